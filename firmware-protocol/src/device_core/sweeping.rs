//! One sweep: to where it sets out, up to speed, window after window, and to rest. It knows the
//! axes, the board and the moments, not the queue.

use core::time::Duration;

use super::axes::Axes;
use super::statistics::Statistics;
use super::windows::Windows;
use crate::{
    AxisCounts, Board, BoardFault, Illumination, Instant, Shutter, Sweep, SweepMotion, Window,
};

pub(super) struct Sweeping {
    sweep: Sweep,
    motion: SweepMotion,
    stage: Stage,
}

enum Stage {
    /// On the way to where it sets out.
    Approaching,
    /// At rest there, until then.
    Settling(Instant),
    /// Accelerating since then.
    Ramping(Instant),
    /// At constant speed before the first window; set out then.
    Leading(Instant),
    Measuring(Measuring),
    Braking,
}

/// What a sweep has of its windows.
struct Measuring {
    set_out: Instant,
    statistics: Statistics,
    /// ADC readings of all windows so far.
    taken: u64,
    index: u16,
    /// The pose latched at the window's begin, and when.
    start: AxisCounts,
    begin: Instant,
}

impl Sweeping {
    /// Sets out for the place from which it sweeps.
    pub(super) fn begin(
        sweep: Sweep,
        motion: SweepMotion,
        now: Instant,
        axes: &mut Axes,
        board: &mut impl Board,
    ) -> Self {
        board.prepare_dwell(now, illumination(&sweep, 0));
        axes.go_to(now, motion.axes().iter().map(|cruise| cruise.from), board);
        Self { sweep, motion, stage: Stage::Approaching }
    }

    /// When to [`progress`](Self::progress) next; `None` while the axes' coming to rest is all
    /// that it waits for.
    pub(super) fn due(&self, axes: &Axes, now: Instant) -> Option<Instant> {
        match &self.stage {
            Stage::Approaching | Stage::Braking => axes.is_at_rest().then_some(now),
            Stage::Settling(until) => Some(*until),
            Stage::Ramping(set_out) => Some(after(*set_out, self.motion.ramp_us())),
            Stage::Leading(set_out) => Some(after(*set_out, self.motion.before_us())),
            Stage::Measuring(at) => Some(self.reading_end(at.set_out, at.taken + 1)),
        }
    }

    /// When a board that answers late needs to be called: where a window ends, and not for each of
    /// its ADC readings.
    pub(super) fn wake(&self, axes: &Axes, now: Instant) -> Option<Instant> {
        match &self.stage {
            Stage::Measuring(at) => Some(self.window_end(at.set_out, at.index)),
            _ => self.due(axes, now),
        }
    }

    /// Goes on at the moment that is due. `true` when the axes rest behind the last window.
    pub(super) fn progress(
        &mut self,
        now: Instant,
        axes: &mut Axes,
        board: &mut impl Board,
        windows: &mut Windows,
    ) -> Result<bool, BoardFault> {
        if self.due(axes, now).is_none_or(|due| due > now) {
            return Ok(false);
        }
        match &mut self.stage {
            Stage::Approaching => {
                self.stage = Stage::Settling(after(now, self.sweep.settle_us.into()));
            }
            Stage::Settling(_) => {
                axes.sweep(now, &self.motion, board);
                self.stage = Stage::Ramping(now);
            }
            Stage::Ramping(set_out) => {
                let ramp = Duration::from_micros(self.motion.ramp_us());
                for (channel, cruise) in (0..).zip(self.motion.axes()) {
                    if cruise.counts_per_s != 0.0 {
                        board.begin_cruise(now, channel, cruise.counts_per_s, ramp);
                    }
                }
                self.stage = Stage::Leading(*set_out);
            }
            Stage::Leading(set_out) => {
                let set_out = *set_out;
                let start = axes.readback(now, board);
                self.stage = Stage::Measuring(Measuring {
                    set_out,
                    statistics: Statistics::new(board.adc().0),
                    taken: 0,
                    index: 0,
                    start,
                    begin: now,
                });
                self.open(0, now, set_out, board);
            }
            Stage::Measuring(_) => return self.measure(now, axes, board, windows),
            Stage::Braking => return Ok(true),
        }
        Ok(false)
    }

    /// One more ADC reading; a window's last one ends it, and begins the next at the same moment
    /// and pose.
    fn measure(
        &mut self,
        now: Instant,
        axes: &Axes,
        board: &mut impl Board,
        windows: &mut Windows,
    ) -> Result<bool, BoardFault> {
        let Stage::Measuring(at) = &mut self.stage else { return Ok(false) };
        at.statistics.take(board.convert(now)?);
        at.taken += 1;
        if at.statistics.n() < self.sweep.readings {
            return Ok(false);
        }
        let end = axes.readback(now, board);
        windows.keep(at.window(&self.sweep, &end, now));
        if at.taken >= self.motion.readings() {
            self.stage = Stage::Braking;
            return Ok(false);
        }
        at.index += 1;
        at.start = end;
        at.begin = now;
        at.statistics = Statistics::new(board.adc().0);
        let (index, set_out) = (at.index, at.set_out);
        self.open(index, now, set_out, board);
        Ok(false)
    }

    fn open(&self, index: u16, now: Instant, set_out: Instant, board: &mut impl Board) {
        let until = self.window_end(set_out, index);
        board.begin_window(now, until, illumination(&self.sweep, index));
    }

    fn window_end(&self, set_out: Instant, index: u16) -> Instant {
        self.reading_end(set_out, (u64::from(index) + 1) * u64::from(self.sweep.readings))
    }

    fn reading_end(&self, set_out: Instant, k: u64) -> Instant {
        after(set_out, self.motion.reading_us(k))
    }
}

impl Measuring {
    fn window(&self, sweep: &Sweep, end: &AxisCounts, now: Instant) -> Window {
        let moved = end.0.iter().zip(&self.start.0).map(|(end, start)| end.wrapping_sub(*start));
        Window {
            id: sweep.id,
            index: self.index,
            mean: self.statistics.mean(),
            variance: self.statistics.variance(),
            min: self.statistics.min(),
            max: self.statistics.max(),
            saturated: self.statistics.saturated(),
            start: self.start.clone(),
            moved: AxisCounts(moved.collect()),
            start_tick: self.begin.tick(),
            duration_us: u32::try_from(now.since(self.begin).as_micros()).unwrap_or(u32::MAX),
        }
    }
}

/// A sweep looks at the sample; its windows are named one after the other.
const fn illumination(sweep: &Sweep, index: u16) -> Illumination {
    Illumination {
        reading: sweep.reading.wrapping_add(index as u32),
        gain: sweep.gain,
        shutter: Shutter::Open,
    }
}

fn after(at: Instant, us: u64) -> Instant {
    Instant::from_micros(at.micros().saturating_add(us))
}
