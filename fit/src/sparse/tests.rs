//! The sparse path beside the dense one, on fits that both can do.

use super::fit as fit_readings;
use crate::Readings;
use crate::{
    Angular, BasisSpec, Common, Fine, Fit, FitError, Noise, Penalised, Penalty, Position, Ray,
    Region, Sample, Shift, Symmetry, SymmetryError,
};
use std::f64::consts::{FRAC_PI_2, TAU};

const REGION: Region = Region::surface((-0.01, 0.01), (-0.01, 0.01), FRAC_PI_2);

fn basis(position: Position) -> BasisSpec {
    let fine = Fine { from: 0, to: 2, halvings: 1, ..Fine::NONE };
    BasisSpec { angular: Angular::Splines { theta_spans: 6, phi_spans: 9, fine }, position }
}

/// Scattered, dense enough that every function is met.
fn samples(count: u32, noise: Noise) -> Vec<Sample> {
    let fraction = |i: u32, by: f64| (f64::from(i) * by).fract();
    let one = |i: u32| {
        let ray = Ray {
            x_m: 0.02 * fraction(i, 0.618_033_989) - 0.01,
            y_m: 0.02 * fraction(i, 1.732_050_808) - 0.01,
            theta_rad: FRAC_PI_2 * fraction(i, 2.236_067_977),
            phi_rad: TAU * fraction(i, 2.645_751_311),
        };
        let field = 3.0 + libm::cos(ray.theta_rad) + 20.0 * ray.x_m * libm::cos(ray.phi_rad);
        Sample { ray, value: field + 0.1 * libm::sin(f64::from(i) * 17.3), noise }
    };
    (0..count).map(one).collect()
}

fn commons() -> [Common; 3] {
    [
        Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale },
        Common { name: "dark".into(), u: 0.03, shift: Shift::Offset },
        Common {
            name: "linearity".into(),
            u: 1.0,
            shift: Shift::Value(Box::new(|_, level| 1e-3 * level * level)),
        },
    ]
}

fn fit(
    samples: &[Sample],
    model: impl Into<Penalised>,
    common: &[Common],
) -> Result<Fit, FitError> {
    let readings = Readings { common, ..Readings::of(samples) };
    fit_readings(&readings, &REGION, model.into(), None)
}

#[track_caller]
fn agree(dense: &Fit, sparse: &Fit) {
    // What rounding does to either.
    let tolerance = 1e-13 * dense.condition();
    // u comes from products of rows, which square the condition.
    let of_u = (1e-14 * dense.condition().powi(2)).max(1e-9);
    assert!(sparse.is_sparse() && !dense.is_sparse());
    let largest = dense.coefficients().iter().fold(0.0_f64, |most, c| most.max(c.abs()));
    for (a, b) in dense.coefficients().iter().zip(sparse.coefficients()) {
        assert!((a - b).abs() < tolerance * largest, "{a} {b}");
    }
    for theta_deg in [0.0, 12.0, 55.0, 89.0] {
        let ray =
            Ray { x_m: 0.004, y_m: -0.007, theta_rad: f64::to_radians(theta_deg), phi_rad: 2.0 };
        let (a, b) = (dense.radiance(&ray), sparse.radiance(&ray));
        assert!((b.u / a.u - 1.0).abs() < of_u, "{a:?} {b:?}");
        assert!((b.u_independent / a.u_independent - 1.0).abs() < of_u, "{a:?} {b:?}");
    }
    let (a, b) = (dense.exitance(), sparse.exitance());
    assert!((a.value / b.value - 1.0).abs() < tolerance && (a.u / b.u - 1.0).abs() < of_u);
    assert!((dense.chi2() / sparse.chi2() - 1.0).abs() < 1e-6);
    // Power iteration is good to a few per cent.
    assert!((sparse.condition() / dense.condition() - 1.0).abs() < 0.1, "{}", sparse.condition());
}

#[test]
fn a_plain_fit_equals_the_dense_one_to_rounding() {
    let noise = Noise::Modelled { floor: 0.004, per_radiance: 0.002 };
    let samples = samples(1500, noise);
    for position in [Position::Legendre { degree: 1 }, Position::Legendre { degree: 2 }] {
        let (model, common) = (basis(position), commons());
        let dense = crate::fit(&samples, &REGION, model, &common).unwrap();
        let sparse = fit(&samples, model, &common).unwrap();
        agree(&dense, &sparse);
        assert!((dense.determined() - sparse.determined()).abs() < 1e-9);
        let (a, b) = (dense.covariance(), sparse.covariance());
        // Products of rows square the condition, 3e5 of the second.
        let rounding = (1e-15 * dense.condition().powi(2)).max(1e-9);
        assert!((a[3][7] / b[3][7] - 1.0).abs() < rounding);
    }
}

#[test]
fn a_penalised_fit_equals_the_dense_one_and_its_determined_part_is_close() {
    let samples = samples(700, Noise::Unknown);
    for (power, position) in
        [(1.0, Position::Legendre { degree: 2 }), (2.0, Position::Splines { spans: 1 })]
    {
        let penalty = Penalty { power, strength: 2.0 };
        let model = Penalised::new(basis(position), penalty);
        let dense = crate::fit(&samples, &REGION, model, &commons()).unwrap();
        let sparse = fit(&samples, model, &commons()).unwrap();
        // The scatter follows from the estimate of what is determined.
        let (a, b) = (dense.determined(), sparse.determined());
        assert!((a - b).abs() < 4.0 * (2.0 * a / 48.0).sqrt(), "{a} {b}");
        let noise = Noise::Fixed { variance: 0.01 };
        let known: Vec<Sample> = samples.iter().map(|s| Sample { noise, ..*s }).collect();
        let dense = crate::fit(&known, &REGION, model, &commons()).unwrap();
        let sparse = fit(&known, model, &commons()).unwrap();
        agree(&dense, &sparse);
    }
}

/// Readings of little noise determine as many coefficients as they are, never more.
#[test]
fn few_readings_determine_no_more_than_they_are() {
    let samples = samples(30, Noise::Fixed { variance: 1e-6 });
    let penalty = Penalty { power: 1.0, strength: 1e-3 };
    for position in [Position::Legendre { degree: 1 }, Position::Legendre { degree: 2 }] {
        let model = Penalised::new(basis(position), penalty);
        assert!(model.basis.len() > samples.len());
        let dense = crate::fit(&samples, &REGION, model, &[]).unwrap();
        let sparse = fit(&samples, model, &[]).unwrap();
        let (a, b) = (dense.determined(), sparse.determined());
        assert!(b <= samples.len() as f64, "{b} of {}", samples.len());
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn what_no_reading_meets_is_named_and_so_is_what_is_not_told_apart() {
    let noise = Noise::Fixed { variance: 0.01 };
    let cone: Vec<Sample> =
        samples(3000, noise).into_iter().filter(|s| s.ray.theta_rad < 0.8).collect();
    let model = basis(Position::Legendre { degree: 0 });
    let refused = fit(&cone, model, &[]).unwrap_err();
    let FitError::Undetermined { functions, .. } = &refused else { panic!("{refused}") };
    let beyond = |name: &String| name[2..4].parse::<f64>().is_ok_and(|theta_deg| theta_deg > 46.0);
    assert!(!functions.is_empty() && functions.iter().all(beyond), "{functions:?}");
    // One place, a gradient asked for.
    let place: Vec<Sample> = samples(3000, noise)
        .into_iter()
        .map(|s| Sample { ray: Ray { x_m: 0.005, ..s.ray }, ..s })
        .collect();
    let model = basis(Position::Legendre { degree: 1 });
    let refused = fit(&place, model, &[]).unwrap_err();
    assert!(matches!(refused, FitError::Undetermined { .. }), "{refused}");
}

#[test]
fn many_local_functions_go_this_way_by_themselves_and_to_their_limit() {
    let fine = Fine::NONE;
    let spec = |theta_spans, phi_spans| BasisSpec {
        angular: Angular::Splines { theta_spans, phi_spans, fine },
        position: Position::Legendre { degree: 0 },
    };
    let penalty = Penalty { power: 2.0, strength: 1e-3 };
    let model = Penalised::new(spec(36, 90), penalty);
    let samples = samples(500, Noise::Fixed { variance: 0.01 });
    let found = crate::fit(&samples, &REGION, model, &[]).unwrap();
    assert!(found.is_sparse() && found.coefficients().len() > 2000);
    let exitance = found.exitance();
    assert!(exitance.u > 0.0 && exitance.u < 0.1 * exitance.value, "{exitance:?}");
    let again = Fit::from_parts(found.parts().clone()).unwrap_err();
    assert!(matches!(again, FitError::Parts { what: "factor", .. }), "{again}");
    let refused = found.nonnegative().unwrap_err();
    assert!(matches!(refused, FitError::Sparse { .. }), "{refused}");
    let refused = found.symmetric(Symmetry::Rotational).unwrap_err();
    assert!(matches!(refused, SymmetryError::Fit(FitError::Sparse { .. })), "{refused}");
    let mut readings = Readings::of(&samples);
    let gain = [Common { name: "gain".into(), u: 0.02, shift: Shift::Scale }];
    readings.nuisances = &gain;
    let refused = crate::fit_readings(&readings, &REGION, model, None).unwrap_err();
    assert!(refused.to_string().starts_with("nuisances fitted along: not with more than 2000"));
    let vast = crate::fit(&samples, &REGION, spec(300, 300), &[]).unwrap_err();
    assert!(matches!(vast, FitError::TooLarge { coefficients_max: 32_768, .. }), "{vast}");
}
