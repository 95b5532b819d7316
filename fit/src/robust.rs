//! Readings that don't belong: what weight is left to one whose residual is larger than noise makes
//! it. Knows residuals in units of their standard deviation, and no field.
//!
//! Huber's weight bounds what one reading can do: outliers all to one side still pull. Tukey's takes
//! the weight away altogether beyond six standard deviations, and so needs to start near the truth:
//! from Huber's fit, which is unique (Huber and Ronchetti 2009, "Robust Statistics", §7; Maronna,
//! Martin and Yohai 2006, §5). The scale is that of the stated noise; scatter beyond it is found from
//! residuals cut off at Huber's bound (his "proposal 2"), so that outliers don't widen it.
//!
//! Neither is a default. A lobe narrower than the basis follows leaves a few large residuals at its peak,
//! which nothing in the residuals tells from a disturbance: who lets weights go needs to know that
//! the basis is fine enough.

/// How residuals beyond what noise makes them are weighed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Robust {
    /// Like all others: least squares.
    #[default]
    None,
    /// By 1.5 over their size in standard deviations, beyond 1.5. Of normal readings 96 % of the
    /// efficiency stays.
    Huber,
    /// By `(1 - (z/6)²)²`, and not at all beyond 6 standard deviations. Of normal readings 98 % of
    /// the efficiency stays.
    Tukey,
}

impl Robust {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Huber, Self::Tukey];

    /// As plans write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Huber => "huber",
            Self::Tukey => "tukey",
        }
    }

    /// What is left of the weight of a reading so many standard deviations off.
    pub fn weight(self, z: f64) -> f64 {
        let z = z.abs();
        match self {
            Self::None => 1.0,
            Self::Huber => {
                if z <= HUBER {
                    1.0
                } else {
                    HUBER / z
                }
            }
            Self::Tukey => {
                let rest = 1.0 - (z / TUKEY).powi(2);
                if rest > 0.0 { rest * rest } else { 0.0 }
            }
        }
    }

    /// What is reweighed one after the other, each from where the one before it ended.
    pub(crate) const fn phases(self) -> &'static [Self] {
        match self {
            Self::None => &[Self::None],
            Self::Huber => &[Self::None, Self::Huber],
            Self::Tukey => &[Self::None, Self::Huber, Self::Tukey],
        }
    }

    /// The variance of the coefficients of normal readings over that which the weights state,
    /// (AᵀWA)⁻¹: with ψ = z w of n readings it is E ψ²/(n (E ψ')²), and the weights say 1/(n E w).
    pub(crate) fn inflation(self) -> f64 {
        if self == Self::None {
            return 1.0;
        }
        let (weight, square) =
            (normal(|z| self.weight(z)), normal(|z| (z * self.weight(z)).powi(2)));
        // E ψ' = E z ψ for a normal z (Stein).
        let slope = normal(|z| z * z * self.weight(z));
        square * weight / (slope * slope)
    }
}

/// The sum of squares that cut residuals z² have, over what normal ones of that scale have: 1 each.
pub(crate) fn cut_square(z2: f64) -> f64 {
    z2.min(HUBER * HUBER) / CUT_SQUARE
}

/// Standard deviation of [`cut_square`] of a normal reading.
pub(crate) const CUT_SIGMA: f64 = 1.019_335;

/// E f(z) of a standard normal z, f even: the trapezoidal rule, which errs by 1e-7 at a kink.
fn normal(f: impl Fn(f64) -> f64) -> f64 {
    const STEP: f64 = 1e-3;
    const STEPS: u32 = 9000;
    let density = |z: f64| libm::exp(-0.5 * z * z) / (2.0 * core::f64::consts::PI).sqrt();
    let inner: f64 = (1..STEPS).map(|k| STEP * f64::from(k)).map(|z| f(z) * density(z)).sum();
    2.0 * STEP * (inner + 0.5 * f(0.0) * density(0.0))
}

/// Where Huber's weight begins to fall, standard deviations.
const HUBER: f64 = 1.5;
/// Where Tukey's weight ends.
const TUKEY: f64 = 6.0;
/// E min(z², 1.5²) of a standard normal z.
const CUT_SQUARE: f64 = 0.778_465;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_constants_are_those_of_the_normal_distribution() {
        let cut = |z: f64| (z * z).min(HUBER * HUBER);
        let mean = normal(cut);
        assert!((mean - CUT_SQUARE).abs() < 1e-6, "{mean}");
        let sigma = (normal(|z| cut(z).powi(2)) - mean * mean).sqrt() / mean;
        assert!((sigma - CUT_SIGMA).abs() < 1e-4, "{sigma}");
        assert!((normal(|z| z * z) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn of_normal_readings_less_than_five_percent_is_lost() {
        for robust in [Robust::Huber, Robust::Tukey] {
            let efficiency = normal(|z| z * z * robust.weight(z)).powi(2)
                / normal(|z| (z * robust.weight(z)).powi(2));
            assert!(efficiency > 0.95 && efficiency < 0.99, "{robust:?}: {efficiency}");
            let inflation = robust.inflation();
            assert!((0.93..1.03).contains(&inflation), "{robust:?}: {inflation}");
        }
    }

    #[test]
    fn weights_fall_with_the_residual_and_ask_for_nothing_within() {
        assert!((Robust::Huber.weight(-1.4) - 1.0).abs() < 1e-15);
        assert!((Robust::Huber.weight(15.0) - 0.1).abs() < 1e-15);
        assert!(Robust::Tukey.weight(6.0) == 0.0 && Robust::Tukey.weight(-1e300) == 0.0);
        assert!((Robust::Tukey.weight(3.0) - 0.5625).abs() < 1e-15);
    }
}
