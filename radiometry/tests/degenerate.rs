//! Sizes of zero have a meaning: nothing, or the limit from above. Each is held against a size so small
//! that the difference cannot matter.

use std::f64::consts::PI;

use glam::DVec3;
use radiometry::Tolerance;
use radiometry::convex::{ConvexBody, surface_area};
use radiometry::form_factor::{
    aligned_rectangles, coaxial_disks, concentric_spheres, parallel_cylinders, parallel_disks,
    parallel_rectangles, perpendicular_offset_rectangles, perpendicular_rectangles, polygons,
    sphere_disk, spheres, throughput_of_polygons, wedge_rectangles,
};
use radiometry::ray::Ray;
use radiometry::shape::Polygon;
use radiometry::throughput;

const FINE: Tolerance = Tolerance::FINE;
const TINY: f64 = 1e-9;

/// The value at zero is the one next to it, but for what the tiny size itself makes of it.
fn continues(what: &str, f: impl Fn(f64) -> f64) {
    let (at_zero, next) = (f(0.0), f(TINY));
    let difference = (at_zero - next).abs();
    assert!(difference <= 4.0 * TINY, "{what}: {at_zero:e} at 0, {next:e} at {TINY:e}");
}

#[test]
fn a_form_factor_at_size_zero_is_the_limit() {
    continues("disk 1", |r| coaxial_disks(r, 2.0, 1.0).unwrap().ratio());
    continues("disk 2", |r| coaxial_disks(2.0, r, 1.0).unwrap().ratio());
    for offset in [0.0, 0.5, 3.0] {
        let disks = |r1, r2| parallel_disks(r1, r2, 1.5, offset, FINE).unwrap().value;
        continues("offset disk 1", |r| disks(r, 2.0));
        continues("offset disk 2", |r| disks(2.0, r));
    }
    continues("sphere to disk", |r| sphere_disk(r, 2.0, 1.0).unwrap().ratio());
    continues("disk from sphere", |r| sphere_disk(1.0, 2.0, r).unwrap().ratio());
    continues("inner sphere", |r| concentric_spheres(r, 2.0).unwrap().ratio());
    continues("sphere 1", |r| spheres(r, 1.0, 4.0, FINE).unwrap().value);
    continues("sphere 2", |r| spheres(1.0, r, 4.0, FINE).unwrap().value);
    continues("cylinders", |r| parallel_cylinders(r, 3.0).unwrap().ratio());
    continues("strips a", |a| parallel_rectangles(a, 1.0, 1.0).unwrap().ratio());
    continues("wall", |h| perpendicular_rectangles(1.0, h, 1.0).unwrap().ratio() / 1e2);
    continues("wedge to", |b| wedge_rectangles(1.0, b, 2.0, 0.6, FINE).unwrap().value / 1e2);
    // Next to zero these still change by x ln x.
    continues("floor", |w| perpendicular_rectangles(w, 1.0, 1.0).unwrap().ratio() / 1e2);
    continues("wedge from", |a| wedge_rectangles(a, 5.0, 2.0, 0.6, FINE).unwrap().value / 1e2);
    continues("edge", |l| perpendicular_rectangles(1.0, 1.0, l).unwrap().ratio() / 1e2);
    continues("wedge edge", |l| wedge_rectangles(1.0, 5.0, l, 0.6, FINE).unwrap().value / 1e2);
}

#[test]
fn from_a_rectangle_without_a_side_it_is_the_limit() {
    let (x, y, other) = ([0.2, 1.0], [-0.5, 0.3], [0.1, 0.9]);
    let aligned = |x, y| aligned_rectangles(x, y, other, [-0.2, 2.0], 0.7).unwrap().ratio();
    let upright = |x, y| perpendicular_offset_rectangles(x, y, other, [-0.2, 2.0]).unwrap().ratio();
    let thin = |[low, _]: [f64; 2], width| [low, low + width];
    continues("aligned x", |width| aligned(thin(x, width), y));
    continues("aligned y", |width| aligned(x, thin(y, width)));
    continues("aligned x and y", |width| aligned(thin(x, width), thin(y, width)));
    continues("upright x", |width| upright(thin(x, width), y));
    continues("upright y", |width| upright(x, thin(y, width)));
    continues("upright x and y", |width| upright(thin(x, width), thin(y, width)));
    // In the plane of a wall that begins higher nothing of it is seen.
    continues("in the wall's plane", |width| upright([0.0, width], y));
    // A point under one corner: half of the circle's view in either plane, Howell C-11 and B-3.
    let corner = aligned_rectangles([0.0; 2], [0.0; 2], [0.0, 1.0], [0.0, 1.0], 1.0).unwrap();
    let expected = 0.5_f64.sqrt() * 0.5_f64.sqrt().atan() / PI;
    assert!((corner.ratio() / expected - 1.0).abs() < 1e-13, "{corner:?}, {expected}");
    // Receivers without a size.
    continues("to a line", |width| {
        aligned_rectangles(x, y, other, thin(y, width), 0.7).unwrap().ratio()
    });
    continues("to a lintel", |width| {
        perpendicular_offset_rectangles(x, y, thin(other, width), y).unwrap().ratio()
    });
}

#[test]
#[expect(clippy::float_cmp, reason = "the claim is exactness")]
fn at_the_foot_of_a_wall_half_is_seen() {
    let foot =
        |y, eta| perpendicular_offset_rectangles([0.0; 2], y, [0.0, 2.0], eta).unwrap().ratio();
    let wall = [1.0, 3.0];
    for (along, expected) in [
        ([1.5, 2.0], 0.5),
        ([0.0, 4.0], 0.25),
        ([0.0, 2.0], 0.25),
        ([2.0, 4.0], 0.25),
        ([3.0, 4.0], 0.0),
        ([2.0, 2.0], 0.5),
        ([1.0, 1.0], 0.25),
        ([3.0, 3.0], 0.25),
        ([0.5, 0.5], 0.0),
    ] {
        assert_eq!(foot(along, wall), expected, "{along:?}");
        let thin = [along[0], along[1].max(along[0] + 1e-6)];
        let next = perpendicular_offset_rectangles([0.0, 1e-9], thin, [0.0, 2.0], wall).unwrap();
        let expected = if along[0] == along[1] && expected == 0.25 {
            // Beside an end a short line has all or nothing of it.
            foot(thin, wall)
        } else {
            expected
        };
        assert!((next.ratio() - expected).abs() < 1e-2, "{along:?}: {next:?}");
    }
}

#[test]
fn a_polygon_without_an_area_receives_nothing() {
    let triangle = |x: f64| {
        Polygon::new(vec![DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::new(2.0, x, 1.0)]).unwrap()
    };
    let floor = Polygon::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y]).unwrap();
    continues("to a line", |x| polygons(&floor, &triangle(x), FINE).unwrap().value);
    continues("of a line", |x| throughput_of_polygons(&floor, &triangle(x), FINE).unwrap().value);
    // Which way would it look?
    assert!(polygons(&triangle(0.0), &floor, FINE).is_err());
}

#[test]
#[expect(clippy::float_cmp, reason = "the claim is exactness")]
fn what_has_no_size_lets_nothing_through_and_has_no_surface() {
    assert_eq!(throughput::coaxial_disks(0.0, 1.0, 1.0).unwrap().m2_sr(), 0.0);
    assert_eq!(throughput::coaxial_disks(1.0, 0.0, 1.0).unwrap().m2_sr(), 0.0);
    let partials = throughput::CoaxialDisks::new(1.0, 0.0, 1.0).unwrap().partials().unwrap();
    assert_eq!((partials.per_radius_1, partials.per_radius_2), (0.0, 0.0));
    let area = |body| surface_area(body).unwrap().m2();
    assert_eq!(area(ConvexBody::Sphere { radius_m: 0.0 }), 0.0);
    assert_eq!(area(ConvexBody::Box { edges_m: [0.0, 2.0, 3.0] }), 12.0);
    // Both faces of a disk.
    assert_eq!(area(ConvexBody::Cylinder { radius_m: 1.0, height_m: 0.0 }), 2.0 * PI);
    assert_eq!(area(ConvexBody::Cone { radius_m: 1.0, height_m: 0.0 }), 2.0 * PI);
    assert_eq!(area(ConvexBody::Cone { radius_m: 0.0, height_m: 1.0 }), 0.0);
    let flat = area(ConvexBody::Ellipsoid { semi_axes_m: [0.0, 2.0, 3.0] });
    assert!((flat / (12.0 * PI) - 1.0).abs() < 1e-15);
    assert_eq!(area(ConvexBody::Ellipsoid { semi_axes_m: [0.0, 3.0, 0.0] }), 0.0);
    assert_eq!(area(ConvexBody::Ellipsoid { semi_axes_m: [0.0; 3] }), 0.0);
}

#[test]
fn a_cylinder_of_no_radius_is_its_axis() {
    let at = |y| Ray::new(DVec3::new(-1.0, y, 1.0), DVec3::X).unwrap();
    let axis = |ray: Ray| ray.cylinder(DVec3::ZERO, DVec3::new(0.0, 0.0, 2.0), 0.0).unwrap();
    assert_eq!(axis(at(0.0)), Some(1.0));
    assert_eq!(axis(at(1e-100)), None);
}
