//! `gonio fit` of a long CSV: the file is walked through again and again, in blocks. Where no basis is pinned
//! it is chosen from whole sweeps that a first look keeps, a bounded number of samples. Memory is that of
//! those, of the coefficients' triangle and of a block.

use std::cell::RefCell;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use fit::blocks::{Asked, Blocks, Blockwise, Totals};
use fit::{
    Choice, Common, FitError, Gleaning, Noise, Optics, Penalised, Ray, Readings, Region, Robust,
    Rules, Sample, Wish,
};

use super::args::ChartArgs;
use super::chart::csv_help;
use super::failure::Failure;
use super::fit::FIT_HELP;
use crate::export::{
    BlockError, InputSample, InputSamples, RayChart, TreatedReadings, read_sample_blocks,
};
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
    /// Those that have no part in the fit.
    pub(super) left_out: TreatedReadings,
    is_surface: bool,
    gleaning: Gleaning,
    totals: Totals,
    /// Of the samples that are no limits.
    squares: f64,
    plain: usize,
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
        for sample in block.left_out() {
            self.left_out.leave_out(sample.line, sample.ray.ray(), sample.value);
        }
        let (samples, limits) = block.fit_readings(Noise::Unknown);
        self.used += samples.len();
        self.totals.take(&Readings { limits: &limits, ..Readings::of(&samples) });
        let (plain, _) = block.fit_samples_with_lines();
        self.plain += plain.len();
        self.squares += plain.iter().map(|sample| sample.value * sample.value).sum::<f64>();
        self.gleaning.take(&plain);
    }

    fn none(quantity: Quantity) -> Self {
        Self {
            quantity,
            region: Region::surface(NOWHERE, NOWHERE, 0.0),
            samples: 0,
            flagged: 0,
            used: 0,
            has_u: false,
            left_out: TreatedReadings::default(),
            is_surface: false,
            gleaning: Gleaning::new(KEPT_MAX),
            totals: Totals::default(),
            squares: 0.0,
            plain: 0,
        }
    }

    /// Whether the file is longer than what is kept, or not to be kept.
    pub(super) fn is_for_blocks(&self, is_wanted: bool) -> bool {
        (is_wanted || self.samples > KEPT_MAX) && self.is_surface
    }

    /// The basis that is pinned, or that the sweeps which were kept ask for.
    pub(super) fn model(
        &self,
        path: &Path,
        (wish, optics): (&Wish, Option<&Optics>),
        u_relative: Option<f64>,
    ) -> Result<(Penalised, Option<Choice>), Failure> {
        let noise = self.noise(u_relative);
        let samples = self.gleaning.clone().into_samples().into_iter();
        let samples: Vec<Sample> = samples.map(|sample| known(sample, noise)).collect();
        let chosen = chosen((&samples, false), &self.region, wish, optics);
        chosen.map_err(|error| {
            // Whose sample is wrong is known by its line to a walk through the file alone.
            let asked = Asked {
                region: self.region,
                model: fit::BasisSpec::zernike(0, 0).into(),
                robust: Robust::None,
                optics: None,
                with_truncation: false,
                others: &[],
            };
            let by_line =
                error.index().and_then(|_| self.fit(path, &asked, (u_relative, None)).err());
            by_line.unwrap_or_else(|| {
                Failure::with_help(format!("{}: {error}", path.display()), FIT_HELP)
            })
        })
    }

    /// The fit, in as many walks as it takes, and the readings that are no plain ones.
    pub(super) fn fit(
        &self,
        path: &Path,
        asked: &Asked<'_>,
        (u_relative, u_scale): (Option<f64>, Option<f64>),
    ) -> Result<(Blockwise, TreatedReadings), Failure> {
        let lines = RefCell::new(Vec::new());
        let noise = self.noise(u_relative);
        let mut file = LongCsv { path, noise, u_scale, lines: &lines };
        let mut treated = self.left_out.clone();
        let totals = if u_relative.is_some() { self.totals.known() } else { self.totals };
        let fitted = fit::blocks::fit(&mut file, &totals, asked, &mut |block, told| {
            let lines = lines.borrow();
            let named = |i: usize| (lines[i], block.samples[i].ray, block.samples[i].value);
            treated.take(&told.weighed, named);
        });
        let fitted = fitted.map_err(|stopped| match stopped {
            Stopped::Source(failure) => failure,
            Stopped::Fit(error) => {
                Failure::with_help(format!("{}: {error}", path.display()), FIT_HELP)
            }
        })?;
        Ok((fitted, treated))
    }

    /// Of samples that state no u.
    fn noise(&self, u_relative: Option<f64>) -> Noise {
        let Some(u_relative) = u_relative else { return Noise::Unknown };
        let mean_square = self.squares / self.plain.max(1) as f64;
        Noise::Fixed { variance: u_relative * u_relative * mean_square }
    }
}

/// The basis that is pinned, or that these samples ask for: where outliers are weighed, those without them.
pub(super) fn chosen(
    (samples, is_flown): (&[Sample], bool),
    region: &Region,
    wish: &Wish,
    optics: Option<&Optics>,
) -> Result<(Penalised, Option<Choice>), FitError> {
    if wish.rules.robust == Robust::None || wish.decided().is_some() {
        let choose = if is_flown { fit::choose_flown } else { fit::choose };
        return choose(samples, region, wish, optics);
    }
    let rules = Rules { robust: wish.rules.robust, ..Rules::default() };
    let wish = Wish { rules, ..*wish };
    // Their ways are not kept; that they had some counts here.
    let way = |sample: &Sample| is_flown.then_some((sample.ray, sample.ray));
    let flown: Vec<Option<(Ray, Ray)>> = samples.iter().map(way).collect();
    fit::fit_valued(&Readings { flown: &flown, ..Readings::of(samples) }, region, &wish, optics)
        .map(|ruled| (ruled.fit.model(), ruled.choice))
}

fn known(sample: Sample, without_u: Noise) -> Sample {
    let noise = if sample.noise == Noise::Unknown { without_u } else { sample.noise };
    Sample { noise, ..sample }
}

/// A file that is walked through again and again.
struct LongCsv<'a> {
    path: &'a Path,
    /// Of samples that state no u.
    noise: Noise,
    u_scale: Option<f64>,
    /// Where the samples of the block stand that is looked at.
    lines: &'a RefCell<Vec<u64>>,
}

/// Why a walk did not come to its end.
pub(super) enum Stopped {
    Source(Failure),
    Fit(FitError),
}

impl From<Failure> for Stopped {
    fn from(failure: Failure) -> Self {
        Self::Source(failure)
    }
}

impl From<FitError> for Stopped {
    fn from(error: FitError) -> Self {
        Self::Fit(error)
    }
}

impl Blocks for LongCsv<'_> {
    type Error = Stopped;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), Stopped> {
        let common: Vec<Common> = self.u_scale.map(super::fit::scale).into_iter().collect();
        each_block(self.path, RayChart::Surface, |block| {
            let (samples, limits) = block.fit_readings(self.noise);
            let lines = block.with_limits().map(|sample| sample.line);
            self.lines.replace(lines.collect());
            let readings = Readings { limits: &limits, common: &common, ..Readings::of(&samples) };
            take(&readings).map_err(|error| match error.index() {
                Some(index) => format!("line {}: {error}", self.lines.borrow()[index]),
                None => error.to_string(),
            })
        })
        .map_err(Stopped::Source)
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
pub(super) const KEPT_MAX: usize = 50_000;
