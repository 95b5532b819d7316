//! The finite beam over every law and over outlines; bodies, lamps and windows in it.

use core::f64::consts::TAU;

use glam::DVec3;
use sim::{Batwing, Body, Emitter, Law, Lobe, Lobes, Quantity, Scene, Shape, Tabulated};

use crate::bench::exact_rig;
use crate::{Both, MM, agree, axis, read};

const RAYS: u32 = 40_000;

fn of(emitter: Emitter) -> Scene {
    Scene::new(Quantity::Radiance).with(emitter).unwrap()
}

fn square(side_mm: f64) -> Shape {
    Shape::rectangle(0.0, 0.0, side_mm * MM, side_mm * MM)
}

/// Inside of an outline, across its sides and its corners, level and slanting.
const POSES: [(f64, f64, f64, f64); 7] = [
    (0.0, 0.0, 0.0, 0.0),
    (2.0, -1.0, 40.0, 100.0),
    (10.0, 3.0, 0.0, 0.0),
    (9.5, 10.0, 35.0, 20.0),
    (8.0, -1.0, 70.0, 170.0),
    (-9.0, 2.0, 55.0, -90.0),
    (11.0, 0.0, 20.0, 0.0),
];

fn over_poses(what: &str, both: &Both, peak: f64) {
    for (x, y, theta, phi) in POSES {
        let at = axis(x, y, theta, phi);
        let what = format!("{what} at {x} {y} mm, {theta}° {phi}°");
        agree(&what, both.seen(&at, RAYS), peak, both.stated(), 3e-3);
    }
}

fn lobes(into: DVec3) -> f64 {
    let lobe = |axis: DVec3, n: f64, weight: f64| weight * axis.dot(into).max(0.0).powf(n);
    0.1 + lobe(LEANING, 60.0, 1.0) + lobe(DVec3::Z, 8.0, 0.5)
}

const LEANING: DVec3 = DVec3::new(0.5, 0.0, 0.866_025_403_784_438_6);

/// Half its peak on the normal; the ring at 40°, m = 3.
fn batwing(into: DVec3) -> f64 {
    let wing = |theta: f64| {
        let peak = 40f64.to_radians();
        let k = 6.0 / peak.tan().powi(2);
        theta.sin().powi(6) * theta.cos().powf(k)
    };
    0.25 + 0.75 * wing(into.z.acos()) / wing(40f64.to_radians())
}

/// What the table holds at its nodes, every 30° of C and 10° of γ.
fn node(c_deg: f64, gamma_deg: f64) -> f64 {
    (1.0 + (gamma_deg / 90.0) * (1.0 + (c_deg - 70.0).to_radians().cos()))
        * (1.0 - gamma_deg / 90.0)
}

fn table(into: DVec3) -> f64 {
    let gamma = into.z.acos().to_degrees() / 10.0;
    let c = (-into.y.atan2(into.x)).rem_euclid(TAU).to_degrees() / 30.0;
    let (g, p) = (gamma.floor(), c.floor());
    let plane = |p: f64| {
        let at = |g: f64| node(30.0 * p, 10.0 * g);
        at(g) + (gamma - g) * (at(g + 1.0) - at(g))
    };
    (plane(p) + (c - p) * (plane(p + 1.0) - plane(p))) / into.z
}

#[test]
fn the_beam_averages_every_law_within_outlines_and_across_them() {
    let rig = exact_rig;
    let even = of(Emitter::lambertian(square(20.0), 10.0));
    over_poses("lambertian", &Both::new(even, &[], rig()), 10.0);
    let disk = of(Emitter::lambertian(Shape::disk(0.0, 0.0, 10.0 * MM), 10.0));
    over_poses("disk", &Both::new(disk, &[], rig()), 10.0);
    let cosine = of(Emitter::cosine_power(square(20.0), 50.0, 10.0));
    over_poses("cos^50", &Both::new(cosine, &[], rig()), 10.0);
    let two = vec![
        Lobe { axis: LEANING, exponent: 60.0, weight: 1.0 },
        Lobe { axis: DVec3::Z, exponent: 8.0, weight: 0.5 },
    ];
    let leaning = of(Emitter::lobes(square(20.0), Lobes::new(0.1, two).unwrap(), 10.0));
    over_poses("lobes", &Both::new(leaning, &[lobes], rig()), 10.0);
    let ring = Batwing::new(40f64.to_radians(), 0.25, 3).unwrap();
    let ring = of(Emitter::batwing(square(20.0), ring, 10.0));
    over_poses("batwing", &Both::new(ring, &[batwing], rig()), 10.0);
    let c: Vec<f64> = (0..=12).map(|i| 30.0 * f64::from(i)).collect();
    let gamma: Vec<f64> = (0..=9).map(|i| 10.0 * f64::from(i)).collect();
    let law = Law::Tabulated(Tabulated::new(&c, &gamma, node).unwrap());
    let filed = of(Emitter::new(Body::Flat(square(20.0)), law, 10.0));
    over_poses("table", &Both::new(filed, &[table], rig()), 20.0);
}

#[test]
fn the_beam_averages_polygons_images_and_bodies_above_the_plane() {
    let concave = read(
        "[[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 10\n\
         corners_mm = [[-10, -10], [11, -9], [9, 10], [1, 2], [-10, 10]]\n",
    );
    over_poses("concave polygon", &Both::new(concave, &[], exact_rig()), 10.0);
    let image = read(
        "[[emitter]]\nkind = \"image\"\nfile = \"image.pgm\"\nx_mm = [-10, 11]\ny_mm = [-9, 10]\n\
         radiance_w_per_m2_sr = 10\n",
    );
    over_poses("image", &Both::new(image, &[], exact_rig()), 10.0);
    let raised = read(
        "[[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 10\n\
         centre_mm = [0, 0, 8]\nradius_mm = 7\n\
         [[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 4\n\
         x_mm = [-20, 20]\ny_mm = [-20, 20]\n",
    );
    over_poses("ball over a square", &Both::new(raised, &[], exact_rig()), 10.0);
}

const PATCH: &str = "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-40, 40]\ny_mm = [-40, 40]\n\
                     radiance_w_per_m2_sr = 7\n";

#[test]
fn what_stands_in_the_beam_takes_its_part_of_it() {
    for body in [
        "kind = \"sphere\"\ncentre_mm = [3, 0, 100]\nradius_mm = 2\n",
        "kind = \"disk\"\ncentre_mm = [0, 3, 60]\naxis = [0.2, 0.1, 1]\nradius_mm = 3\n",
        "kind = \"half-plane\"\nx_max_mm = 0.5\nz_mm = 80\n",
        "kind = \"polygon\"\ncorners_mm = [[-2, -2, 50], [3, -2, 50], [0, 4, 55]]\n",
    ] {
        let both = Both::new(read(&format!("{PATCH}[[occluder]]\n{body}")), &[], exact_rig());
        for (x, y, theta, phi) in [
            (0.0, 0.0, 0.0, 0.0),
            (2.0, 1.0, 0.0, 0.0),
            (0.0, 0.0, 3.0, 90.0),
            (1.0, 2.0, 3.0, 0.0),
        ] {
            let at = axis(x, y, theta, phi);
            agree(
                &format!("{body}at {x} {y}, {theta}° {phi}°"),
                both.seen(&at, RAYS),
                7.0,
                both.stated(),
                3e-3,
            );
        }
    }
    let lamp = "[[lamp]]\nkind = \"disk\"\ncentre_mm = [3, 0, 100]\naxis = [0, 0, 1]\n\
                radius_mm = 3\nradiance_w_per_m2_sr = 20\n";
    let both = Both::new(read(&format!("{PATCH}{lamp}")), &[], exact_rig());
    agree(
        "lamp in the beam",
        both.seen(&axis(0.0, 0.0, 0.0, 0.0), RAYS),
        20.0,
        both.stated(),
        3e-3,
    );
}

#[test]
fn a_window_passes_and_shifts_what_photons_do() {
    let two = "[[emitter]]\nkind = \"cosine-power\"\nexponent = 3\nx_mm = [-40, 0]\n\
               y_mm = [-40, 40]\nradiance_w_per_m2_sr = 7\n\
               [[emitter]]\nkind = \"lambertian\"\nx_mm = [0, 40]\ny_mm = [-40, 40]\n\
               radiance_w_per_m2_sr = 5\n";
    for owner in ["sample", "beam"] {
        let window = |index: f64| {
            format!(
                "[[window]]\nz_mm = 12\nthickness_mm = 4\nindex = {index}\n\
                 absorption_per_mm = 0.03\nbelongs_to = \"{owner}\"\n"
            )
        };
        // Inside of one patch: all reflections inside the plate count.
        let both = Both::new(read(&format!("{two}{}", window(1.52))), &[], exact_rig());
        for (theta, phi) in [(0.0, 0.0), (45.0, 10.0), (70.0, -60.0)] {
            for x in [-22.0, 24.0] {
                let at = axis(x, 0.0, theta, phi);
                agree(
                    &format!("{owner} {x} {theta}°"),
                    both.seen(&at, RAYS),
                    7.0,
                    both.stated(),
                    3e-3,
                );
            }
        }
        // Across the border of two: where the shift is. A ghost image of the border, from two
        // reflections inside, would stand elsewhere: an index of 1.1 has next to none.
        let both = Both::new(read(&format!("{two}{}", window(1.1))), &[], exact_rig());
        for (x, theta, phi) in [(0.0, 0.0, 0.0), (-0.5, 45.0, 0.0), (0.4, 65.0, 180.0)] {
            let at = axis(x, 0.0, theta, phi);
            agree(
                &format!("{owner}, border {theta}°"),
                both.seen(&at, RAYS),
                7.0,
                both.stated(),
                3e-3,
            );
        }
    }
}
