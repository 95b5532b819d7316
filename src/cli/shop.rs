//! What the daemon leaves to the command line: what a client sent becomes a run on the daemon's
//! own rig, and a run's readings become the files of its folder.

use std::path::Path;

use spanned_toml::{Document, Source};

use super::acquire::Pace;
use super::adapting;
use super::failure::Failure;
use super::folder::{JOURNAL, create};
use super::inputs::Bundle;
use super::report::RunRecord;
use super::results::{Results, open_run, targets_planned};
use super::resume::{self, what_is_left};
use super::run::job_of;
use super::session::utc_now;
use super::setup::{Setup, Stage};
use super::stopping;
use super::text::with_uncertainty;
use crate::daemon::{Checked, Finished, Prepared, Refusal, Workshop};
use crate::journal::{EffectWishes, Input, InputRole, Journal, JournalError, Writer};
use crate::rig::Rig;
use crate::run::OnFault;
use crate::run::resume::rule_met;

/// The daemon's rig, and on a simulated one what stands on it.
#[derive(Debug)]
pub(crate) struct Shop {
    pub(crate) rig: Rig,
    /// `None` for a real rig.
    pub(crate) stage: Option<Stage>,
    /// The rig's file, the scene's, and what that names, byte for byte.
    pub(crate) inputs: Vec<Input>,
    pub(crate) seed: u64,
    /// On which terms the rig's effects were chosen.
    pub(crate) wishes: EffectWishes,
}

impl Shop {
    /// The client's plan on our rig, under our scene.
    fn set_up(&self, bundle: &[u8]) -> Result<(Setup, Vec<String>), Refusal> {
        let bundle: Bundle = serde_json::from_slice(bundle).map_err(|error| {
            Refusal::new(format!("not a plan with its files: {error}"))
                .expecting("{\"files\": [{\"role\": \"plan\", \"name\": ..., \"text\": ...}, ...]}")
        })?;
        let name = bundle.name.clone();
        let sent = bundle.unpack().map_err(Refusal::new)?;
        let mut notes = Vec::new();
        for input in &sent {
            match input.role {
                InputRole::Rig => notes.extend(self.compare_rig(input)?),
                InputRole::Scene => self.compare_scene(input)?,
                InputRole::Attachment => self.compare_attachment(input)?,
                InputRole::Plan => {}
            }
        }
        let theirs =
            sent.into_iter().filter(|i| matches!(i.role, InputRole::Plan | InputRole::Attachment));
        let inputs = self.inputs.iter().cloned().chain(theirs).collect();
        let setup = Setup::from_inputs(inputs, name, self.seed, self.wishes.clone())
            .map_err(|failure| Refusal::new(failure.text()))?;
        Ok((setup, notes))
    }

    fn ours(&self, role: InputRole) -> Option<&Input> {
        self.inputs.iter().find(|input| input.role == role)
    }

    /// Another rig is refused; the same one is run as the daemon's own file has it.
    fn compare_rig(&self, sent: &Input) -> Result<Option<String>, Refusal> {
        let text = String::from_utf8_lossy(&sent.bytes);
        let rig = Document::parse(Source::new(&sent.name, &text))
            .and_then(Rig::read)
            .map_err(|problem| Refusal::new(problem.to_string()))?;
        if rig.name != self.rig.name {
            return Err(Refusal::new(format!("the plan is for another rig: \"{}\"", rig.name))
                .expecting(format!("this daemon's, \"{}\"", self.rig.name))
                .with_help("name this rig in the plan, or submit it to that rig's daemon"));
        }
        let is_ours = self.ours(InputRole::Rig).is_some_and(|ours| ours.bytes == sent.bytes);
        Ok((!is_ours).then(|| format!("{}: the daemon's own rig file is used instead", sent.name)))
    }

    fn compare_scene(&self, sent: &Input) -> Result<(), Refusal> {
        match self.ours(InputRole::Scene) {
            // A real rig measures what stands on it.
            None => Ok(()),
            Some(ours) if ours.bytes == sent.bytes => Ok(()),
            Some(ours) => {
                Err(Refusal::new(format!("{}: another scene than the daemon's", sent.name))
                    .expecting(format!("the contents of the daemon's {}", ours.name))
                    .with_help("start the daemon with this --scene, or leave the plan's out"))
            }
        }
    }

    /// A run that is carried on must find the rig and the scene that it was begun with; only the
    /// port may be another one.
    fn compare_run(&self, begun: &Setup) -> Result<(), Refusal> {
        let refuse = |what: &str, help: &str| {
            let error = format!("the run was begun with another {what} than the daemon's");
            Err(Refusal::new(error).with_help(help))
        };
        let (ours, its) = (&self.rig, &begun.rig);
        let is_ours = (&its.name, &its.axes, &its.detector, its.is_simulated())
            == (&ours.name, &ours.axes, &ours.detector, ours.is_simulated());
        if !is_ours {
            return refuse("rig", "start the daemon with the rig.toml in the run's folder");
        }
        if self.stage.is_none() {
            return Ok(());
        }
        if begun.seed != self.seed {
            return refuse("seed", &format!("start the daemon with --seed {}", begun.seed));
        }
        let scene = begun.inputs.iter().find(|input| input.role == InputRole::Scene);
        let is_ours = scene.map(|scene| &scene.bytes)
            == self.ours(InputRole::Scene).map(|scene| &scene.bytes);
        if !is_ours {
            return refuse("scene", "start the daemon with the scene.toml in the run's folder");
        }
        Ok(())
    }

    /// Files go by their names: ours must not be taken for theirs.
    fn compare_attachment(&self, sent: &Input) -> Result<(), Refusal> {
        let differs = |ours: &&Input| {
            ours.role == sent.role && ours.name == sent.name && ours.bytes != sent.bytes
        };
        match self.inputs.iter().find(differs) {
            None => Ok(()),
            Some(ours) => Err(Refusal::new(format!(
                "{}: the daemon's scene has a file of this name with other contents",
                ours.name
            ))
            .with_help("rename yours, or start the daemon with this scene")),
        }
    }
}

impl Workshop for Shop {
    fn rig(&self) -> &Rig {
        &self.rig
    }

    fn utc_now(&self) -> String {
        utc_now()
    }

    fn check(&self, bundle: &[u8]) -> Result<Checked, Refusal> {
        let (setup, mut notes) = self.set_up(bundle)?;
        let prediction = &setup.sequence.prediction;
        let limit = setup.plan.stop.rig_time_max.filter(|_| setup.plan.adaptive().is_some());
        if let Some(limit) = limit {
            let most_s = limit.as_secs_f64();
            notes.push(format!(
                "targets and readings are those of its first round; further ones follow from what it \
                 reads, within {most_s:.0} s"
            ));
        }
        Ok(Checked {
            name: setup.plan_name.clone(),
            targets: prediction.targets,
            readings: prediction.readings,
            predicted_s: limit.map_or(prediction.total_s(), |limit| limit.as_secs_f64()),
            notes,
        })
    }

    fn prepare(&self, bundle: &[u8], folder: &Path) -> Result<Prepared, Refusal> {
        let refuse = |failure: Failure| Refusal::new(failure.text());
        let path = folder.join(JOURNAL);
        let (journal, job) = match Journal::open(&path) {
            Err(JournalError::Missing { .. } | JournalError::Empty { .. }) => {
                let (setup, _) = self.set_up(bundle)?;
                // A daemon that was killed while it made the folder had measured nothing.
                let _ = std::fs::remove_dir_all(folder);
                let (journal, _) = create(folder, &setup).map_err(refuse)?;
                (journal, job_of(&setup, &path, OnFault::Wait, Pace::Real).map_err(refuse)?)
            }
            Err(error) => return Err(Refusal::new(error.to_string())),
            Ok(journal) => {
                let (setup, left) = what_is_left(&path).map_err(refuse)?;
                self.compare_run(&setup)?;
                // A reference that has moved is a fault; to say continue once more accepts it.
                let job = resume::job(&setup, &path, &left, false, (OnFault::Wait, Pace::Real));
                let job = job.map_err(refuse)?;
                match job {
                    None => return Ok(Prepared::Measured),
                    Some(job) => (journal, job),
                }
            }
        };
        let journal = Writer::threaded(journal).map_err(|error| Refusal::new(error.to_string()))?;
        Ok(Prepared::ToMeasure { job: Box::new(job), journal: Box::new(journal) })
    }

    fn finish(&self, folder: &Path) -> Result<Finished, Refusal> {
        self.evaluate(folder).map_err(|failure| Refusal::new(failure.text()))
    }
}

impl Shop {
    fn evaluate(&self, folder: &Path) -> Result<Finished, Failure> {
        let (setup, _, reader) = open_run(folder)?;
        let (results, readings) = Results::of_run(&setup, &reader, false)?;
        let record = RunRecord::of(&reader, readings)?;
        results.write(folder, &setup, &record)?;
        let (measured, planned) = (results.tally.measured, targets_planned(&setup));
        let fit = match &results.fitted {
            Ok(fitted) => {
                let exitance = fitted.fit.exitance();
                let [_, unit, _] = self.rig.detector.quantity.units();
                format!("exitance {}", with_uncertainty(exitance.value, exitance.u, unit))
            }
            Err(error) => format!("no fit: {error}"),
        };
        let rule = rule_met(&record.sessions);
        let missed = stopping::missed(&setup, &results).or_else(|| adapting::missed(&setup));
        let mut summary = format!("{measured} of {planned} targets measured; {fit}");
        if let Some(rule) = &rule {
            summary = format!("stopped by the plan's rule: {rule}; {summary}");
        }
        if let Some(missed) = &missed {
            summary = format!("{summary}; {missed}");
        }
        let is_complete = (measured == planned || rule.is_some()) && missed.is_none();
        Ok(Finished { is_complete, summary })
    }
}
