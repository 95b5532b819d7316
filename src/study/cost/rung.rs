//! Strategies, and their ladders of plans. All know the same: the region, the detector's noise, and
//! the narrowest feature that is looked for.

use std::fmt::Write as _;

use crate::study::Motion;

/// How readings are taken, and what is made of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Strategy {
    /// The field's habit: a raster at rest, interpolated by cubic splines.
    RestInterpolated,
    /// A raster in flight, interpolated by cubic splines.
    FlightInterpolated,
    /// A raster at rest, fitted in a basis chosen by leaving out sweeps.
    RestFitted,
    /// A raster in flight, fitted likewise.
    FlightFitted,
    /// Sweeps that the readings decide upon, fitted.
    AdaptiveFitted,
}

impl Strategy {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::RestInterpolated,
        Self::FlightInterpolated,
        Self::RestFitted,
        Self::FlightFitted,
        Self::AdaptiveFitted,
    ];
    /// Those in flight with a fit, which the aims are about.
    pub const AIMED: [Self; 2] = [Self::FlightFitted, Self::AdaptiveFitted];

    /// As the command line and cost.csv name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RestInterpolated => "stop-and-go+interpolation",
            Self::FlightInterpolated => "sweeps+interpolation",
            Self::RestFitted => "stop-and-go+fit",
            Self::FlightFitted => "sweeps+fit",
            Self::AdaptiveFitted => "adaptive",
        }
    }

    /// How it takes its readings.
    pub const fn motion(self) -> Motion {
        match self {
            Self::RestInterpolated | Self::RestFitted => Motion::StopAndGo,
            Self::FlightInterpolated | Self::FlightFitted => Motion::Sweep,
            Self::AdaptiveFitted => Motion::Adaptive,
        }
    }

    /// Whether a field is fitted to its readings. A rung with a single place is none for it: nobody
    /// who doesn't know the scene can stop before he has seen more than one.
    pub const fn is_fitted(self) -> bool {
        !matches!(self, Self::RestInterpolated | Self::FlightInterpolated)
    }

    /// Whether the rung is one of its own. What is interleaved is no grid to interpolate on.
    pub const fn takes(self, rung: &Rung) -> bool {
        if self.is_fitted() { rung.places > 1 } else { !rung.is_interleaved }
    }
}

/// A plan of a ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rung {
    /// How readings are taken.
    pub motion: Motion,
    /// Columns of places, and as many rows; of an adaptive one those of its first round.
    pub places: u32,
    /// Meridians, an even number; of an adaptive one those that it begins with, none where they are as
    /// many as the narrowest feature asks.
    pub meridians: u32,
    /// Whether each meridian is flown at one place alone.
    pub is_interleaved: bool,
    /// Between circles, of a raster at rest, degrees. A window's way follows from the feature that
    /// is looked for.
    pub theta_step_deg: f64,
    /// How many times as long as usual a reading is.
    pub longer: u32,
    /// A dark reading, milliseconds.
    pub dark_ms: u32,
    /// What an adaptive plan is told to reach: the errors of radiance and exitance, relative.
    pub wanted: Option<(f64, f64)>,
}

/// The ladder of a motion, not in the order of time: what a rung takes the rig tells. A dim source
/// gets longer readings too, since who plans knows the noise.
pub fn ladder(motion: Motion, is_dim: bool) -> Vec<Rung> {
    let rung = |places, theta_step_deg, meridians, longer| Rung {
        motion,
        places,
        meridians,
        is_interleaved: false,
        theta_step_deg,
        longer,
        dark_ms: DARK_MS,
        wanted: None,
    };
    let dealt = |longer: &[u32]| -> Vec<Rung> {
        let of = |&(places, meridians): &(u32, u32)| {
            let rung = rung(places, 0.0, meridians, 1);
            let of =
                move |&longer| Rung { is_interleaved: true, dark_ms: DARK_LONG_MS, longer, ..rung };
            longer.iter().map(of)
        };
        INTERLEAVED.iter().flat_map(of).collect()
    };
    let longer: &[u32] = if is_dim { &[1, 4, 16] } else { &[1] };
    let with = |grids: &[(u32, f64, u32)]| -> Vec<Rung> {
        let of = |&(places, step, meridians): &(u32, f64, u32)| {
            longer.iter().map(move |longer| rung(places, step, meridians, *longer))
        };
        grids.iter().flat_map(of).collect()
    };
    match (motion, is_dim) {
        (Motion::StopAndGo, false) => with(&AT_REST),
        (Motion::StopAndGo, true) => with(&AT_REST_DIM),
        (Motion::Sweep, false) => [with(&IN_FLIGHT), dealt(&[1])].concat(),
        (Motion::Sweep, true) => [with(&IN_FLIGHT_DIM), dealt(&[1, 2, 4])].concat(),
        (Motion::Adaptive, _) => {
            let of =
                |(wanted, meridians)| Rung { wanted: Some(wanted), ..rung(2, 0.0, meridians, 1) };
            DECIDING.map(of).to_vec()
        }
    }
}

impl Rung {
    /// As cost.csv and tables name it.
    pub fn name(&self) -> String {
        let Self { places, meridians, theta_step_deg, .. } = self;
        let dwell_ms = self.dwell_ms();
        if let Some((radiance, exitance)) = self.wanted {
            let until = format!("until L {} %, M {} %", 100.0 * radiance, 100.0 * exitance);
            let begun = match meridians {
                0 => "as many meridians as declared".to_owned(),
                count => format!("{count} meridians"),
            };
            return format!("{until}, begun with {begun}, windows of {dwell_ms} ms");
        }
        let mut name = format!("{places}x{places} places, {meridians} meridians");
        if self.is_interleaved {
            name.push_str(" interleaved");
        }
        // Writing to a string does not fail.
        let _ = match self.motion {
            Motion::StopAndGo => write!(name, ", {theta_step_deg} deg, {dwell_ms} ms"),
            Motion::Sweep | Motion::Adaptive => write!(name, ", windows of {dwell_ms} ms"),
        };
        name
    }

    fn dwell_ms(&self) -> u32 {
        let usual = match self.motion {
            Motion::StopAndGo => DWELL_MS,
            Motion::Sweep | Motion::Adaptive => WINDOW_MS,
        };
        usual * self.longer
    }

    /// plan.toml.
    pub fn plan(&self) -> String {
        let Self { places, meridians, theta_step_deg, .. } = self;
        let (dwell_ms, dark_ms) = (self.dwell_ms(), self.dark_ms);
        let turn = format!("phi_step_deg = {}\n", 360.0 / f64::from((*meridians).max(1)));
        let (schedule, turn, dark_every) = match self.motion {
            Motion::StopAndGo => {
                let schedule = format!("kind = \"raster\"\ntheta_step_deg = {theta_step_deg}\n");
                (schedule, turn, DARK_AT_REST)
            }
            Motion::Sweep => {
                let mut schedule =
                    format!("kind = \"sweep\"\nnarrowest_feature_deg = {NARROWEST_DEG}\n");
                if self.is_interleaved {
                    schedule.push_str("interleaved = true\n");
                }
                (schedule, turn, DARK_IN_FLIGHT)
            }
            Motion::Adaptive => {
                let (radiance, exitance) = self.wanted.unwrap_or(DECIDING[0].0);
                let schedule = format!(
                    "kind = \"adaptive\"\nnarrowest_feature_deg = {NARROWEST_DEG}\n\
                     radiance_relative = {radiance}\n\
                     exitance_within_region_relative = {exitance}\n"
                );
                let turn = if *meridians > 0 { turn } else { String::new() };
                (schedule, turn, DARK_IN_FLIGHT)
            }
        };
        let stop = match self.motion {
            Motion::Adaptive => format!("\n[stop]\nrig_time_s_max = {ADAPTIVE_S_MAX}\n"),
            Motion::StopAndGo | Motion::Sweep => String::new(),
        };
        format!(
            "name = \"cost\"\nrig = \"rig.toml\"\nscene = \"scene.toml\"\n\n[region]\n\
             x_mm = [-15, 15]\ny_mm = [-15, 15]\ntheta_max_deg = 80\n\n[schedule]\n{schedule}\
             x_count = {places}\ny_count = {places}\n{turn}\n[dwell]\n\
             dwell_ms = {dwell_ms}\ngain = \"1 nA\"\n\n[dark]\nmethod = \"shutter\"\n\
             every = {dark_every}\ndwell_ms = {dark_ms}\n\n[reference]\nx_mm = 0\ny_mm = 0\n\
             theta_deg = 0\nphi_deg = 0\nevery = {NEVER}\ndwell_ms = 100\n{stop}"
        )
    }
}

/// Full width at half maximum of the narrowest feature that plans declare: a little less than that
/// of the narrowest scene that does not break the promise.
const NARROWEST_DEG: f64 = 6.0;
const DWELL_MS: u32 = 50;
const WINDOW_MS: u32 = 25;
/// Readings in about a minute.
const DARK_AT_REST: u32 = 130;
const DARK_IN_FLIGHT: u32 = 1800;
const DARK_MS: u32 = 500;
/// Of interleaved sweeps: with the one at the end a tenth of the time of a dozen of them. Two of 0.5 s leave
/// 0.6 % of the exitance of a lobe 13.5° wide, by the noise model; these 0.2 %.
const DARK_LONG_MS: u32 = 4000;
/// Nothing drifts here: at the start and at the end is enough.
const NEVER: u32 = 1_000_000;

/// What adaptive plans are told to reach, radiance and exitance, and meridians of the first round: so many
/// that lobes of 15° show between them, which narrower ones may escape until others follow, or (0) as
/// many as the narrowest feature asks.
const DECIDING: [((f64, f64), u32); 5] = [
    ((0.05, 0.01), 18),
    ((0.02, 0.003), 18),
    ((0.05, 0.01), 0),
    ((0.02, 0.003), 0),
    ((0.01, 0.003), 0),
];
/// The end that comes in any case.
const ADAPTIVE_S_MAX: u32 = 1500;

/// Places a side, step in θ, meridians.
const AT_REST: [(u32, f64, u32); 14] = [
    (1, 16.0, 4),
    (1, 8.0, 12),
    (1, 5.0, 24),
    (2, 16.0, 4),
    (3, 16.0, 4),
    (4, 16.0, 4),
    (3, 10.0, 8),
    (3, 8.0, 12),
    (3, 5.0, 24),
    (4, 5.0, 24),
    (4, 4.0, 36),
    (4, 2.5, 36),
    (4, 2.0, 48),
    (4, 2.0, 72),
];
const AT_REST_DIM: [(u32, f64, u32); 5] =
    [(1, 8.0, 12), (1, 5.0, 24), (3, 10.0, 8), (3, 8.0, 12), (3, 5.0, 24)];
const IN_FLIGHT: [(u32, f64, u32); 14] = [
    (1, 0.0, 4),
    (1, 0.0, 12),
    (1, 0.0, 24),
    (2, 0.0, 4),
    (3, 0.0, 4),
    (4, 0.0, 4),
    (2, 0.0, 12),
    (3, 0.0, 8),
    (3, 0.0, 12),
    (3, 0.0, 24),
    (4, 0.0, 24),
    (4, 0.0, 36),
    (4, 0.0, 48),
    (4, 0.0, 72),
];
const IN_FLIGHT_DIM: [(u32, f64, u32); 5] =
    [(1, 0.0, 4), (1, 0.0, 12), (2, 0.0, 4), (2, 0.0, 12), (3, 0.0, 24)];
/// Places a side, meridians: each flown at one place alone.
const INTERLEAVED: [(u32, u32); 9] =
    [(2, 8), (2, 12), (2, 16), (2, 24), (2, 36), (2, 60), (3, 72), (2, 90), (2, 120)];

#[cfg(test)]
mod tests {
    use spanned_toml::{Document, Source};

    use super::super::Scene;
    use super::*;
    use crate::plan::Plan;
    use crate::rig::Rig;

    #[test]
    fn every_small_rung_is_a_plan_that_the_built_in_rig_can_do() {
        let rig = Rig::built_in().unwrap();
        for motion in Motion::ALL {
            for is_dim in [false, true] {
                let rungs = ladder(motion, is_dim);
                for rung in rungs.iter().filter(|r| r.places < 4 && r.meridians < 24) {
                    let text = rung.plan();
                    let plan =
                        Plan::read(Document::parse(Source::new("plan.toml", &text)).unwrap());
                    let sequence = plan.unwrap().lay_out(&rig, None).unwrap();
                    let longest_s = sequence.steps.iter().map(|s| s.dwell.as_secs_f64());
                    assert!(longest_s.fold(0.0, f64::max) >= f64::from(rung.dwell_ms()) / 1e3);
                    assert_eq!(rung.meridians % 2, 0, "{}", rung.name());
                }
            }
        }
    }

    #[test]
    fn names_differ_and_a_single_place_is_for_who_knows_the_scene() {
        let rungs: Vec<Rung> = Motion::ALL.into_iter().flat_map(|m| ladder(m, true)).collect();
        let names: std::collections::BTreeSet<String> = rungs.iter().map(Rung::name).collect();
        assert_eq!(names.len(), rungs.len());
        let alone = rungs.iter().filter(|rung| rung.places == 1);
        assert!(alone.clone().count() > 0);
        assert!(alone.clone().all(|rung| !Strategy::FlightFitted.takes(rung)));
        assert!(alone.clone().all(|rung| Strategy::FlightInterpolated.takes(rung)));
        assert_eq!(Scene::ALL.into_iter().filter(|scene| scene.is_common()).count(), 8);
    }
}
