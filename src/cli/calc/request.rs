//! One line of JSON in, one document out: the request's form, and who it is answered to. A line
//! that is no JSON is answered too, with its id if that can be made out.

use serde::Deserialize;
use serde_json::{Value, json};

use super::inputs::Inputs;
use super::quantity::{self, Answer, Quantity, Refusal};
use super::unambiguous::UnambiguousMap;

/// A request as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    #[serde(default)]
    id: Value,
    quantity: String,
    #[serde(default)]
    inputs: UnambiguousMap,
}

/// What is left of a request that can't be read as a whole.
#[derive(Deserialize)]
struct Addressed {
    #[serde(default)]
    id: Value,
}

/// Answers one line: `{"id", "value", "unit", "error_bound"}` or `{"id", "error"}`.
pub fn answer_line(line: &[u8]) -> Value {
    match serde_json::from_slice::<Request>(line) {
        Err(error) => {
            refused(&id_of(line), &Refusal::new(format!("the request is wrong: {error}")))
        }
        Ok(Request { id, quantity, inputs: UnambiguousMap(inputs) }) => {
            let found = quantity::named(&quantity).and_then(|quantity| {
                quantity.answer(Inputs::new(&inputs)).map(|answer| (quantity, answer))
            });
            match found {
                Ok((quantity, answer)) => answered(&id, quantity, &answer),
                Err(refusal) => refused(&id, &refusal),
            }
        }
    }
}

fn answered(id: &Value, quantity: &Quantity, answer: &Answer) -> Value {
    let mut document = json!({"id": id, "value": answer.value, "unit": quantity.unit});
    if let Some(bound) = answer.error_bound {
        document["error_bound"] = bound.into();
    }
    document
}

fn refused(id: &Value, refusal: &Refusal) -> Value {
    json!({"id": id, "error": refusal.to_string()})
}

/// The id of a line that is no request: of another shape, with a number out of range, or with the
/// NaN and Infinity that some writers take for JSON. Null if there is none to be found.
fn id_of(line: &[u8]) -> Value {
    let text = String::from_utf8_lossy(line);
    // Only the id is read from it, so that nothing else in the line can be mistaken for data.
    let text = ["-Infinity", "Infinity", "NaN"]
        .iter()
        .fold(text.into_owned(), |text, word| text.replace(word, "null"));
    serde_json::from_str::<Addressed>(&text).map_or(Value::Null, |addressed| addressed.id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_no_request_is_answered_to_its_id() {
        for line in [
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": {"angle": NaN}}"#,
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": {"angle": -Infinity}}"#,
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": {"angle": 1e999}}"#,
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": [1]}"#,
            r#"{"id": "a", "quantity": 7, "inputs": {}}"#,
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": {"angle": 1}, "more": 1}"#,
            r#"{"id": "a"}"#,
        ] {
            let answer = answer_line(line.as_bytes());
            assert_eq!(answer["id"], "a", "{line}");
            assert!(answer["error"].is_string() && answer.get("value").is_none(), "{line}");
        }
        for line in [&b"not json"[..], b"\xff\xfe", b"[]", b"7"] {
            let answer = answer_line(line);
            assert!(answer["id"].is_null() && answer["error"].is_string());
        }
    }

    #[test]
    fn an_input_given_twice_is_refused_by_name() {
        for line in [
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": {"angle": 1, "angle": 2}}"#,
            r#"{"id": "a", "quantity": "wrap-angle", "inputs": {"angle": {"angle": 1, "angle": 1}}}"#,
        ] {
            let answer = answer_line(line.as_bytes());
            assert_eq!(answer["id"], "a", "{line}");
            let error = answer["error"].as_str().unwrap();
            assert!(error.contains("`angle` is given twice"), "{error}");
        }
    }

    #[test]
    fn numbers_read_back_to_the_same_double() {
        let line =
            br#"{"id": 7, "quantity": "wrap-angle", "inputs": {"angle": -3.141592653589793}}"#;
        let text = answer_line(line).to_string();
        let answer: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(answer["id"], 7);
        let value = answer["value"].as_f64().unwrap();
        assert_eq!(value.to_bits(), (-std::f64::consts::PI).to_bits());
    }
}
