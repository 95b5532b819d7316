//! `gonio calc --json` on every reference case at its own tolerance, on every example of its own
//! list, and on what has no meaning: the very function that answers a line.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

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

#[test]
fn the_largest_and_smallest_doubles_give_a_number_or_a_sentence() {
    for (name, inputs) in one_of_each() {
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

#[test]
fn several_bodies_hide_what_any_of_them_hides() {
    let seen = |bodies: Value| {
        let mut inputs = json!({
            "point": [0, 0, 0], "normal": [0, 0, 1],
            "source": {"kind": "sphere", "center": [0, 0, 2], "radius": 1},
        });
        for (key, value) in bodies.as_object().expect("an object") {
            inputs[key] = value.clone();
        }
        ask("occluded-projected-solid-angle", &inputs)
    };
    // A knife edge through the middle, the same again nearer, and a ball far aside.
    let edge = |z: f64| json!({"kind": "half-plane", "x_max": 0, "z": z});
    let aside = json!({"kind": "sphere", "center": [9, 0, 1], "radius": 0.1});
    for bodies in [
        json!({"occluder": edge(0.5)}),
        json!({"occluders": [edge(0.5)]}),
        json!({"occluders": [edge(0.5), aside, edge(0.25)]}),
    ] {
        let answer = seen(bodies);
        let error = (answer["value"].as_f64().expect("a value") - PI / 8.0).abs();
        assert!(error <= answer["error_bound"].as_f64().expect("a bound"), "{answer}");
    }
    let both = seen(json!({"occluder": edge(0.5), "occluders": [edge(0.5)]}));
    for refused in [both, seen(json!({})), seen(json!({"occluders": [{"kind": "cube"}]}))] {
        assert!(refused["error"].is_string(), "{refused}");
    }
}

#[test]
fn light_has_the_values_of_the_closed_forms() {
    let near = |quantity: &str, inputs: Value, expected: &[f64]| {
        let answer = ask(quantity, &inputs);
        let bound = answer["error_bound"].as_f64().unwrap_or_else(|| panic!("{answer}"));
        let found: Vec<f64> = match &answer["value"] {
            Value::Array(values) => values.iter().filter_map(Value::as_f64).collect(),
            value => value.as_f64().into_iter().collect(),
        };
        assert_eq!(found.len(), expected.len(), "{answer}");
        for (found, expected) in found.iter().zip(expected) {
            let error = (found - expected).abs();
            let said = format!("{quantity}: {answer}, expected {expected:e}");
            // What is written here is rounded too.
            assert!(error <= bound + 4e-16 * expected.abs(), "{said}");
            assert!(bound <= 1e-7 * expected.abs() + 1e-12, "{said}");
        }
    };
    let up = |more: Value| {
        let mut inputs = json!({"point": [0, 0, 0], "normal": [0, 0, 1], "radiance": 100});
        for (key, value) in more.as_object().expect("an object") {
            inputs[key] = value.clone();
        }
        inputs
    };
    // π L sin² of the half angle: 1/2, and (1/2)² for the sphere.
    let disk = json!({"center": [0, 0, 1], "axis": [0, 0, 1], "radius": 1});
    near("irradiance-from-disk", up(disk), &[50.0 * PI]);
    let sphere = json!({"center": [0, 0, 2], "radius": 1});
    near("irradiance-from-sphere", up(sphere), &[25.0 * PI]);
    // One corner of a cube around the receiver: by symmetry of the upper half.
    let quadrant = json!({"vertices": [[0, 0, 1], [1e20, 0, 1], [0, 1e20, 1]]});
    near("irradiance-from-polygon", up(quadrant), &[25.0 * PI]);
    let half = json!({
        "source": {"kind": "sphere", "center": [0, 0, 2], "radius": 1},
        "occluder": {"kind": "half-plane", "x_max": 0, "z": 0.5},
    });
    near("irradiance-from-occluded-source", up(half), &[12.5 * PI]);
    let sky = json!([[100.0, 100.0], [0.0, 0.0]]);
    let environment = |normal: [f64; 3]| json!({"normal": normal, "map": sky});
    near("irradiance-from-environment", environment([0.0, 0.0, 3.0]), &[100.0 * PI]);
    near("irradiance-from-environment", environment([1.0, 2.0, 0.0]), &[50.0 * PI]);
    // The view factor of the sky: (1 + cos θ)/2.
    near("irradiance-from-environment", environment([3.0, 0.0, 4.0]), &[90.0 * PI]);
    let square = json!([[7.0, 7.0], [7.0, 7.0]]);
    let square = json!({"normal": [1, 2, 3], "map": square, "pixels": "equal-area"});
    near("irradiance-from-environment", square, &[7.0 * PI]);
    near("environment-radiance", json!({"direction": [0, 1, -0.1], "map": sky}), &[0.0]);
    near("irradiance-from-sun", json!({"normal_angle": 0}), &[1353.0]);
    near("irradiance-from-sun", json!({"normal_angle": PI / 3.0}), &[676.5]);
    near("irradiance-from-sun", json!({"normal_angle": 2}), &[0.0]);
    let earth = json!({"distance": 149_597_870_700_f64});
    near("sun-radiance", earth, &[2.003_402_381_394_15e7]);
    near("sun-half-angle", json!({}), &[(PI / 180.0) / 4.0]);
    near("radiance-from-exitance", json!({"exitance": 100.0 * PI}), &[100.0]);
    near("exitance", json!({"radiance": 100}), &[100.0 * PI]);
    let beam = |theta2: f64| json!({"area1": 2e-6, "theta1": 0, "area2": 3e-6, "theta2": theta2, "distance": 0.5});
    near("throughput-infinitesimal-beam", beam(PI / 3.0), &[1.2e-11]);
    near("luminance", json!({"radiance": 2, "efficacy": 683}), &[1366.0]);
    near(
        "radiant-flux-from-luminous-flux",
        json!({"luminous_flux": 1366, "efficacy": 683}),
        &[2.0],
    );
    // Two wide plates: M₁ = (M₀ + ρ₁ρ₂...)/(1 - ρ₁ρ₂).
    let plates = json!({
        "areas": [1, 1], "form_factors": [[0, 1], [1, 0]],
        "emitted": [100, 0], "reflectance": [0.5, 0.8],
    });
    near("radiosity-exitances", plates.clone(), &[100.0 / 0.6, 80.0 / 0.6]);
    near("radiosity-irradiances", plates, &[80.0 / 0.6, 100.0 / 0.6]);
}

#[test]
fn light_without_meaning_is_refused() {
    let refused = |quantity: &str, inputs: Value, word: &str| {
        let answer = ask(quantity, &inputs);
        let error = answer["error"].as_str().unwrap_or_else(|| panic!("{quantity}: {answer}"));
        assert!(error.contains(word), "{quantity}: {error}");
    };
    let map = |map: Value| json!({"normal": [0, 0, 1], "map": map});
    refused("irradiance-from-environment", map(json!([[1, 2], [3, -4]])), "pixel 3");
    refused("irradiance-from-environment", map(json!([[1, 2], [3]])), "row 1");
    refused("irradiance-from-environment", map(json!([])), "0 rows");
    refused("irradiance-from-environment", map(json!([[], []])), "0 columns");
    let equal_area = |map: Value| json!({"normal": [0, 0, 1], "map": map, "pixels": "equal-area"});
    refused("irradiance-from-environment", equal_area(json!([[1, 2]])), "square");
    refused("irradiance-from-environment", equal_area(json!([[1]])), "even");
    let unknown = json!({"normal": [0, 0, 1], "map": [[1]], "pixels": "cube"});
    refused("irradiance-from-environment", unknown, "cube");
    refused("irradiance-from-sun", json!({"normal_angle": 4}), "normal_angle");
    refused("irradiance-from-sun", json!({"normal_angle": 0, "distance": 1}), "sphere");
    refused("sun-radiance", json!({"distance": -1}), "distance");
    refused("luminance", json!({"radiance": 2, "efficacy": 700}), "683.002");
    refused("luminance", json!({"radiance": -2, "efficacy": 600}), "radiance");
    refused("radiance-from-luminance", json!({"luminance": 2, "efficacy": 0}), "efficacy");
    refused("radiant-flux", json!({"radiance": 2, "throughput": -1}), "throughput");
    let plates = |factors: Value, reflectance: Value| json!({"areas": [1, 1], "form_factors": factors, "emitted": [1, 0], "reflectance": reflectance});
    let closed = json!([[0, 1], [1, 0]]);
    refused("radiosity-exitances", plates(json!([[0, 0.9], [0.9, 0]]), json!([0.5, 0.5])), "sum");
    refused("radiosity-exitances", plates(json!([[0, 1], [0.5, 0.5]]), json!([0.5, 0.5])), "back");
    refused("radiosity-exitances", plates(json!([[0, 1]]), json!([0.5, 0.5])), "matrix");
    refused("radiosity-exitances", plates(closed.clone(), json!([1.5, 0.5])), "reflectance");
    refused("radiosity-exitances", plates(closed.clone(), json!([0.5])), "reflectance");
    refused("radiosity-exitances", plates(closed, json!([1, 1])), "radiosity");
    let two = json!([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [0, 1, 1], [1, 0, 1]]]);
    let open = json!({"surfaces": two, "emitted": [1, 0], "reflectance": [0, 0]});
    refused("radiosity-exitances", open, "do not close");
}
