//! Sums over rays made finer until the quadrature no longer matters beside u. Knows no geometry:
//! it is handed rules by their level of fineness.

use super::medium::Medium;
use super::{DeriveError, Derived, Field, Remark};
use crate::{Contribution, Estimate, Functional, Ray, Region};
use radiometry::quadrature::gauss_legendre;

/// A term of a sum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Node {
    /// The radiance along a ray.
    Along(Ray),
    /// The mean over the region of the radiance in a direction.
    Towards {
        /// From the normal, radians.
        theta_rad: f64,
        /// From +x towards +y, radians.
        phi_rad: f64,
    },
}

/// Terms with their weights.
pub(super) type Terms<'a> = Box<dyn Iterator<Item = (Node, f64)> + 'a>;

/// A sum as functionals: of the rays where something was measured, and of the others.
#[derive(Debug, Clone)]
pub(super) struct Sum {
    inside: Functional,
    outside: Functional,
    /// Terms of which nothing came through.
    lost: usize,
}

impl Sum {
    pub(super) fn whole(&self) -> Functional {
        self.inside.clone().plus(1.0, &self.outside)
    }
}

impl Field<'_> {
    /// The sum as a rule of the level has it; `None` where that are too many rays.
    pub(super) fn sum(
        &self,
        terms: impl Iterator<Item = (Node, f64)>,
        level: usize,
    ) -> Option<Sum> {
        let nothing = self.fit.weighted_rays([]);
        let mut sum = Sum { inside: nothing.clone(), outside: nothing, lost: 0 };
        let places = match self.medium {
            Medium::Air => Vec::new(),
            _ => places(self.fit.region(), PLACES_FIRST + 2 * level),
        };
        let mut rays: Vec<(Ray, f64)> = Vec::new();
        let mut count = 0;
        for (node, weight) in terms {
            match (node, self.medium) {
                (Node::Along(ray), _) => rays.push((ray, weight)),
                (Node::Towards { theta_rad, phi_rad }, Medium::Air) => {
                    let part = self.fit.mean_towards(theta_rad, phi_rad);
                    let is_inside = theta_rad <= self.fit.region().theta_max_rad + ROUNDING_RAD
                        && self.fit.is_in_no_gap(theta_rad, phi_rad);
                    let side = if is_inside { &mut sum.inside } else { &mut sum.outside };
                    side.add(weight, &part);
                }
                (Node::Towards { theta_rad, phi_rad }, _) => {
                    count += places.len();
                    rays.extend(places.iter().map(|&(x_m, y_m, share)| {
                        (Ray { x_m, y_m, theta_rad, phi_rad }, share * weight)
                    }));
                }
            }
            count += 1;
            if rays.len() >= CHUNK {
                self.absorb(&mut sum, &mut rays);
            }
            if count > RAYS_MAX {
                return None;
            }
        }
        self.absorb(&mut sum, &mut rays);
        Some(sum)
    }

    fn absorb(&self, sum: &mut Sum, rays: &mut Vec<(Ray, f64)>) {
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for (ray, weight) in rays.drain(..) {
            let Some((seen, factor)) = self.medium.seen(&ray) else {
                sum.lost += 1;
                continue;
            };
            let side = if self.fit.is_measured(&seen) { &mut inside } else { &mut outside };
            side.push((seen, weight * factor));
        }
        for (side, rays) in [(&mut sum.inside, inside), (&mut sum.outside, outside)] {
            if !rays.is_empty() {
                side.add(1.0, &self.fit.weighted_rays(rays));
            }
        }
    }

    /// The functional of one node, without refinement: for curves and single rays.
    pub(super) fn functional(&self, node: Node) -> Result<Functional, DeriveError> {
        let theta_rad = match node {
            Node::Along(ray) => ray.theta_rad,
            Node::Towards { theta_rad, .. } => theta_rad,
        };
        self.sum(std::iter::once((node, 1.0)), POSITION_LEVEL)
            .filter(|sum| sum.lost == 0)
            .map(|sum| sum.whole())
            .ok_or(DeriveError::NothingThrough { theta_rad })
    }

    /// The sum at the first level of its rule that changes the value by no more than a small part of
    /// its u.
    pub(super) fn refined<'a>(
        &self,
        rule: impl Fn(usize) -> Terms<'a>,
    ) -> Result<Derived, DeriveError> {
        let mut before: Option<Estimate> = None;
        let (mut bound, mut allowed) = (f64::INFINITY, 0.0);
        for level in 0..LEVELS {
            let Some(sum) = self.sum(rule(level), level) else { break };
            let found = self.fit.of(&sum.whole());
            allowed = (BOUND_SHARE * found.u).max(ROUNDING * found.value.abs());
            let change = before.map(|before| (found.value - before.value).abs());
            let u_change = before.map_or(f64::INFINITY, |before| (found.u - before.u).abs());
            bound = change.unwrap_or(f64::INFINITY);
            if bound <= allowed && u_change <= U_SHARE * found.u {
                let with = |medium: Medium| {
                    let field = Field { fit: self.fit, medium };
                    let sum = field.sum(rule(level), level)?;
                    Some(self.fit.of(&sum.whole()).value)
                };
                return Ok(self.stated(&sum, bound, with));
            }
            before = Some(found);
        }
        Err(DeriveError::TooFine { rays_max: RAYS_MAX, bound, wanted: allowed })
    }

    /// A sum's value, with what the layer's uncertain numbers add to its u.
    fn stated(&self, sum: &Sum, bound: f64, with: impl Fn(Medium) -> Option<f64>) -> Derived {
        let whole = sum.whole();
        let (value, inside) = (self.fit.of(&whole).value, self.fit.of(&sum.inside).value);
        let (_, outside) = (value, self.fit.of(&sum.outside).value);
        let mut remarks = Vec::new();
        if outside != 0.0 {
            remarks.push(Remark::Extrapolated);
        }
        if sum.lost > 0 {
            remarks.push(Remark::Grazing);
        }
        Derived {
            estimate: self.fit.of(&whole),
            budget: self.fit.contributions_of(&whole),
            measured_fraction: (value > 0.0).then(|| inside / value),
            functional: (self.medium == Medium::Air).then_some(whole),
            quadrature_bound: bound,
            remarks,
        }
        .with_layer(&self.medium, with)
    }

    /// A sum without refinement, with its u.
    pub(super) fn estimate(&self, terms: &[(Node, f64)]) -> Estimate {
        let with = |medium: Medium| {
            let field = Field { fit: self.fit, medium };
            Some(field.sum(terms.iter().copied(), POSITION_LEVEL)?.whole())
        };
        let functional = with(self.medium).unwrap_or_else(|| self.fit.weighted_rays([]));
        let value = self.fit.of_value(&functional);
        let shifted = |medium: Medium| Some(self.fit.of_value(&with(medium)?));
        self.first_order(value, &functional, shifted).estimate
    }

    /// A quantity that is the functional's, or to first order shifts as it does, with the layer's
    /// uncertain numbers; `with` answers its value under another layer.
    pub(super) fn first_order(
        &self,
        value: f64,
        functional: &Functional,
        with: impl Fn(Medium) -> Option<f64>,
    ) -> Derived {
        Derived {
            estimate: Estimate { value, ..self.fit.of(functional) },
            budget: self.fit.contributions_of(functional),
            measured_fraction: None,
            functional: None,
            quadrature_bound: 0.0,
            remarks: Vec::new(),
        }
        .with_layer(&self.medium, with)
    }
}

impl Derived {
    /// Adds what the layer's uncertain numbers do to the value, by central differences over ±u.
    fn with_layer(mut self, medium: &Medium, with: impl Fn(Medium) -> Option<f64>) -> Self {
        let mut variance = self.estimate.u * self.estimate.u;
        for (name, up, down, apart) in medium.disturbed() {
            if let (Some(up), Some(down)) = (with(up), with(down)) {
                let u = (up - down).abs() / apart;
                self.budget.push(Contribution { name: name.to_owned(), u });
                variance += u * u;
            }
        }
        self.estimate.u = variance.sqrt();
        self
    }
}

/// Places over the region with their shares, by Gauss-Legendre; one along a side without length.
fn places(region: &Region, nodes: usize) -> Vec<(f64, f64, f64)> {
    let side = |(from, to): (f64, f64)| -> Vec<(f64, f64)> {
        let middle = f64::midpoint(from, to);
        if from < to {
            let rule = gauss_legendre(nodes);
            rule.into_iter().map(|(t, w)| (middle + 0.5 * t * (to - from), 0.5 * w)).collect()
        } else {
            vec![(middle, 1.0)]
        }
    };
    let (x, y) = (side(region.x_m), side(region.y_m));
    let along = |&(x_m, wx): &(f64, f64)| {
        y.iter().map(move |&(y_m, wy)| (x_m, y_m, wx * wy)).collect::<Vec<_>>()
    };
    x.iter().flat_map(along).collect()
}

/// The quadrature's change may be this share of u. It then adds less than a thousandth to it.
const BOUND_SHARE: f64 = 0.02;
/// Where u is next to nothing: this share of the value.
const ROUNDING: f64 = 1e-10;
/// By how much u itself may change.
const U_SHARE: f64 = 0.01;
/// Levels of fineness, each with more nodes a side.
const LEVELS: usize = 12;
/// Rays of one rule at most: half a minute's work.
const RAYS_MAX: usize = 4_000_000;
/// Nodes a side over the region at the first level.
const PLACES_FIRST: usize = 4;
/// The level of the mean over the region on a curve: 8 nodes a side, exact for degree 15.
const POSITION_LEVEL: usize = 2;
/// Rays that are held at once.
const CHUNK: usize = 8192;
/// An angle's rounding.
const ROUNDING_RAD: f64 = 1e-9;
