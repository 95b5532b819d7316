//! What lies between readings that neither the fit's functions nor finer ones foretell: a reading that is
//! left out is missed by it, and so, in every sum over directions, is the part of the field that the
//! reading stands for. This is the jackknife over directions: a fit is a weighted sum of its readings; what a
//! functional changes by where one direction's are replaced by what the others foretell is their weight in it times
//! what they are missed by, and the squares of these changes make its variance. (`MacKinnon` and White 1985 as HC3: the
//! covariance of least squares that holds whatever the errors' variances are. It rather says too much the more
//! of a reading is its own, since what a reading misses lies twice as far off its neighbours as what lies between.)

use super::left_out::LeftOut;
use super::wider::Wider;
use crate::triangle::Triangle;
use faer::Mat;

impl Wider<'_> {
    /// Fields over the fit's functions and the finer ones, one u of an independent component each.
    pub(super) fn between(&self, left_out: &LeftOut) -> Vec<Vec<f64>> {
        let mut fields = changes(&self.fit().factor_matrix(), left_out, self.has_unknown());
        for field in &mut fields {
            field.resize(field.len() + self.beyond().len(), 0.0);
        }
        fields
    }
}

/// Changes of a fit's coefficients, one u of an independent component each; `factor` is S of their covariance.
/// None where noise explains what readings are missed by: as it is stated, or, where it `is_unknown`, as the
/// likeliest model has it.
fn changes(factor: &Mat<f64>, left_out: &LeftOut, is_unknown: bool) -> Vec<Vec<f64>> {
    let p = factor.nrows();
    let influence = factor * (factor.transpose() * left_out.rows.as_ref().subrows(0, p));
    let mut triangle = Triangle::new(p, 0);
    let (mut all, mut unexplained) = (0.0, 0.0);
    let mut change = vec![0.0; p];
    for ((j, group), (missed, held)) in left_out.groups.iter().enumerate().zip(left_out.missed()) {
        all += missed * missed;
        unexplained += missed * missed - held * left_out.noise_variance(group, is_unknown);
        let weighted = missed * group.weight();
        let influence = influence.col_as_slice(j);
        change.iter_mut().zip(influence).for_each(|(out, value)| *out = weighted * value);
        triangle.absorb(&change);
    }
    if unexplained <= 0.0 {
        return Vec::new();
    }
    let part = (unexplained / all).sqrt();
    let r = triangle.packed();
    let row = |i: usize| {
        let entry = |j: usize| if j < i { 0.0 } else { part * r[j * (j + 1) / 2 + i] };
        (0..p).map(entry).collect()
    };
    (0..p).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::left_out::Group;
    use super::super::wider::Noise;
    use super::*;
    use glam::DVec3;

    const UNKNOWNS: usize = 4;

    /// Groups of 1 to 3 readings of variance 0.01, a row each; their mean values.
    fn groups() -> (Vec<f64>, Mat<f64>, Vec<f64>) {
        let part = |i: usize, by: f64| ((i + 1) as f64 * by).fract() - 0.5;
        let rows = Mat::from_fn(UNKNOWNS, 15, |k, i| part(i, [0.618, 0.414, 0.732, 0.236][k]));
        let values = (0..15).map(|i| libm::sin(7.0 * f64::from(i))).collect();
        ((0..15).map(|i| 1.0 + f64::from(i % 3)).collect(), rows, values)
    }

    fn solved(weights: &[f64], rows: &Mat<f64>, values: &[f64]) -> crate::triangle::Solution {
        let mut triangle = Triangle::new(UNKNOWNS, 1);
        for (i, weight) in weights.iter().enumerate() {
            let row = rows.col_as_slice(i).iter().chain([&values[i]]);
            triangle.absorb(&row.map(|value| weight.sqrt() * value).collect::<Vec<f64>>());
        }
        triangle.solve().unwrap()
    }

    /// Changes, where so much of the noise is stated.
    fn changed(stated: f64, is_unknown: bool) -> Vec<Vec<f64>> {
        let (counts, rows, values) = groups();
        let weights: Vec<f64> = counts.iter().map(|count| count / 0.01).collect();
        let solution = solved(&weights, &rows, &values);
        let unknowns = solution.unknowns(0);
        let group = |i: usize| Group {
            count: counts[i],
            found: 0.01 * counts[i],
            stated: stated * counts[i],
            residual: values[i] - crate::basis::dot(rows.col_as_slice(i), &unknowns),
            towards: DVec3::Z,
        };
        let (factor, noise) = (solution.inverse_matrix(), Noise { is_stated: false, scale: 1.0 });
        let left_out = LeftOut::of((0..15).map(group).collect(), rows, &factor, noise);
        changes(&factor, &left_out, is_unknown)
    }

    /// One fit for each direction, made without it.
    #[test]
    fn changes_are_those_of_fits_without_each_direction() {
        let (counts, rows, values) = groups();
        let weights: Vec<f64> = counts.iter().map(|count| count / 0.01).collect();
        let whole = solved(&weights, &rows, &values).unknowns(0);
        let mut expected = [0.0; UNKNOWNS];
        for i in 0..weights.len() {
            let mut others = weights.clone();
            others[i] = 0.0;
            let without = solved(&others, &rows, &values).unknowns(0);
            for k in 0..UNKNOWNS {
                expected[k] += (without[k] - whole[k]).powi(2);
            }
        }
        let found = changed(0.0, false);
        for (k, expected) in expected.into_iter().enumerate() {
            let found: f64 = found.iter().map(|field| field[k] * field[k]).sum();
            assert!((found / expected - 1.0).abs() < 1e-9, "{k}: {found} {expected}");
        }
    }

    #[test]
    fn what_noise_explains_is_no_change() {
        // What is missed is of the order of 1.
        assert!(changed(10.0, false).is_empty());
        let squares = |fields: Vec<Vec<f64>>| fields.iter().map(|field| field[0].powi(2)).sum();
        let (none, half): (f64, f64) = (squares(changed(0.0, false)), squares(changed(0.1, false)));
        assert!(half < 0.95 * none && half > 0.3 * none, "{half} {none}");
        // Where nothing is stated it is the noise that was found.
        let unknown: f64 = squares(changed(0.0, true));
        assert!((unknown / squares(changed(0.01, false)) - 1.0).abs() < 1e-12);
    }
}
