//! The line that shows how far a run is: on standard error, and only on a terminal.

use std::io::IsTerminal as _;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::acquire::Pace;
use super::output::note;
use super::setup::Setup;
use super::text::duration;
use crate::rig::{Detector, Reading, ReadingKind, Rig};
use crate::run::{Happening, Progress, State};

/// A bar with the time that is left, and below it the pose and the reading.
pub(crate) struct ProgressLine {
    bar: ProgressBar,
    rig: Rig,
    pace: Pace,
    /// Of each gain range, the last dark level, counts: good enough to look at.
    darks: Vec<f64>,
    /// How accurate the result is so far, in words; empty where nobody has said yet.
    accuracy: String,
}

impl ProgressLine {
    /// A line for the setup's steps; where it is not to be shown, or nobody looks, it does nothing.
    pub(crate) fn new(setup: &Setup, pace: Pace, is_shown: bool) -> Self {
        let target = if is_shown && std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr_with_hz(10)
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(setup.sequence.steps.len() as u64), target);
        if let Ok(style) =
            ProgressStyle::with_template("{bar:24} {pos}/{len} {prefix}\n  {wide_msg}")
        {
            bar.set_style(style);
        }
        let darks = vec![0.0; setup.rig.detector.gains.len()];
        Self { bar, rig: setup.rig.clone(), pace, darks, accuracy: String::new() }
    }

    /// A line of its own, above the bar, that stays.
    pub(crate) fn say(&self, text: &str) {
        if self.bar.is_hidden() { note(text) } else { self.bar.println(text) }
    }

    /// Shows what happened, and how far that brought the run.
    pub(crate) fn show(&mut self, happening: &Happening, progress: Progress) {
        match happening {
            Happening::Accuracy(text) => self.accuracy = format!(" · {text}"),
            Happening::Fault(fault) => self.say(&format!("fault: {fault}")),
            Happening::Finished(_) => self.bar.finish_and_clear(),
            Happening::Progress(progress) => self.show_progress(*progress),
            Happening::Reading(reading) => self.show_reading(reading),
            Happening::State(State::Homing) => {
                self.show_progress(progress);
                self.bar.set_message("looking for the home marks");
            }
            Happening::State(state @ (State::Stopping | State::Paused | State::Faulted)) => {
                self.bar.set_message(state.name());
            }
            _ => {}
        }
    }

    fn show_progress(&self, progress: Progress) {
        let Progress { done, total, rig_s, rest_s, rest_most_s } = progress;
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        self.bar.set_prefix(match self.pace {
            _ if rest_most_s.is_some() => {
                let most_s = rest_most_s.unwrap_or(rest_s);
                format!("round {} left, run at most {}", duration(rest_s), duration(most_s))
            }
            Pace::Real => format!("{} left", duration(rest_s)),
            Pace::Virtual => format!("rig {} of {}", duration(rig_s), duration(rig_s + rest_s)),
        });
    }

    fn show_reading(&mut self, reading: &Reading) {
        if reading.kind == ReadingKind::Dark
            && let Some(dark) = self.darks.get_mut(usize::from(reading.gain))
        {
            *dark = reading.mean;
        }
        if self.bar.is_hidden() {
            return;
        }
        let (_, pose) = self.rig.measured(reading);
        self.bar.set_message(format!(
            "θ {:.2}° φ {:.2}° x {:.2} mm y {:.2} mm · {}{}",
            pose.theta_rad.to_degrees(),
            pose.phi_rad.to_degrees(),
            pose.x_m * 1e3,
            pose.y_m * 1e3,
            self.radiance(reading),
            self.accuracy,
        ));
    }

    /// By the last dark level; calibration, after the run, does it properly.
    fn radiance(&self, reading: &Reading) -> String {
        let detector: &Detector = &self.rig.detector;
        if reading.kind == ReadingKind::Dark {
            return "dark".to_owned();
        }
        let dark = self.darks.get(usize::from(reading.gain)).copied().unwrap_or_default();
        let current = (reading.mean - dark) * detector.lsb_a(reading.gain);
        let [unit, ..] = detector.quantity.units();
        format!("{:.4e} {unit}", current / detector.a_per_radiance())
    }
}
