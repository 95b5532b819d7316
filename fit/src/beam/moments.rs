//! Averages of polynomials of the place over beams that nothing cuts, from the beam's moments. It
//! does not know which rule a beam deserves.
//!
//! Pₐ(x + δ) is its Taylor series about the beam's own place x: powers of δ times what depends on x
//! alone. So the mean over a beam of position terms times functions of the direction is a sum over
//! the means of δₓᵐ δᵧⁿ times those functions, which all beams of one direction share, wherever they
//! look. A raster of many places asks for few directions: to average costs as much as a sum then.
//!
//! The series' terms may be larger than what they add up to, and their rounding with them: by as much
//! as the same series of absolute values says. Beyond [`GROWTH_MAX`] there is no answer here.

use std::collections::HashMap;

use super::directions::Directions;
use super::sight::Sight;
use super::{Averager, Means};
use crate::basis::{Basis, dot};
use crate::{Chart, Ray};

/// Moments found so far, of beams of a rule and a direction.
#[derive(Debug, Default)]
pub(super) struct Moments {
    known: HashMap<(usize, u64, u64), Moment>,
    numbers: usize,
}

/// The moments of one beam.
#[derive(Debug)]
struct Moment {
    /// The largest |δ| in x and y, in half widths of the region.
    reach: (f64, f64),
    /// Powers in the order of the position terms, for each the functions of the direction.
    means: Vec<f64>,
}

impl Averager {
    /// The row of a beam that nothing cuts, by a rule; false, and nothing done, where the basis or the
    /// size of the beam does not allow for it.
    pub(super) fn row_of_moments(
        &self,
        rule: &Directions,
        ray: &Ray,
        basis: &Basis,
        scratch: &mut Means,
        out: &mut [f64],
    ) -> bool {
        let is_on_plane = matches!(basis.region().chart, Chart::Surface);
        if self.ends.is_empty() || !basis.places().is_polynomial() || !is_on_plane {
            return false;
        }
        let key = (rule.degree, ray.theta_rad.to_bits(), ray.phi_rad.to_bits());
        if !scratch.moments.known.contains_key(&key) {
            let moment = self.moment(rule, ray, basis, scratch);
            let moments = &mut scratch.moments;
            if moments.numbers > NUMBERS_MAX {
                *moments = Moments::default();
            }
            moments.numbers += moment.means.len();
            moments.known.insert(key, moment);
        }
        let degree = basis.places().rule_degree();
        let (x, y) = basis.region().scaled(ray);
        let (x, y) = (series(degree, x), series(degree, y));
        let moment = &scratch.moments.known[&key];
        if growth(&x, moment.reach.0) * growth(&y, moment.reach.1) > GROWTH_MAX {
            return false;
        }
        add_up(&x, &y, &moment.means, out);
        true
    }

    fn moment(&self, rule: &Directions, ray: &Ray, basis: &Basis, scratch: &mut Means) -> Moment {
        let (degree, region) = (basis.places().rule_degree(), basis.region());
        let scale = |(from, to): (f64, f64)| if to > from { 2.0 / (to - from) } else { 0.0 };
        let scale = (scale(region.x_m), scale(region.y_m));
        let sight = Sight::new(&Ray { x_m: 0.0, y_m: 0.0, ..*ray }, Chart::Surface);
        let mut means = vec![0.0; basis.len()];
        let mut powers = Powers::new(degree);
        let mut reach = (0.0_f64, 0.0_f64);
        for node in &rule.nodes {
            let Some(direction) = sight.direction(node.slope) else { continue };
            let shear = sight.shear(&self.optics.beam, node);
            let ring = &rule.rings[node.ring];
            // In half widths, of so many reaches along the shift and across it.
            let place = |(along, across): (f64, f64)| {
                let (along, across) = (along * ring.reach_m, across * ring.reach_m);
                let s1 = along * node.cos - across * node.sin;
                let s2 = along * node.sin + across * node.cos;
                let (x, y) = sight.place(shear.place((s1, s2)));
                (x * scale.0, y * scale.1)
            };
            let (at, along, across) = (place((0.0, 0.0)), place((1.0, 0.0)), place((0.0, 1.0)));
            let x = [at.0, along.0 - at.0, across.0 - at.0];
            let y = [at.1, along.1 - at.1, across.1 - at.1];
            let farthest = |[at, along, across]: [f64; 3]| at.abs() + libm::hypot(along, across);
            reach = (reach.0.max(farthest(x)), reach.1.max(farthest(y)));
            powers.means(x, y, &ring.powers, &mut scratch.position);
            scratch.direction_along(direction, basis);
            scratch.add(node.weight, &mut means);
        }
        Moment { reach, means }
    }
}

/// Powers of two lengths that are linear in two others, as polynomials of these: coefficients by
/// rising degree, and in each by rising power of the second.
struct Powers {
    degree: usize,
    /// xᵃ yᵇ, by rising a + b and then b, each with room for the highest.
    polynomials: Vec<f64>,
}

impl Powers {
    fn new(degree: usize) -> Self {
        let mut polynomials = vec![0.0; count(degree) * count(degree)];
        polynomials[0] = 1.0;
        Self { degree, polynomials }
    }

    /// The means of all xᵃ yᵇ from those of the others' powers; x and y by what they are where the
    /// others are zero, and how they grow with the first and the second.
    fn means(&mut self, x: [f64; 3], y: [f64; 3], of_others: &[f64], means: &mut [f64]) {
        for total in 0..self.degree {
            for of_y in 0..=total {
                self.multiply(term(total, of_y), x, term(total + 1, of_y), total);
            }
            self.multiply(term(total, total), y, term(total + 1, total + 1), total);
        }
        let mut polynomials = self.polynomials.chunks_exact(count(self.degree)).zip(means);
        for total in 0..=self.degree {
            for (polynomial, mean) in polynomials.by_ref().take(total + 1) {
                *mean = dot(&polynomial[..count(total)], of_others);
            }
        }
    }

    /// Makes one polynomial another one, of a degree, times a linear one.
    fn multiply(&mut self, from: usize, by: [f64; 3], to: usize, degree: usize) {
        let room = count(self.degree);
        let (before, after) = self.polynomials.split_at_mut(to * room);
        let (from, to) = (&before[from * room..][..count(degree)], &mut after[..count(degree + 1)]);
        to.fill(0.0);
        for total in 0..=degree {
            let own = &from[term(total, 0)..][..=total];
            let (low, high) = to[term(total, 0)..].split_at_mut(total + 1);
            for (i, value) in own.iter().enumerate() {
                low[i] += by[0] * value;
                high[i] += by[1] * value;
                high[i + 1] += by[2] * value;
            }
        }
    }
}

/// Products of powers up to this degree in all.
const fn count(degree: usize) -> usize {
    term(degree + 1, 0)
}

/// The place of a product of powers of this degree in all, the second's being this one.
const fn term(total: usize, of_second: usize) -> usize {
    total * (total + 1) / 2 + of_second
}

/// The Taylor coefficients at `t` of the Legendre polynomials up to a degree, each scaled by √(2k+1):
/// by the three-term recurrence, on polynomials of the distance from `t`.
fn series(degree: usize, t: f64) -> Vec<Vec<f64>> {
    let mut series: Vec<Vec<f64>> = vec![vec![1.0]];
    for k in 0..degree {
        let (this, last) = (&series[k], k.checked_sub(1).map(|before| &series[before]));
        let of = |series: Option<&Vec<f64>>, power: Option<usize>| {
            let found = series.zip(power).and_then(|(series, power)| series.get(power));
            found.copied().unwrap_or(0.0)
        };
        let order = k as f64;
        let next = |m: usize| {
            let shifted = t * of(Some(this), Some(m)) + of(Some(this), m.checked_sub(1));
            ((2.0 * order + 1.0) * shifted - order * of(last, Some(m))) / (order + 1.0)
        };
        let next = (0..=k + 1).map(next).collect();
        series.push(next);
    }
    for (k, own) in series.iter_mut().enumerate() {
        let norm = (2.0 * k as f64 + 1.0).sqrt();
        for part in own {
            *part *= norm;
        }
    }
    series
}

/// How large the highest polynomial's terms are together at a distance.
fn growth(series: &[Vec<f64>], reach: f64) -> f64 {
    let highest = series.last().map_or(&[][..], Vec::as_slice);
    highest.iter().rev().fold(0.0, |sum, part| sum * reach + part.abs())
}

/// The averages of the position terms times the functions of the direction.
fn add_up(x: &[Vec<f64>], y: &[Vec<f64>], means: &[f64], out: &mut [f64]) {
    let degree = x.len() - 1;
    let angular = out.len() / ((degree + 1) * (degree + 2) / 2);
    // Of the term (or the power) a in x and b in y.
    let place = |a: usize, b: usize| angular * term(a + b, b);
    out.fill(0.0);
    let mut along_y = vec![0.0; angular];
    for (b, of_y) in y.iter().enumerate() {
        for m in 0..=degree - b {
            along_y.fill(0.0);
            for (n, factor) in of_y.iter().enumerate() {
                let moment = &means[place(m, n)..][..angular];
                along_y.iter_mut().zip(moment).for_each(|(sum, mean)| *sum += factor * mean);
            }
            for (a, of_x) in x.iter().enumerate().take(degree - b + 1).skip(m) {
                let term = &mut out[place(a, b)..][..angular];
                term.iter_mut().zip(&along_y).for_each(|(out, mean)| *out += of_x[m] * mean);
            }
        }
    }
}

/// How much larger than the terms the series may be: rounding is a few 1e-16 times as much.
const GROWTH_MAX: f64 = 1e5;
/// Numbers that are kept at most, 8 MB; then it begins anew.
const NUMBERS_MAX: usize = 1 << 20;

#[cfg(test)]
mod tests {
    use radiometry::beam::Beam;

    use super::super::Optics;
    use super::*;
    use crate::{BasisSpec, Region};

    /// Rows by moments and by places, of beams over a region; how many had moments.
    fn compared(half_m: (f64, f64), degrees: (usize, usize)) -> usize {
        let region =
            Region::surface((0.003 - half_m.0, 0.003 + half_m.0), (-half_m.1, half_m.1), 1.2);
        let basis = Basis::new(BasisSpec::zernike(degrees.0, degrees.1), region).unwrap();
        let beam = Beam::of_spot(0.00625, 0.0025, 0.3).unwrap();
        let averager = Averager::new(&Optics { beam, outline: None }, &basis).unwrap();
        let mut scratch = Means::new(&basis);
        let (mut of_moments, mut of_places) = (vec![0.0; basis.len()], vec![0.0; basis.len()]);
        let mut count = 0;
        for (theta_rad, phi_rad) in [(0.0, 0.0), (0.5, 1.0), (1.1, -2.5)] {
            for part in [(0.0, 0.0), (1.0, -1.0), (-0.7, 0.4), (-1.0, 1.02)] {
                let (x_m, y_m) = (0.003 + part.0 * half_m.0, part.1 * half_m.1);
                let ray = Ray { x_m, y_m, theta_rad, phi_rad };
                for rule in &averager.smooth[..3] {
                    averager.row_of_places(rule, &ray, &basis, &mut scratch, &mut of_places);
                    let by = &mut of_moments;
                    if !averager.row_of_moments(rule, &ray, &basis, &mut scratch, by) {
                        continue;
                    }
                    count += 1;
                    let size = of_places.iter().fold(0.0_f64, |most, term| most.max(term.abs()));
                    for (found, expected) in of_moments.iter().zip(&of_places) {
                        let off = (found - expected).abs();
                        assert!(off < 1e-10 * size, "{found} {expected} {ray:?}");
                    }
                }
            }
        }
        count
    }

    #[test]
    fn rows_are_those_of_the_places_one_by_one() {
        assert_eq!(compared((0.03, 0.015), (2, 4)), 36);
        assert_eq!(compared((0.03, 0.03), (1, 8)), 36);
        assert_eq!(compared((0.03, 0.0), (3, 5)), 36, "a line");
    }

    #[test]
    fn series_that_would_lose_digits_are_refused() {
        let wide = compared((0.002, 0.002), (1, 12));
        assert!(wide < 36, "{wide} of beams wider than the region");
    }
}
