//! A whole run on a simulated rig in virtual time: one of the many that a rehearsal, a frontier or a study
//! is made of. From the wire to the journal it is what `gonio run` is; it does not know what becomes of its
//! readings, nor who hears Ctrl-C.

use std::path::Path;

use super::acquire::{Acquired, Company, Pace, acquire};
use super::failure::Failure;
use super::folder::{JOURNAL, create_within};
use super::run::{job_of, why_not_whole};
use super::setup::Setup;
use crate::journal::{EffectWishes, Input, InputRole, Order};
use crate::rig::Reading;
use crate::run::OnFault;
use crate::study::coverage::Attachment;

/// What a run to its end came to.
pub(crate) struct VirtualRun {
    /// With what its rounds added to it, where readings decide what is measured.
    pub(crate) setup: Setup,
    /// As they were taken.
    pub(crate) readings: Vec<Reading>,
    /// From the first command to the last, homing included.
    pub(crate) rig_s: f64,
}

/// What a run is made of, where it was drawn or computed and is in no files.
#[derive(Clone, Copy)]
pub(crate) struct Texts<'a> {
    pub(crate) plan: &'a str,
    pub(crate) rig: &'a str,
    pub(crate) scene: &'a str,
    /// Files that they name.
    pub(crate) attachments: &'a [Attachment],
}

impl Texts<'_> {
    /// Puts them together, as files are.
    pub(crate) fn setup(self, seed: u64) -> Result<Setup, Failure> {
        let input = |role, name: &str, bytes: &[u8]| Input {
            role,
            name: name.to_owned(),
            bytes: bytes.to_vec(),
        };
        let mut inputs = vec![
            input(InputRole::Plan, "plan.toml", self.plan.as_bytes()),
            input(InputRole::Rig, "rig.toml", self.rig.as_bytes()),
            input(InputRole::Scene, "scene.toml", self.scene.as_bytes()),
        ];
        let attached = self.attachments.iter();
        inputs.extend(attached.map(|a| input(InputRole::Attachment, &a.name, &a.bytes)));
        Setup::from_inputs(inputs, None, seed, EffectWishes::default())
    }
}

impl VirtualRun {
    /// Makes the run; its journal stays in `folder`, which must not be there yet. The folder around it
    /// must be.
    pub(crate) fn kept(setup: Setup, folder: &Path) -> Result<Self, Failure> {
        let acquired = acquire(&setup, Pace::Virtual, Company::AmongOthers, || {
            let (journal, _) = create_within(folder, &setup)?;
            Ok((journal, job_of(&setup, &folder.join(JOURNAL), OnFault::Finish, Pace::Virtual)?))
        })?;
        let Acquired { outcome, rig_s, journal } = acquired;
        let journal = journal.map_err(Failure::midway)?;
        if !outcome.is_as_planned() {
            // A part of a plan says nothing about the plan.
            return Err(Failure::midway(why_not_whole(&outcome)));
        }
        let readings = journal.reader().readings(Order::Taken)?;
        let setup = setup.with_rounds(journal.reader())?;
        journal.close().map_err(Failure::midway)?;
        Ok(Self { setup, readings, rig_s })
    }

    /// The same, without its folder in the end: thousands of journals would fill a disk.
    pub(crate) fn passing(setup: Setup, folder: &Path) -> Result<Self, Failure> {
        let run = Self::kept(setup, folder)?;
        let _ = std::fs::remove_dir_all(folder);
        Ok(run)
    }

    /// When the first reading began.
    pub(crate) fn first_s(&self) -> f64 {
        self.readings.iter().map(|reading| reading.time_s).fold(f64::INFINITY, f64::min)
    }
}
