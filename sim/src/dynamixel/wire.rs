//! Packets of Dynamixel's protocol 2.0 from the servo's side: instructions are found in a stream
//! of bytes, statuses are built. Written from the protocol's document; it shares nothing with any
//! host's codec.

const HEADER: [u8; 4] = [0xff, 0xff, 0xfd, 0x00];
/// Longer instructions are noise.
const LENGTH_MAX: usize = 1024;

pub(super) const BROADCAST: u8 = 0xfe;

/// An instruction packet whose CRC was right, or not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Received {
    pub(super) id: u8,
    pub(super) instruction: u8,
    pub(super) parameters: Vec<u8>,
    /// A servo that is spoken to so answers that it did not understand.
    pub(super) is_garbled: bool,
}

/// The receiving end.
#[derive(Debug, Clone, Default)]
pub(super) struct Ear {
    held: Vec<u8>,
}

impl Ear {
    /// The packet that this byte completes.
    pub(super) fn hear(&mut self, byte: u8) -> Option<Received> {
        self.held.push(byte);
        while !self.held.is_empty() && !is_begin(&self.held) {
            self.held.remove(0);
        }
        let length = usize::from(*self.held.get(5)?) | usize::from(*self.held.get(6)?) << 8;
        if !(3..=LENGTH_MAX).contains(&length) {
            self.held.clear();
            return None;
        }
        if self.held.len() < 7 + length {
            return None;
        }
        let packet = std::mem::take(&mut self.held);
        let (said, crc) = packet.split_at(packet.len() - 2);
        let plain = without_stuffing(&said[7..]);
        Some(Received {
            id: packet[4],
            instruction: plain[0],
            parameters: plain[1..].to_vec(),
            is_garbled: crc16(said) != u16::from(crc[0]) | u16::from(crc[1]) << 8,
        })
    }
}

fn is_begin(bytes: &[u8]) -> bool {
    bytes.iter().zip(HEADER).all(|(byte, header)| *byte == header)
}

fn without_stuffing(bytes: &[u8]) -> Vec<u8> {
    let mut plain: Vec<u8> = Vec::new();
    let mut bytes = bytes.iter().peekable();
    while let Some(byte) = bytes.next() {
        plain.push(*byte);
        if plain.ends_with(&[0xff, 0xff, 0xfd]) {
            bytes.next_if_eq(&&0xfd);
        }
    }
    plain
}

/// A status packet.
pub(super) fn status(id: u8, error: u8, data: &[u8]) -> Vec<u8> {
    let mut content = vec![0x55, error];
    for byte in data {
        content.push(*byte);
        if content.ends_with(&[0xff, 0xff, 0xfd]) {
            content.push(0xfd);
        }
    }
    let mut packet = begin(id, content.len() + 2);
    packet.extend(content);
    close(&mut packet);
    packet
}

/// The one packet that several servos say together, each its part: error, id, data, CRC of all
/// before. Not stuffed.
pub(super) fn status_together(parts: &[(u8, u8, Vec<u8>)]) -> Vec<u8> {
    let bytes: usize = parts.iter().map(|(_, _, data)| data.len() + 4).sum();
    let mut packet = begin(BROADCAST, bytes + 1);
    packet.push(0x55);
    for (id, error, data) in parts {
        packet.extend([*error, *id]);
        packet.extend(data);
        close(&mut packet);
    }
    packet
}

fn begin(id: u8, length: usize) -> Vec<u8> {
    let mut packet = HEADER.to_vec();
    #[allow(clippy::cast_possible_truncation)] // a table is shorter
    packet.extend([id, length as u8, (length >> 8) as u8]);
    packet
}

fn close(packet: &mut Vec<u8>) {
    let crc = crc16(packet);
    packet.extend([(crc & 0xff) as u8, (crc >> 8) as u8]);
}

/// Polynomial x^16 + x^15 + x^2 + 1, from 0, highest bit first.
fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).rev().fold(crc, |crc, bit| {
            let out = crc >> 15 ^ u16::from(byte >> bit & 1);
            crc << 1 ^ if out == 1 { 0x8005 } else { 0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(bytes: &[u8]) -> Vec<Received> {
        let mut ear = Ear::default();
        bytes.iter().filter_map(|byte| ear.hear(*byte)).collect()
    }

    fn packet(tail: &[u8]) -> Vec<u8> {
        [&HEADER, tail].concat()
    }

    #[test]
    fn the_maker_s_examples_are_heard_and_said() {
        let read = packet(&[1, 7, 0, 2, 0x84, 0, 4, 0, 0x1d, 0x15]);
        let expected =
            Received { id: 1, instruction: 2, parameters: vec![0x84, 0, 4, 0], is_garbled: false };
        assert_eq!(heard(&[&[0xff, 0x13, 0xff], &read[..]].concat()), [expected]);
        let answer = packet(&[1, 8, 0, 0x55, 0, 0xa6, 0, 0, 0, 0x8c, 0xc0]);
        assert_eq!(status(1, 0, &[0xa6, 0, 0, 0]), answer);
        let stuffed = packet(&[1, 10, 0, 3, 0x70, 0, 0xff, 0xff, 0xfd, 0xfd, 0, 0x62, 0x63]);
        assert_eq!(heard(&stuffed)[0].parameters, [0x70, 0, 0xff, 0xff, 0xfd, 0]);
        let mut garbled = read;
        garbled[8] ^= 4;
        assert!(heard(&garbled)[0].is_garbled);
    }

    #[test]
    fn several_say_the_maker_s_packet_together() {
        let parts =
            [(3, 0, vec![0xa6, 0, 0, 0]), (7, 0, vec![0x1f, 8, 0, 0]), (4, 0, vec![0xff, 3, 0, 0])];
        let expected = packet(&[
            0xfe, 0x19, 0, 0x55, 0, 3, 0xa6, 0, 0, 0, 0x84, 8, 0, 7, 0x1f, 8, 0, 0, 0x16, 0xca, 0,
            4, 0xff, 3, 0, 0, 0xd1, 0x9e,
        ]);
        assert_eq!(status_together(&parts), expected);
    }
}
