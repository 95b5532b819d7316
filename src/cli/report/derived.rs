//! What the plan asks to be derived from its fit, as a table of the report.

use super::super::text::{percent, with_uncertainty};
use crate::cli::results::Results;
use crate::cli::setup::Setup;
use crate::export::{DerivedOutcome, DerivedQuantity};
use crate::report::{Section, Table};
use crate::rig::Quantity;

/// The section; `None` where the plan asks for nothing.
pub(super) fn section(setup: &Setup, results: &Results) -> Option<Section> {
    if results.derived.is_empty() {
        return None;
    }
    let quantity = setup.rig.detector.quantity;
    let columns = ["", "value ± u (k = 1)", "measured fraction", "where", "to know"];
    let table = Table {
        columns: columns.map(str::to_owned).into(),
        rows: results.derived.iter().map(|derived| cells(derived, quantity)).collect(),
    };
    Some(Section { title: "Derived quantities".to_owned(), table, ..Section::default() })
}

fn cells(derived: &DerivedQuantity, quantity: Quantity) -> Vec<String> {
    let name = derived.name.replace('_', " ");
    let asked = derived.asked.clone();
    match &derived.outcome {
        Ok(DerivedOutcome::Number { derived: found, .. }) => {
            let estimate = found.estimate;
            let unit = derived.kind.unit(quantity);
            let remarks: Vec<String> = found.remarks.iter().map(ToString::to_string).collect();
            vec![
                name,
                with_uncertainty(estimate.value, estimate.u, unit),
                found.measured_fraction.map(percent).unwrap_or_default(),
                asked,
                remarks.join("; "),
            ]
        }
        Ok(DerivedOutcome::Table(table)) => {
            let rows = format!("{} rows in {}", table.rows.len(), derived.file_name());
            vec![name, rows, String::new(), asked, String::new()]
        }
        Err(why) => vec![name, "none".to_owned(), String::new(), asked, why.clone()],
    }
}
