//! Twins around one board, each at the end of its own serial line: bytes reach a twin when they
//! have passed at the baud rate, and its words come out when they have.
//!
//! Everything happens at its exact microsecond and in one order, whichever line it came by and
//! however late the caller is. It reads no clock and does no I/O: [`crate::serve_bench`] does.

use std::collections::VecDeque;

use firmware_protocol::Instant;

use crate::wire::Wire;
use crate::{SimulatedBoard, Twin};

/// A board and the devices that share it. Lines are numbered in the order of [`Bench::plug`].
pub struct Bench {
    board: SimulatedBoard,
    lines: Vec<Line>,
    /// Everything up to here has happened.
    clock: Instant,
}

struct Line {
    twin: Box<dyn Twin>,
    wire: Wire,
    /// Bytes on their way to the device, with the moment at which each has passed.
    inward: VecDeque<(Instant, u8)>,
    inward_free: Instant,
    /// What is on its way out, with the moment at which the last byte has passed.
    outward: VecDeque<(Instant, Vec<u8>)>,
    outward_free: Instant,
}

/// What happens next on a bench.
#[derive(Debug, Clone, Copy)]
enum Due {
    /// A byte arrives on this line.
    Byte(usize),
    /// This line's twin wakes.
    Timeout(usize),
}

impl Bench {
    /// A bench with nothing on it but the board.
    pub const fn new(board: SimulatedBoard) -> Self {
        Self { board, lines: Vec::new(), clock: Instant::ZERO }
    }

    /// Puts a device on a line of its own; the line's number.
    pub fn plug(&mut self, twin: impl Twin + 'static, wire: Wire) -> usize {
        self.lines.push(Line {
            twin: Box::new(twin),
            wire,
            inward: VecDeque::new(),
            inward_free: self.clock,
            outward: VecDeque::new(),
            outward_free: self.clock,
        });
        self.lines.len() - 1
    }

    /// How many lines there are.
    pub fn lines(&self) -> usize {
        self.lines.len()
    }

    /// The board under the twins.
    pub const fn board(&self) -> &SimulatedBoard {
        &self.board
    }

    /// The same, to put devices around it.
    pub const fn board_mut(&mut self) -> &mut SimulatedBoard {
        &mut self.board
    }

    /// A host puts bytes on a line at `now`.
    pub fn send(&mut self, now: Instant, line: usize, bytes: &[u8]) {
        let Some(line) = self.lines.get_mut(line) else { return };
        let from = line.inward_free.max(now);
        for (i, byte) in bytes.iter().enumerate() {
            line.inward_free = line.wire.passed(from, i + 1);
            let carried = line.wire.carry(&[*byte]);
            line.inward.extend(carried.into_iter().map(|byte| (line.inward_free, byte)));
        }
    }

    /// When a line takes more bytes from its host.
    pub fn inward_free(&self, line: usize) -> Instant {
        self.lines.get(line).map_or(Instant::ZERO, |line| line.inward_free)
    }

    /// Lets everything happen that is due by `now`, in order, each at its own moment.
    pub fn advance(&mut self, now: Instant) {
        while let Some((at, due)) = self.next_due().filter(|(at, _)| *at <= now) {
            // A twin that asks for a moment that has passed is woken now, and time goes on.
            self.clock = self.clock.max(at);
            self.happen(due);
        }
        self.clock = self.clock.max(now);
        for i in 0..self.lines.len() {
            self.transmit(i);
        }
    }

    fn happen(&mut self, due: Due) {
        let now = self.clock;
        for line in &mut self.lines {
            line.twin.follow(&mut self.board, now);
        }
        let (Due::Byte(i) | Due::Timeout(i)) = due;
        let Some(line) = self.lines.get_mut(i) else { return };
        match due {
            Due::Byte(_) => {
                if let Some((_, byte)) = line.inward.pop_front() {
                    line.twin.handle_bytes(&mut self.board, now, &[byte]);
                }
            }
            Due::Timeout(_) => line.twin.handle_timeout(&mut self.board, now),
        }
        self.transmit(i);
    }

    fn transmit(&mut self, line: usize) {
        let now = self.clock;
        let Some(line) = self.lines.get_mut(line) else { return };
        let bytes = line.twin.poll_transmit();
        if !bytes.is_empty() {
            line.outward_free = line.wire.passed(line.outward_free.max(now), bytes.len());
            let carried = line.wire.carry(&bytes);
            line.outward.push_back((line.outward_free, carried));
        }
    }

    /// What a line's host hears by `now`; call [`Bench::advance`] first.
    pub fn receive(&mut self, now: Instant, line: usize) -> Option<Vec<u8>> {
        let outward = &mut self.lines.get_mut(line)?.outward;
        outward.pop_front_if(|(at, _)| *at <= now).map(|(_, bytes)| bytes)
    }

    /// When to call [`Bench::advance`] and [`Bench::receive`] again.
    pub fn next(&self) -> Option<Instant> {
        let out = self.lines.iter().filter_map(|line| line.outward.front().map(|(at, _)| *at));
        out.chain(self.next_due().map(|(at, _)| at)).min()
    }

    fn next_due(&self) -> Option<(Instant, Due)> {
        let lines = self.lines.iter().enumerate();
        let events = lines.flat_map(|(i, line)| {
            let byte = line.inward.front().map(|(at, _)| (*at, Due::Byte(i)));
            let wake = line.twin.poll_timeout(&self.board).map(|at| (at, Due::Timeout(i)));
            [wake, byte].into_iter().flatten()
        });
        // The first of equals: the order of the lines, time-outs before bytes.
        events.min_by_key(|(at, _)| *at)
    }
}

impl core::fmt::Debug for Bench {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let lines = self.lines.len();
        f.debug_struct("Bench")
            .field("clock", &self.clock)
            .field("lines", &lines)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
pub(crate) mod tests;
