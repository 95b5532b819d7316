//! `gonio resume`: carries an interrupted run on, from its journal alone, each target exactly
//! once.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use super::acquire::{Pace, acquire};
use super::args::ResumeArgs;
use super::failure::{Failure, Outcome};
use super::folder::JOURNAL;
use super::output::note;
use super::run::{Ending, finish, first_job};
use super::setup::Setup;
use crate::journal::{Journal, Order, Reader};
use crate::run::resume::{Remainder, check, remainder};
use crate::run::{Job, OnFault};

/// Carries an interrupted run on.
pub(crate) fn resume(args: &ResumeArgs) -> Outcome {
    let began = Instant::now();
    let journal = args.dir.join(JOURNAL);
    let (setup, left) = what_is_left(&journal)?;
    let Some(job) = job(&setup, &journal, &left, args.accept_drift, OnFault::Finish)? else {
        note(&format!("{}: complete; nothing is left to measure", args.dir.display()));
        return Ok(ExitCode::SUCCESS);
    };
    let pace = Pace::of(&setup, args.realtime);
    let acquired = acquire(&setup, pace, || Ok((Journal::open(&journal)?, job)))?;
    let ending = Ending { is_strict: args.strict, is_json: args.json };
    finish(&args.dir, &setup, acquired, began, ending)
}

/// The run as its journal has it, and what of it is left.
pub(crate) fn what_is_left(journal: &Path) -> Result<(Setup, Remainder), Failure> {
    let reader = Reader::open(journal)?;
    let header = reader.header()?;
    let setup = Setup::from_inputs(reader.inputs()?, Some(header.plan_name), header.seed)?;
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
    let left = remainder(&reader.steps()?, &reader.readings(Order::Taken)?, &reader.sessions()?);
    Ok((setup, left))
}

/// The job that measures what is left, after a look at the reference pose; `None` if nothing is.
pub(crate) fn job(
    setup: &Setup,
    journal: &Path,
    left: &Remainder,
    accepts_drift: bool,
    on_fault: OnFault,
) -> Result<Option<Job>, Failure> {
    if left.steps.is_empty() {
        return Ok(None);
    }
    let before = Reader::open(journal)?.readings(Order::Taken)?;
    let rig = Arc::new(setup.rig.clone());
    let mut job = first_job(setup, on_fault);
    job.check = Some(check(rig, &setup.sequence, left, before, accepts_drift));
    job.warm_up = job.warm_up.map(|(gate, step, _)| (gate, step, left.warm_ups));
    job.steps.clone_from(&left.steps);
    job.done_before = left.done;
    job.session = left.session;
    job.session_began_s = left.began_s;
    Ok(Some(job))
}
