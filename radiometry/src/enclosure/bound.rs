//! How far a balance of radiosity can be off. It does not know how the balance was found.
//!
//! What a balance M misses, `r = M₀ + ρFM - M`, is made up for by the error e = (1 - ρF)⁻¹ r. No entry of
//! that inverse is negative, so |e| is at most max |r| times its largest row sum: the largest radiosity
//! where every surface emits 1 (Varga 2000, *Matrix Iterative Analysis*, section 3.5).

use super::{Enclosure, EnclosureError, Radiosity};
use crate::quantity::Exitance;

/// Of a product and a sum of some terms, each.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

impl Enclosure {
    /// A bound, W·m⁻², of the error of every exitance and irradiance of a balance, where the form factors
    /// from a surface may all together be off by `row_error`; 0 if they are exact. To first order in that.
    ///
    /// ```
    /// use radiometry::enclosure::Enclosure;
    /// use radiometry::quantity::{Area, Exitance, FormFactor};
    /// let sphere = Enclosure::new(&[Area::from_m2(1.0)], |_, _| FormFactor::ZERO)?;
    /// let (emitted, reflectance) = ([Exitance::from_w_per_m2(2.0)], [0.75]);
    /// let balance = sphere.radiosity(&emitted, &reflectance)?;
    /// let bound = sphere.radiosity_error_bound(&emitted, &reflectance, &balance, 0.0)?;
    /// assert!((balance.exitance[0].w_per_m2() - 8.0).abs() <= bound && bound < 1e-12);
    /// # Ok::<(), radiometry::enclosure::EnclosureError>(())
    /// ```
    pub fn radiosity_error_bound(
        &self,
        emitted: &[Exitance],
        reflectance: &[f64],
        balance: &Radiosity,
        row_error: f64,
    ) -> Result<f64, EnclosureError> {
        if emitted.iter().all(|exitance| *exitance == Exitance::ZERO) {
            return Ok(0.0);
        }
        let ones = vec![Exitance::from_w_per_m2(1.0); self.surfaces()];
        let of_ones = self.radiosity(&ones, reflectance)?.exitance;
        // Twice the rounding that the ones' own balance may have.
        let amplification = 1.0001 * of_ones.iter().map(|m| m.w_per_m2()).fold(0.0, f64::max);
        let largest = balance.exitance.iter().map(|m| m.w_per_m2()).fold(0.0, f64::max);
        let leaving = emitted.iter().zip(reflectance).zip(&balance.irradiance);
        let missing = leaving
            .zip(&balance.exitance)
            .map(|(((emitted, rho), arriving), leaving)| {
                (emitted.w_per_m2() + rho * arriving.w_per_m2() - leaving.w_per_m2()).abs()
            })
            .fold(0.0, f64::max);
        let of_row = (row_error + ROUNDING) * largest;
        Ok(amplification * (missing + of_row) + of_row)
    }
}
