//! Every reference case of solid angles and projected solid angles, at its own tolerance.

use std::collections::BTreeMap;

use glam::DVec3;
use radiometry::projected::{self, Receiver};
use radiometry::shape::{Disk, Polygon, Sphere};
use radiometry::{DomainError, solid_angle};
use serde_json::Value;

const CASES: &str = include_str!("data/cases-projected.jsonl");

#[test]
fn every_reference_case_is_met() {
    let mut count_by_kind = BTreeMap::new();
    let mut misses = Vec::new();
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        let kind = case["quantity"].as_str().expect("quantity").to_owned();
        *count_by_kind.entry(kind).or_insert(0) += 1;
        misses.extend(miss(&case));
    }
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
    let counts: Vec<i32> = count_by_kind.into_values().collect();
    assert_eq!(counts, [5, 58, 39, 30, 29, 5, 2, 9], "a case got lost");
}

/// What went wrong with a case, if anything did.
fn miss(case: &Value) -> Option<String> {
    let expected: f64 = case["expected"].as_str().expect("text").parse().expect("a number");
    let tolerance =
        case["abs_tol"].as_f64().unwrap() + case["rel_tol"].as_f64().unwrap() * expected.abs();
    let text = |key: &str| case[key].as_str().unwrap_or("?").to_owned();
    match answer(&text("quantity"), &case["inputs"]) {
        Ok(got) if (got - expected).abs() <= tolerance => None,
        Ok(got) => Some(format!(
            "{} {}: got {got:e}, expected {expected:e} ± {tolerance:e} ({:e} relative; {})",
            text("id"),
            text("quantity"),
            got / expected - 1.0,
            text("note")
        )),
        Err(error) => Some(format!("{} {}: {error}", text("id"), text("quantity"))),
    }
}

fn vector(value: &Value) -> DVec3 {
    let component = |i: usize| value[i].as_f64().expect("a component");
    DVec3::new(component(0), component(1), component(2))
}

fn polygon(value: &Value) -> Result<Polygon, DomainError> {
    Polygon::new(value["vertices"].as_array().expect("vertices").iter().map(vector).collect())
}

fn sphere(value: &Value) -> Result<Sphere, DomainError> {
    Sphere::new(vector(&value["center"]), value["radius"].as_f64().expect("radius"))
}

fn answer(quantity: &str, inputs: &Value) -> Result<f64, DomainError> {
    let number = |key: &str| inputs[key].as_f64().unwrap_or_else(|| panic!("{quantity}: {key}"));
    let corner = |key: &str| vector(&inputs[key]);
    let receiver = || Receiver::new(corner("point"), corner("normal"));
    Ok(match quantity {
        "triangle-solid-angle" => {
            solid_angle::triangle(corner("a"), corner("b"), corner("c"))?.sr()
        }
        "signed-triangle-solid-angle" => {
            let corners = (corner("a"), corner("b"), corner("c"));
            solid_angle::triangle_signed(corner("point"), corners.0, corners.1, corners.2)?.sr()
        }
        "disk-projected-solid-angle" => {
            projected::disk_parallel(number("radius"), number("distance"), number("offset"))?.sr()
        }
        "tilted-disk-projected-solid-angle" => {
            let angle = number("normal_angle");
            projected::disk_tilted(number("radius"), number("distance"), angle)?.sr()
        }
        "sphere-projected-solid-angle" => {
            let angle = number("normal_angle");
            projected::sphere_tilted(number("radius"), number("distance"), angle)?.sr()
        }
        "projected-solid-angle-of-disk" => {
            let disk = Disk::new(corner("center"), corner("axis"), number("radius"))?;
            projected::disk(&receiver()?, &disk)?.sr()
        }
        "projected-solid-angle-of-sphere" => {
            projected::sphere(&receiver()?, &sphere(inputs)?)?.sr()
        }
        "polygon-projected-solid-angle" => {
            projected::polygon(&receiver()?, &polygon(inputs)?)?.sr()
        }
        other => panic!("nothing answers {other}"),
    })
}
