//! Functions of the place where a ray pierces the second plane of the two-plane chart, and the
//! throughput between the two rectangles. It knows no samples.
//!
//! They are functions of a ray, not of its direction alone: where it begins matters as much.

use super::Places;
use super::Position;
use crate::{Chart, FitError, Region};
use glam::DVec3;
use radiometry::quadrature::gauss_legendre;

/// Products of Legendre polynomials over the second rectangle.
#[derive(Debug, Clone)]
pub(crate) struct SecondPlane {
    functions: Places,
    /// The second rectangle, as if it were a sample.
    rectangle: Region,
    distance_m: f64,
    degree: usize,
}

impl SecondPlane {
    /// `None` of a chart that has no second plane.
    pub(crate) fn new(degree: usize, chart: Chart) -> Result<Option<Self>, FitError> {
        let Chart::TwoPlane { distance_m, s_m, t_m } = chart else { return Ok(None) };
        let rectangle = Region::surface(s_m, t_m, 1.0);
        let functions = Places::new(Position::Legendre { degree }, &rectangle)?;
        Ok(Some(Self { functions, rectangle, distance_m, degree }))
    }

    pub(crate) fn len(&self) -> usize {
        self.functions.len()
    }

    pub(crate) fn degree(&self) -> usize {
        self.degree
    }

    /// The total degree of a function.
    pub(crate) fn degree_of(&self, j: usize) -> usize {
        self.functions.degree(j)
    }

    /// The largest value of a function over the rectangle: that at a corner.
    pub(crate) fn largest(&self, j: usize) -> f64 {
        let mut values = vec![0.0; self.len()];
        self.functions.evaluate((1.0, 1.0), &mut self.lines(), &mut values);
        values[j]
    }

    pub(crate) fn lines(&self) -> [Vec<f64>; 2] {
        let (s, t) = self.functions.lines();
        [vec![0.0; s], vec![0.0; t]]
    }

    /// All values along the ray from a place in the first plane; where it misses the rectangle by more
    /// than half its width those of there.
    pub(crate) fn evaluate(
        &self,
        (u_m, v_m): (f64, f64),
        direction: DVec3,
        lines: &mut [Vec<f64>; 2],
        out: &mut [f64],
    ) {
        let along = self.distance_m / direction.z.max(GRAZING);
        let (s_m, t_m) = (u_m + along * direction.x, v_m + along * direction.y);
        let (s, t) = Places::scaled(&self.rectangle, s_m, t_m);
        let limit = self.functions.continued();
        self.functions.evaluate((s.clamp(-limit, limit), t.clamp(-limit, limit)), lines, out);
    }

    /// `P2(s) P1(t)`, or `1`.
    pub(crate) fn name(&self, j: usize) -> String {
        let name = self.functions.name(j).replace("(x)", "(s)").replace("(y)", "(t)");
        if name.is_empty() { "1".to_owned() } else { name.trim_start().to_owned() }
    }

    /// ∬ of every function times every one of the first plane's over all rays through both
    /// rectangles, with their throughput, over the first one's area: by Gauss's rules, ever finer.
    pub(crate) fn throughput(
        &self,
        places: &Places,
        region: &Region,
    ) -> Result<Vec<f64>, FitError> {
        let first = |nodes: usize| self.throughput_by(nodes, places, region);
        let least = usize::midpoint(places.rule_degree(), self.degree) + 4;
        let mut before = first(least);
        for nodes in [least + 4, least + 10, least + 18, least + 28] {
            let found = first(nodes);
            let size = found.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            let change = |(a, b): (&f64, &f64)| (a - b).abs() <= THROUGHPUT_RELATIVE * size;
            if found.iter().zip(&before).all(change) {
                return Ok(found);
            }
            before = found;
        }
        Err(FitError::PlanesTooNear { distance_m: self.distance_m })
    }

    fn throughput_by(&self, nodes: usize, places: &Places, region: &Region) -> Vec<f64> {
        let rule = gauss_legendre(nodes);
        let pairs = || rule.iter().flat_map(|a| rule.iter().map(move |b| (a, b)));
        let half = |(from, to): (f64, f64)| (to - from) / 2.0;
        let at = |(from, to): (f64, f64), t: f64| f64::midpoint(from, to) + t * half((from, to));
        let second = self.rectangle;
        let area_m2 = half(second.x_m) * half(second.y_m);
        let mut lines = self.lines();
        let seen: Vec<(f64, f64, f64, Vec<f64>)> = pairs()
            .map(|((s, a), (t, b))| {
                let mut values = vec![0.0; self.len()];
                self.functions.evaluate((*s, *t), &mut lines, &mut values);
                (at(second.x_m, *s), at(second.y_m, *t), a * b * area_m2, values)
            })
            .collect();
        let (nx, ny) = places.lines();
        let (mut lines, mut terms) = ([vec![0.0; nx], vec![0.0; ny]], vec![0.0; places.len()]);
        let (mut sums, mut inner) = (vec![0.0; places.len() * self.len()], vec![0.0; self.len()]);
        for ((u, a), (v, b)) in pairs() {
            let (u_m, v_m) = (at(region.x_m, *u), at(region.y_m, *v));
            inner.fill(0.0);
            for (s_m, t_m, weight, values) in &seen {
                let place = radiometry::chart::TwoPlane {
                    u_m,
                    v_m,
                    s_m: *s_m,
                    t_m: *t_m,
                    distance_m: self.distance_m,
                };
                let factor = weight * place.density();
                inner.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
            }
            places.evaluate((*u, *v), &mut lines, &mut terms);
            for (term, block) in terms.iter().zip(sums.chunks_exact_mut(self.len())) {
                // The mean over the first rectangle: weights a and b each sum to 2.
                let factor = a * b / 4.0 * term;
                block.iter_mut().zip(&inner).for_each(|(sum, value)| *sum += factor * value);
            }
        }
        sums
    }
}

/// cos θ of a ray that meets the second plane nowhere that matters.
const GRAZING: f64 = 1e-9;
/// By how much a finer rule may change the throughput.
const THROUGHPUT_RELATIVE: f64 = 1e-10;
