//! `gonio explain`: which effects a scene calls for, why, and what they amount to.

use std::fmt::Write as _;
use std::process::ExitCode;

use serde_json::json;

use super::args::ExplainArgs;
use super::failure::{Failure, Outcome};
use super::inputs::{BUILT_IN, Inputs, beside};
use super::output::{say, say_json};
use super::setup::{rig_at, stage_at};
use super::text::{table, wrapped};
use crate::journal::InputRole;
use crate::plan::Plan;

/// The seed matters to the drawn values alone, not to which effects there are.
const SEED: u64 = 1;

/// Compiles the scene and prints one row an effect.
pub(crate) fn explain(args: &ExplainArgs) -> Outcome {
    let mut inputs = Inputs::from_disk();
    let rig_of_plan = match &args.plan {
        None => None,
        Some(path) => {
            let plan = Plan::read(inputs.document(InputRole::Plan, path)?)?;
            plan.rig.as_deref().filter(|name| *name != BUILT_IN).map(|name| beside(path, name))
        }
    };
    let path = args.rig.clone().or(rig_of_plan).unwrap_or_else(|| BUILT_IN.into());
    let rig = rig_at(&mut inputs, &path)?;
    if !rig.is_simulated() {
        return Err(Failure::with_help(
            format!(
                "{}: {} is a real rig; effects are those of a simulated one",
                path.display(),
                rig.name
            ),
            "leave --rig out for the built-in rig, or give a rig.toml with link.kind = \"simulated\"",
        ));
    }
    let stage = stage_at(&mut inputs, &args.scene, &rig, SEED)?;
    let (effects, notes) = (stage.compiled.effects(), stage.compiled.scene().notes());
    if args.json {
        let rows: Vec<_> = effects
            .iter()
            .map(|row| {
                json!({
                    "effect": row.name,
                    "included": row.included,
                    "called_for_by": row.cause,
                    "bound": row.bound.map(|bound| json!({"value": bound.value, "unit": bound.unit.symbol()})),
                    "how": row.how,
                })
            })
            .collect();
        say_json(&json!({"rig": rig.name, "effects": rows, "notes": notes}))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text = effects_text(effects);
    for note in notes {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  note: {note}");
    }
    say(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Two paragraphs an effect: whether it is in, what it amounts to and what calls for it; and how
/// it is done.
fn effects_text(effects: &[sim::EffectRow]) -> String {
    let rows: Vec<_> = effects
        .iter()
        .map(|row| {
            let bound = row.bound.map_or_else(
                || "-".to_owned(),
                |bound| format!("{:.2e} {}", bound.value, bound.unit.symbol()),
            );
            let mark = if row.included { "in" } else { "out" };
            vec![mark.to_owned(), row.name.clone(), bound]
        })
        .collect();
    let mut text = String::new();
    for (line, row) in table(&rows).lines().zip(effects) {
        let _ = writeln!(text, "{line}");
        let cause = row.cause.as_deref().unwrap_or("nothing calls for it");
        text.push_str(&wrapped(&format!("because {}", cause), 7));
        text.push_str(&wrapped(&row.how, 7));
    }
    text
}
