//! What happened in the course of a run: signal, reference and dark readings, residuals, and how
//! the accuracy grew with rig time.

use super::words::Words;
use crate::cli::results::Results;
use crate::cli::setup::Setup;
use crate::cli::text::{duration, percent};
use crate::export::AccuracyPoint;
use crate::report::{Chart, Picture, Section, Series, Stroke};
use crate::rig::calibration::Sample;
use crate::rig::{Reading, ReadingKind};
use crate::study::{Reach, Trend};

/// A unit of time that a run's axis can do with.
#[derive(Debug, Clone, Copy)]
struct TimeUnit {
    seconds: f64,
    name: &'static str,
}

impl TimeUnit {
    fn of(length_s: f64) -> Self {
        match length_s {
            s if s < 600.0 => Self { seconds: 1.0, name: "s" },
            s if s < 3.0 * 3600.0 => Self { seconds: 60.0, name: "min" },
            _ => Self { seconds: 3600.0, name: "h" },
        }
    }

    fn label(self) -> String {
        format!("rig time / {}", self.name)
    }
}

fn series(name: &str, colour: usize, stroke: Stroke, points: Vec<(f64, f64)>) -> Series {
    Series { name: name.to_owned(), colour, stroke, points, errors: Vec::new() }
}

fn chart(name: &'static str, title: &str, caption: &str, labels: [String; 2]) -> Chart {
    let [x_label, y_label] = labels;
    Chart {
        name,
        title: title.to_owned(),
        caption: caption.to_owned(),
        x_label,
        y_label,
        is_logarithmic: false,
        series: Vec::new(),
    }
}

/// Standardised residuals of the fit's readings.
pub(super) fn residuals(setup: &Setup, results: &Results, length_s: f64) -> Option<Section> {
    let used = results.calibrated.samples.iter().zip(&results.levels);
    let used = used.filter(|(sample, _)| !sample.flags.excludes_from_fit());
    let residuals: Vec<(&Sample, f64)> = used
        .map(|(sample, level)| (sample, (sample.value - level) / sample.u_independent))
        .collect();
    let squares: f64 = residuals.iter().map(|(_, residual)| residual * residual).sum();
    let rms = libm::sqrt(squares / residuals.len().max(1) as f64);
    let unit = TimeUnit::of(length_s);
    let over = |place: &dyn Fn(&Sample) -> f64| {
        let points = residuals.iter().map(|(sample, residual)| (place(sample), *residual));
        vec![series("", 0, Stroke::Dots, points.collect())]
    };
    let label = "(reading − fit) / u".to_owned();
    let caption = format!(
        "u is each reading's own independent standard uncertainty, by the detector's model at the \
         fitted level. RMS {rms:.2}; about 1 where noise alone separates readings and fit."
    );
    let by_theta = chart(
        "residuals-theta",
        "Residuals against θ",
        &caption,
        ["θ / degrees".to_owned(), label.clone()],
    );
    let by_time = chart("residuals-time", "Residuals against time", "", [unit.label(), label]);
    let theta = |sample: &Sample| sample.pose.theta_rad.to_degrees();
    let time = |sample: &Sample| sample.time_s / unit.seconds;
    let charts =
        [Chart { series: over(&theta), ..by_theta }, Chart { series: over(&time), ..by_time }];
    let mut paragraphs = Vec::new();
    if let Some(error) = results.truth.and_then(|truth| truth.radiance_error_rms_relative) {
        let word = Words::of(setup.rig.detector.quantity).radiance;
        paragraphs.push(format!(
            "Against the simulator's truth the fitted {word} is off by {} RMS over the region, \
             weighted by throughput.",
            percent(error)
        ));
    }
    let pictures: Vec<Picture> = charts.into_iter().filter_map(Chart::picture).collect();
    let title = "Residuals".to_owned();
    (!pictures.is_empty()).then(|| Section { title, paragraphs, pictures, ..Section::default() })
}

/// Every reading against time: targets, references, warm-up, darks.
pub(super) fn signal(
    setup: &Setup,
    results: &Results,
    readings: &[Reading],
    length_s: f64,
) -> Option<Section> {
    let words = Words::of(setup.rig.detector.quantity);
    let unit = TimeUnit::of(length_s);
    let name = Words::with_unit(words.radiance, words.radiance_unit);
    let caption = "Target, reference and warm-up readings less the dark level; dark readings as \
                   they are, in the same unit.";
    let all = chart("signal", "Signal against time", caption, [unit.label(), name]);
    let targets = results.calibrated.samples.iter().map(|s| (s.time_s / unit.seconds, s.value));
    let references = &results.calibrated.references;
    let at_reference = references.iter().map(|r| (r.time_s / unit.seconds, r.value));
    let of_kind = |kind: ReadingKind, less_dark: bool| {
        let level = |reading: &Reading| level(setup, results, reading, less_dark);
        let chosen = readings.iter().filter(move |reading| reading.kind == kind);
        chosen.map(|r| (r.time_s / unit.seconds, level(r))).collect::<Vec<_>>()
    };
    let dark = of_kind(ReadingKind::Dark, false);
    let all = Chart {
        series: vec![
            series("targets", 0, Stroke::Dots, targets.collect()),
            series("warm-up", 3, Stroke::Points, of_kind(ReadingKind::WarmUp, true)),
            series("reference", 1, Stroke::Points, at_reference.collect()),
            series("dark", 2, Stroke::Points, dark),
        ],
        ..all
    };
    let charts = [Some(all), reference(results, unit), darks(setup, results, readings, unit)];
    let pictures: Vec<Picture> = charts.into_iter().flatten().filter_map(Chart::picture).collect();
    let title = "In the course of the run".to_owned();
    (!pictures.is_empty()).then(|| Section { title, pictures, ..Section::default() })
}

/// A reading in the unit of radiance.
fn level(setup: &Setup, results: &Results, reading: &Reading, less_dark: bool) -> f64 {
    let detector = &setup.rig.detector;
    let dark = results.calibrated.darks.iter().find(|dark| dark.gain == reading.gain);
    let dark_a = dark.filter(|_| less_dark).map_or(0.0, |dark| dark.level_a);
    (reading.mean * detector.lsb_a(reading.gain) - dark_a) / detector.a_per_radiance()
}

/// The reference pose about its mean; `None` with fewer than two readings of it.
fn reference(results: &Results, unit: TimeUnit) -> Option<Chart> {
    let mean = results.calibrated.drift()?.mean;
    let references = &results.calibrated.references;
    let percent = |value: f64| 100.0 * value / mean.abs();
    let points = references.iter().map(|r| (r.time_s / unit.seconds, percent(r.value - mean)));
    let errors = references.iter().map(|r| percent(r.u_independent)).collect();
    let marks = series("", 1, Stroke::Points, points.collect());
    let caption = "Bars: one standard uncertainty, noise alone.";
    let labels = [unit.label(), "about the mean / %".to_owned()];
    let chart = chart("reference", "The reference pose against time", caption, labels);
    Some(Chart { series: vec![Series { errors, ..marks }], ..chart })
}

/// The dark level about its mean, range by range; `None` with fewer than two readings of it.
fn darks(setup: &Setup, results: &Results, readings: &[Reading], unit: TimeUnit) -> Option<Chart> {
    let detector = &setup.rig.detector;
    let words = Words::of(detector.quantity);
    let mut drawn = Vec::new();
    for (colour, dark) in results.calibrated.darks.iter().enumerate() {
        let is_of = |reading: &&Reading| {
            reading.kind == ReadingKind::Dark && reading.gain == dark.gain && reading.saturated == 0
        };
        let used: Vec<&Reading> = readings.iter().filter(is_of).collect();
        if used.len() < 2 {
            continue;
        }
        let mean = dark.level_a / detector.a_per_radiance();
        let points = used
            .iter()
            .map(|r| (r.time_s / unit.seconds, level(setup, results, r, false) - mean))
            .collect();
        let u = |r: &&Reading| {
            libm::sqrt(detector.modelled_variance(dark.gain, r.n, dark.level_a).floor)
        };
        let gain = detector.gains.get(usize::from(dark.gain)).map_or("", |gain| &gain.name);
        let marks = series(gain, 2 + colour, Stroke::Points, points);
        drawn.push(Series { errors: used.iter().map(u).collect(), ..marks });
    }
    let caption = "About the mean of the run, gain range by gain range. Bars: one standard \
                   uncertainty, noise alone.";
    let labels = [unit.label(), Words::with_unit("dark level", words.radiance_unit)];
    let chart = chart("dark", "The dark level against time", caption, labels);
    (!drawn.is_empty()).then_some(Chart { series: drawn, ..chart })
}

/// How the exitance's uncertainty fell with rig time, and what more of it would buy.
pub(super) fn accuracy(setup: &Setup, results: &Results) -> Option<Section> {
    let words = Words::of(setup.rig.detector.quantity);
    let points: Vec<&AccuracyPoint> =
        results.accuracy.iter().filter(|point| point.exitance.value > 0.0).collect();
    let last = *points.last()?;
    let curve = |u: &dyn Fn(&AccuracyPoint) -> f64| {
        points.iter().map(|p| (p.rig_s, 100.0 * u(p) / p.exitance.value)).collect::<Vec<_>>()
    };
    let combined = curve(&|point| point.exitance.u);
    let independent = curve(&|point| point.exitance.u_independent);
    let mut drawn = vec![
        series("combined", 0, Stroke::Line, combined.clone()),
        series("", 0, Stroke::Points, combined),
        series("independent", 1, Stroke::Line, independent.clone()),
        series("", 1, Stroke::Points, independent),
    ];
    let target = setup.plan.stop.exitance_relative;
    if let Some(target) = target {
        let ends = [points[0].rig_s, last.rig_s].map(|t| (t, 100.0 * target));
        drawn.push(series("the plan's target", 3, Stroke::Dashes, ends.to_vec()));
    }
    let caption = format!(
        "Standard uncertainty of the {} relative to it, from the readings taken first, ever more \
         of them.",
        words.exitance
    );
    let labels = ["rig time / s".to_owned(), "u / %".to_owned()];
    let title = format!("Uncertainty of the {} against rig time", words.exitance);
    let chart = chart("accuracy", &title, &caption, labels);
    let picture = Chart { series: drawn, is_logarithmic: true, ..chart }.picture()?;
    Some(Section {
        title: "Accuracy so far".to_owned(),
        paragraphs: outlook(results, last, target),
        pictures: vec![picture],
        ..Section::default()
    })
}

/// What twice the time would buy, and what the plan's target would cost.
fn outlook(results: &Results, last: &AccuracyPoint, target: Option<f64>) -> Vec<String> {
    let trend = match &results.fitted {
        Ok(fitted) => Trend::of_exitance(last.rig_s, &fitted.fit),
        Err(_) => Trend::of(last.rig_s, &last.exitance),
    };
    let Some(trend) = trend else { return Vec::new() };
    let mut said = vec![format!(
        "After {} the uncertainty is {}, of which more readings of the same kind leave {}: what \
         they all share, and what the fit's functions can't follow. Twice the time would bring {}, if the \
         rest goes on to fall as the square root of time.",
        duration(last.rig_s),
        percent(trend.u()),
        percent(trend.lasting),
        percent(trend.after(2.0))
    )];
    if let Some(target) = target {
        let asked = percent(target);
        said.push(match trend.reach(target) {
            Reach::Met => format!("The plan's target of {asked} is met."),
            Reach::Never => format!(
                "The plan's target of {asked} can't be met by more time: what more readings \
                 leave is more than that."
            ),
            Reach::At(seconds) => format!(
                "The plan's target of {asked} would be met after about {} by the same rule.",
                duration(seconds)
            ),
        });
    }
    if results.fitted.as_ref().is_ok_and(|fitted| fitted.fit.excess_rms() > 0.0) {
        said.push(
            "The misfit counts as independent here. More readings of the same kind do not \
                   lessen it; a basis that follows the field does."
                .to_owned(),
        );
    }
    said
}
