//! Homing of a simulated grbl: axes look for their marks one way, then the other, go back to them,
//! and from there to where grbl stands after homing: the pull-off from its switches.

use core::time::Duration;

use firmware_protocol::{Board as _, Instant};

use super::motion::{Block, Leg, Limits};
use super::{GrblTwin, PULL_OFF};
use crate::SimulatedBoard;

/// Axes search at this part of their speed.
const PART_OF_SPEED: f64 = 0.25;
/// How often they are looked after.
const LOOK: Duration = Duration::from_millis(5);

/// See the module.
#[derive(Debug)]
pub(super) struct Homing {
    seekers: Vec<Seeker>,
    look_at: Instant,
}

#[derive(Debug)]
struct Seeker {
    channel: u8,
    limits: Limits,
    leg: Option<Leg>,
    /// Setpoint at rest, the board's counts.
    at: f64,
    stage: Stage,
    reach: f64,
    /// Where it goes in the end, counts from the mark.
    rest: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Upwards,
    Downwards,
    Back,
    Away,
    Found,
    Missed,
}

/// What came of a look.
pub(super) enum Progress {
    Done,
    Missed,
    Searching,
}

impl Homing {
    pub(super) fn begin(twin: &GrblTwin, board: &mut SimulatedBoard, now: Instant) -> Self {
        let positions = twin.position.iter().zip(&twin.origin);
        let seekers = twin.axes.iter().zip(positions).map(|(axis, (position, origin))| {
            board.begin_search(now, axis.channel);
            let creeping = Limits { speed: PART_OF_SPEED * axis.limits.speed, ..axis.limits };
            let rest = -PULL_OFF * axis.steps_per_unit - axis.mark;
            let mut seeker = Seeker {
                channel: axis.channel,
                limits: creeping,
                leg: None,
                at: position - origin,
                stage: Stage::Upwards,
                reach: axis.reach,
                rest,
            };
            seeker.go(board, now, seeker.at + axis.reach);
            seeker
        });
        let seekers = seekers.collect();
        Self { seekers, look_at: now + LOOK }
    }

    pub(super) const fn wake(&self) -> Instant {
        self.look_at
    }

    /// Where the axes are, counts of the board.
    pub(super) fn setpoints(&self, now: Instant) -> Vec<f64> {
        self.seekers.iter().map(|seeker| seeker.here(now)).collect()
    }

    pub(super) fn go_on(
        &mut self,
        twin: &mut GrblTwin,
        board: &mut SimulatedBoard,
        now: Instant,
    ) -> Progress {
        if now < self.look_at {
            return Progress::Searching;
        }
        self.look_at = now + LOOK;
        // A limit switch only ends a search to its side.
        let mut has_opened = board.fault(now).is_some();
        for seeker in &mut self.seekers {
            has_opened |= seeker.go_on(board, now, has_opened);
        }
        if self.seekers.iter().any(|seeker| seeker.stage == Stage::Missed) {
            return Progress::Missed;
        }
        if self.seekers.iter().any(|seeker| seeker.stage != Stage::Found) {
            return Progress::Searching;
        }
        for (n, axis) in twin.axes.iter().enumerate() {
            let machine = -PULL_OFF * axis.steps_per_unit;
            twin.position[n] = machine;
            twin.planned[n] = machine;
            twin.origin[n] = axis.mark;
        }
        Progress::Done
    }
}

impl Seeker {
    fn here(&self, now: Instant) -> f64 {
        let on_leg = self.leg.as_ref().and_then(|leg| leg.position(now).first().copied());
        on_leg.unwrap_or(self.at)
    }

    fn go(&mut self, board: &mut SimulatedBoard, now: Instant, to: f64) {
        self.at = self.here(now);
        let block = Block { target: vec![to], lengths_per_s: None };
        self.leg = Leg::new(&[self.at], &block, &[self.limits], now);
        board.begin_motion(now, self.channel, to);
    }

    fn rests(&self, now: Instant) -> bool {
        self.leg.as_ref().is_none_or(|leg| leg.ends_at() <= now)
    }

    fn go_on(&mut self, board: &mut SimulatedBoard, now: Instant, _opened: bool) -> bool {
        match self.stage {
            Stage::Upwards | Stage::Downwards => {
                if let Some(mark) = board.home_mark(now, self.channel) {
                    self.go(board, now, mark);
                    self.stage = Stage::Back;
                } else if self.rests(now) && self.stage == Stage::Upwards {
                    self.go(board, now, self.here(now) - 2.0 * self.reach);
                    self.stage = Stage::Downwards;
                } else if self.rests(now) {
                    self.stage = Stage::Missed;
                }
            }
            Stage::Back if self.rests(now) => {
                self.at = self.here(now);
                self.leg = None;
                board.set_home(now, self.channel);
                self.at = 0.0;
                self.go(board, now, self.rest);
                self.stage = Stage::Away;
            }
            Stage::Away if self.rests(now) => {
                self.at = self.here(now);
                self.leg = None;
                self.stage = Stage::Found;
            }
            Stage::Away | Stage::Back | Stage::Found | Stage::Missed => {}
        }
        false
    }
}
