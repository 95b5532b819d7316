//! What a file says: intensities over (C, γ) and what they belong to. Nothing here reads text.

use super::label::{IntensityUnit, Keyword, Version};
use super::note::Note;
use super::opening::Opening;

/// The table of intensities with its surroundings; complete and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Photometry {
    pub(super) version: Version,
    pub(super) keywords: Vec<Keyword>,
    pub(super) tilt: Option<Tilt>,
    pub(super) lamps: usize,
    pub(super) lumens_per_lamp: Option<f64>,
    pub(super) input_w: f64,
    pub(super) opening: Opening,
    pub(super) intensity_unit: IntensityUnit,
    pub(super) symmetry: Symmetry,
    pub(super) gamma_deg: Vec<f64>,
    pub(super) c_deg: Vec<f64>,
    /// By plane, then by γ; all factors applied.
    pub(super) planes: Vec<Vec<f64>>,
    pub(super) notes: Vec<Note>,
}

/// How the planes in the file stand for all planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// One plane: the same all round.
    Rotational,
    /// Planes 0 to 90°: mirrored in both vertical planes.
    Quadrant,
    /// Planes 0 to 180°: mirrored in the plane C0-C180.
    AboutC0,
    /// Planes 90 to 270°: mirrored in the plane C90-C270.
    AboutC90,
    /// Planes 0 to 360°: as they are.
    None,
}

/// How the output changes as the luminaire is tilted, included by `TILT=INCLUDE`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tilt {
    /// 1: the lamp's base up or down; 2: horizontal along C0; 3: horizontal along C90.
    pub lamp_geometry: usize,
    /// Degrees, rising.
    pub angles_deg: Vec<f64>,
    /// One an angle.
    pub factors: Vec<f64>,
}

impl Photometry {
    /// The edition that the file follows.
    pub fn version(&self) -> Version {
        self.version
    }

    /// All keywords, in the file's order.
    pub fn keywords(&self) -> &[Keyword] {
        &self.keywords
    }

    /// The text of the first keyword of a name, whatever its case.
    pub fn keyword(&self, name: &str) -> Option<&str> {
        let named = |keyword: &&Keyword| keyword.name.eq_ignore_ascii_case(name);
        self.keywords.iter().find(named).map(|keyword| keyword.text.as_str())
    }

    /// Tilt factors, if included.
    pub fn tilt(&self) -> Option<&Tilt> {
        self.tilt.as_ref()
    }

    /// How many lamps the luminaire had.
    pub fn lamps(&self) -> usize {
        self.lamps
    }

    /// Rated flux of one lamp; none for absolute photometry.
    pub fn lumens_per_lamp(&self) -> Option<f64> {
        self.lumens_per_lamp
    }

    /// Electrical power, W; 0 where the laboratory did not say.
    pub fn input_w(&self) -> f64 {
        self.input_w
    }

    /// What shines.
    pub fn opening(&self) -> Opening {
        self.opening
    }

    /// What the intensities are in.
    pub fn intensity_unit(&self) -> IntensityUnit {
        self.intensity_unit
    }

    /// How the planes stand for all planes.
    pub fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// The vertical angles, degrees, rising within [0, 180].
    pub fn gamma_deg(&self) -> &[f64] {
        &self.gamma_deg
    }

    /// The horizontal angles in the file, degrees, rising.
    pub fn c_deg(&self) -> &[f64] {
        &self.c_deg
    }

    /// The intensities of each plane in the order of [`c_deg`](Self::c_deg), by γ, in
    /// [`intensity_unit`](Self::intensity_unit), all factors applied, averaged where planes meet.
    pub fn planes(&self) -> &[Vec<f64>] {
        &self.planes
    }

    /// What is irregular, and what was done about it.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Intensity in the direction (C, γ), degrees: bilinear between the file's angles, C of any
    /// number of turns, by the file's symmetry; 0 where γ is outside the file's range (the standard:
    /// no light goes there).
    pub fn intensity(&self, c_deg: f64, gamma_deg: f64) -> f64 {
        if !c_deg.is_finite() {
            return 0.0;
        }
        let Some((lower, upper, t)) = cell(&self.gamma_deg, gamma_deg) else {
            return 0.0;
        };
        let along = |plane: &[f64]| mix(plane[lower], plane[upper], t);
        // The fold lands in the file's range; one plane is a range of one angle.
        match cell(&self.c_deg, self.folded(c_deg)) {
            Some((left, right, s)) => mix(along(&self.planes[left]), along(&self.planes[right]), s),
            None => 0.0,
        }
    }

    /// Flux of the bilinear table, ∬ I sin γ dγ dC, lm or the radiant [`IntensityUnit::flux_unit`]:
    /// linear pieces times the sine, integrated in closed form.
    pub fn flux(&self) -> f64 {
        self.flux_within(180.0)
    }

    /// The part of the flux within a cone γ <= `gamma_max_deg`.
    pub fn flux_within(&self, gamma_max_deg: f64) -> f64 {
        let mut flux = 0.0;
        for (pair, index) in self.gamma_deg.windows(2).zip(0..) {
            let (low, high) = (pair[0], pair[1].min(gamma_max_deg));
            if low >= high {
                break;
            }
            let (at_low, at_next) = (self.mean_over_c(index), self.mean_over_c(index + 1));
            let at_high = mix(at_low, at_next, (high - low) / (pair[1] - low));
            flux += ring(low.to_radians(), high.to_radians(), at_low, at_high);
        }
        2.0 * std::f64::consts::PI * flux
    }

    /// The mean over all C of the intensity at the `index`-th γ.
    fn mean_over_c(&self, index: usize) -> f64 {
        let range = self.c_deg[self.c_deg.len() - 1] - self.c_deg[0];
        if range <= 0.0 {
            return self.planes[0][index];
        }
        let trapezoids = self.c_deg.windows(2).zip(self.planes.windows(2));
        let area: f64 = trapezoids
            .map(|(c, planes)| (c[1] - c[0]) * f64::midpoint(planes[0][index], planes[1][index]))
            .sum();
        area / range
    }

    /// C brought into the range of the file's planes.
    fn folded(&self, c_deg: f64) -> f64 {
        let c = c_deg.rem_euclid(360.0);
        let mirrored_in_c0 = c.min(360.0 - c);
        match self.symmetry {
            Symmetry::Rotational => self.c_deg[0],
            Symmetry::Quadrant => mirrored_in_c0.min(180.0 - mirrored_in_c0),
            Symmetry::AboutC0 => mirrored_in_c0,
            Symmetry::AboutC90 if c < 90.0 => 180.0 - c,
            Symmetry::AboutC90 if c > 270.0 => 540.0 - c,
            Symmetry::AboutC90 | Symmetry::None => c,
        }
    }
}

impl Photometry {
    /// Makes one value of what the file says twice of one direction, and notes what is irregular.
    pub(super) fn settle(&mut self) {
        self.join_the_seam();
        self.join_the_pole(0.0);
        self.join_the_pole(180.0);
        self.note_the_horizon();
    }

    /// C = 0 and C = 360° are one plane: makes them equal.
    fn join_the_seam(&mut self) {
        let (Symmetry::None, [first, .., last]) = (self.symmetry, self.planes.as_mut_slice())
        else {
            return;
        };
        let mut largest = (0.0, 0.0);
        for ((a, b), gamma) in first.iter_mut().zip(last.iter_mut()).zip(&self.gamma_deg) {
            let difference = (*a - *b).abs();
            if difference > largest.0 {
                largest = (difference, *gamma);
            }
            let mean = f64::midpoint(*a, *b);
            (*a, *b) = (mean, mean);
        }
        if largest.0 > 0.0 {
            self.notes.push(Note::SeamDisagrees { largest: largest.0, gamma_deg: largest.1 });
        }
    }

    /// At γ = 0 and 180° all planes are one direction: makes them equal.
    fn join_the_pole(&mut self, pole_deg: f64) {
        let Some(index) =
            self.gamma_deg.iter().position(|gamma| (gamma - pole_deg).abs() < f64::EPSILON)
        else {
            return;
        };
        let at_pole = || self.planes.iter().map(|plane| plane[index]);
        let (low, high) = (at_pole().fold(f64::INFINITY, f64::min), at_pole().fold(0.0, f64::max));
        if low >= high {
            return;
        }
        let mean = self.mean_over_c(index);
        for plane in &mut self.planes {
            plane[index] = mean;
        }
        self.notes.push(Note::PlanesDisagree { gamma_deg: pole_deg, low, high, mean });
    }

    fn note_the_horizon(&mut self) {
        let mut largest = (0.0, 0.0, 0.0);
        for (plane, c) in self.planes.iter().zip(&self.c_deg) {
            for (intensity, gamma) in plane.iter().zip(&self.gamma_deg) {
                if *gamma >= 90.0 && *intensity > largest.0 {
                    largest = (*intensity, *c, *gamma);
                }
            }
        }
        let (largest, c_deg, gamma_deg) = largest;
        if largest > 0.0 {
            let flux_fraction = (1.0 - self.flux_within(90.0) / self.flux()).max(0.0);
            self.notes.push(Note::AtOrBeyondHorizon { largest, c_deg, gamma_deg, flux_fraction });
        }
    }
}

/// The places to either side of a value in a rising list, and how far between them it lies (0 to
/// 1); none outside the list.
fn cell(angles: &[f64], angle: f64) -> Option<(usize, usize, f64)> {
    let last = angles.len().checked_sub(1)?;
    if !(angles[0]..=angles[last]).contains(&angle) {
        return None;
    }
    let upper = angles.partition_point(|known| *known <= angle);
    if upper > last {
        return Some((last, last, 0.0));
    }
    let lower = upper - 1;
    Some((lower, upper, (angle - angles[lower]) / (angles[upper] - angles[lower])))
}

fn mix(at_0: f64, at_1: f64, t: f64) -> f64 {
    (1.0 - t) * at_0 + t * at_1
}

/// ∫ I(γ) sin γ dγ over [low, high], radians, I linear.
fn ring(low: f64, high: f64, at_low: f64, at_high: f64) -> f64 {
    let (sin_low, cos_low) = libm::sincos(low);
    let (sin_high, cos_high) = libm::sincos(high);
    let mean_cos = (sin_high - sin_low) / (high - low);
    at_low * (cos_low - mean_cos) + at_high * (mean_cos - cos_high)
}
