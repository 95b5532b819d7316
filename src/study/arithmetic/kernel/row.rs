//! The inputs of a reference case, read. It does not know what they mean.

use glam::{DVec2, DVec3};
use radiometry::Tolerance;
use radiometry::shape::Polygon;
use serde_json::Value;

use crate::study::arithmetic::Unmeasured;

/// Named values.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a>(&'a Value);

impl<'a> Row<'a> {
    /// Of a case's inputs.
    pub fn new(inputs: &'a Value) -> Self {
        Self(inputs)
    }

    /// Whether there is one of this name.
    pub fn has(self, key: &str) -> bool {
        self.0.get(key).is_some()
    }

    /// A number.
    pub fn number(self, key: &str) -> Result<f64, Unmeasured> {
        self.0[key].as_f64().ok_or_else(|| lacks(key, "number"))
    }

    /// Several numbers.
    pub fn numbers<const N: usize>(self, keys: [&str; N]) -> Result<[f64; N], Unmeasured> {
        let mut numbers = [0.0; N];
        for (number, key) in numbers.iter_mut().zip(keys) {
            *number = self.number(key)?;
        }
        Ok(numbers)
    }

    /// A whole number.
    pub fn count(self, key: &str) -> Result<usize, Unmeasured> {
        let number = self.number(key)?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a degree
        Ok(number as usize)
    }

    /// A vector.
    pub fn vector(self, key: &str) -> Result<DVec3, Unmeasured> {
        vector(&self.0[key]).ok_or_else(|| lacks(key, "vector"))
    }

    /// A point in a plane.
    pub fn point_2d(self, key: &str) -> Result<DVec2, Unmeasured> {
        let list = &self.0[key];
        let read = || Some(DVec2::new(list[0].as_f64()?, list[1].as_f64()?));
        read().ok_or_else(|| lacks(key, "point"))
    }

    /// A polygon.
    pub fn polygon(self, key: &str) -> Result<Polygon, Unmeasured> {
        let list = self.0[key].as_array().ok_or_else(|| lacks(key, "list"))?;
        let vertices: Option<Vec<DVec3>> = list.iter().map(vector).collect();
        Ok(Polygon::new(vertices.ok_or_else(|| lacks(key, "list of vectors"))?)?)
    }

    /// Triangles.
    pub fn triangles(self, key: &str) -> Result<Vec<[DVec3; 3]>, Unmeasured> {
        let list = self.0[key].as_array().ok_or_else(|| lacks(key, "list"))?;
        let corner = |triangle: &Value, k: usize| vector(&triangle[k]);
        let triangle = |t: &Value| Some([corner(t, 0)?, corner(t, 1)?, corner(t, 2)?]);
        let triangles: Option<Vec<_>> = list.iter().map(triangle).collect();
        triangles.ok_or_else(|| lacks(key, "list of triangles"))
    }

    /// Values within a value.
    #[must_use]
    pub fn object(self, key: &str) -> Self {
        Self(&self.0[key])
    }

    /// A text; empty where there is none.
    pub fn text(self, key: &str) -> &'a str {
        self.0[key].as_str().unwrap_or_default()
    }

    /// As the case asks for it; the library's default where it doesn't.
    pub fn tolerance(self) -> Result<Tolerance, Unmeasured> {
        self.tolerance_or(Tolerance::default())
    }

    /// As the case asks for it; another one where it doesn't.
    pub fn tolerance_or(self, usual: Tolerance) -> Result<Tolerance, Unmeasured> {
        if self.has("relative_tolerance") {
            Ok(Tolerance::from_relative(self.number("relative_tolerance")?)?)
        } else {
            Ok(usual)
        }
    }
}

fn vector(value: &Value) -> Option<DVec3> {
    Some(DVec3::new(value[0].as_f64()?, value[1].as_f64()?, value[2].as_f64()?))
}

fn lacks(key: &str, kind: &str) -> Unmeasured {
    Unmeasured::because(format!("the case's input `{key}` is no {kind}"))
}
