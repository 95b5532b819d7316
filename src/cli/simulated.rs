//! The simulated device on a byte stream: in this process for a run, or on a pseudo-terminal for
//! anybody (`gonio sim`).

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use firmware_protocol::Device;
use tokio::io::{DuplexStream, duplex};
use tokio::sync::mpsc;
use tokio::time::Instant;

use super::acquire::Pace;
use super::args::SimArgs;
use super::failure::{Failure, Outcome};
use super::inputs::{BUILT_IN, Inputs};
use super::output::{note, say};
use super::session::draw_session;
use super::setup::{Stage, no_scene, rig_at, stage_at};
use super::twins;
use crate::device::{Link, Opener, Openers, opener};
use crate::rig::Devices;

/// Bytes that wait between host and wire: as much as a serial port's driver buffers.
const STREAM_BYTES: usize = 4096;
/// The boot of a device that lives as long as this process: every run's is the same.
const OWN_BOOT: u32 = 1;

/// A simulated device that is switched on: every link leads to the same one.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedDevice {
    streams: mpsc::UnboundedSender<DuplexStream>,
}

impl SimulatedDevice {
    /// Switches a device on, as a task of the current runtime; it goes by that runtime's clock.
    pub(crate) fn switch_on(stage: &Stage, baud: u32) -> Self {
        let (streams, mut waiting) = mpsc::unbounded_channel::<DuplexStream>();
        let mut device = device(stage, OWN_BOOT);
        let wire = wire(stage, baud);
        tokio::spawn(async move {
            let boot = Instant::now();
            while let Some(stream) = waiting.recv().await {
                // A stream that ends is a host that left; the next one may come.
                let _ = sim::serve(stream, &mut device, boot, wire.clone()).await;
            }
        });
        Self { streams }
    }

    /// Links to it, as often as they are asked for. The one before must have been dropped.
    pub(crate) fn opener(self) -> Opener {
        opener(move || {
            let (host, device) = duplex(STREAM_BYTES);
            // A device whose task has ended leaves the stream closed, which the driver notices.
            let _ = self.streams.send(device);
            std::future::ready(Ok(Link::new("simulated rig", host)))
        })
    }
}

/// Simulated devices of other makes, switched on: every set of links leads to the same ones.
#[derive(Debug, Clone)]
pub(crate) struct SimulatedDevices {
    streams: mpsc::UnboundedSender<(usize, DuplexStream)>,
    /// What each line's device is, in words.
    names: Vec<String>,
}

impl SimulatedDevices {
    /// Switches them on around one board, as a task of the current runtime.
    pub(crate) fn switch_on(stage: &Stage, devices: &Devices) -> Self {
        let (streams, mut waiting) = mpsc::unbounded_channel::<(usize, DuplexStream)>();
        let there = twins::of(devices);
        let mut bench = twins::bench(stage, &there, stage.boot);
        let names = there.iter().map(|line| format!("simulated {}", line.name())).collect();
        let lines = bench.lines();
        tokio::spawn(async move {
            let boot = Instant::now();
            let mut plugged: BTreeMap<usize, DuplexStream> = BTreeMap::new();
            while let Some((line, stream)) = waiting.recv().await {
                plugged.insert(line, stream);
                if plugged.len() == lines {
                    let streams = std::mem::take(&mut plugged).into_values().collect();
                    // Streams that end are a host that left; the next one may come.
                    let notice = |happened| note(&twins::note_of(happened, &there));
                    let _ = sim::serve_bench(streams, &mut bench, boot, notice).await;
                }
            }
        });
        Self { streams, names }
    }

    /// Links to them, as often as they are asked for. Those before must have been dropped.
    pub(crate) fn openers(self) -> Openers {
        let opener_to = |(line, name): (usize, String)| {
            let streams = self.streams.clone();
            opener(move || {
                let (host, device) = duplex(STREAM_BYTES);
                let _ = streams.send((line, device));
                std::future::ready(Ok(Link::new(&name, host)))
            })
        };
        Openers(self.names.into_iter().enumerate().map(opener_to).collect())
    }
}

fn device(stage: &Stage, boot: u32) -> Device<sim::SimulatedBoard> {
    Device::new(sim::SimulatedBoard::new(Arc::clone(&stage.compiled), boot))
}

pub(super) fn wire(stage: &Stage, baud: u32) -> sim::Wire {
    sim::Wire::new(baud).with_faults(stage.faults, stage.seed)
}

/// `gonio sim`: serves the device on a pseudo-terminal, or devices of other makes on one each, in
/// real time, until it is stopped.
pub(crate) fn sim(args: &SimArgs) -> Outcome {
    let mut inputs = Inputs::from_disk();
    let path = args.rig.rig.clone().unwrap_or_else(|| BUILT_IN.into());
    let rig = rig_at(&mut inputs, &path)?;
    let scene = args.rig.scene.as_ref().ok_or_else(|| no_scene(&rig))?;
    let stage = stage_at(&mut inputs, scene, &rig, &args.effects.terms(args.rig.seed))?;
    let lines = twins::wanted(&args.makes, &rig);
    let lines = lines.map(|lines| at_baud(lines, args.baud));
    twins::check_faults(&rig, lines.as_deref().unwrap_or_default())?;
    let expected = lines.as_ref().map_or(1, Vec::len);
    if !args.pty.is_empty() && args.pty.len() != expected {
        return Err(Failure::with_help(
            format!("--pty: {} links for {expected} devices", args.pty.len()),
            "give one for each device, divided by commas and in their order, or none",
        ));
    }
    let runtime = Pace::Real.runtime()?;
    if let Some(lines) = lines {
        return runtime.block_on(serve_twins(args, &stage, &lines));
    }
    let baud = args.baud.unwrap_or_else(|| rig.link.baud());
    runtime.block_on(serve_on_pty(args, &stage, baud))
}

fn at_baud(mut lines: Vec<twins::Line>, baud: Option<u32>) -> Vec<twins::Line> {
    for line in &mut lines {
        line.baud = baud.unwrap_or(line.baud);
    }
    lines
}

/// A pseudo-terminal; with a link to it where one is wanted.
fn terminal(link: Option<&PathBuf>) -> Result<sim::Pty, Failure> {
    let cannot = |error: std::io::Error| {
        let at = link.map_or(String::new(), |link| format!(" at {}", link.display()));
        Failure::start(format!("no pseudo-terminal{at}: {error}"))
    };
    let pty = sim::Pty::open(link.map(PathBuf::as_path)).map_err(cannot)?;
    say(&format!("{}\n", link.map_or(pty.path(), |link| link).display()))?;
    Ok(pty)
}

fn stop_signals() -> Result<StopSignals, Failure> {
    StopSignals::new().map_err(|error| Failure::start(format!("no signals: {error}")))
}

/// Until it is stopped, or the terminals fail.
async fn serve_until_stopped(
    stop: &mut StopSignals,
    served: impl Future<Output = std::io::Result<()>>,
) -> Outcome {
    tokio::select! {
        biased;
        () = stop.next() => Ok(ExitCode::SUCCESS),
        served = served => match served {
            Ok(()) => Ok(ExitCode::SUCCESS),
            Err(error) => Err(Failure::midway(format!("the pseudo-terminal failed: {error}"))),
        },
    }
}

async fn serve_on_pty(args: &SimArgs, stage: &Stage, baud: u32) -> Outcome {
    let mut stop = stop_signals()?;
    let pty = terminal(args.pty.first())?;
    note(&format!("simulated rig at {baud} baud; Ctrl-C switches it off"));
    // Whoever drove the one before must see that this is another boot: its clock began anew.
    let mut device = device(stage, draw_session());
    let served = sim::serve(pty, &mut device, Instant::now(), wire(stage, baud));
    serve_until_stopped(&mut stop, served).await
}

async fn serve_twins(args: &SimArgs, stage: &Stage, lines: &[twins::Line]) -> Outcome {
    let mut stop = stop_signals()?;
    let mut terminals: Vec<Option<sim::Pty>> = Vec::new();
    for (place, line) in lines.iter().enumerate() {
        terminals.push(Some(terminal(args.pty.get(place))?));
        note(&format!("a simulated {} at {} baud", line.name(), line.baud));
    }
    note("Ctrl-C switches them off");
    let mut bench = twins::bench(stage, lines, draw_session());
    // A plug that was pulled and comes back is another terminal.
    let open = |place: usize| match terminals.get_mut(place).and_then(Option::take) {
        Some(terminal) => Ok(terminal),
        None => terminal(args.pty.get(place))
            .map_err(|failure| std::io::Error::other(failure.text().to_owned())),
    };
    let notice = |happened| note(&twins::note_of(happened, lines));
    let served = sim::serve_bench_at(open, &mut bench, Instant::now(), notice);
    serve_until_stopped(&mut stop, served).await
}

/// Ctrl-C and SIGTERM, counted from when this was made.
#[derive(Debug)]
pub(crate) struct StopSignals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
}

impl StopSignals {
    pub(crate) fn new() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
        })
    }

    /// The next of either.
    pub(crate) async fn next(&mut self) {
        tokio::select! {
            biased;
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
    }
}
