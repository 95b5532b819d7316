//! Moments and mean shadows against the reference cases, each at its own tolerance, and the laws of
//! merging.

use radiometry::DomainError;
use radiometry::convex::{ConvexBody, mean_projected_area};
use radiometry::moments::{self, Moments};
use serde_json::Value;

const CASES: &str = include_str!("data/cases-statistics.jsonl");

#[test]
fn every_reference_case_is_met() {
    let mut misses = Vec::new();
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        let expected: f64 = case["expected"].as_str().expect("text").parse().expect("a number");
        let relative = case["rel_tol"].as_f64().expect("rel_tol");
        let allowed = case["abs_tol"].as_f64().expect("abs_tol") + relative * expected.abs();
        let got = answer(case["quantity"].as_str().expect("quantity"), &case["inputs"]);
        if !got.as_ref().is_ok_and(|got| (got - expected).abs() <= allowed) {
            misses.push(format!("{}: {got:?}, expected {expected:e} ± {allowed:e}", case["id"]));
        }
    }
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
    assert_eq!(CASES.lines().count(), 17);
}

fn answer(quantity: &str, inputs: &Value) -> Result<f64, DomainError> {
    if quantity == "mean-projected-area" {
        return Ok(mean_projected_area(body(&inputs["shape"]))?.m2());
    }
    if quantity == "merged-variance" {
        let mut merged = Moments::default();
        for part in inputs["parts"].as_array().expect("parts") {
            let n = |key: &str| part[key].as_f64().expect(key);
            merged.merge(&Moments::from_parts(n("n"), n("mean"), n("m2"))?);
        }
        return Ok(merged.variance());
    }
    let (values, weights) = readings(inputs);
    match quantity {
        "weighted-mean" => moments::weighted_mean(&values, &weights),
        "weighted-variance" => moments::weighted_variance(&values, &weights),
        "weighted-std" => moments::weighted_std(&values, &weights),
        "sample-variance" => moments::sample_variance(&values),
        other => panic!("nothing answers {other}"),
    }
}

fn body(shape: &Value) -> ConvexBody {
    let n = |key: &str| shape[key].as_f64().expect(key);
    match shape["kind"].as_str().expect("kind") {
        "sphere" => ConvexBody::Sphere { radius_m: n("radius") },
        "box" => ConvexBody::Box { edges_m: [n("a"), n("b"), n("c")] },
        "cylinder" => ConvexBody::Cylinder { radius_m: n("radius"), height_m: n("height") },
        "cone" => ConvexBody::Cone { radius_m: n("radius"), height_m: n("height") },
        "ellipsoid" => ConvexBody::Ellipsoid { semi_axes_m: [n("a"), n("b"), n("c")] },
        other => panic!("no body is a {other}"),
    }
}

fn readings(inputs: &Value) -> (Vec<f64>, Vec<f64>) {
    let list = |key: &str| -> Option<Vec<f64>> {
        let list = inputs[key].as_array()?;
        Some(list.iter().map(|value| value.as_f64().expect(key)).collect())
    };
    if let Some(values) = list("values") {
        return (values, list("weights").unwrap_or_default());
    }
    let generator = &inputs["generator"];
    let n = |key: &str| generator[key].as_f64().expect(key);
    match generator["kind"].as_str().expect("kind") {
        "stride" => (0..generator["n"].as_u64().expect("n"))
            .map(|i| {
                let k = (i * 7919) % 10007;
                (n("offset") + n("amp") * k as f64, 1.0 + (i % 5) as f64)
            })
            .unzip(),
        "alternating" => {
            let pairs = usize::try_from(generator["pairs"].as_u64().expect("pairs")).unwrap();
            let pair = [n("low"), n("high")];
            (core::iter::once(n("first")).chain(pair.repeat(pairs)).collect(), Vec::new())
        }
        other => panic!("no generator is called {other}"),
    }
}

#[test]
fn running_moments_keep_up_with_the_list_however_they_are_grouped() {
    let offset = 1e9;
    let readings: Vec<(f64, f64)> = (0..10_000_u32)
        .map(|i| (offset + f64::from((i * 7919) % 10_007) * 1e-4, 1.0 + f64::from(i % 5)))
        .collect();
    let (values, weights): (Vec<f64>, Vec<f64>) = readings.iter().copied().unzip();
    let exact = moments::weighted_variance(&values, &weights).unwrap();
    for group in [1, 7, 100, 3333] {
        let mut all = Moments::default();
        for chunk in readings.chunks(group) {
            let mut part = Moments::default();
            for (value, weight) in chunk {
                part.add(*value, *weight).unwrap();
            }
            all.merge(&part);
        }
        let mean = moments::weighted_mean(&values, &weights).unwrap();
        assert!(
            (all.mean() - mean).abs() <= 2.0 * f64::EPSILON * offset,
            "{group}: {}",
            all.mean()
        );
        assert!((all.variance() / exact - 1.0).abs() < 1e-12, "{group}: {:e}", all.variance());
    }
}

#[test]
fn what_has_no_mean_is_refused() {
    assert!(moments::weighted_mean(&[], &[]).is_err());
    assert!(moments::weighted_mean(&[1.0], &[1.0, 2.0]).is_err());
    assert!(moments::weighted_mean(&[1.0, 2.0], &[1.0, -1.0]).is_err());
    assert!(moments::weighted_mean(&[f64::NAN], &[1.0]).is_err());
    assert!(moments::weighted_variance(&[-1e200, 1e200], &[1.0, 1.0]).is_err());
    assert!(moments::sample_variance(&[1.0]).is_err());
    assert!(moments::sum(&[f64::MAX, f64::MAX]).is_err());
    assert!(Moments::from_parts(0.0, 1.0, 0.0).is_err());
    let widest = moments::weighted_mean(&[f64::MAX, f64::MAX, -f64::MAX], &[1.0; 3]).unwrap();
    assert!((widest / f64::MAX - 1.0 / 3.0).abs() < 1e-15);
}
