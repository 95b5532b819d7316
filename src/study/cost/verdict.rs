//! From scored runs to times: the first rung of a ladder that meets a target, and how strategies
//! compare, with the scene known beforehand and without.

use super::{Rung, Scene, Strategy};
use crate::study::median;

/// What is asked of a run, once the factor that fits the truth best is taken out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// RMS error of the radiance over the region, relative to the truth's RMS, at most.
    Radiance(f64),
    /// Error of the exitance into the region's directions, relative, at most.
    Exitance(f64),
}

/// One scored run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// What it looked at.
    pub scene: Scene,
    /// How.
    pub strategy: Strategy,
    /// By which plan.
    pub rung: Rung,
    /// Of the simulated rig.
    pub seed: u64,
    /// From the first reading's beginning to the last one's end, seconds; homing comes before.
    pub rig_s: f64,
    /// What the axes need for the same path, and the readings for themselves, seconds.
    pub bound_s: f64,
    /// Waiting for axes to be still, which the bound leaves out, seconds.
    pub settling_s: f64,
    /// Readings of all kinds.
    pub readings: usize,
    /// RMS error of the radiance, relative, without the common factor.
    pub radiance: f64,
    /// Error of the exitance within the region, relative, without it.
    pub exitance: f64,
    /// That factor: what the result has to be multiplied by.
    pub factor: f64,
    /// Of a fit: RMS error of the prediction of readings of sweeps left out, over their stated u.
    pub left_out_rms: Option<f64>,
    /// Of a fit: the narrowest feature that its report claims to show, degrees of arc; what is narrower
    /// was not looked for.
    pub resolves_deg: Option<f64>,
    /// Of a run that decides: whether it ended believing that its target is met.
    pub believes: Option<bool>,
    /// Of a fit: its basis and how many coefficients that has.
    pub basis: Option<(String, usize)>,
    /// Processor's wall time, seconds: the simulation is in it where no other strategy had it made.
    pub compute_s: f64,
}

impl Target {
    /// All that are asked.
    pub const ALL: [Self; 5] = [
        Self::Radiance(0.05),
        Self::Radiance(0.02),
        Self::Radiance(0.01),
        Self::Exitance(0.01),
        Self::Exitance(0.003),
    ];

    /// As tables and cost.csv name it.
    pub fn name(self) -> String {
        match self {
            Self::Radiance(part) => format!("L {} %", 100.0 * part),
            Self::Exitance(part) => format!("M {} %", 100.0 * part),
        }
    }

    fn times(self, factor: f64) -> Self {
        match self {
            Self::Radiance(most) => Self::Radiance(factor * most),
            Self::Exitance(most) => Self::Exitance(factor * most),
        }
    }

    /// Whether the median of runs meets it; runs of one rung and one strategy, other seeds.
    pub fn is_met(self, runs: &[Run]) -> bool {
        let (most, error): (f64, fn(&Run) -> f64) = match self {
            Self::Radiance(most) => (most, |run| run.radiance),
            Self::Exitance(most) => (most, |run| run.exitance.abs()),
        };
        median(runs.iter().map(error)).is_some_and(|error| error <= most)
    }
}
/// When a strategy met a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Reached {
    /// Of what.
    pub scene: Scene,
    /// How.
    pub strategy: Strategy,
    /// What.
    pub target: Target,
    /// The rung, its rig time in seconds, and how many seeds its median is of; `None` where no
    /// rung met it.
    pub at: Option<(Rung, f64, usize)>,
    /// Rig time of the longest rung that was run, seconds.
    pub longest_s: f64,
}

/// One strategy going up the ladder in one scene.
#[derive(Debug, Clone)]
pub struct Climb {
    reached: Vec<Reached>,
}

impl Climb {
    /// At the foot.
    pub fn new(scene: Scene, strategy: Strategy) -> Self {
        let open = |target| Reached { scene, strategy, target, at: None, longest_s: 0.0 };
        Self { reached: Target::ALL.into_iter().map(open).collect() }
    }

    /// Whether every target is met: nothing above is of interest.
    pub fn is_done(&self) -> bool {
        self.reached.iter().all(|reached| reached.at.is_some())
    }

    /// Whether these runs of a rung would meet a target that is open.
    pub fn would_meet(&self, runs: &[Run]) -> bool {
        self.reached.iter().any(|reached| reached.at.is_none() && reached.target.is_met(runs))
    }

    /// Whether these runs of a rung come so close to a target that is open that others, of other seeds,
    /// might meet it.
    pub fn might_meet(&self, runs: &[Run]) -> bool {
        let might = |target: Target| target.times(MIGHT).is_met(runs);
        self.reached.iter().any(|reached| reached.at.is_none() && might(reached.target))
    }

    /// Takes the runs of the next rung.
    pub fn settle(&mut self, runs: &[Run]) {
        let (Some(first), Some(rig_s)) = (runs.first(), median(runs.iter().map(|r| r.rig_s)))
        else {
            return;
        };
        for reached in &mut self.reached {
            reached.longest_s = reached.longest_s.max(rig_s);
            if reached.at.is_none() && reached.target.is_met(runs) {
                reached.at = Some((first.rung, rig_s, runs.len()));
            }
        }
    }

    /// What came of it.
    pub fn reached(self) -> Vec<Reached> {
        self.reached
    }
}

/// A run off by more than so many times a target is not made again with other seeds.
const MIGHT: f64 = 2.0;

/// One strategy beside a baseline at one target, over the common scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// The baseline.
    pub baseline: Strategy,
    /// What is compared with it.
    pub strategy: Strategy,
    /// What is asked.
    pub target: Target,
    /// Rig time of the one plan of the baseline that serves the hardest scene, seconds.
    pub fixed_s: f64,
    /// Whether no plan of the baseline serves all scenes: the time is then that of its longest, and
    /// ratios are at least what is said.
    pub is_at_least: bool,
    /// How many times less rig time the strategy takes, scene by scene; 0 where it does not reach
    /// the target.
    pub ratios: Vec<(Scene, f64)>,
}

impl Compared {
    /// The median ratio.
    pub fn median(&self) -> f64 {
        median(self.ratios.iter().map(|(_, ratio)| *ratio)).unwrap_or(0.0)
    }

    /// The lowest one.
    pub fn worst(&self) -> f64 {
        self.ratios.iter().map(|(_, ratio)| *ratio).fold(f64::INFINITY, f64::min)
    }
}

/// Against the baseline's one fixed plan for scenes that nobody knows beforehand. `None` where
/// either was not run.
pub fn compared(
    reached: &[Reached],
    baseline: Strategy,
    strategy: Strategy,
    target: Target,
) -> Option<Compared> {
    let of = |wanted: Strategy| {
        reached
            .iter()
            .filter(move |r| r.strategy == wanted && r.target == target && r.scene.is_common())
    };
    let time = |r: &Reached| r.at.map_or(r.longest_s, |(_, rig_s, _)| rig_s);
    let fixed_s = of(baseline).map(time).fold(0.0, f64::max);
    let is_at_least = of(baseline).any(|r| r.at.is_none());
    let ratio = |r: &Reached| (r.scene, r.at.map_or(0.0, |(_, rig_s, _)| fixed_s / rig_s));
    let ratios: Vec<(Scene, f64)> = of(strategy).map(ratio).collect();
    let is_known = fixed_s > 0.0 && !ratios.is_empty();
    is_known.then_some(Compared { baseline, strategy, target, fixed_s, is_at_least, ratios })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::ladder;
    use super::*;

    pub(in super::super) fn run(
        scene: Scene,
        strategy: Strategy,
        rig_s: f64,
        radiance: f64,
    ) -> Run {
        let rung = ladder(strategy.motion(), false)[4];
        Run {
            scene,
            strategy,
            rung,
            seed: 1,
            rig_s,
            bound_s: 0.99 * rig_s,
            settling_s: 0.0,
            readings: 10,
            radiance,
            exitance: -0.5 * radiance,
            factor: 1.0,
            left_out_rms: None,
            resolves_deg: None,
            believes: None,
            basis: None,
            compute_s: 0.0,
        }
    }

    /// A climb over rungs of ten seconds, twenty, forty.
    pub(in super::super) fn climbed(
        scene: Scene,
        strategy: Strategy,
        errors: &[f64],
    ) -> Vec<Reached> {
        let mut climb = Climb::new(scene, strategy);
        let mut rig_s = 10.0;
        for error in errors {
            climb.settle(&[run(scene, strategy, rig_s, *error)]);
            rig_s *= 2.0;
        }
        climb.reached()
    }

    #[test]
    fn the_first_rung_whose_median_meets_a_target_is_its_time() {
        let mut climb = Climb::new(Scene::Gloss, Strategy::FlightFitted);
        let of = |rig_s, errors: [f64; 3]| {
            errors.map(|e| run(Scene::Gloss, Strategy::FlightFitted, rig_s, e)).to_vec()
        };
        climb.settle(&of(10.0, [0.04, 0.2, 0.06]));
        assert!(climb.would_meet(&of(20.0, [0.3, 0.02, 0.01])));
        assert!(!climb.would_meet(&of(20.0, [0.07; 3])) && climb.might_meet(&of(20.0, [0.07; 3])));
        assert!(!climb.might_meet(&of(20.0, [0.11; 3])));
        climb.settle(&of(20.0, [0.3, 0.02, 0.01]));
        assert!(!climb.is_done());
        climb.settle(&of(40.0, [0.004, 0.004, 0.004]));
        climb.settle(&of(80.0, [0.0, 0.0, 0.0]));
        assert!(climb.is_done() && !climb.would_meet(&of(80.0, [0.0; 3])));
        let times: Vec<f64> =
            climb.reached().iter().map(|r| r.at.map_or(0.0, |(_, rig_s, _)| rig_s)).collect();
        assert_eq!(times, [20.0, 20.0, 40.0, 20.0, 40.0]);
    }

    #[test]
    fn the_fixed_plan_is_that_of_the_hardest_scene_and_a_miss_is_no_gain() {
        let mut reached = climbed(Scene::Lambertian, Strategy::FlightInterpolated, &[0.001]);
        reached.extend(climbed(Scene::Gloss, Strategy::FlightInterpolated, &[0.1, 0.1, 0.001]));
        reached.extend(climbed(Scene::Lambertian, Strategy::FlightFitted, &[0.001]));
        reached.extend(climbed(Scene::Gloss, Strategy::FlightFitted, &[0.1, 0.001]));
        // Not a scene that a plan has to serve unknown.
        reached.extend(climbed(Scene::Spike, Strategy::FlightInterpolated, &[0.5; 9]));
        let [base, ours] = [Strategy::FlightInterpolated, Strategy::FlightFitted];
        let found = compared(&reached, base, ours, Target::ALL[2]).unwrap();
        assert!(!found.is_at_least);
        assert_eq!(found.ratios, [(Scene::Lambertian, 4.0), (Scene::Gloss, 2.0)]);
        assert_eq!((found.median(), found.worst()), (3.0, 2.0));
        reached.extend(climbed(Scene::Batwing, Strategy::FlightFitted, &[0.1]));
        reached.extend(climbed(Scene::Batwing, base, &[0.1; 5]));
        let found = compared(&reached, base, ours, Target::ALL[2]).unwrap();
        assert!(found.is_at_least && found.worst().abs() < 1e-15);
        assert_eq!(compared(&reached, Strategy::RestInterpolated, ours, Target::ALL[2]), None);
    }
}
