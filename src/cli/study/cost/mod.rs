//! `gonio study cost`: what accuracy costs in rig time, strategy against strategy. Climbs ladders of
//! plans on the simulated rig, scene by scene, until the targets are met.

use std::path::Path;
use std::process::ExitCode;

use self::one::Bench;
use super::document::Document;
use super::kept::program;
use super::place::Place;
use crate::cli::args::CostArgs;
use crate::cli::failure::{Failure, Outcome};
use crate::cli::output::{note, say, say_json};
use crate::cli::parallel::in_parallel;
use crate::export::{ExportError, write_atomically, write_cost, write_reached};
use crate::rig::Rig;
use crate::study::Motion;
use crate::study::cost::{Aim, Climb, Reached, Run, Rung, Scene, Strategy, aims, ladder};

mod cache;
mod one;
mod words;

/// The section's marks in the document.
const NAME: &str = "cost";
const SEEDS: u64 = 5;
const QUOTED_SEEDS: u64 = 20;
/// The short study: one scene, and the first rungs that all strategies take; nothing adaptive, which
/// takes its own time.
const SHORT: Scene = Scene::Gradient;
const SHORT_RUNGS: usize = 2;

/// What is asked.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    pub(super) scenes: Vec<Scene>,
    pub(super) strategies: Vec<Strategy>,
    pub(super) seeds: u64,
    pub(super) quoted_seeds: u64,
    is_short: bool,
    pub(super) longest_s: f64,
    pub(super) longest_fit_s: f64,
}

/// What came of it.
pub(super) struct Found {
    pub(super) asked: Asked,
    pub(super) runs: Vec<Run>,
    pub(super) reached: Vec<Reached>,
    pub(super) aims: Vec<Aim>,
}

/// Climbs, writes what was found, and answers whether every aim that was asked about is met.
pub(crate) fn cost(args: &CostArgs) -> Outcome {
    let document = Document::asked(&args.document, NAME)?;
    let asked = Asked::of(args)?;
    let cache = args.cache.as_deref();
    let place = Place::make("cost", args.out.as_deref(), cache)?;
    let found = study(asked, &place.runs, cache)?;
    place.clear();
    let svg = words::picture(&found);
    write(&place.folder, &found, &svg).map_err(Failure::midway)?;
    if let Some(document) = document {
        document.write(&words::section(&found, &document), &svg)?;
    }
    if args.json {
        say_json(&words::as_json(&found))?;
    } else {
        say(&format!("{}  folder {}\n", words::summary(&found), place.folder.display()))?;
    }
    let is_met = found.aims.iter().all(|aim| aim.is_met != Some(false));
    Ok(if is_met { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn write(folder: &Path, found: &Found, svg: &str) -> Result<(), ExportError> {
    write_atomically(&folder.join("cost.csv"), |out| write_cost(out, &found.runs))?;
    write_atomically(&folder.join("reached.csv"), |out| write_reached(out, &found.reached))?;
    write_atomically(&folder.join("cost.svg"), |out| out.write_all(svg.as_bytes()))
}

impl Asked {
    fn of(args: &CostArgs) -> Result<Self, Failure> {
        let scenes = named("--scenes", &args.scenes, Scene::ALL, Scene::name)?;
        let strategies = named("--strategies", &args.strategies, Strategy::ALL, Strategy::name)?;
        let is_short = args.short;
        let strategies = if is_short && args.strategies.is_empty() {
            strategies.into_iter().filter(|s| s.motion() != Motion::Adaptive).collect()
        } else {
            strategies
        };
        let scenes = if is_short && args.scenes.is_empty() { vec![SHORT] } else { scenes };
        let seeds = args.seeds.unwrap_or(if is_short { 1 } else { SEEDS });
        let quoted_seeds = args.quoted_seeds.unwrap_or(if is_short { 1 } else { QUOTED_SEEDS });
        if quoted_seeds < seeds {
            return Err(Failure::with_help(
                format!("--quoted-seeds {quoted_seeds}: fewer than the {seeds} that place a rung"),
                "what is quoted rests on those and more: give at least as many",
            ));
        }
        let longest_s = args.longest.unwrap_or(f64::INFINITY);
        let longest_fit_s = args.longest_fit.unwrap_or(f64::INFINITY).min(longest_s);
        Ok(Self { scenes, strategies, seeds, quoted_seeds, is_short, longest_s, longest_fit_s })
    }
}

/// What was named, or all.
fn named<T: Copy, const N: usize>(
    flag: &str,
    names: &[String],
    all: [T; N],
    name: fn(T) -> &'static str,
) -> Result<Vec<T>, Failure> {
    if names.is_empty() {
        return Ok(all.to_vec());
    }
    let find = |wanted: &String| {
        all.into_iter().find(|one| name(*one) == wanted).ok_or_else(|| {
            Failure::with_help(
                format!("{flag}: there is no `{wanted}`"),
                format!("choose among {}", all.map(name).join(", ")),
            )
        })
    };
    names.iter().map(find).collect()
}

/// Every scene by every motion, as many at once as there are threads.
fn study(asked: Asked, work: &Path, cache: Option<&Path>) -> Result<Found, Failure> {
    let rig = Rig::built_in()?.document().source().text().to_owned();
    let program = cache.map_or(Ok(String::new()), |_| program())?;
    // The dear ones first, so that no thread is left with one of them in the end.
    let motions = Motion::ALL.into_iter().rev();
    let entries: Vec<(Scene, Motion)> = motions
        .flat_map(|motion| asked.scenes.iter().rev().map(move |scene| (*scene, motion)))
        .filter(|(_, motion)| asked.strategies.iter().any(|s| s.motion() == *motion))
        .collect();
    let done = in_parallel(&entries, |(scene, motion)| {
        let bench = Bench::new(*scene, &rig, work, &program, cache);
        climb(&asked, &bench, *motion)
    });
    let (mut runs, mut reached) = (Vec::new(), Vec::new());
    for ((scene, _), done) in entries.iter().zip(done) {
        let lost = || Failure::midway(format!("{}: a thread panicked", scene.name()));
        let (of_runs, of_reached) = done.ok_or_else(lost)??;
        runs.extend(of_runs);
        reached.extend(of_reached);
    }
    let place = |scene: Scene| Scene::ALL.iter().position(|s| *s == scene);
    runs.sort_by(|a: &Run, b| {
        let of = |run: &Run| (place(run.scene), run.strategy);
        of(a).cmp(&of(b)).then(a.rig_s.total_cmp(&b.rig_s)).then(a.seed.cmp(&b.seed))
    });
    reached.sort_by_key(|reached: &Reached| (place(reached.scene), reached.strategy));
    let aims = if asked.is_short { Vec::new() } else { aims(&reached, &runs) };
    Ok(Found { asked, runs, reached, aims })
}

/// One scene, one motion, and whatever is made of its readings, rung by rung.
fn climb(
    asked: &Asked,
    bench: &Bench<'_>,
    motion: Motion,
) -> Result<(Vec<Run>, Vec<Reached>), Failure> {
    let scene = bench.scene();
    let mut climbs: Vec<(Strategy, Climb)> = Strategy::ALL
        .into_iter()
        .filter(|s| s.motion() == motion && asked.strategies.contains(s))
        .map(|strategy| (strategy, Climb::new(scene, strategy)))
        .collect();
    let mut all = Vec::new();
    for (rung, rig_s) in rungs(asked, bench, motion)? {
        let is_short_enough = |s: Strategy| !s.is_fitted() || rig_s <= asked.longest_fit_s;
        let takes = |s: Strategy| s.takes(&rung) && is_short_enough(s);
        let open = climbs.iter().filter(|(s, climb)| takes(*s) && !climb.is_done());
        let open: Vec<Strategy> = open.map(|(strategy, _)| *strategy).collect();
        if open.is_empty() {
            continue;
        }
        let mut runs = bench.runs(&rung, 1, &open)?;
        // What is far off with one seed no other seed brings to a target.
        let close = climbs
            .iter()
            .filter(|(s, climb)| open.contains(s) && climb.might_meet(&of_strategy(&runs, *s)));
        let close: Vec<Strategy> = close.map(|(strategy, _)| *strategy).collect();
        for seed in 2..=asked.seeds {
            runs.extend(bench.runs(&rung, seed, &close)?);
        }
        for (strategy, climb) in climbs.iter_mut().filter(|(s, _)| open.contains(s)) {
            let mut mine = of_strategy(&runs, *strategy);
            if climb.would_meet(&mine) {
                for seed in asked.seeds + 1..=asked.quoted_seeds {
                    mine.extend(bench.runs(&rung, seed, &[*strategy])?);
                }
            }
            climb.settle(&mine);
            all.extend(mine);
        }
    }
    let reached = climbs.into_iter().flat_map(|(_, climb)| climb.reached()).collect();
    Ok((all, reached))
}

fn of_strategy(runs: &[Run], strategy: Strategy) -> Vec<Run> {
    runs.iter().filter(|run| run.strategy == strategy).cloned().collect()
}

/// The ladder's rungs with the time that they take, in its order.
fn rungs(asked: &Asked, bench: &Bench<'_>, motion: Motion) -> Result<Vec<(Rung, f64)>, Failure> {
    let ladder = ladder(motion, bench.scene() == Scene::Dim);
    let mut timed = Vec::new();
    for rung in ladder {
        if asked.is_short && (rung.is_interleaved || !(2..=3).contains(&rung.places)) {
            continue;
        }
        let rig_s = bench.foretold_s(&rung)?;
        if rig_s <= asked.longest_s {
            timed.push((rung, rig_s));
        }
    }
    timed.sort_by(|a, b| a.1.total_cmp(&b.1));
    if timed.is_empty() {
        note(&format!("{}: no rung is as short as --longest", bench.scene().name()));
    }
    let count = if asked.is_short { SHORT_RUNGS } else { timed.len() };
    timed.truncate(count);
    Ok(timed)
}
