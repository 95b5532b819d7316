//! One run of a study of cost: from the wire through the journal and the calibration that `gonio
//! run` has, to values at the nodes, by a fit or by splines through the readings; and their score.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Instant;

use super::cache::{Cache, Key};
use crate::cli::failure::Failure;
use crate::cli::results::{fit_region, optics};
use crate::cli::setup::Setup;
use crate::cli::study::coverage::PHOTOMETRIC;
use crate::cli::virtual_run::{Texts, VirtualRun};
use crate::plan::Plan;
use crate::rig::calibration::{Calibrated, calibrate};
use crate::rig::{Pose, Reading, Rig};
use crate::study::Motion;
use crate::study::cost::{Run, Rung, Scene, SceneFiles, Strategy, interpolate};
use crate::study::{Nodes, Score};

/// One scene before the simulated rig.
pub(super) struct Bench<'a> {
    scene: Scene,
    files: SceneFiles,
    rig: &'a str,
    /// Where journals are kept while they are written.
    work: &'a Path,
    program: &'a str,
    cache: Cache<'a>,
    truth: OnceCell<Truth>,
}

/// What is true at the nodes.
struct Truth {
    nodes: Nodes,
    radiance: Vec<f64>,
    exitance: f64,
}

/// What the readings of a run were made into.
struct Made {
    values: Vec<f64>,
    exitance: f64,
    left_out_rms: Option<f64>,
    resolves_deg: Option<f64>,
    basis: Option<(String, usize)>,
}

/// Readings of one plan with one seed.
struct Acquisition {
    setup: Setup,
    calibrated: Calibrated,
    readings: usize,
    rig_s: f64,
    compute_s: f64,
}

impl<'a> Bench<'a> {
    /// `program` names the build, for the cache.
    pub(super) fn new(
        scene: Scene,
        rig: &'a str,
        work: &'a Path,
        program: &'a str,
        cache: Option<&'a Path>,
    ) -> Self {
        let files = scene.files(PHOTOMETRIC);
        let (cache, truth) = (Cache::new(cache), OnceCell::new());
        Self { scene, files, rig, work, program, cache, truth }
    }

    pub(super) fn scene(&self) -> Scene {
        self.scene
    }

    /// How long a rung takes, without homing, as its plan says.
    pub(super) fn foretold_s(&self, rung: &Rung) -> Result<f64, Failure> {
        let rig = Rig::read(document("rig.toml", self.rig)?)?;
        let plan = Plan::read(document("plan.toml", &rung.plan())?)?;
        let prediction = plan.lay_out(&rig, None)?.prediction;
        Ok(prediction.total_s() - prediction.homing_s)
    }

    /// A run of each of these strategies, which share their readings; those that were made before
    /// are found in the cache.
    pub(super) fn runs(
        &self,
        rung: &Rung,
        seed: u64,
        strategies: &[Strategy],
    ) -> Result<Vec<Run>, Failure> {
        let plan = rung.plan();
        let mut acquired: Option<Acquisition> = None;
        let mut runs = Vec::new();
        for &strategy in strategies {
            let (scene, files, rig) = (self.scene, &self.files, self.rig);
            let key = Key { program: self.program, scene, files, rig, plan: &plan, seed, strategy };
            if let Some(run) = self.cache.find(&key, *rung) {
                runs.push(run);
                continue;
            }
            let one = match acquired.take() {
                Some(one) => Acquisition { compute_s: 0.0, ..one },
                None => self.acquire(&plan, seed, strategy)?,
            };
            let run = self.scored(&one, *rung, seed, strategy)?;
            self.cache.keep(&key, &run)?;
            runs.push(run);
            acquired = Some(one);
        }
        Ok(runs)
    }

    fn acquire(&self, plan: &str, seed: u64, strategy: Strategy) -> Result<Acquisition, Failure> {
        let began = Instant::now();
        let SceneFiles { text: scene, attachments } = &self.files;
        let setup = Texts { plan, rig: self.rig, scene, attachments }.setup(seed)?;
        // A scene is climbed by one thread for each motion.
        let folder = self.work.join(format!("{}-{}", self.scene.name(), strategy.name()));
        let VirtualRun { mut setup, readings, .. } = VirtualRun::passing(setup, &folder)?;
        if strategy.motion() == Motion::Adaptive {
            // Its time may have broken a round off: what it would have measured costs nothing.
            let taken: BTreeSet<u32> = readings.iter().map(|reading| reading.id).collect();
            let steps = setup.sequence.steps.iter().filter(|step| taken.contains(&step.id));
            let steps = steps.copied().collect();
            setup.sequence = setup.sequence.with_steps(&setup.rig, steps);
        }
        if readings.len() != setup.sequence.steps.len() {
            let (scene, seed) = (self.scene.name(), setup.seed);
            return Err(Failure::midway(format!("{scene}, seed {seed}: the run is not complete")));
        }
        let calibrated = calibrate(&setup.rig, &readings).map_err(Failure::midway)?;
        let compute_s = began.elapsed().as_secs_f64();
        let rig_s = span_s(&readings);
        Ok(Acquisition { setup, calibrated, readings: readings.len(), rig_s, compute_s })
    }

    fn scored(
        &self,
        one: &Acquisition,
        rung: Rung,
        seed: u64,
        strategy: Strategy,
    ) -> Result<Run, Failure> {
        let truth = self.truth(&one.setup)?;
        let began = Instant::now();
        let made = if strategy.is_fitted() {
            fitted(one, &truth.nodes)
        } else {
            interpolated(one, &truth.nodes)
        };
        // What can't be fitted or interpolated is as wrong as can be; the cache keeps why.
        let nothing = |why: String| Made {
            values: vec![0.0; truth.radiance.len()],
            exitance: 0.0,
            left_out_rms: None,
            resolves_deg: None,
            basis: Some((why, 0)),
        };
        let made = made.unwrap_or_else(nothing);
        let score = Score::of_values(&truth.nodes, &made.values, &truth.radiance)
            .ok_or_else(|| Failure::midway(format!("{}: is dark", self.scene.name())))?;
        let prediction = &one.setup.sequence.prediction;
        Ok(Run {
            scene: self.scene,
            strategy,
            rung,
            seed,
            rig_s: one.rig_s,
            bound_s: prediction.moving_s + prediction.dwelling_s + prediction.checking_s,
            settling_s: prediction.settling_s,
            readings: one.readings,
            radiance: score.shape_rms_relative,
            exitance: score.factor * made.exitance / truth.exitance - 1.0,
            factor: score.factor,
            left_out_rms: made.left_out_rms,
            resolves_deg: made.resolves_deg,
            believes: one
                .setup
                .accounts
                .last()
                .and_then(|last| Some(last.verdict.as_ref()?.is_met)),
            basis: made.basis,
            compute_s: one.compute_s + began.elapsed().as_secs_f64(),
        })
    }

    fn truth(&self, setup: &Setup) -> Result<&Truth, Failure> {
        if let Some(truth) = self.truth.get() {
            return Ok(truth);
        }
        let known = setup.truth().ok_or_else(|| Failure::midway("the rig is not simulated"))?;
        let nodes = Nodes::of(&fit_region(setup), self.scene.fineness());
        let at = |ray: &fit::Ray| known.radiance(ray.x_m, ray.y_m, ray.theta_rad, ray.phi_rad);
        let radiance = nodes.rays().map(|(ray, _)| at(&ray)).collect();
        let exitance = known.exitance_within_region();
        Ok(self.truth.get_or_init(|| Truth { nodes, radiance, exitance }))
    }
}

fn document(name: &str, text: &str) -> Result<spanned_toml::Document, Failure> {
    Ok(spanned_toml::Document::parse(spanned_toml::Source::new(name, text))?)
}

/// From the first reading's beginning to the last one's end.
fn span_s(readings: &[Reading]) -> f64 {
    let length = |reading: &Reading| (reading.end_us - reading.start_us) as f64 / 1e6;
    let from = readings.iter().map(|r| r.time_s).fold(f64::INFINITY, f64::min);
    let to = readings.iter().map(|r| r.time_s + length(r)).fold(f64::NEG_INFINITY, f64::max);
    (to - from).max(0.0)
}

/// The fit of `gonio run` for a plan that leaves the basis open.
fn fitted(one: &Acquisition, nodes: &Nodes) -> Result<Made, String> {
    let (region, optics) = (fit_region(&one.setup), optics(&one.setup));
    let wish = &one.setup.plan.fit;
    let found = one.calibrated.fit(&region, wish, optics.as_ref());
    let found = found.map_err(|error| error.to_string())?;
    let best = found.choice.as_ref().and_then(|choice| choice.candidates.first());
    let basis = found.fit.basis();
    let name =
        format!("{} {} x {}", basis.angular.name(), basis.angular.len(), basis.position.len());
    Ok(Made {
        values: nodes.rays().map(|(ray, _)| found.fit.value(&ray)).collect(),
        exitance: found.fit.exitance_within_region().value,
        left_out_rms: best.map(|best| best.left_out_rms),
        resolves_deg: Some(arc_deg(&found.resolves)),
        basis: Some((name, basis.len())),
    })
}

/// The narrowest feature that it claims to show, whichever way it lies: by arc at the edge of what was
/// measured.
fn arc_deg(resolves: &fit::Resolves) -> f64 {
    let round = resolves.phi_rad.map_or(0.0, |phi| phi.width * resolves.measured_to_rad.sin());
    // Of what it has no idea it claims nothing.
    resolves.theta_rad.width.max(round).to_degrees().min(180.0)
}

/// Splines through the readings, each taken as the radiance at its target.
fn interpolated(one: &Acquisition, nodes: &Nodes) -> Result<Made, String> {
    let targets = one.setup.sequence.targets.iter();
    let poses: BTreeMap<u32, Pose> = targets.map(|target| (target.index, target.pose)).collect();
    let samples = one.calibrated.samples.iter();
    let readings: Vec<(Pose, f64)> =
        samples.filter_map(|s| Some((*poses.get(&s.index)?, s.value))).collect();
    let values = interpolate(&readings, nodes).map_err(|error| error.to_string())?;
    let exitance = nodes.exitance(&values);
    Ok(Made { values, exitance, left_out_rms: None, resolves_deg: None, basis: None })
}
