//! A meter that this program does not know by name: its words, and how to read its answers, as the
//! rig file lists them.

use super::language::{Asked, Language, Wrong};
use super::lines::{Reading, reading};
use super::script::{Expects, Step, ask, no_error, tell};
use crate::rig::ScpiTable;

/// Words that set something, and whether they were understood.
fn checked(table: &ScpiTable, words: impl IntoIterator<Item = String>) -> Vec<Step> {
    let mut steps: Vec<Step> = words.into_iter().map(tell).collect();
    if table.has_error_queue && !steps.is_empty() {
        steps.push(no_error());
    }
    steps
}

impl Language for ScpiTable {
    fn kind(&self) -> &'static str {
        "scpi meter"
    }

    fn end(&self) -> &'static str {
        if self.ends_with_cr { "\r" } else { "\n" }
    }

    fn unit(&self) -> &'static str {
        self.measures.unit()
    }

    fn hello(&self) -> Vec<Step> {
        vec![ask("*IDN?", Expects::Fact)]
    }

    fn recognise(&self, answers: &[String]) -> Result<String, Wrong> {
        let name = answers.first().map_or("", String::as_str);
        if name.to_ascii_uppercase().contains(&self.identity.to_ascii_uppercase()) {
            return Ok(name.to_owned());
        }
        Err(Wrong {
            what: format!("it calls itself \"{name}\""),
            expected: format!("a name with \"{}\" in it", self.identity),
            help: "correct identity or port of [photometer], or the baud rate".to_owned(),
        })
    }

    fn check_range(&self, _full_scale: f64) -> Result<(), Wrong> {
        Ok(())
    }

    fn set_up(&self) -> Vec<Step> {
        checked(self, self.set_up.iter().cloned())
    }

    fn zero(&self) -> Vec<Step> {
        checked(self, self.zero.iter().cloned())
    }

    fn range(&self, _place: usize, full_scale: f64) -> Vec<Step> {
        let text = self.range.replace("{}", &format!("{full_scale:e}"));
        checked(self, (!text.is_empty()).then_some(text))
    }

    fn expose(&self, readings: u32) -> Vec<Asked> {
        let one = || Asked {
            steps: vec![ask(self.read.clone(), Expects::Values)],
            readings: 1,
            reply_bytes: 256,
        };
        (0..readings).map(|_| one()).collect()
    }

    fn read(&self, answer: &str) -> Option<(Vec<Reading>, Option<f64>)> {
        let element = answer.split(',').nth(self.element)?;
        Some((vec![reading(element, self.unit())?], None))
    }
}
