//! A schedule that readings decide upon: its terms, the sweeps that it begins with, and those that
//! check it.
//!
//! How the sweeps between are chosen is not known here.

use std::f64::consts::{PI, TAU};

use spanned_toml::{Bounds, Problem, Table};

use super::file::{read_count, read_turn_step};
use super::{Expect, Meridian, Plan, Stop, grid, sweep};
use crate::rig::Rig;

const TARGET: Bounds = Bounds::positive_up_to(1.0);
const NARROWEST_DEG: Bounds = Bounds::between(0.5, 180.0);
/// Sweeps that are decided upon at most, those of the first round among them; a decision's time grows
/// with their cube.
pub const SWEEPS_MAX: usize = 300;
/// More places than this in a row are a map of their own, not a beginning.
const PLACES_MAX: i64 = 64;
/// Meridians of the first round for each place, at least: two ways over the top tell a lobe's side.
const PER_PLACE: u32 = 2;
/// Meridians of the first round, at least.
const MERIDIANS_MIN: u32 = 4;
/// Sweeps of the first round that check the others, at least; and one for so many meridians.
const CHECKS_MIN: u32 = 4;
const MERIDIANS_PER_CHECK: u32 = 8;
/// The fractional parts by which checks step through φ, x and y: the powers of 1/g, with g the real
/// root of g⁴ = g + 1 (the additive recurrence R3: Roberts 2018, as for low-discrepancy schedules).
const R3: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_960_8];

/// What a schedule states that readings decide upon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptive {
    /// Columns of places of the first round.
    pub x_count: u32,
    /// Rows.
    pub y_count: u32,
    /// Full width at half maximum of the narrowest feature that is looked for, degrees.
    pub narrowest_feature_deg: f64,
    /// Between the meridians of the first round, degrees, whatever their places; as
    /// `narrowest_feature_deg` asks if absent.
    pub phi_step_deg: Option<f64>,
    /// Target: root mean square error of the radiance, without the scale that all readings share,
    /// over the region, relative to the radiance's own root mean square.
    pub radiance_relative: Option<f64>,
    /// Target: the exitance's combined relative standard uncertainty.
    pub exitance_relative: Option<f64>,
    /// Target: that of the exitance into the region's directions, without the scale that all
    /// readings share.
    pub exitance_within_region_relative: Option<f64>,
}

impl Adaptive {
    /// `x_count`, `y_count`; `narrowest_feature_deg` (default: `[expect]`'s); `radiance_relative`,
    /// `exitance_relative` and `exitance_within_region_relative`, one of them at least;
    /// `phi_step_deg`, if the first round shall be coarser or finer than the narrowest feature asks.
    pub(super) fn read(table: &Table<'_>, expect: &Expect) -> Result<Self, Problem> {
        let phi_step_deg = if table.has("phi_step_deg") {
            Some(read_turn_step(table, "phi_step_deg")?)
        } else {
            table.leave("phi_step_deg");
            None
        };
        let adaptive = Self {
            x_count: read_count(table, "x_count", PLACES_MAX)?,
            y_count: read_count(table, "y_count", PLACES_MAX)?,
            narrowest_feature_deg: match expect.narrowest_feature_rad {
                Some(expected) => table
                    .number("narrowest_feature_deg", NARROWEST_DEG)?
                    .unwrap_or(expected.to_degrees()),
                None => table.required_number("narrowest_feature_deg", NARROWEST_DEG)?,
            },
            phi_step_deg,
            radiance_relative: table.number("radiance_relative", TARGET)?,
            exitance_relative: table.number("exitance_relative", TARGET)?,
            exitance_within_region_relative: table
                .number("exitance_within_region_relative", TARGET)?,
        };
        if adaptive.radiance_relative.is_none() && !adaptive.asks_exitance() {
            return Err(table.problem(
                "radiance_relative",
                "nothing says when it is enough",
                "radiance_relative, exitance_relative, exitance_within_region_relative, or several",
                "state the error that the run is to reach, for example radiance_relative = 0.02",
            ));
        }
        Ok(adaptive)
    }

    /// Whether a target is one of the exitance.
    pub const fn asks_exitance(&self) -> bool {
        self.exitance_relative.is_some() || self.exitance_within_region_relative.is_some()
    }

    /// Such a schedule has its targets itself, and needs an end that comes in any case.
    pub(super) fn check_stop(root: &Table<'_>, stop: &Stop) -> Result<(), Problem> {
        let table = root.table("stop")?;
        let place = table.as_ref().unwrap_or(root);
        if stop.exitance_relative.is_some() {
            return Err(place.problem(
                "exitance_relative",
                "an adaptive schedule ends by its own targets",
                "no exitance_relative in [stop]",
                "move it to [schedule], where it decides what is measured too",
            ));
        }
        if stop.rig_time_max.is_none() {
            return Err(place.problem(
                if table.is_some() { "rig_time_s_max" } else { "stop" },
                "an adaptive schedule without a limit of time",
                "rig_time_s_max in [stop]",
                "state how long the run may take if its target is not met before",
            ));
        }
        Ok(())
    }

    /// The arc between neighbouring meridians of the first round where they lie furthest apart,
    /// radians: at the region's largest θ.
    pub fn arc_rad(&self, plan: &Plan, rig: &Rig) -> f64 {
        let turn = if sweep::reaches_over(plan, rig) { PI } else { TAU };
        let spacing = turn / f64::from(self.meridians(plan, rig));
        spacing * libm::sin(plan.region.theta_max_rad)
    }

    /// How many sweeps the first round has, and the key of the plan that asks for so many.
    pub(super) fn first_sweeps(&self, plan: &Plan, rig: &Rig) -> (usize, &'static str) {
        let count = self.meridians(plan, rig);
        let key = match self.phi_step_deg {
            _ if count == PER_PLACE * self.x_count * self.y_count => "x_count",
            Some(_) => "phi_step_deg",
            None => "narrowest_feature_deg",
        };
        ((count + first_checks(count)) as usize, key)
    }

    /// How many meridians (pairs of them, over the top) the first round has.
    fn meridians(&self, plan: &Plan, rig: &Rig) -> u32 {
        let turn = if sweep::reaches_over(plan, rig) { PI } else { TAU };
        let asked = self.phi_step_deg.map_or_else(
            || {
                turn * libm::sin(plan.region.theta_max_rad)
                    / self.narrowest_feature_deg.to_radians()
            },
            |step_deg| turn / step_deg.to_radians(),
        );
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // the reader's bounds
        let asked = libm::ceil(asked - 1e-9) as u32;
        asked.max(PER_PLACE * self.x_count * self.y_count).max(MERIDIANS_MIN)
    }

    /// The sweeps that a run begins with: meridians so close that no feature as wide as declared lies
    /// between them, each at another place; and the first checks.
    pub(super) fn first(&self, plan: &Plan, rig: &Rig) -> Vec<Meridian> {
        let turn = if sweep::reaches_over(plan, rig) { PI } else { TAU };
        let places = grid::places(&plan.region, self.x_count, self.y_count);
        let count = self.meridians(plan, rig);
        let meridian = |k: u32| {
            let (x_m, y_m) = places[grid::dealt(k as usize, places.len())];
            let phi_rad = turn * f64::from(k) / f64::from(count);
            Meridian { x_m, y_m, phi_rad, theta_rad: range(plan, rig), window: plan.dwell }
        };
        let checks = (0..first_checks(count)).map(|j| self.check(plan, rig, j));
        (0..count).map(meridian).chain(checks).collect()
    }

    /// The j-th sweep that checks: at a phase and a place that no other sweep has, evenly over φ and
    /// the region however many there are.
    pub fn check(&self, plan: &Plan, rig: &Rig, j: u32) -> Meridian {
        evenly(plan, rig, j, 0.5)
    }

    /// The i-th sweep of a sequence that is as even, and has none of the checks.
    pub fn candidate(&self, plan: &Plan, rig: &Rig, i: u32) -> Meridian {
        evenly(plan, rig, i, 0.25)
    }
}

/// How many sweeps check so many meridians.
fn first_checks(meridians: u32) -> u32 {
    CHECKS_MIN.max(meridians / MERIDIANS_PER_CHECK)
}

/// From the lowest to the highest angle of the arm.
fn range(plan: &Plan, rig: &Rig) -> (f64, f64) {
    let most = plan.region.theta_max_rad;
    (if sweep::reaches_over(plan, rig) { -most } else { 0.0 }, most)
}

fn evenly(plan: &Plan, rig: &Rig, i: u32, start: f64) -> Meridian {
    let turn = if sweep::reaches_over(plan, rig) { PI } else { TAU };
    let part = |step: f64| {
        let at = start + step * f64::from(i);
        at - libm::floor(at)
    };
    let within = |(low, high): (f64, f64), part: f64| low + (high - low) * part;
    Meridian {
        x_m: within(plan.region.x_m, part(R3[1])),
        y_m: within(plan.region.y_m, part(R3[2])),
        phi_rad: turn * part(R3[0]),
        theta_rad: range(plan, rig),
        window: plan.dwell,
    }
}
