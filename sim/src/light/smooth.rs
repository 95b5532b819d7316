//! Smooth functions over a rectangle of the sample's plane, as values at a few places. It does not know
//! what they are of.

use core::f64::consts::PI;

use glam::DVec2;

use crate::scene::Shape;

/// A smooth function over a rectangle, interpolated between Chebyshev's points (Berrut and Trefethen
/// 2004).
#[derive(Debug, Clone)]
pub(super) struct Smooth<const N: usize> {
    x_m: (f64, f64),
    y_m: (f64, f64),
    /// Row after row along x.
    values: Vec<f64>,
    /// Chebyshev's points of [0, 1].
    points: [f64; N],
}

impl<const N: usize> Smooth<N> {
    pub(super) fn new(shape: &Shape, of: &dyn Fn(DVec2) -> f64) -> Self {
        let (x_m, y_m) = shape.bounding_box();
        let points: [f64; N] = core::array::from_fn(|i| chebyshev(i, N));
        let at = |(low, high): (f64, f64), part: f64| low + (high - low) * part;
        let place = |v: f64, u: f64| DVec2::new(at(x_m, u), at(y_m, v));
        let places = points.iter().flat_map(|v| points.iter().map(|u| place(*v, *u)));
        let values = places.map(of).collect();
        Self { x_m, y_m, values, points }
    }

    pub(super) fn holds(&self, place: DVec2) -> bool {
        let within = |(low, high): (f64, f64), at: f64| (low..=high).contains(&at);
        within(self.x_m, place.x) && within(self.y_m, place.y)
    }

    pub(super) fn at(&self, place: DVec2) -> f64 {
        let part = |(low, high): (f64, f64), at: f64| (at - low) / (high - low);
        let along = shares(&self.points, part(self.x_m, place.x));
        let across = shares(&self.points, part(self.y_m, place.y));
        let rows = self.values.chunks_exact(N).zip(across);
        let row = |(values, share): (&[f64], f64)| {
            share * values.iter().zip(along).map(|(value, share)| value * share).sum::<f64>()
        };
        rows.map(row).sum()
    }
}

/// The i-th of n points of [0, 1].
fn chebyshev(i: usize, n: usize) -> f64 {
    let half = libm::sin(PI * i as f64 / (2.0 * (n - 1) as f64));
    half * half
}

/// What each point's value counts at a place of [0, 1].
fn shares<const N: usize>(points: &[f64; N], place: f64) -> [f64; N] {
    let mut shares = [0.0; N];
    for (i, share) in shares.iter_mut().enumerate() {
        let apart = place - points[i];
        if apart == 0.0 {
            let mut one = [0.0; N];
            one[i] = 1.0;
            return one;
        }
        let ends = if i == 0 || i == N - 1 { 0.5 } else { 1.0 };
        *share = if i % 2 == 0 { ends } else { -ends } / apart;
    }
    let sum: f64 = shares.iter().sum();
    shares.map(|share| share / sum)
}
