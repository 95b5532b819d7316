//! Readings that tests of several ways to fit share: at rays that fill a region evenly, of a field that a small
//! basis holds, with scatter. It does not know how they are fitted, nor what noise is stated of them.

use crate::{BasisSpec, Ray, Region};

/// Where they are.
pub(crate) const REGION: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);
/// What holds their field.
pub(crate) const BASIS: BasisSpec = BasisSpec::zernike(4, 1);

/// The i-th of a sequence that fills 0 to 1, evenly by most steps and never twice the same.
pub(crate) fn part(i: usize, step: f64) -> f64 {
    (i as f64 * step + 0.37).fract()
}

/// The i-th ray, and what is read there: the field, scattering by 0.41.
pub(crate) fn reading(i: usize) -> (Ray, f64) {
    let ray = Ray {
        x_m: 0.02 * part(i, 0.618_034) - 0.01,
        y_m: 0.02 * part(i, 0.754_878) - 0.01,
        theta_rad: 1.4 * part(i, 0.569_840),
        phi_rad: 6.2 * part(i, 0.438_579),
    };
    let scatter = part(i, 0.233_7) + part(i, 0.871_3) - 1.0;
    let bent = 80.0 - 30.0 * ray.theta_rad.sin().powi(2);
    (ray, bent + 10.0 * ray.x_m / 0.01 + scatter)
}
