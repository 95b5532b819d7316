//! Enclosures of flat faces that stand in each other's way: what leaves a face arrives somewhere, to the
//! tolerance, though every pair was integrated by itself.

use glam::DVec3;
use radiometry::Tolerance;
use radiometry::enclosure::Enclosure;
use radiometry::form_factor::{aligned_rectangles, concentric_spheres};
use radiometry::quantity::{Area, Exitance, FormFactor};
use radiometry::shape::Polygon;

fn face(corners: &[[f64; 3]]) -> Polygon {
    Polygon::new(corners.iter().map(|v| DVec3::from_array(*v)).collect()).unwrap()
}

/// The six faces of a box, floor and ceiling last, seen from within.
fn from_within(low: [f64; 3], high: [f64; 3]) -> Vec<Polygon> {
    let [[a, b, c], [d, e, f]] = [low, high];
    vec![
        face(&[[a, b, c], [a, e, c], [a, e, f], [a, b, f]]),
        face(&[[d, b, c], [d, b, f], [d, e, f], [d, e, c]]),
        face(&[[a, b, c], [a, b, f], [d, b, f], [d, b, c]]),
        face(&[[a, e, c], [d, e, c], [d, e, f], [a, e, f]]),
        face(&[[a, b, c], [d, b, c], [d, e, c], [a, e, c]]),
        face(&[[a, b, f], [a, e, f], [d, e, f], [d, b, f]]),
    ]
}

/// The same seen from without.
fn from_without(low: [f64; 3], high: [f64; 3]) -> Vec<Polygon> {
    let turned = |face: Polygon| Polygon::new(face.vertices().iter().rev().copied().collect());
    from_within(low, high).into_iter().map(|face| turned(face).unwrap()).collect()
}

/// What is left of each row to 1: 0 for a flat face.
fn leaks(enclosure: &Enclosure) -> Vec<f64> {
    (0..enclosure.surfaces()).map(|i| enclosure.form_factor(i, i).unwrap().ratio()).collect()
}

#[test]
fn a_box_that_floats_in_a_room_closes() {
    let mut faces = from_within([0.0, 0.0, 0.0], [4.0, 3.0, 2.5]);
    faces.extend(from_without([1.0, 0.5, 0.7], [2.0, 1.8, 1.9]));
    let enclosure = Enclosure::from_polygons(&faces, Tolerance::from_relative(1e-4).unwrap());
    let enclosure = enclosure.unwrap();
    for (i, leak) in leaks(&enclosure).into_iter().enumerate() {
        assert!(leak < 2e-4, "face {i}: {leak:e}");
    }
    // The box's faces do not see each other, nor the wall behind them.
    for i in 6..12 {
        for j in 6..12 {
            assert!(enclosure.form_factor(i, j).unwrap().ratio() < 2e-4);
        }
    }
    assert_eq!(enclosure.form_factor(6, 1), Some(FormFactor::ZERO));
}

#[test]
fn a_box_that_stands_on_the_floor_closes() {
    let mut faces = from_within([0.0, 0.0, 0.0], [3.0, 3.0, 2.0]);
    // The floor around the box, in one piece with a slit.
    faces[4] = face(&[
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [3.0, 3.0, 0.0],
        [0.0, 3.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [1.0, 2.0, 0.0],
        [2.0, 2.0, 0.0],
        [2.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
    ]);
    let mut on_floor = from_without([1.0, 1.0, 0.0], [2.0, 2.0, 1.2]);
    on_floor.remove(4);
    faces.extend(on_floor);
    let enclosure = Enclosure::from_polygons(&faces, Tolerance::from_relative(1e-4).unwrap());
    for (i, leak) in leaks(&enclosure.unwrap()).into_iter().enumerate() {
        assert!(leak < 2e-4, "face {i}: {leak:e}");
    }
}

#[test]
fn a_room_round_a_corner_closes() {
    // An L of floor and ceiling, six walls.
    let outline = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    let height = 1.5;
    let floor: Vec<[f64; 3]> = outline.iter().map(|v| [v[0], v[1], 0.0]).collect();
    let ceiling: Vec<[f64; 3]> = outline.iter().rev().map(|v| [v[0], v[1], height]).collect();
    let mut faces = vec![face(&floor), face(&ceiling)];
    for i in 0..6 {
        let ([ax, ay], [bx, by]) = (outline[i], outline[(i + 1) % 6]);
        faces.push(face(&[[ax, ay, 0.0], [ax, ay, height], [bx, by, height], [bx, by, 0.0]]));
    }
    let enclosure = Enclosure::from_polygons(&faces, Tolerance::from_relative(1e-6).unwrap());
    let enclosure = enclosure.unwrap();
    for (i, leak) in leaks(&enclosure).into_iter().enumerate() {
        assert!(leak < 2e-6, "face {i}: {leak:e}");
    }
    // Both walls of the inner corner look away from each other.
    assert_eq!(enclosure.form_factor(4, 5), Some(FormFactor::ZERO));
    // The end walls cannot see each other past the corner's edge but along it: less than in the open.
    let open = aligned_rectangles([0.0, 1.0], [0.0, 1.5], [0.0, 1.0], [0.0, 1.5], 3.0).unwrap();
    let straight = enclosure.form_factor(3, 7).unwrap().ratio();
    assert!(straight > 0.0 && straight > open.ratio() / 2.0, "{straight}");
}

/// One photon after another between a ball and the shell about it, which are evenly lit by symmetry.
#[test]
fn photons_between_concentric_spheres_find_the_radiosity() {
    use std::f64::consts::PI;
    const PHOTONS: u32 = 30_000;
    const REFLECTANCE: [f64; 2] = [0.6, 0.8];
    let mut state = 17_u64;
    let mut unit = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 11) as f64 * (-53_f64).exp2()
    };
    for (inner, is_lit) in [(0.4, [true, false]), (0.8, [false, true]), (0.6, [true, true])] {
        let radii: [f64; 2] = [inner, 1.0];
        let areas = radii.map(|r| 4.0 * PI * r * r);
        let emitted = is_lit.map(|lit| if lit { 2.0 } else { 0.0 });
        let flux = [emitted[0] * areas[0], emitted[1] * areas[1]];
        let outward = concentric_spheres(inner, 1.0).unwrap();
        // The shell's factor to the ball is the one that is asked for.
        let enclosure = Enclosure::new(&[areas[1], areas[0]].map(Area::from_m2), |_, _| outward);
        let sources = [emitted[1], emitted[0]].map(Exitance::from_w_per_m2);
        let found = enclosure.unwrap().radiosity(&sources, &[REFLECTANCE[1], REFLECTANCE[0]]);
        let found = found.unwrap();

        let (mut arrived, mut squares) = ([0.0; 2], [0.0; 2]);
        for _ in 0..PHOTONS {
            let mut surface = usize::from(unit() * (flux[0] + flux[1]) >= flux[0]);
            let mut hits = [0.0_f64; 2];
            loop {
                // Lambert's law about the normal; a sphere looks the same from all its places.
                // How near a ray from the shell comes to the middle: the sine of its angle to the normal.
                let nearest = unit().sqrt();
                surface = usize::from(surface == 0 || nearest > inner);
                hits[surface] += 1.0;
                if unit() >= REFLECTANCE[surface] {
                    break;
                }
            }
            for i in 0..2 {
                arrived[i] += hits[i];
                squares[i] += hits[i] * hits[i];
            }
        }
        for (i, irradiance) in [found.irradiance[1], found.irradiance[0]].iter().enumerate() {
            let count = f64::from(PHOTONS);
            let mean = arrived[i] / count;
            let deviation = ((squares[i] / count - mean * mean) / count).sqrt();
            let expected = irradiance.w_per_m2() * areas[i] / (flux[0] + flux[1]);
            assert!(
                (mean - expected).abs() < 5.0 * deviation && deviation < 0.02 * mean,
                "{inner}, surface {i}: {expected} hits a photon, counted {mean} ± {deviation}"
            );
        }
    }
}
