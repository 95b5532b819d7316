//! What a study of cost found, in words: on the terminal, as JSON, as a document's section, and as a
//! picture.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{Asked, Found, NAME};
use crate::cli::study::document::Document;
use crate::cli::text::{percent, table};
use crate::report::{Chart, INK, Series, Stroke};
use crate::study::cost::{Aim, Compared, Reached, Scene, Strategy, Target, compared};
use crate::study::median;

/// Targets in the radiance come first.
const OF_RADIANCE: usize = 3;

/// For the terminal.
pub(super) fn summary(found: &Found) -> String {
    let mut text = String::new();
    for (title, rows) in tables(found) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {title}");
        text.push_str(&table(&rows));
    }
    for aim in &found.aims {
        let _ = writeln!(text, "  {}: {}: {}", yes_or_no(aim), aim.text, aim.found);
    }
    text
}

/// So many seeds, and what they do.
fn counted(seeds: u64, one: &str, many: &str) -> String {
    if seeds == 1 { format!("1 seed {one}") } else { format!("{seeds} seeds {many}") }
}

/// For the document: Markdown.
pub(super) fn section(found: &Found, document: &Document) -> String {
    let Asked { seeds, quoted_seeds, longest_s, longest_fit_s, .. } = found.asked;
    let mut text = format!(
        "# What accuracy costs in rig time\n\nScenes on the built-in simulated rig, over 30 mm x 30 mm \
         and out to 80°, so bright that 20 ms have a noise of 0.1 % of the peak; `dim` is a batwing \
         at twenty times that. A strategy knows the region, the noise, and that the narrowest \
         feature is 6° wide (`spike` breaks that: 1.6°); it does not know the scene. Its time is \
         that of the first rung of its ladder of plans whose median error over the seeds meets the \
         target, from the first reading to the end of the last. Truth says when to stop, for every \
         strategy alike, and nothing else.\n\n\
         - Interpolation: cubic splines along θ through the pole, round φ, along x and y (not-a-knot), \
         through the readings as they are. Its ladders have grids of a single place too, which only \
         somebody who knows the scene would dare; those of the fits have not, but sweeps that are \
         interleaved over the places instead, with dark readings of 4 s. Adaptive runs begin with \
         meridians 20° apart, between which a lobe of 15° shows, or as far apart as the narrowest \
         feature asks, 6° of arc at 80°; they are told both targets, of L and of M.\n\
         - Fit: as `gonio run` does it where the plan leaves the basis open: chosen from the readings \
         by leaving out sweeps, each reading the mean over its beam and its way.\n\
         - L: RMS error of the radiance over region and directions, weighted with cos θ dω dA. M: error \
         of the exitance into 80°. Both after the factor common to all readings was taken out.\n\n\
         {} a rung, {} quoted.",
        counted(seeds, "places", "place"),
        counted(quoted_seeds, "is", "are"),
    );
    if seeds > 1 {
        text.push_str(
            " A rung that the first seed misses every open target with by more than a factor of two \
             is tried with no other.",
        );
    }
    if longest_s.is_finite() {
        let _ = write!(text, " Rungs of more than {longest_s} s were left out.");
    }
    if longest_fit_s < longest_s {
        let _ = write!(text, " Fits were made of rungs of up to {longest_fit_s} s alone.");
    }
    text.push_str("\n\n");
    for (title, rows) in tables(found) {
        let _ = writeln!(text, "## {title}\n");
        let mut rows = rows.into_iter();
        let head = rows.next().unwrap_or_default();
        let _ = writeln!(text, "| {} |\n|{}", head.join(" | "), " --- |".repeat(head.len()));
        for row in rows {
            let _ = writeln!(text, "| {} |", row.join(" | "));
        }
        text.push('\n');
    }
    if let Some(reference) = document.reference("Rig time of each strategy against the habit's") {
        let _ = writeln!(text, "{reference}\n\n{CAPTION}\n");
    }
    let _ =
        writeln!(text, "## What was aimed at\n\n| reached | aim | found |\n| --- | --- | --- |");
    for aim in &found.aims {
        let _ = writeln!(text, "| {} | {} | {} |", yes_or_no(aim), aim.text, aim.found);
    }
    let _ = writeln!(
        text,
        "\n{}\n\n`{}`  \n{}",
        factors(found),
        command(&found.asked),
        document.date()
    );
    text
}

/// What the section was made by.
fn command(asked: &Asked) -> String {
    let Asked { seeds, quoted_seeds, longest_s, longest_fit_s, .. } = asked;
    let scenes: Vec<&str> = asked.scenes.iter().map(|scene| scene.name()).collect();
    let mut words = "gonio study cost".to_owned();
    if scenes.len() < Scene::ALL.len() {
        let _ = write!(words, " --scenes {}", scenes.join(","));
    }
    if asked.strategies.len() < Strategy::ALL.len() {
        let names: Vec<&str> = asked.strategies.iter().map(|strategy| strategy.name()).collect();
        let _ = write!(words, " --strategies {}", names.join(","));
    }
    let _ = write!(words, " --seeds {seeds} --quoted-seeds {quoted_seeds}");
    if longest_s.is_finite() {
        let _ = write!(words, " --longest {longest_s}");
    }
    if longest_fit_s < longest_s {
        let _ = write!(words, " --longest-fit {longest_fit_s}");
    }
    words
}

const fn yes_or_no(aim: &Aim) -> &'static str {
    match aim.is_met {
        Some(true) => "yes",
        Some(false) => "no",
        None => "not asked",
    }
}

/// The responsivity's part, which no strategy can mend.
fn factors(found: &Found) -> String {
    let good = || found.runs.iter().filter(|run| run.radiance <= 0.05);
    let squares = good().map(|run| (run.factor - 1.0) * (run.factor - 1.0)).sum::<f64>();
    match good().count() {
        0 => "The factor common to all readings: no run is good enough to tell.".to_owned(),
        count => format!(
            "The factor common to all readings (responsivity, throughput, gain), which is taken out: \
             {} RMS over the {count} runs whose radiance is right to 5 %.",
            percent(libm::sqrt(squares / count as f64))
        ),
    }
}

fn tables(found: &Found) -> Vec<(String, Vec<Vec<String>>)> {
    let mut all = Vec::new();
    let (radiance, exitance) = Target::ALL.split_at(OF_RADIANCE);
    for targets in [radiance, exitance] {
        let names: Vec<String> = targets.iter().map(|target| target.name()).collect();
        all.push((format!("Rig time in seconds to {}", names.join(" / ")), times(found, targets)));
    }
    let unknown = against_one_plan(found);
    if unknown.len() > 1 {
        all.push(("Scene unknown: times less rig time than one plan for all".to_owned(), unknown));
    }
    let best = at_best(found);
    if best.len() > 1 {
        all.push(("The best that was run".to_owned(), best));
    }
    all
}

fn times(found: &Found, targets: &[Target]) -> Vec<Vec<String>> {
    let mut head = vec!["scene".to_owned()];
    head.extend(found.asked.strategies.iter().map(|strategy| strategy.name().to_owned()));
    let mut rows = vec![head];
    for &scene in &found.asked.scenes {
        let mut row = vec![scene.name().to_owned()];
        for &strategy in &found.asked.strategies {
            let of = |target: &Target| {
                let is_it =
                    |r: &&Reached| (r.scene, r.strategy, r.target) == (scene, strategy, *target);
                let at = found.reached.iter().find(is_it).and_then(|reached| reached.at);
                at.map_or_else(|| "-".to_owned(), |(_, rig_s, _)| format!("{rig_s:.0}"))
            };
            row.push(targets.iter().map(of).collect::<Vec<_>>().join(" / "));
        }
        rows.push(row);
    }
    rows
}

fn against_one_plan(found: &Found) -> Vec<Vec<String>> {
    let heads = ["target", "one plan of", "takes, s", "strategy", "median", "worst", "worst in"];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for target in Target::ALL {
        for baseline in [Strategy::RestInterpolated, Strategy::FlightInterpolated] {
            for &strategy in found.asked.strategies.iter().filter(|s| **s != baseline) {
                rows.extend(
                    compared(&found.reached, baseline, strategy, target).as_ref().map(compared_row),
                );
            }
        }
    }
    rows
}

fn compared_row(found: &Compared) -> Vec<String> {
    let least = if found.is_at_least { "> " } else { "" };
    let ratio = |ratio: f64| {
        if ratio > 0.0 { format!("{least}{ratio:.1}") } else { "not reached".to_owned() }
    };
    let worst = found.ratios.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    vec![
        found.target.name(),
        found.baseline.name().to_owned(),
        format!("{least}{:.0}", found.fixed_s),
        found.strategy.name().to_owned(),
        ratio(found.median()),
        ratio(found.worst()),
        worst.map_or(String::new(), |(scene, _)| scene.name().to_owned()),
    ]
}

/// The least error of each strategy in each scene, and what it was made of.
fn at_best(found: &Found) -> Vec<Vec<String>> {
    let heads = ["scene", "strategy", "rig time, s", "rung", "L", "M", "left out, u", "basis"];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for &scene in &found.asked.scenes {
        for &strategy in &found.asked.strategies {
            let of = || found.runs.iter().filter(|r| r.scene == scene && r.strategy == strategy);
            let best = of().min_by(|a, b| a.radiance.total_cmp(&b.radiance));
            let Some(best) = best else { continue };
            let same = || of().filter(|run| run.rung == best.rung);
            let middle = |values: Vec<f64>| median(values).map_or(String::new(), percent);
            let left_out = median(same().filter_map(|run| run.left_out_rms));
            rows.push(vec![
                scene.name().to_owned(),
                strategy.name().to_owned(),
                format!("{:.0}", best.rig_s),
                best.rung.name(),
                middle(same().map(|run| run.radiance).collect()),
                middle(same().map(|run| run.exitance.abs()).collect()),
                left_out.map_or(String::new(), |rms| format!("{rms:.2}")),
                best.basis.as_ref().map_or(String::new(), |(name, _)| name.clone()),
            ]);
        }
    }
    rows
}

const CAPTION: &str = "Each mark is a scene and a target of the radiance: across the rig time of the \
                       raster at rest with interpolation, up that of the other strategies. Below the \
                       line is faster.";

/// An SVG document: the other strategies' times over those of the habit.
pub(super) fn picture(found: &Found) -> String {
    let habit = Strategy::RestInterpolated;
    let time = |scene: Scene, strategy: Strategy, target: Target| {
        let is_it = |r: &&Reached| (r.scene, r.strategy, r.target) == (scene, strategy, target);
        found.reached.iter().find(is_it)?.at.map(|(_, rig_s, _)| rig_s)
    };
    let pairs = |strategy: Strategy| -> Vec<(f64, f64)> {
        let scenes = found.asked.scenes.iter();
        let all =
            scenes.flat_map(|scene| Target::ALL[..OF_RADIANCE].iter().map(move |t| (*scene, *t)));
        all.filter_map(|(scene, t)| Some((time(scene, habit, t)?, time(scene, strategy, t)?)))
            .collect()
    };
    let series = |(colour, strategy): (usize, &Strategy)| Series {
        name: strategy.name().to_owned(),
        colour,
        stroke: Stroke::Points,
        points: pairs(*strategy),
        errors: Vec::new(),
    };
    let others = found.asked.strategies.iter().filter(|strategy| **strategy != habit);
    let mut all: Vec<Series> = others.enumerate().map(series).collect();
    let along = || all.iter().flat_map(|s| s.points.iter().map(|(across, _)| *across));
    let ends = (along().fold(f64::INFINITY, f64::min), along().fold(0.0, f64::max));
    all.insert(
        0,
        Series {
            name: "as long".to_owned(),
            colour: INK,
            stroke: Stroke::Dashes,
            points: vec![(ends.0, ends.0), (ends.1, ends.1)],
            errors: Vec::new(),
        },
    );
    let chart = Chart {
        name: NAME,
        title: "What accuracy costs in rig time".to_owned(),
        caption: CAPTION.to_owned(),
        x_label: "rig time at rest, interpolated / s".to_owned(),
        y_label: "rig time of the strategy / s".to_owned(),
        is_logarithmic: true,
        series: all,
    };
    chart.picture().map_or_else(String::new, |picture| picture.document())
}

/// One JSON document.
pub(super) fn as_json(found: &Found) -> Value {
    let reached = |r: &Reached| {
        json!({
            "scene": r.scene.name(),
            "strategy": r.strategy.name(),
            "target": r.target.name(),
            "rung": r.at.map(|(rung, _, _)| rung.name()),
            "rig_s": r.at.map(|(_, rig_s, _)| rig_s),
            "seeds": r.at.map(|(_, _, seeds)| seeds),
            "longest_s": r.longest_s,
        })
    };
    let aim = |aim: &Aim| json!({"aim": aim.text, "found": aim.found, "met": aim.is_met});
    json!({
        "seeds": found.asked.seeds,
        "quoted_seeds": found.asked.quoted_seeds,
        "runs": found.runs.len(),
        "reached": found.reached.iter().map(reached).collect::<Vec<_>>(),
        "aims": found.aims.iter().map(aim).collect::<Vec<_>>(),
    })
}
