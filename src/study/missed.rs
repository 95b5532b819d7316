//! What a basis misses of fields that a plan declares: by how much the fits of features as narrow as it
//! says, and of the expected field, are off, over the region and over the hemisphere.

use core::f64::consts::{FRAC_PI_2, PI};

use fit::{Predicted, Ray, Region};
use radiometry::quadrature::gauss_legendre;

use super::prior::{Features, Prior};

/// Nodes across a feature's field.
const FIELD_THETA_NODES: usize = 40;
const FIELD_PHI_NODES: u32 = 120;
const FIELD_POSITION_NODES: usize = 16;

/// By how much quantities are off.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Missed {
    /// The exitance over the hemisphere.
    pub(super) exitance: Truncation,
    /// The exitance within the region's cone.
    pub(super) within: Truncation,
    /// The radiance, root mean square over the region.
    pub(super) radiance: Truncation,
}

/// What the basis can't follow, as part of u.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truncation {
    /// Root mean square over all features.
    pub u: f64,
    /// Over those of the shape that the basis follows better: spots, or rings and stripes.
    pub least: f64,
    /// Over those of the other shape.
    pub most: f64,
}

impl Truncation {
    pub(super) fn over(self, whole: f64) -> Self {
        Self { u: self.u / whole, least: self.least / whole, most: self.most / whole }
    }
}

/// Squares of errors of the exitance over the hemisphere, within the region, and of the radiance.
type Squares = [f64; 3];

/// Of the expected field, where it is no even one, and of one feature of each kind that is declared; `None`
/// where neither is.
pub(super) fn missed(
    prior: &Prior,
    features: &[Features; 2],
    predicted: &Predicted,
) -> Option<Missed> {
    let region = predicted.fit.region();
    let (mut all, mut least, mut most) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    let mut is_known = false;
    if prior.exponent > 0.0 {
        is_known = true;
        let radiance = |ray: &Ray, _| prior.radiance(ray.theta_rad);
        let own = squares(predicted, 0..1, &radiance, Fineness::InDirection.rules(region));
        for sum in [&mut all, &mut least, &mut most] {
            add(sum, own[0]);
        }
    }
    let mut first = 1;
    for (kind, fineness) in features.iter().zip([Fineness::InDirection, Fineness::InPosition]) {
        if kind.is_empty() {
            continue;
        }
        is_known = true;
        let fields: Vec<_> = kind.iter().collect();
        let radiance = |ray: &Ray, i: usize| fields[i].radiance(ray);
        let fits = first..first + kind.len();
        let squares = squares(predicted, fits, &radiance, fineness.rules(region));
        first += kind.len();
        let (spots, drawn_out) = squares.split_at(kind.spots.len());
        let (spots, drawn_out) = (mean(spots), mean(drawn_out));
        let both = |of: fn(f64, f64) -> f64| [0, 1, 2].map(|i| of(spots[i], drawn_out[i]));
        add(&mut all, both(|a, b| 0.5 * (a + b)));
        add(&mut least, both(f64::min));
        add(&mut most, both(f64::max));
    }
    let truncation = |i: usize| Truncation {
        u: libm::sqrt(all[i]),
        least: libm::sqrt(least[i]),
        most: libm::sqrt(most[i]),
    };
    is_known.then(|| Missed {
        exitance: truncation(0),
        within: truncation(1),
        radiance: truncation(2),
    })
}

fn add(sum: &mut Squares, more: Squares) {
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
}

fn mean(all: &[Squares]) -> Squares {
    let count = all.len().max(1) as f64;
    [0, 1, 2].map(|i| all.iter().map(|squares| squares[i]).sum::<f64>() / count)
}

/// By how much some of the predicted fits (0 is the expected field's) are off the fields that they are of,
/// by rules over the region and over the hemisphere.
fn squares(
    predicted: &Predicted,
    fits: std::ops::Range<usize>,
    field: &dyn Fn(&Ray, usize) -> f64,
    [region, hemisphere]: [Vec<(Ray, f64)>; 2],
) -> Vec<Squares> {
    let count = fits.len();
    let mut square = vec![0.0; count];
    let (mut within, mut whole) = (vec![0.0; count], vec![0.0; count]);
    let total = |rule: &[(Ray, f64)]| rule.iter().map(|(_, weight)| weight).sum::<f64>();
    let share = 1.0 / total(&region);
    for (ray, weight) in &region {
        let values = predicted.values(ray);
        for (i, k) in fits.clone().enumerate() {
            let radiance = field(ray, i);
            within[i] += share * weight * radiance;
            square[i] += share * weight * (values[k] - radiance).powi(2);
        }
    }
    let share = 1.0 / total(&hemisphere);
    for (ray, weight) in &hemisphere {
        for (i, whole) in whole.iter_mut().enumerate() {
            *whole += share * weight * field(ray, i);
        }
    }
    let sin2_max = libm::sin(predicted.fit.region().theta_max_rad).powi(2);
    let of = |(i, k): (usize, usize)| {
        let fit = match k {
            0 => &predicted.fit,
            _ => &predicted.fields[k - 1].fit,
        };
        let off = fit.exitance().value - PI * whole[i];
        let off_within = fit.exitance_within_region().value - PI * sin2_max * within[i];
        [off * off, off_within * off_within, square[i]]
    };
    fits.enumerate().map(of).collect()
}

/// What a field's rules have to tell apart.
#[derive(Debug, Clone, Copy)]
enum Fineness {
    InDirection,
    InPosition,
}

impl Fineness {
    fn rules(self, region: &Region) -> [Vec<(Ray, f64)>; 2] {
        let nodes = match self {
            Self::InDirection => (FIELD_THETA_NODES, FIELD_PHI_NODES, 1),
            Self::InPosition => (2, 4, FIELD_POSITION_NODES),
        };
        [region.theta_max_rad, FRAC_PI_2].map(|theta_max_rad| rule(region, theta_max_rad, nodes))
    }
}

/// Rays and weights by throughput: Gauss-Legendre in sin²θ and in x and y, the trapezoid in φ.
pub(super) fn rule(
    region: &Region,
    theta_max_rad: f64,
    (theta, phi, position): (usize, u32, usize),
) -> Vec<(Ray, f64)> {
    let scale = |(low, high): (f64, f64), t: f64| low + (high - low) * 0.5 * (1.0 + t);
    let sin2_max = libm::sin(theta_max_rad).powi(2);
    let line = gauss_legendre(position);
    let mut rule = Vec::new();
    for (t, weight_theta) in gauss_legendre(theta) {
        let theta_rad = libm::asin(libm::sqrt(scale((0.0, sin2_max), t)));
        for k in 0..phi {
            let phi_rad = core::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(phi);
            for (tx, weight_x) in &line {
                for (ty, weight_y) in &line {
                    let (x_m, y_m) = (scale(region.x_m, *tx), scale(region.y_m, *ty));
                    let ray = Ray { x_m, y_m, theta_rad, phi_rad };
                    rule.push((ray, weight_theta * weight_x * weight_y));
                }
            }
        }
    }
    rule
}
