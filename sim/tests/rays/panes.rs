//! Surroundings behind bodies and on glossy surfaces, and light of every lamp through the sample's window.

use glam::DVec3;

use crate::lit::{BODIES, GLOSSY, LAMPS, PANEL, PATHS, lamp};
use crate::{Both, agree, axis};

const SKY: (&str, &str) = LAMPS[4];

/// The sample's, not far above the panel, so that what it shifts and throws back is seen.
const WINDOW: &str = "[[window]]\nz_mm = 20\nthickness_mm = 6\nindex = 1.52\n\
                      absorption_per_mm = 0.01\nbelongs_to = \"sample\"\n";

#[test]
fn a_sky_is_hidden_by_what_stands_before_it() {
    // A panel that leans, above the floor: it hides the sky from the floor, and the ball from it.
    let leaning = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.6\n\
                   corners_mm = [[8, -15, 5], [30, -15, 15], [30, 15, 22], [8, 15, 12]]\n";
    let text = format!("{PANEL}{leaning}{}[[occluder]]\n{}", lamp(SKY), BODIES[2]);
    let both = Both::of_axes(&text);
    let open = Both::of_axes(&format!("{PANEL}{}", lamp(SKY)));
    let mut shaded = 0;
    for (x, y) in [(0.0, 0.0), (7.0, -3.0), (-9.0, 8.0), (-2.0, -9.0), (6.0, 9.0)] {
        let at = axis(x, y, 0.0, 0.0);
        // Below all that stands above.
        let (found, mean) = both.leaving(&at, 4e-3, PATHS / 2);
        let unshaded = open.along(&at, 1).0;
        agree(&format!("at {x} {y}"), (found, mean), unshaded, 1e-6, 1e-2);
        shaded += u32::from(found < 0.9 * unshaded);
    }
    assert!(shaded > 2, "only {shaded} places are in the shadow");
    // What leans sees a part of the sky that goes with its azimuth.
    let place = DVec3::new(19.0, 0.0, 13.5) * 1e-3;
    let into = DVec3::new(-0.4, 0.1, 1.0).normalize();
    let ray = sim::Ray::through(place, into).unwrap();
    let found = both.compiled.radiance(&ray);
    let mean = crate::beam::along(&both.world, place + into * 1e-3, -into, PATHS, 5);
    agree("what leans", (found, mean), found, 1e-6, 8e-3);
}

#[test]
fn a_glossy_panel_sends_on_the_sky() {
    let both = Both::of_axes(&format!("{GLOSSY}{}[[occluder]]\n{}", lamp(SKY), BODIES[1]));
    let row = both.compiled.effects().iter().find(|row| row.name == "gloss[0]").unwrap();
    assert!(row.included && row.error.unwrap() < 1e-5, "{row:?}");
    for (x, y, theta, phi) in
        [(0.0, 0.0, 0.0, 0.0), (3.0, -4.0, 50.0, 210.0), (5.0, 3.0, 70.0, 10.0)]
    {
        let at = axis(x, y, theta, phi);
        let (found, mean) = both.along(&at, PATHS);
        agree(&format!("{x} {y} {theta}°"), (found, mean), found, 1e-6, 8e-3);
    }
}

#[test]
fn every_lamp_lights_a_panel_through_the_window() {
    // The sun's light has a test of its own.
    for of in [LAMPS[0], LAMPS[1], LAMPS[2], LAMPS[4]] {
        let both = Both::of_axes(&format!("{PANEL}{WINDOW}{}", lamp(of)));
        let clear = Both::of_axes(&format!("{PANEL}{}", lamp(of)));
        let rows = both.compiled.effects().iter().filter(|row| row.included);
        let stated: f64 = rows.filter_map(|row| row.error).sum();
        assert!(stated > 0.0 && stated < 5e-5, "{stated}");
        let mut apart = 0.0_f64;
        for (x, y, theta, phi) in [(-9.0, 4.0, 35.0, 200.0), (8.0, -7.0, 60.0, 250.0)] {
            let at = axis(x, y, theta, phi);
            let (found, mean) = both.leaving(&at, 30e-3, 2 * PATHS);
            let what = format!("{} at {x} {y} {theta}°", of.0);
            // What the upper face throws back is taken as if it all went straight up.
            agree(&what, (found, mean), found, 5e-4, 5e-3);
            apart = apart.max((found / clear.along(&at, 1).0 - 1.0).abs());
        }
        assert!(apart > 0.03, "the window hardly matters: {apart}");
    }
}
