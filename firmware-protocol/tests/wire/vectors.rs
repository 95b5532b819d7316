//! If this breaks, two ends built at different times no longer understand each other, or a
//! damaged frame is taken for a good one.

use crate::golden::{self, Packet};
use firmware_protocol::{
    Decoder, EventType, Foreign, PacketError, ReplyType, RequestType, SessionTag, ToDevice, ToHost,
};

/// The only frame in `wire`, which must have one.
fn read(wire: &[u8]) -> Result<Packet, PacketError> {
    let mut decoder = Decoder::default();
    let mut rest = wire;
    let frame = decoder.next_frame(&mut rest).expect("a frame").expect("a good one");
    match frame.header.kind {
        firmware_protocol::frame::Kind::Request => ToDevice::decode(&frame).map(Packet::Down),
        _ => ToHost::decode(&frame).map(Packet::Up),
    }
}

/// Whether any frame is found in `wire`.
fn finds_a_frame(wire: &[u8]) -> bool {
    let mut decoder = Decoder::default();
    let mut rest = wire;
    while let Some(result) = decoder.next_frame(&mut rest) {
        if result.is_ok() {
            return true;
        }
    }
    false
}

#[test]
fn every_message_has_a_vector_and_is_written_and_read_so() {
    let packets = golden::packets();
    for (name, packet) in &packets {
        let wire = golden::bytes(name);
        assert_eq!(packet.encode(), wire, "{name}: written");
        assert_eq!(read(&wire).as_ref(), Ok(packet), "{name}: read");
    }
    let foreign = golden::names().into_iter().filter(|name| name.starts_with("foreign-"));
    assert_eq!(packets.len() + foreign.count(), golden::names().len(), "a vector without meaning");

    let types: Vec<u8> =
        golden::names().iter().map(|name| type_byte(&golden::bytes(name))).collect();
    let requests = RequestType::ALL.iter().map(|kind| kind.byte());
    let replies = ReplyType::ALL.iter().map(|kind| kind.byte());
    let events = EventType::ALL.iter().map(|kind| kind.byte());
    for byte in requests.chain(replies).chain(events) {
        assert!(types.contains(&byte), "type 0x{byte:02x} has no vector");
    }
}

fn type_byte(wire: &[u8]) -> u8 {
    let mut decoder = Decoder::default();
    let mut rest = wire;
    decoder.next_frame(&mut rest).expect("a frame").expect("a good one").header.type_byte
}

#[test]
fn of_other_versions_only_what_never_changes_is_read() {
    let foreign = |minor, seq, type_byte| {
        let session = SessionTag::of(golden::SESSION);
        Err(PacketError::Version(Foreign { major: 2, minor, session, seq, type_byte }))
    };
    assert_eq!(read(&golden::bytes("foreign-identity")), foreign(Some(7), 0, 0x41));
    assert_eq!(read(&golden::bytes("foreign-identify")), foreign(None, 0, 0x01));
    assert!(matches!(
        read(&golden::bytes("foreign-stop")),
        Ok(Packet::Down(ToDevice { seq: 9, request: firmware_protocol::Request::Stop, .. }))
    ));
}

#[test]
fn every_flip_of_one_or_two_bits_is_refused() {
    for name in golden::names() {
        let mut wire = golden::bytes(&name);
        // The next frame's delimiter, so that a flip in this one's last does not hide it.
        wire.push(0);
        let bits = (wire.len() - 1) * 8;
        for first in 0..bits {
            wire[first / 8] ^= 1 << (first % 8);
            assert!(!finds_a_frame(&wire), "{name}: bit {first}");
            for second in first + 1..bits {
                wire[second / 8] ^= 1 << (second % 8);
                assert!(!finds_a_frame(&wire), "{name}: bits {first} and {second}");
                wire[second / 8] ^= 1 << (second % 8);
            }
            wire[first / 8] ^= 1 << (first % 8);
        }
    }
}

#[test]
fn every_cut_and_every_lost_byte_is_refused() {
    for name in golden::names() {
        let wire = golden::bytes(&name);
        for at in 1..wire.len() - 1 {
            let cut: Vec<u8> = [&wire[..at], &[0]].concat();
            assert!(!finds_a_frame(&cut), "{name}: cut at {at}");
            let lost: Vec<u8> = [&wire[..at], &wire[at + 1..]].concat();
            assert!(!finds_a_frame(&lost), "{name}: byte {at} lost");
        }
    }
}

/// One flipped bit each, which COBS with a CRC-16 (IBM-3740, little-endian) lets through: it
/// makes or destroys a delimiter or a code byte, and the frame ends elsewhere.
#[test]
fn what_cobs_with_a_crc_16_lets_through_is_refused() {
    let first: &[u8] =
        &[0x05, 0xe0, 0x81, 0xf6, 0xbf, 0x04, 0x72, 0x66, 0x39, 0x00, 0x35, 0xdc, 0xb5, 0x00];
    let second: &[u8] = &[0x03, 0x4c, 0xb9, 0x02, 0xc5, 0x01, 0x00, 0x3a, 0x00];
    for wire in [first, second] {
        assert!(!finds_a_frame(wire), "{wire:02x?}");
    }
}
