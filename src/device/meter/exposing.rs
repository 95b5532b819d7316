//! One integration of a meter: range, readings, and what they come to.

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::Instant;

use super::language::Asked;
use super::lines::Reading;
use super::{Doing, Meter};
use crate::device::driver::Trouble;
use crate::device::photometer::{Exposed, Exposure, PhotometerEvent};

/// A reading above its range by more than this is none: the makers' overranges are smaller.
const OVERRANGE: f64 = 1.1;
/// How much slower than the rig file says a meter may be.
const SLOWNESS: u32 = 3;
/// A garbled answer is asked for again so often.
const AGAIN_MAX: u8 = 2;

/// An integration under way.
#[derive(Debug)]
pub(super) struct Exposing {
    exposure: Exposure,
    asked: VecDeque<Asked>,
    readings: Vec<Reading>,
    began: Option<Instant>,
    ended: Instant,
    device_time_s: Option<f64>,
    again: u8,
}

impl Meter {
    pub(super) fn begin_exposure(&mut self, exposure: Exposure) {
        let asked = self.language.expose(exposure.readings.max(1)).into();
        self.script.clear();
        if !self.is_set_up {
            self.script.extend(self.language.set_up());
            self.is_set_up = true;
        }
        if self.range != Some(exposure.range) {
            let place = usize::from(exposure.range);
            let Some(full_scale) = self.full_scales.get(place).copied() else {
                return self.fault(format!("the rig file has no range {place}"));
            };
            self.script.extend(self.language.range(place, full_scale));
            self.range = Some(exposure.range);
        }
        let exposing = Exposing {
            exposure,
            asked,
            readings: Vec::new(),
            began: None,
            ended: Instant::ZERO,
            device_time_s: None,
            again: 0,
        };
        self.ask_for(exposing);
    }

    /// Asks for the next readings.
    fn ask_for(&mut self, exposing: Exposing) {
        if let Some(asked) = exposing.asked.front() {
            let integrating =
                Duration::from_secs_f64(f64::from(asked.readings) / f64::from(self.rate_hz));
            let longer = integrating * SLOWNESS + self.wire_time(asked.reply_bytes);
            let steps = asked.steps.iter().cloned().map(|step| step.within(longer));
            self.script.extend(steps);
        }
        self.doing = Doing::Exposing(exposing);
    }

    /// Words have come to their end that no answer ends.
    pub(super) fn go_on_exposing(&mut self, exposing: Exposing) {
        self.doing = Doing::Exposing(exposing);
    }

    /// Readings came to what was asked at `since`.
    pub(super) fn exposed(&mut self, now: Instant, since: Instant, answer: &str) {
        let Doing::Exposing(mut exposing) = std::mem::replace(&mut self.doing, Doing::Nothing)
        else {
            return;
        };
        let expected = exposing.asked.front().map_or(0, |asked| asked.readings);
        let Some((readings, time_s)) = self.language.read(answer) else {
            return self.garbled(exposing, answer);
        };
        if readings.len() != expected as usize {
            // It is set otherwise than it was told to be.
            self.is_set_up = false;
            self.range = None;
            return self.trouble(Trouble::Restarted);
        }
        exposing.asked.pop_front();
        exposing.readings.extend(readings);
        exposing.began.get_or_insert(since);
        // The answer's own way over the wire lies between the last reading and now.
        let on_wire = self.wire_time(answer.len() + 1).min(now.since(since));
        exposing.ended = since + now.since(since).saturating_sub(on_wire);
        exposing.device_time_s = time_s.or(exposing.device_time_s);
        if exposing.asked.is_empty() {
            let exposed = self.result(&exposing);
            self.events.push_back(PhotometerEvent::Exposed(exposed));
        } else {
            self.ask_for(exposing);
        }
    }

    fn garbled(&mut self, mut exposing: Exposing, answer: &str) {
        if exposing.again < AGAIN_MAX {
            exposing.again += 1;
            return self.ask_for(exposing);
        }
        let shown: String = answer.chars().take(60).collect();
        let unit = self.language.unit();
        self.fault(format!("it answers \"{shown}\" where a reading in {unit} was asked for"));
    }

    fn result(&self, exposing: &Exposing) -> Exposed {
        let range = exposing.exposure.range;
        let full_scale = self.full_scales.get(usize::from(range)).copied().unwrap_or(f64::NAN);
        let limit = full_scale * OVERRANGE;
        let is_over = |reading: &&Reading| match reading {
            Reading::Over { .. } => true,
            Reading::Value(value) => value.abs() > limit,
        };
        let value = |reading: &Reading| match reading {
            Reading::Over { is_negative: true } => -full_scale,
            Reading::Over { is_negative: false } => full_scale,
            Reading::Value(value) if value.abs() > limit => full_scale.copysign(*value),
            Reading::Value(value) => *value,
        };
        let values: Vec<f64> = exposing.readings.iter().map(value).collect();
        let count = values.len() as f64;
        // Around the first: readings are alike, and their spread is small beside them.
        let first = values.first().copied().unwrap_or_default();
        let mean = first + values.iter().map(|value| value - first).sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        Exposed {
            range,
            readings: u32::try_from(values.len()).unwrap_or(u32::MAX),
            mean,
            variance: if values.len() > 1 { squares / (count - 1.0) } else { 0.0 },
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            saturated: u32::try_from(exposing.readings.iter().filter(is_over).count())
                .unwrap_or(u32::MAX),
            began: exposing.began.unwrap_or(exposing.ended),
            ended: exposing.ended,
            device_time_s: exposing.device_time_s,
        }
    }
}
