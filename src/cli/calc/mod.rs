//! `gonio calc`: one quantity of the library, for anyone's hands: by name on the command line, or
//! JSON lines in and JSON lines out. It computes nothing itself: the tables beside it say which
//! function of which crate answers.

mod angles;
mod bases;
mod enclosures;
mod form_factors;
mod inputs;
mod interfaces;
mod irradiance;
mod least_squares;
mod light;
mod motion;
mod photometric;
mod quantity;
mod rays;
mod request;
mod solid_angles;
mod statistics;
mod unambiguous;

use std::io::{self, BufRead as _, BufReader};
use std::process::ExitCode;

use serde_json::{Map, Value, json};

use super::args::CalcArgs;
use super::failure::{Failure, Outcome};
use super::output::{say, say_json, write_out};
use inputs::Inputs;
use quantity::{Answer, Quantity};
use unambiguous::Unambiguous;

pub use request::answer_line;

/// Lists the quantities, answers one, or answers every line of standard input.
pub(crate) fn calc(args: &CalcArgs) -> Outcome {
    match args.words.split_first() {
        _ if args.list => list(args.json)?,
        None if args.json => answer_lines()?,
        None => {
            return Err(Failure::with_help(
                "calc needs a QUANTITY",
                "`gonio calc --list` shows them all",
            ));
        }
        Some((name, words)) => answer_one(name, words, args.json)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// An example of every quantity: its name and the words that follow it on the command line.
pub fn examples() -> impl Iterator<Item = (&'static str, Vec<String>)> {
    quantity::all().map(|quantity| {
        let words = quantity.example.split_whitespace().map(str::to_owned).collect();
        (quantity.name, words)
    })
}

/// What the command line `gonio calc NAME WORDS...` answers, as one JSON document; or why it can't.
pub fn answer_words(name: &str, words: &[String]) -> Result<Value, String> {
    let quantity = quantity::named(name).map_err(|refusal| refusal.to_string())?;
    let answer = answer(quantity, words)?;
    let mut document = json!({"quantity": name, "value": answer.value, "unit": quantity.unit});
    if let Some(bound) = answer.error_bound {
        document["error_bound"] = bound.into();
    }
    Ok(document)
}

fn answer(quantity: &Quantity, words: &[String]) -> Result<Answer, String> {
    let inputs = read_words(words)?;
    quantity.answer(Inputs::new(&inputs)).map_err(|refusal| refusal.to_string())
}

fn answer_one(name: &str, words: &[String], is_json: bool) -> Result<(), Failure> {
    let quantity = quantity::named(name).map_err(Failure::start)?;
    let is_json = is_json || words.iter().any(|word| word == "--json");
    let words: Vec<String> = words.iter().filter(|word| *word != "--json").cloned().collect();
    if words.iter().any(|word| word == "--help" || word == "-h") {
        return say(&quantity.description());
    }
    let fail = |why: String| {
        Failure::with_help(format!("{name}: {why}"), format!("try: {}", quantity.command()))
    };
    if is_json {
        return say_json(&answer_words(name, &words).map_err(fail)?);
    }
    let answer = answer(quantity, &words).map_err(fail)?;
    let bound = answer.error_bound.map_or(String::new(), |bound| format!(" (± {bound:.1e})"));
    match answer.value {
        Value::Null => say("none\n"),
        value if quantity.unit == "1" => say(&format!("{value}{bound}\n")),
        value => say(&format!("{value} {}{bound}\n", quantity.unit)),
    }
}

/// `--name value` pairs; a value is a number, or JSON, or numbers between commas.
fn read_words(words: &[String]) -> Result<Map<String, Value>, String> {
    let mut inputs = Map::new();
    let mut words = words.iter();
    while let Some(word) = words.next() {
        let name = word
            .strip_prefix("--")
            .ok_or_else(|| format!("`{word}` stands where an input's `--name` was expected"))?;
        let (name, value) = match name.split_once('=') {
            Some((name, value)) => (name, value),
            None => (name, words.next().ok_or_else(|| format!("--{name} has no value"))?.as_str()),
        };
        let value = read_value(value).map_err(|why| format!("--{name} is `{value}`, {why}"))?;
        if inputs.insert(name.replace('-', "_"), value).is_some() {
            return Err(format!("--{name} is given twice"));
        }
    }
    Ok(inputs)
}

fn read_value(text: &str) -> Result<Value, String> {
    let expected = || String::from("expected a number or JSON");
    let number = |text: &str| {
        let value: f64 = text.trim().parse().ok()?;
        value.is_finite().then(|| Value::from(value))
    };
    match serde_json::from_str(text) {
        Ok(Unambiguous(value)) => return Ok(value),
        // Of JSON's form, but not to be taken as it is.
        Err(error) if error.is_data() => return Err(format!("where {error}")),
        Err(_) => {}
    }
    if text.contains(',') {
        let numbers = text.split(',').map(number).collect::<Option<Vec<_>>>();
        return numbers.map(Value::from).ok_or_else(expected);
    }
    // A word; `inf` and `nan` are numbers, if no finite ones.
    let is_word = text.starts_with(|c: char| c.is_ascii_lowercase())
        && text.chars().all(|c| c.is_ascii_lowercase() || c == '-')
        && text.parse::<f64>().is_err();
    if is_word { Ok(text.into()) } else { number(text).ok_or_else(expected) }
}

fn list(is_json: bool) -> Result<(), Failure> {
    write_out(|out| {
        for quantity in quantity::all() {
            if is_json {
                writeln!(out, "{}", quantity.as_json())?;
            } else {
                out.write_all(quantity.description().as_bytes())?;
            }
        }
        Ok(())
    })
}

/// One answer a line, in order. Whoever waits for an answer before asking on gets it.
fn answer_lines() -> Result<(), Failure> {
    let mut input = BufReader::new(io::stdin().lock());
    let mut line = Vec::new();
    write_out(|out| {
        loop {
            line.clear();
            if input.read_until(b'\n', &mut line)? == 0 {
                return Ok(());
            }
            if !line.trim_ascii().is_empty() {
                writeln!(out, "{}", answer_line(&line))?;
            }
            if input.buffer().is_empty() {
                out.flush()?;
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_pairs_of_a_name_and_a_value() {
        let words =
            |text: &str| -> Vec<String> { text.split_whitespace().map(str::to_owned).collect() };
        let read = read_words(&words("--a 1e-3 --b=-0.5 --half-angle .5 --v 1,2,-3")).unwrap();
        assert_eq!(
            Value::from(read),
            json!({"a": 1e-3, "b": -0.5, "half_angle": 0.5, "v": [1.0, 2.0, -3.0]})
        );
        let read = read_words(&words("--pixels equal-area")).unwrap();
        assert_eq!(Value::from(read), json!({"pixels": "equal-area"}));
        for wrong in ["--a", "a 1", "--a NaN", "--a inf", "--a 1 --a 2", "--a 1,x"] {
            assert!(read_words(&words(wrong)).is_err(), "{wrong}");
        }
        let twice = read_words(&words(r#"--a {"b":1,"b":1}"#)).unwrap_err();
        assert!(twice.contains("`b` is given twice"), "{twice}");
    }
}
