//! Driving the rig by hand while no run goes on: home, jog, read, look.

use std::time::Duration;

use firmware_protocol::{
    Cause, CommandId, Dwell, DwellResult, Event, Home, MoveTo, Rejection, Reply, Request, Shutter,
    Status,
};
use thiserror::Error;
use tokio::sync::mpsc;

use super::channels::{all_axes, micros, route, to_axes, to_channels};
use super::desk::{Desk, Order};
use super::events::Happening;
use super::hardware::{Hardware, ReachError};
use super::machine::{Answer, Wish};
use super::reading::{Taking, reading};
use super::state::{Doubt, Fault, Position, State};
use crate::device::{Controller, DeviceEvent, NamedFault};
use crate::plan::Step;
use crate::rig::{DeviceTimes, Latched, LimitError, Reading, ReadingKind};

/// Why the rig did not do what it was told by hand.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum HandError {
    /// Wait for its end, or abort it.
    #[error("a run goes on")]
    Busy,
    /// The device stopped by itself, or was stopped.
    #[error("{}", Fault::Device(*.0))]
    Failed(Cause),
    /// One of the rig's devices stands still, and says why.
    #[error("{0}")]
    Fault(NamedFault),
    /// The owner has ended.
    #[error("the owner of the rig has ended")]
    Gone,
    /// Too far.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The link broke.
    #[error("{0}")]
    Link(String),
    /// The rig is not there.
    #[error(transparent)]
    Reach(#[from] ReachError),
    /// The device refused.
    #[error("{}", Fault::Refused(*.0))]
    Refused(Rejection),
}

/// Where the axes stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// Encoder positions, counts.
    pub counts: Latched,
    /// Whether all axes have found their home marks in this boot.
    pub is_homed: bool,
    /// What the device stands still for.
    pub fault: Option<Cause>,
}

/// A reading to take by hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TakeOne {
    /// The gain range, an index into the detector's.
    pub gain: u8,
    /// The integration.
    pub dwell: Duration,
    /// Whether the shutter is open.
    pub shutter: Shutter,
}

/// The rig in somebody's hand.
pub(super) struct Hand<'a> {
    pub(super) hardware: &'a mut Hardware,
    pub(super) orders: &'a mut mpsc::Receiver<Order>,
    pub(super) desk: &'a mut Desk,
}

impl Hand<'_> {
    pub(super) async fn home(&mut self) -> Result<Stand, HandError> {
        let (id, _) = self.begin().await?;
        let axes = all_axes(&self.hardware.rig);
        self.desk.tell(Happening::State(State::Homing));
        let homed = self.execute(id, Request::Home(Home { id, axes })).await;
        self.desk.tell(Happening::State(State::Idle));
        let stand = match homed {
            Ok(_) => self.look().await?,
            Err(error) => {
                let doubt = Position::Untrusted(Doubt::NotHomed);
                self.desk.tell(Happening::Position(doubt));
                return Err(error);
            }
        };
        Ok(stand)
    }

    pub(super) async fn jog(&mut self, to: Latched) -> Result<Stand, HandError> {
        let (id, status) = self.begin().await?;
        let rig = self.hardware.rig.clone();
        let from = to_axes(&rig, &status.readback);
        rig.check_move(from, rig.positions(to))?;
        let way = route(&rig, Some(from), to);
        self.desk.tell(Happening::State(State::Moving));
        let mut moved = Ok(());
        for (n, stop) in (0..).zip(way.via.into_iter().chain([to])) {
            let id = CommandId(id.0.saturating_add(n));
            let targets = to_channels(&rig, stop);
            moved = self.execute(id, Request::MoveTo(MoveTo { id, targets })).await.map(|_| ());
            if moved.is_err() {
                break;
            }
        }
        if moved.is_ok() {
            self.desk.tell(Happening::State(State::Settling));
            tokio::time::sleep(way.settle).await;
        }
        self.desk.tell(Happening::State(State::Idle));
        moved?;
        self.look().await
    }

    pub(super) async fn take(&mut self, one: TakeOne) -> Result<Reading, HandError> {
        let (id, status) = self.begin().await?;
        let counts = to_axes(&self.hardware.rig, &status.readback);
        let TakeOne { gain, dwell, shutter } = one;
        let request = Request::Dwell(Dwell {
            id,
            reading: id.0,
            gain,
            shutter,
            settle_us: 0,
            duration_us: micros(dwell),
        });
        self.desk.tell(Happening::State(State::Dwelling));
        let taken = self.execute(id, request).await;
        self.desk.tell(Happening::State(State::Idle));
        let Some(result) = taken? else {
            return Err(HandError::Link("the device ended a dwell as a move".to_owned()));
        };
        Ok(self.reading(counts, one, &result))
    }

    fn reading(&self, counts: Latched, one: TakeOne, result: &DwellResult) -> Reading {
        let step = Step {
            id: result.reading,
            kind: match one.shutter {
                Shutter::Closed => ReadingKind::Dark,
                Shutter::Open => ReadingKind::Target { index: 0, repeat: 0 },
            },
            pose: None,
            positions: self.hardware.rig.positions(counts),
            counts,
            via: None,
            settle: Duration::ZERO,
            gain: one.gain,
            dwell: one.dwell,
            shutter: one.shutter,
            source_off: false,
            swept: None,
        };
        let taking = Taking {
            session: 0,
            session_began_s: 0.0,
            start_us: 0,
            end_us: i64::from(result.end_tick.micros_since(result.start_tick)),
            device_times: DeviceTimes::default(),
            link_retries: 0,
        };
        reading(&self.hardware.rig, &step, result, taking)
    }

    pub(super) async fn look(&mut self) -> Result<Stand, HandError> {
        let status = match &mut self.hardware.controller {
            Some(controller) => controller.status().await.ok(),
            None => None,
        };
        let status = match status {
            Some(status) => status,
            None => self.hardware.reach().await?.status,
        };
        let is_homed = self.is_homed(&status);
        self.desk.tell(Happening::Position(if is_homed {
            Position::Trusted { boot_id: status.boot_id }
        } else {
            Position::Untrusted(Doubt::NotHomed)
        }));
        let counts = to_axes(&self.hardware.rig, &status.readback);
        Ok(Stand { counts, is_homed, fault: status.fault })
    }

    fn is_homed(&self, status: &Status) -> bool {
        let axes = all_axes(&self.hardware.rig).0;
        status.homed.0 & axes == axes
    }

    /// Opens a session, and leaves whatever the device stands still for: driving by hand is an
    /// explicit act. The next command's number, and the device's state.
    async fn begin(&mut self) -> Result<(CommandId, Status), HandError> {
        let status = self.hardware.reach().await?.status;
        if status.fault.is_some() {
            let controller = self.controller()?;
            controller.submit(Request::ClearFault);
            loop {
                match controller.next_event().await {
                    DeviceEvent::Reply { reply: Reply::Cleared, .. } => break,
                    DeviceEvent::Reply { reply: Reply::Rejected(_, why), .. } => {
                        return Err(HandError::Refused(why));
                    }
                    DeviceEvent::LinkLost(lost) => return Err(HandError::Link(lost.to_string())),
                    DeviceEvent::Restarted { .. } => {
                        return Err(HandError::Link(Fault::Restarted.to_string()));
                    }
                    DeviceEvent::Clocks(..)
                    | DeviceEvent::Reply { .. }
                    | DeviceEvent::Event(_)
                    | DeviceEvent::Fault(_) => {}
                }
            }
        }
        let id = status.last_id.map_or(1, |last| last.0.saturating_add(1));
        Ok((CommandId(id), status))
    }

    fn controller(&mut self) -> Result<&mut Controller, HandError> {
        self.hardware.controller.as_mut().ok_or_else(|| HandError::Link("no link".to_owned()))
    }

    /// One command, to its end; a dwell has a result. An abort stops it.
    async fn execute(
        &mut self,
        id: CommandId,
        request: Request,
    ) -> Result<Option<DwellResult>, HandError> {
        let Some(controller) = self.hardware.controller.as_mut() else {
            return Err(HandError::Link("no link".to_owned()));
        };
        controller.submit(request);
        loop {
            let event = tokio::select! {
                biased;
                order = self.orders.recv() => {
                    match order {
                        Some(Order::Wish(Wish::Abort | Wish::Stop, reply)) => {
                            controller.stop();
                            let _ = reply.send(Some(Answer::Ending));
                        }
                        Some(Order::ShutDown) | None => {
                            self.desk.is_closing = true;
                            controller.stop();
                            return Err(HandError::Gone);
                        }
                        Some(other) => other.refuse(),
                    }
                    continue;
                }
                event = controller.next_event() => event,
            };
            match event {
                DeviceEvent::Event(Event::Done(done)) if done.id == id => {
                    controller.acknowledge(id);
                    return Ok(None);
                }
                DeviceEvent::Event(Event::Sampled(result)) if result.id == id => {
                    controller.acknowledge(id);
                    return Ok(Some(result));
                }
                DeviceEvent::Event(Event::Failed(failed, cause, _)) if failed == id => {
                    controller.acknowledge(id);
                    return Err(HandError::Failed(cause));
                }
                DeviceEvent::Reply { reply: Reply::Rejected(refused, why), .. }
                    if refused == id =>
                {
                    return Err(HandError::Refused(why));
                }
                DeviceEvent::LinkLost(lost) => return Err(HandError::Link(lost.to_string())),
                DeviceEvent::Restarted { .. } => {
                    return Err(HandError::Link(Fault::Restarted.to_string()));
                }
                DeviceEvent::Fault(fault) => return Err(HandError::Fault(fault)),
                DeviceEvent::Clocks(..) | DeviceEvent::Event(_) | DeviceEvent::Reply { .. } => {}
            }
        }
    }
}
