//! What the mechanics bring to the compiler: an effect for each way in which an axis is not where
//! it is thought to be, or does not meet the others as it should.

use std::sync::Arc;

use super::flaws::{
    AXIS_OFFSET, AxisFlaws, BACKLASH, ENCODER_ERROR, LATCH_JITTER, MISSED_STEPS, MOTION_SMEAR,
    MissedSteps, NON_ORTHOGONALITY, Ringing, SETTLE_RINGING, SETTLING, WOBBLE,
};
use super::geometry::{Kinematics, Misaligned, Perfect};
use super::ringing::Rings;
use super::settling::Settling;
use super::smear::{self, Moment};
use super::weigh::{Departing, Joints, Trials};
use super::{AxisTruth, Misalignment, Uncertain};
use crate::compile::Setting;
use crate::effect::{Bound, BoundUnit, Candidate, Chosen, Influence};
use crate::optics::Axis;
use crate::simulated::AXIS_NAMES;
use crate::{Nominal, NominalAxis, Simulated};

/// Moments of a dwell that an axis not yet at rest is tried at, at most.
const UNREST_TRIALS: u32 = 64;

/// ADC readings of a dwell that smear is summed over, at most.
const SMEAR_READINGS: f64 = 1e5;

/// The axes' candidates, those of how they meet, and the limit switches'.
pub(crate) fn candidates(setting: &Setting<'_>) -> Vec<Candidate> {
    let weighing = Weighing { setting, trials: core::cell::OnceCell::new() };
    let mut candidates: Vec<Candidate> = (0..4).flat_map(|i| weighing.of_axis(i)).collect();
    candidates.push(weighing.of_smear());
    candidates.extend(weighing.of_misalignment());
    let margin = setting.simulated.limit_margin;
    candidates.push(Candidate::of_key(
        "limit-switches",
        &format!("simulated.limit_margin_fraction_of_travel = {margin}"),
        true,
        Influence::Mandatory(None),
        "open when a setpoint passes them, to the microsecond: a search for a home mark turns \
         round, any other motion ends in a fault; no reading is taken there",
    ));
    candidates
}

/// The axes as they are, with what was chosen of them.
pub(crate) fn axes(
    nominal: &Nominal,
    simulated: &Simulated,
    seed: u64,
    chosen: &Chosen,
) -> [AxisTruth; 4] {
    core::array::from_fn(|i| {
        let (name, mut axis) = (AXIS_NAMES[i], nominal.axes[i].clone());
        for (what, value) in [
            ("zero", &mut axis.u_zero),
            ("homing", &mut axis.u_homing),
            ("scale", &mut axis.u_readback),
            (SETTLING, &mut axis.settle_s),
        ] {
            if !chosen.has(&format!("{name}-{what}")) {
                *value = 0.0;
            }
        }
        let flaws = simulated.axes[i].chosen(name, |effect| chosen.has(effect));
        AxisTruth::draw(name, &axis, &flaws, simulated.start[i], simulated.limit_margin, seed)
    })
}

/// How the axes meet, with what was chosen of that.
pub(crate) fn kinematics(simulated: &Simulated, seed: u64, chosen: &Chosen) -> Arc<dyn Kinematics> {
    let drawn = simulated.misalignment.drawn(seed, |effect| chosen.has(effect));
    if drawn == Misaligned::default() { Arc::new(Perfect) } else { Arc::new(drawn) }
}

/// The moments of an ADC reading at which the light is looked at while an axis is not at rest.
pub(crate) fn moments(nominal: &Nominal, simulated: &Simulated, chosen: &Chosen) -> Vec<Moment> {
    if chosen.has(MOTION_SMEAR) {
        smear::moments(fastest_hz(simulated), 1.0 / f64::from(nominal.detector.adc_rate_hz))
    } else {
        vec![smear::END]
    }
}

/// Of all that rings, hertz.
fn fastest_hz(simulated: &Simulated) -> f64 {
    let ringing = simulated.axes.iter().filter_map(|flaws| flaws.ringing);
    ringing.map(|ringing| ringing.frequency_hz).fold(0.0, f64::max)
}

/// The poses are put together when the first effect asks for them.
struct Weighing<'s> {
    setting: &'s Setting<'s>,
    trials: core::cell::OnceCell<Trials<'s>>,
}

impl Weighing<'_> {
    fn largest(&self, errors: &[Departing<'_>]) -> Influence {
        let trials = self.trials.get_or_init(|| Trials::new(self.setting));
        Influence::Relative(trials.largest(errors))
    }

    /// Of an axis that is off by so much, either way.
    fn off(&self, axis: usize, by: f64) -> Influence {
        let moved = |mut joints: Joints, by: f64| {
            joints[axis] += by;
            vec![Perfect.seen(joints)]
        };
        self.largest(&[&|joints| moved(joints, by), &|joints| moved(joints, -by)])
    }

    fn of_axis(&self, i: usize) -> Vec<Candidate> {
        let mut candidates = self.as_stated(i);
        candidates.extend(self.flaws(i));
        candidates.extend(self.latch(i));
        candidates
    }

    /// What the rig file states of an axis.
    fn as_stated(&self, i: usize) -> Vec<Candidate> {
        let (name, axis) = (AXIS_NAMES[i], &self.setting.nominal.axes[i]);
        let (unit, key, per_key) = units(i);
        let drawn = |what: &str, key_name: &str, u: f64, how: &str| {
            let cause = format!("axes.{name}.{key_name}_{key} = {}", u * per_key);
            let influence = if u > 0.0 { self.off(i, u) } else { Influence::Relative(0.0) };
            Candidate::of_key(format!("{name}-{what}"), &cause, u > 0.0, influence, how)
        };
        let resolution = Bound { value: 0.5 / axis.counts_per_unit.abs(), unit };
        let rounded = if axis.has_encoder {
            "the position, rounded to a count"
        } else {
            "the setpoint, rounded to a count"
        };
        vec![
            drawn(
                "zero",
                "u_zero",
                axis.u_zero,
                "where the home mark stands, drawn once by the seed",
            ),
            drawn(
                "homing",
                "u_homing",
                axis.u_homing,
                "drawn at each homing of a boot, by its number",
            ),
            drawn(
                "scale",
                "u_readback",
                axis.u_readback,
                "drawn for each count of the scale by the seed",
            ),
            Candidate::of_key(
                format!("{name}-resolution"),
                &format!("axes.{name}.counts_per_{key} and readback"),
                true,
                Influence::Mandatory(Some(resolution)),
                rounded,
            ),
            self.settling(i),
        ]
    }

    /// What `[simulated]` states of an axis.
    fn flaws(&self, i: usize) -> Vec<Candidate> {
        let (name, axis) = (AXIS_NAMES[i], &self.setting.nominal.axes[i]);
        let AxisFlaws { backlash, encoder_error, ringing, missed_steps, .. } =
            self.setting.simulated.axes[i];
        let (_, key, per_key) = units(i);
        let of = |effect: &str, key_name: &str, size: f64, weigh: &dyn Fn() -> Influence, how| {
            let cause = format!("simulated.{name}.{key_name} = {}", size * per_key);
            let influence = if size > 0.0 { weigh() } else { Influence::Relative(0.0) };
            Candidate::of_key(format!("{name}-{effect}"), &cause, size > 0.0, influence, how)
        };
        let error = encoder_error.map_or(0.0, |error| error.amplitude);
        let rings = ringing.map_or(0.0, |ringing| ringing.amplitude);
        let lost = missed_steps.map_or(0.0, |missed| self.lost(axis, &missed));
        let lost_key = format!("missed_steps: rms at the end of the run, {key}");
        vec![
            of(
                BACKLASH,
                &format!("backlash_{key}"),
                backlash,
                &|| self.off(i, backlash),
                "the load stays until the play is used up, from either side",
            ),
            of(
                ENCODER_ERROR,
                &format!("encoder_error.amplitude_{key}"),
                error,
                &|| self.off(i, error),
                "a sine in the position, its phase drawn by the seed",
            ),
            of(
                SETTLE_RINGING,
                &format!("ringing.amplitude_{key}"),
                rings,
                &|| ringing.map_or(Influence::Relative(0.0), |r| self.ringing(i, &r)),
                "a damped oscillation after each stop, averaged by the dwell's ADC readings",
            ),
            of(
                MISSED_STEPS,
                &lost_key,
                lost,
                &|| self.off(i, lost),
                "a move falls short with a probability, drawn by its number since boot",
            ),
        ]
    }

    /// Of an axis with an encoder, where readings are taken while it moves.
    fn latch(&self, i: usize) -> Option<Candidate> {
        let (name, speed) = (AXIS_NAMES[i], self.setting.terms.sweep[i]);
        if speed <= 0.0 || !self.setting.nominal.axes[i].has_encoder {
            return None;
        }
        let jitter_s = self.setting.simulated.axes[i].jitter_s();
        let (_, key, per_key) = units(i);
        let off = speed * jitter_s;
        let cause = format!(
            "simulated.{name}.latch_jitter_us = {}, {:.3} {key}/s",
            jitter_s * 1e6,
            speed * per_key
        );
        let influence = if off > 0.0 { self.off(i, off) } else { Influence::Relative(0.0) };
        let how = "each latch in flight is early or late, drawn for its place by the seed";
        let name = format!("{name}-{LATCH_JITTER}");
        Some(Candidate::of_key(name, &cause, off > 0.0, influence, how))
    }

    /// Root mean square of what is lost by the end of the run if every loss goes the same way,
    /// units. A move a dwell, each waiting for the axis to settle.
    fn lost(&self, axis: &NominalAxis, missed: &MissedSteps) -> f64 {
        let terms = self.setting.terms;
        let moves = terms.run_s / (terms.dwell_s + axis.settle_s);
        let p = missed.probability_per_move;
        let mean = moves * p;
        missed.counts * libm::sqrt(mean * (1.0 - p) + mean * mean) / axis.counts_per_unit.abs()
    }

    /// Of an axis that comes to rest when its stated time is over nothing is left in a dwell.
    fn settling(&self, i: usize) -> Candidate {
        let (name, axis) = (AXIS_NAMES[i], &self.setting.nominal.axes[i]);
        let (stated_s, takes_s) = (axis.settle_s, self.takes_s(i));
        let settling = Settling::new(axis, takes_s);
        let stated = format!("axes.{name}.settle_ms = {}", stated_s * 1e3);
        let cause = if takes_s > stated_s {
            format!("simulated.{name}.settle_ms = {}, {stated}", takes_s * 1e3)
        } else {
            stated
        };
        let influence = match settling.filter(|_| takes_s > stated_s) {
            Some(settling) => {
                let lag = settling.lag_counts() / axis.counts_per_unit.abs();
                self.unrest(i, &|from_s, to_s| lag * settling.mean_left(from_s, to_s))
            }
            None => Influence::Relative(0.0),
        };
        let how = "behind after a stop by what its acceleration asks, (1 - t/settle)³, then \
                   exactly at rest";
        let name = format!("{name}-{SETTLING}");
        let mut candidate = Candidate::of_key(name, &cause, settling.is_some(), influence, how);
        if settling.is_some() {
            let how_out = if takes_s > stated_s {
                "the axis is taken to rest at once"
            } else {
                "a dwell begins when the stated time is over, and finds the axis at rest (a host \
                 that waits less will not see that: force it)"
            };
            how_out.clone_into(&mut candidate.how_out);
        }
        candidate
    }

    /// How long an axis really takes to come to rest, seconds.
    fn takes_s(&self, i: usize) -> f64 {
        self.setting.simulated.axes[i].settle_s.unwrap_or(self.setting.nominal.axes[i].settle_s)
    }

    fn ringing(&self, i: usize, ringing: &Ringing) -> Influence {
        let rings = Rings::new(ringing, self.setting.nominal.axes[i].counts_per_unit);
        self.unrest(i, &|from_s, to_s| ringing.amplitude * rings.left(f64::midpoint(from_s, to_s)))
    }

    /// In a dwell that begins when the axis's stated time to settle is over. `off`: by how much the
    /// axis is off between two moments after its stop, units.
    fn unrest(&self, i: usize, off: &dyn Fn(f64, f64) -> f64) -> Influence {
        let (axis, dwell_s) = (&self.setting.nominal.axes[i], self.setting.terms.dwell_s);
        let n = (dwell_s * f64::from(axis_rate(self.setting))).max(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most 64
        let trials = n.min(f64::from(UNREST_TRIALS)) as u32;
        let at = |k: u32| axis.settle_s + dwell_s * f64::from(k) / f64::from(trials);
        let left: Vec<f64> = (0..trials).map(|k| off(at(k), at(k + 1))).collect();
        let moved = |joints: Joints, sign: f64| -> Vec<Axis> {
            let off = left.iter().map(|by| {
                let mut joints = joints;
                joints[i] += sign * by;
                Perfect.seen(joints)
            });
            off.collect()
        };
        self.largest(&[&|joints| moved(joints, 1.0), &|joints| moved(joints, -1.0)])
    }

    /// Of the axes that move while a window integrates, and of those that are not at rest when
    /// their stated time to settle is over.
    fn of_smear(&self) -> Candidate {
        let mut names = Vec::new();
        let mut influence = 0.0;
        let mut sweeps = Vec::new();
        let Setting { nominal, terms, .. } = self.setting;
        let reading_s = 1.0 / f64::from(nominal.detector.adc_rate_hz);
        for (i, speed) in terms.sweep.into_iter().enumerate().filter(|(_, speed)| *speed > 0.0) {
            let (_, key, per_key) = units(i);
            sweeps.push(format!("{} sweeps at {:.3} {key}/s", AXIS_NAMES[i], speed * per_key));
            // A reading's end is half of it ahead of its middle.
            if let Influence::Relative(of_axis) = self.off(i, 0.5 * speed * reading_s) {
                influence += of_axis;
            }
        }
        for (i, name) in AXIS_NAMES.into_iter().enumerate() {
            let smeared = self.smeared(i);
            if !smeared.is_empty() {
                names.push(name);
            }
            for by in smeared {
                if let Influence::Relative(of_axis) = self.off(i, by) {
                    influence += of_axis;
                }
            }
        }
        if !names.is_empty() {
            sweeps.push(format!("{} moves on beyond its time to settle", names.join(", ")));
        }
        let key = if sweeps.is_empty() {
            "dwells are taken at rest: no axis moves on beyond its time to settle".to_owned()
        } else {
            sweeps.join("; ")
        };
        Candidate::of_key(
            MOTION_SMEAR,
            &key,
            !sweeps.is_empty(),
            Influence::Relative(influence),
            "until the axes rest, each ADC reading is the mean over the places passed in its time",
        )
    }

    /// By how much the mean of a dwell moves when its readings are not taken for their ends, units:
    /// of an axis that rings, and of one that has not settled.
    fn smeared(&self, i: usize) -> Vec<f64> {
        let Setting { nominal, simulated, terms, .. } = self.setting;
        let (axis, flaws) = (&nominal.axes[i], &simulated.axes[i]);
        let reading_s = 1.0 / f64::from(nominal.detector.adc_rate_hz);
        let moments = smear::moments(fastest_hz(simulated), reading_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let n = (terms.dwell_s / reading_s).clamp(1.0, SMEAR_READINGS) as u32;
        let change =
            |left: &dyn Fn(f64) -> f64| smear::change(left, &moments, axis.settle_s, reading_s, n);
        let mut smeared = Vec::new();
        if let Some(ringing) = flaws.ringing.filter(|ringing| ringing.amplitude > 0.0) {
            let rings = Rings::new(&ringing, axis.counts_per_unit);
            if rings.lasts_s() > axis.settle_s {
                smeared.push(ringing.amplitude * change(&|since_s| rings.left(since_s)));
            }
        }
        let settling = Settling::new(axis, self.takes_s(i));
        if let Some(settling) = settling.filter(|settling| settling.lasts_s() > axis.settle_s) {
            let lag = settling.lag_counts() / axis.counts_per_unit.abs();
            smeared.push(lag * change(&|since_s| settling.left(since_s)));
        }
        smeared
    }

    fn of_misalignment(&self) -> Vec<Candidate> {
        let stated = &self.setting.simulated.misalignment;
        let [x, y, z] = &stated.axis_offset_m;
        let mm = |of: &Uncertain| format!("{} (u {})", of.value * 1e3, of.u * 1e3);
        let deg = |of: &Uncertain| format!("{} (u {})", of.value.to_degrees(), of.u.to_degrees());
        let of = |name: &str, key: String, numbers: &[&Uncertain], how: &str| {
            let calls = numbers.iter().any(|number| !number.is_none());
            let influence =
                if calls { self.misaligned(stated, name) } else { Influence::Relative(0.0) };
            Candidate::of_key(name, &key, calls, influence, how)
        };
        vec![
            of(
                AXIS_OFFSET,
                format!("simulated.axis_offset: {}, {}, {} mm", mm(x), mm(y), mm(z)),
                &[x, y, z],
                "the detector's axis passes the arm's beside the turntable's, exactly",
            ),
            of(
                NON_ORTHOGONALITY,
                format!(
                    "simulated.non_orthogonality: arm {}, beam {} deg",
                    deg(&stated.arm_axis_rad),
                    deg(&stated.beam_rad)
                ),
                &[&stated.arm_axis_rad, &stated.beam_rad],
                "the arm's axis and the beam lean, as exact rotations",
            ),
            of(
                WOBBLE,
                format!("simulated.wobble.tilt_deg = {}", deg(&stated.wobble_rad)),
                &[&stated.wobble_rad],
                "the turntable's top leans and turns with it, as an exact rotation",
            ),
        ]
    }

    /// Of one kind of misalignment, at the corners of its numbers' spread. A direction that is
    /// drawn is tried all round.
    fn misaligned(&self, stated: &Misalignment, name: &str) -> Influence {
        let corners = stated.corners(name);
        let seen: Vec<_> =
            corners.iter().map(|rig| move |joints: Joints| vec![rig.seen(joints)]).collect();
        let errors: Vec<Departing<'_>> = seen.iter().map(|seen| seen as Departing<'_>).collect();
        self.largest(&errors)
    }
}

fn axis_rate(setting: &Setting<'_>) -> u32 {
    setting.nominal.detector.adc_rate_hz
}

/// Of an axis's positions: for a bound, in the file's keys, and how many of those a unit is.
fn units(axis: usize) -> (BoundUnit, &'static str, f64) {
    if axis < 2 {
        (BoundUnit::Radian, "deg", 180.0 / core::f64::consts::PI)
    } else {
        (BoundUnit::Metre, "mm", 1e3)
    }
}
