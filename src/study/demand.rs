//! The accuracy that a person asks of a plan.

use super::Forecast;

/// Largest relative standard uncertainties (k = 1); `None` where all is well.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    /// Of the exitance.
    pub exitance: Option<f64>,
    /// Of the flux.
    pub flux: Option<f64>,
    /// Of the radiance, root mean square over the region.
    pub radiance: Option<f64>,
    /// Whether they are meant without the scale that is common to all readings.
    pub without_scale: bool,
}

/// A quantity that misses what was asked of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shortfall {
    /// The quantity.
    pub quantity: &'static str,
    /// What was asked.
    pub target: f64,
    /// What it is going to be.
    pub u: f64,
    /// The largest part of it, by name.
    pub largest: String,
    /// And by size.
    pub largest_u: f64,
}

impl Demand {
    /// How much worse a forecast is than asked: the largest of u over target. At most 1 where all
    /// targets are met.
    pub fn ratio(&self, forecast: &Forecast) -> f64 {
        self.all(forecast).map(|(_, target, u)| u / target).fold(0.0, f64::max)
    }

    /// The quantity that misses its target by the largest factor; `None` if all are met.
    pub fn shortfall(&self, forecast: &Forecast) -> Option<Shortfall> {
        let missed = self.all(forecast).filter(|(_, target, u)| u > target);
        let (quantity, target, u) = missed.max_by(|a, b| (a.2 / a.1).total_cmp(&(b.2 / b.1)))?;
        let budget = match quantity {
            "radiance" => &forecast.of_radiance,
            _ => &forecast.of_exitance,
        };
        let (largest, largest_u) = budget.largest(!self.without_scale);
        Some(Shortfall { quantity, target, u, largest: largest.to_owned(), largest_u })
    }

    /// Name, target and forecast of each quantity that is asked for.
    fn all(&self, forecast: &Forecast) -> impl Iterator<Item = (&'static str, f64, f64)> {
        let u = |budget: &super::Budget| {
            if self.without_scale { budget.u_without_scale() } else { budget.u() }
        };
        let (exitance, radiance) = (u(&forecast.of_exitance), u(&forecast.of_radiance));
        let asked = [
            ("exitance", self.exitance, exitance),
            ("flux", self.flux, exitance),
            ("radiance", self.radiance, radiance),
        ];
        asked.into_iter().filter_map(|(name, target, u)| Some((name, target?, u)))
    }
}
