//! Counts of a run's samples, which hold where the samples themselves are not all kept.

use crate::rig::calibration::{Flag, Part, Sample};

/// What a run's samples amount to by number.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    /// Samples.
    pub(super) measured: usize,
    /// Those that carry a flag.
    pub(super) flagged: usize,
    /// Those that have no part in a fit.
    pub(super) left_out: usize,
    /// Run time at which the last integration ended, seconds.
    pub(super) ended_s: f64,
    /// In the order of [`Flag::ALL`].
    by_flag: [usize; Flag::ALL.len()],
}

impl Tally {
    /// Of samples that are all there.
    pub(super) fn of(samples: &[Sample]) -> Self {
        let mut tally = Self::default();
        for sample in samples {
            tally.take(sample);
        }
        tally
    }

    /// Counts one more, with the flags that it has in the end.
    pub(super) fn take(&mut self, sample: &Sample) {
        self.measured += 1;
        self.flagged += usize::from(!sample.flags.is_empty());
        self.left_out += usize::from(sample.part() == Part::None);
        self.ended_s = self.ended_s.max(sample.time_s + sample.dwell_s);
        for (count, flag) in self.by_flag.iter_mut().zip(Flag::ALL) {
            *count += usize::from(sample.flags.contains(flag));
        }
    }

    /// The flags that occur, with how often.
    pub(super) fn flags(&self) -> impl Iterator<Item = (&'static str, usize)> {
        let named = Flag::ALL.map(Flag::name).into_iter().zip(self.by_flag);
        named.filter(|(_, count)| *count > 0)
    }
}
