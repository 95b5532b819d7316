//! One frame: header, body and check, packed so that no zero byte occurs inside. Knows bytes,
//! not messages.
//!
//! ```text
//! wire     00  COBS( kind·version | seq | len | type | body … | crc32c, 4 B LE )  00
//! decoded            1 B            1 B   1 B   1 B    0–242 B   over all before it
//! ```
//!
//! `len` is the decoded length, check included, and must be what COBS gave. Without it a single
//! flipped bit can move a frame's end and still pass a CRC-16.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc};

/// The largest decoded frame: COBS then adds exactly one byte.
pub const DECODED_MAX: usize = 250;
/// The largest frame on the wire, both delimiters included.
pub const WIRE_MAX: usize = DECODED_MAX + 3;
/// The largest body.
pub const BODY_MAX: usize = DECODED_MAX - OVERHEAD;
/// Header and check.
pub const OVERHEAD: usize = HEADER + CHECK;

const HEADER: usize = 4;
const CHECK: usize = 4;
/// CRC-32C (Castagnoli): distance 6 up to 655 bytes (Koopman 2002).
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// What a frame is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Host to device.
    Request,
    /// Device to host, answering the request with the same sequence number.
    Reply,
    /// Device to host, unasked.
    Event,
    /// Device to host: not accepted, and the sequence number that is expected.
    Nak,
    /// Defined by nobody yet.
    Other(u8),
}

impl Kind {
    /// Its number on the wire, 4 bits.
    pub const fn number(self) -> u8 {
        match self {
            Self::Request => 1,
            Self::Reply => 2,
            Self::Event => 3,
            Self::Nak => 4,
            Self::Other(number) => number & 0x0f,
        }
    }

    const fn from_number(number: u8) -> Self {
        match number {
            1 => Self::Request,
            2 => Self::Reply,
            3 => Self::Event,
            4 => Self::Nak,
            other => Self::Other(other),
        }
    }
}

/// A frame's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// What it is for.
    pub kind: Kind,
    /// The protocol's major version that the sender speaks, 4 bits.
    pub major: u8,
    /// Sequence number.
    pub seq: u8,
    /// The message's number.
    pub type_byte: u8,
}

/// A frame that passed all checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Its header.
    pub header: Header,
    /// Tags and message.
    pub body: &'a [u8],
}

/// Why the bytes between two delimiters are no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// More bytes without a delimiter than a frame can have.
    TooLong,
    /// A COBS code points beyond the end.
    Cobs,
    /// Fewer bytes than header and check have.
    TooShort(usize),
    /// The length that the frame states, and the one found.
    Length(u8, usize),
    /// The check that the frame carries, and the one computed.
    Check(u32, u32),
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong => write!(f, "frame longer than {DECODED_MAX} bytes"),
            Self::Cobs => write!(f, "frame ends inside a COBS block"),
            Self::TooShort(found) => {
                write!(f, "frame of {found} bytes, expected {OVERHEAD} or more")
            }
            Self::Length(said, found) => write!(f, "frame length {said}, found {found} bytes"),
            Self::Check(said, computed) => {
                write!(f, "frame check {said:08x}, computed {computed:08x}")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// Writes one frame with both delimiters to `out` and returns its length; `None` if the body is
/// longer than [`BODY_MAX`] or `out` too short ([`WIRE_MAX`] always suffices).
///
/// ```
/// use firmware_protocol::frame::{Header, Kind, WIRE_MAX, encode};
/// let header = Header { kind: Kind::Request, major: 1, seq: 0x2a, type_byte: 0 };
/// let mut wire = [0; WIRE_MAX];
/// let length = encode(header, &[0x05, 0x40, 0xe2, 0x01], &mut wire).unwrap();
/// assert_eq!(
///     wire[..length],
///     [0, 4, 0x11, 0x2a, 12, 9, 0x05, 0x40, 0xe2, 0x01, 0x8f, 0xb9, 0x92, 0xff, 0]
/// );
/// ```
pub fn encode(header: Header, body: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut decoded = [0_u8; DECODED_MAX];
    let length = OVERHEAD + body.len();
    let end = length - CHECK;
    decoded.get_mut(HEADER..end)?.copy_from_slice(body);
    decoded[0] = header.kind.number() << 4 | header.major & 0x0f;
    decoded[1] = header.seq;
    decoded[2] = u8::try_from(length).ok()?;
    decoded[3] = header.type_byte;
    let check = CRC.checksum(&decoded[..end]).to_le_bytes();
    decoded.get_mut(end..length)?.copy_from_slice(&check);

    let wire = out.get_mut(..length + 3)?;
    wire[0] = 0;
    let packed = cobs::try_encode(&decoded[..length], &mut wire[1..]).ok()?;
    *wire.get_mut(1 + packed)? = 0;
    Some(packed + 2)
}

/// Reads, in place, what stood between two delimiters.
pub fn decode(packed: &mut [u8]) -> Result<Frame<'_>, FrameError> {
    let length = cobs::decode_in_place(packed).map_err(|_| FrameError::Cobs)?;
    if length < OVERHEAD {
        return Err(FrameError::TooShort(length));
    }
    if length > DECODED_MAX {
        return Err(FrameError::TooLong);
    }
    let decoded = &packed[..length];
    if usize::from(decoded[2]) != length {
        return Err(FrameError::Length(decoded[2], length));
    }
    let (checked, check) = decoded.split_at(length - CHECK);
    let said = u32::from_le_bytes([check[0], check[1], check[2], check[3]]);
    let computed = CRC.checksum(checked);
    if said != computed {
        return Err(FrameError::Check(said, computed));
    }
    let header = Header {
        kind: Kind::from_number(checked[0] >> 4),
        major: checked[0] & 0x0f,
        seq: checked[1],
        type_byte: checked[3],
    };
    Ok(Frame { header, body: &checked[HEADER..] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stated_length_unlike_the_one_found_is_refused_though_the_check_is_right() {
        let mut decoded = [0x11, 0x2a, 12, 0x05, 0x40, 0, 0, 0, 0];
        let check = CRC.checksum(&decoded[..5]).to_le_bytes();
        decoded[5..].copy_from_slice(&check);
        let mut packed = [0; 16];
        let length = cobs::try_encode(&decoded, &mut packed).unwrap();
        assert_eq!(decode(&mut packed[..length]), Err(FrameError::Length(12, 9)));
    }

    #[test]
    fn bodies_fit_up_to_the_largest() {
        let header = Header { kind: Kind::Reply, major: 1, seq: 0, type_byte: 1 };
        let (body, mut wire) = ([1; BODY_MAX + 1], [0; WIRE_MAX]);
        assert_eq!(encode(header, &body[1..], &mut wire), Some(WIRE_MAX));
        assert_eq!(decode(&mut wire[1..=DECODED_MAX + 1]).map(|frame| frame.header), Ok(header));
        assert_eq!(encode(header, &body, &mut wire), None);
        assert_eq!(encode(header, &body[1..], &mut wire[1..]), None);
    }
}
