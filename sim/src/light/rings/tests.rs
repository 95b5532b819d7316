//! Rings against closed forms, where there are some.

use core::f64::consts::PI;

use radiometry::projected::{self, Receiver};
use radiometry::shape::{Disk, Polygon, Sphere};

use super::*;
use crate::scene::{Image, Solid, Window, WindowOwner};

fn solids() -> [Solid; 3] {
    let corners = [[-0.4, -0.3, 0.8], [0.3, -0.2, 0.9], [-0.1, 0.5, 0.85]];
    let corners = corners.map(DVec3::from_array).to_vec();
    let (centre, axis) = (DVec3::new(-0.2, 0.1, 0.7), DVec3::new(0.4, 0.1, -1.0));
    [
        Solid::Polygon(Polygon::new(corners).unwrap()),
        Solid::Disk(Disk::new(centre, axis, 0.3).unwrap()),
        Solid::Sphere(Sphere::new(centre, 0.25).unwrap()),
    ]
}

fn plate(index: f64) -> Plate {
    let (thickness_m, absorption_per_m, belongs_to) = (0.05, 0.0, WindowOwner::Sample);
    let z_m = 0.2;
    Plate::new(&Window { z_m, thickness_m, index, absorption_per_m, belongs_to }).unwrap()
}

fn rings<'r>(
    (place, normal): (DVec3, DVec3),
    shines: Shines<'r>,
    plates: &'r [Plate],
    before: &'r [(&'r Sight, usize)],
) -> f64 {
    let passes = &|_| 1.0;
    Rings { place, normal, plates, shines, before, passes, is_fine: false }.sum()
}

#[test]
fn without_a_window_a_ring_after_the_other_gives_the_closed_forms() {
    for normal in [DVec3::Z, DVec3::new(0.5, -0.3, 0.6).normalize()] {
        let place = DVec3::new(0.1, -0.05, 0.0);
        let receiver = Receiver::new(place, normal).unwrap();
        for solid in solids() {
            let expected = match &solid {
                Solid::Disk(disk) => projected::disk(&receiver, disk),
                Solid::Polygon(polygon) => projected::polygon(&receiver, polygon),
                Solid::Sphere(ball) => projected::sphere(&receiver, ball),
                Solid::HalfPlane(_) => unreachable!(),
            };
            let expected = expected.unwrap().sr();
            let sight = Sight::Body(solid);
            let shines = || Shines::Body(&sight, 0);
            let found = rings((place, normal), shines(), &[], &[]);
            assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        }
    }
}

#[test]
fn a_body_before_hides_what_it_hides_and_a_sky_is_seen_all_round() {
    let place = DVec3::new(0.05, 0.1, 0.0);
    let ball = Sight::Body(Solid::Sphere(Sphere::new(DVec3::new(0.0, 0.1, 0.4), 0.1).unwrap()));
    let map = Surrounding::new(&Image::new(3, vec![4.0, 1.0, 0.0, 9.0, 2.0, 5.0]).unwrap());
    let gloss = crate::light::gloss::Gloss::of_all_that_arrives();
    for normal in [DVec3::Z, DVec3::new(0.2, -0.3, 0.9).normalize()] {
        // Of a leaning surface the sky below the plane is not asked for.
        let found = rings((place, normal), Shines::Sky(&map), &[], &[(&ball, 0)]);
        if normal == DVec3::Z {
            let lobe = gloss.lobe(place, normal, normal);
            let before = std::slice::from_ref(&ball);
            let seen = lobe.of_surrounding(&map, before, crate::light::gloss::Counts::Seen);
            assert!((found / (PI * seen) - 1.0).abs() < 1e-6, "{found} {}", PI * seen);
        }
        for solid in solids() {
            let lamp = Sight::Body(solid);
            let shines = || Shines::Body(&lamp, 0);
            let found = rings((place, normal), shines(), &[], &[(&ball, 0)]);
            let lobe = gloss.lobe(place, normal, normal);
            let seen = PI * lobe.radiance(&lamp, std::slice::from_ref(&ball));
            assert!((found / seen - 1.0).abs() < 1e-5, "{found} {seen}");
        }
    }
}

#[test]
fn a_plate_that_refracts_nothing_changes_nothing_and_one_that_does_brings_the_lamp_nearer() {
    let place = DVec3::new(0.1, -0.05, 0.0);
    for solid in solids() {
        let sight = Sight::Body(solid);
        let of = |plates: &[Plate]| {
            let shines = Shines::Body(&sight, plates.len());
            rings((place, DVec3::Z), shines, plates, &[])
        };
        let (open, thin, glass) = (of(&[]), of(&[plate(1.0)]), of(&[plate(1.5)]));
        assert!((open / thin - 1.0).abs() < 1e-9, "{open} {thin}");
        // From 17 mm nearer by, d (1 - 1/n), if all went straight up.
        assert!(glass > 1.01 * open && glass < 1.15 * open, "{open} {glass}");
    }
}
