//! plan.toml, read: every key of it, with its bounds.
//!
//! Lengths are millimetres and angles degrees in the file; metres and radians from here on.
//! Whether the rig can do it is asked later, when the sequence is laid out.

use std::time::Duration;

use fit::Outline;
use radiometry::direction::wrap_deg;
use spanned_toml::{Bounds, Document, Problem, Table};

use super::fitting::read_fit;
use super::{
    Adaptive, Allocation, Dark, DarkMethod, Expect, Order, Plan, Reference, Region, Schedule, Stop,
    TARGETS_MAX, Wanted, WarmUp,
};
use crate::rig::Pose;

/// A sample is smaller than this from its origin.
const PLACE_MAX_MM: f64 = 10_000.0;
const PLACE_MM: Bounds = Bounds::between(-PLACE_MAX_MM, PLACE_MAX_MM);
/// A region's corner on the sample's outline is on the sample, whatever a division rounds to.
const INWARDS: f64 = 1.0 - 1e-12;
const THETA_DEG: Bounds = Bounds::between(0.0, 90.0);
/// An azimuth may be written in any turn that a person would write.
pub(super) const PHI_DEG: Bounds = Bounds::between(-720.0, 720.0);
const STEP_DEG: Bounds = Bounds::between(0.001, 360.0);
/// The wire's dwell is a 32-bit count of microseconds; an hour is well inside.
const DWELL_MS: Bounds = Bounds::between(0.01, 3_600_000.0);
const SPEED_DEG_PER_S: Bounds = Bounds::positive_up_to(1e5);
const SECONDS: Bounds = Bounds::positive_up_to(1e7);
/// Relative tolerances, not percentages.
const RELATIVE: Bounds = Bounds::positive_up_to(1.0);
/// Steps that miss a whole turn by less than this much of it go round.
const WHOLE_SLACK: f64 = 1e-9;
const NAME_BYTES_MAX: usize = 100;
const COUNT_MAX: i64 = TARGETS_MAX as i64;
/// Nodes of a quadrature rule along one coordinate: more are a grid.
const NODES_MAX: i64 = 256;
const REPEAT_MAX: i64 = 1_000;
/// Targets between dark readings, and between reference readings, where the plan does not say.
const DARK_EVERY: u32 = 200;
const REFERENCE_EVERY: u32 = 100;
/// The same for both within a round of an adaptive schedule.
const ROUND_EVERY: u32 = 2_000;
/// A dark and a reference reading integrate this many times as long as a target, where the plan
/// does not say: their noise enters many targets.
const DARK_DWELLS: u32 = 4;
const REFERENCE_DWELLS: u32 = 2;

impl Plan {
    /// Reads a plan file.
    ///
    /// At the top: `name`, what to call its runs · `rig`, a rig file beside the plan or
    /// `"simulated"` · `scene`, a scene file beside the plan. Then the tables `[region]`,
    /// `[schedule]`, `[dwell]`, `[dark]`, `[fit]`, and if wanted `[sample]`, `[reference]`,
    /// `[warm_up]`, `[stop]` and `[expect]`, and any number of `[[derive]]`.
    pub fn read(document: Document) -> Result<Self, Problem> {
        let root = document.root();
        let text = |key: &str| root.text(key).map(|text| text.map(str::to_owned));
        let (name, rig, scene) = (read_name(&root)?, text("rig")?, text("scene")?);
        let region = read_region(root.required_table("region")?)?;
        let sample = root.table("sample")?.map(|table| read_sample(table, &region)).transpose()?;
        let expect = root.table("expect")?.map(Expect::read).transpose()?.unwrap_or_default();
        let (schedule, order, repeat, window) =
            read_schedule(root.required_table("schedule")?, &expect)?;
        let is_flown = is_flown(&schedule);
        let (dwell, allocation, gain) = read_dwell(root.required_table("dwell")?, is_flown)?;
        let dwell = window.unwrap_or(dwell);
        // Rounds close with both whatever comes between: a sweep alone has a hundred windows.
        let is_adaptive = matches!(schedule, Schedule::Adaptive(_));
        let every =
            if is_adaptive { (ROUND_EVERY, ROUND_EVERY) } else { (DARK_EVERY, REFERENCE_EVERY) };
        let dark = read_dark(root.required_table("dark")?, dwell, every.0)?;
        let reference = read_reference(root.table("reference")?, &region, dwell, every.1)?;
        let warm_up = root.table("warm_up")?.map(read_warm_up).transpose()?;
        let stop = root.table("stop")?.map(read_stop).transpose()?.unwrap_or_default();
        if let Schedule::Adaptive(_) = schedule {
            Adaptive::check_stop(&root, &stop)?;
        }
        let fit = root.table("fit")?.map(read_fit).transpose()?.unwrap_or_default();
        let derive = Wanted::read_all(&root, false)?;
        root.finish()?;
        Ok(Self {
            name,
            rig,
            scene,
            region,
            sample,
            schedule,
            order,
            repeat,
            dwell,
            allocation,
            gain,
            dark,
            reference,
            warm_up,
            stop,
            expect,
            fit,
            derive,
            document,
        })
    }
}

/// A run's folder is named after the plan, so the name is one that a folder can have.
fn read_name(root: &Table<'_>) -> Result<Option<String>, Problem> {
    let Some(name) = root.text("name")? else { return Ok(None) };
    let is_plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
    if name.chars().all(is_plain) && !name.starts_with('.') && name.len() <= NAME_BYTES_MAX {
        return Ok(Some(name.to_owned()));
    }
    Err(root.problem(
        "name",
        &format!("\"{name}\" can't name a folder"),
        &format!(
            "at most {NAME_BYTES_MAX} letters, digits, spaces, '-', '_' and '.', no '.' first"
        ),
        "runs are kept in folders named after the plan",
    ))
}

/// `[region]`: `x_mm`, `y_mm` = [low, high] on the sample; `theta_max_deg` from the normal, at
/// most 90. All azimuths belong to it.
fn read_region(table: Table<'_>) -> Result<Region, Problem> {
    let interval = |key: &str| {
        let (low, high) = table.required_interval(key, PLACE_MM)?;
        Ok((low / 1e3, high / 1e3))
    };
    let region = Region {
        x_m: interval("x_mm")?,
        y_m: interval("y_mm")?,
        theta_max_rad: table
            .required_number("theta_max_deg", Bounds::positive_up_to(90.0))?
            .to_radians(),
    };
    table.finish()?;
    Ok(region)
}

/// `[sample]`: where the sample ends, as scenes say it: `x_mm` and `y_mm` = [low, high], or
/// `radius_mm` with `centre_mm` = [x, y] (default: the origin). Its radiance is zero beyond. The
/// region lies on it.
fn read_sample(table: Table<'_>, region: &Region) -> Result<Outline, Problem> {
    let metres = |(low, high): (f64, f64)| (low / 1e3, high / 1e3);
    let x = table.interval("x_mm", PLACE_MM)?.map(metres);
    let y = table.interval("y_mm", PLACE_MM)?.map(metres);
    let radius = table.number("radius_mm", Bounds::positive_up_to(PLACE_MAX_MM))?;
    let centre = table.numbers("centre_mm", PLACE_MM, 2..=2)?;
    let keys = "x_mm with y_mm; or radius_mm, with centre_mm if it is not at the origin";
    let wrong = |key: &str, what: &str| {
        Err(table.problem(key, what, keys, "state one outline; without [sample] none is assumed"))
    };
    let outline = match (x, y, radius, &centre) {
        (Some(x_m), Some(y_m), None, None) => Outline::Rectangle { x_m, y_m },
        (None, None, Some(radius), centre) => {
            let centre = centre.as_deref().unwrap_or(&[0.0, 0.0]);
            let centre_m = (centre[0] / 1e3, centre[1] / 1e3);
            Outline::Disk { centre_m, radius_m: radius / 1e3 }
        }
        (None, None, None, Some(_)) => return wrong("centre_mm", "a centre without a radius"),
        (None, None, None, None) => return wrong("x_mm", "it has no outline"),
        (Some(_), None, None, _) => return wrong("x_mm", "y_mm is missing beside it"),
        (None, Some(_), None, _) => return wrong("y_mm", "x_mm is missing beside it"),
        (Some(_), Some(_), None, Some(_)) => {
            return wrong("centre_mm", "a rectangle is given by its sides");
        }
        (_, _, Some(_), _) => return wrong("radius_mm", "a disk and a rectangle at once"),
    };
    let (x, y) = (region.x_m, region.y_m);
    let corners = [(x.0, y.0), (x.0, y.1), (x.1, y.0), (x.1, y.1)];
    let inwards = |(x, y): (f64, f64)| (x * INWARDS, y * INWARDS);
    if !corners.into_iter().map(inwards).all(|(x, y)| outline.holds(x, y)) {
        let key = if radius.is_some() { "radius_mm" } else { "x_mm" };
        return Err(table.problem(
            key,
            "the region reaches beyond the sample",
            "a sample that holds the region's corners",
            "lower the region: what is fitted there would be darkness",
        ));
    }
    table.finish()?;
    Ok(outline)
}

/// `[schedule]`: `kind`, and after it
/// raster: `x_count`, `y_count`, `theta_step_deg`, `phi_step_deg` ·
/// cgamma: `x_count`, `y_count`, `c_step_deg`, `gamma_step_deg` ·
/// low-discrepancy: `count` · list: `file` ·
/// quadrature: `x_count`, `y_count`, `theta_count`, `phi_count` ·
/// sweep: `x_count`, `y_count`, `phi_step_deg`; `narrowest_feature_deg`, the full width at half
/// maximum of the narrowest feature that is looked for (default: `[expect]`'s), or
/// `speed_deg_per_s`; `window_ms` (default: `dwell.dwell_ms`); `interleaved`, whether each meridian
/// is flown at one of the places alone (default false). Sweeps have their own order ·
/// spiral: the same with `theta_step_deg`, between turns, in the place of `phi_step_deg`, and without a speed:
/// each turn has its own ·
/// adaptive: see [`Adaptive::read`].
/// Then `order` travel (default; listed for a list) or listed, and `repeat` (default 1).
fn read_schedule(
    table: Table<'_>,
    expect: &Expect,
) -> Result<(Schedule, Order, u32, Option<Duration>), Problem> {
    #[derive(Clone, Copy)]
    enum Kind {
        Adaptive,
        CGamma,
        List,
        LowDiscrepancy,
        Quadrature,
        Raster,
        Spiral,
        Sweep,
    }
    let words = [
        ("raster", Kind::Raster),
        ("cgamma", Kind::CGamma),
        ("low-discrepancy", Kind::LowDiscrepancy),
        ("quadrature", Kind::Quadrature),
        ("list", Kind::List),
        ("sweep", Kind::Sweep),
        ("spiral", Kind::Spiral),
        ("adaptive", Kind::Adaptive),
    ];
    let count = |key: &str| read_count(&table, key, COUNT_MAX);
    let step = |key: &str| table.required_number(key, STEP_DEG);
    let schedule = match table.required_choice("kind", &words)? {
        Kind::Raster => Schedule::Raster {
            x_count: count("x_count")?,
            y_count: count("y_count")?,
            theta_step_deg: step("theta_step_deg")?,
            phi_step_deg: read_turn_step(&table, "phi_step_deg")?,
        },
        Kind::CGamma => Schedule::CGamma {
            x_count: count("x_count")?,
            y_count: count("y_count")?,
            c_step_deg: read_turn_step(&table, "c_step_deg")?,
            gamma_step_deg: step("gamma_step_deg")?,
        },
        Kind::LowDiscrepancy => Schedule::LowDiscrepancy { count: count("count")? },
        Kind::Quadrature => Schedule::Quadrature {
            x_count: read_count(&table, "x_count", NODES_MAX)?,
            y_count: read_count(&table, "y_count", NODES_MAX)?,
            theta_count: read_count(&table, "theta_count", NODES_MAX)?,
            phi_count: count("phi_count")?,
        },
        Kind::List => Schedule::List { file: table.required_text("file")?.to_owned() },
        Kind::Sweep => read_sweep(&table, expect)?,
        Kind::Spiral => read_spiral(&table, expect)?,
        Kind::Adaptive => Schedule::Adaptive(Adaptive::read(&table, expect)?),
    };
    if is_flown(&schedule) {
        let window = table.number("window_ms", DWELL_MS)?.map(millis);
        let repeat = match schedule {
            Schedule::Adaptive(_) => 1,
            _ => table.integer("repeat", 1..=REPEAT_MAX)?.map_or(1, whole),
        };
        table.finish()?;
        return Ok((schedule, Order::Listed, repeat, window));
    }
    let orders = [("travel", Order::Travel), ("listed", Order::Listed)];
    let order = table.choice("order", &orders)?.unwrap_or(Order::Travel);
    let repeat = table.integer("repeat", 1..=REPEAT_MAX)?.map_or(1, whole);
    table.finish()?;
    Ok((schedule, order, repeat, None))
}

/// Whether readings are taken in flight.
fn is_flown(schedule: &Schedule) -> bool {
    matches!(schedule, Schedule::Adaptive(_) | Schedule::Spiral { .. } | Schedule::Sweep { .. })
}

fn read_spiral(table: &Table<'_>, expect: &Expect) -> Result<Schedule, Problem> {
    let expected_deg = expect.narrowest_feature_rad.map(f64::to_degrees);
    let narrowest_feature_deg = table.number("narrowest_feature_deg", STEP_DEG)?.or(expected_deg);
    Ok(Schedule::Spiral {
        x_count: read_count(table, "x_count", COUNT_MAX)?,
        y_count: read_count(table, "y_count", COUNT_MAX)?,
        theta_step_deg: table.required_number("theta_step_deg", STEP_DEG)?,
        is_interleaved: table.flag("interleaved")?.unwrap_or(false),
        narrowest_feature_deg: narrowest_feature_deg.ok_or_else(|| {
            table.problem(
                "narrowest_feature_deg",
                "nothing says how fast to turn",
                "the full width at half maximum of the narrowest feature that is looked for",
                "state narrowest_feature_deg, here or in [expect]: the speed follows from it and the beam",
            )
        })?,
    })
}

fn read_sweep(table: &Table<'_>, expect: &Expect) -> Result<Schedule, Problem> {
    let speed_deg_per_s = table.number("speed_deg_per_s", SPEED_DEG_PER_S)?;
    let expected_deg = expect.narrowest_feature_rad.map(f64::to_degrees);
    // Who states a speed has it.
    let expected_deg = expected_deg.filter(|_| speed_deg_per_s.is_none());
    let schedule = Schedule::Sweep {
        x_count: read_count(table, "x_count", COUNT_MAX)?,
        y_count: read_count(table, "y_count", COUNT_MAX)?,
        phi_step_deg: read_turn_step(table, "phi_step_deg")?,
        is_interleaved: table.flag("interleaved")?.unwrap_or(false),
        speed_deg_per_s,
        narrowest_feature_deg: table.number("narrowest_feature_deg", STEP_DEG)?.or(expected_deg),
    };
    if let Schedule::Sweep { speed_deg_per_s: None, narrowest_feature_deg: None, .. } = schedule {
        return Err(table.problem(
            "narrowest_feature_deg",
            "nothing says how fast to sweep",
            "narrowest_feature_deg, the full width at half maximum of the narrowest feature that is looked \
             for, or speed_deg_per_s",
            "state narrowest_feature_deg, here or in [expect]: the speed follows from it and the beam",
        ));
    }
    Ok(schedule)
}

/// A step that goes round a whole number of times, so that the last gap equals the others.
pub(super) fn read_turn_step(table: &Table<'_>, key: &str) -> Result<f64, Problem> {
    let step = table.required_number(key, STEP_DEG)?;
    let steps = 360.0 / step;
    if (steps - libm::round(steps)).abs() <= WHOLE_SLACK * steps {
        return Ok(step);
    }
    let (fine, coarse) = (360.0 / libm::ceil(steps), 360.0 / libm::floor(steps));
    Err(table.problem(
        key,
        &format!("360° is not a whole number of steps of {step}°"),
        "a step that divides 360",
        &format!("try {fine} or {coarse}"),
    ))
}

/// `[dwell]`: `dwell_ms`; `gain`, a gain range's name (default: the rig's first), or "expected"
/// for the one that suits the level in `[expect]`; `allocation`, how the dwells of targets at rest
/// differ, `dwell_ms` their mean: "even" (default), "total" or "each", see [`Allocation`].
fn read_dwell(
    table: Table<'_>,
    is_flown: bool,
) -> Result<(Duration, Allocation, Option<String>), Problem> {
    let dwell = millis(table.required_number("dwell_ms", DWELL_MS)?);
    let allocation = table.choice("allocation", &Allocation::WORDS)?.unwrap_or_default();
    if is_flown && allocation != Allocation::Even {
        return Err(table.problem(
            "allocation",
            "windows of a sweep follow one another at its speed",
            "targets at rest",
            "leave the key out; where readings decide, sweeps are as slow as their noise asks",
        ));
    }
    let gain = table.text("gain")?.map(str::to_owned);
    table.finish()?;
    Ok((dwell, allocation, gain))
}

/// `[dark]`: `method` shutter or source-off (which asks a person); `every` so many targets
/// (default 200, of an adaptive schedule 2000); `dwell_ms` (default four times a target's).
fn read_dark(table: Table<'_>, dwell: Duration, every: u32) -> Result<Dark, Problem> {
    let words = [("shutter", DarkMethod::Shutter), ("source-off", DarkMethod::SourceOff)];
    let dark = Dark {
        every: table.integer("every", 1..=COUNT_MAX)?.map_or(every, whole),
        dwell: table.number("dwell_ms", DWELL_MS)?.map_or(dwell * DARK_DWELLS, millis),
        method: table.required_choice("method", &words)?,
    };
    table.finish()?;
    Ok(dark)
}

/// `[reference]`: `x_mm`, `y_mm` (default: the region's middle), `theta_deg`, `phi_deg` (default
/// 0); `every` so many targets (default 100, of an adaptive schedule 2000); `dwell_ms` (default twice a target's).
fn read_reference(
    table: Option<Table<'_>>,
    region: &Region,
    dwell: Duration,
    every: u32,
) -> Result<Reference, Problem> {
    let mut reference = Reference {
        pose: Pose {
            x_m: 0.5 * (region.x_m.0 + region.x_m.1),
            y_m: 0.5 * (region.y_m.0 + region.y_m.1),
            theta_rad: 0.0,
            phi_rad: 0.0,
        },
        every,
        dwell: dwell * REFERENCE_DWELLS,
    };
    let Some(table) = table else { return Ok(reference) };
    let pose = &mut reference.pose;
    if let Some(x_mm) = table.number("x_mm", PLACE_MM)? {
        pose.x_m = x_mm / 1e3;
    }
    if let Some(y_mm) = table.number("y_mm", PLACE_MM)? {
        pose.y_m = y_mm / 1e3;
    }
    pose.theta_rad = table.number("theta_deg", THETA_DEG)?.unwrap_or(0.0).to_radians();
    pose.phi_rad = wrap_deg(table.number("phi_deg", PHI_DEG)?.unwrap_or(0.0)).to_radians();
    if let Some(every) = table.integer("every", 1..=COUNT_MAX)? {
        reference.every = whole(every);
    }
    if let Some(dwell_ms) = table.number("dwell_ms", DWELL_MS)? {
        reference.dwell = millis(dwell_ms);
    }
    table.finish()?;
    Ok(reference)
}

/// `[warm_up]`: reference readings until they stay within `tolerance_relative` (highest less
/// lowest over their mean) for `over_s`; given up after `timeout_s`. They are compared as counts,
/// before any dark level is known: the dark current is part of their mean, and their noise part
/// of the spread.
fn read_warm_up(table: Table<'_>) -> Result<WarmUp, Problem> {
    let seconds = |key: &str| table.required_number(key, SECONDS).map(Duration::from_secs_f64);
    let warm_up = WarmUp {
        tolerance_relative: table.required_number("tolerance_relative", RELATIVE)?,
        over: seconds("over_s")?,
        timeout: seconds("timeout_s")?,
    };
    if warm_up.timeout < warm_up.over {
        return Err(table.problem(
            "timeout_s",
            "it ends before the readings can have been stable for over_s",
            "a timeout_s of at least over_s",
            "raise timeout_s, or lower over_s",
        ));
    }
    table.finish()?;
    Ok(warm_up)
}

/// `[stop]`: rules that end the run before its last target. Either way the last dark and reference
/// readings are still taken.
///
/// `exitance_relative`: once the exitance's combined standard uncertainty (k = 1), what all
/// readings share included, is at most this part of it, by a fit of what there is. It is looked at
/// from two targets a coefficient of the fit on, and again whenever there are a tenth more. A run
/// that ends without it has missed its accuracy target. What was measured by then should cover
/// the region: a low-discrepancy schedule as listed, or repeats, rather than one round of a grid.
///
/// `rig_time_s_max`: so that the run ends within this rig time, homing and warming up included;
/// time at a standstill, paused or faulted, doesn't count.
fn read_stop(table: Table<'_>) -> Result<Stop, Problem> {
    let stop = Stop {
        exitance_relative: table.number("exitance_relative", RELATIVE)?,
        rig_time_max: table.number("rig_time_s_max", SECONDS)?.map(Duration::from_secs_f64),
    };
    table.finish()?;
    Ok(stop)
}

pub(super) fn read_count(table: &Table<'_>, key: &str, most: i64) -> Result<u32, Problem> {
    table.required_integer(key, 1..=most).map(whole)
}

/// An integer that its bounds keep inside u32.
fn whole(integer: i64) -> u32 {
    u32::try_from(integer).unwrap_or(u32::MAX)
}

/// To whole microseconds, as they go over the wire.
fn millis(ms: f64) -> Duration {
    let exact = Duration::from_secs_f64(ms / 1e3);
    Duration::new(exact.as_secs(), (exact.subsec_nanos() + 500) / 1_000 * 1_000)
}
