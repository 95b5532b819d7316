//! The device's time: microseconds since its boot, whole and as it goes over the wire.

use core::ops::{Add, Sub};
use core::time::Duration;

use serde::{Deserialize, Serialize};

/// A moment in microseconds since the clock's start. Not the operating system's clock: the
/// caller decides what zero is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Hash)]
pub struct Instant(u64);

impl Instant {
    /// The clock's start.
    pub const ZERO: Self = Self(0);

    /// `us` microseconds after the start.
    pub const fn from_micros(us: u64) -> Self {
        Self(us)
    }

    /// Microseconds since the start.
    pub const fn micros(self) -> u64 {
        self.0
    }

    /// The time since `earlier`; zero if `earlier` is later.
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }

    /// The low 32 bits, as they go over the wire.
    #[allow(clippy::cast_possible_truncation)] // the wrap is the wire's definition
    pub const fn tick(self) -> Tick {
        Tick(self.0 as u32)
    }
}

impl Add<Duration> for Instant {
    type Output = Self;

    /// Saturates after half a million years.
    fn add(self, duration: Duration) -> Self {
        Self(self.0.saturating_add(u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)))
    }
}

impl Sub for Instant {
    type Output = Duration;

    fn sub(self, earlier: Self) -> Duration {
        self.since(earlier)
    }
}

/// A device's microsecond count modulo 2^32: it wraps every 71.6 minutes. Two ticks compare
/// rightly while they are less than half of that apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Tick(pub u32);

impl Tick {
    /// Signed microseconds from `earlier` to `self`, by the shorter way round.
    #[allow(clippy::cast_possible_wrap)] // the signed difference is what the wrap means
    pub const fn micros_since(self, earlier: Self) -> i32 {
        self.0.wrapping_sub(earlier.0) as i32
    }

    /// Whether `self` comes before `other`, by the shorter way round.
    pub const fn is_before(self, other: Self) -> bool {
        self.micros_since(other) < 0
    }
}

/// Turns a sequence of wrapping ticks into microseconds that do not wrap. Each step is the
/// signed 32-bit difference, so that a tick slightly out of order goes back a little instead of
/// forward by 71.6 minutes.
#[derive(Debug, Clone, Copy, Default)]
pub struct TickUnwrapper {
    last: Option<(Tick, i64)>,
}

impl TickUnwrapper {
    /// Microseconds from the first tick seen to this one.
    pub fn unwrap(&mut self, tick: Tick) -> i64 {
        let micros = match self.last {
            None => 0,
            Some((last, micros)) => micros + i64::from(tick.micros_since(last)),
        };
        self.last = Some((tick, micros));
        micros
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_compare_across_the_wrap() {
        let (late, early) = (Tick(10), Tick(u32::MAX - 10));
        assert!(early.is_before(late) && !late.is_before(early));
        assert_eq!(late.micros_since(early), 21);
    }

    #[test]
    fn unwrapping_follows_wraps_and_small_steps_back() {
        let mut ticks = TickUnwrapper::default();
        assert_eq!(ticks.unwrap(Tick(1_000_000)), 0);
        assert_eq!(ticks.unwrap(Tick(999_990)), -10);
        assert_eq!(ticks.unwrap(Tick(1_000_020)), 20);
        let mut ticks = TickUnwrapper::default();
        ticks.unwrap(Tick(u32::MAX));
        assert_eq!(ticks.unwrap(Tick(4)), 5);
    }
}
