//! Pose to axis positions and back, in closed form; and the way from one place to the next.
//!
//! The arm's angle is signed: at θ < 0 it stands on the other side of the zenith, and looks along
//! (|θ|, φ + 180°). The turntable's angle is the φ, in the sample's frame, of the arm's positive
//! side. The stage's positions are the x and y of the point of the sample that stands on the
//! turntable's axis, in the sample's frame. So all four read 0 at home: looking along the normal
//! at the sample's origin.
//!
//! Nothing here knows of misalignment: positions are nominal, and their uncertainty is the
//! calibration's business.

use std::f64::consts::{PI, TAU};
use std::time::Duration;

use super::{AxisPositions, Latched, LimitError, Pose, Rig};

/// How to come from one place to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Route {
    /// Where to go first, so that one-sided axes reach their target from their own side.
    pub via: Option<Latched>,
    /// Rest after the last move: the longest of the axes that moved.
    pub settle: Duration,
}

/// The ray that the rig looks along with its axes at `positions`.
pub fn forward(positions: AxisPositions) -> Pose {
    let AxisPositions([arm, table, x_m, y_m]) = positions;
    let phi = if arm < 0.0 { table + PI } else { table };
    Pose { x_m, y_m, theta_rad: arm.abs(), phi_rad: wrap(phi) }
}

/// Every set of positions that looks along `pose`: the arm on either side of the zenith, the
/// turntable a turn further either way. The first is the plain one, (θ, φ).
pub fn solutions(pose: Pose) -> [AxisPositions; 6] {
    let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
    let turned = if phi_rad > 0.0 { phi_rad - PI } else { phi_rad + PI };
    let at = |arm: f64, table: f64| AxisPositions([arm, table, x_m, y_m]);
    [
        at(theta_rad, phi_rad),
        at(-theta_rad, turned),
        at(theta_rad, phi_rad - TAU),
        at(theta_rad, phi_rad + TAU),
        at(-theta_rad, turned - TAU),
        at(-theta_rad, turned + TAU),
    ]
}

/// An angle brought into (-π, π] by whole turns.
pub fn wrap(angle: f64) -> f64 {
    let wrapped = libm::remainder(angle, TAU);
    if wrapped <= -PI { PI } else { wrapped }
}

impl Rig {
    /// Every set of positions that looks along `pose` and is inside the limits, in the order of
    /// [`solutions`]; if there is none, why the plain one is outside.
    pub fn reachable(&self, pose: Pose) -> Result<Vec<AxisPositions>, LimitError> {
        let mut first_error = None;
        let mut reachable = Vec::with_capacity(2);
        for positions in solutions(pose) {
            match self.check(positions) {
                Ok(()) => reachable.push(positions),
                Err(e) => first_error = first_error.or(Some(e)),
            }
        }
        match first_error {
            Some(e) if reachable.is_empty() => Err(e),
            _ => Ok(reachable),
        }
    }

    /// The positions that look along `pose` and are quickest to reach from `from`.
    pub fn nearest(&self, pose: Pose, from: AxisPositions) -> Result<AxisPositions, LimitError> {
        let reachable = self.reachable(pose)?;
        let time = |positions: &AxisPositions| self.move_time_s(from, *positions);
        let nearest = reachable.iter().copied().min_by(|a, b| time(a).total_cmp(&time(b)));
        // `reachable` is never empty: the fallback is the plain solution.
        Ok(nearest.unwrap_or(solutions(pose)[0]))
    }

    /// Whether every axis may stand at its position.
    pub fn check(&self, positions: AxisPositions) -> Result<(), LimitError> {
        self.axes.iter().zip(positions.0).try_for_each(|(axis, position)| axis.check(position))
    }

    /// Positions in whole counts, rounded to the nearest.
    pub fn counts(&self, positions: AxisPositions) -> Latched {
        let mut counts = [0; 4];
        for ((count, axis), position) in counts.iter_mut().zip(&self.axes).zip(positions.0) {
            *count = axis.counts(position);
        }
        Latched(counts)
    }

    /// The positions, radians and metres, of counts.
    pub fn positions(&self, counts: Latched) -> AxisPositions {
        let mut positions = [0.0; 4];
        for ((position, axis), count) in positions.iter_mut().zip(&self.axes).zip(counts.0) {
            *position = axis.position(f64::from(count));
        }
        AxisPositions(positions)
    }

    /// How to come from `from` to `to`.
    pub fn route(&self, from: Latched, to: Latched) -> Route {
        let mut via = to;
        let mut settle = Duration::ZERO;
        for (i, axis) in self.axes.iter().enumerate() {
            if from.0[i] != to.0[i] {
                settle = settle.max(axis.settle);
            }
            if let Some(run_up) = axis.run_up_from(from.0[i], to.0[i]) {
                via.0[i] = run_up;
            }
        }
        Route { via: (via != to).then_some(via), settle }
    }
}
