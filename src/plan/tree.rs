//! Nearest neighbours in rig time: a k-d tree over axis positions, from which points are taken
//! out as they are visited.
//!
//! The distance of two places is the time of the move between them, the longest of the axes'
//! times, and then until the axes are still. Since each axis's time grows with its own distance, one axis alone bounds the whole from
//! below, and a tree that splits one axis at a time finds the true nearest.
//!
//! It knows times and places, not targets. Every answer depends on its input alone.

use crate::rig::{Approach, AxisPositions, Rig};

/// Nearer than this, in radians or metres, an axis does not move: less than any rig's count.
const STILL: f64 = 1e-9;

/// The rig's axes as far as the time of a move goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct MoveTime {
    speed: [f64; 4],
    acceleration: [f64; 4],
    settle_s: [f64; 4],
    /// Where targets are reached from, as a sign, and how far beyond them the way there turns.
    run_up: [Option<(f64, f64)>; 4],
}

impl MoveTime {
    pub(super) fn of(rig: &Rig) -> Self {
        Self {
            speed: rig.axes.each_ref().map(|axis| axis.speed),
            acceleration: rig.axes.each_ref().map(|axis| axis.acceleration),
            settle_s: rig.axes.each_ref().map(|axis| axis.settle.as_secs_f64()),
            run_up: rig.axes.each_ref().map(|axis| match axis.approach {
                Approach::Either => None,
                Approach::Negative => Some((-1.0, axis.run_up)),
                Approach::Positive => Some((1.0, axis.run_up)),
            }),
        }
    }

    /// The same where nothing waits for the axes to be still: what is left dies away on the way.
    pub(super) fn without_settling(self) -> Self {
        Self { settle_s: [0.0; 4], ..self }
    }

    /// Seconds from one place to another, until the axes are still, but for where they have to come
    /// from: symmetric, and at most [`Self::directed`].
    pub(super) fn between(&self, a: &AxisPositions, b: &AxisPositions) -> f64 {
        let along = |axis: usize| self.along(axis, a.0[axis] - b.0[axis]);
        along(0).max(along(1)).max(along(2)).max(along(3)) + self.settling(a, b)
    }

    /// Seconds from one place to another as they are driven: an axis with play comes from its own
    /// side, and turns round where its way there has another one.
    pub(super) fn directed(&self, from: &AxisPositions, to: &AxisPositions) -> f64 {
        let (mut via, mut has_via) = (*to, false);
        for axis in 0..4 {
            let way = to.0[axis] - from.0[axis];
            if let Some((side, run_up)) = self.run_up[axis]
                && way.abs() > STILL
                && way * side < 0.0
            {
                via.0[axis] = to.0[axis] - side * run_up;
                has_via = true;
            }
        }
        if !has_via {
            return self.between(from, to);
        }
        let moving = |a: &AxisPositions, b: &AxisPositions| {
            let along = |axis: usize| self.along(axis, a.0[axis] - b.0[axis]);
            along(0).max(along(1)).max(along(2)).max(along(3))
        };
        moving(from, &via) + moving(&via, to) + self.settling(from, to)
    }

    /// Whether some axis has a side of its own.
    pub(super) fn is_one_sided(&self) -> bool {
        self.run_up.iter().any(Option::is_some)
    }

    /// Of the axes that move the one that takes longest.
    fn settling(&self, a: &AxisPositions, b: &AxisPositions) -> f64 {
        let of = |axis: usize| {
            if (a.0[axis] - b.0[axis]).abs() > STILL { self.settle_s[axis] } else { 0.0 }
        };
        of(0).max(of(1)).max(of(2)).max(of(3))
    }

    fn along(&self, axis: usize, distance: f64) -> f64 {
        rest_to_rest_s(distance.abs(), self.speed[axis], self.acceleration[axis])
    }
}

/// Seconds over a distance with a trapezoid of speed, or a triangle where it is short. The device's
/// own profile ([`firmware_protocol::Trapezoid`]) keeps its last digit, which costs time, and a
/// choice between ways doesn't need it.
fn rest_to_rest_s(distance: f64, speed: f64, acceleration: f64) -> f64 {
    if distance * acceleration <= speed * speed {
        2.0 * libm::sqrt(distance / acceleration)
    } else {
        distance / speed + speed / acceleration
    }
}

/// The tree. Points are called by their place in the list that it was built from.
///
/// A subtree is a range of slots; its root is the middle one, with the lower half of the points,
/// along the root's axis, before it and the upper half behind it.
#[derive(Debug)]
pub(super) struct Tree<'p> {
    points: &'p [AxisPositions],
    time: MoveTime,
    /// Slot to point.
    point_at: Vec<u32>,
    /// Point to slot.
    slot_of: Vec<u32>,
    /// Slot to the axis that it splits.
    axis_at: Vec<u8>,
    /// Slot to the points left in its subtree.
    left_at: Vec<u32>,
    is_taken: Vec<bool>,
}

impl<'p> Tree<'p> {
    /// A tree of all points; fewer than 2^32 of them.
    pub(super) fn new(points: &'p [AxisPositions], time: MoveTime) -> Self {
        let count = u32::try_from(points.len()).unwrap_or(u32::MAX);
        let mut tree = Self {
            points,
            time,
            point_at: (0..count).collect(),
            slot_of: vec![0; points.len()],
            axis_at: vec![0; points.len()],
            left_at: vec![0; points.len()],
            is_taken: vec![false; points.len()],
        };
        tree.split(0, points.len());
        for (slot, point) in (0..count).zip(&tree.point_at) {
            tree.slot_of[*point as usize] = slot;
        }
        tree
    }

    /// Takes a point out; it is found no more.
    pub(super) fn take(&mut self, point: u32) {
        let slot = self.slot_of[point as usize] as usize;
        if std::mem::replace(&mut self.is_taken[slot], true) {
            return;
        }
        let (mut low, mut high) = (0_usize, self.points.len());
        loop {
            let middle = low.midpoint(high);
            self.left_at[middle] -= 1;
            match slot.cmp(&middle) {
                std::cmp::Ordering::Less => high = middle,
                std::cmp::Ordering::Equal => return,
                std::cmp::Ordering::Greater => low = middle + 1,
            }
        }
    }

    /// The point that is soonest reached from `from`, if any is left.
    pub(super) fn nearest(&self, from: &AxisPositions) -> Option<u32> {
        let mut found = Vec::with_capacity(2);
        self.search(0, self.points.len(), from, 1, &mut found);
        found.first().map(|(_, point)| *point)
    }

    /// Up to `count` points, the soonest reached from `from` first.
    pub(super) fn nearest_few(&self, from: &AxisPositions, count: usize) -> Vec<u32> {
        let mut found = Vec::with_capacity(count + 1);
        self.search(0, self.points.len(), from, count, &mut found);
        found.into_iter().map(|(_, point)| point).collect()
    }

    /// The depth is that of a balanced tree: at most 32.
    fn split(&mut self, low: usize, high: usize) {
        if low >= high {
            return;
        }
        let middle = low.midpoint(high);
        let axis = self.widest_axis(low, high);
        let points = self.points;
        let position = |point: &u32| points[*point as usize].0[axis];
        self.point_at[low..high].select_nth_unstable_by(middle - low, |a, b| {
            position(a).total_cmp(&position(b)).then(a.cmp(b))
        });
        self.axis_at[middle] = u8::try_from(axis).unwrap_or_default();
        self.left_at[middle] = u32::try_from(high - low).unwrap_or(u32::MAX);
        self.split(low, middle);
        self.split(middle + 1, high);
    }

    /// The axis that takes longest from one end of these points to the other.
    fn widest_axis(&self, low: usize, high: usize) -> usize {
        let (mut least, mut most) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
        for point in &self.point_at[low..high] {
            for (axis, position) in self.points[*point as usize].0.iter().enumerate() {
                least[axis] = least[axis].min(*position);
                most[axis] = most[axis].max(*position);
            }
        }
        let width = |axis: &usize| self.time.along(*axis, most[*axis] - least[*axis]);
        (0..4).max_by(|a, b| width(a).total_cmp(&width(b))).unwrap_or(0)
    }

    /// Keeps in `found`, sorted by time, the nearest `count` of itself and the points in a range.
    fn search(
        &self,
        low: usize,
        high: usize,
        from: &AxisPositions,
        count: usize,
        found: &mut Vec<(f64, u32)>,
    ) {
        let middle = low.midpoint(high);
        if low >= high || self.left_at[middle] == 0 {
            return;
        }
        let point = self.point_at[middle];
        let here = &self.points[point as usize];
        if !self.is_taken[middle] {
            let time = self.time.between(from, here);
            let place = found.partition_point(|(known, _)| *known <= time);
            if place < count {
                found.insert(place, (time, point));
                found.truncate(count);
            }
        }
        let axis = usize::from(self.axis_at[middle]);
        let beyond = from.0[axis] - here.0[axis];
        let (near, far) = if beyond <= 0.0 {
            ((low, middle), (middle + 1, high))
        } else {
            ((middle + 1, high), (low, middle))
        };
        self.search(near.0, near.1, from, count, found);
        let farthest = found.last().filter(|_| found.len() == count).map(|(time, _)| *time);
        if farthest.is_none_or(|time| self.time.along(axis, beyond) < time) {
            self.search(far.0, far.1, from, count, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn time() -> MoveTime {
        MoveTime {
            speed: [1.0, 1.0, 0.1, 0.1],
            acceleration: [2.0, 2.0, 0.5, 0.5],
            settle_s: [0.05, 0.02, 0.3, 0.0],
            run_up: [None, Some((1.0, 0.1)), None, None],
        }
    }

    fn places() -> impl Strategy<Value = Vec<AxisPositions>> {
        let coarse = (-4_i32..=4).prop_map(|i| f64::from(i) / 4.0);
        let place = proptest::array::uniform4(prop_oneof![-1.0..1.0, coarse]);
        proptest::collection::vec(place.prop_map(AxisPositions), 1..80)
    }

    proptest! {
        #[test]
        fn times_are_those_of_the_device(distance in 0.0..10.0_f64) {
            let profile = firmware_protocol::Trapezoid::new(distance, 1.0, 2.0).unwrap();
            let error_s = rest_to_rest_s(distance, 1.0, 2.0) - profile.duration_s();
            prop_assert!(error_s.abs() < 1e-14 * (1.0 + profile.duration_s()));
        }

        #[test]
        fn taking_the_nearest_until_none_is_left_agrees_with_a_plain_search(points in places()) {
            let mut tree = Tree::new(&points, time());
            let mut left: Vec<u32> = (0..).take(points.len()).collect();
            let mut here = AxisPositions([0.0; 4]);
            while let Some(found) = tree.nearest(&here) {
                let reach = |point: u32| time().between(&here, &points[point as usize]);
                let least = left.iter().map(|point| reach(*point)).fold(f64::INFINITY, f64::min);
                prop_assert!(left.contains(&found));
                prop_assert_eq!(reach(found).to_bits(), least.to_bits());
                here = points[found as usize];
                left.retain(|point| *point != found);
                tree.take(found);
                tree.take(found);
            }
            prop_assert!(left.is_empty());
        }

        #[test]
        fn a_way_that_has_to_turn_round_takes_no_less(points in places()) {
            let here = AxisPositions([0.1; 4]);
            for point in &points {
                let (there, back) = (time().directed(&here, point), time().directed(point, &here));
                let least = time().between(&here, point);
                prop_assert!(there >= least && back >= least);
                prop_assert!(there.to_bits() == least.to_bits() || back.to_bits() == least.to_bits());
            }
        }

        #[test]
        fn the_nearest_few_come_in_order(points in places(), count in 1_usize..12) {
            let tree = Tree::new(&points, time());
            let here = AxisPositions([0.1; 4]);
            let mut all: Vec<f64> = points.iter().map(|p| time().between(&here, p)).collect();
            all.sort_by(f64::total_cmp);
            all.truncate(count);
            let found = tree.nearest_few(&here, count);
            let times: Vec<f64> =
                found.iter().map(|p| time().between(&here, &points[*p as usize])).collect();
            prop_assert_eq!(times, all);
        }
    }
}
