//! How long moves take: rest to rest, trapezoidal speed, all axes together.

use std::time::Duration;

use super::{AxisPositions, Latched, Rig};

/// The time, seconds, to come from rest to rest over `distance` with at most `speed`, speeding up
/// and slowing down at `acceleration` (a triangle of speed where the distance is too short to
/// reach the full one). The three are in one unit of length or angle; `distance` may be negative.
pub fn rest_to_rest_s(distance: f64, speed: f64, acceleration: f64) -> f64 {
    let distance = distance.abs();
    if distance * acceleration <= speed * speed {
        2.0 * libm::sqrt(distance / acceleration)
    } else {
        distance / speed + speed / acceleration
    }
}

impl Rig {
    /// The time of one time-synchronised move between two places in counts, as the device runs it:
    /// in whole microseconds, none too short.
    pub fn move_duration(&self, from: Latched, to: Latched) -> Duration {
        let mut longest_s = 0.0_f64;
        for (i, axis) in self.axes.iter().enumerate() {
            let distance = axis.position(f64::from(to.0[i]) - f64::from(from.0[i]));
            longest_s = longest_s.max(rest_to_rest_s(distance, axis.speed, axis.acceleration));
        }
        Duration::from_secs_f64(libm::ceil(longest_s * 1e6) / 1e6)
    }

    /// The time, seconds, of one time-synchronised move: that of its slowest axis.
    pub fn move_time_s(&self, from: AxisPositions, to: AxisPositions) -> f64 {
        let ends = from.0.iter().zip(to.0);
        self.axes.iter().zip(ends).fold(0.0, |longest: f64, (axis, (from, to))| {
            longest.max(rest_to_rest_s(to - from, axis.speed, axis.acceleration))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::rest_to_rest_s;

    #[test]
    fn short_moves_are_triangles_and_long_ones_trapezoids() {
        assert!(rest_to_rest_s(0.0, 60.0, 120.0).abs() < 1e-300);
        // 30° just reach 60°/s at 120°/s²: half a second up, half a second down.
        assert!((rest_to_rest_s(30.0, 60.0, 120.0) - 1.0).abs() < 1e-15);
        assert!((rest_to_rest_s(-90.0, 60.0, 120.0) - 2.0).abs() < 1e-15);
        assert!((rest_to_rest_s(0.3, 60.0, 120.0) - 0.1).abs() < 1e-15);
    }
}
