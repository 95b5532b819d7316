//! How the light of a scene goes with the device's time: it warms up, and it flickers with the
//! mains. Each is a factor on all light, averaged over the interval of an ADC reading.
//!
//! Time counts from the device's boot. A resumed run boots the device anew: light that goes with
//! time is then another's, as it would be on a real rig, where the lamp burned on or cooled down
//! meanwhile. Noise, which goes by the reading's name, is the same.

mod effects;
mod mains;
mod warm_up;

use firmware_protocol::Instant;
use spanned_toml::{Problem, Table};

pub use mains::MainsFlicker;
pub use warm_up::WarmUp;

pub(crate) use effects::{candidates, stages};

/// The table `[source]` of scene.toml: what the light of all emitters and lamps does with time.
/// Everything absent is an effect absent.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SourceOverTime {
    /// The light drifts towards its level after it was switched on.
    pub warm_up: Option<WarmUp>,
    /// The light goes up and down with the mains.
    pub mains_flicker: Option<MainsFlicker>,
}

impl SourceOverTime {
    /// Reads the table; unknown keys are refused.
    pub fn read(table: Table<'_>) -> Result<Self, Problem> {
        let warm_up = table.table("warm_up")?.map(WarmUp::read).transpose()?;
        let mains_flicker = table.table("mains_flicker")?.map(MainsFlicker::read).transpose()?;
        table.finish()?;
        Ok(Self { warm_up, mains_flicker })
    }
}

/// The time over which one ADC reading integrates, seconds since the device's boot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    pub(crate) begin_s: f64,
    pub(crate) end_s: f64,
}

impl Interval {
    /// The interval of this length that ends now.
    pub(crate) fn ending(now: Instant, length_s: f64) -> Self {
        let end_s = seconds(now);
        Self { begin_s: end_s - length_s, end_s }
    }

    pub(crate) fn middle_s(self) -> f64 {
        f64::midpoint(self.begin_s, self.end_s)
    }
}

/// Since the device's boot.
pub(crate) fn seconds(now: Instant) -> f64 {
    now.micros() as f64 * 1e-6
}

/// (1 - exp(-u)) / u, the mean of exp(-s) over s from 0 to u, for u of at least 0.
pub(crate) fn mean_of_decay(u: f64) -> f64 {
    if u == 0.0 { 1.0 } else { -libm::expm1(-u) / u }
}

#[cfg(test)]
mod tests {
    use spanned_toml::{Document, Source};

    use super::*;

    fn read(text: &str) -> Result<SourceOverTime, Problem> {
        let document = Document::parse(Source::new("scene.toml", text)).unwrap();
        SourceOverTime::read(document.root().required_table("source").unwrap())
    }

    #[test]
    fn an_empty_table_calls_for_nothing() {
        assert_eq!(read("[source]\n").unwrap(), SourceOverTime::default());
    }

    #[test]
    fn keys_are_read_and_unknown_ones_refused() {
        let source = read(
            "[source]\n\
             warm_up = { amplitude_relative = -0.05, time_constant_s = 600, age_s = 30 }\n\
             mains_flicker = { frequency_hz = 100, depth_relative = 0.2 }\n",
        )
        .unwrap();
        let warm_up = WarmUp { amplitude_relative: -0.05, time_constant_s: 600.0, age_s: 30.0 };
        assert_eq!(source.warm_up, Some(warm_up));
        let flicker = MainsFlicker { frequency_hz: 100.0, depth_relative: 0.2, phase_rad: None };
        assert_eq!(source.mains_flicker, Some(flicker));
        for (bad, part) in [
            ("warm_up = { amplitude_relative = 0.1 }", "time_constant_s"),
            ("warm_up = { amplitude_relative = 1.5, time_constant_s = 1 }", "at most 1"),
            ("mains_flicker = { frequency_hz = 100, depth_relative = 2 }", "at most 1"),
            ("mains_flicker = { frequency_hz = 0, depth_relative = 0.1 }", "above 0"),
            ("mains_flicker = { frequency_khz = 1, depth_relative = 0.1 }", "frequency_hz"),
            ("mains_fliker = {}", "did you mean `mains_flicker`?"),
        ] {
            let problem = read(&format!("[source]\n{bad}\n")).unwrap_err().to_string();
            assert!(problem.contains(part), "{bad}: {problem}");
        }
    }
}
