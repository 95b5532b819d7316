//! Runs that decide on the way: the decision put together from the plan's terms, and what was found
//! after each round, in words. How it is decided is [`crate::study::adaptive`]'s.

use std::path::Path;

use serde_json::{Value, json};

use super::acquire::Pace;
use super::failure::Failure;
use super::results::{fit_region, optics};
use super::setup::Setup;
use super::text::{duration, percent, row};
use crate::journal::{self, Order, Reader};
use crate::plan::{After, Step, WARM_UP_IDS_FROM};
use crate::report::Section;
use crate::rig::Reading;
use crate::run::resume::rule_met;
use crate::run::{Decide, Decided, Decider, Next};
use crate::study::adaptive::{Account, Choice, Gaps, Terms, Verdict, conclude, decide};

/// Decides for a run whose journal may have readings from earlier sessions; the setup's sequence holds all
/// steps so far, and its accounts what was decided. `None` if the plan is fixed beforehand.
pub(crate) fn decider(
    setup: &Setup,
    journal: &Path,
    pace: Pace,
) -> Result<Option<Decider>, Failure> {
    let Some(terms) = terms(setup)? else { return Ok(None) };
    let mut deciding = Deciding {
        terms,
        steps: setup.sequence.steps.clone(),
        accounts: setup.accounts.clone(),
        readings: Vec::new(),
    };
    deciding.look(Reader::open(journal)?.readings(Order::Taken)?);
    let decide: Decide = Box::new(move |readings| deciding.decide(readings));
    match pace {
        Pace::Virtual => Ok(Some(Decider::inline(decide))),
        Pace::Real => Decider::threaded(decide)
            .map(Some)
            .map_err(|error| Failure::start(format!("a thread for decisions: {error}"))),
    }
}

fn terms(setup: &Setup) -> Result<Option<Terms>, Failure> {
    Ok(Terms::new(&setup.plan, &setup.rig, fit_region(setup), optics(setup))?)
}

/// The setup of a run that is over, with the last word on it where its plan's limit ended it between
/// two decisions.
pub(crate) fn concluded(mut setup: Setup, reader: &Reader) -> Result<Setup, Failure> {
    let is_judged = setup.accounts.last().is_some_and(|last| last.verdict.is_some());
    if is_judged || setup.plan.adaptive().is_none() {
        return Ok(setup);
    }
    let (Some(why), Some(terms)) = (rule_met(&reader.sessions()?), terms(&setup)?) else {
        return Ok(setup);
    };
    let mut readings = reader.readings(Order::Id)?;
    readings.retain(|reading| reading.id < WARM_UP_IDS_FROM);
    let account = conclude(&terms, &setup.sequence.steps, &readings, &setup.accounts, &why);
    setup.accounts.push(account);
    Ok(setup)
}

struct Deciding {
    terms: Terms,
    steps: Vec<Step>,
    accounts: Vec<Account>,
    readings: Vec<Reading>,
}

impl Deciding {
    /// Readings of the sequence; what was read while warming up, or after a resume, decides nothing,
    /// so that a resumed run decides as one that was never interrupted.
    fn look(&mut self, readings: Vec<Reading>) {
        self.readings.extend(readings.into_iter().filter(|reading| reading.id < WARM_UP_IDS_FROM));
    }

    fn decide(&mut self, readings: Vec<Reading>) -> Result<Decided, String> {
        self.look(readings);
        let number = u32::try_from(self.accounts.len()).unwrap_or(u32::MAX);
        let Terms { plan, rig, .. } = &self.terms;
        let (mut account, choice) =
            decide(&self.terms, &self.steps, &self.readings, &self.accounts);
        let next = match choice {
            Choice::Measure(further) => {
                match plan.lay_out_round(rig, After::steps(rig, &self.steps), &further) {
                    Ok(round) => Next::Measure(round.steps),
                    Err(problem) => {
                        let why = format!("the rig can't fly what is wanted: {problem}");
                        let verdict = Verdict { is_met: false, why: why.clone(), largest: None };
                        account.verdict = Some(verdict);
                        Next::Enough(why)
                    }
                }
            }
            Choice::Enough => {
                let why = account.verdict.as_ref().map(|verdict| verdict.why.clone());
                Next::Enough(why.unwrap_or_default())
            }
        };
        // What can't be written down can't be read back by a resume.
        let text = serde_json::to_string(&account).map_err(|error| error.to_string())?;
        if let Next::Measure(steps) = &next {
            self.steps.extend(steps);
        }
        self.accounts.push(account);
        Ok(Decided { number, account: text, next })
    }
}

/// What a journal's rounds found; one that can't be read is a damaged file.
pub(crate) fn accounts(reader: &Reader) -> Result<Vec<Account>, Failure> {
    let read = |round: &journal::Round| {
        serde_json::from_str(&round.account).map_err(|error| {
            let path = reader.path().display();
            Failure::start(format!("{path}: round {}: {error}", round.number))
        })
    };
    reader.rounds()?.iter().map(read).collect()
}

/// What there is to say about a run that did not reach its plan's targets.
pub(crate) fn missed(setup: &Setup) -> Option<String> {
    setup.plan.adaptive()?;
    let last = setup.accounts.last();
    let Some(Verdict { is_met, why, largest }) = last.and_then(|last| last.verdict.as_ref()) else {
        return Some("the accuracy target was missed: the run is not at its end".to_owned());
    };
    if *is_met {
        return None;
    }
    let mut text = format!("the accuracy target was missed: {why}");
    if let Some((name, part)) = largest {
        text.extend(["\n  help: the largest part is ", name, ", ", &percent(*part)]);
    }
    Some(text)
}

/// Rows of the summary.
pub(crate) fn rows(setup: &Setup) -> Vec<Vec<String>> {
    let mut rows: Vec<Vec<String>> = setup
        .accounts
        .iter()
        .map(|account| row(&format!("round {}", account.round), found(account)))
        .collect();
    if let Some(last) = setup.accounts.last() {
        rows.push(row("not looked at", not_looked_at(setup, &last.gaps)));
    }
    rows
}

fn found(account: &Account) -> String {
    let Account { sweeps, checks, rig_s, .. } = account;
    let said = |part: Option<f64>| part.map_or_else(|| "unknown".to_owned(), percent);
    let mut text = format!(
        "{sweeps} sweeps, {checks} of them checks, {}: between them {}",
        duration(*rig_s),
        said(account.between_relative)
    );
    if let (Some(checked), Some(upper)) = (account.checked_relative, account.checked_upper_relative)
    {
        let (checked, upper) = (percent(checked), percent(upper));
        text.extend(["; by the checks ", &checked, " (below ", &upper, ", 90 %)"]);
    }
    if let Some(u) = account.exitance_u_relative {
        text.extend(["; u of exitance ", &percent(u)]);
    }
    if let Some(u) = account.exitance_within_region_u_relative {
        let dark = account.dark_relative.map_or_else(String::new, percent);
        text.extend([" (within the region, without the scale, ", &percent(u), ")"]);
        text.extend(["; dark level ", &dark]);
    }
    text
}

/// What may have been missed, in one sentence.
fn not_looked_at(setup: &Setup, gaps: &Gaps) -> String {
    let narrowest_feature_deg =
        setup.plan.adaptive().map_or(0.0, |adaptive| adaptive.narrowest_feature_deg);
    let theta_deg = setup.plan.region.theta_max_rad.to_degrees();
    let Gaps { arc_deg, arc_at_a_place_deg, x_mm, y_mm, .. } = gaps;
    let declared = if *arc_deg > narrowest_feature_deg {
        format!(", wider than the {narrowest_feature_deg}° declared")
    } else {
        String::new()
    };
    format!(
        "features narrower than the widest gap between meridians, {arc_deg:.1}° of arc at θ = \
         {theta_deg:.0}°{declared}; at one place alone up to {arc_at_a_place_deg:.1}° from the nearest \
         sweep; between places {x_mm:.1} mm in x, {y_mm:.1} mm in y"
    )
}

/// For programs.
pub(crate) fn as_json(setup: &Setup) -> Value {
    json!({"rounds": setup.accounts, "is_met": missed(setup).is_none()})
}

/// A section of the report.
pub(crate) fn section(setup: &Setup) -> Option<Section> {
    let last = setup.accounts.last()?;
    let ended = last.verdict.as_ref().map(|verdict| format!("It ended: {}.", verdict.why));
    let unseen = format!("Not looked at: {}.", not_looked_at(setup, &last.gaps));
    let estimates = "Between the sweeps: the error expected from each sweep left out in turn. By the \
                     checks: the error of a fit of all other sweeps where the checks read. Both are root \
                     mean squares relative to the radiance's own, without the scale that all readings \
                     share."
        .to_owned();
    let rounds = setup
        .accounts
        .iter()
        .map(|account| format!("Round {}: {}.", account.round, found(account)));
    Some(Section {
        title: "Rounds".to_owned(),
        paragraphs: [Some(estimates), ended, Some(unseen)].into_iter().flatten().collect(),
        items: rounds.collect(),
        ..Section::default()
    })
}
