//! The path of one axis: where its setpoint is at each microsecond. A path starts and ends on a
//! whole microsecond; it knows one axis, no board and no command.

use crate::{Instant, Trapezoid};

/// How an axis moves, positions in counts.
#[derive(Debug, Clone, Copy)]
pub(super) enum Path {
    /// At rest, here.
    Rest(f64),
    /// From rest to rest.
    Leg(Leg),
    /// From a speed to rest.
    Braking(Braking),
}

/// A trapezoid, stretched in time so that it ends together with others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leg {
    from: f64,
    to: f64,
    start: Instant,
    end: Instant,
    profile: Trapezoid,
    /// Seconds of the profile per second of the clock, at most 1.
    rate: f64,
}

/// Even deceleration to rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Braking {
    from: f64,
    to: f64,
    start: Instant,
    end: Instant,
    duration_s: f64,
    /// Signed, towards `to`, counts a second squared.
    deceleration: f64,
}

impl Path {
    /// A leg that lasts `duration_us`, which is no shorter than the profile; at rest at once where
    /// there is no way to go.
    pub(super) fn leg(
        from: f64,
        to: f64,
        profile: Trapezoid,
        start: Instant,
        duration_us: u64,
    ) -> Self {
        if duration_us == 0 || profile.duration_s() <= 0.0 {
            return Self::Rest(to);
        }
        let end = Instant::from_micros(start.micros().saturating_add(duration_us));
        let rate = profile.duration_s() / seconds(duration_us);
        Self::Leg(Leg { from, to, start, end, profile, rate })
    }

    /// When it comes to rest; `None` at rest.
    pub(super) const fn end(&self) -> Option<Instant> {
        match self {
            Self::Rest(_) => None,
            Self::Leg(leg) => Some(leg.end),
            Self::Braking(braking) => Some(braking.end),
        }
    }

    /// Where it comes to rest.
    pub(super) const fn destination(&self) -> f64 {
        match self {
            Self::Rest(at) => *at,
            Self::Leg(leg) => leg.to,
            Self::Braking(braking) => braking.to,
        }
    }

    /// Where it is.
    pub(super) fn position(&self, now: Instant) -> f64 {
        match self {
            Self::Rest(at) => *at,
            Self::Leg(leg) => leg.position(now),
            Self::Braking(braking) => braking.position(now),
        }
    }

    /// The path from here on when the axis brakes as hard as it may. It does not pass where it
    /// was going: from any point of a leg the way on is at least v² / 2a.
    pub(super) fn braked(self, now: Instant, acceleration: f64) -> Self {
        let Self::Leg(leg) = self else {
            return self;
        };
        let (from, velocity) = (leg.position(now), leg.velocity(now));
        let duration_s = velocity.abs() / acceleration;
        let duration_us = whole_micros(duration_s);
        if duration_us == 0 {
            return Self::Rest(from);
        }
        Self::Braking(Braking {
            from,
            to: between(from, leg.to, from + 0.5 * velocity * duration_s),
            start: now,
            end: Instant::from_micros(now.micros().saturating_add(duration_us)),
            duration_s,
            deceleration: acceleration.copysign(velocity),
        })
    }
}

impl Leg {
    fn position(&self, now: Instant) -> f64 {
        let (elapsed_us, left_us) = around(self.start, now, self.end);
        let ramped = self.profile.ramped(self.rate * seconds(elapsed_us.min(left_us)));
        let ramped = ramped.copysign(self.to - self.from);
        let position = if elapsed_us <= left_us { self.from + ramped } else { self.to - ramped };
        between(self.from, self.to, position)
    }

    fn velocity(&self, now: Instant) -> f64 {
        let (elapsed_us, left_us) = around(self.start, now, self.end);
        let speed = self.rate * self.profile.speed(self.rate * seconds(elapsed_us.min(left_us)));
        speed.copysign(self.to - self.from)
    }
}

impl Braking {
    fn position(&self, now: Instant) -> f64 {
        let (elapsed_us, _) = around(self.start, now, self.end);
        // Counted from the stop, so that it ends there exactly; the last fraction of a
        // microsecond is at rest.
        let left_s = (self.duration_s - seconds(elapsed_us)).max(0.0);
        between(self.from, self.to, self.to - 0.5 * self.deceleration * left_s * left_s)
    }
}

/// The shortest whole number of microseconds that is no shorter.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; saturates
pub(super) fn whole_micros(duration_s: f64) -> u64 {
    libm::ceil(duration_s * 1e6) as u64
}

fn seconds(micros: u64) -> f64 {
    micros as f64 / 1e6
}

/// Microseconds since the start and to the end, both within the path.
fn around(start: Instant, now: Instant, end: Instant) -> (u64, u64) {
    let now = now.max(start).min(end);
    (now.micros() - start.micros(), end.micros() - now.micros())
}

fn between(a: f64, b: f64, x: f64) -> f64 {
    x.max(a.min(b)).min(a.max(b))
}
