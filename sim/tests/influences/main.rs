//! What could break: a bound that an effect exceeds, or one so wide that everything is kept. Each
//! effect is tried in random rigs and scenes, its influences spread over eight decades. A longer
//! run, as a table and a figure: `influences` of the crate benches.

#[path = "../bench/mod.rs"]
mod bench;
mod drawn;

use drawn::{KINDS, Verdict, weigh};
use sim::{Emitter, Quantity, Region, Scene, Shape, Simulated, Terms, compile};

/// Cases a kind.
const CASES: u64 = 2;

#[test]
fn every_bound_holds_and_is_not_too_wide() {
    let weighed = weigh(CASES * KINDS, 1);
    let (mut seen, mut smallest, mut largest) = (0, f64::INFINITY, 0.0_f64);
    let mut broken = Vec::new();
    for (i, weighed) in weighed.iter().enumerate() {
        let line =
            format!("case {i}, {}: {:e}, bound {:e}", weighed.effect, weighed.found, weighed.bound);
        match weighed.verdict() {
            Verdict::Exceeded => broken.push(format!("{line}: exceeded")),
            Verdict::TooWide => broken.push(format!("{line}: too wide")),
            Verdict::Unseen => {}
            Verdict::Holds => {
                seen += 1;
                (smallest, largest) = (smallest.min(weighed.found), largest.max(weighed.found));
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
    assert!(seen > 60, "{seen} influences were large enough to be seen");
    assert!(smallest < 1e-7 && largest > 0.3, "from {smallest:e} to {largest:e}");
}

#[test]
fn what_is_smaller_than_a_grids_step_is_found() {
    // Half a millimetre wide, in a region of ten centimetres, off the places of any even grid.
    let patch = Emitter::lambertian(Shape::rectangle(0.0131, 0.0073, 5e-4, 5e-4), 40.0);
    let scene = Scene::new(Quantity::Radiance).with(patch).unwrap();
    let mut nominal = bench::exact_rig();
    nominal.detector.read_noise_a = 1e-13;
    nominal.axes[2].u_zero = 1e-5;
    nominal.axes[0].u_zero = 1e-5;
    let region = Region { x_m: (-0.05, 0.05), y_m: (-0.05, 0.05), theta_max_rad: 1.0 };
    let terms =
        Terms { region: Some(region), without: vec!["finite-beam".into()], ..Terms::default() };
    let compiled = compile(scene, nominal, Simulated::default(), &terms).unwrap();
    let bound = |name: &str| {
        let row = compiled.effects().iter().find(|row| row.name == name).unwrap();
        row.bound.unwrap().value
    };
    assert_eq!(
        [bound("x-zero"), bound("theta-zero")].map(f64::to_bits),
        [1.0, 0.0_f64].map(f64::to_bits)
    );
    // Where it does not shine there is noise alone.
    assert!(bound("read-noise") > 0.5, "{}", bound("read-noise"));
}
