//! What stood between the sample and the air while it was measured, as a map of rays: which ray of
//! the measured field a ray of the sample became, and by how much its radiance changed. Knows rays
//! and indices; the optics is `radiometry`'s.
//!
//! - A plane-parallel window in air: the ray goes on in its direction, moved aside by
//!   t (tan θ - tan θ'), and τ(θ) of it passes, with all reflections inside the window. There is air
//!   on both sides: no n² enters.
//! - An immersed emitter: sin θ outside is n sin θ inside, and L/n² stays but for the transmittance
//!   T of the one face and the layer's absorption: L inside = n² L outside/T. What the face throws
//!   back into the layer is not undone. Beyond the critical angle nothing comes out, and nothing
//!   is known.

use super::DeriveError;
use crate::Ray;
use radiometry::interface::{Incidence, Interface, Window};

/// A number with its standard uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// The number.
    pub value: f64,
    /// Its standard uncertainty, 0 where it counts as exact.
    pub u: f64,
}

/// A plane-parallel layer beside air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// Refractive index, to that of air.
    pub index: Uncertain,
    /// Thickness, m.
    pub thickness_m: Uncertain,
    /// Absorption coefficient, 1/m: exp(-α s) is left after a path s.
    pub absorption_per_m: Uncertain,
}

/// What stood between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Medium {
    /// Nothing.
    Air,
    /// A window with air on both sides, parallel to the sample's plane, at whatever height.
    Window(Layer),
    /// The emitter lies in the medium, its plane z = 0, and the layer ends in air at its thickness.
    Immersion(Layer),
}

/// Below this share of a ray that comes through, nothing is concluded from it.
const THROUGH_MIN: f64 = 1e-6;

impl Medium {
    pub(super) fn check(&self) -> Result<(), DeriveError> {
        let Some(layer) = self.layer() else { return Ok(()) };
        let refuse = |what: &'static str, value: f64, expected: &'static str| {
            Err(DeriveError::Layer { what, value, expected })
        };
        let Layer { index, thickness_m, absorption_per_m } = *layer;
        if !(index.value >= 1.0 && index.value <= INDEX_MAX) {
            return refuse("index", index.value, "a number from 1 to 10");
        }
        let lowest_m = if matches!(self, Self::Immersion(_)) { 0.0 } else { f64::MIN_POSITIVE };
        if !(thickness_m.value >= lowest_m && thickness_m.value.is_finite()) {
            let expected = if lowest_m > 0.0 { "more than 0" } else { "0 or more" };
            return refuse("thickness_m", thickness_m.value, expected);
        }
        if !(absorption_per_m.value >= 0.0 && absorption_per_m.value.is_finite()) {
            return refuse("absorption_per_m", absorption_per_m.value, "0 or more");
        }
        for (what, number) in self.numbers() {
            if !(number.u >= 0.0 && number.u.is_finite()) {
                return refuse(what, number.u, "an uncertainty of 0 or more");
            }
        }
        Ok(())
    }

    fn layer(&self) -> Option<&Layer> {
        match self {
            Self::Air => None,
            Self::Window(layer) | Self::Immersion(layer) => Some(layer),
        }
    }

    fn numbers(&self) -> Vec<(&'static str, Uncertain)> {
        let Some(layer) = self.layer() else { return Vec::new() };
        let names = match self {
            Self::Immersion(_) => ["medium index", "medium thickness", "medium absorption"],
            _ => ["window index", "window thickness", "window absorption"],
        };
        let numbers = [layer.index, layer.thickness_m, layer.absorption_per_m];
        names.into_iter().zip(numbers).collect()
    }

    /// The layer with each of its uncertain numbers off by u, up and down: for differences.
    /// The third number is by how many u the two lie apart; what can't be lower stays.
    pub(super) fn disturbed(&self) -> Vec<(&'static str, Self, Self, f64)> {
        let mut disturbed = Vec::new();
        for (k, (name, number)) in self.numbers().into_iter().enumerate() {
            if number.u > 0.0 {
                let lowest = if k == 0 { 1.0 } else { 0.0 };
                let low = (number.value - number.u).max(lowest);
                let apart = 1.0 + (number.value - low) / number.u;
                let up = self.with(k, number.value + number.u);
                disturbed.push((name, up, self.with(k, low), apart));
            }
        }
        disturbed
    }

    fn with(mut self, k: usize, value: f64) -> Self {
        if let Self::Window(layer) | Self::Immersion(layer) = &mut self {
            match k {
                0 => layer.index.value = value,
                1 => layer.thickness_m.value = value,
                _ => layer.absorption_per_m.value = value,
            }
        }
        self
    }

    /// The ray of the measured field that this ray of the sample became, and its radiance's factor:
    /// L sample = factor L measured. `None` where next to nothing comes through.
    pub(super) fn seen(&self, ray: &Ray) -> Option<(Ray, f64)> {
        match self {
            Self::Air => Some((*ray, 1.0)),
            Self::Window(layer) => through_window(layer, ray),
            Self::Immersion(layer) => out_of_medium(layer, ray),
        }
    }

    /// Whether the sample's polar angles differ from those measured.
    pub(super) fn is_immersion(&self) -> bool {
        matches!(self, Self::Immersion(_))
    }

    /// The largest polar angle on the sample's side that comes out at `theta_rad`.
    pub(super) fn inner_theta_rad(&self, theta_rad: f64) -> f64 {
        match self {
            Self::Immersion(layer) => libm::asin(libm::sin(theta_rad) / layer.index.value),
            _ => theta_rad,
        }
    }
}

fn through_window(layer: &Layer, ray: &Ray) -> Option<(Ray, f64)> {
    let face = Interface::new(1.0, layer.index.value).ok()?;
    let window = Window::new(face, layer.thickness_m.value, layer.absorption_per_m.value).ok()?;
    let incidence = Incidence::from_angle(ray.theta_rad).ok()?;
    let through = window.transmittance(incidence);
    if through < THROUGH_MIN {
        return None;
    }
    // Along the sample's plane the ray's own shift is longer by 1/cos θ; its foot moves inwards.
    let aside_m = -window.lateral_shift_m(incidence)? / incidence.cos();
    Some((moved(ray, aside_m, ray.theta_rad), 1.0 / through))
}

fn out_of_medium(layer: &Layer, ray: &Ray) -> Option<(Ray, f64)> {
    let face = Interface::new(layer.index.value, 1.0).ok()?;
    let incidence = Incidence::from_angle(ray.theta_rad).ok()?;
    let theta_rad = face.refracted_angle(incidence)?;
    let through = face.transmittance(incidence);
    let path_m = layer.thickness_m.value / incidence.cos();
    let left = through * libm::exp(-layer.absorption_per_m.value * path_m);
    if left < THROUGH_MIN {
        return None;
    }
    // Where the ray in air, drawn back to the sample's plane, seems to come from.
    let aside_m = layer.thickness_m.value * (libm::tan(ray.theta_rad) - libm::tan(theta_rad));
    let n2 = layer.index.value * layer.index.value;
    Some((moved(ray, aside_m, theta_rad), n2 / left))
}

fn moved(ray: &Ray, aside_m: f64, theta_rad: f64) -> Ray {
    let (sin, cos) = libm::sincos(ray.phi_rad);
    Ray {
        x_m: ray.x_m + aside_m * cos,
        y_m: ray.y_m + aside_m * sin,
        theta_rad,
        phi_rad: ray.phi_rad,
    }
}

/// Beyond what is transparent anywhere between ultraviolet and far infrared.
const INDEX_MAX: f64 = 10.0;
