//! `gonio study coverage`: many runs on simulated rigs, each of another scene, rig and noise, through
//! the wire, the journal, the calibration and the fit that `gonio run` has; how often the stated
//! intervals hold the truth.

use std::path::Path;
use std::process::ExitCode;

use radiometry::quadrature::gauss_legendre;

use super::document::{Document, section, summary};
use super::kept::Scores;
use super::place::Place;
use crate::cli::args::CoverageArgs;
use crate::cli::failure::{Failure, Outcome};
use crate::cli::output::{note, say, write_out};
use crate::cli::parallel::in_parallel;
use crate::cli::results::{fit_of, fit_region};
use crate::cli::setup::Setup;
use crate::cli::virtual_run::{Texts, VirtualRun};
use crate::export::{write_atomically, write_coverage};
use crate::report::{Cells, scores_svg};
use crate::rig::Rig;
use crate::study::coverage::{
    Answer, Cell, Drawn, Draws, FAMILIES, Family, Kind, Lamp, Pool, Run, Scale, Score, Target,
    binomial_band, demands, tally, targets,
};

/// The section's marks in the document, with pinned plans and with such as leave the basis open.
const NAMES: [&str; 2] = ["coverage", "coverage-unpinned"];
/// Of a real lamp; MIT as the notice beside it says.
pub(super) const PHOTOMETRIC: &str = include_str!("../../../examples/luminaire/ushio_b1.ies");
/// Measured lamps, each with planes all round; MIT as the notice beside them says.
const LAMPS: [&[u8]; 10] = [
    include_bytes!("../../../photometry-files/tests/data/sterilray.ies"),
    include_bytes!("../../../photometry-files/tests/data/aerolamp.ies"),
    include_bytes!("../../../photometry-files/tests/data/beacon.ies"),
    include_bytes!("../../../photometry-files/tests/data/lumenizer_zone.ies"),
    include_bytes!("../../../photometry-files/tests/data/nukit_torch.ies"),
    include_bytes!("../../../photometry-files/tests/data/ushio_b1.ies"),
    include_bytes!("../../../photometry-files/tests/data/ushio_b1.5.ies"),
    include_bytes!("../../../photometry-files/tests/data/uvpro222_b1.ies"),
    include_bytes!("../../../photometry-files/tests/data/uvpro222_b2.ies"),
    include_bytes!("../../../photometry-files/tests/data/visium.ies"),
];
/// Runs a scene of the short study.
const SHORT_RUNS: usize = 12;
/// Scenes of the short study: one that the basis follows, one that it does not.
const SHORT: [Family; 2] = [Family::Lobe, Family::AnyLobe];
/// Nodes a side of a mean over the region.
const NODES: usize = 8;

/// What came of all runs.
pub(super) struct Studied {
    pub(super) runs: usize,
    pub(super) seed: u64,
    pub(super) families: Vec<Family>,
    pub(super) cells: Vec<Cell>,
    pub(super) pools: Vec<Pool>,
    /// Why runs came to no fit, one sentence each.
    pub(super) refused: Vec<String>,
    /// Whether the plans leave basis and penalty to the readings.
    pub(super) unpinned: bool,
}

/// A run to make.
#[derive(Debug, Clone, Copy)]
struct Entry {
    family: usize,
    scale: usize,
    run: usize,
}

/// Makes the runs, writes what they say, and answers whether every demand was met.
pub(crate) fn coverage(args: &CoverageArgs) -> Outcome {
    let document = Document::asked(&args.document, NAMES[usize::from(args.unpinned)])?;
    let families = families(args)?;
    let runs = args.runs.unwrap_or(if args.short { SHORT_RUNS } else { 1000 });
    let place = Place::make("coverage", args.out.as_deref(), args.cache.as_deref())?;
    let studied = study(families, runs, args, &place.runs)?;
    place.clear();
    let demands = demands(&studied.cells, &studied.pools);
    let svg = picture(&studied);
    write_atomically(&place.folder.join("coverage.csv"), |out| write_coverage(out, &studied.cells))
        .and_then(|()| {
            write_atomically(&place.folder.join("coverage.svg"), |out| {
                out.write_all(svg.as_bytes())
            })
        })
        .map_err(Failure::midway)?;
    if let Some(document) = document {
        document.write(&section(&studied, &demands, &document), &svg)?;
    }
    for refused in &studied.refused {
        note(&format!("no fit: {refused}"));
    }
    if args.json {
        write_out(|out| super::document::write_json(out, &studied, &demands))?;
    } else {
        let shown = place.folder.display();
        say(&format!("{}  folder {shown}\n", summary(&studied, &demands)))?;
    }
    let is_met = demands.iter().all(|demand| demand.is_met) && studied.refused.is_empty();
    Ok(if is_met { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn families(args: &CoverageArgs) -> Result<Vec<Family>, Failure> {
    if args.scenes.is_empty() {
        return Ok(if args.short { SHORT.to_vec() } else { FAMILIES.to_vec() });
    }
    let named = |name: &String| {
        FAMILIES.into_iter().find(|family| family.name() == name).ok_or_else(|| {
            let known: Vec<&str> = FAMILIES.iter().map(|family| family.name()).collect();
            Failure::with_help(
                format!("--scenes: there is no `{name}`"),
                format!("choose among {}", known.join(", ")),
            )
        })
    };
    args.scenes.iter().map(named).collect()
}

/// Every scene on rigs of both kinds, so many runs each, on as many threads as the machine has.
fn study(
    families: Vec<Family>,
    runs: usize,
    args: &CoverageArgs,
    work: &Path,
) -> Result<Studied, Failure> {
    let (seed, unpinned) = (args.seed, args.unpinned);
    let rig = Rig::built_in()?.document().source().text().to_owned();
    let (lamps, kept) = (lamps(), Scores::new(args.cache.as_deref())?);
    let entries: Vec<Entry> = (0..families.len())
        .flat_map(|family| (0..Scale::ALL.len()).map(move |scale| (family, scale)))
        .flat_map(|(family, scale)| (0..runs).map(move |run| Entry { family, scale, run }))
        .collect();
    let one = |entry: &Entry| {
        let (family, scale) = (families[entry.family], Scale::ALL[entry.scale]);
        // A family's number among all, so that a study of one repeats what it was among others.
        let place = FAMILIES.iter().position(|f| *f == family).unwrap_or(0);
        let mut draws = Draws::at(seed, &[place as u64, entry.scale as u64, entry.run as u64]);
        let folder = work.join(format!("{}-{}-{}", family.name(), entry.scale, entry.run));
        let mut drawn = family.draw(&mut draws, scale, &rig, &lamps);
        if unpinned {
            drawn = drawn.unpinned();
        }
        run_one(&drawn, draws.seed(), &folder, &kept)
            .map_err(|failure| format!("{}, run {}: {}", family.name(), entry.run, failure.text()))
    };
    let done = in_parallel(&entries, one);
    let mut refused = Vec::new();
    let (mut cells, mut pools) = (Vec::new(), Vec::new());
    for scale in 0..Scale::ALL.len() {
        let mut followed: Vec<(Vec<Target>, Vec<Run>)> = Vec::new();
        for (i, family) in families.iter().enumerate() {
            let mine = entries.iter().zip(&done).filter(|(e, _)| e.family == i && e.scale == scale);
            let mut found = Vec::new();
            let mut asked = Vec::new();
            for (_, outcome) in mine {
                match outcome {
                    Some(Ok((targets, run))) => {
                        asked.clone_from(targets);
                        found.push(run.clone());
                    }
                    Some(Err(why)) => refused.push(why.clone()),
                    None => refused.push(format!("{}: a thread panicked", family.name())),
                }
            }
            if found.is_empty() {
                continue;
            }
            let scale = Scale::ALL[scale];
            cells.extend(Cell::of(*family, scale, &asked, &found));
            pools.extend(pools_of(Some(*family), scale, &[(asked.clone(), found.clone())]));
            if !family.is_limited_by_basis() {
                followed.push((asked, found));
            }
        }
        pools.extend(pools_of(None, Scale::ALL[scale], &followed));
    }
    Ok(Studied { runs, seed, families, cells, pools, refused, unpinned })
}

/// The lamps of [`Family::Photometric`].
fn lamps() -> Vec<Lamp> {
    let lamp = |file: &&[u8]| {
        // Ours, and part of the program.
        let photometry = photometry_files::lm63::read(file).expect("a sound file");
        Lamp::of(&photometry).expect("planes all round")
    };
    LAMPS.iter().map(lamp).collect()
}

/// The pools of one kind of rig, a quantity each.
fn pools_of(family: Option<Family>, scale: Scale, parts: &[(Vec<Target>, Vec<Run>)]) -> Vec<Pool> {
    let runs: usize = parts.iter().map(|(_, runs)| runs.len()).sum();
    let pool = |kind: Kind| {
        let scores = parts.iter().flat_map(|(targets, runs)| {
            runs.iter().flat_map(move |run| {
                let of_kind = run.scores.iter().zip(targets).filter(move |(_, t)| t.kind == kind);
                of_kind.map(|(score, _)| score)
            })
        });
        Pool { family, scale, kind, runs, tally: tally(scores) }
    };
    if runs == 0 { Vec::new() } else { Kind::ALL.into_iter().map(pool).collect() }
}

/// One run of a scene as drawn, from the wire to the scores.
fn run_one(
    drawn: &Drawn,
    seed: u64,
    folder: &Path,
    kept: &Scores<'_>,
) -> Result<(Vec<Target>, Run), Failure> {
    let Drawn { plan, rig, scene, attachments } = drawn;
    let setup = Texts { plan, rig, scene, attachments }.setup(seed)?;
    if let Some(run) = kept.find(drawn, seed) {
        return Ok((targets(&fit_region(&setup)), run));
    }
    let VirtualRun { setup, readings, .. } = VirtualRun::passing(setup, folder)?;
    let (targets, run) = scored(&setup, &fit_of(&setup, &readings)?)?;
    kept.keep(drawn, seed, &run)?;
    Ok((targets, run))
}

fn scored(setup: &Setup, fit: &fit::Fit) -> Result<(Vec<Target>, Run), Failure> {
    let region = fit_region(setup);
    let truth = setup.truth().ok_or_else(|| Failure::midway("the rig is not simulated"))?;
    let exitance = truth.exitance();
    let answer = |target: &Target| -> Answer {
        let (estimate, truth) = match (target.kind, target.ray) {
            (Kind::ExitanceWithin, _) => {
                (fit.exitance_within_region(), truth.exitance_within_region())
            }
            (Kind::Flux, _) => (fit.flux(), truth.flux()),
            (Kind::Intensity, Some(ray)) => (
                fit.intensity(ray.theta_rad, ray.phi_rad),
                intensity(&truth, ray.theta_rad, ray.phi_rad),
            ),
            (Kind::Radiance, Some(ray)) => {
                let radiance = truth.radiance(ray.x_m, ray.y_m, ray.theta_rad, ray.phi_rad);
                (fit.radiance(&ray), radiance)
            }
            _ => (fit.exitance(), exitance),
        };
        Answer { kind: target.kind, value: estimate.value, u: estimate.u, truth }
    };
    let targets = targets(&region);
    let answers: Vec<Answer> = targets.iter().map(answer).collect();
    Ok((targets, Run { scores: Score::of(&answers) }))
}

/// ∫ L cos θ dA over the region, of the truth.
fn intensity(truth: &sim::Truth<'_>, theta_rad: f64, phi_rad: f64) -> f64 {
    let region = truth.region();
    let at = |(low, high): (f64, f64), t: f64| f64::midpoint(low, high) + 0.5 * t * (high - low);
    let rule = gauss_legendre(NODES);
    let mut mean = 0.0;
    for (s, weight_x) in &rule {
        for (t, weight_y) in &rule {
            let (x_m, y_m) = (at(region.x_m, *s), at(region.y_m, *t));
            mean += 0.25 * weight_x * weight_y * truth.radiance(x_m, y_m, theta_rad, phi_rad);
        }
    }
    mean * region.area_m2() * libm::cos(theta_rad)
}

/// The cells of the rigs that know their scale: those of the others all lie at 1 and 95 %.
fn picture(studied: &Studied) -> String {
    let group = |family: &Family| Cells {
        name: family.name().to_owned(),
        is_cross: family.is_limited_by_basis(),
        cells: studied
            .cells
            .iter()
            .filter(|cell| cell.family == *family && cell.scale == Scale::Known)
            .map(|cell| (cell.tally.rms, cell.tally.coverage()))
            .collect(),
    };
    let groups: Vec<Cells> = studied.families.iter().map(group).collect();
    let (least, most) = binomial_band(studied.runs, 0.95);
    let part = |count: usize| count as f64 / studied.runs as f64;
    let title = format!("Coverage, scale known exactly, {} runs a scene", studied.runs);
    scores_svg(&title, &groups, (part(least), part(most)))
}
