//! What a frontier says: its table, what twice the time buys, and the page with the pictures.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::cli::setup::Setup;
use crate::cli::text::{duration, percent, table};
use crate::report::{Picture, Report, Section, Table};
use crate::study::{FrontierPoint, FrontierRow, by_strategy, coverage, doubling};

const HEADS: [&str; 9] = [
    "strategy",
    "rung",
    "rig time",
    "foretold",
    "radiance",
    "its shape",
    "foretold",
    "exitance",
    "",
];

/// For a terminal.
pub(super) fn as_text(rows: &[FrontierRow], points: &[FrontierPoint], orders: &[String]) -> String {
    let mut lines = vec![HEADS.map(str::to_owned).to_vec()];
    lines.extend(points.iter().map(cells));
    let mut text = table(&lines);
    text.push('\n');
    for words in doublings(points).iter().chain(orders) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {words}");
    }
    let _ = writeln!(text, "  {}", honesty(rows));
    text
}

fn cells(point: &FrontierPoint) -> Vec<String> {
    let foretold = point.foretold.uncertainty;
    vec![
        point.strategy.clone(),
        point.parameters.clone(),
        duration(point.rig_s),
        duration(point.foretold.rig_s),
        percent(point.radiance[1]),
        percent(point.shape[1]),
        foretold.map_or_else(String::new, |u| percent(u.shape)),
        percent(point.exitance_rms),
        if point.is_on_front { "front".to_owned() } else { String::new() },
    ]
}

/// For each strategy, between neighbours.
fn doublings(points: &[FrontierPoint]) -> Vec<String> {
    let mut words = Vec::new();
    for (name, curve) in by_strategy(points) {
        let pairs = curve.windows(2).filter_map(|pair| doubling(pair[0], pair[1]));
        words.extend(pairs.map(|said| format!("{name}: {said}")));
    }
    words
}

fn honesty(rows: &[FrontierRow]) -> String {
    let coverage = coverage(rows);
    format!(
        "exitance over {} runs: RMS of error over stated u {:.2}, {} within 2 u",
        rows.len(),
        coverage.rms_of_error_over_u,
        percent(coverage.within_2u),
    )
}

/// For a browser.
pub(super) fn page(
    setup: &Setup,
    title: &str,
    (rows, points): (&[FrontierRow], &[FrontierPoint]),
    pictures: Vec<Picture>,
    orders: Vec<String>,
) -> Report {
    let fact = |name: &str, text: String| (name.to_owned(), text);
    let seeds = rows.iter().map(|row| row.seed);
    let (first, last) = seeds.fold((u64::MAX, 0), |(low, high), s| (low.min(s), high.max(s)));
    let facts = vec![
        fact("plan", setup.plan_name.clone()),
        fact("rig", format!("{} (simulated)", setup.rig.name)),
        fact("runs", format!("{}, of {} plans, seeds {first} to {last}", rows.len(), points.len())),
        fact("stated uncertainty", honesty(rows)),
    ];
    let rungs = Table {
        columns: HEADS.map(str::to_owned).to_vec(),
        rows: points.iter().map(cells).collect(),
    };
    let explained = "Rig time, and the median over the seeds of the radiance's relative error over \
                     the region; its shape is the error once the factor that fits the truth best is \
                     taken out, which no density or dwell can mend. Exitance: root mean square over \
                     the seeds. Foretold: what the plan alone says beforehand. On the front is what \
                     no other rung betters in less time.";
    Report {
        title: title.to_owned(),
        banners: vec!["Simulated: every run is of the simulated rig".to_owned()],
        facts,
        sections: vec![
            Section { title: "Error against rig time".to_owned(), pictures, ..Section::default() },
            Section {
                title: "Rungs".to_owned(),
                paragraphs: vec![explained.to_owned()],
                table: rungs,
                ..Section::default()
            },
            Section {
                title: "What twice the time buys".to_owned(),
                items: doublings(points),
                ..Section::default()
            },
            Section {
                title: "Order of the targets".to_owned(),
                paragraphs: vec![
                    "Moving and settling from target to target and back, against a bound below \
                     every order (Held and Karp's)."
                        .to_owned(),
                ],
                items: orders,
                ..Section::default()
            },
        ],
    }
}

/// A line of JSON.
pub(super) fn as_json(row: &FrontierRow) -> Value {
    let known = row.foretold;
    json!({
        "scene": row.scene, "strategy": row.strategy, "parameters": row.parameters,
        "seed": row.seed, "rig_s": row.rig_s, "readings": row.readings,
        "error_radiance_rms_relative": row.error_radiance_rms_relative,
        "error_exitance_relative": row.error_exitance_relative,
        "error_flux_relative": row.error_flux_relative,
        "u_exitance_relative": row.u_exitance_relative,
        "compute_s": row.compute_s,
        "error_shape_rms_relative": row.error_shape_rms_relative,
        "error_exitance_shape_relative": row.error_exitance_shape_relative,
        "predicted_rig_s": known.rig_s,
        "predicted_u_radiance_relative": known.uncertainty.map(|u| u.radiance),
        "predicted_u_shape_relative": known.uncertainty.map(|u| u.shape),
        "predicted_u_exitance_relative": known.uncertainty.map(|u| u.exitance),
        "predicted_u_exitance_shape_relative": known.uncertainty.map(|u| u.exitance_shape),
        "way_s": known.way_s,
        "dwelling_s": known.dwelling_s,
        "photon_limit_relative": known.uncertainty.map(|u| u.photon_limit),
    })
}
