//! The luminous opening: what the signs of its three dimensions mean in each edition, and the
//! outline of a flat one. It doesn't know the intensities.

use std::f64::consts::PI;
use std::fmt;

use super::label::Version;

/// The shape of what shines, metres. Length lies along C0-C180, width along C90-C270, height along
/// the photometric zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Opening {
    /// A flat disk.
    Circle {
        /// Diameter.
        diameter_m: f64,
    },
    /// A box whose sides shine too.
    Cuboid {
        /// Along C0-C180.
        length_m: f64,
        /// Along C90-C270.
        width_m: f64,
        /// Along the vertical.
        height_m: f64,
    },
    /// A flat ellipse.
    Ellipse {
        /// Along C0-C180.
        length_m: f64,
        /// Along C90-C270.
        width_m: f64,
    },
    /// An ellipsoid with three different axes.
    Ellipsoid {
        /// Along C0-C180.
        length_m: f64,
        /// Along C90-C270.
        width_m: f64,
        /// Along the vertical.
        height_m: f64,
    },
    /// A lying cylinder, its axis along C0-C180.
    HorizontalCylinderAlongC0 {
        /// Of the axis.
        length_m: f64,
        /// Across, horizontally.
        width_m: f64,
        /// Across, vertically.
        height_m: f64,
    },
    /// A lying cylinder, its axis along C90-C270.
    HorizontalCylinderAlongC90 {
        /// Across, horizontally.
        length_m: f64,
        /// Of the axis.
        width_m: f64,
        /// Across, vertically.
        height_m: f64,
    },
    /// No size.
    Point,
    /// A flat rectangle.
    Rectangle {
        /// Along C0-C180.
        length_m: f64,
        /// Along C90-C270.
        width_m: f64,
    },
    /// A ball.
    Sphere {
        /// Diameter.
        diameter_m: f64,
    },
    /// Dimensions whose signs stand in none of the edition's shapes.
    Unlisted {
        /// As in the file, metres.
        length_m: f64,
        /// As in the file, metres.
        width_m: f64,
        /// As in the file, metres.
        height_m: f64,
    },
    /// A standing cylinder, circular or elliptical, whose side shines too.
    VerticalCylinder {
        /// Along C0-C180.
        length_m: f64,
        /// Along C90-C270.
        width_m: f64,
        /// Along the vertical.
        height_m: f64,
    },
    /// A flat, upright ellipse or circle that faces C = 0.
    VerticalEllipse {
        /// Along C90-C270.
        width_m: f64,
        /// Along the vertical.
        height_m: f64,
    },
}

/// The outline of a flat, horizontal opening: full extents, metres, along +x = C0 and along the
/// horizontal across it (±y = C90-C270).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outline {
    /// Also a circle: both extents are its diameter.
    Ellipse {
        /// Along C0-C180.
        x_m: f64,
        /// Along C90-C270.
        y_m: f64,
    },
    /// Sides parallel to the axes.
    Rectangle {
        /// Along C0-C180.
        x_m: f64,
        /// Along C90-C270.
        y_m: f64,
    },
}

/// An opening that has no flat, horizontal outline, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutlineError {
    /// What the opening is instead.
    pub opening: &'static str,
}

impl Opening {
    /// What the shape is called in messages.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Circle { .. } => "a circle",
            Self::Cuboid { .. } => "a rectangle with luminous sides",
            Self::Ellipse { .. } => "an ellipse",
            Self::Ellipsoid { .. } => "an ellipsoid",
            Self::HorizontalCylinderAlongC0 { .. } => "a horizontal cylinder along C0-C180",
            Self::HorizontalCylinderAlongC90 { .. } => "a horizontal cylinder along C90-C270",
            Self::Point => "a point without extent",
            Self::Rectangle { .. } => "a rectangle",
            Self::Sphere { .. } => "a sphere",
            Self::Unlisted { .. } => "none of the standard's shapes",
            Self::VerticalCylinder { .. } => "a vertical cylinder",
            Self::VerticalEllipse { .. } => "an upright circle or ellipse",
        }
    }

    /// The outline of a flat, horizontal opening: length to x, width to y. An error, by name, for
    /// all others.
    pub fn outline(&self) -> Result<Outline, OutlineError> {
        match *self {
            Self::Circle { diameter_m } => {
                Ok(Outline::Ellipse { x_m: diameter_m, y_m: diameter_m })
            }
            Self::Ellipse { length_m, width_m } => {
                Ok(Outline::Ellipse { x_m: length_m, y_m: width_m })
            }
            Self::Rectangle { length_m, width_m } => {
                Ok(Outline::Rectangle { x_m: length_m, y_m: width_m })
            }
            _ => Err(OutlineError { opening: self.name() }),
        }
    }

    /// The area as seen from the direction (C, γ), degrees, of a flat opening: A cos γ below the
    /// horizon and 0 from it on, whatever C; for an upright one that faces C = 0, A sin γ cos C. An
    /// error, by name, for a point, a body and an unlisted shape.
    pub fn projected_area_m2(&self, c_deg: f64, gamma_deg: f64) -> Result<f64, OutlineError> {
        let (sin_gamma, cos_gamma) = libm::sincos(gamma_deg.to_radians());
        if let Self::VerticalEllipse { width_m, height_m } = *self {
            let facing = sin_gamma * libm::cos(c_deg.to_radians());
            return Ok(PI / 4.0 * width_m * height_m * facing.max(0.0));
        }
        let area = self.outline()?.area_m2();
        // The double nearest 90° has a cosine of 6e-17.
        Ok(if gamma_deg.abs() < 90.0 { area * cos_gamma } else { 0.0 })
    }
}

impl Outline {
    /// Its area, m².
    pub fn area_m2(&self) -> f64 {
        match *self {
            Self::Ellipse { x_m, y_m } => PI / 4.0 * x_m * y_m,
            Self::Rectangle { x_m, y_m } => x_m * y_m,
        }
    }
}

impl fmt::Display for OutlineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "expected a flat, horizontal luminous opening, found {}", self.opening)
    }
}

impl std::error::Error for OutlineError {}

/// The dimensions as they stand in a file, metres, in its order.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_field_names, reason = "the unit stands last in the name")]
pub(super) struct Dimensions {
    pub(super) width_m: f64,
    pub(super) length_m: f64,
    pub(super) height_m: f64,
}

impl Dimensions {
    /// The shape that the edition's table gives to these signs. A negative dimension is a rounded
    /// one, and the tables differ in which of a round shape's dimensions are written out.
    pub(super) fn opening(self, version: Version) -> Opening {
        let signs = [sign(self.width_m), sign(self.length_m), sign(self.height_m)];
        let (width_m, length_m) = (self.width_m.abs(), self.length_m.abs());
        let height_m = self.height_m.abs();
        match signs {
            [0, 0, 0] => Opening::Point,
            [1, 1, 0] => Opening::Rectangle { length_m, width_m },
            [1, 1, 1] => Opening::Cuboid { length_m, width_m, height_m },
            _ if version >= Version::Lm63In2002 => self.opening_since_2002(signs),
            [-1, 0, 0] => Opening::Circle { diameter_m: width_m },
            [-1, 0, 1] => Opening::VerticalCylinder { length_m: width_m, width_m, height_m },
            [-1, 1, 0] => Opening::Ellipse { length_m, width_m },
            _ if version >= Version::Lm63In1995 => self.opening_in_1995(signs),
            [-1, 1, 1] => Opening::Ellipsoid { length_m, width_m, height_m },
            _ => self.unlisted(),
        }
    }

    /// LM-63-2002, table 1: circular where two rounded dimensions are equal.
    #[expect(clippy::float_cmp, reason = "one number written twice")]
    fn opening_since_2002(self, signs: [i8; 3]) -> Opening {
        let (width_m, length_m) = (self.width_m.abs(), self.length_m.abs());
        let height_m = self.height_m.abs();
        let round = width_m == length_m;
        match signs {
            [-1, -1, 0] if round => Opening::Circle { diameter_m: width_m },
            [-1, -1, 0] => Opening::Ellipse { length_m, width_m },
            [-1, -1, 1] => Opening::VerticalCylinder { length_m, width_m, height_m },
            [-1, -1, -1] if round && width_m == height_m => Opening::Sphere { diameter_m: width_m },
            [-1, -1, -1] => Opening::Ellipsoid { length_m, width_m, height_m },
            [-1, 1, -1] => Opening::HorizontalCylinderAlongC0 { length_m, width_m, height_m },
            [1, -1, -1] => Opening::HorizontalCylinderAlongC90 { length_m, width_m, height_m },
            [-1, 0, -1] => Opening::VerticalEllipse { width_m, height_m },
            _ => self.unlisted(),
        }
    }

    /// LM-63-1995: what it has beyond the older editions.
    #[expect(clippy::float_cmp, reason = "one number written twice")]
    fn opening_in_1995(self, signs: [i8; 3]) -> Opening {
        let (width_m, length_m) = (self.width_m.abs(), self.length_m.abs());
        let height_m = self.height_m.abs();
        match signs {
            [-1, 0, -1] if width_m == height_m => Opening::Sphere { diameter_m: width_m },
            [0, 1, -1] => {
                Opening::HorizontalCylinderAlongC0 { length_m, width_m: height_m, height_m }
            }
            [1, 0, -1] => {
                Opening::HorizontalCylinderAlongC90 { length_m: height_m, width_m, height_m }
            }
            [1, -1, 0] => Opening::Ellipse { length_m, width_m },
            [-1, 1, 1] | [1, -1, 1] => Opening::VerticalCylinder { length_m, width_m, height_m },
            [-1, 1, -1] | [1, -1, -1] => Opening::Ellipsoid { length_m, width_m, height_m },
            _ => self.unlisted(),
        }
    }

    fn unlisted(self) -> Opening {
        Opening::Unlisted {
            length_m: self.length_m,
            width_m: self.width_m,
            height_m: self.height_m,
        }
    }
}

fn sign(dimension: f64) -> i8 {
    i8::from(dimension > 0.0) - i8::from(dimension < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opening(width_m: f64, length_m: f64, height_m: f64, version: Version) -> Opening {
        Dimensions { width_m, length_m, height_m }.opening(version)
    }

    #[test]
    fn length_lies_along_c0_and_width_across_it() {
        let panel = opening(0.045, 0.06, 0.0, Version::Lm63In2002);
        assert_eq!(panel, Opening::Rectangle { length_m: 0.06, width_m: 0.045 });
        assert_eq!(panel.outline(), Ok(Outline::Rectangle { x_m: 0.06, y_m: 0.045 }));
    }

    #[test]
    fn every_shape_of_2002_has_its_signs() {
        let since_2002 = |w, l, h| opening(w, l, h, Version::Lm63In2002);
        let (length_m, width_m, height_m) = (2.0, 1.0, 3.0);
        assert_eq!(since_2002(0.0, 0.0, 0.0), Opening::Point);
        assert_eq!(since_2002(1.0, 2.0, 3.0), Opening::Cuboid { length_m, width_m, height_m });
        assert_eq!(since_2002(-1.0, -1.0, 0.0), Opening::Circle { diameter_m: 1.0 });
        assert_eq!(since_2002(-1.0, -2.0, 0.0), Opening::Ellipse { length_m, width_m });
        assert_eq!(
            since_2002(-1.0, -2.0, 3.0),
            Opening::VerticalCylinder { length_m, width_m, height_m }
        );
        assert_eq!(since_2002(-1.0, -1.0, -1.0), Opening::Sphere { diameter_m: 1.0 });
        assert_eq!(
            since_2002(-1.0, -2.0, -3.0),
            Opening::Ellipsoid { length_m, width_m, height_m }
        );
        assert_eq!(
            since_2002(-1.0, 2.0, -3.0),
            Opening::HorizontalCylinderAlongC0 { length_m, width_m, height_m }
        );
        assert_eq!(
            since_2002(1.0, -2.0, -3.0),
            Opening::HorizontalCylinderAlongC90 { length_m, width_m, height_m }
        );
        assert_eq!(since_2002(-1.0, 0.0, -3.0), Opening::VerticalEllipse { width_m, height_m });
    }

    #[test]
    fn one_set_of_signs_means_different_shapes_in_different_editions() {
        let (length_m, width_m, height_m) = (2.0, 1.0, 3.0);
        assert_eq!(
            opening(-1.0, 2.0, -3.0, Version::Lm63In1995),
            Opening::Ellipsoid { length_m, width_m, height_m }
        );
        assert_eq!(
            opening(-1.0, 0.0, 0.0, Version::Lm63In1991),
            Opening::Circle { diameter_m: 1.0 }
        );
        let now = opening(-1.0, 0.0, 0.0, Version::Lm63In2019);
        assert_eq!(now.name(), "none of the standard's shapes");
        assert_eq!(
            now.outline().unwrap_err().to_string(),
            "expected a flat, horizontal luminous opening, found none of the standard's shapes"
        );
    }

    #[test]
    fn a_flat_opening_is_seen_foreshortened_and_never_from_behind() {
        let panel = Opening::Rectangle { length_m: 2.0, width_m: 3.0 };
        assert_eq!(panel.projected_area_m2(0.0, 0.0), Ok(6.0));
        assert!((panel.projected_area_m2(77.0, 60.0).unwrap() - 3.0).abs() < 1e-15 * 3.0);
        assert_eq!(panel.projected_area_m2(0.0, 90.0), Ok(0.0));
        assert_eq!(panel.projected_area_m2(0.0, 120.0), Ok(0.0));
        let disk = Opening::Circle { diameter_m: 2.0 };
        assert_eq!(disk.projected_area_m2(0.0, 0.0), Ok(PI));
        let upright = Opening::VerticalEllipse { width_m: 2.0, height_m: 2.0 };
        assert_eq!(upright.projected_area_m2(0.0, 90.0), Ok(PI));
        assert_eq!(upright.projected_area_m2(180.0, 90.0), Ok(0.0));
        assert!(Opening::Sphere { diameter_m: 1.0 }.projected_area_m2(0.0, 0.0).is_err());
    }
}
