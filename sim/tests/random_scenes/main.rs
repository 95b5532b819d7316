//! What could break: a bound of an effect of light that the effect exceeds, or one so wide that the
//! effect is always kept. Random scenes, whose true influences span eight decades, each searched for
//! the axis where the effect changes most. A longer run, as a table: `influences` of the crate benches.

#[path = "../bench/mod.rs"]
mod bench;
mod cases;

use cases::{Weighed, draw};

const SCENES: u64 = 36;
/// Influences below this are rounding.
const SEEN: f64 = 1e-9;

#[test]
fn bounds_of_light_hold_and_are_not_too_wide() {
    let nominal = bench::exact_rig();
    let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
    let mut broken = Vec::new();
    for i in 0..SCENES {
        let case = draw(i);
        let Weighed { bound, found } = case.weighed(&nominal, i);
        let line = format!("scene {i}, {}: {found:e}, bound {bound:e}", case.effect);
        if found > bound * (1.0 + 1e-9) + 1e-12 {
            broken.push(format!("{line}: exceeded"));
        }
        if found > SEEN {
            (smallest, largest) = (smallest.min(found), largest.max(found));
            if bound > 100.0 * found {
                broken.push(format!("{line}: too wide"));
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
    assert!(smallest < 1e-6 && largest > 0.3, "from {smallest:e} to {largest:e}");
}
