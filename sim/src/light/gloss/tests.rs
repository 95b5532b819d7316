//! The lobe against what is known of it, and against sums over directions.

use core::f64::consts::PI;

use glam::DVec3;
use radiometry::direction::frame;
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};

use super::*;
use crate::scene::Image;

const GLOSS: f64 = 0.4;

fn glossy(exponent: f64) -> Gloss {
    Gloss::new(&Reflection { albedo: 0.0, gloss: GLOSS, exponent }).unwrap()
}

/// Of a level surface.
fn radiance(of: &Gloss, place: DVec3, into: DVec3, source: &Sight, before: &[Sight]) -> f64 {
    of.lobe(place, DVec3::Z, into.normalize()).radiance(source, before)
}

fn polygon(corners: &[[f64; 3]]) -> Sight {
    let corners = corners.iter().map(|c| DVec3::from_array(*c)).collect();
    Sight::Body(Solid::Polygon(Polygon::new(corners).unwrap()))
}

fn disk(centre: [f64; 3], axis: [f64; 3], radius_m: f64) -> Sight {
    let disk = Disk::new(DVec3::from_array(centre), DVec3::from_array(axis), radius_m);
    Sight::Body(Solid::Disk(disk.unwrap()))
}

fn sphere(centre: [f64; 3], radius_m: f64) -> Sight {
    Sight::Body(Solid::Sphere(Sphere::new(DVec3::from_array(centre), radius_m).unwrap()))
}

fn lamps() -> [Sight; 4] {
    [
        polygon(&[[-0.4, -0.3, 0.8], [0.3, -0.2, 0.9], [-0.1, 0.5, 0.85]]),
        disk([-0.2, 0.1, 0.7], [0.4, 0.1, -1.0], 0.3),
        sphere([-0.2, 0.1, 0.7], 0.25),
        Sight::Cap(DVec3::new(-0.3, 0.1, 0.9).normalize(), 0.2),
    ]
}

#[test]
fn under_a_white_sky_no_more_is_reflected_than_arrives() {
    let sky = Sight::Cap(DVec3::Z, FRAC_PI_2);
    for exponent in [0.0, 1.0, 7.5, 40.0, 3000.0, 20_000.0] {
        let mut least = f64::INFINITY;
        for theta in [0.0, 30.0, 60.0, 85.0, 89.9_f64] {
            let (sin, cos) = theta.to_radians().sin_cos();
            let into = DVec3::new(sin, 0.0, cos);
            let found = radiance(&glossy(exponent), DVec3::ZERO, into, &sky, &[]);
            let finer = radiance(&glossy(exponent).finer(), DVec3::ZERO, into, &sky, &[]);
            assert!((found - finer).abs() < 1e-8, "{found} {finer}, {exponent} {theta}°");
            assert!(found <= GLOSS * (1.0 + 1e-8) && found > 0.0, "{found}, {exponent} {theta}°");
            assert!(found <= least + 1e-8, "{found} after {least}, {exponent} {theta}°");
            least = found;
            if theta == 0.0 {
                // (n + 2)/(2π) ∫ cosⁿ⁺¹ dω = 1 along the normal.
                assert!((found / GLOSS - 1.0).abs() < 1e-8, "{found}, {exponent}");
            }
        }
    }
}

#[test]
fn a_lobe_is_the_same_both_ways() {
    // Between two small disks: each seen from the other's direction.
    let (a, b) = (DVec3::new(0.3, 0.1, 0.8).normalize(), DVec3::new(-0.5, 0.2, 0.6).normalize());
    let of = |from: DVec3, into: DVec3| {
        // L / cos θ: what is left is fr.
        radiance(&glossy(12.0), DVec3::ZERO, into, &Sight::Cap(from, 1e-4), &[]) / from.z
    };
    let (there, back) = (of(a, b), of(b, a));
    assert!((there / back - 1.0).abs() < 1e-6, "{there} {back}");
    let mirrored = DVec3::new(-a.x, -a.y, a.z).dot(b);
    let expected = GLOSS * 14.0 / TAU * mirrored.powi(12) * PI * 1e-8;
    assert!((there / expected - 1.0).abs() < 1e-6, "{there} {expected}");
}

#[test]
fn a_narrow_lobe_is_a_mirror_of_a_part() {
    let lamp = disk([-0.5, 0.0, 0.5], [1.0, 0.0, -1.0], 0.1);
    let into = DVec3::new(1.0, 0.0, 1.0);
    let found = radiance(&glossy(20_000.0), DVec3::ZERO, into, &lamp, &[]);
    // The factor (n + 2)/(n + 1) cos θ.
    let expected = GLOSS * 20_002.0 / 20_001.0 * 0.5f64.sqrt();
    assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
}

#[test]
fn without_an_exponent_the_lobe_is_what_arrives_above_the_mirror_plane() {
    // n = 0, along the normal: s/π E, and E of a cap is π sin² of its half angle times cos θ.
    let (towards, half) = (DVec3::new(0.5, -0.2, 1.0).normalize(), 0.3_f64);
    let cap = Sight::Cap(towards, half);
    let found = radiance(&glossy(0.0), DVec3::ZERO, DVec3::Z, &cap, &[]);
    let expected = GLOSS * half.sin().powi(2) * towards.z;
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

/// By directions in line with nothing: spread evenly over what holds the source, or, of a narrow lobe, as
/// densely as that is bright.
fn by_directions(of: &Gloss, into: DVec3, source: &Sight, before: &[Sight]) -> f64 {
    const COUNT: u32 = 60_000;
    const NARROW: f64 = 20.0;
    // Powers of the root of t³ = t + 1: evenly in two dimensions (Roberts 2018).
    const ROOT: f64 = 1.324_717_957_244_746;
    let lobe = of.lobe(DVec3::new(0.1, -0.05, 0.0), DVec3::Z, into.normalize());
    let n = of.moments.exponent();
    let (source_axis, half) = source.cone(lobe.place).unwrap();
    let (axis, solid_angle) = if n > NARROW {
        (lobe.mirror, TAU / (n + 1.0))
    } else {
        (source_axis, TAU * (1.0 - half.cos()))
    };
    let (e, f) = frame(axis);
    let mut sum = 0.0;
    for i in 0..COUNT {
        let part = |step: f64| (0.5 + f64::from(i) * step).fract();
        let part_in = part(1.0 / ROOT);
        let (cos, bright) = if n > NARROW {
            (part_in.powf(1.0 / (n + 1.0)), None)
        } else {
            (1.0 - part_in * (1.0 - half.cos()), Some(n))
        };
        let (sin, turn) = ((1.0 - cos * cos).sqrt(), TAU * part(1.0 / (ROOT * ROOT)));
        let towards = axis * cos + (e * turn.cos() + f * turn.sin()) * sin;
        let Some(far) = source.distance(lobe.place, towards).filter(|_| towards.z > 0.0) else {
            continue;
        };
        if !before.iter().any(|b| b.distance(lobe.place, towards).is_some_and(|near| near < far)) {
            let bright = bright.map_or(1.0, |n| lobe.mirror.dot(towards).max(0.0).powf(n));
            sum += bright * towards.z;
        }
    }
    of.factor * sum * solid_angle / f64::from(COUNT)
}

#[test]
fn what_is_seen_of_a_lamp_past_bodies_is_what_a_sum_over_directions_says() {
    let edge = HalfPlane::new(-0.05, 0.35).unwrap();
    let bodies = [
        Sight::Body(Solid::HalfPlane(edge)),
        disk([0.0, 0.05, 0.4], [0.3, -0.2, 1.0], 0.1),
        sphere([0.0, 0.0, 0.3], 0.06),
        polygon(&[[-0.2, -0.2, 0.3], [0.05, -0.2, 0.5], [-0.05, 0.3, 0.4]]),
    ];
    let low = [sphere([-0.8, 0.1, 0.1], 0.25), disk([-0.7, 0.0, 0.0], [1.0, 0.1, 0.1], 0.3)];
    let place = DVec3::new(0.1, -0.05, 0.0);
    for exponent in [1.5, 30.0, 300.0] {
        let of = glossy(exponent);
        for (i, lamp) in lamps().iter().chain(&low).enumerate() {
            let into = if i < 4 { DVec3::new(0.5, -0.1, 1.0) } else { DVec3::new(1.0, -0.1, 0.3) };
            let hidings = [&bodies[..0], &bodies[i % 4..][..1], &bodies[i % 3..][..2]];
            let whole = radiance(&of, place, into, lamp, &[]);
            for before in hidings {
                let found = radiance(&of, place, into, lamp, before);
                let expected = by_directions(&of, into, lamp, before);
                let what = format!("{exponent} {i} {}: {found} {expected}", before.len());
                assert!((found - expected).abs() < 4e-3 * whole + 1e-4, "{what} of {whole}");
                let finer = radiance(&of.finer(), place, into, lamp, before);
                assert!((found - finer).abs() < 1e-7 * whole, "{what}, {finer}");
            }
        }
    }
}

#[test]
fn what_is_hidden_and_what_is_left_are_the_whole() {
    let place = DVec3::new(0.1, -0.05, 0.0);
    // Two squares that share an edge hide all that they cover together.
    let left = polygon(&[[-2.0, -2.0, 0.3], [0.0, -2.0, 0.3], [0.0, 2.0, 0.3], [-2.0, 2.0, 0.3]]);
    let right = polygon(&[[0.0, -2.0, 0.3], [2.0, -2.0, 0.3], [2.0, 2.0, 0.3], [0.0, 2.0, 0.3]]);
    for exponent in [3.0, 25.0, 400.0] {
        for lamp in &lamps() {
            let of = |before: &[Sight]| {
                let into = DVec3::new(0.5, -0.1, 1.0);
                radiance(&glossy(exponent), place, into, lamp, before)
            };
            let whole = of(&[]);
            let parts = of(std::slice::from_ref(&left)) + of(std::slice::from_ref(&right));
            assert!(whole > 0.0 && (parts / whole - 1.0).abs() < 1e-6, "{whole} {parts}");
            assert!(of(&[left.clone(), right.clone()]) < 1e-9 * whole);
        }
    }
}

#[test]
fn a_lamp_far_from_the_mirror_direction_is_seen_in_the_tail_without_loss() {
    // A small cap at 60° of a lobe of exponent 30: fr cos θ times its solid angle.
    let (into, half) = (DVec3::Z, 1e-4_f64);
    let towards = DVec3::new(0.75f64.sqrt(), 0.0, 0.5);
    let found = radiance(&glossy(30.0), DVec3::ZERO, into, &Sight::Cap(towards, half), &[]);
    let expected = GLOSS * 32.0 / TAU * 0.5f64.powi(30) * 0.5 * PI * half * half;
    assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
}

fn sky(columns: usize, values: &[f64]) -> Surrounding {
    Surrounding::new(&Image::new(columns, values.to_vec()).unwrap())
}

fn of_sky(of: &Gloss, (place, normal, into): (DVec3, DVec3, DVec3), before: &[Sight]) -> [f64; 2] {
    let map = sky(
        5,
        &[
            4.0, 1.0, 0.0, 9.0, 2.0, 1.0, 0.0, 3.0, 5.0, 5.0, 2.0, 8.0, 0.0, 1.0, 6.0, 7.0, 7.0,
            0.0, 2.0, 1.0,
        ],
    );
    let lobe = of.lobe(place, normal.normalize(), into.normalize());
    [Counts::Seen, Counts::Hidden].map(|counts| lobe.of_surrounding(&map, before, counts))
}

#[test]
fn a_surrounding_that_is_white_all_over_is_a_white_sky() {
    let (white, cap) = (sky(3, &[1.0; 6]), Sight::Cap(DVec3::Z, FRAC_PI_2));
    // Half white and half next to it: every border is there, and steps by next to nothing.
    let checkered: Vec<f64> = (0..48).map(|i| if i % 2 == 0 { 1.0 } else { 1.0 + 1e-9 }).collect();
    let checkered = sky(8, &checkered);
    for exponent in [0.0, 1.0, 7.5, 400.0, 20_000.0] {
        for theta in [0.0, 45.0, 85.0, 89.9_f64] {
            let (sin, cos) = theta.to_radians().sin_cos();
            let of = glossy(exponent);
            let lobe = of.lobe(DVec3::ZERO, DVec3::Z, DVec3::new(sin, 0.0, cos));
            let expected = lobe.radiance(&cap, &[]);
            for map in [&white, &checkered] {
                let found = lobe.of_surrounding(map, &[], Counts::Seen);
                let off = (found - expected).abs();
                assert!(off < 3e-8, "{found} {expected}, {exponent} {theta}°");
            }
        }
    }
}

#[test]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
fn of_a_surrounding_is_sent_on_what_a_sum_over_directions_says() {
    let bodies = [
        sphere([0.1, 0.2, 0.5], 0.3),
        polygon(&[[-0.2, -0.9, 0.1], [0.6, -0.2, 0.5], [-0.05, 0.3, 0.4]]),
        disk([0.4, -0.3, 0.0], [1.0, 0.1, 0.1], 0.3),
        Sight::Body(Solid::HalfPlane(HalfPlane::new(-0.2, 0.35).unwrap())),
    ];
    let place = DVec3::new(0.05, -0.05, 0.0);
    let map = [
        4.0, 1.0, 0.0, 9.0, 2.0, 1.0, 0.0, 3.0, 5.0, 5.0, 2.0, 8.0, 0.0, 1.0, 6.0, 7.0, 7.0, 0.0,
        2.0, 1.0,
    ];
    for exponent in [0.0, 3.0, 60.0] {
        let of = glossy(exponent);
        for (i, (normal, into)) in [
            (DVec3::Z, DVec3::Z),
            (DVec3::Z, DVec3::new(1.0, 0.0, 1.0)),
            (DVec3::new(0.3, -0.5, 0.7), DVec3::new(0.1, 0.4, 1.0)),
            (DVec3::new(0.9, 0.2, 0.1), DVec3::new(1.0, 0.8, 0.3)),
        ]
        .into_iter()
        .enumerate()
        {
            for before in [&bodies[..0], &bodies[i..][..1], &bodies[i % 3..][..2]] {
                let [seen, hidden] = of_sky(&of, (place, normal, into), before);
                let lobe = of.lobe(place, normal.normalize(), into.normalize());
                // All directions evenly, by Fibonacci's spiral.
                let count = 400_000;
                let mut sums = [0.0; 2];
                for k in 0..count {
                    let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
                    let turn = f64::from(k) * 2.399_963_229_728_653;
                    let root = (1.0 - z * z).sqrt();
                    let towards = DVec3::new(root * turn.cos(), root * turn.sin(), z);
                    let rise = lobe.normal.dot(towards);
                    let cos = lobe.mirror.dot(towards);
                    if rise <= 0.0 || cos <= 0.0 {
                        continue;
                    }
                    let (row, column) =
                        (z.acos() / PI * 4.0, towards.y.atan2(towards.x) / TAU + 0.5);
                    let radiance =
                        map[(row as usize).min(3) * 5 + ((column * 5.0) as usize).min(4)];
                    let is_hidden =
                        before.iter().any(|b| b.distance(lobe.place, towards).is_some());
                    sums[usize::from(is_hidden)] += radiance * cos.powf(exponent) * rise;
                }
                let scale = of.factor * 4.0 * PI / f64::from(count);
                let what = format!("{exponent} {i} {}", before.len());
                for (found, sum) in [(seen, sums[0]), (hidden, sums[1])] {
                    assert!((found - sum * scale).abs() < 5e-3, "{what}: {found} {}", sum * scale);
                }
                let finer = of_sky(&of.finer(), (place, normal, into), before);
                assert!((finer[0] - seen).abs() < 1e-6, "{what}: {seen} {finer:?}");
            }
        }
    }
}

#[test]
fn what_is_hidden_of_a_surrounding_and_what_is_left_are_all_of_it() {
    let body = sphere([0.3, -0.2, 0.4], 0.25);
    for exponent in [0.0, 5.0, 300.0] {
        for into in [DVec3::new(-0.3, 0.2, 0.4), DVec3::new(0.5, 0.1, 0.8)] {
            let at = (DVec3::ZERO, DVec3::new(0.1, 0.1, 1.0), into);
            let [whole, none] = of_sky(&glossy(exponent), at, &[]);
            let [seen, hidden] = of_sky(&glossy(exponent), at, std::slice::from_ref(&body));
            assert!(
                none == 0.0 && (seen + hidden - whole).abs() < 1e-7 * whole,
                "{seen} {hidden} {whole}"
            );
        }
    }
}
