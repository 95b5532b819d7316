//! Over which ranges, sessions and positions samples are spread: all that decides what they share, however
//! many they are. It grows with the positions that axes with a readback can tell apart, not with the samples.

use std::collections::{BTreeMap, BTreeSet};

use super::component::{Component, Effect};
use super::{Calibration, Sample};
use crate::rig::{AXES, AxisName, AxisPositions};

/// What samples have among them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Spread {
    pub(super) gains: BTreeSet<u8>,
    pub(super) sessions: BTreeSet<u32>,
    /// By axis, how many samples each position has, to the last bit.
    positions: [BTreeMap<u64, usize>; AXES.len()],
}

impl Spread {
    /// Of all of them at once.
    pub fn of<'s>(samples: impl IntoIterator<Item = &'s Sample>) -> Self {
        let mut spread = Self::default();
        samples.into_iter().for_each(|sample| spread.take(sample));
        spread
    }

    /// Takes one in.
    pub fn take(&mut self, sample: &Sample) {
        self.gains.insert(sample.gain);
        self.sessions.insert(sample.session);
        let AxisPositions(positions) = sample.positions;
        for (counts, position) in self.positions.iter_mut().zip(positions) {
            *counts.entry(position.to_bits()).or_default() += 1;
        }
    }

    /// The positions of an axis and how many samples each has.
    pub(super) fn positions(&self, axis: AxisName) -> &BTreeMap<u64, usize> {
        let place = AXES.iter().position(|name| *name == axis).unwrap_or(0);
        &self.positions[place]
    }

    /// Whether a component concerns one of the samples at least.
    pub(super) fn is_concerned(&self, component: &Component) -> bool {
        match component.effect {
            Effect::Scale { gain: Some(gain) } | Effect::Offset { gain } => {
                self.gains.contains(&gain)
            }
            Effect::Axis { session: Some(session), .. } => self.sessions.contains(&session),
            _ => !self.gains.is_empty(),
        }
    }

    /// Whether it concerns all of them.
    pub(super) fn is_concerned_alike(&self, component: &Component) -> bool {
        let is_one = match component.effect {
            Effect::Scale { gain: Some(_) } | Effect::Offset { .. } => self.gains.len() == 1,
            Effect::Axis { session: Some(_), .. } => self.sessions.len() == 1,
            _ => true,
        };
        is_one && self.is_concerned(component)
    }
}

impl Calibration<'_> {
    /// What samples of such a spread share, those with u = 0 left out.
    pub fn components(&self, spread: &Spread) -> Vec<Component> {
        super::component::of(self.rig, &self.darks, spread)
    }
}
