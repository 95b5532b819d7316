//! Projected solid angles against rays shot at random with a fixed seed: another method, which shares
//! nothing with the kernels but the geometry.

mod dice;

use std::f64::consts::PI;

use dice::Dice;
use glam::DVec3;
use radiometry::projected::{self, Occluder, Receiver, Source, occluded};
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use radiometry::{DomainError, EstimateError, Tolerance, direction, solid_angle};

impl Dice {
    fn disk(&mut self, distance: f64) -> Disk {
        let center = self.direction() * distance;
        let radius = self.between(0.1, 0.45) * distance;
        Disk::new(center, self.direction(), radius).unwrap()
    }

    fn sphere(&mut self, distance: f64) -> Sphere {
        let center = self.direction() * distance;
        Sphere::new(center, self.between(0.1, 0.45) * distance).unwrap()
    }

    /// A pentagon with a notch, anywhere.
    fn polygon(&mut self, distance: f64) -> Polygon {
        let normal = self.direction();
        let (x, y) = direction::frame(normal);
        let center = self.direction() * distance;
        let flat = [(-1.0, -1.0), (1.0, -1.0), (0.8, 1.1), (0.1, -0.2), (-1.0, 0.7)];
        let size = 0.3 * distance;
        let vertex = |(u, v): (f64, f64)| center + x * (u * size) + y * (v * size);
        Polygon::new(flat.into_iter().map(vertex).collect()).unwrap()
    }

    fn source(&mut self, kind: u64, distance: f64) -> Source {
        match kind % 3 {
            0 => Source::Disk(self.disk(distance)),
            1 => Source::Sphere(self.sphere(distance)),
            _ => Source::Polygon(self.polygon(distance)),
        }
    }

    fn occluder(&mut self, kind: u64, distance: f64) -> Occluder {
        match kind % 4 {
            0 => Occluder::Disk(self.disk(distance)),
            1 => Occluder::Sphere(self.sphere(distance)),
            2 => Occluder::Polygon(self.polygon(distance)),
            _ => {
                let x_max = self.between(-1.0, 1.0) * distance;
                Occluder::HalfPlane(
                    HalfPlane::new(x_max, self.between(0.3, 1.0) * distance).unwrap(),
                )
            }
        }
    }
}

fn whole(receiver: &Receiver, source: &Source) -> f64 {
    let projected = match source {
        Source::Disk(disk) => projected::disk(receiver, disk),
        Source::Sphere(sphere) => projected::sphere(receiver, sphere),
        Source::Polygon(polygon) => projected::polygon(receiver, polygon),
    };
    projected.unwrap().sr()
}

/// Where a ray from the origin meets a body.
fn disk_hit(disk: &Disk, ray: DVec3) -> Option<f64> {
    let reach = disk.axis().dot(disk.center_m()) / disk.axis().dot(ray);
    (reach > 0.0 && (ray * reach - disk.center_m()).length() < disk.radius_m()).then_some(reach)
}

fn sphere_hit(sphere: &Sphere, ray: DVec3) -> Option<f64> {
    let along = sphere.center_m().dot(ray);
    let square = along * along - sphere.center_m().length_squared() + sphere.radius_m().powi(2);
    (along > 0.0 && square > 0.0).then(|| along - square.sqrt())
}

fn polygon_hit(polygon: &Polygon, ray: DVec3) -> Option<f64> {
    let corners = polygon.vertices();
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let reach = normal.dot(corners[0]) / normal.dot(ray);
    let hit = ray * reach;
    // By the angle that the edges turn through about the hit.
    let next = corners.iter().cycle().skip(1);
    let turned: f64 = corners
        .iter()
        .zip(next)
        .map(|(a, b)| {
            let (a, b) = (*a - hit, *b - hit);
            a.cross(b).dot(normal.normalize()).atan2(a.dot(b))
        })
        .sum();
    (reach > 0.0 && turned.abs() > 1.0).then_some(reach)
}

fn source_hit(source: &Source, ray: DVec3) -> Option<f64> {
    match source {
        Source::Disk(disk) => disk_hit(disk, ray),
        Source::Sphere(sphere) => sphere_hit(sphere, ray),
        Source::Polygon(polygon) => polygon_hit(polygon, ray),
    }
}

fn occluder_hit(occluder: &Occluder, ray: DVec3) -> Option<f64> {
    match occluder {
        Occluder::Disk(disk) => disk_hit(disk, ray),
        Occluder::Sphere(sphere) => sphere_hit(sphere, ray),
        Occluder::Polygon(polygon) => polygon_hit(polygon, ray),
        Occluder::HalfPlane(edge) => {
            let reach = edge.z_m() / ray.z;
            (reach > 0.0 && reach * ray.x <= edge.x_max_m()).then_some(reach)
        }
    }
}

const RAYS: u32 = 20_000;

/// The share of cosine-weighted rays that a test passes, times π, and its standard deviation.
fn shot(dice: &mut Dice, normal: DVec3, passes: impl Fn(DVec3) -> bool) -> (f64, f64) {
    let hits = (0..RAYS).filter(|_| passes(dice.ray(normal))).count() as f64;
    let share = hits / f64::from(RAYS);
    (PI * share, PI * ((share * (1.0 - share)).max(1e-5) / f64::from(RAYS)).sqrt())
}

/// One in 10^7 by chance.
const SIGMAS: f64 = 5.3;

#[test]
fn unoccluded_sources_agree_with_rays() {
    for seed in 0..120 {
        let mut dice = Dice(seed);
        let normal = dice.direction();
        let receiver = Receiver::new(DVec3::ZERO, normal).unwrap();
        let source = dice.source(seed, 1.0);
        let found = whole(&receiver, &source);
        let (expected, sigma) = shot(&mut dice, normal, |ray| source_hit(&source, ray).is_some());
        assert!(
            (found - expected).abs() < SIGMAS * sigma,
            "seed {seed}: {found}, rays {expected} ± {sigma} ({source:?}, {normal})"
        );
    }
}

#[test]
fn occluded_sources_agree_with_rays() {
    let mut partly = 0;
    for seed in 0..600 {
        let mut dice = Dice(1000 + seed);
        let source = dice.source(seed, 3.0);
        // Overhead, so that not too many look away.
        let middle = match &source {
            Source::Disk(disk) => disk.center_m(),
            Source::Sphere(sphere) => sphere.center_m(),
            Source::Polygon(polygon) => polygon.vertices()[0],
        };
        let normal = (middle.normalize() + 0.9 * dice.direction()).normalize();
        let receiver = Receiver::new(DVec3::ZERO, normal).unwrap();
        // Half of them beyond the source; the near ones are tried until one is in the way.
        let distance = if seed % 2 == 0 { 1.0 } else { 9.0 };
        let occluder = (0..20)
            .map(|_| dice.occluder(seed / 3, distance))
            .find(|occluder| occluder_hit(occluder, middle.normalize()).is_some());
        let Some(occluder) = occluder else { continue };
        let found = match occluded(&receiver, &source, &occluder, Tolerance::default()) {
            Err(EstimateError::Domain(
                DomainError::Interpenetrating | DomainError::Inside { .. },
            )) => continue,
            other => other.unwrap(),
        };
        let visible = |ray: DVec3| {
            let far = source_hit(&source, ray);
            far.is_some_and(|far| occluder_hit(&occluder, ray).is_none_or(|near| near > far))
        };
        let (expected, sigma) = shot(&mut dice, normal, visible);
        assert!(
            (found.value - expected).abs() < SIGMAS * sigma,
            "seed {seed}: {found:?}, rays {expected} ± {sigma}\n{source:?}\n{occluder:?}\n{normal}"
        );
        let part = found.value / whole(&receiver, &source);
        partly += u32::from(part > 0.001 && part < 0.999);
    }
    assert!(partly > 50, "only {partly} cases had a shadow on them");
}

#[test]
fn what_two_bodies_cover_does_not_depend_on_which_is_nearer() {
    // Ω̃(S without O) + Ω̃(O) = Ω̃(O without S) + Ω̃(S), S brought nearer for the right side.
    for seed in 0..400 {
        let mut dice = Dice(5000 + seed);
        let far = dice.source(seed, 3.0);
        let near = dice.source(seed / 3, 1.0);
        let receiver = Receiver::new(DVec3::ZERO, dice.direction()).unwrap();
        let visible = |source: &Source, occluder: Occluder| {
            occluded(&receiver, source, &occluder, Tolerance::default()).unwrap()
        };
        let whole = |source: &Source| whole(&receiver, source);
        let (left, right) =
            (visible(&far, as_occluder(&near, 1.0)), visible(&near, as_occluder(&far, 0.05)));
        let bound = left.error_bound + right.error_bound + 1e-12 * (whole(&near) + whole(&far));
        let difference = (left.value + whole(&near)) - (right.value + whole(&far));
        assert!(
            difference.abs() <= bound,
            "seed {seed}: off by {difference:e}, bound {bound:e}\n{far:?}\n{near:?}"
        );
    }
}

/// The same directions from the origin, at another distance.
fn as_occluder(source: &Source, scale: f64) -> Occluder {
    match source {
        Source::Disk(disk) => Occluder::Disk(
            Disk::new(disk.center_m() * scale, disk.axis(), disk.radius_m() * scale).unwrap(),
        ),
        Source::Sphere(sphere) => Occluder::Sphere(
            Sphere::new(sphere.center_m() * scale, sphere.radius_m() * scale).unwrap(),
        ),
        Source::Polygon(polygon) => Occluder::Polygon(
            Polygon::new(polygon.vertices().iter().map(|v| *v * scale).collect()).unwrap(),
        ),
    }
}

#[test]
fn solid_angles_agree_with_rays() {
    for seed in 0..60 {
        let mut dice = Dice(9000 + seed);
        let polygon = dice.polygon(1.0);
        let sphere = dice.sphere(1.0);
        let hits = |dice: &mut Dice, hit: &dyn Fn(DVec3) -> bool| {
            let share =
                (0..RAYS).filter(|_| hit(dice.direction())).count() as f64 / f64::from(RAYS);
            (
                4.0 * PI * share,
                4.0 * PI * ((share * (1.0 - share)).max(1e-5) / f64::from(RAYS)).sqrt(),
            )
        };
        let found = solid_angle::polygon(DVec3::ZERO, &polygon).unwrap().sr();
        let (expected, sigma) = hits(&mut dice, &|ray| polygon_hit(&polygon, ray).is_some());
        assert!((found - expected).abs() < SIGMAS * sigma, "seed {seed}: {found}, rays {expected}");
        let distance = sphere.center_m().length();
        let found = solid_angle::sphere(sphere.radius_m(), distance).unwrap().sr();
        let (expected, sigma) = hits(&mut dice, &|ray| sphere_hit(&sphere, ray).is_some());
        assert!((found - expected).abs() < SIGMAS * sigma, "seed {seed}: {found}, rays {expected}");
    }
}
