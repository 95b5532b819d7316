//! `gonio frontier`: what accuracy costs in time. Runs a plan at several densities and dwells, at
//! rest and in flight, on the simulated rig, with several seeds, and scores every run against the truth;
//! and times arithmetic likewise.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use self::rungs::{Entry, entries};
use super::args::FrontierArgs;
use super::failure::{Failure, Outcome};
use super::folder::refuse_existing;
use super::halt::ends_when_stopped;
use super::output::{say, write_out};
use super::parallel::in_parallel;
use super::results::Results;
use super::session::utc_stamp;
use super::setup::Setup;
use super::text::{duration, percent};
use super::virtual_run::VirtualRun;
use crate::export::{ExportError, write_atomically, write_frontier};
use crate::report::frontier_pictures;
use crate::study::{Foretold, FrontierPoint, FrontierRow, points};

mod compute;
mod rungs;
mod words;

pub use compute::panels;

/// Runs every rung of every strategy, and times the kernels where that is asked; writes tables, pictures
/// and pages, and prints the tables.
pub(crate) fn frontier(args: &FrontierArgs) -> Outcome {
    let peers = args.peers.as_deref().map(compute::peers).transpose()?.unwrap_or_default();
    // What a rung can't do is found before anything is made.
    let asked = args.plan.as_deref().map(|plan| asked(args, plan)).transpose()?;
    let name = asked.as_ref().map_or("compute", |(setup, _)| &setup.plan_name);
    let folder =
        args.out.clone().unwrap_or_else(|| format!("frontier-{name}-{}", utc_stamp()).into());
    refuse_existing(&folder)?;
    std::fs::create_dir_all(&folder)
        .map_err(|error| Failure::start(format!("{}: {error}", folder.display())))?;
    ends_when_stopped(&folder, "stopped: nothing of the frontier is kept".to_owned())?;
    if let Some((setup, entries)) = &asked {
        in_rig_time(args, setup, entries, &folder)?;
    }
    if args.compute {
        compute::compute(&folder, args.seeds, peers, args.json)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn asked(args: &FrontierArgs, plan: &Path) -> Result<(Setup, Vec<Entry>), Failure> {
    let setup = Setup::from_disk(plan, &args.rig, &args.effects)?;
    if setup.stage.is_none() {
        return Err(Failure::with_help(
            format!("{}: errors are known on a simulated rig alone", setup.rig.name),
            "choose one with --rig, and what it looks at with --scene",
        ));
    }
    let entries = entries(&setup, args)?;
    Ok((setup, entries))
}

fn in_rig_time(
    args: &FrontierArgs,
    setup: &Setup,
    entries: &[Entry],
    folder: &Path,
) -> Result<(), Failure> {
    std::fs::create_dir(folder.join("runs"))
        .map_err(|error| Failure::start(format!("{}: {error}", folder.display())))?;
    let rows = run_all(entries, folder, args.seeds)?;
    let points = points(&rows);
    let orders = orders(entries);
    write(setup, &orders, folder, (&rows, &points)).map_err(Failure::midway)?;
    if args.json {
        write_out(|out| rows.iter().try_for_each(|row| writeln!(out, "{}", words::as_json(row))))
    } else {
        let text = words::as_text(&rows, &points, &orders);
        say(&format!("{text}  folder {}\n", folder.display()))
    }
}

/// Of every rung how good the order of its targets, or of its sweeps, is.
fn orders(entries: &[Entry]) -> Vec<String> {
    let said = |entry: &Entry| {
        let way = entry.setup.plan.way(&entry.setup.rig, &entry.setup.sequence)?;
        let (motion, rung) = (entry.motion.name(), entry.parameters());
        let (gap, least) = (percent(way.gap()), duration(way.least_s));
        Some(format!("{motion}, {rung}: the way is at most {gap} above the least of {least}"))
    };
    entries.iter().filter_map(said).collect()
}

fn write(
    setup: &Setup,
    orders: &[String],
    folder: &Path,
    (rows, points): (&[FrontierRow], &[FrontierPoint]),
) -> Result<(), ExportError> {
    let title = format!("{}: what accuracy costs in time", setup.plan_name);
    write_atomically(&folder.join("frontier.csv"), |out| write_frontier(out, rows))?;
    let pictures = frontier_pictures(&setup.plan_name, rows, points);
    for picture in &pictures {
        let svg = picture.document();
        let path = folder.join(format!("{}.svg", picture.name));
        write_atomically(&path, |out| out.write_all(svg.as_bytes()))?;
    }
    let page = words::page(setup, &title, (rows, points), pictures, orders.to_vec());
    write_atomically(&folder.join("frontier.html"), |out| page.write(out))
}

/// Every rung with every seed, on as many threads as the machine has; the rows in a fixed order.
fn run_all(entries: &[Entry], folder: &Path, seeds: u64) -> Result<Vec<FrontierRow>, Failure> {
    let runs: Vec<(usize, u64)> =
        (0..entries.len()).flat_map(|entry| (0..seeds).map(move |k| (entry, k))).collect();
    let rows = in_parallel(&runs, |(i, k)| {
        let folder = folder.join("runs").join(format!("rung{i}-seed{}", 1 + k));
        run_one(&entries[*i], &folder, *k)
    });
    let row = |(run, row): (&(usize, u64), Option<Result<FrontierRow, Failure>>)| {
        let entry = &entries[run.0];
        let lost = || {
            let (motion, rung) = (entry.motion.name(), entry.parameters());
            Failure::midway(format!("{motion}, {rung}: a thread panicked"))
        };
        row.unwrap_or_else(|| Err(lost()))
    };
    runs.iter().zip(rows).map(row).collect()
}

fn run_one(entry: &Entry, folder: &Path, k: u64) -> Result<FrontierRow, Failure> {
    let began = Instant::now();
    let seed = entry.setup.seed.wrapping_add(k);
    let setup = entry.setup.with_plan(entry.setup.plan.clone(), seed)?;
    let VirtualRun { setup, readings, rig_s } = VirtualRun::kept(setup, folder)?;
    let results = Results::of(&setup, setup.plan.fit, &readings)?;
    row(entry, &setup, &results, rig_s, readings.len(), began)
}

fn row(
    entry: &Entry,
    setup: &Setup,
    results: &Results,
    rig_s: f64,
    readings: usize,
    began: Instant,
) -> Result<FrontierRow, Failure> {
    let fitted = results.fitted.as_ref().map_err(|error| {
        let (strategy, rung) = (entry.motion.name(), entry.rung.parameters());
        Failure::midway(format!("{strategy}, {rung}: fit: {error}"))
    })?;
    let (truth, score) = results.truth.zip(results.score).ok_or_else(|| {
        Failure::start("the scene is dark: relative errors need some light in the plan's region")
    })?;
    let (exitance, flux) = (fitted.fit.exitance(), fitted.fit.flux());
    // Of what was decided on the way, its steps' own time can be said when they are known.
    let foretold = match setup.plan.adaptive() {
        Some(_) => Foretold::of(true, &setup.sequence.prediction, None),
        None => entry.foretold,
    };
    Ok(FrontierRow {
        scene: setup.plan_name.clone(),
        strategy: entry.motion.name().to_owned(),
        parameters: entry.parameters(),
        seed: setup.seed,
        rig_s,
        readings: u32::try_from(readings).unwrap_or(u32::MAX),
        error_radiance_rms_relative: score.rms_relative,
        error_exitance_relative: exitance.value / truth.exitance - 1.0,
        error_flux_relative: flux.value / truth.flux - 1.0,
        u_exitance_relative: exitance.u / exitance.value,
        error_shape_rms_relative: score.shape_rms_relative,
        error_exitance_shape_relative: score.factor * exitance.value / truth.exitance - 1.0,
        foretold,
        compute_s: began.elapsed().as_secs_f64(),
    })
}
