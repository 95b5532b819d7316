//! What a propagation of distributions found, as fit.json says it.

use fit::Estimate;
use fit::trials::{Interval, Spread};
use serde_json::{Map, Value, json};

/// 95 % of a normal distribution lie within so many standard uncertainties.
pub const COVERAGE_95: f64 = 1.959_964;

/// Trials of a fit's readings, and what came of them.
#[derive(Debug, Clone, PartialEq)]
pub struct MonteCarlo {
    /// How many.
    pub trials: usize,
    /// The seed of what was drawn.
    pub seed: u64,
    /// One after the other.
    pub numbers: Vec<Propagated>,
    /// By how much the direction of the largest radiance scatters.
    pub peak_direction: PeakDirection,
}

/// A number that was propagated.
#[derive(Debug, Clone, PartialEq)]
pub struct Propagated {
    /// Its name among the fit's quantities.
    pub name: String,
    /// Its unit; empty for a relative one.
    pub unit: &'static str,
    /// By the law of propagation of uncertainty (GUM).
    pub linear: Estimate,
    /// By the trials; or in how many of them there is no such number.
    pub trials: Result<Spread, usize>,
}

/// How the direction of a trial's peak lies about the fit's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakDirection {
    /// Root mean square of the trials' offsets along growing θ, radians.
    pub u_theta_rad: f64,
    /// And across it, as an angle on the sphere, radians.
    pub u_across_rad: f64,
    /// 95 % of the trials lie within this angle, radians.
    pub within_95_rad: f64,
}

impl Propagated {
    /// The interval of the law of propagation.
    pub fn linear_interval(&self) -> Interval {
        let Estimate { value, u, .. } = self.linear;
        Interval { low: value - COVERAGE_95 * u, high: value + COVERAGE_95 * u }
    }

    fn json(&self) -> Value {
        let interval = |Interval { low, high }: Interval| json!([low, high]);
        let trials = match self.trials {
            Ok(spread) => json!({
                "mean": spread.mean,
                "u": spread.u,
                "interval_95": interval(spread.symmetric),
                "shortest_95": interval(spread.shortest),
                "end_sd": spread.end_sd,
            }),
            Err(without) => json!({"without": without}),
        };
        json!({
            "name": self.name,
            "unit": self.unit,
            "trials": trials,
            "linear": {
                "value": self.linear.value,
                "u": self.linear.u,
                "interval_95": interval(self.linear_interval()),
            },
        })
    }
}

impl MonteCarlo {
    /// What fit.json says of it.
    pub fn json(&self) -> Value {
        let numbers: Vec<Value> = self.numbers.iter().map(Propagated::json).collect();
        let PeakDirection { u_theta_rad, u_across_rad, within_95_rad } = self.peak_direction;
        let mut object = Map::new();
        object.insert("trials".to_owned(), json!(self.trials));
        object.insert("seed".to_owned(), json!(self.seed));
        object.insert("numbers".to_owned(), Value::Array(numbers));
        let direction = json!({
            "u_theta_deg": u_theta_rad.to_degrees(),
            "u_across_deg": u_across_rad.to_degrees(),
            "within_95_deg": within_95_rad.to_degrees(),
        });
        object.insert("peak_direction".to_owned(), direction);
        Value::Object(object)
    }
}
