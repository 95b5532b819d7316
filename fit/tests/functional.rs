//! Sums of radiances along weighted rays: their value and uncertainty are those of the covariance,
//! of the derived quantities that the basis integrates itself, and of a field disturbed by hand.

#[allow(dead_code)]
mod scenes;

use fit::{BasisSpec, Common, Fit, Noise, Ray, Shift};
use scenes::disturbed::disturbed;
use scenes::{Die, REGION, exact, scaled, spread_rays};
use std::f64::consts::{PI, TAU};

const BASIS: BasisSpec = BasisSpec::zernike(4, 1);

fn level(ray: &Ray) -> f64 {
    let (x, _) = scaled(ray);
    5.0 + 20.0 * libm::cos(ray.theta_rad).powi(2) + 2.0 * x
}

fn field() -> Fit {
    let mut samples = exact(&spread_rays(300, &REGION, 7), level);
    for (i, sample) in samples.iter_mut().enumerate() {
        sample.noise = Noise::Fixed { variance: 0.01 * (1.0 + (i % 5) as f64) };
    }
    let common = [
        Common { name: "responsivity".into(), u: 0.02, shift: Shift::Scale },
        Common { name: "dark".into(), u: 0.1, shift: Shift::Value(Box::new(|_, _| 0.1)) },
    ];
    fit::fit(&samples, &REGION, BASIS, &common).unwrap()
}

/// The cone's rays by the mid-point rule over sin² and azimuth, at two places beside the centre.
fn cone(sin2: f64) -> Vec<(Ray, f64)> {
    let (rings, spokes) = (200, 24);
    let mut rays = Vec::new();
    for x_m in [-0.011, 0.011] {
        for k in 0..rings * spokes {
            let s = sin2 * (f64::from(k / spokes) + 0.5) / f64::from(rings);
            let phi_rad = TAU * f64::from(k % spokes) / f64::from(spokes);
            let ray = Ray { x_m, y_m: 0.015, theta_rad: s.sqrt().asin(), phi_rad };
            rays.push((ray, 0.5 * PI * sin2 / f64::from(rings * spokes)));
        }
    }
    rays
}

#[test]
fn a_cone_by_rays_is_the_cone_by_the_basis() {
    let field = field();
    let by_rays = field.of(&field.weighted_rays(cone(0.4)));
    let by_basis = field.exitance_within(0.4_f64.sqrt().asin()).unwrap();
    assert!((by_rays.value / by_basis.value - 1.0).abs() < 1e-5);
    assert!((by_rays.u / by_basis.u - 1.0).abs() < 1e-4);
    assert!((by_rays.u_independent / by_basis.u_independent - 1.0).abs() < 1e-3);
}

#[test]
fn the_uncertainty_is_the_covariances_and_the_budget_adds_up_to_it() {
    let field = field();
    let functional = field.weighted_rays(cone(0.1)).times(3.0);
    let found = field.of(&functional);
    let row = functional.row();
    let covariance = field.covariance();
    let times_row = covariance.iter().map(|c| c.iter().zip(row).map(|(a, b)| a * b).sum::<f64>());
    let variance: f64 = row.iter().zip(times_row).map(|(a, b)| a * b).sum();
    assert!((found.u * found.u / variance - 1.0).abs() < 1e-10);
    let budget = field.contributions_of(&functional);
    let squares: f64 = budget.iter().map(|part| part.u * part.u).sum();
    assert!((squares / variance - 1.0).abs() < 1e-10);
    let names: Vec<&str> = budget.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["independent", "responsivity", "dark"]);
}

#[test]
fn disturbed_coefficients_scatter_a_sum_as_its_u_says() {
    let field = field();
    let near = |x_m: f64| Ray { x_m, y_m: 0.015, theta_rad: 0.3, phi_rad: 1.0 };
    let difference = field
        .weighted_rays([(near(0.01), 1.0)])
        .plus(-1.0, &field.weighted_rays([(near(-0.01), 1.0)]));
    let stated = field.of(&difference);
    let mut die = Die::new(3);
    let runs = 4000;
    let squares: f64 = (0..runs)
        .map(|_| {
            let other = disturbed(field.parts(), &mut die);
            let by_hand = other.value(&near(0.01)) - other.value(&near(-0.01));
            (by_hand - stated.value).powi(2)
        })
        .sum();
    let scatter = (squares / f64::from(runs)).sqrt();
    // The standard deviation of 4000 draws is known to 1.1 %.
    assert!((scatter / stated.u - 1.0).abs() < 0.05, "{scatter} {}", stated.u);
    // What all readings share cancels in the difference but for the scale of 2 %.
    assert!(field.contributions_of(&difference)[2].u < 1e-3 * stated.u);
}

#[test]
fn no_ray_is_nothing_and_another_fits_functional_is_refused() {
    let field = field();
    let nothing = field.of(&field.weighted_rays([]));
    let zeros = [nothing.value, nothing.u, nothing.u_independent].map(f64::to_bits);
    assert_eq!(zeros, [0.0_f64.to_bits(); 3]);
    let coarser = BasisSpec::zernike(2, 0);
    let samples = exact(&spread_rays(50, &REGION, 7), |_| 1.0);
    let other = fit::fit(&samples, &REGION, coarser, &[]).unwrap();
    let functional = other.weighted_rays(cone(0.1));
    let mixed = std::panic::catch_unwind(|| field.of(&functional));
    assert!(mixed.is_err());
}
