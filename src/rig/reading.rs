//! A raw reading: what the device said, before anyone interprets it. This is what the journal
//! keeps; radiance is derived from it, and can be derived again.

/// Why a reading was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingKind {
    /// Shutter closed, or source off.
    Dark,
    /// The reference pose, measured again and again to see drift.
    Reference,
    /// The reference pose while waiting for the source to settle.
    WarmUp,
    /// A target of the plan.
    Target {
        /// The target's index in the plan.
        index: u32,
        /// Which of the plan's repeats, from 0.
        repeat: u32,
    },
}

/// Encoder positions in counts, in the order of [`crate::rig::AXES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Latched(pub [i32; 4]);

impl Latched {
    /// Nowhere, and at home.
    pub const ZERO: Self = Self([0; 4]);

    /// These counts further, `times` over.
    #[must_use]
    pub fn plus(self, travel: Self, times: i32) -> Self {
        Self(std::array::from_fn(|i| self.0[i].saturating_add(travel.0[i].saturating_mul(times))))
    }
}

/// What the clocks of a rig's several devices read at a reading, seconds of their own; `None`
/// where a device has none, or one controller drives all.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DeviceTimes {
    /// Of what moves the axes, when it last said where they are.
    pub axes_s: Option<f64>,
    /// Of the meter, at its first reading.
    pub photometer_s: Option<f64>,
}

/// One dwell, or one window of a sweep, as the device reported it.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Its name in the plan's sequence ([`crate::plan::Step::id`]); the journal holds each once.
    pub id: u32,
    /// Why it was taken.
    pub kind: ReadingKind,
    /// The gain range, an index into the detector's ranges.
    pub gain: u8,
    /// ADC readings taken.
    pub n: u32,
    /// Their mean, counts.
    pub mean: f64,
    /// Their variance (n - 1), counts squared.
    pub variance: f64,
    /// The smallest, counts.
    pub min: i32,
    /// The largest, counts.
    pub max: i32,
    /// How many stood at an end of the ADC's range.
    pub saturated: u32,
    /// Setpoints when the integration began, counts.
    pub commanded: Latched,
    /// How far the setpoints went at constant speed while it lasted, counts: zero at rest, and in
    /// a sweep what a window goes.
    pub travel: Latched,
    /// Encoders when the integration began.
    pub start: Latched,
    /// Encoders when it ended.
    pub end: Latched,
    /// The device's clock when the integration began, microseconds, unwrapped, since its
    /// session began.
    pub start_us: i64,
    /// The same at its end.
    pub end_us: i64,
    /// Seconds from the start of the run (of its first session) to the start of the
    /// integration; sessions follow on each other without the time between them.
    pub time_s: f64,
    /// Which session of the run took it: 0, and one more after every resume.
    pub session: u32,
    /// What the devices' own clocks read.
    pub device_times: DeviceTimes,
    /// Frames of its command that had to be sent again.
    pub link_retries: u32,
    /// The setpoint was not reached within the settle tolerance when the integration began.
    pub unsettled: bool,
}
