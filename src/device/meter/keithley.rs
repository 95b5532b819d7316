//! The words of Keithley's 6485 and 6487 picoammeters over RS-232: SCPI, one line a word, ended
//! by CR. Source: the maker's reference manual (6485-901-01) and users' programs.

use std::time::Duration;

use super::language::{Asked, Language, Wrong};
use super::lines::{Reading, number, reading};
use super::script::{Expects, Step, ask, no_error, tell};
use crate::rig::Picoammeter;

/// The upper ends of its ranges, amperes.
const RANGES_A: [f64; 8] = [2e-9, 2e-8, 2e-7, 2e-6, 2e-5, 2e-4, 2e-3, 2e-2];
/// A range holds so much more than its name.
const OVERRANGE: f64 = 1.05;
/// One trigger takes so many readings at most.
const READINGS_MAX: u32 = 2500;
/// Elements of each reading: value and time.
const ELEMENTS: usize = 2;

impl Language for Picoammeter {
    fn kind(&self) -> &'static str {
        "keithley picoammeter"
    }

    fn hello(&self) -> Vec<Step> {
        vec![ask("*IDN?", Expects::Fact)]
    }

    fn recognise(&self, answers: &[String]) -> Result<String, Wrong> {
        let name = answers.first().map_or("", String::as_str);
        let upper = name.to_ascii_uppercase();
        if upper.contains("KEITHLEY") && (upper.contains("6485") || upper.contains("6487")) {
            return Ok(name.to_owned());
        }
        Err(Wrong {
            what: format!("it calls itself \"{name}\""),
            expected: "a Keithley 6485 or 6487".to_owned(),
            help: "correct driver or port of [photometer], or the baud rate".to_owned(),
        })
    }

    fn check_range(&self, full_scale: f64) -> Result<(), Wrong> {
        let has = RANGES_A
            .iter()
            .any(|range| full_scale >= range * 0.999 && full_scale <= range * OVERRANGE * 1.001);
        if has {
            return Ok(());
        }
        Err(Wrong {
            what: format!("a range of {full_scale:e} A in the rig file"),
            expected: "2e-9, 2e-8 and so on to 2e-2 A".to_owned(),
            help: "correct full_scale_a of its [[detector.gain]]".to_owned(),
        })
    }

    fn set_up(&self) -> Vec<Step> {
        let mut steps = vec![
            tell("*RST"),
            tell("FORM:ELEM READ,TIME"),
            tell(format!("CURR:NPLC {}", self.nplc)),
            tell("CURR:RANG:AUTO OFF"),
        ];
        if self.average > 1 {
            steps.push(tell("AVER:TCON REP"));
            steps.push(tell(format!("AVER:COUN {}", self.average)));
        }
        steps.push(tell(if self.average > 1 { "AVER ON" } else { "AVER OFF" }));
        steps.push(tell("SYST:ZCH OFF"));
        steps.push(no_error());
        steps
    }

    fn zero(&self) -> Vec<Step> {
        if !self.zero {
            return Vec::new();
        }
        let reading = Duration::from_secs(10);
        vec![
            tell("SYST:ZCH ON"),
            tell("CURR:RANG 2e-9"),
            tell("TRIG:COUN 1"),
            tell("INIT"),
            ask("*OPC?", Expects::Word("1")).within(reading),
            tell("SYST:ZCOR:ACQ"),
            tell("SYST:ZCOR ON"),
            tell("SYST:ZCH OFF"),
            no_error(),
        ]
    }

    fn range(&self, _place: usize, full_scale: f64) -> Vec<Step> {
        let set = tell(format!("CURR:RANG {full_scale:e}"));
        vec![set, ask("CURR:RANG?", Expects::About(full_scale))]
    }

    fn expose(&self, readings: u32) -> Vec<Asked> {
        let mut left = readings;
        let mut asked = Vec::new();
        while left > 0 {
            let count = left.min(READINGS_MAX);
            let steps = vec![tell(format!("TRIG:COUN {count}")), ask("READ?", Expects::Values)];
            asked.push(Asked { steps, readings: count, reply_bytes: count as usize * 30 });
            left -= count;
        }
        asked
    }

    fn read(&self, answer: &str) -> Option<(Vec<Reading>, Option<f64>)> {
        let elements: Vec<&str> = answer.split(',').collect();
        let parts = elements.chunks_exact(ELEMENTS);
        if !parts.remainder().is_empty() {
            return None;
        }
        let readings = parts.clone().map(|part| reading(part.first()?, "A"));
        let time_s = elements.last().and_then(|time| number(time));
        Some((readings.collect::<Option<Vec<_>>>()?, time_s))
    }
}
