//! Character counting: lines go out only while all that grbl has not answered fits into its
//! receive buffer. What is sent beyond that is lost without a word.

use std::collections::VecDeque;

/// What a line is for; handed back with its answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Waits until all motion queued before it is over.
    Barrier,
    /// `$I` or `$$`
    Ask,
    Home,
    Move,
    Shutter,
    Unlock,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Stream {
    capacity: usize,
    waiting: VecDeque<(String, Purpose)>,
    /// Lengths of what was sent and not answered, with what it was for.
    in_flight: VecDeque<(usize, Purpose)>,
}

impl Stream {
    /// For a receive buffer of so many bytes.
    pub(super) const fn new(capacity: usize) -> Self {
        Self { capacity, waiting: VecDeque::new(), in_flight: VecDeque::new() }
    }

    /// Queues a line, without its end.
    pub(super) fn push(&mut self, line: &str, purpose: Purpose) {
        self.waiting.push_back((format!("{line}\n"), purpose));
    }

    /// The next line, once there is room for it.
    pub(super) fn poll(&mut self) -> Option<Vec<u8>> {
        let length = self.waiting.front()?.0.len();
        if self.unanswered() + length > self.capacity {
            return None;
        }
        let (line, purpose) = self.waiting.pop_front()?;
        self.in_flight.push_back((length, purpose));
        Some(line.into_bytes())
    }

    /// The oldest line was answered: what it was for. `None`: nothing was asked.
    pub(super) fn answered(&mut self) -> Option<Purpose> {
        self.in_flight.pop_front().map(|(_, purpose)| purpose)
    }

    /// A reset has emptied grbl's buffer, and nothing of ours is to follow.
    pub(super) fn clear(&mut self) {
        self.waiting.clear();
        self.in_flight.clear();
    }

    /// Bytes that may stand in grbl's buffer.
    pub(super) fn unanswered(&self) -> usize {
        self.in_flight.iter().map(|(length, _)| length).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_hundred_lines_at_once_never_overrun_the_buffer() {
        let mut stream = Stream::new(128);
        for n in 0..300 {
            stream.push(&format!("G21G53G0X{n}.0000Y-{n}.0000Z0.0000"), Purpose::Move);
        }
        // A device that answers the oldest line now and then.
        let (mut sent, mut most, mut answered) = (0, 0, 0);
        while answered < 300 {
            while let Some(line) = stream.poll() {
                assert!(line.ends_with(b"\n"));
                sent += 1;
                most = most.max(stream.unanswered());
                assert!(stream.unanswered() <= 128);
            }
            assert_eq!(stream.answered(), Some(Purpose::Move));
            answered += 1;
        }
        assert_eq!(sent, 300);
        assert!(most > 96, "the buffer is used: {most}");
        assert_eq!((stream.answered(), stream.poll()), (None, None));
    }

    #[test]
    fn a_line_longer_than_the_buffer_is_never_sent() {
        let mut stream = Stream::new(16);
        stream.push("G4P0", Purpose::Barrier);
        stream.push(&"X".repeat(16), Purpose::Move);
        assert!(stream.poll().is_some());
        assert_eq!(stream.poll(), None);
        stream.answered();
        assert_eq!(stream.poll(), None);
    }
}
