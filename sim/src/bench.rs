//! Twins around one board, each at the end of its own serial line: bytes reach a twin when they
//! have passed at the baud rate, and its words come out when they have.
//!
//! Everything happens at its exact microsecond and in one order, whichever line it came by and
//! however late the caller is. It reads no clock and does no I/O: [`crate::serve_bench`] does.

use core::time::Duration;
use std::collections::VecDeque;

use firmware_protocol::Instant;

use crate::faults::{Faults, Turn};
use crate::wire::Wire;
use crate::{DeviceFault, FaultKind, SimulatedBoard, Twin};

/// A board and the devices that share it. Lines are numbered in the order of [`Bench::plug`].
pub struct Bench {
    board: SimulatedBoard,
    lines: Vec<Line>,
    /// Everything up to here has happened.
    clock: Instant,
    /// Where the axes were sent last, and since when they are there.
    setpoints: [i64; 4],
    /// No earlier than the last fault.
    at_rest_since: Instant,
    /// Since the last fault began, nobody was told that the axes stand.
    awaits_rest: bool,
    notes: Vec<Note>,
}

/// Something that a person who looks at the bench would notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Note {
    /// A fault of this line's device began.
    Began(Instant, usize, FaultKind),
    /// It is over.
    Ended(Instant, usize, FaultKind),
    /// The axes stand since then, the first time since a fault began.
    AtRest(Instant),
}

/// Axes that have not moved for so long stand.
const STANDS_AFTER: Duration = Duration::from_millis(500);

struct Line {
    twin: Box<dyn Twin>,
    wire: Wire,
    /// Bytes on their way to the device, with the moment at which each has passed.
    inward: VecDeque<(Instant, u8)>,
    inward_free: Instant,
    /// What is on its way out, with the moment at which the last byte has passed.
    outward: VecDeque<(Instant, Vec<u8>)>,
    outward_free: Instant,
    faults: Faults,
}

/// What happens next on a bench.
#[derive(Debug, Clone, Copy)]
enum Due {
    /// A byte arrives on this line.
    Byte(usize),
    /// A fault of this line begins or ends.
    Fault(usize),
    /// Somebody looks whether the axes stand.
    Look,
    /// This line's twin wakes.
    Timeout(usize),
}

impl Bench {
    /// A bench with nothing on it but the board.
    pub const fn new(board: SimulatedBoard) -> Self {
        Self {
            board,
            lines: Vec::new(),
            clock: Instant::ZERO,
            setpoints: [0; 4],
            at_rest_since: Instant::ZERO,
            awaits_rest: false,
            notes: Vec::new(),
        }
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
            faults: Faults::default(),
        });
        self.lines.len() - 1
    }

    /// Something is to go wrong with a line's device.
    pub fn plan_fault(&mut self, line: usize, fault: DeviceFault) {
        if let Some(line) = self.lines.get_mut(line) {
            line.faults.add(fault);
        }
    }

    /// Whether a line's plug is in.
    pub fn is_plugged(&self, line: usize) -> bool {
        self.lines.get(line).is_none_or(|line| !line.faults.has(FaultKind::Unplugged))
    }

    /// What there was to be noticed since this was last asked.
    pub fn take_notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
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
        self.look_whether_axes_move(now);
        let (Due::Byte(i) | Due::Fault(i) | Due::Timeout(i)) = due else { return };
        let Some(line) = self.lines.get_mut(i) else { return };
        match due {
            Due::Byte(_) => {
                if let Some((_, byte)) = line.inward.pop_front()
                    && line.faults.hears()
                {
                    line.twin.handle_bytes(&mut self.board, now, &[byte]);
                }
            }
            Due::Fault(_) => match line.faults.turn(now) {
                Some(Turn::Began(kind)) => {
                    line.twin.fail(&mut self.board, now, kind);
                    (self.awaits_rest, self.at_rest_since) = (true, now);
                    self.notes.push(Note::Began(now, i, kind));
                }
                Some(Turn::Ended(kind)) => self.notes.push(Note::Ended(now, i, kind)),
                None => {}
            },
            Due::Timeout(_) => line.twin.handle_timeout(&mut self.board, now),
            Due::Look => {}
        }
        line.faults.notice(now, line.twin.deeds());
        self.transmit(i);
    }

    /// Twins wake when a motion of theirs ends: what changed since the last look moved until now.
    fn look_whether_axes_move(&mut self, now: Instant) {
        let setpoints = self.board.setpoints();
        if setpoints != self.setpoints {
            self.setpoints = setpoints;
            self.at_rest_since = now;
        } else if self.awaits_rest && now.since(self.at_rest_since) >= STANDS_AFTER {
            self.awaits_rest = false;
            self.notes.push(Note::AtRest(self.at_rest_since));
        }
    }

    fn transmit(&mut self, line: usize) {
        let now = self.clock;
        let Some(line) = self.lines.get_mut(line) else { return };
        let bytes = line.faults.passes(line.twin.poll_transmit());
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
            let fault = line.faults.next().map(|at| (at, Due::Fault(i)));
            [wake, byte, fault].into_iter().flatten()
        });
        let look = self.awaits_rest.then(|| (self.at_rest_since + STANDS_AFTER, Due::Look));
        // The first of equals: the order of the lines, time-outs before bytes.
        events.chain(look).min_by_key(|(at, _)| *at)
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
