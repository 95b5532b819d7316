//! From what the device reported to what the journal keeps: channels become axes, ticks become
//! run time, and a pose that was not reached is noted.

use firmware_protocol::DwellResult;

use super::channels::to_axes;
use crate::plan::Step;
use crate::rig::{DeviceTimes, Latched, Readback, Reading, Rig};

/// An axis is off its setpoint when it reads further from it than this many standard
/// uncertainties of one position ...
const OFF_U: f64 = 6.0;
/// ... and than this many counts.
const OFF_COUNTS: f64 = 2.0;

/// What the engine knows about a reading beside the device's words.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Taking {
    /// The session of the run.
    pub(super) session: u32,
    /// Run time at which the session began, seconds.
    pub(super) session_began_s: f64,
    /// Start and end of the integration since the session began, microseconds.
    pub(super) start_us: i64,
    pub(super) end_us: i64,
    /// What the devices' own clocks read.
    pub(super) device_times: DeviceTimes,
    /// Frames of the command that were sent again.
    pub(super) link_retries: u32,
}

pub(super) fn reading(rig: &Rig, step: &Step, result: &DwellResult, taking: Taking) -> Reading {
    let Taking { session, session_began_s, start_us, end_us, device_times, link_retries } = taking;
    let start = to_axes(rig, &result.start);
    Reading {
        id: step.id,
        kind: step.kind,
        gain: result.gain,
        n: result.n,
        mean: result.mean,
        variance: result.variance,
        min: result.min,
        max: result.max,
        saturated: result.saturated,
        commanded: step.counts,
        travel: step.swept.map_or(Latched::ZERO, |swept| swept.travel),
        start,
        end: to_axes(rig, &result.end),
        start_us,
        end_us,
        time_s: session_began_s + start_us as f64 * 1e-6,
        session,
        device_times,
        link_retries,
        unsettled: is_off(rig, step.counts, start),
    }
}

fn is_off(rig: &Rig, commanded: Latched, readback: Latched) -> bool {
    rig.axes.iter().enumerate().any(|(i, axis)| {
        let off = (f64::from(readback.0[i]) - f64::from(commanded.0[i])).abs();
        let u_counts = axis.u_readback * axis.counts_per_unit;
        axis.readback == Readback::Encoder && off > (OFF_U * u_counts).max(OFF_COUNTS)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_encoder_far_off_its_setpoint_is_unsettled() {
        let mut rig = Rig::built_in().unwrap();
        let at = |theta| Latched([theta, 0, 0, 0]);
        let u_counts = rig.axes[0].u_readback * rig.axes[0].counts_per_unit;
        assert!((u_counts - 2.0).abs() < 1e-9);
        assert!(!is_off(&rig, at(1000), at(1012)));
        assert!(is_off(&rig, at(1000), at(1013)));
        rig.axes[0].readback = Readback::Steps;
        assert!(!is_off(&rig, at(1000), at(9000)));
    }
}
