//! The boundary of one polygon in legs, each with the places where it comes near the other polygon's
//! boundary at its ends: there the inner integral bends, and the places of a rule are to crowd. It
//! knows geometry only.

use glam::DVec3;

/// An edge: its start, its direction, its length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub(super) start: DVec3,
    pub(super) along: DVec3,
    pub(super) length: f64,
    /// Which vertex it starts from.
    pub(super) vertex: usize,
}

/// A part of an edge, from `near` by `reach`, in parts of its length, backwards if that is negative.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leg {
    pub(super) edge: usize,
    pub(super) near: f64,
    pub(super) reach: f64,
    /// Whether the places are to crowd at the near end.
    pub(super) is_graded: bool,
}

impl Leg {
    /// The share of the reach at s in [0, 1], and how it grows.
    pub(super) fn share(&self, s: f64) -> (f64, f64) {
        if self.is_graded {
            let fourth = s * s * s * s;
            (fourth * s, 5.0 * fourth)
        } else {
            (s, 1.0)
        }
    }
}

pub(super) fn edges(vertices: &[DVec3]) -> Vec<Edge> {
    let ends = (0..vertices.len()).map(|i| (i, vertices[i], vertices[(i + 1) % vertices.len()]));
    ends.filter_map(|(vertex, start, end)| {
        let length = (end - start).length();
        let along = (end - start) / length;
        (length > 0.0).then_some(Edge { start, along, length, vertex })
    })
    .collect()
}

/// All edges in legs.
pub(super) fn legs(outer: &[Edge], inner: &[Edge]) -> Vec<Leg> {
    let mut legs = Vec::with_capacity(3 * outer.len());
    for (index, edge) in outer.iter().enumerate() {
        let mut turns = turns(edge, inner);
        turns.insert(0, (0.0, f64::INFINITY));
        turns.push((1.0, f64::INFINITY));
        turns.dedup_by(|next, last| {
            let gap = next.0 - last.0;
            // Nearer to each other than to what bends them: one is enough, an end for sure.
            let is_one = gap <= 1e-9 || (gap < last.1.min(next.1) && last.0 > 0.0 && next.0 < 1.0);
            if is_one {
                last.1 = last.1.min(next.1);
            }
            is_one
        });
        if let Some(last) = turns.last_mut() {
            last.0 = 1.0;
        }
        for pair in turns.windows(2) {
            let [(from, at_from), (to, at_to)] = [pair[0], pair[1]];
            let span = to - from;
            let bends = |distance: f64| distance < NEAR * span;
            let leg = |near, reach, is_graded| Leg { edge: index, near, reach, is_graded };
            match (bends(at_from), bends(at_to)) {
                (true, true) => {
                    legs.push(leg(from, 0.5 * span, true));
                    legs.push(leg(to, -0.5 * span, true));
                }
                (true, false) => legs.push(leg(from, span, true)),
                (false, true) => legs.push(leg(to, -span, true)),
                (false, false) => legs.push(leg(from, span, false)),
            }
        }
    }
    legs
}

/// Nearer than this, in parts of the leg, the other boundary makes it bend.
const NEAR: f64 = 0.25;

/// Where an edge comes nearest to the vertices and edges of the other boundary, and how near, in parts of
/// its length; rising, and only where that is near.
fn turns(edge: &Edge, inner: &[Edge]) -> Vec<(f64, f64)> {
    let mut turns = Vec::with_capacity(2 * inner.len());
    let mut add = |t: f64, distance: f64| {
        if distance < NEAR * edge.length {
            turns.push((t, distance / edge.length));
        }
    };
    for other in inner {
        let offset = other.start - edge.start;
        let t = (offset.dot(edge.along) / edge.length).clamp(0.0, 1.0);
        add(t, (offset - edge.along * (t * edge.length)).length());
        // Of lines that cross each other in space.
        let cosine = edge.along.dot(other.along);
        let sine_squared = edge.along.cross(other.along).length_squared();
        if sine_squared > 1e-12 {
            let (p, q) = (offset.dot(edge.along), offset.dot(other.along));
            let t = (p - cosine * q) / sine_squared / edge.length;
            let u = (cosine * p - q) / sine_squared / other.length;
            if (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u) {
                let between = offset + other.along * (u * other.length);
                add(t, (between - edge.along * (t * edge.length)).length());
            }
        }
    }
    turns.sort_by(|a, b| a.0.total_cmp(&b.0));
    turns
}
