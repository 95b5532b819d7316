//! `gonio daemon`: puts the rig together, gives it a thread, and opens the daemon's door.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use super::acquire::{Pace, openers_of};
use super::args::DaemonArgs;
use super::client::default_address;
use super::failure::{Failure, Outcome};
use super::inputs::Inputs;
use super::output::note;
use super::session::draw_session;
use super::setup::{no_scene, rig_at, stage_at};
use super::shop::Shop;
use super::simulated::StopSignals;
use crate::daemon::{Address, Config, Daemon, DaemonError, RigThread, Shutdown};
use crate::journal::EffectWishes;
use crate::run::own;

/// Owns a rig until it is told to stop.
pub(crate) fn daemon(args: &DaemonArgs) -> Outcome {
    let shop = open_shop(args)?;
    let listen = match &args.listen {
        Some(text) => Address::parse(text).map_err(Failure::start)?,
        None => default_address(&args.data)?,
    };
    let config = Config { data: args.data.clone(), listen };
    let runtime = Pace::Real.runtime()?;
    let rig = start_rig(&shop)?;
    let served = runtime.block_on(serve(&config, shop, &rig));
    // Results that are still being written are written again after a continue.
    runtime.shutdown_background();
    rig.end();
    served
}

fn open_shop(args: &DaemonArgs) -> Result<Shop, Failure> {
    let mut inputs = Inputs::from_disk();
    let rig = rig_at(&mut inputs, &args.rig)?;
    let stage = match (&args.scene, rig.is_simulated()) {
        (Some(scene), true) => {
            Some(stage_at(&mut inputs, scene, &rig, &args.effects.terms(args.seed))?)
        }
        (None, false) => None,
        (None, true) => {
            return Err(no_scene(&rig));
        }
        (Some(scene), false) => {
            return Err(Failure::with_help(
                format!("--scene {}: {} is a real rig", scene.display(), rig.name),
                "leave --scene out, or choose a simulated rig with --rig",
            ));
        }
    };
    // The rig is compiled when the daemon begins, before any plan.
    let wishes = EffectWishes { ignores_plan: true, ..args.effects.wishes() };
    Ok(Shop { rig, stage, inputs: inputs.read().to_vec(), seed: args.seed, wishes })
}

fn start_rig(shop: &Shop) -> Result<RigThread, Failure> {
    let (rig, stage) = (Arc::new(shop.rig.clone()), shop.stage.clone());
    RigThread::start(move || {
        let opener = openers_of(stage.as_ref(), &rig);
        own(rig, opener, draw_session())
    })
    .map_err(|error| Failure::start(format!("the rig's thread: {error}")))
}

async fn serve(config: &Config, shop: Shop, rig: &RigThread) -> Outcome {
    let mut signals =
        StopSignals::new().map_err(|error| Failure::start(format!("signals: {error}")))?;
    let shutdown = Shutdown::default();
    let simulated = if shop.rig.is_simulated() { " (simulated)" } else { "" };
    let name = shop.rig.name.clone();
    let daemon = Daemon::open(config, shop, rig.owner(), shutdown.clone())
        .await
        .map_err(|error| explain(&error, &config.data))?;
    note(&format!("{name}{simulated}: listening at {}", daemon.address()));
    tokio::spawn(async move {
        signals.next().await;
        note("bringing the axes to rest; once more stops at once");
        shutdown.gently.cancel();
        signals.next().await;
        shutdown.at_once.cancel();
    });
    daemon.serve().await.map_err(Failure::midway)?;
    Ok(ExitCode::SUCCESS)
}

fn explain(error: &DaemonError, data: &Path) -> Failure {
    match error {
        DaemonError::Data { .. } | DaemonError::Queue(_) => Failure::with_help(
            error,
            format!("choose another data folder than {} with --data", data.display()),
        ),
        DaemonError::Listen(_) | DaemonError::Server(_) => Failure::start(error),
    }
}
