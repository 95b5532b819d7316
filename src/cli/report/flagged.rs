//! Readings that carry a flag, those that the fit left out first, and the effects of a simulated
//! run: tables of bounded length that say how much they hold back.

use std::collections::BTreeMap;

use fit::Robust;

use super::words::Words;
use crate::cli::results::Results;
use crate::cli::setup::Setup;
use crate::cli::text::with_uncertainty;
use crate::export::{TreatedReading, Treatment};
use crate::report::{Section, Table};
use crate::rig::calibration::{Flag, Part, Sample};

/// Readings that are listed, at most.
const LISTED_MAX: usize = 60;

/// The list of flagged readings; `None` where none is.
pub(super) fn section(setup: &Setup, results: &Results) -> Option<Section> {
    let words = Words::of(setup.rig.detector.quantity);
    let treatment = results.fitted.as_ref().ok().map(|fitted| results.treatment(fitted));
    let treated: BTreeMap<u64, TreatedReading> = treatment
        .iter()
        .flat_map(Treatment::listed)
        .map(|reading| (reading.id, *reading))
        .collect();
    let of = |sample: &Sample| treated.get(&u64::from(sample.reading));
    let is_listed = |sample: &&Sample| !sample.flags.is_empty() || of(sample).is_some();
    let mut flagged: Vec<&Sample> = results.calibrated.samples.iter().filter(is_listed).collect();
    if flagged.is_empty() {
        return None;
    }
    let place = |sample: &&Sample| match sample.part() {
        Part::None => 0,
        Part::Limit => 1,
        Part::Value => 2 + u8::from(of(sample).is_none()),
    };
    flagged.sort_by_key(place);
    let (all, listed) = (flagged.len(), flagged.len().min(LISTED_MAX));
    let mut paragraphs = vec![count(results, all)];
    if let Some(treatment) = &treatment {
        let rule = match treatment.robust() {
            Robust::None => "Outliers were not reweighed.".to_owned(),
            robust => format!("Outliers were weighed by {}'s rule.", robust.name()),
        };
        let counts = treatment.counts();
        let counts = counts.iter().map(|(why, count)| format!("{count} {}", why.in_words()));
        let counts: Vec<String> = counts.collect();
        paragraphs.push(format!("{rule} {}", counts.join("; ")));
    }
    if listed < all {
        paragraphs.push(format!(
            "The first {listed} are listed; samples.csv has all flags, weights.csv all weights."
        ));
    }
    let columns = [
        "target",
        "repeat",
        "time / s",
        "x / mm",
        "y / mm",
        "θ / °",
        "φ / °",
        words.radiance,
        "flags",
        "residual / u",
        "weight",
    ];
    let row = |sample: &&Sample| {
        vec![
            sample.index.to_string(),
            sample.repeat.to_string(),
            format!("{:.2}", sample.time_s),
            format!("{:.2}", sample.pose.x_m * 1e3),
            format!("{:.2}", sample.pose.y_m * 1e3),
            format!("{:.2}", sample.pose.theta_rad.to_degrees()),
            format!("{:.2}", sample.pose.phi_rad.to_degrees()),
            with_uncertainty(sample.value, sample.u, words.radiance_unit),
            sample.flags.iter().map(Flag::name).collect::<Vec<_>>().join(", "),
            of(sample).and_then(|r| r.residual).map_or_else(String::new, |z| format!("{z:+.1}")),
            match (of(sample), sample.part()) {
                (Some(reading), _) => format!("{:.3} ({})", reading.weight, reading.why.in_words()),
                (None, Part::None) => "0".to_owned(),
                (None, _) => "1".to_owned(),
            },
        ]
    };
    let table = Table {
        columns: columns.map(str::to_owned).into(),
        rows: flagged.iter().take(LISTED_MAX).map(row).collect(),
    };
    let title = "Excluded and flagged readings".to_owned();
    Some(Section { title, paragraphs, table, ..Section::default() })
}

fn count(results: &Results, listed: usize) -> String {
    let said = format!("{listed} readings carry a flag or are far from the fit.");
    let (kept, of) = (results.calibrated.samples.len(), results.tally.measured);
    if kept == of {
        return said;
    }
    format!("{said} Of {of} that the run has, {kept} were kept for this report.")
}

/// The effects that a simulated rig was compiled to; `None` on hardware.
pub(super) fn effects(setup: &Setup) -> Option<Section> {
    let rows = setup.stage.as_ref()?.compiled.effects();
    let (included, out): (Vec<_>, Vec<_>) = rows.iter().partition(|row| row.included);
    let row = |row: &&sim::EffectRow| {
        vec![
            row.name.clone(),
            row.cause.clone().unwrap_or_default(),
            row.bound.map_or_else(|| "–".to_owned(), |bound| bound.to_string()),
            row.how.clone(),
        ]
    };
    let table = Table {
        columns: ["effect", "called for by", "at most, or u", "how"].map(str::to_owned).into(),
        rows: included.iter().map(row).collect(),
    };
    let count = format!(
        "{} effects are part of this run; {} others were weighed and left out (gonio explain shows \
         them).",
        included.len(),
        out.len()
    );
    let title = "Effects in the simulation".to_owned();
    Some(Section { title, paragraphs: vec![count], table, ..Section::default() })
}
