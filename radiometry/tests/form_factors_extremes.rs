//! Whatever the size of its arguments, a form factor is a number in [0, 1] or an error, and soon.

use glam::DVec3;
use radiometry::form_factor::{aligned_rectangles, parallel_rectangles, polygons};
use radiometry::shape::Polygon;
use radiometry::{EstimateError, Tolerance};

const SIZES: [f64; 11] =
    [0.0, -0.0, f64::MIN_POSITIVE, 5e-324, 1e-308, 1e-160, 1e-150, 1e150, 1e160, 1e308, f64::MAX];

#[test]
fn rectangles_keep_their_digits_down_to_36_powers_of_ten_and_are_refused_below() {
    let unit = [0.0, 1.0];
    let far = |width: f64| aligned_rectangles([0.0, width], unit, [1000.0, 1001.0], unit, 1.0);
    // Reciprocity: what the unit sees of a strip that ends a thousand beside it and nowhere else: √2 - 1
    // less what passes the end.
    let all = far(1e6).unwrap().ratio() * 1e6;
    assert!((all - (2.0_f64.sqrt() - 1.0)).abs() < 1e-9, "{all}");
    for exponent in [8, 11, 12, 13, 14, 16, 20, 30, 35] {
        let width = 10_f64.powi(exponent);
        let found = far(width).unwrap().ratio() * width;
        assert!((found / all - 1.0).abs() < 2e-12, "1e{exponent}: {found}, {all}");
    }
    for exponent in [40, 100, 155, 160, 200, 300] {
        let refused = far(10_f64.powi(exponent)).unwrap_err();
        assert!(refused.to_string().contains("no digits"), "1e{exponent}: {refused}");
    }
    // Where the closed form holds, no size is refused.
    let touching = parallel_rectangles(1.0, 1.0, 1e-300).unwrap().ratio();
    assert!((touching - 1.0).abs() < 4e-16, "{touching}");
    for exponent in [100, 155, 160, 300] {
        let strip = parallel_rectangles(10_f64.powi(exponent), 1.0, 1.0).unwrap().ratio();
        assert!((strip - (2.0_f64.sqrt() - 1.0)).abs() < 4e-13, "1e{exponent}: {strip}");
    }
}

#[test]
fn polygons_of_any_size_give_a_number_or_a_sentence() {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let wall = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]];
    let lid = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 0.0, 1.0]];
    let polygon = |corners: [[f64; 3]; 4]| Polygon::new(corners.map(DVec3::from_array).to_vec());
    let mut answered = 0;
    for other in [wall, lid] {
        for axis in 0..3 {
            for size in SIZES.into_iter().flat_map(|size| [size, -size]) {
                let stretched = other.map(|mut corner| {
                    corner[axis] *= size;
                    corner
                });
                let shifted = other.map(|mut corner| {
                    corner[axis] += size;
                    corner
                });
                let scaled = other.map(|corner| corner.map(|x| x * size));
                for spoiled in [stretched, shifted, scaled] {
                    let (Ok(from), Ok(to)) = (polygon(floor), polygon(spoiled)) else { continue };
                    for found in [
                        polygons(&from, &to, Tolerance::default()),
                        polygons(&to, &from, Tolerance::default()),
                    ] {
                        match found {
                            Ok(found) => {
                                answered += 1;
                                assert!((0.0..=1.0).contains(&found.value), "{size:e}: {found:?}");
                            }
                            Err(EstimateError::Unmet { estimate, .. }) => {
                                assert!(estimate.error_bound.is_finite(), "{size:e}: {estimate:?}");
                            }
                            Err(error) => assert!(!error.to_string().is_empty()),
                        }
                    }
                }
            }
        }
    }
    assert!(answered > 100, "{answered}");
}
