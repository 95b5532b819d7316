//! The words of Thorlabs' PM100D, PM400, PM100USB and their like: SCPI, ended by LF. Source: the
//! maker's operation manual (PM100D, chapter on SCPI) and the programs of pymeasure and
//! `ThorlabsPM100`.

use std::time::Duration;

use super::language::{Asked, Language, Wrong};
use super::lines::{Reading, reading};
use super::script::{Expects, Step, ask, no_error, tell};
use crate::rig::{Measures, PowerMeter};

/// The node of what it measures.
const fn node(meter: &PowerMeter) -> &'static str {
    match meter.measures {
        Measures::Current => "CURR",
        Measures::Power => "POW",
    }
}

impl Language for PowerMeter {
    fn kind(&self) -> &'static str {
        "thorlabs power meter"
    }

    fn end(&self) -> &'static str {
        "\n"
    }

    fn unit(&self) -> &'static str {
        self.measures.unit()
    }

    fn hello(&self) -> Vec<Step> {
        let mut steps = vec![ask("*IDN?", Expects::Fact), ask("SYST:SENS:IDN?", Expects::Fact)];
        if self.measures == Measures::Power {
            steps.push(ask("SENS:POW:UNIT?", Expects::Fact));
        }
        steps
    }

    fn recognise(&self, answers: &[String]) -> Result<String, Wrong> {
        let text = |n: usize| answers.get(n).map_or("", String::as_str);
        let (name, head, unit) = (text(0), text(1), text(2));
        if !name.to_ascii_uppercase().contains("THORLABS") {
            return Err(Wrong {
                what: format!("it calls itself \"{name}\""),
                expected: "a power meter of Thorlabs".to_owned(),
                help: "correct driver or port of [photometer], or the baud rate".to_owned(),
            });
        }
        if self.measures == Measures::Power && !unit.trim().eq_ignore_ascii_case("W") {
            return Err(Wrong {
                what: format!("it reads power in {unit}"),
                expected: "W".to_owned(),
                help: "set its unit to W (SENS:POW:UNIT W)".to_owned(),
            });
        }
        Ok(format!("{name}, head {head}"))
    }

    fn check_range(&self, _full_scale: f64) -> Result<(), Wrong> {
        // Its ranges are its head's; that one was taken is read back.
        Ok(())
    }

    fn set_up(&self) -> Vec<Step> {
        let node = node(self);
        let mut steps = vec![tell("*CLS"), tell(format!("CONF:{node}"))];
        if let Some(wavelength_nm) = self.wavelength_nm {
            steps.push(tell(format!("SENS:CORR:WAV {wavelength_nm}")));
        }
        steps.push(tell(format!("SENS:AVER:COUN {}", self.average)));
        steps.push(tell(format!("SENS:{node}:RANG:AUTO 0")));
        steps.push(no_error());
        steps
    }

    fn zero(&self) -> Vec<Step> {
        if !self.zero {
            return Vec::new();
        }
        vec![
            tell("SENS:CORR:COLL:ZERO:INIT"),
            ask("SENS:CORR:COLL:ZERO:STAT?", Expects::Until("0|+0")).within(Duration::from_mins(1)),
            no_error(),
        ]
    }

    fn range(&self, _place: usize, full_scale: f64) -> Vec<Step> {
        let node = node(self);
        vec![
            tell(format!("SENS:{node}:RANG:UPP {full_scale:e}")),
            ask(format!("SENS:{node}:RANG:UPP?"), Expects::About(full_scale)),
        ]
    }

    fn expose(&self, readings: u32) -> Vec<Asked> {
        let one =
            || Asked { steps: vec![ask("READ?", Expects::Values)], readings: 1, reply_bytes: 20 };
        (0..readings).map(|_| one()).collect()
    }

    fn read(&self, answer: &str) -> Option<(Vec<Reading>, Option<f64>)> {
        Some((vec![reading(answer, self.unit())?], None))
    }
}
