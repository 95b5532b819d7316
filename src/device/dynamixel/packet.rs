//! Dynamixel Protocol 2.0 packets: instructions to bytes, bytes to status packets.
//!
//! ```text
//! FF FF FD 00 | id | length (2, LE) | instruction | parameters ... | CRC (2, LE)
//! ```
//!
//! `length` counts what follows it. Where instruction and parameters hold FF FF FD, an FD is put
//! behind it (stuffing), so that no header occurs inside a packet; length and CRC are of the
//! stuffed form. The CRC goes over everything before it: polynomial 8005, from 0, not reflected.
//! A reply to a fast sync read comes from the broadcast id and is not stuffed.
//! Source: the maker's "DYNAMIXEL Protocol 2.0". It does not know registers, nor time.

use std::fmt;

use crc::{CRC_16_UMTS, Crc};

pub(super) const HEADER: [u8; 4] = [0xff, 0xff, 0xfd, 0x00];
const STUFFED: [u8; 3] = [0xff, 0xff, 0xfd];
const STATUS: u8 = 0x55;
const BROADCAST: u8 = 0xfe;
/// Header, id and length.
const HEAD_BYTES: usize = 7;
const CRC_BYTES: usize = 2;

/// The longest packet that is taken in, bytes: a fast sync read of a position from all 253
/// servos fits. A length beyond it is noise.
pub(super) const PACKET_BYTES_MAX: usize = 2048;

/// The same polynomial under an older name.
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_UMTS);

/// One servo's number on its bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ServoId(u8);

impl ServoId {
    /// The highest that a servo can have.
    pub const MAX: u8 = 252;

    /// `None` above 252: 253 is reserved, 254 means all.
    pub const fn new(id: u8) -> Option<Self> {
        if id <= Self::MAX { Some(Self(id)) } else { None }
    }

    /// The number.
    pub const fn number(self) -> u8 {
        self.0
    }
}

impl fmt::Display for ServoId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "servo {}", self.0)
    }
}

/// What a host asks of servos.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Instruction {
    /// Who are you? Model and firmware.
    Ping(ServoId),
    /// The same to all, who answer one after the other.
    PingAll,
    /// So many bytes from an address on.
    Read {
        /// Whom.
        id: ServoId,
        /// From where in the control table.
        address: u16,
        /// How many bytes.
        length: u16,
    },
    /// Bytes to an address. Answered by a status packet without parameters.
    Write {
        /// Whom.
        id: ServoId,
        /// Where to in the control table.
        address: u16,
        /// What.
        data: Vec<u8>,
    },
    /// Restarts the servo: the way out of a hardware error.
    Reboot(ServoId),
    /// The same bytes of several servos. They answer in the order of the list.
    SyncRead {
        /// From where in the control table.
        address: u16,
        /// How many bytes.
        length: u16,
        /// Whom.
        ids: Vec<ServoId>,
    },
    /// The same, answered by one packet that all write together.
    FastSyncRead {
        /// From where in the control table.
        address: u16,
        /// How many bytes.
        length: u16,
        /// Whom.
        ids: Vec<ServoId>,
    },
    /// Bytes to the same address of several servos at once. Nobody answers.
    SyncWrite {
        /// Where to in the control table.
        address: u16,
        /// How many bytes each gets.
        length: u16,
        /// Whom, and what: `length` bytes each.
        data: Vec<(ServoId, Vec<u8>)>,
    },
}

/// An instruction that no packet holds: a list of servos or data longer than packets are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a packet of {bytes} bytes; at most {PACKET_BYTES_MAX} go into one")]
pub(super) struct TooLong {
    /// How long it would be.
    pub(super) bytes: usize,
}

impl Instruction {
    /// The packet, stuffed and with its CRC.
    pub(super) fn encode(&self) -> Result<Vec<u8>, TooLong> {
        let mut content = vec![self.code()];
        match self {
            Self::Ping(_) | Self::PingAll | Self::Reboot(_) => {}
            Self::Read { address, length, .. } => push_words(&mut content, [*address, *length]),
            Self::Write { address, data, .. } => {
                push_words(&mut content, [*address]);
                content.extend_from_slice(data);
            }
            Self::SyncRead { address, length, ids }
            | Self::FastSyncRead { address, length, ids } => {
                push_words(&mut content, [*address, *length]);
                content.extend(ids.iter().map(|id| id.0));
            }
            Self::SyncWrite { address, length, data } => {
                push_words(&mut content, [*address, *length]);
                for (id, data) in data {
                    content.push(id.0);
                    content.extend_from_slice(data);
                }
            }
        }
        packet(self.addressee(), &stuffed(&content))
    }

    fn addressee(&self) -> u8 {
        match self {
            Self::Ping(id) | Self::Reboot(id) | Self::Read { id, .. } | Self::Write { id, .. } => {
                id.0
            }
            Self::PingAll
            | Self::SyncRead { .. }
            | Self::FastSyncRead { .. }
            | Self::SyncWrite { .. } => BROADCAST,
        }
    }

    const fn code(&self) -> u8 {
        match self {
            Self::Ping(_) | Self::PingAll => 0x01,
            Self::Read { .. } => 0x02,
            Self::Write { .. } => 0x03,
            Self::Reboot(_) => 0x08,
            Self::SyncRead { .. } => 0x82,
            Self::SyncWrite { .. } => 0x83,
            Self::FastSyncRead { .. } => 0x8a,
        }
    }
}

fn push_words<const N: usize>(content: &mut Vec<u8>, words: [u16; N]) {
    content.extend(words.iter().flat_map(|word| word.to_le_bytes()));
}

fn packet(id: u8, content: &[u8]) -> Result<Vec<u8>, TooLong> {
    let bytes = HEAD_BYTES + content.len() + CRC_BYTES;
    let length = u16::try_from(content.len() + CRC_BYTES).map_err(|_| TooLong { bytes })?;
    if bytes > PACKET_BYTES_MAX {
        return Err(TooLong { bytes });
    }
    let mut packet = HEADER.to_vec();
    packet.push(id);
    packet.extend(length.to_le_bytes());
    packet.extend_from_slice(content);
    packet.extend(CRC.checksum(&packet).to_le_bytes());
    Ok(packet)
}

fn stuffed(content: &[u8]) -> Vec<u8> {
    let mut stuffed = Vec::with_capacity(content.len());
    for byte in content {
        stuffed.push(*byte);
        if stuffed.ends_with(&STUFFED) {
            stuffed.push(0xfd);
        }
    }
    stuffed
}

/// Takes the stuffing out; `None` where FF FF FD stands without it, which no sender writes.
fn unstuffed(content: &[u8]) -> Option<Vec<u8>> {
    let mut plain = Vec::with_capacity(content.len());
    let mut bytes = content.iter();
    while let Some(byte) = bytes.next() {
        plain.push(*byte);
        if plain.ends_with(&STUFFED) && bytes.next() != Some(&0xfd) {
            return None;
        }
    }
    Some(plain)
}

/// What one servo answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Status {
    /// Which servo.
    pub(super) id: ServoId,
    /// What it made of the instruction.
    pub(super) result: Result<(), StatusError>,
    /// Whether its hardware-error register is not zero.
    pub(super) alert: bool,
    /// The bytes that were asked for.
    pub(super) data: Vec<u8>,
}

/// Why a servo did not do what it was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum StatusError {
    /// Where a value was written that the servo does not take now: it is being moved by another
    /// mode, or something is switched on that must be off.
    #[error("the value can't be written now (access error)")]
    Access,
    /// The instruction was garbled on its way.
    #[error("the instruction arrived garbled (CRC error)")]
    Crc,
    /// Fewer bytes than the register has.
    #[error("the value is shorter than its register (data length error)")]
    DataLength,
    /// Outside a limit that the servo keeps.
    #[error("the value is outside the servo's own limits (data limit error)")]
    DataLimit,
    /// Outside what the register takes, or the bus watchdog has struck.
    #[error("the register does not take the value (data range error)")]
    DataRange,
    /// The servo does not know the instruction.
    #[error("the servo does not know the instruction (instruction error)")]
    Instruction,
    /// It tried, and could not.
    #[error("the servo could not process the instruction (result fail)")]
    Result,
    /// A number that the protocol does not have.
    #[error("error {0}, which the protocol does not have")]
    Unknown(u8),
}

impl StatusError {
    fn read(code: u8) -> Result<(), Self> {
        Err(match code {
            0 => return Ok(()),
            1 => Self::Result,
            2 => Self::Instruction,
            3 => Self::Crc,
            4 => Self::DataRange,
            5 => Self::DataLength,
            6 => Self::DataLimit,
            7 => Self::Access,
            other => Self::Unknown(other),
        })
    }
}

/// Why what was heard is no answer. Counted, and otherwise passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct BadPackets {
    /// Bytes outside packets.
    pub(super) noise_bytes: u64,
    /// Longer than packets are, or shorter than can be.
    pub(super) length: u64,
    /// Wrong CRC.
    pub(super) crc: u64,
    /// Sound, but no status packet: an instruction's echo, a reply without its error byte.
    pub(super) foreign: u64,
}

/// Finds status packets in a stream of bytes, however it is cut. It holds back at most
/// [`PACKET_BYTES_MAX`] bytes. After a packet with a wrong CRC it looks for the next header right
/// behind the bad one's: a garbled length swallows nothing.
#[derive(Debug, Clone, Default)]
pub(super) struct Decoder {
    held: Vec<u8>,
    bad: BadPackets,
}

impl Decoder {
    /// What was passed over so far.
    pub(super) const fn bad(&self) -> BadPackets {
        self.bad
    }

    /// How many bytes of an unfinished packet have come.
    #[cfg(test)]
    fn held(&self) -> usize {
        self.held.len()
    }

    /// Forgets an unfinished packet: its sender has fallen silent.
    pub(super) fn discard(&mut self) {
        self.bad.noise_bytes += self.held.len() as u64;
        self.held.clear();
    }

    /// Takes bytes in; the answers that they complete, in order.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Vec<Status> {
        let mut answers = Vec::new();
        // In pieces, so that no caller makes it hold more than a packet and a piece.
        for piece in bytes.chunks(PACKET_BYTES_MAX) {
            self.held.extend_from_slice(piece);
            while self.next_packet(&mut answers) {}
        }
        answers
    }

    /// Whether there was something to take off the front; answers go to `answers`.
    fn next_packet(&mut self, answers: &mut Vec<Status>) -> bool {
        self.skip_noise();
        let Some(head) = self.held.get(..HEAD_BYTES) else { return false };
        let length = usize::from(u16::from_le_bytes([head[5], head[6]]));
        let whole = HEAD_BYTES + length;
        // Instruction and CRC at least.
        if length <= CRC_BYTES || whole > PACKET_BYTES_MAX {
            self.bad.length += 1;
            self.skip_header();
            return true;
        }
        let Some(packet) = self.held.get(..whole) else { return false };
        let (covered, crc) = packet.split_at(whole - CRC_BYTES);
        if CRC.checksum(covered).to_le_bytes() != crc {
            self.bad.crc += 1;
            self.skip_header();
            return true;
        }
        match read_packet(packet) {
            Some(statuses) => answers.extend(statuses),
            None => self.bad.foreign += 1,
        }
        self.held.drain(..whole);
        true
    }

    /// Up to the next header, or to what may become one.
    fn skip_noise(&mut self) {
        let from = (0..self.held.len())
            .find(|from| {
                let rest = self.held.get(*from..).unwrap_or_default();
                rest.starts_with(&HEADER) || HEADER.starts_with(rest)
            })
            .unwrap_or(self.held.len());
        self.bad.noise_bytes += from as u64;
        self.held.drain(..from);
    }

    fn skip_header(&mut self) {
        self.bad.noise_bytes += HEADER.len() as u64;
        self.held.drain(..HEADER.len());
    }
}

/// The answers in a packet whose CRC is right; `None` where it holds none.
fn read_packet(packet: &[u8]) -> Option<Vec<Status>> {
    let id = *packet.get(4)?;
    let content = packet.get(HEAD_BYTES..packet.len() - CRC_BYTES)?;
    if content.first() != Some(&STATUS) {
        return None;
    }
    if id == BROADCAST {
        return read_fast(packet);
    }
    let content = unstuffed(content)?;
    let (&[_, error], data) = content.split_first_chunk::<2>()?;
    Some(vec![status(ServoId::new(id)?, error, data)])
}

fn status(id: ServoId, error: u8, data: &[u8]) -> Status {
    let result = StatusError::read(error & 0x7f);
    Status { id, result, alert: error & 0x80 != 0, data: data.to_vec() }
}

/// A fast reply: for each servo its error, its id, its data and a CRC over everything before it.
/// All parts are equally long; how long, only who asked knows, but the CRCs say it too.
fn read_fast(packet: &[u8]) -> Option<Vec<Status>> {
    let begin = HEAD_BYTES + 1;
    let bytes = packet.len() - begin;
    // Error, id, a byte of data and a CRC at least.
    let part = (5..=bytes).find(|part| {
        let mut ends = (1..=bytes / part).map(|n| begin + n * part);
        bytes.is_multiple_of(*part)
            && ends.all(|end| has_crc(packet.get(..end).unwrap_or_default()))
    })?;
    let parts = packet.get(begin..)?.chunks_exact(part);
    let read = |part: &[u8]| {
        let (&[error, id], rest) = part.split_first_chunk::<2>()?;
        let data = rest.get(..rest.len() - CRC_BYTES)?;
        Some(status(ServoId::new(id)?, error, data))
    };
    parts.map(read).collect()
}

fn has_crc(bytes: &[u8]) -> bool {
    let Some((covered, crc)) = bytes.split_last_chunk::<CRC_BYTES>() else { return false };
    CRC.checksum(covered).to_le_bytes() == *crc
}

#[cfg(test)]
mod tests;
