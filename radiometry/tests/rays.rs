//! What must hold of rays: at interfaces, against surfaces, and in every chart.

use std::f64::consts::PI;

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use radiometry::basis::{HemisphericalHarmonics, SphericalHarmonics};
use radiometry::chart::{Environment, Line, Perpendicular, Surface, TwoPlane};
use radiometry::direction::unit;
use radiometry::interface::{Incidence, Interface, Window};
use radiometry::quadrature::gauss_legendre;
use radiometry::ray::Ray;

fn repeatable(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(20_261_122),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn direction() -> impl Strategy<Value = DVec3> {
    (0.0..PI, -PI..PI).prop_map(|(theta, phi)| unit(theta, phi))
}

fn place(size: f64) -> impl Strategy<Value = DVec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

proptest! {
    #![proptest_config(repeatable(1000))]

    #[test]
    fn what_is_not_reflected_goes_on(n1 in 0.5..3.0f64, n2 in 0.5..3.0f64, cos in 0.0..=1.0f64) {
        let face = Interface::new(n1, n2).unwrap();
        let ray = Incidence::from_cos(cos).unwrap();
        prop_assert!((face.reflectance_s(ray) + face.transmittance_s(ray) - 1.0).abs() < 1e-14);
        prop_assert!((face.reflectance_p(ray) + face.transmittance_p(ray) - 1.0).abs() < 1e-14);
        for share in [face.reflectance_s(ray), face.reflectance_p(ray), face.transmittance(ray)] {
            prop_assert!((0.0..=1.0).contains(&share));
        }
    }

    #[test]
    fn light_goes_back_the_way_it_came(n1 in 0.5..3.0f64, n2 in 0.5..3.0f64, cos in 0.01..=1.0f64) {
        let face = Interface::new(n1, n2).unwrap();
        let there = Incidence::from_cos(cos).unwrap();
        if let Some(cos_t) = face.refracted_cos(there).filter(|cos_t| *cos_t > 0.01) {
            let back = Incidence::from_cos(cos_t).unwrap();
            let reversed = face.reversed();
            prop_assert!((reversed.refracted_cos(back).unwrap() - cos).abs() < 1e-12);
            prop_assert!((reversed.transmittance_s(back) - face.transmittance_s(there)).abs() < 1e-11);
            prop_assert!((reversed.transmittance_p(back) - face.transmittance_p(there)).abs() < 1e-11);
        }
    }

    /// n² cos θ sin θ dθ is the same on both sides (dφ is), so L/n² is too.
    #[test]
    fn refraction_conserves_throughput_times_index_squared(
        n1 in 1.0..2.5f64, n2 in 1.0..2.5f64, theta in 0.05..1.2f64
    ) {
        let face = Interface::new(n1, n2).unwrap();
        let step = 1e-5;
        let refracted = |theta: f64| face.refracted_angle(Incidence::from_angle(theta).unwrap());
        if let (Some(low), Some(middle), Some(high)) =
            (refracted(theta - step), refracted(theta), refracted(theta + step))
        {
            prop_assume!(high < 1.4);
            let slope = (high - low) / (2.0 * step);
            let before = n1 * n1 * theta.cos() * theta.sin();
            let after = n2 * n2 * middle.cos() * middle.sin() * slope;
            prop_assert!((after / before - 1.0).abs() < 1e-6, "{before} {after}");
        }
    }

    /// The magnifying glass: with source and detector in one medium, radiance never rises.
    #[test]
    fn no_window_brightens(
        n in 0.5..3.0f64, cos in 0.0..=1.0f64, thickness in 0.0..0.1f64, absorption in 0.0..100.0f64
    ) {
        let face = Interface::new(1.0, n).unwrap();
        let inward_and_out = face.radiance_ratio() * face.reversed().radiance_ratio();
        prop_assert!((inward_and_out - 1.0).abs() < 1e-15);
        let ray = Incidence::from_cos(cos).unwrap();
        let pane = Window::new(face, thickness, absorption).unwrap();
        let (through, back) = (pane.transmittance(ray), pane.reflectance(ray));
        prop_assert!((0.0..=1.0).contains(&through) && (0.0..=1.0).contains(&back));
        prop_assert!(through + back <= 1.0 + 1e-14);
        let clear = Window::new(face, thickness, 0.0).unwrap();
        prop_assert!((clear.transmittance(ray) + clear.reflectance(ray) - 1.0).abs() < 1e-13);
        prop_assert!(through <= clear.transmittance(ray) + 1e-15);
    }

    #[test]
    fn refracted_directions_obey_snell(
        n1 in 0.5..3.0f64, n2 in 0.5..3.0f64, ray in direction(), normal in direction()
    ) {
        let face = Interface::new(n1, n2).unwrap();
        let normal = if normal.dot(ray) > 0.0 { -normal } else { normal };
        if let Some(refracted) = face.refract(3.0 * ray, 0.1 * normal).unwrap() {
            prop_assert!((refracted.length() - 1.0).abs() < 1e-15);
            // n sin θ across the normal is one vector on both sides.
            let defect = n1 * ray.cross(normal) - n2 * refracted.cross(normal);
            prop_assert!(defect.length() < 1e-14, "{defect}");
            prop_assert!(refracted.dot(normal) <= 1e-15);
        }
    }

    #[test]
    fn a_hit_lies_on_the_sphere(origin in place(10.0), towards in direction(), radius in 0.1..5.0f64) {
        let ray = Ray::new(origin, towards).unwrap();
        if let Some(distance) = ray.sphere(DVec3::ZERO, radius).unwrap() {
            prop_assert!(((origin + distance * towards).length() - radius).abs() < 1e-12);
        } else {
            let beside = origin.cross(towards).length();
            prop_assert!(origin.dot(towards) > 0.0 || beside >= radius - 1e-12);
        }
    }

    #[test]
    fn a_hit_lies_on_the_cylinder(
        origin in place(5.0), towards in direction(), top in place(3.0), radius in 0.1..4.0f64
    ) {
        let ray = Ray::new(origin, towards).unwrap();
        if let Some(distance) = ray.cylinder(DVec3::ZERO, top, radius).unwrap() {
            let hit = origin + distance * towards;
            let height = hit.dot(top) / top.length_squared();
            let beside = (hit - height * top).length();
            prop_assert!((beside - radius).abs() < 1e-9, "{beside} {radius}");
            prop_assert!((-1e-9..=1.0 + 1e-9).contains(&height));
        }
    }

    /// Both triangles of a square together are hit exactly where the square is, and where a disk
    /// around it is not missed.
    #[test]
    fn a_square_is_its_two_triangles(origin in place(2.0), towards in direction()) {
        let ray = Ray::new(origin, towards).unwrap();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec3::new(x, y, 0.25));
        let [a, b, c, d] = corners;
        let hits = ray.mesh_hits(&[[a, b, c], [c, d, a]]).unwrap();
        let first = ray.triangle([a, b, c]).unwrap().or(ray.triangle([c, d, a]).unwrap());
        prop_assert_eq!(hits, usize::from(first.is_some()));
        let center = DVec3::new(0.0, 0.0, 0.25);
        let around = ray.disk(center, DVec3::Z, 2f64.sqrt()).unwrap();
        let within = ray.disk(center, -DVec3::Z, 1.0).unwrap();
        prop_assert!(first.is_none() || around.is_some());
        prop_assert!(within.is_none() || first.is_some());
    }

    /// Through a vertex or along an edge of a fan of triangles: one hit, never none, never two.
    #[test]
    fn a_closed_fan_leaks_nowhere(origin in place(1.0), share in 0.0..1.0f64, spoke in 0usize..7) {
        let origin = DVec3::new(origin.x, origin.y, -1.0);
        let rim = |i: usize| {
            let phi = i as f64 * 2.0 * PI / 7.0;
            DVec3::new(phi.cos(), phi.sin(), 1.0 + 0.1 * phi.sin())
        };
        let hub = DVec3::new(0.1, 0.05, 1.2);
        let fan: Vec<_> = (0..7).map(|i| [hub, rim(i), rim((i + 1) % 7)]).collect();
        let target = hub + share * (rim(spoke) - hub);
        prop_assume!(share < 0.999);
        let ray = Ray::new(origin, target - origin).unwrap();
        prop_assert_eq!(ray.mesh_hits(&fan).unwrap(), 1);
    }

    /// One beam has one throughput: |det ∂(chart)/∂(surface chart)| times the chart's density is
    /// the surface chart's density.
    #[test]
    fn one_beam_has_one_throughput_in_every_chart(
        x_m in -2.0..2.0f64, y_m in -2.0..2.0f64, theta_rad in 0.1..1.3f64, phi_rad in -3.0..3.0f64
    ) {
        let at = [x_m, y_m, theta_rad, phi_rad];
        let line = |p: [f64; 4]| {
            Surface { x_m: p[0], y_m: p[1], theta_rad: p[2], phi_rad: p[3] }.line().unwrap()
        };
        let expected = Surface::of(&line(at)).unwrap().density();
        let across = |p: [f64; 4]| {
            let ray = Perpendicular::of(&line(p));
            [ray.theta_rad, ray.phi_rad, ray.x_m, ray.y_m]
        };
        let density = Perpendicular::of(&line(at)).density();
        let found = jacobian(across, at).abs() * density;
        prop_assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        let planes = |p: [f64; 4]| {
            let ray = TwoPlane::of(&line(p), 0.7).unwrap();
            [ray.u_m, ray.v_m, ray.s_m, ray.t_m]
        };
        let found = jacobian(planes, at).abs() * TwoPlane::of(&line(at), 0.7).unwrap().density();
        prop_assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        // At one place, the environment's projected solid angle is the rest of it.
        let towards = Environment::of(line(at).direction()).unwrap();
        prop_assert!((towards.density() - expected).abs() < 1e-15);
    }

    #[test]
    fn every_chart_maps_both_ways(at in place(3.0), towards in direction()) {
        let line = Line::new(at, towards).unwrap();
        let same = |other: Line| {
            let apart = other.point_m() - at;
            let beside = (apart - apart.dot(towards) * towards).length();
            (other.direction() - towards).length() < 1e-12 && beside < 1e-9
        };
        prop_assert!(same(Perpendicular::of(&line).line().unwrap()));
        prop_assert_eq!(Surface::of(&line).is_some(), towards.z > 0.0);
        if towards.z > 1e-3 {
            prop_assert!(same(Surface::of(&line).unwrap().line().unwrap()));
            prop_assert!(same(TwoPlane::of(&line, 0.7).unwrap().line().unwrap()));
        }
    }

    /// Whatever doubles come in: an answer or an error, never NaN, never a panic.
    #[test]
    fn no_doubles_make_nan(bits in proptest::array::uniform12(any::<u64>())) {
        let [a, b, c, d] = [0, 3, 6, 9].map(|i| {
            DVec3::from_array([bits[i], bits[i + 1], bits[i + 2]].map(f64::from_bits))
        });
        if let Ok(ray) = Ray::new(a, b) {
            let found = [
                ray.sphere(c, d.x.abs()), ray.plane(c, d), ray.disk(c, d, d.y.abs()),
                ray.triangle([a, c, d]), ray.triangle([b, c, d]), ray.cylinder(c, d, b.x.abs()),
            ];
            for distance in found.into_iter().flatten().flatten() {
                prop_assert!(distance.is_finite() && distance >= 0.0);
            }
        }
        if let Ok(face) = Interface::new(a.x.abs(), a.y.abs()) {
            if let Ok(Some(refracted)) = face.refract(c, d) {
                prop_assert!(refracted.is_finite());
            }
            for cos in [0.0, 1e-300, 0.5, 1.0] {
                let ray = Incidence::from_cos(cos).unwrap();
                prop_assert!((0.0..=1.0).contains(&face.reflectance(ray)));
                prop_assert!((0.0..=1.0).contains(&face.transmittance(ray)));
            }
        }
    }
}

/// By central differences.
fn jacobian(map: impl Fn([f64; 4]) -> [f64; 4], at: [f64; 4]) -> f64 {
    let step = 1e-5;
    let columns: Vec<[f64; 4]> = (0..4)
        .map(|k| {
            let (mut low, mut high) = (at, at);
            low[k] -= step;
            high[k] += step;
            let (low, high) = (map(low), map(high));
            std::array::from_fn(|i| (high[i] - low[i]) / (2.0 * step))
        })
        .collect();
    glam::DMat4::from_cols_array_2d(&[columns[0], columns[1], columns[2], columns[3]]).determinant()
}

#[test]
fn at_equal_indices_there_is_no_interface() {
    let open = Interface::new(1.5, 1.5).unwrap();
    for cos in [0.0, 1e-300, 1e-9, 0.3, 1.0] {
        let ray = Incidence::from_cos(cos).unwrap();
        assert!(open.reflectance(ray) <= 0.0);
        assert!(open.transmittance(ray) >= 1.0);
        assert!((open.refracted_cos(ray).unwrap() - cos).abs() <= 1e-16 * cos);
    }
}

#[test]
fn a_direction_away_from_the_interface_is_refused() {
    let glass = Interface::new(1.0, 1.5).unwrap();
    assert!(glass.refract(DVec3::Z, DVec3::Z).is_err());
    assert!(glass.refract(DVec3::ZERO, DVec3::Z).is_err());
    assert!(glass.refract(-DVec3::Z, DVec3::ZERO).is_err());
    assert!(Interface::new(0.0, 1.0).is_err() && Interface::new(1.0, f64::NAN).is_err());
    assert!(Incidence::from_cos(1.1).is_err() && Incidence::from_angle(-0.1).is_err());
}

#[test]
fn a_ray_in_a_triangles_plane_meets_its_border() {
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let along = |x: f64, y: f64| Ray::new(DVec3::new(x, y, 0.0), DVec3::X).unwrap();
    assert_eq!(along(-1.0, 0.25).triangle(triangle).unwrap(), Some(1.0));
    assert_eq!(along(0.25, 0.25).triangle(triangle).unwrap(), Some(0.0));
    assert_eq!(along(2.0, 0.25).triangle(triangle).unwrap(), None);
    // Along an edge, and just past the other corner.
    assert_eq!(along(-1.0, 0.0).triangle(triangle).unwrap(), Some(1.0));
    assert_eq!(along(-1.0, 1.0).triangle(triangle).unwrap(), Some(1.0));
    assert_eq!(along(-1.0, 1.0 + f64::EPSILON).triangle(triangle).unwrap(), None);
    assert!(along(0.0, 0.0).triangle([DVec3::ZERO, DVec3::X, 3.0 * DVec3::X]).is_err());
}

#[test]
fn a_ray_along_the_axis_meets_a_cylinder_only_within_its_surface() {
    let up = |x: f64, z: f64| Ray::new(DVec3::new(x, 0.0, z), DVec3::Z).unwrap();
    let top = 2.0 * DVec3::Z;
    assert_eq!(up(0.5, -1.0).cylinder(DVec3::ZERO, top, 1.0).unwrap(), None);
    assert_eq!(up(1.0, -1.0).cylinder(DVec3::ZERO, top, 1.0).unwrap(), Some(1.0));
    assert_eq!(up(1.0, 1.0).cylinder(DVec3::ZERO, top, 1.0).unwrap(), Some(0.0));
    assert_eq!(up(1.0, 3.0).cylinder(DVec3::ZERO, top, 1.0).unwrap(), None);
    assert!(up(1.0, 3.0).cylinder(top, top, 1.0).is_err());
}

#[test]
fn harmonics_are_orthonormal() {
    const DEGREE: usize = 8;
    let (whole, half) =
        (SphericalHarmonics::new(DEGREE).unwrap(), HemisphericalHarmonics::new(DEGREE).unwrap());
    let count = whole.len();
    let mut grams = [vec![0.0; count * count], vec![0.0; count * count]];
    let mut values = vec![0.0; count];
    let spokes = 2 * DEGREE + 2;
    for (node, weight) in gauss_legendre(2 * DEGREE + 2) {
        for spoke in 0..spokes {
            let phi = 2.0 * PI * spoke as f64 / spokes as f64;
            for (gram, z, is_half) in
                [(0, node, false), (1, f64::midpoint(1.0, node), true)].map(|(g, z, h)| (g, z, h))
            {
                let sin = ((1.0 - z) * (1.0 + z)).sqrt();
                let at = DVec3::new(sin * phi.cos(), sin * phi.sin(), z);
                if is_half {
                    half.evaluate(at, &mut values);
                } else {
                    whole.evaluate(at, &mut values);
                }
                let solid_angle =
                    weight * 2.0 * PI / spokes as f64 * if is_half { 0.5 } else { 1.0 };
                for i in 0..count {
                    for j in 0..count {
                        grams[gram][i * count + j] += solid_angle * values[i] * values[j];
                    }
                }
            }
        }
    }
    for gram in grams {
        for (index, found) in gram.iter().enumerate() {
            let expected = f64::from(u8::from(index / count == index % count));
            assert!((found - expected).abs() < 1e-13, "{index}: {found}");
        }
    }
}
