//! The keys of `[simulated]` that say what is wrong with the mechanics.

use core::f64::consts::{FRAC_PI_4, TAU};

use glam::DVec3;
use spanned_toml::{Bounds, Problem, Table};

use super::geometry::Misaligned;
use crate::chance::{Stream, draw};

/// A number that is stated, and by how much it may be off: its standard uncertainty, from which it
/// is drawn by the seed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Uncertain {
    /// As stated.
    pub value: f64,
    /// Standard uncertainty, at least 0.
    pub u: f64,
}

/// How the rig's axes fail to meet as they should. Lengths in metres, angles in radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Misalignment {
    /// Where the detector's axis passes the arm's axis, from where the turntable's axis meets the
    /// sample's plane: x across the arm's axis, y along it, z up.
    pub axis_offset_m: [Uncertain; 3],
    /// By how much the arm's axis leans out of the horizontal.
    pub arm_axis_rad: Uncertain,
    /// By how much the detector's axis leans out of the plane in which the arm swings.
    pub beam_rad: Uncertain,
    /// By how much the turntable's top leans.
    pub wobble_rad: Uncertain,
    /// Towards where it leans, from +x towards +y; drawn where absent.
    pub wobble_towards_rad: Option<f64>,
}

/// What is wrong with one axis. Its unit is the radian for θ and φ, the metre for x and y.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisFlaws {
    /// The play between drive and load, units; zero for none.
    pub backlash: f64,
    /// A periodic error of the scale.
    pub encoder_error: Option<EncoderError>,
    /// How it rings after a stop.
    pub ringing: Option<Ringing>,
    /// How it loses steps.
    pub missed_steps: Option<MissedSteps>,
    /// How long it takes to come to rest, seconds, at least 0. `None`: as long as the rig file
    /// states.
    pub settle_s: Option<f64>,
    /// By how much the moments at which an encoder is latched in flight scatter, seconds: a standard
    /// deviation, at least 0. `None`: as a latch does, 3 µs.
    pub latch_jitter_s: Option<f64>,
}

/// A sine in the position: the eccentricity of a graduated circle, the pitch of a screw, the
/// interpolation of an encoder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderError {
    /// Units.
    pub amplitude: f64,
    /// Units, above 0.
    pub period: f64,
}

/// A damped oscillation after a stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ringing {
    /// At the stop, units.
    pub amplitude: f64,
    /// Of the undamped oscillation, hertz, above 0.
    pub frequency_hz: f64,
    /// Of critical damping, above 0 and below 1.
    pub damping_ratio: f64,
}

/// Steps that a motor loses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissedSteps {
    /// The probability that a move loses any.
    pub probability_per_move: f64,
    /// How many counts it loses then.
    pub counts: f64,
}

const OFFSET_MM_MAX: f64 = 1000.0;
const TILT_DEG_MAX: f64 = 10.0;
const ERROR_MAX: f64 = 10.0;
const PERIOD_MAX: f64 = 1e4;
const FREQUENCY_HZ_MAX: f64 = 1e4;
/// An oscillation that is damped less outlasts any dwell.
const DAMPING: (f64, f64) = (1e-4, 0.999);
const COUNTS_MAX: f64 = 1e6;
/// Of an encoder that an interrupt reads: the time that it waits for another one to end.
pub(super) const LATCH_JITTER_S: f64 = 3e-6;
const LATCH_JITTER_US_MAX: f64 = 1e5;
/// As long as a rig file may state.
const SETTLE_MS_MAX: f64 = 60_000.0;

/// The effects' names, as rows and command lines have them; an axis's begin with its own.
pub(super) const AXIS_OFFSET: &str = "axis-offset";
pub(super) const NON_ORTHOGONALITY: &str = "non-orthogonality";
pub(super) const WOBBLE: &str = "wobble";
pub(super) const BACKLASH: &str = "backlash";
pub(super) const ENCODER_ERROR: &str = "encoder-error";
pub(super) const SETTLING: &str = "settling";
pub(super) const SETTLE_RINGING: &str = "settle-ringing";
pub(super) const MISSED_STEPS: &str = "missed-steps";
pub(super) const LATCH_JITTER: &str = "latch-jitter";
pub(super) const MOTION_SMEAR: &str = "motion-smear";

impl Uncertain {
    /// `key` and `u_key`; zero where absent.
    fn read(table: &Table<'_>, key: &str, largest: f64, per_key: f64) -> Result<Self, Problem> {
        let value = table.number(key, Bounds::between(-largest, largest))?.unwrap_or(0.0);
        let u_key = format!("u_{key}");
        let u = table.number(&u_key, Bounds::between(0.0, largest))?.unwrap_or(0.0);
        Ok(Self { value: value * per_key, u: u * per_key })
    }

    /// Whether it is zero for certain.
    pub fn is_none(&self) -> bool {
        self.value == 0.0 && self.u == 0.0
    }

    fn drawn(&self, seed: u64, effect: &str, key: u64) -> f64 {
        if self.u == 0.0 { self.value } else { self.value + self.u * draw(seed, effect, key) }
    }
}

impl Misalignment {
    pub(crate) fn read(table: &Table<'_>) -> Result<Self, Problem> {
        let (mm, deg) = (1e-3, 1.0_f64.to_radians());
        let mut read = Self::default();
        if let Some(offset) = table.table("axis_offset")? {
            for (of, key) in read.axis_offset_m.iter_mut().zip(["x_mm", "y_mm", "z_mm"]) {
                *of = Uncertain::read(&offset, key, OFFSET_MM_MAX, mm)?;
            }
            offset.finish()?;
        }
        if let Some(angles) = table.table("non_orthogonality")? {
            read.arm_axis_rad = Uncertain::read(&angles, "arm_axis_deg", TILT_DEG_MAX, deg)?;
            read.beam_rad = Uncertain::read(&angles, "beam_deg", TILT_DEG_MAX, deg)?;
            angles.finish()?;
        }
        if let Some(wobble) = table.table("wobble")? {
            read.wobble_rad = Uncertain::read(&wobble, "tilt_deg", TILT_DEG_MAX, deg)?;
            let towards = wobble.number("towards_deg", Bounds::between(-360.0, 360.0))?;
            read.wobble_towards_rad = towards.map(f64::to_radians);
            wobble.finish()?;
        }
        Ok(read)
    }

    /// What one effect may be drawn as: each of its numbers a standard uncertainty up and down, a
    /// direction that is drawn all round.
    pub(super) fn corners(&self, effect: &str) -> Vec<Misaligned> {
        let ends = |of: &Uncertain| {
            if of.u > 0.0 { vec![of.value - of.u, of.value + of.u] } else { vec![of.value] }
        };
        let mut corners = vec![Misaligned::default()];
        let mut spread = |values: &[f64], put: &dyn Fn(&mut Misaligned, f64)| {
            let with = |corner: &Misaligned, value: f64| {
                let mut corner = *corner;
                put(&mut corner, value);
                corner
            };
            let all = corners.iter().flat_map(|c| values.iter().map(move |value| with(c, *value)));
            corners = all.collect();
        };
        match effect {
            AXIS_OFFSET => {
                spread(&ends(&self.axis_offset_m[0]), &|rig, x| rig.meets_m.x = x);
                spread(&ends(&self.axis_offset_m[1]), &|rig, y| rig.meets_m.y = y);
                spread(&ends(&self.axis_offset_m[2]), &|rig, z| rig.meets_m.z = z);
            }
            NON_ORTHOGONALITY => {
                spread(&ends(&self.arm_axis_rad), &|rig, angle| rig.arm_axis_rad = angle);
                spread(&ends(&self.beam_rad), &|rig, angle| rig.beam_rad = angle);
            }
            _ => {
                let round: Vec<f64> = (0..8).map(|i| f64::from(i) * FRAC_PI_4).collect();
                let towards = self.wobble_towards_rad.map_or(round, |towards| vec![towards]);
                spread(&ends(&self.wobble_rad), &|rig, angle| rig.wobble_rad = angle);
                spread(&towards, &|rig, towards| rig.wobble_towards_rad = towards);
            }
        }
        corners
    }

    /// As drawn by the seed, with what is called for of it.
    pub(crate) fn drawn(&self, seed: u64, is_in: impl Fn(&str) -> bool) -> Misaligned {
        let mut drawn = Misaligned::default();
        if is_in(AXIS_OFFSET) {
            let of = |i: u8| self.axis_offset_m[usize::from(i)].drawn(seed, AXIS_OFFSET, i.into());
            drawn.meets_m = DVec3::new(of(0), of(1), of(2));
        }
        if is_in(NON_ORTHOGONALITY) {
            drawn.arm_axis_rad = self.arm_axis_rad.drawn(seed, NON_ORTHOGONALITY, 0);
            drawn.beam_rad = self.beam_rad.drawn(seed, NON_ORTHOGONALITY, 1);
        }
        if is_in(WOBBLE) {
            drawn.wobble_rad = self.wobble_rad.drawn(seed, WOBBLE, 0);
            let uniform = || TAU * Stream::new(seed, WOBBLE, 1).uniform();
            drawn.wobble_towards_rad = self.wobble_towards_rad.unwrap_or_else(uniform);
        }
        drawn
    }
}

impl AxisFlaws {
    /// Of one axis: lengths are in millimetres in the file, angles in degrees.
    pub(crate) fn read(table: Table<'_>, is_angle: bool) -> Result<Self, Problem> {
        let (unit, per_unit) = if is_angle { ("deg", 1.0_f64.to_radians()) } else { ("mm", 1e-3) };
        let error = Bounds::between(0.0, ERROR_MAX);
        let key = |name: &str| format!("{name}_{unit}");
        let backlash = table.number(&key("backlash"), error)?.unwrap_or(0.0) * per_unit;
        let settle_ms = table.number("settle_ms", Bounds::between(0.0, SETTLE_MS_MAX))?;
        let settle_s = settle_ms.map(|ms| ms / 1e3);
        let jitter = Bounds::between(0.0, LATCH_JITTER_US_MAX);
        let latch_jitter_s = table.number("latch_jitter_us", jitter)?.map(|us| us / 1e6);
        let mut read = Self { backlash, settle_s, latch_jitter_s, ..Self::default() };
        if let Some(error_table) = table.table("encoder_error")? {
            let period = Bounds::positive_up_to(PERIOD_MAX);
            read.encoder_error = Some(EncoderError {
                amplitude: error_table.required_number(&key("amplitude"), error)? * per_unit,
                period: error_table.required_number(&key("period"), period)? * per_unit,
            });
            error_table.finish()?;
        }
        if let Some(ringing) = table.table("ringing")? {
            let frequency = Bounds::positive_up_to(FREQUENCY_HZ_MAX);
            let damping = Bounds::between(DAMPING.0, DAMPING.1);
            read.ringing = Some(Ringing {
                amplitude: ringing.required_number(&key("amplitude"), error)? * per_unit,
                frequency_hz: ringing.required_number("frequency_hz", frequency)?,
                damping_ratio: ringing.required_number("damping_ratio", damping)?,
            });
            ringing.finish()?;
        }
        if let Some(missed) = table.table("missed_steps")? {
            let probability = Bounds::between(0.0, 1.0);
            let counts = Bounds::between(0.0, COUNTS_MAX);
            read.missed_steps = Some(MissedSteps {
                probability_per_move: missed
                    .required_number("probability_per_move", probability)?,
                counts: missed.required_number("counts", counts)?,
            });
            missed.finish()?;
        }
        table.finish()?;
        Ok(read)
    }

    /// With what is called for of it; names are an axis's own and the effect's.
    pub(crate) fn chosen(mut self, axis: &str, is_in: impl Fn(&str) -> bool) -> Self {
        let is_in = |effect: &str| is_in(&format!("{axis}-{effect}"));
        if !is_in(BACKLASH) {
            self.backlash = 0.0;
        }
        self.encoder_error = self.encoder_error.filter(|_| is_in(ENCODER_ERROR));
        self.ringing = self.ringing.filter(|_| is_in(SETTLE_RINGING));
        self.missed_steps = self.missed_steps.filter(|_| is_in(MISSED_STEPS));
        self.settle_s = self.settle_s.filter(|_| is_in(SETTLING));
        self.latch_jitter_s = Some(if is_in(LATCH_JITTER) { self.jitter_s() } else { 0.0 });
        self
    }

    /// By how much the moments of latches scatter, stated or not.
    pub(super) fn jitter_s(&self) -> f64 {
        self.latch_jitter_s.unwrap_or(LATCH_JITTER_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misalignments_spread_as_stated_about_what_is_stated() {
        const N: u32 = 4000;
        let stated = Misalignment {
            axis_offset_m: [Uncertain { value: 1e-3, u: 1e-4 }; 3],
            arm_axis_rad: Uncertain { value: -2e-3, u: 5e-4 },
            wobble_rad: Uncertain { value: 1e-3, u: 0.0 },
            ..Misalignment::default()
        };
        let drawn: Vec<Misaligned> =
            (0..N).map(|seed| stated.drawn(u64::from(seed), |_| true)).collect();
        // Standard errors: 1.6 % of u in the mean, 1.1 % in the deviation.
        let check = |of: &dyn Fn(&Misaligned) -> f64, expected: &Uncertain| {
            let mean = drawn.iter().map(of).sum::<f64>() / f64::from(N);
            let squares = drawn.iter().map(|rig| (of(rig) - mean) * (of(rig) - mean));
            let deviation = libm::sqrt(squares.sum::<f64>() / f64::from(N));
            assert!((mean - expected.value).abs() < 0.07 * expected.u, "{mean}, {expected:?}");
            assert!((deviation / expected.u - 1.0).abs() < 0.05, "{deviation}, {expected:?}");
        };
        check(&|rig| rig.meets_m.x, &stated.axis_offset_m[0]);
        check(&|rig| rig.meets_m.z, &stated.axis_offset_m[2]);
        check(&|rig| rig.arm_axis_rad, &stated.arm_axis_rad);
        // The direction goes all round: its mean is half a turn, its deviation a turn over √12.
        let round = Uncertain { value: TAU / 2.0, u: TAU / libm::sqrt(12.0) };
        check(&|rig| rig.wobble_towards_rad, &round);
        assert!(drawn.iter().all(|rig| rig.wobble_rad.to_bits() == 1e-3_f64.to_bits()));
        // What is not called for is not there, and leaves the others' draws alone.
        let less = stated.drawn(7, |effect| effect != AXIS_OFFSET);
        assert_eq!(less.meets_m, DVec3::ZERO);
        assert_eq!(less.arm_axis_rad.to_bits(), drawn[7].arm_axis_rad.to_bits());
    }
}
