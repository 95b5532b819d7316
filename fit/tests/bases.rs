//! Every basis does what every basis has to: it holds constants, its exitance is that of its
//! values, it finds its own fields again; and what is held against rough fields is.

#[allow(dead_code, reason = "tests share them")]
mod scenes;

use fit::{
    Angular, Around, BasisSpec, Fine, Fit, Noise, Penalised, Penalty, Position, Ray, Region, Sample,
};
use radiometry::quadrature::cone;
use scenes::{Die, REGION, exact, spread_rays};
use std::f64::consts::{FRAC_PI_2, PI};

const ANGULAR: [Angular; 7] = [
    Angular::Zernike { degree: 5, cosine_columns: 0 },
    Angular::Zernike { degree: 5, cosine_columns: 3 },
    Angular::Hemispherical { degree: 3 },
    Angular::EvenHarmonics { degree: 5 },
    Angular::Splines {
        theta_spans: 5,
        phi_spans: 9,
        fine: Fine { from: 1, to: 3, halvings: 2, ..Fine::NONE },
    },
    Angular::Spherical { degree: 4 },
    // Its patch goes through φ = 0.
    Angular::Splines {
        theta_spans: 5,
        phi_spans: 9,
        fine: Fine { from: 3, to: 5, halvings: 1, around: Around { from: 7, to: 11, halvings: 2 } },
    },
];
const POSITION: [Position; 3] = [
    Position::Legendre { degree: 0 },
    Position::Legendre { degree: 2 },
    Position::Splines { spans: 1 },
];
const HEMISPHERE: Region = Region::surface((-0.02, 0.02), (0.005, 0.025), FRAC_PI_2);

fn specs() -> impl Iterator<Item = BasisSpec> {
    let position = |i: usize| POSITION[i % POSITION.len()];
    let of = move |(i, angular): (usize, Angular)| BasisSpec { angular, position: position(i) };
    ANGULAR
        .into_iter()
        .enumerate()
        .map(of)
        .chain([BasisSpec::zernike(4, 0), BasisSpec { angular: ANGULAR[1], position: POSITION[2] }])
}

/// A field of the basis with coefficients drawn at random.
fn drawn(basis: BasisSpec, seed: u64) -> Fit {
    let mut die = Die::new(seed);
    // Any fit has the parts of this basis; only the coefficients are ours.
    let rays = spread_rays(40, &HEMISPHERE, 1);
    let penalty = Penalty { power: 1.0, strength: 1.0 };
    let some = fit::fit(&exact(&rays, |_| 1.0), &HEMISPHERE, Penalised::new(basis, penalty), &[]);
    let mut parts = some.unwrap().parts().clone();
    for coefficient in &mut parts.coefficients {
        *coefficient = die.normal();
    }
    Fit::from_parts(parts).unwrap()
}

#[test]
fn constants_are_held_and_cost_nothing() {
    let rays = spread_rays(60, &REGION, 7);
    let penalty = Penalty { power: 2.0, strength: 1e6 };
    for basis in specs() {
        let fit =
            fit::fit(&exact(&rays, |_| 7.5), &REGION, Penalised::new(basis, penalty), &[]).unwrap();
        for ray in spread_rays(20, &HEMISPHERE, 8) {
            assert!((fit.value(&ray) - 7.5).abs() < 1e-8, "{basis:?}: {}", fit.value(&ray));
        }
        assert!((fit.exitance().value - 7.5 * PI).abs() < 1e-7, "{basis:?}");
        let names = fit.names();
        let distinct: std::collections::BTreeSet<&String> = names.iter().collect();
        assert_eq!((names.len(), distinct.len()), (fit.coefficients().len(), names.len()));
    }
}

#[test]
fn the_exitance_is_the_integral_of_the_values() {
    for (seed, basis) in specs().enumerate() {
        let fit = drawn(basis, seed as u64);
        for theta_max in [0.4, 1.1, FRAC_PI_2] {
            // Many in φ: those of the patch are 10° wide.
            let nodes = cone(theta_max, 40, 144).unwrap();
            let mean = |x: f64, y: f64| -> f64 {
                let at = |n: &radiometry::quadrature::ConeNode| Ray {
                    x_m: 0.02 * x,
                    y_m: 0.015 + 0.01 * y,
                    theta_rad: n.theta_rad,
                    phi_rad: n.phi_rad,
                };
                nodes.iter().map(|n| n.weight_sr * fit.value(&at(n))).sum()
            };
            // Gauss over the one span is exact for cubics of either axis; degree 2 needs less.
            let gauss = radiometry::quadrature::gauss_legendre(3);
            let mut integral = 0.0;
            if basis.position == (Position::Legendre { degree: 0 }) {
                integral = mean(0.1, -0.3);
            } else {
                let spans = [(-1.0, 1.0)];
                let nodes: Vec<(f64, f64)> = spans
                    .iter()
                    .flat_map(|(a, b)| {
                        let (middle, half) = ((a + b) / 2.0, (b - a) / 2.0);
                        gauss.iter().map(move |(t, w)| (middle + half * t, w * half / 2.0))
                    })
                    .collect();
                if theta_max > 0.5 && theta_max < 1.5 {
                    for (x, wx) in &nodes {
                        for (y, wy) in &nodes {
                            integral += wx * wy * mean(*x, *y);
                        }
                    }
                } else {
                    continue;
                }
            }
            let stated = fit.exitance_within(theta_max).unwrap().value;
            // The rule in θ isn't broken at the splines' knots.
            let tolerance = 3e-4;
            assert!(
                (stated - integral).abs() < tolerance,
                "{basis:?} {theta_max}: {stated} {integral}"
            );
        }
    }
}

#[test]
fn a_field_of_the_basis_is_found_again() {
    for (seed, basis) in specs().enumerate() {
        let truth = drawn(basis, 100 + seed as u64);
        let rays = spread_rays(3 * truth.coefficients().len() + 100, &HEMISPHERE, 3);
        let samples = exact(&rays, |ray| truth.value(ray));
        let fit = fit::fit(&samples, &HEMISPHERE, basis, &[]).unwrap();
        for ray in spread_rays(50, &HEMISPHERE, 4) {
            let off = fit.value(&ray) - truth.value(&ray);
            assert!(off.abs() < 1e-7, "{basis:?}: {off:e} at {ray:?}");
        }
    }
}

#[test]
fn splines_are_smooth_across_the_pole_and_round_the_seam() {
    let basis = BasisSpec {
        angular: Angular::Splines { theta_spans: 6, phi_spans: 16, fine: Fine::NONE },
        position: Position::Legendre { degree: 0 },
    };
    let fit = drawn(basis, 5);
    let at =
        |theta_rad: f64, phi_rad: f64| fit.value(&Ray { x_m: 0.0, y_m: 0.015, theta_rad, phi_rad });
    for phi in [0.0, 0.7, 2.0] {
        // One value at the pole, and one slope through it.
        assert!((at(0.0, phi) - at(0.0, 0.0)).abs() < 1e-12);
        let h = 1e-6;
        let before = (at(0.0, 0.0) - at(h, phi + PI)) / h;
        let after = (at(h, phi) - at(0.0, 0.0)) / h;
        assert!((before - after).abs() < 1e-3, "{before} {after}");
    }
    for theta in [0.2, 0.9, 1.5] {
        assert!((at(theta, PI - 1e-9) - at(theta, -PI + 1e-9)).abs() < 1e-6);
    }
}

#[test]
fn a_penalty_fills_gaps_with_uncertainty_and_few_readings_are_enough() {
    // Nothing beyond 60°, and of fewer readings than coefficients.
    let near = Region { theta_max_rad: 60f64.to_radians(), ..HEMISPHERE };
    let mut die = Die::new(9);
    let noise = Noise::Fixed { variance: 1e-4 };
    let samples: Vec<Sample> = spread_rays(80, &near, 5)
        .into_iter()
        .map(|ray| Sample {
            ray,
            value: 1.0 + libm::cos(ray.theta_rad) + 0.01 * die.normal(),
            noise,
        })
        .collect();
    for angular in [
        Angular::Zernike { degree: 14, cosine_columns: 2 },
        Angular::Hemispherical { degree: 10 },
        Angular::Spherical { degree: 10 },
        Angular::Splines { theta_spans: 10, phi_spans: 12, fine: Fine::NONE },
    ] {
        let basis = BasisSpec { angular, position: Position::Legendre { degree: 0 } };
        assert!(basis.len() > samples.len());
        let penalty = Penalty { power: 2.0, strength: 0.1 };
        let fit = fit::fit(&samples, &HEMISPHERE, Penalised::new(basis, penalty), &[]).unwrap();
        let at = |theta_deg: f64| {
            let ray = Ray { x_m: 0.0, y_m: 0.015, theta_rad: theta_deg.to_radians(), phi_rad: 1.0 };
            let (found, truth) = (fit.radiance(&ray), 1.0 + libm::cos(ray.theta_rad));
            assert!(
                (found.value - truth).abs() < 4.0 * found.u,
                "{angular:?} {theta_deg} {found:?}"
            );
            found.u
        };
        let u = [30.0, 70.0, 80.0, 90.0].map(at);
        assert!(u.is_sorted() && u[3] > 4.0 * u[0], "{angular:?}: {u:?}");
        let determined = fit.determined();
        assert!(determined > 3.0 && determined < 80.0, "{determined}");
        assert!((80.0 - determined - fit.dof() as f64).abs() < 1.0);
    }
}

#[test]
fn a_vanishing_penalty_changes_nothing() {
    let basis = BasisSpec::zernike(4, 1);
    let rays = spread_rays(300, &REGION, 6);
    let mut die = Die::new(3);
    let mut samples = exact(&rays, |ray| 2.0 + libm::sin(ray.theta_rad + ray.phi_rad));
    for sample in &mut samples {
        sample.value += 0.01 * die.normal();
    }
    let penalty = Penalty { power: 2.0, strength: 1e-12 };
    let plain = fit::fit(&samples, &REGION, basis, &[]).unwrap();
    let held = fit::fit(&samples, &REGION, Penalised::new(basis, penalty), &[]).unwrap();
    for (a, b) in plain.coefficients().iter().zip(held.coefficients()) {
        assert!((a - b).abs() < 1e-9);
    }
    assert!((plain.exitance().u / held.exitance().u - 1.0).abs() < 1e-9);
    assert!((held.determined() - plain.coefficients().len() as f64).abs() < 1e-6);
    assert_eq!(plain.dof(), held.dof());
}

#[test]
fn penalties_that_make_no_sense_are_refused() {
    let samples = exact(&spread_rays(60, &REGION, 2), |_| 1.0);
    let refused = |angular: Angular, power: f64, strength: f64| {
        let basis = BasisSpec { angular, position: Position::Legendre { degree: 0 } };
        let penalty = Penalty { power, strength };
        fit::fit(&samples, &REGION, Penalised::new(basis, penalty), &[]).unwrap_err().to_string()
    };
    for (power, strength) in [(2.0, -1.0), (2.0, f64::NAN), (-1.0, 1.0), (99.0, 1.0)] {
        let said = refused(ANGULAR[0], power, strength);
        assert!(said.contains("penalty of power"), "{said}");
    }
    assert!(refused(ANGULAR[4], 1.5, 1.0).contains("of splines 1 or 2"));
}
