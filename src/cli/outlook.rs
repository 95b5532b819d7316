//! What a plan is going to know on its rig, asked before anything moves: see
//! [`crate::study::Forecast`]. Here are the words.

use fit::{Angular, BasisSpec, Position};
use serde_json::{Value, json};

use super::setup::Setup;
use super::text::{percent, table};
use crate::plan::Region;
use crate::rig::Quantity;
use crate::study::{Budget, Forecast, ForecastError, Truncation};

/// Of the exitance beyond the region less is not worth a word.
const BEYOND_MIN: f64 = 1e-3;

/// Asks.
pub(crate) fn outlook(setup: &Setup) -> Result<Forecast, ForecastError> {
    Forecast::of(&setup.plan, &setup.rig, &setup.sequence)
}

/// A warning for a person about to spend rig time, if there is reason for one.
pub(crate) fn warning(outlook: &Result<Forecast, ForecastError>) -> Option<String> {
    match outlook {
        Err(ForecastError::Fit(error)) => Some(undetermined(error)),
        Ok(forecast) if forecast.saturates => Some(
            "warning: the expected radiance fills the gain range: readings would be saturated\n  \
             help: choose a higher range with dwell.gain, or correct [expect]"
                .to_owned(),
        ),
        _ => None,
    }
}

/// The same for who is about to run the plan: whether its fit will be refused, and no more.
pub(crate) fn refusal(setup: &Setup) -> Option<String> {
    // What the first round does not determine, further ones do.
    setup.plan.adaptive().is_none().then_some(())?;
    Forecast::refusal(&setup.plan, &setup.rig, &setup.sequence).map(|error| undetermined(&error))
}

fn undetermined(error: &fit::FitError) -> String {
    format!(
        "warning: these poses do not determine the plan's fit: {error}\n  help: take more of them, \
         or lower the degrees in [fit]; the readings are as good as ever"
    )
}

/// What the uncertainties hold for, and a table of them.
pub(crate) fn text(forecast: &Forecast, region: Region, quantity: Quantity) -> String {
    let [unit, ..] = quantity.units();
    let from = if forecast.prior.is_declared {
        "[expect]"
    } else {
        "assumed: a tenth of the gain range; state it in [expect]"
    };
    let level = forecast.prior.level;
    let mut said = format!("\n  predicted u, relative (k = 1), at {level:.4} {unit} ({from})\n");
    let heads = ["", "all", "without scale", "independent", "truncation", "largest part"];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    let within = format!("within {:.1}°", region.theta_max_rad.to_degrees());
    for (name, budget) in [
        ("exitance, flux", &forecast.of_exitance),
        (&within, &forecast.of_exitance_within_region),
        ("radiance, RMS", &forecast.of_radiance),
    ] {
        let (largest, u) = budget.largest(true);
        rows.push(vec![
            name.to_owned(),
            percent(budget.u()),
            percent(budget.u_without_scale()),
            percent(budget.independent),
            budget.truncation.map_or_else(|| "not asked".to_owned(), truncation),
            format!("{largest} {}", percent(u)),
        ]);
    }
    rows.push(vec![
        "radiance, worst".to_owned(),
        percent(forecast.radiance_worst),
        percent(forecast.radiance_worst_without_scale),
    ]);
    said.push_str(&table(&rows));
    said.push_str(&not_foretold(forecast, &within));
    said
}

/// The mean over the features, and from those of one shape to those of the other.
fn truncation(truncation: Truncation) -> String {
    let Truncation { u, least, most } = truncation;
    format!("{} ({} to {})", percent(u), percent(least), percent(most))
}

/// What the numbers don't hold.
fn not_foretold(forecast: &Forecast, within: &str) -> String {
    let mut said = String::new();
    if forecast.of_radiance.truncation.is_none() {
        said.push_str(
            "  truncation: state expect.narrowest_feature_deg (or _mm) to have it predicted\n",
        );
    }
    if forecast.beyond_region >= BEYOND_MIN {
        said.push_str("  not foretold: ");
        said.push_str(&percent(forecast.beyond_region));
        said.push_str(
            " of the exitance lies beyond what is measured; a fit that finds structure states a \
             larger\n  u of the whole, and beside it that ",
        );
        said.push_str(within);
        said.push_str(". --rehearse shows it\n");
    }
    if forecast.is_direction_open {
        said.push_str(
            "  not foretold: expect.narrowest_feature_mm stands alone; a fit that finds structure in position \
             states\n  besides what may lie between the directions that are read. --rehearse shows it\n",
        );
    }
    said
}

/// A basis in words.
pub(crate) fn basis(BasisSpec { angular, position }: BasisSpec) -> String {
    let name = angular.name();
    let direction = match (angular, angular.degree()) {
        (Angular::Splines { theta_spans, phi_spans, .. }, _) => {
            format!("{name} of {theta_spans} x {phi_spans} spans")
        }
        (_, degree) => format!("{name} functions of degree {}", degree.unwrap_or(0)),
    };
    match position {
        Position::Legendre { degree } => format!("{direction}, of degree {degree} in position"),
        Position::Splines { spans } => format!("{direction}, of {spans} spans in position"),
    }
}

/// The same for programs.
pub(crate) fn as_json(forecast: &Forecast, quantity: Quantity) -> Value {
    let mut worst = budget(&forecast.of_radiance);
    worst["worst_relative"] = json!(forecast.radiance_worst);
    worst["worst_relative_without_scale"] = json!(forecast.radiance_worst_without_scale);
    let mut exitance = budget(&forecast.of_exitance);
    let mut flux = exitance.clone();
    exitance["expected"] = json!(forecast.exitance);
    flux["expected"] = json!(forecast.flux);
    json!({
        "level": {
            "key": quantity.radiance_column(), "value": forecast.prior.level,
            "stated_in_plan": forecast.prior.is_declared, "saturates": forecast.saturates,
        },
        quantity.exitance_key(): exitance,
        quantity.exitance_within_region_key(): budget(&forecast.of_exitance_within_region),
        "exitance_beyond_region_relative": forecast.beyond_region,
        quantity.flux_key(): flux,
        "radiance": worst,
    })
}

fn budget(budget: &Budget) -> Value {
    let common: serde_json::Map<String, Value> =
        budget.common.iter().map(|(name, u, _)| (name.clone(), json!(u))).collect();
    json!({
        "u_relative": budget.u(),
        "u_relative_without_scale": budget.u_without_scale(),
        "independent_relative": budget.independent,
        "u_range_relative": budget.range(),
        "not_shared_relative": budget.not_shared(),
        "truncation_relative": budget.truncation.map(|truncation| truncation.u),
        "truncation_range_relative":
            budget.truncation.map(|truncation| [truncation.least, truncation.most]),
        "common_relative": common,
    })
}
