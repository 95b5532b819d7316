//! `gonio fit`: fits again, from a run's journal or from any CSV of samples, and evaluates the
//! fit at listed rays.

use std::path::Path;
use std::process::ExitCode;

use fit::blocks::Asked;
use fit::{Optics, Readings, Region, Resolves, Wish};

use super::args::FitArgs;
use super::derive;
use super::failure::{Failure, Outcome};
use super::inputs::Inputs;
use super::long_run::{self, IN_BLOCKS};
use super::monte_carlo::{self, Dice};
use super::output::{note, say, write_out};
use super::partial;
use super::picture;
use super::results::{Results, compare, fit_region, open_run, optics};
use super::setup::{Setup, rig_at};
use super::stream::{self, Scan};
use super::summary::{field_rows, model_rows, treatment_rows};
use super::text::{row, table};
use super::wished::wished;
use crate::export::{
    FitFile, InputSample, ListedRay, MonteCarlo, RayChart, Treatment, read_rays, write_at,
    write_atomically, write_weights,
};
use crate::journal::{Order, Reader};
use crate::plan::Wanted;
use crate::rig::Reading;
use crate::rig::calibration::{Fitted, IndependentParts, calibrate};

pub(super) const FIT_HELP: &str =
    "lower --angular-degree or --position-degree, or measure what is not determined";
/// A larger CSV is not what a rig makes: 2 GiB.
const CSV_BYTES_MAX: u64 = 2 << 30;

/// Fits again and prints what came out.
pub(crate) fn fit(args: &FitArgs) -> Outcome {
    let chart = args.chart.ray_chart()?;
    if args.picture.is_some() {
        picture::check(&args.chart.chart)?;
    }
    let rays = args.at.as_deref().map(|path| rays_at(chart, path)).transpose()?;
    let wanted = derive::wanted(&args.derive, chart.is_all_round())?;
    if args.merge {
        return partial::merge(args, rays, &wanted);
    }
    if args.partial {
        if !wanted.is_empty() {
            let what = "--derive: a share of the readings is no fit yet";
            return Err(Failure::with_help(what, "give it to --merge"));
        }
        return partial::partial(args);
    }
    if args.source.is_dir() { fit_run(args, rays, &wanted) } else { fit_csv(args, rays, &wanted) }
}

/// The rays at which the fit shall be evaluated.
fn rays_at(chart: RayChart, path: &Path) -> Result<Vec<ListedRay>, Failure> {
    let names = chart.names().join(", ");
    let help = format!("expected a header with {names}, and a row for each ray");
    read_rays(chart, &read_csv(path)?)
        .map_err(|error| Failure::with_help(format!("{}: {error}", path.display()), help))
}

fn fit_run(args: &FitArgs, rays: Option<Vec<ListedRay>>, wanted: &[Wanted]) -> Outcome {
    let dice = Dice::of(args)?;
    args.chart.demand_none()?;
    if args.u_scale.is_some() {
        return Err(Failure::with_help(
            "--u-scale: a run's rig says how well its scale is known",
            "leave it out; it is for a CSV",
        ));
    }
    if args.u_relative.is_some() {
        return Err(Failure::with_help(
            "--u-relative: a run's samples have uncertainties of their own",
            "leave it out; it is for a CSV without a column of uncertainties",
        ));
    }
    if args.rig.is_some() {
        return Err(Failure::with_help(
            "--rig: a run brings its rig along",
            "leave it out; it is for a CSV, which has none",
        ));
    }
    let (mut setup, _, reader) = open_run(&args.source)?;
    setup.plan.derive.extend_from_slice(wanted);
    let wish = wished(args, setup.plan.fit)?;
    if args.in_blocks || (dice.is_none() && long_run::is_long(&reader)?) {
        return fit_long_run(args, rays, (&setup, &reader, &wish));
    }
    let readings = reader.readings(Order::Taken)?;
    let results = Results::of(&setup, wish, &readings)?;
    let fitted = results
        .fitted
        .as_ref()
        .map_err(|error| Failure::midway(format!("fit: {error}\n  help: {FIT_HELP}")))?;
    let monte_carlo = match dice {
        Some(dice) => Some(roll(dice, &setup, (&results, fitted), &wish, &readings)?),
        None => None,
    };
    let path = args.output.clone().unwrap_or_else(|| args.source.join("fit.json"));
    results.write_fit(&path, &setup, fitted, monte_carlo.as_ref()).map_err(Failure::midway)?;
    derive::write_tables(beside(&path), &results.derived).map_err(Failure::midway)?;
    let treatment = results.treatment(fitted);
    let file = FitFile {
        fit: &fitted.fit,
        treatment: &treatment,
        choice: fitted.choice.as_ref(),
        resolves: Some(fitted.resolves),
        quantity: setup.rig.detector.quantity,
        simulated: setup.rig.is_simulated(),
        n_flagged: results.n_flagged(),
        n_excluded: fitted.n_excluded,
        notes: &[],
        truth: results.truth,
        independent: &results.independent,
        derived: &results.derived,
        rounds: &setup.accounts,
        monte_carlo: monte_carlo.as_ref(),
    };
    show(args, rays, &file, Some(&path))
}

/// A long run, in blocks.
fn fit_long_run(
    args: &FitArgs,
    rays: Option<Vec<ListedRay>>,
    (setup, reader, wish): (&Setup, &Reader, &Wish),
) -> Outcome {
    let made = long_run::fit(setup, reader, wish)?;
    let notes = [IN_BLOCKS.to_owned()];
    let fit = &made.ruled.fit;
    let quantity = setup.rig.detector.quantity;
    let derived = derive::derive(fit, quantity, &setup.plan.derive);
    let treatment = Treatment::of_readings(wish.rules.robust, made.treated, &made.nuisances)
        .with_rules(made.ruled.symmetry.as_ref(), made.ruled.nonnegative.as_ref())
        .with_drift(made.drift.as_ref());
    let file = FitFile {
        fit,
        treatment: &treatment,
        choice: made.ruled.choice.as_ref(),
        resolves: Some(made.resolves),
        quantity,
        simulated: setup.rig.is_simulated(),
        n_flagged: made.n_flagged,
        n_excluded: made.n_excluded,
        notes: &notes,
        truth: compare(setup, &fit_region(setup), fit).map(|(truth, _)| truth),
        independent: &made.independent,
        derived: &derived,
        rounds: &setup.accounts,
        monte_carlo: None,
    };
    let path = args.output.clone().unwrap_or_else(|| args.source.join("fit.json"));
    write_fit(&path, &file)?;
    show(args, rays, &file, Some(&path))
}

/// Trials of a run's readings.
fn roll(
    dice: Dice,
    setup: &Setup,
    (results, fitted): (&Results, &Fitted),
    wish: &Wish,
    readings: &[Reading],
) -> Result<MonteCarlo, Failure> {
    if let Some(failure) =
        monte_carlo::refusal(fitted.symmetry.as_ref(), fitted.nonnegative.as_ref())
    {
        return Err(failure);
    }
    // As the fit took them: the results' own are restated from it.
    let calibrated = calibrate(&setup.rig, readings).map_err(Failure::midway)?;
    let asked = (setup.plan.derive.as_slice(), results.derived.as_slice());
    let quantity = setup.rig.detector.quantity;
    calibrated
        .tried(fitted, &wish.rules, optics(setup).as_ref(), |trials| {
            dice.roll(&fitted.fit, trials, quantity, asked)
        })
        .map_err(|error| monte_carlo::failed(&error))
}

fn fit_csv(args: &FitArgs, rays: Option<Vec<ListedRay>>, wanted: &[Wanted]) -> Outcome {
    let shown = args.source.display();
    let chart = args.chart.ray_chart()?;
    if let Some(u) = args.u_relative
        && !(u > 0.0 && u.is_finite())
    {
        return Err(Failure::start(format!("--u-relative: {u}; expected a number above 0")));
    }
    let common = scale_of(args)?;
    let dice = Dice::of(args)?;
    let wish = wished(args, Wish::default())?;
    if wish.rules.drift == Some(true) {
        return Err(Failure::with_help(
            "--drift: a CSV has no reference readings",
            "leave it out; it is for a run",
        ));
    }
    if args.in_blocks && chart != RayChart::Surface {
        return Err(Failure::with_help(
            "--in-blocks: samples of this chart are kept",
            "leave it out; it is for the surface chart",
        ));
    }
    let optics = args.chart.optics(args.rig.as_deref().map(optics_of).transpose()?);
    let (scan, kept) = Scan::of(&args.source, &args.chart)?;
    let is_streamed = kept.is_none() && args.picture.is_none() && dice.is_none();
    if is_streamed && scan.is_for_blocks(args.in_blocks) {
        return fit_stream(args, rays, wanted, (&scan, optics, &wish));
    }
    let refused = |error: fit::FitError| Failure::with_help(format!("{shown}: {error}"), FIT_HELP);
    let input = kept.map_or_else(|| stream::all(&args.source, chart), Ok)?;
    let region = args.chart.region(chart, &input.samples.iter().map(|sample| sample.ray.ray()));
    let (samples, limits) = input.fit_readings(input.noise(args.u_relative));
    let readings = Readings { limits: &limits, common: &common, ..Readings::of(&samples) };
    let ruled = fit::fit_wished(&readings, &region, &wish, optics.as_ref()).map_err(refused)?;
    let fit = &ruled.fit;
    let resolves = Resolves::of(&samples, &region, fit.basis(), optics.as_ref());
    let mut notes = vec![note_on_u(input.has_u(), args.u_relative)];
    notes.extend(args.u_scale.map(|u| format!("all samples share a scale known to {u}, relative")));
    let derived = derive::derive(fit, input.quantity, wanted);
    let monte_carlo = match dice {
        Some(dice) => {
            let refusal = monte_carlo::refusal(ruled.symmetry.as_ref(), ruled.nonnegative.as_ref());
            if let Some(failure) = refusal {
                return Err(failure);
            }
            let trials = fit.trials(&readings, optics.as_ref());
            let trials = trials.map_err(|error| monte_carlo::failed(&error))?;
            Some(dice.roll(fit, &trials, input.quantity, (wanted, &derived)))
        }
        None => None,
    };
    let named = |sample: &InputSample| (sample.line, sample.ray.ray(), sample.value);
    let used: Vec<_> = input.with_limits().map(named).collect();
    let treatment = Treatment::of(fit, |i| used[i], input.left_out().map(named))
        .with_rules(ruled.symmetry.as_ref(), ruled.nonnegative.as_ref());
    let file = FitFile {
        fit,
        treatment: &treatment,
        choice: ruled.choice.as_ref(),
        resolves: Some(resolves),
        quantity: input.quantity,
        simulated: false,
        n_flagged: input.flagged(),
        n_excluded: input.samples.len() - samples.len(),
        notes: &notes,
        truth: None,
        independent: &IndependentParts::NONE,
        derived: &derived,
        rounds: &[],
        monte_carlo: monte_carlo.as_ref(),
    };
    if let Some(path) = &args.picture {
        picture::write(path, fit, input.quantity, &samples)?;
    }
    write_and_show(args, rays, &file)
}

/// What all samples of a CSV share.
fn scale_of(args: &FitArgs) -> Result<Vec<fit::Common>, Failure> {
    let Some(u) = args.u_scale else { return Ok(Vec::new()) };
    if !(u >= 0.0 && u.is_finite()) {
        return Err(Failure::start(format!("--u-scale: {u}; expected a number of 0 or more")));
    }
    Ok(vec![scale(u)])
}

/// Of a relative standard uncertainty.
pub(super) fn scale(u: f64) -> fit::Common {
    fit::Common { name: "scale".to_owned(), u, shift: fit::Shift::Scale }
}

/// A long file, in blocks.
fn fit_stream(
    args: &FitArgs,
    rays: Option<Vec<ListedRay>>,
    wanted: &[Wanted],
    (scan, optics, wish): (&Scan, Option<Optics>, &Wish),
) -> Outcome {
    let optics = optics.as_ref();
    let (model, choice) = scan.model(&args.source, (wish, optics), args.u_relative)?;
    let robust = wish.rules.robust;
    let others = &choice.as_ref().map_or_else(Vec::new, fit::Choice::others);
    let region = scan.region;
    let asked = Asked { region, model, robust, optics, with_truncation: true, others };
    let us = (args.u_relative, args.u_scale);
    let (blockwise, treated) = scan.fit(&args.source, &asked, us)?;
    let resolves = Some(blockwise.resolves);
    let ruled = blockwise.fit.ruled(&wish.rules).map_err(|error| {
        Failure::with_help(format!("{}: {error}", args.source.display()), FIT_HELP)
    })?;
    let notes = [note_on_u(scan.has_u, args.u_relative), IN_BLOCKS.to_owned()];
    let derived = derive::derive(&ruled.fit, scan.quantity, wanted);
    let treatment = Treatment::of_readings(wish.rules.robust, treated, &[])
        .with_rules(ruled.symmetry.as_ref(), ruled.nonnegative.as_ref());
    let file = FitFile {
        fit: &ruled.fit,
        treatment: &treatment,
        choice: choice.as_ref(),
        resolves,
        quantity: scan.quantity,
        simulated: false,
        n_flagged: scan.flagged,
        n_excluded: scan.samples - scan.used,
        notes: &notes,
        truth: None,
        independent: &IndependentParts::NONE,
        derived: &derived,
        rounds: &[],
        monte_carlo: None,
    };
    write_and_show(args, rays, &file)
}

fn write_and_show(args: &FitArgs, rays: Option<Vec<ListedRay>>, file: &FitFile<'_>) -> Outcome {
    match &args.output {
        Some(path) => write_fit(path, file)?,
        None => derive::write_tables(Path::new(""), file.derived).map_err(Failure::midway)?,
    }
    show(args, rays, file, args.output.as_deref())
}

/// Writes fit.json, and beside it what is a file of its own.
fn write_fit(path: &Path, file: &FitFile<'_>) -> Result<(), Failure> {
    let folder = beside(path);
    derive::write_tables(folder, file.derived).map_err(Failure::midway)?;
    write_atomically(path, |out| file.write(out)).map_err(Failure::midway)?;
    if file.treatment.is_long() {
        write_atomically(&folder.join("weights.csv"), |out| {
            write_weights(out, file.quantity, &file.fit.region().chart, file.treatment)
        })
        .map_err(Failure::midway)?;
    }
    Ok(())
}

fn note_on_u(has_u: bool, u_relative: Option<f64>) -> String {
    match (has_u, u_relative) {
        (true, _) => {
            "the input's uncertainties count as independent from sample to sample".to_owned()
        }
        (false, Some(u)) => {
            format!("each sample counts with u = {u} of the input's RMS, independent")
        }
        (false, None) => {
            "the input has no uncertainties: they are taken from the residuals, independent"
                .to_owned()
        }
    }
}

/// The beam of a rig's detector; where the sample ends a CSV does not say.
pub(super) fn optics_of(path: &Path) -> Result<Optics, Failure> {
    let rig = rig_at(&mut Inputs::from_disk(), path)?;
    let beam = rig.detector.beam().map_err(|error| Failure::start(error.to_string()))?;
    Ok(Optics { beam, outline: None })
}

fn read_csv(path: &Path) -> Result<Vec<u8>, Failure> {
    let shown = path.display();
    let cannot = |error: std::io::Error| {
        Failure::with_help(
            format!("{shown}: cannot be read: {error}"),
            "give a run's folder, or a CSV with x_mm, y_mm, theta_deg, phi_deg and a radiance",
        )
    };
    let size = std::fs::metadata(path).map_err(cannot)?.len();
    if size > CSV_BYTES_MAX {
        return Err(Failure::start(format!(
            "{shown}: {size} bytes; expected at most {CSV_BYTES_MAX}"
        )));
    }
    std::fs::read(path).map_err(cannot)
}

/// Prints the fit: at listed rays where those are asked for, as JSON, or as a table.
pub(super) fn show(
    args: &FitArgs,
    rays: Option<Vec<ListedRay>>,
    file: &FitFile<'_>,
    written: Option<&Path>,
) -> Outcome {
    if let Some(rays) = rays {
        note_rays_outside(&rays, file.fit.region());
        let estimates = rays.into_iter().map(|listed| {
            let estimate = file.fit.radiance(&listed.ray);
            (listed, estimate)
        });
        let chart = args.chart.ray_chart()?;
        write_out(|out| write_at(out, file.quantity, chart, estimates))?;
    } else if args.json {
        write_out(|out| file.write(out))?;
    } else {
        say(&summary(args, file, written))?;
    }
    let mut is_whole = true;
    for quantity in file.derived {
        if let Err(why) = &quantity.outcome {
            is_whole = false;
            note(&format!("{}, {}: {why}", quantity.name, quantity.asked));
        }
    }
    if let Some(Err(why)) = file.treatment.symmetry() {
        is_whole = false;
        note(&format!("symmetry not used: {why}"));
    }
    Ok(if is_whole { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The folder of a file; that of a bare name is the current one.
pub(super) fn beside(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// The fit's functions go on beyond what was measured, and say so in their u only in part.
fn note_rays_outside(rays: &[ListedRay], region: &Region) {
    let outside = rays.iter().filter(|listed| !region.covers(&listed.ray)).count();
    if outside > 0 {
        let of = rays.len();
        note(&format!("note: {outside} of {of} rays lie outside the region that was measured"));
    }
}

fn summary(args: &FitArgs, file: &FitFile<'_>, written: Option<&Path>) -> String {
    let fit = file.fit;
    let simulated = if file.simulated { " (simulated)" } else { "" };
    let mut rows = vec![
        row("samples", format!("{}{simulated}", args.source.display())),
        row("samples used", fit.n_used().to_string()),
        row("coefficients", fit.coefficients().len().to_string()),
        row("condition", format!("{:.1}", fit.condition())),
    ];
    rows.extend(model_rows(fit, file.choice, file.resolves));
    rows.extend(treatment_rows(file.treatment, file.quantity));
    rows.extend(field_rows(fit, file.quantity));
    rows.extend(derive::rows(file.derived, file.quantity));
    rows.extend(file.monte_carlo.map_or_else(Vec::new, monte_carlo::rows));
    rows.extend(file.notes.iter().map(|note| row("note", note)));
    rows.extend(written.map(|path| row("written to", path.display().to_string())));
    table(&rows)
}
