//! Every reference case at its own tolerance: what breaks here has lost digits that it used to have.

use std::collections::BTreeSet;

use glam::DVec3;
use radiometry::basis::{legendre, zernike};
use radiometry::quadrature::Sum;
use radiometry::quantity::SolidAngle;
use radiometry::throughput::CoaxialDisks;
use radiometry::{DomainError, direction, solid_angle};
use serde_json::Value;

const CASES: &str = include_str!("data/cases.jsonl");

#[test]
fn every_reference_case_is_met() {
    let mut kinds = BTreeSet::new();
    let mut misses = Vec::new();
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        kinds.insert(case["quantity"].as_str().expect("quantity").to_owned());
        if let Some(miss) = miss(&case) {
            misses.push(miss);
        }
    }
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
    assert_eq!(kinds.len(), 16, "a kind of case got lost: {kinds:?}");
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
            "{} {}: got {got:e}, expected {expected:e} ± {tolerance:e} ({})",
            text("id"),
            text("quantity"),
            text("note")
        )),
        Err(error) => Some(format!("{} {}: {error}", text("id"), text("quantity"))),
    }
}

fn answer(quantity: &str, inputs: &Value) -> Result<f64, DomainError> {
    let number = |key: &str| inputs[key].as_f64().unwrap_or_else(|| panic!("{quantity}: {key}"));
    let index = |key: &str| usize::try_from(inputs[key].as_u64().expect(key)).expect(key);
    let vector = |key: &str| {
        let list = &inputs[key];
        DVec3::new(
            list[0].as_f64().expect(key),
            list[1].as_f64().expect(key),
            list[2].as_f64().expect(key),
        )
    };
    Ok(match quantity {
        "angle-between-vectors" => direction::angle_between(vector("a"), vector("b")),
        "angular-distance" => direction::angular_distance(
            number("theta1"),
            number("phi1"),
            number("theta2"),
            number("phi2"),
        ),
        "annulus-solid-angle" => solid_angle::annulus(number("inner"), number("outer"))?.sr(),
        "cone-half-angle" => {
            solid_angle::cone_half_angle(SolidAngle::from_sr(number("solid_angle")))?
        }
        "cone-projected-solid-angle" => solid_angle::cone_projected(number("half_angle"))?.sr(),
        "cone-solid-angle" => solid_angle::cone(number("half_angle"))?.sr(),
        "direction-phi" => direction::angles(vector("direction")).1,
        "direction-theta" => direction::angles(vector("direction")).0,
        "disk-solid-angle" => solid_angle::disk(number("radius"), number("distance"))?.sr(),
        "form-factor-coaxial-disks" => {
            CoaxialDisks::new(number("r1"), number("r2"), number("h"))?.form_factor().ratio()
        }
        "legendre" => legendre::polynomial(index("l"), number("x"))?,
        "orthonormal-basis-defect" => defect(vector("normal")),
        "shortest-rotation" => direction::shortest_rotation(number("from"), number("to")),
        "sum" => terms(inputs).into_iter().collect::<Sum>().value(),
        "wrap-angle" => direction::wrap(number("angle")),
        "zernike-radial" => zernike::radial(index("n"), index("m"), number("r"))?,
        other => panic!("nothing answers {other}"),
    })
}

/// The largest deviation of the frame on a normal from orthonormality.
fn defect(normal: DVec3) -> f64 {
    let (tangent, bitangent) = direction::frame(normal);
    let products = [
        tangent.dot(normal),
        bitangent.dot(normal),
        tangent.dot(bitangent),
        tangent.length() - 1.0,
        bitangent.length() - 1.0,
    ];
    products.into_iter().map(f64::abs).fold(0.0, f64::max)
}

fn terms(inputs: &Value) -> Vec<f64> {
    if let Some(values) = inputs["values"].as_array() {
        return values.iter().map(|value| value.as_f64().expect("values")).collect();
    }
    let generator = &inputs["generator"];
    assert_eq!(generator["kind"], "repeat", "the one generator in these cases");
    let count = usize::try_from(generator["n"].as_u64().expect("n")).expect("n");
    vec![generator["value"].as_f64().expect("value"); count]
}
