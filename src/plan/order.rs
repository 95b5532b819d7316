//! The order of visits that saves travel: nearest neighbour, then exchanges ([`super::tour`]), on the
//! times of moves; and for any order, on which side of the zenith to stand.
//!
//! A pose can be seen from several axis positions ([`crate::rig::solutions`]). The nearest
//! neighbour picks among all of them; at the end the best choice for the order found is made
//! exactly, by dynamic programming (Viterbi 1967). The tour begins and ends at the reference pose,
//! which is where a run begins and ends.
//!
//! The order depends on poses and rig alone, and its work is bounded.

use super::tour::Tour;
use super::tree::{MoveTime, Tree};
use crate::rig::{AxisPositions, Rig};

/// A visit to a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Visit {
    /// The target, by its place in the candidates.
    pub(super) target: u32,
    /// The positions chosen for it.
    pub(super) positions: AxisPositions,
}

/// Visits in the order given, each from the best of its positions.
///
/// `candidates`: for each target, the positions from which it is seen, at least one.
pub(super) fn listed(
    rig: &Rig,
    candidates: &[Vec<AxisPositions>],
    start: AxisPositions,
) -> Vec<Visit> {
    let order: Vec<u32> = (0..).take(candidates.len()).collect();
    sides(MoveTime::of(rig), candidates, &order, start)
}

/// Visits in an order that saves travel.
pub(super) fn travelling(
    rig: &Rig,
    candidates: &[Vec<AxisPositions>],
    start: AxisPositions,
) -> Vec<Visit> {
    let time = MoveTime::of(rig);
    let visits = nearest_neighbours(time, candidates, start);
    let mut places = vec![start];
    places.extend(visits.iter().map(|visit| visit.positions));
    let tour = Tour::new(&places, time).improved();
    let targets = tour.iter().skip(1).map(|place| visits[*place as usize - 1].target);
    sides(time, candidates, &targets.collect::<Vec<u32>>(), start)
}

/// From each place to the soonest reached that is left, whatever the side.
fn nearest_neighbours(
    time: MoveTime,
    candidates: &[Vec<AxisPositions>],
    start: AxisPositions,
) -> Vec<Visit> {
    let points: Vec<AxisPositions> = candidates.iter().flatten().copied().collect();
    let mut first_of = Vec::with_capacity(candidates.len());
    let mut target_of = Vec::with_capacity(points.len());
    for (target, positions) in (0_u32..).zip(candidates) {
        first_of.push(target_of.len());
        target_of.extend(positions.iter().map(|_| target));
    }
    let mut tree = Tree::new(&points, time);
    let mut visits = Vec::with_capacity(candidates.len());
    let mut here = start;
    while let Some(point) = tree.nearest(&here) {
        here = points[point as usize];
        let target = target_of[point as usize];
        visits.push(Visit { target, positions: here });
        let first = first_of[target as usize];
        for twin in first..first + candidates[target as usize].len() {
            tree.take(u32::try_from(twin).unwrap_or(u32::MAX));
        }
    }
    visits
}

/// The choice of positions that makes the way through the targets, in this order, quickest.
fn sides(
    time: MoveTime,
    candidates: &[Vec<AxisPositions>],
    order: &[u32],
    start: AxisPositions,
) -> Vec<Visit> {
    // The quickest time to each side of the target at hand, and for each target and side the side
    // to come from.
    let mut reached = vec![(0.0, start)];
    let mut came_from: Vec<Vec<usize>> = Vec::with_capacity(order.len());
    for target in order {
        let step = |to: &AxisPositions| {
            let ways = reached.iter().map(|(until, from)| until + time.directed(from, to));
            let best = ways.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            best.unwrap_or((0, 0.0))
        };
        let sides = &candidates[*target as usize];
        let best: Vec<(usize, f64)> = sides.iter().map(step).collect();
        came_from.push(best.iter().map(|(side, _)| *side).collect());
        reached = best.iter().zip(sides).map(|((_, until), side)| (*until, *side)).collect();
    }
    let ways = reached.iter().map(|(until, from)| until + time.directed(from, &start));
    let best = ways.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    let mut side = best.map_or(0, |(side, _)| side);
    let mut visits = Vec::with_capacity(order.len());
    for (target, came_from) in order.iter().zip(&came_from).rev() {
        let positions = candidates[*target as usize][side];
        visits.push(Visit { target: *target, positions });
        side = came_from[side];
    }
    visits.reverse();
    visits
}

#[cfg(test)]
mod tests {
    use super::super::grid;
    use super::super::{Region, Schedule};
    use super::*;
    use crate::rig::Pose;

    const START: AxisPositions = AxisPositions([0.0; 4]);

    fn candidates(rig: &Rig, schedule: &Schedule) -> Vec<Vec<AxisPositions>> {
        let region =
            Region { x_m: (-0.02, 0.02), y_m: (-0.02, 0.02), theta_max_rad: 80.0_f64.to_radians() };
        let poses: Vec<Pose> = grid::poses(schedule, &region);
        poses.iter().map(|pose| rig.reachable(*pose).unwrap()).collect()
    }

    fn length_s(rig: &Rig, visits: &[Visit]) -> f64 {
        let mut here = START;
        let mut length_s = 0.0;
        for visit in visits {
            length_s += rig.move_time_s(here, visit.positions);
            here = visit.positions;
        }
        length_s + rig.move_time_s(here, START)
    }

    fn indices(visits: &[Visit]) -> Vec<u32> {
        let mut indices: Vec<u32> = visits.iter().map(|visit| visit.target).collect();
        indices.sort_unstable();
        indices
    }

    #[test]
    fn every_target_is_visited_once_and_the_tour_is_much_shorter_than_the_list() {
        let rig = Rig::built_in().unwrap();
        let candidates = candidates(&rig, &Schedule::LowDiscrepancy { count: 600 });
        let as_listed = listed(&rig, &candidates, START);
        let nearest = nearest_neighbours(MoveTime::of(&rig), &candidates, START);
        let visits = travelling(&rig, &candidates, START);
        let all: Vec<u32> = (0..600).collect();
        assert_eq!(indices(&as_listed), all);
        assert_eq!(indices(&visits), all);
        let [listed_s, nearest_s, improved_s] =
            [&as_listed, &nearest, &visits].map(|visits| length_s(&rig, visits));
        // Short moves take the root of their length, and the longest axis alone counts: the
        // exchanges have less to gain than on a map.
        assert!(improved_s < 0.97 * nearest_s, "{nearest_s} s became {improved_s} s");
        assert!(improved_s < 0.5 * listed_s, "{listed_s} s became {improved_s} s");
        assert_eq!(visits, travelling(&rig, &candidates, START));
    }

    /// As driven: settled, and turned round where play asks for it.
    fn driven_s(rig: &Rig, visits: &[Visit]) -> f64 {
        let time = MoveTime::of(rig);
        let stops: Vec<AxisPositions> = std::iter::once(START)
            .chain(visits.iter().map(|visit| visit.positions))
            .chain([START])
            .collect();
        stops.windows(2).map(|pair| time.directed(&pair[0], &pair[1])).sum()
    }

    #[test]
    fn where_an_axis_has_its_own_side_the_order_minds_it() {
        let mut rig = Rig::built_in().unwrap();
        let candidates = candidates(&rig, &Schedule::LowDiscrepancy { count: 300 });
        let unminded = travelling(&rig, &candidates, START);
        rig.axes[0].approach = crate::rig::Approach::Positive;
        rig.axes[0].run_up = 5.0_f64.to_radians();
        rig.axes[1].settle = std::time::Duration::from_millis(200);
        let minded = travelling(&rig, &candidates, START);
        let [unminded_s, minded_s] = [&unminded, &minded].map(|visits| driven_s(&rig, visits));
        assert!(minded_s < 0.97 * unminded_s, "{unminded_s} s became {minded_s} s");
        assert_eq!(indices(&minded), (0..300).collect::<Vec<u32>>());
    }

    #[test]
    fn a_meridian_through_the_pole_is_one_sweep_of_the_arm() {
        let rig = Rig::built_in().unwrap();
        let raster =
            Schedule::Raster { x_count: 1, y_count: 1, theta_step_deg: 10.0, phi_step_deg: 180.0 };
        let candidates = candidates(&rig, &raster);
        let visits = travelling(&rig, &candidates, START);
        // From 0° to 80°, back over the pole to -80° and home: 10° steps, but for the first way
        // out or the last way home, which may skip; the turntable stays.
        assert!(visits.iter().all(|visit| visit.positions.0[1].abs() < 1e-12));
        let step_s = rig.move_time_s(START, visits[1].positions);
        assert!(length_s(&rig, &visits) < 33.0 * step_s);
    }

    #[test]
    fn no_two_targets_and_many_equal_ones_are_ordered_too() {
        let rig = Rig::built_in().unwrap();
        assert!(travelling(&rig, &[], START).is_empty());
        assert!(listed(&rig, &[], START).is_empty());
        let one = vec![START];
        for count in [1, 2, 3, 40] {
            let visits = travelling(&rig, &vec![one.clone(); count], START);
            assert_eq!(visits.len(), count);
        }
    }

    #[test]
    fn two_thousand_poses_take_seconds_at_most() {
        let rig = Rig::built_in().unwrap();
        let candidates = candidates(&rig, &Schedule::LowDiscrepancy { count: 2_000 });
        let visits = travelling(&rig, &candidates, START);
        assert_eq!(visits.len(), 2_000);
    }
}
