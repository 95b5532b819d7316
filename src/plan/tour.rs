//! A tour of places made quicker by exchanges. It knows times and places, not targets.
//!
//! Its work is bounded, and follows from its input alone.

use std::collections::VecDeque;

use super::tree::{MoveTime, Tree};
use crate::rig::AxisPositions;

/// The neighbours that 2-opt tries at each place. More than ten brought less than half a percent
/// on even sets of 2,000 poses.
const NEIGHBOURS: usize = 10;
/// Places of a piece that is put elsewhere, at most.
const PIECE_MAX: usize = 3;
/// Places that exchanges may move in all: about a second of work.
const MOVED_MAX: u64 = 500_000_000;
/// An improvement below this, in seconds, is rounding.
const GAIN_MIN_S: f64 = 1e-9;

/// A closed tour of places, the first of which stays the first.
pub(super) struct Tour<'p> {
    places: &'p [AxisPositions],
    time: MoveTime,
    /// Place by place in the tour.
    place_at: Vec<u32>,
    /// Where each place stands in it.
    index_of: Vec<u32>,
}

/// Two legs to replace: the tour's part from index `from` to index `to` turns round.
struct Reversal {
    from: u32,
    to: u32,
}

/// A piece, by the indices of its ends, that moves between the places at `gap` and behind it.
struct Insertion {
    low: usize,
    high: usize,
    gap: usize,
    is_turned: bool,
}

impl<'p> Tour<'p> {
    pub(super) fn new(places: &'p [AxisPositions], time: MoveTime) -> Self {
        let order: Vec<u32> = (0..).take(places.len()).collect();
        Self { places, time, place_at: order.clone(), index_of: order }
    }

    /// 2-opt (Croes 1958) and the insertion of short pieces elsewhere (Or 1976) with neighbour lists
    /// and a queue of places whose legs changed (Bentley 1992), until no exchange helps or the work
    /// is used up; then, where axes have sides of their own, insertions by the times as driven, and
    /// the quicker way round. The places in their order, the first one first.
    pub(super) fn improved(mut self) -> Vec<u32> {
        let tree = Tree::new(self.places, self.time);
        let neighbours: Vec<Vec<u32>> = (0_u32..)
            .zip(self.places)
            .map(|(place, at)| {
                let mut near = tree.nearest_few(at, NEIGHBOURS + 1);
                near.retain(|other| *other != place);
                near
            })
            .collect();
        let moved = self.exchange(&neighbours, false, 0);
        if self.time.is_one_sided() {
            self.exchange(&neighbours, true, moved);
        }
        let first = self.index_of[0] as usize;
        self.place_at.rotate_left(first);
        let back: Vec<u32> = self
            .place_at
            .iter()
            .take(1)
            .chain(self.place_at.iter().skip(1).rev())
            .copied()
            .collect();
        if self.length(&back) < self.length(&self.place_at) - GAIN_MIN_S {
            return back;
        }
        self.place_at
    }

    /// Exchanges until none helps; as driven, insertions alone, since to turn a part round changes
    /// all legs in it. How many places were moved, with those that had been.
    fn exchange(&mut self, neighbours: &[Vec<u32>], as_driven: bool, mut moved: u64) -> u64 {
        let mut queue: VecDeque<u32> = self.place_at.iter().copied().collect();
        let mut is_queued = vec![true; self.places.len()];
        while let Some(place) = queue.pop_front() {
            is_queued[place as usize] = false;
            while moved <= MOVED_MAX {
                let near = &neighbours[place as usize];
                let reversal = if as_driven { None } else { self.better(place, near) };
                let ends: Vec<u32> = if let Some(reversal) = reversal {
                    let ends = self.ends(&reversal).to_vec();
                    moved += self.reverse(&reversal);
                    ends
                } else if let Some(insertion) = self.better_insertion(place, near, as_driven) {
                    let ends = self.ends_of_insertion(&insertion);
                    moved += self.insert(&insertion);
                    ends
                } else {
                    break;
                };
                for end in ends {
                    if !std::mem::replace(&mut is_queued[end as usize], true) {
                        queue.push_back(end);
                    }
                }
            }
        }
        moved
    }

    /// A short piece that begins or ends at `place` and stands better between two other places, next
    /// to a neighbour of its end's. None that would pass the list's ends, which are no end of the tour.
    fn better_insertion(
        &self,
        place: u32,
        neighbours: &[u32],
        as_driven: bool,
    ) -> Option<Insertion> {
        let leg = |a: u32, b: u32| if as_driven { self.driven(a, b) } else { self.leg(a, b) };
        let (count, at) = (self.place_at.len(), self.index(place) as usize);
        for length in 1..=PIECE_MAX.min(count.saturating_sub(3)) {
            // The piece stands from `low` to `high`, `place` at one of its ends.
            for (low, is_first) in [(Some(at), true), (at.checked_sub(length - 1), false)] {
                let Some(low) = low.filter(|low| *low >= 1 && low + length < count) else {
                    continue;
                };
                let high = low + length - 1;
                let (first, last) = (self.place_at[low], self.place_at[high]);
                let (before, after) = (self.place_at[low - 1], self.place_at[high + 1]);
                let freed = leg(before, first) + leg(last, after) - leg(before, after);
                for &near in neighbours {
                    let reach = self.leg(place, near);
                    if reach >= freed {
                        break;
                    }
                    let to = self.index(near) as usize;
                    if (low..=high).contains(&to) {
                        continue;
                    }
                    // Behind the neighbour, and before it.
                    for gap in [Some(to), to.checked_sub(1)].into_iter().flatten() {
                        if gap + 1 >= count || (low - 1..=high).contains(&gap) {
                            continue;
                        }
                        let (left, right) = (self.place_at[gap], self.place_at[gap + 1]);
                        let is_turned = (gap == to) != is_first;
                        let added = if is_turned {
                            let inner = if as_driven { self.turning(low, high) } else { 0.0 };
                            leg(left, last) + leg(first, right) + inner - leg(left, right)
                        } else {
                            leg(left, first) + leg(last, right) - leg(left, right)
                        };
                        if freed - added > GAIN_MIN_S {
                            return Some(Insertion { low, high, gap, is_turned });
                        }
                    }
                }
            }
        }
        None
    }

    /// What turning a piece round adds to its own legs, as driven.
    fn turning(&self, low: usize, high: usize) -> f64 {
        let pairs = self.place_at[low..=high].windows(2);
        pairs.map(|pair| self.driven(pair[1], pair[0]) - self.driven(pair[0], pair[1])).sum()
    }

    fn ends_of_insertion(&self, insertion: &Insertion) -> Vec<u32> {
        let Insertion { low, high, gap, .. } = *insertion;
        [low - 1, low, high, high + 1, gap, gap + 1].map(|at| self.place_at[at]).to_vec()
    }

    /// Moves the piece. How many places were moved.
    fn insert(&mut self, insertion: &Insertion) -> u64 {
        let Insertion { low, high, gap, is_turned } = *insertion;
        if is_turned {
            self.place_at[low..=high].reverse();
        }
        let length = high + 1 - low;
        let (from, to) = if gap > high {
            self.place_at[low..=gap].rotate_left(length);
            (low, gap)
        } else {
            self.place_at[gap + 1..=high].rotate_right(length);
            (gap + 1, high)
        };
        for index in from..=to {
            self.index_of[self.place_at[index] as usize] = u32::try_from(index).unwrap_or(u32::MAX);
        }
        (to + 1 - from) as u64
    }

    /// Of the whole tour, as driven.
    fn length(&self, order: &[u32]) -> f64 {
        let next = order.iter().cycle().skip(1);
        order.iter().zip(next).map(|(a, b)| self.driven(*a, *b)).sum()
    }

    /// An exchange of two legs, one of them at `place`, that shortens the tour.
    fn better(&self, place: u32, neighbours: &[u32]) -> Option<Reversal> {
        let (before, after) = (self.before(place), self.after(place));
        let (time_before, time_after) = (self.leg(before, place), self.leg(place, after));
        for &other in neighbours {
            let time = self.leg(place, other);
            if time >= time_before.max(time_after) {
                return None;
            }
            let other_after = self.after(other);
            let gain =
                time_after + self.leg(other, other_after) - time - self.leg(after, other_after);
            if gain > GAIN_MIN_S {
                return Some(Reversal { from: self.index(after), to: self.index(other) });
            }
            let other_before = self.before(other);
            let gain =
                time_before + self.leg(other_before, other) - time - self.leg(before, other_before);
            if gain > GAIN_MIN_S {
                return Some(Reversal { from: self.index(place), to: self.index(other_before) });
            }
        }
        None
    }

    /// The four places whose legs a reversal exchanges.
    fn ends(&self, reversal: &Reversal) -> [u32; 4] {
        let (first, last) =
            (self.place_at[reversal.from as usize], self.place_at[reversal.to as usize]);
        [self.before(first), first, last, self.after(last)]
    }

    /// Turns the part round, or the rest where that is shorter: the same closed tour. How many
    /// places were moved.
    fn reverse(&mut self, reversal: &Reversal) -> u64 {
        let count = self.place_at.len();
        let (from, to) = (reversal.from as usize, reversal.to as usize);
        let inside = (to + count - from) % count + 1;
        let (mut low, mut high, length) = if 2 * inside <= count {
            (from, to, inside)
        } else {
            ((to + 1) % count, (from + count - 1) % count, count - inside)
        };
        for _ in 0..length / 2 {
            self.place_at.swap(low, high);
            for index in [low, high] {
                self.index_of[self.place_at[index] as usize] =
                    u32::try_from(index).unwrap_or(u32::MAX);
            }
            low = (low + 1) % count;
            high = (high + count - 1) % count;
        }
        length as u64
    }

    fn driven(&self, a: u32, b: u32) -> f64 {
        self.time.directed(&self.places[a as usize], &self.places[b as usize])
    }

    fn leg(&self, a: u32, b: u32) -> f64 {
        self.time.between(&self.places[a as usize], &self.places[b as usize])
    }

    fn index(&self, place: u32) -> u32 {
        self.index_of[place as usize]
    }

    fn after(&self, place: u32) -> u32 {
        self.place_at[(self.index(place) as usize + 1) % self.place_at.len()]
    }

    fn before(&self, place: u32) -> u32 {
        let count = self.place_at.len();
        self.place_at[(self.index(place) as usize + count - 1) % count]
    }
}
