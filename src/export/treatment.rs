//! What became of readings that are not simply what they read (outliers, limits, those left out), what was
//! fitted along with the field, and what it was held to: for fit.json and weights.csv.

use std::io::{self, Write};

use fit::{Chart, Fit, FittedNuisance, Nonnegative, Robust, SymmetryError, SymmetryTest, Weighed};
use serde_json::{Value, json};

use super::charted::{coordinates, ray_json};
use super::number::number;
use crate::rig::Quantity;
use crate::rig::calibration::FittedDrift;

/// Readings that fit.json lists at most; where there are more, weights.csv has them.
const LISTED_MAX: usize = 50;
/// Readings that weights.csv lists at most: 4 MB or so.
const KEPT_MAX: usize = 50_000;
/// A residual beyond so many of its standard deviations is remarkable.
const REMARKABLE: f64 = 5.0;
/// A reading with less of its weight left counts as downweighted.
const DOWNWEIGHTED: f64 = 0.5;
/// A limit that holds less than this part of a reading's information doesn't hold the field.
const HOLDING: f64 = 1e-3;

/// What was done beyond least squares.
#[derive(Debug, Clone, Default)]
pub struct Treatment<'a> {
    /// How outliers were weighed.
    robust: Robust,
    readings: TreatedReadings,
    nuisances: &'a [FittedNuisance],
    drift: Option<&'a FittedDrift>,
    symmetry: Option<&'a Result<SymmetryTest, SymmetryError>>,
    nonnegative: Option<&'a Nonnegative>,
}

/// Readings that are no plain ones: all are counted, the farthest off are listed.
#[derive(Debug, Clone, Default)]
pub struct TreatedReadings {
    counts: [usize; Why::ALL.len()],
    listed: Vec<TreatedReading>,
}

/// A reading that is listed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreatedReading {
    /// The reading's id in readings.csv, or its line in a CSV.
    pub id: u64,
    /// Its ray.
    pub ray: fit::Ray,
    /// What it read.
    pub value: f64,
    /// (value - fitted) in standard deviations of a residual; `None` of one that has no part in the
    /// fit.
    pub residual: Option<f64>,
    /// What is left of its weight.
    pub weight: f64,
    /// Why it is listed.
    pub why: Why,
}

/// Why a reading is listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// It was not settled, or not on the sample: left out.
    LeftOut,
    /// Saturated: a lower limit that the field exceeds anyway.
    LimitExceeded,
    /// Saturated: a lower limit that holds the field up.
    LimitHolding,
    /// Its weight was taken away, most of it or all.
    Downweighted,
    /// Far off, and weighed like all others.
    Remarkable,
}

impl Why {
    const ALL: [Self; 5] = [
        Self::LeftOut,
        Self::LimitExceeded,
        Self::LimitHolding,
        Self::Downweighted,
        Self::Remarkable,
    ];

    /// As files name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LeftOut => "left_out",
            Self::LimitExceeded => "limit_exceeded",
            Self::LimitHolding => "limit_holding",
            Self::Downweighted => "downweighted",
            Self::Remarkable => "remarkable",
        }
    }

    /// In words, of so many readings.
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::LeftOut => "left out",
            Self::LimitExceeded => "saturated, which the field exceeds anyway",
            Self::LimitHolding => "saturated, lower limits that hold the field up",
            Self::Downweighted => "downweighted by half or more",
            Self::Remarkable => "more than 5 u off and weighed like all others",
        }
    }
}

impl TreatedReadings {
    /// Notes a reading that has no part in the fit.
    pub fn leave_out(&mut self, id: u64, ray: fit::Ray, value: f64) {
        let why = Why::LeftOut;
        self.note(TreatedReading { id, ray, value, residual: None, weight: 0.0, why });
    }

    /// Notes what became of readings, the i-th of which is `name(i)`: its id, ray and value.
    pub fn take(&mut self, weighed: &Weighed, name: impl Fn(usize) -> (u64, fit::Ray, f64)) {
        for (i, (&weight, &z)) in weighed.weights.iter().zip(&weighed.residuals).enumerate() {
            let why = if weighed.limits.binary_search(&i).is_ok() {
                if weight < HOLDING { Why::LimitExceeded } else { Why::LimitHolding }
            } else if weight < DOWNWEIGHTED {
                Why::Downweighted
            } else if z.abs() > REMARKABLE {
                Why::Remarkable
            } else {
                continue;
            };
            let (id, ray, value) = name(i);
            self.note(TreatedReading { id, ray, value, residual: Some(z), weight, why });
        }
    }

    fn note(&mut self, reading: TreatedReading) {
        self.counts[reading.why as usize] += 1;
        self.listed.push(reading);
        if self.listed.len() >= 2 * KEPT_MAX {
            self.sort();
        }
    }

    /// The farthest off first; forgets those beyond what is kept.
    fn sort(&mut self) {
        let size = |reading: &TreatedReading| reading.residual.map_or(f64::INFINITY, f64::abs);
        self.listed.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.id.cmp(&b.id)));
        self.listed.truncate(KEPT_MAX);
    }
}

impl<'a> Treatment<'a> {
    /// Of a fit whose sample i is the reading `name(i)`: its id, ray and value; and of those left out.
    pub fn of(
        fit: &'a Fit,
        name: impl Fn(usize) -> (u64, fit::Ray, f64),
        left_out: impl IntoIterator<Item = (u64, fit::Ray, f64)>,
    ) -> Self {
        let mut readings = TreatedReadings::default();
        left_out.into_iter().for_each(|(id, ray, value)| readings.leave_out(id, ray, value));
        let Some(weighed) = fit.weighed() else {
            return Self::of_readings(Robust::None, readings, &[]);
        };
        readings.take(weighed, name);
        Self::of_readings(weighed.robust, readings, &weighed.nuisances)
    }

    /// Of a fit that forgot its readings, of those that were noted on the way.
    pub fn of_readings(
        robust: Robust,
        mut readings: TreatedReadings,
        nuisances: &'a [FittedNuisance],
    ) -> Self {
        readings.sort();
        Self { robust, readings, nuisances, ..Self::default() }
    }

    /// With what the field was held to.
    #[must_use]
    pub fn with_rules(
        self,
        symmetry: Option<&'a Result<SymmetryTest, SymmetryError>>,
        nonnegative: Option<&'a Nonnegative>,
    ) -> Self {
        Self { symmetry, nonnegative, ..self }
    }

    /// With the drift that was taken out.
    #[must_use]
    pub fn with_drift(self, drift: Option<&'a FittedDrift>) -> Self {
        Self { drift, ..self }
    }

    /// How well the readings bear the symmetry asked for, or why it was not used.
    pub fn symmetry(&self) -> Option<&'a Result<SymmetryTest, SymmetryError>> {
        self.symmetry
    }

    /// What holding the field above zero did.
    pub fn nonnegative(&self) -> Option<&'a Nonnegative> {
        self.nonnegative
    }

    /// The drift that was taken out.
    pub fn drift(&self) -> Option<&'a FittedDrift> {
        self.drift
    }

    /// What was fitted along.
    pub fn nuisances(&self) -> &'a [FittedNuisance] {
        self.nuisances
    }

    /// The readings that are no plain ones, the farthest off first: of very many the farthest.
    pub fn listed(&self) -> &[TreatedReading] {
        &self.readings.listed
    }

    /// Whether there are more of them than fit.json lists, so that weights.csv is written.
    pub fn is_long(&self) -> bool {
        self.listed().len() > LISTED_MAX
    }

    /// How many there are of each kind, those kinds that there are.
    pub fn counts(&self) -> Vec<(Why, usize)> {
        let counts = Why::ALL.into_iter().zip(self.readings.counts);
        counts.filter(|(_, n)| *n > 0).collect()
    }

    /// How outliers were weighed.
    pub fn robust(&self) -> Robust {
        self.robust
    }

    pub(super) fn readings(&self, chart: &Chart) -> Value {
        let mut object = json!({"robust": self.robust.name()});
        for (why, count) in Why::ALL.into_iter().zip(self.readings.counts) {
            object[why.name()] = json!(count);
        }
        let listed = self.listed().iter().take(LISTED_MAX).map(|reading| {
            let mut listed = ray_json(reading.ray, chart);
            listed["reading"] = json!(reading.id);
            listed["value"] = json!(reading.value);
            listed["residual_over_u"] = json!(reading.residual);
            listed["weight"] = json!(reading.weight);
            listed["why"] = json!(reading.why.name());
            listed
        });
        object["listed"] = listed.collect();
        object
    }

    pub(super) fn fitted_along(&self) -> Value {
        let row = |fitted: &FittedNuisance| json!({"name": fitted.name, "value_over_prior_u": fitted.value, "u_over_prior_u": fitted.u});
        self.nuisances.iter().map(row).collect()
    }

    pub(super) fn drift_json(&self) -> Value {
        let Some(drift) = self.drift else { return Value::Null };
        let at = |time_s: f64| {
            let (value, u) = drift.at_with_u(time_s);
            json!({"time_s": time_s, "relative": value, "u_by_reference": u})
        };
        let (from, to) = drift.time_s;
        let times = (0..=10).map(|k| from + 0.1 * f64::from(k) * (to - from));
        json!({
            "reference_readings": drift.readings, "degree": drift.degree, "chi2": drift.chi2,
            "dof": drift.dof, "curve": times.map(at).collect::<Vec<Value>>(),
        })
    }

    pub(super) fn symmetry_json(&self) -> Value {
        match self.symmetry {
            None => Value::Null,
            Some(Ok(test)) => tested(test, true),
            Some(Err(SymmetryError::Contradicted(test))) => tested(test, false),
            Some(Err(error)) => json!({"used": false, "why": error.to_string()}),
        }
    }

    pub(super) fn nonnegative_json(&self, chart: &Chart) -> Value {
        let Some(bound) = self.nonnegative else { return Value::Null };
        let ray = |ray: &fit::Ray| ray_json(*ray, chart);
        json!({
            "rays": bound.rays, "n_held": bound.held.len(), "least_before": bound.least,
            "exitance_change": bound.exitance,
            "held": bound.held.iter().take(LISTED_MAX).map(ray).collect::<Vec<Value>>(),
        })
    }
}

fn tested(test: &SymmetryTest, is_used: bool) -> Value {
    json!({
        "used": is_used, "name": test.symmetry.key(), "forbidden": test.forbidden,
        "chi2": test.chi2, "p": test.p,
    })
}

/// Writes weights.csv: the readings that are no plain ones, the farthest off first, its ray by the
/// chart's own coordinates.
pub fn write_weights(
    out: impl Write,
    quantity: Quantity,
    chart: &Chart,
    treatment: &Treatment<'_>,
) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    let origin = fit::Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.0, phi_rad: 0.0 };
    let names = coordinates(origin, chart).into_iter().map(|(name, _)| name);
    let radiance = quantity.radiance_column();
    let header = ["reading"].into_iter().chain(names);
    csv.write_record(header.chain([radiance, "residual_over_u", "weight", "why"]))?;
    for reading in treatment.listed() {
        let ray = coordinates(reading.ray, chart).into_iter().map(|(_, value)| number(value));
        let record = [reading.id.to_string()].into_iter().chain(ray).chain([
            number(reading.value),
            reading.residual.map_or_else(String::new, number),
            number(reading.weight),
            reading.why.name().to_owned(),
        ]);
        csv.write_record(record)?;
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_listed_by_their_charts_coordinates() {
        let ray = fit::Ray { x_m: 2e-3, y_m: 0.0, theta_rad: 0.25, phi_rad: 0.0 };
        let (id, value, why) = (7, 1.5, Why::Downweighted);
        let reading = TreatedReading { id, ray, value, residual: Some(6.0), weight: 0.25, why };
        let mut readings = TreatedReadings::default();
        readings.note(reading);
        let treatment = Treatment::of_readings(Robust::None, readings, &[]);
        let side = (0.0, 0.1);
        let planes = Chart::TwoPlane { distance_m: 1.0, s_m: side, t_m: side };
        for (chart, names, first) in [
            (Chart::Surface, "x_mm,y_mm,theta_deg,phi_deg", "2,0,14.32"),
            (Chart::Environment, "theta_deg,phi_deg", "14.32"),
            (planes, "u_mm,v_mm,s_mm,t_mm", "2,0,257.34"),
        ] {
            let mut csv = Vec::new();
            write_weights(&mut csv, Quantity::Radiance, &chart, &treatment).unwrap();
            let csv = String::from_utf8(csv).unwrap();
            let (head, row) = csv.split_once('\n').unwrap();
            assert!(head.starts_with(&format!("reading,{names},radiance_w_per_m2_sr,")), "{head}");
            assert!(row.starts_with(&format!("7,{first}")), "{row}");
            let listed = &treatment.readings(&chart)["listed"][0];
            assert!(names.split(',').all(|name| listed[name].is_number()), "{listed}");
            assert_eq!(listed["x_mm"].is_null(), !names.contains("x_mm"));
        }
    }
}
