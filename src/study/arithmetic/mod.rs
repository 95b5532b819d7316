//! What accuracy costs in arithmetic: quantities with a reference value to 17 digits, the kernels of
//! `radiometry` that answer them, and the methods that integrate them knowing nothing but the
//! integrand. It has no clock: it is handed one.

mod integral;
pub mod kernel;
mod sweep;

use std::fmt;

use serde_json::Value;

pub use integral::{Chart, Method, Problem};
pub use sweep::{Effort, METHODS, STUDIES, Spot, fastest, sweep};

/// Why something could not be computed or measured.
#[derive(Debug)]
pub struct Unmeasured(String);

impl Unmeasured {
    /// In one sentence.
    pub fn because(why: impl Into<String>) -> Self {
        Self(why.into())
    }
}

impl fmt::Display for Unmeasured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl<E: std::error::Error> From<E> for Unmeasured {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

/// The reference cases that are looked at; a test holds them equal to those of `tests/data/cases.jsonl`.
pub const CASES: &str = include_str!("cases.jsonl");

/// The same, read.
pub(crate) fn cases() -> Result<Vec<Value>, Unmeasured> {
    CASES.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
}
