//! The parts of a predicted uncertainty, and how they are gathered over a region.

use fit::{Angular, Contribution, Fit, Position, Predicted, Ray, Region};

use super::missed::{Truncation, missed, rule};
use super::prior::{Features, Prior};

/// Nodes of the rule over the directions of a region, at most; and in each of x and y.
const THETA_NODES_MAX: usize = 24;
const PHI_NODES_MAX: u32 = 48;
const POSITION_NODES_MAX: usize = 9;
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
    pub truncation: Option<Truncation>,
}

impl Budget {
    /// All parts.
    pub fn u(&self) -> f64 {
        libm::sqrt(self.squares(true))
    }

    /// All parts, with the truncation of the shape that the basis follows better, and of the other.
    pub fn range(&self) -> [f64; 2] {
        let with = |truncation: fn(&Truncation) -> f64| {
            let as_if = |t: &Truncation| Truncation { u: truncation(t), ..*t };
            Self { truncation: self.truncation.as_ref().map(as_if), ..self.clone() }.u()
        };
        [with(|t| t.least), with(|t| t.most)]
    }

    /// What readings do not share: their noise, and what the basis can't follow. As the u of a fit.
    pub fn not_shared(&self) -> f64 {
        libm::hypot(self.independent, self.truncation_u())
    }

    fn truncation_u(&self) -> f64 {
        self.truncation.map_or(0.0, |truncation| truncation.u)
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
        let own = [("independent", self.independent), ("truncation", self.truncation_u())];
        own.into_iter()
            .chain(common.map(|(name, u, _)| (name.as_str(), *u)))
            .fold(("independent", 0.0), |most, part| if part.1 > most.1 { part } else { most })
    }

    fn squares(&self, with_scale: bool) -> f64 {
        let common = self.common.iter().filter(|(_, _, is_scale)| with_scale || !is_scale);
        self.independent.powi(2)
            + self.truncation_u().powi(2)
            + common.map(|(_, u, _)| u * u).sum::<f64>()
    }
}

/// What is foretold, gathered.
pub(super) struct Parts {
    pub(super) of_exitance: Budget,
    pub(super) of_exitance_within_region: Budget,
    /// The part of the expected exitance beyond the region's cone.
    pub(super) beyond_region: f64,
    pub(super) of_radiance: Budget,
    /// The radiance's largest u, with and without the scale.
    pub(super) worst: [f64; 2],
}

impl Parts {
    pub(super) fn of(
        prior: &Prior,
        features: &[Features; 2],
        predicted: &Predicted,
        scales: &[String],
    ) -> Self {
        let fit = &predicted.fit;
        let missed = missed(prior, features, predicted);
        let is_scale = |name: &str| scales.iter().any(|scale| scale == name);
        let (exitance, within) = (fit.exitance().value, fit.exitance_within_region().value);
        let (of_radiance, level, worst) = over_region(prior, fit, &is_scale);
        let of = |rows: Vec<Contribution>, whole: f64| Budget::of_rows(rows, whole, &is_scale);
        Self {
            of_exitance: Budget {
                truncation: missed.map(|missed| missed.exitance.over(exitance)),
                ..of(fit.contributions(), exitance)
            },
            of_exitance_within_region: Budget {
                truncation: missed.map(|missed| missed.within.over(within)),
                ..of(fit.contributions_within_region(), within)
            },
            beyond_region: 1.0 - within / exitance,
            of_radiance: Budget {
                truncation: missed.map(|missed| missed.radiance.over(level)),
                ..of_radiance
            },
            worst,
        }
    }
}

/// The radiance's budget but for truncation, the root mean square that it is relative to, and its largest u
/// with and without the scale.
fn over_region(
    prior: &Prior,
    fit: &Fit,
    is_scale: &dyn Fn(&str) -> bool,
) -> (Budget, f64, [f64; 2]) {
    let nodes = nodes_of_fit(fit);
    let area: f64 = nodes.iter().map(|(_, weight)| weight).sum();
    let of_ray = |(ray, weight): &(Ray, f64)| weight * prior.radiance(ray.theta_rad).powi(2);
    let level = libm::sqrt(nodes.iter().map(of_ray).sum::<f64>() / area);

    let mut rows: Vec<Contribution> = Vec::new();
    let mut worst = [0.0_f64; 2];
    for (ray, weight) in nodes.into_iter().chain(edge(fit.region())) {
        let (mut all, mut apart) = (0.0, 0.0);
        for (i, part) in fit.radiance_contributions(&ray).into_iter().enumerate() {
            let square = part.u * part.u;
            all += square;
            apart += if is_scale(&part.name) { 0.0 } else { square };
            // The rows are the same along every ray, in the same order.
            if rows.len() == i {
                rows.push(Contribution { u: 0.0, ..part });
            }
            rows[i].u += weight / area * square;
        }
        worst = [worst[0].max(all), worst[1].max(apart)];
    }
    for row in &mut rows {
        row.u = libm::sqrt(row.u);
    }
    let worst = worst.map(|square| libm::sqrt(square) / level);
    (Budget::of_rows(rows, level, is_scale), level, worst)
}

impl Budget {
    /// Of contributions, the independent one first, over what they are relative to.
    fn of_rows(rows: Vec<Contribution>, whole: f64, is_scale: &dyn Fn(&str) -> bool) -> Self {
        let mut rows = rows.into_iter();
        let independent = rows.next().map_or(0.0, |row| row.u / whole);
        let common = rows.map(|row| {
            let scale = is_scale(&row.name);
            (row.name, row.u / whole, scale)
        });
        Self { independent, common: common.collect(), truncation: None }
    }
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
