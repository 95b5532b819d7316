//! The simulated device on a byte stream: in this process for a run, or on a pseudo-terminal for
//! anybody (`gonio sim`).

use std::collections::BTreeMap;
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
use crate::device::{Link, Opener, Openers, opener};
use crate::rig::{AXES, AxesDriver, AxesLink, Devices, PhotometerDriver};

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
    lines: usize,
}

impl SimulatedDevices {
    /// Switches them on around one board, as a task of the current runtime.
    pub(crate) fn switch_on(stage: &Stage, devices: &Devices) -> Self {
        let (streams, mut waiting) = mpsc::unbounded_channel::<(usize, DuplexStream)>();
        let mut bench = bench(stage, devices, OWN_BOOT);
        let lines = bench.lines();
        tokio::spawn(async move {
            let boot = Instant::now();
            let mut plugged: BTreeMap<usize, DuplexStream> = BTreeMap::new();
            while let Some((line, stream)) = waiting.recv().await {
                plugged.insert(line, stream);
                if plugged.len() == lines {
                    let streams = std::mem::take(&mut plugged).into_values().collect();
                    // Streams that end are a host that left; the next one may come.
                    let _ = sim::serve_bench(streams, &mut bench, boot).await;
                }
            }
        });
        Self { streams, lines }
    }

    /// Links to them, as often as they are asked for. Those before must have been dropped.
    pub(crate) fn openers(self) -> Openers {
        let opener_to = |line: usize| {
            let streams = self.streams.clone();
            opener(move || {
                let (host, device) = duplex(STREAM_BYTES);
                let _ = streams.send((line, device));
                std::future::ready(Ok(Link::new("simulated device", host)))
            })
        };
        Openers((0..self.lines).map(opener_to).collect())
    }
}

/// The devices of a rig file around one board, the meter as the last.
fn bench(stage: &Stage, devices: &Devices, boot: u32) -> sim::Bench {
    let board = sim::SimulatedBoard::new(Arc::clone(&stage.compiled), boot);
    let nominal = board.nominal().clone();
    let mut bench = sim::Bench::new(board);
    for link in &devices.axes {
        let wire = wire(stage, link.baud);
        match &link.driver {
            AxesDriver::Grbl { letters, .. } => {
                let twin = sim::GrblTwin::new(&nominal, &by_letter(letters, link));
                bench.plug(twin, wire);
            }
        }
    }
    let wire = wire(stage, devices.photometer.baud);
    match devices.photometer.driver {
        PhotometerDriver::Keithley6485 => bench.plug(sim::KeithleyTwin::new(), wire),
    };
    bench
}

/// What a grbl's axes move, in its own order: the place in the rig, and the zero in degrees or
/// millimetres.
fn by_letter(letters: &[char], link: &AxesLink) -> Vec<(usize, f64)> {
    let mut axes: Vec<(char, usize, f64)> = Vec::new();
    for ((letter, name), zero) in letters.iter().zip(&link.axes).zip(&link.zeros) {
        let place = AXES.iter().position(|axis| axis == name).unwrap_or_default();
        let zero = if name.is_rotary() { zero.to_degrees() } else { zero * 1e3 };
        axes.push((*letter, place, zero));
    }
    axes.sort_by_key(|(letter, ..)| "XYZABCUVW".find(*letter));
    axes.into_iter().map(|(_, place, zero)| (place, zero)).collect()
}

fn device(stage: &Stage, boot: u32) -> Device<sim::SimulatedBoard> {
    Device::new(sim::SimulatedBoard::new(Arc::clone(&stage.compiled), boot))
}

fn wire(stage: &Stage, baud: u32) -> sim::Wire {
    sim::Wire::new(baud).with_faults(stage.faults, stage.seed)
}

/// `gonio sim`: serves the device on a pseudo-terminal, in real time, until it is stopped.
pub(crate) fn sim(args: &SimArgs) -> Outcome {
    let mut inputs = Inputs::from_disk();
    let path = args.rig.rig.clone().unwrap_or_else(|| BUILT_IN.into());
    let rig = rig_at(&mut inputs, &path)?;
    let scene = args.rig.scene.as_ref().ok_or_else(|| no_scene(&rig))?;
    let stage = stage_at(&mut inputs, scene, &rig, &args.effects.terms(args.rig.seed))?;
    let baud = args.baud.unwrap_or_else(|| rig.link.baud());
    let runtime = Pace::Real.runtime()?;
    runtime.block_on(serve_on_pty(args, &stage, baud))
}

async fn serve_on_pty(args: &SimArgs, stage: &Stage, baud: u32) -> Outcome {
    let cannot = |error: std::io::Error| {
        let link =
            args.pty.as_ref().map_or(String::new(), |link| format!(" at {}", link.display()));
        Failure::start(format!("no pseudo-terminal{link}: {error}"))
    };
    let mut stop = StopSignals::new().map_err(cannot)?;
    let pty = sim::Pty::open(args.pty.as_deref()).map_err(cannot)?;
    let shown = args.pty.as_deref().unwrap_or(pty.path());
    say(&format!("{}\n", shown.display()))?;
    note(&format!("simulated rig at {baud} baud; Ctrl-C switches it off"));
    // Whoever drove the one before must see that this is another boot: its clock began anew.
    let mut device = device(stage, draw_session());
    tokio::select! {
        biased;
        () = stop.next() => Ok(ExitCode::SUCCESS),
        served = sim::serve(pty, &mut device, Instant::now(), wire(stage, baud)) => match served {
            Ok(()) => Ok(ExitCode::SUCCESS),
            Err(error) => Err(Failure::midway(format!("the pseudo-terminal failed: {error}"))),
        },
    }
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
