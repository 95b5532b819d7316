//! What could break: a table that misses what it is made of, or says more than it knows.

use super::*;
use crate::optics::Boundary;

const SIDE: (f64, f64) = (-1.0, 2.0);

fn table(radiance: &dyn Fn(DVec2) -> f64, told: &[DVec2], error: f64) -> Table {
    let patch = Patch {
        name: "surface[0]".to_owned(),
        boundary: Boundary::of_rectangle(SIDE, SIDE),
        place: DVec2::ZERO,
        goes: Goes::WithPlace,
    };
    let wanted = Wanted { x_m: (-0.5, 9.0), y_m: SIDE, spot_m: 0.5, floor: 1e-6, error };
    Table::new(&patch, told, wanted, radiance).expect("the patch lies within")
}

/// How far the mean over a spot is off at most, over an odd lattice of spots.
fn off(table: &Table, radiance: &dyn Fn(DVec2) -> f64) -> f64 {
    let odd = |i: u32, k: f64| (f64::from(i) * k + 0.5).fract();
    let of_spot = |spot: u32| {
        let centre = DVec2::new(odd(spot, 0.754_877_666), odd(spot, 0.569_840_29));
        let centre = DVec2::new(-0.25, -0.75) + centre * DVec2::new(2.0, 2.5);
        let apart = |i: u32| {
            let turn = DVec2::from_angle(6.3 * odd(i, 0.618_034));
            let at = centre + turn * (0.25 * (f64::from(i) / 500.0).sqrt());
            table.at(at).unwrap() - radiance(at)
        };
        (0..500).map(apart).sum::<f64>().abs() / 500.0
    };
    (0..300).map(of_spot).fold(0.0, f64::max)
}

#[test]
fn a_smooth_field_and_one_with_the_root_of_a_penumbra_are_followed() {
    let smooth = |at: DVec2| 3.0 + libm::sin(2.0 * at.x) * libm::exp(at.y / 2.0);
    let made = table(&smooth, &[], 1e-8);
    assert!(off(&made, &smooth) < 6e-8, "{:e}", off(&made, &smooth));
    // Its edge lies aslant; then upright, for which fewer cells will do.
    let edge = |along: DVec2| move |at: DVec2| (at.dot(along) - 0.3).max(0.0).powf(1.5);
    let (aslant, upright) = (edge(DVec2::new(0.8, 0.6)), edge(DVec2::X));
    let (first, second) = (table(&aslant, &[], 1e-5), table(&upright, &[], 1e-5));
    assert!(off(&first, &aslant) < 2e-5, "{:e}", off(&first, &aslant));
    assert!(off(&second, &upright) < 2e-5, "{:e}", off(&second, &upright));
    assert!(second.cells.len() < first.cells.len() / 2);
}

#[test]
fn what_the_field_tells_of_is_not_missed_between_the_nodes() {
    let small = DVec2::new(0.613, 0.257);
    let spot = |at: DVec2| 1.0 - libm::exp(-at.distance_squared(small) / 4e-5);
    let missed = |table: Table| (table.at(small).unwrap() - spot(small)).abs();
    assert!(missed(table(&spot, &[], 1e-4)) > 0.5);
    assert!(missed(table(&spot, &[small], 1e-4)) < 1e-2);
}

#[test]
fn nothing_is_said_beyond_what_was_wanted_and_the_patch() {
    let made = table(&|at| at.x + 3.0, &[], 1e-6);
    for outside in [DVec2::new(-0.51, 0.0), DVec2::new(2.01, 0.0), DVec2::new(0.0, -1.01)] {
        assert_eq!(made.at(outside), None);
    }
    assert!((made.at(DVec2::new(2.0, 2.0)).unwrap() - 5.0).abs() < 1e-12);
}
