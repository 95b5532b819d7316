//! Throughputs against lines thrown at random with a fixed seed, and against plain sums over the
//! infinitesimal beams that they are made of: from the definitions, by nothing of the kernels' own.

mod dice;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use dice::{Dice, SIGMAS, mean};
use glam::{DVec2, DVec3};
use radiometry::chart::{Environment, Line, Perpendicular, Surface, TwoPlane};
use radiometry::convex::{self, ConvexBody};
use radiometry::quadrature::{Cell, adaptive_between, cubature, gauss_legendre};
use radiometry::quantity::Area;
use radiometry::shape::Polygon;
use radiometry::throughput::{coaxial_disks, infinitesimal_beam};
use radiometry::{Tolerance, form_factor, projected};

#[track_caller]
fn agrees(what: &str, closed: f64, (found, deviation): (f64, f64)) {
    assert!(deviation < 0.02 * closed, "{what}: too few samples, {found} ± {deviation}");
    let off = (closed - found).abs();
    assert!(off < SIGMAS * deviation, "{what}: {closed}, sampled {found} ± {deviation}");
}

/// Not positive within the body, and convex along every line.
fn level(body: ConvexBody, at: DVec3) -> f64 {
    let aside = at.truncate().length();
    match body {
        ConvexBody::Sphere { radius_m } => at.length() - radius_m,
        ConvexBody::Box { edges_m } => (at.abs() - DVec3::from_array(edges_m) / 2.0).max_element(),
        ConvexBody::Cylinder { radius_m, height_m } => {
            (aside - radius_m).max(at.z.abs() - height_m / 2.0)
        }
        ConvexBody::Cone { radius_m, height_m } => {
            (aside - radius_m * (1.0 - at.z / height_m)).max(-at.z)
        }
        ConvexBody::Ellipsoid { semi_axes_m } => {
            (at / DVec3::from_array(semi_axes_m)).length() - 1.0
        }
    }
}

/// By halving towards the lowest level on the line; `reach` from its middle there is no body any more.
fn is_met(body: ConvexBody, middle: DVec3, direction: DVec3, reach: f64) -> bool {
    let (mut low, mut high) = (-reach, reach);
    for _ in 0..40 {
        let third = (high - low) / 3.0;
        let [near, far] = [low + third, high - third].map(|t| level(body, middle + direction * t));
        if near <= 0.0 || far <= 0.0 {
            return true;
        }
        if near < far { high -= third } else { low += third }
    }
    false
}

/// The shadow's area along a direction from the body's axes.
fn shadow(body: ConvexBody, along: DVec3) -> f64 {
    let along = along.abs();
    let across = along.truncate().length();
    match body {
        ConvexBody::Sphere { radius_m } => PI * radius_m * radius_m,
        ConvexBody::Box { edges_m: [a, b, c] } => along.dot(DVec3::new(b * c, c * a, a * b)),
        ConvexBody::Cylinder { radius_m, height_m } => {
            PI * radius_m * radius_m * along.z + 2.0 * radius_m * height_m * across
        }
        // The base's ellipse, and the triangle from the apex that touches it if that is outside.
        ConvexBody::Cone { radius_m, height_m } => {
            let base = radius_m * radius_m * along.z;
            let apex = height_m * across / (radius_m * along.z);
            let wings =
                if apex > 1.0 { (apex * apex - 1.0).sqrt() - (1.0 / apex).acos() } else { 0.0 };
            base * (PI + wings)
        }
        ConvexBody::Ellipsoid { semi_axes_m: [a, b, c] } => {
            PI * (along * DVec3::new(b * c, c * a, a * b)).length()
        }
    }
}

#[test]
fn convex_bodies_by_lines_and_by_shadows() {
    let bodies = [
        ConvexBody::Sphere { radius_m: 0.7 },
        ConvexBody::Box { edges_m: [1.3, 0.4, 0.9] },
        ConvexBody::Cylinder { radius_m: 0.6, height_m: 1.1 },
        ConvexBody::Cone { radius_m: 0.8, height_m: 0.9 },
        ConvexBody::Ellipsoid { semi_axes_m: [1.0, 0.3, 0.6] },
    ];
    let mut dice = Dice(3);
    for body in bodies {
        let said = format!("{body:?}");
        let closed = convex::throughput(body).unwrap().m2_sr();
        // All lines through a ball about it: 4π of directions, each with the ball's shadow of places.
        let radius = 1.25;
        let lines = mean(20_000, || {
            let direction = dice.direction();
            let (x, y) = direction.any_orthonormal_pair();
            let place = DVec2::from_angle(TAU * dice.unit()) * (radius * dice.unit().sqrt());
            f64::from(is_met(body, x * place.x + y * place.y, direction, radius))
        });
        let all = 4.0 * PI * PI * radius * radius;
        agrees(&said, closed, (all * lines.0, all * lines.1));

        // The mean shadow over an octant, in cos θ and φ; smooth but where the cone's apex comes out.
        let (middle, tolerance) = (convex::mean_projected_area(body).unwrap().m2(), 1e-9);
        let toward =
            |cos: f64, phi: f64| (DVec2::from_angle(phi) * (1.0 - cos * cos).sqrt()).extend(cos);
        let tolerance = Tolerance::from_relative(tolerance).unwrap();
        let summed = if let ConvexBody::Cone { radius_m, height_m } = body {
            let out = (height_m / radius_m.hypot(height_m), 1.0);
            let of_theta = |theta: f64| theta.sin() * shadow(body, toward(theta.cos(), 0.0));
            let breaks = [0.0, out.0.acos(), FRAC_PI_2 - 1e-12];
            adaptive_between(of_theta, &breaks, tolerance).unwrap()
        } else {
            let octant = [Cell::Rectangle(DVec2::ZERO, DVec2::splat(FRAC_PI_2))];
            let part = |p: DVec2| p.x.sin() * shadow(body, toward(p.x.cos(), p.y)) / FRAC_PI_2;
            cubature(part, &octant, tolerance).unwrap()
        };
        let off = (middle - summed.value).abs();
        assert!(off <= summed.error_bound + 1e-11 * middle, "{said}: {middle} {summed:?}");
    }
}

/// Where a line crosses the plane z = `height`.
fn crossing(line: &Line, height: f64) -> DVec2 {
    let (at, along) = (line.point_m(), line.direction());
    (at + along * ((height - at.z) / along.z)).truncate()
}

#[test]
fn a_finite_beam_has_its_throughput_in_every_chart() {
    let mut dice = Dice(5);
    for (r1, r2, h) in [(1.0, 1.0, 1.0), (0.5, 1.2, 0.8), (2.0, 0.7, 1.5)] {
        let closed = coaxial_disks(r1, r2, h).unwrap().m2_sr();
        let is_in_beam = |line: &Line| {
            f64::from(crossing(line, 0.0).length() < r1 && crossing(line, h).length() < r2)
        };
        let widest = ((r1 + r2) / h).atan();
        let square = |dice: &mut Dice, r: f64| [dice.between(-r, r), dice.between(-r, r)];
        // Each chart's coordinates evenly over a box that holds the beam, weighted by its density.
        let angular = 4.0 * r1 * r1 * widest * TAU;
        let surface = mean(60_000, || {
            let [x_m, y_m] = square(&mut dice, r1);
            let (theta_rad, phi_rad) = (dice.between(0.0, widest), dice.between(-PI, PI));
            let ray = Surface { x_m, y_m, theta_rad, phi_rad };
            angular * ray.density() * is_in_beam(&ray.line().unwrap())
        });
        agrees("surface", closed, surface);
        let perpendicular = mean(60_000, || {
            let [x_m, y_m] = square(&mut dice, r1);
            let (theta_rad, phi_rad) = (dice.between(0.0, widest), dice.between(-PI, PI));
            let ray = Perpendicular { theta_rad, phi_rad, x_m, y_m };
            angular * ray.density() * is_in_beam(&ray.line().unwrap())
        });
        agrees("perpendicular", closed, perpendicular);
        let planes = mean(60_000, || {
            let ([u_m, v_m], [s_m, t_m]) = (square(&mut dice, r1), square(&mut dice, r2));
            let ray = TwoPlane { u_m, v_m, s_m, t_m, distance_m: h };
            16.0 * r1 * r1 * r2 * r2 * ray.density() * is_in_beam(&ray.line().unwrap())
        });
        agrees("two planes", closed, planes);
    }
}

#[test]
fn a_ball_has_its_projected_solid_angle_in_the_environments_chart() {
    let mut dice = Dice(7);
    // Overhead, aslant, and setting.
    for (sine, tilt) in [(0.8_f64, 0.0), (0.5, 0.6), (0.6, 1.4), (0.9, 1.7)] {
        let closed = projected::sphere_tilted(sine, 1.0, tilt).unwrap().sr();
        let middle = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        let cosine = (1.0 - sine * sine).sqrt();
        let found = mean(100_000, || {
            let (theta_rad, phi_rad) = (dice.between(0.0, FRAC_PI_2), dice.between(-PI, PI));
            let ray = Environment { theta_rad, phi_rad };
            FRAC_PI_2 * TAU * ray.density() * f64::from(ray.direction().dot(middle) > cosine)
        });
        agrees("environment", closed, found);
    }
}

/// The beam from a piece of one surface to a piece of another.
fn beam(from: (DVec3, DVec3, f64), to: (DVec3, DVec3, f64)) -> f64 {
    let ray = to.0 - from.0;
    let leaning = |normal: DVec3| (normal.dot(ray).abs() / ray.length()).min(1.0).acos();
    let end = |(_, normal, area): (DVec3, DVec3, f64)| (Area::from_m2(area), leaning(normal));
    infinitesimal_beam(end(from), end(to), ray.length()).unwrap().m2_sr()
}

#[test]
fn coaxial_disks_are_the_sum_of_their_infinitesimal_beams() {
    let rule = gauss_legendre(24);
    let around = 48;
    for (r1, r2, h) in [(1.0, 1.0, 1.0), (0.3, 1.1, 0.9), (1.4, 0.6, 1.2), (0.1, 0.2, 3.0)] {
        let mut sum = 0.0;
        for ((a, wa), (b, wb)) in rule.iter().flat_map(|a| rule.iter().map(move |b| (*a, *b))) {
            let (rho_1, rho_2) = (r1 * (a + 1.0) / 2.0, r2 * (b + 1.0) / 2.0);
            // Rings; by symmetry one place on the first stands for all of it.
            let (ring_1, ring_2) = (PI * rho_1 * r1 * wa, PI * rho_2 * r2 * wb);
            for k in 0..around {
                let place = DVec2::from_angle(TAU * f64::from(k) / f64::from(around)) * rho_2;
                let from = (DVec3::X * rho_1, DVec3::Z, ring_1);
                sum += beam(from, (place.extend(h), DVec3::Z, ring_2 / f64::from(around)));
            }
        }
        let closed = coaxial_disks(r1, r2, h).unwrap().m2_sr();
        assert!((sum / closed - 1.0).abs() < 1e-9, "{r1} {r2} {h}: {closed}, summed {sum}");
    }
}

#[test]
fn polygons_are_the_sum_of_their_infinitesimal_beams() {
    let mut dice = Dice(11);
    let rule = gauss_legendre(8);
    for _ in 0..6 {
        // Parallelograms, tilted, one wholly before the other.
        let mut side = |x: f64, y: f64| DVec3::new(x, y, 0.0) + 0.3 * dice.direction();
        let (from, to) = (
            [DVec3::ZERO, side(1.0, 0.0), side(0.0, 1.0)],
            [side(0.3, 0.1) + 1.8 * DVec3::Z, side(1.0, 0.4), side(-0.3, 1.0)],
        );
        let corners =
            |[o, a, b]: [DVec3; 3]| Polygon::new(vec![o, o + a, o + a + b, o + b]).unwrap();
        let nodes = |[o, a, b]: [DVec3; 3]| -> Vec<(DVec3, DVec3, f64)> {
            let normal = a.cross(b);
            let pairs = rule.iter().flat_map(|u| rule.iter().map(move |v| (*u, *v)));
            pairs
                .map(|((u, wu), (v, wv))| {
                    let place = o + a * (u + 1.0) / 2.0 + b * (v + 1.0) / 2.0;
                    (place, normal.normalize(), normal.length() * wu * wv / 4.0)
                })
                .collect()
        };
        let ends = nodes(to);
        let sum: f64 =
            nodes(from).iter().map(|a| ends.iter().map(|b| beam(*a, *b)).sum::<f64>()).sum();
        let tolerance = Tolerance::from_relative(1e-9).unwrap();
        let found =
            form_factor::throughput_of_polygons(&corners(from), &corners(to), tolerance).unwrap();
        let off = (found.value / sum - 1.0).abs();
        assert!(off < 1e-7, "{from:?} {to:?}: {found:?}, summed {sum}, off {off:e}");
    }
}
