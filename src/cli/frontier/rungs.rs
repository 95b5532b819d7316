//! The plans of a frontier: strategies times rungs, each a text of its own, laid out on the rig and
//! foretold before any of them runs.

use crate::cli::args::FrontierArgs;
use crate::cli::failure::Failure;
use crate::cli::outlook::outlook;
use crate::cli::output::note;
use crate::cli::setup::Setup;
use crate::journal::EffectWishes;
use crate::study::{Foretold, LADDER, Motion, Rung};

/// Plans of a frontier at most.
const RUNGS_MAX: usize = 500;

/// One plan of the frontier.
pub(super) struct Entry {
    pub(super) motion: Motion,
    pub(super) rung: Rung,
    /// With the first seed.
    pub(super) setup: Setup,
    pub(super) foretold: Foretold,
}

impl Entry {
    /// The rung's, and what was wanted of the simulated effects.
    pub(super) fn parameters(&self) -> String {
        parameters(self.rung, &self.setup.wishes)
    }
}

fn parameters(rung: Rung, wishes: &EffectWishes) -> String {
    let EffectWishes { tolerance, force, without, .. } = wishes;
    let mut words = vec![rung.parameters()];
    words.extend(tolerance.map(|tolerance| format!("tolerance={tolerance}")));
    words.extend(force.iter().map(|effect| format!("force={effect}")));
    words.extend(without.iter().map(|effect| format!("without={effect}")));
    words.join(" ")
}

/// What is to be run. What a rung of the plan's own strategy, or of one that was asked for, can't do
/// ends it here; a rung of another is left out, and said to be.
pub(super) fn entries(setup: &Setup, args: &FrontierArgs) -> Result<Vec<Entry>, Failure> {
    let mut entries = Vec::new();
    for motion in Motion::ALL {
        let is_own = motion == Motion::of(&setup.plan.schedule);
        let is_asked = args.strategies.contains(&motion);
        // What decides by itself takes its time to: only where it is asked for.
        let is_default = args.strategies.is_empty() && (is_own || motion != Motion::Adaptive);
        if !(is_asked || is_default) {
            continue;
        }
        for rung in rungs(args, motion)? {
            match entry(setup, motion, rung) {
                Ok(entry) => entries.push(entry),
                Err(failure) if is_own || is_asked => return Err(failure),
                Err(failure) => {
                    let (name, rung) = (motion.name(), rung.parameters());
                    note(&format!("left out: {name}, {rung}\n{}", failure.text()));
                }
            }
        }
    }
    Ok(entries)
}

/// The ladder, or every combination of the factors that were given.
fn rungs(args: &FrontierArgs, motion: Motion) -> Result<Vec<Rung>, Failure> {
    let FrontierArgs { densities, dwells, speeds, .. } = args;
    if densities.is_empty() && dwells.is_empty() && speeds.is_empty() {
        return Ok(LADDER.to_vec());
    }
    let or_itself = |factors: &[f64]| if factors.is_empty() { vec![1.0] } else { factors.to_vec() };
    // Who stands still has no speed: one rung for all of them.
    let speeds = if motion == Motion::Sweep { or_itself(speeds) } else { vec![1.0] };
    let mut rungs = Vec::new();
    for density in or_itself(densities) {
        for dwell in or_itself(dwells) {
            rungs.extend(speeds.iter().map(|&speed| Rung { density, dwell, speed }));
        }
    }
    if rungs.len() > RUNGS_MAX {
        return Err(Failure::with_help(
            format!("{} combinations; at most {RUNGS_MAX}", rungs.len()),
            "give fewer factors to --density, --dwell and --speed",
        ));
    }
    Ok(rungs)
}

fn entry(setup: &Setup, motion: Motion, rung: Rung) -> Result<Entry, Failure> {
    let name = motion.name();
    let changes = motion.changes(&setup.plan).ok_or_else(|| {
        Failure::with_help(
            format!("{name}: the plan's schedule does not say what that needs"),
            "a list of poses has no meridians to fly along, an adaptive schedule no grid: give a plan \
             with a grid or sweeps, or another --strategy",
        )
    })?;
    let plan = setup.plan.changed(&changes).and_then(|plan| rung.text(&plan)).ok_or_else(|| {
        Failure::with_help(
            format!("the plan's text can't be changed to {name}, {}", rung.parameters()),
            "write its tables as [schedule], [dwell] and [fit], each key on a line of its own",
        )
    })?;
    let setup = setup.with_plan(plan, setup.seed)?;
    let is_sweep = motion != Motion::StopAndGo;
    let foretold =
        Foretold::of(is_sweep, &setup.sequence.prediction, outlook(&setup).ok().as_ref());
    Ok(Entry { motion, rung, setup, foretold })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_says_what_was_wanted_of_the_effects() {
        let named = |wishes: &EffectWishes| parameters(LADDER[2], wishes);
        assert_eq!(named(&EffectWishes::default()), LADDER[2].parameters());
        let wishes = EffectWishes {
            tolerance: Some(1e-4),
            force: vec!["finite-beam".into()],
            without: vec!["shot-noise".into(), "read-noise".into()],
            ignores_plan: false,
        };
        assert_eq!(
            named(&wishes),
            "density=1.000 dwell=1.000 tolerance=0.0001 force=finite-beam without=shot-noise \
             without=read-noise"
        );
    }
}
