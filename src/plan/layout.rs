//! From a plan to its sequence on a rig: targets checked against limits, put in order, and
//! interleaved with dark and reference readings.
//!
//! Everything that a rig can object to is found here, before anything moves.

use std::ops::Range;

use spanned_toml::{Problem, Source};

use super::builder::{Builder, Place, step};
use super::order::{self, Visit};
use super::{
    DarkMethod, Order, Plan, Prediction, READINGS_MAX, Region, Schedule, Sequence, TARGETS_MAX,
    Target, grid, list, spiral, sweep,
};
use crate::rig::{AxisPositions, LimitError, Pose, ReadingKind, Rig};

/// A list's pose may pass the region's edge by this much: 80° are not exactly 80° in binary.
const EDGE_SLACK: f64 = 1e-12;

/// The poses of a plan, and for a list where each stands in its file.
struct Poses<'s> {
    poses: Vec<Pose>,
    places: Option<(&'s Source, Vec<Range<usize>>)>,
}

impl Plan {
    /// Every reading of the plan on `rig`, in order, and what they cost. `list` is the text of
    /// [`Plan::list_file`], for a plan that has one.
    ///
    /// The problem names the line of the plan, or of the list, that the rig can't do.
    pub fn lay_out(&self, rig: &Rig, list: Option<&Source>) -> Result<Sequence, Problem> {
        let gain = self.gain_on(rig)?;
        self.check_dwells(rig)?;
        self.check_dark(rig)?;
        self.check_expected(rig)?;
        let reference = self.reference_on(rig)?;
        match self.schedule {
            Schedule::Spiral { .. } | Schedule::Sweep { .. } => {
                return self.lay_out_sweeps(rig, gain, reference);
            }
            Schedule::Adaptive(adaptive) => {
                return self.lay_out_first_round(rig, &adaptive, gain, reference);
            }
            _ => {}
        }
        let poses = self.poses(list)?;
        self.check_readings(poses.poses.len())?;
        let candidates = self.candidates(rig, &poses)?;
        let visits = match self.order {
            Order::Listed => order::listed(rig, &candidates, reference.positions),
            Order::Travel => order::travelling(rig, &candidates, reference.positions),
        };
        let targets = targets(&poses.poses, &visits);
        let dwells = self.dwells(rig, gain, &targets)?;
        let mut builder = Builder::new(self, rig, gain, reference);
        builder.fill(&targets, &visits, &dwells);
        let prediction = Prediction::of(rig, &targets, &builder.steps);
        let (steps, reference) = (builder.steps, builder.reference);
        let reference = step(0, ReadingKind::Reference, reference, gain, self.reference.dwell);
        Ok(Sequence { targets, steps, prediction, reference })
    }

    fn lay_out_sweeps(&self, rig: &Rig, gain: u8, reference: Place) -> Result<Sequence, Problem> {
        let lines = match self.schedule {
            Schedule::Spiral { .. } => spiral::lines(self, rig)?,
            _ => sweep::lines(self, rig)?,
        };
        let targets = sweep::targets(rig, &lines);
        self.check_readings(targets.len())?;
        let mut builder = Builder::new(self, rig, gain, reference);
        builder.fill_sweeps(&targets, &lines);
        let prediction = Prediction::of(rig, &targets, &builder.steps);
        let (steps, reference) = (builder.steps, builder.reference);
        let reference = step(0, ReadingKind::Reference, reference, gain, self.reference.dwell);
        Ok(Sequence { targets, steps, prediction, reference })
    }

    /// A dwell must hold a whole ADC reading.
    fn check_dwells(&self, rig: &Rig) -> Result<(), Problem> {
        let rate_hz = rig.detector.adc.rate_hz;
        let dwells =
            [("dwell", self.dwell), ("dark", self.dark.dwell), ("reference", self.reference.dwell)];
        for (table, dwell) in dwells {
            if dwell.as_micros() * u128::from(rate_hz) < 1_000_000 {
                return Err(self.problem(
                    table,
                    "dwell_ms",
                    &format!("{dwell:?} hold no ADC reading"),
                    &format!("at least {} ms, at {rate_hz} readings a second", {
                        1e3 / f64::from(rate_hz)
                    }),
                    "lengthen the dwell",
                ));
            }
        }
        Ok(())
    }

    /// A shutter has to be there to be closed.
    fn check_dark(&self, rig: &Rig) -> Result<(), Problem> {
        if self.dark.method != DarkMethod::Shutter || rig.has_shutter() {
            return Ok(());
        }
        Err(self.problem(
            "dark",
            "method",
            &format!("{} has no shutter", rig.name),
            "\"source-off\", where a person switches the source",
            "say so, or give an [[axes_link]] of the rig file its `shutter`",
        ))
    }

    pub(super) fn reference_on(&self, rig: &Rig) -> Result<Place, Problem> {
        let pose = self.reference.pose;
        let positions = rig.nearest(pose, rig.home()).map_err(|e| {
            let help = "move the reference pose to where the axes reach it";
            self.problem("reference", "", &e.to_string(), "a pose inside the rig's limits", help)
        })?;
        Ok(Place { pose: Some(pose), positions, counts: rig.counts(positions) })
    }

    fn poses<'s>(&self, list: Option<&'s Source>) -> Result<Poses<'s>, Problem> {
        if let Schedule::List { file } = &self.schedule {
            let source = list.ok_or_else(|| {
                let what = format!("the list {file} was not read");
                self.problem("schedule", "file", &what, "a CSV file of poses", "check the path")
            })?;
            let (poses, places) = list::read(source)?.into_iter().unzip();
            return Ok(Poses { poses, places: Some((source, places)) });
        }
        let count = grid::count(&self.schedule, &self.region);
        if count > u64::from(TARGETS_MAX) {
            return Err(self.problem(
                "schedule",
                "kind",
                &format!("the schedule has {count} targets"),
                &format!("at most {TARGETS_MAX} targets"),
                "take larger steps or fewer places",
            ));
        }
        Ok(Poses { poses: grid::poses(&self.schedule, &self.region), places: None })
    }

    pub(super) fn check_readings(&self, targets: usize) -> Result<(), Problem> {
        let visits = targets as u64 * u64::from(self.repeat);
        let checks = visits / u64::from(self.dark.every) + visits / u64::from(self.reference.every);
        if visits + checks <= u64::from(READINGS_MAX) {
            return Ok(());
        }
        Err(self.problem(
            "schedule",
            "repeat",
            &format!("{targets} targets, {} times, make {} readings", self.repeat, visits + checks),
            &format!("at most {READINGS_MAX} readings"),
            "repeat less often, or measure fewer targets",
        ))
    }

    /// For each pose the axis positions that see it.
    fn candidates(&self, rig: &Rig, poses: &Poses<'_>) -> Result<Vec<Vec<AxisPositions>>, Problem> {
        let candidates = poses.poses.iter().enumerate().map(|(index, pose)| {
            if poses.places.is_some() {
                check_inside(&self.region, pose).map_err(|what| {
                    let help = "widen the region, or move or leave out the pose";
                    self.refused(poses, index, &what, "a pose in the region", help)
                })?;
            }
            rig.reachable(*pose).map_err(|e: LimitError| {
                let help =
                    "shrink the region, move or leave out the pose, or check the rig's travel";
                self.refused(poses, index, &e.to_string(), "a pose inside the rig's limits", help)
            })
        });
        candidates.collect()
    }

    fn refused(
        &self,
        poses: &Poses<'_>,
        index: usize,
        why: &str,
        expected: &str,
        help: &str,
    ) -> Problem {
        let what = format!("pose {index}: {why}");
        match &poses.places {
            Some((source, places)) => {
                Problem::at(source, places[index].clone(), "", &what, expected, help)
            }
            None => self.problem("schedule", "kind", &what, expected, help),
        }
    }

    /// A problem at a key of a table, or as near to it as the file has anything.
    pub(super) fn problem(
        &self,
        table: &str,
        key: &str,
        what: &str,
        expected: &str,
        help: &str,
    ) -> Problem {
        let root = self.document().root();
        match root.table(table) {
            Ok(Some(table)) if !key.is_empty() => table.problem(key, what, expected, help),
            _ => root.problem(table, what, expected, help),
        }
    }
}

fn check_inside(region: &Region, pose: &Pose) -> Result<(), String> {
    let is_inside =
        |(low, high): (f64, f64), at: f64| at >= low - EDGE_SLACK && at <= high + EDGE_SLACK;
    let outside = |name: &str, (low, high): (f64, f64), at: f64, unit: &str| {
        Err(format!("{name}: {at:.3}{unit} is outside the region's {low:.3} to {high:.3}{unit}"))
    };
    let mm = |(low, high): (f64, f64)| (low * 1e3, high * 1e3);
    let thetas = (0.0, region.theta_max_rad);
    if !is_inside(region.x_m, pose.x_m) {
        outside("x", mm(region.x_m), pose.x_m * 1e3, " mm")
    } else if !is_inside(region.y_m, pose.y_m) {
        outside("y", mm(region.y_m), pose.y_m * 1e3, " mm")
    } else if !is_inside(thetas, pose.theta_rad) {
        let thetas = (0.0, thetas.1.to_degrees());
        outside("theta", thetas, pose.theta_rad.to_degrees(), "°")
    } else {
        Ok(())
    }
}

/// Targets in the order of the schedule, with the positions that the visits chose.
fn targets(poses: &[Pose], visits: &[Visit]) -> Vec<Target> {
    let mut targets: Vec<Target> = visits
        .iter()
        .filter_map(|visit| {
            let pose = *poses.get(visit.target as usize)?;
            Some(Target { index: visit.target, pose, positions: visit.positions })
        })
        .collect();
    targets.sort_by_key(|target| target.index);
    targets
}
