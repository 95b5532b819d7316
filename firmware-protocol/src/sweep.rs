//! The motion of a sweep: how axes come to their constant speeds together, keep them while windows
//! integrate, and brake together. It knows counts and seconds, no board and no clock; host and
//! device work out the same places from it.

use heapless::Vec;
use libm::ceil;

use crate::{AXES_MAX, AxisIdentity, Rejection, Sweep};

/// Where and how fast the axes of a [`Sweep`] go, all within their limits.
///
/// All axes accelerate evenly over one time, that of the axis which needs the longest; their
/// speeds are in proportion at every moment, so that the path is straight in counts from rest to
/// rest. The constant speed is `step` in the time of a window exactly.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepMotion {
    rate_hz: u32,
    readings: u64,
    ramp_us: u64,
    lead_us: u64,
    cruise_us: u64,
    axes: Vec<Cruise, AXES_MAX>,
}

/// One axis of a sweep, counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cruise {
    /// Where it sets out, at rest; not a whole number.
    pub from: f64,
    /// Where it comes to rest.
    pub to: f64,
    /// Its constant speed, signed, counts a second.
    pub counts_per_s: f64,
}

impl SweepMotion {
    /// On these axes, with so many ADC readings a second. `lead_us` and the rest as `sweep` says;
    /// its number, name and gain don't matter.
    ///
    /// Errors: *senseless* without windows, without readings, without any motion or with another
    /// number of axes; *too fast*; *outside limits* where an axis would set out or come to rest
    /// beyond its travel: the nearest whole count beyond it is named.
    pub fn new(axes: &[AxisIdentity], rate_hz: u32, sweep: &Sweep) -> Result<Self, Rejection> {
        let (from, step) = (&sweep.from.0, &sweep.step.0);
        let is_whole = from.len() == axes.len() && step.len() == axes.len();
        let moves = step.iter().any(|step| *step != 0);
        if !is_whole || !moves || sweep.windows == 0 || sweep.readings == 0 || rate_hz == 0 {
            return Err(Rejection::Senseless);
        }
        let per_s = f64::from(rate_hz) / f64::from(sweep.readings);
        let mut ramp_s = 0.0_f64;
        for ((channel, axis), step) in (0_u8..).zip(axes).zip(step) {
            let speed = f64::from(*step).abs() * per_s;
            if speed > f64::from(axis.speed) {
                return Err(Rejection::TooFast(channel));
            }
            ramp_s = ramp_s.max(speed / f64::from(axis.acceleration.max(1)));
        }
        let readings = u64::from(sweep.windows) * u64::from(sweep.readings);
        let lead_us = u64::from(sweep.lead_us);
        let mut motion = Self {
            rate_hz,
            readings,
            ramp_us: whole_micros(ramp_s),
            lead_us,
            cruise_us: lead_us + (readings * 1_000_000).div_ceil(u64::from(rate_hz)),
            axes: Vec::new(),
        };
        for ((channel, axis), (from, step)) in (0_u8..).zip(axes).zip(from.iter().zip(step)) {
            let cruise = motion.cruise(f64::from(*from), f64::from(*step) * per_s);
            cruise.check(channel, axis)?;
            let _ = motion.axes.push(cruise);
        }
        Ok(motion)
    }

    fn cruise(&self, first: f64, counts_per_s: f64) -> Cruise {
        let from = first - counts_per_s * (0.5 * seconds(self.ramp_us) + seconds(self.lead_us));
        let to = from + counts_per_s * (seconds(self.ramp_us) + seconds(self.cruise_us));
        Cruise { from, to, counts_per_s }
    }

    /// One entry an axis.
    pub fn axes(&self) -> &[Cruise] {
        &self.axes
    }

    /// How long the axes accelerate, and how long they brake, microseconds.
    pub const fn ramp_us(&self) -> u64 {
        self.ramp_us
    }

    /// From setting out to the first window, microseconds.
    pub const fn before_us(&self) -> u64 {
        self.ramp_us + self.lead_us
    }

    /// From setting out to rest, microseconds.
    pub const fn duration_us(&self) -> u64 {
        2 * self.ramp_us + self.cruise_us
    }

    /// From setting out to the end of the k-th ADC reading, microseconds; k = 0 is the first
    /// window's beginning. Counted from there, so that no rounding adds up.
    pub const fn reading_us(&self, k: u64) -> u64 {
        self.before_us() + k * 1_000_000 / self.rate_hz as u64
    }

    /// All ADC readings of all windows.
    pub const fn readings(&self) -> u64 {
        self.readings
    }
}

impl Cruise {
    fn check(&self, channel: u8, axis: &AxisIdentity) -> Result<(), Rejection> {
        let (low, high) = (f64::from(axis.low), f64::from(axis.high));
        for end in [self.from, self.to] {
            if end < low - SLACK_COUNTS {
                return Err(Rejection::OutsideLimits(channel, whole(libm::floor(end))));
            }
            if end > high + SLACK_COUNTS {
                return Err(Rejection::OutsideLimits(channel, whole(ceil(end))));
            }
        }
        Ok(())
    }
}

/// What rounding may put an end beyond a limit that it should stand on.
const SLACK_COUNTS: f64 = 1e-6;

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; saturates
fn whole_micros(duration_s: f64) -> u64 {
    ceil(duration_s * 1e6) as u64
}

#[allow(clippy::cast_possible_truncation)] // saturates, as a place far outside may
fn whole(counts: f64) -> i32 {
    counts as i32
}

fn seconds(micros: u64) -> f64 {
    micros as f64 / 1e6
}
