//! When it is enough, when more sweeps won't do, and what is the largest part of what is left.

use std::f64::consts::PI;
use std::time::Duration;

use fit::{Contribution, EXTRAPOLATION, Estimate, Fit, TRUNCATION};
use serde::{Deserialize, Serialize};

use super::{Account, State, dark};
use crate::study::percent;

/// A fit that stays this far above what lies between the sweeps can't follow them ...
const STUCK: f64 = 2.0;
/// ... if none of so many rounds brought its error down to this part of what it was before them. One round
/// alone may bring checks to where the field is rough, or too few sweeps for the functions that follow it.
const STUCK_GAIN: f64 = 0.9;
const STUCK_ROUNDS: usize = 2;
/// How the dark level's rows of a budget begin.
const DARK: &str = "dark ";

type Of = fn(&Fit) -> Estimate;

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Whether all targets were met.
    pub is_met: bool,
    /// One sentence.
    pub why: String,
    /// The largest part of the error that is left, and how large it is.
    pub largest: Option<(String, f64)>,
}

impl State<'_> {
    /// The verdict on targets that are met, all of them if there are several.
    pub(super) fn met(&self, account: &Account) -> Option<Verdict> {
        let mut said = Vec::new();
        if let Some(asked) = self.terms.adaptive.radiance_relative {
            let upper = account.checked_upper_relative?.max(account.between_relative?);
            if libm::hypot(upper, account.dark_relative?) > asked {
                return None;
            }
            said.push(format!(
                "radiance to {} by the checks (below {} with 90 % confidence) and {} by what lies \
                 between the sweeps, asked {}",
                percent(account.checked_relative?),
                percent(account.checked_upper_relative?),
                percent(account.between_relative?),
                percent(asked)
            ));
        }
        if let Some(asked) = self.terms.adaptive.exitance_relative {
            let u = account.exitance_u_relative?;
            if u > asked {
                return None;
            }
            said.push(format!("exitance to {}, asked {}", percent(u), percent(asked)));
        }
        if let Some(asked) = self.terms.adaptive.exitance_within_region_relative {
            let u = account.exitance_within_region_u_relative?;
            if u > asked {
                return None;
            }
            let (u, asked) = (percent(u), percent(asked));
            said.push(format!(
                "exitance within the region to {u} without the scale, asked {asked}"
            ));
        }
        let Account { round, sweeps, .. } = account;
        let s = if *round == 1 { "" } else { "s" };
        let why = format!("{} after {sweeps} sweeps in {round} round{s}", said.join(", "));
        Some(Verdict { is_met: true, why, largest: None })
    }

    /// The verdict on targets that more sweeps won't meet.
    pub(super) fn hopeless(&self, account: &Account) -> Option<Verdict> {
        let not_met = |why: String, largest| Some(Verdict { is_met: false, why, largest });
        let adaptive = &self.terms.adaptive;
        let fit = self.whole.as_ref();
        let shape = fit.map(|fit| fit.without_scale(&self.calibrated.scales()));
        let of_exitance = [
            (
                adaptive.exitance_relative,
                fit.map(|fit| (fit.exitance(), fit.contributions())),
                "exitance",
            ),
            (
                adaptive.exitance_within_region_relative,
                shape.map(|fit| (fit.exitance_within_region(), fit.contributions_within_region())),
                "exitance within the region without the scale",
            ),
        ];
        // Of a fit that does not follow the field yet, poses seem to matter more than they do.
        let is_followed = adaptive.radiance_relative.is_none_or(|asked| follows(asked, account));
        for (asked, found, what) in of_exitance.into_iter().filter(|_| is_followed) {
            if let (Some(asked), Some((estimate, parts))) = (asked, found)
                && let Some((name, shared)) = self.shared(estimate.value, parts)
                && shared > asked
            {
                let (asked, u) = (percent(asked), percent(shared));
                let why =
                    format!("{what} to {asked} can't be reached: what all readings share is {u}");
                return not_met(why, Some((name, shared)));
            }
        }
        let asked = self.terms.adaptive.radiance_relative?;
        let checked = account.checked_relative.filter(|_| is_stuck(asked, account, self.before))?;
        let why = format!(
            "radiance to {} can't be reached by more sweeps: the fit's functions stay {} off",
            percent(asked),
            percent(checked)
        );
        not_met(why, largest(account))
    }

    /// The relative uncertainty of an exitance by what all readings share, however many there are, and the
    /// largest part of it. `budget` has the independent part first.
    fn shared(&self, value: f64, mut budget: Vec<Contribution>) -> Option<(String, f64)> {
        let mut parts = budget.split_off(1);
        let dark = dark::known(self.calibrated);
        let lessens = dark.is_some_and(|dark| dark::is_noise(self.terms, dark));
        // More sweeps lessen these.
        let is_less = |name: &str| [TRUNCATION, EXTRAPOLATION].contains(&name);
        let is_shared = |name: &str| !(is_less(name) || lessens && name.starts_with(DARK));
        parts.retain(|part| is_shared(&part.name));
        let square: f64 = parts.iter().map(|part| part.u * part.u).sum();
        let largest = parts.iter().max_by(|a, b| a.u.total_cmp(&b.u))?;
        (value > 0.0).then(|| (largest.name.clone(), libm::sqrt(square) / value))
    }

    /// How long the dark level has to be read further, where that is all that is missing.
    pub(super) fn longer_dark(&self, account: &Account) -> Option<Duration> {
        let adaptive = &self.terms.adaptive;
        let level = libm::sqrt(self.between.mean_square());
        let mut parts = Vec::new();
        if let Some(asked) = adaptive.radiance_relative {
            let rest = account.checked_upper_relative?.max(account.between_relative?);
            parts.push(dark::Part { asked, rest, level });
        }
        let fit = self.whole.as_ref();
        let u_offset = dark::known(self.calibrated)?.u_radiance;
        let sine = libm::sin(self.terms.region.theta_max_rad);
        let of_exitance = [
            (adaptive.exitance_relative, account.exitance_u_relative, PI, Fit::exitance as Of),
            (
                adaptive.exitance_within_region_relative,
                account.exitance_within_region_u_relative,
                PI * sine * sine,
                Fit::exitance_within_region,
            ),
        ];
        for (asked, found, throughput, of) in of_exitance {
            let Some(asked) = asked else { continue };
            let level = of(fit?).value / throughput;
            let offset = u_offset / level;
            let rest = libm::sqrt((found?.powi(2) - offset * offset).max(0.0));
            parts.push(dark::Part { asked, rest, level });
        }
        dark::wanted(self.terms, self.calibrated, &parts)
    }
}

/// The largest part of the radiance's error.
pub(super) fn largest(account: &Account) -> Option<(String, f64)> {
    let between = account.between_relative?;
    let checked = account.checked_relative.unwrap_or(0.0);
    let beyond = libm::sqrt((checked * checked - between * between).max(0.0));
    Some(if beyond > between {
        ("what the fit's functions can't follow".to_owned(), beyond)
    } else {
        ("what lies between the sweeps".to_owned(), between)
    })
}

/// Whether the checks are met as well as is asked, or nearly as well as what lies between the sweeps; true
/// where there are none.
pub(super) fn follows(asked: f64, account: &Account) -> bool {
    let between = account.between_relative.unwrap_or(0.0);
    account.checked_relative.is_none_or(|checked| checked <= asked.max(STUCK * between))
}

/// Whether the checks say that more sweeps won't bring the radiance to what is asked: the fit's functions
/// stay far off what lies between the sweeps.
fn is_stuck(asked: f64, account: &Account, before: &[Account]) -> bool {
    let (Some(checked), Some(between)) = (account.checked_relative, account.between_relative)
    else {
        return false;
    };
    // What the checks' own noise may have added to it does not speak against the functions.
    let upper = account.checked_upper_relative.unwrap_or(checked);
    let least = libm::sqrt((2.0 * checked * checked - upper * upper).max(0.0));
    let is_no_better = |account: &Account| {
        let (error, between) = (account.checked_relative, account.between_relative);
        error
            .zip(between)
            .is_some_and(|(error, between)| error > STUCK * between && checked > STUCK_GAIN * error)
    };
    let rounds = before.len().checked_sub(STUCK_ROUNDS).map(|first| &before[first..]);
    least > asked
        && between <= asked
        && least > STUCK * between
        && rounds.is_some_and(|rounds| rounds.iter().all(is_no_better))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::adaptive::Gaps;

    const GAPS: Gaps =
        Gaps { arc_deg: 5.0, arc_at_a_place_deg: 5.0, x_mm: 1.0, y_mm: 1.0, window_deg: 1.0 };

    /// Rounds by what lies between the sweeps and what the checks say.
    fn rounds(found: &[(f64, Option<f64>)]) -> Vec<Account> {
        let account = |(round, (between, checked)): (usize, &(f64, Option<f64>))| Account {
            round: u32::try_from(round).unwrap() + 1,
            sweeps: 30,
            checks: 7,
            rig_s: 100.0,
            between_relative: Some(*between),
            checked_relative: *checked,
            checked_upper_relative: checked.map(|checked| 1.1 * checked),
            noise_relative: None,
            exitance_u_relative: None,
            exitance_within_region_u_relative: None,
            dark_relative: None,
            gaps: GAPS,
            verdict: None,
        };
        found.iter().enumerate().map(account).collect()
    }

    #[test]
    fn a_fit_that_checks_do_not_bear_out_does_not_follow_yet() {
        let follows_at = |found| follows(0.02, &rounds(&[found])[0]);
        assert!(follows_at((0.05, None)) && follows_at((0.001, Some(0.019))));
        assert!(follows_at((0.02, Some(0.035))));
        assert!(!follows_at((0.0176, Some(0.0426))) && !follows_at((0.001, Some(0.021))));
    }

    #[test]
    fn more_sweeps_are_given_up_when_two_rounds_brought_nothing() {
        let is_stuck_at = |found: &[(f64, Option<f64>)]| {
            let accounts = rounds(found);
            let (last, before) = accounts.split_last().unwrap();
            is_stuck(0.02, last, before)
        };
        let far = |checked: f64| (0.01, Some(checked));
        assert!(is_stuck_at(&[far(0.07), far(0.07), far(0.07)]));
        assert!(is_stuck_at(&[(0.05, None), far(0.07), far(0.072), far(0.066)]));
        // A ridge that later rounds followed: checks came to where it is.
        assert!(!is_stuck_at(&[(0.0176, Some(0.0426)), (0.0124, Some(0.077))]));
        assert!(!is_stuck_at(&[(0.0176, Some(0.0664)), (0.0131, Some(0.0622)), far(0.0526)]));
        // Getting better, not far above what lies between, or nearly there.
        assert!(!is_stuck_at(&[far(0.09), far(0.08), far(0.07)]));
        assert!(!is_stuck_at(&[far(0.07), (0.04, Some(0.07)), far(0.07)]));
        assert!(!is_stuck_at(&[far(0.021), far(0.021), far(0.021)]));
        assert!(!is_stuck_at(&[far(0.07), far(0.07)]) && !is_stuck_at(&[far(0.07)]));
    }
}
