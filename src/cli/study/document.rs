//! What a study found, in words: on the terminal, as JSON, and as a document's section.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;

use serde_json::json;

use super::coverage::Studied;
use crate::cli::args::DocumentArgs;
use crate::cli::failure::Failure;
use crate::cli::text::table;
use crate::export::{with_section, write_atomically};
use crate::study::coverage::{Demand, Family, Pool};

/// The document that a section goes to.
pub(super) struct Document {
    path: PathBuf,
    date: String,
    figure: Option<PathBuf>,
    name: &'static str,
}

impl Document {
    /// What the command line asks for; refused before a study of hours has begun.
    pub(super) fn asked(args: &DocumentArgs, name: &'static str) -> Result<Option<Self>, Failure> {
        let Some(path) = args.doc.clone() else { return Ok(None) };
        let Some(date) = args.date.clone() else {
            return Err(Failure::with_help(
                "--doc: the document states the day, and nothing here reads a calendar",
                "add it, for example --date 2026-11-22",
            ));
        };
        Ok(Some(Self { path, date, figure: args.figure.clone(), name }))
    }

    /// Replaces the section, or adds it; and the figure.
    pub(super) fn write(&self, section: &str, svg: &str) -> Result<(), Failure> {
        let old = if self.path.exists() {
            std::fs::read_to_string(&self.path)
                .map_err(|error| Failure::midway(format!("{}: {error}", self.path.display())))?
        } else {
            String::new()
        };
        let new = with_section(&old, self.name, section);
        write_atomically(&self.path, |out| out.write_all(new.as_bytes()))
            .map_err(Failure::midway)?;
        if let Some(figure) = &self.figure {
            write_atomically(figure, |out| out.write_all(svg.as_bytes()))
                .map_err(Failure::midway)?;
        }
        Ok(())
    }

    /// The day.
    pub(super) fn date(&self) -> &str {
        &self.date
    }

    /// The figure as the document refers to it, if it lies below its folder.
    pub(super) fn reference(&self, words: &str) -> Option<String> {
        let figure = self.figure.as_ref()?;
        let below = self.path.parent().and_then(|folder| figure.strip_prefix(folder).ok());
        Some(format!("![{words}]({})", below.unwrap_or(figure).display()))
    }
}

const HEADS: [&str; 9] = [
    "scenes",
    "scale",
    "quantity",
    "runs",
    "RMS of error/u",
    "mean",
    "intervals that hold, %",
    "median u, relative",
    "u over RMS error",
];

fn cells_of(pool: &Pool) -> Vec<String> {
    let tally = &pool.tally;
    vec![
        pool.family.map_or("all that the basis follows", |family| family.name()).to_owned(),
        pool.scale.name().to_owned(),
        pool.kind.name().replace('_', " "),
        pool.runs.to_string(),
        format!("{:.3}", tally.rms),
        format!("{:+.3}", tally.mean),
        format!("{:.1}", 100.0 * tally.coverage()),
        format!("{:.1e}", tally.median_u),
        format!("{:.2}", tally.u_over_rms_error()),
    ]
}

/// For the terminal.
pub(super) fn summary(studied: &Studied, demands: &[Demand]) -> String {
    let mut rows = vec![HEADS.map(str::to_owned).to_vec()];
    rows.extend(studied.pools.iter().map(cells_of));
    let mut text = table(&rows);
    let missed = demands.iter().filter(|demand| !demand.is_met);
    for demand in missed.clone() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  missed: {}", demand.text);
    }
    let refused = studied.refused.len();
    if refused > 0 {
        let _ = writeln!(text, "  missed: {refused} runs came to no fit");
    }
    let met = demands.len() - missed.count();
    let _ = writeln!(text, "  {met} of {} demands met", demands.len());
    text
}

/// For the document: Markdown.
pub(super) fn section(studied: &Studied, demands: &[Demand], document: &Document) -> String {
    let Studied { runs, seed, families, unpinned, .. } = studied;
    let (title, flag) = if *unpinned {
        ("The same with basis and penalty chosen from the readings", " --unpinned")
    } else {
        ("Do the stated uncertainties cover the truth?", "")
    };
    let names: Vec<&str> = families.iter().map(|family| family.name()).collect();
    let (followed, limited): (Vec<_>, Vec<_>) =
        families.iter().partition(|family| !family.is_limited_by_basis());
    let list =
        |of: &[&Family]| of.iter().map(|family| family.name()).collect::<Vec<_>>().join(", ");
    let basis = if *unpinned {
        format!("The plans pin no basis; polynomials follow {} exactly", list(&followed))
    } else {
        format!(
            "The plan's basis follows {} exactly; it limits {}",
            list(&followed),
            list(&limited)
        )
    };
    let mut text = format!(
        "## {title}\n\n{runs} runs of each of {} scenes, on rigs \
         that know their scale as a rig file states it, and exactly. Every run draws the scene's \
         numbers, the rig and its noise anew, and goes through the wire, the journal, the calibration \
         and the fit as `gonio run` does. {basis}. An interval is value ± 1.96 u; u and errors are relative to the \
         largest truth of their quantity in the run. Several rays of a \
         run share its errors.\n\n",
        families.len(),
    );
    let _ = writeln!(text, "| {} |\n|{}", HEADS.join(" | "), " --- |".repeat(HEADS.len()));
    for pool in &studied.pools {
        let _ = writeln!(text, "| {} |", cells_of(pool).join(" | "));
    }
    if let Some(reference) = document.reference("Coverage by cell") {
        let _ = writeln!(text, "\n{reference}");
    }
    let met = demands.iter().filter(|demand| demand.is_met).count();
    let _ = writeln!(text, "\n{met} of {} demands met.", demands.len());
    for demand in demands.iter().filter(|demand| !demand.is_met) {
        let _ = writeln!(text, "\nMissed: {}.", demand.text);
    }
    if !studied.refused.is_empty() {
        let _ = writeln!(text, "\nMissed: {} runs came to no fit.", studied.refused.len());
    }
    let _ = writeln!(
        text,
        "\n`gonio study coverage --scenes {} --runs {runs} --seed {seed}{flag}`  \n{}",
        names.join(","),
        document.date()
    );
    text
}

/// One JSON document.
pub(super) fn write_json(
    out: &mut dyn Write,
    studied: &Studied,
    demands: &[Demand],
) -> io::Result<()> {
    let pools: Vec<serde_json::Value> = studied
        .pools
        .iter()
        .map(|pool| {
            json!({
                "scene": pool.family.map(Family::name),
                "scale": pool.scale.name(),
                "quantity": pool.kind.name(),
                "runs": pool.runs,
                "rms_error_over_u": pool.tally.rms,
                "mean_error_over_u": pool.tally.mean,
                "coverage": pool.tally.coverage(),
                "median_u_relative": pool.tally.median_u,
                "rms_error_relative": pool.tally.rms_error,
            })
        })
        .collect();
    let demands: Vec<serde_json::Value> =
        demands.iter().map(|d| json!({"demand": d.text, "met": d.is_met})).collect();
    let document = json!({
        "runs": studied.runs,
        "seed": studied.seed,
        "pools": pools,
        "demands": demands,
        "refused": studied.refused,
    });
    writeln!(out, "{document}")
}
