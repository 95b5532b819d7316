//! What accuracy costs in time: what many scored runs of the rungs say together. It does not know
//! how a run is made.

use super::{Forecast, median};
use crate::plan::Prediction;

/// One scored run. Errors are against the truth, relative, with their sign where it has one.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontierRow {
    /// The scene's name.
    pub scene: String,
    /// The strategy's name.
    pub strategy: String,
    /// The rung's parameters and wishes for effects, `key=value` joined by spaces.
    pub parameters: String,
    /// The seed of the simulated rig.
    pub seed: u64,
    /// Rig time, seconds.
    pub rig_s: f64,
    /// Readings taken, dark and reference ones included.
    pub readings: u32,
    /// Throughput-weighted RMS over the region, relative to the truth's.
    pub error_radiance_rms_relative: f64,
    /// Fitted over true exitance, less one.
    pub error_exitance_relative: f64,
    /// Fitted over true flux, less one.
    pub error_flux_relative: f64,
    /// The standard uncertainty that the fit states for the exitance, relative.
    pub u_exitance_relative: f64,
    /// The same error of the radiance once the best common factor is taken out: what density and
    /// dwell can buy, without what the calibration fixes.
    pub error_shape_rms_relative: f64,
    /// Fitted over true exitance, less one, once the same factor is taken out.
    pub error_exitance_shape_relative: f64,
    /// What was foretold of the rung.
    pub foretold: Foretold,
    /// Wall time of the simulation and the fit, seconds.
    pub compute_s: f64,
}

/// What is known of a rung before it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foretold {
    /// Rig time, seconds, homing at its most included.
    pub rig_s: f64,
    /// The way alone, seconds: no rig with these axes takes the rung's readings in less. Moving
    /// between poses; a sweep's windows pass while it moves, and are in it.
    pub way_s: f64,
    /// Integrating at targets, seconds.
    pub dwelling_s: f64,
    /// Of the uncertainty, where there is a forecast.
    pub uncertainty: Option<ForetoldUncertainty>,
}

/// Relative standard uncertainties.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForetoldUncertainty {
    /// Of the radiance, root mean square over the region.
    pub radiance: f64,
    /// The same without the scale common to all readings.
    pub shape: f64,
    /// Of the exitance.
    pub exitance: f64,
    /// The same without the scale.
    pub exitance_shape: f64,
    /// What photon noise leaves of the radiance's: see [`super::Forecast::photon_limit`].
    pub photon_limit: f64,
}

impl Foretold {
    const NOTHING: Self = Self { rig_s: 0.0, way_s: 0.0, dwelling_s: 0.0, uncertainty: None };

    /// Of a plan laid out, with or without a forecast of what it will know.
    pub fn of(is_sweep: bool, prediction: &Prediction, forecast: Option<&Forecast>) -> Self {
        let flown_s = if is_sweep { prediction.dwelling_s } else { 0.0 };
        Self {
            rig_s: prediction.total_s(),
            way_s: prediction.moving_s + flown_s,
            dwelling_s: prediction.dwelling_s,
            uncertainty: forecast.map(|forecast| ForetoldUncertainty {
                radiance: forecast.of_radiance.u(),
                shape: forecast.of_radiance.u_without_scale(),
                exitance: forecast.of_exitance.u(),
                exitance_shape: forecast.of_exitance.u_without_scale(),
                photon_limit: forecast.photon_limit,
            }),
        }
    }
}

/// What the seeds of one rung say together.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontierPoint {
    /// As in the rows.
    pub strategy: String,
    /// As in the rows.
    pub parameters: String,
    /// Median rig time, seconds.
    pub rig_s: f64,
    /// Lowest, median and highest relative error of the radiance.
    pub radiance: [f64; 3],
    /// The same with the best common factor taken out.
    pub shape: [f64; 3],
    /// RMS over the seeds of the relative error of the exitance.
    pub exitance_rms: f64,
    /// The same with that factor taken out.
    pub exitance_shape_rms: f64,
    /// What the fits state as the exitance's uncertainty, on average.
    pub u_exitance: f64,
    /// What was foretold.
    pub foretold: Foretold,
    /// Whether no other point is at least as quick and as good, in the shape's median.
    pub is_on_front: bool,
}

/// One point a rung, in order of rig time. Rows of one rung are those with equal strategy and
/// parameters.
pub fn points(rows: &[FrontierRow]) -> Vec<FrontierPoint> {
    let mut names: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        let name = (row.strategy.as_str(), row.parameters.as_str());
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let is_of = |row: &FrontierRow, name: (&str, &str)| (&*row.strategy, &*row.parameters) == name;
    let mut points: Vec<FrontierPoint> = names
        .into_iter()
        .map(|name| point(name, &rows.iter().filter(|row| is_of(row, name))))
        .collect();
    points.sort_by(|a, b| a.rig_s.total_cmp(&b.rig_s));
    let mut best = f64::INFINITY;
    for point in &mut points {
        point.is_on_front = point.shape[1] < best;
        best = best.min(point.shape[1]);
    }
    points
}

/// The points of each strategy, in the order in which the strategies first appear.
pub fn by_strategy(points: &[FrontierPoint]) -> Vec<(&str, Vec<&FrontierPoint>)> {
    let mut curves: Vec<(&str, Vec<&FrontierPoint>)> = Vec::new();
    for point in points {
        match curves.iter_mut().find(|(name, _)| *name == point.strategy) {
            Some((_, curve)) => curve.push(point),
            None => curves.push((&point.strategy, vec![point])),
        }
    }
    curves
}

fn point<'a>(
    (strategy, parameters): (&str, &str),
    rows: &(impl Iterator<Item = &'a FrontierRow> + Clone),
) -> FrontierPoint {
    let spread = |value: fn(&FrontierRow) -> f64| {
        let mut values: Vec<f64> = rows.clone().map(value).collect();
        values.sort_by(f64::total_cmp);
        let middle = median(values.iter().copied()).unwrap_or(values[0]);
        [values[0], middle, values[values.len() - 1]]
    };
    let rms = |value: fn(&FrontierRow) -> f64| {
        let squares: Vec<f64> = rows.clone().map(|row| value(row) * value(row)).collect();
        libm::sqrt(squares.iter().sum::<f64>() / squares.len() as f64)
    };
    let mean = |value: fn(&FrontierRow) -> f64| {
        rows.clone().map(value).sum::<f64>() / rows.clone().count() as f64
    };
    FrontierPoint {
        strategy: strategy.to_owned(),
        parameters: parameters.to_owned(),
        rig_s: spread(|row| row.rig_s)[1],
        radiance: spread(|row| row.error_radiance_rms_relative),
        shape: spread(|row| row.error_shape_rms_relative),
        exitance_rms: rms(|row| row.error_exitance_relative),
        exitance_shape_rms: rms(|row| row.error_exitance_shape_relative),
        u_exitance: mean(|row| row.u_exitance_relative),
        foretold: rows.clone().next().map_or(Foretold::NOTHING, |row| row.foretold),
        is_on_front: false,
    }
}

/// A shape that errs by less errs by rounding, about which time decides nothing.
const ROUNDING: f64 = 1e-12;
/// Points nearer to each other in time say nothing of twice the time.
const TIME_MIN: f64 = 1.25;

/// In words, what twice the time buys between two neighbouring points: the factor on the error
/// of the radiance's shape, by the power law through both. `None` where no law can be told: the
/// errors are rounding, or the times are as good as equal.
pub fn doubling(lower: &FrontierPoint, upper: &FrontierPoint) -> Option<String> {
    let (time, error) = (upper.rig_s / lower.rig_s, upper.shape[1] / lower.shape[1]);
    let is_rounding = |point: &FrontierPoint| point.shape[1] <= ROUNDING;
    if time < TIME_MIN || !error.is_finite() || [lower, upper].into_iter().any(is_rounding) {
        return None;
    }
    let factor = libm::exp2(libm::log(error) / libm::log(time));
    Some(format!(
        "from {:.0} s to {:.0} s: twice the time leaves {:.0} % of the error of the radiance's shape",
        lower.rig_s,
        upper.rig_s,
        100.0 * factor
    ))
}

/// How honest the stated uncertainty of the exitance is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coverage {
    /// RMS of error over stated standard uncertainty: 1 for an honest one.
    pub rms_of_error_over_u: f64,
    /// How much of the runs has the truth within two stated uncertainties.
    pub within_2u: f64,
}

/// Over all rows, at least one.
pub fn coverage(rows: &[FrontierRow]) -> Coverage {
    let count = rows.len() as f64;
    // The error is relative to the truth and u to the fit: the same but for second order.
    let in_u = rows.iter().map(|row| row.error_exitance_relative / row.u_exitance_relative);
    let squares: f64 = in_u.clone().map(|z| z * z).sum();
    let within = in_u.filter(|z| z.abs() <= 2.0).count();
    Coverage { rms_of_error_over_u: libm::sqrt(squares / count), within_2u: within as f64 / count }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(parameters: &str, seed: u64, rig_s: f64, error: f64) -> FrontierRow {
        FrontierRow {
            scene: "s".into(),
            strategy: "stop-and-go".into(),
            parameters: parameters.into(),
            seed,
            rig_s,
            readings: 10,
            error_radiance_rms_relative: error,
            error_exitance_relative: -error,
            error_flux_relative: -error,
            u_exitance_relative: error,
            error_shape_rms_relative: error,
            error_exitance_shape_relative: 0.5 * error,
            foretold: Foretold::NOTHING,
            compute_s: 0.1,
        }
    }

    #[test]
    fn rows_of_a_rung_make_one_point_in_order_of_time() {
        let rows = [
            row("b", 1, 200.0, 0.01),
            row("a", 1, 100.0, 0.04),
            row("a", 2, 100.0, 0.02),
            row("b", 2, 200.0, 0.01),
        ];
        let points = points(&rows);
        assert_eq!(points.len(), 2);
        assert_eq!(points[0].parameters, "a");
        for (found, expected) in points[0].radiance.iter().zip([0.02, 0.03, 0.04]) {
            assert!((found - expected).abs() < 1e-15);
        }
        assert!((points[0].exitance_rms - libm::sqrt(0.001)).abs() < 1e-15);
    }

    #[test]
    fn the_front_is_what_nothing_quicker_betters() {
        let mut rows = vec![
            row("a", 1, 100.0, 0.04),
            row("b", 1, 200.0, 0.05),
            row("c", 1, 300.0, 0.02),
            row("a", 1, 50.0, 0.06),
        ];
        rows[3].strategy = "sweep".into();
        let points = points(&rows);
        let front: Vec<bool> = points.iter().map(|point| point.is_on_front).collect();
        assert_eq!(front, [true, true, false, true]);
        let curves = by_strategy(&points);
        assert_eq!(
            curves.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
            ["sweep", "stop-and-go"]
        );
        assert_eq!(curves[1].1.len(), 3);
    }

    #[test]
    fn coverage_counts_what_lies_within_two_u() {
        let mut rows = [row("a", 1, 1.0, 0.01), row("a", 2, 1.0, 0.01)];
        rows[1].error_exitance_relative = 0.03;
        let coverage = coverage(&rows);
        assert!((coverage.within_2u - 0.5).abs() < 1e-15);
        assert!((coverage.rms_of_error_over_u - libm::sqrt(5.0)).abs() < 1e-12);
    }

    #[test]
    fn rounding_and_equal_times_tell_no_law() {
        let between = |lower: FrontierRow, upper: FrontierRow| {
            let points = points(&[lower, upper]);
            doubling(&points[0], &points[1])
        };
        // An even source that the fit holds exactly: its errors are a few ulp, one way or the other.
        assert_eq!(between(row("a", 1, 100.0, 2e-16), row("b", 1, 101.0, 9e-16)), None);
        assert_eq!(between(row("a", 1, 100.0, 0.02), row("b", 1, 200.0, 1e-16)), None);
        assert_eq!(between(row("a", 1, 100.0, 0.02), row("b", 1, 101.0, 0.03)), None);
        assert!(between(row("a", 1, 100.0, 0.02), row("b", 1, 200.0, 0.03)).is_some());
    }

    #[test]
    fn photon_noise_leaves_71_percent_for_twice_the_time() {
        let points = points(&[row("a", 1, 100.0, 0.02), row("b", 1, 400.0, 0.01)]);
        let text = doubling(&points[0], &points[1]).unwrap();
        assert!(text.contains("leaves 71 %"), "{text}");
        assert_eq!(doubling(&points[1], &points[0]), None);
    }
}
