//! Cubic splines through values, with the ends of the field's interpolation routines: not-a-knot
//! (de Boor 1978, "A Practical Guide to Splines", chapter IV) or periodic.

/// A cubic spline through points, by its second derivatives there.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cubic {
    at: Vec<f64>,
    values: Vec<f64>,
    second: Vec<f64>,
}

impl Cubic {
    /// Through points in ascending order. The third derivative goes on smoothly at the last nodes
    /// but one, so that any cubic is reproduced; through three points a parabola, through two a
    /// line, through one a constant. `None` for none, or where they don't ascend.
    pub(super) fn not_a_knot(at: Vec<f64>, values: Vec<f64>) -> Option<Self> {
        if at.is_empty() || at.len() != values.len() || !ascends(&at) {
            return None;
        }
        let second = not_a_knot(&at, &values);
        Some(Self { at, values, second })
    }

    /// Through points of one period in ascending order, at least three. `None` where there are
    /// fewer, or they don't ascend within a period.
    pub(super) fn periodic(at: Vec<f64>, values: Vec<f64>, period: f64) -> Option<Self> {
        let n = at.len();
        if n < 3 || n != values.len() || !ascends(&at) || at[n - 1] - at[0] >= period {
            return None;
        }
        let mut second = periodic(&at, &values, period);
        let (mut at, mut values) = (at, values);
        // The period's end is its beginning.
        at.push(at[0] + period);
        values.push(values[0]);
        second.push(second[0]);
        Some(Self { at, values, second })
    }

    /// Its value; beyond the ends the last piece goes on. A periodic one is asked within a period
    /// from its first node on.
    pub(super) fn value(&self, at: f64) -> f64 {
        let last = self.at.len() - 1;
        if last == 0 {
            return self.values[0];
        }
        let i = self.at.partition_point(|node| *node <= at).clamp(1, last) - 1;
        let h = self.at[i + 1] - self.at[i];
        let (a, b) = ((self.at[i + 1] - at) / h, (at - self.at[i]) / h);
        let bend = (a * a * a - a) * self.second[i] + (b * b * b - b) * self.second[i + 1];
        a * self.values[i] + b * self.values[i + 1] + bend * h * h / 6.0
    }
}

/// What each node's value counts for at some places: a row a place. Splines are linear in their
/// values.
pub(super) fn weights(
    count: usize,
    spline: impl Fn(Vec<f64>) -> Option<Cubic>,
    places: &[f64],
) -> Option<Vec<Vec<f64>>> {
    let unit = |i: usize| (0..count).map(|j| f64::from(u8::from(i == j))).collect();
    let cardinal: Option<Vec<Cubic>> = (0..count).map(|i| spline(unit(i))).collect();
    let cardinal = cardinal?;
    Some(places.iter().map(|at| cardinal.iter().map(|c| c.value(*at)).collect()).collect())
}

fn ascends(at: &[f64]) -> bool {
    at.windows(2).all(|pair| pair[1] > pair[0])
}

fn steps(at: &[f64]) -> Vec<f64> {
    at.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

fn not_a_knot(at: &[f64], values: &[f64]) -> Vec<f64> {
    let n = at.len();
    if n < 3 {
        return vec![0.0; n];
    }
    let h = steps(at);
    let slope = |i: usize| (values[i + 1] - values[i]) / h[i];
    if n == 3 {
        return vec![2.0 * (slope(1) - slope(0)) / (h[0] + h[1]); 3];
    }
    // One equation for each inner node; the ends are eliminated by their own condition.
    let (mut lower, mut upper) = (h[..n - 2].to_vec(), h[1..].to_vec());
    let mut middle: Vec<f64> = (1..n - 1).map(|i| 2.0 * (h[i - 1] + h[i])).collect();
    let right: Vec<f64> = (1..n - 1).map(|i| 6.0 * (slope(i) - slope(i - 1))).collect();
    let (first, last) = (h[0], h[n - 2]);
    middle[0] += first * (first + h[1]) / h[1];
    upper[0] -= first * first / h[1];
    middle[n - 3] += last * (last + h[n - 3]) / h[n - 3];
    lower[n - 3] -= last * last / h[n - 3];
    let inner = tridiagonal(&lower, &middle, &upper, &right);
    let end = |near: f64, next: f64, h: f64, h_next: f64| near + (near - next) * h / h_next;
    let mut second = vec![end(inner[0], inner[1], first, h[1])];
    second.extend(&inner);
    second.push(end(inner[n - 3], inner[n - 4], last, h[n - 3]));
    second
}

/// The cyclic system by Sherman and Morrison (1950): a tridiagonal one and a correction of rank one.
fn periodic(at: &[f64], values: &[f64], period: f64) -> Vec<f64> {
    let n = at.len();
    let mut h = steps(at);
    h.push(at[0] + period - at[n - 1]);
    let before = |i: usize| (i + n - 1) % n;
    let slope = |i: usize| (values[(i + 1) % n] - values[i]) / h[i];
    let lower: Vec<f64> = (0..n).map(|i| h[before(i)]).collect();
    let mut middle: Vec<f64> = (0..n).map(|i| 2.0 * (h[before(i)] + h[i])).collect();
    let right: Vec<f64> = (0..n).map(|i| 6.0 * (slope(i) - slope(before(i)))).collect();
    // The two corners are equal: h[n - 1] = (u vᵀ) with u = (g, 0, …, c), v = (1, 0, …, c/g).
    let corner = h[n - 1];
    let pivot = -middle[0];
    middle[0] -= pivot;
    middle[n - 1] -= corner * corner / pivot;
    let plain = tridiagonal(&lower, &middle, &h, &right);
    let mut of_corner = vec![0.0; n];
    (of_corner[0], of_corner[n - 1]) = (pivot, corner);
    let turned = tridiagonal(&lower, &middle, &h, &of_corner);
    let along = |x: &[f64]| x[0] + x[n - 1] * corner / pivot;
    let factor = along(&plain) / (1.0 + along(&turned));
    plain.iter().zip(&turned).map(|(plain, turned)| plain - factor * turned).collect()
}

/// Thomas's elimination: the systems here are diagonally dominant. `lower[i]` stands left of
/// `middle[i]`, `upper[i]` right of it; the first and the last of them outside are not read.
fn tridiagonal(lower: &[f64], middle: &[f64], upper: &[f64], right: &[f64]) -> Vec<f64> {
    let n = middle.len();
    let (mut scaled, mut x) = (vec![0.0; n], vec![0.0; n]);
    for i in 0..n {
        let (above, known) = if i == 0 { (0.0, 0.0) } else { (scaled[i - 1], x[i - 1]) };
        let left = if i == 0 { 0.0 } else { lower[i] };
        let pivot = middle[i] - left * above;
        scaled[i] = upper[i] / pivot;
        x[i] = (right[i] - left * known) / pivot;
    }
    for i in (0..n - 1).rev() {
        x[i] -= scaled[i] * x[i + 1];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_are_reproduced_from_four_uneven_nodes_on_and_beyond_the_ends() {
        let cubic = |t: f64| 2.0 - t + 0.5 * t * t - 0.25 * t * t * t;
        for nodes in [vec![-1.0, 0.2, 0.9, 2.0], vec![-3.0, -1.0, -0.5, 0.1, 0.7, 2.0, 2.1]] {
            let values = nodes.iter().map(|t| cubic(*t)).collect();
            let spline = Cubic::not_a_knot(nodes, values).unwrap();
            for t in [-3.5, -1.0, -0.3, 0.0, 1.234, 2.5] {
                assert!((spline.value(t) - cubic(t)).abs() < 1e-12, "{t}");
            }
        }
    }

    #[test]
    fn few_points_make_the_polynomial_through_them() {
        let of = |at: &[f64], f: fn(f64) -> f64| {
            Cubic::not_a_knot(at.to_vec(), at.iter().map(|t| f(*t)).collect()).unwrap()
        };
        assert!((of(&[1.0], |_| 7.0).value(3.0) - 7.0).abs() < 1e-15);
        assert!((of(&[1.0, 2.0], |t| 3.0 * t).value(5.0) - 15.0).abs() < 1e-13);
        assert!((of(&[0.0, 1.0, 3.0], |t| t * t - t).value(2.0) - 2.0).abs() < 1e-13);
        assert_eq!(Cubic::not_a_knot(vec![], vec![]), None);
        assert_eq!(Cubic::not_a_knot(vec![1.0, 1.0], vec![0.0, 0.0]), None);
    }

    #[test]
    fn a_periodic_spline_is_smooth_through_its_seam_and_of_fourth_order() {
        let tau = core::f64::consts::TAU;
        let error = |n: u32| {
            let at: Vec<f64> = (0..n).map(|i| tau * f64::from(i) / f64::from(n)).collect();
            let values = at.iter().map(|t| libm::sin(*t)).collect();
            let spline = Cubic::periodic(at, values, tau).unwrap();
            let inside = (0..1000).map(|i| tau * f64::from(i) / 1000.0);
            inside.map(|t| (spline.value(t) - libm::sin(t)).abs()).fold(0.0, f64::max)
        };
        let ratio = error(16) / error(32);
        assert!((15.0..18.0).contains(&ratio), "{ratio}");
        // Twice continuously differentiable through the seam, by one-sided differences.
        let at = vec![0.3, 1.0, 2.5, 4.0, 5.5];
        let spline = Cubic::periodic(at, vec![1.0, -2.0, 0.5, 3.0, 1.5], tau).unwrap();
        let h = 1e-4;
        let left = |k: f64| spline.value(0.3 + tau - k * h);
        let right = |k: f64| spline.value(0.3 + k * h);
        let second = |f: &dyn Fn(f64) -> f64| {
            (2.0 * f(0.0) - 5.0 * f(1.0) + 4.0 * f(2.0) - f(3.0)) / (h * h)
        };
        assert!(
            (second(&left) - second(&right)).abs() < 1e-2,
            "{} {}",
            second(&left),
            second(&right)
        );
        let first = |f: &dyn Fn(f64) -> f64| (-3.0 * f(0.0) + 4.0 * f(1.0) - f(2.0)) / (2.0 * h);
        assert!((first(&left) + first(&right)).abs() < 1e-5);
    }

    #[test]
    fn weights_sum_to_one_and_give_the_spline() {
        let at = [0.0, 1.0, 2.0, 4.0, 5.0];
        let values = [1.0, 3.0, -1.0, 0.5, 2.0];
        let spline = |v: Vec<f64>| Cubic::not_a_knot(at.to_vec(), v);
        let places = [0.5, 3.3, 5.0];
        let rows = weights(5, spline, &places).unwrap();
        for (row, place) in rows.iter().zip(places) {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-13);
            let value: f64 = row.iter().zip(values).map(|(w, v)| w * v).sum();
            assert!((value - spline(values.to_vec()).unwrap().value(place)).abs() < 1e-13);
        }
    }
}
