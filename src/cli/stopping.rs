//! The exitance's uncertainty so far, and the plan's target for it, `exitance_relative` of its
//! `[stop]`: the rule that ends a run once it is met, what is said while the run goes on, and of a run
//! that missed it.
//!
//! A run's first readings are kept and fitted anew at every look. From [`KEPT_MAX`] of them on none is: each is
//! taken in once ([`LiveFit`]), so that a look costs what it costs however many there were. What the functions
//! can't follow then takes a walk through the journal, which has the last word on whether it is enough.

use std::path::{Path, PathBuf};

use fit::{Choice, Chosen, Fit, Ruled};

use super::acquire::Pace;
use super::failure::Failure;
use super::live::LiveFit;
use super::long_results::readings_taken;
use super::long_run::LongRun;
use super::results::{Results, fit_region, optics, targets_planned};
use super::setup::Setup;
use super::text::{duration, percent};
use crate::journal::Reader;
use crate::rig::calibration::{Calibrated, Fitted, calibrate};
use crate::rig::{Reading, ReadingKind, Rig};
use crate::run::{Rule, Said, Watch};
use crate::study::{Reach, Trend};

/// A fit says something about its own misfit from this many samples a coefficient on.
const SAMPLES_PER_COEFFICIENT: usize = 2;
/// Coefficients that a basis chosen from the readings is taken to have, before there are any.
const COEFFICIENTS_CHOSEN: usize = 30;
/// The fit is made anew whenever there are this much more targets: all fits together cost about
/// eleven times the last one.
const GROWTH: f64 = 1.1;
/// Readings that are kept to be fitted anew: some 10 MB with all that is made of them.
const KEPT_MAX: usize = 20_000;
/// The same where fewer don't determine the fit, as of a raster that comes late to its other places: twice as
/// many are tried, and again.
const KEPT_MOST: usize = 80_000;

/// The rule for a run, whose journal may have readings from earlier sessions. In virtual time, where nobody
/// watches and every fit would be waited for, there is none where the plan has no target.
pub(crate) fn rule(setup: &Setup, journal: &Path, pace: Pace) -> Result<Option<Watch>, Failure> {
    let asked = setup.plan.stop.exitance_relative;
    if asked.is_none() && pace == Pace::Virtual {
        return Ok(None);
    }
    let mut target = Target::new(setup, journal, KEPT_MAX);
    for reading in readings_taken(&Reader::open(journal)?) {
        target.take(&reading.map_err(Failure::start)?);
    }
    let rule: Rule = Box::new(move |reading| target.look(reading));
    match pace {
        Pace::Virtual => Ok(Some(Watch::inline(rule))),
        Pace::Real => Watch::threaded(rule)
            .map(Some)
            .map_err(|error| Failure::start(format!("a thread for the stop rule: {error}"))),
    }
}

/// The exitance's combined uncertainty, as far as it is known.
pub(super) struct Target {
    rig: Rig,
    region: fit::Region,
    wish: fit::Wish,
    /// What the wish leaves open, as it was chosen last, and at how many targets.
    chosen: Option<(Chosen, usize)>,
    optics: Option<fit::Optics>,
    /// The plan's target, if it has one.
    asked: Option<f64>,
    planned: usize,
    journal: PathBuf,
    kept_max: usize,
    pub(super) form: Form,
    targets: usize,
    next: usize,
}

/// Where the readings so far are.
pub(super) enum Form {
    Kept(Vec<Reading>),
    Live(Box<LiveFit>),
    /// In the journal alone: of these nothing can be taken in once. A look walks through all of them.
    Journalled,
}

impl Target {
    pub(super) fn new(setup: &Setup, journal: &Path, kept_max: usize) -> Self {
        let wish = setup.plan.fit;
        let coefficients = wish.decided().map_or(COEFFICIENTS_CHOSEN, |model| model.basis.len());
        let first = coefficients.saturating_mul(SAMPLES_PER_COEFFICIENT);
        Self {
            rig: setup.rig.clone(),
            region: fit_region(setup),
            wish,
            chosen: wish.decided().map(|model| (model.into(), usize::MAX)),
            optics: optics(setup),
            asked: setup.plan.stop.exitance_relative,
            planned: targets_planned(setup),
            journal: journal.to_owned(),
            kept_max,
            form: Form::Kept(Vec::new()),
            targets: 0,
            next: first,
        }
    }

    /// What the rule says when this reading is taken.
    fn look(&mut self, reading: &Reading) -> Said {
        self.take(reading);
        if !is_target(reading) || self.targets < self.next {
            return Said::Nothing;
        }
        self.next = grown(self.targets);
        self.so_far(reading.time_s).unwrap_or(Said::Nothing)
    }

    /// Takes a reading without saying anything.
    pub(super) fn take(&mut self, reading: &Reading) {
        self.targets += usize::from(is_target(reading));
        match &mut self.form {
            Form::Kept(readings) => {
                readings.push(reading.clone());
                if readings.len() >= self.kept_max {
                    self.let_go();
                }
            }
            Form::Live(live) => {
                if live.take(&self.rig, reading).is_err() {
                    self.form = Form::Journalled;
                }
            }
            Form::Journalled => {}
        }
    }

    /// Lets go of the readings that were kept, if they foretell the rest, or are too many.
    fn let_go(&mut self) {
        let Form::Kept(readings) = std::mem::replace(&mut self.form, Form::Journalled) else {
            return;
        };
        if let Some(live) = self.begun(&readings) {
            self.form = Form::Live(Box::new(live));
        } else if 2 * self.kept_max <= KEPT_MOST {
            self.kept_max *= 2;
            self.form = Form::Kept(readings);
        }
    }

    fn begun(&mut self, readings: &[Reading]) -> Option<LiveFit> {
        if self.chosen.is_none()
            && let Ok(calibrated) = calibrate(&self.rig, readings)
        {
            self.fitted(&calibrated);
        }
        let (chosen, _) = self.chosen.as_ref()?;
        let asked = (&self.region, chosen.model, self.optics.as_ref());
        LiveFit::begin(&self.rig, readings, asked, &self.wish.rules)
    }

    fn so_far(&mut self, rig_s: f64) -> Option<Said> {
        let trend = self.trend(rig_s)?;
        let Self { asked, targets, planned, .. } = *self;
        Some(match asked {
            Some(asked) if trend.u() <= asked => Said::Enough(format!(
                "exitance to {} after {targets} of {planned} targets",
                percent(asked)
            )),
            _ => Said::SoFar(said_so_far(&trend, asked)),
        })
    }
}

impl Target {
    /// What the functions can't follow, and what others make of where nothing was measured, takes a pass more:
    /// where the rest would be enough, it has the last word.
    pub(super) fn trend(&mut self, rig_s: f64) -> Option<Trend> {
        let asked = self.asked;
        let is_enough = |trend: &Trend| asked.is_some_and(|asked| trend.u() <= asked);
        if let Form::Kept(readings) = &self.form {
            let calibrated = calibrate(&self.rig, readings).ok()?;
            let trend = Trend::of_exitance(rig_s, &self.fitted(&calibrated)?)?;
            if is_enough(&trend) {
                return Trend::of_exitance(rig_s, &self.doubted(&calibrated)?);
            }
            return Some(trend);
        }
        if let Form::Live(live) = &mut self.form {
            match live.fit(&self.rig) {
                Ok(fit) => {
                    let trend = Trend::of_exitance(rig_s, &fit?)?;
                    if !is_enough(&trend) {
                        return Some(trend);
                    }
                }
                Err(_) => self.form = Form::Journalled,
            }
        }
        Trend::of_exitance(rig_s, &self.walked()?)
    }

    /// The fit of all that is in the journal by now, with all that is not known of it.
    fn walked(&self) -> Option<Fit> {
        let reader = Reader::open(&self.journal).ok()?;
        let run = LongRun::open(&self.rig, &reader, &self.wish.rules).ok()?;
        let made = run.fit_wished(&self.region, self.optics.as_ref(), &self.wish);
        Some(made.ok()?.ruled.fit)
    }
}

/// For the line that shows how far a run is.
fn said_so_far(trend: &Trend, asked: Option<f64>) -> String {
    let u = format!("exitance to {}", percent(trend.u()));
    match asked.map(|asked| (percent(asked), trend.reach(asked))) {
        None | Some((_, Reach::Met)) => u,
        Some((asked, Reach::Never)) => format!("{u}; {asked} is out of reach of more readings"),
        Some((asked, Reach::At(seconds))) => {
            format!("{u}; {asked} at about {} of rig time", duration(seconds))
        }
    }
}

/// What more time would bring a run that has ended, in words.
pub(crate) fn in_words(trend: &Trend, setup: &Setup) -> String {
    let twice = format!("twice as long would bring {}", percent(trend.after(2.0)));
    match setup.plan.stop.exitance_relative.map(|asked| (percent(asked), trend.reach(asked))) {
        None | Some((_, Reach::Met)) => twice,
        Some((asked, Reach::Never)) => format!("{twice}; {asked} is out of reach of more readings"),
        Some((asked, Reach::At(seconds))) => {
            format!("{twice}; {asked} takes {}", duration(seconds))
        }
    }
}

/// The same for programs.
pub(crate) fn as_json(trend: &Trend, setup: &Setup) -> serde_json::Value {
    let asked = setup.plan.stop.exitance_relative;
    let target_s = asked.and_then(|asked| match trend.reach(asked) {
        Reach::Met => Some(trend.rig_s),
        Reach::At(seconds) => Some(seconds),
        Reach::Never => None,
    });
    serde_json::json!({
        "u_relative": trend.u(), "u_relative_lasting": trend.lasting,
        "u_relative_after_twice_the_time": trend.after(2.0),
        "target_relative": asked, "target_rig_s": target_s,
    })
}

impl Target {
    /// In the basis chosen last; it is chosen anew whenever there are twice as many targets.
    fn fitted(&mut self, calibrated: &Calibrated) -> Option<Fit> {
        let optics = self.optics.as_ref();
        if let Some((chosen, at)) = &self.chosen
            && self.targets / 2 < *at
        {
            let rules = &self.wish.rules;
            return Some(calibrated.fit_as(&self.region, chosen.model, rules, optics).ok()?.fit);
        }
        let Ruled { fit, choice, .. } =
            calibrated.fit_valued(&self.region, &self.wish, optics).ok()?;
        let chosen = choice.as_ref().and_then(Choice::chosen);
        self.chosen = Some((chosen.unwrap_or_else(|| fit.model().into()), self.targets));
        Some(fit)
    }

    /// The fit in the same basis with all that is not known of it.
    fn doubted(&self, calibrated: &Calibrated) -> Option<Fit> {
        let (chosen, _) = self.chosen.as_ref()?;
        calibrated.fit_known(&self.region, chosen, &self.wish.rules, self.optics.as_ref()).ok()
    }
}

fn is_target(reading: &Reading) -> bool {
    matches!(reading.kind, ReadingKind::Target { .. })
}

fn grown(targets: usize) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // millions at most
    let grown = libm::ceil(targets as f64 * GROWTH) as usize;
    grown.max(targets + 1)
}

/// The exitance's combined relative standard uncertainty; infinite without any light.
fn u_relative(fitted: &Fitted) -> f64 {
    let exitance = fitted.fit.exitance();
    if exitance.value > 0.0 { exitance.u / exitance.value } else { f64::INFINITY }
}

/// What there is to say about a run whose plan asks for an accuracy that it does not have.
pub(crate) fn missed(setup: &Setup, results: &Results) -> Option<String> {
    let asked = setup.plan.stop.exitance_relative?;
    let Ok(fitted) = &results.fitted else {
        return Some("the accuracy target was missed: there is no fit".to_owned());
    };
    let u = u_relative(fitted);
    if u <= asked {
        return None;
    }
    let asked = percent(asked);
    let exitance = fitted.fit.exitance();
    if !u.is_finite() {
        return Some(format!("the accuracy target was missed: no light; expected {asked}"));
    }
    let shared = exitance.u.powi(2) - exitance.u_independent.powi(2);
    let shared = percent(libm::sqrt(shared.max(0.0)) / exitance.value);
    Some(format!(
        "the accuracy target was missed: exitance to {}, expected {asked}\n  help: {shared} are \
         shared by all targets (the detector, the dark level): more of them do not lessen that",
        percent(u)
    ))
}
