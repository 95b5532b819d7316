//! Rounds of a schedule that readings decide upon: sweeps that are wanted become steps, in an order
//! of short travel, closed by a reference and a dark reading.
//!
//! Why they are wanted is not known here.

use std::f64::consts::PI;
use std::time::Duration;

use spanned_toml::Problem;

use super::builder::{Builder, Place};
use super::sweep::{self, Line};
use super::{Adaptive, Plan, Prediction, SWEEPS_MAX, Sequence, Step, Target, time_of};
use crate::rig::{
    Approach, AxisPositions, Flight, Latched, ReadingKind, Rig, comes_to_rest, forward, set_out,
};

/// A sweep that is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meridian {
    /// The place on the sample.
    pub x_m: f64,
    /// The place on the sample.
    pub y_m: f64,
    /// The azimuth of positive arm angles; negative ones are half a turn from it.
    pub phi_rad: f64,
    /// From and to, by the arm's angle; rising.
    pub theta_rad: (f64, f64),
    /// How long each of its windows is.
    pub window: Duration,
}

/// What is measured further.
#[derive(Debug, Clone, PartialEq)]
pub enum Further {
    /// These sweeps, closed by a reference and a dark reading.
    Sweeps(Vec<Meridian>),
    /// A dark reading, so long: what is known of the dark level is all that is missing.
    Dark(Duration),
}

/// What a round follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct After {
    /// The id of its first step.
    pub step: u32,
    /// The index of its first target.
    pub target: u32,
    /// Where the axes rest.
    pub here: Latched,
}

/// Steps that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    /// In the order in which they are taken.
    pub steps: Vec<Step>,
    /// What they take, predicted.
    pub seconds: f64,
}

/// What a sweep takes with windows of one length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepPace {
    /// How long a window is.
    pub window: Duration,
    /// While readings are taken.
    pub seconds_per_rad: f64,
    /// Coming to speed and to rest.
    pub around_s: f64,
}

/// Paces that differ by less than this part are one.
const SAME_PACE: f64 = 0.02;

impl SweepPace {
    /// How many times as long as at another pace the arm is over an angle: so many times less is the
    /// noise's variance there.
    pub fn slower_than(&self, other: &Self) -> f64 {
        self.seconds_per_rad / other.seconds_per_rad
    }

    /// A sweep over so many radians, from rest to rest.
    pub fn sweep_s(&self, span_rad: f64) -> f64 {
        self.around_s + span_rad * self.seconds_per_rad
    }
}

impl After {
    /// After steps in their order.
    pub fn steps(rig: &Rig, steps: &[Step]) -> Self {
        let index = |step: &Step| match step.kind {
            ReadingKind::Target { index, .. } => Some(index + 1),
            _ => None,
        };
        Self {
            step: steps.iter().map(|step| step.id + 1).max().unwrap_or(0),
            target: steps.iter().filter_map(index).max().unwrap_or(0),
            here: steps.last().map_or(Latched::ZERO, |step| step.rests_at(rig)),
        }
    }
}

impl Plan {
    /// The steps of a round after others. The problem is one of the plan: a sweep that the rig can't
    /// fly.
    pub fn lay_out_round(
        &self,
        rig: &Rig,
        after: After,
        wanted: &Further,
    ) -> Result<Round, Problem> {
        let gain = self.gain_on(rig)?;
        let reference = self.reference_on(rig)?;
        let builder = Builder::new(self, rig, gain, reference).following(after.step, after.here);
        let wanted = match wanted {
            Further::Sweeps(wanted) => wanted,
            Further::Dark(dwell) => {
                let steps = builder.dark_alone(*dwell);
                let seconds = time_of(rig, after.here, &steps);
                return Ok(Round { steps, seconds });
            }
        };
        let (steps, _) = self.fill_round(rig, after, wanted, builder)?;
        let seconds = time_of(rig, after.here, &steps);
        Ok(Round { steps, seconds })
    }

    /// The round that a run begins with.
    pub(super) fn lay_out_first_round(
        &self,
        rig: &Rig,
        adaptive: &Adaptive,
        gain: u8,
        reference: Place,
    ) -> Result<Sequence, Problem> {
        sweep::check_wire(self, rig)?;
        self.check_first_round(rig, adaptive)?;
        let wanted = adaptive.first(self, rig);
        let builder = Builder::new(self, rig, gain, reference);
        let after = After { step: 0, target: 0, here: Latched::ZERO };
        let (steps, targets) = self.fill_round(rig, after, &wanted, builder)?;
        let prediction = Prediction::of(rig, &targets, &steps);
        let seconds = prediction.total_s();
        let most = self.stop.rig_time_max.map_or(f64::INFINITY, |most| most.as_secs_f64());
        if seconds > most {
            return Err(self.problem(
                "stop",
                "rig_time_s_max",
                &format!("the first round alone takes {seconds:.0} s, homing included"),
                &format!("more than {seconds:.0} s"),
                "allow more time, look for wider features (narrowest_feature_deg), or begin with fewer \
                 meridians (phi_step_deg)",
            ));
        }
        let reference =
            super::builder::step(0, ReadingKind::Reference, reference, gain, self.reference.dwell);
        Ok(Sequence { targets, steps, prediction, reference })
    }

    fn check_first_round(&self, rig: &Rig, adaptive: &Adaptive) -> Result<(), Problem> {
        let (sweeps, key) = adaptive.first_sweeps(self, rig);
        if sweeps <= SWEEPS_MAX {
            return Ok(());
        }
        Err(self.problem(
            "schedule",
            key,
            &format!("the first round alone has {sweeps} sweeps"),
            &format!("at most {SWEEPS_MAX}, those that check included"),
            "begin with fewer places (x_count, y_count) or meridians (phi_step_deg), or look for wider \
             features (narrowest_feature_deg)",
        ))
    }

    fn fill_round(
        &self,
        rig: &Rig,
        after: After,
        wanted: &[Meridian],
        mut builder: Builder<'_>,
    ) -> Result<(Vec<Step>, Vec<Target>), Problem> {
        let blocks: Result<Vec<_>, Problem> =
            wanted.iter().map(|meridian| self.block(rig, *meridian)).collect();
        let mut lines = in_short_order(rig, after.here, blocks?);
        let mut lowest = 0;
        for line in &mut lines {
            line.lowest = lowest;
            lowest += u32::from(line.windows);
        }
        sweep::check_places(self, rig, &lines)?;
        self.check_readings(after.target as usize + lowest as usize)?;
        let mut targets = sweep::targets(rig, &lines);
        for target in &mut targets {
            target.index += after.target;
        }
        builder.fill_sweeps(&targets, &lines);
        Ok((builder.steps, targets))
    }

    /// What sweeps take, whatever their length: the plan's own first, and then others that are as fast
    /// as anything bears, or slower, with windows to suit.
    pub fn sweep_paces(&self, rig: &Rig) -> Result<Vec<SweepPace>, Problem> {
        let mut paces = vec![self.sweep_pace(rig, self.dwell)?];
        // A window that can't be flown is none to choose; nor is one that is as fast as another.
        let others = sweep::windows(self, rig).into_iter();
        for pace in others.filter_map(|window| self.sweep_pace(rig, window).ok()) {
            let is_alike = |known: &SweepPace| (pace.slower_than(known) - 1.0).abs() < SAME_PACE;
            if !paces.iter().any(is_alike) {
                paces.push(pace);
            }
        }
        Ok(paces)
    }

    fn sweep_pace(&self, rig: &Rig, window: Duration) -> Result<SweepPace, Problem> {
        let most = self.region.theta_max_rad;
        let from = if sweep::reaches_over(self, rig) { -most } else { 0.0 };
        let flights = sweep::cut(self, rig, (from, most), window)?;
        let Some((flight, windows)) = flights.first().copied() else {
            return Ok(SweepPace { window, seconds_per_rad: 0.0, around_s: 0.0 });
        };
        let motion = rig.flight(flight).ok();
        let around_us = motion.map_or(0, |motion| motion.before_us() + motion.ramp_us());
        let span = rig.axes[0].distance(f64::from(flight.travel.0[0]) * f64::from(windows));
        let flown_s = flight.window.as_secs_f64() * f64::from(windows);
        Ok(SweepPace { window, seconds_per_rad: flown_s / span, around_s: around_us as f64 / 1e6 })
    }

    /// The flights of a sweep, upwards.
    fn block(&self, rig: &Rig, meridian: Meridian) -> Result<Vec<Line>, Problem> {
        let Meridian { x_m, y_m, phi_rad, theta_rad, window } = meridian;
        // Any turn of the table that its travel allows; half a turn changes the arm's sides, which
        // it can only where it reaches over the top.
        let halves = if sweep::reaches_over(self, rig) { 1 } else { 2 };
        let turns = [0, -halves, -2 * halves, halves];
        let half_turns = turns
            .into_iter()
            .find(|n| rig.axes[1].check(phi_rad + f64::from(*n) * PI).is_ok())
            .unwrap_or(0);
        let (low, high) =
            if half_turns % 2 == 0 { theta_rad } else { (-theta_rad.1, -theta_rad.0) };
        let phi = phi_rad + f64::from(half_turns) * PI;
        let at = rig.counts(AxisPositions([0.0, phi, x_m, y_m]));
        let flights = sweep::cut(self, rig, (low, high), window)?;
        let line = |(flight, windows): (Flight, u16)| {
            let from = Latched([flight.from.0[0], at.0[1], at.0[2], at.0[3]]);
            let flight = Flight { from, windows, ..flight };
            Line { flight, windows, lowest: 0, is_down: false }
        };
        Ok(flights.into_iter().map(line).collect())
    }
}

impl Sequence {
    /// The same plan's sequence when these are all of its steps.
    #[must_use]
    pub fn with_steps(&self, rig: &Rig, steps: Vec<Step>) -> Self {
        let target = |step: &Step| match (step.kind, step.pose) {
            (ReadingKind::Target { index, repeat: 0 }, Some(pose)) => {
                Some(Target { index, pose, positions: step.positions })
            }
            _ => None,
        };
        let mut targets: Vec<Target> = steps.iter().filter_map(target).collect();
        targets.sort_by_key(|target| target.index);
        let prediction = Prediction::of(rig, &targets, &steps);
        Self { targets, steps, prediction, reference: self.reference }
    }
}

/// A sweep flown one way: where it sets out, where it comes to rest.
struct Way {
    lines: Vec<Line>,
    set_out: Latched,
    rests: Latched,
}

/// From each sweep to the one whose beginning, or end, is the nearest by the axes' time.
fn in_short_order(rig: &Rig, mut here: Latched, blocks: Vec<Vec<Line>>) -> Vec<Line> {
    let mut left: Vec<Vec<Way>> = blocks.into_iter().map(|block| ways(rig, block)).collect();
    let mut ordered = Vec::new();
    while !left.is_empty() {
        let time = |way: &Way| rig.move_duration(here, way.set_out);
        let nearest = left
            .iter()
            .enumerate()
            .flat_map(|(i, ways)| ways.iter().enumerate().map(move |(w, way)| (i, w, way)))
            .min_by_key(|(i, w, way)| (time(way), *i, *w))
            .map(|(i, w, _)| (i, w));
        let Some((i, w)) = nearest else { break };
        let way = left.remove(i).swap_remove(w);
        here = way.rests;
        ordered.extend(way.lines);
    }
    ordered
}

fn ways(rig: &Rig, block: Vec<Line>) -> Vec<Way> {
    let down: Vec<Line> = block.iter().rev().map(|line| sweep::flipped(*line)).collect();
    let both = match rig.axes[0].approach {
        Approach::Either => vec![block, down],
        Approach::Negative => vec![down],
        Approach::Positive => vec![block],
    };
    let way = |lines: Vec<Line>| {
        let motion = |line: Option<&Line>| line.and_then(|line| rig.flight(line.flight).ok());
        Way {
            set_out: motion(lines.first()).map_or(Latched::ZERO, |motion| set_out(&motion)),
            rests: motion(lines.last()).map_or(Latched::ZERO, |motion| comes_to_rest(&motion)),
            lines,
        }
    };
    both.into_iter().map(way).collect()
}

impl Meridian {
    /// The direction at an arm's angle: θ from 0, and its azimuth.
    pub fn direction(&self, arm_rad: f64) -> (f64, f64) {
        let pose = forward(AxisPositions([arm_rad, self.phi_rad, self.x_m, self.y_m]));
        (pose.theta_rad, pose.phi_rad)
    }
}
