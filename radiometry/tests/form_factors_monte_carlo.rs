//! Every closed form of the form factors against rays, and against a quadrature of what single points see:
//! both written here, from the definition.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use radiometry::form_factor::{
    aligned_rectangles, coaxial_disks, concentric_spheres, parallel_cylinders, parallel_disks,
    parallel_rectangles, perpendicular_offset_rectangles, perpendicular_rectangles, sphere_disk,
    spheres, strips, wedge_rectangles,
};
use radiometry::projected::{self, Receiver, disk_parallel, disk_tilted, sphere_tilted};
use radiometry::quadrature::{Cell, adaptive_between, cubature};
use radiometry::shape::{Polygon, Sphere};
use radiometry::{Estimate, Tolerance};

/// A generator of its own, so that a failure can be run again.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 11) as f64 * 2_f64.powi(-53)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn on_disk(&mut self, radius: f64) -> DVec2 {
        let (r, phi) = (radius * self.next().sqrt(), 2.0 * PI * self.next());
        DVec2::new(r * phi.cos(), r * phi.sin())
    }

    /// By Lambert's law around a unit normal.
    fn ray(&mut self, normal: DVec3) -> DVec3 {
        let across = self.on_disk(1.0);
        let (e, f) = normal.any_orthonormal_pair();
        let up = (1.0 - across.length_squared()).max(0.0).sqrt();
        e * across.x + f * across.y + normal * up
    }

    /// The same in a plane.
    fn ray_2d(&mut self, normal: DVec2) -> DVec2 {
        let sine = self.between(-1.0, 1.0);
        normal.perp() * sine + normal * (1.0 - sine * sine).sqrt()
    }

    fn direction(&mut self) -> DVec3 {
        let (z, phi) = (self.between(-1.0, 1.0), 2.0 * PI * self.next());
        let across = (1.0 - z * z).sqrt();
        DVec3::new(across * phi.cos(), across * phi.sin(), z)
    }
}

const RAYS: u32 = 30_000;

/// The part of rays that hit, and 4.5 standard deviations of it.
fn rays(chance: &mut Chance, mut hits: impl FnMut(&mut Chance) -> bool) -> (f64, f64) {
    let count = (0..RAYS).filter(|_| hits(chance)).count() as f64;
    let part = count / f64::from(RAYS);
    (part, 4.5 * (part.max(1e-3) * (1.0 - part).max(1e-3) / f64::from(RAYS)).sqrt())
}

fn check(what: &str, closed: f64, (cast, wide): (f64, f64), summed: Estimate) {
    assert!((closed - cast).abs() <= wide, "{what}: {closed} by rays {cast} ± {wide}");
    let off = (closed - summed.value).abs();
    let allowed = summed.error_bound + 1e-13 * closed;
    assert!(off <= allowed, "{what}: {closed:e} by quadrature {summed:?}, off {off:e}");
}

fn fine() -> Tolerance {
    Tolerance::from_relative(1e-9).unwrap()
}

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn seen_polygon(point: DVec3, normal: DVec3, polygon: &Polygon) -> f64 {
    projected::polygon(&Receiver::new(point, normal).unwrap(), polygon).unwrap().sr() / PI
}

fn seen_sphere(point: DVec3, normal: DVec3, sphere: &Sphere) -> f64 {
    projected::sphere(&Receiver::new(point, normal).unwrap(), sphere).unwrap().sr() / PI
}

#[test]
fn disks() {
    let mut chance = Chance(31);
    for i in 0..12 {
        let (r1, r2) = (chance.between(0.2, 2.0), chance.between(0.2, 2.0));
        let (h, offset) = (chance.between(0.2, 2.0), chance.between(0.0, 3.0));
        let offset = if i % 2 == 0 { 0.0 } else { offset };
        let cast = rays(&mut chance, |chance| {
            let start = chance.on_disk(r1) + DVec2::X * offset;
            let ray = chance.ray(DVec3::Z);
            (start + ray.truncate() * (h / ray.z)).length() <= r2
        });
        // Over radius and azimuth of disk 1.
        let seen = |p: DVec2| {
            let from_axis = DVec2::new(offset + p.x * p.y.cos(), p.x * p.y.sin()).length();
            2.0 * p.x * disk_parallel(r2, h, from_axis).unwrap().sr() / (PI * PI * r1 * r1)
        };
        let half = Cell::Rectangle(DVec2::ZERO, DVec2::new(r1, PI));
        let summed = cubature(seen, &[half], fine()).unwrap();
        let said = format!("{r1} {r2} {h} {offset}");
        let general = parallel_disks(r1, r2, h, offset, Tolerance::FINE).unwrap().value;
        check(&said, general, cast, summed);
        if offset == 0.0 {
            check(&said, coaxial_disks(r1, r2, h).unwrap().ratio(), cast, summed);
        }
    }
}

#[test]
fn rectangles() {
    let mut chance = Chance(37);
    for _ in 0..8 {
        let mut side = || {
            let start = chance.between(0.0, 1.0);
            [start, start + chance.between(0.3, 2.0)]
        };
        let [x, y, xi, eta] = [side(), side(), side(), side()];
        let z = chance.between(0.3, 2.0);
        let inside = |side: [f64; 2], x: f64| side[0] <= x && x <= side[1];
        let cell = Cell::Rectangle(DVec2::new(x[0], y[0]), DVec2::new(x[1], y[1]));
        let area = (x[1] - x[0]) * (y[1] - y[0]);
        let point =
            |chance: &mut Chance| at(chance.between(x[0], x[1]), chance.between(y[0], y[1]), 0.0);
        let said = format!("{x:?} {y:?} {xi:?} {eta:?} {z}");

        let lid = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| at(xi[i], eta[j], z));
        let lid = Polygon::new(lid.to_vec()).unwrap();
        let cast = rays(&mut chance, |chance| {
            let (start, ray) = (point(chance), chance.ray(DVec3::Z));
            let end = start + ray * (z / ray.z);
            inside(xi, end.x) && inside(eta, end.y)
        });
        let seen = |p: DVec2| seen_polygon(p.extend(0.0), DVec3::Z, &lid) / area;
        let summed = cubature(seen, &[cell], fine()).unwrap();
        check(&said, aligned_rectangles(x, y, xi, eta, z).unwrap().ratio(), cast, summed);

        let wall = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| at(0.0, eta[i], xi[j]));
        let wall = Polygon::new(wall.to_vec()).unwrap();
        let cast = rays(&mut chance, |chance| {
            let (start, ray) = (point(chance), chance.ray(DVec3::Z));
            let end = start - ray * (start.x / ray.x);
            ray.x < 0.0 && inside(eta, end.y) && inside(xi, end.z)
        });
        let seen = |p: DVec2| seen_polygon(p.extend(0.0), DVec3::Z, &wall) / area;
        let summed = cubature(seen, &[cell], fine()).unwrap();
        let closed = perpendicular_offset_rectangles(x, y, xi, eta).unwrap().ratio();
        check(&said, closed, cast, summed);
    }
}

#[test]
fn rectangles_that_face_or_meet() {
    let mut chance = Chance(41);
    for i in 0..8 {
        let (a, b) = (chance.between(0.3, 2.0), chance.between(0.3, 2.0));
        let (l, cos_phi) = (chance.between(0.3, 2.0), [-0.8, 0.0, 0.6, 0.9][i % 4]);
        let sin_phi = (1.0_f64 - cos_phi * cos_phi).sqrt();
        let cell = Cell::Rectangle(DVec2::ZERO, DVec2::new(a, l));
        let arm = at(cos_phi, 0.0, sin_phi);
        let corners = [DVec3::ZERO, DVec3::Y * l, DVec3::Y * l + arm * b, arm * b];
        let other = Polygon::new(corners.to_vec()).unwrap();
        let across = at(-sin_phi, 0.0, cos_phi);
        let cast = rays(&mut chance, |chance| {
            let start = at(chance.between(0.0, a), chance.between(0.0, l), 0.0);
            let ray = chance.ray(DVec3::Z);
            let t = -across.dot(start) / across.dot(ray);
            let end = start + ray * t;
            t > 0.0 && (0.0..=l).contains(&end.y) && (0.0..=b).contains(&arm.dot(end))
        });
        let seen = |p: DVec2| seen_polygon(p.extend(0.0), DVec3::Z, &other) / (a * l);
        let summed = cubature(seen, &[cell], fine()).unwrap();
        let said = format!("wedge {a} {b} {l} {cos_phi}");
        let wedge = wedge_rectangles(a, b, l, cos_phi, Tolerance::FINE).unwrap().value;
        check(&said, wedge, cast, summed);
        if i % 4 == 1 {
            check(&said, perpendicular_rectangles(a, b, l).unwrap().ratio(), cast, summed);
        }

        let lid = [(0.0, 0.0), (a, 0.0), (a, l), (0.0, l)].map(|(x, y)| at(x, y, b));
        let lid = Polygon::new(lid.to_vec()).unwrap();
        let cast = rays(&mut chance, |chance| {
            let start = at(chance.between(0.0, a), chance.between(0.0, l), 0.0);
            let ray = chance.ray(DVec3::Z);
            let end = start + ray * (b / ray.z);
            (0.0..=a).contains(&end.x) && (0.0..=l).contains(&end.y)
        });
        let seen = |p: DVec2| seen_polygon(p.extend(0.0), DVec3::Z, &lid) / (a * l);
        let summed = cubature(seen, &[cell], fine()).unwrap();
        check("facing", parallel_rectangles(a, l, b).unwrap().ratio(), cast, summed);
    }
}

#[test]
fn balls() {
    let mut chance = Chance(43);
    for _ in 0..8 {
        let (r1, r2) = (chance.between(0.3, 2.0), chance.between(0.3, 2.0));
        let gap = chance.between(0.05, 2.0);
        let hits_ball = |start: DVec3, ray: DVec3, center: DVec3, radius: f64| {
            let to_center = center - start;
            let along = to_center.dot(ray);
            along > 0.0 && to_center.length_squared() - along * along <= radius * radius
        };
        let said = format!("{r1} {r2} {gap}");

        let center = DVec3::Z * (r1 + r2 + gap);
        let cast = rays(&mut chance, |chance| {
            let normal = chance.direction();
            hits_ball(normal * r1, chance.ray(normal), center, r2)
        });
        let other = Sphere::new(center, r2).unwrap();
        // By the cosine of the place on ball 1, broken where the other begins to set and has set.
        let seen = |z: f64| {
            let normal = at((1.0 - z * z).sqrt(), 0.0, z);
            0.5 * seen_sphere(normal * r1, normal, &other)
        };
        let far = r1 + r2 + gap;
        let breaks = [(r1 - r2) / far, (r1 + r2) / far];
        let summed = adaptive_between(seen, &[-1.0, breaks[0], breaks[1], 1.0], fine()).unwrap();
        let closed = spheres(r1, r2, far, Tolerance::FINE).unwrap().value;
        check(&said, closed, cast, summed);

        let h = r1 + gap;
        let cast = rays(&mut chance, |chance| {
            let normal = chance.direction();
            let (start, ray) = (normal * r1, chance.ray(normal));
            let t = -(start.z + h) / ray.z;
            t > 0.0 && (start + ray * t).truncate().length() <= r2
        });
        let ball = Sphere::new(DVec3::Z * h, r1).unwrap();
        let share = PI * r2 * r2 / (4.0 * PI * r1 * r1);
        let seen =
            |r: f64| share * 2.0 * r / (r2 * r2) * seen_sphere(at(r, 0.0, 0.0), DVec3::Z, &ball);
        let summed = adaptive_between(seen, &[0.0, r2], fine()).unwrap();
        check(&said, sphere_disk(r1, h, r2).unwrap().ratio(), cast, summed);

        let outer = r1 + gap;
        let cast = rays(&mut chance, |chance| {
            let normal = chance.direction();
            hits_ball(normal * outer, chance.ray(-normal), DVec3::ZERO, r1)
        });
        let inner = Sphere::new(DVec3::ZERO, r1).unwrap();
        let summed = Estimate::closed(seen_sphere(DVec3::X * outer, -DVec3::X, &inner), 8.0);
        check(&said, concentric_spheres(r1, outer).unwrap().ratio(), cast, summed);
    }
}

#[test]
fn strips_and_cylinders() {
    let mut chance = Chance(47);
    for _ in 0..8 {
        let p =
            [DVec2::new(chance.between(-1.0, 0.0), 0.0), DVec2::new(chance.between(0.1, 1.0), 0.0)];
        let mut high = || DVec2::new(chance.between(-2.0, 2.0), chance.between(0.2, 2.0));
        let q = [high(), high()];
        // Both ends of p on one side of q's line.
        let side = |x: DVec2| (q[1] - q[0]).perp_dot(x - q[0]) > 0.0;
        if side(p[0]) != side(p[1]) {
            continue;
        }
        let sine = |from: DVec2, to: DVec2| (to.x - from.x) / from.distance(to);
        let cast = rays(&mut chance, |chance| {
            let start = p[0].lerp(p[1], chance.next());
            let found = chance.between(-1.0, 1.0);
            let ends = q.map(|end| sine(start, end));
            (ends[0] - found) * (ends[1] - found) <= 0.0
        });
        let seen = |t: f64| {
            let start = p[0].lerp(p[1], t);
            (sine(start, q[0]) - sine(start, q[1])).abs() / 2.0
        };
        let summed = adaptive_between(seen, &[0.0, 1.0], fine()).unwrap();
        check(&format!("{p:?} {q:?}"), strips(p, q).unwrap().ratio(), cast, summed);

        let (r, gap) = (chance.between(0.2, 1.0), chance.between(0.01, 3.0));
        let d = 2.0 * r + gap;
        let cast = rays(&mut chance, |chance| {
            let phi = chance.between(-PI, PI);
            let normal = DVec2::new(phi.cos(), phi.sin());
            let ray = chance.ray_2d(normal);
            let to_axis = DVec2::X * d - normal * r;
            to_axis.dot(ray) > 0.0 && to_axis.perp_dot(ray).abs() <= r
        });
        // From a point of the one, the sines between the tangents of the other, above its horizon.
        let seen = |phi: f64| {
            let normal = DVec2::new(phi.cos(), phi.sin());
            let to_axis = DVec2::X * d - normal * r;
            let (middle, half) = (
                normal.perp_dot(to_axis).atan2(normal.dot(to_axis)),
                (r / to_axis.length()).asin(),
            );
            let clamped = |angle: f64| angle.clamp(-PI / 2.0, PI / 2.0).sin();
            (clamped(middle + half) - clamped(middle - half)) / 2.0 / PI
        };
        let set = [0.0, (2.0 * r / d).acos(), PI / 2.0, PI];
        let summed = adaptive_between(seen, &set, fine()).unwrap();
        check(&format!("{r} {d}"), parallel_cylinders(r, d).unwrap().ratio(), cast, summed);
    }
}

#[test]
fn points_before_disks_and_balls() {
    let mut chance = Chance(53);
    for _ in 0..12 {
        let (radius, h) = (chance.between(0.2, 2.0), chance.between(0.2, 2.0));
        let (offset, angle) = (chance.between(0.0, 3.0), chance.between(0.0, PI));
        let normal = at(angle.sin(), 0.0, angle.cos());
        let on_disk = |center: DVec3, ray: DVec3| {
            ray.z > 0.0 && (ray * (center.z / ray.z) - center).length() <= radius
        };
        let parallel =
            rays(&mut chance, |chance| on_disk(at(offset, 0.0, h), chance.ray(DVec3::Z)));
        let tilted = rays(&mut chance, |chance| on_disk(DVec3::Z * h, chance.ray(normal)));
        let far = radius + h;
        let ball = rays(&mut chance, |chance| {
            let ray = chance.ray(normal);
            ray.z > 0.0 && (far * ray.truncate().length()) <= radius
        });
        // ∫ cos θ dω over the disk, from the definition.
        let over = |center: DVec3, normal: DVec3| {
            let kernel = |p: DVec2| {
                let ray = center + at(p.x * p.y.cos(), p.x * p.y.sin(), 0.0);
                let cosines = (normal.dot(ray)).max(0.0) * h;
                p.x * cosines / ray.length_squared().powi(2)
            };
            let cells = [[0.0, PI], [PI, 2.0 * PI]]
                .map(|[from, to]| Cell::Rectangle(DVec2::new(0.0, from), DVec2::new(radius, to)));
            let rough = Tolerance::new(1e-6, 1e-7, 1_000_000).unwrap();
            cubature(kernel, &cells, rough).unwrap().scaled(1.0 / PI)
        };
        let said = format!("{radius} {h} {offset} {angle}");
        let closed = disk_parallel(radius, h, offset).unwrap().sr() / PI;
        check(&said, closed, parallel, over(at(offset, 0.0, h), DVec3::Z));
        let closed = disk_tilted(radius, h, angle).unwrap().sr() / PI;
        check(&said, closed, tilted, over(DVec3::Z * h, normal));
        let closed = sphere_tilted(radius, far, angle).unwrap().sr() / PI;
        // The ball is the disk of its outline.
        let sine = radius / far;
        let (level, rim) = (far * (1.0 - sine * sine), radius * (1.0 - sine * sine).sqrt());
        let outline = disk_tilted(rim, level, angle).unwrap().sr() / PI;
        check(&said, closed, ball, Estimate { value: outline, error_bound: 1e-12, evaluations: 0 });
    }
}
