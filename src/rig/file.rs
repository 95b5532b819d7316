//! rig.toml, read: every key of it but those of `[simulated]`, which is for whoever simulates
//! the rig, and every limit checked.
//!
//! Lengths are millimetres and angles degrees in the file; metres and radians from here on.

use std::collections::HashSet;
use std::time::Duration;

use radiometry::quantity::Throughput;
use radiometry::throughput::CoaxialDisks;
use spanned_toml::{Bounds, Document, Problem, Source, Table};

use super::alignment::Alignment;
use super::axis::{Approach, Axis, Readback};
use super::detector::{Adc, Detector, Gain, Quantity};
use super::{AXES, AxisName, Devices, Link, PhotometerDriver, Rig};

/// The rig behind `rig = "simulated"`.
const BUILT_IN: &str = include_str!("simulated.toml");

/// Channels are as many as there are axes, so that a move names them all.
const CHANNEL_MAX: i64 = 3;
const TRAVEL_MM_MAX: f64 = 10_000.0;
/// Of an axis that nobody counts: a position within half a micrometre or microradian of where it
/// stands is that one.
const FIXED_COUNTS_PER_UNIT: f64 = 1e6;
/// The faster of the world's power lines.
const LINE_HZ_MAX: f64 = 60.0;
const SETTLE_MS_MAX: f64 = 60_000.0;
/// Gain ranges that a device can number.
const GAINS_MAX: usize = 64;
const RATE_HZ_MAX: i64 = 10_000_000;
/// A relative standard uncertainty of 1 means that nothing is known.
const RELATIVE: Bounds = Bounds::between(0.0, 1.0);
/// What is farther off, or leans more, is no uncertainty but a rig to be put right.
const OFFSET_MM_MAX: f64 = 100.0;
const LEAN_DEG_MAX: f64 = 10.0;
/// The factor of a spectral mismatch: a number in per cent, or its distance from 1, is none.
const MISMATCH: Bounds = Bounds::between(0.1, 10.0);
/// Run-up of a one-sided axis, in the file's unit, where the file does not say.
const RUN_UP_DEFAULT: f64 = 0.5;

impl Rig {
    /// Reads a rig file.
    pub fn read(document: Document) -> Result<Self, Problem> {
        let root = document.root();
        let name = root.required_text("name")?.to_owned();
        let axes_table = root.required_table("axes")?;
        let axes = read_axes(&axes_table)?;
        let alignment = root.table("alignment")?.map(read_alignment).transpose()?;
        let alignment = alignment.unwrap_or_default();
        let detector = read_detector(root.required_table("detector")?)?;
        let link = Link::read(root.required_table("link")?)?;
        let is_simulated = matches!(link, Link::Simulated { .. });
        let devices = Devices::read(&root, !is_simulated, detector.gains.len())?;
        check_devices(&root, &link, devices.as_ref(), &axes)?;
        check_rate(&root, devices.as_ref(), detector.adc)?;
        if is_simulated {
            root.leave("simulated");
        } else if root.has("simulated") {
            return Err(root.problem(
                "simulated",
                "a table for simulated rigs in the file of a real one",
                "no such table unless link.kind is \"simulated\"",
                "remove it, or set link.kind to \"simulated\"",
            ));
        }
        root.finish()?;
        Ok(Self { name, axes, alignment, detector, link, devices, document })
    }

    /// The built-in simulated rig, which `rig = "simulated"` names.
    pub fn built_in() -> Result<Self, Problem> {
        Self::read(Document::parse(Source::new("the built-in rig", BUILT_IN))?)
    }
}

/// Devices and the word for them go together, and each axis that is not fixed is moved by one.
fn check_devices(
    root: &Table<'_>,
    link: &Link,
    devices: Option<&Devices>,
    axes: &[Axis; 4],
) -> Result<(), Problem> {
    let Some(devices) = devices else {
        if let Some(axis) = axes.iter().find(|axis| axis.fixed.is_some()) {
            let name = axis.name.name();
            return Err(root.required_table("axes")?.problem(
                name,
                &format!("{name} is fixed, on a rig with one controller"),
                "a fixed axis only where [[axes_link]] says who moves the others",
                "describe how the controller moves it, or the devices that move the others",
            ));
        }
        return match link {
            Link::Devices => Err(root.missing(
                "axes_link",
                "[[axes_link]] and [photometer] where link.kind is \"devices\"",
            )),
            _ => Ok(()),
        };
    };
    if matches!(link, Link::Serial { .. }) {
        return Err(root.problem(
            "link",
            "[[axes_link]] in the file of a rig with one controller",
            "link.kind = \"devices\" or \"simulated\" beside [[axes_link]]",
            "set link.kind to \"devices\", or remove [[axes_link]] and [photometer]",
        ));
    }
    let is_moved = |axis: &Axis| devices.place_of(axis.name).is_some();
    match axes.iter().find(|axis| is_moved(axis) == axis.fixed.is_some()) {
        None => Ok(()),
        Some(axis) if is_moved(axis) => Err(root.problem(
            "axes_link",
            &format!("a device moves {0}, which is fixed in [axes.{0}]", axis.name.name()),
            "an axis that is moved or fixed, not both",
            "remove it from the [[axes_link]], or describe how it moves in its table",
        )),
        Some(axis) => Err(root.problem(
            "axes_link",
            &format!("no device moves {}", axis.name.name()),
            "each of theta, phi, x and y in one [[axes_link]], or fixed",
            &format!(
                "say which device moves it, or where it stands: fixed_{} in [axes.{}]",
                axis.name.file_unit(),
                axis.name.name()
            ),
        )),
    }
}

/// A picoammeter gives no more readings a second than its integration leaves time for.
fn check_rate(root: &Table<'_>, devices: Option<&Devices>, adc: Adc) -> Result<(), Problem> {
    let Some(PhotometerDriver::Keithley(meter)) = devices.map(|devices| &devices.photometer.driver)
    else {
        return Ok(());
    };
    let cycles = meter.nplc * f64::from(meter.average);
    let most = LINE_HZ_MAX / cycles;
    if f64::from(adc.rate_hz) <= most * 1.001 {
        return Ok(());
    }
    Err(root.problem(
        "photometer",
        &format!("{} readings a second of {cycles} power line cycles each", adc.rate_hz),
        &format!("at most {most:.0} a second where the line has {LINE_HZ_MAX} Hz"),
        "lower rate_hz of [detector.adc], or nplc or average of [photometer]",
    ))
}

fn read_axes(table: &Table<'_>) -> Result<[Axis; 4], Problem> {
    let mut channels = HashSet::new();
    let mut read = |name: AxisName| {
        let axis_table = table.required_table(name.name())?;
        if axis_table.has(&format!("fixed_{}", name.file_unit())) {
            return read_fixed(name, axis_table);
        }
        let axis = read_axis(name, &axis_table)?;
        if !channels.insert(axis.channel) {
            return Err(axis_table.problem(
                "channel",
                &format!("channel {} is another axis's already", axis.channel),
                "a channel of its own for each axis, from 0 to 3",
                "give each axis the channel that it is wired to",
            ));
        }
        axis_table.finish()?;
        Ok(axis)
    };
    let [theta, phi, x, y] = AXES;
    let mut axes = [read(theta)?, read(phi)?, read(x)?, read(y)?];
    // What nobody moves takes the channels that are left.
    let mut left = (0_u8..).take(AXES.len()).filter(|channel| !channels.contains(channel));
    for axis in axes.iter_mut().filter(|axis| axis.fixed.is_some()) {
        axis.channel = left.next().unwrap_or_default();
    }
    Ok(axes)
}

/// The keys of an axis that nothing moves: `fixed_UNIT`, where it stands · `u_zero_UNIT`, how well
/// that is known.
fn read_fixed(name: AxisName, table: Table<'_>) -> Result<Axis, Problem> {
    let unit = name.file_unit();
    let si = |value: f64| if name.is_rotary() { value.to_radians() } else { value / 1e3 };
    let reach = reach(name);
    let at = si(table.required_number(&format!("fixed_{unit}"), Bounds::between(-reach, reach))?);
    let u_zero = si(table.required_number(&format!("u_zero_{unit}"), Bounds::NON_NEGATIVE)?);
    let moving = ["channel", "readback", "settle_ms"].map(str::to_owned);
    let moving = moving.into_iter().chain([format!("travel_{unit}"), format!("counts_per_{unit}")]);
    if let Some(key) = moving.into_iter().find(|key| table.has(key)) {
        return Err(table.problem(
            &key,
            "a key of axes that move, in the table of a fixed one",
            &format!("fixed_{unit} and u_zero_{unit} alone"),
            &format!("remove it, or remove fixed_{unit}"),
        ));
    }
    table.finish()?;
    Ok(Axis {
        name,
        channel: 0,
        fixed: Some(at),
        travel: (at, at),
        speed: 1.0,
        acceleration: 1.0,
        counts_per_unit: FIXED_COUNTS_PER_UNIT,
        settle: Duration::ZERO,
        approach: Approach::Either,
        run_up: 0.0,
        readback: Readback::None,
        u_zero,
        u_homing: 0.0,
        u_readback: 0.0,
    })
}

/// An axis's keys. `UNIT` is `deg` for theta and phi, `mm` for x and y.
///
/// `channel` 0 to 3 · `travel_UNIT = [low, high]`, both allowed, around the home mark at 0 ·
/// `speed_UNIT_per_s` · `acceleration_UNIT_per_s2` · `counts_per_UNIT` · `settle_ms`: rest before
/// it is still · `approach` positive, negative or either (default): the side from which targets
/// are reached, against backlash · `run_up_UNIT` (default 0.5): how far it goes past a target to
/// come back to it from that side · `readback` encoder, steps or none · `u_zero_UNIT`: of where 0
/// lies · `u_homing_UNIT`: of finding it again · `u_readback_UNIT`: of one position.
fn read_axis(name: AxisName, table: &Table<'_>) -> Result<Axis, Problem> {
    let unit = name.file_unit();
    let si = |value: f64| if name.is_rotary() { value.to_radians() } else { value / 1e3 };
    let positive = |key: &str| table.required_number(key, Bounds::POSITIVE);
    let uncertainty = |key: String| table.required_number(&key, Bounds::NON_NEGATIVE).map(si);

    let channel = table.required_integer("channel", 0..=CHANNEL_MAX)?;
    let travel = read_travel(name, table)?;
    let speed = positive(&format!("speed_{unit}_per_s"))?;
    let acceleration = positive(&format!("acceleration_{unit}_per_s2"))?;
    let counts_key = format!("counts_per_{unit}");
    let counts = positive(&counts_key)?;
    check_counts(table, &counts_key, counts, [travel.0, travel.1, speed, acceleration])?;
    let settle_ms = table.required_number("settle_ms", Bounds::between(0.0, SETTLE_MS_MAX))?;
    let (approach, run_up) = read_approach(table, &format!("run_up_{unit}"))?;
    let readback = table.required_choice(
        "readback",
        &[("encoder", Readback::Encoder), ("steps", Readback::Steps), ("none", Readback::None)],
    )?;
    Ok(Axis {
        name,
        channel: u8::try_from(channel).unwrap_or_default(),
        fixed: None,
        travel: (si(travel.0), si(travel.1)),
        speed: si(speed),
        acceleration: si(acceleration),
        counts_per_unit: counts / si(1.0),
        settle: Duration::from_secs_f64(settle_ms / 1e3),
        approach,
        run_up: si(run_up),
        readback,
        u_zero: uncertainty(format!("u_zero_{unit}"))?,
        u_homing: uncertainty(format!("u_homing_{unit}"))?,
        u_readback: uncertainty(format!("u_readback_{unit}"))?,
    })
}

/// How far from its zero an axis may stand, in the file's unit.
const fn reach(name: AxisName) -> f64 {
    match name {
        AxisName::Theta => 180.0,
        AxisName::Phi => 540.0,
        AxisName::X | AxisName::Y => TRAVEL_MM_MAX,
    }
}

fn read_travel(name: AxisName, table: &Table<'_>) -> Result<(f64, f64), Problem> {
    let key = format!("travel_{}", name.file_unit());
    let reach = reach(name);
    let travel = table.required_interval(&key, Bounds::between(-reach, reach))?;
    if travel.0 <= 0.0 && travel.1 >= 0.0 {
        return Ok(travel);
    }
    Err(table.problem(
        &key,
        &format!("0 lies outside {} to {}", travel.0, travel.1),
        "a travel around 0, where the home mark is",
        "count positions from the home mark",
    ))
}

/// Everything that goes over the wire in counts must fit it: positions as i32, speed and
/// acceleration as whole counts from 1.
fn check_counts(
    table: &Table<'_>,
    key: &str,
    counts_per_unit: f64,
    [low, high, speed, acceleration]: [f64; 4],
) -> Result<(), Problem> {
    let most = counts_per_unit * low.abs().max(high.abs()).max(speed).max(acceleration);
    let least = counts_per_unit * speed.min(acceleration);
    if most > f64::from(i32::MAX) {
        return Err(table.problem(
            key,
            &format!("travel, speed or acceleration makes {most:.0} counts"),
            &format!("at most {} counts", i32::MAX),
            "lower the counts, or check the unit of the travel",
        ));
    }
    if least < 1.0 {
        return Err(table.problem(
            key,
            &format!("speed or acceleration makes {least} counts a second"),
            "at least one count a second, and one a second squared",
            "check speed, acceleration and counts",
        ));
    }
    Ok(())
}

fn read_approach(table: &Table<'_>, run_up_key: &str) -> Result<(Approach, f64), Problem> {
    let words = [
        ("positive", Approach::Positive),
        ("negative", Approach::Negative),
        ("either", Approach::Either),
    ];
    let approach = table.choice("approach", &words)?.unwrap_or(Approach::Either);
    let run_up = table.number(run_up_key, Bounds::POSITIVE)?;
    match (approach, run_up) {
        (Approach::Either, Some(_)) => Err(table.problem(
            run_up_key,
            "a run-up on an axis that comes from either side",
            "no run-up, or approach = \"positive\" or \"negative\"",
            "say from which side the axis shall come, or remove the run-up",
        )),
        (Approach::Either, None) => Ok((approach, 0.0)),
        (_, run_up) => Ok((approach, run_up.unwrap_or(RUN_UP_DEFAULT))),
    }
}

/// The keys of `[alignment]`, each a standard uncertainty, 0 where absent; the table may be too.
///
/// `u_offset_x_mm`, `u_offset_y_mm`, `u_offset_z_mm`: of where the beam's axis passes the arm's axis,
/// from where the turntable's axis meets the sample: across the arm's axis, along it, up ·
/// `u_arm_axis_deg`: of the arm's axis out of the horizontal · `u_beam_deg`: of the beam out of the
/// plane of the arm's swing · `u_tilt_deg`: of the turntable's top against its axis.
fn read_alignment(table: Table<'_>) -> Result<Alignment, Problem> {
    let read = |key: &str, most: f64| table.number(key, Bounds::between(0.0, most));
    let length = |key: &str| Ok(read(key, OFFSET_MM_MAX)?.unwrap_or(0.0) / 1e3);
    let angle = |key: &str| Ok(read(key, LEAN_DEG_MAX)?.unwrap_or(0.0).to_radians());
    let alignment = Alignment {
        u_offset_m: [length("u_offset_x_mm")?, length("u_offset_y_mm")?, length("u_offset_z_mm")?],
        u_arm_axis_rad: angle("u_arm_axis_deg")?,
        u_beam_rad: angle("u_beam_deg")?,
        u_tilt_rad: angle("u_tilt_deg")?,
    };
    table.finish()?;
    Ok(alignment)
}

/// The keys of `[detector]`.
///
/// `quantity` radiance (default), luminance or relative · `distance_mm` from the sample to the
/// entrance pupil · `pupil_diameter_mm` · `spot_diameter_mm` on a sample facing it · a
/// `u_..._mm` for each of the three · `responsivity_a_per_w` (for luminance
/// `responsivity_a_per_lm`, for relative none) and `u_responsivity_relative` ·
/// `spectral_mismatch` (default 1), by which radiances are multiplied for a source of another
/// spectrum than the calibration's, and `u_spectral_mismatch_relative` · `read_noise_a` of one ADC reading · `[[detector.gain]]` with `name`, `full_scale_a`, `u_relative` ·
/// `[detector.adc]` with `bits` (sign included) and `rate_hz`.
fn read_detector(table: Table<'_>) -> Result<Detector, Problem> {
    let quantity = read_quantity(&table)?;
    let length = |key: &str| table.required_number(key, Bounds::POSITIVE).map(|mm| mm / 1e3);
    let u_length = |key: &str| table.required_number(key, Bounds::NON_NEGATIVE).map(|mm| mm / 1e3);
    let (responsivity, u_responsivity_relative) = read_responsivity(&table, quantity)?;
    let (spectral_mismatch, u_spectral_mismatch_relative) = read_mismatch(&table, quantity)?;
    let detector = Detector {
        quantity,
        distance_m: length("distance_mm")?,
        u_distance_m: u_length("u_distance_mm")?,
        pupil_radius_m: length("pupil_diameter_mm")? / 2.0,
        u_pupil_radius_m: u_length("u_pupil_diameter_mm")? / 2.0,
        spot_radius_m: length("spot_diameter_mm")? / 2.0,
        u_spot_radius_m: u_length("u_spot_diameter_mm")? / 2.0,
        responsivity,
        u_responsivity_relative,
        spectral_mismatch,
        u_spectral_mismatch_relative,
        read_noise_a: table.required_number("read_noise_a", Bounds::NON_NEGATIVE)?,
        gains: read_gains(&table)?,
        adc: read_adc(table.required_table("adc")?)?,
    };
    check_beam(&table, &detector)?;
    table.finish()?;
    Ok(detector)
}

/// A throughput so small or large that no double holds it has a length in a wrong unit.
fn check_beam(table: &Table<'_>, detector: &Detector) -> Result<(), Problem> {
    let disks = detector.disks();
    let throughput = disks.and_then(CoaxialDisks::throughput).map(Throughput::m2_sr);
    let has_partials = disks.and_then(CoaxialDisks::partials).is_ok();
    if has_partials && throughput.is_ok_and(f64::is_normal) {
        return Ok(());
    }
    Err(table.problem(
        "distance_mm",
        "distance, pupil and spot make no throughput",
        "lengths of a beam, in millimetres",
        "check the units of distance_mm, pupil_diameter_mm and spot_diameter_mm",
    ))
}

fn read_quantity(table: &Table<'_>) -> Result<Quantity, Problem> {
    let words = [Quantity::Radiance, Quantity::Luminance, Quantity::Relative]
        .map(|quantity| (quantity.name(), quantity));
    Ok(table.choice("quantity", &words)?.unwrap_or(Quantity::Radiance))
}

fn read_responsivity(table: &Table<'_>, quantity: Quantity) -> Result<(f64, f64), Problem> {
    let key = match quantity {
        Quantity::Luminance => "responsivity_a_per_lm",
        Quantity::Radiance => "responsivity_a_per_w",
        Quantity::Relative => return Ok((1.0, 0.0)),
    };
    let responsivity = table.required_number(key, Bounds::POSITIVE)?;
    let u_relative = table.required_number("u_responsivity_relative", RELATIVE)?;
    Ok((responsivity, u_relative))
}

/// A factor always comes with its uncertainty; an uncertainty alone says that nothing is corrected.
fn read_mismatch(table: &Table<'_>, quantity: Quantity) -> Result<(f64, f64), Problem> {
    const KEYS: [&str; 2] = ["spectral_mismatch", "u_spectral_mismatch_relative"];
    if quantity == Quantity::Relative
        && let Some(key) = KEYS.into_iter().find(|key| table.has(key))
    {
        return Err(table.problem(
            key,
            "a spectral mismatch of a detector without a calibration",
            "none where quantity = \"relative\"",
            "remove it, or state the detector's quantity and responsivity",
        ));
    }
    let factor = table.number(KEYS[0], MISMATCH)?;
    let u_relative = if factor.is_some() {
        table.required_number(KEYS[1], RELATIVE)?
    } else {
        table.number(KEYS[1], RELATIVE)?.unwrap_or(0.0)
    };
    Ok((factor.unwrap_or(1.0), u_relative))
}

fn read_gains(table: &Table<'_>) -> Result<Vec<Gain>, Problem> {
    let mut gains: Vec<Gain> = Vec::new();
    for gain_table in table.tables("gain")? {
        let gain = Gain {
            name: gain_table.required_text("name")?.to_owned(),
            full_scale_a: gain_table.required_number("full_scale_a", Bounds::POSITIVE)?,
            u_relative: gain_table.required_number("u_relative", RELATIVE)?,
        };
        if gains.iter().any(|known| known.name == gain.name) {
            return Err(gain_table.problem(
                "name",
                &format!("\"{}\" is the name of another gain range already", gain.name),
                "a name of its own for each gain range",
                "rename one of the two",
            ));
        }
        gain_table.finish()?;
        gains.push(gain);
    }
    if (1..=GAINS_MAX).contains(&gains.len()) {
        return Ok(gains);
    }
    Err(table.problem(
        "gain",
        &format!("{} gain ranges", gains.len()),
        &format!("1 to {GAINS_MAX} gain ranges"),
        "add [[detector.gain]] with name, full_scale_a and u_relative",
    ))
}

fn read_adc(table: Table<'_>) -> Result<Adc, Problem> {
    let bits = table.required_integer("bits", 8..=32)?;
    let rate_hz = table.required_integer("rate_hz", 1..=RATE_HZ_MAX)?;
    table.finish()?;
    Ok(Adc {
        bits: u8::try_from(bits).unwrap_or_default(),
        rate_hz: u32::try_from(rate_hz).unwrap_or_default(),
    })
}
