//! The last replies of a session: a request that comes again is answered again, and executed
//! no second time.

use heapless::Deque;

use crate::{Reply, WINDOW};

/// One request that was taken, and its reply once there is one.
#[derive(Debug, Clone)]
struct Answer {
    seq: u8,
    reply: Option<Reply>,
    due: bool,
}

/// Where a sequence number stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// The next one: to be executed.
    Next,
    /// One of the last: to be answered again.
    Repeat,
    /// Something before it is missing.
    Ahead,
    /// None that the host could still wait for.
    Elsewhere,
}

/// As many replies as a host can wait for.
#[derive(Debug, Clone, Default)]
pub(super) struct Replies {
    answers: Deque<Answer, WINDOW>,
    expected: u8,
}

impl Replies {
    /// The sequence number that is executed next.
    pub(super) fn expected(&self) -> u8 {
        self.expected
    }

    pub(super) fn place(&self, seq: u8) -> Place {
        match usize::from(seq.wrapping_sub(self.expected)) {
            0 => Place::Next,
            ahead if ahead < WINDOW => Place::Ahead,
            _ if usize::from(self.expected.wrapping_sub(seq)) <= WINDOW => Place::Repeat,
            _ => Place::Elsewhere,
        }
    }

    /// Whether the request that is executed next was numbered shortly before this number.
    pub(super) fn is_before(&self, seq: u8) -> bool {
        (1..=WINDOW).contains(&usize::from(seq.wrapping_sub(self.expected)))
    }

    /// Takes the next request. Who sends it has heard the answer to the one [`WINDOW`] before.
    pub(super) fn take_next(&mut self) {
        if self.answers.is_full() {
            self.answers.pop_front();
        }
        let answer = Answer { seq: self.expected, reply: None, due: false };
        if self.answers.push_back(answer).is_ok() {
            self.expected = self.expected.wrapping_add(1);
        }
    }

    /// The reply to a request that was taken.
    pub(super) fn answer(&mut self, seq: u8, reply: Reply) {
        if let Some(answer) = self.answers.iter_mut().find(|answer| answer.seq == seq) {
            answer.reply = Some(reply);
            answer.due = true;
        }
    }

    /// Says the reply again, if there is one by now.
    pub(super) fn repeat(&mut self, seq: u8) {
        if let Some(answer) = self.answers.iter_mut().find(|answer| answer.seq == seq) {
            answer.due = answer.reply.is_some();
        }
    }

    /// The next reply to send. It counts as sent.
    pub(super) fn pop_due(&mut self) -> Option<(u8, &Reply)> {
        let answer = self.answers.iter_mut().find(|answer| answer.due)?;
        answer.due = false;
        Some((answer.seq, answer.reply.as_ref()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequence_numbers_wrap() {
        let mut replies = Replies::default();
        for _ in 0..254 {
            replies.take_next();
        }
        assert_eq!(replies.place(254), Place::Next);
        assert_eq!(replies.place(1), Place::Ahead);
        assert_eq!(replies.place(2), Place::Elsewhere);
        assert_eq!(replies.place(250), Place::Repeat);
        assert_eq!(replies.place(249), Place::Elsewhere);
        replies.take_next();
        replies.take_next();
        assert_eq!(replies.expected(), 0);
        assert_eq!(replies.place(255), Place::Repeat);
    }

    #[test]
    fn a_reply_is_sent_once_and_again_when_asked() {
        let mut replies = Replies::default();
        replies.take_next();
        assert_eq!(replies.pop_due(), None);
        replies.repeat(0);
        assert_eq!(replies.pop_due(), None);
        replies.answer(0, Reply::Alive);
        assert_eq!(replies.pop_due(), Some((0, &Reply::Alive)));
        assert_eq!(replies.pop_due(), None);
        replies.repeat(0);
        assert_eq!(replies.pop_due(), Some((0, &Reply::Alive)));
    }
}
