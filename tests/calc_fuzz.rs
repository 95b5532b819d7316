//! Requests to `gonio calc --json` with bytes and numbers changed at random, the same ones every
//! time: each gets one document, a finite value or a sentence.

use gonio::cli::calc::answer_line;
use serde_json::Value;

const CASES: &str = include_str!("data/cases.jsonl");

/// `SplitMix64` (Steele, Lea and Flood 2014).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        usize::try_from(self.next() % limit as u64).expect("less than a usize")
    }
}

const NUMBERS: [f64; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1e-9,
    -1e-9,
    1e9,
    1e160,
    1e-160,
    f64::MAX,
    -f64::MAX,
    5e-324,
    std::f64::consts::PI,
];

/// Changes some of the numbers in a document.
fn mutate(value: &mut Value, dice: &mut Dice) {
    match value {
        Value::Number(_) if dice.below(4) == 0 => {
            *value = NUMBERS[dice.below(NUMBERS.len())].into();
        }
        Value::Array(items) => {
            if dice.below(8) == 0 && !items.is_empty() {
                let (from, to) = (dice.below(items.len()), dice.below(items.len()));
                items[to] = items[from].clone();
            }
            for item in items {
                mutate(item, dice);
            }
        }
        Value::Object(fields) => {
            for field in fields.values_mut() {
                mutate(field, dice);
            }
        }
        _ => {}
    }
}

fn all_finite(value: &Value) -> bool {
    match value {
        // JSON has no NaN: it would have become null.
        Value::Null => false,
        Value::Array(items) => items.iter().all(all_finite),
        Value::Object(fields) => fields.values().all(all_finite),
        _ => true,
    }
}

fn check(line: &[u8]) {
    let answer = answer_line(line);
    let shown = String::from_utf8_lossy(line);
    let is_refused = answer["error"].as_str().is_some_and(|error| !error.is_empty());
    assert!(is_refused ^ answer.get("value").is_some(), "{shown}\n{answer}");
    // No hit, no refracted ray.
    let may_be_none = ["\"ray-", "\"refract", "\"snell"].iter().any(|name| shown.contains(name));
    let value = &answer["value"];
    assert!(
        is_refused || all_finite(value) || (may_be_none && value.is_null()),
        "{shown}\n{answer}"
    );
    let bound = answer.get("error_bound");
    assert!(
        bound.is_none_or(|bound| bound.as_f64().is_some_and(|b| b >= 0.0)),
        "{shown}\n{answer}"
    );
    if shown.contains("projected-solid-angle")
        && let Some(sr) = value.as_f64()
    {
        assert!((0.0..=std::f64::consts::PI).contains(&sr), "{shown}\n{answer}");
    }
}

#[test]
fn numbers_changed_at_random_give_finite_values_or_sentences() {
    let mut dice = Dice(1);
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        for _ in 0..3 {
            let mut inputs = case["inputs"].clone();
            mutate(&mut inputs, &mut dice);
            let request = serde_json::json!({"quantity": case["quantity"], "inputs": inputs});
            check(request.to_string().as_bytes());
        }
    }
}

#[test]
fn bytes_changed_at_random_give_finite_values_or_sentences() {
    let mut dice = Dice(2);
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        let request =
            serde_json::json!({"quantity": case["quantity"], "inputs": case["inputs"]}).to_string();
        for _ in 0..4 {
            let mut bytes = request.clone().into_bytes();
            for _ in 0..=dice.below(3) {
                let at = dice.below(bytes.len());
                match dice.below(4) {
                    0 => bytes[at] ^= 1 << dice.below(8),
                    1 => bytes[at] = b"0123456789.-e[]{},\":"[dice.below(20)],
                    2 => bytes.truncate(at.max(1)),
                    _ => bytes.insert(at, b"0123456789-e"[dice.below(12)]),
                }
            }
            check(&bytes);
        }
    }
}
