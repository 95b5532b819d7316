//! What must be known of a make of meter to drive it: its words and how to read its answers.

use std::fmt;

use super::lines::Reading;
use super::script::Step;

/// Why a meter is not the one that is expected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Wrong {
    pub(super) what: String,
    pub(super) expected: String,
    pub(super) help: String,
}

/// A question for readings.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Asked {
    pub(super) steps: Vec<Step>,
    /// How many readings answer it: another number is the answer of a meter that has forgotten
    /// how it was set.
    pub(super) readings: u32,
    /// How long the answer is at most.
    pub(super) reply_bytes: usize,
}

/// A make of meter.
pub(super) trait Language: fmt::Debug + Send {
    /// As messages call it.
    fn kind(&self) -> &'static str;
    /// What ends a line that is said to it.
    fn end(&self) -> &'static str {
        "\r"
    }
    /// Its unit as it writes it behind a number, "A" or "W".
    fn unit(&self) -> &'static str {
        "A"
    }
    /// Who are you, and how are you set? Changes nothing.
    fn hello(&self) -> Vec<Step>;
    /// What the answers to that say: its name, or what is wrong with it.
    fn recognise(&self, answers: &[String]) -> Result<String, Wrong>;
    /// Whether it can have such a range.
    fn check_range(&self, full_scale: f64) -> Result<(), Wrong>;
    /// Sets what stays.
    fn set_up(&self) -> Vec<Step>;
    /// Takes its own offset off; none where it has no such thing.
    fn zero(&self) -> Vec<Step>;
    /// Sets the range that stands at this place of the rig file's list.
    fn range(&self, place: usize, full_scale: f64) -> Vec<Step>;
    /// Reads so often.
    fn expose(&self, readings: u32) -> Vec<Asked>;
    /// The readings in an answer, and the meter's own time of the last, seconds. `None` where it
    /// holds anything else.
    fn read(&self, answer: &str) -> Option<(Vec<Reading>, Option<f64>)>;
}
