//! If this breaks, noise on the line or an unlucky read stops a rig.

use firmware_protocol::frame::{BODY_MAX, Header, Kind, WIRE_MAX, encode};
use firmware_protocol::{
    Decoder, EventType, HostEndpoint, HostEvent, Instant, Reply, ReplyType, Request, RequestType,
    Said, SessionTag, ToHost,
};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

use crate::golden;
use crate::pair::{Ledger, Peer};

const NOW: Instant = Instant::from_micros(1_000_000);

/// A piece of a stream: a golden frame, a frame with any message in it, or noise.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    let any_frame = (any::<u8>(), any::<u8>(), any::<u8>(), vec(any::<u8>(), 0..BODY_MAX));
    prop_oneof![
        select(golden::names()).prop_map(|name| golden::bytes(&name)),
        any_frame.prop_map(|(kind, seq, type_byte, body)| frame(kind, seq, type_byte, &body)),
        (0_u8..8, message_type(), vec(any::<u8>(), 0..40)).prop_map(|(seq, type_byte, body)| {
            let tags = [&golden::SESSION.to_le_bytes()[..2], &golden::BOOT.to_le_bytes()].concat();
            let tags = if type_byte < 0x40 { &tags[..2] } else { &tags };
            frame(1 + (type_byte >> 6), seq, type_byte, &[tags, &body].concat())
        }),
        vec(any::<u8>(), 0..300),
        vec(Just(0), 0..10),
    ]
}

fn message_type() -> impl Strategy<Value = u8> {
    let requests = RequestType::ALL.iter().map(|kind| kind.byte());
    let replies = ReplyType::ALL.iter().map(|kind| kind.byte());
    let events = EventType::ALL.iter().map(|kind| kind.byte());
    select(requests.chain(replies).chain(events).collect::<Vec<_>>())
}

fn frame(kind: u8, seq: u8, type_byte: u8, body: &[u8]) -> Vec<u8> {
    let kind = match kind & 0x0f {
        1 => Kind::Request,
        2 => Kind::Reply,
        3 => Kind::Event,
        4 => Kind::Nak,
        other => Kind::Other(other),
    };
    let mut wire = [0; WIRE_MAX];
    let header = Header { kind, major: 1, seq, type_byte };
    let length = encode(header, &body[..body.len().min(BODY_MAX)], &mut wire).unwrap();
    wire[..length].to_vec()
}

/// A host in a session, with a request of each sort on its way.
fn host() -> HostEndpoint {
    let mut wire = [0; WIRE_MAX];
    let mut host = HostEndpoint::new(golden::SESSION, 115_200);
    host.identify(NOW);
    host.poll_transmit(NOW, &mut wire);
    host.handle_bytes(NOW, &golden::bytes("identity"));
    assert!(host.is_open());
    host.poll_event();
    for request in [Request::KeepAlive, Request::ReadStatus, Request::ClearFault, Request::Stop] {
        host.submit(NOW, request).unwrap();
        host.poll_transmit(NOW, &mut wire);
    }
    host
}

fn drain_host(host: &mut HostEndpoint, events: &mut Vec<String>) {
    while let Some(event) = host.poll_event() {
        events.push(format!("{event:?}"));
    }
}

/// A device in a session.
fn device() -> Ledger {
    let mut device = Ledger::new(golden::BOOT);
    device.handle_bytes(NOW, &golden::bytes("identify"));
    device.poll_transmit(NOW, &mut [0; WIRE_MAX]);
    device
}

fn drain_device(device: &mut Ledger) -> Vec<Vec<u8>> {
    let mut wire = [0; WIRE_MAX];
    let mut said = Vec::new();
    while let Some(length) = device.poll_transmit(NOW, &mut wire) {
        said.push(wire[..length].to_vec());
    }
    said
}

/// `bytes` in slices that end at these places.
fn cut(bytes: &[u8], places: &[Index]) -> Vec<Vec<u8>> {
    let mut ends: Vec<usize> = places.iter().map(|place| place.index(bytes.len() + 1)).collect();
    ends.push(bytes.len());
    ends.sort_unstable();
    let mut begin = 0;
    ends.into_iter().map(|end| bytes[std::mem::replace(&mut begin, end)..end].to_vec()).collect()
}

proptest! {
    #[test]
    fn any_bytes_in_any_slices_give_the_same_frames(
        pieces in vec(piece(), 0..12),
        places in vec(any::<Index>(), 0..20),
    ) {
        let bytes = pieces.concat();
        let frames = |slices: &[Vec<u8>]| {
            let mut decoder = Decoder::default();
            let mut found = Vec::new();
            for slice in slices {
                let mut rest = &slice[..];
                while let Some(result) = decoder.next_frame(&mut rest) {
                    found.push(result.map(|frame| (frame.header, frame.body.to_vec())));
                }
            }
            (found, decoder.bad())
        };
        prop_assert_eq!(frames(std::slice::from_ref(&bytes)), frames(&cut(&bytes, &places)));
    }

    #[test]
    fn any_bytes_in_any_slices_tell_the_host_the_same(
        pieces in vec(piece(), 0..12),
        places in vec(any::<Index>(), 0..20),
    ) {
        let bytes = pieces.concat();
        let hear = |slices: &[Vec<u8>]| {
            let (mut host, mut events) = (host(), Vec::new());
            for slice in slices {
                host.handle_bytes(NOW, slice);
                drain_host(&mut host, &mut events);
            }
            (events, host.statistics(), host.poll_timeout())
        };
        prop_assert_eq!(hear(std::slice::from_ref(&bytes)), hear(&cut(&bytes, &places)));
    }

    #[test]
    fn any_bytes_in_any_slices_have_the_device_do_the_same(
        pieces in vec(piece(), 0..12),
        places in vec(any::<Index>(), 0..20),
    ) {
        let bytes = pieces.concat();
        let obey = |slices: &[Vec<u8>]| {
            let mut device = device();
            for slice in slices {
                device.handle_bytes(NOW, slice);
            }
            (device.executed.clone(), device.link.bad(), drain_device(&mut device))
        };
        prop_assert_eq!(obey(std::slice::from_ref(&bytes)), obey(&cut(&bytes, &places)));
    }

    #[test]
    fn after_any_garbage_the_next_frame_is_found(
        garbage in vec(any::<u8>(), 0..1000),
        name in select(golden::packets().into_iter().map(|(name, _)| name).collect::<Vec<_>>()),
    ) {
        let wire = [garbage, golden::bytes(name)].concat();
        let mut decoder = Decoder::default();
        let mut rest = &wire[..];
        let mut last = None;
        while let Some(result) = decoder.next_frame(&mut rest) {
            last = Some(result.map(|frame| frame.header.type_byte));
        }
        let mut alone = Decoder::default();
        let golden = golden::bytes(name);
        let expected = alone.next_frame(&mut &golden[..]).unwrap().unwrap().header.type_byte;
        prop_assert_eq!(last, Some(Ok(expected)));
    }

    #[test]
    fn what_reads_as_a_reply_is_written_and_read_again_alike(
        type_byte in message_type(),
        body in vec(prop_oneof![0_u8..4, any::<u8>()], 0..80),
    ) {
        if let Ok(reply) = Reply::decode(type_byte, &body) {
            let mut out = [0; BODY_MAX];
            let length = reply.encode(&mut out).unwrap();
            prop_assert_eq!(Reply::decode(type_byte, &out[..length]), Ok(reply));
        }
    }
}

#[test]
fn nothing_may_be_left_over_behind_a_message() {
    for (name, packet) in golden::packets() {
        let body = match &packet {
            golden::Packet::Down(packet) => {
                let mut out = [0; BODY_MAX];
                let length = packet.request.encode(&mut out).unwrap();
                [&out[..length], &[0]].concat()
            }
            golden::Packet::Up(_) => continue,
        };
        let golden::Packet::Down(packet) = packet else { continue };
        let byte = packet.request.message_type().byte();
        assert!(Request::decode(byte, &body).is_err(), "{name}");
        for short in 0..body.len() - 1 {
            assert!(Request::decode(byte, &body[..short]).is_err(), "{name} cut at {short}");
        }
    }
}

#[test]
fn a_flood_of_events_does_not_crowd_out_the_answer() {
    let mut host = host();
    let mut flood = Vec::new();
    for id in 0..200 {
        let tick = firmware_protocol::Tick(0);
        let event = firmware_protocol::Event::Started(firmware_protocol::CommandId(id), tick);
        flood.extend(upward(0, Said::Event(event)));
        flood.extend(frame(2, 0, 0x7f, &[0; 6]));
    }
    flood.extend(upward(0, Said::Reply(Reply::Alive)));
    host.handle_bytes(NOW, &flood);
    let events: Vec<_> = std::iter::from_fn(|| host.poll_event()).collect();
    assert!(matches!(events.last(), Some(HostEvent::Reply { reply: Reply::Alive, .. })));
}

fn upward(seq: u8, message: Said) -> Vec<u8> {
    let session = SessionTag::of(golden::SESSION);
    let mut wire = [0; WIRE_MAX];
    let packet = ToHost { session, boot_id: golden::BOOT, seq, message };
    let length = packet.encode(&mut wire).unwrap();
    wire[..length].to_vec()
}
