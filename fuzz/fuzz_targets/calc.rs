//! `gonio calc --json`, from bytes: lines as they are, and the listed examples with their numbers
//! replaced. Each line has one answer on one line, to its id: finite numbers within a bound, no
//! value where there is none, or a sentence. It knows no quantity by name.
#![no_main]

use std::sync::OnceLock;

use gonio::cli::calc::{answer_line, examples};
use libfuzzer_sys::fuzz_target;
use serde_json::{Map, Value, json};

/// Numbers and choices from bytes.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// Small ones that meet each other often, edges of the range, or any double at all.
    fn number(&mut self) -> Option<f64> {
        const EDGES: [f64; 10] =
            [0.0, -0.0, f64::MAX, -f64::MAX, 5e-324, 1e160, 1e-160, 1e16, 1.0 + 1e-15, 1e-8];
        let kind = self.byte()?;
        if kind < 180 {
            return Some((f64::from(kind) - 60.0) / 16.0);
        }
        if kind < 240 {
            return Some(EDGES[usize::from(kind) % EDGES.len()]);
        }
        let (bits, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(f64::from_le_bytes(*bits)).filter(|number| number.is_finite())
    }
}

/// The examples as requests' inputs.
fn listed() -> &'static [(&'static str, Map<String, Value>)] {
    static LISTED: OnceLock<Vec<(&'static str, Map<String, Value>)>> = OnceLock::new();
    LISTED.get_or_init(|| {
        let inputs = |words: Vec<String>| {
            let pairs = words.chunks_exact(2);
            pairs.map(|pair| (pair[0][2..].replace('-', "_"), value(&pair[1]))).collect()
        };
        examples().map(|(name, words)| (name, inputs(words))).collect()
    })
}

fn value(text: &str) -> Value {
    serde_json::from_str(text)
        .or_else(|_| serde_json::from_str(&format!("[{text}]")))
        .unwrap_or_else(|_| text.into())
}

/// Some of a document's numbers become others; lists may lose or repeat their last item.
fn spoil(value: &mut Value, bytes: &mut Bytes<'_>) -> Option<()> {
    match value {
        Value::Number(number) => {
            if bytes.byte()? % 2 == 0 {
                let new = bytes.number()?;
                // Degrees and counts stay such, or nothing but their refusal is tried.
                *value = if number.is_f64() || new.fract() != 0.0 || new.abs() > 1e9 {
                    json!(new)
                } else {
                    json!(new as i64)
                };
            }
        }
        Value::Array(items) => {
            match bytes.byte()? {
                0..=9 => drop(items.pop()),
                10..=19 => items.extend(items.last().cloned()),
                _ => {}
            }
            items.iter_mut().try_for_each(|item| spoil(item, bytes))?;
        }
        Value::Object(entries) => entries.values_mut().try_for_each(|item| spoil(item, bytes))?,
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
    Some(())
}

/// One answer: a number, numbers or none, with a bound; or a sentence.
fn check(line: &[u8]) -> Value {
    let answer = answer_line(line);
    let text = answer.to_string();
    let said = || format!("{}\n{text}", String::from_utf8_lossy(line));
    assert!(!text.contains('\n') && answer.get("id").is_some(), "{}", said());
    if let Some(error) = answer.get("error") {
        let is_sentence = error.as_str().is_some_and(|error| !error.trim().is_empty());
        assert!(is_sentence && answer.get("value").is_none(), "{}", said());
        return answer;
    }
    let numbers = match answer.get("value") {
        Some(Value::Array(items)) => &items[..],
        Some(Value::Null) => return answer,
        Some(one) => core::slice::from_ref(one),
        None => panic!("no value and no error: {}", said()),
    };
    let are_finite = numbers.iter().all(|n| n.as_f64().is_some_and(f64::is_finite));
    let bound = answer["error_bound"].as_f64();
    assert!(are_finite && bound.is_some_and(|bound| bound >= 0.0), "{}", said());
    answer
}

fn run(bytes: &[u8]) -> Option<()> {
    let mut bytes = Bytes(bytes);
    if bytes.byte()? % 4 == 0 {
        for line in bytes.0.split(|byte| *byte == b'\n').take(8) {
            check(line);
        }
        return Some(());
    }
    let listed = listed();
    let (name, inputs) = &listed[usize::from(bytes.byte()?) % listed.len()];
    let mut inputs = Value::Object(inputs.clone());
    let _ = spoil(&mut inputs, &mut bytes);
    let line = json!({"id": 7, "quantity": name, "inputs": inputs}).to_string();
    let answer = check(line.as_bytes());
    assert_eq!(answer["id"], 7, "{line}");
    Some(())
}

fuzz_target!(|bytes: &[u8]| {
    let _ = run(bytes);
});
