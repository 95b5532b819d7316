//! The wire from bytes: into a whole device over a board without hardware, and into the host's end,
//! in pieces, with time going by; as noise, and as bodies in frames whose check is right. Neither end
//! panics, both come to rest, and what one sends the other can decode.
#![no_main]

use std::time::Duration;

use firmware_protocol::frame::{Header, Kind, WIRE_MAX, encode};
use firmware_protocol::{
    AxisIdentity, Board, BoardFault, Decoder, Device, HostEndpoint, Illumination, Instant, Request,
    ToDevice, ToHost,
};
use libfuzzer_sys::fuzz_target;

struct Bare {
    axes: [AxisIdentity; 2],
    counts: [f64; 2],
}

impl Board for Bare {
    fn axes(&self) -> &[AxisIdentity] {
        &self.axes
    }

    fn gains(&self) -> u8 {
        2
    }

    fn adc(&self) -> (u8, u32) {
        (24, 1000)
    }

    fn boot_id(&self) -> u32 {
        1
    }

    fn set_setpoint(&mut self, _: Instant, channel: u8, counts: f64) {
        assert!(counts.is_finite(), "a setpoint of {counts}");
        self.counts[usize::from(channel)] = counts;
    }

    fn readback(&mut self, _: Instant, channel: u8) -> i32 {
        self.counts[usize::from(channel)] as i32
    }

    fn begin_search(&mut self, _: Instant, _: u8) {}

    fn home_mark(&mut self, _: Instant, channel: u8) -> Option<f64> {
        (channel == 0).then_some(0.0)
    }

    fn set_home(&mut self, _: Instant, channel: u8) {
        self.counts[usize::from(channel)] = 0.0;
    }

    fn begin_dwell(&mut self, _: Instant, _: Illumination) {}

    fn convert(&mut self, now: Instant) -> Result<i32, BoardFault> {
        Ok(now.tick().0 as i32)
    }

    fn fault(&mut self, _: Instant) -> Option<BoardFault> {
        None
    }
}

/// Both ends and what is between them.
struct Line {
    device: Device<Bare>,
    host: HostEndpoint,
    now: Instant,
}

impl Line {
    fn new() -> Self {
        let axis = AxisIdentity { low: -1000, high: 1000, speed: 500, acceleration: 2000 };
        let mut host = HostEndpoint::new(7, 115_200);
        host.identify(Instant::ZERO);
        Self {
            device: Device::new(Bare { axes: [axis.clone(), axis], counts: [0.0; 2] }),
            host,
            now: Instant::ZERO,
        }
    }

    /// Everything that either end has to say reaches the other, if `joined`.
    fn exchange(&mut self, joined: bool) {
        let mut out = [0; WIRE_MAX];
        // More than an outbox and a window hold: an end that never falls silent is a fault.
        for turn in 0.. {
            assert!(turn < 1000, "the ends do not come to rest");
            let mut is_silent = true;
            while let Some(length) = self.host.poll_transmit(self.now, &mut out) {
                is_silent = false;
                decodes(&out[..length], |frame| ToDevice::decode(frame).is_ok());
                if joined {
                    self.device.handle_bytes(self.now, &out[..length]);
                }
            }
            while let Some(length) = self.device.poll_transmit(self.now, &mut out) {
                is_silent = false;
                decodes(&out[..length], |frame| ToHost::decode(frame).is_ok());
                if joined {
                    self.host.handle_bytes(self.now, &out[..length]);
                }
            }
            while self.host.poll_event().is_some() {}
            if is_silent {
                return;
            }
        }
    }

    fn wait(&mut self, time: Duration) {
        self.now = self.now + time;
        self.device.handle_timeout(self.now);
        self.host.handle_timeout(self.now);
    }
}

/// What an end sends is one frame that the other end takes.
fn decodes(wire: &[u8], is_taken: impl Fn(&firmware_protocol::frame::Frame<'_>) -> bool) {
    let (mut decoder, mut bytes, mut frames) = (Decoder::default(), wire, 0);
    while let Some(result) = decoder.next_frame(&mut bytes) {
        let frame = result.unwrap_or_else(|error| panic!("sent {wire:02x?}: {error}"));
        assert!(is_taken(&frame), "sent {wire:02x?}");
        frames += 1;
    }
    assert_eq!(frames, 1, "sent {wire:02x?}");
}

fn run(mut bytes: &[u8]) -> Option<()> {
    let mut line = Line::new();
    let byte = |bytes: &mut &[u8]| {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        Some(*first)
    };
    for _ in 0..200 {
        let what = byte(&mut bytes)?;
        let joined = what & 0x80 == 0;
        match what % 8 {
            // Noise.
            0 | 1 => {
                let length = usize::from(byte(&mut bytes)?).min(bytes.len());
                let (piece, rest) = bytes.split_at(length);
                bytes = rest;
                if what % 8 == 0 {
                    line.device.handle_bytes(line.now, piece);
                } else {
                    line.host.handle_bytes(line.now, piece);
                }
            }
            // A frame that passes the checks, with any header and body.
            2..=4 => {
                let (kind, seq) = (byte(&mut bytes)?, byte(&mut bytes)?);
                let (type_byte, length) = (byte(&mut bytes)?, byte(&mut bytes)?);
                let length = usize::from(length).min(bytes.len());
                let (body, rest) = bytes.split_at(length);
                bytes = rest;
                let kinds = [Kind::Request, Kind::Reply, Kind::Event, Kind::Nak, Kind::Other(9)];
                let kind_and_major = (kinds[usize::from(kind) % 5], 1 - kind / 250);
                let (kind, major) = kind_and_major;
                let mut wire = [0; WIRE_MAX];
                let header = Header { kind, major, seq, type_byte };
                let Some(length) = encode(header, body, &mut wire) else { continue };
                if what % 8 == 2 {
                    line.host.handle_bytes(line.now, &wire[..length]);
                } else {
                    line.device.handle_bytes(line.now, &wire[..length]);
                }
            }
            // A request of the host's own.
            5 => {
                let (type_byte, length) = (byte(&mut bytes)?, byte(&mut bytes)?);
                let length = usize::from(length).min(bytes.len());
                let (body, rest) = bytes.split_at(length);
                bytes = rest;
                if let Ok(request) = Request::decode(type_byte, body) {
                    let _ = line.host.submit(line.now, request);
                }
            }
            6 => line.wait(Duration::from_millis(u64::from(byte(&mut bytes)?))),
            _ => line.wait(Duration::from_secs(u64::from(byte(&mut bytes)?))),
        }
        line.exchange(joined);
    }
    Some(())
}

fuzz_target!(|bytes: &[u8]| {
    let _ = run(bytes);
});
