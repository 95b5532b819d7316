//! `gonio fit` of a long CSV: the file is read again and again, in blocks. Where no basis is pinned it is
//! chosen from whole sweeps that a first look keeps, a bounded number of samples. Memory is that of those,
//! of the coefficients' triangle and of a block.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use fit::partial::{Closed, Pass, Passes, Weighting};
use fit::{Choice, Gleaning, Optics, Penalised, Ray, Region, Robust, Wish};

use super::args::ChartArgs;
use super::chart::csv_help;
use super::failure::Failure;
use super::fit::FIT_HELP;
use crate::export::{BlockError, InputSample, InputSamples, RayChart, read_sample_blocks};
use crate::rig::Quantity;

/// What a file holds, by a first look at it.
#[derive(Debug)]
pub(super) struct Scan {
    pub(super) quantity: Quantity,
    /// The rectangle and the cone that hold all samples.
    pub(super) region: Region,
    pub(super) samples: usize,
    pub(super) flagged: usize,
    pub(super) used: usize,
    pub(super) has_u: bool,
    has_limits: bool,
    is_surface: bool,
    gleaning: Gleaning,
}

impl Scan {
    /// Looks through a file; of what can be read but once, a pipe, the samples are kept.
    pub(super) fn of(
        path: &Path,
        args: &ChartArgs,
    ) -> Result<(Self, Option<InputSamples>), Failure> {
        let chart = args.ray_chart()?;
        let mut scan: Option<Self> = None;
        let is_file = std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
        let kept = if is_file {
            each_block(path, chart, |block| {
                scan.get_or_insert_with(|| Self::none(block.quantity)).take(&block);
                Ok(())
            })?;
            None
        } else {
            let input = all(path, chart)?;
            scan.get_or_insert_with(|| Self::none(input.quantity)).take(&input);
            Some(input)
        };
        let mut scan = scan.ok_or_else(|| {
            Failure::with_help(format!("{}: no samples", path.display()), csv_help(chart))
        })?;
        // The ends of what was seen stand for all of it.
        let Region { x_m, y_m, theta_max_rad, .. } = scan.region;
        let at = |x_m, y_m| Ray { x_m, y_m, theta_rad: theta_max_rad, phi_rad: 0.0 };
        let ends = [at(x_m.0, y_m.0), at(x_m.1, y_m.1)];
        scan.region = args.region(chart, &ends.into_iter());
        scan.is_surface = chart == RayChart::Surface;
        Ok((scan, kept))
    }

    fn take(&mut self, block: &InputSamples) {
        self.samples += block.samples.len();
        self.flagged += block.flagged();
        self.has_u |= block.has_u();
        let Region { x_m, y_m, theta_max_rad, .. } = &mut self.region;
        for sample in &block.samples {
            let ray = sample.ray.ray();
            *x_m = (x_m.0.min(ray.x_m), x_m.1.max(ray.x_m));
            *y_m = (y_m.0.min(ray.y_m), y_m.1.max(ray.y_m));
            *theta_max_rad = theta_max_rad.max(ray.theta_rad);
        }
        let (used, _) = block.fit_samples_with_lines();
        self.used += used.len();
        self.has_limits |= block.with_limits().count() > used.len();
        self.gleaning.take(&used);
    }

    fn none(quantity: Quantity) -> Self {
        Self {
            quantity,
            region: Region::surface(NOWHERE, NOWHERE, 0.0),
            samples: 0,
            flagged: 0,
            used: 0,
            has_u: false,
            has_limits: false,
            is_surface: false,
            gleaning: Gleaning::new(KEPT_MAX),
        }
    }

    /// Whether the file is long and what is asked for needs no more than passes over it.
    pub(super) fn is_for_blocks(&self, wish: &Wish) -> bool {
        let is_plain = wish.rules.robust == Robust::None && !self.has_limits && self.is_surface;
        self.samples > KEPT_MAX && is_plain
    }

    /// The basis that is pinned, or that the sweeps which were kept ask for.
    pub(super) fn model(
        &self,
        path: &Path,
        wish: &Wish,
        optics: Option<&Optics>,
    ) -> Result<(Penalised, Option<Choice>), Failure> {
        let samples = self.gleaning.clone().into_samples();
        fit::choose(&samples, &self.region, wish, optics).map_err(|error| {
            // Whose sample is wrong is known by its line to a pass over the file alone.
            let flat = fit::BasisSpec::zernike(0, 0).into();
            let by_line = error.index().and_then(|_| self.fit(path, flat, None, None).err());
            by_line.unwrap_or_else(|| {
                Failure::with_help(format!("{}: {error}", path.display()), FIT_HELP)
            })
        })
    }

    /// The fit, in as many passes as it takes.
    pub(super) fn fit(
        &self,
        path: &Path,
        model: Penalised,
        optics: Option<Optics>,
        u_relative: Option<f64>,
    ) -> Result<Closed, Failure> {
        let shown = path.display();
        let refused =
            |error: fit::FitError| Failure::with_help(format!("{shown}: {error}"), FIT_HELP);
        let weighting = if self.has_u { Weighting::Stated } else { Weighting::Alike };
        let mut passes = Passes::new(self.region, model, optics, weighting).map_err(refused)?;
        for _ in 0..PASSES_MAX {
            each_block(path, RayChart::Surface, |block| {
                let (samples, lines) = block.fit_samples_with_lines();
                passes.absorb(&samples).map_err(|error| match error.index() {
                    Some(index) => format!("line {}: {error}", lines[index]),
                    None => error.to_string(),
                })
            })?;
            if let Pass::Done(closed) = passes.end(u_relative).map_err(refused)? {
                return Ok(*closed);
            }
        }
        Err(refused(fit::FitError::OutOfRange))
    }
}

/// Hands the blocks of a file on.
pub(super) fn each_block(
    path: &Path,
    chart: RayChart,
    take: impl FnMut(InputSamples) -> Result<(), String>,
) -> Result<(), Failure> {
    let shown = path.display();
    let file = File::open(path).map_err(|error| {
        Failure::with_help(
            format!("{shown}: cannot be read: {error}"),
            "give a run's folder, or a CSV with x_mm, y_mm, theta_deg, phi_deg and a radiance",
        )
    })?;
    read_sample_blocks(chart, BufReader::new(file), take).map_err(|error| {
        let help = match &error {
            BlockError::Taken(_) => FIT_HELP.to_owned(),
            BlockError::Read(_) | BlockError::Csv(_) => error_help(&error, chart),
        };
        Failure::with_help(format!("{shown}: {error}"), help)
    })
}

/// All samples of a file, its text forgotten.
pub(super) fn all(path: &Path, chart: RayChart) -> Result<InputSamples, Failure> {
    let mut kept: Vec<InputSample> = Vec::new();
    let mut quantity = None;
    each_block(path, chart, |block| {
        quantity = quantity.or(Some(block.quantity));
        kept.extend(block.samples);
        Ok(())
    })?;
    let quantity = quantity.ok_or_else(|| {
        Failure::with_help(format!("{}: no samples", path.display()), csv_help(chart))
    })?;
    Ok(InputSamples { quantity, samples: kept })
}

fn error_help<E>(error: &BlockError<E>, chart: RayChart) -> String {
    use crate::export::CsvError;
    match error {
        BlockError::Csv(CsvError::Repeated { .. }) => {
            "remove one of them; if they are two readings that came out alike, add a column that tells \
             them apart (time_s, say)"
                .to_owned()
        }
        _ => csv_help(chart),
    }
}

/// Before anything lies anywhere.
const NOWHERE: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);
/// Fewer samples than this are kept rather than read again, and of more this many at most: some 10 MB.
const KEPT_MAX: usize = 50_000;
/// The excess settles in fewer.
const PASSES_MAX: usize = 40;
