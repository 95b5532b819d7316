//! `gonio frontier`: what accuracy costs in time. Runs a plan at several densities and dwells on
//! the simulated rig, with several seeds, and scores every run against the truth.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::json;

use super::acquire::{Acquired, Pace, acquire};
use super::args::FrontierArgs;
use super::failure::{Failure, Outcome};
use super::folder::create;
use super::output::{say, write_out};
use super::results::Results;
use super::run::first_job;
use super::session::utc_stamp;
use super::setup::Setup;
use super::text::{duration, percent, table};
use crate::export::{write_atomically, write_frontier};
use crate::journal::{EffectWishes, Order};
use crate::report::frontier_svg;
use crate::run::OnFault;
use crate::study::{FrontierPoint, FrontierRow, LADDER, Rung, coverage, doubling, points};

/// The only strategy so far.
const STRATEGY: &str = "stop-and-go";

/// A run to make: a rung and a seed.
type Entry = (usize, u64);

/// Runs the ladder, writes frontier.csv and frontier.svg, and prints the table.
pub(crate) fn frontier(args: &FrontierArgs) -> Outcome {
    let setup = Setup::from_disk(&args.plan, &args.rig, &args.effects)?;
    if setup.stage.is_none() {
        return Err(Failure::with_help(
            format!("{}: errors are known on a simulated rig alone", setup.rig.name),
            "choose one with --rig, and what it looks at with --scene",
        ));
    }
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| format!("frontier-{}-{}", setup.plan_name, utc_stamp()).into());
    if folder.exists() {
        return Err(Failure::with_help(
            format!("{}: exists already; nothing is overwritten", folder.display()),
            "choose another folder with --out",
        ));
    }
    // What a rung can't do is found before anything is made.
    for rung in LADDER {
        setup.with_plan(rung.apply(&setup.plan), setup.seed)?;
    }
    std::fs::create_dir_all(folder.join("runs"))
        .map_err(|error| Failure::start(format!("{}: {error}", folder.display())))?;
    let rows = run_all(&setup, &folder, args.seeds)?;
    let points = points(&rows);
    let title = format!("{}: what accuracy costs in time", setup.plan_name);
    let svg = frontier_svg(&title, &points);
    write_atomically(&folder.join("frontier.csv"), |out| write_frontier(out, &rows))
        .and_then(|()| {
            write_atomically(&folder.join("frontier.svg"), |out| out.write_all(svg.as_bytes()))
        })
        .map_err(Failure::midway)?;
    if args.json {
        write_out(|out| rows.iter().try_for_each(|row| writeln!(out, "{}", as_json(row))))?;
    } else {
        say(&format!("{}  folder {}\n", as_text(&rows, &points), folder.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Every rung with every seed, on as many threads as the machine has; the rows in a fixed order.
fn run_all(setup: &Setup, folder: &Path, seeds: u64) -> Result<Vec<FrontierRow>, Failure> {
    let entries: Vec<Entry> = (0..LADDER.len())
        .flat_map(|rung| (0..seeds).map(move |k| (rung, setup.seed.wrapping_add(k))))
        .collect();
    let bar = ProgressBar::with_draw_target(
        Some(entries.len() as u64),
        ProgressDrawTarget::stderr_with_hz(5),
    );
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<FrontierRow, Failure>)>> = Mutex::default();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads.min(entries.len()) {
            scope.spawn(|| {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&(rung, seed)) = entries.get(place) else { break };
                    let row = run_one(setup, folder, rung, seed);
                    bar.inc(1);
                    // A thread that panicked has ended the program's work already.
                    if let Ok(mut done) = done.lock() {
                        done.push((place, row));
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut done = done.into_inner().unwrap_or_default();
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, row)| row).collect()
}

fn run_one(setup: &Setup, folder: &Path, rung: usize, seed: u64) -> Result<FrontierRow, Failure> {
    let began = Instant::now();
    let step: Rung = LADDER[rung];
    let setup = setup.with_plan(step.apply(&setup.plan), seed)?;
    let folder = folder.join("runs").join(format!("rung{rung}-seed{seed}"));
    let acquired = acquire(&setup, Pace::Virtual, || {
        let (journal, _) = create(&folder, &setup)?;
        Ok((journal, first_job(&setup, OnFault::Finish, Pace::Virtual)?))
    })?;
    let Acquired { rig_s, journal, .. } = acquired;
    let journal = journal.map_err(Failure::midway)?;
    let readings = journal.reader().readings(Order::Taken)?;
    let results = Results::of(&setup, setup.plan.fit, &readings)?;
    journal.close().map_err(Failure::midway)?;
    row(&setup, step, &results, rig_s, readings.len(), began)
}

fn row(
    setup: &Setup,
    rung: Rung,
    results: &Results,
    rig_s: f64,
    readings: usize,
    began: Instant,
) -> Result<FrontierRow, Failure> {
    let fitted = results
        .fitted
        .as_ref()
        .map_err(|error| Failure::midway(format!("{}: fit: {error}", rung.parameters())))?;
    let (truth, score) = results.truth.zip(results.score).ok_or_else(|| {
        Failure::start("the scene is dark: relative errors need some light in the plan's region")
    })?;
    let (exitance, flux) = (fitted.fit.exitance(), fitted.fit.flux());
    Ok(FrontierRow {
        scene: setup.plan_name.clone(),
        strategy: STRATEGY.to_owned(),
        parameters: parameters(rung, &setup.wishes),
        seed: setup.seed,
        rig_s,
        readings: u32::try_from(readings).unwrap_or(u32::MAX),
        error_radiance_rms_relative: score.rms_relative,
        error_exitance_relative: exitance.value / truth.exitance - 1.0,
        error_flux_relative: flux.value / truth.flux - 1.0,
        u_exitance_relative: exitance.u / exitance.value,
        error_shape_rms_relative: score.shape_rms_relative,
        compute_s: began.elapsed().as_secs_f64(),
    })
}

/// The rung's, and what was wanted of the simulated effects.
fn parameters(rung: Rung, wishes: &EffectWishes) -> String {
    let EffectWishes { tolerance, force, without, .. } = wishes;
    let mut words = vec![rung.parameters()];
    words.extend(tolerance.map(|tolerance| format!("tolerance={tolerance}")));
    words.extend(force.iter().map(|effect| format!("force={effect}")));
    words.extend(without.iter().map(|effect| format!("without={effect}")));
    words.join(" ")
}

fn as_text(rows: &[FrontierRow], points: &[FrontierPoint]) -> String {
    let heads = ["rung", "rig time", "radiance", "its shape", "exitance"];
    let mut lines = vec![heads.map(str::to_owned).to_vec()];
    for point in points {
        lines.push(vec![
            point.parameters.clone(),
            duration(point.rig_s),
            percent(point.radiance[1]),
            percent(point.shape[1]),
            percent(point.exitance_rms),
        ]);
    }
    let mut text = table(&lines);
    for pair in points.windows(2) {
        if let Some(words) = doubling(&pair[0], &pair[1]) {
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {words}");
        }
    }
    let coverage = coverage(rows);
    let _ = writeln!(
        text,
        "  exitance over {} runs: RMS of error over stated u {:.2}, {} within 2 u",
        rows.len(),
        coverage.rms_of_error_over_u,
        percent(coverage.within_2u),
    );
    text
}

fn as_json(row: &FrontierRow) -> serde_json::Value {
    json!({
        "scene": row.scene, "strategy": row.strategy, "parameters": row.parameters,
        "seed": row.seed, "rig_s": row.rig_s, "readings": row.readings,
        "error_radiance_rms_relative": row.error_radiance_rms_relative,
        "error_exitance_relative": row.error_exitance_relative,
        "error_flux_relative": row.error_flux_relative,
        "u_exitance_relative": row.u_exitance_relative,
        "compute_s": row.compute_s,
        "error_shape_rms_relative": row.error_shape_rms_relative,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_says_what_was_wanted_of_the_effects() {
        let named = |wishes: &EffectWishes| parameters(LADDER[2], wishes);
        assert_eq!(named(&EffectWishes::default()), LADDER[2].parameters());
        let wishes = EffectWishes {
            tolerance: Some(1e-4),
            force: vec!["finite-beam".into()],
            without: vec!["shot-noise".into(), "read-noise".into()],
            ignores_plan: false,
        };
        assert_eq!(
            named(&wishes),
            "density=1.000 dwell=1.000 tolerance=0.0001 force=finite-beam without=shot-noise \
             without=read-noise"
        );
    }
}
