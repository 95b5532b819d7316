//! The words of Newport's 1830-C: a letter and a number, ended by LF; it never says that it did
//! not understand, so that everything is read back. Source: users' programs for it.

use super::language::{Asked, Language, Wrong};
use super::lines::{Reading, reading};
use super::script::{Expects, Step, ask, tell};
use crate::rig::{Filter, Newport1830};

impl Language for Newport1830 {
    fn kind(&self) -> &'static str {
        "newport 1830-c"
    }

    fn end(&self) -> &'static str {
        "\n"
    }

    fn unit(&self) -> &'static str {
        "W"
    }

    fn hello(&self) -> Vec<Step> {
        vec![ask("U?", Expects::Fact), ask("R?", Expects::Fact)]
    }

    fn recognise(&self, answers: &[String]) -> Result<String, Wrong> {
        let text = |n: usize| answers.get(n).map_or("", |answer| answer.trim());
        let digit = |n: usize| text(n).trim_start_matches(['+', 'U', 'R']).parse::<u8>().ok();
        let wrong = |what: String, expected: &str, help: &str| Wrong {
            what,
            expected: expected.to_owned(),
            help: help.to_owned(),
        };
        match (digit(0), digit(1)) {
            (Some(1), Some(0..=8)) => Ok("Newport 1830-C".to_owned()),
            (Some(unit @ 2..=4), Some(0..=8)) => Err(wrong(
                format!("it is set to unit {unit} (dBm, dB or relative)"),
                "unit 1, W",
                "press its unit key until it shows W, or send U1",
            )),
            _ => Err(wrong(
                format!("it answers \"{}\" to U? and \"{}\" to R?", text(0), text(1)),
                "numbers, as a Newport 1830-C answers",
                "correct driver or port of [photometer], or the baud rate",
            )),
        }
    }

    fn check_range(&self, _full_scale: f64) -> Result<(), Wrong> {
        Ok(())
    }

    fn set_up(&self) -> Vec<Step> {
        let filter = match self.filter {
            Filter::Slow => "F1",
            Filter::Medium => "F2",
            Filter::Fast => "F3",
        };
        let mut steps = vec![
            tell("E0"),
            tell("Z0"),
            tell(filter),
            tell(if self.attenuator { "A1" } else { "A0" }),
        ];
        if let Some(wavelength_nm) = self.wavelength_nm {
            steps.push(tell(format!("W{wavelength_nm:04}")));
            steps.push(ask("W?", Expects::Number(f64::from(wavelength_nm))));
        }
        steps
    }

    fn zero(&self) -> Vec<Step> {
        // Its zero takes what it sees off: only in the dark would that be an offset.
        Vec::new()
    }

    fn range(&self, place: usize, _full_scale: f64) -> Vec<Step> {
        let range = self.ranges.get(place).copied().unwrap_or(1);
        vec![tell(format!("R{range}")), ask("R?", Expects::Number(f64::from(range)))]
    }

    fn expose(&self, readings: u32) -> Vec<Asked> {
        let one =
            || Asked { steps: vec![ask("D?", Expects::Values)], readings: 1, reply_bytes: 12 };
        (0..readings).map(|_| one()).collect()
    }

    fn read(&self, answer: &str) -> Option<(Vec<Reading>, Option<f64>)> {
        Some((vec![reading(answer, self.unit())?], None))
    }
}
