//! What the fits of rehearsed runs state: the same plan several times before a scene that is likely, each time
//! with other draws of all that is random. It is handed fits and times; it does not know how a run is
//! rehearsed.

use fit::{Estimate, Fit, Ray};

use super::{Fineness, Nodes, Score};

/// What one rehearsed run came to; numbers relative to its own values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rehearsed {
    /// From the beginning of the first reading to the end of the last, seconds.
    pub after_homing_s: f64,
    /// The exitance over the hemisphere.
    pub exitance: Stated,
    /// The exitance into the region's own cone.
    pub exitance_within_region: Stated,
    /// The radiance, root mean square over the region, relative to the scene's own.
    pub radiance: Stated,
}

/// What a fit states of a quantity, and how far it is off.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stated {
    /// Its combined standard uncertainty.
    pub u: f64,
    /// The part that readings do not share: noise, and what the basis can't follow.
    pub independent: f64,
    /// The quantity less the scene's, without sign.
    pub error: f64,
}

/// A scene that a run was rehearsed before, as it is.
#[derive(Clone, Copy)]
pub struct Likely<'a> {
    /// Its exitance over the hemisphere.
    pub exitance: f64,
    /// The same within the region's cone.
    pub exitance_within_region: f64,
    /// Its radiance along a ray.
    pub radiance: &'a dyn Fn(&Ray) -> f64,
}

/// How finely u is looked at: it bends no more than the basis does, and a ray costs a functional of
/// all that the fit may miss.
const FINENESS: Fineness = Fineness { theta: 8, phi: 12, parts: 1, in_part: 3 };

impl Rehearsed {
    /// Of a run's fit; `None` where the scene is dark, or the fit makes it so.
    pub fn of(fit: &Fit, likely: Likely<'_>, after_homing_s: f64) -> Option<Self> {
        let (whole, within) = (fit.exitance(), fit.exitance_within_region());
        Some(Self {
            after_homing_s,
            exitance: stated(whole, likely.exitance)?,
            exitance_within_region: stated(within, likely.exitance_within_region)?,
            radiance: radiance(fit, likely.radiance)?,
        })
    }

    /// Root mean squares over several; of the time the mean. `None` of none.
    pub fn together(runs: &[Self]) -> Option<Self> {
        let count = (!runs.is_empty()).then_some(runs.len() as f64)?;
        let mean = |of: &dyn Fn(&Self) -> f64| runs.iter().map(of).sum::<f64>() / count;
        let rms = |of: &dyn Fn(&Self) -> Stated| {
            let rms = |part: fn(&Stated) -> f64| libm::sqrt(mean(&|run| part(&of(run)).powi(2)));
            Stated { u: rms(|s| s.u), independent: rms(|s| s.independent), error: rms(|s| s.error) }
        };
        Some(Self {
            after_homing_s: mean(&|run| run.after_homing_s),
            exitance: rms(&|run| run.exitance),
            exitance_within_region: rms(&|run| run.exitance_within_region),
            radiance: rms(&|run| run.radiance),
        })
    }
}

fn stated(found: Estimate, truth: f64) -> Option<Stated> {
    let is_bright = found.value > 0.0 && truth > 0.0;
    is_bright.then(|| Stated {
        u: found.u / found.value,
        independent: found.u_independent / found.value,
        error: (found.value / truth - 1.0).abs(),
    })
}

fn radiance(fit: &Fit, truth: &dyn Fn(&Ray) -> f64) -> Option<Stated> {
    let nodes = Nodes::of(fit.region(), FINENESS);
    let (mut signal, mut all, mut independent) = (0.0, 0.0, 0.0);
    for (ray, weight) in nodes.rays() {
        let found = fit.radiance(&ray);
        signal += weight * truth(&ray).powi(2);
        all += weight * found.u * found.u;
        independent += weight * found.u_independent * found.u_independent;
    }
    let error = Score::of(fit.region(), |ray| fit.value(ray), truth)?.rms_relative;
    let relative = |square: f64| libm::sqrt(square / signal);
    (signal > 0.0).then(|| Stated { u: relative(all), independent: relative(independent), error })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fit::{BasisSpec, Noise, Region, Sample};

    #[test]
    fn what_an_even_field_s_fit_states_is_its_own_u_everywhere() {
        let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), 1.2);
        let sample = |i: u32| Sample {
            ray: Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.02 * f64::from(i), phi_rad: f64::from(i) },
            value: 100.0 + if i.is_multiple_of(2) { 1.0 } else { -1.0 },
            noise: Noise::Fixed { variance: 1.0 },
        };
        let samples: Vec<Sample> = (0..50).map(sample).collect();
        let fit = fit::fit(&samples, &region, BasisSpec::zernike(0, 0), &[]).unwrap();
        let pi = core::f64::consts::PI;
        let likely = Likely {
            exitance: 99.0 * pi,
            exitance_within_region: 99.0 * pi * libm::sin(1.2).powi(2),
            radiance: &|_| 99.0,
        };
        let one = Rehearsed::of(&fit, likely, 12.0).unwrap();
        // The mean of fifty readings of u 1: relative to a hundred.
        let expected = 0.01 / libm::sqrt(50.0);
        for stated in [one.exitance, one.exitance_within_region] {
            assert!((stated.u / expected - 1.0).abs() < 1e-9, "{stated:?}");
            assert!((stated.error - 1.0 / 99.0).abs() < 1e-9, "{stated:?}");
        }
        // The radiance's is relative to the scene, which is 99.
        assert!((one.radiance.u / expected - 100.0 / 99.0).abs() < 1e-9, "{one:?}");
        assert!((one.radiance.error - 1.0 / 99.0).abs() < 1e-9, "{one:?}");
        let twice = Rehearsed { after_homing_s: 14.0, ..one };
        let together = Rehearsed::together(&[one, twice]).unwrap();
        assert!((together.after_homing_s - 13.0).abs() < 1e-12);
        assert!((together.radiance.u / one.radiance.u - 1.0).abs() < 1e-12);
        assert_eq!(Rehearsed::together(&[]), None);
    }
}
