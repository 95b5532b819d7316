//! Flat polygons in convex parts, cut by planes. It knows neither light nor bodies.

use glam::DVec3;

/// A simple polygon as convex parts in its own sense of rotation, counter-clockwise around the
/// normal: itself if it is convex, else triangles, by cutting off ears (Meisters 1975).
pub(super) fn convex_parts(vertices: &[DVec3], normal: DVec3) -> Vec<Vec<DVec3>> {
    let mut left: Vec<DVec3> = vertices.to_vec();
    left.dedup();
    if left.len() > 1 && left.first() == left.last() {
        left.pop();
    }
    if (0..left.len()).all(|i| turn(&left, i, normal) >= 0.0) {
        return vec![left];
    }
    let mut parts = Vec::with_capacity(left.len());
    while left.len() > 3 {
        let count = left.len();
        let ear = (0..count).find(|i| is_ear(&left, *i, normal));
        // Touching edges may leave no clean ear: then the one that takes the least.
        let flattest = |a: &usize, b: &usize| {
            turn(&left, *a, normal).abs().total_cmp(&turn(&left, *b, normal).abs())
        };
        let Some(at) = ear.or_else(|| (0..count).min_by(flattest)) else { break };
        let part = around(&left, at);
        if turn(&left, at, normal) > 0.0 {
            parts.push(part.to_vec());
        }
        left.remove(at);
    }
    if left.len() == 3 && turn(&left, 1, normal) > 0.0 {
        parts.push(left);
    }
    parts
}

/// A vertex between its neighbours.
fn around(vertices: &[DVec3], i: usize) -> [DVec3; 3] {
    let count = vertices.len();
    [vertices[(i + count - 1) % count], vertices[i], vertices[(i + 1) % count]]
}

/// Above 0 where the outline turns left, 0 where it goes straight on to rounding.
fn turn(vertices: &[DVec3], i: usize, normal: DVec3) -> f64 {
    let [a, b, c] = around(vertices, i);
    let (before, after) = (b - a, c - b);
    let turn = before.cross(after).dot(normal);
    let noise = 1e-14 * before.length() * after.length() * normal.length();
    // Straight back is no straight edge.
    if turn.abs() <= noise && before.dot(after) >= 0.0 { 0.0 } else { turn }
}

fn is_ear(vertices: &[DVec3], i: usize, normal: DVec3) -> bool {
    let [a, b, c] = around(vertices, i);
    if turn(vertices, i, normal) <= 0.0 {
        return false;
    }
    let left_of = |from: DVec3, to: DVec3, x: DVec3| (to - from).cross(x - from).dot(normal) >= 0.0;
    vertices.iter().filter(|x| ![a, b, c].contains(x)).all(|x| {
        let is_within = left_of(a, b, *x) && left_of(b, c, *x) && left_of(c, a, *x);
        !is_within
    })
}

/// What of a convex polygon is on the side of a plane through the origin that its normal points to,
/// and what is on the other, by the height above it less `level`.
pub(super) fn split(polygon: &[DVec3], normal: DVec3, level: f64) -> [Vec<DVec3>; 2] {
    let (mut above, mut below) =
        (Vec::with_capacity(polygon.len() + 1), Vec::with_capacity(polygon.len() + 1));
    let Some(last) = polygon.last() else { return [above, below] };
    let (mut start, mut from) = (*last, normal.dot(*last) - level);
    for end in polygon {
        let to = normal.dot(*end) - level;
        if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
            let crossing = start + (*end - start) * (from / (from - to));
            above.push(crossing);
            below.push(crossing);
        }
        if to >= 0.0 {
            above.push(*end);
        }
        if to <= 0.0 {
            below.push(*end);
        }
        (start, from) = (*end, to);
    }
    [above, below]
}

/// The part above alone.
pub(super) fn clip(polygon: &[DVec3], normal: DVec3, level: f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    let Some(last) = polygon.last() else { return kept };
    let (mut start, mut from) = (*last, normal.dot(*last) - level);
    for end in polygon {
        let to = normal.dot(*end) - level;
        if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
            kept.push(start + (*end - start) * (from / (from - to)));
        }
        if to >= 0.0 {
            kept.push(*end);
        }
        (start, from) = (*end, to);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[DVec3]) -> f64 {
        let fan = polygon.windows(2).map(|w| (w[0] - polygon[0]).cross(w[1] - polygon[0]).z / 2.0);
        fan.sum()
    }

    #[test]
    fn the_parts_of_a_polygon_are_convex_and_have_its_area() {
        let corners = |list: &[[f64; 2]]| -> Vec<DVec3> {
            list.iter().map(|v| DVec3::new(v[0], v[1], 0.0)).collect()
        };
        let room =
            corners(&[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]);
        // A slit from the outline to a hole and back.
        let frame = corners(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]);
        let star: Vec<DVec3> = (0..10)
            .map(|i| {
                let (sin, cos) = libm::sincos(f64::from(i) * core::f64::consts::PI / 5.0);
                DVec3::new(cos, sin, 0.0) * if i % 2 == 0 { 1.0 } else { 0.3 }
            })
            .collect();
        for (polygon, exact) in [(room, 4.0), (frame, 12.0), (star.clone(), area(&star))] {
            let parts = convex_parts(&polygon, DVec3::Z);
            let sum: f64 = parts.iter().map(|part| area(part)).sum();
            assert!((sum - exact).abs() < 1e-14, "{sum} for {exact}");
            for part in parts {
                assert!((0..part.len()).all(|i| turn(&part, i, DVec3::Z) >= 0.0));
            }
        }
    }
}
