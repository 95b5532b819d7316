//! `gonio home`, `jog` and `read`: a rig driven by hand, the daemon's, or one opened for this
//! command.

use std::sync::Arc;
use std::time::Duration;

use super::acquire::{Pace, openers_of};
use super::args::{HandArgs, JogArgs, ReadArgs};
use super::client::Client;
use super::failure::{Failure, Outcome};
use super::inputs::Inputs;
use super::remote::{self, daemon_for, tell_reading, tell_stand};
use super::setup::{Stage, no_scene, rig_at, stage_at};
use crate::daemon::http::body::{ReadingBody, Stands};
use crate::rig::{Pose, Rig, forward};
use crate::run::{HandError, OwnerHandle, Stand, TakeOne, own};
use firmware_protocol::Shutter;

/// Longer than any reading by hand: an hour.
const DWELL_MS_MAX: f64 = 3.6e6;

/// Finds the home marks.
pub(crate) fn home(args: &HandArgs) -> Outcome {
    match whose(args)? {
        Whose::Daemons(client) => remote::home(&client, args),
        Whose::Ours(bench) => {
            let stand = bench.drive(async |owner| owner.home().await)?;
            tell_stand(&bench.stands(&stand), args.json)
        }
    }
}

/// Goes to a pose; what is not given stays as it is.
pub(crate) fn jog(args: &JogArgs) -> Outcome {
    check_target(args)?;
    let bench = match whose(&args.hand)? {
        Whose::Daemons(client) => return remote::jog(&client, args),
        Whose::Ours(bench) => bench,
    };
    let rig = &bench.rig;
    let stand = bench.drive(async |owner| {
        let stand = stand_homed(&owner).await?;
        let from = rig.positions(stand.counts);
        let to = rig.nearest(target(args, forward(from)), from)?;
        owner.jog(rig.counts(to)).await
    })?;
    tell_stand(&bench.stands(&stand), args.hand.json)
}

/// Takes one reading where the axes stand.
pub(crate) fn read(args: &ReadArgs) -> Outcome {
    let bench = match whose(&args.hand)? {
        Whose::Daemons(client) => return remote::read(&client, args),
        Whose::Ours(bench) => bench,
    };
    let one = take_one(args, &bench.rig)?;
    let reading = bench.drive(async |owner| owner.take(one).await)?;
    tell_reading(&ReadingBody::of(&bench.rig, &reading), args.hand.json)
}

/// Who drives the rig.
enum Whose {
    /// A daemon has it.
    Daemons(Client),
    /// Opened for this one command.
    Ours(Box<Bench>),
}

fn whose(args: &HandArgs) -> Result<Whose, Failure> {
    let mut inputs = Inputs::from_disk();
    let rig = args.rig.rig.as_ref().map(|path| rig_at(&mut inputs, path)).transpose()?;
    if let Some(client) = daemon_for(&args.daemon, rig.as_ref())? {
        return Ok(Whose::Daemons(client));
    }
    let rig = rig.ok_or_else(|| {
        Failure::with_help("no rig to drive", "give one with --rig, or --daemon where one owns it")
    })?;
    Ok(Whose::Ours(Box::new(Bench::of(args, inputs, rig)?)))
}

/// The pose that is asked for.
fn target(args: &JogArgs, at: Pose) -> Pose {
    Pose {
        x_m: args.x_mm.map_or(at.x_m, |x| x / 1e3),
        y_m: args.y_mm.map_or(at.y_m, |y| y / 1e3),
        theta_rad: args.theta_deg.map_or(at.theta_rad, f64::to_radians),
        phi_rad: args
            .phi_deg
            .map_or(at.phi_rad, |phi| radiometry::direction::wrap(phi.to_radians())),
    }
}

fn check_target(args: &JogArgs) -> Result<(), Failure> {
    let values = [args.theta_deg, args.phi_deg, args.x_mm, args.y_mm];
    if values.iter().all(Option::is_none) {
        return Err(Failure::with_help(
            "nowhere to go",
            "give --theta-deg, --phi-deg, --x-mm or --y-mm",
        ));
    }
    if let Some(bad) = values.into_iter().flatten().find(|value| !value.is_finite()) {
        return Err(Failure::start(format!("{bad}: expected a finite number")));
    }
    match args.theta_deg {
        Some(theta) if !(0.0..=90.0).contains(&theta) => Err(Failure::with_help(
            format!("--theta-deg {theta}: expected 0 to 90"),
            "a direction on the other side is the same θ at φ + 180°",
        )),
        _ => Ok(()),
    }
}

fn take_one(args: &ReadArgs, rig: &Rig) -> Result<TakeOne, Failure> {
    if !(args.dwell_ms > 0.0 && args.dwell_ms <= DWELL_MS_MAX) {
        return Err(Failure::start(format!(
            "--dwell-ms {}: expected above 0 and at most {DWELL_MS_MAX}",
            args.dwell_ms
        )));
    }
    let gain = match &args.gain {
        None => 0,
        Some(name) => rig.detector.gain_index(name).ok_or_else(|| {
            let names: Vec<&str> = rig.detector.gains.iter().map(|g| g.name.as_str()).collect();
            Failure::start(format!("--gain {name}: expected one of {}", names.join(", ")))
        })?,
    };
    let dwell = Duration::from_secs_f64(args.dwell_ms / 1e3);
    Ok(TakeOne { gain, dwell, shutter: Shutter::Open })
}

async fn stand_homed(owner: &OwnerHandle) -> Result<Stand, HandError> {
    let stand = owner.look().await?;
    if stand.is_homed { Ok(stand) } else { owner.home().await }
}

/// A rig opened for one command.
struct Bench {
    rig: Rig,
    stage: Option<Stage>,
}

impl Bench {
    fn of(args: &HandArgs, mut inputs: Inputs, rig: Rig) -> Result<Self, Failure> {
        if !rig.is_simulated() {
            return Ok(Self { rig, stage: None });
        }
        let scene = args.rig.scene.as_ref().ok_or_else(|| no_scene(&rig))?;
        let stage = stage_at(&mut inputs, scene, &rig, &sim::Terms::seeded(args.rig.seed))?;
        Ok(Self { rig, stage: Some(stage) })
    }

    /// Lets somebody drive the rig, and lets go of it.
    fn drive<T>(
        &self,
        hand: impl AsyncFnOnce(OwnerHandle) -> Result<T, HandError>,
    ) -> Result<T, Failure> {
        let pace = if self.stage.is_some() { Pace::Virtual } else { Pace::Real };
        pace.runtime()?.block_on(async {
            let opener = openers_of(self.stage.as_ref(), &self.rig);
            let (owner, task) = own(Arc::new(self.rig.clone()), opener, pace.session());
            let done = hand(owner.clone()).await;
            owner.shut_down().await;
            drop(owner);
            // The task has nothing to tell but its end.
            let _ = task.await;
            done.map_err(|error| match error {
                HandError::Failed(_) | HandError::Link(_) => Failure::midway(error),
                _ => Failure::start(error),
            })
        })
    }

    fn stands(&self, stand: &Stand) -> Stands {
        Stands::at(self.rig.positions(stand.counts))
    }
}
