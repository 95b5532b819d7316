//! A sample: a radiance along a pose, with the parts of its uncertainty and its flags.

use std::fmt;

use super::dark::{self, Dark};
use crate::rig::{AxisPositions, ModelledVariance, Pose, Reading, ReadingKind, Rig};

/// An axis moved during a dwell when its end lies further from its start than this many standard
/// uncertainties of a position (the difference of two has sqrt(2) of one) ...
const MOVED_U: f64 = 6.0;
/// ... and than this many counts.
const MOVED_COUNTS: u32 = 2;

/// What a target's reading says. Radiances are in the unit of the detector's quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// The target's index in the plan.
    pub index: u32,
    /// Which of the plan's repeats, from 0.
    pub repeat: u32,
    /// The reading's id.
    pub reading: u32,
    /// The session that took it.
    pub session: u32,
    /// The gain range, an index into the detector's.
    pub gain: u8,
    /// Run time at which the integration began, seconds.
    pub time_s: f64,
    /// The integration, seconds, by the device's clock.
    pub dwell_s: f64,
    /// The measured ray.
    pub pose: Pose,
    /// Of a reading taken in flight: where the beam was when it began, and when it ended.
    pub way: Option<(Pose, Pose)>,
    /// The measured axis positions that it comes from.
    pub positions: AxisPositions,
    /// The radiance, dark level subtracted; negative values stay.
    pub value: f64,
    /// Standard uncertainty by what is independent from sample to sample.
    pub u_independent: f64,
    /// Standard uncertainty by what many samples share.
    pub u_common: f64,
    /// Combined standard uncertainty (k = 1).
    pub u: f64,
    /// The independent variance as a function of the level.
    pub noise: ModelledVariance,
    /// Relative standard uncertainty of the scale: responsivity, gain and throughput.
    pub u_scale_relative: f64,
    /// Standard uncertainty of the dark level.
    pub u_dark: f64,
    /// What is remarkable about it.
    pub flags: Flags,
}

/// Something remarkable about a sample. Nothing is corrected or left out on its account.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flag {
    /// An ADC reading stood at an end of the range: the value is too low.
    Saturated,
    /// |value| is less than twice its uncertainty.
    BelowNoise,
    /// An axis was not settled when the dwell began, or moved while it lasted; in a sweep, one
    /// was not where it should be, or did not go as far as it should.
    Unsettled,
    /// The reference readings before and after it differ by more than three times the standard
    /// uncertainty of their difference, noise alone.
    Drift,
    /// Frames of its command were sent again. No harm to the value.
    LinkRetry,
    /// The beam reaches beyond the sample's outline, where the plan states it. The fit knows how
    /// much of it: no harm.
    OffSample,
}

/// What part a sample has in the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// It is the radiance at its pose, to its uncertainty.
    Value,
    /// The radiance at its pose is no less: saturated.
    Limit,
    /// None: its pose is not known.
    None,
}

/// A set of flags.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Flags(u8);

impl Flag {
    /// All flags, in the order in which they are written.
    pub const ALL: [Self; 6] = [
        Self::Saturated,
        Self::BelowNoise,
        Self::Unsettled,
        Self::Drift,
        Self::LinkRetry,
        Self::OffSample,
    ];

    /// The name in samples.csv.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Saturated => "saturated",
            Self::BelowNoise => "below_noise",
            Self::Unsettled => "unsettled",
            Self::Drift => "drift",
            Self::LinkRetry => "link_retry",
            Self::OffSample => "off_sample",
        }
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

impl Flags {
    /// Whether the flag is set.
    pub const fn contains(self, flag: Flag) -> bool {
        self.0 & flag.bit() != 0
    }

    /// Sets the flag, or takes it away.
    pub const fn set(&mut self, flag: Flag, is_set: bool) {
        if is_set {
            self.0 |= flag.bit();
        } else {
            self.0 &= !flag.bit();
        }
    }

    /// Whether no flag is set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether the value says something else than the radiance at its pose, so that a fit can't take
    /// it for that: see [`Sample::part`] for what it does instead. One below the noise stays in: leaving it out would bias the fit upwards. So
    /// does one off the sample, of which the fit takes the mean over what is on it.
    pub const fn excludes_from_fit(self) -> bool {
        self.contains(Flag::Saturated) || self.contains(Flag::Unsettled)
    }

    /// The flags that are set, in the order of [`Flag::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Flag> {
        Flag::ALL.into_iter().filter(move |flag| self.contains(*flag))
    }
}

impl fmt::Display for Flags {
    /// Names joined by `|`; nothing where no flag is set.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, flag) in self.iter().enumerate() {
            if i > 0 {
                f.write_str("|")?;
            }
            f.write_str(flag.name())?;
        }
        Ok(())
    }
}

impl Sample {
    /// The measured ray as the fit takes it.
    pub fn ray(&self) -> fit::Ray {
        ray(self.pose)
    }

    /// The way of a reading taken in flight as the fit takes it.
    pub fn flown(&self) -> Option<(fit::Ray, fit::Ray)> {
        self.way.map(|(from, to)| (ray(from), ray(to)))
    }

    /// Run time in the middle of the integration, seconds.
    pub fn middle_s(&self) -> f64 {
        self.time_s + 0.5 * self.dwell_s
    }

    /// What the fit makes of it.
    pub fn part(&self) -> Part {
        if self.flags.contains(Flag::Unsettled) {
            Part::None
        } else if self.flags.contains(Flag::Saturated) {
            // At the lower end of the range the value is too high: a limit of another kind.
            if self.value > 0.0 { Part::Limit } else { Part::None }
        } else {
            Part::Value
        }
    }

    /// States the uncertainty as it is at `level`: the fitted one where it is known.
    pub fn state_at(&mut self, level: f64) {
        self.u_independent =
            libm::sqrt(self.noise.floor + self.noise.per_radiance * level.max(0.0));
        self.u_common = libm::hypot(self.u_scale_relative * level, self.u_dark);
        self.u = libm::hypot(self.u_independent, self.u_common);
        self.flags.set(Flag::BelowNoise, self.value.abs() < 2.0 * self.u);
    }
}

/// The sample of a target's reading; `None` for other readings.
pub(super) fn from_reading(rig: &Rig, darks: &[Dark], reading: &Reading) -> Option<Sample> {
    let ReadingKind::Target { index, repeat } = reading.kind else { return None };
    let (value, noise) = dark::radiance(rig, darks, reading);
    let (positions, pose) = rig.measured(reading);
    let gain = rig.detector.gains.get(usize::from(reading.gain))?;
    let mut flags = Flags::default();
    flags.set(Flag::Saturated, reading.saturated > 0);
    flags.set(Flag::Unsettled, reading.unsettled || moved(rig, reading));
    flags.set(Flag::LinkRetry, reading.link_retries > 0);
    let mut sample = Sample {
        index,
        repeat,
        reading: reading.id,
        session: reading.session,
        gain: reading.gain,
        time_s: reading.time_s,
        dwell_s: (reading.end_us - reading.start_us) as f64 / 1e6,
        pose,
        way: rig.way(reading),
        positions,
        value,
        u_independent: 0.0,
        u_common: 0.0,
        u: 0.0,
        noise,
        u_scale_relative: libm::hypot(rig.detector.u_scale_relative(), gain.u_relative),
        u_dark: darks
            .iter()
            .find(|dark| dark.gain == reading.gain)
            .map_or(0.0, |dark| dark.u_radiance),
        flags,
    };
    sample.state_at(value);
    Some(sample)
}

fn ray(pose: Pose) -> fit::Ray {
    let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
    fit::Ray { x_m, y_m, theta_rad, phi_rad }
}

fn moved(rig: &Rig, reading: &Reading) -> bool {
    let ends = reading.start.0.iter().zip(&reading.travel.0).zip(reading.end.0);
    rig.axes.iter().zip(ends).any(|(axis, ((start, travel), end))| {
        let counts = end.abs_diff(start.saturating_add(*travel));
        counts > MOVED_COUNTS && axis.distance(f64::from(counts)) > MOVED_U * axis.u_readback
    })
}
