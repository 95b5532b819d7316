//! The driver of gonio's own controllers: a link joined to the protocol's host endpoint. One task
//! owns it, reads and writes through it, and keeps the device's lease while commands are open.
//!
//! It does not know what commands are for: it hands on what the device says.

use std::collections::BTreeSet;
use std::time::Duration;

use firmware_protocol::{
    CommandId, Event, HostEndpoint, HostEvent, Identity, Instant, LinkCause, LinkStatistics,
    Nonsense, Reply, Request, RequestType, SubmitError, Ticket, frame,
};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, ReadHalf, WriteHalf};
use tokio::time::sleep_until;

use super::Link;

/// Signs of life go out this many times in a lease, so that losing some does no harm.
const SIGNS_PER_LEASE: u32 = 4;

/// What a device has to say, or what became of the link to it.
#[derive(Debug, Clone, PartialEq)]
pub enum DeviceEvent {
    /// Something unasked: started, done, sampled, failed. Each comes once.
    Event(Event),
    /// The link is gone, and with it all open requests. Nothing more will come.
    LinkLost(LinkLost),
    /// A frame that makes no sense, and the type byte that it carries. Whatever waited waits on.
    Nonsense(u8, Nonsense),
    /// A request was answered.
    Reply {
        /// As `submit` gave it.
        ticket: Ticket,
        /// What was asked.
        request: RequestType,
        /// The answer.
        reply: Reply,
        /// How often the request had to be sent again.
        retries: u8,
    },
    /// The device booted anew: it is unhomed and knows nothing of us. Connect again.
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

/// A device of our own protocol, connected.
#[derive(Debug)]
pub struct Native {
    name: String,
    reading: ReadHalf<Link>,
    writing: WriteHalf<Link>,
    host: HostEndpoint,
    outgoing: Vec<u8>,
    started: tokio::time::Instant,
    spoke: Instant,
    open: BTreeSet<CommandId>,
    lease: Duration,
    is_lost: bool,
}

impl Native {
    /// Opens a session. `session` is drawn anew by the caller for every connection. Asks again
    /// until `patience` is over; a device of another protocol version, or a port that hangs up,
    /// ends it at once.
    pub async fn connect(
        link: Link,
        session: u32,
        baud: u32,
        patience: Duration,
    ) -> Result<(Self, Identity), ConnectError> {
        let mut native = Self::new(link, session, baud);
        native.host.identify(native.now());
        loop {
            let port = native.name.clone();
            match native.next_host_event().await {
                Err(detail) => return Err(ConnectError::HungUp { port, detail }),
                Ok(HostEvent::Reply { reply: Reply::Identity(identity), .. }) => {
                    native.lease = Duration::from_millis(identity.lease_ms.into());
                    return Ok((native, identity));
                }
                Ok(HostEvent::VersionMismatch { device: (major, minor), host }) => {
                    let found =
                        minor.map_or(format!("{major}"), |minor| format!("{major}.{minor}"));
                    let newer = major > host.0;
                    return Err(ConnectError::Version { port, found, expected: host, newer });
                }
                Ok(HostEvent::LinkDown { cause, .. }) => {
                    let waited = native.started.elapsed();
                    if waited >= patience {
                        return Err(unanswered(port, baud, waited, cause));
                    }
                    native.host.identify(native.now());
                }
                Ok(_) => {}
            }
        }
    }

    fn new(link: Link, session: u32, baud: u32) -> Self {
        let name = link.name().to_owned();
        let (reading, writing) = tokio::io::split(link);
        Self {
            name,
            reading,
            writing,
            host: HostEndpoint::new(session, baud),
            outgoing: Vec::with_capacity(frame::WIRE_MAX),
            started: tokio::time::Instant::now(),
            spoke: Instant::ZERO,
            open: BTreeSet::new(),
            lease: Duration::MAX,
            is_lost: false,
        }
    }

    /// The time since the link was opened.
    pub fn now(&self) -> Instant {
        Instant::ZERO + self.started.elapsed()
    }

    /// What messages call the link.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the link went through so far.
    pub fn statistics(&self) -> LinkStatistics {
        self.host.statistics()
    }

    /// Takes a request in; it goes out when [`Native::next_event`] is next waited for. A full
    /// window is no fault: submit again after the next reply.
    pub fn submit(&mut self, request: Request) -> Result<Ticket, SubmitError> {
        let command = command_of(&request);
        let ticket = self.host.submit(self.now(), request)?;
        self.open.extend(command);
        Ok(ticket)
    }

    /// Brings the axes to rest: taken always, and sent before anything else.
    pub fn stop(&mut self) {
        // Stop is taken in every phase.
        let _ = self.host.submit(self.now(), Request::Stop);
    }

    /// The next thing that the device says. Writes, reads and keeps time while it waits, so
    /// somebody must wait for it all the time; nothing is lost if the wait is broken off. After
    /// [`DeviceEvent::LinkLost`] it waits for ever.
    pub async fn next_event(&mut self) -> DeviceEvent {
        loop {
            if self.is_lost {
                std::future::pending::<()>().await;
            }
            match self.next_host_event().await {
                Err(detail) => {
                    self.is_lost = true;
                    let port = self.name.clone();
                    return DeviceEvent::LinkLost(LinkLost::HungUp { port, detail });
                }
                Ok(event) => {
                    if let Some(event) = self.translate(event) {
                        return event;
                    }
                }
            }
        }
    }

    /// `None` for what a session that is open can't meet, or need not know.
    fn translate(&mut self, event: HostEvent) -> Option<DeviceEvent> {
        Some(match event {
            HostEvent::Event(event) => {
                match &event {
                    Event::Done(done) => self.open.remove(&done.id),
                    Event::Failed(id, ..) => self.open.remove(id),
                    Event::Sampled(result) => self.open.remove(&result.id),
                    Event::Started(..) => false,
                };
                DeviceEvent::Event(event)
            }
            HostEvent::Reply { ticket, request, reply, retries } => {
                if request == RequestType::KeepAlive {
                    return None;
                }
                if let Reply::Rejected(id, _) = &reply {
                    self.open.remove(id);
                }
                DeviceEvent::Reply { ticket, request, reply, retries }
            }
            HostEvent::DeviceRestarted { old, new } => {
                self.open.clear();
                DeviceEvent::Restarted { old, new }
            }
            HostEvent::LinkDown { request, attempts, elapsed, cause } => {
                self.is_lost = true;
                let port = self.name.clone();
                DeviceEvent::LinkLost(LinkLost::NoReply { port, request, attempts, elapsed, cause })
            }
            HostEvent::Garbage { type_byte, problem } => DeviceEvent::Nonsense(type_byte, problem),
            HostEvent::VersionMismatch { .. } => return None,
        })
    }

    /// Pumps the endpoint until it has something to tell; an error is a port that hung up.
    async fn next_host_event(&mut self) -> Result<HostEvent, String> {
        let mut incoming = [0; 512];
        loop {
            self.keep_alive();
            self.fill_outgoing();
            if let Some(event) = self.host.poll_event() {
                return Ok(event);
            }
            let deadline = self.deadline();
            let moment = deadline.unwrap_or(Instant::ZERO) - Instant::ZERO;
            tokio::select! {
                biased;
                () = sleep_until(self.started + moment), if deadline.is_some() => {
                    self.host.handle_timeout(self.now());
                }
                written = self.writing.write(&self.outgoing), if !self.outgoing.is_empty() => {
                    let count = written.map_err(|error| error.to_string())?;
                    self.outgoing.drain(..count);
                }
                read = self.reading.read(&mut incoming) => match read {
                    // A port without a device behind it reads as ended, now and for ever.
                    Ok(0) => return Err("end of stream".to_owned()),
                    Ok(count) => self.host.handle_bytes(self.now(), &incoming[..count]),
                    Err(error) => return Err(error.to_string()),
                },
            }
        }
    }

    /// While commands are open, silence for a quarter of the lease is broken by a sign of life.
    fn keep_alive(&mut self) {
        if self.sign_due().is_some_and(|due| due <= self.now()) {
            // A full window has frames on the way, which are signs of life too.
            let _ = self.host.submit(self.now(), Request::KeepAlive);
            self.spoke = self.now();
        }
    }

    fn sign_due(&self) -> Option<Instant> {
        let is_needed = !self.open.is_empty() && self.lease < Duration::MAX && self.host.is_open();
        is_needed.then(|| self.spoke + self.lease / SIGNS_PER_LEASE)
    }

    fn fill_outgoing(&mut self) {
        let mut wire = [0; frame::WIRE_MAX];
        while self.outgoing.is_empty()
            && let Some(length) = self.host.poll_transmit(self.now(), &mut wire)
        {
            self.outgoing.extend_from_slice(&wire[..length]);
            self.spoke = self.now();
        }
    }

    fn deadline(&self) -> Option<Instant> {
        self.host.poll_timeout().into_iter().chain(self.sign_due()).min()
    }
}

fn unanswered(port: String, baud: u32, waited: Duration, cause: LinkCause) -> ConnectError {
    match cause {
        LinkCause::Garbled { bytes } => ConnectError::Garbled { port, baud, bytes },
        _ => ConnectError::Silent { port, baud, waited },
    }
}

/// The command that a request opens.
fn command_of(request: &Request) -> Option<CommandId> {
    match request {
        Request::Dwell(dwell) => Some(dwell.id),
        Request::Home(home) => Some(home.id),
        Request::MoveTo(target) => Some(target.id),
        Request::Sweep(sweep) => Some(sweep.id),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::duplex;

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(2);

    #[tokio::test(start_paused = true)]
    async fn silence_garbage_and_a_hang_up_are_told_apart() {
        let (host, _device) = duplex(256);
        let error = Native::connect(Link::new("p", host), 1, 115_200, PATIENCE).await.unwrap_err();
        assert!(matches!(error, ConnectError::Silent { .. }), "{error}");

        let (host, mut device) = duplex(256);
        tokio::spawn(async move {
            let mut heard = [0; 64];
            while device.read(&mut heard).await.is_ok_and(|count| count > 0) {
                let _ = device.write_all(b"login: ").await;
            }
        });
        let error = Native::connect(Link::new("p", host), 1, 115_200, PATIENCE).await.unwrap_err();
        assert!(error.to_string().contains("another baud rate"), "{error}");

        let (host, device) = duplex(256);
        drop(device);
        let error = Native::connect(Link::new("p", host), 1, 115_200, PATIENCE).await.unwrap_err();
        assert!(matches!(error, ConnectError::HungUp { .. }), "{error}");
    }
}
