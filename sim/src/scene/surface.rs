//! What reflects: a body, and how. It emits nothing of its own.

use super::{Body, EXPONENT_MAX, Scene, SceneError, Window, WindowOwner};

/// A surface that is lit.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    body: Body,
    reflection: Reflection,
}

/// How a surface reflects: fᵣ = ρ/π + s (n + 2)/(2π) cosⁿα, with α between the outgoing direction
/// and the mirror image of the incoming one (0 beyond 90°).
///
/// The modified Phong model of Lafortune and Willems (1994): reciprocal, and it reflects no more than
/// ρ + s of what arrives from any direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflection {
    /// ρ, the diffuse albedo, in [0, 1].
    pub albedo: f64,
    /// s, what the lobe around the mirror direction reflects of light along the normal; 0 for none.
    pub gloss: f64,
    /// n.
    pub exponent: f64,
}

impl Reflection {
    /// Lambert's law alone.
    pub const fn lambertian(albedo: f64) -> Self {
        Self { albedo, gloss: 0.0, exponent: 0.0 }
    }

    /// Whether it is Lambert's law alone.
    pub fn is_lambertian(&self) -> bool {
        self.gloss == 0.0
    }

    /// What it reflects at most of what arrives from anywhere.
    pub fn reflectance_bound(&self) -> f64 {
        self.albedo + self.gloss
    }
}

impl Surface {
    /// A surface and how it reflects.
    pub const fn new(body: Body, reflection: Reflection) -> Self {
        Self { body, reflection }
    }

    /// Where it is.
    pub const fn body(&self) -> &Body {
        &self.body
    }

    /// How it reflects.
    pub const fn reflection(&self) -> &Reflection {
        &self.reflection
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        self.body.check()?;
        let Reflection { albedo, gloss, exponent } = self.reflection;
        let is_sound = albedo >= 0.0 && gloss >= 0.0 && albedo + gloss <= 1.0;
        if !is_sound {
            return Err(SceneError::Reflects(albedo, gloss));
        }
        if !(0.0..=EXPONENT_MAX).contains(&exponent) {
            return Err(SceneError::Exponent(exponent));
        }
        Ok(())
    }
}

impl Scene {
    /// The pairs of surfaces of which each lies before the other, and both reflect.
    pub(crate) fn facing(&self) -> Vec<(usize, usize)> {
        let reflects = |surface: &Surface| surface.reflection().reflectance_bound() > 0.0;
        let surfaces = self.surfaces();
        let mut pairs = Vec::new();
        for (i, surface) in surfaces.iter().enumerate() {
            for (k, other) in surfaces.iter().enumerate().skip(i + 1) {
                if reflects(surface) && reflects(other) && surface.body().faces(other.body()) {
                    pairs.push((i, k));
                }
            }
        }
        pairs
    }

    /// A glossy surface, and what is not simulated of the light on it, if that is so.
    pub(crate) fn unsupported_gloss(&self) -> Option<(usize, String)> {
        let is_glossy = |i: usize| !self.surfaces()[i].reflection().is_lambertian();
        let mut pairs = self.facing().into_iter();
        if let Some((a, b)) = pairs.find(|(a, b)| is_glossy(*a) || is_glossy(*b)) {
            let (own, other) = if is_glossy(a) { (a, b) } else { (b, a) };
            let what = format!("light between surface[{own}], glossy, and surface[{other}]");
            return Some((own, what));
        }
        let i = (0..self.surfaces().len()).find(|i| is_glossy(*i))?;
        let is_own = |window: &Window| window.belongs_to == WindowOwner::Sample;
        let k = self.windows().iter().position(is_own)?;
        Some((i, format!("surface[{i}], glossy, under window[{k}] of the sample")))
    }
}
