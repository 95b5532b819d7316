//! What could break: a device behind a paced wire that answers early, late, twice or never, or
//! whose answers depend on how it was reached.

mod bench;

use std::sync::Arc;
use std::time::Duration;

use bench::{Host, compiled, counts, device, exact_rig};
use firmware_protocol::{DwellResult, Reply, Shutter};
use sim::{Compiled, Emitter, LinkFaults, Pty, Quantity, Scene, Shape, Wire, serve};
use tokio::time::Instant;
use tokio_serial::SerialStream;

const RADIANCE: f64 = 40.0;

fn scene() -> Scene {
    let patch = Emitter::lambertian(Shape::rectangle(0.0, 0.0, 0.04, 0.04), RADIANCE);
    Scene::new(Quantity::Radiance).with(patch).unwrap()
}

fn rig(seed: u64) -> Arc<Compiled> {
    compiled(scene(), exact_rig(), seed)
}

/// For real time: its homing takes tenths of a second.
fn quick_rig() -> Arc<Compiled> {
    let mut nominal = exact_rig();
    for axis in &mut nominal.axes {
        axis.speed_counts_per_s *= 50;
        axis.acceleration_counts_per_s2 *= 1000;
    }
    compiled(scene(), nominal, 5)
}

/// Identify, home, move, dwell in the light and in the dark. All readings, and how long it took.
async fn session(rig: &Arc<Compiled>, wire: Wire, baud: u32) -> (Vec<DwellResult>, Duration) {
    let (near, far) = tokio::io::duplex(4096);
    let mut device = device(rig);
    let boot = Instant::now();
    let host = async {
        let mut host = Host::new(near, 7, baud);
        assert!(matches!(host.identify().await, Reply::Identity(_)));
        host.home().await;
        let done = host.move_to(counts(30.0, -70.0, 0.005, 0.01)).await;
        assert_eq!(done.readback, counts(30.0, -70.0, 0.005, 0.01));
        vec![
            host.dwell(0, 0, Shutter::Open).await,
            host.dwell(1, 0, Shutter::Closed).await,
            host.dwell(2, 1, Shutter::Open).await,
        ]
    };
    let readings = tokio::select! {
        biased;
        readings = host => readings,
        served = serve(far, &mut device, boot, wire) => panic!("{served:?}"),
    };
    (readings, boot.elapsed())
}

#[tokio::test(start_paused = true)]
async fn a_whole_session_in_virtual_time() {
    let rig = rig(1);
    let started = std::time::Instant::now();
    let (readings, took) = Box::pin(session(&rig, Wire::new(1_000_000), 1_000_000)).await;
    let [light, dark, saturated] = &readings[..] else { panic!("{readings:?}") };
    assert_eq!((light.n, light.saturated), (200, 0));
    let expected = RADIANCE * rig.current_per_radiance() / 1e-6 * 8_388_608.0;
    // Shot noise alone: sqrt(q I rate) of 1.1e-6 of full scale over sqrt(200).
    assert!((light.mean / expected - 1.0).abs() < 1e-5, "{} beside {expected}", light.mean);
    assert_eq!((dark.mean.to_bits(), dark.variance.to_bits()), (0, 0));
    assert_eq!(saturated.saturated, 200);
    assert_eq!((saturated.min, saturated.max), (8_388_607, 8_388_607));
    assert!(took > Duration::from_secs(2), "{took:?}: homing takes its time");
    assert!(started.elapsed() < Duration::from_secs(20), "virtual time does not wait");
}

#[tokio::test(start_paused = true)]
async fn the_same_seed_gives_the_same_bytes_whatever_the_baud_rate() {
    let [mut fast, mut slow, mut other] =
        [(1, 1_000_000), (1, 19_200), (2, 1_000_000)].map(|(seed, baud)| (rig(seed), baud));
    let mut run = Vec::new();
    for (rig, baud) in [&mut fast, &mut slow, &mut other] {
        run.push(Box::pin(session(rig, Wire::new(*baud), *baud)).await);
    }
    let light = |run: &(Vec<DwellResult>, Duration)| {
        (run.0[0].mean.to_bits(), run.0[0].variance.to_bits(), run.0[0].min, run.0[0].max)
    };
    assert_eq!(light(&run[0]), light(&run[1]));
    assert_ne!(light(&run[0]), light(&run[2]));
    assert!(run[1].1 > run[0].1, "a slow wire takes longer");
    let again = Box::pin(session(&fast.0, Wire::new(fast.1), fast.1)).await;
    assert_eq!(again, run[0], "to the last tick");
}

#[tokio::test(start_paused = true)]
async fn a_noisy_wire_costs_time_and_changes_no_reading() {
    let rig = rig(3);
    let clean = Box::pin(session(&rig, Wire::new(115_200), 115_200)).await;
    let faults = LinkFaults { drop_rate: 0.001, corrupt_rate: 0.001 };
    for seed in 0..5 {
        let wire = Wire::new(115_200).with_faults(faults, seed);
        let noisy = Box::pin(session(&rig, wire, 115_200)).await;
        for (a, b) in clean.0.iter().zip(&noisy.0) {
            assert_eq!(
                (a.mean.to_bits(), a.variance.to_bits()),
                (b.mean.to_bits(), b.variance.to_bits())
            );
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_round_trip_takes_the_wires_time_and_a_tick() {
    let rig = rig(1);
    let (near, far) = tokio::io::duplex(4096);
    let mut device = device(&rig);
    let boot = Instant::now();
    let exchange = async {
        let mut host = Host::new(near, 1, 9600);
        host.identify().await;
        boot.elapsed()
    };
    let took = tokio::select! {
        biased;
        took = exchange => took,
        served = serve(far, &mut device, boot, Wire::new(9600)) => panic!("{served:?}"),
    };
    // At 9600 baud a byte takes 1.04 ms: some 15 bytes there, more back.
    assert!(took >= Duration::from_millis(30) && took < Duration::from_millis(200), "{took:?}");
}

#[tokio::test]
async fn a_device_on_a_pseudo_terminal_keeps_its_home_between_clients() {
    let rig = quick_rig();
    let mut device = device(&rig);
    let pty = Pty::open(None).unwrap();
    let path = pty.path().to_string_lossy().into_owned();
    let open = || SerialStream::open(&tokio_serial::new(path.clone(), 1_000_000)).unwrap();
    let clients = async {
        let boot_id = |reply: Reply| match reply {
            Reply::Identity(identity) => identity.boot_id,
            other => panic!("{other:?}"),
        };
        let mut first = Host::new(open(), 1, 1_000_000);
        let booted = boot_id(first.identify().await);
        first.home().await;
        drop(first);
        tokio::time::sleep(Duration::from_millis(50)).await;
        let mut second = Host::new(open(), 2, 1_000_000);
        assert_eq!(boot_id(second.identify().await), booted);
        second.set_last_id(1);
        // Unhomed, it would refuse to move.
        second.move_to(counts(1.0, 0.0, 0.0, 0.0)).await;
        second.dwell(0, 0, Shutter::Open).await
    };
    let reading = tokio::select! {
        biased;
        reading = clients => reading,
        served = serve(pty, &mut device, Instant::now(), Wire::new(1_000_000)) => panic!("{served:?}"),
    };
    assert_eq!(reading.n, 200);
}
