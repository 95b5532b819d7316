//! An enclosure of diffuse surfaces: its form factors made consistent, and the balance of radiosity. How
//! a single factor is found it does not know.
//!
//! For the person at the rig: how much light goes round in a box or between baffles. Reference: Sparrow
//! and Cess, *Radiation Heat Transfer* (1978), ch. 3; the matrix is completed by the laws that it must
//! obey (Clark and Korybalski 1974), so that errors of the single factors break neither.

mod bound;

use core::f64::consts::PI;
use core::fmt;

use crate::domain::{DomainError, not_negative, positive, within};
use crate::estimate::{EstimateError, Tolerance};
use crate::form_factor::between_fronts;
use crate::quadrature::Sum;
use crate::quantity::{Area, Exitance, FormFactor, Irradiance, Radiance};
use crate::shape::Polygon;

/// How far a row's given factors may exceed 1 by their own error before it counts as a mistake.
const EXCESS_MAX: f64 = 1e-6;
/// Sweeps of Gauss and Seidel at most.
const SWEEPS: usize = 100_000;
/// What may be missing of a radiosity, relative to the largest.
const SETTLED: f64 = 1e-14;

/// The form factors among surfaces that together leave no way out.
/// Who needs it: the person at the rig, for a box or baffles; the page on form factors.
#[derive(Debug, Clone, PartialEq)]
pub struct Enclosure {
    areas_m2: Vec<f64>,
    /// `exchange[i][j]` = `A_i` `F_ij`, symmetric.
    exchange: Vec<Vec<f64>>,
}

/// Why an enclosure has no balance.
#[derive(Debug, Clone, PartialEq)]
pub enum EnclosureError {
    /// A number outside its domain.
    Domain(DomainError),
    /// A list of another length than the surfaces'.
    Count {
        /// Which list.
        list: &'static str,
        /// Its length.
        count: usize,
        /// That of the list of areas.
        surfaces: usize,
    },
    /// The factor of a pair is not known well enough.
    Pair {
        /// The one surface, counted from 0.
        from: usize,
        /// The other.
        to: usize,
        /// What the integral came to.
        error: EstimateError,
    },
    /// The factors from a surface to the others sum to more than 1.
    Overfull {
        /// Counted from 0.
        surface: usize,
        /// What they sum to.
        sum: f64,
    },
    /// Light comes in and none is ever absorbed.
    NothingAbsorbs,
    /// The surfaces reflect so much that the balance did not settle.
    Unsettled {
        /// The last change, relative to the largest radiosity.
        change: f64,
    },
}

impl From<DomainError> for EnclosureError {
    fn from(error: DomainError) -> Self {
        Self::Domain(error)
    }
}

impl fmt::Display for EnclosureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Domain(error) => error.fmt(f),
            Self::Count { list, count, surfaces } => {
                write!(f, "{list} has {count} entries, expected {surfaces}, one for each surface")
            }
            Self::Pair { from, to, error } => {
                write!(f, "the form factor from surface {from} to surface {to}: {error}")
            }
            Self::Overfull { surface, sum } => {
                write!(
                    f,
                    "the form factors from surface {surface} sum to {sum}, expected at most 1"
                )
            }
            Self::NothingAbsorbs => {
                f.write_str("no surface absorbs, expected a reflectance below 1 where light comes")
            }
            Self::Unsettled { change } => {
                write!(f, "the radiosity still changes by {change:e} a sweep, expected 0")
            }
        }
    }
}

impl core::error::Error for EnclosureError {}

/// The balance of an enclosure, one entry for each surface.
/// Who needs it: the person at the rig, for the light that goes round in a box.
#[derive(Debug, Clone, PartialEq)]
pub struct Radiosity {
    /// All that leaves: emitted and reflected.
    pub exitance: Vec<Exitance>,
    /// All that arrives.
    pub irradiance: Vec<Irradiance>,
}

impl Radiosity {
    /// M = πL: what a diffuse surface looks like from everywhere.
    pub fn radiance(&self, surface: usize) -> Option<Radiance> {
        Some(Radiance::from_w_per_m2_sr(self.exitance.get(surface)?.w_per_m2() / PI))
    }
}

impl Enclosure {
    /// From areas and the factors known: `factor(i, j)` is asked for i < j alone, `F_ji` follows by
    /// reciprocity, and what a row lacks to 1 is the surface's view of itself (0 for flat ones, if the
    /// rest is right). Both laws then hold to a rounding.
    ///
    /// ```
    /// use radiometry::enclosure::Enclosure;
    /// use radiometry::form_factor::concentric_spheres;
    /// use radiometry::quantity::Area;
    /// // Two concentric spheres: all from the inner one goes to the outer.
    /// let areas = [Area::from_m2(4.0), Area::from_m2(1.0)];
    /// let outward = concentric_spheres(1.0, 2.0)?;
    /// let spheres = Enclosure::new(&areas, |_, _| outward)?;
    /// assert_eq!(spheres.form_factor(1, 0).unwrap().ratio(), 1.0);
    /// assert_eq!(spheres.form_factor(0, 0).unwrap().ratio(), 0.75);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(
        areas: &[Area],
        mut factor: impl FnMut(usize, usize) -> FormFactor,
    ) -> Result<Self, EnclosureError> {
        Self::completed(areas, |i, j| Ok((factor(i, j), 0.0)))
    }

    /// From factors with a bound of the error of each.
    fn completed(
        areas: &[Area],
        mut factor: impl FnMut(usize, usize) -> Result<(FormFactor, f64), EnclosureError>,
    ) -> Result<Self, EnclosureError> {
        let count = areas.len();
        let mut areas_m2 = Vec::with_capacity(count);
        for area in areas {
            areas_m2.push(positive("area_m2", area.m2())?);
        }
        let mut exchange = vec![vec![0.0; count]; count];
        let mut bounds = vec![0.0; count];
        for i in 0..count {
            for j in i + 1..count {
                let (factor, bound) = factor(i, j)?;
                let ratio = within("form factor", factor.ratio(), 0.0, 1.0)?;
                bounds[i] += bound;
                bounds[j] += bound * (areas_m2[i] / areas_m2[j]);
                exchange[i][j] = areas_m2[i] * ratio;
                exchange[j][i] = exchange[i][j];
            }
        }
        for i in 0..count {
            let others: Sum = exchange[i].iter().copied().collect();
            let sum = others.value() / areas_m2[i];
            if sum > 1.0 + EXCESS_MAX + bounds[i] {
                return Err(EnclosureError::Overfull { surface: i, sum });
            }
            exchange[i][i] = (areas_m2[i] - others.value()).max(0.0);
        }
        Ok(Self { areas_m2, exchange })
    }

    /// From flat faces, convex or not, that act by their fronts: their vertices run counter-clockwise as
    /// seen from the cavity. Every face hides what is behind it from every pair, where it stands between
    /// them: a box in a room, a corner that a room goes around. A face must not be split by another (the
    /// floor under a box is no part of the enclosure). The factor of each pair is known to the tolerance,
    /// relative to what it would be without the others; the rest to 1 of a row is the face's own, and
    /// tells by how much the faces fail to close.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::{Tolerance, enclosure::Enclosure, shape::Polygon};
    /// // A tetrahedron: by symmetry, from the base to each of the others a third.
    /// let [a, b, c, d] = [[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]]
    ///     .map(DVec3::from_array);
    /// let faces = [[a, b, c], [a, d, b], [a, c, d], [b, d, c]];
    /// let mut polygons = Vec::new();
    /// for face in faces {
    ///     polygons.push(Polygon::new(face.to_vec())?);
    /// }
    /// let enclosure = Enclosure::from_polygons(&polygons, Tolerance::from_relative(1e-8)?)?;
    /// assert!((enclosure.form_factor(0, 3).unwrap().ratio() - 1.0 / 3.0).abs() < 1e-8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_polygons(faces: &[Polygon], tolerance: Tolerance) -> Result<Self, EnclosureError> {
        let areas: Vec<Area> = faces.iter().map(|face| Area::from_m2(area_m2(face))).collect();
        Self::completed(&areas, |i, j| {
            let apart = faces.iter().enumerate().filter(|(k, _)| *k != i && *k != j);
            let others = apart.map(|(_, face)| face);
            match between_fronts(&faces[i], &faces[j], others, tolerance) {
                Ok(factor) => Ok((FormFactor::from_ratio(factor.value), factor.error_bound)),
                Err(error) => Err(EnclosureError::Pair { from: i, to: j, error }),
            }
        })
    }

    /// How many surfaces it has.
    pub fn surfaces(&self) -> usize {
        self.areas_m2.len()
    }

    /// `F_ij`, if both surfaces exist.
    pub fn form_factor(&self, from: usize, to: usize) -> Option<FormFactor> {
        let exchange = self.exchange.get(from)?.get(to)?;
        Some(FormFactor::from_ratio((exchange / self.areas_m2[from]).min(1.0)))
    }

    /// What leaves and what arrives everywhere, when each surface emits an exitance of its own and
    /// reflects a part (in [0, 1]) of what arrives: M = M₀ + ρ F M, by the sweeps of Gauss and Seidel,
    /// which settle since no row of ρF sums to more than 1 and light is lost somewhere.
    ///
    /// ```
    /// use radiometry::enclosure::Enclosure;
    /// use radiometry::quantity::{Area, Exitance, FormFactor};
    /// // An integrating sphere, all of it alike: M = M₀/(1 - ρ).
    /// let sphere = Enclosure::new(&[Area::from_m2(1.0)], |_, _| FormFactor::ZERO)?;
    /// let balance = sphere.radiosity(&[Exitance::from_w_per_m2(2.0)], &[0.75])?;
    /// assert!((balance.exitance[0].w_per_m2() - 8.0).abs() < 1e-12);
    /// # Ok::<(), radiometry::enclosure::EnclosureError>(())
    /// ```
    pub fn radiosity(
        &self,
        emitted: &[Exitance],
        reflectance: &[f64],
    ) -> Result<Radiosity, EnclosureError> {
        let surfaces = self.surfaces();
        for (list, count) in [("emitted", emitted.len()), ("reflectance", reflectance.len())] {
            if count != surfaces {
                return Err(EnclosureError::Count { list, count, surfaces });
            }
        }
        for (emitted, reflectance) in emitted.iter().zip(reflectance) {
            not_negative("emitted_w_per_m2", emitted.w_per_m2())?;
            within("reflectance", *reflectance, 0.0, 1.0)?;
        }
        let mut leaving: Vec<f64> = emitted.iter().map(|exitance| exitance.w_per_m2()).collect();
        self.settle(&mut leaving, emitted, reflectance)?;
        let irradiance =
            (0..surfaces).map(|i| Irradiance::from_w_per_m2(self.arriving(i, &leaving)));
        let irradiance = irradiance.collect();
        let exitance = leaving.into_iter().map(Exitance::from_w_per_m2).collect();
        Ok(Radiosity { exitance, irradiance })
    }

    /// Sweeps until what is still to come, the rest of a geometric series of changes, does not count.
    fn settle(
        &self,
        leaving: &mut [f64],
        emitted: &[Exitance],
        reflectance: &[f64],
    ) -> Result<(), EnclosureError> {
        let mut last = f64::INFINITY;
        for _ in 0..SWEEPS {
            let change = self.sweep(leaving, emitted, reflectance)?;
            let still_to_come = change * (change / (last - change));
            if change <= 2.0 * f64::EPSILON
                || (last.is_finite() && change < last && still_to_come <= SETTLED)
            {
                return Ok(());
            }
            last = change;
        }
        Err(EnclosureError::Unsettled { change: last })
    }

    /// One sweep; the largest change relative to the largest radiosity.
    fn sweep(
        &self,
        leaving: &mut [f64],
        emitted: &[Exitance],
        reflectance: &[f64],
    ) -> Result<f64, EnclosureError> {
        let (mut change, mut largest): (f64, f64) = (0.0, 0.0);
        for i in 0..self.surfaces() {
            // What the surface sends to itself is solved for.
            let own = reflectance[i] * self.exchange[i][i] / self.areas_m2[i];
            let others =
                self.arriving(i, leaving) - self.exchange[i][i] / self.areas_m2[i] * leaving[i];
            let source = emitted[i].w_per_m2() + reflectance[i] * others.max(0.0);
            if own >= 1.0 && source > 0.0 {
                return Err(EnclosureError::NothingAbsorbs);
            }
            let next = if source == 0.0 { 0.0 } else { source / (1.0 - own) };
            change = change.max((next - leaving[i]).abs());
            largest = largest.max(next);
            leaving[i] = next;
        }
        if !largest.is_finite() {
            return Err(DomainError::Overflow { result: "exitance_w_per_m2" }.into());
        }
        Ok(if largest > 0.0 { change / largest } else { 0.0 })
    }

    /// Irradiance of a surface: Σ `F_ij` `M_j`.
    fn arriving(&self, surface: usize, leaving: &[f64]) -> f64 {
        let terms = self.exchange[surface].iter().zip(leaving).map(|(exchange, m)| exchange * m);
        terms.collect::<Sum>().value() / self.areas_m2[surface]
    }
}

fn area_m2(face: &Polygon) -> f64 {
    let vertices = face.vertices();
    let first = vertices[0];
    let fan = vertices.windows(2).map(|edge| (edge[0] - first).cross(edge[1] - first));
    fan.fold(glam::DVec3::ZERO, |sum, triangle| sum + triangle).length() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form_factor::{parallel_rectangles, perpendicular_rectangles};

    /// Floor, ceiling and four walls of a room a x b x c.
    fn room(a: f64, b: f64, c: f64) -> Enclosure {
        let areas = [a * b, a * b, a * c, a * c, b * c, b * c].map(Area::from_m2);
        Enclosure::new(&areas, |i, j| {
            match (i / 2, j / 2) {
                (0, 0) => parallel_rectangles(a, b, c),
                (1, 1) => parallel_rectangles(a, c, b),
                (2, 2) => parallel_rectangles(b, c, a),
                (0, 1) => perpendicular_rectangles(b, c, a),
                (0, 2) => perpendicular_rectangles(a, c, b),
                _ => perpendicular_rectangles(a, b, c),
            }
            .unwrap()
        })
        .unwrap()
    }

    #[test]
    fn the_faces_of_a_room_do_not_see_themselves() {
        let room = room(4.0, 5.0, 2.5);
        for i in 0..6 {
            assert!(room.form_factor(i, i).unwrap().ratio() < 1e-13);
            let sum: f64 = (0..6).map(|j| room.form_factor(i, j).unwrap().ratio()).sum();
            assert!((sum - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn what_is_emitted_is_absorbed() {
        let room = room(4.0, 5.0, 2.5);
        let emitted = [0.0, 10.0, 0.0, 1.0, 0.0, 0.0].map(Exitance::from_w_per_m2);
        let reflectance = [0.2, 0.9, 0.5, 0.5, 0.7, 1.0];
        let balance = room.radiosity(&emitted, &reflectance).unwrap();
        let mut missing = 0.0;
        for (i, area) in room.areas_m2.iter().enumerate() {
            let absorbed = (1.0 - reflectance[i]) * balance.irradiance[i].w_per_m2();
            missing += area * (emitted[i].w_per_m2() - absorbed);
            let leaving = emitted[i].w_per_m2() + reflectance[i] * balance.irradiance[i].w_per_m2();
            assert!((balance.exitance[i].w_per_m2() - leaving).abs() < 1e-12);
        }
        assert!(missing.abs() < 1e-10, "{missing:e}");
    }

    #[test]
    fn at_one_temperature_every_surface_looks_alike_whatever_it_reflects() {
        // Kirchhoff: emission 1 - ρ makes M = 1 everywhere.
        let room = room(1.0, 30.0, 0.5);
        let reflectance = [0.0, 0.99, 0.3, 0.5, 0.1, 0.95];
        let emitted = reflectance.map(|rho| Exitance::from_w_per_m2(1.0 - rho));
        let balance = room.radiosity(&emitted, &reflectance).unwrap();
        for i in 0..6 {
            assert!((balance.radiance(i).unwrap().w_per_m2_sr() - 1.0 / PI).abs() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let area = [Area::from_m2(1.0); 3];
        let overfull = Enclosure::new(&area, |_, _| FormFactor::from_ratio(0.6)).unwrap_err();
        assert_eq!(overfull, EnclosureError::Overfull { surface: 0, sum: 1.2 });
        let mirror = Enclosure::new(&area[..1], |_, _| FormFactor::ZERO).unwrap();
        let one = [Exitance::from_w_per_m2(1.0)];
        assert_eq!(mirror.radiosity(&one, &[1.0]), Err(EnclosureError::NothingAbsorbs));
        assert!(mirror.radiosity(&one, &[1.5]).is_err());
        assert!(mirror.radiosity(&[], &[0.5]).is_err());
        let mirrors = room(1.0, 1.0, 1.0).radiosity(&[one[0]; 6], &[1.0; 6]);
        assert!(matches!(
            mirrors,
            Err(EnclosureError::NothingAbsorbs | EnclosureError::Unsettled { .. })
        ));
    }
}
