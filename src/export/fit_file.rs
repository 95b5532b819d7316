//! fit.json: what was fitted, how well, and on a simulated rig what is true.

use std::io::{self, Write};

use fit::{
    Angular, BasisSpec, BeamRows, Chart, Choice, Contribution, Estimate, Fit, Limit, Penalty,
    Position, Resolves, Width,
};
use serde_json::{Map, Value, json};

use super::charted::{put_charted, ray_json, region_json};
use super::{DerivedQuantity, MonteCarlo, Treatment};
use crate::rig::Quantity;
use crate::rig::calibration::IndependentParts;
use crate::study::adaptive::Account;

/// What fit.json says. Numbers that do not exist are `null`.
#[derive(Debug, Clone, Copy)]
pub struct FitFile<'a> {
    /// The fit.
    pub fit: &'a Fit,
    /// What became of outliers and limits, what was fitted along, what the field was held to.
    pub treatment: &'a Treatment<'a>,
    /// What its basis and penalty were chosen from; `None` where they were pinned.
    pub choice: Option<&'a Choice>,
    /// The narrowest feature that can be seen; `None` where the readings' rays are not at hand.
    pub resolves: Option<Resolves>,
    /// What its values are.
    pub quantity: Quantity,
    /// Whether the samples come from a simulated rig.
    pub simulated: bool,
    /// Samples that carry a flag, used or not.
    pub n_flagged: usize,
    /// Samples that the fit left out on account of their flags.
    pub n_excluded: usize,
    /// What a reader must know, one sentence each: that the input's u counts as independent, say.
    pub notes: &'a [String],
    /// What is true, on a simulated rig.
    pub truth: Option<Truth>,
    /// The independent parts of u by source.
    pub independent: &'a IndependentParts,
    /// What was derived from the fit beyond what is always there.
    pub derived: &'a [DerivedQuantity],
    /// What was found after each round of a run that decided on the way; empty for others.
    pub rounds: &'a [Account],
    /// What a propagation of distributions found; `None` where none was asked for.
    pub monte_carlo: Option<&'a MonteCarlo>,
}

/// What leaves a simulated sample, by the definitions of the fit's own quantities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Into the whole hemisphere, mean over the region.
    pub exitance: f64,
    /// Into the region's directions alone.
    pub exitance_within_region: f64,
    /// From the region.
    pub flux: f64,
    /// The largest radiance within the region; `None` where it has no bound.
    pub peak: Option<TruePeak>,
    /// Throughput-weighted RMS of fitted less true radiance within the region, divided by that of
    /// the true one; `None` where that is dark.
    pub radiance_error_rms_relative: Option<f64>,
}

/// The largest radiance within the region, and where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruePeak {
    /// The radiance.
    pub value: f64,
    /// Where.
    pub ray: fit::Ray,
}

impl FitFile<'_> {
    /// Writes it: one key a line, the covariance one row a line.
    pub fn write(&self, mut out: impl Write) -> io::Result<()> {
        let object = self.object();
        let last = object.len().saturating_sub(1);
        out.write_all(b"{\n")?;
        for (i, (key, value)) in object.iter().enumerate() {
            write!(out, "  {}: ", Value::from(key.as_str()))?;
            match value {
                Value::Array(rows) if rows.iter().any(Value::is_array) => {
                    write_rows(&mut out, rows)?;
                }
                value => write!(out, "{value}")?,
            }
            out.write_all(if i < last { b",\n" } else { b"\n" })?;
        }
        out.write_all(b"}\n")
    }

    fn object(&self) -> Map<String, Value> {
        let Self { fit, quantity, .. } = self;
        let mut object = Map::new();
        let mut put = |key: &str, value: Value| object.insert(key.to_owned(), value);
        put("quantity", json!(quantity.name()));
        put("simulated", json!(self.simulated));
        put("chart", json!(fit.region().chart.name()));
        put("basis", basis(fit.basis(), Some(fit.names())));
        put("penalty", json!({"power": fit.penalty().power, "strength": fit.penalty().strength}));
        put("truncation", json!(fit.model().truncation));
        put("truncation_gain", json!(fit.parts().truncation.as_ref().map(|missed| missed.gain)));
        put("choice", self.choice.map_or(Value::Null, choice));
        put("resolves", self.resolves.map_or(Value::Null, resolves));
        put("region", region_json(fit.region()));
        put("coefficients", json!(fit.coefficients()));
        // Of thousands of local functions it would be gigabytes.
        let is_kept = !fit.is_sparse();
        put("covariance", if is_kept { json!(fit.covariance()) } else { Value::Null });
        put("condition", json!(fit.condition()));
        put("residual_rms", json!(fit.residual_rms()));
        put("excess_rms", json!(fit.excess_rms()));
        put("chi2", json!(fit.chi2()));
        put("dof", json!(fit.dof()));
        put("determined", json!(fit.determined()));
        put("beam", fit.beam().map_or(Value::Null, beam));
        put("n_used", json!(fit.n_used()));
        put("n_flagged", json!(self.n_flagged));
        put("n_excluded", json!(self.n_excluded));
        put("readings", self.treatment.readings(&fit.region().chart));
        put("nuisances", self.treatment.fitted_along());
        put("drift", self.treatment.drift_json());
        put("symmetry", self.treatment.symmetry_json());
        put("nonnegative", self.treatment.nonnegative_json(&fit.region().chart));
        if !self.rounds.is_empty() {
            put("rounds", json!(self.rounds));
        }
        let aliased = fit.aliased().map(|cause| cause.to_string());
        put("notes", self.notes.iter().cloned().chain(aliased).map(Value::from).collect());
        put("monte_carlo", self.monte_carlo.map_or(Value::Null, MonteCarlo::json));
        if fit.region().chart == Chart::Surface {
            self.put_derived(&mut object);
        } else {
            put_charted(fit, *quantity, &mut object);
        }
        self.put_peak(&mut object);
        let derived = self.derived.iter().map(|quantity| quantity.json(self.quantity));
        object.insert("derived".to_owned(), derived.collect());
        if let Some(truth) = self.truth {
            object.insert("truth".to_owned(), self.truth(truth));
            object.insert(
                "radiance_error_rms_relative".to_owned(),
                json!(truth.radiance_error_rms_relative),
            );
        }
        object
    }

    fn put_derived(&self, object: &mut Map<String, Value>) {
        let Self { fit, quantity, .. } = self;
        let mut exitance = estimate(fit.exitance());
        exitance["measured_fraction"] = json!(fit.measured_fraction());
        put_budget(&mut exitance, &fit.contributions(), &self.independent.exitance, 1.0);
        object.insert(quantity.exitance_key().to_owned(), exitance);
        // The region's cone lies within the hemisphere, so that it has an exitance.
        let within = fit.exitance_within(fit.region().theta_max_rad).map_or(Value::Null, estimate);
        object.insert(quantity.exitance_within_region_key().to_owned(), within);
        let area_m2 = fit.region().area_m2();
        let mut flux = estimate(fit.flux());
        put_budget(&mut flux, &fit.contributions(), &self.independent.exitance, area_m2);
        object.insert(quantity.flux_key().to_owned(), flux);
        let normal = fit.mean_towards(0.0, 0.0).times(area_m2);
        let mut intensity = estimate(fit.of(&normal));
        let parts = fit.contributions_of(&normal);
        put_budget(&mut intensity, &parts, &self.independent.intensity, 1.0);
        object.insert(quantity.intensity_on_axis_key().to_owned(), intensity);
    }

    fn put_peak(&self, object: &mut Map<String, Value>) {
        let Self { fit, quantity, .. } = self;
        let peak = fit.peak();
        let mut at = ray_json(peak.ray, &fit.region().chart);
        at["value"] = json!(peak.radiance.value);
        at["u"] = json!(peak.radiance.u);
        at["u_independent"] = json!(peak.radiance.u_independent);
        let pointing = fit.pointing(&peak);
        at["u_theta_deg"] = json!(pointing.map(|u| u.u_theta_rad.to_degrees()));
        at["u_across_deg"] = json!(pointing.map(|u| u.u_across_rad.to_degrees()));
        let parts = fit.radiance_contributions(&peak.ray);
        put_budget(&mut at, &parts, &self.independent.peak, 1.0);
        object.insert(quantity.peak_key().to_owned(), at);
    }

    fn truth(&self, truth: Truth) -> Value {
        let quantity = self.quantity;
        let is_bright = truth.exitance > 0.0;
        let fraction = is_bright.then(|| truth.exitance_within_region / truth.exitance);
        let peak = truth.peak.map_or(Value::Null, |peak| {
            let mut at = ray_json(peak.ray, &Chart::Surface);
            at["value"] = json!(peak.value);
            at
        });
        json!({
            quantity.exitance_key(): {"value": truth.exitance, "measured_fraction": fraction},
            quantity.exitance_within_region_key(): {"value": truth.exitance_within_region},
            quantity.flux_key(): {"value": truth.flux},
            quantity.peak_key(): peak,
            "radiance_error_rms_relative": truth.radiance_error_rms_relative,
        })
    }
}

/// Puts the uncertainty by source, times a factor: the first row is the independent part as a whole,
/// the others are what readings share; and that part by its own sources.
fn put_budget(
    object: &mut Value,
    rows: &[Contribution],
    independent: &[Contribution],
    factor: f64,
) {
    let budget = |rows: &[Contribution]| -> Value {
        rows.iter().map(|row| json!({"name": row.name, "u": factor * row.u})).collect()
    };
    object["budget"] = budget(rows);
    object["budget_independent"] = budget(independent);
}

/// Which functions. What a kind does not have is null.
fn basis(spec: BasisSpec, functions: Option<Vec<String>>) -> Value {
    let (cosine_columns, spans, fine) = match spec.angular {
        Angular::Zernike { cosine_columns, .. } => (Some(cosine_columns), None, None),
        Angular::Hemispherical { .. }
        | Angular::EvenHarmonics { .. }
        | Angular::Spherical { .. }
        | Angular::SecondPlane { .. } => (None, None, None),
        Angular::Splines { theta_spans, phi_spans, fine } => {
            (None, Some((theta_spans, phi_spans)), (!fine.is_none()).then_some(fine))
        }
    };
    let position_spans = match spec.position {
        Position::Legendre { .. } => None,
        Position::Splines { spans } => Some(spans),
    };
    let angular = match spec.angular {
        Angular::Zernike { .. } => "Zernike on the Nusselt disk",
        Angular::Hemispherical { .. } => "hemispherical harmonics",
        Angular::EvenHarmonics { .. } => "even spherical harmonics",
        Angular::Splines { .. } => "cubic B-splines in theta and phi",
        Angular::Spherical { .. } => "spherical harmonics",
        Angular::SecondPlane { .. } => "Legendre in s and t",
    };
    let position = if position_spans.is_some() { "cubic B-splines" } else { "Legendre" };
    let mut basis = json!({
        "kind": format!("{angular} times {position} in x and y"),
        "angular": spec.angular.name(),
        "angular_degree": spec.angular.degree(),
        "cosine_columns": cosine_columns,
        "theta_spans": spans.map(|(theta, _)| theta),
        "phi_spans": spans.map(|(_, phi)| phi),
        "fine_spans": fine.map(|fine| json!([fine.from, fine.to, fine.halvings])),
        "fine_phi_spans": fine.map(|fine| fine.around).filter(|around| !around.is_none())
            .map(|around| json!([around.from, around.to, around.halvings])),
        "position_degree": spec.position.degree(),
        "position_spans": position_spans,
    });
    if let Some(functions) = functions {
        basis["functions"] = json!(functions);
    }
    basis
}

fn penalty(penalty: Penalty) -> Value {
    json!({"power": penalty.power, "strength": penalty.strength})
}

/// All that was tried, the chosen one first.
fn choice(choice: &Choice) -> Value {
    let candidates = choice.candidates.iter().map(|candidate| {
        json!({
            "basis": basis(candidate.model.basis, None),
            "penalty": penalty(candidate.model.penalty),
            "coefficients": candidate.coefficients,
            "score": candidate.score,
            "left_out_rms_over_u": candidate.left_out_rms,
        })
    });
    json!({
        "left_out": choice.sweeps.name(),
        "n_sweeps": choice.n_sweeps,
        "n_lines": choice.n_lines,
        "n_readings": choice.n_readings,
        "candidates": candidates.collect::<Vec<Value>>(),
    })
}

fn resolves(resolves: Resolves) -> Value {
    let angle = |width: Width| (width.width.to_degrees(), width.limit);
    let length = |width: Width| (width.width * 1e3, width.limit);
    // Not finite: the basis is constant along it. JSON says null.
    let put = |(width, limit): (f64, Limit)| json!({"width": width, "limit": limit.name()});
    json!({
        "theta_deg": put(angle(resolves.theta_rad)),
        "phi_deg": resolves.phi_rad.map(angle).map_or(Value::Null, put),
        "x_mm": resolves.x_m.map(length).map_or(Value::Null, put),
        "y_mm": resolves.y_m.map(length).map_or(Value::Null, put),
        "measured_to_deg": resolves.measured_to_rad.to_degrees(),
    })
}

/// How many readings count as what, and by how much of its own independent u the averages'
/// quadrature may shift a derived quantity.
fn beam(rows: BeamRows) -> Value {
    json!({
        "point": rows.point,
        "averaged": rows.averaged,
        "cut": rows.cut,
        "off_sample": rows.off_sample,
        "directions": rows.directions,
        "quadrature_u": rows.quadrature,
    })
}

fn estimate(Estimate { value, u, u_independent }: Estimate) -> Value {
    json!({"value": value, "u": u, "u_independent": u_independent})
}

fn write_rows(out: &mut impl Write, rows: &[Value]) -> io::Result<()> {
    out.write_all(b"[")?;
    for (i, row) in rows.iter().enumerate() {
        write!(out, "{}\n    {row}", if i > 0 { "," } else { "" })?;
    }
    out.write_all(b"\n  ]")
}

#[cfg(test)]
mod tests {
    use super::*;
    use fit::{Common, Noise, Ray, Region, Sample, Shift};
    use std::f64::consts::PI;

    fn lambertian() -> Fit {
        let ray = |i: u32| Ray {
            x_m: 0.0,
            y_m: 0.0,
            theta_rad: f64::from(i % 8) * 0.2,
            phi_rad: f64::from(i / 8) * PI / 3.0,
        };
        let noise = Noise::Fixed { variance: 0.01 };
        let samples: Vec<Sample> =
            (0..48).map(|i| Sample { ray: ray(i), value: 100.0, noise }).collect();
        let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.4);
        let basis = BasisSpec::zernike(2, 0);
        let scale = Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale };
        fit::fit(&samples, &region, basis, &[scale]).unwrap()
    }

    fn written(file: &FitFile<'_>) -> Value {
        let mut text = Vec::new();
        file.write(&mut text).unwrap();
        serde_json::from_slice(&text).unwrap()
    }

    #[test]
    fn it_holds_what_the_contract_names() {
        let fit = lambertian();
        let notes = ["the input's u counts as independent".to_owned()];
        let ray = Ray { x_m: 0.0, y_m: 0.001, theta_rad: 0.0, phi_rad: 0.0 };
        let truth = Truth {
            exitance: 100.0 * PI,
            exitance_within_region: 305.0,
            flux: 0.04 * PI,
            peak: Some(TruePeak { value: 100.0, ray }),
            radiance_error_rms_relative: Some(1e-3),
        };
        let quantity = Quantity::Radiance;
        let file = FitFile {
            treatment: &Treatment::default(),
            fit: &fit,
            choice: None,
            resolves: None,
            quantity,
            simulated: true,
            n_flagged: 3,
            n_excluded: 1,
            notes: &notes,
            truth: Some(truth),
            independent: &IndependentParts::NONE,
            derived: &[],
            rounds: &[],
            monte_carlo: None,
        };
        let json = written(&file);
        let number = |path: &str| json.pointer(path).and_then(Value::as_f64).expect(path);
        assert!((number("/exitance_w_per_m2/value") - 100.0 * PI).abs() < 1e-9);
        assert!(number("/exitance_w_per_m2/u") > 2.0 * PI);
        assert!((0.9..1.0).contains(&number("/exitance_w_per_m2/measured_fraction")));
        assert!((number("/flux_w/value") - 0.04 * PI).abs() < 1e-12);
        assert!(number("/exitance_within_region_w_per_m2/u") > 0.0);
        assert!((number("/peak_radiance/value") - 100.0).abs() < 1e-9);
        for key in ["x_mm", "y_mm", "theta_deg", "phi_deg", "u"] {
            number(&format!("/peak_radiance/{key}"));
        }
        // Of a flat field no direction is known.
        assert!(json["peak_radiance"]["u_theta_deg"].is_null());
        for key in ["condition", "residual_rms", "dof", "n_used", "n_flagged"] {
            number(&format!("/{key}"));
        }
        assert_eq!(number("/truth/exitance_w_per_m2/value").to_bits(), (100.0 * PI).to_bits());
        assert_eq!(number("/truth/peak_radiance/y_mm").to_bits(), 1.0_f64.to_bits());
        assert_eq!(number("/truth/radiance_error_rms_relative").to_bits(), 1e-3_f64.to_bits());
        assert_eq!(json["notes"][0], notes[0].as_str());

        // Numbers come back to the last bit.
        let covariance = fit.covariance();
        for (i, row) in covariance.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                let read = number(&format!("/covariance/{i}/{j}"));
                assert_eq!(read.to_bits(), value.to_bits());
            }
        }
        assert_eq!(json["coefficients"].as_array().unwrap().len(), covariance.len());
    }

    #[test]
    fn photometric_and_relative_fits_carry_no_radiometric_name() {
        let fit = lambertian();
        for quantity in [Quantity::Luminance, Quantity::Relative] {
            let file = FitFile {
                treatment: &Treatment::default(),
                fit: &fit,
                choice: None,
                resolves: None,
                quantity,
                simulated: false,
                n_flagged: 0,
                n_excluded: 0,
                notes: &[],
                truth: None,
                independent: &IndependentParts::NONE,
                derived: &[],
                rounds: &[],
                monte_carlo: None,
            };
            let json = written(&file);
            let object = json.as_object().unwrap();
            assert!(object.contains_key(quantity.exitance_key()));
            assert!(!object.contains_key("truth"));
            let radiometric = object.keys().find(|key| key.contains("_w_") || key.ends_with("_w"));
            assert_eq!(radiometric, None);
        }
    }
}
