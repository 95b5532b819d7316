//! When it is enough, when more sweeps won't do, and what is the largest part of what is left.

use std::f64::consts::PI;
use std::time::Duration;

use fit::{EXTRAPOLATION, Estimate, Fit, TRUNCATION};
use serde::{Deserialize, Serialize};

use super::{Account, State, dark};
use crate::study::percent;

/// A fit that stays this far above what lies between the sweeps, twice, can't follow them ...
const STUCK: f64 = 2.0;
/// ... if a round did not bring its error down to this part.
const STUCK_GAIN: f64 = 0.9;
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
            (adaptive.exitance_relative, fit, "exitance"),
            (
                adaptive.exitance_within_region_relative,
                shape.as_ref(),
                "exitance without the scale",
            ),
        ];
        for (asked, fit, what) in of_exitance {
            if let (Some(asked), Some(fit)) = (asked, fit)
                && let Some((name, shared)) = self.shared(fit)
                && shared > asked
            {
                let (asked, u) = (percent(asked), percent(shared));
                let why =
                    format!("{what} to {asked} can't be reached: what all readings share is {u}");
                return not_met(why, Some((name, shared)));
            }
        }
        let asked = self.terms.adaptive.radiance_relative?;
        let (checked, between) = (account.checked_relative?, account.between_relative?);
        let before = self.before.last()?;
        let (last, last_between) = (before.checked_relative?, before.between_relative?);
        // What the checks' own noise may have added to it does not speak against the functions.
        let upper = account.checked_upper_relative.unwrap_or(checked);
        let least = libm::sqrt((2.0 * checked * checked - upper * upper).max(0.0));
        let is_stuck = least > asked
            && between <= asked
            && least > STUCK * between
            && last > STUCK * last_between
            && checked > STUCK_GAIN * last;
        if !is_stuck {
            return None;
        }
        let why = format!(
            "radiance to {} can't be reached by more sweeps: the fit's functions stay {} off",
            percent(asked),
            percent(checked)
        );
        not_met(why, largest(account))
    }

    /// The exitance's uncertainty by what all readings share, however many there are, and the largest
    /// part of it.
    fn shared(&self, fit: &Fit) -> Option<(String, f64)> {
        let value = fit.exitance().value;
        let mut parts = fit.contributions().split_off(1);
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
