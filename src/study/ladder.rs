//! A plan at other densities and dwells: the rungs of what accuracy costs in time.

use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use std::time::Duration;

use crate::plan::{Adaptive, Change, Plan, Schedule, Stop};

/// A rung of the ladder: how a plan's density, dwell and speed are scaled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rung {
    /// Factor on the number of targets.
    pub density: f64,
    /// Factor on the dwell; of a sweep on its windows.
    pub dwell: f64,
    /// Factor on the way that a sweep goes in a window, beyond what the density says: on its speed
    /// where the dwell stays. A plan at rest has none.
    pub speed: f64,
}

/// Five rungs, each with about twice the integration time of the one below: more targets and
/// longer dwells, in equal parts of the factor. The plan itself stands in the middle.
pub const LADDER: [Rung; 5] = [
    Rung { density: 0.5, dwell: 0.5, speed: 1.0 },
    Rung { density: FRAC_1_SQRT_2, dwell: FRAC_1_SQRT_2, speed: 1.0 },
    Rung::ITSELF,
    Rung { density: SQRT_2, dwell: SQRT_2, speed: 1.0 },
    Rung { density: 2.0, dwell: 2.0, speed: 1.0 },
];

/// Finer steps than these are finer than any rig: see the plan's own bounds.
const STEP_DEG_MIN: f64 = 0.01;

impl Rung {
    /// The plan as it is.
    pub const ITSELF: Self = Self { density: 1.0, dwell: 1.0, speed: 1.0 };

    /// The plan of this rung, as a text of its own: see [`Self::apply`]. `None` where the plan's text
    /// can't be changed.
    pub fn text(&self, plan: &Plan) -> Option<Plan> {
        let wanted = self.apply(plan);
        let mut changes = spacing(&wanted.schedule);
        if wanted.fit.angular_degree != plan.fit.angular_degree {
            let degree = wanted.fit.angular_degree?;
            changes.push(Change::set("fit", "angular_degree", degree));
        }
        let dwell_ms = wanted.dwell.as_secs_f64() * 1e3;
        changes.push(Change::set("dwell", "dwell_ms", dwell_ms));
        let gone =
            [("schedule", "window_ms"), ("stop", "exitance_relative"), ("stop", "rig_time_s_max")];
        let is_kept = |key: &str| key == "rig_time_s_max" && plan.adaptive().is_some();
        let gone = gone.into_iter().filter(|(_, key)| !is_kept(key));
        changes.extend(gone.map(|(table, key)| Change::remove(table, key)));
        let found = plan.changed(&changes)?;
        // A text that could not be changed is read as it was.
        let is_wanted = found.schedule == wanted.schedule
            && found.dwell.abs_diff(wanted.dwell) <= Duration::from_micros(1)
            && found.fit == wanted.fit;
        is_wanted.then_some(found)
    }

    /// The plan with its number of targets and its dwell scaled, and with its angular degree as the
    /// spacing of the targets allows: denser targets resolve more. Steps in φ and C keep dividing
    /// the circle; the grid over the sample stays, since it is the fit's degree in position that
    /// asks for it. A list of poses has no density: only its dwell scales.
    #[must_use]
    pub fn apply(&self, plan: &Plan) -> Plan {
        let mut plan = plan.clone();
        let finer = libm::sqrt(self.density);
        let finer_step = |step: f64| (step / finer).max(STEP_DEG_MIN);
        let finer_turn = |step: f64| 360.0 / libm::round(360.0 / step * finer).max(1.0);
        // An arm that flies over the top takes two meridians at once: an even number of them.
        let finer_pairs = |step: f64| match 360.0 / step {
            pairs if libm::round(pairs) % 2.0 == 0.0 => {
                180.0 / libm::round(0.5 * pairs * finer).max(1.0)
            }
            _ => finer_turn(step),
        };
        plan.schedule = match plan.schedule {
            Schedule::CGamma { x_count, y_count, c_step_deg, gamma_step_deg } => Schedule::CGamma {
                x_count,
                y_count,
                c_step_deg: finer_turn(c_step_deg),
                gamma_step_deg: finer_step(gamma_step_deg),
            },
            Schedule::Raster { x_count, y_count, theta_step_deg, phi_step_deg } => {
                Schedule::Raster {
                    x_count,
                    y_count,
                    theta_step_deg: finer_step(theta_step_deg),
                    phi_step_deg: finer_turn(phi_step_deg),
                }
            }
            Schedule::LowDiscrepancy { count } => {
                Schedule::LowDiscrepancy { count: scaled_count(count, self.density) }
            }
            Schedule::Quadrature { x_count, y_count, theta_count, phi_count } => {
                Schedule::Quadrature {
                    x_count,
                    y_count,
                    theta_count: scaled_count(theta_count, finer),
                    phi_count: scaled_count(phi_count, finer),
                }
            }
            Schedule::Sweep {
                x_count,
                y_count,
                phi_step_deg,
                is_interleaved,
                speed_deg_per_s,
                narrowest_feature_deg,
            } => Schedule::Sweep {
                x_count,
                y_count,
                phi_step_deg: finer_pairs(phi_step_deg),
                is_interleaved,
                speed_deg_per_s: speed_deg_per_s.map(|speed| speed * self.speed / finer),
                narrowest_feature_deg: narrowest_feature_deg
                    .map(|width| finer_step(width * self.speed)),
            },
            spiral @ Schedule::Spiral { .. } => {
                turned(spiral, &finer_step, &|width| finer_step(width * self.speed))
            }
            // An error so many times smaller, as if by noise alone.
            Schedule::Adaptive(adaptive) => Schedule::Adaptive(Adaptive {
                radiance_relative: adaptive.radiance_relative.map(|error| error / finer),
                exitance_relative: adaptive.exitance_relative.map(|error| error / finer),
                exitance_within_region_relative: adaptive
                    .exitance_within_region_relative
                    .map(|error| error / finer),
                ..adaptive
            }),
            list @ Schedule::List { .. } => list,
        };
        if plan.list_file().is_none() {
            plan.fit.angular_degree =
                plan.fit.angular_degree.map(|degree| scaled_degree(degree, finer));
        }
        plan.dwell = whole_micros(plan.dwell.mul_f64(self.dwell));
        // What a rung is compared by is what its rules would have ended it by.
        plan.stop = Stop {
            exitance_relative: None,
            // Where readings decide there is nothing else that ends a run in any case.
            rig_time_max: plan.stop.rig_time_max.filter(|_| plan.adaptive().is_some()),
        };
        plan
    }

    /// As a row of frontier.csv names it.
    pub fn parameters(&self) -> String {
        let Self { density, dwell, speed } = self;
        let words = format!("density={density:.3} dwell={dwell:.3}");
        if (speed - 1.0).abs() > 1e-12 { format!("{words} speed={speed:.3}") } else { words }
    }
}

/// The keys that say how dense a schedule is.
pub(super) fn spacing(schedule: &Schedule) -> Vec<Change> {
    let set = |key: &'static str, value: f64| Change::set("schedule", key, value);
    match *schedule {
        Schedule::CGamma { c_step_deg, gamma_step_deg, .. } => {
            vec![set("c_step_deg", c_step_deg), set("gamma_step_deg", gamma_step_deg)]
        }
        Schedule::Raster { theta_step_deg, phi_step_deg, .. } => {
            vec![set("theta_step_deg", theta_step_deg), set("phi_step_deg", phi_step_deg)]
        }
        Schedule::LowDiscrepancy { count } => vec![Change::set("schedule", "count", count)],
        Schedule::Quadrature { theta_count, phi_count, .. } => vec![
            Change::set("schedule", "theta_count", theta_count),
            Change::set("schedule", "phi_count", phi_count),
        ],
        Schedule::Sweep { phi_step_deg, speed_deg_per_s, narrowest_feature_deg, .. } => {
            let mut changes = vec![set("phi_step_deg", phi_step_deg)];
            changes.extend(speed_deg_per_s.map(|speed| set("speed_deg_per_s", speed)));
            changes.extend(
                narrowest_feature_deg.map(|narrowest| set("narrowest_feature_deg", narrowest)),
            );
            changes
        }
        Schedule::Spiral { theta_step_deg, narrowest_feature_deg, .. } => vec![
            set("theta_step_deg", theta_step_deg),
            set("narrowest_feature_deg", narrowest_feature_deg),
        ],
        Schedule::Adaptive(Adaptive {
            radiance_relative,
            exitance_relative,
            exitance_within_region_relative,
            ..
        }) => [
            ("radiance_relative", radiance_relative),
            ("exitance_relative", exitance_relative),
            ("exitance_within_region_relative", exitance_within_region_relative),
        ]
        .into_iter()
        .filter_map(|(key, error)| Some(set(key, error?)))
        .collect(),
        Schedule::List { .. } => Vec::new(),
    }
}

/// A spiral with other turns, for features of another width.
fn turned(mut spiral: Schedule, step: &dyn Fn(f64) -> f64, width: &dyn Fn(f64) -> f64) -> Schedule {
    if let Schedule::Spiral { theta_step_deg, narrowest_feature_deg, .. } = &mut spiral {
        *theta_step_deg = step(*theta_step_deg);
        *narrowest_feature_deg = width(*narrowest_feature_deg);
    }
    spiral
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates, and is positive
fn scaled_count(count: u32, factor: f64) -> u32 {
    (libm::round(f64::from(count) * factor) as u32).max(1)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
fn scaled_degree(degree: usize, finer: f64) -> usize {
    libm::floor(degree as f64 * finer) as usize
}

/// The wire counts microseconds.
fn whole_micros(duration: Duration) -> Duration {
    Duration::from_micros(u64::try_from(duration.as_micros()).unwrap_or(u64::MAX).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan_by;

    fn plan(schedule: &str) -> Plan {
        plan_by(schedule, "angular_degree = 2\nposition_degree = 0")
    }

    #[test]
    fn the_middle_rung_is_the_plan_itself() {
        let plan = plan("kind = \"low-discrepancy\"\ncount = 500");
        let same = LADDER[2].apply(&plan);
        assert_eq!((same.schedule, same.dwell), (plan.schedule, plan.dwell));
    }

    #[test]
    fn meridians_flown_in_pairs_stay_pairs() {
        let plan = plan(
            "kind = \"sweep\"\nx_count = 1\ny_count = 1\nphi_step_deg = 20\nnarrowest_feature_deg = 10",
        );
        for rung in LADDER {
            let Schedule::Sweep { phi_step_deg, narrowest_feature_deg, .. } =
                rung.apply(&plan).schedule
            else {
                panic!("a sweep stays a sweep");
            };
            let pairs = 180.0 / phi_step_deg;
            assert!((pairs - libm::round(pairs)).abs() < 1e-12, "{phi_step_deg}");
            let narrowest = 10.0 / libm::sqrt(rung.density);
            assert!((narrowest_feature_deg.unwrap() - narrowest).abs() < 1e-12);
            assert_eq!(rung.text(&plan).unwrap().schedule, rung.apply(&plan).schedule);
        }
    }

    #[test]
    fn density_scales_targets_and_turns_stay_whole() {
        let plan = plan(
            "kind = \"raster\"\nx_count = 1\ny_count = 1\ntheta_step_deg = 10\nphi_step_deg = 30",
        );
        let finer = LADDER[4].apply(&plan);
        let Schedule::Raster { theta_step_deg, phi_step_deg, .. } = finer.schedule else {
            panic!("a raster stays a raster");
        };
        assert!((theta_step_deg - 10.0 / libm::sqrt(2.0)).abs() < 1e-12);
        assert!((360.0 / phi_step_deg - 17.0).abs() < 1e-12, "{phi_step_deg}");
        assert_eq!(finer.dwell, Duration::from_millis(100));
    }
}
