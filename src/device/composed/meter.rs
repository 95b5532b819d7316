//! The meter, as the composer sees it, and how its values become counts: a count is the range's
//! full scale divided by what the rig file's converter counts to, so that calibration takes them
//! for any other's.

use firmware_protocol::{AxisCounts, Cause, Dwell, DwellResult, Instant, Shutter};

use super::Composer;
use crate::device::controller::{ConnectError, LinkLost};
use crate::device::driver::{NamedFault, Trouble};
use crate::device::photometer::{
    Exposed, Exposure, Photometer, PhotometerCommand, PhotometerEvent, PhotometerFacts,
};
use crate::rig::Adc;

/// What the meter was asked and has not answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    Exposure,
    Ready,
    Zero,
}

/// See the module.
#[derive(Debug)]
pub(super) struct MeterPart {
    pub(super) driver: Box<dyn Photometer>,
    /// Full scale of each range, in the meter's unit.
    pub(super) full_scales: Vec<f64>,
    pub(super) adc: Adc,
    pub(super) facts: Option<PhotometerFacts>,
    pub(super) awaited: Option<Asked>,
    /// Whether its own offset is taken off.
    pub(super) is_zeroed: bool,
    /// What the last exposure gave.
    pub(super) exposed: Option<Exposed>,
    /// How the shutter was put last; `None` where nobody knows.
    pub(super) shutter: Option<Shutter>,
    /// The last time that a device of the axes told, seconds of its own.
    pub(super) axes_time_s: Option<f64>,
    /// It said that something is wrong, or booted.
    pub(super) is_at_fault: bool,
    /// Its port hung up.
    pub(super) is_gone: bool,
}

impl MeterPart {
    pub(super) fn open(&mut self, now: Instant) {
        self.facts = None;
        self.is_zeroed = false;
        self.awaited = Some(Asked::Ready);
        self.driver.open(now);
    }

    pub(super) fn zero(&mut self, now: Instant) {
        self.awaited = Some(Asked::Zero);
        self.driver.begin(now, PhotometerCommand::Zero);
    }

    pub(super) fn expose(&mut self, now: Instant, dwell: &Dwell) {
        let duration = std::time::Duration::from_micros(dwell.duration_us.into());
        let readings = self.adc.readings_in(duration);
        let exposure = Exposure { range: dwell.gain, duration, readings };
        self.exposed = None;
        self.awaited = Some(Asked::Exposure);
        self.driver.begin(now, PhotometerCommand::Expose(exposure));
    }

    pub(super) fn abandon(&mut self, now: Instant) {
        if matches!(self.awaited, Some(Asked::Exposure | Asked::Zero)) {
            self.awaited = None;
            self.driver.abandon(now);
        }
    }

    /// An exposure as a dwell's result.
    pub(super) fn result(
        &self,
        dwell: &Dwell,
        exposed: &Exposed,
        [start, end]: [AxisCounts; 2],
    ) -> DwellResult {
        let full_scale = self.full_scales.get(usize::from(exposed.range)).copied();
        let lsb = full_scale.unwrap_or(f64::NAN) / self.adc.full_scale_counts();
        DwellResult {
            id: dwell.id,
            reading: dwell.reading,
            gain: exposed.range,
            n: exposed.readings,
            mean: exposed.mean / lsb,
            variance: exposed.variance / (lsb * lsb),
            min: whole(exposed.min / lsb),
            max: whole(exposed.max / lsb),
            saturated: exposed.saturated,
            start,
            end,
            start_tick: exposed.began.tick(),
            end_tick: exposed.ended.tick(),
        }
    }
}

impl Composer {
    pub(super) fn hear_meter(&mut self, now: Instant, event: PhotometerEvent) {
        let meter = &mut self.meter;
        match event {
            PhotometerEvent::Ready(facts) if meter.awaited == Some(Asked::Ready) => {
                meter.awaited = None;
                meter.is_at_fault = false;
                meter.facts = Some(facts);
            }
            PhotometerEvent::Zeroed if meter.awaited == Some(Asked::Zero) => {
                meter.awaited = None;
                meter.is_zeroed = true;
            }
            PhotometerEvent::Exposed(exposed) if meter.awaited == Some(Asked::Exposure) => {
                meter.awaited = None;
                meter.exposed = Some(exposed);
            }
            PhotometerEvent::Ready(_) | PhotometerEvent::Zeroed | PhotometerEvent::Exposed(_) => {}
            PhotometerEvent::Trouble(trouble) => self.meter_trouble(now, trouble),
        }
    }

    fn meter_trouble(&mut self, now: Instant, trouble: Trouble) {
        let meter = &mut self.meter;
        let was_opening = meter.awaited.take() == Some(Asked::Ready);
        meter.is_at_fault = true;
        match trouble {
            Trouble::Fault(fault) => self.fault(now, fault),
            Trouble::Refused(refusal) => self.unfit(ConnectError::Refused(refusal)),
            // It moves nothing: where the axes are is known still, and it can be set up again.
            Trouble::Restarted => {
                let device = meter.driver.name().to_owned();
                let name = "the meter restarted: power, or its reset key".to_owned();
                let cause = Cause::Detector;
                self.fault(now, NamedFault { device, name, cause, loses_position: false });
            }
            Trouble::Silent(what) => {
                meter.facts = None;
                if !was_opening {
                    self.lost(now, LinkLost::Mute(what));
                } else if self.is_clearing() {
                    self.not_cleared(Cause::Detector);
                } else {
                    self.unfit(ConnectError::Mute(what));
                }
            }
        }
    }
}

/// The nearest count; far outside any range it saturates.
#[allow(clippy::cast_possible_truncation)] // saturating, as documented
fn whole(counts: f64) -> i32 {
    libm::round(counts) as i32
}
