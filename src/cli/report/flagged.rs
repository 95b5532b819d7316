//! Readings that carry a flag, those that the fit left out first, and the effects of a simulated
//! run: tables of bounded length that say how much they hold back.

use super::words::Words;
use crate::cli::results::Results;
use crate::cli::setup::Setup;
use crate::cli::text::with_uncertainty;
use crate::report::{Section, Table};
use crate::rig::calibration::{Flag, Sample};

/// Readings that are listed, at most.
const LISTED_MAX: usize = 60;

/// The list of flagged readings; `None` where none is.
pub(super) fn section(setup: &Setup, results: &Results) -> Option<Section> {
    let words = Words::of(setup.rig.detector.quantity);
    let mut flagged: Vec<&Sample> =
        results.calibrated.samples.iter().filter(|sample| !sample.flags.is_empty()).collect();
    if flagged.is_empty() {
        return None;
    }
    flagged.sort_by_key(|sample| !sample.flags.excludes_from_fit());
    let excluded = flagged.iter().filter(|sample| sample.flags.excludes_from_fit()).count();
    let (all, listed) = (flagged.len(), flagged.len().min(LISTED_MAX));
    let mut paragraphs =
        vec![format!("{all} readings carry a flag; {excluded} of them are left out of the fit.")];
    if listed < all {
        paragraphs.push(format!("The first {listed} are listed; samples.csv has all."));
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
        "in the fit",
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
            if sample.flags.excludes_from_fit() { "no" } else { "yes" }.to_owned(),
        ]
    };
    let table = Table {
        columns: columns.map(str::to_owned).into(),
        rows: flagged.iter().take(LISTED_MAX).map(row).collect(),
    };
    let title = "Excluded and flagged readings".to_owned();
    Some(Section { title, paragraphs, table, ..Section::default() })
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
