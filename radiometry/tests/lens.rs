//! What becomes of radiance and throughput at interfaces, and through a real lens of two spherical
//! faces: n²T stays, and with source and detector in one medium radiance never rises. The magnifying
//! glass concentrates because it fills a larger projected solid angle, not because its rays carry more.

use glam::{DMat4, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use radiometry::direction::unit;
use radiometry::interface::{Incidence, Interface, basic_radiance, radiance_in_medium, reflect};
use radiometry::projected::{Receiver, disk_parallel, polygon};
use radiometry::quadrature::{Sum, cone};
use radiometry::quantity::Radiance;
use radiometry::ray::Ray;
use radiometry::shape::Polygon;
use radiometry::solid_angle::triangle;

fn repeatable(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(20_261_122),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(repeatable(2000))]

    /// Between two cones about the normal the projected solid angle is π(cos² θa - cos² θb); times n²
    /// it is the same on both sides, from straight on to grazing, however alike the indices.
    #[test]
    fn n_squared_t_of_a_finite_beam_stays_at_refraction(
        n1 in 1.0..2.5f64, step in -16.0..0.0f64, denser in any::<bool>(),
        grazing in -12.0..0.0f64, wider in 1.001..10.0f64
    ) {
        let n2 = n1 * (1.0 + if denser { 1.0 } else { -0.5 } * 10f64.powf(step));
        let face = Interface::new(n1, n2).unwrap();
        let (far, near) = (10f64.powf(grazing), (10f64.powf(grazing) * wider).min(1.0));
        let refracted = |cos: f64| face.refracted_cos(Incidence::from_cos(cos).unwrap());
        let (Some(near_t), Some(far_t)) = (refracted(near), refracted(far)) else {
            return Ok(());
        };
        let before = n1 * n1 * (near - far) * (near + far);
        let after = n2 * n2 * (near_t - far_t) * (near_t + far_t);
        // The cosines are right to an ulp or two; what their difference loses is not the kernel's.
        let rounding = 8.0 * f64::EPSILON * n2 * n2 * (near_t * near_t + far_t * far_t);
        prop_assert!((after - before).abs() <= 1e-14 * before + rounding, "{before:e} {after:e}");
    }

    /// The same for an infinitesimal beam in any direction through a face in any position, by the rays
    /// themselves: n times the part of the direction along the face is one vector on both sides, and
    /// its area is n² cos θ dω.
    #[test]
    fn n_squared_t_of_a_thin_beam_stays_at_refraction(
        n1 in 1.0..2.5f64, n2 in 1.0..2.5f64, cos in 1e-3..1.0f64, phi in -3.0..3.0f64
    ) {
        let face = Interface::new(n1, n2).unwrap();
        let width = 1e-4 * cos;
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        let ray = DVec3::new(sin * phi.cos(), sin * phi.sin(), -cos);
        let (across, along) = (DVec3::new(-phi.sin(), phi.cos(), 0.0), DVec3::new(cos * phi.cos(), cos * phi.sin(), sin));
        // A kite about the ray: what is odd in its width goes.
        let corners = [width * across, width * along, -width * across, -width * along];
        let corners = corners.map(|aside| ray + aside);
        let refracted = corners.map(|ray| face.refract(ray, DVec3::Z).unwrap());
        if let ([Some(a), Some(b), Some(c), Some(d)], Some(middle)) =
            (refracted, face.refract(ray, DVec3::Z).unwrap())
        {
            prop_assume!(middle.z < -0.1);
            let sr = |[a, b, c, d]: [DVec3; 4]| {
                triangle(a, b, c).unwrap().sr() + triangle(c, d, a).unwrap().sr()
            };
            let before = n1 * n1 * cos * sr(corners);
            let after = n2 * n2 * -middle.z * sr([a, b, c, d]);
            // Next to the critical angle the kite is wide beside the cosine that is left.
            let allowed = 1e-5 + 10.0 * (width / (middle.z * middle.z)).powi(2);
            prop_assert!((after / before - 1.0).abs() < allowed, "{before:e} {after:e}");
        }
    }

    /// A mirror leaves solid angle and projected solid angle as they are, at grazing too.
    #[test]
    fn t_of_a_beam_stays_at_reflection(
        theta in 0.0..1.57f64, phi in -3.0..3.0f64, width in 1e-6..0.1f64, tilt in 0.0..3.0f64
    ) {
        let normal = unit(tilt, 0.7);
        let (t, b) = radiometry::direction::frame(normal);
        let at = |theta: f64, phi: f64| {
            let d = unit(theta, phi);
            d.x * t + d.y * b - d.z * normal
        };
        let corners = [at(theta, phi), at(theta * (1.0 - width), phi), at(theta, phi + width)];
        let mirrored = corners.map(|ray| reflect(ray, normal).unwrap());
        let sr = |v: [DVec3; 3]| triangle(v[0], v[1], v[2]).unwrap().sr();
        let (before, after) = (sr(corners), sr(mirrored));
        // Directions have ulps, which a beam so narrow feels.
        let slack = 1e-14 + 4e-15 / width / theta.sin().max(1e-9);
        prop_assert!((after - before).abs() <= slack * before.max(1e-30), "{before:e} {after:e}");
        prop_assume!(theta > 1e-3);
        let projected = |corners: [DVec3; 3], normal: DVec3| {
            let receiver = Receiver::new(DVec3::ZERO, normal).unwrap();
            polygon(&receiver, &Polygon::new(corners.to_vec()).unwrap()).unwrap().sr()
        };
        let (before, after) = (projected(corners, -normal), projected(mirrored, normal));
        prop_assert!((after - before).abs() <= slack * before + 1e-15 * width, "{before:e} {after:e}");
    }
}

/// A biconvex lens about the z axis, its front vertex at 0: a magnifying glass of 51 mm.
const RADIUS_M: f64 = 0.05;
const THICKNESS_M: f64 = 0.006;
const APERTURE_M: f64 = 0.010;
const INDEX: f64 = 1.5;

/// A ray, and the share of its radiance that the faces let through.
#[derive(Debug, Clone, Copy)]
struct Light {
    point_m: DVec3,
    direction: DVec3,
    share: f64,
}

impl Light {
    fn to_plane(self, z_m: f64) -> Self {
        let along = (z_m - self.point_m.z) / self.direction.z;
        Self { point_m: self.point_m + along * self.direction, ..self }
    }

    /// Through a spherical face, out of medium 1. None beside the aperture or at total reflection.
    fn through(self, center_m: DVec3, face: Interface) -> Option<Self> {
        let ray = Ray::new(self.point_m, self.direction).unwrap();
        let hit = self.point_m + ray.sphere(center_m, RADIUS_M).unwrap()? * self.direction;
        if hit.truncate().length() > APERTURE_M {
            return None;
        }
        let outward = hit - center_m;
        let normal = if outward.dot(self.direction) < 0.0 { outward } else { -outward };
        let direction = face.refract(self.direction, normal).unwrap()?;
        let passed = face.transmittance(Incidence::between(self.direction, normal).unwrap());
        Some(Self { point_m: hit, direction, share: self.share * passed })
    }

    fn into_glass(self) -> Option<Self> {
        self.through(DVec3::Z * RADIUS_M, Interface::new(1.0, INDEX).unwrap())
    }

    fn out_of_glass(self) -> Option<Self> {
        let face = Interface::new(INDEX, 1.0).unwrap();
        self.through(DVec3::Z * (THICKNESS_M - RADIUS_M), face)
    }

    fn through_lens(self) -> Option<Self> {
        self.into_glass()?.out_of_glass()
    }
}

/// The ray whose place is (x, y) at a height z and whose direction's parts are (p, q)/n.
fn ray_of([x, y, p, q]: [f64; 4], z_m: f64) -> Light {
    let direction = DVec3::new(p, q, (1.0 - p * p - q * q).sqrt());
    Light { point_m: DVec3::new(x, y, z_m), direction, share: 1.0 }
}

/// By central differences.
fn determinant(map: impl Fn([f64; 4]) -> [f64; 4], at: [f64; 4]) -> f64 {
    let columns: [[f64; 4]; 4] = std::array::from_fn(|k| {
        let step = 1e-5;
        let (mut low, mut high) = (at, at);
        low[k] -= step;
        high[k] += step;
        let (low, high) = (map(low), map(high));
        std::array::from_fn(|i| (high[i] - low[i]) / (2.0 * step))
    });
    DMat4::from_cols_array_2d(&columns).determinant()
}

proptest! {
    #![proptest_config(repeatable(300))]

    /// dT = dx dy dp dq/n² in optical cosines: the map of rays from before the lens into its glass, and
    /// to behind it, has determinant 1, however aberrated the lens.
    #[test]
    fn n_squared_t_stays_through_a_lens(
        x in -0.006..0.006f64, y in -0.006..0.006f64, p in -0.02..0.02f64, q in -0.02..0.02f64
    ) {
        let coordinates = |light: Light, index: f64| {
            let [p, q] = [index * light.direction.x, index * light.direction.y];
            [light.point_m.x, light.point_m.y, p, q]
        };
        let glass = |at: [f64; 4]| {
            coordinates(ray_of(at, -0.02).into_glass().unwrap().to_plane(0.003), INDEX)
        };
        let behind = |at: [f64; 4]| {
            coordinates(ray_of(at, -0.02).through_lens().unwrap().to_plane(0.06), 1.0)
        };
        let at = [x, y, p, q];
        prop_assert!((determinant(glass, at) - 1.0).abs() < 1e-6);
        prop_assert!((determinant(behind, at) - 1.0).abs() < 1e-6);
    }

    /// In the glass radiance is up to n² times what it was; basic radiance isn't more, and behind
    /// the lens neither is.
    #[test]
    fn radiance_rises_in_glass_and_nowhere_behind_it(
        x in -0.008..0.008f64, y in -0.008..0.008f64, p in -0.1..0.1f64, q in -0.1..0.1f64
    ) {
        let source = Radiance::from_w_per_m2_sr(100.0);
        let Some(inside) = ray_of([x, y, p, q], -0.01).into_glass() else { return Ok(()) };
        let in_glass = radiance_in_medium(inside.share * source, INDEX).unwrap();
        prop_assert!(in_glass > 2.0 * source && in_glass <= INDEX * INDEX * source);
        prop_assert!(basic_radiance(in_glass, INDEX).unwrap() <= source);
        if let Some(out) = inside.out_of_glass() {
            prop_assert!(out.share * source <= source && out.share > 0.8);
        }
    }
}

/// A uniform disk before the lens, a detector behind it where its image lies.
#[test]
fn a_magnifying_glass_concentrates_without_raising_radiance() {
    let (source_z_m, source_radius_m) = (-0.1, 0.005);
    let detector_z_m = THICKNESS_M + 0.102;
    // What the detector sees, traced backwards; the lens is symmetric, so mirror it in its middle.
    let radiance = |direction: DVec3| {
        let start = DVec3::Z * (THICKNESS_M - detector_z_m);
        let light = Light { point_m: start, direction, share: 1.0 }.through_lens()?;
        let at = light.to_plane(THICKNESS_M - source_z_m);
        Some(if at.point_m.truncate().length() <= source_radius_m { light.share } else { 0.0 })
    };
    // Wider than the lens is from there; what passes beside it is dark.
    let (mut irradiance, mut lens_sr, mut brightest) = (Sum::default(), Sum::default(), 0.0_f64);
    for node in cone(0.12, 400, 64).unwrap() {
        if let Some(radiance) = radiance(unit(node.theta_rad, node.phi_rad)) {
            irradiance.add(node.weight_sr * radiance);
            lens_sr.add(node.weight_sr);
            brightest = brightest.max(radiance);
        }
    }
    let (irradiance, lens_sr) = (irradiance.value(), lens_sr.value());
    let bare = disk_parallel(source_radius_m, detector_z_m - source_z_m, 0.0).unwrap().sr();
    assert!(brightest > 0.9 && brightest <= 1.0, "{brightest}");
    // Sixteen times brighter a spot, as many times as the lens is wider than the source: both faces
    // pass 0.96 each, and the detector sees nothing but the source through it.
    assert!(irradiance > 10.0 * bare, "{irradiance} {bare}");
    assert!((irradiance / lens_sr - 0.9216).abs() < 2e-3, "{irradiance} {lens_sr}");
    // The lens's rim is the bound: 10 mm, at 102 mm and a little.
    let rim = disk_parallel(APERTURE_M, 0.102, 0.0).unwrap().sr();
    assert!(irradiance < rim && (lens_sr / rim - 1.0).abs() < 0.05, "{lens_sr} {rim}");
}
