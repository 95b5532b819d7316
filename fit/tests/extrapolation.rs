//! Where nothing was measured u is what functions that do as well elsewhere make of it, and nothing is
//! added where something was.

#[allow(dead_code)]
mod scenes;

use fit::trials::Spread;
use fit::{Chosen, EXTRAPOLATION, Fit, Noise, Ray, Readings, Region, Ruled, Rules, Sample, Wish};
use scenes::Die;
use std::f64::consts::{PI, TAU};

/// Measured to 80°.
const REGION: Region = Region::surface((0.0, 0.0), (0.0, 0.0), 80.0 * PI / 180.0);
const SIGMA: f64 = 1e-2;
/// Of a power that no polynomial follows to the horizon.
fn lobe(theta_rad: f64, _: f64) -> f64 {
    1.0 + 2.0 * theta_rad.cos().max(0.0).powf(1.5)
}

/// Rings 8° apart, twelve readings each.
fn readings(field: impl Fn(f64, f64) -> f64, die: &mut Die) -> Vec<Sample> {
    let noise = Noise::Fixed { variance: SIGMA * SIGMA };
    let rays = (0..=10).flat_map(|ring| {
        let theta_rad = f64::to_radians(8.0) * f64::from(ring);
        (0..12).map(move |k| (theta_rad, TAU * f64::from(k) / 12.0))
    });
    let mut sample = |(theta_rad, phi_rad)| {
        let value = field(theta_rad, phi_rad) + SIGMA * die.normal();
        Sample { ray: Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad }, value, noise }
    };
    rays.map(&mut sample).collect()
}

fn wished(samples: &[Sample]) -> Ruled {
    fit::fit_wished(&Readings::of(samples), &REGION, &Wish::default(), None).unwrap()
}

/// The same with functions that nobody doubts.
fn pinned(samples: &[Sample], fit: &Fit) -> Fit {
    let chosen = Chosen::from(fit.model());
    let readings = Readings::of(samples);
    fit::fit_known(&readings, &REGION, &chosen, &Rules::default(), None).unwrap().fit
}

fn part(fit: &Fit, rows: &[fit::Contribution]) -> f64 {
    assert!(fit.contributions().iter().any(|row| row.name == EXTRAPOLATION));
    rows.iter().find(|row| row.name == EXTRAPOLATION).map_or(0.0, |row| row.u)
}

#[test]
fn what_was_measured_is_not_doubted() {
    let mut die = Die::new(2);
    let samples = readings(lobe, &mut die);
    let Ruled { fit, .. } = wished(&samples);
    assert!(part(&fit, &fit.contributions()) > 0.0);
    assert!(part(&fit, &fit.contributions_within_region()) < 1e-300);
    let ray = |theta_deg: f64| Ray {
        x_m: 0.0,
        y_m: 0.0,
        theta_rad: theta_deg.to_radians(),
        phi_rad: 1.0,
    };
    assert!(part(&fit, &fit.radiance_contributions(&ray(70.0))) < 1e-300);
    assert!(part(&fit, &fit.radiance_contributions(&ray(88.0))) > 0.0);
    let sure = pinned(&samples, &fit);
    assert!(sure.contributions().iter().all(|row| row.name != EXTRAPOLATION));
    assert!((sure.radiance(&ray(70.0)).u / fit.radiance(&ray(70.0)).u - 1.0).abs() < 1e-12);
    // Sums take it with them: the exitance by a rule of rays, and as it is integrated.
    let field = fit::derive::Field::of(&fit);
    let by_rays = field.mean_exitance(fit::derive::HEMISPHERE).unwrap();
    let (u, own) = (by_rays.estimate.u, fit.exitance().u);
    assert!((u / own - 1.0).abs() < 0.02, "{u} {own}");
}

#[test]
fn where_functions_go_on_alike_next_to_nothing_is_added() {
    let mut die = Die::new(4);
    let samples = readings(|_, _| 1.0, &mut die);
    let Ruled { fit, .. } = wished(&samples);
    let u = part(&fit, &fit.contributions());
    assert!(u < 3e-4 * fit.exitance().value, "{u}");
}

#[test]
fn in_a_gap_functions_are_doubted_and_beside_it_not() {
    let mut die = Die::new(9);
    let field = |theta: f64, phi: f64| 1.0 + 0.5 * theta.sin() * (3.0 * phi).cos() * theta.cos();
    let mut samples = readings(field, &mut die);
    samples.retain(|s| !(1.4..3.9).contains(&s.ray.phi_rad) || s.ray.theta_rad < 0.3);
    let Ruled { fit, .. } = wished(&samples);
    let towards = |phi_rad: f64| Ray { x_m: 0.0, y_m: 0.0, theta_rad: 1.0, phi_rad };
    let of = |phi_rad: f64| part(&fit, &fit.radiance_contributions(&towards(phi_rad)));
    assert!(of(2.6) > 0.0);
    assert!(of(5.5) < 1e-300);
}

#[test]
fn trials_scatter_as_u_says() {
    let mut die = Die::new(12);
    let samples = readings(lobe, &mut die);
    let Ruled { fit, .. } = wished(&samples);
    let readings = Readings::of(&samples);
    let trials = fit.trials(&readings, None).unwrap();
    let sum = fit.exitance_sum();
    let mut values = Vec::new();
    trials.run(4000, &mut || die.normal(), &mut |trial| values.push(trial.of(&sum)));
    let (spread, u) = (Spread::of(values).unwrap(), fit.exitance().u);
    assert!((spread.u / u - 1.0).abs() < 0.04, "{} {u}", spread.u);
    assert!(part(&fit, &fit.contributions()) > 0.3 * u, "not tested by this lamp");
}
