//! A plan by other means: at rest at every target, or in flight past them. Every variant is the
//! plan's own text with some keys changed, read again, so that what is run is what is written.

use crate::plan::{Change, Plan, Schedule};

/// How a plan takes its readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Motion {
    /// A reading at a time, the axes at rest.
    StopAndGo,
    /// In windows while the arm flies along a meridian.
    Sweep,
    /// In sweeps that the readings so far decide upon.
    Adaptive,
}

/// Meridians where neither the plan's grid nor its fit says how many.
const PHI_STEP_DEG: f64 = 15.0;
/// Columns and rows of places where the plan pins no degree in position.
const PLACES: usize = 2;

/// What is asked of readings that decide, and how long they may take, where the plan doesn't say.
const RADIANCE_RELATIVE: f64 = 0.02;
const RIG_TIME_S: f64 = 7200.0;

impl Motion {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::StopAndGo, Self::Sweep, Self::Adaptive];

    /// As frontier.csv and the command line say it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::StopAndGo => "stop-and-go",
            Self::Sweep => "sweep",
            Self::Adaptive => "adaptive",
        }
    }

    /// The one of a schedule.
    pub fn of(schedule: &Schedule) -> Self {
        match schedule {
            Schedule::Adaptive(_) => Self::Adaptive,
            Schedule::Spiral { .. } | Schedule::Sweep { .. } => Self::Sweep,
            Schedule::CGamma { .. }
            | Schedule::List { .. }
            | Schedule::LowDiscrepancy { .. }
            | Schedule::Quadrature { .. }
            | Schedule::Raster { .. } => Self::StopAndGo,
        }
    }

    /// What makes the plan one of this strategy: nothing where it is; `None` where it can't be,
    /// since a list of poses has no meridians.
    ///
    /// Sweeps take the meridians and the places of a grid; where the schedule has none, as many as
    /// the fit's degrees need. A grid takes the sweeps' meridians and places, and two circles within
    /// the narrowest feature. An adaptive plan takes the places of either, and asks for 2 % of the
    /// radiance, and leaves the fit's basis to the readings.
    pub fn changes(self, plan: &Plan) -> Option<Vec<Change>> {
        match (Self::of(&plan.schedule), self) {
            (from, to) if from == to => Some(Vec::new()),
            (Self::StopAndGo, Self::Sweep) => sweeps(plan),
            (Self::Sweep, Self::StopAndGo) => grid(plan),
            (Self::StopAndGo | Self::Sweep, Self::Adaptive) => adaptive(plan),
            // An error to reach does not say how fine a grid is.
            _ => None,
        }
    }
}

fn sweeps(plan: &Plan) -> Option<Vec<Change>> {
    let places =
        u32::try_from(plan.fit.position_degree.map_or(PLACES, |degree| degree + 1)).ok()?;
    let (places, phi_step_deg, theta_step_deg) = match plan.schedule {
        Schedule::CGamma { x_count, y_count, c_step_deg, gamma_step_deg } => {
            ((x_count, y_count), c_step_deg, gamma_step_deg)
        }
        Schedule::Raster { x_count, y_count, theta_step_deg, phi_step_deg } => {
            ((x_count, y_count), phi_step_deg, theta_step_deg)
        }
        Schedule::Quadrature { x_count, y_count, theta_count, phi_count } => {
            // The nodes lie closest to the edge; their mean distance is what they resolve.
            let theta_step_deg = plan.region.theta_max_rad.to_degrees() / f64::from(theta_count);
            ((x_count, y_count), 360.0 / f64::from(phi_count), theta_step_deg)
        }
        Schedule::LowDiscrepancy { .. } => {
            // A polynomial of degree n has n waves round the circle: 2n + 1 meridians, made even.
            let step = |degree: usize| 360.0 / (2 * (degree + 1)) as f64;
            let step = plan.fit.angular_degree.map_or(PHI_STEP_DEG, step);
            ((places, places), step, step)
        }
        Schedule::Adaptive(_)
        | Schedule::List { .. }
        | Schedule::Spiral { .. }
        | Schedule::Sweep { .. } => return None,
    };
    // What the grid resolves where the plan doesn't say what there is to resolve.
    let declared = plan.expect.narrowest_feature_rad.map(f64::to_degrees);
    let narrowest_feature_deg = declared.unwrap_or(2.0 * theta_step_deg);
    let gone = [
        "count",
        "theta_count",
        "phi_count",
        "theta_step_deg",
        "gamma_step_deg",
        "c_step_deg",
        "order",
    ];
    let mut changes: Vec<Change> =
        gone.into_iter().map(|key| Change::remove("schedule", key)).collect();
    changes.push(Change::remove("dwell", "allocation"));
    changes.push(Change::set("schedule", "kind", "\"sweep\""));
    changes.push(Change::set("schedule", "x_count", places.0));
    changes.push(Change::set("schedule", "y_count", places.1));
    changes.push(Change::set("schedule", "phi_step_deg", phi_step_deg));
    changes.push(Change::set("schedule", "narrowest_feature_deg", narrowest_feature_deg));
    Some(changes)
}

/// The places of a grid or of sweeps, and the narrowest feature that they resolve; as long as it takes,
/// within reason.
fn adaptive(plan: &Plan) -> Option<Vec<Change>> {
    let flown = match Motion::of(&plan.schedule) {
        Motion::Sweep => plan.clone(),
        _ => plan.changed(&sweeps(plan)?)?,
    };
    let Schedule::Sweep { x_count, y_count, phi_step_deg, narrowest_feature_deg, .. } =
        flown.schedule
    else {
        return None;
    };
    let declared = plan.expect.narrowest_feature_rad.map(f64::to_degrees);
    let narrowest_feature_deg = declared.or(narrowest_feature_deg).unwrap_or(phi_step_deg);
    let mut changes: Vec<Change> = [
        "count",
        "theta_count",
        "phi_count",
        "theta_step_deg",
        "gamma_step_deg",
        "c_step_deg",
        "phi_step_deg",
        "interleaved",
        "speed_deg_per_s",
        "order",
        "repeat",
    ]
    .into_iter()
    .map(|key| Change::remove("schedule", key))
    .collect();
    changes.push(Change::remove("stop", "exitance_relative"));
    changes.push(Change::remove("dwell", "allocation"));
    // Plain least squares of a given degree wants a grid as fine as that everywhere.
    changes.push(Change::remove("fit", "angular_degree"));
    changes.push(Change::set("schedule", "kind", "\"adaptive\""));
    changes.push(Change::set("schedule", "x_count", x_count));
    changes.push(Change::set("schedule", "y_count", y_count));
    changes.push(Change::set("schedule", "narrowest_feature_deg", narrowest_feature_deg));
    changes.push(Change::set("schedule", "radiance_relative", RADIANCE_RELATIVE));
    if plan.stop.rig_time_max.is_none() {
        changes.push(Change::set("stop", "rig_time_s_max", RIG_TIME_S));
    }
    Some(changes)
}

fn grid(plan: &Plan) -> Option<Vec<Change>> {
    let Schedule::Sweep { phi_step_deg, narrowest_feature_deg, .. } = plan.schedule else {
        return None;
    };
    let declared = plan.expect.narrowest_feature_rad.map(f64::to_degrees);
    let narrowest_feature_deg = narrowest_feature_deg.or(declared).unwrap_or(phi_step_deg);
    let gone = ["interleaved", "speed_deg_per_s", "narrowest_feature_deg", "window_ms"];
    let mut changes: Vec<Change> =
        gone.into_iter().map(|key| Change::remove("schedule", key)).collect();
    changes.push(Change::set("schedule", "kind", "\"raster\""));
    changes.push(Change::set("schedule", "theta_step_deg", 0.5 * narrowest_feature_deg));
    Some(changes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan_by;

    fn plan(schedule: &str) -> Plan {
        plan_by(schedule, "angular_degree = 8\nposition_degree = 2")
    }

    fn into(strategy: Motion, plan: &Plan) -> Schedule {
        plan.changed(&strategy.changes(plan).unwrap()).unwrap().schedule
    }

    #[test]
    fn a_grid_flies_along_its_own_meridians_and_comes_back() {
        let raster = plan(
            "kind = \"raster\"\nx_count = 2\ny_count = 3\ntheta_step_deg = 5\nphi_step_deg = 30",
        );
        let flown = into(Motion::Sweep, &raster);
        let expected = Schedule::Sweep {
            x_count: 2,
            y_count: 3,
            phi_step_deg: 30.0,
            is_interleaved: false,
            speed_deg_per_s: None,
            narrowest_feature_deg: Some(10.0),
        };
        assert_eq!(flown, expected);
        let sweep = plan(
            "kind = \"sweep\"\nx_count = 2\ny_count = 3\nphi_step_deg = 30\nnarrowest_feature_deg = 10\n\
             window_ms = 5",
        );
        assert_eq!(into(Motion::StopAndGo, &sweep), raster.schedule);
    }

    #[test]
    fn poses_that_fill_the_region_fly_as_the_fit_needs() {
        let plan = plan("kind = \"low-discrepancy\"\ncount = 500");
        let Schedule::Sweep { x_count, y_count, phi_step_deg, .. } = into(Motion::Sweep, &plan)
        else {
            panic!("a sweep");
        };
        assert_eq!((x_count, y_count, phi_step_deg), (3, 3, 20.0));
    }

    #[test]
    fn a_grid_that_readings_decide_upon_keeps_its_places_and_its_narrowest_feature() {
        let raster = plan(
            "kind = \"raster\"\nx_count = 2\ny_count = 3\ntheta_step_deg = 5\nphi_step_deg = 30\n\
             order = \"listed\"\nrepeat = 2",
        );
        let changed = raster.changed(&Motion::Adaptive.changes(&raster).unwrap()).unwrap();
        let adaptive = changed.adaptive().unwrap();
        assert_eq!((adaptive.x_count, adaptive.y_count), (2, 3));
        assert!((adaptive.narrowest_feature_deg - 10.0).abs() < 1e-12);
        assert!(changed.stop.rig_time_max.is_some());
        assert_eq!(Motion::Sweep.changes(&changed), None);
    }

    #[test]
    fn a_list_can_not_fly_and_stays_what_it_is() {
        let list = plan("kind = \"list\"\nfile = \"poses.csv\"");
        assert_eq!(Motion::Sweep.changes(&list), None);
        assert_eq!(Motion::StopAndGo.changes(&list), Some(Vec::new()));
    }
}
