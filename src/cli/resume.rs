//! `gonio resume`: carries an interrupted run on, from its journal alone, each target exactly
//! once.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::acquire::{Acquired, Company, Pace, acquire};
use super::args::ResumeArgs;
use super::failure::{Failure, Outcome};
use super::folder::{JOURNAL, effects};
use super::output::note;
use super::run::{Ending, finish, job_of};
use super::setup::Setup;
use crate::journal::{Journal, Order, Reader};
use crate::run::resume::{Remainder, check, remainder};
use crate::run::{self, Job, OnFault};

/// Carries an interrupted run on.
pub(crate) fn resume(args: &ResumeArgs) -> Outcome {
    let began = Instant::now();
    let journal = args.dir.join(JOURNAL);
    let (setup, left) = what_is_left(&journal)?;
    let pace = Pace::of(&setup, args.realtime);
    let job = job(&setup, &journal, &left, args.accept_drift, (OnFault::Finish, pace))?;
    let acquired = match job {
        Some(job) => acquire(&setup, pace, Company::Alone, || Ok((Journal::open(&journal)?, job)))?,
        None => nothing_left(&args.dir, Journal::open(&journal)?, &left),
    };
    let ending = Ending { is_strict: args.strict, is_json: args.json, in_blocks: args.in_blocks };
    finish(&args.dir, &setup, acquired, began, ending)
}

/// A run that has all that it was to have, though perhaps not its results.
fn nothing_left(folder: &Path, journal: Journal, left: &Remainder) -> Acquired {
    let (why, outcome) = match &left.rule {
        None => ("complete".to_owned(), run::Outcome::Complete),
        Some(rule) => {
            (format!("ended by its plan's rule: {rule}"), run::Outcome::Reached(rule.clone()))
        }
    };
    note(&format!("{}: {why}; nothing is left to measure", folder.display()));
    Acquired { outcome, rig_s: left.began_s, journal: Ok(journal) }
}

/// The run as its journal has it, and what of it is left.
pub(crate) fn what_is_left(journal: &Path) -> Result<(Setup, Remainder), Failure> {
    let reader = Reader::open(journal)?;
    let header = reader.header()?;
    let setup = Setup::from_inputs(
        reader.inputs()?,
        Some(header.plan_name),
        header.seed,
        header.effect_wishes,
    )?;
    let hash = setup.plan_hash.to_string();
    if hash != header.plan_hash {
        return Err(Failure::with_help(
            format!(
                "{}: its plan now means other readings ({hash}) than when it began ({})",
                journal.display(),
                header.plan_hash
            ),
            "use the version of gonio that began it",
        ));
    }
    if effects(&setup) != header.effects {
        return Err(Failure::with_help(
            format!(
                "{}: its scene now compiles to other effects than when it began",
                journal.display()
            ),
            "use the version of gonio that began it",
        ));
    }
    let mut setup = setup.with_rounds(&reader)?;
    let left = remainder(&reader.steps()?, &reader.readings(Order::Taken)?, &reader.sessions()?);
    // A meter knows no names of readings: what it reads in another session has other noise.
    if let Some(stage) = &mut setup.stage {
        stage.boot = stage.boot.saturating_add(left.session);
    }
    Ok((setup, left))
}

/// The job that measures what is left, after a look at the reference pose; `None` if nothing is.
pub(crate) fn job(
    setup: &Setup,
    journal: &Path,
    left: &Remainder,
    accepts_drift: bool,
    (on_fault, pace): (OnFault, Pace),
) -> Result<Option<Job>, Failure> {
    let is_decided = setup.accounts.last().is_some_and(|account| account.verdict.is_some());
    let is_open = setup.plan.adaptive().is_some() && !is_decided;
    if (left.steps.is_empty() && !is_open) || left.rule.is_some() {
        return Ok(None);
    }
    let mut job = job_of(setup, journal, on_fault, pace)?;
    let before = Reader::open(journal)?.readings(Order::Taken)?;
    let rig = Arc::new(setup.rig.clone());
    job.check = Some(check(rig, &setup.sequence, left, before, accepts_drift));
    job.warm_up = job.warm_up.map(|(gate, step, _)| (gate, step, left.warm_ups));
    job.steps.clone_from(&left.steps);
    job.done_before = left.done;
    job.session = left.session;
    job.session_began_s = left.began_s;
    Ok(Some(job))
}
