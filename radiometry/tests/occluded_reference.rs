//! Every reference case of a source behind an occluder, at its own tolerance and within the bound
//! that comes with the answer.

use glam::DVec3;
use radiometry::projected::{Occluder, Receiver, Source, occluded_by};
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use radiometry::{DomainError, Estimate, EstimateError, Tolerance};
use serde_json::Value;

const CASES: &str = include_str!("data/cases-occluded.jsonl");
/// Sources from 1e-12 rad up, and several bodies before one source: integrated over rings about the
/// source's middle, the visible part of each ring in closed form, with 50 digits (mpmath).
const SMALL: &str = include_str!("data/cases-occluded-small.jsonl");

#[test]
fn every_reference_case_is_met_within_its_bound() {
    let cases: Vec<Value> = CASES.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(cases.len(), 74, "a case got lost");
    let misses: Vec<String> = cases.iter().filter_map(miss).collect();
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
}

#[test]
fn sources_as_small_as_stars_are_met_to_ten_digits_of_the_whole() {
    let cases: Vec<Value> = SMALL.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(cases.len(), 39, "a case got lost");
    let misses: Vec<String> = cases.iter().filter_map(miss).collect();
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
}

/// What went wrong with a case, if anything did.
fn miss(case: &Value) -> Option<String> {
    let expected: f64 = case["expected"].as_str().expect("text").parse().expect("a number");
    let tolerance =
        case["abs_tol"].as_f64().unwrap() + case["rel_tol"].as_f64().unwrap() * expected.abs();
    let label = format!("{} ({})", case["id"], case["note"]);
    match answer(&case["inputs"]) {
        Ok(Estimate { value, error_bound, evaluations }) => {
            let error = (value - expected).abs();
            // A value that the reference has with 17 digits.
            let allowed = tolerance.min(error_bound + 2e-16 * expected);
            (error > allowed).then(|| {
                format!(
                    "{label}: got {value:e} ± {error_bound:e}, expected {expected:e} ± \
                     {tolerance:e}, off by {error:e} ({evaluations} evaluations)"
                )
            })
        }
        Err(error) => Some(format!("{label}: {error}")),
    }
}

fn vector(value: &Value) -> DVec3 {
    let component = |i: usize| value[i].as_f64().expect("a component");
    DVec3::new(component(0), component(1), component(2))
}

fn answer(inputs: &Value) -> Result<Estimate, EstimateError> {
    let receiver = Receiver::new(vector(&inputs["point"]), vector(&inputs["normal"]))?;
    let tolerance = Tolerance::from_relative(inputs["relative_tolerance"].as_f64().unwrap())?;
    let occluders: Vec<Occluder> = match inputs["occluders"].as_array() {
        Some(bodies) => bodies.iter().map(occluder).collect::<Result<_, _>>()?,
        None => vec![occluder(&inputs["occluder"])?],
    };
    occluded_by(&receiver, &source(&inputs["source"])?, &occluders, tolerance)
}

fn source(shape: &Value) -> Result<Source, DomainError> {
    Ok(match shape["kind"].as_str().expect("kind") {
        "disk" => Source::Disk(disk(shape)?),
        "sphere" => Source::Sphere(sphere(shape)?),
        "polygon" => Source::Polygon(polygon(shape)?),
        other => panic!("no source is a {other}"),
    })
}

fn occluder(shape: &Value) -> Result<Occluder, DomainError> {
    Ok(match shape["kind"].as_str().expect("kind") {
        "half-plane" => {
            let number = |key: &str| shape[key].as_f64().expect("a number");
            Occluder::HalfPlane(HalfPlane::new(number("x_max"), number("z"))?)
        }
        "disk" => Occluder::Disk(disk(shape)?),
        "sphere" => Occluder::Sphere(sphere(shape)?),
        "polygon" => Occluder::Polygon(polygon(shape)?),
        other => panic!("no occluder is a {other}"),
    })
}

fn polygon(shape: &Value) -> Result<Polygon, DomainError> {
    Polygon::new(shape["vertices"].as_array().expect("vertices").iter().map(vector).collect())
}

/// Horizontal, as all in these cases are.
fn disk(shape: &Value) -> Result<Disk, DomainError> {
    Disk::new(vector(&shape["center"]), DVec3::Z, shape["radius"].as_f64().expect("radius"))
}

fn sphere(shape: &Value) -> Result<Sphere, DomainError> {
    Sphere::new(vector(&shape["center"]), shape["radius"].as_f64().expect("radius"))
}
