//! What the readback of an axis is off by belongs to the position: the same for all samples that were
//! taken there, another one elsewhere. As the fit takes it: a component for each position that
//! samples share, and one jitter for those that stand alone.

use std::sync::Arc;

use fit::{Common, Shift};

use super::fit_input::ray;
use super::{Component, Sample, Spread};
use crate::rig::{AXES, AxisName, AxisPositions};

/// Positions that have a component of their own at most. More of them are taken together in so many
/// components, each with the positions' effects under random signs: the sum of their squares is the
/// same on average, and within a tenth in u (its variance is that of so many squares: 2/64).
const COMPONENTS_MAX: usize = 64;

/// The positions of an axis that samples share.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    /// To the last bit, rising.
    positions: Arc<[u64]>,
    /// Whether some samples stand alone.
    is_alone: bool,
}

impl Shared {
    pub(super) fn of(spread: &Spread, axis: AxisName) -> Self {
        let counts = spread.positions(axis);
        let positions: Arc<[u64]> =
            counts.iter().filter(|(_, n)| **n > 1).map(|(bits, _)| *bits).collect();
        let is_alone = positions.len() < counts.len();
        Self { positions, is_alone }
    }
}

/// The components of an axis's readback, of samples that are all or some of those that share positions.
pub(super) fn components(
    component: &Component,
    axis: AxisName,
    samples: &Arc<[Sample]>,
    Shared { positions: shared, is_alone }: &Shared,
) -> Vec<Common> {
    let place = AXES.iter().position(|name| *name == axis).unwrap_or(0);
    let position = move |sample: &Sample| {
        let AxisPositions(positions) = sample.positions;
        positions[place]
    };
    let moved = |times: Box<dyn Fn(u64) -> f64 + Send + Sync>| {
        let (samples, own) = (Arc::clone(samples), component.clone());
        move |i: usize, at: &fit::Ray| {
            let times = times(position(&samples[i]).to_bits());
            // The very same ray, to the last bit, where nothing moves.
            if times.abs() > 0.0 { ray(own.ray_seen(&samples[i], times)) } else { *at }
        }
    };
    let common = |place: String, shift: Shift| Common {
        name: format!("{}{place}", component.name),
        u: component.u,
        shift,
    };
    let mut all = Vec::new();
    if *is_alone {
        let is_shared = Arc::clone(shared);
        let alone = moved(Box::new(move |bits| f64::from(is_shared.binary_search(&bits).is_err())));
        all.push(common(String::new(), Shift::Jitter(Box::new(alone))));
    }
    if shared.len() <= COMPONENTS_MAX {
        for &bits in shared.iter() {
            let here = moved(Box::new(move |at| f64::from(at == bits)));
            let shown = axis.in_file_unit(f64::from_bits(bits));
            all.push(common(format!(" @ {shown}"), Shift::Ray(Box::new(here))));
        }
        return all;
    }
    let size = 1.0 / libm::sqrt(COMPONENTS_MAX as f64);
    for k in 0..COMPONENTS_MAX as u64 {
        let shared = Arc::clone(shared);
        let signed = moved(Box::new(move |bits| {
            if shared.binary_search(&bits).is_err() {
                return 0.0;
            }
            if sign(bits, k) { size } else { -size }
        }));
        all.push(common(format!(" @ combination {k}"), Shift::Ray(Box::new(signed))));
    }
    all
}

/// A coin for each position and combination, always the same (`SplitMix64`).
fn sign(bits: u64, k: u64) -> bool {
    let mut z = bits ^ k.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ (z >> 31)) & 1 == 1
}
