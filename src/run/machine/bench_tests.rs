//! A scripted device that runs commands in order, latches stops and loses links, and a bench with
//! the machine at its other end. It checks that each reading is taken once and at its own pose.

use std::sync::Arc;

use firmware_protocol::{AxisCounts, AxisMask, Done, Shutter, Sweep, Tick, Window};

use super::*;
use crate::plan::Step;
use crate::rig::{Approach, AxisPositions, ReadingKind, Rig};

pub(super) const QUEUE_DEPTH: usize = 8;
pub(super) const AXES: AxisMask = AxisMask(0b1111);
pub(super) const NOW: Instant = Instant::ZERO;

/// The built-in rig, with an arm that comes to its targets from below, and a channel order of
/// its own.
pub(super) fn rig() -> Arc<Rig> {
    let mut rig = Rig::built_in().unwrap();
    for (axis, channel) in rig.axes.iter_mut().zip([2, 0, 3, 1]) {
        axis.channel = channel;
    }
    rig.axes[0].approach = Approach::Positive;
    rig.axes[0].run_up = 0.01;
    Arc::new(rig)
}

pub(super) fn step(id: u32, kind: ReadingKind) -> Step {
    let n = i32::try_from(id % 7).unwrap();
    Step {
        id,
        kind,
        pose: None,
        positions: AxisPositions([0.0; 4]),
        // Every third is where the one before it was.
        counts: Latched([1000 * (n - n % 3), -500 * (n - n % 3), 10, 20]),
        via: None,
        settle: Duration::from_millis(50),
        gain: 0,
        dwell: Duration::from_millis(50),
        shutter: Shutter::Open,
        source_off: false,
        swept: None,
    }
}

pub(super) fn steps(n: u32) -> Vec<Step> {
    (0..n).map(|id| step(id, ReadingKind::Target { index: id, repeat: 0 })).collect()
}

#[derive(Default)]
pub(super) struct Device {
    pub(super) boot_id: u32,
    pub(super) homed: bool,
    pub(super) latched: Option<Cause>,
    pub(super) queue: VecDeque<Request>,
    pub(super) at: AxisCounts,
    pub(super) last_id: Option<CommandId>,
    pub(super) ticks: u32,
    pub(super) upward: VecDeque<Input>,
    pub(super) downward: VecDeque<Request>,
    pub(super) has_moved: bool,
    /// The most windows of a sweep; 0: it can't sweep.
    pub(super) windows: u16,
    /// Readings of windows that are lost on the way, once.
    pub(super) lost: Vec<u32>,
    pub(super) kept: Vec<(u32, Window)>,
    pub(super) sweeps: usize,
}

pub(super) fn id_of(request: &Request) -> CommandId {
    match request {
        Request::Home(home) => home.id,
        Request::MoveTo(to) => to.id,
        Request::Dwell(dwell) => dwell.id,
        Request::Sweep(sweep) => sweep.id,
        other => panic!("{other:?} has no number"),
    }
}

impl Device {
    pub(super) fn identify(&mut self) -> Connected {
        self.upward.clear();
        self.downward.clear();
        self.queue.clear();
        Connected {
            boot_id: self.boot_id,
            queue_depth: u8::try_from(QUEUE_DEPTH).unwrap(),
            homed: AxisMask(if self.homed { AXES.0 } else { 0 }),
            last_id: self.last_id,
            fault: self.latched,
            windows: self.windows,
        }
    }

    /// Takes one request off the wire; `Stop` first if it may overtake.
    pub(super) fn hear(&mut self, stop_overtakes: bool) {
        let stop = self.downward.iter().position(|request| *request == Request::Stop);
        let at = stop.filter(|_| stop_overtakes).unwrap_or(0);
        match self.downward.remove(at) {
            None => {}
            Some(Request::Acknowledge(id)) => self.kept.retain(|(_, window)| window.id != id),
            Some(Request::FetchWindow(id, index)) => {
                let is_it = |window: &Window| window.id == id && window.index == index;
                let kept = self.kept.iter().find(|(_, window)| is_it(window));
                self.upward.push_back(kept.map_or(Input::WindowGone(id), |(_, window)| {
                    Input::Event(Event::Window(window.clone()))
                }));
            }
            Some(Request::Stop) => {
                self.upward.push_back(Input::Stopping);
                self.stop(Cause::Stopped);
            }
            Some(Request::ClearFault) => {
                self.latched = None;
                self.upward.push_back(Input::Cleared);
            }
            Some(command) => self.take(command),
        }
    }

    pub(super) fn take(&mut self, command: Request) {
        let id = id_of(&command);
        let rejection = if let Some(cause) = self.latched {
            Some(Rejection::Faulted(cause))
        } else if self.last_id.is_some_and(|last| last >= id) {
            Some(Rejection::IdReused)
        } else if self.queue.len() > QUEUE_DEPTH {
            Some(Rejection::QueueFull)
        } else if !self.homed && matches!(command, Request::MoveTo(_)) {
            Some(Rejection::Unhomed(0))
        } else {
            None
        };
        if let Some(rejection) = rejection {
            self.upward.push_back(Input::Rejected(id, rejection));
            return;
        }
        self.last_id = Some(id);
        self.queue.push_back(command);
        self.upward.push_back(Input::Accepted(id));
    }

    pub(super) fn stop(&mut self, cause: Cause) {
        self.latched.get_or_insert(cause);
        if matches!(self.queue.front(), Some(Request::Home(_))) {
            self.homed = false;
        }
        for command in self.queue.drain(..) {
            let failed = Event::Failed(id_of(&command), cause, Tick(self.ticks));
            self.upward.push_back(Input::Event(failed));
        }
    }

    pub(super) fn restart(&mut self) {
        let (boot_id, ticks) = (self.boot_id + 1, self.ticks);
        *self = Self { boot_id, ticks, windows: self.windows, ..Self::default() };
    }

    /// Ends the command that runs.
    pub(super) fn work(&mut self) {
        let Some(command) = self.queue.pop_front() else { return };
        self.ticks += 100_000;
        let tick = Tick(self.ticks);
        let event = match command {
            Request::Home(home) => {
                self.at = AxisCounts([0; 4].into_iter().collect());
                self.homed = true;
                Event::Done(Done { id: home.id, readback: self.at.clone(), tick })
            }
            Request::MoveTo(to) => {
                self.at = to.targets;
                Event::Done(Done { id: to.id, readback: self.at.clone(), tick })
            }
            Request::Dwell(dwell) => Event::Sampled(DwellResult {
                id: dwell.id,
                reading: dwell.reading,
                gain: dwell.gain,
                n: 100,
                mean: 1e5,
                variance: 1.0,
                min: 99_999,
                max: 100_001,
                saturated: 0,
                start: self.at.clone(),
                end: self.at.clone(),
                start_tick: tick,
                end_tick: tick,
            }),
            Request::Sweep(sweep) => self.sweep(&sweep),
            other => panic!("{other:?} was queued"),
        };
        self.upward.push_back(Input::Event(event));
    }
}

impl Device {
    fn sweep(&mut self, sweep: &Sweep) -> Event {
        self.sweeps += 1;
        let mut start = sweep.from.clone();
        for index in 0..sweep.windows {
            let window = Window {
                id: sweep.id,
                index,
                mean: 1e5,
                variance: 1.0,
                min: 99_999,
                max: 100_001,
                saturated: 0,
                start: start.clone(),
                moved: sweep.step.clone(),
                start_tick: Tick(self.ticks),
                duration_us: 25_000,
            };
            start.0.iter_mut().zip(&sweep.step.0).for_each(|(at, step)| *at += step);
            self.ticks += 25_000;
            let reading = sweep.reading + u32::from(index);
            self.kept.push((reading, window.clone()));
            if let Some(lost) = self.lost.iter().position(|lost| *lost == reading) {
                self.lost.remove(lost);
            } else {
                self.upward.push_back(Input::Event(Event::Window(window)));
            }
        }
        self.at = start;
        Event::Done(Done { id: sweep.id, readback: self.at.clone(), tick: Tick(self.ticks) })
    }
}

/// Machine and device, and what came of it.
pub(super) struct Bench {
    pub(super) machine: Machine,
    pub(super) device: Device,
    pub(super) rig: Arc<Rig>,
    pub(super) taken: Vec<Step>,
    pub(super) states: Vec<State>,
    pub(super) asked: Vec<Source>,
    pub(super) outcome: Option<Outcome>,
    pub(super) reconnects: usize,
    /// Asked for; whoever tests answers.
    pub(super) decisions: usize,
    pub(super) is_linked: bool,
    pub(super) verdict: Result<(), String>,
}

impl Bench {
    pub(super) fn new(program: Program, on_fault: OnFault) -> Self {
        Self::on(Device { boot_id: 1, ..Device::default() }, program, on_fault)
    }

    pub(super) fn on(device: Device, program: Program, on_fault: OnFault) -> Self {
        let rig = rig();
        let setup = Setup { rig: rig.clone(), home_first: true, on_fault };
        let mut bench = Self {
            machine: Machine::new(setup, program),
            device,
            rig,
            taken: Vec::new(),
            states: Vec::new(),
            asked: Vec::new(),
            outcome: None,
            reconnects: 0,
            decisions: 0,
            is_linked: true,
            verdict: Ok(()),
        };
        let connected = bench.device.identify();
        bench.tell(Input::Connected(connected));
        bench
    }

    pub(super) fn tell(&mut self, input: Input) {
        self.machine.handle(NOW, input);
        self.act();
    }

    pub(super) fn wish(&mut self, wish: Wish) -> Answer {
        let answer = self.machine.handle_request(NOW, wish);
        self.act();
        answer
    }

    pub(super) fn act(&mut self) {
        while let Some(action) = self.machine.poll_action() {
            assert_eq!(self.outcome, None, "{action:?} after the end");
            match action {
                Action::Send(request) => {
                    self.device.has_moved |= matches!(request, Request::MoveTo(_));
                    if self.is_linked {
                        self.device.downward.push_back(request);
                    }
                }
                Action::Record(taken) => {
                    let at = channels::to_axes(&self.rig, &taken.result.start);
                    assert_eq!(at, taken.step.counts, "reading {} at another pose", taken.step.id);
                    assert_eq!(taken.step.id, taken.result.reading);
                    assert!(self.taken.iter().all(|had| had.id != taken.step.id), "taken twice");
                    self.taken.push(taken.step);
                }
                Action::Became(state) => self.states.push(state),
                Action::AskSource(source) => self.asked.push(source),
                Action::Judge => self.machine.handle(NOW, Input::Judged(self.verdict.clone())),
                Action::Decide => self.decisions += 1,
                Action::Reconnect => self.reconnects += 1,
                Action::Finish(outcome) => self.outcome = Some(outcome),
                Action::Fault(_) | Action::Position(_) => {}
            }
        }
    }

    pub(super) fn deliver(&mut self) {
        if let Some(input) = self.device.upward.pop_front() {
            self.tell(input);
        }
    }

    pub(super) fn time_out(&mut self) {
        if let Some(at) = self.machine.poll_timeout() {
            self.machine.handle_timeout(at);
            self.act();
        }
    }

    pub(super) fn cut(&mut self) {
        self.device.stop(Cause::LeaseExpired);
        self.device.upward.clear();
        self.device.downward.clear();
        self.is_linked = false;
        self.tell(Input::Fault(Fault::LinkLost("pulled".into())));
    }

    /// Lets everything happen until nothing more does.
    pub(super) fn settle(&mut self) {
        for _ in 0..10_000 {
            if self.reconnects > 0 {
                self.reconnects = 0;
                self.is_linked = true;
                let connected = self.device.identify();
                self.tell(Input::Connected(connected));
            }
            self.device.hear(false);
            self.deliver();
            self.time_out();
            if self.device.downward.is_empty() && self.device.upward.is_empty() {
                if self.device.queue.is_empty() {
                    return;
                }
                self.device.work();
            }
        }
        panic!("no end: {:?}", self.machine);
    }

    pub(super) fn step_until(&mut self, state: State) {
        for _ in 0..1000 {
            if self.machine.state() == state {
                return;
            }
            self.device.hear(false);
            self.deliver();
            if self.machine.state() == state {
                return;
            }
            if self.device.downward.is_empty() && self.device.upward.is_empty() {
                self.device.work();
            }
        }
        panic!("never {}: {:?}", state.name(), self.states);
    }
}
