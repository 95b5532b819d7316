//! An axis's two limit switches: one a margin beyond each end of its travel. They know places
//! and the highest speed, not the path: an axis that sets out beyond a switch is looked at again
//! when it could have come there at the earliest, and so to the microsecond.

use core::time::Duration;

use firmware_protocol::Instant;

/// The switches of one axis, places in counts.
#[derive(Debug, Clone)]
pub(crate) struct Switches {
    low: f64,
    high: f64,
    /// The axis's highest speed, counts a second.
    speed: f64,
    /// The one that the axis is about to run into.
    ahead: Option<Side>,
    look_at: Option<Instant>,
    has_opened: bool,
}

#[derive(Debug, Clone, Copy)]
enum Side {
    Low,
    High,
}

/// The clock's step.
const LOOK_MIN: Duration = Duration::from_micros(1);

impl Switches {
    /// At these places, of an axis that goes at most so fast.
    pub(crate) const fn new((low, high): (f64, f64), speed: f64) -> Self {
        Self { low, high, speed, ahead: None, look_at: None, has_opened: false }
    }

    /// The axis sets out. A switch that is open already lets it come back.
    pub(crate) fn begin_motion(&mut self, now: Instant, from: f64, towards: f64) {
        self.ahead = if towards > from && towards > self.high {
            Some(Side::High)
        } else if towards < from && towards < self.low {
            Some(Side::Low)
        } else {
            None
        };
        self.look_again(now, from);
    }

    /// The axis has come to here.
    pub(crate) fn pass(&mut self, now: Instant, place: f64) {
        if self.ahead.is_some_and(|side| self.left(side, place) <= 0.0) {
            self.ahead = None;
            self.has_opened = true;
        }
        self.look_again(now, place);
    }

    /// When to look where the axis is.
    pub(crate) const fn look_at(&self) -> Option<Instant> {
        self.look_at
    }

    /// Whether one opened since this was last asked.
    pub(crate) const fn take_opened(&mut self) -> bool {
        core::mem::replace(&mut self.has_opened, false)
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    fn look_again(&mut self, now: Instant, place: f64) {
        self.look_at = self.ahead.map(|side| {
            let micros = self.left(side, place).max(0.0) / self.speed * 1e6;
            now + LOOK_MIN.max(Duration::from_micros(micros as u64))
        });
    }

    /// How far it is to the switch, counts.
    fn left(&self, side: Side, place: f64) -> f64 {
        match side {
            Side::Low => place - self.low,
            Side::High => self.high - place,
        }
    }
}
