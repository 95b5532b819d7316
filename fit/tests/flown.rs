//! What could break: a reading taken in flight that is fitted as if it stood in its middle, which
//! takes the top off a lobe.

use fit::{BasisSpec, Fit, Noise, Ray, Region, Sample};

const NOISE: Noise = Noise::Fixed { variance: 1e-12 };

fn ray(theta: f64, phi_deg: f64) -> Ray {
    let phi = if theta < 0.0 { phi_deg + 180.0 } else { phi_deg };
    Ray { x_m: 0.0, y_m: 0.0, theta_rad: theta.abs(), phi_rad: phi.to_radians() }
}

/// cos⁸ θ and a little azimuth: a polynomial of degree 8 on the disk, so that the basis holds it.
fn field(ray: &Ray) -> f64 {
    let u = ray.theta_rad.sin() * ray.phi_rad.cos();
    ray.theta_rad.cos().powi(8) * 10.0 + 0.3 * u
}

/// Windows of 4° along planes through the zenith: the mean over each way, by 400 parts.
fn windows() -> (Vec<Sample>, Vec<Option<(Ray, Ray)>>) {
    let mut samples = Vec::new();
    let mut flown = Vec::new();
    for plane in 0..12 {
        let phi_deg = 15.0 * f64::from(plane);
        for window in -20..20 {
            let at = |part: f64| ray((4.0 * (f64::from(window) + part)).to_radians(), phi_deg);
            let parts = (0..400).map(|i| field(&at((f64::from(i) + 0.5) / 400.0)));
            let value = parts.sum::<f64>() / 400.0;
            samples.push(Sample { ray: at(0.5), value, noise: NOISE });
            flown.push(Some((at(0.0), at(1.0))));
        }
    }
    (samples, flown)
}

fn off(fit: &Fit) -> f64 {
    (0..80)
        .map(|deg| ray(f64::from(deg).to_radians(), 37.0))
        .map(|at| (fit.radiance(&at).value - field(&at)).abs())
        .fold(0.0, f64::max)
}

#[test]
fn the_mean_over_a_way_gives_the_field_and_the_middle_alone_blurs_it() {
    let (samples, flown) = windows();
    let region = Region::surface((0.0, 0.0), (0.0, 0.0), 80.0_f64.to_radians());
    let basis = BasisSpec::zernike(8, 0);
    let blurred = fit::fit(&samples, &region, basis, &[]).unwrap();
    let whole = fit::fit_flown(&samples, &flown, &region, basis, &[], None).unwrap();
    // Half w²/12 times the curvature of the top, 8 · 10: 0.016.
    let taken = 0.5 * 4.0_f64.to_radians().powi(2) / 12.0 * 80.0;
    assert!((off(&blurred) / taken - 1.0).abs() < 0.2, "{}, {taken}", off(&blurred));
    assert!(off(&whole) < 2e-3 * taken, "{}", off(&whole));
    // A way that is missing counts as none.
    let at_rest = fit::fit_flown(&samples, &[], &region, basis, &[], None).unwrap();
    assert_eq!(off(&at_rest).to_bits(), off(&blurred).to_bits());
}
