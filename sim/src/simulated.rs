//! The rig file's `[simulated]` table: what a real rig would keep to itself. Its keys are listed
//! here and nowhere else.

use spanned_toml::{Bounds, Problem, Table};

use crate::{AxisFlaws, DetectorFlaws, DeviceFault, Misalignment};

/// What the rig file can't know of a real rig. Everything absent is an effect absent; but limit
/// switches every rig has.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// Current without light, amperes; zero for none.
    pub dark_current_a: f64,
    /// What else is wrong with the detector.
    pub detector: DetectorFlaws,
    /// What is wrong with the axes, in the order θ, φ, x, y.
    pub axes: [AxisFlaws; 4],
    /// How the axes fail to meet.
    pub misalignment: Misalignment,
    /// Where the axes stand at boot, as fractions of their travel from its lower end, in the
    /// order θ, φ, x, y. Drawn from the middle half of the travel where absent.
    pub start: [Option<f64>; 4],
    /// How far beyond each end of its travel an axis has a limit switch, as a fraction of the
    /// travel; 0.01 where absent.
    pub limit_margin: f64,
    /// What goes wrong on the wire.
    pub faults: LinkFaults,
    /// What goes wrong with devices of other makes.
    pub device_faults: Vec<DeviceFault>,
}

/// What goes wrong on the wire, for tests of the link.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkFaults {
    /// The probability that a byte is lost.
    pub drop_rate: f64,
    /// The probability that one bit of a byte is flipped.
    pub corrupt_rate: f64,
}

impl LinkFaults {
    /// Whether nothing goes wrong.
    pub fn is_none(&self) -> bool {
        self.drop_rate <= 0.0 && self.corrupt_rate <= 0.0
    }
}

impl Default for Simulated {
    fn default() -> Self {
        Self {
            dark_current_a: 0.0,
            detector: DetectorFlaws::default(),
            axes: [AxisFlaws::default(); 4],
            misalignment: Misalignment::default(),
            start: [None; 4],
            limit_margin: LIMIT_MARGIN,
            faults: LinkFaults::default(),
            device_faults: Vec::new(),
        }
    }
}

/// More than an axis overruns its home mark by, and less than homing searches beyond the travel.
const LIMIT_MARGIN: f64 = 0.01;

/// A photodiode that leaks more than this is broken.
const DARK_CURRENT_A_MAX: f64 = 1e-3;

/// More lost bytes than this and no frame gets through.
const FAULT_RATE_MAX: f64 = 0.1;

impl Simulated {
    /// Reads the table `[simulated]`; unknown keys are refused.
    pub fn read(table: Table<'_>) -> Result<Self, Problem> {
        let dark = Bounds::between(-DARK_CURRENT_A_MAX, DARK_CURRENT_A_MAX);
        let fraction = Bounds::between(0.0, 1.0);
        let dark_current_a = table.number("dark_current_a", dark)?.unwrap_or(0.0);
        let detector = DetectorFlaws::read(&table)?;
        if detector.dark_drift_relative_per_h != 0.0 && dark_current_a == 0.0 {
            return Err(table.problem(
                "dark_drift_relative_per_h",
                "a drift of a dark current that is not there",
                "a dark_current_a other than 0 beside it",
                "state the dark current, or remove its drift",
            ));
        }
        let mut axes = [AxisFlaws::default(); 4];
        for (i, (axis, name)) in axes.iter_mut().zip(AXIS_NAMES).enumerate() {
            if let Some(table) = table.table(name)? {
                *axis = AxisFlaws::read(table, i < 2)?;
            }
        }
        let misalignment = Misalignment::read(&table)?;
        let mut start = [None; 4];
        if let Some(axes) = table.table("start_fraction_of_travel")? {
            for (start, axis) in start.iter_mut().zip(AXIS_NAMES) {
                *start = axes.number(axis, fraction)?;
            }
            axes.finish()?;
        }
        let limit_margin = table.number("limit_margin_fraction_of_travel", fraction)?;
        let mut faults = LinkFaults::default();
        if let Some(link) = table.table("link")? {
            let rate = Bounds::between(0.0, FAULT_RATE_MAX);
            faults.drop_rate = link.number("drop_rate", rate)?.unwrap_or(0.0);
            faults.corrupt_rate = link.number("corrupt_rate", rate)?.unwrap_or(0.0);
            link.finish()?;
        }
        let device_faults = table.tables("fault")?.into_iter().map(DeviceFault::read);
        let device_faults = device_faults.collect::<Result<_, _>>()?;
        table.finish()?;
        Ok(Self {
            dark_current_a,
            detector,
            axes,
            misalignment,
            start,
            limit_margin: limit_margin.unwrap_or(LIMIT_MARGIN),
            faults,
            device_faults,
        })
    }
}

/// The axes' names in files, in the order of [`crate::Nominal::axes`].
pub(crate) const AXIS_NAMES: [&str; 4] = ["theta", "phi", "x", "y"];

#[cfg(test)]
mod tests {
    use spanned_toml::{Document, Source};

    use super::*;

    fn read(text: &str) -> Result<Simulated, Problem> {
        let document = Document::parse(Source::new("rig.toml", text)).unwrap();
        Simulated::read(document.root().required_table("simulated").unwrap())
    }

    #[test]
    fn an_empty_table_calls_for_nothing() {
        let simulated = read("[simulated]\n").unwrap();
        assert_eq!(simulated, Simulated::default());
        assert!(simulated.faults.is_none());
    }

    #[test]
    fn keys_are_read_and_unknown_ones_refused() {
        let text = "[simulated]\ndark_current_a = 1e-12\nlink.drop_rate = 0.01\n\
                    start_fraction_of_travel = { theta = 0.5, y = 0 }\n\
                    limit_margin_fraction_of_travel = 0.02\n";
        let simulated = read(text).unwrap();
        assert_eq!(simulated.start, [Some(0.5), None, None, Some(0.0)]);
        assert!(!simulated.faults.is_none());
        assert!((simulated.limit_margin - 0.02).abs() < f64::EPSILON);
        for (key, help) in [
            ("dark_curent_a = 1e-12", "did you mean `dark_current_a`?"),
            ("axis_ofset = { x_mm = 1 }", "did you mean `axis_offset`?"),
            ("theta.backlash_mm = 1", "did you mean `backlash_deg`?"),
            ("flicker_noise.corner_khz = 1", "did you mean `corner_hz`?"),
        ] {
            let problem = read(&format!("[simulated]\n{key}\n")).unwrap_err().to_string();
            assert!(problem.contains(help), "{problem}");
        }
        for bad in [
            "dark_current_a = nan",
            "link.drop_rate = 0.5",
            "link.delay = 1",
            "limit_margin_fraction_of_travel = -0.1",
            "dark_drift_relative_per_h = 0.1",
            "non_linearity_relative_at_full_scale = -0.1",
            "stray_light_fraction_of_flux = 2",
            "detector_drift.random_walk_relative_per_root_h = -1",
            "gain_switching = { step_relative = 0.1 }",
            "flicker_noise = { corner_hz = 0 }",
            "theta.ringing = { amplitude_deg = 1, frequency_hz = 9, damping_ratio = 1 }",
            "x.missed_steps = { probability_per_move = 2, counts = 4 }",
            "y.encoder_error = { amplitude_mm = 0.1 }",
            "phi.backlash_deg = -1",
            "wobble.tilt_deg = 11",
            "axis_offset.u_x_mm = -1",
            "non_orthogonality.arm_axis_rad = 0.1",
        ] {
            assert!(read(&format!("[simulated]\n{bad}\n")).is_err(), "{bad}");
        }
    }

    #[test]
    fn flaws_are_read_in_their_units() {
        let text = "[simulated]\ndark_current_a = 1e-12\ndark_drift_relative_per_h = 0.1\n\
                    stray_light_fraction_of_flux = 1e-6\n\
                    non_linearity_relative_at_full_scale = 0.01\n\
                    detector_drift = { relative_per_h = -0.01 }\n\
                    gain_switching = { step_relative = 0.001, time_constant_ms = 20 }\n\
                    flicker_noise.corner_hz = 10\n\
                    axis_offset = { x_mm = 0.1, u_z_mm = 0.2 }\n\
                    non_orthogonality = { arm_axis_deg = 0.5, u_beam_deg = 0.1 }\n\
                    wobble = { tilt_deg = 0.02, towards_deg = 90 }\n\
                    theta.backlash_deg = 0.03\n\
                    phi.encoder_error = { amplitude_deg = 0.01, period_deg = 360 }\n\
                    x.ringing = { amplitude_mm = 0.1, frequency_hz = 20, damping_ratio = 0.05 }\n\
                    y.missed_steps = { probability_per_move = 0.01, counts = 4 }\n";
        let simulated = read(text).unwrap();
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-12, "{found} beside {expected}");
        };
        let Simulated { detector, axes, misalignment, .. } = simulated;
        close(detector.gain_switching.unwrap().time_constant_s, 0.02);
        close(detector.flicker.unwrap().lowest_hz, 0.01);
        close(detector.drift.relative_per_h, -0.01);
        close(misalignment.axis_offset_m[0].value, 1e-4);
        close(misalignment.axis_offset_m[2].u, 2e-4);
        close(misalignment.arm_axis_rad.value, 0.5_f64.to_radians());
        close(misalignment.beam_rad.u, 0.1_f64.to_radians());
        close(misalignment.wobble_towards_rad.unwrap(), core::f64::consts::FRAC_PI_2);
        close(axes[0].backlash, 0.03_f64.to_radians());
        close(axes[1].encoder_error.unwrap().period, core::f64::consts::TAU);
        close(axes[2].ringing.unwrap().amplitude, 1e-4);
        close(axes[3].missed_steps.unwrap().counts, 4.0);
    }
}
