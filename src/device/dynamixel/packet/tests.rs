//! What could break: a byte that is taken for another, an answer for somebody else's, or a stream that
//! never ends.

use proptest::prelude::*;

use super::*;

fn id(number: u8) -> ServoId {
    ServoId::new(number).unwrap()
}

/// Bytes of a packet behind its header, written as in documents.
fn bytes(hex: &str) -> Vec<u8> {
    let tail = hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap());
    HEADER.into_iter().chain(tail).collect()
}

fn decode(packet: &[u8]) -> Vec<Status> {
    Decoder::default().take(packet)
}

fn answer(number: u8, data: &[u8]) -> Status {
    Status { id: id(number), result: Ok(()), alert: false, data: data.to_vec() }
}

/// The maker's examples, and two that the maker's own client accepted.
#[test]
fn instructions_are_the_documented_bytes() {
    use Instruction as I;
    let write = |address, data: &[u8]| I::Write { id: id(1), address, data: data.to_vec() };
    let sync = |ids: &[u8]| ids.iter().map(|number| id(*number)).collect::<Vec<_>>();
    let cases = [
        (I::Ping(id(1)), "01 03 00 01 19 4E"),
        (I::Read { id: id(1), address: 132, length: 4 }, "01 07 00 02 84 00 04 00 1D 15"),
        (write(116, &512_u32.to_le_bytes()), "01 09 00 03 74 00 00 02 00 00 CA 89"),
        (I::Reboot(id(1)), "01 03 00 08 2F 4E"),
        (
            I::SyncRead { address: 132, length: 4, ids: sync(&[1, 2]) },
            "FE 09 00 82 84 00 04 00 01 02 CE FA",
        ),
        (
            I::SyncWrite {
                address: 116,
                length: 4,
                data: vec![(id(1), vec![0x96, 0, 0, 0]), (id(2), vec![0xaa, 0, 0, 0])],
            },
            "FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
        ),
        (
            I::FastSyncRead { address: 132, length: 4, ids: sync(&[3, 7, 4]) },
            "FE 0A 00 8A 84 00 04 00 03 07 04 20 F2",
        ),
        (write(64, &[1]), "01 06 00 03 40 00 01 DB 66"),
        (write(112, &0x00fd_ffff_u32.to_le_bytes()), "01 0A 00 03 70 00 FF FF FD FD 00 62 63"),
    ];
    for (instruction, hex) in cases {
        assert_eq!(instruction.encode().unwrap(), bytes(hex), "{instruction:?}");
    }
}

#[test]
fn documented_answers_are_read() {
    for (hex, expected) in [
        ("01 07 00 55 00 06 04 26 65 5D", answer(1, &[0x06, 0x04, 0x26])),
        ("02 07 00 55 00 06 04 26 6F 6D", answer(2, &[0x06, 0x04, 0x26])),
        ("01 08 00 55 00 A6 00 00 00 8C C0", answer(1, &[0xa6, 0, 0, 0])),
        ("01 04 00 55 00 A1 0C", answer(1, &[])),
        ("02 08 00 55 00 1F 08 00 00 BA BE", answer(2, &[0x1f, 0x08, 0, 0])),
        ("01 06 00 55 00 77 00 C3 69", answer(1, &[0x77, 0])),
        ("02 05 00 55 00 24 8B A9", answer(2, &[0x24])),
        ("01 04 00 55 03 AB 0C", Status { result: Err(StatusError::Crc), ..answer(1, &[]) }),
    ] {
        assert_eq!(decode(&bytes(hex)), [expected], "{hex}");
    }
}

#[test]
fn a_fast_reply_is_one_answer_a_servo() {
    let reply = bytes(
        "FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E",
    );
    let expected =
        [answer(3, &[0xa6, 0, 0, 0]), answer(7, &[0x1f, 0x08, 0, 0]), answer(4, &[0xff, 3, 0, 0])];
    assert_eq!(decode(&reply), expected);
}

#[test]
fn an_instruction_that_is_echoed_is_no_answer() {
    let mut decoder = Decoder::default();
    let mut wire = Instruction::Ping(id(1)).encode().unwrap();
    wire.extend(bytes("01 04 00 55 00 A1 0C"));
    assert_eq!(decoder.take(&wire), [answer(1, &[])]);
    assert_eq!(decoder.bad(), BadPackets { foreign: 1, ..BadPackets::default() });
}

#[test]
fn a_garbled_length_swallows_nothing_that_follows() {
    let good = bytes("01 04 00 55 00 A1 0C");
    let mut garbled = bytes("01 08 00 55 00 A6 00 00 00 8C C0");
    garbled[5] = 14; // as if it went on into the next packets
    let wire = [garbled, good.clone(), good].concat();
    assert_eq!(decode(&wire), [answer(1, &[]), answer(1, &[])]);
}

#[test]
fn what_no_packet_holds_is_refused() {
    let too_long = Instruction::Write { id: id(1), address: 0, data: vec![0; 70_000] };
    assert_eq!(too_long.encode(), Err(TooLong { bytes: 70_012 }));
    let too_long = Instruction::Write { id: id(1), address: 0, data: vec![0; PACKET_BYTES_MAX] };
    assert_eq!(too_long.encode(), Err(TooLong { bytes: PACKET_BYTES_MAX + 12 }));
    assert_eq!((ServoId::new(253), ServoId::new(254)), (None, None));
}

/// A status packet as a servo builds it, by the protocol's text and not by the encoder above.
fn said(id: u8, error: u8, data: &[u8]) -> Vec<u8> {
    let mut content = vec![0x55, error];
    for byte in data {
        content.push(*byte);
        if content.ends_with(&[0xff, 0xff, 0xfd]) {
            content.push(0xfd);
        }
    }
    let mut packet = vec![0xff, 0xff, 0xfd, 0x00, id];
    packet.extend(u16::try_from(content.len() + 2).unwrap().to_le_bytes());
    packet.extend(content);
    let mut crc = 0_u16;
    for byte in &packet {
        crc ^= u16::from(*byte) << 8;
        for _ in 0..8 {
            crc = if crc & 0x8000 == 0 { crc << 1 } else { (crc << 1) ^ 0x8005 };
        }
    }
    packet.extend(crc.to_le_bytes());
    packet
}

/// Bytes among which header and stuffing often occur.
fn tricky() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![3 => Just(0xff), 2 => Just(0xfd), 1 => Just(0), 1 => any::<u8>()];
    proptest::collection::vec(byte, 0..64)
}

proptest! {
    #[test]
    fn any_answer_comes_back_however_it_is_cut(
        number in 0..=ServoId::MAX,
        alert in any::<bool>(),
        data in tricky(),
        noise in tricky(),
        cut in 1_usize..16,
    ) {
        let packet = said(number, u8::from(alert) << 7, &data);
        let expected = Status { alert, ..answer(number, &data) };
        let mut decoder = Decoder::default();
        let mut heard = Vec::new();
        // Noise may look like the head of a packet, and then delays what follows it.
        for piece in noise.chunks(cut).chain(packet.chunks(cut)) {
            heard.extend(decoder.take(piece));
        }
        decoder.discard();
        prop_assert!(heard.len() <= 1);
        let mut heard = Vec::new();
        for piece in packet.chunks(cut) {
            heard.extend(decoder.take(piece));
        }
        prop_assert_eq!(heard, [expected]);
    }

    #[test]
    fn stuffing_is_undone(content in tricky()) {
        let stuffed = stuffed(&content);
        prop_assert!(!stuffed.windows(4).any(|four| four == HEADER));
        prop_assert_eq!(unstuffed(&stuffed), Some(content));
    }

    #[test]
    fn one_or_two_flipped_bits_are_never_an_answer(
        data in proptest::collection::vec(any::<u8>(), 0..16),
        first in any::<proptest::sample::Index>(),
        second in any::<proptest::sample::Index>(),
    ) {
        let mut packet = said(1, 0, &data);
        let bits = packet.len() * 8;
        let (first, second) = (first.index(bits), second.index(bits));
        for bit in [first, second] {
            packet[bit / 8] ^= 1 << (bit % 8);
        }
        let heard = decode(&packet);
        prop_assert!(first == second || heard.is_empty(), "{heard:?}");
    }

    #[test]
    fn hostile_bytes_neither_panic_nor_pile_up(
        pieces in proptest::collection::vec(tricky(), 0..64),
        length in any::<u16>(),
    ) {
        let mut decoder = Decoder::default();
        for piece in pieces {
            let mut head = HEADER.to_vec();
            head.push(1);
            head.extend(length.to_le_bytes());
            decoder.take(&head);
            decoder.take(&piece);
            prop_assert!(decoder.held() <= PACKET_BYTES_MAX);
        }
    }
}
