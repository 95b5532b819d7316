//! The functions of the place on the sample, ready to be evaluated.

use super::Position;
use crate::{Chart, Face, FitError, Ray, Region};
use radiometry::DomainError;
use radiometry::basis::{BSpline, Legendre};
use radiometry::beam::disk_rule;

/// Products of functions of x and of y.
#[derive(Debug, Clone)]
pub(crate) struct Places {
    along: (Line, Line),
    /// Which function of x times which of y.
    terms: Vec<(usize, usize)>,
    /// Of every term, over the region.
    means: Vec<f64>,
    position: Position,
}

/// The functions along one side of the region, mapped to [-1, 1].
#[derive(Debug, Clone)]
enum Line {
    Legendre(Legendre),
    Splines(BSpline),
    /// The constant: a side without length.
    Constant,
}

impl Places {
    pub(crate) fn new(position: Position, region: &Region) -> Result<Self, FitError> {
        let refused = |_: DomainError| FitError::Basis { kind: "position splines" };
        let line = |side: (f64, f64)| Line::new(position, side).map_err(refused);
        let along = (line(region.x_m)?, line(region.y_m)?);
        let terms = match position {
            Position::Legendre { degree } => {
                (0..=degree).flat_map(|total| (0..=total).map(move |y| (total - y, y))).collect()
            }
            Position::Splines { .. } => {
                let (nx, ny) = (along.0.len(), along.1.len());
                (0..nx).flat_map(|x| (0..ny).map(move |y| (x, y))).collect()
            }
        };
        let mut new = Self { along, terms, means: Vec::new(), position };
        new.means = match (region.chart, position) {
            (Chart::Perpendicular { face: Face::Disk }, Position::Legendre { degree }) => {
                new.means_over_disk(degree)
            }
            (Chart::Perpendicular { face: Face::Disk }, Position::Splines { .. }) => {
                return Err(FitError::Basis { kind: "position splines over a disk" });
            }
            _ => new.means_over_square().map_err(refused)?,
        };
        Ok(new)
    }

    pub(crate) fn len(&self) -> usize {
        self.terms.len()
    }

    /// Functions along x, and along y.
    pub(crate) fn lines(&self) -> (usize, usize) {
        (self.along.0.len(), self.along.1.len())
    }

    /// All terms at a place mapped to [-1, 1]².
    pub(crate) fn evaluate(&self, (x, y): (f64, f64), lines: &mut [Vec<f64>; 2], out: &mut [f64]) {
        self.along.0.evaluate(x, &mut lines[0]);
        self.along.1.evaluate(y, &mut lines[1]);
        for (out, &(a, b)) in out.iter_mut().zip(&self.terms) {
            *out = lines[0][a] * lines[1][b];
        }
    }

    /// The mean over the region of a term.
    pub(crate) fn mean(&self, q: usize) -> f64 {
        self.means[q]
    }

    fn means_over_square(&self) -> Result<Vec<f64>, DomainError> {
        let (x, y) = (self.along.0.means()?, self.along.1.means()?);
        Ok(self.terms.iter().map(|&(a, b)| x[a] * y[b]).collect())
    }

    /// By a rule that is exact for the degree.
    fn means_over_disk(&self, degree: usize) -> Vec<f64> {
        let (nx, ny) = self.lines();
        let (mut lines, mut values) = ([vec![0.0; nx], vec![0.0; ny]], vec![0.0; self.len()]);
        let (mut means, mut all) = (vec![0.0; self.len()], 0.0);
        for (place, weight) in disk_rule(degree) {
            self.evaluate((place.x, place.y), &mut lines, &mut values);
            means.iter_mut().zip(&values).for_each(|(mean, value)| *mean += weight * value);
            all += weight;
        }
        for mean in &mut means {
            *mean /= all;
        }
        means
    }

    /// The coefficient of a term where the field is 1 everywhere.
    pub(crate) fn unity(&self, q: usize) -> f64 {
        match self.position {
            Position::Legendre { .. } => f64::from(u8::from(q == 0)),
            Position::Splines { .. } => 1.0,
        }
    }

    /// The total degree of a term, for penalties; 0 of splines.
    pub(crate) fn degree(&self, q: usize) -> usize {
        match self.position {
            Position::Legendre { .. } => self.terms[q].0 + self.terms[q].1,
            Position::Splines { .. } => 0,
        }
    }

    /// The degree of polynomials over the region that the terms are, or over a span.
    pub(crate) fn rule_degree(&self) -> usize {
        match self.position {
            Position::Legendre { degree } => degree,
            Position::Splines { .. } => {
                let varies = |line: &Line| !matches!(line, Line::Constant);
                SPLINES_DEGREE
                    * (usize::from(varies(&self.along.0)) + usize::from(varies(&self.along.1)))
            }
        }
    }

    /// Half widths from the middle at which the terms become constant.
    pub(crate) fn continued(&self) -> f64 {
        match self.position {
            Position::Legendre { degree: 0 | 1 } => CONTINUED_LINE,
            Position::Legendre { .. } => CONTINUED,
            Position::Splines { .. } => 1.0,
        }
    }

    /// How fine a grid along a side has to be that nothing slips through.
    pub(crate) fn fineness(&self) -> usize {
        match self.position {
            Position::Legendre { degree } => degree,
            Position::Splines { spans } => 2 * spans,
        }
    }

    pub(crate) fn is_polynomial(&self) -> bool {
        matches!(self.position, Position::Legendre { .. })
    }

    /// The penalty on roughness of two terms' product: ∫ f'' g'' over the region's half widths, both
    /// ways, and ∫ f g. For splines.
    pub(crate) fn grams(&self) -> Result<Grams, FitError> {
        let refused = |_: DomainError| FitError::Basis { kind: "position splines" };
        let gram = |line: &Line, order| line.gram(order).map_err(refused);
        Ok(Grams {
            x: [gram(&self.along.0, 0)?, gram(&self.along.0, 2)?],
            y: [gram(&self.along.1, 0)?, gram(&self.along.1, 2)?],
            terms: self.terms.clone(),
            widths: self.lines(),
        })
    }

    /// Degrees in x and y where the term varies with them.
    pub(crate) fn name(&self, q: usize) -> String {
        let (a, b) = self.terms[q];
        match self.position {
            Position::Legendre { .. } => {
                let factor = |axis: &str, degree: usize| match degree {
                    0 => String::new(),
                    degree => format!(" P{degree}({axis})"),
                };
                format!("{}{}", factor("x", a), factor("y", b))
            }
            Position::Splines { .. } => format!(" B{a}(x) B{b}(y)"),
        }
    }

    pub(crate) fn scaled(region: &Region, x_m: f64, y_m: f64) -> (f64, f64) {
        region.scaled(&Ray { x_m, y_m, theta_rad: 0.0, phi_rad: 0.0 })
    }
}

/// Gram matrices of splines along both sides, by order of the derivative 0 and 2.
#[derive(Debug)]
pub(crate) struct Grams {
    x: [Vec<f64>; 2],
    y: [Vec<f64>; 2],
    terms: Vec<(usize, usize)>,
    widths: (usize, usize),
}

impl Grams {
    /// Mass, and mass plus roughness, of two terms.
    pub(crate) fn of(&self, p: usize, q: usize) -> (f64, f64) {
        let ((a, b), (c, d)) = (self.terms[p], self.terms[q]);
        let x = |order: usize| self.x[order][a * self.widths.0 + c];
        let y = |order: usize| self.y[order][b * self.widths.1 + d];
        let mass = x(0) * y(0);
        (mass, mass + x(1) * y(0) + x(0) * y(1))
    }
}

impl Line {
    fn new(position: Position, (from, to): (f64, f64)) -> Result<Self, DomainError> {
        match position {
            Position::Legendre { degree } => Ok(Self::Legendre(Legendre::new(degree))),
            Position::Splines { .. } if to <= from => Ok(Self::Constant),
            Position::Splines { spans } => {
                let spans = spans.max(1);
                let breaks = (0..=spans).map(|i| 2.0 * i as f64 / spans as f64 - 1.0);
                Ok(Self::Splines(BSpline::open(SPLINES_DEGREE, &breaks.collect::<Vec<f64>>())?))
            }
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Legendre(legendre) => legendre.len(),
            Self::Splines(splines) => splines.len(),
            Self::Constant => 1,
        }
    }

    fn evaluate(&self, t: f64, out: &mut [f64]) {
        match self {
            Self::Legendre(legendre) => legendre.evaluate(t, out),
            Self::Splines(splines) => {
                let done = splines.evaluate(t.clamp(-1.0, 1.0), out);
                debug_assert!(done.is_ok(), "a place within the region");
            }
            Self::Constant => out[0] = 1.0,
        }
    }

    /// Over [-1, 1].
    fn means(&self) -> Result<Vec<f64>, DomainError> {
        match self {
            Self::Legendre(legendre) => {
                Ok((0..legendre.len()).map(|k| f64::from(u8::from(k == 0))).collect())
            }
            Self::Splines(splines) => {
                let mut means = vec![0.0; splines.len()];
                splines.integrals(-1.0, 1.0, &mut means)?;
                for mean in &mut means {
                    *mean /= 2.0;
                }
                Ok(means)
            }
            Self::Constant => Ok(vec![1.0]),
        }
    }

    fn gram(&self, order: usize) -> Result<Vec<f64>, DomainError> {
        match self {
            Self::Splines(splines) => {
                // Means over [-1, 1], as Legendre polynomials are scaled by.
                Ok(splines.gram(order)?.iter().map(|entry| entry / 2.0).collect())
            }
            Self::Legendre(_) | Self::Constant => Ok(vec![if order == 0 { 1.0 } else { 0.0 }]),
        }
    }
}

/// Cubic.
const SPLINES_DEGREE: usize = 3;
/// The position polynomials end here, in half widths of the region from its middle: one of degree 6
/// is a thousand times as large there as within.
const CONTINUED: f64 = 2.0;
/// A line doesn't run away: it goes on as far as a footprint reaches at grazing, since the mean over
/// a footprint is then the value at its centroid, as along a sample that goes on.
const CONTINUED_LINE: f64 = 8.0;
