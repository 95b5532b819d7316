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

use radiometry::direction::wrap;

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
    // -π and π are one direction, and its name is π.
    let phi_rad = Some(wrap(phi)).filter(|phi_rad| *phi_rad > -PI).unwrap_or(PI);
    Pose { x_m, y_m, theta_rad: arm.abs(), phi_rad }
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

/// Every set of positions that looks along `pose` and passes a check; if there is none, why the plain
/// one does not.
fn reachable_by(
    pose: Pose,
    check: impl Fn(AxisPositions) -> Result<(), LimitError>,
) -> Result<Vec<AxisPositions>, LimitError> {
    let mut first_error = None;
    let mut reachable = Vec::with_capacity(2);
    for positions in solutions(pose) {
        match check(positions) {
            Ok(()) => reachable.push(positions),
            Err(e) => first_error = first_error.or(Some(e)),
        }
    }
    match first_error {
        Some(e) if reachable.is_empty() => Err(e),
        _ => Ok(reachable),
    }
}

impl Rig {
    /// Every set of positions that looks along `pose` and is inside the limits, in the order of
    /// [`solutions`]; if there is none, why the plain one is outside.
    pub fn reachable(&self, pose: Pose) -> Result<Vec<AxisPositions>, LimitError> {
        reachable_by(pose, |positions| self.check(positions))
    }

    /// The positions that look along `pose` and are quickest to reach from `from`. An axis that
    /// stays where it is may stand anywhere: some are homed at switches beyond their travel.
    pub fn nearest(&self, pose: Pose, from: AxisPositions) -> Result<AxisPositions, LimitError> {
        let reachable =
            reachable_by(pose, |positions| self.check_move(self.counts(from), positions))?;
        let time = |positions: &AxisPositions| self.move_time_s(from, *positions);
        let nearest = reachable.iter().copied().min_by(|a, b| time(a).total_cmp(&time(b)));
        // `reachable` is never empty: the fallback is the plain solution.
        Ok(nearest.unwrap_or(solutions(pose)[0]))
    }

    /// Whether every axis may stand at its position.
    pub fn check(&self, positions: AxisPositions) -> Result<(), LimitError> {
        self.axes.iter().zip(positions.0).try_for_each(|(axis, position)| axis.check(position))
    }

    /// Where the axes stand at home: at 0, but for those that are fixed elsewhere.
    pub fn home(&self) -> AxisPositions {
        self.positions(Latched::ZERO)
    }

    /// Whether every axis that has to move from there may stand at its position.
    pub fn check_move(&self, from: Latched, to: AxisPositions) -> Result<(), LimitError> {
        let moves = self.axes.iter().zip(to.0).zip(from.0);
        let mut moves = moves.filter(|((axis, to), from)| axis.counts(*to) != *from);
        moves.try_for_each(|((axis, to), _)| axis.check(to))
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use radiometry::direction::{angle_between, unit};

    use super::super::{AXES, Approach};
    use super::*;

    const NEAR: f64 = 1e-12;

    fn rig() -> Rig {
        Rig::built_in().unwrap()
    }

    fn pose(x_mm: f64, y_mm: f64, theta_deg: f64, phi_deg: f64) -> Pose {
        Pose {
            x_m: x_mm / 1e3,
            y_m: y_mm / 1e3,
            theta_rad: theta_deg.to_radians(),
            phi_rad: phi_deg.to_radians(),
        }
    }

    fn degrees(positions: AxisPositions) -> [f64; 2] {
        [positions.0[0].to_degrees(), positions.0[1].to_degrees()]
    }

    fn angle(a: Pose, b: Pose) -> f64 {
        angle_between(unit(a.theta_rad, a.phi_rad), unit(b.theta_rad, b.phi_rad))
    }

    #[test]
    fn an_arm_on_the_other_side_of_the_zenith_looks_along_the_opposite_azimuth() {
        let positions = AxisPositions([(-30.0_f64).to_radians(), 20.0_f64.to_radians(), 0.0, 0.0]);
        let seen = forward(positions);
        assert!((seen.theta_rad.to_degrees() - 30.0).abs() < NEAR);
        assert!((seen.phi_rad.to_degrees() + 160.0).abs() < NEAR);
    }

    #[test]
    fn the_arm_passes_the_pole_instead_of_turning_the_table_round() {
        let rig = rig();
        let from = AxisPositions([5.0_f64.to_radians(), 0.0, 0.0, 0.0]);
        let nearest = rig.nearest(pose(0.0, 0.0, 5.0, 180.0), from).unwrap();
        let [arm, table] = degrees(nearest);
        assert!((arm + 5.0).abs() < NEAR && table.abs() < NEAR, "{arm}° {table}°");
    }

    #[test]
    fn the_table_goes_on_past_half_a_turn_where_its_travel_allows() {
        let rig = rig();
        let from = AxisPositions([80.0_f64.to_radians(), 179.0_f64.to_radians(), 0.0, 0.0]);
        let [arm, table] = degrees(rig.nearest(pose(0.0, 0.0, 80.0, -179.0), from).unwrap());
        assert!((arm - 80.0).abs() < NEAR && (table - 181.0).abs() < NEAR, "{arm}° {table}°");
        // At -174° the other turn ends at 186°, outside ±185°: all the way back, or over the top.
        let [arm, table] = degrees(rig.nearest(pose(0.0, 0.0, 80.0, -174.0), from).unwrap());
        assert!((arm + 80.0).abs() < NEAR && (table - 6.0).abs() < NEAR, "{arm}° {table}°");
    }

    #[test]
    fn a_pose_outside_is_named_by_its_plain_solution() {
        let e = rig().reachable(pose(60.0, 0.0, 10.0, 0.0)).unwrap_err();
        assert_eq!(e.to_string(), "x: 60.000 mm is above the upper limit 50.000 mm");
        let mut narrow = rig();
        narrow.axes[0].travel = ((-10.0_f64).to_radians(), 10.0_f64.to_radians());
        let e = narrow.reachable(pose(0.0, 0.0, 12.0, 0.0)).unwrap_err();
        assert_eq!(e.to_string(), "theta: 12.000° is above the upper limit 10.000°");
    }

    #[test]
    fn routes_settle_after_the_axes_that_move_and_come_from_the_stated_side() {
        let mut rig = rig();
        rig.axes[2].settle = Duration::from_millis(300);
        rig.axes[1].approach = Approach::Negative;
        rig.axes[1].run_up = 1.0_f64.to_radians();
        let at = |phi: i32, x: i32| Latched([0, phi, x, 0]);
        let still = rig.route(at(5, 5), at(5, 5));
        assert_eq!(still, Route { via: None, settle: Duration::ZERO });
        let down = rig.route(at(5000, 5), at(3000, 5));
        assert_eq!(down, Route { via: None, settle: Duration::from_millis(50) });
        let up = rig.route(at(3000, 0), at(5000, 7));
        assert_eq!(up, Route { via: Some(at(6000, 7)), settle: Duration::from_millis(300) });
    }

    proptest! {
        #[test]
        fn every_solution_looks_along_the_pose(
            x_mm in -50.0..50.0, y_mm in -50.0..50.0,
            theta_deg in 0.0..=90.0, phi_deg in -180.0..=180.0,
        ) {
            let wanted = pose(x_mm, y_mm, theta_deg, phi_deg);
            for positions in solutions(wanted) {
                let seen = forward(positions);
                prop_assert!(angle(seen, wanted) < 1e-15 * 4.0, "{positions:?} sees {seen:?}");
                prop_assert!(seen.phi_rad > -PI && seen.phi_rad <= PI);
                prop_assert_eq!((seen.x_m, seen.y_m), (wanted.x_m, wanted.y_m));
            }
        }

        #[test]
        fn positions_inside_the_limits_are_found_again(
            arm_deg in -95.0..=95.0, table_deg in -185.0..=185.0,
            x_mm in -50.0..=50.0, y_mm in -50.0..=50.0,
        ) {
            let rig = rig();
            let at = |deg: f64| f64::to_radians(deg);
            let positions = AxisPositions([at(arm_deg), at(table_deg), x_mm / 1e3, y_mm / 1e3]);
            let found = rig.nearest(forward(positions), positions).unwrap();
            for (i, axis) in AXES.iter().enumerate() {
                let error = (found.0[i] - positions.0[i]).abs();
                prop_assert!(error < NEAR, "{}: {:?} for {:?}", axis.name(), found, positions);
            }
        }

        #[test]
        fn counts_stay_within_half_a_count(fractions in proptest::array::uniform4(0.0..=1.0)) {
            let rig = rig();
            let mut positions = [0.0; 4];
            for ((position, axis), fraction) in positions.iter_mut().zip(&rig.axes).zip(fractions) {
                *position = axis.travel.0 + (axis.travel.1 - axis.travel.0) * fraction;
            }
            let counted = rig.positions(rig.counts(AxisPositions(positions)));
            for (i, axis) in rig.axes.iter().enumerate() {
                let error = (counted.0[i] - positions[i]).abs() * axis.counts_per_unit;
                prop_assert!(error <= 0.5 + 1e-9, "{error} counts");
            }
        }
    }
}
