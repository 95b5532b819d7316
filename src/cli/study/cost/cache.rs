//! Runs that were made before, found again by all that they depend on: a file a run, named by a hash,
//! which also says what it is of, so that a hash of something else is not taken for it.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::cli::failure::Failure;
use crate::export::write_atomically;
use crate::plan::fnv1a64;
use crate::study::cost::{Run, Rung, Scene, SceneFiles, Strategy};

/// Where runs are kept, if anywhere.
pub(super) struct Cache<'a> {
    folder: Option<&'a Path>,
}

/// All that a run depends on.
pub(super) struct Key<'a> {
    /// Which build made it: another one may fit otherwise.
    pub(super) program: &'a str,
    pub(super) scene: Scene,
    pub(super) files: &'a SceneFiles,
    pub(super) rig: &'a str,
    pub(super) plan: &'a str,
    pub(super) seed: u64,
    pub(super) strategy: Strategy,
}

impl<'a> Cache<'a> {
    pub(super) const fn new(folder: Option<&'a Path>) -> Self {
        Self { folder }
    }

    fn path(&self, key: &Key<'_>) -> Option<PathBuf> {
        Some(self.folder?.join(format!("{:016x}.json", key.hash())))
    }

    /// The run, if it was made. A file that can't be read, or is of something else, is as none.
    pub(super) fn find(&self, key: &Key<'_>, rung: Rung) -> Option<Run> {
        let text = std::fs::read_to_string(self.path(key)?).ok()?;
        let kept: Value = serde_json::from_str(&text).ok()?;
        if kept["of"] != key.says() {
            return None;
        }
        let number = |name: &str| kept[name].as_f64();
        let basis = kept["basis"].as_str().map(str::to_owned);
        let coefficients = kept["coefficients"].as_u64().and_then(|n| usize::try_from(n).ok());
        Some(Run {
            scene: key.scene,
            strategy: key.strategy,
            rung,
            seed: key.seed,
            rig_s: number("rig_s")?,
            bound_s: number("bound_s")?,
            settling_s: number("settling_s")?,
            readings: usize::try_from(kept["readings"].as_u64()?).ok()?,
            radiance: number("radiance")?,
            exitance: number("exitance")?,
            factor: number("factor")?,
            left_out_rms: number("left_out_rms"),
            resolves_deg: number("resolves_deg"),
            believes: kept["believes"].as_bool(),
            basis: basis.zip(coefficients),
            compute_s: number("compute_s")?,
        })
    }

    /// Keeps a run.
    pub(super) fn keep(&self, key: &Key<'_>, run: &Run) -> Result<(), Failure> {
        let Some(path) = self.path(key) else { return Ok(()) };
        let (basis, coefficients) = run.basis.clone().unzip();
        let kept = json!({
            "of": key.says(),
            "rung": run.rung.name(),
            "rig_s": run.rig_s,
            "bound_s": run.bound_s,
            "settling_s": run.settling_s,
            "readings": run.readings,
            "radiance": run.radiance,
            "exitance": run.exitance,
            "factor": run.factor,
            "left_out_rms": run.left_out_rms,
            "resolves_deg": run.resolves_deg,
            "believes": run.believes,
            "basis": basis,
            "coefficients": coefficients,
            "compute_s": run.compute_s,
        });
        write_atomically(&path, |out| writeln!(out, "{kept}")).map_err(Failure::midway)
    }
}

impl Key<'_> {
    /// What can be compared by eye; the rest is in the hash.
    fn says(&self) -> Value {
        json!({
            "program": self.program,
            "scene": self.scene.name(),
            "strategy": self.strategy.name(),
            "seed": self.seed,
            "plan": self.plan,
            "hash": format!("{:016x}", self.hash()),
        })
    }

    fn hash(&self) -> u64 {
        let says = [self.program, self.strategy.name(), self.scene.name()];
        let texts = says.into_iter().chain([self.plan, self.rig, &self.files.text]);
        let texts = texts.map(str::as_bytes);
        let seed = self.seed.to_le_bytes();
        let attached = self.files.attachments.iter().map(|attachment| &attachment.bytes[..]);
        let parts = texts.chain([&seed[..]]).chain(attached);
        fnv1a64(parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Motion;
    use crate::study::cost::ladder;

    #[test]
    fn a_kept_run_is_found_again_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(Some(folder.path()));
        let rung = ladder(Motion::Sweep, false)[3];
        let (files, plan) = (Scene::Batwing.files(""), rung.plan());
        let strategy = Strategy::FlightFitted;
        let scene = Scene::Batwing;
        let of = |program, seed, rig| Key {
            program,
            scene,
            files: &files,
            rig,
            plan: &plan,
            seed,
            strategy,
        };
        let key = |seed, rig| of("this", seed, rig);
        let run = Run {
            scene: Scene::Batwing,
            strategy,
            rung,
            seed: 7,
            rig_s: 12.5,
            bound_s: 12.0,
            settling_s: 0.1,
            readings: 500,
            radiance: 0.01,
            exitance: -0.001,
            factor: 1.002,
            left_out_rms: Some(1.1),
            resolves_deg: Some(5.9),
            believes: Some(true),
            basis: Some(("zernike 28 x 1".to_owned(), 28)),
            compute_s: 0.5,
        };
        assert_eq!(cache.find(&key(7, "rig"), rung), None);
        cache.keep(&key(7, "rig"), &run).unwrap();
        assert_eq!(cache.find(&key(7, "rig"), rung), Some(run.clone()));
        assert_eq!(cache.find(&key(8, "rig"), rung), None);
        assert_eq!(cache.find(&key(7, "other"), rung), None);
        assert_eq!(cache.find(&of("one with another fit", 7, "rig"), rung), None);
        // Nowhere to keep it is no error.
        Cache::new(None).keep(&key(7, "rig"), &run).unwrap();
    }
}
