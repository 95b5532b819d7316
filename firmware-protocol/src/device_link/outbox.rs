//! Events on their way to the host, in the order in which they happened. A start is said once;
//! a result is repeated until it is acknowledged.

use core::time::Duration;

use heapless::Deque;

use crate::{CommandId, Event, Instant};

/// Results that are kept for repetition. The host remembers more than these, so that it never
/// takes an old result for a new one, nor the other way round.
pub(super) const RESULTS: usize = 16;
const STARTS: usize = 16;
const PLACES: usize = RESULTS + STARTS;

/// After this a result is said again; then after twice as long, and so on.
const REPEAT_FIRST: Duration = Duration::from_millis(50);
const REPEAT_LAST: Duration = Duration::from_millis(800);
/// A host that was silent for so long has gone, or rests: nothing is repeated to it until it is
/// heard again.
const PATIENCE: Duration = Duration::from_secs(30);

#[derive(Debug, Clone)]
struct Letter {
    seq: u8,
    event: Event,
    due: bool,
    /// Said (a start) or acknowledged (a result): only holds its place in the order.
    is_over: bool,
    repeat_at: Instant,
    interval: Duration,
}

impl Letter {
    fn is_open_result(&self) -> bool {
        !self.is_over && self.event.is_result()
    }
}

/// The events of one session.
#[derive(Debug, Clone, Default)]
pub(super) struct Outbox {
    letters: Deque<Letter, PLACES>,
    /// A window on its way: before the letters, since it happened before the results behind it.
    window: Option<(u8, Event)>,
    next_seq: u8,
}

impl Outbox {
    /// Whether any event finds a place.
    pub(super) fn has_room(&self) -> bool {
        self.window.is_none() && self.has_room_for_result()
    }

    fn has_room_for_result(&self) -> bool {
        self.count(true) < RESULTS
    }

    /// Takes an event to say. A result or a window without a place is given back; a start without
    /// one is dropped.
    pub(super) fn push(&mut self, event: Event) -> Result<(), Event> {
        if matches!(event, Event::Window(_)) {
            if self.window.is_some() {
                return Err(event);
            }
            self.window = Some((self.next_seq, event));
            self.next_seq = self.next_seq.wrapping_add(1);
            return Ok(());
        }
        let is_result = event.is_result();
        if is_result && !self.has_room_for_result() {
            return Err(event);
        }
        let has_place = is_result || self.count(false) < STARTS;
        let letter = Letter {
            seq: self.next_seq,
            event,
            due: true,
            is_over: false,
            repeat_at: Instant::ZERO,
            interval: REPEAT_FIRST,
        };
        self.next_seq = self.next_seq.wrapping_add(1);
        if has_place {
            let _ = self.letters.push_back(letter);
        }
        Ok(())
    }

    /// The host has the result of this command.
    pub(super) fn acknowledge(&mut self, id: CommandId) {
        for letter in &mut self.letters {
            letter.is_over |= letter.is_open_result() && letter.event.command() == id;
        }
        self.sweep();
    }

    /// The next event to send. It counts as sent.
    pub(super) fn pop_due(&mut self, now: Instant) -> Option<(u8, Event)> {
        if let Some(window) = self.window.take() {
            return Some(window);
        }
        let letter = self.letters.iter_mut().find(|letter| letter.due && !letter.is_over)?;
        letter.due = false;
        letter.is_over = !letter.event.is_result();
        letter.repeat_at = now + letter.interval;
        letter.interval = REPEAT_LAST.min(letter.interval * 2);
        let said = (letter.seq, letter.event.clone());
        self.sweep();
        Some(said)
    }

    /// When something is to be said again, to a host that was heard at this moment.
    pub(super) fn next_repeat(&self, heard: Instant) -> Option<Instant> {
        let waiting = self.letters.iter().filter(|letter| letter.is_open_result() && !letter.due);
        let next = waiting.map(|letter| letter.repeat_at).min()?;
        (next < heard + PATIENCE).then_some(next)
    }

    /// What was not acknowledged in time is due again.
    pub(super) fn handle_timeout(&mut self, now: Instant, heard: Instant) {
        if self.next_repeat(heard).is_none() {
            return;
        }
        for letter in &mut self.letters {
            letter.due |= letter.is_open_result() && letter.repeat_at <= now;
        }
    }

    fn count(&self, is_result: bool) -> usize {
        self.letters.iter().filter(|letter| letter.event.is_result() == is_result).count()
    }

    fn sweep(&mut self) {
        while self.letters.front().is_some_and(|letter| letter.is_over) {
            self.letters.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cause, Tick};

    const fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1000)
    }

    fn failed(id: u32) -> Event {
        Event::Failed(CommandId(id), Cause::Stopped, Tick(0))
    }

    #[test]
    fn a_result_is_repeated_ever_more_slowly_until_acknowledged() {
        let mut outbox = Outbox::default();
        outbox.push(failed(1)).unwrap();
        let mut said = [0; 6];
        for moment in &mut said {
            let now = outbox.next_repeat(at(0)).unwrap_or(at(0));
            outbox.handle_timeout(now, at(0));
            assert_eq!(outbox.pop_due(now), Some((0, failed(1))));
            assert_eq!(outbox.pop_due(now), None);
            *moment = now.micros() / 1000;
        }
        assert_eq!(said, [0, 50, 150, 350, 750, 1550]);
        outbox.acknowledge(CommandId(1));
        assert_eq!(outbox.next_repeat(at(0)), None);
        assert!(outbox.letters.is_empty());
    }

    #[test]
    fn a_silent_host_is_left_alone_until_it_is_heard() {
        let mut outbox = Outbox::default();
        outbox.push(failed(1)).unwrap();
        let mut now = at(0);
        let mut said = 0;
        while outbox.pop_due(now).is_some() {
            said += 1;
            let Some(next) = outbox.next_repeat(at(0)) else { break };
            now = next;
            outbox.handle_timeout(now, at(0));
        }
        assert!((30..60).contains(&said), "said {said} times");
        assert!(outbox.next_repeat(at(60_000)).is_some());
    }

    #[test]
    fn starts_are_said_once_in_order_and_leave_room_for_results() {
        let mut outbox = Outbox::default();
        for id in 0..100 {
            outbox.push(Event::Started(CommandId(id), Tick(0))).unwrap();
        }
        for id in 0..16 {
            outbox.push(failed(id)).unwrap();
        }
        assert_eq!(outbox.push(failed(16)), Err(failed(16)));
        for id in 0..16 {
            assert_eq!(
                outbox.pop_due(at(0)).map(|(_, event)| event.command()),
                Some(CommandId(id))
            );
        }
        assert_eq!(outbox.pop_due(at(0)).map(|(_, event)| event), Some(failed(0)));
    }
}
