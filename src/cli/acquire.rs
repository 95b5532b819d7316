//! Runs a job on a rig in this process: an owner on a runtime of its own, in virtual time for a
//! simulated rig that shall go as fast as it can. Where it is alone it hears Ctrl-C and shows how far it is.

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;

use super::failure::Failure;
use super::progress::ProgressLine;
use super::session::draw_session;
use super::setup::{Setup, Stage};
use super::simulated::{SimulatedDevice, SimulatedDevices, StopSignals};
use crate::device::{Openers, SerialSettings, port_opener, serial_opener};
use crate::journal::{Journal, JournalError, Writer};
use crate::rig::{Link, Port, Rig};
use crate::run::{Ended, Happening, Job, Outcome, OwnerHandle, Source, StartError, Wish, own};

/// The number of a session with a device that lives in this process alone.
const OWN_SESSION: u32 = 1;

/// How a job is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pace {
    /// As fast as it can, in virtual time; for simulated rigs alone.
    Virtual,
    /// By the clock on the wall.
    Real,
}

/// Whether a job is all that the process does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Company {
    /// It hears Ctrl-C and shows how far it is.
    Alone,
    /// Whoever began it with others does that for all of them.
    AmongOthers,
}

/// What came of a job.
#[derive(Debug)]
pub(crate) struct Acquired {
    pub(crate) outcome: Outcome,
    pub(crate) rig_s: f64,
    /// The journal, or why some readings could not be kept.
    pub(crate) journal: Result<Journal, JournalError>,
}

impl Pace {
    /// Virtual for a simulated rig, unless real time is asked for.
    pub(crate) fn of(setup: &Setup, is_realtime: bool) -> Self {
        if setup.stage.is_some() && !is_realtime { Self::Virtual } else { Self::Real }
    }

    /// A runtime of one thread, its clock paused for virtual time.
    pub(crate) fn runtime(self) -> Result<tokio::runtime::Runtime, Failure> {
        tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .start_paused(self == Self::Virtual)
            .build()
            .map_err(|error| Failure::start(format!("no runtime: {error}")))
    }

    fn writer(self, journal: Journal) -> Result<Writer, JournalError> {
        match self {
            Self::Virtual => Ok(Writer::inline(journal)),
            Self::Real => Writer::threaded(journal),
        }
    }

    /// The first session's number.
    pub(crate) fn session(self) -> u32 {
        match self {
            Self::Virtual => OWN_SESSION,
            Self::Real => draw_session(),
        }
    }
}

/// The way to a rig, link by link; a simulated one is switched on here. Must be called on the
/// runtime that the rig is to be driven on.
pub(crate) fn openers_of(stage: Option<&Stage>, rig: &Rig) -> Openers {
    match (stage, &rig.link, &rig.devices) {
        (Some(stage), _, Some(devices)) => SimulatedDevices::switch_on(stage, devices).openers(),
        (Some(stage), link, None) => SimulatedDevice::switch_on(stage, link.baud()).opener().into(),
        (None, Link::Serial { port, baud, reset_on_open, boot_wait }, _) => {
            serial_opener(SerialSettings {
                port: port.clone(),
                baud: *baud,
                reset_on_open: *reset_on_open,
                boot_wait: *boot_wait,
            })
            .into()
        }
        (None, Link::Devices, Some(devices)) => {
            Openers(devices.ports().map(|port| port_opener(settings(port))).collect())
        }
        (None, Link::Devices, None) => unreachable!("the rig reader demands devices"),
        (None, Link::Simulated { .. }, _) => unreachable!("a simulated rig has a stage"),
    }
}

fn settings(port: &Port) -> SerialSettings {
    let Port { path, baud, reset_on_open, boot_wait } = port.clone();
    SerialSettings { port: path, baud, reset_on_open, boot_wait }
}

/// Reaches the rig; then lets `begin` make the journal and the job, and runs it to its end. A rig
/// that can't be reached is an error before anything was made.
pub(crate) fn acquire(
    setup: &Setup,
    pace: Pace,
    company: Company,
    begin: impl FnOnce() -> Result<(Journal, Job), Failure>,
) -> Result<Acquired, Failure> {
    pace.runtime()?.block_on(async {
        let opener = openers_of(setup.stage.as_ref(), &setup.rig);
        let (owner, task) = own(Arc::new(setup.rig.clone()), opener, pace.session());
        owner.look().await.map_err(Failure::start)?;
        let (journal, job) = begin()?;
        let ended = run_job(setup, &owner, (pace, company), journal, job).await;
        owner.shut_down().await;
        drop(owner);
        // The task has nothing to tell but its end.
        let _ = task.await;
        let Ended { outcome, rig_s, journal, lost, .. } = ended?;
        let journal = match lost {
            Some(error) => Err(error),
            None => journal.finish().await,
        };
        Ok(Acquired { outcome, rig_s, journal })
    })
}

async fn run_job(
    setup: &Setup,
    owner: &OwnerHandle,
    (pace, company): (Pace, Company),
    journal: Journal,
    job: Job,
) -> Result<Ended, Failure> {
    let is_alone = company == Company::Alone;
    let stop = is_alone.then(StopSignals::new).transpose();
    let mut stop = stop.map_err(|error| Failure::start(format!("signals: {error}")))?;
    let mut events = owner.subscribe();
    let mut line = ProgressLine::new(setup, pace, is_alone);
    let mut lines: Option<mpsc::Receiver<()>> = None;
    let writer = pace.writer(journal)?;
    let busy = |error: StartError| Failure::start(error);
    let ended = owner.start(job, writer).await.map_err(busy)?.ended();
    tokio::pin!(ended);
    let mut wishes = [Wish::Stop, Wish::Abort].into_iter().cycle();
    loop {
        tokio::select! {
            biased;
            () = signalled(stop.as_mut()) => {
                let wish = wishes.next().unwrap_or(Wish::Abort);
                line.say(if wish == Wish::Stop {
                    "stopping after this dwell; once more stops at once"
                } else {
                    "stopping at once"
                });
                owner.wish(wish).await;
            }
            ended = &mut ended => return ended.map_err(busy),
            Some(()) = async { lines.as_mut()?.recv().await } => {
                owner.wish(Wish::Continue).await;
            }
            event = events.recv() => match event {
                Ok(event) => {
                    if let Happening::AskSource(source) = &event.happening {
                        line.say(match source {
                            Source::Off => "switch the source off, then press Enter",
                            Source::On => "switch the source on again, then press Enter",
                        });
                        lines.get_or_insert_with(lines_of_standard_input);
                    }
                    line.show(&event.happening, owner.status().progress);
                }
                // The line shows the latest; what it missed is in the journal.
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => tokio::time::sleep(Duration::from_millis(1)).await,
            },
        }
    }
}

/// The next signal; never one where another hears them.
async fn signalled(stop: Option<&mut StopSignals>) {
    match stop {
        Some(stop) => stop.next().await,
        None => std::future::pending().await,
    }
}

/// One message for every line that a person enters; ends with standard input.
fn lines_of_standard_input() -> mpsc::Receiver<()> {
    let (sender, receiver) = mpsc::channel(1);
    std::thread::spawn(move || {
        for line in std::io::stdin().lines() {
            if line.is_err() || sender.blocking_send(()).is_err() {
                break;
            }
        }
    });
    receiver
}

/// The exit code of a run that ended so.
pub(crate) fn exit_code(is_complete: bool) -> ExitCode {
    if is_complete { ExitCode::SUCCESS } else { ExitCode::from(1) }
}
