//! `gonio run` and `gonio resume`: acquire, journal, fit, export.

use std::path::Path;
use std::time::Instant;

use super::acquire::{Acquired, Company, Pace, acquire, exit_code};
use super::adapting;
use super::args::RunArgs;
use super::failure::{Failure, Outcome};
use super::folder::{JOURNAL, create, default_folder, exists_already};
use super::outlook::refusal;
use super::output::{note, say, say_json};
use super::report::RunRecord;
use super::results::{Results, targets_planned};
use super::setup::Setup;
use super::stopping;
use super::summary::Summary;
use super::text::shell_word;
use crate::plan::{DarkMethod, Plan};
use crate::run::{self, Job, OnFault};

/// How the person wants the end of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ending {
    pub(crate) is_strict: bool,
    pub(crate) is_json: bool,
    /// Whether a run of any length is read in blocks.
    pub(crate) in_blocks: bool,
}

/// The main job.
pub(crate) fn run(args: &RunArgs) -> Outcome {
    let began = Instant::now();
    let setup = Setup::from_disk(&args.plan, &args.rig, &args.effects)?;
    let folder = args.out.clone().unwrap_or_else(|| default_folder(&setup.plan_name));
    if folder.exists() {
        return Err(exists_already(&folder));
    }
    if let Some(warning) = refusal(&setup) {
        note(&warning);
    }
    let pace = Pace::of(&setup, args.realtime);
    let acquired = acquire(&setup, pace, Company::Alone, || {
        let (journal, _) = create(&folder, &setup)?;
        Ok((journal, job_of(&setup, &folder.join(JOURNAL), OnFault::Finish, pace)?))
    })?;
    let ending = Ending { is_strict: args.strict, is_json: args.json, in_blocks: args.in_blocks };
    finish(&folder, &setup, acquired, began, ending)
}

/// The whole run, whose journal may have readings already.
pub(crate) fn job_of(
    setup: &Setup,
    journal: &Path,
    on_fault: OnFault,
    pace: Pace,
) -> Result<Job, Failure> {
    let mut job = Job::new(setup.sequence.steps.clone(), on_fault);
    job.warm_up = setup.plan.warm_up.map(|gate| (gate, setup.sequence.warm_up(0), 0));
    job.rig_time_max = setup.plan.stop.rig_time_max;
    job.rule = stopping::rule(setup, journal, pace)?;
    job.decider = adapting::decider(setup, journal, pace)?;
    Ok(job)
}

/// Evaluates the journal, writes the folder's files, and prints the summary.
pub(crate) fn finish(
    folder: &Path,
    setup: &Setup,
    acquired: Acquired,
    began: Instant,
    ending: Ending,
) -> Outcome {
    let Acquired { outcome, rig_s, journal } = acquired;
    let journal = journal
        .map_err(|error| Failure::midway(format!("{error}\n  help: {}", resume_line(folder))))?;
    let is_as_planned = outcome.is_as_planned();
    let setup = setup.clone().with_rounds(journal.reader())?;
    let setup = &adapting::concluded(setup, journal.reader())?;
    let reader = journal.reader();
    let (results, readings) = match Results::of_run(setup, reader, ending.in_blocks) {
        // Too little was measured to say anything.
        Err(_) if !is_as_planned => return Err(interrupted(folder, &outcome)),
        results => results?,
    };
    results.write(folder, setup, &RunRecord::of(reader, readings)?)?;
    let closed = journal.close();
    let summary = Summary {
        folder,
        setup,
        results: &results,
        outcome: &outcome,
        rig_s,
        wall_s: began.elapsed().as_secs_f64(),
    };
    if ending.is_json {
        say_json(&summary.json())?;
    } else {
        say(&summary.text())?;
    }
    closed.map_err(Failure::midway)?;
    if !is_as_planned {
        return Err(interrupted(folder, &outcome));
    }
    if let Some(missed) = stopping::missed(setup, &results).or_else(|| adapting::missed(setup)) {
        return Err(Failure::midway(missed));
    }
    let n_excluded = results.fitted.as_ref().map_or(usize::MAX, |fitted| fitted.n_excluded);
    let is_measured =
        outcome != run::Outcome::Complete || results.tally.measured == targets_planned(setup);
    let is_whole = is_measured && n_excluded == 0;
    Ok(exit_code(is_whole && !(ending.is_strict && results.n_flagged() > 0)))
}

fn interrupted(folder: &Path, outcome: &run::Outcome) -> Failure {
    Failure::midway(format!("{}\n  help: {}", why_not_whole(outcome), resume_line(folder)))
}

/// Why a run did not come to its end.
pub(crate) fn why_not_whole(outcome: &run::Outcome) -> String {
    match outcome {
        run::Outcome::Faulted(fault) => format!("the run stopped: {fault}"),
        other => format!("the run is not complete: {}", other.name()),
    }
}

/// What carries the run on.
fn resume_line(folder: &Path) -> String {
    format!("carry it on with `gonio resume {}`", shell_word(folder))
}

/// A plan that a simulated rig can't follow.
pub(crate) fn check_simulated(plan: &Plan) -> Result<(), Failure> {
    if plan.dark.method == DarkMethod::Shutter {
        return Ok(());
    }
    Err(Failure::from(plan.document().root().problem(
        "dark",
        "source-off asks a person to switch the source, and a simulated rig has none",
        "method = \"shutter\" on a simulated rig",
        "use the shutter",
    )))
}
