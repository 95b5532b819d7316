//! A scene that is no more than flat patches, as the beam's forms take it: which they are, and with what
//! the radiance of each goes. It does not know the beam.

use super::{Glow, LitScene, Part};
use crate::field::{Goes, Patch, Ray};

impl LitScene {
    /// `None` if anything stands above the plane, or a patch has outlines within.
    pub(super) fn flat_patches(&self) -> Option<Vec<Patch>> {
        if !self.plates.is_empty() || !self.raised.is_empty() {
            return None;
        }
        self.flat.iter().enumerate().map(|(i, part)| patch(i, part)).collect()
    }

    /// Along a ray from one of them, as if it had no end.
    pub(super) fn of_flat_patch(&self, patch: usize, ray: &Ray) -> f64 {
        let part = self.flat.get(patch);
        part.map_or(0.0, |part| self.radiance_of(part, ray.point, ray.direction))
    }
}

fn patch(i: usize, part: &Part) -> Option<Patch> {
    match &part.glow {
        // Emitters come first, in their order.
        Glow::Emits(emitter) => {
            Patch::of_emitter(i, emitter).map(|own| Patch { name: part.name.clone(), ..own })
        }
        Glow::Lit(lit) => {
            let goes = match &lit.gloss {
                None => Goes::WithPlace,
                Some(_) if lit.lighting.is_of_sky_alone() => {
                    Goes::WithDirection { is_round: false }
                }
                Some(_) => Goes::WithBoth,
            };
            Some(Patch::new(part.name.clone(), part.body.shape()?, goes))
        }
        Glow::Black | Glow::Lamp(_) => None,
    }
}
