//! The head of a report: what run this was, with what, how it ended, what is remarkable.

use super::RunRecord;
use super::words::Words;
use crate::cli::results::{Results, targets_planned};
use crate::cli::setup::Setup;
use crate::cli::text::{duration, percent};
use crate::device::Composer;
use crate::journal::{Event, EventKind, InputRole};
use crate::report::significant;
use crate::rig::calibration::Fitted;

/// What nobody may overlook.
pub(super) fn banners(setup: &Setup, results: &Results, record: &RunRecord<'_>) -> Vec<String> {
    let mut banners = Vec::new();
    if record.header.simulated {
        banners.push(
            "Simulated: these readings were computed from a scene, nothing was measured."
                .to_owned(),
        );
    }
    let (measured, planned) = (results.tally.measured, targets_planned(setup));
    if measured < planned {
        banners.push(format!("{measured} of {planned} targets measured."));
    }
    banners
}

/// Names and texts of the run's facts.
pub(super) fn facts(
    setup: &Setup,
    results: &Results,
    record: &RunRecord<'_>,
) -> Vec<(String, String)> {
    let header = &record.header;
    let words = Words::of(setup.rig.detector.quantity);
    let simulated = if header.simulated { " (simulated)" } else { "" };
    let mut facts = vec![
        ("Plan", format!("{}, {}", header.plan_name, header.plan_hash)),
        ("Rig", format!("{}{simulated}", header.rig_name)),
        ("Quantity", Words::with_unit(words.radiance, words.radiance_unit)),
        ("Sample", outline(setup)),
        ("Region", region(setup)),
        ("Started", header.started_utc.clone()),
        ("Rig time", duration(rig_time_s(results, record))),
        ("Ended", ending(record)),
        ("Targets", targets(setup, results)),
        ("Flags", flags(results)),
    ];
    if header.simulated {
        let scene = setup.inputs.iter().find(|input| input.role == InputRole::Scene);
        let scene = scene.map_or_else(|| "none".to_owned(), |scene| scene.name.clone());
        facts.push(("Scene", format!("{scene}, seed {}", header.seed)));
    }
    if let Some(composer) = Composer::of(&setup.rig, 0) {
        let devices = composer.promises().into_iter().map(|(name, promises)| {
            let watchdog = promises.watchdog.map_or_else(
                || "no device watchdog".to_owned(),
                |after| format!("stops by itself after {} ms", after.as_millis()),
            );
            let called = called(record, &name);
            format!("{name}: {called}{watchdog}; done means {}", promises.done)
        });
        facts.push(("Devices", devices.collect::<Vec<_>>().join(". ")));
    }
    if let Ok(fitted) = &results.fitted {
        facts.push(("Fit", fit(fitted, &words)));
    }
    facts.push(("Program", format!("gonio {}", header.program_version)));
    facts.into_iter().map(|(name, text)| (name.to_owned(), text)).collect()
}

/// What a device called itself when it was last reached, if it was.
fn called(record: &RunRecord<'_>, device: &str) -> String {
    let name = |event: &Event| {
        let text = event.text.strip_prefix(device)?.strip_prefix(": ")?;
        (event.kind == EventKind::Device).then(|| format!("{}; ", text.trim()))
    };
    record.events.iter().rev().find_map(name).unwrap_or_default()
}

fn outline(setup: &Setup) -> String {
    let span = |(low, high): (f64, f64)| format!("{} to {} mm", mm(low), mm(high));
    match setup.plan.sample {
        None => "its outline is not stated".to_owned(),
        Some(fit::Outline::Rectangle { x_m, y_m }) => {
            format!("rectangle, x {}, y {}", span(x_m), span(y_m))
        }
        Some(fit::Outline::Disk { centre_m: (x, y), radius_m }) => {
            format!("disk of radius {} mm about ({}, {}) mm", mm(radius_m), mm(x), mm(y))
        }
    }
}

fn region(setup: &Setup) -> String {
    let region = setup.region();
    let [x, y] = [region.x_m, region.y_m].map(|(low, high)| format!("{} to {}", mm(low), mm(high)));
    format!("x {x} mm, y {y} mm, θ up to {:.4}°", region.theta_max_rad.to_degrees())
        .replace(".0000°", "°")
}

/// Millimetres, to a thousandth of them.
fn mm(m: f64) -> String {
    let text = format!("{:.3}", m * 1e3);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The end of the last reading or of the last session, whichever is later.
pub(super) fn rig_time_s(results: &Results, record: &RunRecord<'_>) -> f64 {
    let sessions = record.sessions.iter().filter_map(|session| session.ended.as_ref());
    sessions.map(|(ended_s, _)| *ended_s).fold(results.tally.ended_s, f64::max)
}

fn ending(record: &RunRecord<'_>) -> String {
    let last = record.sessions.last();
    let how = match last.map(|session| &session.ended) {
        Some(Some((_, reason))) => reason.clone(),
        _ => "not yet, or cut off".to_owned(),
    };
    match record.sessions.len() {
        0 | 1 => how,
        n => format!("{how}; {n} sessions"),
    }
}

fn targets(setup: &Setup, results: &Results) -> String {
    let (measured, planned) = (results.tally.measured, targets_planned(setup));
    format!("{measured} of {planned} measured")
}

fn flags(results: &Results) -> String {
    let counts = results.tally.flags();
    let said: Vec<String> = counts.map(|(name, count)| format!("{count} {name}")).collect();
    match (said.is_empty(), results.tally.left_out) {
        (true, _) => "none".to_owned(),
        (false, 0) => said.join(", "),
        (false, n) => format!("{}; {n} left out of the fit", said.join(", ")),
    }
}

fn fit(fitted: &Fitted, words: &Words) -> String {
    let fit = &fitted.fit;
    let unit = words.radiance_unit;
    format!(
        "{} coefficients from {} readings, condition {:.1}, residuals {} {unit} RMS",
        fit.coefficients().len(),
        fit.n_used(),
        fit.condition(),
        significant(fit.residual_rms(), 3)
    )
}

/// What a reader must know to read the numbers right, one sentence each.
pub(super) fn notes(setup: &Setup, results: &Results) -> Vec<String> {
    let words = Words::of(setup.rig.detector.quantity);
    let mut notes = Vec::new();
    if let Some(drift) = results.calibrated.drift() {
        let spread = percent(drift.spread / drift.mean.abs());
        notes.push(format!(
            "The reference pose was read {} times, all within {spread}. Drift is flagged, not \
             corrected.",
            drift.readings
        ));
    }
    let remarks = results.remarks();
    if !remarks.is_empty() {
        notes.push(format!("The run was {}.", remarks.join("; ")));
    }
    let Ok(fitted) = &results.fitted else { return notes };
    let fit = &fitted.fit;
    if fit.excess_rms() > 0.0 {
        notes.push(format!(
            "The readings lie {} {} RMS further from the fit than their noise explains: what \
             its functions can't follow, or a source that wavers. It counts as scatter from \
             reading to reading; where it is systematic, u is too small.",
            significant(fit.excess_rms(), 3),
            words.radiance_unit
        ));
    }
    if let Some(fraction) = fit.measured_fraction().filter(|fraction| *fraction < 1.0) {
        let (within, beyond) = (percent(fraction), percent(1.0 - fraction));
        notes.push(format!(
            "{within} of the {} leave within the region's cone of {:.1}°; the other {beyond} are \
             extrapolated.",
            words.exitance,
            fit.region().theta_max_rad.to_degrees()
        ));
    }
    notes
}
