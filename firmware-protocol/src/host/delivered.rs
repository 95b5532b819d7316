//! Which events were already handed on. The device repeats a result until it is acknowledged,
//! and a wire may double anything; the user hears of each once.

use heapless::Deque;

use crate::{CommandId, Event};

/// How many results are remembered: four times what a device keeps, so that anything older than
/// all of them is old news.
const MEMORY: usize = 64;

/// The memory of one session.
#[derive(Debug, Clone, Default)]
pub(super) struct Delivered {
    results: Deque<CommandId, MEMORY>,
    started: Option<CommandId>,
}

impl Delivered {
    /// Whether the event is news; it counts as handed on from now.
    pub(super) fn is_news(&mut self, event: &Event) -> bool {
        let id = event.command();
        // Which windows it has is the user's to know.
        if matches!(event, Event::Window(_)) {
            return true;
        }
        if self.has_result(id) {
            return false;
        }
        if event.is_result() {
            if self.results.is_full() {
                self.results.pop_front();
            }
            return self.results.push_back(id).is_ok();
        }
        // Commands start in the order of their numbers.
        let news = self.started.is_none_or(|last| last < id);
        if news {
            self.started = Some(id);
        }
        news
    }

    fn has_result(&self, id: CommandId) -> bool {
        let older = self.results.is_full() && self.results.iter().all(|known| id < *known);
        older || self.results.iter().any(|known| *known == id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cause, Tick};

    fn failed(id: u32) -> Event {
        Event::Failed(CommandId(id), Cause::Stopped, Tick(0))
    }

    #[test]
    fn a_result_is_news_once_and_an_older_one_still_is() {
        let mut delivered = Delivered::default();
        assert!(delivered.is_news(&failed(6)));
        assert!(delivered.is_news(&failed(5)));
        assert!(!delivered.is_news(&failed(6)));
        assert!(!delivered.is_news(&failed(5)));
    }

    #[test]
    fn what_is_older_than_the_memory_is_no_news() {
        let mut delivered = Delivered::default();
        for id in 1..=100 {
            assert!(delivered.is_news(&failed(id)));
        }
        assert!(!delivered.is_news(&failed(1)));
        assert!(delivered.is_news(&failed(101)));
    }

    #[test]
    fn a_start_is_no_news_after_its_result() {
        let mut delivered = Delivered::default();
        let started = Event::Started(CommandId(7), Tick(0));
        assert!(delivered.is_news(&started));
        assert!(!delivered.is_news(&started));
        assert!(delivered.is_news(&failed(8)));
        assert!(!delivered.is_news(&Event::Started(CommandId(8), Tick(0))));
    }
}
