//! On what terms a scene and a rig are compiled: the seed, what the plan asks for, and what a
//! person wants in or out. It does not know the plan's file.

use crate::Region;

/// What decides, beside scene and rig, which effects a rig is compiled to.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// Of everything random.
    pub seed: u64,
    /// Where readings will be taken; effects are judged there. `None`: the bounding rectangle of
    /// what the scene has on the sample's plane, θ up to 80°.
    pub region: Option<Region>,
    /// How long a reading integrates, seconds.
    pub dwell_s: f64,
    /// The speeds of the fastest sweep, θ, φ, x, y, radians and metres a second; zero: readings are
    /// taken at rest.
    pub sweep: [f64; 4],
    /// How long the run takes, seconds: what drifts has so long to do it.
    pub run_s: f64,
    /// How much all that is left out may change a reading, relative to it. `None`: a tenth of the
    /// predicted relative noise of one dwell on the brightest ray of the region.
    pub tolerance: Option<f64>,
    /// Effects that are in whatever the tolerance says, by name.
    pub force: Vec<String>,
    /// Effects that are out whatever they amount to, by name.
    pub without: Vec<String>,
}

impl Terms {
    /// The default ones with another seed.
    pub fn seeded(seed: u64) -> Self {
        Self { seed, ..Self::default() }
    }
}

impl Default for Terms {
    fn default() -> Self {
        Self {
            seed: 1,
            region: None,
            dwell_s: 0.05,
            sweep: [0.0; 4],
            run_s: 3600.0,
            tolerance: None,
            force: Vec::new(),
            without: Vec::new(),
        }
    }
}
