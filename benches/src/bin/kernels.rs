//! The time of one call of each kernel of `radiometry`, on the inputs of every reference case of
//! its quantity (on its example in `gonio calc --list` where it has none). A kernel is called
//! directly, without JSON, over and over on the same inputs, which are hidden from the compiler;
//! batches of at least 0.1 ms, the median of 31 of them, in the thread's own processor time, so that
//! another program's turn on the core does not count.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::process::ExitCode;

use benches::kernel::{self, Call, HARD_AIM_NS, Kind};
use benches::{Arguments, Section, Table, Unmeasured, call_ns, cases, report};
use clap::Parser;
use gonio::cli::calc::examples;
use serde_json::{Map, Value};

/// Time per call of each kernel.
#[derive(Debug, Parser)]
struct Asked {
    /// Of this quantity alone.
    #[arg(long)]
    quantity: Option<String>,
    #[command(flatten)]
    arguments: Arguments,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

/// One case, timed.
struct Timed {
    id: String,
    note: String,
    ns: f64,
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let mut kernels: BTreeMap<(Kind, String), Vec<Timed>> = BTreeMap::new();
    for case in rows()? {
        let text = |key: &str| case[key].as_str().unwrap_or_default().trim().to_owned();
        let quantity = text("quantity");
        if asked.quantity.as_ref().is_some_and(|only| *only != quantity) {
            continue;
        }
        let Some(call) = kernel::call(&quantity, &case["inputs"])? else { continue };
        let ns = call_ns(|| black_box(call.answer()));
        let note = text("note").replace([',', '|'], ";");
        kernels.entry((call.kind, quantity)).or_default().push(Timed { id: text("id"), note, ns });
    }
    let empty = Call::empty();
    let empty_ns = call_ns(|| black_box(empty.answer()));
    Ok(section(kernels, empty_ns))
}

fn section(kernels: BTreeMap<(Kind, String), Vec<Timed>>, empty_ns: f64) -> Section {
    let mut shown = Table::new(&[
        "kernel",
        "kind",
        "cases",
        "least ns",
        "median ns",
        "most ns",
        "missed",
        "slowest case (what is hard in it)",
    ]);
    let mut raw = Table::new(&["id", "quantity", "kind", "ns", "note"]);
    let mut misses: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for ((kind, quantity), mut timed) in kernels {
        for Timed { id, note, ns } in &timed {
            let ns = format!("{ns:.1}");
            raw.row([id, &quantity, kind.name(), &ns, note]);
        }
        timed.sort_by(|a, b| a.ns.total_cmp(&b.ns));
        let middle = timed[(timed.len() - 1) / 2].ns;
        let slowest = &timed[timed.len() - 1];
        let mut missed = Vec::new();
        if kind.aim_ns().is_some_and(|aim| middle > aim) {
            missed.push(kind.name());
        }
        if slowest.ns > HARD_AIM_NS {
            missed.push("hard");
        }
        for aim in &missed {
            misses.entry(aim).or_default().push(quantity.clone());
        }
        shown.row([
            quantity.clone(),
            kind.name().to_owned(),
            timed.len().to_string(),
            format!("{:.0}", timed[0].ns),
            format!("{middle:.0}"),
            format!("{:.0}", slowest.ns),
            missed.join(" and "),
            format!("{} ({})", slowest.id, slowest.note),
        ]);
    }
    let mut section = Section::new("kernels", "Time per call of each kernel");
    section.say(&format!(
        "Over the reference cases of each quantity, called directly; the median of 31 batches a \
         case, in processor time. Making a call costs {empty_ns:.1} ns by itself, which is not \
         taken off. What an integral costs is the tolerance's, which each case asks for itself."
    ));
    section.show(&shown);
    let mut aim = |text: &str, name: &str| {
        let missed = misses.get(name).cloned().unwrap_or_default();
        section.aim(text, missed.is_empty());
        if !missed.is_empty() {
            section.say(&format!("Missed by {}.", missed.join(", ")));
        }
    };
    aim("a closed form's middle case within 200 ns", Kind::Closed.name());
    aim("a corner sum's middle case within 2 µs", Kind::Corners.name());
    aim("every case, the hardest too, within 20 µs", "hard");
    section.keep(raw);
    section
}

/// The reference cases, and the examples of quantities that have none.
fn rows() -> Result<Vec<Value>, Unmeasured> {
    let mut rows = cases()?;
    let has_cases = |rows: &[Value], name: &str| rows.iter().any(|row| row["quantity"] == name);
    for (name, words) in examples() {
        if !has_cases(&rows, name) {
            let inputs = inputs_of(&words);
            rows.push(serde_json::json!({"id": "example", "quantity": name, "inputs": inputs}));
        }
    }
    Ok(rows)
}

/// An example's words, `--name value` or `--name=value`.
fn inputs_of(words: &[String]) -> Value {
    let mut inputs = Map::new();
    let mut words = words.iter();
    while let Some(word) = words.next() {
        let (name, value) = match word.split_once('=') {
            Some((name, value)) => (name, value),
            None => (word.as_str(), words.next().map_or("", String::as_str)),
        };
        let name = name.trim_start_matches('-').replace('-', "_");
        let list = || serde_json::from_str(&format!("[{value}]"));
        inputs.insert(name, serde_json::from_str(value).or_else(|_| list()).unwrap_or_default());
    }
    inputs.into()
}
