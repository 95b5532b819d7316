//! Form factors past opaque bodies, against a ray caster of the tests' own, against scenes whose shadow
//! is known, and against the laws.

use std::f64::consts::PI;

use glam::DVec3;
use radiometry::form_factor::{aligned_rectangles, polygons, polygons_occluded, strips};
use radiometry::projected::Occluder;
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use radiometry::{DomainError, Estimate, EstimateError, Tolerance};

/// A generator of its own, so that a failure can be run again.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 11) as f64 * 2_f64.powi(-53)
    }
}

fn polygon(corners: &[[f64; 3]]) -> Polygon {
    Polygon::new(corners.iter().map(|v| DVec3::from_array(*v)).collect()).unwrap()
}

/// Horizontal.
fn plate(x: [f64; 2], y: [f64; 2], z: f64) -> Polygon {
    polygon(&[[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]])
}

/// At one x.
fn wall(x: f64, y: [f64; 2], z: [f64; 2]) -> Polygon {
    polygon(&[[x, y[0], z[0]], [x, y[1], z[0]], [x, y[1], z[1]], [x, y[0], z[1]]])
}

fn square(z: f64) -> Polygon {
    plate([0.0, 1.0], [0.0, 1.0], z)
}

fn tolerance(relative: f64) -> Tolerance {
    Tolerance::from_relative(relative).unwrap()
}

fn seen(from: &Polygon, to: &Polygon, occluders: &[Occluder], relative: f64) -> Estimate {
    polygons_occluded(from, to, occluders, tolerance(relative)).unwrap()
}

// The ray caster: knows nothing of how the crate does it.

fn blocks(occluder: &Occluder, from: DVec3, to: DVec3) -> bool {
    let ray = to - from;
    let on_plane = |point: DVec3, normal: DVec3| {
        let t = normal.dot(point - from) / normal.dot(ray);
        (t > 0.0 && t < 1.0).then(|| from + ray * t)
    };
    match occluder {
        Occluder::HalfPlane(half_plane) => {
            on_plane(DVec3::new(0.0, 0.0, half_plane.z_m()), DVec3::Z)
                .is_some_and(|hit| hit.x <= half_plane.x_max_m())
        }
        Occluder::Disk(disk) => on_plane(disk.center_m(), disk.axis())
            .is_some_and(|hit| hit.distance(disk.center_m()) <= disk.radius_m()),
        Occluder::Sphere(ball) => {
            let t = ((ball.center_m() - from).dot(ray) / ray.length_squared()).clamp(0.0, 1.0);
            (from + ray * t).distance(ball.center_m()) <= ball.radius_m()
        }
        Occluder::Polygon(polygon) => {
            let v = polygon.vertices();
            let normal = (1..v.len() - 1)
                .map(|i| (v[i] - v[0]).cross(v[i + 1] - v[0]))
                .fold(DVec3::ZERO, |sum, triangle| sum + triangle);
            let Some(hit) = on_plane(v[0], normal) else { return false };
            // Crossing number along an axis across the normal.
            let size = normal.abs();
            let flat = |x: DVec3| match (size.x >= size.y, size.y >= size.z, size.x >= size.z) {
                (true, _, true) => (x.y, x.z),
                (false, true, _) => (x.z, x.x),
                _ => (x.x, x.y),
            };
            let (px, py) = flat(hit);
            let mut inside = false;
            for i in 0..v.len() {
                let ((ax, ay), (bx, by)) = (flat(v[i]), flat(v[(i + 1) % v.len()]));
                if (ay > py) != (by > py) && px < ax + (py - ay) / (by - ay) * (bx - ax) {
                    inside = !inside;
                }
            }
            inside
        }
    }
}

/// Mean and its standard error over pairs of points of two triangles or parallelograms, the first
/// three corners of each given, facing each other.
fn cast(
    from: [DVec3; 3],
    to: [DVec3; 3],
    are_triangles: bool,
    occluders: &[Occluder],
    chance: &mut Chance,
) -> (f64, f64) {
    const RAYS: u32 = 60_000;
    let normals = [from, to].map(|t| (t[1] - t[0]).cross(t[2] - t[0]));
    let area_to = normals[1].length() * if are_triangles { 0.5 } else { 1.0 };
    let units = normals.map(|normal| normal.normalize());
    let mut place = |t: [DVec3; 3]| {
        let (mut u, mut v) = (chance.next(), chance.next());
        if are_triangles && u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v
    };
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..RAYS {
        let (start, end) = (place(from), place(to));
        let ray = end - start;
        let cosines = (units[0].dot(ray) * units[1].dot(ray)).abs();
        let kernel = area_to * cosines / (PI * ray.length_squared().powi(2));
        let is_blocked = occluders.iter().any(|occluder| blocks(occluder, start, end));
        let value = if is_blocked { 0.0 } else { kernel };
        sum += value;
        squares += value * value;
    }
    let count = f64::from(RAYS);
    let mean = sum / count;
    (mean, ((squares / count - mean * mean).max(0.0) / count).sqrt())
}

#[test]
fn random_scenes_agree_with_rays_and_obey_the_laws() {
    let mut chance = Chance(23);
    for scene in 0..60 {
        let mut corner = |z: f64| DVec3::new(chance.next(), chance.next(), z + 0.3 * chance.next());
        let from = [corner(0.0), corner(0.0), corner(0.0)];
        let to = [corner(2.0), corner(2.0), corner(2.0)];
        let mut occluders = Vec::new();
        for kind in 0..=scene % 3 {
            let z = 0.7 + 0.35 * f64::from(kind);
            let center = corner(z);
            occluders.push(match (scene / 3 + kind) % 4 {
                0 => {
                    Occluder::Polygon(Polygon::new(vec![corner(z), corner(z), corner(z)]).unwrap())
                }
                1 => Occluder::Disk(Disk::new(center, corner(z) - center, 0.25).unwrap()),
                2 => Occluder::Sphere(Sphere::new(center, 0.15).unwrap()),
                // A dart.
                _ => {
                    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, z, 2.0 * z, center.x);
                    let dart = [[0.5, 0.0], [-0.3, 0.4], [-0.1, 0.0], [-0.3, -0.4]];
                    let at = |v: [f64; 2]| center + turn * (DVec3::new(v[0], v[1], 0.0) * 0.6);
                    Occluder::Polygon(Polygon::new(dart.map(at).to_vec()).unwrap())
                }
            });
        }
        let facing = |t: [DVec3; 3], others: [DVec3; 3]| {
            let normal = (t[1] - t[0]).cross(t[2] - t[0]);
            let sides = others.map(|x| normal.dot(x - t[0]) > 0.0);
            sides == [true; 3] || sides == [false; 3]
        };
        if !facing(from, to) || !facing(to, from) {
            continue;
        }
        let [p, q] = [from, to].map(|t| Polygon::new(t.to_vec()).unwrap());
        let wanted = tolerance(2e-4);
        let kinds = format!("{scene}: {occluders:?}");
        let estimate = match polygons_occluded(&p, &q, &occluders, wanted) {
            Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
            Err(error) => panic!("{kinds}: {error}"),
        };
        let whole = polygons(&p, &q, wanted).unwrap();
        assert!(estimate.error_bound <= 2e-3 * whole.value, "{kinds} {estimate:?}");
        assert!(estimate.value >= 0.0 && estimate.value <= whole.value + whole.error_bound);
        let (mean, deviation) = cast(from, to, true, &occluders, &mut chance);
        let off = (mean - estimate.value).abs();
        assert!(off <= 4.5 * deviation + estimate.error_bound, "{kinds} {estimate:?} {mean}");
        // Reciprocity.
        let area = |t: [DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length();
        let back = match polygons_occluded(&q, &p, &occluders, wanted) {
            Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
            Err(error) => panic!("{kinds}: {error}"),
        };
        let (there, back) = (area(from) * estimate.value, area(to) * back.value);
        assert!((there - back).abs() <= 1e-12 * there, "{kinds}: {there} {back}");
    }
}

#[test]
fn a_plate_across_leaves_nothing_and_one_aside_everything() {
    let lid = Occluder::Polygon(plate([-1.0, 2.0], [-1.0, 2.0], 0.5));
    let none = seen(&square(0.0), &square(1.0), &[lid], 1e-9);
    assert!(none.value <= none.error_bound && none.error_bound < 1e-14, "{none:?}");
    // Exactly as large as the squares, and touching one of them: in a plane, it hides nothing.
    let whole = aligned_rectangles([0.0, 1.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0], 1.0).unwrap();
    let idle = [
        square(0.0),
        square(1.0),
        square(-0.5),
        square(1.5),
        plate([1.0, 2.0], [0.0, 1.0], 0.5),
        wall(1.0, [0.0, 1.0], [0.0, 1.0]),
        wall(1.0, [-1.0, 1.0], [-3.0, 4.0]),
        wall(1.2, [0.0, 1.0], [0.0, 1.0]),
        wall(0.5, [0.0, 1.0], [1.0, 2.0]),
        wall(0.5, [0.0, 1.0], [-1.0, 0.0]),
    ];
    for body in idle {
        let all = seen(&square(0.0), &square(1.0), &[Occluder::Polygon(body.clone())], 1e-9);
        assert!((all.value - whole.ratio()).abs() <= all.error_bound, "{body:?}: {all:?}");
    }
    // One just as large as both is in every line between them; a smaller one is not.
    let alike = seen(&square(0.0), &square(1.0), &[Occluder::Polygon(square(0.5))], 1e-9);
    assert!(alike.value <= alike.error_bound && alike.error_bound < 1e-14, "{alike:?}");
    let smaller = [Occluder::Polygon(plate([0.25, 0.75], [0.25, 0.75], 0.5))];
    let aligned = seen(&square(0.0), &square(1.0), &smaller, 1e-7);
    let rays = cast(
        [DVec3::ZERO, DVec3::X, DVec3::Y],
        [DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::new(0.0, 1.0, 1.0)],
        false,
        &smaller,
        &mut Chance(1),
    );
    assert!((aligned.value - rays.0).abs() < 4.5 * rays.1, "{aligned:?} {rays:?}");
}

#[test]
fn a_septum_parts_a_gap_into_two() {
    // Each half sees the half over it, and nothing else.
    let half = [0.0, 0.5];
    let exact = aligned_rectangles(half, [0.0, 1.0], half, [0.0, 1.0], 1.0).unwrap().ratio();
    for septum in [
        wall(0.5, [0.0, 1.0], [0.0, 1.0]),
        // Through both, and twice the same.
        wall(0.5, [-1.0, 2.0], [-1.0, 2.0]),
    ] {
        let septum = Occluder::Polygon(septum);
        for relative in [1e-3, 1e-6, 1e-9] {
            for bodies in [vec![septum.clone()], vec![septum.clone(), septum.clone()]] {
                let found = seen(&square(0.0), &square(1.0), &bodies, relative);
                assert!((found.value - exact).abs() <= found.error_bound, "{found:?} {exact}");
            }
        }
    }
}

#[test]
fn a_low_septum_between_long_strips_is_crossed_strings_round_its_top() {
    // Strips [0, 1] on the floor and [0, 1] at height 1, a septum at ½ from the floor up to 0.4: by
    // strings, the left half sees the ceiling past the top at (½, 0.4).
    let top = glam::DVec2::new(0.5, 0.4);
    let at = |x: f64, y: f64| glam::DVec2::new(x, y);
    // Strings for floor [0, ½] and the whole ceiling: crossed ones end at (0,0)-(1,1) bent over the
    // top where it is in the way, (½,0)-(0,1); uncrossed (0,0)-(0,1), (½,0)-top-(1,1).
    let (p0, p1, q0, q1) = (at(0.0, 0.0), at(0.5, 0.0), at(0.0, 1.0), at(1.0, 1.0));
    // The straight string from (0,0) to (1,1) passes over the top.
    assert!(top.y < 0.5);
    let crossed = p0.distance(q1) + p1.distance(q0);
    let uncrossed = p0.distance(q0) + p1.distance(top) + top.distance(q1);
    // Each half sees as much, by symmetry.
    let exact = (crossed - uncrossed) / (2.0 * 0.5);
    let unhindered = strips([p0, at(1.0, 0.0)], [q0, q1]).unwrap().ratio();
    assert!(exact < unhindered);
    for length in [1e2, 1e3, 1e4] {
        let y = [0.0, length];
        let (floor, ceiling) = (plate([0.0, 1.0], y, 0.0), plate([0.0, 1.0], y, 1.0));
        let septum = [Occluder::Polygon(wall(0.5, y, [0.0, 0.4]))];
        let found = seen(&floor, &ceiling, &septum, 1e-5);
        // The ends see less: a part of 1/length.
        let missing = exact - found.value;
        assert!(missing > 0.0 && missing < 1.0 / length, "{length}: {found:?} {exact}");
    }
}

#[test]
fn shadows_of_disk_ball_and_edge_over_a_point_are_known() {
    let half = 1e-4;
    let source = plate([-half, half], [-half, half], 0.0);
    let target = plate([-3.0, 3.0], [-3.0, 3.0], 2.0);
    let whole = polygons(&source, &target, tolerance(1e-9)).unwrap().value;
    let up = DVec3::new(0.0, 0.0, 0.7);
    let disk = Occluder::Disk(Disk::new(up, DVec3::Z, 0.5).unwrap());
    let ball = Occluder::Sphere(Sphere::new(up, 0.5).unwrap());
    let edge = Occluder::HalfPlane(HalfPlane::new(0.0, 0.7).unwrap());
    // sin² of the half angle; the source is not quite a point, of the order of its squared size.
    let cases = [
        (disk.clone(), 0.25 / (0.25 + 0.49)),
        (ball.clone(), 0.25 / 0.49),
        (edge.clone(), whole / 2.0),
    ];
    for (body, hidden) in cases {
        let found = seen(&source, &target, std::slice::from_ref(&body), 1e-6);
        let exact = whole - hidden;
        assert!(
            (found.value - exact).abs() < found.error_bound + 1e-7,
            "{body:?} {found:?} {exact}"
        );
    }
    // The ball hides the disk that is within it; a half of both is behind the edge.
    let Err(EstimateError::Unmet { estimate: both, .. }) =
        polygons_occluded(&source, &target, &[disk, ball.clone()], tolerance(1e-6))
    else {
        panic!("one of them counts as a polygon of 96 corners");
    };
    assert!((both.value - (whole - 0.25 / 0.49)).abs() <= both.error_bound + 1e-7, "{both:?}");
    assert!(both.error_bound < 1e-3);
    let behind_edge = seen(&source, &target, &[edge, ball], 1e-6);
    let exact = (whole - 0.25 / 0.49) / 2.0;
    assert!((behind_edge.value - exact).abs() <= behind_edge.error_bound + 1e-6, "{behind_edge:?}");
}

#[test]
fn balls_may_touch_but_not_pierce() {
    let touching = [Occluder::Sphere(Sphere::new(DVec3::new(0.5, 0.5, 0.5), 0.5).unwrap())];
    let from_corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let to_corners = from_corners.map(|x| x + DVec3::Z);
    let found = match polygons_occluded(&square(0.0), &square(1.0), &touching, tolerance(1e-4)) {
        Ok(estimate) | Err(EstimateError::Unmet { estimate, .. }) => estimate,
        Err(error) => panic!("{error}"),
    };
    let rays = cast(from_corners, to_corners, false, &touching, &mut Chance(4));
    assert!((found.value - rays.0).abs() < 4.5 * rays.1 + found.error_bound, "{found:?} {rays:?}");
    let through = [Occluder::Sphere(Sphere::new(DVec3::new(0.5, 0.5, 0.3), 0.4).unwrap())];
    let error = polygons_occluded(&square(0.0), &square(1.0), &through, tolerance(1e-4));
    assert_eq!(error, Err(EstimateError::Domain(DomainError::Interpenetrating)));
}

#[test]
fn bounds_hold_from_coarse_to_fine() {
    let tilted = Occluder::Polygon(polygon(&[[0.2, 0.1, 0.3], [0.9, 0.3, 0.5], [0.7, 0.8, 0.6]]));
    let dart = Occluder::Polygon(polygon(&[
        [0.0, 0.0, 0.7],
        [0.5, 0.2, 0.7],
        [1.0, 0.0, 0.7],
        [0.5, 0.9, 0.7],
    ]));
    for bodies in [vec![tilted.clone()], vec![dart.clone()], vec![tilted, dart]] {
        let fine = seen(&square(0.0), &square(1.0), &bodies, 1e-8);
        for relative in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let found = seen(&square(0.0), &square(1.0), &bodies, relative);
            let off = (found.value - fine.value).abs();
            assert!(off <= found.error_bound + fine.error_bound, "{found:?} {fine:?}");
        }
    }
}

#[test]
fn bounds_hold_in_random_scenes() {
    let mut chance = Chance(61);
    for scene in 0..16 {
        let mut corner = |low: f64, high: f64| {
            DVec3::new(chance.next(), chance.next(), low + (high - low) * chance.next())
        };
        let mut bodies: Vec<Occluder> = (0..=scene % 3)
            .map(|_| Polygon::new(vec![corner(0.0, 1.0), corner(0.0, 1.0), corner(0.0, 1.0)]))
            .map(|triangle| Occluder::Polygon(triangle.unwrap()))
            .collect();
        if scene % 4 == 0 {
            let disk = Disk::new(corner(0.3, 0.7), corner(-1.0, 1.0), 0.2).unwrap();
            bodies.push(Occluder::Disk(disk));
        }
        let find = |relative: f64| {
            let (from, to) = (square(0.0), square(1.0));
            let tolerance = Tolerance::new(relative, 0.0, 15_000).unwrap();
            match polygons_occluded(&from, &to, &bodies, tolerance) {
                Ok(found) | Err(EstimateError::Unmet { estimate: found, .. }) => found,
                Err(error) => panic!("{bodies:?}: {error}"),
            }
        };
        let fine = find(1e-7);
        assert!(fine.error_bound < 1e-3, "{bodies:?} {fine:?}");
        for relative in [1e-2, 1e-4] {
            let found = find(relative);
            let off = (found.value - fine.value).abs();
            assert!(off <= found.error_bound + fine.error_bound, "{bodies:?}: {found:?} {fine:?}");
        }
    }
}

#[test]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "places in short lists"
)]
fn anything_at_all_gives_a_factor_or_an_error() {
    let odd = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-320, 1e-200, 1e-9, 1e9, 1e200, f64::MAX];
    let mut chance = Chance(59);
    let coarse = Tolerance::new(1e-2, 0.0, 20_000).unwrap();
    let mut counts = [0; 2];
    for _ in 0..3000 {
        // Mostly of one size, or hardly a scene would have any digits.
        let mut pick = |wild: f64| {
            let at = chance.next();
            let index = (at * odd.len() as f64).floor();
            if chance.next() < wild {
                odd.into_iter().nth(index as usize).unwrap_or(0.0)
            } else {
                (4.0 * at).floor() / 2.0
            }
        };
        let wild = if pick(0.0) > 1.0 { 0.5 } else { 0.02 };
        let mut corners = |count: usize| {
            let corner = |_| DVec3::new(pick(wild), pick(wild), pick(wild));
            (0..count).map(corner).collect::<Vec<_>>()
        };
        let (from, to) = (Polygon::new(corners(3)), Polygon::new(corners(3)));
        let (Ok(from), Ok(to)) = (from, to) else { continue };
        let [a, b, c] = [corners(1)[0], corners(1)[0], corners(1)[0]];
        let mut bodies = Vec::new();
        bodies.extend(Polygon::new(corners(3)).ok().map(Occluder::Polygon));
        bodies.extend(Polygon::new(corners(4)).ok().map(Occluder::Polygon));
        bodies.extend(Disk::new(a, b, c.x).ok().map(Occluder::Disk));
        bodies.extend(Sphere::new(b, c.y).ok().map(Occluder::Sphere));
        bodies.extend(HalfPlane::new(c.z, a.x).ok().map(Occluder::HalfPlane));
        // One of them, so that not everything is hidden.
        let body = bodies.swap_remove((a.y.abs() as usize) % bodies.len());
        match polygons_occluded(&from, &to, &[body], coarse) {
            Ok(found) | Err(EstimateError::Unmet { estimate: found, .. }) => {
                counts[0] += 1;
                assert!((0.0..=1.0).contains(&found.value), "{found:?}");
                assert!(found.error_bound >= 0.0, "{found:?}");
            }
            Err(EstimateError::Domain(_)) => counts[1] += 1,
            Err(error) => panic!("{from:?} {to:?}: {error}"),
        }
    }
    assert!(counts.iter().all(|count| *count > 20), "{counts:?}");
}
