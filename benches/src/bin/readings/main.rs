//! What a simulated reading costs: values of the converter a second from the bare pipeline (a
//! Lambertian patch, a point beam, no noise), and what each effect adds to it.
//!
//! A value is taken at each of 64 poses in turn, in the thread's own processor time; the quickest of
//! many batches counts, since others on the machine only make it slower. An effect's cost is the time
//! with it less the time of the same rig without it, the two timed in turns. Mechanics are timed on the
//! board, which moves its axes to each pose. That a rig pays nothing for effects that are not in is
//! counted, not timed: instructions a value, under valgrind's callgrind.

mod cases;
mod instructions;
mod timed;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use benches::bars::{Bar, Bars};
use benches::{Arguments, Section, Table, Unmeasured, report};
use clap::Parser;
use sim::{Compiled, compile};

use cases::{Case, GROUPS, MECHANICS};

/// Readings a second, and what each effect costs.
#[derive(Debug, Parser)]
struct Asked {
    /// Draw the costs as SVG.
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,
    /// Take so many values of a rig and say nothing: for callgrind.
    #[arg(long, value_names = ["RIG", "COUNT"], num_args = 2, hide = true)]
    take: Vec<String>,
    #[command(flatten)]
    arguments: Arguments,
}

/// Values a second that the bare pipeline should reach.
const AIM_PER_S: f64 = 5e6;

fn main() -> ExitCode {
    let asked = Asked::parse();
    if let [rig, count] = asked.take.as_slice() {
        return instructions::take(rig, count);
    }
    report(&asked.arguments, || measure(asked.figure.as_deref()))
}

/// An effect, timed.
struct Cost {
    name: String,
    group: usize,
    with_ns: f64,
    less_ns: f64,
    how: String,
}

pub(crate) fn compiled(case: &Case) -> Result<Arc<Compiled>, Unmeasured> {
    let terms = cases::terms(case.effect);
    let (scene, nominal) = (case.scene.clone(), case.nominal.clone());
    Ok(Arc::new(compile(scene, nominal, case.simulated.clone(), &terms)?))
}

fn cost(case: &Case) -> Result<Cost, Unmeasured> {
    let Case { effect, note, group, .. } = *case;
    let with = compiled(case)?;
    let unmeasured = || Unmeasured::because(format!("{effect} is not in, or can't be left out"));
    let less = Arc::new(with.less(effect).ok_or_else(unmeasured)?);
    let row = with.effects().iter().find(|row| row.name == effect).ok_or_else(unmeasured)?;
    let [with_ns, less_ns] = if group == MECHANICS {
        timed::least_ns([&mut timed::moves(&with), &mut timed::moves(&less)])
    } else {
        timed::least_ns([&mut timed::values(&with), &mut timed::values(&less)])
    };
    let separator = if note.is_empty() { "" } else { ", " };
    let name = format!("{effect}{separator}{note}");
    Ok(Cost { name, group, with_ns, less_ns, how: row.how.replace(['|', '\n'], " ") })
}

fn measure(figure: Option<&Path>) -> Result<Section, Unmeasured> {
    let bare = compiled(&cases::bare()?)?;
    let [bare_ns, _] = timed::least_ns([&mut timed::values(&bare), &mut timed::values(&bare)]);
    let costs: Vec<Cost> = cases::all()?.iter().map(cost).collect::<Result<_, _>>()?;
    let mut section = Section::new("readings", "What a simulated reading costs");
    section.say(&format!(
        "The bare pipeline (a Lambertian patch, a point beam, no noise): {bare_ns:.1} ns a value of \
         the converter, {:.2} million a second on one core.",
        1e3 / bare_ns
    ));
    section.aim("5 million values a second on one core", 1e9 / bare_ns >= AIM_PER_S);
    section.say(
        "What each effect adds: the time of a value with it less that of the same rig without it. \
         Mechanics: of a move and one value after it.",
    );
    let mut shown = Table::new(&["effect", "without, ns", "with, ns", "it costs, ns"]);
    let mut raw = Table::new(&["effect", "without_ns", "with_ns", "cost_ns", "how"]);
    for Cost { name, with_ns, less_ns, how, .. } in &costs {
        let numbers = [*less_ns, *with_ns, with_ns - less_ns].map(|ns| format!("{ns:.1}"));
        let [less, with, cost] = numbers.clone();
        shown.row([name.clone(), less, with, cost]);
        let [less, with, cost] = numbers;
        raw.row([name.replace(',', ";"), less, with, cost, how.replace(',', ";")]);
    }
    section.show(&shown);
    instructions::compare(&mut section)?;
    if let Some(path) = figure {
        std::fs::write(path, chart(&costs, bare_ns).svg())?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        section.say(&format!("![What each effect costs](figures/{name})"));
    }
    section.keep(raw);
    Ok(section)
}

fn chart(costs: &[Cost], bare_ns: f64) -> Bars {
    let mut ordered: Vec<&Cost> = costs.iter().collect();
    ordered.sort_by(|a, b| {
        let cost = |cost: &Cost| cost.with_ns - cost.less_ns;
        a.group.cmp(&b.group).then(cost(b).total_cmp(&cost(a)))
    });
    let bar = |cost: &&Cost| {
        let value = cost.with_ns - cost.less_ns;
        let label = match value {
            ns if ns < 1.0 => "below 1 ns".to_owned(),
            ns if ns < 1e3 => format!("{ns:.0} ns"),
            ns if ns < 1e6 => format!("{:.1} µs", ns / 1e3),
            ns => format!("{:.1} ms", ns / 1e6),
        };
        Bar { name: cost.name.clone(), value, label, group: cost.group }
    };
    Bars {
        title: format!("What each effect adds to a simulated value (bare: {bare_ns:.0} ns)"),
        axis: "processor time a value, ns".into(),
        floor: 1.0,
        groups: GROUPS.map(str::to_owned).to_vec(),
        bars: ordered.iter().map(bar).collect(),
    }
}
