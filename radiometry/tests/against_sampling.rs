//! Solid angles and projected solid angles against cubature over the source, from the definition
//! ∬ cos θ cos θ'/r² dA, and what had no rays yet against rays: nothing here knows a closed form.

mod dice;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use dice::{Dice, SIGMAS, mean};
use glam::{DVec2, DVec3};
use radiometry::basis::Zernike;
use radiometry::environment::EqualArea;
use radiometry::irradiance::Sun;
use radiometry::projected::{self, Occluder, Receiver, Source, occluded, occluded_by};
use radiometry::quadrature::{Cell, adaptive_between, cubature, quasi_monte_carlo};
use radiometry::quantity::Radiance;
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use radiometry::solid_angle;
use radiometry::{Estimate, EstimateError, Tolerance};

impl Dice {
    /// A disk and a triangle in space, some way off.
    fn disk(&mut self) -> Disk {
        Disk::new(self.direction() * 1.5, self.direction(), self.between(0.2, 0.9)).unwrap()
    }

    fn triangle(&mut self) -> [DVec3; 3] {
        let middle = self.direction() * 1.5;
        [0; 3].map(|_| middle + 0.8 * self.direction())
    }
}

/// The part of a whole that tests pass, and its standard deviation.
fn part(whole: f64, samples: u32, mut passes: impl FnMut() -> bool) -> (f64, f64) {
    let (share, _) = mean(samples, || f64::from(passes()));
    // Of a share below one in a thousand few samples or none pass, which proves no more than this.
    let variance = (share * (1.0 - share)).max(1e-3);
    (whole * share, whole * (variance / f64::from(samples)).sqrt())
}

#[track_caller]
fn agrees(what: &str, found: f64, (expected, deviation): (f64, f64)) {
    let off = (found - expected).abs();
    assert!(off <= SIGMAS * deviation, "{what}: {found}, by rays {expected} ± {deviation}");
}

/// Where the source sets: the horizon may cut a corner of a cell between its nodes, and its bound with it.
#[track_caller]
fn meets_clipped(what: &str, found: f64, summed: Estimate) {
    meets(what, found, Estimate { error_bound: 10.0 * summed.error_bound, ..summed });
}

#[track_caller]
fn meets(what: &str, found: f64, summed: Estimate) {
    let off = (found - summed.value).abs();
    let allowed = summed.error_bound + 2e-13 * found;
    assert!(off <= allowed, "{what}: {found} by cubature {summed:?}, off {off:e}");
}

#[test]
fn round_cones_are_integrals_over_their_half_angle() {
    let tolerance = Tolerance::from_relative(1e-12).unwrap();
    let mut dice = Dice(1);
    for half in [1e-6, 0.01, 0.3, 1.0, FRAC_PI_2, 2.5, PI] {
        let over = |from: f64, to: f64, of: fn(f64) -> f64| {
            let summed = adaptive_between(|t| TAU * of(t), &[from, to], tolerance);
            summed.unwrap()
        };
        let said = format!("{half}");
        let cone = solid_angle::cone(half).unwrap();
        meets(&said, cone.sr(), over(0.0, half, f64::sin));
        assert!((solid_angle::cone_half_angle(cone).unwrap() - half).abs() < 1e-7 * half);
        let inner = 0.7 * half;
        meets(&said, solid_angle::annulus(inner, half).unwrap().sr(), over(inner, half, f64::sin));
        let share = part(4.0 * PI, 20_000, || {
            let angle = dice.direction().z.acos();
            inner < angle && angle < half
        });
        agrees(&said, solid_angle::annulus(inner, half).unwrap().sr(), share);
        // Nothing arrives from below the horizon.
        let up = over(0.0, half.min(FRAC_PI_2), |t| t.sin() * t.cos());
        let found = solid_angle::cone_projected(half).unwrap().sr();
        meets(&said, found, up);
        let share = part(PI, 20_000, || dice.ray(DVec3::Z).z.acos() < half);
        agrees(&said, found, share);
        if half < FRAC_PI_2 {
            let found = solid_angle::disk(2.0 * half.tan(), 2.0).unwrap().sr();
            meets(&said, found, over(0.0, half, f64::sin));
            let found = solid_angle::sphere(2.0 * half.sin(), 2.0).unwrap().sr();
            meets(&said, found, over(0.0, half, f64::sin));
        }
    }
}

/// ∬ over a plane piece of `of(ray) |cos θ'|/r²`, by cells that a map takes to it with an area element.
fn over(
    cells: &[Cell],
    normal: DVec3,
    place: impl Fn(DVec2) -> (DVec3, f64),
    of: impl Fn(DVec3) -> f64,
    relative: f64,
) -> Estimate {
    let element = |p: DVec2| {
        let (place, area) = place(p);
        let r = place.length();
        of(place / r) * normal.dot(place).abs() / r.powi(3) * area
    };
    // The clipped cosine is not smooth where the source sets.
    let tolerance = Tolerance::new(relative, 1e-9, 400_000).unwrap();
    match cubature(element, cells, tolerance) {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
        Err(other) => panic!("{other}"),
    }
}

fn over_triangle([a, b, c]: [DVec3; 3], of: impl Fn(DVec3) -> f64, relative: f64) -> Estimate {
    let normal = (b - a).cross(c - a);
    let whole = [Cell::Triangle([DVec2::ZERO, DVec2::X, DVec2::Y])];
    let place = |p: DVec2| (a + (b - a) * p.x + (c - a) * p.y, normal.length());
    over(&whole, normal.normalize(), place, of, relative)
}

fn over_disk(disk: &Disk, of: impl Fn(DVec3) -> f64, relative: f64) -> Estimate {
    let axis = disk.axis().normalize();
    let (x, y) = axis.any_orthonormal_pair();
    let cells = [0.0, FRAC_PI_2, PI, PI + FRAC_PI_2].map(|from| {
        Cell::Rectangle(DVec2::new(0.0, from), DVec2::new(disk.radius_m(), from + FRAC_PI_2))
    });
    let place = |p: DVec2| {
        let aside = DVec2::from_angle(p.y) * p.x;
        (disk.center_m() + x * aside.x + y * aside.y, p.x)
    };
    over(&cells, axis, place, of, relative)
}

/// The corners of the part of a triangle above a plane through the origin.
fn cut(corners: [DVec3; 3], normal: DVec3) -> Vec<DVec3> {
    let mut up = Vec::new();
    for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
        let (height_a, height_b) = (normal.dot(a), normal.dot(b));
        if height_a >= 0.0 {
            up.push(a);
        }
        if height_a * height_b < 0.0 {
            up.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    up
}

/// By the triangles that the origin makes with its edges.
fn meets_triangle(corners: [DVec3; 3], ray: DVec3) -> bool {
    let [a, b, c] = corners;
    let turns = [(a, b), (b, c), (c, a)].map(|(a, b)| a.cross(b).dot(ray) > 0.0);
    turns.iter().all(|turn| *turn == turns[0]) && (a + b + c).dot(ray) > 0.0
}

fn meets_disk(disk: &Disk, ray: DVec3) -> bool {
    let reach = disk.axis().dot(disk.center_m()) / disk.axis().dot(ray);
    reach > 0.0 && (ray * reach).distance(disk.center_m()) < disk.radius_m()
}

#[test]
fn solid_angles_are_integrals_over_the_source() {
    let mut dice = Dice(2);
    for i in 0..25 {
        let (triangle, disk) = (dice.triangle(), dice.disk());
        let [a, b, c] = triangle;
        let found = solid_angle::triangle(a, b, c).unwrap().sr();
        let summed = over_triangle(triangle, |_| 1.0, 1e-9);
        meets(&format!("triangle {i}"), found, summed);
        let signed = solid_angle::triangle_signed(DVec3::ZERO, a, c, b).unwrap().sr();
        meets(&format!("signed {i}"), signed * a.cross(c).dot(b).signum(), summed);
        let share = part(4.0 * PI, 8_000, || meets_triangle(triangle, dice.direction()));
        agrees(&format!("triangle {i}"), found, share);
        // A kite of two of them.
        let fourth = a + 2.2 * ((b + c) / 2.0 - a);
        let kite = Polygon::new(vec![a, b, fourth, c]).unwrap();
        let both = summed.value + over_triangle([b, fourth, c], |_| 1.0, 1e-9).value;
        let found = solid_angle::polygon(DVec3::ZERO, &kite).unwrap().sr();
        assert!((found - both).abs() < 4e-9 + 4e-9 * both, "kite {i}: {found} {both}");
        let found = solid_angle::disk_from(DVec3::ZERO, &disk).unwrap().sr();
        meets(&format!("disk {i}"), found, over_disk(&disk, |_| 1.0, 1e-9));
        let share = part(4.0 * PI, 8_000, || meets_disk(&disk, dice.direction()));
        agrees(&format!("disk {i}"), found, share);
    }
}

#[test]
fn projected_solid_angles_are_integrals_over_the_source() {
    let mut dice = Dice(3);
    let mut setting = 0;
    for i in 0..40 {
        let (triangle, disk, normal) = (dice.triangle(), dice.disk(), dice.direction());
        let receiver = Receiver::new(DVec3::ZERO, normal).unwrap();
        let cosine = |ray: DVec3| normal.dot(ray).max(0.0);
        let polygon = Polygon::new(triangle.to_vec()).unwrap();
        let found = projected::polygon(&receiver, &polygon).unwrap().sr();
        // What is up of it, so that nothing is left to clip.
        let up = cut(triangle, normal);
        let fan = up.windows(2).skip(1).map(|pair| [up[0], pair[0], pair[1]]);
        let summed: f64 = fan.map(|t| over_triangle(t, cosine, 1e-9).value).sum();
        let off = (found - summed).abs();
        assert!(off < 3e-9 + 3e-9 * found, "triangle {i}: {found}, summed {summed}");
        let found = projected::disk(&receiver, &disk).unwrap().sr();
        meets_clipped(&format!("disk {i}"), found, over_disk(&disk, cosine, 1e-6));
        // A ball is the directions about its middle; rings of them by height over the horizon.
        let ball = Sphere::new(disk.center_m(), disk.radius_m()).unwrap();
        let toward = disk.center_m().normalize();
        let (x, y) = toward.any_orthonormal_pair();
        let half = (disk.radius_m() / 1.5).asin();
        let ring = |p: DVec2| {
            let aside = DVec2::from_angle(p.y) * p.x.sin();
            p.x.sin() * cosine(toward * p.x.cos() + x * aside.x + y * aside.y)
        };
        let quarters = [0.0, FRAC_PI_2, PI, PI + FRAC_PI_2]
            .map(|from| Cell::Rectangle(DVec2::new(0.0, from), DVec2::new(half, from + FRAC_PI_2)));
        let tolerance = Tolerance::new(1e-5, 1e-8, 400_000).unwrap();
        let found = projected::sphere(&receiver, &ball).unwrap().sr();
        meets_clipped(&format!("ball {i}"), found, cubature(ring, &quarters, tolerance).unwrap());
        setting += u32::from(normal.dot(toward).abs() < half.sin());
    }
    assert!(setting > 8, "only {setting} stood on the horizon");
}

#[test]
fn the_sun_sets_as_its_disk_does() {
    let sun = Sun::lecture();
    let half = sun.half_angle_rad();
    let radiance = sun.radiance().w_per_m2_sr();
    for share in [-20.0, -1.5, -0.9, -0.3, 0.0, 0.2, 0.8] {
        let tilt = FRAC_PI_2 + share * half;
        // Over the angle from its middle in units of half, and around.
        let element = |p: DVec2| {
            let off = p.x * half;
            let cosine = tilt.cos() * off.cos() + tilt.sin() * off.sin() * p.y.cos();
            2.0 * half * radiance * off.sin() * cosine.max(0.0)
        };
        let cell = [Cell::Rectangle(DVec2::ZERO, DVec2::new(1.0, PI))];
        let tolerance = Tolerance::new(1e-5, 1e-6, 400_000).unwrap();
        let summed = cubature(element, &cell, tolerance).unwrap();
        let found = sun.irradiance_at(tilt).unwrap().w_per_m2();
        let off = (found - summed.value).abs();
        assert!(off <= summed.error_bound + 1e-10 * found, "{share}: {found} {summed:?}");
    }
}

#[test]
fn many_bodies_leave_what_rays_find() {
    let mut dice = Dice(4);
    let mut partly = 0;
    for i in 0..60 {
        let source = Disk::new(
            DVec3::new(dice.between(-1.0, 1.0), dice.between(-1.0, 1.0), 4.0),
            dice.direction(),
            1.2,
        )
        .unwrap();
        let normal = (DVec3::Z + 0.8 * dice.direction()).normalize();
        let receiver = Receiver::new(DVec3::ZERO, normal).unwrap();
        // One above the other, so that none pierces another.
        let plate = Disk::new(
            DVec3::new(dice.between(-0.4, 0.4), dice.between(-0.4, 0.4), 1.8),
            DVec3::Z,
            dice.between(0.1, 0.5),
        )
        .unwrap();
        let middle = DVec3::new(dice.between(-0.3, 0.3), dice.between(-0.3, 0.3), 1.2);
        let ball = Sphere::new(middle, dice.between(0.05, 0.3)).unwrap();
        let corner =
            |dice: &mut Dice| DVec3::new(dice.between(-0.3, 0.3), dice.between(-0.3, 0.3), 0.7);
        let triangle = [0; 3].map(|_| corner(&mut dice));
        let edge = HalfPlane::new(dice.between(-0.3, 0.1), 0.4).unwrap();
        let bodies = [
            Occluder::Disk(plate),
            Occluder::Sphere(ball),
            Occluder::Polygon(Polygon::new(triangle.to_vec()).unwrap()),
            Occluder::HalfPlane(edge),
        ];
        let hides = |ray: DVec3| {
            let along = ray.dot(middle);
            [
                meets_disk(&plate, ray),
                along > 0.0 && middle.length_squared() - along * along < ball.radius_m().powi(2),
                meets_triangle(triangle, ray),
                ray.z > 0.0 && ray.x * 0.4 / ray.z <= edge.x_max_m(),
            ]
        };
        let whole = projected::disk(&receiver, &source).unwrap().sr();
        let source_of = Source::Disk(source);
        for count in 1..=4 {
            let found = occluded_by(&receiver, &source_of, &bodies[..count], Tolerance::default());
            let found = found.unwrap();
            let rays = part(PI, 6_000, || {
                let ray = dice.ray(normal);
                meets_disk(&source, ray) && !hides(ray)[..count].contains(&true)
            });
            agrees(&format!("{i}, {count}"), found.value, rays);
            partly += u32::from(found.value > 0.05 * whole && found.value < 0.95 * whole);
        }
        // And the ball alone, over the source's area.
        if i % 6 == 0 {
            let one = occluded(&receiver, &source_of, &bodies[1], Tolerance::default()).unwrap();
            let lit = |ray: DVec3| if hides(ray)[1] { 0.0 } else { normal.dot(ray).max(0.0) };
            let axis = source.axis().normalize();
            let (x, y) = axis.any_orthonormal_pair();
            let element = |p: &[f64; 2]| {
                let aside = DVec2::from_angle(TAU * p[0]) * (1.2 * p[1].sqrt());
                let ray = source.center_m() + x * aside.x + y * aside.y;
                let r = ray.length();
                PI * 1.2 * 1.2 * lit(ray / r) * axis.dot(ray).abs() / r.powi(3)
            };
            let tolerance = Tolerance::new(1e-3, 1e-4, 1_000_000).unwrap();
            let summed = quasi_monte_carlo(element, i, tolerance).unwrap();
            let off = (one.value - summed.value).abs();
            assert!(off < 1.5 * summed.error_bound, "{i}: {one:?} {summed:?}");
        }
    }
    assert!(partly > 60, "only {partly} had a shadow on them");
}

#[test]
fn rays_find_the_equal_area_maps_irradiance_through_its_lookup() {
    let mut dice = Dice(5);
    for side in [2, 6, 16] {
        let drawn: Vec<f64> = (0..side * side).map(|_| dice.unit()).collect();
        let radiances: Vec<_> = drawn.iter().map(|l| Radiance::from_w_per_m2_sr(*l)).collect();
        let map = EqualArea::new(side, &radiances).unwrap();
        for _ in 0..5 {
            let normal = dice.direction();
            let found = map.irradiance(normal, Tolerance::default()).unwrap().value;
            let rays = mean(30_000, || PI * map.radiance(dice.ray(normal)).unwrap().w_per_m2_sr());
            agrees(&format!("{side}, {normal}"), found, rays);
        }
    }
}

#[test]
fn rays_find_the_zernike_integrals_over_a_cone() {
    let mut dice = Dice(6);
    let zernike = Zernike::new(8);
    let (mut exact, mut values) = (vec![0.0; zernike.len()], vec![0.0; zernike.len()]);
    for theta_max in [0.3, 0.9, 1.4] {
        zernike.integrals_within(theta_max, &mut exact).unwrap();
        for (index, exact) in exact.iter().enumerate() {
            let rays = mean(2_000, || {
                let ray = dice.ray(DVec3::Z);
                zernike.evaluate_direction(ray, &mut values);
                if ray.z > theta_max.cos() { PI * values[index] } else { 0.0 }
            });
            agrees(&format!("{theta_max}, {index}"), *exact, rays);
        }
    }
}
