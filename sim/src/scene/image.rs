//! An image on a rectangle: each pixel is a small rectangle that is the same all over, so that areas
//! and means are exact. The first row lies along the side of the highest y, the first column along
//! that of the lowest x.

use photometry_files::netpbm::GreyImage;

/// Values relative to one level.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    columns: usize,
    rows: usize,
    values: Vec<f64>,
}

impl Image {
    /// Values row by row, each at least 0. `None` if they are none, do not fill their rows, or are
    /// negative or not finite.
    pub fn new(columns: usize, values: Vec<f64>) -> Option<Self> {
        let is_full = columns > 0 && !values.is_empty() && values.len().is_multiple_of(columns);
        let is_sound = values.iter().all(|value| value.is_finite() && *value >= 0.0);
        (is_full && is_sound).then(|| Self { columns, rows: values.len() / columns, values })
    }

    pub(crate) fn from_grey(image: GreyImage) -> Option<Self> {
        Self::new(image.width(), image.into_values())
    }

    /// Pixels along x.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Pixels along y.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The value of a column (from the lowest x) in a row (from the highest y); 0 outside.
    pub fn value(&self, column: usize, row: usize) -> f64 {
        let is_inside = column < self.columns && row < self.rows;
        if is_inside { self.values[row * self.columns + column] } else { 0.0 }
    }

    /// The largest.
    pub fn peak(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }

    /// At a place given by parts of the sides, from the lowest x and the lowest y, each in [0, 1].
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a part of a count
    pub(crate) fn at(&self, part_x: f64, part_y: f64) -> f64 {
        let cell = |part: f64, count: usize| {
            let cell = libm::floor(part.clamp(0.0, 1.0) * count as f64) as usize;
            cell.min(count - 1)
        };
        let row = cell(1.0 - part_y, self.rows);
        self.value(cell(part_x, self.columns), row)
    }

    /// ∫ value dA over the part of the unit square within these parts of its sides.
    pub(crate) fn integral(&self, xs: (f64, f64), ys: (f64, f64)) -> f64 {
        let columns = shares(self.columns, xs);
        let rows = shares(self.rows, (1.0 - ys.1, 1.0 - ys.0));
        let in_row = |row: usize| -> f64 {
            let values = &self.values[row * self.columns..(row + 1) * self.columns];
            values.iter().zip(&columns).map(|(value, share)| value * share).sum()
        };
        rows.iter().enumerate().map(|(row, share)| share * in_row(row)).sum()
    }

    /// The largest value within these parts of the sides, and the middle of what is within of its
    /// pixel.
    pub(crate) fn brightest(&self, xs: (f64, f64), ys: (f64, f64)) -> Option<(f64, f64, f64)> {
        let (columns, rows) = (self.columns as f64, self.rows as f64);
        let within = |i: usize, count: f64, side: (f64, f64)| {
            let low = (i as f64 / count).max(side.0);
            let high = ((i + 1) as f64 / count).min(side.1);
            (low < high).then(|| f64::midpoint(low, high))
        };
        let mut best: Option<(f64, f64, f64)> = None;
        for row in 0..self.rows {
            let Some(down) = within(row, rows, (1.0 - ys.1, 1.0 - ys.0)) else { continue };
            for column in 0..self.columns {
                let Some(along) = within(column, columns, xs) else { continue };
                let value = self.value(column, row);
                if best.is_none_or(|(most, ..)| value > most) {
                    best = Some((value, along, 1.0 - down));
                }
            }
        }
        best
    }
}

/// What of each of `count` equal parts of [0, 1] lies within an interval.
fn shares(count: usize, (low, high): (f64, f64)) -> Vec<f64> {
    let edge = |i: usize| i as f64 / count as f64;
    (0..count).map(|i| (edge(i + 1).min(high) - edge(i).max(low)).max(0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_row_lies_at_high_y_and_areas_add_up() {
        let image = Image::new(3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        assert!((image.at(0.1, 0.9) - 1.0).abs() < 1e-15);
        assert!((image.at(0.9, 0.1) - 6.0).abs() < 1e-15);
        assert!((image.integral((0.0, 1.0), (0.0, 1.0)) - 3.5).abs() < 1e-15);
        assert!((image.integral((0.0, 0.5), (0.5, 1.0)) - (1.0 / 6.0 + 2.0 / 12.0)).abs() < 1e-15);
        for cut in [0.2, 0.5, 0.77] {
            let parts = [
                image.integral((0.0, cut), (0.0, 1.0 - cut)),
                image.integral((cut, 1.0), (0.0, 1.0 - cut)),
                image.integral((0.0, 1.0), (1.0 - cut, 1.0)),
            ];
            assert!((parts.iter().sum::<f64>() - 3.5).abs() < 1e-14, "{cut}");
        }
        let (value, x, y) = image.brightest((0.0, 0.9), (0.6, 1.0)).unwrap();
        assert_eq!((value.to_bits(), image.at(x, y).to_bits()), (3f64.to_bits(), 3f64.to_bits()));
        assert_eq!(image.brightest((2.0, 3.0), (0.0, 1.0)), None);
        assert!(Image::new(2, vec![1.0; 3]).is_none() && Image::new(1, vec![-1.0]).is_none());
    }
}
