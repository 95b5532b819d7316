//! What could break: light that depends on what it should not, noise that is not the stated one,
//! or a frame of coordinates that is mirrored.

mod bench;

use core::f64::consts::PI;
use std::sync::Arc;

use bench::{compiled, counts, exact_rig};
use firmware_protocol::{Board, Illumination, Instant, Shutter};
use sim::{
    Compiled, EffectRow, Emitter, Nominal, Quantity, Region, Scene, Shape, Simulated,
    SimulatedBoard, Tabulated, Terms, compile,
};

const FULL_SCALE: f64 = 8_388_608.0;

fn lambertian(radiance: f64) -> Scene {
    let patch = Emitter::lambertian(Shape::rectangle(0.0, 0.0, 0.2, 0.2), radiance);
    Scene::new(Quantity::Radiance).with(patch).unwrap()
}

/// A board whose axes have been homed as the device core would do it.
fn homed(compiled: &Arc<Compiled>) -> SimulatedBoard {
    let mut board = SimulatedBoard::new(Arc::clone(compiled), 0);
    for channel in 0..4 {
        let span = f64::from(board.axes()[usize::from(channel)].high) * 2.0;
        board.begin_search(Instant::ZERO, channel);
        board.set_setpoint(Instant::ZERO, channel, -span);
        board.set_setpoint(Instant::ZERO, channel, span);
        let mark = board.home_mark(Instant::ZERO, channel).expect("within the travel");
        board.set_setpoint(Instant::ZERO, channel, mark);
        board.set_home(Instant::ZERO, channel);
    }
    board
}

fn go_to(board: &mut SimulatedBoard, theta_deg: f64, phi_deg: f64, x_m: f64, y_m: f64) {
    for (channel, target) in (0..).zip(counts(theta_deg, phi_deg, x_m, y_m).0) {
        board.set_setpoint(Instant::ZERO, channel, f64::from(target));
    }
}

/// ADC readings of one dwell, counts.
fn dwell(board: &mut SimulatedBoard, reading: u32, shutter: Shutter, n: usize) -> Vec<f64> {
    let rested = Instant::from_micros(10_000_000);
    board.begin_dwell(rested, Illumination { reading, gain: 0, shutter });
    (0..n).map(|_| f64::from(board.convert(rested).unwrap())).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

/// The signal as radiance, W·m⁻²·sr⁻¹.
fn radiance(compiled: &Arc<Compiled>, board: &mut SimulatedBoard) -> f64 {
    let counts = mean(&dwell(board, 0, Shutter::Open, 200));
    counts / FULL_SCALE * 1e-6 / compiled.current_per_radiance()
}

#[test]
fn a_lambertian_patch_has_one_radiance_from_anywhere() {
    for (distance_m, spot_radius_m) in [(0.1, 0.002), (0.3, 0.002), (0.9, 0.004)] {
        let mut rig = exact_rig();
        rig.detector.distance_m = distance_m;
        rig.detector.spot_radius_m = spot_radius_m;
        // As far as 85° the beam of the nearest rig goes over 0.5 m of the sample.
        let patch = Emitter::lambertian(Shape::rectangle(0.0, 0.0, 2.0, 2.0), 30.0);
        let scene = Scene::new(Quantity::Radiance).with(patch).unwrap();
        let compiled = compile(scene, rig, Simulated::default(), &Terms::default()).unwrap();
        assert!(row(&compiled, "finite-beam").included);
        let compiled = Arc::new(compiled);
        let mut board = homed(&compiled);
        for theta in [-85.0, -30.0, 0.0, 45.0, 80.0] {
            for (phi, x_m, y_m) in [(0.0, 0.0, 0.0), (170.0, 0.03, -0.04), (-60.0, -0.04, 0.02)] {
                go_to(&mut board, theta, phi, x_m, y_m);
                let found = radiance(&compiled, &mut board);
                assert!((found / 30.0 - 1.0).abs() < 2e-5, "{found} at {distance_m} m, {theta}°");
            }
        }
        go_to(&mut board, 95.0, 0.0, 0.0, 0.0);
        assert_eq!(radiance(&compiled, &mut board).to_bits(), 0, "from behind nothing is seen");
    }
}

#[test]
fn noise_has_the_sigma_of_its_model() {
    const N: usize = 40_000;
    // The standard error of a deviation of N readings is 1 / sqrt(2 N) = 0.35 %.
    let check = |what: &str, found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 0.02, "{what}: {found} beside {expected}");
    };
    let count_a = 1e-6 / FULL_SCALE;
    let shot_only = compiled(lambertian(40.0), exact_rig(), 2);
    let current_a = 40.0 * shot_only.current_per_radiance();
    let shot = (1.602_176_634e-19 * current_a * 2000.0).sqrt() / count_a;
    let found = deviation(&dwell(&mut homed(&shot_only), 1, Shutter::Open, N));
    check("shot", found, shot.hypot(1.0 / 12.0_f64.sqrt()));

    let mut noisy = exact_rig();
    noisy.detector.read_noise_a = 5e-12;
    let noisy = compiled(lambertian(40.0), noisy, 2);
    let read = 5e-12 / count_a;
    check("read", deviation(&dwell(&mut homed(&noisy), 1, Shutter::Closed, N)), read);
    check("both", deviation(&dwell(&mut homed(&noisy), 1, Shutter::Open, N)), read.hypot(shot));

    let mut coarse = exact_rig();
    coarse.detector.adc_bits = 12;
    let coarse = compiled(lambertian(40.0), coarse, 2);
    let errors: Vec<f64> = (0..2000_u32)
        .map(|i| {
            // Radiances spread evenly over many counts: the rounding error is uniform.
            let mut board = homed(&compiled(
                lambertian(20.0 + f64::from(i) * 0.01),
                {
                    let mut rig = exact_rig();
                    rig.detector.adc_bits = 12;
                    rig
                },
                2,
            ));
            let exact =
                (20.0 + f64::from(i) * 0.01) * coarse.current_per_radiance() / 1e-6 * 2048.0;
            dwell(&mut board, 1, Shutter::Open, 1)[0] - exact
        })
        .collect();
    check("quantisation", deviation(&errors) / 1.03, 1.0 / 12.0_f64.sqrt() / 1.03);
}

#[test]
fn switching_one_effect_leaves_the_noise_of_others_alone() {
    let with = |change: &dyn Fn(&mut Nominal, &mut Simulated)| {
        let (mut rig, mut simulated) = (exact_rig(), Simulated::default());
        change(&mut rig, &mut simulated);
        let compiled = compile(lambertian(40.0), rig, simulated, &Terms::seeded(4)).unwrap();
        dwell(&mut homed(&Arc::new(compiled)), 9, Shutter::Open, 500)
    };
    let differences =
        |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
    let bare = with(&|_, _| {});
    let read = with(&|rig, _| rig.detector.read_noise_a = 5e-12);
    // With a dark current on top, the difference is constant but for rounding and the little that
    // it adds to the shot noise's sigma.
    let dark = with(&|_, simulated| simulated.dark_current_a = 1e-11);
    assert!(deviation(&differences(&dark, &bare)) < 0.6);
    let both = with(&|rig, simulated| {
        rig.detector.read_noise_a = 5e-12;
        simulated.dark_current_a = 1e-11;
    });
    let read_alone = differences(&read, &bare);
    let read_over_dark = differences(&both, &dark);
    assert!(deviation(&read_alone) > 30.0);
    assert!(deviation(&differences(&read_alone, &read_over_dark)) < 1.0, "the same read noise");
    // Drawn uncertainties have draws of their own.
    let drawn = with(&|rig, _| rig.axes[0].u_zero = 1e-3);
    assert_eq!(drawn, bare, "a Lambertian patch does not care for the arm's zero");
}

#[test]
fn the_same_seed_and_reading_give_the_same_counts_whatever_was_read_before() {
    let mut rig = exact_rig();
    rig.detector.read_noise_a = 5e-12;
    let compiled = compiled(lambertian(40.0), rig, 4);
    let mut board = homed(&compiled);
    let first = dwell(&mut board, 17, Shutter::Open, 100);
    dwell(&mut board, 18, Shutter::Closed, 33);
    assert_eq!(dwell(&mut board, 17, Shutter::Open, 100), first);
    assert_ne!(dwell(&mut board, 19, Shutter::Open, 100), first);
    assert_eq!(dwell(&mut homed(&compiled), 17, Shutter::Open, 100), first);
}

#[test]
fn drawn_uncertainties_spread_as_stated() {
    let spread = |change: &dyn Fn(&mut Nominal), expected: f64| {
        let bare = compiled(lambertian(1.0), exact_rig(), 0).current_per_radiance();
        let values: Vec<f64> = (0..2000)
            .map(|seed| {
                let mut rig = exact_rig();
                change(&mut rig);
                compiled(lambertian(1.0), rig, seed).current_per_radiance() / bare - 1.0
            })
            .collect();
        let rms = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        assert!((rms / expected - 1.0).abs() < 0.06, "{rms} beside {expected}");
    };
    spread(&|rig| rig.detector.u_responsivity_relative = 0.01, 0.01);
    spread(&|rig| rig.detector.u_distance_m = 0.3e-3, 2e-3);
    spread(&|rig| rig.detector.u_pupil_radius_m = 6.25e-6, 2e-3);
    spread(&|rig| rig.detector.u_spot_radius_m = 2.5e-6, 2e-3);
}

/// A table without any symmetry: bright near C = 70°, growing with γ.
fn asymmetric() -> Tabulated {
    let gamma: Vec<f64> = (0..=18).map(|i| 5.0 * f64::from(i)).collect();
    let c: Vec<f64> = (0..=24).map(|i| 15.0 * f64::from(i)).collect();
    Tabulated::new(&c, &gamma, |c, gamma| {
        let lobe =
            (1.0 + (c - 70.0).to_radians().cos()) * (1.0 + 0.3 * (3.0 * c).to_radians().sin());
        0.1 * (0.2 + lobe * gamma / 90.0) * (1.0 - gamma / 90.0)
    })
    .unwrap()
}

#[test]
fn c_runs_against_phi_through_the_gantrys_own_mechanics() {
    let shape = Shape::rectangle(0.0, 0.0, 0.03, 0.05);
    let scene =
        Scene::new(Quantity::Radiance).with(Emitter::tabulated(shape, asymmetric())).unwrap();
    let compiled = compiled(scene, exact_rig(), 1);
    let mut board = homed(&compiled);
    let table = |c_deg: f64, gamma_deg: f64| {
        let lobe = (1.0 + (c_deg - 70.0).to_radians().cos())
            * (1.0 + 0.3 * (3.0 * c_deg).to_radians().sin());
        let intensity = 0.1 * (0.2 + lobe * gamma_deg / 90.0) * (1.0 - gamma_deg / 90.0);
        intensity / (0.03 * 0.05 * gamma_deg.to_radians().cos())
    };
    let mut mirrored = 0.0_f64;
    for (arm, turntable, c, gamma) in [
        (30.0, -60.0, 60.0, 30.0),
        (30.0, 60.0, 300.0, 30.0),
        (-30.0, 120.0, 60.0, 30.0),
        (-45.0, -105.0, 285.0, 45.0),
        (60.0, 180.0, 180.0, 60.0),
        (60.0, 90.0, 270.0, 60.0),
    ] {
        go_to(&mut board, arm, turntable, 0.0, 0.0);
        let found = radiance(&compiled, &mut board);
        let expected = table(c, gamma);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} beside {expected} at C {c}°");
        mirrored = mirrored.max((table(360.0 - c, gamma) / expected - 1.0).abs());
    }
    assert!(mirrored > 0.3, "the source tells C = φ from C = -φ");
}

#[test]
fn the_stage_carries_the_point_under_the_axis() {
    let corner =
        Emitter::lambertian(Shape::Rectangle { x_m: (0.01, 0.02), y_m: (-0.03, -0.02) }, 40.0);
    let scene = Scene::new(Quantity::Radiance).with(corner).unwrap();
    let compiled = compiled(scene, exact_rig(), 1);
    let mut board = homed(&compiled);
    for (x_m, y_m, seen) in [
        (0.015, -0.025, true),
        (-0.015, 0.025, false),
        (0.015, 0.025, false),
        (-0.025, 0.015, false),
    ] {
        go_to(&mut board, 20.0, 77.0, x_m, y_m);
        assert_eq!(radiance(&compiled, &mut board) > 1.0, seen, "at {x_m}, {y_m}");
    }
}

#[test]
fn truth_is_what_the_definitions_say() {
    let region =
        Region { x_m: (-0.02, 0.02), y_m: (-0.01, 0.03), theta_max_rad: 50.0_f64.to_radians() };
    let close = |found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 1e-13, "{found} beside {expected}");
    };
    let patch = |emitter: Emitter| {
        compiled(Scene::new(Quantity::Radiance).with(emitter).unwrap(), exact_rig(), 1)
    };
    let half = Shape::Rectangle { x_m: (0.0, 0.1), y_m: (-0.1, 0.1) };
    let sin2 = region.theta_max_rad.sin().powi(2);

    let uniform = patch(Emitter::lambertian(half.clone(), 12.0));
    let truth = uniform.truth(region);
    close(truth.exitance(), PI * 12.0 / 2.0);
    close(truth.exitance_within_region(), PI * 12.0 / 2.0 * sin2);
    close(truth.flux(), PI * 6.0 * 0.04 * 0.04);
    let peak = truth.peak().unwrap();
    close(peak.value, 12.0);
    assert!(half.contains(peak.x_m, peak.y_m) && peak.x_m < 0.02);

    let lobe = patch(Emitter::cosine_power(half.clone(), 20.0, 12.0));
    let truth = lobe.truth(region);
    close(truth.exitance(), PI * 12.0 / 22.0);
    close(
        truth.exitance_within_region(),
        PI * 12.0 / 22.0 * (1.0 - region.theta_max_rad.cos().powi(22)),
    );
    let by_exitance = patch(Emitter::cosine_power_exitance(half, 20.0, 7.0));
    close(by_exitance.truth(region).exitance(), 3.5);

    let disk = Shape::disk(0.0, 0.01, 0.005);
    let small = patch(Emitter::lambertian_exitance(disk, 3.0));
    close(small.truth(region).flux(), 3.0 * PI * 0.005 * 0.005);
    assert_eq!(small.truth(region).radiance(0.006, 0.01, 0.1, 0.0).to_bits(), 0);
}

#[test]
fn truth_of_a_table_is_its_flux_over_its_area() {
    let area = 0.03 * 0.05;
    let shape = Shape::rectangle(0.0, 0.0, 0.03, 0.05);
    let scene =
        Scene::new(Quantity::Radiance).with(Emitter::tabulated(shape, asymmetric())).unwrap();
    let compiled = compiled(scene, exact_rig(), 1);
    let region = Region { x_m: (-0.01, 0.01), y_m: (-0.02, 0.02), theta_max_rad: 1.2 };
    let truth = compiled.truth(region);
    // Independently: the midpoint rule over C and γ, of L cos θ rather than of I.
    let sum = |gamma_max: f64| {
        let (rings, sectors) = (2000_u32, 720_u32);
        let (dg, dp) = (gamma_max / f64::from(rings), 2.0 * PI / f64::from(sectors));
        let mut sum = 0.0;
        for i in 0..rings {
            let theta = (f64::from(i) + 0.5) * dg;
            let weight = theta.cos() * theta.sin() * dg * dp;
            for j in 0..sectors {
                let phi = (f64::from(j) + 0.5) * dp - PI;
                sum += weight * truth.radiance(0.0, 0.0, theta, phi);
            }
        }
        sum
    };
    assert!((truth.exitance() / sum(PI / 2.0) - 1.0).abs() < 1e-5);
    assert!((truth.exitance_within_region() / sum(1.2) - 1.0).abs() < 1e-5);
    assert!((truth.flux() / (truth.exitance() * 0.02 * 0.04) - 1.0).abs() < 1e-15);
    assert!((asymmetric().flux_within(PI / 2.0) / (area * truth.exitance()) - 1.0).abs() < 1e-14);
}

fn row(rig: &Compiled, name: &str) -> EffectRow {
    rig.effects().iter().find(|row| row.name == name).cloned().expect("a row for each effect")
}

#[test]
fn a_rig_holds_what_is_called_for_and_says_why() {
    let bare = compiled(lambertian(1.0), exact_rig(), 1);
    for name in ["dark-current", "read-noise", "theta-zero", "distance", "gain[0]", "finite-beam"] {
        assert!(!row(&bare, name).included, "{name}");
    }
    assert!(row(&bare, "finite-beam").how.contains("left out by request"));
    let mut rig = exact_rig();
    rig.detector.read_noise_a = 2e-13;
    rig.detector.gains[0].u_relative = 5e-4;
    rig.axes[0].u_zero = 3e-4;
    rig.axes[2].u_zero = 3e-4;
    let full = compiled(lambertian(1.0), rig, 1);
    let bound = |name: &str| row(&full, name).bound.expect("a bound").value;
    assert!(["read-noise", "x-zero", "gain[0]"].iter().all(|name| row(&full, name).included));
    // The mean of a dwell's hundred ADC readings, beside the smallest signal or half of it.
    let read_noise = 2e-14 / bare.current_per_radiance();
    assert!((1.0..2.001).contains(&(bound("read-noise") / read_noise)), "{}", bound("read-noise"));
    assert!((bound("gain[0]") / 5e-4 - 1.0).abs() < 1e-12);
    // On an even patch no direction matters, but places at its outline do.
    assert!(!row(&full, "theta-zero").included && row(&full, "theta-zero").cause.is_some());
    assert_eq!(
        [bound("theta-zero"), bound("x-zero")].map(f64::to_bits),
        [0.0, 1.0_f64].map(f64::to_bits)
    );
    let names: std::collections::BTreeSet<_> = full.effects().iter().map(|row| &row.name).collect();
    assert_eq!(names.len(), full.effects().len(), "no effect twice");
}

#[test]
fn rigs_that_cannot_be_are_refused() {
    let refused = |change: &dyn Fn(&mut Nominal)| {
        let mut rig = exact_rig();
        change(&mut rig);
        let mut outcomes = (0..40).map(|seed| {
            compile(lambertian(1.0), rig.clone(), Simulated::default(), &Terms::seeded(seed))
        });
        outcomes.find_map(Result::err).expect("refused").to_string()
    };
    assert!(refused(&|rig| rig.quantity = Quantity::Luminance).contains("radiance"));
    assert!(refused(&|rig| rig.axes[1].channel = 2).contains("channels [2, 2, 3, 1]"));
    assert!(refused(&|rig| rig.detector.adc_bits = 1).contains("adc bits"));
    assert!(refused(&|rig| rig.detector.gains.clear()).contains("gain ranges"));
    assert!(refused(&|rig| rig.axes[0].counts_per_unit = f64::NAN).contains("theta"));
    assert!(refused(&|rig| rig.detector.u_distance_m = 1.0).contains("too large"));
}
