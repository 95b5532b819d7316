//! What could break: a bound that an effect exceeds, or one so wide that everything is kept. Each
//! effect is tried at random parameters, its influences spread over eight decades: the true
//! influence is measured on the board, the effect forced in against left out, and must stay below
//! the bound and above a hundredth of it.
//!
//! To add an effect: a function in `cases` that draws a case, and its name in `EFFECTS` there.

#[path = "../bench/mod.rs"]
mod bench;
mod cases;
mod measured;

use cases::{Dice, EFFECTS, Measure};
use sim::{Emitter, Quantity, Region, Scene, Shape, Simulated, Terms, compile};

/// Cases an effect; so many that all effects together make more than 200.
const CASES: u64 = 10;
/// Influences below this are lost in the converter's counts.
const SEEN: f64 = 1e-8;
#[test]
fn every_bound_holds_and_is_not_too_wide() {
    let mut seen = 0;
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    let mut broken = Vec::new();
    for (i, draw) in (0..).zip(EFFECTS) {
        for k in 0..CASES {
            let mut dice = Dice(i * 1000 + k);
            let case = draw(&mut dice);
            let (bound, found) = (case.bound(), case.true_influence(&mut dice));
            let is_random =
                matches!(case.measure, Measure::Dwells | Measure::Seeds | Measure::Moved(_));
            // A standard deviation of 400 dwells, or of 24 seeds, has an error of its own.
            let chance = match case.measure {
                Measure::Dwells => 1.15,
                _ if is_random => 1.45,
                _ => 1.0 + 1e-6,
            };
            let line = format!("{} case {k}: {found:e}, bound {bound:e}", case.effect);
            if found > bound * chance {
                broken.push(format!("{line}: exceeded"));
            }
            if found > SEEN {
                seen += 1;
                (smallest, largest) = (smallest.min(found), largest.max(found));
                if bound > 100.0 * found {
                    broken.push(format!("{line}: too wide"));
                }
            } else if bound > 1e-3 {
                broken.push(format!("{line}: nothing seen"));
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
    assert!(seen > 150, "{seen} influences were large enough to be seen");
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
