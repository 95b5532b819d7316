//! A whole device over a board that does nothing, linked without std and without an allocator, as
//! a microcontroller would. It only has to build.
#![no_std]

use core::panic::PanicInfo;

use firmware_protocol::{AxisIdentity, Board, BoardFault, Device, Illumination, Instant, frame};

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

struct Bare {
    axes: [AxisIdentity; 1],
    counts: f64,
}

impl Board for Bare {
    fn axes(&self) -> &[AxisIdentity] {
        &self.axes
    }

    fn gains(&self) -> u8 {
        1
    }

    fn adc(&self) -> (u8, u32) {
        (16, 1000)
    }

    fn boot_id(&self) -> u32 {
        1
    }

    fn set_setpoint(&mut self, _: Instant, _: u8, counts: f64) {
        self.counts = counts;
    }

    fn readback(&mut self, _: Instant, _: u8) -> i32 {
        self.counts as i32
    }

    fn begin_search(&mut self, _: Instant, _: u8) {}

    fn home_mark(&mut self, _: Instant, _: u8) -> Option<f64> {
        None
    }

    fn set_home(&mut self, _: Instant, _: u8) {}

    fn begin_dwell(&mut self, _: Instant, _: Illumination) {}

    fn convert(&mut self, _: Instant) -> Result<i32, BoardFault> {
        Ok(0)
    }

    fn fault(&mut self, _: Instant) -> Option<BoardFault> {
        None
    }
}

/// What a firmware's main loop does, so that the link and the core are compiled for this
/// board.
#[unsafe(no_mangle)]
pub extern "C" fn frame_length_after_us(us: u64) -> usize {
    let axes = [AxisIdentity { low: 0, high: 1, speed: 1, acceleration: 1 }];
    let mut device = Device::new(Bare { axes, counts: 0.0 });
    let now = Instant::from_micros(us);
    let mut wire = [0; frame::WIRE_MAX];
    device.handle_bytes(now, &wire);
    device.handle_timeout(now);
    let length = device.poll_transmit(now, &mut wire);
    device.poll_timeout().and(length).unwrap_or(0)
}
