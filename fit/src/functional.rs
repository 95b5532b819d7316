//! Anything linear in the field: a weighted sum of radiances along rays, as one row over the
//! coefficients. A quadrature of L over a receiver, a cone or a cell is such a sum, and here it
//! gets its value and its uncertainty with all correlations. Knows no basis: the rows come from it.

use crate::basis::{Basis, dot};
use crate::{Contribution, Estimate, Fit, Ray};

/// A linear functional of the field: the value is the row times the coefficients. It belongs to
/// the fit that made it, and to others of the same basis and region.
#[derive(Debug, Clone, PartialEq)]
pub struct Functional {
    row: Vec<f64>,
    /// Over the functions beyond the fit's own, where it knows what it misses.
    beyond: Vec<f64>,
    /// The one direction that it is a sum over, if there is one.
    along: Option<Along>,
    /// What is not known of it where nothing was measured: one u of an independent component each.
    /// Empty where that is not known.
    unmeasured: Vec<f64>,
}

/// A direction, and the sum of the weights of rays along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Along {
    pub(crate) theta_rad: f64,
    pub(crate) phi_rad: f64,
    pub(crate) weight: f64,
}

impl Functional {
    pub(crate) fn new(row: Vec<f64>, beyond: Vec<f64>) -> Self {
        Self { row, beyond, along: None, unmeasured: Vec::new() }
    }

    /// The same, with what is not known of it where nothing was measured.
    pub(crate) fn with_unmeasured(self, unmeasured: Vec<f64>) -> Self {
        Self { unmeasured, ..self }
    }

    /// See [`with_unmeasured`](Self::with_unmeasured).
    pub(crate) fn unmeasured(&self) -> &[f64] {
        &self.unmeasured
    }

    /// The variance by all of these.
    pub(crate) fn unmeasured_variance(&self) -> f64 {
        dot(&self.unmeasured, &self.unmeasured)
    }

    /// The same, of one direction alone.
    pub(crate) fn towards(self, along: Along) -> Self {
        Self { along: Some(along), ..self }
    }

    /// The one direction that it is a sum over. What is finer than all functions
    /// ([`crate::Penalised::truncation`]) is in it times its weight: in one direction all of it, at
    /// however many places, since it may be the same at all of them; and there the field may be
    /// rougher than elsewhere ([`crate::Uneven`]). Both are taken to be another in every direction, and
    /// to average out of sums over several, but for what readings miss of each other, which is a missed field.
    pub(crate) fn along(&self) -> Option<Along> {
        self.along
    }

    fn is_nothing(&self) -> bool {
        self.row.iter().chain(&self.beyond).all(|element| *element == 0.0)
    }

    /// Of a field over the fit's functions and those beyond.
    pub(crate) fn times_field(&self, field: &[f64]) -> f64 {
        let (own, beyond) = field.split_at(self.row.len());
        dot(&self.row, own) + dot(&self.beyond, beyond)
    }

    /// One number a coefficient, in the unit of the weights.
    pub fn row(&self) -> &[f64] {
        &self.row
    }

    /// The functional times a number: a unit, an area, a share.
    #[must_use]
    pub fn times(mut self, factor: f64) -> Self {
        let rows = self.row.iter_mut().chain(&mut self.beyond).chain(&mut self.unmeasured);
        rows.for_each(|element| *element *= factor);
        if let Some(along) = &mut self.along {
            along.weight *= factor;
        }
        self
    }

    /// This functional and `factor` times another one of the same fit: differences, means, and the
    /// first order of what isn't linear.
    ///
    /// # Panics
    /// As [`add`](Self::add).
    #[must_use]
    pub fn plus(mut self, factor: f64, other: &Self) -> Self {
        self.add(factor, other);
        self
    }

    /// Adds `factor` times another functional of the same fit.
    ///
    /// # Panics
    /// If the two have different numbers of coefficients, and so never belonged to one fit.
    pub fn add(&mut self, factor: f64, other: &Self) {
        assert_eq!(self.row.len(), other.row.len(), "functionals of different fits");
        assert_eq!(self.beyond.len(), other.beyond.len(), "functionals of different fits");
        let (own, others) = (self.unmeasured.len(), other.unmeasured.len());
        assert_eq!(own, others, "functionals of different fits");
        let added = other.along.map(|along| Along { weight: factor * along.weight, ..along });
        self.along = match (self.is_nothing(), other.is_nothing()) {
            (_, true) => self.along,
            (true, false) => added,
            (false, false) => self.along.zip(added).and_then(|(own, added)| own.and(added)),
        };
        self.row.iter_mut().zip(&other.row).for_each(|(a, b)| *a += factor * b);
        self.beyond.iter_mut().zip(&other.beyond).for_each(|(a, b)| *a += factor * b);
        self.unmeasured.iter_mut().zip(&other.unmeasured).for_each(|(a, b)| *a += factor * b);
    }
}

impl Along {
    /// Both, of one direction.
    fn and(self, other: Self) -> Option<Self> {
        let bits = |along: &Self| [along.theta_rad.to_bits(), along.phi_rad.to_bits()];
        let weight = self.weight + other.weight;
        (bits(&self) == bits(&other)).then_some(Self { weight, ..self })
    }
}

impl Fit {
    /// The functional Σ wᵢ L(rayᵢ). No ray at all makes the functional that is 0. Rays beyond the
    /// region or its cone are extrapolated; u tells how little is known there.
    ///
    /// Whatever is linear in L is such a sum, by a quadrature rule's nodes and weights:
    ///
    /// ```
    /// use fit::{BasisSpec, Common, Noise, Ray, Region, Sample, Shift};
    /// use std::f64::consts::PI;
    ///
    /// // A Lambertian field of 100 W·m⁻²·sr⁻¹, its responsivity known to 2 %.
    /// let ray = |theta_rad: f64, phi_rad: f64| Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
    /// let noise = Noise::Fixed { variance: 0.01 };
    /// let at = |i: u32| ray(f64::from(i % 8) * 0.2, f64::from(i / 8) * 2.1);
    /// let samples: Vec<Sample> =
    ///     (0..24).map(|i| Sample { ray: at(i), value: 100.0, noise }).collect();
    /// let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);
    /// let basis = BasisSpec::zernike(2, 0);
    /// let common = Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale };
    /// let field = fit::fit(&samples, &region, basis, &[common])?;
    ///
    /// // The exitance into a cone of half angle α is π L sin²α. With s = sin²θ the projected solid
    /// // angle is dφ ds / 2: the mid-point rule over s and φ.
    /// let sin2 = 0.25;
    /// let (rings, spokes) = (32, 12);
    /// let nodes = (0..rings * spokes).map(|k| {
    ///     let s = sin2 * (f64::from(k / spokes) + 0.5) / f64::from(rings);
    ///     let phi_rad = 2.0 * PI * f64::from(k % spokes) / f64::from(spokes);
    ///     (ray(s.sqrt().asin(), phi_rad), PI * sin2 / f64::from(rings * spokes))
    /// });
    /// let cone = field.weighted_rays(nodes);
    ///
    /// let exitance = field.of(&cone);
    /// assert!((exitance.value - 100.0 * PI * sin2).abs() < 1e-10);
    /// let scale = 0.02 * 100.0 * PI * sin2;
    /// assert!((exitance.u - exitance.u_independent.hypot(scale)).abs() < 1e-10);
    /// assert_eq!(field.contributions_of(&cone)[1].name, "responsivity");
    /// assert!((field.contributions_of(&cone)[1].u - scale).abs() < 1e-10);
    /// # Ok::<(), fit::FitError>(())
    /// ```
    ///
    /// # Panics
    /// If a weight or a number of a ray isn't finite: quadratures have none such.
    pub fn weighted_rays(&self, rays: impl IntoIterator<Item = (Ray, f64)>) -> Functional {
        let rays: Vec<(Ray, f64)> = rays.into_iter().collect();
        for (ray, weight) in &rays {
            let Ray { x_m, y_m, theta_rad, phi_rad } = *ray;
            let is_finite = [x_m, y_m, theta_rad, phi_rad, *weight].into_iter().all(f64::is_finite);
            assert!(is_finite, "not finite: {ray:?} of weight {weight}");
        }
        let along = |(ray, weight): &(Ray, f64)| Along {
            theta_rad: ray.theta_rad,
            phi_rad: ray.phi_rad,
            weight: *weight,
        };
        let first = rays.first().map(along);
        let one = first.and_then(|first| rays[1..].iter().map(along).try_fold(first, Along::and));
        let sum = self.functional(|basis| sum_over(basis, &rays));
        let sum = sum.with_unmeasured(self.unmeasured_along(&rays));
        match one {
            Some(along) => sum.towards(along),
            None => sum,
        }
    }

    /// The mean of the radiance over the region in a direction, as a functional. Times the region's
    /// area and cos θ it is the intensity.
    pub fn mean_towards(&self, theta_rad: f64, phi_rad: f64) -> Functional {
        let mean = self.functional(|basis| basis.mean_over_region(theta_rad, phi_rad));
        let unmeasured = self.unmeasured_towards(&[(theta_rad, phi_rad, 1.0)]);
        mean.with_unmeasured(unmeasured).towards(Along { theta_rad, phi_rad, weight: 1.0 })
    }

    /// The flux in all directions of the chart, as a functional: from the region, through both
    /// rectangles of two planes.
    pub(crate) fn throughput_sum(&self) -> Functional {
        self.exitance_sum().times(self.region().area_m2())
    }

    /// The functional's value with its uncertainty, in the values' unit times the weights'.
    ///
    /// # Panics
    /// If the functional has another number of coefficients, and so is of another fit.
    pub fn of(&self, functional: &Functional) -> Estimate {
        self.demand_own(functional);
        self.estimate(functional)
    }

    /// The functional's value alone: for searches.
    pub(crate) fn of_value(&self, functional: &Functional) -> f64 {
        self.demand_own(functional);
        dot(&functional.row, self.coefficients())
    }

    /// The functional's uncertainty by source, the independent part first.
    ///
    /// # Panics
    /// As [`of`](Self::of).
    pub fn contributions_of(&self, functional: &Functional) -> Vec<Contribution> {
        self.demand_own(functional);
        self.budget(functional)
    }

    fn demand_own(&self, functional: &Functional) {
        assert_eq!(functional.row.len(), self.coefficients().len(), "a functional of another fit");
    }
}

/// Σ wᵢ times the functions along rayᵢ.
fn sum_over(basis: &Basis, rays: &[(Ray, f64)]) -> Vec<f64> {
    let mut scratch = basis.scratch();
    let mut along = vec![0.0; basis.len()];
    let mut row = vec![0.0; basis.len()];
    for (ray, weight) in rays {
        basis.row(ray, &mut scratch, &mut along);
        row.iter_mut().zip(&along).for_each(|(sum, element)| *sum += weight * element);
    }
    row
}
