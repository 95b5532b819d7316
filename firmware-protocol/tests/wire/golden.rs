//! The golden vectors: every message of the protocol, as this crate's values and as the bytes in
//! `tests/vectors/`. The bytes were made by an encoder of their own, in another language, from
//! the definitions of postcard, COBS and CRC-32C. Changing one is a change of the protocol.

use std::path::Path;

use firmware_protocol::{
    AxisCounts, AxisIdentity, AxisMask, Capabilities, Cause, CommandId, Done, Dwell, DwellResult,
    Event, Home, Identity, MoveTo, NakReason, Rejection, Reply, Request, Said, SessionTag, Shutter,
    Status, Sweep, Tick, ToDevice, ToHost, Window,
};
use heapless::Vec as Few;

pub(crate) const SESSION: u32 = 0x162e_04d2;
pub(crate) const BOOT: u32 = 0xb007_c0de;

/// A packet in either direction.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Packet {
    Down(ToDevice),
    Up(ToHost),
}

impl Packet {
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut wire = [0; firmware_protocol::frame::WIRE_MAX];
        let length = match self {
            Self::Down(packet) => packet.encode(&mut wire),
            Self::Up(packet) => packet.encode(&mut wire),
        };
        wire[..length.expect("every message fits")].to_vec()
    }
}

/// The bytes of a vector: hexadecimal, after lines of `#`.
pub(crate) fn bytes(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/vectors/{name}.hex"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines
        .flat_map(str::split_whitespace)
        .map(|byte| u8::from_str_radix(byte, 16).expect("two hexadecimal digits"))
        .collect()
}

/// The names of all vectors, those of other versions too.
pub(crate) fn names() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vectors");
    let files = std::fs::read_dir(folder).expect("the vectors are there");
    let paths = files.map(|file| file.expect("a readable folder").path());
    let mut names: Vec<_> =
        paths.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned())).collect();
    names.sort();
    names
}

pub(crate) fn counts(values: &[i32]) -> AxisCounts {
    AxisCounts(Few::from_slice(values).expect("at most six axes"))
}

fn down(seq: u8, request: Request) -> Packet {
    Packet::Down(ToDevice { session: SessionTag::of(SESSION), seq, request })
}

fn up(seq: u8, message: Said) -> Packet {
    Packet::Up(ToHost { session: SessionTag::of(SESSION), boot_id: BOOT, seq, message })
}

fn reply(seq: u8, reply: Reply) -> Packet {
    up(seq, Said::Reply(reply))
}

fn event(seq: u8, event: Event) -> Packet {
    up(seq, Said::Event(event))
}

/// Every vector of this version with its meaning.
pub(crate) fn packets() -> Vec<(&'static str, Packet)> {
    let mut packets = requests();
    packets.extend(replies());
    packets.extend(statuses());
    packets.extend(events());
    packets.push(("nak-resend", up(5, Said::Nak(NakReason::Resend))));
    packets.push(("nak-no-session", up(0, Said::Nak(NakReason::NoSession))));
    packets.push(("nak-version", up(0, Said::Nak(NakReason::Version))));
    packets
}

fn requests() -> Vec<(&'static str, Packet)> {
    let dwell = Dwell {
        id: CommandId(301),
        reading: 0x8000_0000,
        gain: 3,
        shutter: Shutter::Closed,
        settle_us: 50_000,
        duration_us: 200_000,
    };
    let sweep = Sweep {
        id: CommandId(302),
        reading: 70_000,
        gain: 1,
        settle_us: 20_000,
        lead_us: 50_000,
        readings: 50,
        windows: 10,
        from: counts(&[-2500, 7]),
        step: counts(&[500, 0]),
    };
    let targets = counts(&[0, -1, i32::MAX, i32::MIN]);
    vec![
        ("identify", down(0, Request::Identify(SESSION))),
        ("home", down(0, Request::Home(Home { id: CommandId(7), axes: AxisMask(0b101) }))),
        ("move-to", down(1, Request::MoveTo(MoveTo { id: CommandId(300), targets }))),
        ("dwell", down(2, Request::Dwell(dwell))),
        ("sweep", down(3, Request::Sweep(sweep))),
        ("read-status", down(4, Request::ReadStatus)),
        ("stop", down(2, Request::Stop)),
        ("clear-fault", down(255, Request::ClearFault)),
        ("keep-alive", down(0, Request::KeepAlive)),
        ("acknowledge", down(1, Request::Acknowledge(CommandId(300)))),
        ("capabilities-asked", down(1, Request::Capabilities)),
        ("fetch-window", down(6, Request::FetchWindow(CommandId(302), 9))),
    ]
}

fn replies() -> Vec<(&'static str, Packet)> {
    let axis = |high: i32| AxisIdentity { low: -high, high, speed: 24_000, acceleration: 48_000 };
    let mut axes = Few::new();
    axes.extend([axis(38_000), axis(72_000)]);
    let identity = Identity {
        protocol: (1, 1),
        boot_id: BOOT,
        queue_depth: 8,
        lease_ms: 500,
        gains: 4,
        adc_bits: 20,
        adc_rate_hz: 2000,
        axes,
    };
    let stalled = Rejection::Faulted(Cause::Stalled(1));
    let outside = Rejection::OutsideLimits(2, -9);
    vec![
        ("identity", reply(0, Reply::Identity(identity))),
        ("largest", largest()),
        ("accepted", reply(1, Reply::Accepted(CommandId(300)))),
        ("rejected", reply(2, Reply::Rejected(CommandId(301), outside))),
        ("rejected-faulted", reply(3, Reply::Rejected(CommandId(302), stalled))),
        ("stopping", reply(2, Reply::Stopping)),
        ("cleared", reply(255, Reply::Cleared)),
        ("alive", reply(0, Reply::Alive)),
        ("acknowledged", reply(1, Reply::Acknowledged(CommandId(300)))),
        ("rejected-too-fast", reply(4, Reply::Rejected(CommandId(302), Rejection::TooFast(0)))),
        ("capabilities", reply(1, Reply::Capabilities(Capabilities { windows: 512 }))),
        ("fetched", reply(6, Reply::Fetched(window()))),
    ]
}

fn window() -> Window {
    Window {
        id: CommandId(302),
        index: 9,
        mean: -0.5,
        variance: 2.25,
        min: -3,
        max: 4,
        saturated: 0,
        start: counts(&[2000, 7]),
        moved: counts(&[500, 0]),
        start_tick: Tick(1_000_000),
        duration_us: 25_000,
    }
}

fn largest() -> Packet {
    let axis =
        AxisIdentity { low: i32::MIN, high: i32::MAX, speed: u32::MAX, acceleration: u32::MAX };
    let identity = Identity {
        protocol: (1, 255),
        boot_id: u32::MAX,
        queue_depth: 255,
        lease_ms: u32::MAX,
        gains: 255,
        adc_bits: 32,
        adc_rate_hz: u32::MAX,
        axes: Few::from([axis; 6]),
    };
    Packet::Up(ToHost {
        session: SessionTag::of(SESSION),
        boot_id: u32::MAX,
        seq: 0,
        message: Said::Reply(Reply::Identity(identity)),
    })
}

fn statuses() -> Vec<(&'static str, Packet)> {
    let moving = Status {
        boot_id: BOOT,
        homed: AxisMask(3),
        moving: true,
        fault: None,
        running: Some(CommandId(300)),
        queued: 2,
        unacknowledged: 1,
        last_id: Some(CommandId(302)),
        readback: counts(&[12, -34]),
        tick: Tick(0xffff_fff0),
    };
    let faulted = Status {
        boot_id: BOOT,
        homed: AxisMask(0),
        moving: false,
        fault: Some(Cause::LeaseExpired),
        running: None,
        queued: 0,
        unacknowledged: 0,
        last_id: None,
        readback: counts(&[]),
        tick: Tick(5),
    };
    vec![
        ("status", reply(4, Reply::Status(moving))),
        ("status-faulted", reply(5, Reply::Status(faulted))),
    ]
}

fn events() -> Vec<(&'static str, Packet)> {
    let done = Done { id: CommandId(300), readback: counts(&[0, -1]), tick: Tick(0) };
    let result = DwellResult {
        id: CommandId(301),
        reading: 17,
        gain: 3,
        n: 100,
        mean: -0.5,
        variance: 2.25,
        min: -3,
        max: 4,
        saturated: 0,
        start: counts(&[0, -1]),
        end: counts(&[1, -1]),
        start_tick: Tick(1_000_000),
        end_tick: Tick(1_050_000),
    };
    vec![
        ("started", event(0, Event::Started(CommandId(300), Tick(u32::MAX)))),
        ("done", event(1, Event::Done(done))),
        ("sampled", event(2, Event::Sampled(result))),
        ("window", event(3, Event::Window(window()))),
        ("failed", event(3, Event::Failed(CommandId(302), Cause::Stopped, Tick(77)))),
    ]
}
