//! Opening a session: every device is asked who it is, and compared with the rig file.

use firmware_protocol::{AxisIdentity, Identity, Instant, Reply, RequestType};

use super::part::Awaited;
use super::{Composer, DeviceEvent, Halting, QUEUE_DEPTH, SPOKEN, Said};
use crate::device::axes::{AxesCommand, AxesFacts};
use crate::device::controller::ConnectError;
use crate::device::driver::Refusal;
use crate::rig::Readback;

/// How far an opening has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Opening {
    /// What an earlier session left comes to rest first.
    Resting,
    /// The devices were asked.
    Asking,
}

impl Composer {
    /// Opens a session anew: what an earlier one left is stopped and forgotten.
    pub(super) fn identify(&mut self, now: Instant) {
        self.queue.clear();
        self.unacknowledged.clear();
        let was_busy = self.running.take().is_some();
        if was_busy || self.halting.is_some() {
            self.halt(now, Halting::silent());
        }
        self.opening = Some(Opening::Resting);
    }

    /// Whether the opening came further.
    pub(super) fn go_on_opening(&mut self, now: Instant) -> bool {
        match self.opening {
            Some(Opening::Resting) if self.halting.is_none() => {
                self.opening = Some(Opening::Asking);
                self.ask(now);
                true
            }
            Some(Opening::Asking) if self.are_all_ready() => {
                self.opening = None;
                self.said.push_back(Said::Devices(self.names()));
                let identity = Reply::Identity(self.identity());
                self.say(DeviceEvent::Reply {
                    request: RequestType::Identify,
                    reply: identity,
                    retries: 0,
                });
                true
            }
            _ => false,
        }
    }

    /// Whoever is known shows a sign of life; the others say who they are.
    fn ask(&mut self, now: Instant) {
        for part in &mut self.parts {
            if part.is_gone {
                continue;
            }
            if part.facts.is_some() {
                part.begin(now, AxesCommand::Locate);
            } else {
                part.fault = None;
                part.awaited = Some(Awaited::Ready);
                part.driver.open(now);
            }
        }
        if self.meter.facts.is_none() && !self.meter.is_gone {
            self.meter.open(now);
        }
    }

    fn are_all_ready(&self) -> bool {
        let is_ready = |part: &super::Part| part.awaited.is_none() && part.facts.is_some();
        self.parts.iter().all(is_ready) && self.meter.facts.is_some()
    }

    /// A device said who it is.
    pub(super) fn ready(&mut self, n: usize, facts: AxesFacts) {
        let Some(part) = self.parts.get_mut(n) else { return };
        if part.awaited != Some(Awaited::Ready) {
            return;
        }
        part.awaited = None;
        let name = part.driver.name().to_owned();
        let refused = |what: String, expected: String, help: &str| {
            let help = help.to_owned();
            ConnectError::Refused(Refusal { device: name.clone(), what, expected, help })
        };
        if facts.axes.len() != part.channels.len() {
            let (found, expected) = (facts.axes.len(), part.channels.len());
            let error = refused(
                format!("it answers for {found} axes"),
                format!("the {expected} that the rig file lists"),
                "correct its [[axes_link]]",
            );
            return self.unfit(error);
        }
        let axes = facts.axes.iter().zip(&part.says_encoder);
        let wrong = axes
            .zip(&part.channels)
            .find(|((axis, says_encoder), _)| **says_encoder && axis.readback != Readback::Encoder);
        if let Some((_, channel)) = wrong {
            let error = refused(
                format!("it reads back steps and has no encoder on channel {channel}"),
                "readback = \"steps\" in the rig file".to_owned(),
                "say \"steps\", or \"none\" with the uncertainty of an open loop",
            );
            return self.unfit(error);
        }
        let mask = part.mask();
        self.homed = if facts.is_homed { self.homed | mask } else { self.homed & !mask };
        part.fault.clone_from(&facts.fault);
        if let Some(fault) = &facts.fault {
            self.fault.get_or_insert(fault.cause);
        }
        part.facts = Some(facts);
    }

    /// What each device calls itself.
    fn names(&self) -> Vec<String> {
        let axes = self.parts.iter().filter_map(|part| {
            Some(format!("{}: {}", part.driver.name(), part.facts.as_ref()?.identity))
        });
        let meter = self.meter.facts.as_ref();
        let meter = meter.map(|facts| format!("{}: {}", self.meter.driver.name(), facts.identity));
        axes.chain(meter).collect()
    }

    /// What the devices are, as one.
    fn identity(&self) -> Identity {
        let mut axes =
            vec![AxisIdentity { low: 0, high: 0, speed: 0, acceleration: 0 }; self.here.len()];
        for part in &self.parts {
            let Some(facts) = &part.facts else { continue };
            for ((channel, zero), axis) in part.channels.iter().zip(&part.zeros).zip(&facts.axes) {
                if let Some(slot) = axes.get_mut(*channel) {
                    *slot = AxisIdentity {
                        low: axis.low.saturating_sub(*zero),
                        high: axis.high.saturating_sub(*zero),
                        speed: axis.speed,
                        acceleration: axis.acceleration,
                    };
                }
            }
        }
        Identity {
            protocol: SPOKEN,
            boot_id: self.boot_id,
            queue_depth: u8::try_from(QUEUE_DEPTH).unwrap_or(u8::MAX),
            // No device of several has to hear from us in time: see `Promises`.
            lease_ms: 0,
            gains: u8::try_from(self.meter.full_scales.len()).unwrap_or(u8::MAX),
            adc_bits: self.meter.adc.bits,
            adc_rate_hz: self.meter.adc.rate_hz,
            axes: axes.into_iter().collect(),
        }
    }
}
