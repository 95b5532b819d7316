//! Messages to bytes and back: one table gives every message its number, and postcard writes
//! what it carries. That each fits a frame is checked when this file is compiled.

use core::fmt;

use crate::bounds::Bounded;
use crate::frame::{BODY_MAX, WIRE_MAX};
use crate::packet::TAGS_MAX;
use crate::{
    Capabilities, Cause, CommandId, Done, Dwell, DwellResult, Event, Home, Identity, MoveTo,
    Rejection, Reply, Request, Status, Sweep, Tick, Window,
};

/// The most bytes that a window takes on the wire, of a device with six axes and every number at
/// its longest; one with four axes and numbers as they occur takes some 80.
pub const WINDOW_WIRE_MAX: usize = WIRE_MAX - BODY_MAX + TAGS_MAX + <Window as Bounded>::MAX;
const _: () = assert!(WINDOW_WIRE_MAX <= 140, "windows have to be small: a sweep has hundreds");

/// Why a body is no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CodecError {
    /// No message of this kind has this number.
    UnknownType(u8),
    /// The body ends early, or holds a value that the message can't have.
    Body(u8),
    /// Bytes are left over behind the message: type, how many.
    Leftover(u8, usize),
}

impl fmt::Display for CodecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownType(byte) => write!(f, "unknown message type 0x{byte:02x}"),
            Self::Body(byte) => write!(f, "message type 0x{byte:02x}: the body does not read"),
            Self::Leftover(byte, count) => {
                write!(f, "message type 0x{byte:02x}: {count} bytes left over")
            }
        }
    }
}

impl core::error::Error for CodecError {}

/// From a table of numbers and variants: the enum of types, and the codec of the messages.
macro_rules! messages {
    (
        $(#[$doc:meta])*
        $message:ident as $types:ident {
            $($byte:literal $variant:ident $(($($field:ident: $kind:ty),+))?,)+
        }
    ) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum $types {
            $(
                #[doc = concat!("[`", stringify!($message), "::", stringify!($variant), "`]")]
                $variant = $byte,
            )+
        }

        impl $types {
            /// All of them, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The number on the wire.
            pub const fn byte(self) -> u8 {
                self as u8
            }

            /// The message's name, as this crate spells it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => stringify!($variant),)+
                }
            }
        }

        impl fmt::Display for $types {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }

        impl $message {
            /// Which message this is.
            pub const fn message_type(&self) -> $types {
                match self {
                    $(Self::$variant { .. } => $types::$variant,)+
                }
            }

            /// Writes what the message carries; `None` if `out` is too short.
            pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
                let written = match self {
                    $(Self::$variant $(($($field),+))? => {
                        postcard::to_slice(&($($($field,)+)?), out)
                    })+
                };
                written.ok().map(|bytes| bytes.len())
            }

            /// Reads the message of this number. Nothing may be left over.
            pub fn decode(byte: u8, body: &[u8]) -> Result<Self, CodecError> {
                match byte {
                    $($byte => {
                        let (($($($field,)+)?), rest) =
                            postcard::take_from_bytes::<($($($kind,)+)?)>(body)
                                .map_err(|_| CodecError::Body(byte))?;
                        if !rest.is_empty() {
                            return Err(CodecError::Leftover(byte, rest.len()));
                        }
                        Ok(Self::$variant $(($($field),+))?)
                    })+
                    _ => Err(CodecError::UnknownType(byte)),
                }
            }
        }

        $(const _: () = assert!(
            TAGS_MAX $($(+ <$kind as Bounded>::MAX)+)? <= BODY_MAX,
            "the message does not fit a frame"
        );)+
    };
}

messages! {
    /// The numbers of the requests.
    Request as RequestType {
        0x01 Identify(session: u32),
        0x02 Home(home: Home),
        0x03 MoveTo(move_to: MoveTo),
        0x04 Dwell(dwell: Dwell),
        0x05 Sweep(sweep: Sweep),
        0x06 ReadStatus,
        0x07 Stop,
        0x08 ClearFault,
        0x09 KeepAlive,
        0x0a Acknowledge(id: CommandId),
        0x0b Capabilities,
        0x0c FetchWindow(id: CommandId, index: u16),
    }
}

messages! {
    /// The numbers of the replies.
    Reply as ReplyType {
        0x41 Identity(identity: Identity),
        0x42 Accepted(id: CommandId),
        0x43 Rejected(id: CommandId, why: Rejection),
        0x44 Status(status: Status),
        0x45 Stopping,
        0x46 Cleared,
        0x47 Alive,
        0x48 Acknowledged(id: CommandId),
        0x49 Capabilities(capabilities: Capabilities),
        0x4a Fetched(window: Window),
    }
}

messages! {
    /// The numbers of the events.
    Event as EventType {
        0x81 Started(id: CommandId, tick: Tick),
        0x82 Done(done: Done),
        0x83 Sampled(result: DwellResult),
        0x84 Failed(id: CommandId, cause: Cause, tick: Tick),
        0x85 Window(window: Window),
    }
}

impl Request {
    /// The command's number, of a request that is a command.
    pub const fn command(&self) -> Option<CommandId> {
        match self {
            Self::Home(Home { id, .. })
            | Self::MoveTo(MoveTo { id, .. })
            | Self::Dwell(Dwell { id, .. })
            | Self::Sweep(Sweep { id, .. }) => Some(*id),
            _ => None,
        }
    }

    /// Whether `reply` is one that this request can have.
    pub fn is_answered_by(&self, reply: &Reply) -> bool {
        match (self, reply) {
            (Self::Identify(_), Reply::Identity(_))
            | (Self::ReadStatus, Reply::Status(_))
            | (Self::Stop, Reply::Stopping)
            | (Self::ClearFault, Reply::Cleared | Reply::Rejected(..))
            | (Self::KeepAlive, Reply::Alive)
            | (Self::Capabilities, Reply::Capabilities(_)) => true,
            (Self::FetchWindow(id, index), Reply::Fetched(window)) => {
                (*id, *index) == (window.id, window.index)
            }
            (Self::Acknowledge(id), Reply::Acknowledged(answered))
            | (Self::FetchWindow(id, _), Reply::Rejected(answered, _)) => id == answered,
            (command, Reply::Accepted(id) | Reply::Rejected(id, _)) => {
                command.command() == Some(*id)
            }
            _ => false,
        }
    }
}

impl Event {
    /// The command that it is about.
    pub const fn command(&self) -> CommandId {
        match self {
            Self::Started(id, _)
            | Self::Done(Done { id, .. })
            | Self::Sampled(DwellResult { id, .. })
            | Self::Window(Window { id, .. })
            | Self::Failed(id, ..) => *id,
        }
    }

    /// Whether it ends its command, and so is repeated until it is acknowledged.
    pub const fn is_result(&self) -> bool {
        !matches!(self, Self::Started(..) | Self::Window(_))
    }
}
