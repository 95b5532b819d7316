//! What speaks to one thing behind one port: a machine without I/O. Bytes and time go in; bytes,
//! a wake-up time and events come out. The one task that owns the port pumps it.
//!
//! It knows neither ports nor runtimes, and not what else the rig is put together of.

use std::fmt;
use std::time::Duration;

use firmware_protocol::{Cause, Instant};

/// The five verbs of a driver. After every call that hands in a time, take
/// [`Driver::poll_transmit`] and the events of [`super::Axes`] or [`super::Photometer`] until they
/// are empty, then ask [`Driver::poll_timeout`].
pub trait Driver: fmt::Debug + Send {
    /// The port was opened, or opened again: whatever was known is forgotten, and the thing is
    /// asked who it is, as often as it takes. Its event `Ready` or `Refused` is the answer; the
    /// caller's patience ends the wait. Nothing may move, and no setting may change.
    fn open(&mut self, now: Instant);
    /// These bytes came, in pieces of any length.
    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]);
    /// Time has passed.
    fn handle_timeout(&mut self, now: Instant);
    /// The next bytes for the wire. What stops the axes comes before anything else that waits;
    /// bytes that were handed out are on their way.
    fn poll_transmit(&mut self, now: Instant) -> Option<Vec<u8>>;
    /// When [`Driver::handle_timeout`] wants to be called; `None` while nothing is awaited. A
    /// driver that has nothing to do arms no timer, or simulated time runs away.
    fn poll_timeout(&self) -> Option<Instant>;
    /// What messages call it: kind and port.
    fn name(&self) -> &str;
    /// What its words mean.
    fn promises(&self) -> Promises;
}

/// What a device's words mean, in words for reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Promises {
    /// What is known when a command counts as accepted.
    pub accepted: &'static str,
    /// What is known when it counts as done.
    pub done: &'static str,
    /// After how long the device stops by itself when the host falls silent; `None`: it never
    /// does, and status and report say "no device watchdog".
    pub watchdog: Option<Duration>,
}

/// Why a thing stands still, by its own name for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFault {
    /// Which driver: [`Driver::name`].
    pub device: String,
    /// Its name and what it means: "ALARM:1 hard limit: a limit switch opened".
    pub name: String,
    /// The nearest cause of the common vocabulary.
    pub cause: Cause,
    /// Whether the axes may stand elsewhere than they were counted.
    pub loses_position: bool,
}

impl fmt::Display for NamedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.device, self.name)
    }
}

/// Why a thing that answers is not the one that the rig file describes, or not one that this
/// driver can drive. Nothing has moved.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{device}: {what}; expected {expected}: {help}")]
pub struct Refusal {
    /// Which driver: [`Driver::name`].
    pub device: String,
    /// What was found.
    pub what: String,
    /// What was expected.
    pub expected: String,
    /// What to do.
    pub help: String,
}

/// What goes wrong with any driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Trouble {
    /// It stands still, and says why. Its open command is over.
    Fault(NamedFault),
    /// It is not the thing that is expected: the answer to [`Driver::open`] instead of `Ready`.
    Refused(Refusal),
    /// It booted anew: it knows nothing of what it was told.
    Restarted,
    /// It did not answer in time; in words: to what, for how long, and what was heard instead.
    Silent(String),
}
