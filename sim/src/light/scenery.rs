//! A scene with what is found once for all looks at it: how its surfaces see one another. It knows
//! neither the detector nor which effects will be in.

use std::sync::Arc;

use super::effects;
use super::interreflection::{Aim, Exchange};
use super::lamps::Lighting;
use crate::CompileError;
use crate::scene::Scene;

/// A scene, ready to be looked at with and without each of its effects.
#[derive(Debug, Clone)]
pub(crate) struct Scenery {
    pub(crate) scene: Arc<Scene>,
    /// `None`: no two surfaces that reflect see each other.
    pub(super) exchange: Option<Arc<Exchange>>,
}

/// No better than this, relative: to know it costs more than it is worth.
const ACCURACY_MIN: f64 = 1e-6;

impl Scenery {
    /// Without light between surfaces, yet. Refuses what is not simulated.
    pub(crate) fn new(scene: Arc<Scene>) -> Result<Self, CompileError> {
        if !scene.is_flat_emitters() {
            effects::refuse(&scene)?;
        }
        Ok(Self { scene, exchange: None })
    }

    /// Whether there are surfaces that light each other.
    pub(crate) fn sees_itself(&self) -> bool {
        !self.scene.facing().is_empty()
    }

    /// With light between surfaces, for a tolerance of which its error takes a quarter;
    /// errors count as far as a spot of this area sees them.
    pub(crate) fn with_exchange(self, tolerance: f64, spot_m2: f64) -> Result<Self, CompileError> {
        let lightings = Lighting::all(&self.scene, &|_| true)?;
        let aim = Aim { accuracy: (tolerance / 4.0).max(ACCURACY_MIN), spot_m2 };
        let exchange = Exchange::new(&self.scene, &lightings, aim)?.map(Arc::new);
        Ok(Self { exchange, ..self })
    }
}
