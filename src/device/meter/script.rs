//! What is said to a meter, word for word, and what each word must be answered with.

use std::time::Duration;

use firmware_protocol::Instant;

/// A word to a meter and the answer that it expects.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    /// Without the end of the line.
    pub(super) text: String,
    pub(super) expects: Expects,
    /// How long the answer may take.
    pub(super) patience: Duration,
    /// Until when, where it has been asked before.
    pub(super) until: Option<Instant>,
}

/// What a word is answered with.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Expects {
    /// The upper end of a range near this one.
    About(f64),
    /// Anything: who it is.
    Fact,
    /// Nothing: meters do not answer what sets them.
    Nothing,
    /// This number.
    Number(f64),
    /// The word again and again until it is answered so: something is at work.
    Until(&'static str),
    /// Readings.
    Values,
    /// A line that begins so.
    Word(&'static str),
}

/// Answers to short questions come within this.
const PATIENCE: Duration = Duration::from_millis(1500);

/// Sets something.
pub(super) fn tell(text: impl Into<String>) -> Step {
    Step { text: text.into(), expects: Expects::Nothing, patience: Duration::ZERO, until: None }
}

/// Asks something.
pub(super) fn ask(text: impl Into<String>, expects: Expects) -> Step {
    Step { text: text.into(), expects, patience: PATIENCE, until: None }
}

impl Step {
    /// The same, with more patience.
    pub(super) fn within(self, longer: Duration) -> Self {
        Self { patience: self.patience + longer, ..self }
    }
}

/// What SCPI's error queue says when it is empty.
pub(super) fn no_error() -> Step {
    ask("SYST:ERR?", Expects::Word("0,|+0,"))
}

/// Whether an answer begins with one of the words that a bar divides.
pub(super) fn begins(answer: &str, words: &str) -> bool {
    words.split('|').any(|word| answer.trim().starts_with(word))
}

/// How near a number is that is read back: instruments round, and some add their overrange.
pub(super) fn is_about(found: f64, expected: f64) -> bool {
    found.is_finite() && (0.99..=1.11).contains(&(found / expected))
}
