//! A board with grbl 1.1, simulated: its words, its buffers and its states, over the mechanics of
//! the simulated board. It is written from grbl's documents and sources, apart from the driver.
//!
//! Like the real one it loses without a word what does not fit into its receive buffer, acts on
//! real-time bytes wherever they stand, says `ok` when a line is parsed, answers nothing but a
//! reset while it homes, and has no watchdog. Its home switches stand at its machine zero, which
//! is known from the board's marks by the rig file's zeros.

mod homing;
mod lines;
mod motion;
mod reports;
#[cfg(test)]
mod tests;
mod words;

use std::collections::VecDeque;

use firmware_protocol::{Board as _, Instant, Shutter};

use crate::{FaultKind, Nominal, SimulatedBoard, Twin};
use homing::Homing;
use motion::{Block, Leg, Limits};

/// What a real board holds.
const RX_BYTES: usize = 128;
const PLANNER_BLOCKS: usize = 15;
const LINE_BYTES_MAX: usize = 80;
/// How long a real board takes for a line, and for a reset.
const PARSE_US: u64 = 1_000;
const BOOT_US: u64 = 50_000;
/// How long it is at saying an alarm (`report.c` waits so long for its buffer).
const ALARM_US: u64 = 500_000;
/// What it goes back from its switches, in its unit.
const PULL_OFF: f64 = 2.0;
/// Beyond the rig's travel, in its unit: room for the pull-off and the run-ups.
const SPARE: f64 = 5.0;

/// One of its axes.
#[derive(Debug, Clone)]
struct Axis {
    channel: u8,
    steps_per_unit: f64,
    /// Machine position of the board's home mark, steps.
    mark: f64,
    limits: Limits,
    travel_units: f64,
    /// From the mark to the farther end of the rig's travel, steps: how far a search goes.
    reach: f64,
}

/// Its states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Locked; with the number of the alarm where only a reset helps.
    Alarm(Option<u8>),
    Check,
    Hold,
    Home,
    Idle,
    Run,
}

/// How numbers are taken.
#[derive(Debug, Clone, Copy, Default)]
struct Modes {
    is_incremental: bool,
    is_inches: bool,
}

/// What is switched on.
#[derive(Debug, Clone, Copy, Default)]
struct Outputs {
    is_flood: bool,
    is_spindle: bool,
}

/// What the line that was read waits for before its `ok`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Waiting {
    /// That motion drains, and then for a while; and then the shutter.
    Drain {
        pause_us: u64,
        shutter: Option<Shutter>,
    },
    Pause {
        until: Instant,
        shutter: Option<Shutter>,
    },
}

/// See the module.
#[derive(Debug)]
pub struct GrblTwin {
    axes: Vec<Axis>,
    state: State,
    /// Machine position at rest, steps.
    position: Vec<f64>,
    /// By how much machine positions are ahead of the board's, steps: unknown before homing.
    origin: Vec<f64>,
    leg: Option<Leg>,
    blocks: VecDeque<Block>,
    /// Where the last line queued will end.
    planned: Vec<f64>,
    received: VecDeque<u8>,
    /// The line that was taken out of the buffer, and whether its end was.
    line: Vec<u8>,
    has_line: bool,
    waiting: Option<Waiting>,
    /// While it says a limit's alarm it forgets resets.
    deaf_until: Instant,
    /// When the next byte can be looked at.
    busy_until: Instant,
    homing: Option<Homing>,
    feed: f64,
    motion: u8,
    modes: Modes,
    outputs: Outputs,
    reports: u32,
    /// Lines that it took for a move.
    moves: u32,
    /// Bytes that found the buffer full.
    lost: u64,
    outgoing: Vec<u8>,
    boots_at: Option<Instant>,
}

impl GrblTwin {
    /// A board that has just been switched on. It moves the axes of `letters`, in its own order
    /// (X, Y, Z, A, B, C): for each its place in the rig (θ, φ, x, y), and the rig's zero from the
    /// machine's in degrees or millimetres. `None` for a letter that moves nothing.
    pub fn new(nominal: &Nominal, axes: &[(usize, f64)]) -> Self {
        let axes: Vec<Axis> =
            axes.iter().map(|(place, zero)| axis(nominal, *place, *zero)).collect();
        let rest = vec![0.0; axes.len()];
        let mut twin = Self {
            axes,
            state: State::Alarm(None),
            position: rest.clone(),
            origin: rest.clone(),
            leg: None,
            blocks: VecDeque::new(),
            planned: rest,
            received: VecDeque::new(),
            line: Vec::new(),
            has_line: false,
            waiting: None,
            deaf_until: Instant::ZERO,
            busy_until: Instant::ZERO,
            homing: None,
            feed: 0.0,
            motion: 0,
            modes: Modes::default(),
            outputs: Outputs::default(),
            reports: 0,
            moves: 0,
            lost: 0,
            outgoing: Vec::new(),
            boots_at: None,
        };
        twin.greet();
        twin
    }

    /// How many bytes found its buffer full so far.
    pub const fn lost_bytes(&self) -> u64 {
        self.lost
    }

    fn say(&mut self, text: &str) {
        self.outgoing.extend_from_slice(text.as_bytes());
        self.outgoing.extend_from_slice(b"\r\n");
    }

    fn greet(&mut self) {
        self.say("");
        self.say("Grbl 1.1h ['$' for help]");
        if matches!(self.state, State::Alarm(_)) {
            self.say("[MSG:'$H'|'$X' to unlock]");
        }
    }

    fn is_moving(&self) -> bool {
        self.leg.is_some() || self.homing.is_some()
    }

    /// Where it is now, machine steps.
    fn here(&self, now: Instant) -> Vec<f64> {
        self.leg.as_ref().map_or_else(|| self.position.clone(), |leg| leg.position(now))
    }

    /// A byte that acts at once; `false` for all others.
    fn act_at_once(&mut self, board: &mut SimulatedBoard, now: Instant, byte: u8) -> bool {
        match byte {
            b'?' => {
                // It looks at nothing else while it homes, nor where only a reset helps.
                if self.homing.is_none() && !matches!(self.state, State::Alarm(Some(_))) {
                    self.report(now);
                }
            }
            b'!' => self.hold(now),
            b'~' => self.go_on(board, now),
            0x18 => self.reset(now),
            // Jogs, which there are none of, and overrides, which change nothing here.
            0x80.. => {}
            _ => return false,
        }
        true
    }

    fn hold(&mut self, now: Instant) {
        if matches!(self.state, State::Run | State::Idle) {
            self.state = State::Hold;
            if let Some(leg) = &mut self.leg {
                leg.brake(now);
            }
        }
    }

    fn go_on(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if self.state != State::Hold || self.leg.as_ref().is_some_and(|leg| leg.ends_at() > now) {
            return;
        }
        self.state = State::Idle;
        self.set_out(board, now);
    }

    /// 0x18: everything is forgotten but the position; a motion that is cut off loses steps.
    fn reset(&mut self, now: Instant) {
        if matches!(self.state, State::Alarm(Some(_))) && now < self.deaf_until {
            return;
        }
        let holds_still =
            self.state == State::Hold && self.leg.as_ref().is_none_or(|leg| leg.ends_at() <= now);
        let was_homing = self.homing.take().is_some();
        if self.leg.is_some() && !holds_still {
            self.alarm(now, 3);
        } else if was_homing {
            self.alarm(now, 6);
        }
        self.position = self.here(now);
        self.leg = None;
        self.blocks.clear();
        self.planned = self.position.clone();
        self.received.clear();
        self.line.clear();
        self.has_line = false;
        self.waiting = None;
        (self.motion, self.modes, self.outputs) = (0, Modes::default(), Outputs::default());
        self.state = match self.state {
            State::Alarm(_) => State::Alarm(None),
            _ => State::Idle,
        };
        self.boots_at = Some(Instant::from_micros(now.micros() + BOOT_US));
    }

    /// Stands still at once, and is locked.
    fn alarm(&mut self, now: Instant, number: u8) {
        self.position = self.here(now);
        self.planned = self.position.clone();
        self.leg = None;
        self.homing = None;
        self.blocks.clear();
        self.waiting = None;
        self.say(&format!("ALARM:{number}"));
        self.deaf_until = Instant::from_micros(now.micros() + ALARM_US);
        // Limits lock it until it is reset.
        self.state = State::Alarm(Some(number).filter(|number| *number <= 2));
        if matches!(number, 1 | 2) {
            self.say("[MSG:Reset to continue]");
        }
    }

    /// Starts the next line of the planner, if it may move.
    fn set_out(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if let Some(leg) = self.leg.take() {
            let unfinished = Block { target: leg.target().to_vec(), lengths_per_s: None };
            self.position = leg.position(now);
            if self.position != unfinished.target {
                self.blocks.push_front(unfinished);
            }
        }
        let limits: Vec<Limits> = self.axes.iter().map(|axis| axis.limits).collect();
        while self.leg.is_none() {
            let Some(block) = self.blocks.pop_front() else {
                self.state = State::Idle;
                return;
            };
            self.leg = Leg::new(&self.position, &block, &limits, now);
            if let Some(leg) = &self.leg {
                for ((axis, origin), to) in self.axes.iter().zip(&self.origin).zip(leg.target()) {
                    board.begin_motion(now, axis.channel, to - origin);
                }
            }
        }
        self.state = State::Run;
    }

    /// Everything that time brings.
    fn live(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if self.boots_at.is_some_and(|at| at <= now) {
            self.boots_at = None;
            board.put_shutter(Shutter::Open);
            self.greet();
        }
        if self.is_moving() && self.homing.is_none() && board.fault(now).is_some() {
            self.alarm(now, 1);
        }
        if let Some(mut homing) = self.homing.take() {
            match homing.go_on(self, board, now) {
                homing::Progress::Done => {
                    self.state = State::Idle;
                    self.say("ok");
                }
                homing::Progress::Missed => {
                    self.alarm(now, 9);
                    self.state = State::Alarm(None);
                    // It starts over by itself.
                    self.boots_at = Some(Instant::from_micros(now.micros() + ALARM_US));
                }
                homing::Progress::Searching => self.homing = Some(homing),
            }
        } else if self.state == State::Run
            && self.leg.as_ref().is_some_and(|leg| leg.ends_at() <= now)
        {
            self.set_out(board, now);
        }
        self.wait_on(board, now);
        self.read_lines(board, now);
    }
}

fn axis(nominal: &Nominal, place: usize, zero: f64) -> Axis {
    let axis = &nominal.axes[place.min(3)];
    // Angles in degrees, lengths in millimetres.
    let per_file_unit = if place < 2 { core::f64::consts::PI / 180.0 } else { 1e-3 };
    let steps_per_unit = axis.counts_per_unit.abs() * per_file_unit;
    let mark = libm::round(zero * steps_per_unit);
    let (low, high) = (f64::from(axis.travel_counts.0), f64::from(axis.travel_counts.1));
    Axis {
        channel: axis.channel,
        steps_per_unit,
        mark,
        limits: Limits {
            speed: f64::from(axis.speed_counts_per_s),
            acceleration: f64::from(axis.acceleration_counts_per_s2),
        },
        travel_units: (-(mark + low) / steps_per_unit).max((high - low) / steps_per_unit) + SPARE,
        reach: 1.02 * (high - low),
    }
}

impl Twin for GrblTwin {
    fn follow(&mut self, board: &mut SimulatedBoard, now: Instant) {
        let here = match &self.homing {
            Some(homing) => homing.setpoints(now),
            None => {
                self.here(now).iter().zip(&self.origin).map(|(at, origin)| at - origin).collect()
            }
        };
        for (axis, at) in self.axes.iter().zip(here) {
            board.set_setpoint(now, axis.channel, at);
        }
    }

    fn handle_bytes(&mut self, board: &mut SimulatedBoard, now: Instant, bytes: &[u8]) {
        for byte in bytes {
            if self.act_at_once(board, now, *byte) || self.boots_at.is_some() {
                continue;
            }
            if self.received.len() < RX_BYTES {
                self.received.push_back(*byte);
            } else {
                self.lost += 1;
            }
        }
        self.live(board, now);
    }

    fn handle_timeout(&mut self, board: &mut SimulatedBoard, now: Instant) {
        self.live(board, now);
    }

    fn poll_timeout(&self, board: &SimulatedBoard) -> Option<Instant> {
        let reads = self.would_read().then_some(self.busy_until);
        let ends = self.leg.as_ref().filter(|_| self.state == State::Run).map(Leg::ends_at);
        let pause = match self.waiting {
            Some(Waiting::Pause { until, .. }) => Some(until),
            _ => None,
        };
        let homing = self.homing.as_ref().map(Homing::wake);
        let switch = board.wake_at().filter(|_| self.is_moving() && self.homing.is_none());
        [reads, ends, pause, homing, switch, self.boots_at].into_iter().flatten().min()
    }

    fn deeds(&self) -> u32 {
        self.moves
    }

    fn fail(&mut self, _board: &mut SimulatedBoard, now: Instant, fault: FaultKind) {
        if fault == FaultKind::Alarm {
            self.alarm(now, 1);
        }
    }

    fn poll_transmit(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }
}
