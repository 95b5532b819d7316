//! What could break: a finite beam that is not the mean over all its rays, a bound that does not
//! hold or says nothing, or a form that costs where a cheaper one would do.

mod bench;

use core::f64::consts::TAU;
use std::sync::Arc;

use bench::exact_rig;
use glam::{DVec2, DVec3};
use sim::{
    Axis, Compiled, Emitter, Nominal, Quantity, Ray, Region, Scene, Shape, Simulated, Tabulated,
    Terms, compile,
};

const MM: f64 = 1e-3;
/// Half the noise floor of the bench's rig: its converter's steps, W·m⁻²·sr⁻¹.
const FLOOR: f64 = 3e-7;

fn region(half_mm: f64, theta_max_deg: f64) -> Region {
    let side = (-half_mm * MM, half_mm * MM);
    Region { x_m: side, y_m: side, theta_max_rad: theta_max_deg.to_radians() }
}

fn rig(scene: Scene, nominal: Nominal, terms: &Terms) -> Arc<Compiled> {
    Arc::new(compile(scene, nominal, Simulated::default(), terms).expect("a sound rig"))
}

fn forced(region: Region) -> Terms {
    Terms { region: Some(region), force: vec!["finite-beam".into()], ..Terms::default() }
}

fn of(emitters: impl IntoIterator<Item = Emitter>) -> Scene {
    let mut scene = Scene::new(Quantity::Radiance);
    for emitter in emitters {
        scene.add(emitter).unwrap();
    }
    scene
}

fn axis(x_mm: f64, y_mm: f64, theta_deg: f64, phi_deg: f64) -> Axis {
    let ray = Ray::new(x_mm * MM, y_mm * MM, theta_deg.to_radians(), phi_deg.to_radians());
    Axis { spot: ray.point, direction: ray.direction }
}

/// The mean over the beam of the bench's rig, by brute force: points of pupil and spot from a
/// lattice, each ray weighted with cos⁴. Nothing of the simulator but the radiance of a ray. With
/// its standard error, from sixteen shifted lattices.
fn brute_force(rig: &Compiled, nominal: &Nominal, axis: &Axis, n: u32) -> (f64, f64) {
    let detector = &nominal.detector;
    let helper = if axis.direction.z.abs() > 0.9 { DVec3::X } else { DVec3::Z };
    let u = axis.direction.cross(helper).normalize();
    let v = axis.direction.cross(u);
    let disk = |radius: f64, a: f64, b: f64| {
        let at = DVec2::from_angle(TAU * b) * (radius * a.sqrt());
        u * at.x + v * at.y
    };
    let root = 1.167_303_978_261_418_7_f64;
    let of_shift = |shift: u32| {
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in 0..n {
            let at = |k: i32| {
                let start = (f64::from(shift) * 0.618_033_988_75 * f64::from(k)).fract();
                (start + f64::from(i) * root.powi(-k)).fract()
            };
            let on_spot = axis.spot + disk(detector.spot_radius_m, at(1), at(2));
            let on_pupil = axis.spot
                + axis.direction * detector.distance_m
                + disk(detector.pupil_radius_m, at(3), at(4));
            let along = on_pupil - on_spot;
            let direction = along.normalize();
            let weight = direction.dot(axis.direction).powi(4);
            weights += weight;
            if on_pupil.z > 0.0 && direction.z > 0.0 {
                let crossing = on_pupil - direction * (on_pupil.z / direction.z);
                sum += weight * rig.radiance(&Ray { point: crossing, direction });
            }
        }
        sum / weights
    };
    let means: Vec<f64> = (0..16).map(of_shift).collect();
    let mean = means.iter().sum::<f64>() / 16.0;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 15.0;
    (mean, (variance / 16.0).sqrt())
}

/// A table without symmetry, with kinks at its nodes.
fn table() -> Tabulated {
    let gamma: Vec<f64> = (0..=18).map(|i| 5.0 * f64::from(i)).collect();
    let c: Vec<f64> = (0..=24).map(|i| 15.0 * f64::from(i)).collect();
    Tabulated::new(&c, &gamma, |c, gamma| {
        let lobe = (1.0 + (c - 70.0).to_radians().cos()) * gamma / 90.0;
        (1.0 + lobe) * gamma.to_radians().cos()
    })
    .unwrap()
}

#[test]
fn the_beam_agrees_with_brute_force_over_outlines_corners_and_lobes() {
    let square = Shape::rectangle(0.0, 0.0, 20.0 * MM, 20.0 * MM);
    let disk = Shape::disk(16.0 * MM, 0.0, 4.0 * MM);
    let scenes = [
        of([Emitter::lambertian(square.clone(), 10.0), Emitter::lambertian(disk.clone(), 30.0)]),
        of([Emitter::cosine_power(square.clone(), 40.0, 10.0), Emitter::lambertian(disk, 30.0)]),
        of([Emitter::tabulated(square, table())]),
    ];
    let mut nominal = exact_rig();
    let mut worst = 0.0_f64;
    for (pupil_mm, spot_mm) in [(6.25, 2.5), (12.0, 1.0), (2.0, 8.0)] {
        nominal.detector.pupil_radius_m = pupil_mm * MM;
        nominal.detector.spot_radius_m = spot_mm * MM;
        for scene in &scenes {
            let rig = rig(scene.clone(), nominal.clone(), &forced(region(9.0, 80.0)));
            for (x, y, theta, phi) in [
                (10.0, 0.0, 0.0, 0.0),
                (9.0, 9.5, 30.0, 20.0),
                (0.0, 0.0, 84.0, 45.0),
                (13.0, 1.0, 60.0, 180.0),
                (16.0, 0.0, 0.0, 0.0),
                (16.0, 4.2, 75.0, -70.0),
                (3.0, -2.0, 40.0, 100.0),
            ] {
                let axis = axis(x, y, theta, phi);
                let (expected, error) = brute_force(&rig, &nominal, &axis, 2000);
                let found = rig.seen_radiance(&axis);
                let off = (found - expected).abs();
                worst = worst.max(off / expected.max(1e-3));
                let row = rig.effects().iter().find(|row| row.name == "finite-beam").unwrap();
                let stated = row.error.expect("an error of the form").max(rig.tolerance());
                assert!(stated < 2e-3, "{row:?}");
                assert!(
                    off <= 5.0 * error + stated * expected.max(FLOOR),
                    "{pupil_mm} {spot_mm} at {x} {y} {theta} {phi}: {found}, {expected} ± {error}, {stated:e}"
                );
            }
        }
    }
    assert!(worst > 1e-7, "nothing was compared");
}

#[test]
fn an_even_patch_that_fills_the_beam_is_seen_exactly_and_from_any_distance() {
    let square = Shape::rectangle(0.0, 0.0, 0.4, 0.4);
    for distance_m in [0.1, 0.3, 1.0] {
        let mut nominal = exact_rig();
        nominal.detector.distance_m = distance_m;
        let scene = of([Emitter::lambertian(square.clone(), 10.0)]);
        let rig = rig(scene, nominal, &forced(region(20.0, 80.0)));
        let seen = [0.0, 30.0, 60.0].map(|theta| rig.seen_radiance(&axis(5.0, -3.0, theta, 33.0)));
        assert_eq!(seen.map(f64::to_bits), [10.0_f64.to_bits(); 3], "{distance_m}");
        let row = rig.effects().iter().find(|row| row.name == "finite-beam").unwrap();
        assert_eq!(row.bound.unwrap().value.to_bits(), 0, "no influence at all");
    }
}

#[test]
fn half_a_beam_over_an_edge_sees_half() {
    let half = Shape::Rectangle { x_m: (-0.5, 0.0), y_m: (-0.5, 0.5) };
    let rig = rig(of([Emitter::lambertian(half, 10.0)]), exact_rig(), &Terms::default());
    // Across the edge from straight above, and along it at any angle, by symmetry.
    for theta in [0.0, 40.0, 80.0] {
        let seen = rig.seen_radiance(&axis(0.0, 1.0, theta, 90.0));
        assert!((seen / 5.0 - 1.0).abs() < rig.tolerance(), "{seen} at {theta}°");
        assert!(rig.tolerance() < 1e-5);
    }
}

#[test]
fn bounds_hold_and_are_not_idle() {
    // Patches of several sizes around a region of ±5 mm: from far inside to a sliver of the beam.
    let mut spans = (f64::INFINITY, 0.0_f64);
    for half_mm in [5.5, 7.0, 12.0, 20.0, 21.5, 22.6] {
        for exponent in [None, Some(1.0), Some(6.0), Some(60.0)] {
            let square = Shape::rectangle(0.0, 0.0, 2.0 * half_mm * MM, 2.0 * half_mm * MM);
            let emitter = match exponent {
                None => Emitter::lambertian(square, 10.0),
                Some(n) => Emitter::cosine_power(square, n, 10.0),
            };
            let terms = Terms { tolerance: Some(1e-9), ..forced(region(5.0, 80.0)) };
            let rig = rig(of([emitter]), exact_rig(), &terms);
            let row = rig.effects().iter().find(|row| row.name == "finite-beam").unwrap();
            let bound = row.bound.unwrap().value;
            let mut influence = 0.0_f64;
            for (x, y) in [(0.0, 0.0), (5.0, 5.0), (-5.0, 4.9)] {
                for theta in [0.0, 25.0, 55.0, 79.5, 80.0] {
                    for phi in 0..12 {
                        let axis = axis(x, y, theta, 30.0 * f64::from(phi));
                        let ray = Ray { point: axis.spot, direction: axis.direction };
                        let (with, without) = (rig.seen_radiance(&axis), rig.radiance(&ray));
                        let reading = with.max(without).max(1e-5);
                        influence = influence.max((with - without).abs() / reading);
                    }
                }
            }
            assert!(influence <= bound, "±{half_mm} mm, {exponent:?}: {influence} above {bound}");
            let is_tight = bound <= 100.0 * (influence + 1e-8);
            assert!(is_tight || bound == 0.0, "±{half_mm} mm, {exponent:?}: {influence}, {bound}");
            if bound > 0.0 {
                spans = (spans.0.min(influence), spans.1.max(influence));
            }
        }
    }
    assert!(spans.0 < 1e-3 && spans.1 > 0.3, "influences span {spans:?}");
}

#[test]
fn the_beam_is_left_out_where_it_does_not_show_and_said_so() {
    let square = || Shape::rectangle(0.0, 0.0, 0.1, 0.1);
    let row = |emitter: Emitter, terms: &Terms| {
        let rig = rig(of([emitter]), exact_rig(), terms);
        rig.effects().iter().find(|row| row.name == "finite-beam").cloned().unwrap()
    };
    let within = Terms { region: Some(region(10.0, 60.0)), ..Terms::default() };
    let even = row(Emitter::lambertian(square(), 50.0), &within);
    assert!(!even.included && even.how.contains("changes nothing"), "{even:?}");
    let lobe = row(Emitter::cosine_power(square(), 10.0, 50.0), &within);
    assert!(lobe.included && lobe.bound.unwrap().value > 1e-4, "{lobe:?}");
    let tolerant = Terms { tolerance: Some(0.05), ..within.clone() };
    assert!(!row(Emitter::cosine_power(square(), 10.0, 50.0), &tolerant).included);
    let without = Terms { without: vec!["finite-beam".into()], ..within };
    let out = row(Emitter::cosine_power(square(), 10.0, 50.0), &without);
    assert!(!out.included && out.how.contains("by request"), "{out:?}");
    // The whole patch as region: its outline is there.
    let whole = row(Emitter::lambertian(square(), 50.0), &Terms::default());
    assert!(whole.included && whole.cause.unwrap().contains("crosses the region"));
}
