//! docs/accuracy.md against what `gonio calc` answers: a quantity that is missing there, or gone from
//! here, means that the document describes another program.

use std::collections::{BTreeMap, BTreeSet};

use gonio::cli::calc::examples;
use serde_json::Value;

const DOCUMENT: &str = include_str!("../docs/accuracy.md");
const CASES: &str = include_str!("data/cases.jsonl");
const REMEDY: &str = "write it anew: cargo run --release -p benches --bin accuracy -- \
                      --doc docs/accuracy.md --date YYYY-MM-DD";

/// The table's first two columns: quantity and number of cases.
fn table() -> BTreeMap<String, usize> {
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
    };
    let rows = DOCUMENT.lines().filter(|line| line.starts_with("| ")).map(cells);
    rows.filter_map(|row| Some((row.first()?.clone(), row.get(1)?.parse().ok()?))).collect()
}

#[test]
fn the_table_has_every_reference_case_of_every_quantity() {
    let mut cases: BTreeMap<String, usize> = BTreeMap::new();
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        *cases.entry(case["quantity"].as_str().expect("a name").to_owned()).or_default() += 1;
    }
    assert_eq!(table(), cases, "{REMEDY}");
}

#[test]
fn the_document_names_no_quantity_that_the_list_has_lost() {
    let listed: BTreeSet<String> = examples().map(|(name, _)| name.to_owned()).collect();
    let mut named: BTreeSet<String> = table().into_keys().collect();
    let without = DOCUMENT.lines().find(|line| line.starts_with("Without reference cases"));
    let without = without.expect("the sentence on quantities without cases");
    named.extend(without.split('`').skip(1).step_by(2).map(str::to_owned));
    let lost: Vec<_> = named.difference(&listed).collect();
    assert!(lost.is_empty(), "{lost:?} are not listed any more; {REMEDY}");
}
