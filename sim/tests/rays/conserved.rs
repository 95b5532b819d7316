//! Light that is neither lost nor made, and bytes that do not depend on who computes them.

use core::f64::consts::PI;
use std::sync::Arc;

use sim::{Sampler, Simulated, Terms, compile};

use crate::beam::flux;
use crate::bench::exact_rig;
use crate::world::World;
use crate::{axis, read};

const SCENE: &str = "[[emitter]]\nkind = \"cosine-power\"\nexponent = 4\nx_mm = [-10, 10]\n\
                     y_mm = [-10, 10]\nradiance_w_per_m2_sr = 10\n\
                     [[emitter]]\nkind = \"lambertian\"\ncentre_mm = [16, 0]\nradius_mm = 4\n\
                     radiance_w_per_m2_sr = 30\n";

#[test]
fn the_photocurrent_is_the_flux_through_pupil_and_spot_times_the_responsivity() {
    let (scene, nominal) = (read(SCENE), exact_rig());
    let world = World::new(&scene, &[]);
    let compiled = compile(scene, nominal.clone(), Simulated::default(), &Terms::default());
    let sampler = Sampler::new(&Arc::new(compiled.unwrap()), 0);
    for (theta_deg, phi_deg) in [(0.0, 0.0), (40.0, 30.0), (65.0, -100.0)] {
        let found = sampler.photocurrent_a([
            f64::to_radians(theta_deg),
            f64::to_radians(phi_deg),
            0.0,
            0.0,
        ]);
        // Nothing of a throughput in closed form: ∫∫ L cos θ cos θ' / r² dA dA'.
        let by_rays =
            flux(&world, &nominal.detector, &axis(0.0, 0.0, theta_deg, phi_deg), 40_000, 3);
        let responsivity = nominal.detector.responsivity_a_per_w;
        let (expected, error) = (by_rays.value * responsivity, by_rays.error * responsivity);
        assert!(error < 2e-3 * expected, "{expected} ± {error} is too coarse to tell");
        assert!((found - expected).abs() < 5.0 * error, "{found}, by rays {expected} ± {error}");
    }
    // And of the size that a person would work out: L A₁ A₂ / h².
    let found = sampler.photocurrent_a([0.0; 4]);
    let far = 10.0 * (PI * 0.006_25 * 0.002_5 / 0.3).powi(2) * 0.2;
    assert!((found / far - 1.0).abs() < 3e-3, "{found} {far}");
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_thread() {
    let values = |seed: u64| {
        let mut nominal = exact_rig();
        nominal.detector.read_noise_a = 1e-12;
        nominal.axes[0].u_zero = 1e-3;
        let terms = Terms::seeded(seed);
        let compiled = compile(read(SCENE), nominal, Simulated::default(), &terms).unwrap();
        let mut sampler = Sampler::new(&Arc::new(compiled), 0);
        (0..500_u32)
            .map(|i| {
                sampler.begin(i);
                sampler.convert([0.001 * f64::from(i), 0.0, 0.0, 0.0]).unwrap()
            })
            .collect::<Vec<i32>>()
    };
    let alone = values(7);
    let together = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| values(7))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect::<Vec<_>>()
    });
    assert!(together.iter().all(|values| *values == alone));
    assert_ne!(values(8), alone);
}
