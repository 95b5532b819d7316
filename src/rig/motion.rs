//! How long moves take, by the very profile that devices run.

use std::time::Duration;

use firmware_protocol::Trapezoid;

use super::{AxisPositions, Latched, Rig};

impl Rig {
    /// The time of one time-synchronised move between two places in counts, from rest to rest: that
    /// of its slowest axis, in whole microseconds, none too short.
    pub fn move_duration(&self, from: Latched, to: Latched) -> Duration {
        let mut longest_s = 0.0_f64;
        for (i, axis) in self.axes.iter().enumerate() {
            let distance = (f64::from(to.0[i]) - f64::from(from.0[i])).abs();
            let speed = f64::from(axis.counts_per_s());
            let acceleration = f64::from(axis.counts_per_s2());
            let profile = Trapezoid::new(distance, speed, acceleration);
            longest_s = longest_s.max(profile.map_or(0.0, |profile| profile.duration_s()));
        }
        Duration::from_secs_f64(libm::ceil(longest_s * 1e6) / 1e6)
    }

    /// The same, in seconds, between positions.
    pub fn move_time_s(&self, from: AxisPositions, to: AxisPositions) -> f64 {
        self.move_duration(self.counts(from), self.counts(to)).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slowest_axis_decides_and_short_moves_are_triangles() {
        let rig = Rig::built_in().unwrap();
        let home = Latched([0; 4]);
        let time_ms = |to: Latched| rig.move_duration(home, to).as_secs_f64() * 1e3;
        assert_eq!(rig.move_duration(home, home), Duration::ZERO);
        // 30° just reach 60°/s at 120°/s²: half a second up, half a second down.
        assert!((time_ms(Latched([30_000, 0, 0, 0])) - 1e3).abs() < 2e-3);
        assert!((time_ms(Latched([30_000, -90_000, 0, 0])) - 2e3).abs() < 2e-3);
        assert!((time_ms(Latched([300, 0, 0, 0])) - 100.0).abs() < 2e-3);
        // 45 mm at 100 mm/s and 500 mm/s².
        assert!((time_ms(Latched([300, 0, 45_000, 0])) - 650.0).abs() < 2e-3);
    }
}
