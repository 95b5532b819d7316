//! `gonio plan --target`: the cheapest plan that reaches an accuracy, and what else was looked at.

use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;
use spanned_toml::{Document, Source};

use super::args::PlanArgs;
use super::failure::{Failure, Outcome};
use super::inputs::{BUILT_IN, beside};
use super::output::{say, say_json};
use super::setup::Setup;
use super::text::{duration, percent, table};
use crate::export::write_atomically;
use crate::plan::{Change, Plan, rewrite};
use crate::study::{Candidate, Considered, Demand, Found, Looked, Search, SearchError, Shortfall};

const HELP: &str = "write for example exitance=0.5%, flux=1% or radiance=0.02";

/// Searches, says what was found, and writes it if asked to.
pub(crate) fn plan(args: &PlanArgs, setup: &Setup) -> Outcome {
    if setup.plan.adaptive().is_some() {
        return Err(Failure::with_help(
            "--target: an adaptive plan has its own target, and finds its sweeps while it runs",
            "set radiance_relative or exitance_relative in its [schedule]",
        ));
    }
    let demand = demand(&args.target, args.without_scale)?;
    if let Some(output) = args.output.as_deref().filter(|output| output.exists()) {
        return Err(Failure::with_help(
            format!("{}: exists already; nothing is overwritten", output.display()),
            "choose another file with -o",
        ));
    }
    let Setup { plan, rig, list, .. } = setup;
    let search = Search { plan, rig, list: list.as_ref(), demand };
    let found = look(&search).map_err(Failure::start)?;
    if let (Some(best), Some(output)) = (&found.best, &args.output) {
        write(&args.plan, plan, best, output)?;
    }
    if args.json {
        say_json(&as_json(&found, args.output.as_deref()))?;
    } else {
        say(&as_text(&found, &demand, args.output.as_deref()))?;
    }
    match &found.floor {
        None => Ok(ExitCode::SUCCESS),
        Some(floor) => Err(Failure::midway(unreachable(floor, &demand))),
    }
}

/// Searches on all of the machine's threads, with a line for a terminal of how far it has come.
fn look(search: &Search<'_>) -> Result<Found, SearchError> {
    let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr_with_hz(5));
    if let Ok(style) = ProgressStyle::with_template("{bar:24} {pos}/{len} plans{msg}") {
        bar.set_style(style);
    }
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let found = search.run(threads, &mut |Looked { done, left, best_s }| {
        bar.set_length((done + left) as u64);
        bar.set_position(done as u64);
        let best = |best_s| format!("; the best so far takes {}", duration(best_s));
        bar.set_message(best_s.map_or_else(String::new, best));
        bar.tick();
    });
    bar.finish_and_clear();
    found
}

/// Without a target there is nothing to write, nor to apply it to.
pub(crate) fn check_unused(args: &PlanArgs) -> Result<(), Failure> {
    let unused = [("--output", args.output.is_some()), ("--without-scale", args.without_scale)];
    match unused.iter().find(|(_, is_given)| *is_given) {
        None => Ok(()),
        Some((name, _)) => Err(Failure::with_help(
            format!("{name}: only a search for a target needs it"),
            format!("add --target: {HELP}"),
        )),
    }
}

/// Reads targets as they were typed.
fn demand(texts: &[String], without_scale: bool) -> Result<Demand, Failure> {
    let mut demand = Demand { without_scale, ..Demand::default() };
    for text in texts {
        let refused =
            |what: &str| Failure::with_help(format!("--target {text}: {what}"), HELP.to_owned());
        let (name, number) = text.split_once('=').ok_or_else(|| refused("expected QUANTITY=U"))?;
        let slot = match name.trim() {
            "exitance" => &mut demand.exitance,
            "flux" => &mut demand.flux,
            "radiance" => &mut demand.radiance,
            _ => return Err(refused("expected exitance, flux or radiance")),
        };
        let number = number.trim();
        let (digits, unit) = match number.strip_suffix('%') {
            Some(digits) => (digits.trim(), 0.01),
            None => (number, 1.0),
        };
        let u: f64 = digits.parse().map_err(|_| refused("expected a number, or one with %"))?;
        let u = unit * u;
        if !(u > 0.0 && u < 1.0) {
            return Err(refused("expected more than 0 and less than 100 %"));
        }
        if slot.replace(u).is_some_and(|before| before.to_bits() != u.to_bits()) {
            return Err(refused("another target for the same quantity was given before"));
        }
    }
    Ok(demand)
}

/// Writes the plan; in another folder, with what it refers to named so that it is found from there.
fn write(from: &Path, plan: &Plan, best: &Candidate, output: &Path) -> Result<(), Failure> {
    let folder = |path: &Path| std::path::absolute(path).ok()?.parent().map(Path::to_owned);
    let mut text = best.text.clone();
    if folder(from) != folder(output) {
        let named = [("", "rig", plan.rig.as_deref()), ("", "scene", plan.scene.as_deref())];
        let list = [("schedule", "file", plan.list_file())];
        let mut changes = Vec::new();
        for (table, key, name) in named.into_iter().chain(list) {
            let Some(name) = name.filter(|name| *name != BUILT_IN) else { continue };
            let path: PathBuf = beside(from, name);
            let path = std::path::absolute(&path).unwrap_or(path);
            // As JSON writes a text TOML reads it.
            changes.push(Change::set(table, key, json!(path.to_string_lossy())));
        }
        text = rewrite(&text, &changes);
    }
    // What was written must be a plan.
    let document = Document::parse(Source::new(&output.display().to_string(), &text));
    document.and_then(Plan::read).map_err(|error| Failure::midway(&error))?;
    write_atomically(output, |out| out.write_all(text.as_bytes())).map_err(Failure::midway)
}

fn as_text(found: &Found, demand: &Demand, output: Option<&Path>) -> String {
    let scale = if demand.without_scale { ", without the common scale" } else { "" };
    let mut text = format!("\n  considered (relative u, k = 1{scale})\n");
    let heads = ["", "dwell", "rig time", "exitance, flux", "radiance", ""];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for Considered { what, dwell_ms, time_s, u_exitance, u_radiance, meets } in &found.considered {
        rows.push(vec![
            what.clone(),
            format!("{dwell_ms} ms"),
            duration(*time_s),
            percent(*u_exitance),
            percent(*u_radiance),
            if *meets { "reaches it" } else { "misses it" }.to_owned(),
        ]);
    }
    text.push_str(&table(&rows));
    // Writing to a string does not fail.
    if found.dearer > 0 {
        let _ = writeln!(text, "  {} more take longer by their motion alone", found.dearer);
    }
    if let Some(Candidate { what, dwell_ms, time_s, .. }) = &found.best {
        let time = duration(*time_s);
        let _ = writeln!(text, "\n  cheapest: {what}, dwell {dwell_ms} ms: {time}");
        if let Some(output) = output {
            let _ = writeln!(text, "  written to {}", output.display());
        }
    }
    text
}

fn unreachable(floor: &Shortfall, demand: &Demand) -> String {
    let Shortfall { quantity, target, u, largest, largest_u } = floor;
    let scale = "  help: the scale that all readings share is in it; --without-scale leaves it out";
    let help = match largest.as_str() {
        "truncation" => "  help: raise the degrees in [fit], or declare wider features in [expect]",
        "independent" => "  help: choose a lower gain range, or allow more rig time",
        _ if demand.without_scale => "  help: know it better: see its u in rig.toml",
        _ => scale,
    };
    format!(
        "no plan within the limits reaches {quantity} {}: the nearest comes to {}, of which \
         {largest} is {}\n{help}",
        percent(*target),
        percent(*u),
        percent(*largest_u),
    )
}

fn as_json(found: &Found, output: Option<&Path>) -> serde_json::Value {
    let considered: Vec<serde_json::Value> = found
        .considered
        .iter()
        .map(|c| {
            json!({
                "what": c.what, "dwell_ms": c.dwell_ms, "rig_s": c.time_s,
                "u_exitance_relative": c.u_exitance, "u_radiance_relative": c.u_radiance,
                "reaches": c.meets,
            })
        })
        .collect();
    let best = found.best.as_ref().map(|best| {
        json!({
            "what": best.what, "dwell_ms": best.dwell_ms, "rig_s": best.time_s,
            "u_exitance_relative": best.forecast.of_exitance.u(),
            "u_radiance_relative": best.forecast.of_radiance.u(),
            "written_to": output.map(|output| output.display().to_string()),
        })
    });
    let floor = found.floor.as_ref().map(|floor| {
        json!({
            "quantity": floor.quantity, "target_relative": floor.target, "u_relative": floor.u,
            "largest": floor.largest, "largest_relative": floor.largest_u,
        })
    });
    json!({"best": best, "considered": considered, "dearer": found.dearer, "floor": floor})
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(texts: &[&str]) -> Result<Demand, Failure> {
        let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
        demand(&texts, false)
    }

    #[test]
    fn targets_are_parts_or_percents() {
        let demand = read(&["exitance=0.5%", "radiance = 0.02"]).unwrap();
        assert!((demand.exitance.unwrap() - 0.005).abs() < 1e-15);
        assert!((demand.radiance.unwrap() - 0.02).abs() < 1e-15);
        assert_eq!(demand.flux, None);
    }

    #[test]
    fn what_is_no_target_is_refused_with_an_example() {
        for text in ["exitance", "power=1%", "flux=", "flux=0", "flux=-1%", "flux=100%", "flux=nan"]
        {
            let error = read(&[text]).unwrap_err();
            assert!(error.text().contains(text) && error.text().contains(HELP), "{text}");
        }
        let twice = read(&["flux=1%", "flux=2%"]).unwrap_err();
        assert!(twice.text().contains("before"), "{}", twice.text());
        assert!(read(&["flux=1%", "flux=0.01"]).is_ok());
    }
}
