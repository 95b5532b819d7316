//! What a device has to say: the beginnings of commands, said once, and their results, kept
//! until the host acknowledges them. It knows no frame and no time-out.

use heapless::{Deque, Vec};

use super::RESULTS_MAX;
use crate::{CommandId, Event, Tick};

/// Each command that runs or has a result speaks at most twice.
const UNSAID_MAX: usize = 2 * RESULTS_MAX;

#[derive(Default)]
pub(super) struct Results {
    kept: Vec<Kept, RESULTS_MAX>,
    unsaid: Deque<Unsaid, UNSAID_MAX>,
}

struct Kept {
    id: CommandId,
    event: Event,
    was_said: bool,
}

enum Unsaid {
    Started(CommandId, Tick),
    Result(CommandId),
}

impl Results {
    /// Results that wait for their acknowledgement.
    pub(super) fn len(&self) -> usize {
        self.kept.len()
    }

    pub(super) fn started(&mut self, id: CommandId, tick: Tick) {
        let pushed = self.unsaid.push_back(Unsaid::Started(id, tick));
        debug_assert!(pushed.is_ok(), "room was reserved at acceptance");
    }

    pub(super) fn keep(&mut self, id: CommandId, event: Event) {
        let kept = self.kept.push(Kept { id, event, was_said: false });
        let pushed = self.unsaid.push_back(Unsaid::Result(id));
        debug_assert!(kept.is_ok() && pushed.is_ok(), "room was reserved at acceptance");
    }

    /// The next thing to say, in the order in which things happened.
    pub(super) fn poll(&mut self) -> Option<Event> {
        match self.unsaid.pop_front()? {
            Unsaid::Started(id, tick) => Some(Event::Started(id, tick)),
            Unsaid::Result(id) => {
                let kept = self.kept.iter_mut().find(|kept| kept.id == id)?;
                kept.was_said = true;
                Some(kept.event.clone())
            }
        }
    }

    /// What was said and not yet acknowledged, oldest first.
    pub(super) fn pending(&self) -> impl Iterator<Item = &Event> {
        self.kept.iter().filter(|kept| kept.was_said).map(|kept| &kept.event)
    }

    /// Forgets a result that the host has, and says whether there was one. One that was never
    /// said stays: nobody can have it.
    pub(super) fn acknowledge(&mut self, id: CommandId) -> bool {
        let before = self.kept.len();
        self.kept.retain(|kept| kept.id != id || !kept.was_said);
        self.kept.len() < before
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}
