//! A run's folder: made anew, never overwritten, and taken away again if the run could not begin.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::failure::Failure;
use super::results::write_inputs;
use super::session::{utc_now, utc_stamp};
use super::setup::Setup;
use super::text::shell_word;
use crate::journal::{Header, Journal};

/// The file that all else can be made from.
pub(crate) const JOURNAL: &str = "run.sqlite";

/// The folder where the command line names none: runs/NAME-UTC.
pub(crate) fn default_folder(name: &str) -> PathBuf {
    Path::new("runs").join(format!("{name}-{}", utc_stamp()))
}

/// The effects that a run's simulated rig is compiled to, one line each.
pub(crate) fn effects(setup: &Setup) -> Vec<String> {
    let rows = setup.stage.iter().flat_map(|stage| stage.compiled.effects());
    let included = rows.filter(|row| row.included);
    included
        .map(|row| format!("{}: {}", row.name, row.cause.as_deref().unwrap_or("nothing")))
        .collect()
}

/// What is known of a run when it begins.
pub(crate) fn header(setup: &Setup) -> Header {
    Header {
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: setup.seed,
        simulated: setup.rig.is_simulated(),
        rig_name: setup.rig.name.clone(),
        plan_name: setup.plan_name.clone(),
        plan_hash: setup.plan_hash.to_string(),
        started_utc: utc_now(),
        effects: effects(setup),
        effect_wishes: setup.wishes.clone(),
    }
}

/// Makes the folder with the copies of its inputs and the journal, from which the run can be
/// carried on as soon as this returns. Where that fails nothing is left behind.
pub(crate) fn create(folder: &Path, setup: &Setup) -> Result<(Journal, Header), Failure> {
    if let Some(parent) = folder.parent() {
        std::fs::create_dir_all(parent).map_err(|error| no_folder(parent, &error))?;
    }
    create_within(folder, setup)
}

/// The same in a folder that is there: one that was taken away meanwhile, since all of it shall end, is
/// not made again.
pub(crate) fn create_within(folder: &Path, setup: &Setup) -> Result<(Journal, Header), Failure> {
    std::fs::create_dir(folder).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => exists_already(folder),
        _ => no_folder(folder, &error),
    })?;
    fill(folder, setup).inspect_err(|_| {
        // Made a moment ago, by us; what is in it is of no use.
        let _ = std::fs::remove_dir_all(folder);
    })
}

/// The refusal of a folder that is there.
pub(crate) fn exists_already(folder: &Path) -> Failure {
    let line = format!("gonio resume {}", shell_word(folder));
    Failure::with_help(
        format!("{}: exists already; a run is never overwritten", folder.display()),
        format!("choose another folder with --out, or carry the run on with `{line}`"),
    )
}

/// Refuses a folder that is there already, for what is no run.
pub(crate) fn refuse_existing(folder: &Path) -> Result<(), Failure> {
    if !folder.exists() {
        return Ok(());
    }
    Err(Failure::with_help(
        format!("{}: exists already; nothing is overwritten", folder.display()),
        "choose another folder with --out",
    ))
}

fn no_folder(folder: &Path, error: &std::io::Error) -> Failure {
    Failure::with_help(
        format!("{}: the folder cannot be made: {error}", folder.display()),
        "choose another one with --out",
    )
}

fn fill(folder: &Path, setup: &Setup) -> Result<(Journal, Header), Failure> {
    write_inputs(folder, setup).map_err(Failure::start)?;
    let header = header(setup);
    let journal =
        Journal::create(&folder.join(JOURNAL), &header, &setup.inputs, &setup.sequence.steps)?;
    Ok((journal, header))
}
