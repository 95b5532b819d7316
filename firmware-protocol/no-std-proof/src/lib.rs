//! A device core over a board that does nothing, linked without std and without an allocator, as
//! a microcontroller would. It only has to build.
#![no_std]

use core::panic::PanicInfo;

use firmware_protocol::{
    AxisIdentity, Board, BoardFault, DeviceCore, Illumination, Instant, Reply, Request,
};

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

/// What a firmware's main loop calls, so that the linker needs all of the core.
#[unsafe(no_mangle)]
pub extern "C" fn device_after_us(us: u64) -> u64 {
    let axes = [AxisIdentity { low: 0, high: 1, speed: 1, acceleration: 1 }];
    let mut core = DeviceCore::new(Bare { axes, counts: 0.0 });
    let now = Instant::from_micros(us);
    let said = match core.handle_request(now, &Request::Identify(1)) {
        Reply::Identity(identity) => u64::from(identity.boot_id),
        _ => 0,
    };
    core.handle_timeout(now);
    while core.poll_event().is_some() {}
    core.poll_timeout().map_or(said, Instant::micros)
}
