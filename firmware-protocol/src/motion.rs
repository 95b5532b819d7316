//! The trapezoidal motion profile: how long a move takes, and how far it has come. It knows one
//! axis at rest at both ends, in any unit of length, and no clock.
//!
//! Accelerate evenly to the cruising speed, cruise, brake evenly; a move too short to reach the
//! cruising speed is a triangle. The profile is symmetric in time, so that every distance is
//! counted from its nearer end: what remains shortly before the stop is a (T - t)² / 2 and keeps
//! all its digits, where distance minus position would keep none. That needs T - t to more
//! digits than T has, so T is kept as a sum of two floats.

use libm::{fma, sqrt};

/// A move of one axis from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trapezoid {
    distance: f64,
    acceleration: f64,
    /// The highest speed reached.
    peak: f64,
    /// How long the axis accelerates, and how long it brakes, s.
    ramp_s: f64,
    duration: Sum,
}

impl Trapezoid {
    /// The fastest move over `distance` >= 0 with speed at most `speed` > 0 and acceleration at
    /// most `acceleration` > 0; all finite, in one unit of length and seconds. `None` outside
    /// that domain.
    ///
    /// ```
    /// let profile = firmware_protocol::Trapezoid::new(2.0, 0.5, 1.0).unwrap();
    /// assert_eq!(profile.duration_s(), 4.5);
    /// assert_eq!(profile.remaining(4.25), 0.03125);
    /// ```
    pub fn new(distance: f64, speed: f64, acceleration: f64) -> Option<Self> {
        let is_length = distance >= 0.0 && distance.is_finite();
        let are_positive = speed > 0.0 && acceleration > 0.0;
        if !is_length || !are_positive || !speed.is_finite() || !acceleration.is_finite() {
            return None;
        }
        // The product of roots neither overflows nor vanishes where speed² or d·a would.
        let peak = sqrt(distance) * sqrt(acceleration);
        Some(if peak <= speed {
            let half = Sum::root(distance).over(Sum::root(acceleration));
            Self { distance, acceleration, peak, ramp_s: half.high, duration: half.doubled() }
        } else {
            let ramp = Sum::quotient(speed, acceleration);
            let duration = Sum::quotient(distance, speed).plus(ramp);
            Self { distance, acceleration, peak: speed, ramp_s: ramp.high, duration }
        })
    }

    /// How long the move takes, s.
    pub const fn duration_s(&self) -> f64 {
        self.duration.high
    }

    /// How far it has come `elapsed_s` after its start: 0 before it, all of it after its end.
    pub fn travelled(&self, elapsed_s: f64) -> f64 {
        let left_s = self.duration.minus(elapsed_s);
        if elapsed_s <= left_s {
            self.ramped(elapsed_s)
        } else {
            self.distance - self.ramped(left_s)
        }
    }

    /// How far it has to go `elapsed_s` after its start, to full relative accuracy: all of it
    /// before the start, 0 after the end.
    pub fn remaining(&self, elapsed_s: f64) -> f64 {
        let left_s = self.duration.minus(elapsed_s);
        if elapsed_s <= left_s {
            self.distance - self.ramped(elapsed_s)
        } else {
            self.ramped(left_s)
        }
    }

    /// The distance covered within `seconds` of the nearer end of the move, in its half.
    pub(crate) fn ramped(&self, seconds: f64) -> f64 {
        if seconds <= 0.0 {
            0.0
        } else if seconds < self.ramp_s {
            0.5 * (self.acceleration * seconds) * seconds
        } else {
            self.peak * (seconds - 0.5 * self.ramp_s)
        }
    }

    /// The speed `seconds` away from the nearer end of the move.
    pub(crate) fn speed(&self, seconds: f64) -> f64 {
        if seconds < self.ramp_s { self.acceleration * seconds.max(0.0) } else { self.peak }
    }
}

/// An unevaluated sum of two floats: about 32 digits (Dekker 1971).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    /// The sum of `high` and a much smaller `low`; no `low` where `high` has left the range.
    fn new(high: f64, low: f64) -> Self {
        let sum = high + low;
        if sum.is_finite() {
            Self { high: sum, low: low - (sum - high) }
        } else {
            Self { high, low: 0.0 }
        }
    }

    fn quotient(dividend: f64, divisor: f64) -> Self {
        let high = dividend / divisor;
        Self::new(high, fma(-high, divisor, dividend) / divisor)
    }

    fn root(square: f64) -> Self {
        let high = sqrt(square);
        let low = if high > 0.0 { fma(-high, high, square) / (2.0 * high) } else { 0.0 };
        Self::new(high, low)
    }

    fn over(self, divisor: Self) -> Self {
        let high = self.high / divisor.high;
        let rest = fma(-high, divisor.high, self.high) + (self.low - high * divisor.low);
        Self::new(high, rest / divisor.high)
    }

    fn doubled(self) -> Self {
        Self { high: 2.0 * self.high, low: 2.0 * self.low }
    }

    fn plus(self, other: Self) -> Self {
        // Knuth 1969, two-sum: the rounding error of the sum, exactly.
        let high = self.high + other.high;
        let back = high - self.high;
        let error = (self.high - (high - back)) + (other.high - back);
        Self::new(high, error + self.low + other.low)
    }

    fn minus(self, subtrahend: f64) -> f64 {
        (self.high - subtrahend) + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_symmetric_in_time() {
        for (distance, speed) in [(2.0, 0.5), (0.125, 0.5)] {
            let profile = Trapezoid::new(distance, speed, 1.0).unwrap();
            for i in 0..=64 {
                let elapsed_s = profile.duration_s() * f64::from(i) / 64.0;
                let mirrored = profile.remaining(profile.duration_s() - elapsed_s);
                assert!((profile.travelled(elapsed_s) - mirrored).abs() < 1e-15);
                let whole = profile.travelled(elapsed_s) + profile.remaining(elapsed_s);
                assert!((whole - distance).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn outside_the_domain_there_is_no_profile() {
        for (distance, speed, acceleration) in [
            (-1.0, 1.0, 1.0),
            (f64::NAN, 1.0, 1.0),
            (f64::INFINITY, 1.0, 1.0),
            (1.0, 0.0, 1.0),
            (1.0, 1.0, 0.0),
            (1.0, f64::NAN, 1.0),
            (1.0, 1.0, f64::INFINITY),
        ] {
            assert!(Trapezoid::new(distance, speed, acceleration).is_none());
        }
    }
}
