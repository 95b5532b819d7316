//! One axis: its travel, its motion, its counts, and how well its position is known.
//!
//! It does not know where the axis stands, nor which device moves it.

use std::time::Duration;

use thiserror::Error;

use super::AxisName;

/// Positions this much of a count outside the travel still count as inside: `95°` times counts a
/// degree need not be whole in binary.
const COUNT_SLACK: f64 = 1e-6;

/// From which side an axis comes to its target, so that backlash always lies on the same side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Approach {
    /// From either side: there is no backlash to speak of.
    Either,
    /// Downwards: targets are reached from above.
    Negative,
    /// Upwards: targets are reached from below.
    Positive,
}

/// Where a measured position comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Readback {
    /// An encoder on the axis.
    Encoder,
    /// Nothing: the commanded position stands, with the axis's own uncertainty.
    None,
    /// The steps that were sent, counted.
    Steps,
}

/// An axis of the gantry. Its unit is the radian or the metre, after [`AxisName::is_rotary`].
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Which axis.
    pub name: AxisName,
    /// Its channel on the device.
    pub channel: u8,
    /// Where it stands for good, if nothing moves it: its counts are 0 there, and [`Axis::travel`]
    /// is that place. Its speeds and counts are then nobody's.
    pub fixed: Option<f64>,
    /// Lowest and highest position, both allowed, from the home mark. Contains 0, but for a fixed
    /// axis.
    pub travel: (f64, f64),
    /// Highest speed, unit a second.
    pub speed: f64,
    /// Acceleration and deceleration, unit a second squared.
    pub acceleration: f64,
    /// Counts a radian or a metre.
    pub counts_per_unit: f64,
    /// Rest after a move before the axis is still.
    pub settle: Duration,
    /// From which side it comes to a target.
    pub approach: Approach,
    /// How far it first goes past a target that it would reach from the wrong side; 0 for
    /// [`Approach::Either`].
    pub run_up: f64,
    /// Where its measured position comes from.
    pub readback: Readback,
    /// Standard uncertainty of where its zero lies; the same for all readings of a rig.
    pub u_zero: f64,
    /// Standard uncertainty of finding the home mark again; the same within a session.
    pub u_homing: f64,
    /// Standard uncertainty of one position, as read back or, without a readback, as commanded;
    /// independent from one position to the next.
    pub u_readback: f64,
}

/// A position that an axis can't take.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum LimitError {
    /// Move the region or the target, or check the travel in the rig file.
    #[error("{}: {} is above the upper limit {}", .axis.name(), .axis.in_file_unit(*.position), .axis.in_file_unit(*.limit))]
    Above {
        /// Which axis.
        axis: AxisName,
        /// The position asked for, radians or metres.
        position: f64,
        /// The upper limit.
        limit: f64,
    },
    /// Nothing moves the axis: leave the other positions out of the plan, or say in the rig file
    /// where the axis stands now.
    #[error("{}: {} is asked for, but the rig file has it fixed at {}", .axis.name(), .axis.in_file_unit(*.position), .axis.in_file_unit(*.fixed))]
    Fixed {
        /// Which axis.
        axis: AxisName,
        /// The position asked for, radians or metres.
        position: f64,
        /// Where it stands.
        fixed: f64,
    },
    /// Move the region or the target, or check the travel in the rig file.
    #[error("{}: {} is below the lower limit {}", .axis.name(), .axis.in_file_unit(*.position), .axis.in_file_unit(*.limit))]
    Below {
        /// Which axis.
        axis: AxisName,
        /// The position asked for, radians or metres.
        position: f64,
        /// The lower limit.
        limit: f64,
    },
    /// The target itself is inside, but not the point from which it is approached. Move the
    /// target by the run-up, or shorten the run-up in the rig file.
    #[error("{}: {} can only be approached from {}, which is outside the travel from {} to {}", .axis.name(), .axis.in_file_unit(*.position), .axis.in_file_unit(*.from), .axis.in_file_unit(.travel.0), .axis.in_file_unit(.travel.1))]
    RunUp {
        /// Which axis.
        axis: AxisName,
        /// The position asked for, radians or metres.
        position: f64,
        /// Where the approach would begin.
        from: f64,
        /// Lowest and highest position.
        travel: (f64, f64),
    },
}

impl Axis {
    /// The nearest count to a position; saturates far outside any travel.
    #[allow(clippy::cast_possible_truncation)] // saturating, as documented
    pub fn counts(&self, position: f64) -> i32 {
        libm::round((position - self.fixed.unwrap_or(0.0)) * self.counts_per_unit) as i32
    }

    /// The position, radians or metres, of a count, which need not be whole.
    pub fn position(&self, counts: f64) -> f64 {
        self.fixed.unwrap_or(0.0) + self.distance(counts)
    }

    /// The way, radians or metres, between two positions so many counts apart.
    pub fn distance(&self, counts: f64) -> f64 {
        counts / self.counts_per_unit
    }

    /// Lowest and highest whole count inside the travel.
    #[allow(clippy::cast_possible_truncation)] // the rig reader checked that both fit
    pub fn count_limits(&self) -> (i32, i32) {
        if self.fixed.is_some() {
            return (0, 0);
        }
        let low = libm::ceil(self.travel.0 * self.counts_per_unit - COUNT_SLACK);
        let high = libm::floor(self.travel.1 * self.counts_per_unit + COUNT_SLACK);
        (low as i32, high as i32)
    }

    /// Its highest speed as the device knows it: whole counts a second, none too many.
    pub fn counts_per_s(&self) -> u32 {
        whole_within(self.speed * self.counts_per_unit)
    }

    /// Its acceleration as the device knows it: whole counts a second squared, none too many.
    pub fn counts_per_s2(&self) -> u32 {
        whole_within(self.acceleration * self.counts_per_unit)
    }

    /// Whether the axis may stand at `position`, and can come there from its own side.
    pub fn check(&self, position: f64) -> Result<(), LimitError> {
        let axis = self.name;
        let (low, high) = self.count_limits();
        let is_inside = |position: f64| (low..=high).contains(&self.counts(position));
        if let Some(fixed) = self.fixed.filter(|_| !is_inside(position)) {
            return Err(LimitError::Fixed { axis, position, fixed });
        }
        if !is_inside(position) {
            return Err(if position < self.travel.0 {
                LimitError::Below { axis, position, limit: self.travel.0 }
            } else {
                LimitError::Above { axis, position, limit: self.travel.1 }
            });
        }
        let from = self.run_up_point(position);
        if is_inside(from) {
            Ok(())
        } else {
            Err(LimitError::RunUp { axis, position, from, travel: self.travel })
        }
    }

    /// The counts to go to first, on the way from `from` to `to`, so that `to` is reached from
    /// the axis's own side. `None` if the way comes from there already, or there is no way.
    pub fn run_up_from(&self, from: i32, to: i32) -> Option<i32> {
        let is_wrong_way = match self.approach {
            Approach::Either => false,
            Approach::Negative => to > from,
            Approach::Positive => to < from,
        };
        is_wrong_way.then(|| self.counts(self.run_up_point(self.position(f64::from(to)))))
    }

    fn run_up_point(&self, position: f64) -> f64 {
        match self.approach {
            Approach::Either => position,
            Approach::Negative => position + self.run_up,
            Approach::Positive => position - self.run_up,
        }
    }
}

/// The whole number of counts inside, but for the rounding of units: 60°/s at 1000 counts a degree
/// are 60 000 counts a second, although radians make it a little less.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // the rig reader checked it
fn whole_within(counts: f64) -> u32 {
    libm::floor(counts * (1.0 + COUNT_SLACK)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn theta() -> Axis {
        Axis {
            name: AxisName::Theta,
            channel: 0,
            fixed: None,
            travel: ((-95.0_f64).to_radians(), 95.0_f64.to_radians()),
            speed: 1.0,
            acceleration: 2.0,
            counts_per_unit: 400.0_f64.to_degrees(),
            settle: Duration::from_millis(50),
            approach: Approach::Either,
            run_up: 0.0,
            readback: Readback::Encoder,
            u_zero: 0.0,
            u_homing: 0.0,
            u_readback: 0.0,
        }
    }

    #[test]
    fn limits_are_inclusive_and_named_with_unit() {
        let axis = theta();
        assert_eq!(axis.check(95.0_f64.to_radians()), Ok(()));
        assert_eq!(axis.check((-95.0_f64).to_radians()), Ok(()));
        let above = axis.check(97.5_f64.to_radians()).unwrap_err();
        assert_eq!(above.to_string(), "theta: 97.500° is above the upper limit 95.000°");
        let below = axis.check((-95.01_f64).to_radians()).unwrap_err();
        assert_eq!(below.to_string(), "theta: -95.010° is below the lower limit -95.000°");
        assert_eq!(axis.count_limits(), (-38_000, 38_000));
        let axis = Axis { speed: 60.0_f64.to_radians(), ..axis };
        assert_eq!(axis.counts_per_s(), 24_000);
    }

    #[test]
    fn counts_and_positions_are_inverse_to_half_a_count() {
        let axis = theta();
        for counts in [-38_000, -1, 0, 1, 12_345, 38_000] {
            assert_eq!(axis.counts(axis.position(f64::from(counts))), counts);
        }
    }

    #[test]
    fn a_one_sided_axis_runs_up_only_from_the_wrong_side() {
        let axis = Axis { approach: Approach::Positive, run_up: 0.5_f64.to_radians(), ..theta() };
        assert_eq!(axis.run_up_from(0, 4000), None);
        assert_eq!(axis.run_up_from(4000, 4000), None);
        assert_eq!(axis.run_up_from(8000, 4000), Some(3800));
        let error = axis.check((-95.0_f64).to_radians()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "theta: -95.000° can only be approached from -95.500°, which is outside the travel \
             from -95.000° to 95.000°"
        );
    }

    #[test]
    fn a_fixed_axis_stands_at_its_count_0_and_nowhere_else() {
        let at = 90.0_f64.to_radians();
        let axis = Axis {
            name: AxisName::Phi,
            fixed: Some(at),
            travel: (at, at),
            counts_per_unit: 1e6,
            ..theta()
        };
        assert_eq!((axis.counts(at), axis.count_limits()), (0, (0, 0)));
        assert_eq!(axis.position(0.0).to_bits(), at.to_bits());
        assert_eq!(axis.check(at + 1e-12), Ok(()));
        let moved = axis.check(0.0).unwrap_err();
        assert_eq!(
            moved.to_string(),
            "phi: 0.000° is asked for, but the rig file has it fixed at 90.000°"
        );
    }
}
