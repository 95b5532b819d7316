//! One dwell: settle at rest, then take so many ADC readings, each ending one ADC period after
//! the one before. It knows the board and the moments, not the queue.

use super::axes::Axes;
use super::statistics::Statistics;
use crate::{AxisCounts, Board, BoardFault, Dwell, DwellResult, Illumination, Instant};

pub(super) struct Dwelling {
    dwell: Dwell,
    statistics: Statistics,
    rate_hz: u32,
    /// ADC readings to take.
    n: u32,
    /// When the integration begins.
    begin: Instant,
    /// The pose latched then; `None` while it settles.
    start: Option<AxisCounts>,
}

impl Dwelling {
    /// How many ADC readings fit into the dwell; `None` for none, or for more than 32 bits hold.
    pub(super) fn readings(dwell: &Dwell, rate_hz: u32) -> Option<u32> {
        let n = u64::from(dwell.duration_us) * u64::from(rate_hz) / 1_000_000;
        u32::try_from(n).ok().filter(|n| *n > 0)
    }

    /// Starts to settle.
    pub(super) fn begin(dwell: Dwell, now: Instant, board: &mut impl Board) -> Self {
        let (adc_bits, rate_hz) = board.adc();
        board.prepare_dwell(now, illumination(&dwell));
        Self {
            statistics: Statistics::new(adc_bits),
            rate_hz,
            n: Self::readings(&dwell, rate_hz).unwrap_or(0),
            begin: Instant::from_micros(now.micros().saturating_add(dwell.settle_us.into())),
            start: None,
            dwell,
        }
    }

    /// When to [`progress`](Dwelling::progress) next: the end of the settling, or of the next
    /// ADC reading.
    pub(super) fn due(&self) -> Instant {
        match self.start {
            None => self.begin,
            Some(_) => self.end_of(self.statistics.n().saturating_add(1)),
        }
    }

    /// When a board that answers late needs to be called: at the end of the settling, and when
    /// all is over.
    pub(super) fn wake(&self) -> Instant {
        if self.start.is_none() { self.begin } else { self.end_of(self.n) }
    }

    /// Goes on at the moment that is due. The reading, when it is complete.
    pub(super) fn progress(
        &mut self,
        axes: &Axes,
        board: &mut impl Board,
    ) -> Result<Option<DwellResult>, BoardFault> {
        let now = self.due();
        if self.start.is_none() {
            board.begin_dwell(now, illumination(&self.dwell));
            self.start = Some(axes.readback(now, board));
        } else {
            self.statistics.take(board.convert(now)?);
        }
        Ok(if self.statistics.n() < self.n { None } else { Some(self.result(now, axes, board)) })
    }

    /// The end of the k-th ADC reading, counted from the begin, so that no rounding adds up.
    fn end_of(&self, k: u32) -> Instant {
        let us = u64::from(k) * 1_000_000 / u64::from(self.rate_hz.max(1));
        Instant::from_micros(self.begin.micros().saturating_add(us))
    }

    fn result(&self, now: Instant, axes: &Axes, board: &mut impl Board) -> DwellResult {
        DwellResult {
            id: self.dwell.id,
            reading: self.dwell.reading,
            gain: self.dwell.gain,
            n: self.statistics.n(),
            mean: self.statistics.mean(),
            variance: self.statistics.variance(),
            min: self.statistics.min(),
            max: self.statistics.max(),
            saturated: self.statistics.saturated(),
            start: self.start.clone().unwrap_or_default(),
            end: axes.readback(now, board),
            start_tick: self.begin.tick(),
            end_tick: now.tick(),
        }
    }
}

const fn illumination(dwell: &Dwell) -> Illumination {
    Illumination { reading: dwell.reading, gain: dwell.gain, shutter: dwell.shutter }
}
