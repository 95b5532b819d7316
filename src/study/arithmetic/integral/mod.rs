//! The same quantities as integrals over their surfaces, for methods that know no closed form: a
//! function on the unit square (a point and a source) or on the unit cube of four dimensions (two
//! surfaces), and the methods that integrate it. It knows neither clock nor picture.

mod method;
mod surface;

use glam::DVec3;
use serde_json::Value;

use super::kernel::Row;
use crate::study::arithmetic::Unmeasured;
pub use method::Method;
use surface::Surface;

/// How the unit square is laid onto a surface: for random points evenly by area, for rules with
/// nodes so that the integrand has derivatives (a disk's radius in proportion, not its square root).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chart {
    /// Each part of the square is as much of the surface.
    Even,
    /// Without a square root's edge.
    Smooth,
}

/// A quantity of a reference case, as an integral.
pub enum Problem {
    /// Of the light that a point receives, over the source.
    Point(Receiving),
    /// Of the light between two surfaces, over both, in units of the first's hemisphere.
    Pair([Surface; 2]),
}

/// A receiver, a source, and perhaps a disk between them.
pub struct Receiving {
    point_m: DVec3,
    normal: DVec3,
    source: Surface,
    occluder: Option<Surface>,
}

impl Problem {
    /// Of a reference case; refused where its quantity has no such form here.
    pub fn of_case(case: &Value) -> Result<Self, Unmeasured> {
        let quantity = case["quantity"].as_str().unwrap_or_default();
        let row = Row::new(&case["inputs"]);
        match quantity {
            "form-factor-coaxial-disks" => {
                let [r1, r2, h] = row.numbers(["r1", "r2", "h"])?;
                let disk =
                    |z_m: f64, radius_m: f64| Surface::disk(z_m * DVec3::Z, DVec3::Z, radius_m);
                Ok(Self::Pair([disk(0.0, r1)?, disk(h, r2)?]))
            }
            "form-factor-parallel-disks" => {
                let [r1, r2, h, offset] = row.numbers(["r1", "r2", "h", "offset"])?;
                let far = DVec3::new(offset, 0.0, h);
                let first = Surface::disk(DVec3::ZERO, DVec3::Z, r1)?;
                Ok(Self::Pair([first, Surface::disk(far, DVec3::Z, r2)?]))
            }
            "form-factor-spheres" => {
                let [r1, r2, d] = row.numbers(["r1", "r2", "d"])?;
                Ok(Self::Pair([Surface::ball(DVec3::ZERO, r1), Surface::ball(d * DVec3::Z, r2)]))
            }
            "form-factor-wedge-rectangles" => {
                let [a, b, l, cos] = row.numbers(["a", "b", "l", "cos_phi"])?;
                let sin = libm::sqrt((1.0 - cos) * (1.0 + cos));
                let along = l * DVec3::Y;
                let flat =
                    |across: DVec3| Surface::polygon(&[DVec3::ZERO, across, across + along, along]);
                let up = b * DVec3::new(cos, 0.0, sin);
                Ok(Self::Pair([flat(a * DVec3::X)?, flat(up)?]))
            }
            "form-factor-polygons" => {
                let flat = |key| Surface::polygon(row.polygon(key)?.vertices());
                Ok(Self::Pair([flat("from")?, flat("to")?]))
            }
            _ => Ok(Self::Point(Receiving::new(quantity, row)?)),
        }
    }

    /// 2 or 4.
    pub fn dimensions(&self) -> usize {
        match self {
            Self::Point(_) => 2,
            Self::Pair(_) => 4,
        }
    }

    /// The integrand at a point of the unit square, for [`Problem::Point`].
    pub fn at_2(&self, at: [f64; 2], chart: Chart) -> f64 {
        match self {
            Self::Point(point) => point.at(at, chart),
            Self::Pair(_) => f64::NAN,
        }
    }

    /// The integrand at a point of the unit cube of four dimensions, for [`Problem::Pair`].
    pub fn at_4(&self, [u, v, s, t]: [f64; 4], chart: Chart) -> f64 {
        let Self::Pair([first, second]) = self else { return f64::NAN };
        let (from, near) = first.at([u, v], chart);
        let (to, far) = second.at([s, t], chart);
        let between = to - from;
        let square = between.length_squared();
        let cosines = first.facing(from, between) * second.facing(to, -between);
        let area = first.area();
        near * far * cosines / (square * square * std::f64::consts::PI * area)
    }
}

impl Receiving {
    fn new(quantity: &str, row: Row<'_>) -> Result<Self, Unmeasured> {
        let (point_m, normal) = (row.vector("point")?, row.vector("normal")?);
        let body = |body: Row<'_>| match body.text("kind") {
            "disk" => Surface::disk(body.vector("center")?, DVec3::Z, body.number("radius")?),
            "polygon" => Surface::polygon(body.polygon("vertices")?.vertices()),
            other => Err(Unmeasured::because(format!("no integral for the body `{other}`"))),
        };
        let (source, occluder) = match quantity {
            "polygon-projected-solid-angle" => {
                (Surface::polygon(row.polygon("vertices")?.vertices())?, None)
            }
            "projected-solid-angle-of-disk" => {
                let (center, axis) = (row.vector("center")?, row.vector("axis")?);
                (Surface::disk(center, axis, row.number("radius")?)?, None)
            }
            "projected-solid-angle-of-sphere" => {
                (Surface::sphere(point_m, row.vector("center")?, row.number("radius")?)?, None)
            }
            "occluded-projected-solid-angle" => {
                (body(row.object("source"))?, Some(body(row.object("occluder"))?))
            }
            other => return Err(Unmeasured::because(format!("no integral for `{other}`"))),
        };
        Ok(Self { point_m, normal: normal.normalize(), source, occluder })
    }

    fn at(&self, at: [f64; 2], chart: Chart) -> f64 {
        let (to, element) = self.source.at(at, chart);
        let between = to - self.point_m;
        let square = between.length_squared();
        let towards = between.dot(self.normal);
        if towards <= 0.0 {
            return 0.0;
        }
        if self.occluder.as_ref().is_some_and(|body| body.is_between(self.point_m, to)) {
            return 0.0;
        }
        let facing = match &self.source {
            // Its element is one of solid angle already.
            Surface::Cone { .. } => return element * towards / square.sqrt(),
            source => source.facing(to, between),
        };
        element * towards * facing / (square * square)
    }
}
