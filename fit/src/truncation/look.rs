//! What the wider model takes of readings in its first walk through them: rows under the variances that the
//! fit found and under the stated ones. It knows no prior.

use super::heard::Heard;
use crate::FitError;
use crate::triangle::Triangle;

/// What one walk sums up.
#[derive(Debug, Clone)]
pub(super) struct Look {
    pub(super) found: Rows,
    /// Where these are others.
    pub(super) stated: Option<Rows>,
    /// The least part of a variance that is stated.
    pub(super) least: f64,
    /// How many times as large variances may be as they were found.
    pub(super) most: f64,
    /// Sums by weight of variances, found and stated, of readings that say what they read; and how many.
    pub(super) scatter: [f64; 2],
    pub(super) plain: f64,
}

/// All readings under some variances: a triangle of the fit's functions, what samples share, the
/// finer functions, and the values.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    pub(super) is_stated: bool,
    pub(super) triangle: Triangle,
    /// Of the variances that are finite, and how many these are.
    pub(super) logs: f64,
    pub(super) counted: f64,
}

impl Rows {
    fn new(columns: usize, is_stated: bool) -> Self {
        Self { is_stated, triangle: Triangle::new(columns, 1), logs: 0.0, counted: 0.0 }
    }

    /// Takes a row in, divided by its standard uncertainty.
    pub(super) fn take(
        &mut self,
        row: &[f64],
        variance: f64,
        weighted: &mut [f64],
    ) -> Result<(), FitError> {
        let weight = 1.0 / variance.sqrt();
        if !weight.is_finite() {
            return Err(FitError::OutOfRange);
        }
        if weight == 0.0 {
            return Ok(());
        }
        weighted.iter_mut().zip(row).for_each(|(out, value)| *out = weight * value);
        self.triangle.absorb(weighted);
        self.logs += libm::log(variance);
        self.counted += 1.0;
        Ok(())
    }
}

impl Look {
    /// Of rows of so many columns before their value, with their stated variances too if those matter.
    pub(super) fn new(columns: usize, with_stated: bool) -> Self {
        Self {
            found: Rows::new(columns, false),
            stated: with_stated.then(|| Rows::new(columns, true)),
            least: 1.0,
            most: 1.0,
            scatter: [0.0; 2],
            plain: 0.0,
        }
    }

    /// Takes readings in; `told` hears of the row of each that says what it read.
    pub(super) fn take(
        &mut self,
        heard: &Heard<'_>,
        kept: &[usize],
        mut told: impl FnMut(usize, &[f64]),
    ) -> Result<(), FitError> {
        let columns = heard.own.basis().len() + heard.sides.len() + kept.len();
        let mut rooms = heard.rooms();
        let (mut row, mut weighted) = (vec![0.0; columns + 1], vec![0.0; columns + 1]);
        for (i, value) in heard.values.iter().enumerate() {
            let [found, stated] = [false, true].map(|is_stated| heard.variance(i, is_stated));
            if found == f64::INFINITY {
                continue;
            }
            heard.row(i, kept, &mut rooms, &mut row[..columns]);
            row[columns] = *value;
            self.found.take(&row, found, &mut weighted)?;
            if let Some(rows) = &mut self.stated {
                rows.take(&row, stated, &mut weighted)?;
            }
            self.least = self.least.min(stated / found);
            if heard.is_plain(i) {
                let weight = heard.weighed.weights[i];
                self.scatter[0] += weight * found;
                self.scatter[1] += weight * stated;
                self.plain += 1.0;
                told(i, &row[..columns]);
            }
        }
        Ok(())
    }
}
