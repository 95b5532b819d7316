//! Driving the rig by hand through its owner: what was asked becomes counts, from where the rig
//! stands.

use std::time::Duration;

use firmware_protocol::Shutter;
use radiometry::direction::wrap;

use super::conductor::No;
use crate::rig::{AxisPositions, Pose, Reading, Rig, forward};
use crate::run::{HandError, OwnerHandle, Stand, TakeOne};

/// What can be done by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Hand {
    /// Find the home marks.
    Home,
    /// Look along this ray, homing first where the axes have not been homed.
    Jog(Jog),
    /// Integrate where the rig stands; the gain range is an index into the detector's.
    Read { dwell: Duration, gain: u8 },
}

/// A pose of which only some coordinates are given; the others stay as they are.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Jog {
    /// Radians, in [0, π/2].
    pub(super) theta_rad: Option<f64>,
    pub(super) phi_rad: Option<f64>,
    pub(super) x_m: Option<f64>,
    pub(super) y_m: Option<f64>,
}

impl Jog {
    /// The whole pose, seen from where the rig looks now.
    fn from(self, now: Pose) -> Pose {
        Pose {
            x_m: self.x_m.unwrap_or(now.x_m),
            y_m: self.y_m.unwrap_or(now.y_m),
            theta_rad: self.theta_rad.unwrap_or(now.theta_rad),
            phi_rad: self.phi_rad.map_or(now.phi_rad, wrap),
        }
    }
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Handled {
    /// A reading.
    Read(Box<Reading>),
    /// Where the axes stand now.
    Stands(AxisPositions),
}

/// Does it, and says what came of it.
pub(super) async fn drive(owner: &OwnerHandle, rig: &Rig, hand: Hand) -> Result<Handled, No> {
    let stands = |stand: Stand| Handled::Stands(rig.positions(stand.counts));
    match hand {
        Hand::Home => Ok(stands(owner.home().await?)),
        Hand::Jog(jog) => {
            let mut now = owner.look().await?;
            if !now.is_homed {
                now = owner.home().await?;
            }
            let from = rig.positions(now.counts);
            let to = rig
                .nearest(jog.from(forward(from)), from)
                .map_err(|error| No::Limit(error.to_string()))?;
            Ok(stands(owner.jog(rig.counts(to)).await?))
        }
        Hand::Read { dwell, gain } => {
            let one = TakeOne { gain, dwell, shutter: Shutter::Open };
            Ok(Handled::Read(Box::new(owner.take(one).await?)))
        }
    }
}

impl From<HandError> for No {
    fn from(error: HandError) -> Self {
        match error {
            HandError::Busy => Self::NotNow(error.to_string()),
            HandError::Limit(error) => Self::Limit(error.to_string()),
            other => Self::Rig(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_stays_as_it_is() {
        let now = Pose { x_m: 0.01, y_m: 0.02, theta_rad: 0.3, phi_rad: 0.4 };
        let jog = Jog { theta_rad: Some(0.5), ..Jog::default() };
        assert_eq!(jog.from(now), Pose { theta_rad: 0.5, ..now });
    }
}
