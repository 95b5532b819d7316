//! How the time at the targets is divided between them, by what is expected to be seen there and by
//! the detector's noise.
//!
//! It knows neither a scene nor a fit: which targets matter more for what is fitted is not asked.

use std::time::Duration;

use spanned_toml::Problem;

use super::{Expect, Plan, Target};
use crate::rig::Rig;

/// A target's dwell is that many times the plan's at most, and one over it at least: a source is never
/// quite as expected.
const MOST: f64 = 10.0;
/// What is darker than this part of the highest radiance counts as so dark.
const DARKEST: f64 = 1e-3;
/// Halvings of the interval of the common factor: to a part in 10⁹.
const HALVINGS: u32 = 60;

/// How the dwells of targets at rest differ; their mean is the plan's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Allocation {
    /// Not at all.
    #[default]
    Even,
    /// So that a sum over all targets is known best for its time (Neyman's allocation): in proportion
    /// to a reading's noise, longer where the light's own noise is large.
    Total,
    /// So that every target is known as well, relative to what is seen there: longer where the signal
    /// is weak.
    Each,
}

impl Allocation {
    /// As plan files call them.
    pub const WORDS: [(&'static str, Self); 3] =
        [("even", Self::Even), ("total", Self::Total), ("each", Self::Each)];
}

impl Expect {
    /// The power of the cosine that has the expected beam angle; 0 where all directions are alike.
    pub fn exponent(&self) -> f64 {
        let half = |angle: f64| libm::log(0.5) / libm::log(libm::cos(0.5 * angle));
        self.beam_angle_rad.map_or(0.0, half)
    }
}

impl Plan {
    /// The dwell at each target, by index.
    pub(super) fn dwells(
        &self,
        rig: &Rig,
        gain: u8,
        targets: &[Target],
    ) -> Result<Vec<Duration>, Problem> {
        if self.allocation == Allocation::Even {
            return Ok(vec![self.dwell; targets.len()]);
        }
        let Some((_, level)) = self.expect.level else {
            return Err(self.problem(
                "dwell",
                "allocation",
                "nothing says what is expected",
                "a level in [expect]",
                &format!("state {} there, or leave the key out", {
                    rig.detector.quantity.radiance_column()
                }),
            ));
        };
        let exponent = self.expect.exponent();
        let wanted = |target: &Target| {
            let cosine = libm::cos(target.pose.theta_rad).max(0.0);
            let part = if exponent > 0.0 { libm::pow(cosine, exponent) } else { 1.0 };
            let radiance = level * part.max(DARKEST);
            let noise = rig.detector.modelled_variance(gain, 1, 0.0);
            let variance = noise.floor + noise.per_radiance * radiance;
            match self.allocation {
                Allocation::Each => variance / (radiance * radiance),
                Allocation::Total | Allocation::Even => libm::sqrt(variance),
            }
        };
        let rate_hz = f64::from(rig.detector.adc.rate_hz);
        let dwell = |factor: f64| {
            let readings = libm::round(factor * self.dwell.as_secs_f64() * rate_hz).max(1.0);
            Duration::from_secs_f64(readings / rate_hz)
        };
        let wanted: Vec<f64> = targets.iter().map(wanted).collect();
        Ok(factors(&wanted).into_iter().map(dwell).collect())
    }
}

/// In proportion to what is wanted, of mean 1, none beyond its limits.
fn factors(wanted: &[f64]) -> Vec<f64> {
    let with = |common: f64| wanted.iter().map(move |one| (common * one).clamp(1.0 / MOST, MOST));
    let least = wanted.iter().copied().fold(f64::INFINITY, f64::min);
    let most = wanted.iter().copied().fold(0.0, f64::max);
    // All at the lower limit, and all at the upper one.
    let (mut low, mut high) = (1.0 / (MOST * most), MOST / least);
    for _ in 0..HALVINGS {
        let middle = libm::sqrt(low * high);
        let sum: f64 = with(middle).sum();
        if sum < wanted.len() as f64 { low = middle } else { high = middle }
    }
    with(high).collect()
}

#[cfg(test)]
mod tests {
    use spanned_toml::{Document, Source};

    use super::*;
    use crate::rig::ReadingKind;

    const PLAN: &str = "[region]\nx_mm = [-2, 2]\ny_mm = [-2, 2]\ntheta_max_deg = 70\n[schedule]\n\
        kind = \"raster\"\nx_count = 1\ny_count = 1\ntheta_step_deg = 10\nphi_step_deg = 90\n[dwell]\n\
        dwell_ms = 50\nallocation = \"each\"\n[dark]\nmethod = \"shutter\"\n[expect]\n\
        radiance_w_per_m2_sr = 0.02\nbeam_angle_deg = 60\n";

    fn dwells(text: &str) -> Result<Vec<(f64, f64)>, Problem> {
        let plan = Plan::read(Document::parse(Source::new("plan.toml", text)).unwrap())?;
        let sequence = plan.lay_out(&Rig::built_in().unwrap(), None)?;
        let of = |step: &crate::plan::Step| match step.kind {
            ReadingKind::Target { .. } => Some((step.pose?.theta_rad, step.dwell.as_secs_f64())),
            _ => None,
        };
        let mut all: Vec<(f64, f64)> = sequence.steps.iter().filter_map(of).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(all)
    }

    #[test]
    fn dwells_differ_as_asked_and_their_mean_is_the_plans() {
        let mean = |all: &[(f64, f64)]| all.iter().map(|d| d.1).sum::<f64>() / all.len() as f64;
        let each = dwells(PLAN).unwrap();
        assert!((mean(&each) / 0.05 - 1.0).abs() < 0.01, "{each:?}");
        // Read noise rules: a quarter of the light asks for sixteen times the time, ten at most.
        let (first, last) = (each[0].1, each[each.len() - 1].1);
        assert!(last > 8.0 * first && last <= 0.5 + 1e-9, "{first} {last}");
        // For a sum it does not matter where read noise comes in; where light does, the bright
        // directions are what it comes from.
        let total = PLAN.replace("\"each\"", "\"total\"");
        let dim = dwells(&total).unwrap();
        assert!(dim[0].1 < 1.6 * dim[dim.len() - 1].1, "{dim:?}");
        let bright = dwells(&total.replace("sr = 0.02", "sr = 200")).unwrap();
        assert!((mean(&bright) / 0.05 - 1.0).abs() < 0.01, "{bright:?}");
        assert!(bright[0].1 > 2.0 * bright[bright.len() - 1].1, "{bright:?}");
        let even = dwells(&PLAN.replace("\"each\"", "\"even\"")).unwrap();
        assert!(even.iter().all(|dwell| (dwell.1 - 0.05).abs() < 1e-12));
    }

    #[test]
    fn what_is_not_expected_is_not_divided_by() {
        let refused = dwells(&PLAN.replace("radiance_w_per_m2_sr = 0.02\n", "")).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("allocation") && refused.contains("[expect]"), "{refused}");
        let sweep = "kind = \"sweep\"\nnarrowest_feature_deg = 20\n";
        let flown = PLAN.replace("kind = \"raster\"\n", sweep).replace("theta_step_deg = 10\n", "");
        let refused = dwells(&flown).unwrap_err().to_string();
        assert!(refused.contains("allocation") && refused.contains("at rest"), "{refused}");
    }
}
