//! How long moves take, by the very profile that devices run.

use std::time::Duration;

use firmware_protocol::{
    AxisCounts, AxisIdentity, CommandId, Rejection, Sweep, SweepMotion, Trapezoid,
};

use super::{Approach, AxisPositions, Latched, Rig, Route};

/// A sweep's windows, all alike: how the axes go while readings are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flight {
    /// Where the first window begins, counts.
    pub from: Latched,
    /// How far the axes go in a window, counts.
    pub travel: Latched,
    /// How long a window is.
    pub window: Duration,
    /// At constant speed before the first one.
    pub lead: Duration,
    /// How many.
    pub windows: u16,
}

impl Flight {
    /// The same windows from the other end.
    #[must_use]
    pub fn reversed(self) -> Self {
        let from = self.from.plus(self.travel, self.windows.into());
        Self { from, travel: Latched(self.travel.0.map(|counts| -counts)), ..self }
    }
}

impl Rig {
    /// How the axes come to speed, fly and come to rest, by the very rule that devices follow.
    /// Channels in a rejection are places in [`super::AXES`].
    pub fn flight(&self, flight: Flight) -> Result<SweepMotion, Rejection> {
        let axes = self.axes.each_ref().map(|axis| {
            let (low, high) = axis.count_limits();
            let (speed, acceleration) = (axis.counts_per_s(), axis.counts_per_s2());
            AxisIdentity { low, high, speed, acceleration }
        });
        let counts = |latched: Latched| AxisCounts(latched.0.into_iter().collect());
        let adc = self.detector.adc;
        let sweep = Sweep {
            id: CommandId(0),
            reading: 0,
            gain: 0,
            settle_us: 0,
            lead_us: u32::try_from(flight.lead.as_micros()).unwrap_or(u32::MAX),
            readings: adc.readings_in(flight.window),
            windows: flight.windows,
            from: counts(flight.from),
            step: counts(flight.travel),
        };
        SweepMotion::new(&axes, adc.rate_hz, &sweep)
    }

    /// How to come from `from` to where a flight sets out. Axes that fly come from their own side
    /// by flying.
    pub fn route_to_flight(&self, from: Latched, flight: Flight, motion: &SweepMotion) -> Route {
        let set_out = set_out(motion);
        let route = self.route(from, set_out);
        let via = route.via.map(|mut via| {
            for (i, axis) in self.axes.iter().enumerate() {
                if flight.travel.0[i] != 0 || axis.approach == Approach::Either {
                    via.0[i] = set_out.0[i];
                }
            }
            via
        });
        // What is still to die away does so while the flight comes to speed.
        let coming = Duration::from_micros(motion.before_us());
        let settle = route.settle.saturating_sub(coming);
        Route { via: via.filter(|via| *via != set_out), settle }
    }

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

/// Where a flight sets out, to the nearest count.
pub fn set_out(motion: &SweepMotion) -> Latched {
    ends(motion, |cruise| cruise.from)
}

/// Where it comes to rest, to the nearest count.
pub fn comes_to_rest(motion: &SweepMotion) -> Latched {
    ends(motion, |cruise| cruise.to)
}

#[allow(clippy::cast_possible_truncation)] // within the axes' travel
fn ends(motion: &SweepMotion, end: impl Fn(&firmware_protocol::Cruise) -> f64) -> Latched {
    let mut counts = Latched::ZERO;
    for (count, cruise) in counts.0.iter_mut().zip(motion.axes()) {
        *count = libm::round(end(cruise)) as i32;
    }
    counts
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
