//! Lit surfaces by every lamp, shadows on them, and light that goes between surfaces.

use glam::DVec3;
use sim::{Lamp, LampSource};

use crate::bench::exact_rig;
use crate::{Both, agree, axis, read};

pub(crate) const PATHS: u32 = 100_000;
pub(crate) const RAYS: u32 = 40_000;

pub(crate) const PANEL: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.8\nx_mm = [-50, 50]\n\
                     y_mm = [-50, 50]\n";

pub(crate) const LAMPS: [(&str, &str); 5] = [
    (
        "disk",
        "centre_mm = [60, 0, 90]\naxis = [-0.5, 0, -1]\nradius_mm = 30\nradiance_w_per_m2_sr = 10\n",
    ),
    ("sphere", "centre_mm = [-70, 60, 80]\nradius_mm = 25\nradiance_w_per_m2_sr = 10\n"),
    (
        "polygon",
        "corners_mm = [[60, -80, 60], [90, -20, 80], [40, -60, 130]]\nradiance_w_per_m2_sr = 10\n",
    ),
    ("sun", "theta_deg = 50\nphi_deg = 30\nirradiance_w_per_m2 = 9\n"),
    ("environment", "file = \"sky.pgm\"\nradiance_w_per_m2_sr = 10\n"),
];

pub(crate) fn lamp((kind, place): (&str, &str)) -> String {
    format!("[[lamp]]\nkind = \"{kind}\"\n{place}")
}

const POSES: [(f64, f64, f64, f64); 4] = [
    (0.0, 0.0, 0.0, 0.0),
    (8.0, -7.0, 50.0, 30.0),
    (-9.0, 4.0, 35.0, 200.0),
    (3.0, 9.0, 65.0, 100.0),
];

/// Along the axis and over the beam, in each pose. The scale: what is seen in the brightest.
fn over_poses(what: &str, both: &Both, fine: f64) {
    let axes = POSES.map(|(x, y, theta, phi)| axis(x, y, theta, phi));
    let found = axes.map(|at| both.seen(&at, RAYS));
    let brightest = found.iter().map(|(found, _)| *found).fold(0.0, f64::max);
    assert!(brightest > 0.0, "{what}: dark");
    for ((at, seen), pose) in axes.iter().zip(found).zip(POSES) {
        agree(&format!("{what}, beam, {pose:?}"), seen, brightest, both.stated(), fine);
        agree(&format!("{what}, {pose:?}"), both.along(at, PATHS), brightest, 1e-6, fine);
    }
}

#[test]
fn a_lambertian_panel_is_as_bright_as_every_lamp_makes_it() {
    for of in LAMPS {
        let both = Both::new(read(&format!("{PANEL}{}", lamp(of))), &[], exact_rig());
        // A sky is met by chance alone: more paths would be needed for the same error.
        over_poses(of.0, &both, if of.0 == "environment" { 8e-3 } else { 4e-3 });
    }
}

pub(crate) const GLOSSY: &str = "[[surface]]\nkind = \"glossy\"\nalbedo = 0.2\ngloss = 0.6\nexponent = 12\n\
                      x_mm = [-50, 50]\ny_mm = [-50, 50]\n";

#[test]
fn a_glossy_panel_sends_on_what_its_lobe_says() {
    // Towards the lamps' mirror images, behind a body, and past all of it.
    for (i, of) in LAMPS[..4].iter().enumerate() {
        let beside = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.5\nx_mm = [55, 90]\n\
                      y_mm = [-9, 9]\n";
        let body = if i < 3 { format!("[[occluder]]\n{}", BODIES[i]) } else { beside.to_owned() };
        let text = format!("{GLOSSY}{}{body}", lamp(*of));
        let both = Both::new(read(&text), &[], exact_rig());
        let row = both.compiled.effects().iter().find(|row| row.name == "gloss[0]").unwrap();
        assert!(row.included && row.error.unwrap() < 1e-5, "{row:?}");
        let poses = [(0.0, 0.0, 0.0, 0.0), (3.0, -4.0, 50.0, 210.0), (5.0, 3.0, 40.0, 180.0)];
        let axes = poses.map(|(x, y, theta, phi)| axis(x, y, theta, phi));
        let found = axes.map(|at| both.along(&at, PATHS / 2));
        let brightest = found.iter().map(|(found, _)| *found).fold(0.0, f64::max);
        assert!(brightest > 0.0, "{}: dark", of.0);
        for (at, along) in axes.iter().zip(found) {
            agree(&format!("{} {at:?}", of.0), along, brightest, 1e-6, 8e-3);
            let seen = both.seen(at, RAYS);
            agree(&format!("beam, {} {at:?}", of.0), seen, brightest, both.stated(), 8e-3);
        }
    }
}

const FLOOR: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.8\nx_mm = [-12, 50]\n\
                     y_mm = [-40, 40]\n";

/// A wall on the floor's edge, which a lamp lights from the front; an emitter behind, on the floor.
const WALL: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.9\n\
                    corners_mm = [[-12, -40, 0], [-12, 40, 0], [-12, 40, 50], [-12, -40, 50]]\n";

#[test]
fn a_wall_and_a_floor_light_each_other() {
    let lamp = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [120, 20, 60]\nradius_mm = 30\n\
                radiance_w_per_m2_sr = 10\n";
    let panel = "[[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 2\n\
                 x_mm = [52, 80]\ny_mm = [-40, 40]\n";
    let both = Both::new(read(&format!("{FLOOR}{WALL}{lamp}{panel}")), &[], exact_rig());
    let row = both.compiled.effects().iter().find(|row| row.name == "interreflection").unwrap();
    assert!(
        row.included && row.cause.as_ref().unwrap().contains("see each other, F = "),
        "{row:?}"
    );
    let stated = row.error.unwrap();
    assert!(stated < 1e-2, "{row:?}");
    let poses = [(0.0, 0.0, 0.0, 0.0), (-9.0, 5.0, 20.0, 0.0), (8.0, -7.0, 30.0, 100.0)];
    for (x, y, theta, phi) in poses {
        let at = axis(x, y, theta, phi);
        let what = format!("{x} {y} {theta}°");
        let (found, mean) = both.along(&at, PATHS);
        agree(&what, (found, mean), found, 1e-3, 8e-3);
        let (found, mean) = both.seen(&at, RAYS);
        agree(&format!("beam, {what}"), (found, mean), found, stated + both.stated(), 8e-3);
    }
    // The wall's face, seen over the floor: the sample's plane is crossed beyond it.
    for (y, z) in [(0.0, 10.0), (20.0, 30.0), (-10.0, 2.0)] {
        let (theta, far) = (50f64, 1.191_753_592_594_21);
        let at = axis(-12.0 - z * far, y, theta, 0.0);
        let (found, _) = both.along(&at, 1);
        let place = DVec3::new(-12.0, y, z) * 1e-3 + at.direction * 1e-4;
        let mean = crate::beam::along(&both.world, place, -at.direction, PATHS, 5);
        agree(&format!("wall at {y} {z}"), (found, mean), found, 1e-3, 8e-3);
    }
}

#[test]
fn a_lid_hides_a_part_of_what_a_wall_sends() {
    let lamp = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [120, 0, 60]\nradius_mm = 10\n\
                radiance_w_per_m2_sr = 40\n";
    let lid = "[[occluder]]\nkind = \"polygon\"\n\
               corners_mm = [[-8, -15, 12], [-3, -15, 18], [-3, 15, 18], [-8, 15, 12]]\n";
    let both = Both::new(read(&format!("{FLOOR}{WALL}{lamp}{lid}")), &[], exact_rig());
    for (x, y) in [(0.0, 0.0), (8.0, 5.0), (-2.0, -4.0)] {
        let at = axis(x, y, 0.0, 0.0);
        let (found, mean) = both.along(&at, PATHS);
        agree(&format!("{x} {y}"), (found, mean), found, 5e-3, 8e-3);
    }
}

/// Near the panel, so that all penumbras fall across the poses.
pub(crate) const BODIES: [&str; 4] = [
    "kind = \"half-plane\"\nx_max_mm = 12\nz_mm = 20\n",
    "kind = \"disk\"\ncentre_mm = [18, 0, 25]\naxis = [1, 0.2, 1]\nradius_mm = 9\n",
    "kind = \"sphere\"\ncentre_mm = [-22, 17, 22]\nradius_mm = 8\n",
    "kind = \"polygon\"\ncorners_mm = [[15, -9, 18], [28, 12, 18], [12, 14, 30]]\n",
];

#[test]
fn shadows_are_as_deep_as_rays_find_in_every_penumbra() {
    let mut in_between = 0;
    for (i, of) in LAMPS[..3].iter().enumerate() {
        let open = Both::new(read(&format!("{PANEL}{}", lamp(*of))), &[], exact_rig());
        for body in [BODIES[i], BODIES[i + 1]] {
            let text = format!("{PANEL}{}[[occluder]]\n{body}", lamp(*of));
            let both = Both::new(read(&text), &[], exact_rig());
            for (x, y) in [(0.0, 0.0), (8.0, -3.0), (-9.0, 4.0), (-2.0, 9.0), (5.0, 6.0)] {
                let at = axis(x, y, 0.0, 0.0);
                let (found, mean) = both.along(&at, PATHS / 2);
                let unshaded = open.along(&at, 1).0;
                let what = format!("{} behind {body}at {x} {y}", of.0);
                agree(&what, (found, mean), unshaded, 1e-6, 4e-3);
                in_between += u32::from((0.02..0.98).contains(&(found / unshaded)));
            }
        }
    }
    assert!(in_between > 8, "only {in_between} places lie in a penumbra");
}

#[test]
fn the_beam_sees_the_shadow_and_what_casts_it() {
    let lamp = lamp(LAMPS[1]);
    let text = format!("{PANEL}{lamp}[[occluder]]\n{}", BODIES[2]);
    let both = Both::new(read(&text), &[], exact_rig());
    for (x, y, theta, phi) in
        [(0.0, 0.0, 0.0, 0.0), (-2.0, 3.0, 43.0, 145.0), (9.0, 0.0, 55.0, 150.0)]
    {
        let at = axis(x, y, theta, phi);
        let what = format!("at {x} {y}, {theta}°");
        agree(&what, both.seen(&at, RAYS), 0.5, both.stated(), 4e-3);
    }
}

/// Above the detector, so that their shadows alone are seen.
#[test]
fn the_beam_averages_a_penumbra_from_the_umbra_to_the_light() {
    let lamp = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [0, 0, 1000]\nradius_mm = 12\n\
                radiance_w_per_m2_sr = 5000\n";
    for body in [
        "kind = \"half-plane\"\nx_max_mm = 0\nz_mm = 500\n",
        "kind = \"disk\"\ncentre_mm = [4, 0, 400]\naxis = [0, 0.3, 1]\nradius_mm = 9\n",
        "kind = \"sphere\"\ncentre_mm = [0, 0, 400]\nradius_mm = 2\n",
    ] {
        let text = format!("{PANEL}{lamp}[[occluder]]\n{body}");
        let both = Both::new(read(&text), &[], exact_rig());
        let row = both.compiled.effects().iter().find(|row| row.name == "finite-beam").unwrap();
        assert!(row.how.contains("table"), "{row:?}");
        for (x, y, theta, phi) in [
            (-9.0, 2.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0),
            (9.0, -4.0, 60.0, 10.0),
            (3.0, 9.0, 72.0, 90.0),
        ] {
            let at = axis(x, y, theta, phi);
            let what = format!("{body}at {x} {y}, {theta}°");
            agree(&what, both.seen(&at, RAYS), 0.6, both.stated(), 4e-3);
        }
    }
}

#[test]
fn a_wide_sun_has_penumbras_and_passes_glass() {
    let sun = |half_angle_deg: f64| {
        let towards = DVec3::new(0.6, 0.2, 1.0).normalize();
        let half_angle_rad = half_angle_deg.to_radians();
        Lamp::new(LampSource::Distant { towards, half_angle_rad }, 100.0)
    };
    let off = "[[lamp]]\nkind = \"sun\"\ntheta_deg = 0\nphi_deg = 0\nirradiance_w_per_m2 = 0\n";
    let mut scene = read(&format!("{PANEL}{off}[[occluder]]\n{}", BODIES[1]));
    scene.add_lamp(sun(5.0)).unwrap();
    let both = Both::new(scene, &[], exact_rig());
    for (x, y) in [(0.0, 0.0), (5.0, -3.0), (-2.0, -4.0), (9.0, 2.0)] {
        let (found, mean) = both.along(&axis(x, y, 0.0, 0.0), PATHS);
        agree(&format!("at {x} {y}"), (found, mean), 0.5, 1e-6, 4e-3);
    }
}

#[test]
fn a_window_passes_the_sun_and_throws_back_what_leaves_the_panel() {
    let text = format!(
        "{PANEL}{}[[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 3\n\
         x_mm = [52, 80]\ny_mm = [-40, 40]\n\
         [[window]]\nz_mm = 20\nthickness_mm = 3\nindex = 1.52\nabsorption_per_mm = 0.01\n\
         belongs_to = \"sample\"\n",
        lamp(LAMPS[3])
    );
    let both = Both::new(read(&text), &[], exact_rig());
    let row = both.compiled.effects().iter().find(|row| row.name == "window[0]").unwrap();
    let stated = row.error.unwrap_or(0.0).max(1e-5);
    for (x, y, theta, phi) in POSES {
        let at = axis(x, y, theta, phi);
        let (found, mean) = both.seen(&at, 4 * RAYS);
        agree(&format!("{x} {y} {theta}°"), (found, mean), found, stated.max(both.stated()), 3e-3);
    }
}
