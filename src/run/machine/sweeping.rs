//! Sweeps: several windows handed out as one command, and each window's reading taken over once,
//! as it comes or when it is fetched.

use firmware_protocol::{CommandId, DwellResult, Request, Sweep, Tick, Window};

use super::{Action, Fault, Index, Machine, Taken, What};
use crate::plan::Step;
use crate::rig::comes_to_rest;
use crate::run::channels::{micros, route_to_flight, to_channels};

/// Sweeps that are handed out ahead: one that runs, and one that waits behind it.
const SWEEPS_AHEAD: usize = 2;

/// What a sweep on the device measures.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sweeping {
    first: Index,
    windows: u16,
    /// The axes rest, and every window has been said: what is missing is fetched.
    is_over: bool,
}

impl Sweeping {
    fn indices(self) -> impl Iterator<Item = Index> {
        (0..usize::from(self.windows)).map(move |window| self.first.plus(window))
    }
}

impl What {
    /// The readings that it is to yield.
    pub(super) fn indices(&self) -> Vec<Index> {
        match self {
            Self::Home | Self::Move => Vec::new(),
            Self::Dwell { index, .. } => vec![*index],
            Self::Sweep(sweeping) => sweeping.indices().collect(),
        }
    }
}

impl Machine {
    /// A sweep may take a move to where axes come from their own side.
    pub(super) fn has_room_for_sweep(&self) -> bool {
        let is_sweep = |what: &What| matches!(what, What::Sweep(sweep) if !sweep.is_over);
        let sweeps = self.outstanding.iter().filter(|o| is_sweep(&o.what)).count();
        sweeps < SWEEPS_AHEAD && self.outstanding.len() + 1 < self.window
    }

    /// Hands out as many windows of the sweep that begins here as one command can have. False if
    /// the rig can't, which a plan's sweeps were checked for.
    pub(super) fn submit_sweep(&mut self, first: Index) -> bool {
        let windows = self.work.windows_ahead(self.windows).max(1);
        let (step, rig) = (*self.work.step(first), self.setup.rig.clone());
        let Some(flight) = step.flight(windows) else { return false };
        let motion = match rig.flight(flight) {
            Ok(motion) => motion,
            Err(rejection) => {
                self.stand_still(Fault::Refused(rejection));
                return false;
            }
        };
        for _ in 0..windows {
            self.work.take();
        }
        let way = route_to_flight(&rig, self.commanded, flight, &motion);
        if let Some(via) = way.via {
            let targets = to_channels(&rig, via);
            self.send(What::Move, |id| Request::MoveTo(firmware_protocol::MoveTo { id, targets }));
        }
        let sweep = |id| Sweep {
            id,
            reading: step.id,
            gain: step.gain,
            settle_us: micros(way.settle),
            lead_us: micros(flight.lead),
            readings: rig.detector.adc.readings_in(flight.window),
            windows,
            from: to_channels(&rig, flight.from),
            step: to_channels(&rig, flight.travel),
        };
        let sweeping = Sweeping { first, windows, is_over: false };
        self.send(What::Sweep(sweeping), |id| Request::Sweep(sweep(id)));
        self.commanded = Some(comes_to_rest(&motion));
        true
    }

    pub(super) fn is_sweep(&self, id: CommandId) -> bool {
        self.sweeping(id).is_some()
    }

    fn sweeping(&self, id: CommandId) -> Option<(Sweeping, bool)> {
        let outstanding = self.outstanding.iter().find(|outstanding| outstanding.id == id)?;
        match outstanding.what {
            What::Sweep(sweeping) => Some((sweeping, outstanding.is_void)),
            _ => None,
        }
    }

    /// A window has its reading.
    pub(super) fn on_window(&mut self, window: &Window) {
        let id = window.id;
        let Some((sweeping, is_void)) = self.sweeping(id) else { return };
        if is_void || window.index >= sweeping.windows {
            return;
        }
        let index = sweeping.first.plus(window.index.into());
        let step = *self.work.step(index);
        if self.work.record(index) {
            self.queue_full = 0;
            let readings = self.setup.rig.detector.adc.readings_in(step.dwell);
            let result = result(window, &step, readings);
            self.actions.push_back(Action::Record(Box::new(Taken { step, id, result })));
        }
        if sweeping.is_over {
            self.close_sweep(id, sweeping);
        }
    }

    /// The device has said all windows of a sweep, and rests.
    pub(super) fn on_swept(&mut self, id: CommandId) {
        let Some((sweeping, is_void)) = self.sweeping(id) else { return };
        let sweeping = Sweeping { is_over: true, ..sweeping };
        for outstanding in self.outstanding.iter_mut().filter(|outstanding| outstanding.id == id) {
            outstanding.what = What::Sweep(sweeping);
        }
        if is_void {
            self.give_up_sweep(id);
            return;
        }
        for (window, index) in (0..).zip(sweeping.indices()) {
            if !self.work.is_recorded(index) {
                self.actions.push_back(Action::Send(Request::FetchWindow(id, window)));
            }
        }
        self.close_sweep(id, sweeping);
    }

    /// The device says that it has no such window: it is measured again.
    pub(super) fn on_window_gone(&mut self, id: CommandId) {
        if self.is_sweep(id) {
            self.give_up_sweep(id);
        }
    }

    /// Acknowledges a sweep once every window's reading was taken over.
    fn close_sweep(&mut self, id: CommandId, sweeping: Sweeping) {
        if sweeping.indices().all(|index| self.work.is_recorded(index)) {
            self.end(id);
            self.acknowledge(id);
        }
    }

    fn give_up_sweep(&mut self, id: CommandId) {
        if let Some(ended) = self.end(id) {
            self.unmeasured.extend(ended.what.indices());
        }
        self.acknowledge(id);
    }
}

/// A window as a reading that was asked for: what its command said of it is not said again.
fn result(window: &Window, step: &Step, readings: u32) -> DwellResult {
    let end = window.start.0.iter().zip(&window.moved.0);
    DwellResult {
        id: window.id,
        reading: step.id,
        gain: step.gain,
        n: readings,
        mean: window.mean,
        variance: window.variance,
        min: window.min,
        max: window.max,
        saturated: window.saturated,
        start: window.start.clone(),
        end: firmware_protocol::AxisCounts(
            end.map(|(start, moved)| start.wrapping_add(*moved)).collect(),
        ),
        start_tick: window.start_tick,
        end_tick: Tick(window.start_tick.0.wrapping_add(window.duration_us)),
    }
}
