//! A meter that speaks what a table says: the simulated instrument behind words that nobody here
//! knows by name.

use firmware_protocol::Instant;

use super::scpi::scientific;
use super::{MeterTwin, OFFSET, full_scale, range_for};
use crate::SimulatedBoard;

/// Its words, each a whole line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScpiWords {
    /// What it calls itself.
    pub identity: String,
    /// Whether its lines end with CR rather than LF.
    pub ends_with_cr: bool,
    /// Set what stays.
    pub set_up: Vec<String>,
    /// Take its own offset off, once the last of them was said.
    pub zero: Vec<String>,
    /// Sets a range: `{}` stands for its full scale.
    pub range: String,
    /// Asks for one reading.
    pub read: String,
    /// The reading's place among the elements of the answer, from 0.
    pub element: usize,
    /// Whether it keeps errors, and says them when it is asked `SYST:ERR?`.
    pub has_error_queue: bool,
}

impl ScpiWords {
    /// The number in a word that sets a range; `None` where it does not.
    fn range_in(&self, line: &str) -> Option<f64> {
        let (before, after) = self.range.split_once("{}")?;
        line.strip_prefix(before)?.strip_suffix(after)?.trim().parse().ok()
    }

    /// An answer with a reading in it. What does not fit is SCPI's word for too much.
    pub(super) fn answer(&self, value: Option<f64>) -> String {
        let others = std::iter::repeat_n("0".to_owned(), self.element);
        others.chain([scientific(value.unwrap_or(9.9e37))]).collect::<Vec<_>>().join(",")
    }
}

impl MeterTwin {
    pub(super) fn obey_as_table(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        words: &ScpiWords,
        line: &str,
    ) {
        let sets = |list: &[String]| list.iter().any(|word| word == line);
        if line == "*IDN?" {
            self.say(&format!("SIMULATED,{},1,0", words.identity));
        } else if line == "SYST:ERR?" && words.has_error_queue {
            self.say_error();
        } else if line == words.read {
            self.integrate(board, now, true);
        } else if sets(&words.zero) {
            if words.zero.last().is_some_and(|last| last == line) {
                self.settings.correction = OFFSET;
                self.settings.zero_correct = true;
            }
        } else if let Some(range) = words.range_in(line) {
            let gain = range_for(board, range);
            if full_scale(board, gain) >= 0.95 * range {
                self.settings.gain = Some(gain);
            } else {
                self.fail("-222,\"Data out of range\"");
            }
        } else if !sets(&words.set_up) && line != words.range {
            self.fail("-113,\"Undefined header\"");
        }
    }
}
