//! From a run's readings to what it says: samples, fit, what is true on a simulated rig, the
//! course of its accuracy; and the files of its folder. A run that just ended, one that is fitted
//! again, one of a ladder and one of the daemon's all come through here.

use std::io::{self, Write};
use std::path::Path;

use fit::{Fit, FitError, Optics, Region, Wish};

use super::accuracy;
use super::adapting;
use super::derive::{derive, write_tables};
use super::failure::Failure;
use super::folder::JOURNAL;
use super::long_results::{self, InBlocks};
use super::long_run;
use super::report::{self, REPORT, RunRecord};
use super::setup::Setup;
use super::tally::Tally;
use crate::export::{
    AccuracyPoint, DerivedQuantity, ExportError, FitFile, MonteCarlo, SamplesMeta, Treatment,
    TruePeak, Truth, write_accuracy, write_atomically, write_readings, write_samples,
    write_weights,
};
use crate::journal::{Header, InputRole, Order, Reader};
use crate::rig::Reading;
use crate::rig::calibration::{Calibrated, Fitted, IndependentParts, Part, Sample, calibrate};
use crate::study::Score;

/// What a run says.
#[derive(Debug)]
pub(crate) struct Results {
    /// Of a run in blocks it has some of the samples.
    pub(crate) calibrated: Calibrated,
    /// Of all samples.
    pub(super) tally: Tally,
    /// The fit, or why there is none.
    pub(crate) fitted: Result<Fitted, FitError>,
    pub(crate) truth: Option<Truth>,
    /// How far the fit lies from the truth, where there is both, and any light.
    pub(crate) score: Option<Score>,
    pub(crate) accuracy: Vec<AccuracyPoint>,
    /// What the fit gives each sample's reading, in the samples' order; empty without a fit.
    pub(crate) levels: Vec<f64>,
    /// The independent parts of u by source.
    pub(crate) independent: IndependentParts,
    /// What the plan asks to be derived from the fit.
    pub(crate) derived: Vec<DerivedQuantity>,
    /// Of a run in blocks: what all its samples would say.
    pub(super) blocks: Option<InBlocks>,
}

impl Results {
    /// What a run's journal says, and the readings that its report is made of. A long run, or one that
    /// shall be, is read in blocks: of it these are the readings beside its targets'.
    pub(crate) fn of_run(
        setup: &Setup,
        reader: &Reader,
        in_blocks: bool,
    ) -> Result<(Self, Vec<Reading>), Failure> {
        if in_blocks || long_run::is_long(reader)? {
            return Self::in_blocks(setup, &setup.plan.fit, reader);
        }
        let readings = reader.readings(Order::Taken)?;
        Ok((Self::of(setup, setup.plan.fit, &readings)?, readings))
    }

    /// Calibrates and fits a run's readings. An error is one of the readings; a fit that is not
    /// possible is a result too, since the samples stand.
    pub(crate) fn of(setup: &Setup, wish: Wish, readings: &[Reading]) -> Result<Self, Failure> {
        let mut calibrated = calibrate(&setup.rig, readings).map_err(Failure::midway)?;
        let (region, optics) = (fit_region(setup), optics(setup));
        let fitted = calibrated.fit(&region, &wish, optics.as_ref());
        let levels = match &fitted {
            Ok(fitted) => calibrated.restate_from(&fitted.fit, optics.as_ref()),
            Err(_) => Vec::new(),
        };
        if let Some(optics) = &optics {
            calibrated.flag_off_sample(optics);
        }
        let compared = fitted.as_ref().ok().and_then(|fitted| compare(setup, &region, &fitted.fit));
        let (truth, score) = compared.unzip();
        let course = |fitted: &Fitted| {
            accuracy::course(&calibrated, &region, fitted, &wish.rules, optics.as_ref())
        };
        let accuracy = fitted.as_ref().map_or_else(|_| Vec::new(), course);
        let derived = fitted.as_ref().map_or_else(
            |_| Vec::new(),
            |fitted| derive(&fitted.fit, setup.rig.detector.quantity, &setup.plan.derive),
        );
        let independent = fitted
            .as_ref()
            .map_or(IndependentParts::NONE, |fitted| calibrated.independent_parts(fitted));
        let score = score.flatten();
        Ok(Self {
            tally: Tally::of(&calibrated.samples),
            calibrated,
            fitted,
            truth,
            score,
            accuracy,
            levels,
            independent,
            derived,
            blocks: None,
        })
    }

    /// Samples that carry a flag.
    pub(crate) fn n_flagged(&self) -> usize {
        self.tally.flagged
    }

    /// Writes every file of the run's folder but the journal, each whole or not at all.
    pub(crate) fn write(
        &self,
        folder: &Path,
        setup: &Setup,
        record: &RunRecord<'_>,
    ) -> Result<(), Failure> {
        self.write_files(folder, setup, record).map_err(Failure::midway)
    }

    fn write_files(
        &self,
        folder: &Path,
        setup: &Setup,
        record: &RunRecord<'_>,
    ) -> Result<(), ExportError> {
        let RunRecord { header, reader, .. } = record;
        let quantity = setup.rig.detector.quantity;
        write_atomically(&folder.join("samples.csv"), |out| {
            self.write_samples(out, setup, reader)
        })?;
        self.write_meta(&folder.join("samples.meta.json"), setup, header)?;
        write_atomically(&folder.join("readings.csv"), |out| {
            write_readings(out, &setup.rig, long_results::readings_taken(reader))
        })?;
        write_atomically(&folder.join("accuracy.csv"), |out| {
            write_accuracy(out, quantity, &self.accuracy)
        })?;
        if let Ok(fitted) = &self.fitted {
            self.write_fit(&folder.join("fit.json"), setup, fitted, None)?;
            write_tables(folder, &self.derived)?;
            let treatment = self.treatment(fitted);
            if treatment.is_long() {
                write_atomically(&folder.join("weights.csv"), |out| {
                    write_weights(out, quantity, &fitted.fit.region().chart, &treatment)
                })?;
            }
        }
        let report = report::of(setup, self, record);
        write_atomically(&folder.join(REPORT), |out| report.write(out))
    }

    /// Writes samples.csv.
    pub(crate) fn write_samples(
        &self,
        out: impl Write,
        setup: &Setup,
        reader: &Reader,
    ) -> io::Result<()> {
        if self.blocks.is_some() {
            return long_results::write_samples(out, setup, self, reader);
        }
        write_samples(out, setup.rig.detector.quantity, &self.calibrated.samples)
    }

    /// Writes what samples.csv can't say in columns.
    pub(crate) fn write_meta(
        &self,
        path: &Path,
        setup: &Setup,
        header: &Header,
    ) -> Result<(), ExportError> {
        let meta = SamplesMeta {
            rig: &setup.rig,
            calibrated: &self.calibrated,
            program_version: &header.program_version,
            simulated: header.simulated,
            seed: header.seed,
            plan_name: &header.plan_name,
            plan_hash: &header.plan_hash,
            started_utc: &header.started_utc,
            targets_measured: self.tally.measured,
            samples_flagged: self.tally.flagged,
            targets_planned: targets_planned(setup),
            effects: &header.effects,
        };
        write_atomically(path, |out| meta.write(out))
    }

    /// What became of readings that are no plain ones.
    pub(crate) fn treatment<'a>(&'a self, fitted: &'a Fitted) -> Treatment<'a> {
        let samples = &self.calibrated.samples;
        let named = |sample: &Sample| (u64::from(sample.reading), sample.ray(), sample.value);
        let of_all = || {
            let left_out = samples.iter().filter(|sample| sample.part() == Part::None).map(named);
            Treatment::of(&fitted.fit, |i| named(&samples[fitted.places[i]]), left_out)
        };
        self.blocks
            .as_ref()
            .map_or_else(of_all, InBlocks::treatment)
            .with_rules(fitted.symmetry.as_ref(), fitted.nonnegative.as_ref())
            .with_drift(fitted.drift.as_ref())
    }

    /// Writes fit.json.
    pub(crate) fn write_fit(
        &self,
        path: &Path,
        setup: &Setup,
        fitted: &Fitted,
        monte_carlo: Option<&MonteCarlo>,
    ) -> Result<(), ExportError> {
        let treatment = self.treatment(fitted);
        let file = FitFile {
            fit: &fitted.fit,
            treatment: &treatment,
            choice: fitted.choice.as_ref(),
            resolves: Some(fitted.resolves),
            quantity: setup.rig.detector.quantity,
            simulated: setup.rig.is_simulated(),
            n_flagged: self.n_flagged(),
            n_excluded: fitted.n_excluded,
            notes: self.blocks.as_ref().map_or(&[], InBlocks::notes),
            truth: self.truth,
            independent: &self.independent,
            derived: &self.derived,
            rounds: &setup.accounts,
            monte_carlo,
        };
        write_atomically(path, |out| file.write(out))
    }
}

/// The fit of a run's readings as its plan asks for it, and nothing else: for studies of many runs.
pub(crate) fn fit_of(setup: &Setup, readings: &[Reading]) -> Result<fit::Fit, Failure> {
    let calibrated = calibrate(&setup.rig, readings).map_err(Failure::midway)?;
    let (region, optics) = (fit_region(setup), optics(setup));
    let wish = &setup.plan.fit;
    let fitted = calibrated.fit(&region, wish, optics.as_ref()).map_err(Failure::midway)?;
    Ok(fitted.fit)
}

/// Copies of plan, rig and scene and of what they refer to, as they were read.
pub(crate) fn write_inputs(folder: &Path, setup: &Setup) -> Result<(), ExportError> {
    for input in &setup.inputs {
        let name = match input.role {
            InputRole::Plan => "plan.toml",
            InputRole::Rig => "rig.toml",
            InputRole::Scene => "scene.toml",
            // The name alone: a file of another folder is copied into this one.
            InputRole::Attachment => match Path::new(&input.name).file_name() {
                Some(name) => &*name.to_string_lossy(),
                None => continue,
            },
        };
        write_atomically(&folder.join(name), |out| out.write_all(&input.bytes))?;
    }
    Ok(())
}

/// Opens a run's folder: what it is made of, how it began, and where its readings are to be had.
pub(crate) fn open_run(folder: &Path) -> Result<(Setup, Header, Reader), Failure> {
    let reader = Reader::open(&folder.join(JOURNAL))?;
    let header = reader.header()?;
    let name = Some(header.plan_name.clone());
    let setup =
        Setup::from_inputs(reader.inputs()?, name, header.seed, header.effect_wishes.clone())?
            .with_rounds(&reader)?;
    let setup = adapting::concluded(setup, &reader)?;
    Ok((setup, header, reader))
}

/// Readings of targets that the plan asks for, repeats counted.
pub(crate) fn targets_planned(setup: &Setup) -> usize {
    setup.sequence.targets.len() * setup.plan.repeat as usize
}

/// What the plan's fit stands for.
pub(crate) fn fit_region(setup: &Setup) -> Region {
    let region = setup.region();
    Region::surface(region.x_m, region.y_m, region.theta_max_rad)
}

/// What the rig's detector sees of the plan's sample.
pub(crate) fn optics(setup: &Setup) -> Option<Optics> {
    let beam = setup.rig.detector.beam().ok()?;
    Some(Optics { beam, outline: setup.plan.sample })
}

/// What is true, and how far the fit lies from it.
pub(crate) fn compare(setup: &Setup, region: &Region, fit: &Fit) -> Option<(Truth, Option<Score>)> {
    let truth = setup.truth()?;
    let radiance = |ray: &fit::Ray| truth.radiance(ray.x_m, ray.y_m, ray.theta_rad, ray.phi_rad);
    let score = Score::of(region, |ray| fit.value(ray), radiance);
    let stated = Truth {
        exitance: truth.exitance(),
        exitance_within_region: truth.exitance_within_region(),
        flux: truth.flux(),
        peak: truth.peak().map(|peak| TruePeak {
            value: peak.value,
            ray: fit::Ray {
                x_m: peak.x_m,
                y_m: peak.y_m,
                theta_rad: peak.theta_rad,
                phi_rad: peak.phi_rad,
            },
        }),
        radiance_error_rms_relative: score.map(|score| score.rms_relative),
    };
    Some((stated, score))
}
