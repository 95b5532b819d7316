//! How much of a value rests on measurement, by the directions that were read.

use fit::{BasisSpec, Cause, Fit, Noise, Ray, Region, Sample, Symmetry};

const CONE_DEG: f64 = 80.0;

fn sample(theta_deg: f64, phi_deg: f64) -> Sample {
    let (theta_rad, phi_rad) = (theta_deg.to_radians(), phi_deg.to_radians());
    let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad, phi_rad };
    Sample { ray, value: 100.0, noise: Noise::Fixed { variance: 1.0 } }
}

fn fitted(samples: &[Sample], degree: usize) -> Fit {
    let region = Region::surface((-0.01, 0.01), (-0.01, 0.01), CONE_DEG.to_radians());
    fit::fit(samples, &region, BasisSpec::zernike(degree, 0), &[]).unwrap()
}

/// Every so many degrees, where it is kept.
fn grid(theta_step: u32, phi_step: u32, keep: impl Fn(f64, f64) -> bool) -> Vec<Sample> {
    let theta = (0..=80).step_by(theta_step as usize).map(f64::from);
    let all = theta.flat_map(|theta| {
        let phi = (-180..180).step_by(phi_step as usize).map(f64::from);
        phi.map(move |phi| (theta, phi))
    });
    all.filter(|(theta, phi)| keep(*theta, *phi)).map(|(t, p)| sample(t, p)).collect()
}

/// sin² 80°: what a Lambertian source sends within the cone.
fn cone() -> f64 {
    CONE_DEG.to_radians().sin().powi(2)
}

#[test]
fn a_quarter_of_all_azimuths_left_out_is_a_quarter_not_measured() {
    let fit = fitted(&grid(4, 5, |_, phi| !(0.0..=90.0).contains(&phi)), 4);
    let part = fit.measured_fraction().unwrap() / cone();
    // Readings stand for their own mesh to both sides of the wedge, too: 5° of azimuth.
    assert!((part - 0.75).abs() < 0.02, "{part}");
    let in_gap = sample(50.0, 45.0).ray;
    assert!(!fit.is_measured(&in_gap) && fit.is_measured(&sample(50.0, -45.0).ray));
    let flux = fit::derive::Field::of(&fit).flux(fit::derive::HEMISPHERE).unwrap();
    let by_sum = flux.measured_fraction.unwrap() / cone();
    // A rule of a dozen spokes sees the wedge's ends to a part of a spoke.
    assert!((by_sum - part).abs() < 0.04, "{by_sum} {part}");
}

#[test]
fn grids_without_gaps_are_whole_however_sparse() {
    for (theta, phi) in [(20, 45), (16, 30), (10, 15), (5, 5), (2, 10)] {
        let fit = fitted(&grid(theta, phi, |_, _| true), 2);
        let part = fit.measured_fraction().unwrap() / cone();
        assert!((part - 1.0).abs() < 1e-9, "{theta} {phi}: {part}");
    }
    // A spiral by the golden angle: no rings, no meridians.
    let spiral: Vec<Sample> = (0..400)
        .map(|i| {
            let part = (f64::from(i) + 0.5) / 400.0;
            let theta = (part.sqrt() * (CONE_DEG / 2.0).to_radians().sin()).asin() * 2.0;
            sample(theta.to_degrees(), 137.507_764 * f64::from(i))
        })
        .collect();
    let part = fitted(&spiral, 3).measured_fraction().unwrap() / cone();
    assert!((part - 1.0).abs() < 1e-9, "{part}");
}

#[test]
fn a_symmetry_measures_what_lies_across_the_mirror() {
    let half = grid(4, 5, |_, phi| (0.0..=180.0).contains(&phi) || phi <= -180.0);
    let fit = fitted(&half, 2);
    let part = fit.measured_fraction().unwrap() / cone();
    // And what lies within the mesh's reach, 4°, on the other side.
    assert!((part - 0.54).abs() < 0.03, "{part}");
    let (mirrored, _) = fit.symmetric(Symmetry::Plane { phi_rad: 0.0 }).unwrap();
    let part = mirrored.measured_fraction().unwrap() / cone();
    assert!((part - 1.0).abs() < 1e-9, "{part}");
}

#[test]
fn fewer_meridians_than_the_degree_needs_are_named() {
    // Five meridians: as rows, cos 4φ and cos φ differ by their course in θ alone.
    let five = grid(4, 72, |_, _| true);
    let fit = fitted(&five, 4);
    assert_eq!(fit.aliased(), Some(Cause::Meridians { distinct: 5, degree: 4, needed: 9 }));
    let said = fit.aliased().unwrap().to_string();
    assert!(said.contains("only 5 meridians") && said.contains("needs 9"), "{said}");
    assert_eq!(fitted(&five, 2).aliased(), None);
    assert_eq!(fitted(&grid(4, 40, |_, _| true), 4).aliased(), None);
}
