//! A message on its way: the frame's header, the tags that say which session and which boot it
//! belongs to, and the message.
//!
//! ```text
//! request          session u16 LE | message
//! reply, event     session u16 LE | boot id u32 LE | message
//! nak              session u16 LE | boot id u32 LE
//! ```
//!
//! These layouts, `Identify`, the first two bytes of `Identity`, `Stop` and `Stopping` are the
//! same in every version of the protocol.

use crate::codec::{CodecError, ReplyType, RequestType};
use crate::frame::{self, BODY_MAX, Frame, Header, Kind};
use crate::{Event, Reply, Request};

/// The version spoken here, major and minor. Another major version is not understood; a greater
/// minor version only adds messages.
pub const PROTOCOL: (u8, u8) = (1, 1);
const _: () = assert!(PROTOCOL.0 < 16, "the frame has four bits for it");

/// The longest tags.
pub(crate) const TAGS_MAX: usize = SESSION + BOOT;
const SESSION: usize = 2;
const BOOT: usize = 4;

/// The low half of a session's number: it goes with every frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SessionTag(pub u16);

impl SessionTag {
    /// The tag of the session with this number.
    #[allow(clippy::cast_possible_truncation)] // the low half is the tag's definition
    pub const fn of(session: u32) -> Self {
        Self(session as u16)
    }
}

/// Why a device does not accept a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NakReason {
    /// A frame was lost or damaged: send again from this sequence number.
    Resend,
    /// The session is not the device's: it booted anew, or talks with another host.
    NoSession,
    /// The request's major version is not the device's.
    Version,
}

impl NakReason {
    const fn byte(self) -> u8 {
        match self {
            Self::Resend => 0xc1,
            Self::NoSession => 0xc2,
            Self::Version => 0xc3,
        }
    }

    const fn from_byte(byte: u8) -> Result<Self, CodecError> {
        match byte {
            0xc1 => Ok(Self::Resend),
            0xc2 => Ok(Self::NoSession),
            0xc3 => Ok(Self::Version),
            other => Err(CodecError::UnknownType(other)),
        }
    }
}

/// From host to device.
#[derive(Debug, Clone, PartialEq)]
pub struct ToDevice {
    /// The session it belongs to.
    pub session: SessionTag,
    /// Its place in the session. `Identify` and `Stop` have none: there it only comes back
    /// with the reply.
    pub seq: u8,
    /// What is asked.
    pub request: Request,
}

/// From device to host.
#[derive(Debug, Clone, PartialEq)]
pub struct ToHost {
    /// The session it belongs to; in reply to `Identify`, `Stop` or an unknown session, the
    /// request's.
    pub session: SessionTag,
    /// The device's boot.
    pub boot_id: u32,
    /// A reply: the request's. An event: the count of events in the session, the same in each
    /// repeat. A nak: the number that is expected.
    pub seq: u8,
    /// What is said.
    pub message: Said,
}

/// What a device says.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    /// The answer to a request.
    Reply(Reply),
    /// Something unasked.
    Event(Event),
    /// A refusal of a frame.
    Nak(NakReason),
}

/// Why a valid frame is no packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PacketError {
    /// The peer speaks another major version; its minor version, where it says it.
    Version(Foreign),
    /// The kind goes the other way, or nowhere.
    Kind(u8),
    /// The message does not read.
    Codec(CodecError),
}

/// What can be told of a frame of another major version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Foreign {
    /// Its major version.
    pub major: u8,
    /// The minor version, of an `Identity`.
    pub minor: Option<u8>,
    /// The session that the frame names.
    pub session: SessionTag,
    /// The frame's sequence number.
    pub seq: u8,
    /// The frame's type byte.
    pub type_byte: u8,
}

impl ToDevice {
    /// Writes it as a frame; `None` if `out` is shorter than the frame.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        encode_request(self.session, self.seq, &self.request, out)
    }

    /// Reads it from a frame.
    pub fn decode(frame: &Frame<'_>) -> Result<Self, PacketError> {
        let Header { kind, major, seq, type_byte } = frame.header;
        if kind != Kind::Request {
            return Err(PacketError::Kind(kind.number()));
        }
        let short = PacketError::Codec(CodecError::Body(type_byte));
        let (tag, body) = frame.body.split_first_chunk::<SESSION>().ok_or(short)?;
        let session = SessionTag(u16::from_le_bytes(*tag));
        if major != PROTOCOL.0 && type_byte != RequestType::Stop.byte() {
            let foreign = Foreign { major, minor: None, session, seq, type_byte };
            return Err(PacketError::Version(foreign));
        }
        let request = Request::decode(type_byte, body).map_err(PacketError::Codec)?;
        Ok(Self { session, seq, request })
    }
}

impl ToHost {
    /// Writes it as a frame; `None` if `out` is shorter than the frame.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let (kind, type_byte) = match &self.message {
            Said::Reply(reply) => (Kind::Reply, reply.message_type().byte()),
            Said::Event(event) => (Kind::Event, event.message_type().byte()),
            Said::Nak(reason) => (Kind::Nak, reason.byte()),
        };
        let mut body = [0; BODY_MAX];
        let (session, rest) = body.split_at_mut(SESSION);
        session.copy_from_slice(&self.session.0.to_le_bytes());
        let (boot, message) = rest.split_at_mut(BOOT);
        boot.copy_from_slice(&self.boot_id.to_le_bytes());
        let length = match &self.message {
            Said::Reply(reply) => reply.encode(message)?,
            Said::Event(event) => event.encode(message)?,
            Said::Nak(_) => 0,
        };
        let header = Header { kind, major: PROTOCOL.0, seq: self.seq, type_byte };
        frame::encode(header, body.get(..TAGS_MAX + length)?, out)
    }

    /// Reads it from a frame.
    pub fn decode(frame: &Frame<'_>) -> Result<Self, PacketError> {
        let Header { kind, major, seq, type_byte } = frame.header;
        if matches!(kind, Kind::Request | Kind::Other(_)) {
            return Err(PacketError::Kind(kind.number()));
        }
        let short = PacketError::Codec(CodecError::Body(type_byte));
        let (tag, rest) = frame.body.split_first_chunk::<SESSION>().ok_or(short)?;
        let (boot, body) = rest.split_first_chunk::<BOOT>().ok_or(short)?;
        let session = SessionTag(u16::from_le_bytes(*tag));
        if major != PROTOCOL.0 && type_byte != ReplyType::Stopping.byte() {
            let says = type_byte == ReplyType::Identity.byte();
            let minor = if says { body.get(1).copied() } else { None };
            let foreign = Foreign { major, minor, session, seq, type_byte };
            return Err(PacketError::Version(foreign));
        }
        let message = match kind {
            Kind::Reply => Reply::decode(type_byte, body).map(Said::Reply),
            Kind::Event => Event::decode(type_byte, body).map(Said::Event),
            _ if body.is_empty() => NakReason::from_byte(type_byte).map(Said::Nak),
            _ => Err(CodecError::Leftover(type_byte, body.len())),
        };
        let message = message.map_err(PacketError::Codec)?;
        Ok(Self { session, boot_id: u32::from_le_bytes(*boot), seq, message })
    }
}

/// As [`ToDevice::encode`], of a request that stays where it is.
pub(crate) fn encode_request(
    session: SessionTag,
    seq: u8,
    request: &Request,
    out: &mut [u8],
) -> Option<usize> {
    let mut body = [0; BODY_MAX];
    let (tag, message) = body.split_at_mut(SESSION);
    tag.copy_from_slice(&session.0.to_le_bytes());
    let length = request.encode(message)?;
    let type_byte = request.message_type().byte();
    let header = Header { kind: Kind::Request, major: PROTOCOL.0, seq, type_byte };
    frame::encode(header, body.get(..SESSION + length)?, out)
}
