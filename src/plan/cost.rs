//! What a sequence will cost in rig time, from the same profile of motion that the device runs.
//!
//! Commands cost nothing here: they queue on the device, behind its motion, or are short. What a
//! meter says of many readings at once is not short, and servos say nothing unless they are asked.

use std::time::Duration;

use super::{Step, Target};
use crate::rig::{Latched, ReadingKind, Rig, set_out};

/// A device looks for its home marks at about this part of its speed.
const HOMING_SPEED: f64 = 0.25;

/// Rig time, part by part, and the way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Prediction {
    /// Targets of the plan, each counted once.
    pub targets: u32,
    /// Readings of all kinds, repeats included.
    pub readings: u32,
    /// How far each axis travels, radians, radians, metres, metres, in the order of
    /// [`crate::rig::AXES`].
    pub travel: [f64; 4],
    /// Finding the home marks at the start: an estimate, since nobody knows where the axes stand
    /// before it. It is the time of one sweep over the longest axis.
    pub homing_s: f64,
    /// Moving, between all readings.
    pub moving_s: f64,
    /// Waiting for axes to be still.
    pub settling_s: f64,
    /// Integrating at targets.
    pub dwelling_s: f64,
    /// Integrating dark and reference readings.
    pub checking_s: f64,
    /// Waiting for the meter's words and for servos' answers, of all readings.
    pub overhead_s: f64,
}

/// The rig time of one step, coming from the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepTime {
    /// Moving there, by way of [`Step::via`] where there is one.
    pub moving_s: f64,
    /// Waiting for the axes to be still.
    pub settling_s: f64,
    /// Integrating.
    pub dwelling_s: f64,
    /// Waiting for the meter's words and for servos' answers: see [`Rig::answer_s`], [`Rig::arrival_s`] and
    /// [`Rig::shutter_s`].
    pub overhead_s: f64,
}

impl StepTime {
    /// Of a step that begins at `from`. A sweep's windows take their own time; its first one also
    /// what comes before it, its last one the braking. A rig that rests takes them like any other.
    pub fn of(rig: &Rig, from: Latched, step: &Step) -> Self {
        let step = &taken(rig, step);
        if step.swept.is_some() {
            return Self::of_window(rig, from, step);
        }
        let route = rig.route(from, step.counts);
        let moving_s = match route.via {
            None => rig.move_duration(from, step.counts),
            Some(via) => rig.move_duration(from, via) + rig.move_duration(via, step.counts),
        };
        let adc = rig.detector.adc;
        let readings = adc.readings_in(step.dwell);
        Self {
            moving_s: moving_s.as_secs_f64(),
            settling_s: route.settle.as_secs_f64(),
            dwelling_s: f64::from(readings) / f64::from(adc.rate_hz),
            overhead_s: rig.answer_s(readings) + waiting_s(rig, step.kind),
        }
    }

    fn of_window(rig: &Rig, from: Latched, step: &Step) -> Self {
        let adc = rig.detector.adc;
        let dwelling_s = f64::from(adc.readings_in(step.dwell)) / f64::from(adc.rate_hz);
        let mut time = Self { dwelling_s, ..Self::default() };
        let (Some(swept), Some(flight)) = (step.swept, step.flight(1)) else { return time };
        // A plan's flights are within the limits.
        let Ok(motion) = rig.flight(flight) else { return time };
        if from != step.counts || swept.first == step.id {
            let route = rig.route_to_flight(from, flight, &motion);
            let set_out = set_out(&motion);
            let mut here = from;
            for stop in route.via.into_iter().chain([set_out]) {
                time.moving_s += rig.move_duration(here, stop).as_secs_f64();
                here = stop;
            }
            time.settling_s = route.settle.as_secs_f64();
            time.moving_s += motion.before_us() as f64 / 1e6;
        }
        if step.id + 1 == swept.first + swept.count {
            time.moving_s += motion.ramp_us() as f64 / 1e6;
        }
        time
    }

    /// The whole, seconds.
    pub fn total_s(&self) -> f64 {
        self.moving_s + self.settling_s + self.dwelling_s + self.overhead_s
    }
}

/// Until axes are known to stand, and a servo to have closed the shutter and opened it again.
fn waiting_s(rig: &Rig, kind: ReadingKind) -> f64 {
    let shutter_s = if kind == ReadingKind::Dark { 2.0 * rig.shutter_s() } else { 0.0 };
    rig.arrival_s() + shutter_s
}

impl Prediction {
    /// The whole, seconds, without a warm-up, whose length is the source's to decide.
    pub fn total_s(&self) -> f64 {
        let still = self.settling_s + self.dwelling_s + self.checking_s + self.overhead_s;
        self.homing_s + self.moving_s + still
    }

    /// Finding all home marks: see [`Prediction::homing_s`].
    pub fn homing_s_of(rig: &Rig) -> f64 {
        let sweep = |axis: &crate::rig::Axis| (axis.travel.1 - axis.travel.0) / axis.speed;
        rig.axes.iter().map(sweep).fold(0.0, f64::max) / HOMING_SPEED
    }

    /// Of steps that begin at home.
    pub(super) fn of(rig: &Rig, targets: &[Target], steps: &[Step]) -> Self {
        let mut prediction = Self {
            targets: count(targets.len()),
            readings: count(steps.len()),
            homing_s: Self::homing_s_of(rig),
            ..Self::default()
        };
        let mut here = Latched([0; 4]);
        for step in steps {
            let time = StepTime::of(rig, here, step);
            prediction.moving_s += time.moving_s;
            prediction.settling_s += time.settling_s;
            prediction.overhead_s += time.overhead_s;
            match step.kind {
                ReadingKind::Target { .. } => prediction.dwelling_s += time.dwelling_s,
                _ => prediction.checking_s += time.dwelling_s,
            }
            prediction.travel(rig, here, step);
            here = step.rests_at(rig);
        }
        prediction
    }

    fn travel(&mut self, rig: &Rig, from: Latched, step: &Step) {
        let step = &taken(rig, step);
        let via = step.via.unwrap_or(step.counts);
        for (i, axis) in rig.axes.iter().enumerate() {
            let leg = |a: i32, b: i32| (f64::from(a) - f64::from(b)).abs();
            let mut counts = leg(from.0[i], via.0[i]) + leg(via.0[i], step.counts.0[i]);
            counts += leg(step.counts.0[i], step.rests_at(rig).0[i]);
            self.travel[i] += axis.distance(counts);
        }
    }
}

/// The step as this rig takes it.
fn taken(rig: &Rig, step: &Step) -> Step {
    if rig.takes_sweeps_at_rest() { step.at_rest() } else { *step }
}

/// What steps take, one after the other from `here`, seconds.
pub fn time_of(rig: &Rig, mut here: Latched, steps: &[Step]) -> f64 {
    let time = |step: &Step| {
        let time = StepTime::of(rig, here, step);
        here = step.rests_at(rig);
        time.total_s()
    };
    steps.iter().map(time).sum()
}

/// Both counts are bounded when a sequence is laid out.
fn count(len: usize) -> u32 {
    u32::try_from(len).unwrap_or(u32::MAX)
}

/// Rig time of all readings that are still to be taken, for an ETA.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeLeft {
    /// Seconds from the start of step i to the end of the sequence; one more at the end, 0.
    from_step_s: Vec<f64>,
}

impl TimeLeft {
    /// Of steps that begin at home.
    pub fn of(rig: &Rig, steps: &[Step]) -> Self {
        let mut from_step_s = vec![0.0; steps.len() + 1];
        for (i, step) in steps.iter().enumerate().rev() {
            let from = if i == 0 { Latched::ZERO } else { steps[i - 1].rests_at(rig) };
            from_step_s[i] = from_step_s[i + 1] + StepTime::of(rig, from, step).total_s();
        }
        Self { from_step_s }
    }

    /// Seconds until the end, at the start of a step; zero after the last.
    pub fn at(&self, step: usize) -> Duration {
        Duration::from_secs_f64(self.from_step_s.get(step).copied().unwrap_or_default())
    }
}
