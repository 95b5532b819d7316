//! What a run drives, by one vocabulary: a controller of gonio's own at the end of a link, or
//! several devices that are composed to one.
//!
//! A task of its own owns the links' both directions, so that a wait that is broken off loses
//! nothing. When its handle goes, however that came, the task stops the axes. This does not know
//! what commands are for, nor which of the two it is: it hands on what is said.

use std::time::Duration;

use firmware_protocol::{
    CommandId, Event, HostEndpoint, Identity, LinkCause, LinkStatistics, Reply, Request,
    RequestType, Status,
};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;

use super::Link;
use super::composed::{self, Composer};
use super::driver::{NamedFault, Refusal};
use super::native::Pump;
use crate::rig::DeviceTimes;

/// Why a link says nothing more after it hung up.
const GONE: &str = "the link is closed";

/// The minor version of the protocol that brought sweeps.
const SWEEPS_SINCE: u8 = 1;

/// What a device has to say, or what became of the link to it.
#[derive(Debug, Clone, PartialEq)]
pub enum DeviceEvent {
    /// What the clocks of several devices read at the dwell of this command, whose result follows.
    Clocks(CommandId, DeviceTimes),
    /// Something unasked: started, done, sampled, failed. Each comes once.
    Event(Event),
    /// One of several devices stands still, and has a name for why. The commands that it ends
    /// follow as failed.
    Fault(NamedFault),
    /// The link is gone, and with it the session and all open requests.
    LinkLost(LinkLost),
    /// A request was answered.
    Reply {
        /// What was asked.
        request: RequestType,
        /// The answer.
        reply: Reply,
        /// How often the request had to be sent again.
        retries: u8,
    },
    /// The device booted anew: it is unhomed and knows nothing of us; the session is over.
    Restarted {
        /// The boot that the session began with.
        old: u32,
        /// The boot that answers now.
        new: u32,
    },
}

/// How a link was lost.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkLost {
    /// The port is gone: unplugged, or its other end was closed.
    #[error("{port}: the port hung up ({detail}); check the cable and the power")]
    HungUp {
        /// The port.
        port: String,
        /// In the system's words.
        detail: String,
    },
    /// One of several devices answers no more: which, and to what.
    #[error("{0}")]
    Mute(String),
    /// The port is there, but nobody answers on it.
    #[error("{port}: no reply to {request} after {attempts} attempts over {} ms: {cause}", elapsed.as_millis())]
    NoReply {
        /// The port.
        port: String,
        /// What stayed without an answer.
        request: RequestType,
        /// How often it was sent.
        attempts: u8,
        /// Over which time.
        elapsed: Duration,
        /// What was heard instead.
        cause: LinkCause,
    },
}

/// Why no session could be opened. Nothing has moved.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConnectError {
    /// Something is there, but it speaks otherwise.
    #[error(
        "{port}: something answers, but not in gonio's protocol ({bytes} bytes, no frame); another baud rate than {baud}, or another device?"
    )]
    Garbled {
        /// The port.
        port: String,
        /// The rate that was tried.
        baud: u32,
        /// How much was heard.
        bytes: u32,
    },
    /// The port is gone.
    #[error("{port}: the port hung up while connecting ({detail}); check the cable and the power")]
    HungUp {
        /// The port.
        port: String,
        /// In the system's words.
        detail: String,
    },
    /// A line that loses most of what is said.
    #[error(
        "{port}: a device is heard, but its answers are not ({detail}); check the cable and the baud rate {baud}"
    )]
    Noisy {
        /// The port.
        port: String,
        /// The rate that was tried.
        baud: u32,
        /// What happened.
        detail: String,
    },
    /// One of several devices does not answer: which, and what was heard instead.
    #[error("{0}")]
    Mute(String),
    /// One of several devices is not the one that the rig file describes.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// Nobody answers.
    #[error("{port}: no answer from a device in {} ms; is it powered, and the baud rate {baud}?", waited.as_millis())]
    Silent {
        /// The port.
        port: String,
        /// The rate that was tried.
        baud: u32,
        /// How long it was waited for.
        waited: Duration,
    },
    /// Device and program are of different times.
    #[error("{port}: the device speaks protocol {found}, this program {}.{}; update {}", expected.0, expected.1, if *newer { "this program" } else { "the device's firmware" })]
    Version {
        /// The port.
        port: String,
        /// The device's version.
        found: String,
        /// The version spoken here.
        expected: (u8, u8),
        /// Whether the device's is the newer one.
        newer: bool,
    },
}

/// What the handle asks of its task.
#[derive(Debug)]
pub(super) enum Order {
    Identify,
    Send(Request),
}

/// What the task says to its handle.
#[derive(Debug)]
pub(super) enum Said {
    Device(DeviceEvent),
    /// No session: a device is another one, or there is none.
    Unfit(ConnectError),
    Version {
        device: (u8, Option<u8>),
        host: (u8, u8),
    },
    /// What the devices of a rig call themselves, before the identity that they make.
    Devices(Vec<String>),
    /// No answer to `Identify`.
    Unheard(LinkCause),
}

/// What a run drives, connected. Dropping it stops the axes, if they may be moving, and lets go of
/// the links.
#[derive(Debug)]
pub struct Controller {
    name: String,
    baud: u32,
    orders: mpsc::UnboundedSender<Order>,
    said: mpsc::UnboundedReceiver<Said>,
    statistics: watch::Receiver<LinkStatistics>,
    /// What its devices call themselves.
    devices: Vec<String>,
    task: JoinHandle<()>,
}

impl Controller {
    /// Opens a session with a controller of gonio's own. `session` is drawn anew by the caller for every connection, or the device
    /// takes the new host for the old one. Asks again until `patience` is over; a device of
    /// another protocol version, or a port that hangs up, ends it at once.
    pub async fn connect(
        link: Link,
        session: u32,
        baud: u32,
        patience: Duration,
    ) -> Result<(Self, Identity), ConnectError> {
        let name = link.name().to_owned();
        let (orders, to_task) = mpsc::unbounded_channel();
        let (from_task, said) = mpsc::unbounded_channel();
        let (statistics, watched) = watch::channel(LinkStatistics::default());
        let pump = Pump::new(link, HostEndpoint::new(session, baud), from_task, statistics);
        let task = tokio::spawn(pump.run(to_task));
        let devices = Vec::new();
        let mut native = Self { name, baud, orders, said, statistics: watched, devices, task };
        let identity = native.identify(patience).await?;
        Ok((native, identity))
    }

    /// Opens a session with several devices, over their links in the order of the composer's
    /// drivers.
    pub async fn compose(
        composer: Composer,
        links: Vec<Link>,
    ) -> Result<(Self, Identity), ConnectError> {
        let names: Vec<&str> = links.iter().map(Link::name).collect();
        let name = names.join(" and ");
        let (orders, to_task) = mpsc::unbounded_channel();
        let (from_task, said) = mpsc::unbounded_channel();
        let (_, statistics) = watch::channel(LinkStatistics::default());
        let task = tokio::spawn(composed::pump(composer, links, to_task, from_task));
        let devices = Vec::new();
        let mut composed = Self { name, baud: 0, orders, said, statistics, devices, task };
        // Each driver has a patience of its own.
        let identity = composed.identify(Duration::ZERO).await?;
        Ok((composed, identity))
    }

    /// Opens another session over the same link: what the last one left is stopped and forgotten.
    pub async fn identify(&mut self, patience: Duration) -> Result<Identity, ConnectError> {
        let began = tokio::time::Instant::now();
        let mut heard = LinkCause::Silent;
        loop {
            let _ = self.orders.send(Order::Identify);
            match self.identified().await? {
                Ok(identity) => return Ok(identity),
                // Silence after noise is no news.
                Err(LinkCause::Silent) => {}
                Err(cause) => heard = cause,
            }
            let waited = began.elapsed();
            if waited >= patience {
                return Err(self.unanswered(waited, heard));
            }
        }
    }

    /// The answer to one `Identify`, or what was heard instead.
    async fn identified(&mut self) -> Result<Result<Identity, LinkCause>, ConnectError> {
        loop {
            let port = self.name.clone();
            match self.said.recv().await {
                Some(Said::Device(DeviceEvent::Reply {
                    reply: Reply::Identity(identity), ..
                })) => return Ok(Ok(identity)),
                Some(Said::Unheard(cause)) => return Ok(Err(cause)),
                Some(Said::Unfit(error)) => return Err(error),
                Some(Said::Devices(devices)) => self.devices = devices,
                Some(Said::Device(DeviceEvent::LinkLost(LinkLost::HungUp { detail, .. }))) => {
                    return Err(ConnectError::HungUp { port, detail });
                }
                Some(Said::Version { device: (major, minor), host }) => {
                    let found = minor.map_or(major.to_string(), |minor| format!("{major}.{minor}"));
                    let newer = major > host.0;
                    return Err(ConnectError::Version { port, found, expected: host, newer });
                }
                // What an earlier session left.
                Some(Said::Device(_)) => {}
                None => {
                    let detail = GONE.to_owned();
                    return Err(ConnectError::HungUp { port, detail });
                }
            }
        }
    }

    fn unanswered(&self, waited: Duration, heard: LinkCause) -> ConnectError {
        let (port, baud) = (self.name.clone(), self.baud);
        match heard {
            LinkCause::Silent => ConnectError::Silent { port, baud, waited },
            LinkCause::Garbled { bytes } => ConnectError::Garbled { port, baud, bytes },
            other => ConnectError::Noisy { port, baud, detail: other.to_string() },
        }
    }

    /// Asks for the device's state. What the device says before the answer is lost: for the time
    /// between sessions and runs.
    pub async fn status(&mut self) -> Result<Status, ConnectError> {
        self.submit(Request::ReadStatus);
        loop {
            if let Reply::Status(status) = self.answer().await? {
                return Ok(status);
            }
        }
    }

    /// The next reply.
    async fn answer(&mut self) -> Result<Reply, ConnectError> {
        loop {
            let (port, baud) = (self.name.clone(), self.baud);
            let detail = match self.next_event().await {
                DeviceEvent::Reply { reply, .. } => return Ok(reply),
                DeviceEvent::LinkLost(LinkLost::HungUp { port, detail }) => {
                    return Err(ConnectError::HungUp { port, detail });
                }
                DeviceEvent::LinkLost(lost) => lost.to_string(),
                DeviceEvent::Restarted { .. } => "it restarted".to_owned(),
                DeviceEvent::Clocks(..) | DeviceEvent::Event(_) | DeviceEvent::Fault(_) => continue,
            };
            return Err(ConnectError::Noisy { port, baud, detail });
        }
    }

    /// The most windows that a sweep of this device can have; 0 where it can't sweep, as no device
    /// of version 1.0 can. What the device says before the answer is lost.
    pub async fn windows(&mut self, identity: &Identity) -> Result<u16, ConnectError> {
        if identity.protocol.1 < SWEEPS_SINCE {
            return Ok(0);
        }
        self.submit(Request::Capabilities);
        loop {
            if let Reply::Capabilities(capabilities) = self.answer().await? {
                return Ok(capabilities.windows);
            }
        }
    }

    /// What the devices of a rig of several call themselves, each with its driver's name; empty
    /// for a controller of gonio's own.
    pub fn devices(&self) -> &[String] {
        &self.devices
    }

    /// What messages call the links.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What was counted on the link so far.
    pub fn statistics(&self) -> LinkStatistics {
        *self.statistics.borrow()
    }

    /// Sends a request, in order with the others, however many wait; `Stop` overtakes all.
    pub fn submit(&self, request: Request) {
        // A task that has ended said so with its last event.
        let _ = self.orders.send(Order::Send(request));
    }

    /// Brings the axes to rest, and forgets what is queued on the device.
    pub fn stop(&self) {
        self.submit(Request::Stop);
    }

    /// The result of this command can be forgotten.
    pub fn acknowledge(&self, id: CommandId) {
        self.submit(Request::Acknowledge(id));
    }

    /// The next thing that the device says. Breaking the wait off loses nothing. A link that hung
    /// up says so again and again.
    pub async fn next_event(&mut self) -> DeviceEvent {
        let port = self.name.clone();
        let said = loop {
            match self.said.recv().await {
                Some(Said::Devices(devices)) => self.devices = devices,
                said => break said,
            }
        };
        let detail = match said {
            Some(Said::Device(event)) => return event,
            Some(Said::Devices(_)) => String::new(),
            Some(Said::Version { .. }) => "it now speaks another protocol version".to_owned(),
            Some(Said::Unheard(cause)) => cause.to_string(),
            Some(Said::Unfit(error)) => error.to_string(),
            None => GONE.to_owned(),
        };
        DeviceEvent::LinkLost(LinkLost::HungUp { port, detail })
    }

    /// Stops the axes if they may be moving, and lets go of the links; the task ends when both
    /// are done.
    pub fn let_go(self) -> JoinHandle<()> {
        self.task
    }

    /// As [`Controller::let_go`], and waits for it.
    pub async fn close(self) {
        let _ = self.let_go().await;
    }
}
