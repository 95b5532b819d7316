//! `gonio fit --partial` and `--merge`: shares of the readings fitted apart, on as many machines as
//! there are, and together again.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::process::ExitCode;

use fit::partial::{Accumulator, Weighting};
use fit::{Optics, Penalised, Region, Robust, Rules, Wish};

use super::args::FitArgs;
use super::chart::csv_help;
use super::derive;
use super::failure::{Failure, Outcome};
use super::fit::{FIT_HELP, beside, optics_of, show};
use super::long_run;
use super::output::{note, say};
use super::results::{open_run, optics};
use super::text::{row, table};
use super::wished::wished;
use crate::export::{
    BlockError, FitFile, InputSamples, ListedRay, PartialFile, ReadPartial, Treatment,
    read_sample_blocks, write_atomically,
};
use crate::plan::Wanted;
use crate::rig::Quantity;
use crate::rig::calibration::{FittedDrift, IndependentParts};

/// A partial fit of 4,096 coefficients and dozens of common components is far below.
const PARTIAL_BYTES_MAX: u64 = 1 << 30;
const REGION_HELP: &str = "say what all shares stand for, --x-mm=-20,20 --y-mm=-20,20 \
                           --theta-max-deg 80 for example: each share alone can't know it";
const PARTIAL_HELP: &str = "give files that `gonio fit --partial` wrote, of the same region, \
                            basis and detector";

/// Fits a share and writes it.
pub(super) fn partial(args: &FitArgs) -> Outcome {
    if args.u_relative.is_some() {
        return Err(Failure::with_help(
            "--u-relative: a share alone doesn't know the root mean square of all samples",
            "give it to --merge",
        ));
    }
    let file = if args.source.is_dir() { of_run(args)? } else { of_csv(args)? };
    let Some(path) = &args.output else {
        return Err(Failure::with_help("--partial: no file to write", "add -o part.bin"));
    };
    write_atomically(path, |out| file.write(out)).map_err(Failure::midway)?;
    say(&table(&[
        row("samples", args.source.display().to_string()),
        row("samples used", file.partial.readings().to_string()),
        row("written to", path.display().to_string()),
    ]))?;
    Ok(ExitCode::SUCCESS)
}

fn of_run(args: &FitArgs) -> Result<PartialFile, Failure> {
    args.chart.demand_none()?;
    let (setup, _, reader) = open_run(&args.source)?;
    let wish = wished(args, setup.plan.fit)?;
    needs_one_look(&wish.rules)?;
    let model = decided(wish)?;
    let share = long_run::share(&setup, &reader, model)?;
    if FittedDrift::of(&share.references, false).is_some() {
        note("note: the reference readings show a drift, which a share does not fit along");
    }
    Ok(PartialFile {
        partial: share.partial,
        quantity: setup.rig.detector.quantity,
        optics: optics(&setup),
        simulated: setup.rig.is_simulated(),
        n_flagged: share.n_flagged as u64,
        n_excluded: share.n_excluded as u64,
    })
}

/// A share is looked at once, and its readings are then forgotten.
fn needs_one_look(rules: &Rules) -> Result<(), Failure> {
    let asked = [
        ("robust", rules.robust != Robust::None, "what is an outlier only all readings tell"),
        ("nonnegative", rules.nonnegative, "the field of all readings is held above zero"),
        ("symmetry", rules.symmetry.is_some(), "all readings together bear it or don't"),
        ("drift", rules.drift == Some(true), "it is fitted along with the whole field"),
        ("ranges", rules.ranges == Some(true), "they are fitted along with the whole field"),
    ];
    let Some((key, _, why)) = asked.into_iter().find(|(_, is_asked, _)| *is_asked) else {
        return Ok(());
    };
    let help = match key {
        "nonnegative" | "symmetry" => "give it to --merge",
        _ => "leave it out of the plan's [fit] and of the command, or fit the readings as a whole",
    };
    Err(Failure::with_help(format!("--partial: {key}: {why}"), help))
}

/// The one model that all shares are fitted with: none of them may choose for itself.
fn decided(wish: Wish) -> Result<Penalised, Failure> {
    wish.decided().ok_or_else(|| {
        Failure::with_help(
            "--partial: the basis is not pinned, and shares can't choose one each for itself",
            "--angular-degree N --position-degree N (and --basis, --penalty-strength), for \
             example as `choice` in the fit.json of one share's own fit names them",
        )
    })
}

/// None asked for.
const NO_RULES: Rules =
    Rules { robust: Robust::None, nonnegative: false, symmetry: None, drift: None, ranges: None };

/// What a share of a CSV is fitted with where the command line is silent.
const DEGREES: Wish = Wish {
    kind: None,
    angular_degree: Some(6),
    cosine_columns: None,
    spans: None,
    position_degree: Some(0),
    position_spans: None,
    penalty_power: None,
    penalty_strength: None,
    rules: NO_RULES,
};

/// A CSV, read in blocks: memory doesn't grow with its length.
struct Share<'a> {
    region: Region,
    model: Penalised,
    optics: Option<&'a Optics>,
    begun: Option<(Accumulator, Quantity)>,
    n_flagged: u64,
    n_excluded: u64,
}

fn of_csv(args: &FitArgs) -> Result<PartialFile, Failure> {
    let shown = args.source.display();
    let chart = args.chart.ray_chart()?;
    let file = File::open(&args.source).map_err(|error| {
        Failure::with_help(format!("{shown}: cannot be read: {error}"), csv_help(chart))
    })?;
    let Some(region) = args.chart.whole_region(chart) else {
        return Err(Failure::with_help("--partial of a CSV: no region", REGION_HELP));
    };
    let optics = args.chart.optics(args.rig.as_deref().map(optics_of).transpose()?);
    let wish = wished(args, DEGREES)?;
    needs_one_look(&wish.rules)?;
    let mut share = Share {
        region,
        model: decided(wish.in_chart(&region.chart))?,
        optics: optics.as_ref(),
        begun: None,
        n_flagged: 0,
        n_excluded: 0,
    };
    let blocks = BufReader::new(file);
    read_sample_blocks(chart, blocks, |block| share.take(&block)).map_err(|error| {
        let is_taken = matches!(error, BlockError::Taken(_));
        let help = if is_taken { REGION_HELP.to_owned() } else { csv_help(chart) };
        Failure::with_help(format!("{shown}: {error}"), help)
    })?;
    let (accumulator, quantity) = share
        .begun
        .ok_or_else(|| Failure::with_help(format!("{shown}: no samples"), csv_help(chart)))?;
    Ok(PartialFile {
        partial: accumulator.finish(),
        quantity,
        optics,
        simulated: false,
        n_flagged: share.n_flagged,
        n_excluded: share.n_excluded,
    })
}

impl Share<'_> {
    fn take(&mut self, block: &InputSamples) -> Result<(), String> {
        if self.begun.is_none() {
            let weighting = if block.has_u() { Weighting::Stated } else { Weighting::Alike };
            let begun = Accumulator::new(self.region, self.model, self.optics.copied(), weighting)
                .and_then(Accumulator::with_truncation);
            self.begun = Some((begun.map_err(|error| error.to_string())?, block.quantity));
        }
        let Some((accumulator, _)) = &mut self.begun else { return Ok(()) };
        let (samples, lines) = block.fit_samples_with_lines();
        self.n_flagged += block.flagged() as u64;
        self.n_excluded += (block.samples.len() - samples.len()) as u64;
        accumulator.absorb(&samples).map_err(|error| match error.index() {
            Some(index) => format!("line {}: {error}", lines[index]),
            None => error.to_string(),
        })
    }
}

/// Merges shares and shows the fit of all.
pub(super) fn merge(args: &FitArgs, rays: Option<Vec<ListedRay>>, wanted: &[Wanted]) -> Outcome {
    let mut paths = std::iter::once(&args.source).chain(&args.further);
    let Some(first_path) = paths.next() else { return Ok(ExitCode::SUCCESS) };
    let first = read(first_path)?;
    let mut whole = first.partial.clone();
    let mut count = 1_usize;
    let (mut n_flagged, mut n_excluded) = (first.n_flagged, first.n_excluded);
    let mut simulated = first.simulated;
    for path in paths {
        let part = read(path)?;
        let refused =
            |why: String| Failure::with_help(format!("{}: {why}", path.display()), PARTIAL_HELP);
        first
            .check(&part)
            .map_err(|differ| refused(format!("{differ} ({})", first_path.display())))?;
        whole.merge(&part.partial).map_err(|error| refused(error.to_string()))?;
        n_flagged += part.n_flagged;
        n_excluded += part.n_excluded;
        simulated |= part.simulated;
        count += 1;
    }
    if rays.is_some() {
        args.chart.demand_of(&first.partial.parts().region)?;
    }
    let resolves = whole.resolves(first.optics.as_ref());
    let closed = whole
        .close(args.u_relative)
        .map_err(|error| Failure::with_help(format!("merged: {error}"), FIT_HELP))?;
    let mut notes = vec![format!("merged from {count} partial fits")];
    if closed.u_factor > 1.0 {
        notes.push(format!(
            "the samples scatter beyond their stated uncertainties, which were all multiplied by \
             {:.3}; a fit of all samples together weighs them anew",
            closed.u_factor
        ));
    }
    let rules = wished(args, Wish::default())?.rules;
    let ruled = closed
        .fit
        .ruled(&rules)
        .map_err(|error| Failure::with_help(format!("merged: {error}"), FIT_HELP))?;
    let treatment =
        Treatment::default().with_rules(ruled.symmetry.as_ref(), ruled.nonnegative.as_ref());
    let derived = derive::derive(&ruled.fit, first.quantity, wanted);
    let folder = args.output.as_deref().map_or(Path::new(""), beside);
    derive::write_tables(folder, &derived).map_err(Failure::midway)?;
    let file = FitFile {
        fit: &ruled.fit,
        treatment: &treatment,
        choice: None,
        resolves: Some(resolves),
        quantity: first.quantity,
        simulated,
        n_flagged: usize::try_from(n_flagged).unwrap_or(usize::MAX),
        n_excluded: usize::try_from(n_excluded).unwrap_or(usize::MAX),
        notes: &notes,
        truth: None,
        independent: &IndependentParts::NONE,
        derived: &derived,
        rounds: &[],
        monte_carlo: None,
    };
    if let Some(path) = &args.output {
        write_atomically(path, |out| file.write(out)).map_err(Failure::midway)?;
    }
    show(args, rays, &file, args.output.as_deref())
}

fn read(path: &Path) -> Result<ReadPartial, Failure> {
    let refused = |why: &dyn std::fmt::Display| {
        Failure::with_help(format!("{}: {why}", path.display()), PARTIAL_HELP)
    };
    let size = std::fs::metadata(path).map_err(|error| refused(&error))?.len();
    if size > PARTIAL_BYTES_MAX {
        let expected = format!("{size} bytes; expected at most {PARTIAL_BYTES_MAX}");
        return Err(refused(&expected));
    }
    let bytes = std::fs::read(path).map_err(|error| refused(&error))?;
    ReadPartial::read(&bytes).map_err(|error| refused(&error))
}
