//! What could break on a bench: a line whose bytes come early, late or out of order.

use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::{Emitter, Nominal, NominalAxis, NominalDetector, NominalGain, Quantity};
use crate::{Scene, Shape, Simulated, Terms, compile};

/// A rig whose θ moves 1000 counts a degree, over a patch of 40 W·m⁻²·sr⁻¹.
pub(crate) fn board() -> SimulatedBoard {
    board_of(axis, at_its_middle())
}

fn axis(channel: u8) -> NominalAxis {
    NominalAxis {
        channel,
        home: 0.0,
        counts_per_unit: 1000.0,
        travel_counts: (-50_000, 50_000),
        speed_counts_per_s: 10_000,
        acceleration_counts_per_s2: 100_000,
        settle_s: 0.0,
        has_encoder: true,
        u_zero: 0.0,
        u_homing: 0.0,
        u_readback: 0.0,
    }
}

/// At boot it looks at the middle of the patch.
fn at_its_middle() -> Simulated {
    Simulated { start: [Some(0.5); 4], ..Simulated::default() }
}

/// A board with these axes over that patch.
pub(crate) fn board_of(axis: impl Fn(u8) -> NominalAxis, simulated: Simulated) -> SimulatedBoard {
    board_with(axis, simulated, 0.0)
}

/// The same board, one reading of whose converter has this noise, amperes.
pub(crate) fn noisy_board(read_noise_a: f64) -> SimulatedBoard {
    board_with(axis, at_its_middle(), read_noise_a)
}

fn board_with(
    axis: impl Fn(u8) -> NominalAxis,
    simulated: Simulated,
    read_noise_a: f64,
) -> SimulatedBoard {
    let nominal = Nominal {
        quantity: Quantity::Radiance,
        axes: [axis(0), axis(1), axis(2), axis(3)],
        detector: NominalDetector {
            distance_m: 0.3,
            u_distance_m: 0.0,
            pupil_radius_m: 0.006,
            u_pupil_radius_m: 0.0,
            spot_radius_m: 0.002,
            u_spot_radius_m: 0.0,
            responsivity_a_per_w: 0.2,
            u_responsivity_relative: 0.0,
            read_noise_a,
            gains: vec![NominalGain { name: "1 uA".into(), full_scale_a: 1e-6, u_relative: 0.0 }],
            adc_bits: 24,
            adc_rate_hz: 2000,
        },
    };
    let patch = Emitter::lambertian(Shape::rectangle(0.0, 0.0, 0.04, 0.04), 40.0);
    let scene = Scene::new(Quantity::Radiance).with(patch).unwrap();
    let compiled = compile(scene, nominal, simulated, &Terms::seeded(1)).unwrap();
    SimulatedBoard::new(Arc::new(compiled), 0)
}

/// Says every byte back, in upper case, so long after it came.
struct Echo {
    delay: Duration,
    waiting: VecDeque<(Instant, u8)>,
    said: Vec<u8>,
}

impl Echo {
    fn after(delay: Duration) -> Self {
        Self { delay, waiting: VecDeque::new(), said: Vec::new() }
    }
}

impl Twin for Echo {
    fn handle_bytes(&mut self, _: &mut SimulatedBoard, now: Instant, bytes: &[u8]) {
        let at = now + self.delay;
        self.waiting.extend(bytes.iter().map(|byte| (at, byte.to_ascii_uppercase())));
    }

    fn handle_timeout(&mut self, _: &mut SimulatedBoard, now: Instant) {
        while let Some((_, byte)) = self.waiting.pop_front_if(|(at, _)| *at <= now) {
            self.said.push(byte);
        }
    }

    fn poll_timeout(&self, _: &SimulatedBoard) -> Option<Instant> {
        self.waiting.front().map(|(at, _)| *at)
    }

    fn poll_transmit(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.said)
    }
}

fn at(us: u64) -> Instant {
    Instant::from_micros(us)
}

#[test]
fn lines_are_paced_and_answers_come_when_they_have_passed() {
    let mut bench = Bench::new(board());
    let slow = bench.plug(Echo::after(Duration::from_micros(30)), Wire::new(10_000));
    let fast = bench.plug(Echo::after(Duration::ZERO), Wire::new(1_000_000));
    bench.send(at(0), slow, b"ab");
    bench.send(at(500), fast, b"x");
    bench.advance(at(1000));
    assert_eq!(bench.receive(at(1000), fast), Some(b"X".to_vec()), "10 us in, 10 us out");
    assert_eq!(bench.receive(at(1000), slow), None, "a millisecond in alone");
    // However late the caller comes: each at its own moment.
    bench.advance(at(9000));
    assert_eq!(bench.receive(at(2029), slow), None);
    assert_eq!(bench.receive(at(2030), slow), Some(b"A".to_vec()));
    assert_eq!(bench.next(), Some(at(3030)));
    assert_eq!(bench.receive(at(3030), slow), Some(b"B".to_vec()));
    assert_eq!(bench.next(), None);
}

#[tokio::test(start_paused = true)]
async fn a_line_that_ends_leaves_the_others() {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    let mut bench = Bench::new(board());
    for _ in 0..2 {
        bench.plug(Echo::after(Duration::from_millis(5)), Wire::new(100_000));
    }
    let (mut first, first_far) = tokio::io::duplex(64);
    let (second, second_far) = tokio::io::duplex(64);
    let boot = tokio::time::Instant::now();
    let host = async {
        drop(second);
        let mut heard = [0; 5];
        first.write_all(b"hello").await.unwrap();
        first.read_exact(&mut heard).await.unwrap();
        drop(first);
        heard
    };
    let served = crate::serve_bench(vec![first_far, second_far], &mut bench, boot, |_| {});
    let (served, heard) = tokio::join!(served, host);
    served.unwrap();
    assert_eq!(&heard, b"HELLO");
    assert!(boot.elapsed() < Duration::from_millis(10), "{:?}", boot.elapsed());
}
