//! Values of the converter, one after the other, and the time of one.

use std::hint::black_box;
use std::sync::Arc;

use benches::call_ns_in;
use firmware_protocol::{Board, Illumination, Instant, Shutter};
use sim::{Compiled, Sampler, SimulatedBoard};

const POSES: usize = 64;

/// θ, φ (radians), x, y (metres), all over the region.
fn poses() -> [[f64; 4]; POSES] {
    core::array::from_fn(|i| {
        let part = |k: f64| (i as f64 * k).fract();
        // Additive recurrences (Roberts 2018): even, and never twice the same.
        let at = |k| 2.0 * part(k) - 1.0;
        [
            0.95 * part(0.754_877_67),
            3.0 * at(0.569_840_29),
            0.009 * at(0.856_674_88),
            0.009 * at(0.733_891_85),
        ]
    })
}

/// One value a call.
pub(crate) fn values(compiled: &Arc<Compiled>) -> impl FnMut() {
    let (mut sampler, poses) = (Sampler::new(compiled, 0), poses());
    let mut i = 0;
    move || {
        i = (i + 1) % POSES;
        black_box(sampler.convert(black_box(poses[i])));
    }
}

/// A move and one value a call, on the board.
pub(crate) fn moves(compiled: &Arc<Compiled>) -> impl FnMut() {
    const COUNTS: [f64; 4] = [22_918.311_805, 22_918.311_805, 200_000.0, 200_000.0];
    let mut board = SimulatedBoard::new(Arc::clone(compiled), 0);
    let poses = poses();
    let (mut i, mut reading, mut now_us) = (0, 0_u32, 0_u64);
    move || {
        i = (i + 1) % POSES;
        reading = reading.wrapping_add(1);
        now_us += 1_000_000;
        for ((channel, value), counts) in (0..).zip(black_box(poses[i])).zip(COUNTS) {
            board.begin_motion(Instant::from_micros(now_us), channel, value * counts);
            board.set_setpoint(Instant::from_micros(now_us), channel, value * counts);
        }
        let dwell = Illumination { reading, gain: 0, shutter: Shutter::Open };
        board.begin_dwell(Instant::from_micros(now_us), dwell);
        let _ = black_box(board.convert(Instant::from_micros(now_us + 500)));
    }
}

/// The least time of a call of each, in turns.
pub(crate) fn least_ns<const N: usize>(mut acts: [&mut dyn FnMut(); N]) -> [f64; N] {
    const ROUNDS: usize = 12;
    let mut least = [f64::INFINITY; N];
    for _ in 0..ROUNDS {
        for (act, least) in acts.iter_mut().zip(&mut least) {
            *least = least.min(call_ns_in(5, &mut **act));
        }
    }
    least
}
