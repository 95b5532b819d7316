//! The last thing that a run prints: what was measured, in which time, with which uncertainty,
//! and on a simulated rig how far from the truth.

use std::fmt::Write as _;
use std::path::Path;

use fit::{Angular, BasisSpec, BeamRows, Choice, Fit, Penalty, Position, Resolves, Robust, Width};
use serde_json::{Value, json};

use super::adapting;
use super::derive;
use super::report::REPORT;
use super::results::{Results, targets_planned};
use super::setup::Setup;
use super::stopping;
use super::text::{duration, percent, row, table, with_uncertainty};
use crate::export::{Treatment, charted};
use crate::rig::Quantity;
use crate::run::Outcome;
use crate::study::Trend;

/// What a summary says beside the results.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Summary<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) setup: &'a Setup,
    pub(crate) results: &'a Results,
    /// Why the run ended.
    pub(crate) outcome: &'a Outcome,
    pub(crate) rig_s: f64,
    pub(crate) wall_s: f64,
}

impl Summary<'_> {
    /// For a terminal.
    pub(crate) fn text(&self) -> String {
        let Self { setup, results, .. } = self;
        let simulated = if setup.rig.is_simulated() { " (simulated)" } else { "" };
        let (measured, planned) = self.targets();
        let mut rows = vec![
            row("run", format!("{}{simulated}: {}", setup.plan_name, self.ending())),
            row("targets", format!("{measured} of {planned} measured")),
            row("time in rig", duration(self.rig_s)),
            row("time on the clock", duration(self.wall_s)),
        ];
        let flags: Vec<_> = results.tally.flags().collect();
        if !flags.is_empty() {
            let list: Vec<String> = flags.iter().map(|(flag, n)| format!("{n} {flag}")).collect();
            rows.push(row("flags", list.join(", ")));
        }
        if let Some(drift) = results.calibrated.drift() {
            let spread = percent(drift.spread / drift.mean.abs());
            rows.push(row("reference", format!("{} readings within {spread}", drift.readings)));
        }
        rows.extend(adapting::rows(setup));
        rows.extend(self.fit_rows());
        rows.extend(results.remarks().into_iter().map(|remark| row("note", remark)));
        rows.push(row("folder", self.folder.display().to_string()));
        rows.push(row("report", self.folder.join(REPORT).display().to_string()));
        table(&rows)
    }

    fn fit_rows(&self) -> Vec<Vec<String>> {
        let fitted = match &self.results.fitted {
            Ok(fitted) => fitted,
            Err(error) => return vec![row("fit", format!("none: {error}"))],
        };
        let fit = &fitted.fit;
        let exitance = fit.exitance();
        let mut rows = model_rows(fit, fitted.choice.as_ref(), Some(fitted.resolves));
        let treatment = self.results.treatment(fitted);
        rows.extend(treatment_rows(&treatment, self.setup.rig.detector.quantity));
        rows.extend(field_rows(fit, self.setup.rig.detector.quantity));
        if exitance.value > 0.0 {
            let independent = percent(exitance.u_independent / exitance.value);
            let whole = percent(exitance.u / exitance.value);
            rows.push(row(
                "u, relative",
                format!("{whole} (k = 1), its part not shared by all readings {independent}"),
            ));
        }
        if let Some(trend) = Trend::of_exitance(self.rig_s, fit) {
            rows.push(row("more time", stopping::in_words(&trend, self.setup)));
        }
        if let Some(truth) = self.results.truth.filter(|truth| truth.exitance > 0.0) {
            let error = exitance.value - truth.exitance;
            let relative = percent(error / truth.exitance);
            let in_u = error / exitance.u;
            rows.push(row(
                "error of exitance",
                format!("{relative} ({in_u:+.2} u) against the simulator's truth"),
            ));
            if let Some(rms) = truth.radiance_error_rms_relative {
                let rms = percent(rms);
                rows.push(row("error of radiance", format!("{rms} RMS over the region")));
            }
        }
        rows.extend(derive::rows(&self.results.derived, self.setup.rig.detector.quantity));
        rows
    }

    /// One JSON document.
    pub(crate) fn json(&self) -> Value {
        let Self { setup, results, .. } = self;
        let quantity = setup.rig.detector.quantity;
        let (measured, planned) = self.targets();
        let mut object = json!({
            "plan": setup.plan_name,
            "rig": setup.rig.name,
            "simulated": setup.rig.is_simulated(),
            "outcome": self.outcome.name(),
            "rule": self.rule(),
            "targets_measured": measured,
            "targets_planned": planned,
            "rig_s": self.rig_s,
            "wall_s": self.wall_s,
            "flags": results.tally.flags().map(|(f, n)| (f.to_owned(), json!(n))).collect::<serde_json::Map<_, _>>(),
            "folder": self.folder.display().to_string(),
            "report": self.folder.join(REPORT).display().to_string(),
        });
        if results.blocks.is_some() {
            object["notes"] = json!(results.remarks());
        }
        if setup.plan.adaptive().is_some() {
            object["adaptive"] = adapting::as_json(setup);
        }
        match &results.fitted {
            Ok(fitted) => {
                let (exitance, flux) = (fitted.fit.exitance(), fitted.fit.flux());
                object[quantity.exitance_key()] = json!({
                    "value": exitance.value, "u": exitance.u, "u_independent": exitance.u_independent,
                    "measured_fraction": fitted.fit.measured_fraction(),
                });
                if let Some(trend) = Trend::of_exitance(self.rig_s, &fitted.fit) {
                    object["accuracy"] = stopping::as_json(&trend, setup);
                }
                object[quantity.flux_key()] = json!({"value": flux.value, "u": flux.u});
                if let Some(truth) = &results.truth {
                    object["truth"] = json!({
                        quantity.exitance_key(): truth.exitance,
                        quantity.flux_key(): truth.flux,
                        "radiance_error_rms_relative": truth.radiance_error_rms_relative,
                    });
                }
            }
            Err(error) => object["fit_error"] = json!(error.to_string()),
        }
        object
    }

    /// The plan's rule that ended the run.
    fn rule(&self) -> Option<&str> {
        match self.outcome {
            Outcome::Reached(rule) => Some(rule),
            _ => None,
        }
    }

    fn ending(&self) -> String {
        match self.rule() {
            Some(rule) => format!("stopped by the plan's rule: {rule}"),
            None => self.outcome.name().to_owned(),
        }
    }

    fn targets(&self) -> (usize, usize) {
        (self.results.tally.measured, targets_planned(self.setup))
    }
}

/// How the fit's rows stand for the beam.
fn in_words(beam: BeamRows) -> String {
    let BeamRows { point, averaged, cut, off_sample, .. } = beam;
    let kinds = [
        (averaged, "averaged over the beam"),
        (cut, "over the part of it that meets the sample"),
        (off_sample, "beside the sample"),
        (point, "along its axis alone"),
    ];
    let said = kinds.into_iter().filter(|(count, _)| *count > 0);
    let said: Vec<String> = said.map(|(count, how)| format!("{count} {how}")).collect();
    format!("readings {}", said.join(", "))
}

/// What a fit is made of, what it was chosen from, and what it can show.
pub(crate) fn model_rows(
    fit: &Fit,
    choice: Option<&Choice>,
    resolves: Option<Resolves>,
) -> Vec<Vec<String>> {
    let held = if fit.penalty().is_none() {
        "no penalty".to_owned()
    } else {
        let Penalty { power, strength } = fit.penalty();
        let determined = fit.determined();
        format!("penalty of power {power}, strength {strength:.2e}; {determined:.0} determined")
    };
    let count = fit.coefficients().len();
    let basis = format!("{}, {count} coefficients, {held}", basis_in_words(fit.basis()));
    let mut rows = vec![row("basis", basis)];
    rows.extend(choice.map(|choice| row("  chosen by", choice_in_words(choice))));
    rows.extend(resolves.as_ref().map(|resolves| row("resolves", resolves_in_words(resolves))));
    rows.extend(resolves.as_ref().map(|resolves| row("not looked for", unseen_in_words(resolves))));
    rows.extend(fit.aliased().map(|cause| row("note", cause.to_string())));
    rows
}

fn basis_in_words(basis: BasisSpec) -> String {
    let angular = match basis.angular {
        Angular::Zernike { degree, cosine_columns: 0 } => format!("Zernike of degree {degree}"),
        Angular::Zernike { degree, cosine_columns } => {
            format!("Zernike of degree {degree} and {cosine_columns} of cos θ")
        }
        Angular::Hemispherical { degree } => format!("hemispherical harmonics of degree {degree}"),
        Angular::Spherical { degree } => format!("spherical harmonics of degree {degree}"),
        Angular::SecondPlane { degree } => format!("Legendre in s and t of degree {degree}"),
        Angular::EvenHarmonics { degree } => format!("even harmonics of degree {degree}"),
        Angular::Splines { theta_spans, phi_spans, fine } => {
            let spans =
                format!("splines of {theta_spans} spans in θ, {phi_spans} round the horizon");
            let deg = |span: usize, spans: usize, whole: f64| whole * span as f64 / spans as f64;
            let times = |halvings: usize| 1_u64 << halvings.min(52);
            let (from, to) = (deg(fine.from, theta_spans, 90.0), deg(fine.to, theta_spans, 90.0));
            let finer = times(fine.halvings);
            let along = format!("{spans}, {finer} times as fine from {from:.0}° to {to:.0}°");
            let around = fine.around;
            if fine.is_none() {
                spans
            } else if around.is_none() {
                along
            } else {
                // Through φ = 0 it goes on from there.
                let at = |span| deg(span, phi_spans, 360.0);
                let end = if around.to > phi_spans { around.to - phi_spans } else { around.to };
                let (finer, from, to) = (times(around.halvings), at(around.from), at(end));
                format!("{along}, there in φ {finer} times from {from:.0}° to {to:.0}°")
            }
        }
    };
    match basis.position {
        Position::Legendre { degree: 0 } => angular,
        Position::Legendre { degree } => format!("{angular}, degree {degree} in x and y"),
        Position::Splines { spans } => format!("{angular}, splines of {spans} spans in x and y"),
    }
}

fn choice_in_words(choice: &Choice) -> String {
    let Choice { sweeps, n_sweeps, n_lines, n_readings, candidates } = choice;
    let tried = candidates.len();
    let lines =
        n_lines.map(|lines| format!(", {lines} lines at all places each")).unwrap_or_default();
    let text = format!(
        "leaving out {} ({n_sweeps} of {n_readings} readings{lines}), of {tried} tried",
        sweeps.name()
    );
    let Some(next) = candidates.get(1) else { return text };
    let basis = basis_in_words(next.model.basis);
    format!("{text}; next {basis} ({:+.2} a reading)", next.score)
}

/// What may have been missed: the report says so too.
pub(crate) fn unseen_in_words(resolves: &Resolves) -> String {
    let round = resolves.phi_rad.map_or(0.0, |phi| phi.width * resolves.measured_to_rad.sin());
    let width = resolves.theta_rad.width.max(round).to_degrees();
    if width.is_finite() {
        format!(
            "features narrower than {width:.1}° of arc: they may lie between the readings, or be \
             smeared out"
        )
    } else {
        "features of any width".to_owned()
    }
}

fn resolves_in_words(resolves: &Resolves) -> String {
    let degrees = |width: Width| {
        if width.width.is_finite() {
            format!("{:.1}° ({})", width.width.to_degrees(), width.limit.name())
        } else {
            "nothing".to_owned()
        }
    };
    let mm = |axis: &str, width: Option<Width>| {
        let width = width?;
        Some(format!("{:.1} mm in {axis} ({})", width.width * 1e3, width.limit.name()))
    };
    let mut text = vec![format!("{} in θ", degrees(resolves.theta_rad))];
    text.extend(resolves.phi_rad.map(|width| format!("{} in φ", degrees(width))));
    text.extend(mm("x", resolves.x_m));
    text.extend(mm("y", resolves.y_m));
    let measured = resolves.measured_to_rad.to_degrees();
    format!("{}; nothing was measured beyond {measured:.1}°", text.join(", "))
}

/// What became of readings that are no plain ones, what was fitted along, what the field was held
/// to.
pub(crate) fn treatment_rows(treatment: &Treatment<'_>, quantity: Quantity) -> Vec<Vec<String>> {
    let [radiance_unit, exitance_unit, _] = quantity.units();
    let mut rows = Vec::new();
    if treatment.robust() != Robust::None {
        rows.push(row("outliers", format!("weighed by {}'s rule", treatment.robust().name())));
    }
    let counts = treatment.counts();
    if !counts.is_empty() {
        let said = counts.iter().map(|(why, count)| format!("{count} {}", why.in_words()));
        rows.push(row("readings", said.collect::<Vec<_>>().join("; ")));
    }
    if let Some(drift) = treatment.drift() {
        let (begin, end) = (drift.at(drift.time_s.0), drift.at(drift.time_s.1));
        let text = format!(
            "{:+.3} % to {:+.3} % of the mean, fitted along: degree {} by {} reference readings",
            100.0 * begin,
            100.0 * end,
            drift.degree,
            drift.readings
        );
        rows.push(row("drift", text));
    }
    let ranges = treatment.nuisances().iter().filter(|n| !n.name.starts_with("drift"));
    rows.extend(ranges.map(|n| {
        let text = format!("off by {:+.2} of its u, known to {:.2} of it", n.value, n.u);
        row(&n.name, text)
    }));
    match treatment.symmetry() {
        Some(Ok(test)) => {
            let text = format!("{} (p = {:.2})", test.symmetry.name(), test.p);
            rows.push(row("symmetry", text));
        }
        Some(Err(why)) => rows.push(row("symmetry", format!("not used: {why}"))),
        None => {}
    }
    if let Some(bound) = treatment.nonnegative() {
        let text = if bound.held.is_empty() {
            "nowhere below zero, nothing held".to_owned()
        } else {
            let (held, of, least) = (bound.held.len(), bound.rays, bound.least);
            format!(
                "held at {held} of {of} rays (down to {least:.2e} {radiance_unit} before); exitance \
                 {:+.2e} {exitance_unit}",
                bound.exitance
            )
        };
        rows.push(row("nonnegative", text));
    }
    rows
}

/// What a fit says of its field, whoever asks.
/// Those of a chart other than the surface one.
fn charted_rows(fit: &Fit, quantity: Quantity) -> Vec<Vec<String>> {
    let mut rows = vec![row("chart", fit.region().chart.name().to_owned())];
    for one in charted(fit, quantity) {
        let estimate = one.derived.estimate;
        let mut said = with_uncertainty(estimate.value, estimate.u, one.unit);
        if let Some((theta_rad, phi_rad)) = one.towards {
            let (theta_deg, phi_deg) = (theta_rad.to_degrees(), phi_rad.to_degrees());
            let _ = write!(said, ", theta {theta_deg:.1}°, phi {phi_deg:.1}°");
        }
        rows.push(row(one.name, said));
        let part = one.derived.measured_fraction.filter(|fraction| *fraction < 1.0 - 1e-9);
        if let Some(fraction) = part {
            rows.push(row("", format!("{} of it from where it was measured", percent(fraction))));
        }
    }
    rows
}

pub(crate) fn field_rows(fit: &Fit, quantity: Quantity) -> Vec<Vec<String>> {
    let [radiance_unit, exitance_unit, flux_unit] = quantity.units();
    let mut rows = Vec::new();
    if fit.region().chart == fit::Chart::Surface {
        let (exitance, flux) = (fit.exitance(), fit.flux());
        rows.push(row("exitance", with_uncertainty(exitance.value, exitance.u, exitance_unit)));
        if let Some(fraction) = fit.measured_fraction() {
            let name = format!("  within {:.0}°", fit.region().theta_max_rad.to_degrees());
            let within = fit.exitance_within_region();
            let said = with_uncertainty(within.value, within.u, exitance_unit);
            rows.push(row(
                &name,
                format!("{said}; {} of the exitance was measured", percent(fraction)),
            ));
        }
        rows.push(row("flux", with_uncertainty(flux.value, flux.u, flux_unit)));
    } else {
        rows.extend(charted_rows(fit, quantity));
    }
    rows.extend(fit.beam().map(|beam| row("beam", in_words(beam))));
    let excess = fit.excess_rms();
    if excess > 0.0 {
        // What the fit's functions can't follow, or a source that wavers.
        let text = format!("{excess:.2e} {radiance_unit} RMS beyond the readings' stated noise");
        rows.push(row("misfit", text));
    }
    rows
}
