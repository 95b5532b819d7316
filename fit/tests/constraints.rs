//! Fields held at zero, and fields with a symmetry: that they are right where the source is like that,
//! and that a source that isn't is seen.

#[allow(dead_code)]
mod scenes;

use fit::{
    BasisSpec, Common, Noise, Penalised, Penalty, Ray, Region, Sample, Shift, Symmetry,
    SymmetryError,
};
use scenes::{Die, REGION, raster_rays, scaled, spread_rays};

const NOISE: Noise = Noise::Fixed { variance: 0.04 };

fn noisy(rays: &[Ray], seed: u64, field: impl Fn(&Ray) -> f64) -> Vec<Sample> {
    let mut die = Die::new(seed);
    let sample =
        |ray: &Ray| Sample { ray: *ray, value: field(ray) + 0.2 * die.normal(), noise: NOISE };
    rays.iter().map(sample).collect()
}

fn lobe(ray: &Ray) -> f64 {
    20.0 * libm::pow(libm::cos(ray.theta_rad), 6.0)
}

#[test]
fn a_field_that_dips_below_zero_is_held_there_and_little_else_changes() {
    let samples = noisy(&raster_rays(&REGION, 12, 16, 2), 1, lobe);
    let plain = fit::fit(&samples, &REGION, BasisSpec::zernike(6, 1), &[]).unwrap();
    let (held, bound) = plain.nonnegative().unwrap();
    assert!(bound.least < -0.05 && !bound.held.is_empty());
    // Nowhere below zero, between the rays of the grid neither but for a little.
    let probes = spread_rays(4000, &REGION, 9);
    let least = |fit: &fit::Fit| probes.iter().map(|r| fit.value(r)).fold(f64::INFINITY, f64::min);
    assert!(least(&plain) < -0.05, "{}", least(&plain));
    assert!(least(&held) > 0.1 * bound.least, "{} {}", least(&held), bound.least);
    assert!(bound.held.iter().all(|ray| held.value(ray).abs() < 1e-6));
    let rms = |fit: &fit::Fit| {
        probes.iter().map(|r| (fit.value(r) - lobe(r)).powi(2)).sum::<f64>().sqrt()
    };
    assert!(rms(&held) < rms(&plain), "{} {}", rms(&held), rms(&plain));
    assert!((held.exitance().value - plain.exitance().value - bound.exitance).abs() < 1e-12);
    assert!(bound.exitance.abs() < 3.0 * plain.exitance().u);
    assert!((held.exitance().u - plain.exitance().u).abs() < 1e-15);
    // The nearest one: any other field without darkness lies farther off in χ².
    let chi2 = |fit: &fit::Fit| {
        samples.iter().map(|s| (s.value - fit.value(&s.ray)).powi(2) / 0.04).sum::<f64>()
    };
    assert!(chi2(&held) < chi2(&plain) + 200.0 && chi2(&held) > chi2(&plain));
}

#[test]
fn where_nothing_is_below_zero_nothing_changes() {
    let samples = noisy(&raster_rays(&REGION, 9, 12, 2), 2, |ray| 5.0 + lobe(ray));
    let plain = fit::fit(&samples, &REGION, BasisSpec::zernike(4, 1), &[]).unwrap();
    let (held, bound) = plain.nonnegative().unwrap();
    assert!(bound.held.is_empty() && bound.least > 0.0 && bound.exitance.abs() < 1e-15);
    assert_eq!(held.coefficients(), plain.coefficients());
}

/// A lobe that leans by so many degrees towards φ = 30°.
fn leaning(ray: &Ray, lean_deg: f64) -> f64 {
    let axis = radiometry_unit(lean_deg.to_radians(), 30_f64.to_radians());
    let d = radiometry_unit(ray.theta_rad, ray.phi_rad);
    let cos = axis.iter().zip(d).map(|(a, b)| a * b).sum::<f64>().max(0.0);
    20.0 * cos * cos
}

fn radiometry_unit(theta: f64, phi: f64) -> [f64; 3] {
    let ((st, ct), (sp, cp)) = (libm::sincos(theta), libm::sincos(phi));
    [st * cp, st * sp, ct]
}

const PLANE: Symmetry = Symmetry::Plane { phi_rad: 30.0 * std::f64::consts::PI / 180.0 };
const QUADRANT: Symmetry = Symmetry::Quadrant { phi_rad: 0.0 };

const SEEDS: u64 = 40;

#[test]
fn a_symmetry_that_the_source_has_passes_and_lowers_u() {
    let rays = raster_rays(&REGION, 9, 16, 2);
    let at = Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.8, phi_rad: 1.0 };
    // p of a source with the symmetry is uniform: its mean over seeds is a half.
    let (mut sum, mut refused, mut squares) = (0.0, 0, 0.0);
    for seed in 0..SEEDS {
        let samples = noisy(&rays, seed, lobe);
        let plain = fit::fit(&samples, &REGION, BasisSpec::zernike(6, 1), &[]).unwrap();
        match plain.symmetric(Symmetry::Rotational) {
            Ok((round, test)) => {
                sum += test.p;
                // Round are Z(n,0), 4 of them, and the products of x and y with the pairs Z(n,±1), 3 of
                // them, that turn along or turn round: 4 + 2 · 3.
                assert_eq!(test.forbidden, 84 - 10);
                let (a, b) = (round.radiance(&at), plain.radiance(&at));
                assert!(a.u < 0.6 * b.u);
                squares += ((a.value - lobe(&at)) / a.u).powi(2);
                assert_eq!(round.dof(), plain.dof() + test.forbidden);
                // Along the middle a turn leaves the place as it is.
                let middle = Ray { x_m: 0.0, ..at };
                let turned = Ray { phi_rad: 2.7, ..middle };
                assert!((round.value(&turned) - round.value(&middle)).abs() < 1e-8);
            }
            Err(SymmetryError::Contradicted(_)) => refused += 1,
            Err(error) => panic!("{error}"),
        }
    }
    let n = SEEDS as f64;
    assert!((0.35..0.65).contains(&(sum / n)) && refused <= 3);
    assert!((0.75..1.3).contains(&(squares / n).sqrt()));
}

#[test]
fn a_symmetry_that_the_source_lacks_is_refused_with_its_probability() {
    let rays = raster_rays(&REGION, 9, 12, 2);
    let samples = noisy(&rays, 3, |ray| leaning(ray, 10.0));
    let fit = fit::fit(&samples, &REGION, BasisSpec::zernike(4, 1), &[]).unwrap();
    for symmetry in [Symmetry::Rotational, QUADRANT, Symmetry::Plane { phi_rad: 1.5 }] {
        let refused = fit.symmetric(symmetry).unwrap_err();
        let SymmetryError::Contradicted(test) = &refused else { panic!("{refused}") };
        assert!(test.p < 1e-6 && test.chi2 > 3.0 * test.forbidden as f64);
        assert!(refused.to_string().contains("contradict"));
    }
    // It is the same on both sides of the plane that it leans in.
    let (mirrored, test) = fit.symmetric(PLANE).unwrap();
    assert!(test.p > 0.01, "{test:?}");
    let ray =
        |phi_deg: f64| Ray { x_m: 0.0, y_m: 0.015, theta_rad: 0.9, phi_rad: phi_deg.to_radians() };
    assert!((mirrored.value(&ray(70.0)) - mirrored.value(&ray(-10.0))).abs() < 1e-9);
    // A gradient in x lacks the mirror in y's plane, and has that in x's.
    let gradient = |ray: &Ray| 10.0 + 2.0 * scaled(ray).0;
    let fit = fit::fit(&noisy(&rays, 4, gradient), &REGION, BasisSpec::zernike(2, 1), &[]).unwrap();
    assert!(fit.symmetric(Symmetry::Plane { phi_rad: 0.0 }).is_ok());
    assert!(fit.symmetric(Symmetry::Plane { phi_rad: 0.5 * std::f64::consts::PI }).is_err());
}

#[test]
fn an_axis_that_may_be_off_excuses_a_lean() {
    let rays = raster_rays(&REGION, 9, 12, 2);
    let samples = noisy(&rays, 5, |ray| leaning(ray, 1.0));
    let basis = BasisSpec::zernike(4, 0);
    let plain = fit::fit(&samples, &REGION, basis, &[]).unwrap();
    assert!(plain.symmetric(Symmetry::Rotational).is_err());
    let zero = Shift::Ray(Box::new(|_, ray| {
        // The normal is 1° off, towards 30°.
        let tilt = 1_f64.to_radians();
        let (s, c) = libm::sincos(30_f64.to_radians());
        let [x, y, z] = radiometry_unit(ray.theta_rad, ray.phi_rad);
        let (x, y, z) = (x + tilt * c * z, y + tilt * s * z, z - tilt * (c * x + s * y));
        Ray { theta_rad: libm::atan2(libm::hypot(x, y), z), phi_rad: libm::atan2(y, x), ..*ray }
    }));
    let zero = [Common { name: "zero".into(), u: 0.017, shift: zero }];
    let carried = fit::fit(&samples, &REGION, basis, &zero).unwrap();
    let (_, test) = carried.symmetric(Symmetry::Rotational).unwrap();
    assert!(test.p > 0.01, "{test:?}");
}

#[test]
fn every_kind_of_basis_is_symmetric_or_says_that_it_cannot_be() {
    let region = Region { x_m: (0.0, 0.0), y_m: (0.0, 0.0), ..REGION };
    let rays: Vec<Ray> = raster_rays(&region, 14, 24, 1);
    let samples = noisy(&rays, 6, lobe);
    let held = Penalty { power: 2.0, strength: 1e-4 };
    let of = |angular| {
        let basis = BasisSpec { angular, position: fit::Position::Legendre { degree: 0 } };
        fit::fit(&samples, &region, Penalised::new(basis, held), &[]).unwrap()
    };
    for angular in [
        fit::Angular::Zernike { degree: 8, cosine_columns: 2 },
        fit::Angular::Hemispherical { degree: 6 },
        fit::Angular::EvenHarmonics { degree: 8 },
        fit::Angular::Spherical { degree: 6 },
    ] {
        let (round, test) = of(angular).symmetric(Symmetry::Rotational).unwrap();
        assert!(test.p > 0.01, "{test:?}");
        let at = |phi_rad| round.value(&Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.7, phi_rad });
        assert!((at(0.1) - at(2.2)).abs() < 1e-7);
    }
    let splines = of(fit::Angular::Splines { theta_spans: 6, phi_spans: 8, fine: fit::Fine::NONE });
    let refused = splines.symmetric(Symmetry::Rotational).unwrap_err();
    assert!(matches!(refused, SymmetryError::Basis { .. }), "{refused}");
    // Mirrored at φ = 0, knots fall on knots.
    splines.symmetric(Symmetry::Plane { phi_rad: 0.0 }).unwrap();
}
