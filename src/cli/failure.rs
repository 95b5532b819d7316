//! How a command ends badly: an exit code and a text for the person. 1: ran, but something is
//! missing; 2: could not start, and left everything as it was.

use std::fmt::Display;
use std::io::Write as _;
use std::process::ExitCode;

/// Why a command did not end well.
#[derive(Debug)]
pub(crate) struct Failure {
    code: u8,
    text: String,
}

/// What every command answers: 0 or 1 where it ran, an error where it could not.
pub(crate) type Outcome = Result<ExitCode, Failure>;

impl Failure {
    /// Could not start: bad input, no port, no permission.
    pub(crate) fn start(why: impl Display) -> Self {
        Self { code: 2, text: why.to_string() }
    }

    /// Could not start: what is wrong with which thing, and what to do.
    pub(crate) fn with_help(what: impl Display, help: impl Display) -> Self {
        Self::start(format!("{what}\n  help: {help}"))
    }

    /// Ran, but did not reach its end.
    pub(crate) fn midway(why: impl Display) -> Self {
        Self { code: 1, text: why.to_string() }
    }

    /// What a person is told.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Says so on standard error.
    pub(crate) fn report(&self) -> ExitCode {
        let is_marked = self.text.starts_with("error");
        let mark = if is_marked { "" } else { "error: " };
        // Where standard error is closed the exit code must say it alone.
        let _ = writeln!(std::io::stderr(), "{mark}{}", self.text);
        ExitCode::from(self.code)
    }
}

impl From<spanned_toml::Problem> for Failure {
    fn from(problem: spanned_toml::Problem) -> Self {
        Self::start(problem)
    }
}

impl From<crate::journal::JournalError> for Failure {
    fn from(error: crate::journal::JournalError) -> Self {
        Self::start(error)
    }
}
