//! The cheapest plan that reaches an accuracy, among those that a person would try: the plan's own
//! schedule denser or thinner, with its fit's degree or with one that goes with the density; sweeps
//! instead of a grid where the plan says how narrow its features are; the nodes of a quadrature rule
//! where exitance and flux are all that is asked; each with the shortest dwell that does, and with
//! longer dark readings where the dark level is what stands in the way.
//!
//! Every candidate is the plan's own text with some keys changed, read and laid out again: what is
//! found is what is written.

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::panic::resume_unwind;
use std::time::Duration;

use spanned_toml::{Problem, Source};

use super::ladder::spacing;
use super::{Demand, Forecast, ForecastError, Motion, Rung, Shortfall};
use crate::plan::{Allocation, Change, Plan, Schedule};
use crate::rig::Rig;

/// Factors on the number of targets.
const DENSITIES: [f64; 9] = [0.25, 0.354, 0.5, 0.707, 1.0, 1.414, 2.0, 2.828, 4.0];
/// Dwells are searched up to this, milliseconds; and from this many ADC readings.
const DWELL_MS_MAX: f64 = 1000.0;
const READINGS_MIN: f64 = 2.0;
/// A dwell that does not fit the rig (a sweep's, say) is tried longer or shorter by this factor.
const DWELL_STEP: f64 = 4.0;
/// Degrees of fits at the nodes of quadrature rules, and in position where the plan says none.
const QUADRATURE_DEGREES: [usize; 7] = [2, 4, 6, 8, 12, 16, 20];
const QUADRATURE_POSITION_DEGREE: usize = 1;
/// Dark readings are lengthened by this factor, up to so many milliseconds.
const DARK_LONGER: f64 = 4.0;
const DARK_MS_MAX: f64 = 120_000.0;
/// How often a dwell is corrected after it was interpolated, and by how much.
const CORRECTIONS: u32 = 4;
const CORRECTION: f64 = 1.1;

/// What a search starts from.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// Its rig.
    pub rig: &'a Rig,
    /// Its list of poses, if it has one.
    pub list: Option<&'a Source>,
    /// What is asked.
    pub demand: Demand,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Found {
    /// The cheapest that reaches all targets.
    pub best: Option<Candidate>,
    /// All that were looked at closely, the plan itself first.
    pub considered: Vec<Considered>,
    /// How many were left out, since moving alone takes them longer than the best.
    pub dearer: usize,
    /// Where none reaches them: what the one that comes nearest still misses, with the longest
    /// dwell.
    pub floor: Option<Shortfall>,
}

/// A plan that was tried.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// What was done to the plan, in words.
    pub what: String,
    /// Its text.
    pub text: String,
    /// Its dwell, milliseconds.
    pub dwell_ms: f64,
    /// Its rig time, seconds.
    pub time_s: f64,
    /// What it is going to know.
    pub forecast: Forecast,
}

/// A line of the table of what was considered.
#[derive(Debug, Clone, PartialEq)]
pub struct Considered {
    /// What was done to the plan, in words.
    pub what: String,
    /// The dwell with which it stands here, milliseconds.
    pub dwell_ms: f64,
    /// Its rig time with that, seconds.
    pub time_s: f64,
    /// Relative u of the exitance, without truncation's sign; by the demand's word on the scale.
    pub u_exitance: f64,
    /// Relative u of the radiance.
    pub u_radiance: f64,
    /// Whether it reaches all targets.
    pub meets: bool,
}

/// A way to change the plan, but for its dwell.
struct Variant {
    what: String,
    changes: Vec<Change>,
    /// The rig time with the shortest dwell, seconds.
    least_s: f64,
}

/// How far a search has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looked {
    /// Plans that were looked at, or left out.
    pub done: usize,
    /// Those that are to be looked at, as far as is known.
    pub left: usize,
    /// Rig time of the best so far that reaches all targets, seconds.
    pub best_s: Option<f64>,
}

impl Search<'_> {
    /// Looks for it, at so many plans at once as `threads` says; what is found does not depend on that.
    /// `watch` hears after every few plans. The error is the plan's own: of its layout, or of its fit.
    pub fn run(
        &self,
        threads: NonZeroUsize,
        watch: &mut dyn FnMut(Looked),
    ) -> Result<Found, SearchError> {
        let itself = self.itself()?;
        let meets = self.demand.ratio(&itself.forecast) <= 1.0;
        let mut found = Found {
            considered: vec![self.considered(&itself, meets)],
            best: meets.then(|| itself.clone()),
            dearer: 0,
            floor: None,
        };
        let mut nearest = itself;
        let mut variants = VecDeque::from(self.variants());
        let mut done = 0;
        while !variants.is_empty() {
            let (best_s, left) = (found.best.as_ref().map(|best| best.time_s), variants.len());
            watch(Looked { done, left, best_s });
            let next: Vec<Variant> = variants.drain(..threads.get().min(left)).collect();
            done += next.len();
            // One that turns out to be dearer than another of these was looked at in vain.
            let looked = self.shortest_of(&next, best_s);
            for (variant, looked) in next.iter().zip(looked) {
                if found.best.as_ref().is_some_and(|best| variant.least_s >= best.time_s) {
                    found.dearer += 1;
                    continue;
                }
                let Some((candidate, meets)) = looked else { continue };
                found.considered.push(self.considered(&candidate, meets));
                if meets {
                    if found.best.as_ref().is_none_or(|best| candidate.time_s < best.time_s) {
                        variants.extend(self.with_dwells_where_they_count(variant));
                        found.best = Some(candidate);
                    }
                    continue;
                }
                variants.extend(self.in_longer_dark(variant, &candidate));
                if self.demand.ratio(&candidate.forecast) < self.demand.ratio(&nearest.forecast) {
                    nearest = candidate;
                }
            }
        }
        if found.best.is_none() {
            found.floor = self.demand.shortfall(&nearest.forecast);
        }
        Ok(found)
    }

    fn itself(&self) -> Result<Candidate, SearchError> {
        let text = self.plan.document().source().text().to_owned();
        let sequence = self.plan.lay_out(self.rig, self.list)?;
        let forecast = Forecast::of(self.plan, self.rig, &sequence)?;
        let (time_s, dwell_ms) = (sequence.prediction.total_s(), ms(self.plan.dwell));
        Ok(Candidate { what: "the plan itself".to_owned(), text, dwell_ms, time_s, forecast })
    }

    /// The variants, the quickest first.
    fn variants(&self) -> Vec<Variant> {
        let mut variants = Vec::new();
        for density in DENSITIES {
            let plan = Rung { density, ..Rung::ITSELF }.apply(self.plan);
            let mut degrees = vec![self.plan.fit.angular_degree, plan.fit.angular_degree];
            degrees.dedup();
            for degree in degrees {
                let mut changes = spacing(&plan.schedule);
                let mut what = format!("density {density}");
                if let Some(degree) = degree {
                    what = format!("{what}, degree {degree}");
                    if Some(degree) != self.plan.fit.angular_degree {
                        changes.push(Change::set("fit", "angular_degree", degree));
                    }
                }
                variants.push((what.clone(), changes.clone()));
                if let Some(sweep) = self.as_sweep(&plan) {
                    changes.retain(|change| change.table != "schedule");
                    changes.extend(sweep);
                    variants.push((format!("sweeps, {what}"), changes));
                }
            }
            if self.plan.list_file().is_some() {
                break;
            }
        }
        variants.extend(self.quadratures());
        let of = |(what, changes)| self.variant(what, changes);
        let mut variants: Vec<Variant> = variants.into_iter().filter_map(of).collect();
        variants.sort_by(|a, b| a.least_s.total_cmp(&b.least_s));
        variants
    }

    fn variant(&self, what: String, changes: Vec<Change>) -> Option<Variant> {
        let (plan, _) = self.with(&changes, self.dwell_ms_min())?;
        let sequence = plan.lay_out(self.rig, self.list).ok();
        // Windows this short may be more than the wire carries: no reason to leave it out.
        let least_s = sequence.map_or(0.0, |s| s.prediction.total_s());
        Some(Variant { what, changes, least_s })
    }

    /// Product rules, and fits of the degrees whose squares they integrate: the fit's exitance is then
    /// the rule's, and right for fields of twice its degree.
    fn quadratures(&self) -> Vec<(String, Vec<Change>)> {
        let is_sum = self.demand.radiance.is_none();
        let is_grid = !matches!(
            self.plan.schedule,
            Schedule::Adaptive(_) | Schedule::List { .. } | Schedule::Quadrature { .. }
        );
        if !(is_sum && is_grid) {
            return Vec::new();
        }
        let places = self.plan.fit.position_degree.unwrap_or(QUADRATURE_POSITION_DEGREE) + 1;
        let of = |degree: usize| {
            let (theta_count, phi_count) = (degree / 2 + 1, 2 * degree + 2);
            let gone = [
                "count",
                "theta_step_deg",
                "gamma_step_deg",
                "c_step_deg",
                "phi_step_deg",
                "speed_deg_per_s",
                "narrowest_feature_deg",
            ];
            let mut changes: Vec<Change> =
                gone.into_iter().map(|key| Change::remove("schedule", key)).collect();
            changes.push(Change::set("schedule", "kind", "\"quadrature\""));
            changes.push(Change::set("schedule", "x_count", places));
            changes.push(Change::set("schedule", "y_count", places));
            changes.push(Change::set("schedule", "theta_count", theta_count));
            changes.push(Change::set("schedule", "phi_count", phi_count));
            changes.push(Change::set("fit", "angular_degree", degree));
            changes.push(Change::set("fit", "position_degree", places - 1));
            (format!("quadrature {theta_count} x {phi_count}, degree {degree}"), changes)
        };
        QUADRATURE_DEGREES.into_iter().map(of).collect()
    }

    /// The variant with dwells that follow what is expected, where the plan says that and leaves them
    /// alike, and rests at its targets.
    fn with_dwells_where_they_count(&self, variant: &Variant) -> Option<Variant> {
        let is_shaped =
            self.plan.expect.level.is_some() && self.plan.expect.beam_angle_rad.is_some();
        let is_done = variant.changes.iter().any(|change| change.key == "allocation");
        let (plan, _) = self.with(&variant.changes, self.dwell_ms_min())?;
        let is_open =
            plan.allocation == Allocation::Even && Motion::of(&plan.schedule) == Motion::StopAndGo;
        if !is_shaped || is_done || !is_open {
            return None;
        }
        let mut changes = variant.changes.clone();
        changes.push(Change::set("dwell", "allocation", "\"total\""));
        self.variant(format!("{}, dwells by what is expected", variant.what), changes)
    }

    /// The variant with longer dark readings, where it misses by the dark level most.
    fn in_longer_dark(&self, variant: &Variant, missing: &Candidate) -> Option<Variant> {
        let most = self.demand.shortfall(&missing.forecast)?;
        let known = variant.changes.iter().find(|change| change.table == "dark");
        let dark_ms = match known.and_then(|change| change.value.as_ref()?.parse().ok()) {
            Some(dark_ms) => dark_ms,
            None => ms(self.plan.dark.dwell),
        } * DARK_LONGER;
        if !most.largest.starts_with("dark") || dark_ms > DARK_MS_MAX {
            return None;
        }
        let what = match variant.what.split_once(", dark") {
            Some((what, _)) => what,
            None => &variant.what,
        };
        let mut changes: Vec<Change> =
            variant.changes.iter().filter(|change| change.table != "dark").cloned().collect();
        changes.push(Change::set("dark", "dwell_ms", dark_ms));
        self.variant(format!("{what}, dark {} s", dark_ms / 1e3), changes)
    }

    /// Sweeps along meridians instead of a grid of directions, where the plan says how narrow its
    /// features are.
    fn as_sweep(&self, plan: &Plan) -> Option<Vec<Change>> {
        let is_grid = matches!(plan.schedule, Schedule::CGamma { .. } | Schedule::Raster { .. });
        let is_known = self.plan.expect.narrowest_feature_rad.is_some();
        if is_grid && is_known { Motion::Sweep.changes(plan) } else { None }
    }

    /// [`shortest`](Self::shortest) of each, but for those that take longer than the best, one to a thread.
    fn shortest_of(
        &self,
        variants: &[Variant],
        best_s: Option<f64>,
    ) -> Vec<Option<(Candidate, bool)>> {
        let is_dearer = |variant: &Variant| best_s.is_some_and(|best_s| variant.least_s >= best_s);
        let one = |variant: &Variant| {
            if is_dearer(variant) { None } else { self.shortest(variant) }
        };
        std::thread::scope(|scope| {
            let begin = |variant| scope.spawn(move || one(variant));
            let threads: Vec<_> = variants.iter().map(begin).collect();
            let ended = threads.into_iter().map(std::thread::ScopedJoinHandle::join);
            ended.map(|found| found.unwrap_or_else(|panic| resume_unwind(panic))).collect()
        })
    }

    /// The variant with the shortest dwell that reaches all targets, or with the longest if none
    /// does, and whether it does.
    fn shortest(&self, variant: &Variant) -> Option<(Candidate, bool)> {
        let ratio = |candidate: &Candidate| self.demand.ratio(&candidate.forecast);
        let low = self.nearest_to(variant, self.dwell_ms_min(), DWELL_STEP)?;
        if ratio(&low) <= 1.0 {
            return Some((low, true));
        }
        let high = self.nearest_to(variant, DWELL_MS_MAX, 1.0 / DWELL_STEP)?;
        if ratio(&high) > 1.0 {
            return Some((high, false));
        }
        // u² is a constant and a part that falls as one over the dwell.
        let (from, to) = (1.0 / low.dwell_ms, 1.0 / high.dwell_ms);
        let slope = (ratio(&low).powi(2) - ratio(&high).powi(2)) / (from - to);
        let constant = ratio(&high).powi(2) - slope * to;
        let mut dwell_ms = (slope / (1.0 - constant)).clamp(low.dwell_ms, high.dwell_ms);
        for _ in 0..CORRECTIONS {
            match self.candidate(variant, dwell_ms) {
                Some(candidate) if ratio(&candidate) <= 1.0 => return Some((candidate, true)),
                _ => dwell_ms *= CORRECTION,
            }
        }
        Some((high, true))
    }

    /// The variant with a dwell as near to this as the rig can.
    fn nearest_to(&self, variant: &Variant, mut dwell_ms: f64, step: f64) -> Option<Candidate> {
        while (self.dwell_ms_min()..=DWELL_MS_MAX).contains(&dwell_ms) {
            if let Some(candidate) = self.candidate(variant, dwell_ms) {
                return Some(candidate);
            }
            dwell_ms *= step;
        }
        None
    }

    fn candidate(&self, variant: &Variant, dwell_ms: f64) -> Option<Candidate> {
        let (plan, text) = self.with(&variant.changes, dwell_ms)?;
        let sequence = plan.lay_out(self.rig, self.list).ok()?;
        let (time_s, dwell_ms) = (sequence.prediction.total_s(), ms(plan.dwell));
        // Asked first: a forecast costs far more than the time does.
        if plan.stop.rig_time_max.is_some_and(|most| time_s > most.as_secs_f64()) {
            return None;
        }
        let forecast = Forecast::of(&plan, self.rig, &sequence).ok()?;
        Some(Candidate { what: variant.what.clone(), text, dwell_ms, time_s, forecast })
    }

    /// The plan with these changes and this dwell, if its text can be changed so.
    fn with(&self, changes: &[Change], dwell_ms: f64) -> Option<(Plan, String)> {
        let mut changes = changes.to_vec();
        let dwell_ms = rounded_up(dwell_ms);
        changes.push(Change::set("dwell", "dwell_ms", dwell_ms));
        changes.push(Change::remove("schedule", "window_ms"));
        let plan = self.plan.changed(&changes)?;
        let text = plan.document().source().text().to_owned();
        // A text that could not be changed is read as it was.
        ((ms(plan.dwell) - dwell_ms).abs() < 1e-3 + 1e-6 * dwell_ms).then_some((plan, text))
    }

    fn dwell_ms_min(&self) -> f64 {
        READINGS_MIN * 1e3 / f64::from(self.rig.detector.adc.rate_hz)
    }

    fn considered(&self, candidate: &Candidate, meets: bool) -> Considered {
        let Forecast { of_exitance, of_radiance, .. } = &candidate.forecast;
        let u = |budget: &super::Budget| {
            if self.demand.without_scale { budget.u_without_scale() } else { budget.u() }
        };
        Considered {
            what: candidate.what.clone(),
            dwell_ms: candidate.dwell_ms,
            time_s: candidate.time_s,
            u_exitance: u(of_exitance),
            u_radiance: u(of_radiance),
            meets,
        }
    }
}

/// Why there is nothing to search from.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// The plan can't be laid out.
    #[error(transparent)]
    Plan(#[from] Problem),
    /// Nothing can be foretold of it.
    #[error(transparent)]
    Forecast(#[from] ForecastError),
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

/// To three digits, which a person reads; to whole microseconds at least.
fn rounded_up(dwell_ms: f64) -> f64 {
    let decimals = 2.0 - libm::floor(libm::log10(dwell_ms));
    let factor = libm::pow(10.0, decimals.clamp(0.0, 3.0));
    libm::ceil(dwell_ms * factor - 1e-6) / factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan_by;

    #[test]
    fn what_is_found_does_not_depend_on_how_many_are_looked_at_at_once() {
        let raster =
            "kind = \"raster\"\nx_count = 2\ny_count = 2\ntheta_step_deg = 20\nphi_step_deg = 30";
        let plan = plan_by(raster, "angular_degree = 4\nposition_degree = 1");
        let rig = Rig::built_in().unwrap();
        let demand = Demand { radiance: Some(8e-6), without_scale: true, ..Demand::default() };
        let search = Search { plan: &plan, rig: &rig, list: None, demand };
        let found = |threads: usize| {
            let mut heard = Vec::new();
            let threads = NonZeroUsize::new(threads).unwrap();
            let found = search.run(threads, &mut |looked| heard.push(looked)).unwrap();
            (found, heard)
        };
        let (one, heard) = found(1);
        let best = one.best.clone().unwrap();
        assert!(one.considered.len() > 1 && one.dearer > 5, "{:?}", one.considered);
        let last = heard.last().unwrap();
        assert!(last.best_s == Some(best.time_s) && last.done >= one.considered.len() - 1);
        for threads in [2, 5, 100] {
            let (several, _) = found(threads);
            assert_eq!(several.considered, one.considered, "{threads}");
            assert_eq!(several.dearer, one.dearer, "{threads}");
            let again = several.best.unwrap();
            assert_eq!(
                (again.text, again.time_s.to_bits()),
                (best.text.clone(), best.time_s.to_bits())
            );
        }
    }
}
