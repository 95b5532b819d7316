//! A run's readings fitted in blocks against the same fitted at once: two ranges, a drift, saturated and
//! unsettled readings, positions that samples share and some that none does.

use fit::blocks::{self, Asked, Blocks, Totals};
use fit::{BasisSpec, FitError, Readings, Robust, Rules};

use super::fitting_tests::{readings, region};
use super::*;
use crate::rig::ReadingKind;

/// Readings as they come from a journal.
struct Run<'a> {
    readings: &'a [Reading],
    calibration: &'a Calibration<'a>,
    handing: &'a Handing,
    /// The samples of the block that is looked at, and which of them are used.
    block: std::cell::RefCell<(Vec<Sample>, Vec<usize>)>,
}

impl Blocks for &Run<'_> {
    type Error = FitError;

    fn each(
        &mut self,
        take: &mut dyn FnMut(&Readings<'_>) -> Result<(), FitError>,
    ) -> Result<(), FitError> {
        for block in self.readings.chunks(37) {
            let samples = self.calibration.samples(block);
            let input = self.handing.usable(&samples);
            let flown: Vec<_> = input.places.iter().map(|i| samples[*i].flown()).collect();
            self.block.replace((samples, input.places.clone()));
            take(&input.readings(&flown))?;
        }
        Ok(())
    }
}

/// With an error of everything that rig files know.
fn taken(rig: &mut Rig) -> Vec<Reading> {
    for axis in &mut rig.axes {
        (axis.u_zero, axis.u_homing, axis.u_readback) = (1e-3, 5e-4, 8e-4);
    }
    let drifting = |radiance: f64, time_s: f64| radiance * (1.0 + 2e-4 * time_s);
    let mut all = readings(rig, 5, drifting, |index| u8::from(index % 5 == 0));
    for (i, reading) in all.iter_mut().enumerate() {
        let ReadingKind::Target { index, .. } = reading.kind else { continue };
        reading.session = u32::from(i > 100);
        reading.unsettled = index == 40;
        // One in nine far off, some at the converter's end.
        reading.mean *= if index % 9 == 0 { 1.3 } else { 1.0 };
        reading.saturated = u32::from(index % 31 == 7);
        // Of each position of the turntable one sample has a position of its own.
        if index % 16 == 3 {
            let own = i32::try_from(index).unwrap();
            (reading.start.0[1], reading.end.0[1]) =
                (reading.start.0[1] + own, reading.end.0[1] + own);
            reading.commanded = reading.start;
        }
    }
    all
}

fn assert_close(a: f64, b: f64) {
    assert!((a - b).abs() <= TOLERANCE * (1.0 + b.abs()), "{a} {b}");
}

/// The scatter under a robust rule is found from sums.
const TOLERANCE: f64 = 3e-4;

#[test]
fn readings_of_a_run_in_blocks_say_what_they_say_at_once() {
    let mut rig = Rig::built_in().unwrap();
    let all = taken(&mut rig);
    for robust in [Robust::None, Robust::Huber] {
        let rules = Rules { robust, ..Rules::default() };
        let mut whole = calibrate(&rig, &all).unwrap();
        let (_, region) = region(&whole);
        let model = BasisSpec::zernike(4, 0).into();
        let fitted = whole.fit_as(&region, model, &rules, None).unwrap();
        whole.restate_from(&fitted.fit, None);

        let mut look = FirstLook::default();
        all.iter().try_for_each(|reading| look.take(&rig, reading)).unwrap();
        let calibration = look.calibration(&rig).unwrap();
        assert_eq!(
            (&calibration.darks, &calibration.references),
            (&whole.darks, &whole.references)
        );
        let mut spread = Spread::default();
        for block in all.chunks(37) {
            let samples = calibration.samples(block);
            samples.iter().filter(|s| s.part() != Part::None).for_each(|s| spread.take(s));
        }
        let components = calibration.components(&spread);
        assert_eq!(components, whole.components);
        let handing = Handing::new(components, &calibration.references, &spread, &rules);
        assert!(handing.drift.is_some() && handing.drift == fitted.drift);
        let block = std::cell::RefCell::default();
        let run = Run { readings: &all, calibration: &calibration, handing: &handing, block };
        let mut totals = Totals::default();
        let mut count = |block: &Readings<'_>| {
            totals.take(block);
            Ok(())
        };
        (&run).each(&mut count).unwrap();
        assert_eq!(totals.readings(), fitted.places.len());
        let asked =
            Asked { region, model, robust, optics: None, with_truncation: false, others: &[] };
        let mut sums = IndependentSums::default();
        let found = blocks::fit(&mut &run, &totals, &asked, &mut |_, told| {
            let (samples, places) = &mut *run.block.borrow_mut();
            for (place, level) in places.iter().zip(&told.levels) {
                samples[*place].state_at(*level);
            }
            sums.take(places.iter().map(|place| &samples[*place]), &told.influence);
        });
        let found = found.unwrap();
        for (a, b) in found.fit.coefficients().iter().zip(fitted.fit.coefficients()) {
            assert_close(*a, *b);
        }
        let rows = |fit: &fit::Fit| fit.contributions();
        let parts = [sums.parts(&found.fit), whole.independent_parts(&fitted)];
        assert!(parts[1].exitance.len() > 2 && parts[1].peak.len() > 2);
        let [found_parts, parts] = parts;
        for (a, b) in [
            (rows(&found.fit), rows(&fitted.fit)),
            (found_parts.exitance, parts.exitance),
            (found_parts.intensity, parts.intensity),
            (found_parts.peak, parts.peak),
        ] {
            assert_eq!(a.len(), b.len());
            for (a, b) in a.iter().zip(&b) {
                assert_eq!(a.name, b.name);
                assert_close(a.u, b.u);
            }
        }
        let nuisances = &fitted.fit.weighed().unwrap().nuisances;
        assert!(nuisances.len() > 3 && found.nuisances.len() == nuisances.len());
        for (a, b) in found.nuisances.iter().zip(nuisances) {
            assert_eq!(a.name, b.name);
            assert_close(a.value, b.value);
            assert_close(a.u, b.u);
        }
        assert_eq!(found.fit.n_used(), fitted.fit.n_used());
    }
}
