//! Commands that wait for their turn. It knows the order and the numbers, not what commands do.

use heapless::Deque;

use super::QUEUE_DEPTH;
use crate::{CommandId, Dwell, Home, MoveTo, Sweep};

/// A request that takes time.
#[derive(Debug, Clone)]
pub(super) enum Command {
    Home(Home),
    MoveTo(MoveTo),
    Dwell(Dwell),
    Sweep(Sweep),
}

impl Command {
    pub(super) const fn id(&self) -> CommandId {
        match self {
            Self::Home(home) => home.id,
            Self::MoveTo(move_to) => move_to.id,
            Self::Dwell(dwell) => dwell.id,
            Self::Sweep(sweep) => sweep.id,
        }
    }
}

#[derive(Default)]
pub(super) struct Queue {
    waiting: Deque<Command, QUEUE_DEPTH>,
    last_id: Option<CommandId>,
}

impl Queue {
    /// The last number accepted in this boot.
    pub(super) const fn last_id(&self) -> Option<CommandId> {
        self.last_id
    }

    pub(super) fn len(&self) -> usize {
        self.waiting.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    pub(super) fn is_full(&self) -> bool {
        self.waiting.is_full()
    }

    /// Takes a command for which there is room.
    pub(super) fn push(&mut self, command: Command) {
        self.last_id = Some(command.id());
        let pushed = self.waiting.push_back(command);
        debug_assert!(pushed.is_ok(), "a full queue accepts nothing");
    }

    /// The next one, which stays.
    pub(super) fn front(&self) -> Option<&Command> {
        self.waiting.front()
    }

    pub(super) fn pop(&mut self) -> Option<Command> {
        self.waiting.pop_front()
    }

    pub(super) fn clear(&mut self) {
        self.waiting.clear();
    }
}
