//! What could break: light on surfaces that does not agree with rays traced one by one, shadows that
//! are too sharp or in the wrong place, windows that add light.

mod bench;

use core::f64::consts::{PI, TAU};

use glam::DVec3;
use sim::{Compiled, Nominal, Quantity, Ray, Region, Scene, Simulated, Terms};
use spanned_toml::{Document, Source};

fn scene(text: &str) -> Scene {
    let document = Document::parse(Source::new("scene.toml", text)).unwrap();
    let load = |name: &str| match name {
        "sky.pgm" => Ok(b"P2 4 4 4\n4 1 0 2 1 2 3 1 0 0 0 0 0 0 0 0\n".to_vec()),
        _ => Err("no such file".to_owned()),
    };
    Scene::read(&document, Quantity::Radiance, &load).unwrap()
}

fn terms(half_mm: f64, theta_max_deg: f64) -> Terms {
    let side = (-half_mm / 1e3, half_mm / 1e3);
    let region = Region { x_m: side, y_m: side, theta_max_rad: theta_max_deg.to_radians() };
    let without = vec!["finite-beam".to_owned()];
    Terms { region: Some(region), tolerance: Some(0.0), without, ..Terms::default() }
}

fn compiled(text: &str, terms: &Terms) -> Compiled {
    sim::compile(scene(text), rig(), Simulated::default(), terms).unwrap()
}

fn rig() -> Nominal {
    bench::exact_rig()
}

const PANEL: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.8\nx_mm = [-50, 50]\n\
                     y_mm = [-50, 50]\n";

/// A generator of its own: numbers in [0, 1).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Irradiance on +z at a place, by rays to random points of a ball's near side: the solid angle of its
/// cone sampled evenly.
fn by_rays(
    place: DVec3,
    centre: DVec3,
    radius: f64,
    is_hidden: &dyn Fn(DVec3) -> bool,
) -> (f64, f64) {
    let mut dice = Dice(5);
    let (away, count) = (centre - place, 200_000_u32);
    let axis = away.normalize();
    let cos_min = (1.0 - (radius / away.length()).powi(2)).sqrt();
    let (e, f) = axis.any_orthonormal_pair();
    let solid = TAU * (1.0 - cos_min);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let cos = 1.0 - dice.roll() * (1.0 - cos_min);
        let sin = (1.0 - cos * cos).sqrt();
        let turn = TAU * dice.roll();
        let direction = axis * cos + (e * turn.cos() + f * turn.sin()) * sin;
        let value = if is_hidden(direction) { 0.0 } else { direction.z.max(0.0) };
        sum += value;
        squares += value * value;
    }
    let count = f64::from(count);
    let mean = sum / count;
    (solid * mean, solid * ((squares / count - mean * mean) / count).sqrt())
}

#[test]
fn a_lit_panel_is_as_bright_as_rays_find_in_light_penumbra_and_umbra() {
    let text = format!(
        "{PANEL}[[lamp]]\nkind = \"sphere\"\ncentre_mm = [10, 0, 1000]\nradius_mm = 20\n\
         radiance_w_per_m2_sr = 1000\n\
         [[occluder]]\nkind = \"half-plane\"\nx_max_mm = 0\nz_mm = 500\n\
         [[occluder]]\nkind = \"disk\"\ncentre_mm = [15, 2, 400]\naxis = [0.3, 0, 1]\nradius_mm = 4\n"
    );
    let compiled = compiled(&text, &terms(40.0, 60.0));
    let (centre, radius) = (DVec3::new(0.01, 0.0, 1.0), 0.02);
    let mut penumbra = 0;
    for (x, y) in
        [(-0.035, 0.0), (-0.02, 0.01), (-0.01, 0.0), (0.0, -0.03), (0.02, 0.005), (0.03, 0.0)]
    {
        let place = DVec3::new(x, y, 0.0);
        let is_hidden = |direction: DVec3| {
            let at = place + direction * (0.5 / direction.z);
            let (middle, normal) =
                (DVec3::new(0.015, 0.002, 0.4), DVec3::new(0.3, 0.0, 1.0).normalize());
            let t = normal.dot(middle - place) / normal.dot(direction);
            at.x < 0.0 || (place + direction * t - middle).length() < 0.004
        };
        let (irradiance, deviation) = by_rays(place, centre, radius, &is_hidden);
        let expected = 0.8 / PI * 1000.0 * irradiance;
        let allowed = 0.8 / PI * 1000.0 * 4.5 * deviation + 1e-12;
        for (theta, phi) in [(0.0, 0.0), (0.9, 2.0)] {
            let found = compiled.radiance(&Ray::new(x, y, theta, phi));
            assert!((found - expected).abs() <= allowed, "{x} {y}: {found} {expected} ± {allowed}");
        }
        penumbra += usize::from(deviation > 0.0);
    }
    assert!(penumbra >= 4, "{penumbra}");
}

#[test]
fn the_shadow_of_a_knife_edge_ends_where_tangents_say() {
    // Lamp and edge straight above each other, the edge halfway: the penumbra is as wide as the lamp.
    let text = format!(
        "{PANEL}[[lamp]]\nkind = \"disk\"\ncentre_mm = [0, 0, 1000]\naxis = [0, 0, 1]\nradius_mm = 10\n\
         radiance_w_per_m2_sr = 1000\n\
         [[occluder]]\nkind = \"half-plane\"\nx_max_mm = 0\nz_mm = 500\n"
    );
    let compiled = compiled(&text, &terms(30.0, 60.0));
    let at = |x_mm: f64| compiled.radiance(&Ray::new(x_mm / 1e3, 0.0, 0.0, 0.0));
    assert_eq!(at(-10.001).to_bits(), 0, "umbra");
    assert!(at(-9.9) > 0.0);
    let full = |x_mm: f64| {
        let x = x_mm / 1e3;
        // Ω̃ of a disk seen from beside its axis, by its own kernel: closed form on the axis alone.
        let up = radiometry::projected::Receiver::new(DVec3::new(x, 0.0, 0.0), DVec3::Z).unwrap();
        let disk = radiometry::shape::Disk::new(DVec3::Z, DVec3::Z, 0.01).unwrap();
        800.0 / PI * radiometry::projected::disk(&up, &disk).unwrap().sr()
    };
    assert!((at(10.001) / full(10.001) - 1.0).abs() < 1e-9);
    assert!(at(9.9) < full(9.9) * (1.0 - 1e-5));
    assert!((at(0.0) / full(0.0) - 0.5).abs() < 1e-9, "half of it in the middle");
    let row = |name: &str| compiled.effects().iter().find(|row| row.name == name).unwrap().clone();
    let shadow = row("shadow[0]");
    let cause = shadow.cause.unwrap();
    assert!(cause.contains("occluder[0] comes between lamp[0] and surface[0]"), "{cause}");
    assert!(shadow.included && (shadow.bound.unwrap().value - 1.0).abs() < 1e-12);
    assert!(!row("beam-shadow[0]").included, "it stands beyond the detector");
}

#[test]
fn a_lamp_or_an_occluder_in_the_beam_is_seen_but_is_not_the_samples() {
    let text = "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-50, 50]\ny_mm = [-50, 50]\n\
                radiance_w_per_m2_sr = 7\n\
                [[occluder]]\nkind = \"sphere\"\ncentre_mm = [30, 0, 100]\nradius_mm = 5\n\
                [[lamp]]\nkind = \"disk\"\ncentre_mm = [-30, 0, 100]\naxis = [0, 0, 1]\nradius_mm = 5\n\
                radiance_w_per_m2_sr = 3\n";
    let compiled = compiled(text, &terms(10.0, 60.0));
    let theta = (0.3f64).atan();
    let seen = |phi: f64| {
        let ray = Ray::new(0.0, 0.0, theta, phi);
        compiled.seen_radiance(&sim::Axis { spot: ray.point, direction: ray.direction })
    };
    assert_eq!(seen(0.0).to_bits(), 0, "the ball is black");
    assert!((seen(PI) - 3.0).abs() < 1e-12, "the lamp hides the sample and shines itself");
    assert!((seen(1.0) - 7.0).abs() < 1e-12);
    for phi in [0.0, PI, 1.0] {
        let found = compiled.radiance(&Ray::new(0.0, 0.0, theta, phi));
        assert!((found - 7.0).abs() < 1e-12, "what leaves the sample");
    }
    let truth = compiled.truth(*compiled.region());
    let expected = 7.0 * PI * 0.75;
    assert!((truth.exitance_within_region() / expected - 1.0).abs() < 1e-6);
}

#[test]
fn a_window_shifts_a_ray_and_never_raises_its_radiance() {
    let text = "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-50, 0]\ny_mm = [-50, 50]\n\
                radiance_w_per_m2_sr = 7\n\
                [[emitter]]\nkind = \"lambertian\"\nx_mm = [0, 50]\ny_mm = [-50, 50]\n\
                radiance_w_per_m2_sr = 5\n\
                [[window]]\nz_mm = 20\nthickness_mm = 6\nindex = 1.5\nabsorption_per_mm = 0.01\n\
                belongs_to = \"sample\"\n";
    let compiled = compiled(text, &terms(10.0, 60.0));
    let theta = 50f64.to_radians();
    let inside = (theta.sin() / 1.5).asin();
    let shift = 0.006 * (theta.tan() - inside.tan());
    let at = |x: f64, theta: f64, phi: f64| compiled.radiance(&Ray::new(x, 0.0, theta, phi));
    // Leaning towards +x, the ray comes from a place farther in +x: the step lies at x = -shift.
    let (left, right) = (at(-shift - 1e-6, theta, 0.0), at(-shift + 1e-6, theta, 0.0));
    assert!((left / right - 7.0 / 5.0).abs() < 1e-12, "{left} {right}");
    assert!((at(shift - 1e-6, theta, PI) / at(shift + 1e-6, theta, PI) - 1.4).abs() < 1e-12);
    // Two faces of reflectance 0.04 and 6 mm of absorption, to all orders.
    let (r, a) = (0.04, (-0.06f64).exp());
    let straight = (1.0 - r) * (1.0 - r) * a / (1.0 - r * r * a * a);
    assert!((at(-0.01, 0.0, 0.0) / (7.0 * straight) - 1.0).abs() < 1e-12);
    for i in 0..90 {
        let theta = f64::from(i).to_radians();
        for phi in [0.0, 1.0, 3.0] {
            assert!(at(-0.01, theta, phi) <= 7.0 && at(-0.01, theta, phi) >= 0.0);
        }
    }
}

#[test]
fn a_sunlit_panel_behind_glass_and_under_a_sky_is_as_bright_as_their_laws_say() {
    let sun = "[[lamp]]\nkind = \"sun\"\ntheta_deg = 60\nphi_deg = 30\n";
    let open = compiled(&format!("{PANEL}{sun}"), &terms(10.0, 60.0));
    let expected = 0.8 / PI * 1353.0 * 0.5;
    let found = open.radiance(&Ray::new(0.0, 0.0, 0.3, 0.0));
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    let sky = "[[lamp]]\nkind = \"environment\"\nfile = \"sky.pgm\"\nradiance_w_per_m2_sr = 4\n";
    let lit = compiled(&format!("{PANEL}{sky}"), &terms(10.0, 60.0));
    // Rows of 45°: π sin² of each half of the hemisphere, the mean of its pixels; 4 is the greatest.
    let (cap, ring) = (PI / 2.0, PI / 2.0);
    let expected = 0.8 / PI * (cap * 7.0 / 4.0 + ring * 7.0 / 4.0);
    let found = lit.radiance(&Ray::new(0.0, 0.0, 0.3, 0.0));
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
}

#[test]
fn glass_throws_light_back_as_rays_find() {
    let text = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.9\nx_mm = [-30, 30]\ny_mm = [-20, 20]\n\
                [[lamp]]\nkind = \"sun\"\ntheta_deg = 30\n\
                [[window]]\nz_mm = 25\nthickness_mm = 2\nindex = 1.6\nabsorption_per_mm = 0.02\n\
                belongs_to = \"sample\"\n";
    let with = compiled(text, &terms(10.0, 60.0));
    let mut less = terms(10.0, 60.0);
    less.without.push("window-return[0]".to_owned());
    let without = compiled(text, &less);
    let ray = Ray::new(0.01, 0.005, 0.0, 0.0);
    let found = with.radiance(&ray) / without.radiance(&ray) - 1.0;
    // Light that leaves a place evenly over the projected hemisphere, met by the plate and traced
    // through it, face by face, until it is out or back: one reflection by the plate after another.
    let mut dice = Dice(9);
    let (count, mut back) = (400_000, 0.0);
    let start = DVec3::new(0.01, 0.005, 0.0);
    for _ in 0..count {
        let (mut at, mut weight) = (start, 1.0);
        for _ in 0..4 {
            let (sin, turn) = (dice.roll().sqrt(), TAU * dice.roll());
            let cos = (1.0 - sin * sin).sqrt();
            let inside = (1.0 - sin * sin / 2.56).sqrt();
            let (rs, rp) = {
                let s = (cos - 1.6 * inside) / (cos + 1.6 * inside);
                let p = (1.6 * cos - inside) / (1.6 * cos + inside);
                (s * s, p * p)
            };
            // Polarised one way or the other; inside the plate to and fro.
            let r = if dice.roll() < 0.5 { rs } else { rp };
            let aside = DVec3::new(turn.cos(), turn.sin(), 0.0);
            let (step, inner) = (25e-3 * sin / cos, 2e-3 * sin / 1.6 / inside);
            let passed = (-20.0 * 2e-3 / inside).exp();
            let mut travelled = 2.0 * step;
            let mut reflected = dice.roll() < r;
            if !reflected {
                // Up, and down again, as long as it stays inside.
                loop {
                    weight *= passed;
                    if dice.roll() >= r {
                        break;
                    }
                    weight *= passed;
                    travelled += 2.0 * inner;
                    if dice.roll() >= r {
                        reflected = true;
                        break;
                    }
                }
            }
            at += aside * travelled;
            let on_patch = at.x.abs() <= 0.03 && at.y.abs() <= 0.02;
            if !reflected || !on_patch {
                break;
            }
            weight *= 0.9;
            // Reciprocity: what would leave here and end there lights as much the other way.
            back += weight;
        }
    }
    let expected = back / f64::from(count);
    assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
    assert!(found > 0.01, "{found}");
    let row = with.effects().iter().find(|row| row.name == "window-return[0]").unwrap();
    assert!(row.included && row.bound.unwrap().value >= found);
    assert!(row.error.unwrap() < 1e-3, "{row:?}");
}

#[test]
fn what_is_not_simulated_is_refused_by_name() {
    let lamp = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [0, 0, 200]\nradius_mm = 5\n\
                radiance_w_per_m2_sr = 10\n";
    let window = "[[window]]\nz_mm = 20\nthickness_mm = 6\nindex = 1.5\nbelongs_to = \"sample\"\n";
    let sky = "[[lamp]]\nkind = \"environment\"\nfile = \"sky.pgm\"\nradiance_w_per_m2_sr = 4\n";
    let ball = "[[occluder]]\nkind = \"sphere\"\ncentre_mm = [30, 0, 100]\nradius_mm = 5\n";
    let refused = |text: &str| {
        let refused = sim::compile(scene(text), rig(), Simulated::default(), &terms(10.0, 60.0));
        refused.unwrap_err().to_string()
    };
    let high = ball.replace("100]", "90]");
    let shaded = refused(&format!("{PANEL}{lamp}{high}{window}"));
    let expected = "the shadow of occluder[0] in the light of lamp[0] that comes through a window";
    assert!(shaded.contains(expected), "{shaded}");
    let wall = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.5\n\
                corners_mm = [[60, -9, 0], [60, -9, 9], [60, 9, 9], [60, 9, 0]]\n";
    let between = refused(&format!("{PANEL}{wall}{sky}{window}"));
    assert!(between.contains("see each other"), "{between}");
}

#[test]
fn a_surface_above_a_window_is_not_behind_it() {
    let sun = "[[lamp]]\nkind = \"sun\"\ntheta_deg = 40\nphi_deg = 30\n";
    let above = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.5\n\
                 corners_mm = [[-2, -2, 40], [2, -2, 40], [2, 2, 40], [-2, 2, 40]]\n";
    let window = "[[window]]\nz_mm = 20\nthickness_mm = 6\nindex = 1.5\nbelongs_to = \"sample\"\n";
    let panel = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0\nx_mm = [-9, 9]\ny_mm = [-9, 9]\n";
    let of =
        |text: &str| compiled(text, &terms(10.0, 60.0)).radiance(&Ray::new(0.0, 0.0, 0.0, 0.0));
    let clear = of(&format!("{panel}{above}{sun}"));
    let glass = of(&format!("{panel}{above}{sun}{window}"));
    assert!(clear > 0.0 && (glass / clear - 1.0).abs() < 1e-12, "{glass} {clear}");
}
