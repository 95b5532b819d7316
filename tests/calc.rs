//! `gonio calc --json` on every reference case at its own tolerance, on every example of its own
//! list, and on what has no meaning: the very function that answers a line.

use std::collections::{BTreeMap, BTreeSet};

use gonio::cli::calc::{answer_line, answer_words, examples};
use serde_json::{Value, json};

const CASES: &str = include_str!("data/cases.jsonl");

fn ask(quantity: &str, inputs: &Value) -> Value {
    let request = json!({"id": "x", "quantity": quantity, "inputs": inputs});
    let answer = answer_line(request.to_string().as_bytes());
    assert_eq!(answer["id"], "x");
    answer
}

#[test]
fn every_reference_case_is_met_and_within_its_error_bound() {
    let known: BTreeSet<&str> = examples().map(|(name, _)| name).collect();
    let mut misses = Vec::new();
    let mut met: BTreeMap<String, usize> = BTreeMap::new();
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        let quantity = case["quantity"].as_str().expect("a name");
        if !known.contains(quantity) {
            continue;
        }
        let answer = ask(quantity, &case["inputs"]);
        match miss(&case, &answer) {
            Some(why) => {
                misses.push(format!("{} {quantity}: {why} ({})", case["id"], case["note"]));
            }
            None => *met.entry(quantity.to_owned()).or_default() += 1,
        }
    }
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
    let rows: usize = met.values().sum();
    assert!(rows >= ROWS_MET, "{rows} rows met, once {ROWS_MET}: a quantity got lost: {met:?}");
}

/// How many reference cases are answered: it only grows.
const ROWS_MET: usize = 540;

/// What is wrong with an answer, if anything is.
fn miss(case: &Value, answer: &Value) -> Option<String> {
    if let Some(error) = answer.get("error") {
        return Some(format!("error: {error}"));
    }
    let expected = &case["expected"];
    if expected == "none" {
        let is_none = answer["value"].is_null();
        return (!is_none).then(|| format!("got {}, expected none", answer["value"]));
    }
    let text = |value: &Value| value.as_str().expect("text").parse::<f64>().expect("a number");
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let (expected, got): (Vec<f64>, Vec<f64>) = match (expected, &answer["value"]) {
        (Value::Array(expected), Value::Array(got)) => {
            (expected.iter().map(text).collect(), got.iter().map(number).collect())
        }
        (expected, got) => (vec![text(expected)], vec![number(got)]),
    };
    let absolute = number(&case["abs_tol"]);
    let relative = number(&case["rel_tol"]);
    let bound = number(&answer["error_bound"]);
    // The expected value itself is written with 17 digits, and where it may miss by anything, an
    // exact 0 was computed with some hundred.
    let written = |expected: f64| 2e-16 * expected.abs() + absolute.min(1e-100);
    let is_met = expected.len() == got.len()
        && expected.iter().zip(&got).all(|(expected, got)| {
            let error = (got - expected).abs();
            error <= absolute + relative * expected.abs() && error <= bound + written(*expected)
        });
    let worst = expected.iter().zip(&got).map(|(e, g)| (g - e).abs()).fold(0.0, f64::max);
    (!is_met).then(|| {
        format!("got {got:?}, expected {expected:?}: off by {worst:e}, error bound {bound:e}")
    })
}

#[test]
fn every_listed_example_runs() {
    for (name, words) in examples() {
        let answer = answer_words(name, &words).unwrap_or_else(|why| panic!("{name}: {why}"));
        assert!(!answer["value"].is_null(), "{name}: the example shows nothing");
        assert!(answer["unit"].is_string() && answer["error_bound"].is_number(), "{answer}");
    }
}

/// Replaces one input of an example by something else, or takes it away.
fn spoiled(inputs: &Value, key: &str, value: Option<Value>) -> Value {
    let mut inputs = inputs.as_object().expect("an object").clone();
    match value {
        Some(value) => inputs.insert(key.to_owned(), value),
        None => inputs.remove(key),
    };
    inputs.into()
}

/// One reference case of each quantity that is answered.
fn one_of_each() -> BTreeMap<String, Value> {
    let known: BTreeSet<&str> = examples().map(|(name, _)| name).collect();
    let cases = CASES.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    cases
        .map(|case| (case["quantity"].as_str().expect("a name").to_owned(), case["inputs"].clone()))
        .filter(|(name, _)| known.contains(name.as_str()))
        .collect()
}

#[test]
fn an_input_that_is_missing_unknown_or_of_another_shape_is_refused() {
    for (name, inputs) in one_of_each() {
        let keys: Vec<String> = inputs.as_object().expect("an object").keys().cloned().collect();
        let more = ask(&name, &spoiled(&inputs, "colour", Some(json!(1))));
        assert!(more["error"].is_string(), "{name} took an unknown input: {more}");
        for key in keys {
            // A sum without weights is the unweighted one, and a tolerance has a default.
            let is_optional = ["weights", "relative_tolerance"].contains(&key.as_str());
            let missing = ask(&name, &spoiled(&inputs, &key, None));
            assert!(missing["error"].is_string() || is_optional, "{name} without {key}");
            let shapes =
                [json!("NaN"), json!(null), json!(true), json!([]), json!({}), json!([[1, "x"]])];
            for wrong in shapes {
                let answer = ask(&name, &spoiled(&inputs, &key, Some(wrong.clone())));
                assert!(answer["error"].is_string(), "{name} with {key} = {wrong}: {answer}");
            }
        }
    }
}

#[test]
fn sizes_below_zero_and_normals_of_no_length_are_refused() {
    const SIZES: [&str; 19] = [
        "radius",
        "distance",
        "r",
        "r1",
        "r2",
        "h",
        "n1",
        "n2",
        "half_angle",
        "solid_angle",
        "inner",
        "outer",
        "vmax",
        "amax",
        "degree",
        "l",
        "relative_tolerance",
        "d",
        "theta_i",
    ];
    for (name, inputs) in one_of_each() {
        for (key, value) in inputs.as_object().expect("an object") {
            let wrong = match key.as_str() {
                "normal" | "axis" | "direction" => json!([0.0, 0.0, 0.0]),
                size if SIZES.contains(&size) && value.is_number() => json!(-1.0),
                _ => continue,
            };
            let answer = ask(&name, &spoiled(&inputs, key, Some(wrong.clone())));
            assert!(answer["error"].is_string(), "{name} with {key} = {wrong}: {answer}");
        }
    }
}

#[test]
fn a_radius_of_zero_has_a_value() {
    for (name, inputs) in one_of_each() {
        for key in ["radius", "r", "r1", "r2"] {
            // An outer sphere of no radius would be within the inner one.
            let is_inside_out = name == "form-factor-concentric-spheres" && key == "r2";
            if is_inside_out || !inputs[key].is_number() {
                continue;
            }
            let answer = ask(&name, &spoiled(&inputs, key, Some(json!(0.0))));
            assert!(answer.get("value").is_some(), "{name} with {key} = 0: {answer}");
        }
        if inputs["shape"]["radius"].is_number() {
            let mut shape = inputs.clone();
            shape["shape"]["radius"] = json!(0.0);
            assert_eq!(ask(&name, &shape)["value"], 0.0, "{name}");
        }
    }
}

/// Integrals: at such sizes one may spend its whole budget, which takes minutes unoptimised.
fn is_integrated(name: &str) -> bool {
    name.starts_with("occluded")
        || name.starts_with("form-factor")
        || name.contains("disk-projected")
        || name.ends_with("of-disk")
}

#[test]
fn the_largest_and_smallest_doubles_give_a_number_or_a_sentence() {
    for (name, inputs) in one_of_each().into_iter().filter(|(name, _)| !is_integrated(name)) {
        for (key, value) in inputs.as_object().expect("an object") {
            for extreme in
                [f64::MAX, -f64::MAX, f64::MIN_POSITIVE, 5e-324, 0.0, -0.0, 1e160, 1e-160]
            {
                let wrong = match value {
                    Value::Number(_) => json!(extreme),
                    Value::Array(items) if items.len() == 3 && items[0].is_number() => {
                        json!([extreme, items[1], extreme])
                    }
                    _ => continue,
                };
                let answer = ask(&name, &spoiled(&inputs, key, Some(wrong.clone())));
                let is_answer = answer.get("value").is_some() ^ answer["error"].is_string();
                assert!(is_answer, "{name} with {key} = {wrong}: {answer}");
            }
        }
    }
}
