//! The route of general polygons, run on families that have a closed form: shared edges, gaps down to
//! 1e-9, aspects up to 1e8, far apart, flat wedges. Ten digits and a bound that holds, everywhere.

use glam::{DQuat, DVec3};
use radiometry::form_factor::{
    aligned_rectangles, perpendicular_offset_rectangles, polygons, wedge_rectangles,
};
use radiometry::shape::Polygon;
use radiometry::{EstimateError, Tolerance};
use serde_json::Value;

const CASES: &str = include_str!("data/cases-form-factors.jsonl");
/// Of a closed form that the polygons are held against.
const CLOSED: f64 = 2e-13;

fn rectangle(corner: DVec3, a: DVec3, b: DVec3) -> Polygon {
    Polygon::new(vec![corner, corner + a, corner + a + b, corner + b]).unwrap()
}

/// Misses of ten digits, or of the bound; `known` is how well the exact value is known.
fn misses(what: &str, from: &Polygon, to: &Polygon, exact: f64, known: f64) -> Option<String> {
    let tolerance = Tolerance::from_relative(1e-10).unwrap();
    match polygons(from, to, tolerance) {
        Err(error) => Some(format!("{what}: {error}")),
        Ok(found) => {
            let off = (found.value - exact).abs();
            let is_met = off <= found.error_bound + known * exact && off <= 1.1e-10 * exact;
            (!is_met).then(|| format!("{what}: {found:?}, expected {exact:e}"))
        }
    }
}

#[test]
fn every_reference_case_of_polygons_is_met_to_ten_digits() {
    let mut found = Vec::new();
    let mut count = 0;
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        if case["quantity"] != "form-factor-polygons" {
            continue;
        }
        let polygon = |key: &str| {
            let number = |value: &Value| value.as_f64().expect("a coordinate");
            let vertex = |v: &Value| DVec3::new(number(&v[0]), number(&v[1]), number(&v[2]));
            let vertices = case["inputs"][key].as_array().expect("vertices");
            Polygon::new(vertices.iter().map(vertex).collect()).unwrap()
        };
        let exact: f64 = case["expected"].as_str().expect("text").parse().expect("a number");
        let said = case["id"].to_string();
        found.extend(misses(&said, &polygon("from"), &polygon("to"), exact, 3e-16));
        count += 1;
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    assert_eq!(count, 33);
}

#[test]
fn parallel_rectangles_have_ten_digits_over_any_gap_and_offset() {
    let mut found = Vec::new();
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    for gap in [1e-9, 1e-8, 1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4] {
        for (shift, length) in [
            (0.0, 1.0),
            (1.0, 1.0),
            (0.5, 1.0),
            (1.0 + 1e-6, 1.0),
            (2.0, 0.25),
            (0.0, 1e4),
            (1.0, 1e3),
        ] {
            let from = rectangle(DVec3::ZERO, x, y * length);
            let to = rectangle(x * shift + z * gap, x, y * length);
            let unit = [0.0, 1.0];
            let (along, across) = ([0.0, length], [shift, shift + 1.0]);
            let exact = aligned_rectangles(unit, along, across, along, gap).unwrap().ratio();
            let said = format!("gap {gap:e}, shift {shift}, length {length}");
            found.extend(misses(&said, &from, &to, exact, CLOSED));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn floors_and_walls_have_ten_digits_whatever_their_aspect() {
    let mut found = Vec::new();
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    for gap in [0.0, 1e-9, 1e-6, 1e-3, 1.0] {
        for (width, height, length) in [
            (1.0, 1.0, 1.0),
            (1.0, 1.0, 1e4),
            (1.0, 1.0, 1e-4),
            (1e4, 1.0, 1.0),
            (1e-4, 1.0, 1.0),
            (1e-8, 1.0, 1.0),
            (1.0, 1.0, 1e8),
            (1e8, 1.0, 1.0),
        ] {
            let from = rectangle(x * gap, x * width, y * length);
            let to = rectangle(z * gap, y * length, z * height);
            let (floor, wall) = ([gap, gap + width], [gap, gap + height]);
            let edge = [0.0, length];
            // What the polygons really have, since gap + width rounds.
            let exact = perpendicular_offset_rectangles(floor, edge, wall, edge).unwrap().ratio();
            let said = format!("gap {gap:e}, {width:e} x {height:e} x {length:e}");
            found.extend(misses(&said, &from, &to, exact, CLOSED));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn wedges_have_ten_digits_from_sharp_to_flat() {
    let mut found = Vec::new();
    // With sines and cosines that are doubles, nearly.
    for (sin, cos) in
        [(7.0, 24.0), (3.0, 4.0), (1.0, 0.0), (4.0, -3.0), (7.0, -24.0), (39.0, -760.0)]
    {
        let size = f64::hypot(sin, cos);
        for (a, b, length) in [(1.0, 1.0, 1.0), (25.0, 25.0, 10.0), (1.0, 1e-4, 2.0)] {
            let arm = DVec3::new(cos, 0.0, sin) * (b / size);
            let from = rectangle(DVec3::ZERO, DVec3::X * a, DVec3::Y * length);
            let to = rectangle(DVec3::ZERO, DVec3::Y * length, arm);
            let exact = wedge_rectangles(a, b, length, cos / size, Tolerance::FINE).unwrap().value;
            let said = format!("{a} {b} {length}, cosine {}", cos / size);
            // The arm's vertex is rounded, which a flat wedge notices.
            found.extend(misses(&said, &from, &to, exact, 1e-12));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn a_thin_gap_anywhere_and_in_any_place_keeps_its_digits() {
    let mut found = Vec::new();
    let whole = |x: DVec3| (x * 1024.0).round() / 1024.0;
    for (i, gap) in [1e-3, 1e-5, 1e-6].into_iter().enumerate() {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.2, -2.0 + i as f64);
        // The gap is known to a rounding of the coordinates alone.
        let known = 2e-15 / gap;
        let at = |corner: DVec3| {
            let moved = |x: DVec3| turn * (corner + x) + whole(DVec3::new(0.3, -1.0, 0.2));
            let corners = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
            Polygon::new(corners.map(moved).to_vec()).unwrap()
        };
        let (from, to) = (at(DVec3::ZERO), at(DVec3::new(1.0, 0.0, gap)));
        let unit = [0.0, 1.0];
        let exact = aligned_rectangles(unit, unit, [1.0, 2.0], unit, gap).unwrap().ratio();
        match polygons(&from, &to, Tolerance::from_relative(1e-9).unwrap()) {
            Ok(factor) | Err(EstimateError::Unmet { estimate: factor, .. }) => {
                let off = (factor.value - exact).abs();
                if off > factor.error_bound + known * exact || factor.error_bound > 1e-9 * exact {
                    found.push(format!("gap {gap}: {factor:?} {exact:e}"));
                }
            }
            Err(error) => found.push(format!("gap {gap}: {error}")),
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
