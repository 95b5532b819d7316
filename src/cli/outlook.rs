//! What the fit will make of a plan, asked before anything moves: whether the poses determine its
//! coefficients at all. It knows nothing of levels or noise.

use fit::{FitError, Noise, Sample};

use super::results::fit_region;
use super::setup::Setup;
use crate::rig::forward;

/// Poses times coefficients squared that are looked at: a second's work.
const WORK_MAX: f64 = 3e9;

/// How well the plan's poses determine its fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outlook {
    pub(crate) coefficients: usize,
    pub(crate) condition: f64,
}

/// Fits a sample of equal radiances along the plan's rays. `None` for a plan so large that asking
/// would take long, and for one that leaves the basis to the readings.
pub(crate) fn outlook(setup: &Setup) -> Option<Result<Outlook, FitError>> {
    let model = setup.plan.fit.decided()?;
    let targets = &setup.sequence.targets;
    let coefficients = model.basis.len() as f64;
    if targets.len() as f64 * coefficients * coefficients > WORK_MAX {
        return None;
    }
    let noise = Noise::Fixed { variance: 1.0 };
    let samples: Vec<Sample> = targets
        .iter()
        .map(|target| {
            let pose = forward(target.positions);
            let ray = fit::Ray {
                x_m: pose.x_m,
                y_m: pose.y_m,
                theta_rad: pose.theta_rad,
                phi_rad: pose.phi_rad,
            };
            Sample { ray, value: 1.0, noise }
        })
        .collect();
    let fit = fit::fit(&samples, &fit_region(setup), model, &[]);
    Some(
        fit.map(|fit| Outlook {
            coefficients: fit.coefficients().len(),
            condition: fit.condition(),
        }),
    )
}

/// A warning for a person about to spend rig time, if there is reason for one.
pub(crate) fn warning(setup: &Setup) -> Option<String> {
    let error = outlook(setup)?.err()?;
    Some(format!(
        "warning: these poses do not determine the plan's fit: {error}\n  help: take more of them, \
         or lower the degrees in [fit]; the readings are as good as ever"
    ))
}
