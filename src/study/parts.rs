//! The parts of a predicted uncertainty, and how they are gathered over a region.

use fit::{Angular, Fit, FittedField, Position, Predicted, Ray, Region};
use radiometry::quadrature::gauss_legendre;

use super::prior::{Feature, Prior};

/// Nodes of the rule over the directions of a region, at most; and in each of x and y.
const THETA_NODES_MAX: usize = 24;
const PHI_NODES_MAX: u32 = 48;
const POSITION_NODES_MAX: usize = 9;
/// Nodes across a feature's field, where its truncation is looked at.
const FIELD_THETA_NODES: usize = 40;
const FIELD_PHI_NODES: u32 = 120;
const FIELD_POSITION_NODES: usize = 16;
/// Directions round the region's edge at which the largest u is looked for.
const EDGE_DIRECTIONS: u32 = 12;

/// The parts of a relative standard uncertainty (k = 1); their squares add.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Budget {
    /// By noise, readback and what the basis leaves, independent from reading to reading.
    pub independent: f64,
    /// By each common component, with its name and whether it is a scale of all readings.
    pub common: Vec<(String, f64, bool)>,
    /// By what the basis can't follow of the narrowest feature, or of the expected field; `None`
    /// where the plan declares neither.
    pub truncation: Option<f64>,
}

impl Budget {
    /// All parts.
    pub fn u(&self) -> f64 {
        libm::sqrt(self.squares(true))
    }

    /// All parts but the scale that is common to all readings.
    pub fn u_without_scale(&self) -> f64 {
        libm::sqrt(self.squares(false))
    }

    /// The scale alone.
    pub fn scale(&self) -> f64 {
        libm::sqrt((self.squares(true) - self.squares(false)).max(0.0))
    }

    /// The largest part, by its name; of those that count.
    pub fn largest(&self, with_scale: bool) -> (&str, f64) {
        let common = self.common.iter().filter(|(_, _, is_scale)| with_scale || !is_scale);
        let own =
            [("independent", self.independent), ("truncation", self.truncation.unwrap_or(0.0))];
        own.into_iter()
            .chain(common.map(|(name, u, _)| (name.as_str(), *u)))
            .fold(("independent", 0.0), |most, part| if part.1 > most.1 { part } else { most })
    }

    fn squares(&self, with_scale: bool) -> f64 {
        let common = self.common.iter().filter(|(_, _, is_scale)| with_scale || !is_scale);
        self.independent.powi(2)
            + self.truncation.unwrap_or(0.0).powi(2)
            + common.map(|(_, u, _)| u * u).sum::<f64>()
    }
}

/// The budgets of exitance and radiance, and the radiance's largest u with and without the scale.
pub(super) fn over_region(
    prior: &Prior,
    features: &[Vec<Feature>; 2],
    predicted: &Predicted,
    scales: &[String],
) -> (Budget, Budget, [f64; 2]) {
    let fit = &predicted.fit;
    let nodes = nodes_of_fit(fit);
    let area: f64 = nodes.iter().map(|(_, weight)| weight).sum();
    let mean = |f: &dyn Fn(&Ray) -> f64| -> f64 {
        nodes.iter().map(|(ray, weight)| weight * f(ray)).sum::<f64>() / area
    };
    let level = libm::sqrt(mean(&|ray| prior.radiance(ray.theta_rad).powi(2)));
    let exitance = fit.exitance().value;
    let [truncation_m, truncation_l] = truncation(prior, features, predicted, exitance, level);
    let is_scale = |name: &str| scales.iter().any(|scale| scale == name);

    let mut of_exitance = Budget { truncation: truncation_m, ..Budget::default() };
    of_exitance.independent = fit.exitance().u_independent / exitance;
    for part in fit.contributions().into_iter().skip(1) {
        let scale = is_scale(&part.name);
        of_exitance.common.push((part.name, part.u / exitance, scale));
    }

    let mut squares: Vec<(String, f64)> = Vec::new();
    let mut worst = [0.0_f64; 2];
    for (ray, weight) in nodes.into_iter().chain(edge(fit.region())) {
        let (mut all, mut apart) = (0.0, 0.0);
        for (i, part) in fit.radiance_contributions(&ray).into_iter().enumerate() {
            let square = part.u * part.u;
            all += square;
            apart += if is_scale(&part.name) { 0.0 } else { square };
            // The rows are the same along every ray, in the same order.
            if squares.len() == i {
                squares.push((part.name, 0.0));
            }
            squares[i].1 += weight / area * square;
        }
        worst = [worst[0].max(all), worst[1].max(apart)];
    }
    let mut rms = squares.into_iter().map(|(name, square)| (name, libm::sqrt(square) / level));
    let independent = rms.next().map_or(0.0, |(_, u)| u);
    let with_kind = |(name, u): (String, f64)| {
        let scale = is_scale(&name);
        (name, u, scale)
    };
    let common = rms.map(with_kind).collect();
    let of_radiance = Budget { independent, common, truncation: truncation_l };

    (of_exitance, of_radiance, worst.map(|square| libm::sqrt(square) / level))
}

/// By how much the fit of what is expected, and of a feature of each kind on average, is off.
fn truncation(
    prior: &Prior,
    features: &[Vec<Feature>; 2],
    predicted: &Predicted,
    exitance: f64,
    level: f64,
) -> [Option<f64>; 2] {
    let region = predicted.fit.region();
    let mut squares = [0.0; 2];
    let mut is_known = false;
    if prior.exponent > 0.0 {
        is_known = true;
        let rules = [in_directions(region, region.theta_max_rad), in_directions(region, HORIZON)];
        add(&mut squares, off(&predicted.fit, &|ray| prior.radiance(ray.theta_rad), rules), 1);
    }
    let mut fields = predicted.fields.iter();
    for (kind, features) in features.iter().enumerate() {
        let fitted: Vec<&FittedField> = fields.by_ref().take(features.len()).collect();
        for (feature, field) in features.iter().zip(fitted) {
            is_known = true;
            let rule = |theta_max_rad: f64| match kind {
                0 => in_directions(region, theta_max_rad),
                _ => in_positions(region, theta_max_rad),
            };
            let rules = [rule(region.theta_max_rad), rule(HORIZON)];
            let error = off(&field.fit, &|ray| feature.radiance(ray), rules);
            add(&mut squares, error, features.len());
        }
    }
    let [m, l] = squares.map(libm::sqrt);
    if is_known { [Some(m / exitance), Some(l / level)] } else { [None, None] }
}

const HORIZON: f64 = core::f64::consts::FRAC_PI_2;

fn add(squares: &mut [f64; 2], errors: [f64; 2], among: usize) {
    for (square, error) in squares.iter_mut().zip(errors) {
        *square += error * error / among as f64;
    }
}

/// By how much a fit's exitance and radiance (root mean square) are off a field; by rules over the
/// region and over the hemisphere.
fn off(fit: &Fit, field: &dyn Fn(&Ray) -> f64, rules: [Vec<(Ray, f64)>; 2]) -> [f64; 2] {
    let [region, hemisphere] = rules;
    let share = |rule: &[(Ray, f64)], f: &dyn Fn(&Ray) -> f64| -> f64 {
        let whole: f64 = rule.iter().map(|(_, weight)| weight).sum();
        rule.iter().map(|(ray, weight)| weight * f(ray)).sum::<f64>() / whole
    };
    let square = share(&region, &|ray| (fit.value(ray) - field(ray)).powi(2));
    let exitance = core::f64::consts::PI * share(&hemisphere, field);
    [(fit.exitance().value - exitance).abs(), libm::sqrt(square)]
}

/// A rule fine enough for the square of a function of the fit: u² is a polynomial of twice its
/// degrees, and the rule is exact for it up to degree 23 in direction and 8 in position.
fn nodes_of_fit(fit: &Fit) -> Vec<(Ray, f64)> {
    let degree = match fit.basis().angular {
        Angular::Zernike { degree, .. }
        | Angular::Hemispherical { degree }
        | Angular::EvenHarmonics { degree }
        | Angular::Spherical { degree }
        | Angular::SecondPlane { degree } => degree,
        Angular::Splines { theta_spans, phi_spans, .. } => theta_spans.max(phi_spans),
    };
    let places = match fit.basis().position {
        Position::Legendre { degree } => degree + 1,
        Position::Splines { spans } => spans + 3,
    };
    let theta = (degree / 2 + 1).min(THETA_NODES_MAX);
    let phi = u32::try_from(2 * degree + 1).unwrap_or(PHI_NODES_MAX).min(PHI_NODES_MAX);
    rule(fit.region(), fit.region().theta_max_rad, (theta, phi, places.min(POSITION_NODES_MAX)))
}

fn in_directions(region: &Region, theta_max_rad: f64) -> Vec<(Ray, f64)> {
    rule(region, theta_max_rad, (FIELD_THETA_NODES, FIELD_PHI_NODES, 1))
}

fn in_positions(region: &Region, theta_max_rad: f64) -> Vec<(Ray, f64)> {
    rule(region, theta_max_rad, (2, 4, FIELD_POSITION_NODES))
}

/// Rays and weights by throughput: Gauss-Legendre in sin²θ and in x and y, the trapezoid in φ.
fn rule(
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

/// Rays where a fit is held worst: round the region's edge at its corners and its middle, and along
/// the normal. They weigh nothing.
fn edge(region: &Region) -> Vec<(Ray, f64)> {
    let (x, y) = (region.x_m, region.y_m);
    let middle = (0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1));
    let places = [(x.0, y.0), (x.0, y.1), (x.1, y.0), (x.1, y.1), middle];
    let mut rays = Vec::new();
    for (x_m, y_m) in places {
        rays.push((Ray { x_m, y_m, theta_rad: 0.0, phi_rad: 0.0 }, 0.0));
        for k in 0..EDGE_DIRECTIONS {
            let phi_rad = core::f64::consts::TAU * f64::from(k) / f64::from(EDGE_DIRECTIONS);
            rays.push((Ray { x_m, y_m, theta_rad: region.theta_max_rad, phi_rad }, 0.0));
        }
    }
    rays
}
