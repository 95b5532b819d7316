//! What a run measures next, decided by what it measured so far: sweeps where the field is least
//! known, per second of rig time; checks that the fit has not seen; and when it is enough.
//!
//! A pure function of the plan, the rig and the readings: no clock, no dice, nothing of what is true.
//! Readings that are the same decide the same.

mod between;
mod checked;
mod dark;
mod gaps;
mod scans;
mod verdict;

use std::collections::BTreeSet;
use std::time::Duration;

use fit::{Optics, Region};
use serde::{Deserialize, Serialize};
use spanned_toml::Problem;

use crate::plan::{
    Adaptive, After, Further, Meridian, Plan, Prediction, SWEEPS_MAX, Step, SweepPace, time_of,
};
use crate::rig::calibration::{Calibrated, calibrate};
use crate::rig::{AxisPositions, Latched, Reading, Rig};
use between::Between;
use checked::{Checked, checked};
use scans::{Scan, scans};
use verdict::{follows, largest};

pub use gaps::Gaps;
pub use verdict::Verdict;

/// A round takes this part of the time so far ...
const GROWTH: f64 = 0.35;
/// ... and this many whole sweeps at least.
const SWEEPS_LEAST: f64 = 4.0;
/// One check for so many other sweeps of a round.
const SWEEPS_PER_CHECK: usize = 4;
/// Checks at most: their names are known by where they are.
const CHECKS_MAX: u32 = 400;
/// The fit is asked once the interpolation's own error is no more than this many times the target.
const FIT_FROM: f64 = 1.5;

/// What a decision rests on beside the readings.
#[derive(Debug, Clone)]
pub struct Terms {
    /// The plan, whose schedule is an adaptive one.
    pub plan: Plan,
    /// Its terms.
    pub adaptive: Adaptive,
    /// The rig.
    pub rig: Rig,
    /// What the fit stands for.
    pub region: Region,
    /// What the detector sees.
    pub optics: Option<Optics>,
    /// The plan's own first; never empty.
    paces: Vec<SweepPace>,
}

/// What was found after a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// The round, from 1.
    pub round: u32,
    /// Sweeps so far.
    pub sweeps: usize,
    /// Of them, those that serve as checks.
    pub checks: usize,
    /// Rig time so far, predicted, homing apart.
    pub rig_s: f64,
    /// Error expected between the sweeps, relative RMS, from each of them left out in turn.
    pub between_relative: Option<f64>,
    /// Error of a fit of all sweeps but the checks, found by the checks; `None` where it was not
    /// asked.
    pub checked_relative: Option<f64>,
    /// What that is below with a confidence of 90 %.
    pub checked_upper_relative: Option<f64>,
    /// Noise of one reading, relative to the radiance's RMS.
    pub noise_relative: Option<f64>,
    /// The exitance's combined uncertainty, where the plan asks for it; `None` while the run goes on where
    /// checks don't bear the fit out.
    pub exitance_u_relative: Option<f64>,
    /// That of the exitance within the region, without the common scale, where the plan asks for it; as
    /// before.
    #[serde(default)]
    pub exitance_within_region_u_relative: Option<f64>,
    /// Uncertainty of the dark level, relative to the radiance's RMS.
    #[serde(default)]
    pub dark_relative: Option<f64>,
    /// What has not been looked at.
    pub gaps: Gaps,
    /// How it ended; `None` while it goes on.
    pub verdict: Option<Verdict>,
}

/// What follows.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// This.
    Measure(Further),
    /// Nothing.
    Enough,
}

impl Terms {
    /// `None` for plans whose schedule is fixed beforehand. The problem is one of the plan: sweeps
    /// that the rig can't fly.
    pub fn new(
        plan: &Plan,
        rig: &Rig,
        region: Region,
        optics: Option<Optics>,
    ) -> Result<Option<Self>, Problem> {
        let Some(adaptive) = plan.adaptive().copied() else { return Ok(None) };
        let paces = plan.sweep_paces(rig)?;
        let (plan, rig) = (plan.clone(), rig.clone());
        Ok(Some(Self { plan, adaptive, rig, region, optics, paces }))
    }

    /// The plan's own.
    fn pace(&self) -> &SweepPace {
        &self.paces[0]
    }

    fn check(&self, j: u32) -> Meridian {
        self.adaptive.check(&self.plan, &self.rig, j)
    }

    /// Where a sweep is, by the counts of turntable and stage: as a round lays it out, the table may
    /// stand half turns off.
    fn stands(&self, meridian: &Meridian) -> [[i32; 3]; 4] {
        [0.0, -1.0, -2.0, 1.0].map(|half_turns| {
            let phi = meridian.phi_rad + half_turns * core::f64::consts::PI;
            let at = AxisPositions([0.0, phi, meridian.x_m, meridian.y_m]);
            let [_, phi, x, y] = self.rig.counts(at).0;
            [phi, x, y]
        })
    }

    /// The next checks that have not been flown.
    fn further_checks(&self, steps: &[Step], count: usize, window: Duration) -> Vec<Meridian> {
        let had: BTreeSet<[i32; 3]> = steps
            .iter()
            .map(|step| {
                let [_, phi, x, y] = step.counts.0;
                [phi, x, y]
            })
            .collect();
        let is_new = |check: &Meridian| !self.stands(check).iter().any(|at| had.contains(at));
        let new = (0..CHECKS_MAX).map(|j| self.check(j)).filter(is_new).take(count);
        new.map(|check| Meridian { window, ..check }).collect()
    }

    /// Where all checks are.
    fn checks(&self) -> BTreeSet<[i32; 3]> {
        (0..CHECKS_MAX).flat_map(|j| self.stands(&self.check(j))).collect()
    }
}

/// Decides. `readings` are those of the run's `steps`, in any order; `before` what was found after
/// the rounds before, in order.
pub fn decide(
    terms: &Terms,
    steps: &[Step],
    readings: &[Reading],
    before: &[Account],
) -> (Account, Choice) {
    looked(terms, steps, readings, before, |state, account| state.judge(account, steps))
        .unwrap_or_else(|account| (*account, Choice::Enough))
}

/// The last word on a run that something else ended, `why`, before it was decided: what its readings
/// say by then. Of `steps` those count that have theirs.
pub fn conclude(
    terms: &Terms,
    steps: &[Step],
    readings: &[Reading],
    before: &[Account],
    why: &str,
) -> Account {
    let taken: BTreeSet<u32> = readings.iter().map(|reading| reading.id).collect();
    let steps: Vec<Step> = steps.iter().filter(|step| taken.contains(&step.id)).copied().collect();
    let last_word = |state: &mut State<'_>, account: &mut Account| {
        account.verdict = Some(state.last_word(account, why.to_owned()));
    };
    let looked = looked(terms, &steps, readings, before, last_word);
    looked.map_or_else(|account| *account, |(account, ())| account)
}

/// What readings show, and what is made of it; an account that ends the run where they show nothing.
fn looked<T>(
    terms: &Terms,
    steps: &[Step],
    readings: &[Reading],
    before: &[Account],
    judge: impl FnOnce(&mut State<'_>, &mut Account) -> T,
) -> Result<(Account, T), Box<Account>> {
    let mut readings = readings.to_vec();
    readings.sort_by_key(|reading| reading.id);
    let round = u32::try_from(before.len()).unwrap_or(u32::MAX);
    let rig_s = time_of(&terms.rig, Latched::ZERO, steps);
    let calibrated = calibrate(&terms.rig, &readings)
        .map_err(|error| nothing(terms, round, rig_s, &error.to_string()))?;
    let scans = scans(terms, steps, &calibrated);
    let Some(between) = Between::new(terms, &scans, round) else {
        return Err(nothing(terms, round, rig_s, "the sweeps so far show no light"));
    };
    let mut account = Account {
        round: round + 1,
        sweeps: scans.len(),
        checks: scans.iter().filter(|scan| scan.is_check).count(),
        rig_s,
        between_relative: Some(between.relative()),
        checked_relative: None,
        checked_upper_relative: None,
        noise_relative: Some(between.noise_relative()),
        exitance_u_relative: None,
        exitance_within_region_u_relative: None,
        dark_relative: dark::known(&calibrated)
            .map(|dark| dark.u_radiance / libm::sqrt(between.mean_square())),
        gaps: Gaps::of(terms, &scans),
        verdict: None,
    };
    let calibrated = &calibrated;
    let mut state = State {
        terms,
        calibrated,
        scans: &scans,
        between,
        before,
        known: None,
        whole: None,
        is_asked: false,
    };
    let made = judge(&mut state, &mut account);
    Ok((account, made))
}

struct State<'s> {
    terms: &'s Terms,
    calibrated: &'s Calibrated,
    scans: &'s [Scan],
    between: Between,
    before: &'s [Account],
    /// The basis that the readings of all but the checks asked for, once they were asked.
    known: Option<fit::Chosen>,
    /// The fit of all readings, once it was asked for.
    whole: Option<fit::Fit>,
    /// Whether fits were asked.
    is_asked: bool,
}

impl State<'_> {
    fn judge(&mut self, account: &mut Account, steps: &[Step]) -> Choice {
        let asked = self.terms.adaptive.radiance_relative;
        let close = asked.is_none_or(|asked| self.between.relative() <= FIT_FROM * asked);
        if close {
            self.ask_fit(account);
        }
        let mut ending = self.met(account).or_else(|| self.hopeless(account));
        if ending.is_none() {
            let wanted = self.next(account, steps);
            match wanted {
                Ok(further) => return Choice::Measure(further),
                Err(why) => ending = Some(self.last_word(account, why)),
            }
        }
        self.ask_whole(account);
        account.verdict = ending;
        Choice::Enough
    }

    /// The verdict where nothing more is measured, whatever was reached: what a person wants to know
    /// at the end, whatever it costs.
    fn last_word(&mut self, account: &mut Account, why: String) -> Verdict {
        if !self.is_asked {
            self.ask_fit(account);
        }
        self.ask_whole(account);
        let largest = largest(account);
        self.met(account).unwrap_or(Verdict { is_met: false, why, largest })
    }

    /// What the checks say of a fit; and the exitance's own uncertainty, if they bear it out. Of a fit that
    /// they don't, nothing follows.
    fn ask_fit(&mut self, account: &mut Account) {
        self.is_asked = true;
        let asked = self.terms.adaptive.radiance_relative;
        if asked.is_some() {
            let mean_square = self.between.mean_square();
            // A fit that is refused says nothing yet; more sweeps determine it.
            let found = checked(self.terms, self.calibrated, self.scans, mean_square);
            if let Ok(Some(Checked { chosen, relative, upper_relative })) = found {
                self.known = Some(chosen);
                account.checked_relative = Some(relative);
                account.checked_upper_relative = Some(upper_relative);
            }
        }
        if asked.is_none_or(|asked| follows(asked, account)) {
            self.ask_whole(account);
        }
    }

    /// What a fit of all readings says of the exitance, where the plan asks for it; once.
    fn ask_whole(&mut self, account: &mut Account) {
        if self.whole.is_some() || !self.terms.adaptive.asks_exitance() {
            return;
        }
        let Terms { plan, region, optics, .. } = self.terms;
        let optics = optics.as_ref();
        // The basis that all but the checks ask for is the one of all: choosing it takes longest.
        let whole = match &self.known {
            Some(known) => self.calibrated.fit_known(region, known, &plan.fit.rules, optics),
            None => self.calibrated.fit(region, &plan.fit, optics).map(|fitted| fitted.fit),
        };
        self.whole = whole.ok();
        account.exitance_u_relative = self.whole.as_ref().and_then(|fit| u(fit.exitance()));
        let shape = self.whole.as_ref().map(|fit| fit.without_scale(&self.calibrated.scales()));
        account.exitance_within_region_u_relative =
            shape.and_then(|fit| u(fit.exitance_within_region()));
    }

    /// The pace of sweeps that are not chosen for their place: the plan's where a value's noise is below
    /// the target, one as much slower as brings it there otherwise, if a sweep may take that long.
    fn pace(&self, span_rad: f64, most_s: f64) -> SweepPace {
        let terms = self.terms;
        let plans = *terms.pace();
        let Some(asked) = terms.adaptive.radiance_relative else { return plans };
        let wanted = (self.between.noise_relative() / asked).powi(2);
        let is_slower = |pace: &&SweepPace| pace.slower_than(&plans) > 1.0;
        let slower = terms.paces.iter().filter(is_slower);
        let mut best = plans;
        for pace in slower.take_while(|pace| pace.sweep_s(span_rad) <= most_s) {
            if best.slower_than(&plans) < wanted {
                best = *pace;
            }
        }
        best
    }

    /// The next round, or why there is none.
    fn next(&mut self, account: &Account, steps: &[Step]) -> Result<Further, String> {
        let terms = self.terms;
        if self.scans.len() >= SWEEPS_MAX {
            return Err(format!("{} sweeps are as many as are decided upon", self.scans.len()));
        }
        let after = After::steps(&terms.rig, steps);
        let so_far_s = time_of(&terms.rig, Latched::ZERO, steps);
        let most = terms.plan.stop.rig_time_max.map_or(f64::INFINITY, |most| most.as_secs_f64());
        let left_s = most - Prediction::homing_s_of(&terms.rig) - so_far_s;
        if let Some(dwell) = self.longer_dark(account) {
            let dwell = dwell.min(Duration::try_from_secs_f64(left_s).unwrap_or_default());
            return if dwell >= terms.plan.dark.dwell {
                Ok(Further::Dark(dwell))
            } else {
                used_up()
            };
        }
        let span_rad = 2.0 * terms.plan.region.theta_max_rad;
        let sweep_s = terms.pace().sweep_s(span_rad);
        let wanted_s = (GROWTH * so_far_s).max(SWEEPS_LEAST * sweep_s).min(left_s);
        let pace = self.pace(span_rad, wanted_s / SWEEPS_LEAST);
        let (window, sweep_s) = (pace.window, pace.sweep_s(span_rad));
        // Of a round's time a part goes to checks, which are whole sweeps.
        let part = 1.0 / (SWEEPS_PER_CHECK as f64 + 1.0);
        let chosen_s = wanted_s * (1.0 - part);
        // Where the interpolation is good enough and the fit is not, its functions lack meridians:
        // whole ones, evenly.
        let asked = terms.adaptive.radiance_relative.unwrap_or(0.0);
        let mut chosen = if self.between.relative() <= asked {
            self.between.evenly(chosen_s / sweep_s, window)
        } else {
            self.between.choose(terms, after.here, chosen_s)
        };
        let count = (chosen.len() / SWEEPS_PER_CHECK).max(1);
        let mut checks = terms.further_checks(steps, count, window);
        while !(chosen.is_empty() && checks.is_empty()) {
            let further = Further::Sweeps(chosen.iter().chain(&checks).copied().collect());
            match terms.plan.lay_out_round(&terms.rig, after, &further) {
                Ok(round) if round.seconds <= left_s => return Ok(further),
                Ok(_) => {}
                Err(problem) => return Err(format!("the rig can't fly what is wanted: {problem}")),
            }
            if chosen.pop().is_none() {
                checks.pop();
            }
        }
        used_up()
    }
}

fn used_up<T>() -> Result<T, String> {
    Err("the plan's time is used up".to_owned())
}

/// Relative, of what is positive.
fn u(estimate: fit::Estimate) -> Option<f64> {
    (estimate.value > 0.0).then(|| estimate.u / estimate.value)
}

/// Nothing can be decided.
fn nothing(terms: &Terms, round: u32, rig_s: f64, why: &str) -> Box<Account> {
    Box::new(Account {
        round: round + 1,
        sweeps: 0,
        checks: 0,
        rig_s,
        between_relative: None,
        checked_relative: None,
        checked_upper_relative: None,
        noise_relative: None,
        exitance_u_relative: None,
        exitance_within_region_u_relative: None,
        dark_relative: None,
        gaps: Gaps::of(terms, &[]),
        verdict: Some(Verdict {
            is_met: false,
            why: format!("nothing can be decided: {why}"),
            largest: None,
        }),
    })
}
