//! What could break: a window that sees another place than its encoders say, light that depends
//! on how its window was reached, an axis that has not come to its speed when windows begin.

mod bench;

use std::sync::Arc;

use bench::{COUNTS_PER_DEG, Host, counts, device, exact_rig};
use firmware_protocol::{AxisCounts, CommandId, Reply, Sweep, Window};
use sim::{
    Compiled, Emitter, LinkFaults, Nominal, Quantity, Scene, Shape, Simulated, Terms, Wire,
    compile, serve,
};
use tokio::time::Instant;

const RADIANCE: f64 = 40.0;
const EXPONENT: f64 = 300.0;

/// Half its peak at 3.9° from the normal.
fn lobe() -> Scene {
    let disk = Shape::rectangle(0.0, 0.0, 0.04, 0.04);
    let emitter = Emitter::cosine_power(disk, EXPONENT, RADIANCE);
    Scene::new(Quantity::Radiance).with(emitter).unwrap()
}

/// Through the zenith at 20°/s from -10° to 10°, in windows of 0.5°: 25 ms.
fn over_the_top() -> Sweep {
    let step = counts(0.5, 0.0, 0.0, 0.0);
    Sweep {
        id: CommandId(0),
        reading: 100,
        gain: 0,
        settle_us: 0,
        lead_us: 50_000,
        readings: 50,
        windows: 40,
        from: counts(-10.0, 30.0, 0.002, 0.001),
        step,
    }
}

/// On its way the beam is averaged, and its own width has tests of its own.
fn rig(nominal: Nominal) -> Arc<Compiled> {
    // With the lead that plans give a sweep an axis has settled, and its settling is left out.
    let force = vec!["theta-settling".to_owned()];
    let force = if nominal.axes[0].settle_s > 0.0 { force } else { Vec::new() };
    let terms = Terms {
        force,
        without: vec!["finite-beam".to_owned()],
        sweep: [20.0_f64.to_radians(), 0.0, 0.0, 0.0],
        ..Terms::seeded(1)
    };
    Arc::new(compile(lobe(), nominal, Simulated::default(), &terms).unwrap())
}

async fn swept(rig: &Arc<Compiled>, sweeps: &[Sweep], wire: Wire, baud: u32) -> Vec<Window> {
    let (near, far) = tokio::io::duplex(4096);
    let mut device = device(rig);
    let boot = Instant::now();
    let host = async {
        let mut host = Host::new(near, 7, baud);
        assert!(matches!(host.identify().await, Reply::Identity(_)));
        host.home().await;
        let mut windows = Vec::new();
        for sweep in sweeps {
            windows.extend(host.sweep(sweep.clone()).await);
        }
        windows
    };
    tokio::select! {
        biased;
        windows = host => windows,
        served = serve(far, &mut device, boot, wire) => panic!("{served:?}"),
    }
}

/// The mean radiance between two polar angles, by Gauss's rule of five points on small parts.
fn mean_radiance(from_deg: f64, to_deg: f64) -> f64 {
    let parts = 200;
    let at = |i: i32| {
        let part = (f64::from(i) + 0.5) / f64::from(parts);
        let theta = (from_deg + (to_deg - from_deg) * part).to_radians();
        RADIANCE * theta.cos().powf(EXPONENT)
    };
    (0..parts).map(at).sum::<f64>() / f64::from(parts)
}

fn theta_deg(counts: &AxisCounts) -> f64 {
    f64::from(counts.0[2]) / COUNTS_PER_DEG
}

#[tokio::test(start_paused = true)]
async fn a_window_is_the_mean_over_the_places_between_its_encoder_positions() {
    let rig = rig(exact_rig());
    let wire = Wire::new(1_000_000);
    let windows = Box::pin(swept(&rig, &[over_the_top()], wire, 1_000_000)).await;
    assert_eq!(windows.len(), 40);
    let full = RADIANCE * rig.current_per_radiance() / 1e-6 * 8_388_608.0;
    for (k, window) in (0..).zip(&windows) {
        let from = theta_deg(&window.start);
        assert!((from - (-10.0 + 0.5 * f64::from(k))).abs() < 1e-9, "{k}: {from}");
        let moved = theta_deg(&window.moved);
        assert!((moved - 0.5).abs() < 1e-9, "{k}: {moved}");
        let expected = mean_radiance(from, from + moved) / RADIANCE;
        // Shot noise: 3e-6 of full scale for 50 readings.
        let found = window.mean / full;
        assert!((found - expected).abs() < 2e-5, "{k}: {found}, expected {expected}");
    }
    // In the steepest window the readings differ by their places.
    assert!(windows[12].variance > 5.0 * windows[19].variance);
}

#[tokio::test(start_paused = true)]
async fn noise_goes_by_the_windows_name_and_not_by_the_sweep_that_took_it() {
    let mut nominal = exact_rig();
    nominal.axes[0].u_readback = 0.002_f64.to_radians();
    nominal.axes[0].settle_s = 0.05;
    let rig = rig(nominal);
    let wire = || Wire::new(1_000_000);
    let whole = Box::pin(swept(&rig, &[over_the_top()], wire(), 1_000_000)).await;
    let part = |first: i32, windows: u16| {
        let whole = over_the_top();
        let from = whole.from.0.iter().zip(&whole.step.0).map(|(from, step)| from + first * step);
        let reading = whole.reading + first.unsigned_abs();
        Sweep { from: AxisCounts(from.collect()), windows, reading, ..whole }
    };
    let parts = [part(0, 15), part(15, 25)];
    let parts = Box::pin(swept(&rig, &parts, wire(), 1_000_000)).await;
    for (one, other) in whole.iter().zip(&parts) {
        assert_eq!((&one.start, &one.moved), (&other.start, &other.moved));
        assert!((one.mean - other.mean).abs() < 1e-3 * one.mean.abs().max(1.0), "{}", one.mean);
    }
    // What is latched in flight departs from even places by what the rig states.
    let off = whole.iter().filter(|window| (theta_deg(&window.moved) - 0.5).abs() > 1e-9).count();
    assert!(off > 20, "{off}");
    let noisy =
        Wire::new(115_200).with_faults(LinkFaults { drop_rate: 0.001, corrupt_rate: 0.001 }, 3);
    let noisy = Box::pin(swept(&rig, &[over_the_top()], noisy, 115_200)).await;
    let key = |windows: &[Window]| -> Vec<(u16, u64, AxisCounts)> {
        windows.iter().map(|w| (w.index, w.mean.to_bits(), w.start.clone())).collect()
    };
    assert_eq!(key(&noisy), key(&whole), "a noisy wire loses none and changes none");
}

#[tokio::test(start_paused = true)]
async fn without_a_lead_the_servo_still_comes_in_and_with_one_it_has() {
    let mut nominal = exact_rig();
    nominal.axes[0].settle_s = 0.05;
    let rig = rig(nominal);
    let wire = || Wire::new(1_000_000);
    let sweep = |lead_us| Sweep { lead_us, ..over_the_top() };
    let late = Box::pin(swept(&rig, &[sweep(0)], wire(), 1_000_000)).await;
    let early = Box::pin(swept(&rig, &[sweep(50_000)], wire(), 1_000_000)).await;
    // Behind by a (T/3)²: 120°/s² make 0.033°, and the encoder, on the load, says so.
    let behind = -10.0 - theta_deg(&late[0].start);
    assert!((behind - 120.0 / 3600.0).abs() < 2e-3, "{behind}");
    assert!((theta_deg(&late[2].start) + 9.0).abs() < 1e-9);
    assert!((theta_deg(&early[0].start) + 10.0).abs() < 1e-9);
    let expected = mean_radiance(-10.0, -9.5) / mean_radiance(-0.5, 0.0);
    assert!((early[0].mean / early[19].mean - expected).abs() < 2e-4);
}

#[test]
fn a_sweep_calls_for_motion_smear_and_a_run_at_rest_does_not() {
    let row = |sweep: [f64; 4]| {
        let terms = Terms { sweep, ..Terms::default() };
        let rig = compile(lobe(), exact_rig(), Simulated::default(), &terms).unwrap();
        rig.effects().iter().find(|row| row.name == "motion-smear").unwrap().clone()
    };
    let rest = row([0.0; 4]);
    assert!(!rest.included);
    let fast = row([60.0_f64.to_radians(), 0.0, 0.0, 0.0]);
    assert!(fast.included, "{fast:?}");
    let cause = fast.cause.clone().unwrap();
    assert!(cause.contains("theta sweeps at 60"), "{fast:?}");
}
