//! Surfaces cut into cells, with a polynomial on each: Gauss and Legendre's nodes along both
//! parameters. How good the polynomial is, is told by how its coefficients decay.

use std::sync::OnceLock;

use glam::{DVec2, DVec3};
use radiometry::quadrature::gauss_legendre;

use super::chart::{Chart, Point};
use crate::scene::Body;

/// Nodes along each parameter, and of a cell.
pub(super) const SIDE: usize = 5;
pub(super) const NODES: usize = SIDE * SIDE;

/// Values at a cell's nodes, or weights of them; the first parameter runs fastest.
pub(super) type OnNodes = [f64; NODES];

/// All cells of all surfaces.
#[derive(Debug, Clone)]
pub(super) struct Mesh {
    pub(super) charts: Vec<Patch>,
    pub(super) cells: Vec<Cell>,
    /// Which cells are not cut, in the order in which their nodes are counted.
    pub(super) leaves: Vec<usize>,
}

/// A chart, of which surface, and its first cell.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    pub(super) surface: usize,
    pub(super) chart: Chart,
    root: usize,
    /// Along which parameter and at what value the plane of another surface meets it.
    touched: Vec<(usize, f64)>,
}

#[derive(Debug, Clone)]
pub(super) struct Cell {
    pub(super) patch: usize,
    pub(super) low: DVec2,
    pub(super) high: DVec2,
    state: State,
}

#[derive(Debug, Clone)]
enum State {
    /// Its place among the leaves.
    Leaf(usize),
    /// Along which parameter, where, and the two halves.
    Cut(usize, f64, [usize; 2]),
}

impl Mesh {
    /// Of bodies: cut where the plane of another meets one, since light ends there.
    pub(super) fn new(bodies: &[&Body]) -> Self {
        let mut mesh = Self { charts: Vec::new(), cells: Vec::new(), leaves: Vec::new() };
        for (surface, body) in bodies.iter().enumerate() {
            for chart in Chart::all_of(body) {
                let (patch, root) = (mesh.charts.len(), mesh.cells.len());
                let state = State::Leaf(0);
                mesh.cells.push(Cell { patch, low: DVec2::ZERO, high: DVec2::ONE, state });
                mesh.charts.push(Patch { surface, chart, root, touched: Vec::new() });
            }
        }
        for patch in 0..mesh.charts.len() {
            mesh.cut_at_first(patch);
        }
        mesh.count();
        mesh
    }

    fn cut_at_first(&mut self, patch: usize) {
        let chart = self.charts[patch].chart.clone();
        let mut cuts: Vec<(usize, f64)> = Vec::new();
        for (axis, parts) in chart.parts().into_iter().enumerate() {
            cuts.extend((1..parts).map(|i| (axis, f64::from(i) / f64::from(parts))));
        }
        let planes = self.charts.iter().filter(|other| other.surface != self.charts[patch].surface);
        let planes = planes.filter_map(|other| other.chart.plane());
        let touched: Vec<(usize, f64)> = planes.filter_map(|p| chart.crossed_by(p)).collect();
        cuts.extend(touched.iter().filter(|(_, at)| *at > 0.0 && *at < 1.0));
        self.charts[patch].touched = touched;
        for (axis, at) in cuts {
            for cell in 0..self.cells.len() {
                let Cell { patch: of, low, high, state } = &self.cells[cell];
                let is_inside = at > low[axis] && at < high[axis];
                if *of == patch && is_inside && matches!(state, State::Leaf(_)) {
                    self.cut(cell, axis, at);
                }
            }
        }
    }

    /// Cuts a cell in two; [`Mesh::count`] makes the halves count.
    fn cut(&mut self, cell: usize, axis: usize, at: f64) {
        let Cell { patch, low, high, .. } = self.cells[cell].clone();
        let (mut middle_low, mut middle_high) = (low, high);
        middle_low[axis] = at;
        middle_high[axis] = at;
        let first = self.cells.len();
        for (low, high) in [(low, middle_high), (middle_low, high)] {
            self.cells.push(Cell { patch, low, high, state: State::Leaf(0) });
        }
        self.cells[cell].state = State::Cut(axis, at, [first, first + 1]);
    }

    /// Halves a leaf along a parameter; next to where another surface meets this one it leaves a narrow
    /// cell, for light is rough there and nowhere else.
    pub(super) fn halve(&mut self, cell: usize, axis: usize) {
        let Cell { patch, low, high, .. } = &self.cells[cell];
        let (low, high) = (low[axis], high[axis]);
        let is_touched = |end: f64| {
            let mut touched = self.charts[*patch].touched.iter();
            touched.any(|(of, at)| *of == axis && (at - end).abs() < 1e-9)
        };
        let part = match (is_touched(low), is_touched(high)) {
            (true, false) => NARROW,
            (false, true) => 1.0 - NARROW,
            _ => 0.5,
        };
        self.cut(cell, axis, low + part * (high - low));
    }

    pub(super) fn count(&mut self) {
        self.leaves.clear();
        for (i, cell) in self.cells.iter_mut().enumerate() {
            if let State::Leaf(place) = &mut cell.state {
                *place = self.leaves.len();
                self.leaves.push(i);
            }
        }
    }

    pub(super) fn surface(&self, cell: usize) -> usize {
        self.charts[self.cells[cell].patch].surface
    }

    pub(super) fn chart(&self, cell: usize) -> &Chart {
        &self.charts[self.cells[cell].patch].chart
    }

    /// A cell's nodes, with the area that each stands for.
    pub(super) fn points(&self, cell: usize) -> [Point; NODES] {
        let Cell { low, high, .. } = &self.cells[cell];
        nodes_over(self.chart(cell), *low, *high)
    }

    /// The value at a place of a surface of what is known at all leaves' nodes.
    pub(super) fn value(&self, surface: usize, place: DVec3, values: &[OnNodes]) -> f64 {
        let patches = self.charts.iter().filter(|patch| patch.surface == surface);
        let located = patches.map(|patch| (patch, patch.chart.locate(place)));
        let nearest = located.min_by(|a, b| a.1.1.total_cmp(&b.1.1));
        let Some((patch, (at, _))) = nearest else { return 0.0 };
        let mut cell = patch.root;
        loop {
            match &self.cells[cell].state {
                State::Cut(axis, middle, halves) => {
                    cell = halves[usize::from(at[*axis] > *middle)];
                }
                State::Leaf(leaf) => {
                    let Cell { low, high, .. } = &self.cells[cell];
                    let shares = shares((at - *low) / (*high - *low));
                    return shares.iter().zip(&values[*leaf]).map(|(a, b)| a * b).sum();
                }
            }
        }
    }
}

/// Places of a product rule over a rectangle of parameters; the densities are the areas that they
/// stand for.
pub(super) fn nodes_over(chart: &Chart, low: DVec2, high: DVec2) -> [Point; NODES] {
    let (rule, size) = (rule(), high - low);
    core::array::from_fn(|k| {
        let ((u, a), (v, b)) = (rule.nodes[k % SIDE], rule.nodes[k / SIDE]);
        let mut point = chart.point(low + size * DVec2::new(u, v));
        point.density_m2 *= a * b * size.x * size.y;
        point
    })
}

/// What each node's value counts at parameters within the cell, from (0, 0) to (1, 1).
fn shares(at: DVec2) -> OnNodes {
    let (along, across) = (rule().shares(at.x), rule().shares(at.y));
    core::array::from_fn(|k| along[k % SIDE] * across[k / SIDE])
}

/// What the nodes of a part of a cell count, handed on to the cell's own nodes. The part: from and to
/// which parameters within the cell.
pub(super) fn spread(parts: &OnNodes, (low, high): (DVec2, DVec2), weights: &mut OnNodes) {
    let rule = rule();
    let shares = |axis: usize| {
        rule.nodes.map(|(node, _)| rule.shares(low[axis] + node * (high[axis] - low[axis])))
    };
    let (along, across) = (shares(0), shares(1));
    for (row, of_row) in parts.chunks_exact(SIDE).zip(across) {
        let mut spread = [0.0; SIDE];
        for (part, of_node) in row.iter().zip(along) {
            for (sum, share) in spread.iter_mut().zip(of_node) {
                *sum += part * share;
            }
        }
        for (weights, share) in weights.chunks_exact_mut(SIDE).zip(of_row) {
            for (weight, sum) in weights.iter_mut().zip(spread) {
                *weight += sum * share;
            }
        }
    }
}

/// How far the polynomial may be off in a cell, after each parameter: where the coefficients after
/// Legendre's polynomials decay, what is cut off decays on.
pub(super) fn roughness(values: &OnNodes) -> [f64; 2] {
    let rule = rule();
    let line = |axis: usize, i: usize| {
        let line: [f64; SIDE] =
            core::array::from_fn(|k| values[if axis == 0 { i * SIDE + k } else { k * SIDE + i }]);
        let coefficients = rule
            .legendre
            .map(|row| row.iter().zip(line).map(|(part, value)| part * value).sum::<f64>().abs());
        let last = coefficients[SIDE - 1].max(coefficients[SIDE - 2]);
        let before = coefficients[SIDE - 3].max(coefficients[SIDE - 4]).max(last);
        if last > 0.0 { last * libm::sqrt(last / before) } else { 0.0 }
    };
    [0, 1].map(|axis| (0..SIDE).map(|i| line(axis, i)).fold(0.0, f64::max))
}

/// Grading towards a singular edge (Gui and Babuška 1986: the best is 0.17).
const NARROW: f64 = 0.17;

struct Rule {
    /// On [0, 1].
    nodes: [(f64, f64); SIDE],
    /// Each node's product of distances to the others.
    products: [f64; SIDE],
    /// Values to coefficients, a row for each degree.
    legendre: [[f64; SIDE]; SIDE],
}

fn rule() -> &'static Rule {
    static RULE: OnceLock<Rule> = OnceLock::new();
    RULE.get_or_init(|| {
        let of_whole = gauss_legendre(SIDE);
        let nodes = core::array::from_fn(|i| {
            let (node, weight) = of_whole[i];
            (f64::midpoint(1.0, node), weight / 2.0)
        });
        let products = core::array::from_fn(|i| {
            let apart = |k: usize| if k == i { 1.0 } else { nodes[i].0 - nodes[k].0 };
            (0..SIDE).map(apart).product()
        });
        let legendre = core::array::from_fn(|degree| {
            core::array::from_fn(|i| {
                let (node, weight) = of_whole[i];
                (degree as f64 + 0.5) * weight * polynomial(degree, node)
            })
        });
        Rule { nodes, products, legendre }
    })
}

/// Legendre's.
fn polynomial(degree: usize, x: f64) -> f64 {
    let (mut before, mut last) = (0.0, 1.0);
    for k in 0..degree {
        let k = k as f64;
        (before, last) = (last, ((2.0 * k + 1.0) * x * last - k * before) / (k + 1.0));
    }
    last
}

impl Rule {
    /// Lagrange's polynomials.
    fn shares(&self, at: f64) -> [f64; SIDE] {
        core::array::from_fn(|i| {
            let apart = |k: usize| if k == i { 1.0 } else { at - self.nodes[k].0 };
            (0..SIDE).map(apart).product::<f64>() / self.products[i]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shape;

    #[test]
    fn cells_hold_polynomials_exactly_and_say_so() {
        let body = Body::Flat(Shape::Rectangle { x_m: (-1.0, 2.0), y_m: (0.0, 0.5) });
        let mut mesh = Mesh::new(&[&body]);
        mesh.halve(0, 0);
        mesh.count();
        mesh.halve(mesh.leaves[1], 1);
        mesh.count();
        assert_eq!(mesh.leaves.len(), 3);
        let quartic = |p: DVec3| (p.x - 0.3).powi(4) - p.x * p.y.powi(3) + 2.0;
        let values: Vec<OnNodes> =
            mesh.leaves.iter().map(|cell| mesh.points(*cell).map(|p| quartic(p.place))).collect();
        for at in [[-0.9, 0.1], [0.5, 0.2], [1.7, 0.24], [1.9, 0.49], [2.0, 0.5]] {
            let place = DVec3::new(at[0], at[1], 0.0);
            let found = mesh.value(0, place, &values);
            assert!((found - quartic(place)).abs() < 1e-12, "{found} at {place}");
        }
        // What decays by a factor a degree is off by about as much as is said.
        let along = |k: f64| mesh.points(mesh.leaves[1]).map(|p| (k * (p.place.x - 0.5)).exp());
        let (tame, steep) = (roughness(&along(0.5)), roughness(&along(3.0)));
        assert!(tame[0] < 1e-3 * steep[0] && steep[0] > 1e-4, "{tame:?} {steep:?}");
        assert!(tame[1] < 1e-12 && roughness(&[3.0; NODES])[0] < 1e-12, "{tame:?}");
    }
}
