//! An environment map in latitude and longitude: equal steps of θ by equal steps of φ. It does not know
//! how the horizon cuts a pixel: that is next door.

use core::f64::consts::{PI, TAU};
use core::marker::PhantomData;

use glam::DVec3;

use super::horizon::{Horizon, Ring, Turn};
use super::{EnvironmentError, checked};
use crate::direction::angles;
use crate::domain::{DomainError, direction};
use crate::estimate::Estimate;
use crate::quadrature::Sum;
use crate::quantity::{Radiance, Radiometric, SolidAngle, Weighting};
use crate::transcendental::less_its_sine;

/// Rows that are summed up once and for all.
const BLOCK: usize = 16;
/// So many parts of the turn at least, so that none is wider than an eighth.
const PARTS_MIN: usize = 8;
/// Rounding of the pixels above the horizon, in units of 2⁻⁵² of radiance times solid angle.
const ULPS: f64 = 8.0;
/// Of a row: nearer to the horizon a pixel is looked at more closely.
const NEAR: f64 = 1e-9;

/// Radiance by pixels of π/rows by 2π/columns: row 0 begins at θ = 0, the pole +z, the last one ends at
/// θ = π; column 0 begins at φ = 0, over +x, and φ grows with the column. A pixel is uniform.
/// Who needs it: the simulator, for lit samples; the page on environment maps.
///
/// ```
/// use glam::DVec3;
/// use radiometry::environment::LatLong;
/// use radiometry::quantity::Radiance;
/// // A bright sky over dark ground: π L facing up, half of it on a wall.
/// let [sky, ground] = [2.0, 0.0].map(Radiance::from_w_per_m2_sr);
/// let map = LatLong::new(2, 1, &[sky, ground])?;
/// let up = map.irradiance(DVec3::Z)?;
/// assert!((up.value - 2.0 * std::f64::consts::PI).abs() <= up.error_bound);
/// let wall = map.irradiance(DVec3::X)?;
/// assert!((wall.value - std::f64::consts::PI).abs() <= wall.error_bound);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LatLong<W: Weighting = Radiometric> {
    rows: usize,
    columns: usize,
    /// Column after column, each from θ = 0 on.
    radiance: Vec<f64>,
    /// Likewise, [`BLOCK`] rows each.
    blocks: Vec<Weighed>,
    /// Rows and one.
    parallels: Vec<Turn>,
    /// By rows, of unit radiance and radian of φ.
    rings: Vec<Weighed>,
    weighting: PhantomData<W>,
}

/// Integrals over θ, weighted by radiance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Weighed {
    /// ∫ L sin² θ dθ
    across: f64,
    /// ∫ L sin θ cos θ dθ
    along: f64,
    /// ∫ L sin θ dθ
    solid: f64,
}

impl Weighed {
    fn times(self, radiance: f64) -> Self {
        Self {
            across: self.across * radiance,
            along: self.along * radiance,
            solid: self.solid * radiance,
        }
    }
}

/// A sum of them.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    across: Sum,
    along: Sum,
    solid: Sum,
}

impl Sums {
    fn add(&mut self, term: Weighed) {
        self.across.add(term.across);
        self.along.add(term.along);
        self.solid.add(term.solid);
    }

    fn value(self) -> Weighed {
        Weighed {
            across: self.across.value(),
            along: self.along.value(),
            solid: self.solid.value(),
        }
    }
}

impl<W: Weighting> LatLong<W> {
    /// From the radiances row after row. Refused: no pixels or more than 2²⁶, another number of
    /// radiances, one that is negative or no finite number.
    pub fn new(
        rows: usize,
        columns: usize,
        radiance: &[Radiance<W>],
    ) -> Result<Self, EnvironmentError> {
        let by_rows = checked(rows, columns, radiance)?;
        let transposed = (0..columns).flat_map(|column| {
            let by_rows = &by_rows;
            (0..rows).map(move |row| by_rows[row * columns + column])
        });
        let radiance: Vec<f64> = transposed.collect();
        let parallels = parallels(rows);
        let rings: Vec<Weighed> = (0..rows).map(|row| ring(row, rows)).collect();
        let mut blocks = Vec::with_capacity(columns * rows.div_ceil(BLOCK));
        for column in radiance.chunks(rows) {
            for (block, rings) in column.chunks(BLOCK).zip(rings.chunks(BLOCK)) {
                let mut sums = Sums::default();
                block.iter().zip(rings).for_each(|(l, ring)| sums.add(ring.times(*l)));
                blocks.push(sums.value());
            }
        }
        Ok(Self { rows, columns, radiance, blocks, parallels, rings, weighting: PhantomData })
    }

    /// Steps of θ.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Steps of φ.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// What comes from a direction (of any length but 0): its pixel's radiance.
    /// Who needs it: the simulator, for what a sample reflects.
    ///
    /// ```
    /// use glam::DVec3;
    /// use radiometry::environment::LatLong;
    /// use radiometry::quantity::Radiance;
    /// let pixels = [1.0, 2.0, 3.0, 4.0].map(Radiance::from_w_per_m2_sr);
    /// let map = LatLong::new(1, 4, &pixels)?;
    /// // φ is 135°.
    /// let second = map.radiance(DVec3::new(-1.0, 1.0, 0.5))?;
    /// assert_eq!(second, pixels[1]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn radiance(&self, towards: DVec3) -> Result<Radiance<W>, DomainError> {
        let (theta, phi) = angles(direction("direction", towards)?);
        let turn = phi / TAU;
        let place = if turn < 0.0 { turn + 1.0 } else { turn };
        let row = index(theta / PI, self.rows);
        let column = index(place, self.columns);
        Ok(Radiance::from_amount(self.radiance[column * self.rows + row]))
    }

    /// The solid angle of each pixel of a row, exactly: Δφ (cos θ₁ - cos θ₂). None beyond the last row.
    /// Who needs it: whoever adds a map up pixel by pixel.
    pub fn pixel_solid_angle(&self, row: usize) -> Option<SolidAngle> {
        let ring = self.rings.get(row)?;
        Some(SolidAngle::from_sr(ring.solid * (TAU / self.columns as f64)))
    }

    /// Irradiance ∫ L cos θ dω, W·m⁻² (of a map of luminance lx), on a receiver with a normal of any
    /// length but 0: the part of each pixel above the receiver's horizon, in closed form. The bound is
    /// of rounding; a uniform map gives πL for every normal within it.
    ///
    /// It takes a few operations for each column and pixel on the horizon, and sums of sixteen rows for
    /// the others. An error beside that of the normal where the answer is beyond the largest double.
    /// Who needs it: the simulator, for lit samples; the page on environment maps.
    pub fn irradiance(&self, normal: DVec3) -> Result<Estimate, DomainError> {
        let horizon = Horizon::of(normal)?;
        let split = PARTS_MIN.div_ceil(self.columns);
        let parts = self.columns * split;
        let (mut sum, mut error_bound) = (Sum::default(), 0.0);
        let mut from = Turn { sin: 0.0, cos: 1.0 };
        for part in 0..parts {
            let to = turn_of(part + 1, parts);
            let slice = Slice { column: part / split, from, to, width: TAU / parts as f64 };
            let (value, bound) = self.irradiance_from(&slice, &horizon);
            sum.add(value);
            error_bound += bound;
            from = to;
        }
        let value = sum.value().max(0.0);
        if value.is_finite() && f64::is_finite(error_bound) {
            Ok(Estimate { value, error_bound, evaluations: 0 })
        } else {
            Err(DomainError::Overflow { result: "irradiance" })
        }
    }

    fn irradiance_from(&self, slice: &Slice, horizon: &Horizon) -> (f64, f64) {
        let (from, to) = (horizon.azimuth(slice.from), horizon.azimuth(slice.to));
        let (least, greatest) = horizon.between(from, to);
        let rows = self.rows as f64;
        // As usize: below zero is 0, and neither is NaN.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "by design")]
        let (visible, cut) = (
            (least / PI * rows - NEAR) as usize,
            (((greatest / PI * rows).ceil() + NEAR) as usize).min(self.rows),
        );
        let whole = if horizon.is_mirrored {
            self.weighed(slice.column, self.rows - visible, self.rows)
        } else {
            self.weighed(slice.column, 0, visible)
        };
        let middle = slice.middle();
        let sideways = horizon.normal.x * middle.cos + horizon.normal.y * middle.sin;
        let chord = 2.0 * libm::sin(0.5 * slice.width) * sideways;
        let along = horizon.normal.z * slice.width;
        let mut value = whole.across * chord + whole.along * along;
        let mut error_bound = ULPS * f64::EPSILON * whole.solid * slice.width;
        for row in visible..cut {
            let place = if horizon.is_mirrored { self.rows - 1 - row } else { row };
            let radiance = self.radiance[slice.column * self.rows + place];
            if radiance > 0.0 {
                let seen = horizon.visible(&self.ring(row), from, to);
                value += radiance * seen.sr;
                error_bound += radiance * seen.error_bound;
            }
        }
        (value, error_bound)
    }

    fn ring(&self, row: usize) -> Ring {
        let Weighed { across, along, .. } = self.rings[row];
        Ring { top: self.parallels[row], bottom: self.parallels[row + 1], across, along }
    }

    /// Of some rows of a column.
    fn weighed(&self, column: usize, from: usize, to: usize) -> Weighed {
        let mut sums = Sums::default();
        let radiance = &self.radiance[column * self.rows..][..self.rows];
        let per_column = self.rows.div_ceil(BLOCK);
        let blocks = &self.blocks[column * per_column..][..per_column];
        let (first, last) = (from.div_ceil(BLOCK), to / BLOCK);
        let mut add_rows = |from: usize, to: usize| {
            let rows = self.rings[from..to].iter().zip(&radiance[from..to]);
            rows.for_each(|(ring, radiance)| sums.add(ring.times(*radiance)));
        };
        if first > last {
            add_rows(from, to);
        } else {
            add_rows(from, first * BLOCK);
            add_rows(last * BLOCK, to);
            blocks[first..last].iter().for_each(|block| sums.add(*block));
        }
        sums.value()
    }
}

/// A part of the turn, within a column.
struct Slice {
    column: usize,
    from: Turn,
    to: Turn,
    width: f64,
}

impl Slice {
    fn middle(&self) -> Turn {
        let (sin, cos) = (self.from.sin + self.to.sin, self.from.cos + self.to.cos);
        let length = libm::hypot(sin, cos);
        Turn { sin: sin / length, cos: cos / length }
    }
}

/// Which of so many equal parts of [0, 1] a place is in.
fn index(place: f64, parts: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within 0 to parts"
    )]
    let index = (place * parts as f64) as usize;
    index.min(parts - 1)
}

/// A whole number of parts of the turn.
fn turn_of(part: usize, parts: usize) -> Turn {
    if part == parts {
        return Turn { sin: 0.0, cos: 1.0 };
    }
    Turn::of(TAU * (part as f64 / parts as f64))
}

/// The edges of the rows, symmetric to the bit about the equator.
fn parallels(rows: usize) -> Vec<Turn> {
    let at = |row: usize| match (2 * row).cmp(&rows) {
        _ if row == 0 => Turn { sin: 0.0, cos: 1.0 },
        core::cmp::Ordering::Equal => Turn { sin: 1.0, cos: 0.0 },
        _ => Turn::of(PI * (row as f64 / rows as f64)),
    };
    let northern = |row: usize| if 2 * row <= rows { at(row) } else { at(rows - row) };
    let mirrored = |row: usize| {
        let turn = northern(row);
        if 2 * row <= rows { turn } else { Turn { cos: -turn.cos, ..turn } }
    };
    (0..=rows).map(mirrored).collect()
}

/// The integrals over a row, free of differences.
fn ring(row: usize, rows: usize) -> Weighed {
    let step = PI / rows as f64;
    // In half steps; symmetric about the equator.
    let place = 2 * row + 1;
    let is_southern = place > rows;
    let northern = if is_southern { 2 * rows - place } else { place };
    let middle = Turn::of(0.5 * step * northern as f64);
    let cos = if is_southern { -middle.cos } else { middle.cos };
    let sin_step = libm::sin(step);
    Weighed {
        across: 0.5 * less_its_sine(step) + sin_step * middle.sin * middle.sin,
        along: sin_step * middle.sin * if place == rows { 0.0 } else { cos },
        solid: 2.0 * middle.sin * libm::sin(0.5 * step),
    }
}
