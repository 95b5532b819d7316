//! What a board with grbl says to somebody who only wants to know whether it is one.

use super::codec::{Lines, Message, Position, State};
use super::settings::Board;

/// What was learnt about a board.
#[derive(Debug, Clone, PartialEq)]
pub struct Greeting {
    /// As it calls its version: "1.1h"; `None` where it moved, and was not asked.
    pub version: Option<String>,
    /// Its state: "Idle", "Alarm", "Run", ...
    pub state: String,
    /// How many axes it reports.
    pub axes: usize,
    /// Their positions, in its own unit.
    pub position: Vec<f64>,
}

/// Listens for one.
#[derive(Debug, Default)]
pub(crate) struct Listener {
    lines: Lines,
    board: Board,
    state: Option<State>,
    position: Vec<f64>,
}

impl Listener {
    /// Takes a byte; `Some` once a report was heard.
    pub(crate) fn take(&mut self, byte: u8) -> Option<()> {
        if let Message::Status(report) = self.lines.take(byte)? {
            let (Position::Machine(position) | Position::Work(position)) = report.position;
            self.position = position;
            self.state = Some(report.state);
            return Some(());
        }
        None
    }

    /// Takes a byte; `Some` once the build was heard.
    pub(crate) fn take_build(&mut self, byte: u8) -> Option<()> {
        if let Message::Feedback(feedback) = self.lines.take(byte)? {
            self.board.note(&feedback);
        }
        self.board.version.as_ref().map(|_| ())
    }

    /// Whether nothing moves, so that it may be asked for its build.
    pub(crate) fn is_at_rest(&self) -> bool {
        matches!(self.state, Some(State::Idle | State::Alarm))
    }

    /// What was heard.
    pub(crate) fn greeting(&self) -> Greeting {
        Greeting {
            version: self.board.version.clone(),
            state: self.state.map_or_else(String::new, State::name),
            axes: self.position.len(),
            position: self.position.clone(),
        }
    }
}
