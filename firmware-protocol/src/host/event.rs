//! What the host endpoint tells its user, and what it counts.

use core::fmt;
use core::time::Duration;

use crate::{BadFrames, CodecError, Event, Reply, RequestType};

/// Names one submitted request, until its reply or the link's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub u32);

/// What a host endpoint has to tell.
#[derive(Debug, Clone, PartialEq)]
pub enum HostEvent {
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
    /// The device says something unasked. Each comes once, however often the device repeats
    /// it. It may come before the `Accepted` of its command, where that was lost on the way.
    Event(Event),
    /// The device booted anew: it is unhomed and knows nothing of us. All open tickets are lost
    /// and the session is closed; `identify` opens another.
    DeviceRestarted {
        /// The boot that the session began with.
        old: u32,
        /// The boot that answers now.
        new: u32,
    },
    /// A request stayed without an answer, or the device does not know the session any more.
    /// All open tickets are lost and the session is closed; `identify` opens another.
    LinkDown {
        /// The request that was given up, the oldest.
        request: RequestType,
        /// How often it was sent.
        attempts: u8,
        /// Since it was first sent.
        elapsed: Duration,
        /// What was heard in that time.
        cause: LinkCause,
    },
    /// The device speaks another major version of the protocol: the session is closed, nothing
    /// but `Stop` can be sent to it.
    VersionMismatch {
        /// The device's version; of a device that did not say its minor version, `None`.
        device: (u8, Option<u8>),
        /// The version spoken here.
        host: (u8, u8),
    },
    /// A frame arrived whole, but makes no sense: a peer that is broken, or none of ours. The
    /// request, if it was a reply, goes on waiting.
    Garbage {
        /// The frame's type byte.
        type_byte: u8,
        /// What is wrong with it.
        problem: Nonsense,
    },
}

/// What was heard from a device that does not answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkCause {
    /// Not one byte: unplugged, switched off or the wrong port.
    Silent,
    /// Bytes, but no valid frame among them: another device, or another baud rate.
    Garbled {
        /// How many bytes.
        bytes: u32,
    },
    /// Valid frames, but no answer to this request: a very noisy line.
    Unanswered,
    /// The device answers that it does not know this session: another host took it over.
    SessionLost,
}

/// Why a whole frame makes no sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nonsense {
    /// Its body does not read as a message.
    Body(CodecError),
    /// A reply of a type that does not answer this request.
    Answer(RequestType),
    /// A kind of frame that devices don't send.
    Kind(u8),
}

/// What a host endpoint counted since it was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStatistics {
    /// Frames sent for the first time.
    pub sent: u64,
    /// Frames sent again.
    pub resent: u64,
    /// Valid frames received.
    pub received: u64,
    /// Valid frames that had been received before, or that belong to another session.
    pub stale: u64,
    /// Frames refused, by cause.
    pub bad: BadFrames,
    /// Smoothed round trip (RFC 6298), once one was measured.
    pub srtt: Option<Duration>,
}

impl fmt::Display for LinkCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent => write!(f, "nothing was heard"),
            Self::Garbled { bytes } => {
                write!(f, "{bytes} bytes were heard, but no frame of this protocol")
            }
            Self::Unanswered => write!(f, "the device was heard, but its answer was not"),
            Self::SessionLost => write!(f, "the device does not know this session any more"),
        }
    }
}

impl fmt::Display for Nonsense {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Body(error) => write!(f, "{error}"),
            Self::Answer(request) => write!(f, "no answer to {request}"),
            Self::Kind(kind) => write!(f, "frame kind {kind}, expected a device's: 2, 3 or 4"),
        }
    }
}
