//! Each quantity's worst error over the reference cases (`tests/data/cases.jsonl`), asked the way a
//! person asks: one line of JSON to `gonio calc --json`, answered by the very function that answers
//! there. An error is compared with three things: the value itself, the row's own tolerance, and the
//! error bound that is printed beside the answer.
//!
//! The cases' values have 17 digits and are compared as the doubles next to them, which alone may
//! be half a unit in the last place off. Transcendental functions come from `libm`, so that the
//! numbers are the same on every machine.

use std::collections::BTreeMap;
use std::process::ExitCode;

use benches::{Arguments, Section, Table, Unmeasured, cases, report};
use clap::Parser;
use gonio::cli::calc::{answer_line, examples};
use serde_json::{Value, json};

/// Each quantity's worst error over the reference cases.
#[derive(Debug, Parser)]
struct Asked {
    #[command(flatten)]
    arguments: Arguments,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, measure)
}

/// One case, answered.
struct Answered {
    id: String,
    note: String,
    /// Relative to the largest component of the value; `None` where there is none, or it is no larger
    /// than what the case lets it miss by.
    relative: Option<f64>,
    /// The same in units in the last place.
    ulps: Option<f64>,
    /// Of the row's tolerance; infinite where the answer is of another kind.
    of_tolerance: f64,
    /// Of the bound printed beside the answer.
    of_bound: f64,
}

/// The largest of one kind of error, and where it is.
#[derive(Default)]
struct Worst(Option<(f64, String)>);

impl Worst {
    fn of<'a>(rows: &'a [Answered], error: impl Fn(&'a Answered) -> Option<f64>) -> Self {
        let rows = rows.iter().filter_map(|row| Some((error(row)?, row)));
        let worst = rows.max_by(|a, b| a.0.total_cmp(&b.0));
        Self(worst.map(|(error, row)| (error, format!("{} ({})", row.id, row.note))))
    }

    fn value(&self) -> Option<f64> {
        self.0.as_ref().map(|(error, _)| *error)
    }

    fn place(&self) -> String {
        match &self.0 {
            Some((error, place)) if *error > 0.0 => place.clone(),
            _ => String::new(),
        }
    }
}

fn measure() -> Result<Section, Unmeasured> {
    let known: Vec<&str> = examples().map(|(name, _)| name).collect();
    let mut quantities: BTreeMap<String, Vec<Answered>> = BTreeMap::new();
    for case in cases()? {
        let (quantity, answered) = ask(&case)?;
        quantities.entry(quantity).or_default().push(answered);
    }
    let mut section = Section::new("accuracy", "Worst error over the reference cases");
    let rows: usize = quantities.values().map(Vec::len).sum();
    section.say(&format!(
        "{rows} cases of `tests/data/cases.jsonl` through `gonio calc --json`. \"Relative\" is to \
         the true value, \"ulp\" in units of its last place (the reference itself is rounded to \
         half of one), \"of tolerance\" the worst share of the tolerance that a case grants, \"of \
         bound\" the worst share of the error bound that is printed beside the answer: at most 1 \
         where the bound holds. A case whose true value is \"none\", or no larger than its absolute tolerance, has no \
         relative error."
    ));
    let (shown, raw) = tables(&quantities);
    section.show(&shown);
    let without: Vec<String> = known
        .iter()
        .filter(|name| !quantities.contains_key(**name))
        .map(|name| format!("`{name}`"))
        .collect();
    section.say(&format!(
        "Without reference cases, held by identities in the tests alone: {}.",
        without.join(", ")
    ));
    let all = || quantities.values().flatten();
    section.aim("every case within its tolerance", all().all(|row| row.of_tolerance <= 1.0));
    section.aim("every error within the printed bound", all().all(|row| row.of_bound <= 1.0));
    section.keep(raw);
    Ok(section)
}

fn tables(quantities: &BTreeMap<String, Vec<Answered>>) -> (Table, Table) {
    let mut shown = Table::new(&[
        "quantity",
        "cases",
        "relative",
        "ulp",
        "of tolerance",
        "of bound",
        "worst case (what is hard in it)",
    ]);
    let mut raw =
        Table::new(&["id", "quantity", "relative", "ulp", "of_tolerance", "of_bound", "note"]);
    let scientific = |error: Option<f64>| match error {
        None => "-".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(error) => format!("{error:.1e}"),
    };
    for (name, rows) in quantities {
        let relative = Worst::of(rows, |row| row.relative);
        let tolerance = Worst::of(rows, |row| Some(row.of_tolerance));
        let ulps = Worst::of(rows, |row| row.ulps).value();
        let place = if relative.place().is_empty() { tolerance.place() } else { relative.place() };
        shown.row([
            name.clone(),
            rows.len().to_string(),
            scientific(relative.value()),
            ulps.map_or_else(|| "-".to_owned(), whole),
            scientific(tolerance.value()),
            scientific(Worst::of(rows, |row| Some(row.of_bound)).value()),
            place,
        ]);
        for row in rows {
            let number = |error: Option<f64>| error.map_or(String::new(), |e| format!("{e:e}"));
            raw.row([
                row.id.clone(),
                name.clone(),
                number(row.relative),
                number(row.ulps),
                format!("{:e}", row.of_tolerance),
                format!("{:e}", row.of_bound),
                row.note.clone(),
            ]);
        }
    }
    (shown, raw)
}

fn ask(case: &Value) -> Result<(String, Answered), Unmeasured> {
    let text = |key: &str| case[key].as_str().unwrap_or_default().trim().to_owned();
    let request = json!({
        "id": case["id"], "quantity": case["quantity"], "inputs": case["inputs"],
    });
    let answer = answer_line(request.to_string().as_bytes());
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let (expected, got) = (numbers(&case["expected"])?, numbers(&answer["value"])?);
    let size = expected.iter().fold(0.0, |size: f64, e| size.max(e.abs()));
    let is_like = answer.get("error").is_none() && expected.len() == got.len();
    let pairs = || expected.iter().zip(&got).map(|(e, g)| (e.abs(), (g - e).abs()));
    let error = pairs().map(|(_, error)| error).fold(0.0, f64::max);
    let (absolute, relative) = (number(&case["abs_tol"]), number(&case["rel_tol"]));
    let share = |(e, error): (f64, f64)| part(error, absolute + relative * e);
    // Beside the bound stands what writing the expected value with 17 digits leaves.
    let bound = number(&answer["error_bound"]) + 2e-16 * size + absolute.min(1e-100);
    let has_size = is_like && size > absolute;
    let answered = Answered {
        id: text("id"),
        // Neither column separators nor Markdown's.
        note: text("note").replace([',', '|'], ";"),
        relative: has_size.then(|| error / size),
        ulps: has_size.then(|| error / ulp(size)),
        of_tolerance: if is_like { pairs().map(share).fold(0.0, f64::max) } else { f64::INFINITY },
        of_bound: if expected.is_empty() { 0.0 } else { part(error, bound) },
    };
    Ok((text("quantity"), answered))
}

/// Beyond five digits in scientific notation.
fn whole(ulps: f64) -> String {
    if ulps < 1e5 { format!("{ulps:.0}") } else { format!("{ulps:.1e}") }
}

/// Of what is allowed; nothing of nothing is none of it.
fn part(error: f64, allowed: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / allowed }
}

/// The spacing of doubles at a positive value.
fn ulp(value: f64) -> f64 {
    value.next_up() - value
}

/// A number, several, or none; written as JSON or, with all its digits, as text.
fn numbers(value: &Value) -> Result<Vec<f64>, Unmeasured> {
    match value {
        Value::Null => Ok(Vec::new()),
        Value::Array(items) => {
            Ok(items.iter().map(numbers).collect::<Result<Vec<_>, _>>()?.concat())
        }
        Value::String(text) if text == "none" => Ok(Vec::new()),
        Value::String(text) => Ok(vec![text.parse()?]),
        value => value.as_f64().map(|number| vec![number]).ok_or_else(|| {
            Unmeasured::because(format!("{value} stands where a number was expected"))
        }),
    }
}
