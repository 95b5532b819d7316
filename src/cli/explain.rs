//! `gonio explain`: which effects a scene calls for, why, what they amount to, and what each
//! costs.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use firmware_protocol::{Board as _, Illumination, Instant as Tick, Shutter};
use serde_json::json;

use super::args::ExplainArgs;
use super::failure::{Failure, Outcome};
use super::inputs::{BUILT_IN, Inputs, beside};
use super::output::{say, say_json};
use super::setup::{Stage, lay_out, rig_at, stage_at, terms_of};
use super::text::{table, wrapped};
use crate::journal::InputRole;
use crate::plan::Plan;
use crate::rig::Rig;

/// The seed matters to the drawn values alone, not to which effects there are.
const SEED: u64 = 1;
/// Readings that are timed at a time, each at a pose of its own.
const READINGS: u32 = 48;
/// Longer than any axis takes to come to rest.
const REST: Duration = Duration::from_mins(1);
/// The quickest of so many times is the one that nothing disturbed.
const ROUNDS: usize = 7;

/// Compiles the scene and prints one row an effect.
pub(crate) fn explain(args: &ExplainArgs) -> Outcome {
    let mut inputs = Inputs::from_disk();
    let plan = match &args.plan {
        None => None,
        Some(path) => Some((Plan::read(inputs.document(InputRole::Plan, path)?)?, path)),
    };
    let of_plan = plan.as_ref().and_then(|(plan, path)| {
        plan.rig.as_deref().filter(|name| *name != BUILT_IN).map(|name| beside(path, name))
    });
    let path: PathBuf = args.rig.clone().or(of_plan).unwrap_or_else(|| BUILT_IN.into());
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
    let wishes = args.effects.wishes();
    let terms = match &plan {
        None => args.effects.terms(SEED),
        Some((plan, path)) => {
            let (_, sequence) = lay_out(&mut inputs, path, plan, &rig)?;
            terms_of(&rig, plan, &sequence, SEED, &wishes)
        }
    };
    let stage = stage_at(&mut inputs, &args.scene, &rig, &terms)?;
    let rows = with_costs(&stage, &rig, &terms);
    let notes = stage.compiled.scene().notes();
    if args.json {
        say_json(&json!({
            "rig": rig.name,
            "tolerance": stage.compiled.tolerance(),
            "region": region_json(stage.compiled.region()),
            "dwell_s": terms.dwell_s,
            "run_s": terms.run_s,
            "effects": rows.iter().map(as_json).collect::<Vec<_>>(),
            "notes": notes,
        }))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut text = effects_text(&rows);
    text.push_str(&terms_text(&stage, &terms));
    for note in notes {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  note: {note}");
    }
    say(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// The rows, each effect that can be left out with what it costs a reading: the time with it, less
/// the time without.
fn with_costs(stage: &Stage, rig: &Rig, terms: &sim::Terms) -> Vec<sim::EffectRow> {
    const BEAM: &str = "finite-beam";
    let mut rows = stage.compiled.effects().to_vec();
    // The beam may cost more than all else together: the others are timed without it, so that
    // they show.
    let base = stage.compiled.less(BEAM).map_or_else(|| Arc::clone(&stage.compiled), Arc::new);
    for row in rows.iter_mut().filter(|row| row.included && row.can_be_left_out) {
        let (with, less) = if row.name == BEAM {
            (&stage.compiled, Some(Arc::clone(&base)))
        } else {
            (&base, base.less(&row.name).map(Arc::new))
        };
        row.cost_ns = less.map(|less| difference_ns([with, &less], rig, terms.dwell_s).max(0.0));
    }
    rows
}

/// What a reading costs one board more than another, nanoseconds; timed in turns, so that what
/// disturbs the one disturbs the other.
fn difference_ns(pair: [&Arc<sim::Compiled>; 2], rig: &Rig, dwell_s: f64) -> f64 {
    let mut timed = pair.map(|compiled| Timed::new(compiled, rig, dwell_s));
    let mut quickest = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        for (timed, quickest) in timed.iter_mut().zip(&mut quickest) {
            *quickest = quickest.min(timed.reading_ns());
        }
    }
    quickest[0] - quickest[1]
}

/// A board that takes readings at poses all over its region.
struct Timed {
    board: sim::SimulatedBoard,
    poses: Vec<[(u8, i32); 4]>,
    values: u32,
    now: Tick,
}

impl Timed {
    fn new(compiled: &Arc<sim::Compiled>, rig: &Rig, dwell_s: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let values = (dwell_s * f64::from(rig.detector.adc.rate_hz)).max(1.0) as u32;
        let mut board = sim::SimulatedBoard::new(Arc::clone(compiled), 0);
        for channel in 0..4 {
            home(&mut board, Tick::ZERO, channel);
        }
        Self { board, poses: poses(compiled.region(), rig), values, now: Tick::ZERO }
    }

    /// The mean time of a reading.
    fn reading_ns(&mut self) -> f64 {
        let Self { board, poses, values, now } = self;
        let began = Instant::now();
        for (reading, pose) in (0..).zip(poses.iter()) {
            for (channel, counts) in pose {
                board.set_setpoint(*now, *channel, f64::from(*counts));
            }
            *now = *now + REST;
            let illumination = Illumination { reading, gain: 0, shutter: Shutter::Open };
            board.prepare_dwell(*now, illumination);
            board.begin_dwell(*now, illumination);
            for _ in 0..*values {
                // A fault of the detector would show in the run; here it costs what it costs.
                let _ = black_box(board.convert(*now));
            }
        }
        began.elapsed().as_secs_f64() * 1e9 / f64::from(READINGS)
    }
}

/// As the device core homes an axis: past its mark, and back to it.
fn home(board: &mut sim::SimulatedBoard, now: Tick, channel: u8) {
    let travel = board.axes().get(usize::from(channel)).map(|axis| (axis.low, axis.high));
    let Some((low, high)) = travel else { return };
    let span = f64::from(high) - f64::from(low);
    board.begin_search(now, channel);
    board.set_setpoint(now, channel, -span);
    board.set_setpoint(now, channel, span);
    if let Some(mark) = board.home_mark(now, channel) {
        board.set_setpoint(now, channel, mark);
        board.set_home(now, channel);
    }
}

/// Setpoints by channel, that fill the region evenly.
fn poses(region: &sim::Region, rig: &Rig) -> Vec<[(u8, i32); 4]> {
    let between = |(low, high): (f64, f64), part: f64| low + (high - low) * part;
    let pose = |i: u32| {
        // Irrational steps, one an axis.
        let part = |step: f64| (f64::from(i) * step).fract();
        let positions = [
            region.theta_max_rad * part(0.819_172_5),
            std::f64::consts::PI * (2.0 * part(0.671_043_6) - 1.0),
            between(region.x_m, part(0.549_700_5)),
            between(region.y_m, part(0.450_299_5)),
        ];
        let axes = rig.axes.iter().zip(positions);
        let mut setpoints = axes.map(|(axis, position)| (axis.channel, axis.counts(position)));
        std::array::from_fn(|_| setpoints.next().unwrap_or_default())
    };
    (1..=READINGS).map(pose).collect()
}

fn as_json(row: &sim::EffectRow) -> serde_json::Value {
    json!({
        "effect": row.name,
        "included": row.included,
        "called_for_by": row.cause,
        "bound": row.bound.map(|bound| json!({"value": bound.value, "unit": bound.unit.symbol()})),
        "error": row.error,
        "cost_ns": row.cost_ns,
        "how": row.how,
    })
}

fn region_json(region: &sim::Region) -> serde_json::Value {
    let mm = |(low, high): (f64, f64)| [low * 1e3, high * 1e3];
    json!({
        "x_mm": mm(region.x_m), "y_mm": mm(region.y_m),
        "theta_max_deg": region.theta_max_rad.to_degrees(),
    })
}

/// Two paragraphs an effect: whether it is in, what it amounts to and costs, and what calls for
/// it; and how it is done.
fn effects_text(effects: &[sim::EffectRow]) -> String {
    let rows: Vec<_> = effects
        .iter()
        .map(|row| {
            let bound = row.bound.map_or_else(
                || "-".to_owned(),
                |bound| format!("{:.2e} {}", bound.value, bound.unit.symbol()),
            );
            let mark = if row.included { "in" } else { "out" };
            let cost = row.cost_ns.map_or_else(String::new, |ns| format!("{:.2} µs", ns / 1e3));
            vec![mark.to_owned(), row.name.clone(), bound, cost]
        })
        .collect();
    let mut text = String::new();
    for (line, row) in table(&rows).lines().zip(effects) {
        let _ = writeln!(text, "{}", line.trim_end());
        if let Some(cause) = &row.cause {
            text.push_str(&wrapped(&format!("because {cause}"), 7));
        }
        text.push_str(&wrapped(&row.how, 7));
    }
    text
}

/// By what the effects were weighed.
fn terms_text(stage: &Stage, terms: &sim::Terms) -> String {
    let region = stage.compiled.region();
    let mm = |(low, high): (f64, f64)| format!("{:.1} to {:.1} mm", low * 1e3, high * 1e3);
    let text = format!(
        "weighed over x {}, y {}, θ to {:.1}°, dwells of {:.0} ms, {:.0} s of run; what is left \
         out may change a reading by {:.1e} of it; costs are a reading's, all its ADC values \
         together, on this machine",
        mm(region.x_m),
        mm(region.y_m),
        region.theta_max_rad.to_degrees(),
        terms.dwell_s * 1e3,
        terms.run_s,
        stage.compiled.tolerance(),
    );
    wrapped(&text, 2)
}
