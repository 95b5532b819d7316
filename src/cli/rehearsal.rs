//! `gonio plan --rehearse`: the plan's own runs on the rig's simulated twin, before a scene that is likely, and
//! what their fits state. What is said holds as far as the source is like the scene.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::failure::Failure;
use super::halt::ends_when_stopped;
use super::parallel::in_parallel;
use super::results::{fit_region, optics};
use super::setup::Setup;
use super::text::{duration, percent, table};
use super::virtual_run::VirtualRun;
use crate::journal::InputRole;
use crate::rig::calibration::calibrate;
use crate::study::{Likely, Rehearsed, Stated};

/// Several runs together.
pub(super) struct Rehearsal {
    runs: usize,
    scene: String,
    theta_max_deg: f64,
    found: Rehearsed,
}

/// Runs the plan so many times, each with the next seed; nothing of it is kept.
pub(super) fn rehearse(setup: &Setup, runs: u64) -> Result<Rehearsal, Failure> {
    let work = Work::new()?;
    ends_when_stopped(&work.0, "stopped: nothing of the rehearsal is kept".to_owned())?;
    let seeds: Vec<u64> = (0..runs).map(|k| setup.seed.wrapping_add(k)).collect();
    let one = |seed: &u64| one(setup, *seed, &work.0.join(seed.to_string()));
    let lost = || Err(Failure::midway("a rehearsed run: its thread panicked"));
    let found: Vec<Rehearsed> = in_parallel(&seeds, one)
        .into_iter()
        .map(|run| run.unwrap_or_else(lost))
        .collect::<Result<_, Failure>>()?;
    let scene = setup.inputs.iter().find(|input| input.role == InputRole::Scene);
    Ok(Rehearsal {
        runs: found.len(),
        scene: scene.map_or_else(String::new, |input| input.name.clone()),
        theta_max_deg: setup.region().theta_max_rad.to_degrees(),
        found: Rehearsed::together(&found).ok_or_else(dark)?,
    })
}

fn one(setup: &Setup, seed: u64, folder: &Path) -> Result<Rehearsed, Failure> {
    let setup = setup.with_plan(setup.plan.clone(), seed)?;
    let run = VirtualRun::passing(setup, folder)?;
    let VirtualRun { setup, readings, rig_s } = &run;
    let calibrated = calibrate(&setup.rig, readings).map_err(Failure::midway)?;
    let (region, optics) = (fit_region(setup), optics(setup));
    let fitted = calibrated
        .fit(&region, &setup.plan.fit, optics.as_ref())
        .map_err(|error| Failure::midway(format!("a rehearsed run's fit: {error}")))?;
    let truth = setup.truth().ok_or_else(dark)?;
    let likely = Likely {
        exitance: truth.exitance(),
        exitance_within_region: truth.exitance_within_region(),
        radiance: &|ray| truth.radiance(ray.x_m, ray.y_m, ray.theta_rad, ray.phi_rad),
    };
    Rehearsed::of(&fitted.fit, likely, rig_s - run.first_s()).ok_or_else(dark)
}

fn dark() -> Failure {
    Failure::start("the scene is dark: relative errors need some light in the plan's region")
}

impl Rehearsal {
    /// For people.
    pub(super) fn text(&self) -> String {
        let Self { runs, scene, theta_max_deg, found } = self;
        let times = if *runs == 1 { "once".to_owned() } else { format!("{runs} times") };
        let time = duration(found.after_homing_s);
        let heads = ["", "u stated", "independent", "off the scene"];
        let mut rows = vec![heads.map(str::to_owned).to_vec()];
        let within = format!("within {theta_max_deg:.1}°");
        for (name, stated) in [
            ("exitance, flux", found.exitance),
            (&within, found.exitance_within_region),
            ("radiance, RMS", found.radiance),
        ] {
            let Stated { u, independent, error } = stated;
            rows.push([name.to_owned(), percent(u), percent(independent), percent(error)].into());
        }
        let said = table(&rows);
        format!(
            "\n  rehearsed {times} before {scene}: {time} after homing; relative (k = 1), RMS\n{said}"
        )
    }

    /// For programs.
    pub(super) fn as_json(&self) -> Value {
        let stated = |stated: Stated| {
            json!({
                "u_relative": stated.u, "independent_relative": stated.independent,
                "error_relative": stated.error,
            })
        };
        let Rehearsed { after_homing_s, exitance, exitance_within_region, radiance } = self.found;
        json!({
            "runs": self.runs, "scene": self.scene, "after_homing_s": after_homing_s,
            "exitance": stated(exitance),
            "exitance_within_region": stated(exitance_within_region),
            "radiance": stated(radiance),
        })
    }
}

/// Where the runs' journals are while they go on.
struct Work(PathBuf);

impl Work {
    fn new() -> Result<Self, Failure> {
        let path = std::env::temp_dir().join(format!("gonio-rehearsal-{}", std::process::id()));
        std::fs::create_dir(&path)
            .map_err(|error| Failure::start(format!("{}: {error}", path.display())))?;
        Ok(Self(path))
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        // Nobody misses it.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
