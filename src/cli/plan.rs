//! `gonio plan`: what a plan means on its rig, and what it costs. Moves nothing but a simulated rig, where
//! a rehearsal is asked for.

use std::process::ExitCode;

use serde_json::json;

use super::args::{EffectArgs, PlanArgs};
use super::failure::Outcome;
use super::outlook::{self, outlook, warning};
use super::output::{note, say, say_json};
use super::rehearsal::{Rehearsal, rehearse};
use super::setup::Setup;
use super::target;
use super::text::{duration, percent, row, table};
use crate::plan::Prediction;
use crate::rig::AXES;
use crate::study::{Forecast, ForecastError};

/// Checks a plan and prints its prediction.
pub(crate) fn plan(args: &PlanArgs) -> Outcome {
    let setup = match args.rehearse {
        Some(_) => Setup::for_rehearsal(&args.plan, &args.rig)?,
        None => Setup::from_disk(&args.plan, &args.rig, &EffectArgs::default())?,
    };
    if !args.target.is_empty() {
        return target::plan(args, &setup);
    }
    target::check_unused(args)?;
    let prediction = &setup.sequence.prediction;
    let outlook = outlook(&setup);
    let rehearsal = args.rehearse.map(|runs| rehearse(&setup, runs)).transpose()?;
    if args.json {
        let mut said = as_json(&setup, prediction, &outlook);
        if let Some(rehearsal) = &rehearsal {
            said["rehearsal"] = rehearsal.as_json();
        }
        say_json(&said)?;
    } else {
        let rehearsed = rehearsal.as_ref().map(Rehearsal::text).unwrap_or_default();
        say(&(as_text(&setup, prediction, &outlook) + &rehearsed))?;
    }
    if let Some(warning) = warning(&outlook) {
        note(&warning);
    }
    Ok(ExitCode::SUCCESS)
}

fn as_text(
    setup: &Setup,
    prediction: &Prediction,
    outlook: &Result<Forecast, ForecastError>,
) -> String {
    let simulated = if setup.rig.is_simulated() { " (simulated)" } else { "" };
    let mut rows = vec![
        row("plan", format!("{} ({})", setup.plan_name, setup.plan_hash)),
        row("rig", format!("{}{simulated}", setup.rig.name)),
        row("targets", prediction.targets.to_string()),
        row("readings", prediction.readings.to_string()),
    ];
    if let Some(step) = setup.sequence.steps.first() {
        let gain = setup.rig.detector.gains.get(usize::from(step.gain));
        rows.extend(gain.map(|gain| row("gain", gain.name.clone())));
    }
    if let Some(sweeps) = sweeps(setup) {
        rows.push(row("sweeps", sweeps));
    }
    for (axis, travel) in AXES.iter().zip(prediction.travel) {
        rows.push(row(&format!("travel {}", axis.name()), axis.in_file_unit(travel)));
    }
    let parts = [
        ("homing, at most", prediction.homing_s),
        ("moving", prediction.moving_s),
        ("settling", prediction.settling_s),
        ("dwelling", prediction.dwelling_s),
        ("dark and reference", prediction.checking_s),
        ("overhead", prediction.overhead_s),
        ("rig time", prediction.total_s()),
    ];
    rows.extend(parts.map(|(name, seconds)| row(name, duration(seconds))));
    rows.extend(order(setup));
    rows.extend(decided_on_the_way(setup));
    if let Ok(forecast) = outlook {
        rows.push(row("fit", fit(setup, forecast)));
    }
    let mut text = table(&rows);
    match outlook {
        Ok(forecast) => {
            text.push_str(&outlook::text(forecast, setup.region(), setup.rig.detector.quantity));
        }
        // The fit's own refusal is a warning of its own.
        Err(ForecastError::Fit(_)) => {}
        Err(error) => {
            text.extend(["\n  no predicted uncertainty: ", &error.to_string(), "\n"]);
        }
    }
    text
}

/// The fit that is foretold, and where the plan leaves something to the readings what that is.
fn fit(setup: &Setup, forecast: &Forecast) -> String {
    let Some(stands_in) = forecast.stands_in else {
        let (count, condition) = (forecast.coefficients, forecast.condition);
        return format!("{count} coefficients, all determined (condition {condition:.1})");
    };
    match setup.plan.fit.basis() {
        None => {
            format!("chosen from the readings; here stand in {}", outlook::basis(stands_in))
        }
        Some(pinned) if pinned == stands_in => format!(
            "{}, their penalty chosen from the readings; here without one",
            outlook::basis(pinned)
        ),
        Some(pinned) => format!(
            "{}, their penalty chosen from the readings; here stand in {}, without one",
            outlook::basis(pinned),
            outlook::basis(stands_in)
        ),
    }
}

/// How good the order of the targets is.
fn order(setup: &Setup) -> Option<Vec<String>> {
    let way = setup.plan.way(&setup.rig, &setup.sequence)?;
    Some(row(
        "order",
        format!(
            "{} of {}; no order takes less than {}: at most {} above",
            duration(way.seconds),
            match setup.sequence.sweeps() {
                0 => "moving and settling through the targets",
                _ => "moving from sweep to sweep",
            },
            duration(way.least_s),
            percent(way.gap()),
        ),
    ))
}

/// What is decided while an adaptive plan runs: all else is said of its first round.
fn decided_on_the_way(setup: &Setup) -> Option<Vec<String>> {
    let adaptive = setup.plan.adaptive()?;
    let radiance = adaptive.radiance_relative.map(|part| format!("radiance to {}", percent(part)));
    let exitance = adaptive.exitance_relative.map(|part| format!("exitance to {}", percent(part)));
    let within = adaptive
        .exitance_within_region_relative
        .map(|part| format!("exitance within the region to {} without the scale", percent(part)));
    let targets: Vec<String> = radiance.into_iter().chain(exitance).chain(within).collect();
    let limit = setup.plan.stop.rig_time_max.map_or(0.0, |limit| limit.as_secs_f64());
    let arc_deg = adaptive.arc_rad(&setup.plan, &setup.rig).to_degrees();
    Some(row(
        "adaptive",
        format!(
            "this is the first round, meridians at most {arc_deg:.1}° of arc apart; more follow until \
             {}, within {} at most",
            targets.join(" and "),
            duration(limit)
        ),
    ))
}

/// How many, how fast, and how far a window goes.
fn sweeps(setup: &Setup) -> Option<String> {
    let (sequence, rig) = (&setup.sequence, &setup.rig);
    let window = sequence.steps.iter().find(|step| step.swept.is_some())?;
    let [theta, phi, ..] = sequence.speeds(rig);
    let travel = rig.axes[0].distance(f64::from(window.swept?.travel.0[0])).abs();
    if rig.takes_sweeps_at_rest() {
        return Some(format!(
            "{}, but this rig's devices take no reading in flight: at rest, window by window, \
             {:.1} ms each",
            sequence.sweeps(),
            window.dwell.as_secs_f64() * 1e3,
        ));
    }
    let window_ms = window.dwell.as_secs_f64() * 1e3;
    if phi > 0.0 {
        return Some(format!(
            "{} round a spiral, the table at {:.2}°/s at most, windows of {window_ms:.1} ms",
            sequence.sweeps(),
            phi.to_degrees(),
        ));
    }
    Some(format!(
        "{} at {:.2}°/s, windows of {window_ms:.1} ms and {:.3}°",
        sequence.sweeps(),
        theta.to_degrees(),
        travel.to_degrees(),
    ))
}

fn as_json(
    setup: &Setup,
    prediction: &Prediction,
    outlook: &Result<Forecast, ForecastError>,
) -> serde_json::Value {
    let fit = match outlook {
        Ok(forecast) => json!({
            "determined": true, "coefficients": forecast.coefficients,
            "condition": forecast.condition,
            "pinned": setup.plan.fit.basis().map(outlook::basis),
            "stands_in": forecast.stands_in.map(outlook::basis),
            "assumed_degree": forecast.stands_in.and_then(|basis| basis.angular.degree()),
        }),
        Err(ForecastError::Fit(error)) => json!({"determined": false, "why": error.to_string()}),
        Err(_) => serde_json::Value::Null,
    };
    let uncertainty = outlook.as_ref().map_or(serde_json::Value::Null, |forecast| {
        outlook::as_json(forecast, setup.rig.detector.quantity)
    });
    let [theta, phi, x, y] = prediction.travel;
    json!({
        "plan": setup.plan_name,
        "plan_hash": setup.plan_hash.to_string(),
        "rig": setup.rig.name,
        "simulated": setup.rig.is_simulated(),
        "targets": prediction.targets,
        "readings": prediction.readings,
        "sweeps": {
            "count": setup.sequence.sweeps(),
            "at_rest": setup.rig.takes_sweeps_at_rest(),
            "speed_deg_per_s": setup.sequence.speeds(&setup.rig)[0].to_degrees(),
        },
        "travel": {
            "theta_deg": theta.to_degrees(), "phi_deg": phi.to_degrees(),
            "x_mm": x * 1e3, "y_mm": y * 1e3,
        },
        "order": setup.plan.way(&setup.rig, &setup.sequence).map(|way| json!({
            "way_s": way.seconds, "least_s": way.least_s, "gap_relative": way.gap(),
        })),
        "adaptive": setup.plan.adaptive().map(|adaptive| json!({
            "radiance_relative": adaptive.radiance_relative,
            "exitance_relative": adaptive.exitance_relative,
            "exitance_within_region_relative": adaptive.exitance_within_region_relative,
            "first_round_s": prediction.total_s(),
            "at_most_s": setup.plan.stop.rig_time_max.map(|limit| limit.as_secs_f64()),
        })),
        "fit": fit,
        "uncertainty": uncertainty,
        "time_s": {
            "homing": prediction.homing_s,
            "moving": prediction.moving_s,
            "settling": prediction.settling_s,
            "dwelling": prediction.dwelling_s,
            "dark_and_reference": prediction.checking_s,
            "overhead": prediction.overhead_s,
            "total": prediction.total_s(),
        },
    })
}
