//! The machine against a scripted device that runs commands in order, keeps results, latches
//! stops, and loses links: whatever is asked in whatever order, each reading is taken over once,
//! at its own pose, and nothing moves when the run is over.

use std::sync::Arc;

use firmware_protocol::{AxisCounts, Done, Shutter, Tick};
use proptest::prelude::*;

use super::*;
use crate::plan::{RESUME_IDS_FROM, WARM_UP_IDS_FROM, WarmUp};
use crate::rig::{Approach, AxisPositions, ReadingKind};

const QUEUE_DEPTH: usize = 8;
const AXES: AxisMask = AxisMask(0b1111);
const NOW: Instant = Instant::ZERO;

/// The built-in rig, with an arm that comes to its targets from below, and a channel order of
/// its own.
fn rig() -> Arc<Rig> {
    let mut rig = Rig::built_in().unwrap();
    for (axis, channel) in rig.axes.iter_mut().zip([2, 0, 3, 1]) {
        axis.channel = channel;
    }
    rig.axes[0].approach = Approach::Positive;
    rig.axes[0].run_up = 0.01;
    Arc::new(rig)
}

fn step(id: u32, kind: ReadingKind) -> Step {
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
    }
}

fn steps(n: u32) -> Vec<Step> {
    (0..n).map(|id| step(id, ReadingKind::Target { index: id, repeat: 0 })).collect()
}

#[derive(Default)]
struct Device {
    boot_id: u32,
    homed: bool,
    latched: Option<Cause>,
    queue: VecDeque<Request>,
    at: AxisCounts,
    last_id: Option<CommandId>,
    ticks: u32,
    upward: VecDeque<Input>,
    downward: VecDeque<Request>,
    has_moved: bool,
}

fn id_of(request: &Request) -> CommandId {
    match request {
        Request::Home(home) => home.id,
        Request::MoveTo(to) => to.id,
        Request::Dwell(dwell) => dwell.id,
        other => panic!("{other:?} has no number"),
    }
}

impl Device {
    fn identify(&mut self) -> Connected {
        self.upward.clear();
        self.downward.clear();
        self.queue.clear();
        Connected {
            boot_id: self.boot_id,
            queue_depth: u8::try_from(QUEUE_DEPTH).unwrap(),
            homed: AxisMask(if self.homed { AXES.0 } else { 0 }),
            last_id: self.last_id,
            fault: self.latched,
        }
    }

    /// Takes one request off the wire; `Stop` first if it may overtake.
    fn hear(&mut self, stop_overtakes: bool) {
        let stop = self.downward.iter().position(|request| *request == Request::Stop);
        let at = stop.filter(|_| stop_overtakes).unwrap_or(0);
        match self.downward.remove(at) {
            None | Some(Request::Acknowledge(_)) => {}
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

    fn take(&mut self, command: Request) {
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

    fn stop(&mut self, cause: Cause) {
        self.latched.get_or_insert(cause);
        if matches!(self.queue.front(), Some(Request::Home(_))) {
            self.homed = false;
        }
        for command in self.queue.drain(..) {
            let failed = Event::Failed(id_of(&command), cause, Tick(self.ticks));
            self.upward.push_back(Input::Event(failed));
        }
    }

    fn restart(&mut self) {
        let (boot_id, ticks) = (self.boot_id + 1, self.ticks);
        *self = Self { boot_id, ticks, ..Self::default() };
    }

    /// Ends the command that runs.
    fn work(&mut self) {
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
            other => panic!("{other:?} was queued"),
        };
        self.upward.push_back(Input::Event(event));
    }
}

/// Machine and device, and what came of it.
struct Bench {
    machine: Machine,
    device: Device,
    rig: Arc<Rig>,
    taken: Vec<Step>,
    states: Vec<State>,
    asked: Vec<Source>,
    outcome: Option<Outcome>,
    reconnects: usize,
    is_linked: bool,
    verdict: Result<(), String>,
}

impl Bench {
    fn new(program: Program, on_fault: OnFault) -> Self {
        let rig = rig();
        let setup = Setup { rig: rig.clone(), home_first: true, on_fault };
        let mut bench = Self {
            machine: Machine::new(setup, program),
            device: Device { boot_id: 1, ..Device::default() },
            rig,
            taken: Vec::new(),
            states: Vec::new(),
            asked: Vec::new(),
            outcome: None,
            reconnects: 0,
            is_linked: true,
            verdict: Ok(()),
        };
        let connected = bench.device.identify();
        bench.tell(Input::Connected(connected));
        bench
    }

    fn tell(&mut self, input: Input) {
        self.machine.handle(NOW, input);
        self.act();
    }

    fn wish(&mut self, wish: Wish) -> Answer {
        let answer = self.machine.handle_request(NOW, wish);
        self.act();
        answer
    }

    fn act(&mut self) {
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
                Action::Reconnect => self.reconnects += 1,
                Action::Finish(outcome) => self.outcome = Some(outcome),
                Action::Fault(_) | Action::Position(_) => {}
            }
        }
    }

    fn deliver(&mut self) {
        if let Some(input) = self.device.upward.pop_front() {
            self.tell(input);
        }
    }

    fn time_out(&mut self) {
        if let Some(at) = self.machine.poll_timeout() {
            self.machine.handle_timeout(at);
            self.act();
        }
    }

    fn cut(&mut self) {
        self.device.stop(Cause::LeaseExpired);
        self.device.upward.clear();
        self.device.downward.clear();
        self.is_linked = false;
        self.tell(Input::Fault(Fault::LinkLost("pulled".into())));
    }

    /// Lets everything happen until nothing more does.
    fn settle(&mut self) {
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

    fn step_until(&mut self, state: State) {
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

fn plain(n: u32) -> Program {
    Program { steps: steps(n), ..Program::default() }
}

#[test]
fn a_run_homes_then_takes_every_reading_in_order() {
    let mut bench = Bench::new(plain(20), OnFault::Finish);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
    assert_eq!(bench.taken, steps(20));
    assert_eq!(bench.states[0], State::Homing);
    assert_eq!(bench.states.last(), Some(&State::Done));
    assert_eq!(bench.machine.progress(), (20, 20));
    assert!(bench.states.contains(&State::Moving) && bench.states.contains(&State::Settling));
}

#[test]
fn commands_are_queued_several_ahead_but_never_beyond_the_queue() {
    let mut bench = Bench::new(plain(50), OnFault::Finish);
    bench.step_until(State::Moving);
    while !bench.device.downward.is_empty() {
        bench.device.hear(false);
    }
    assert!((4..=QUEUE_DEPTH).contains(&bench.device.queue.len()), "{:?}", bench.device.queue);
}

#[test]
fn an_empty_program_is_complete_after_homing() {
    let mut bench = Bench::new(plain(0), OnFault::Finish);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
}

#[test]
fn a_pause_finishes_the_dwell_that_runs_and_leaves_no_timer() {
    let mut bench = Bench::new(plain(20), OnFault::Wait);
    bench.step_until(State::Settling);
    let had = bench.taken.len();
    assert_eq!(bench.wish(Wish::Pause), Answer::Pausing);
    assert_eq!(bench.wish(Wish::Pause), Answer::Pausing);
    bench.settle();
    assert_eq!(bench.machine.state(), State::Paused);
    assert_eq!(bench.machine.poll_timeout(), None);
    assert_eq!(bench.taken.len(), had + 1);
    assert_eq!(bench.wish(Wish::Pause), Answer::Paused);
    assert_eq!(bench.wish(Wish::Continue), Answer::Continuing);
    assert_eq!(bench.states.iter().filter(|state| **state == State::Homing).count(), 1);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
    assert_eq!(bench.wish(Wish::Abort), Answer::Over);
}

#[test]
fn a_limit_switch_faults_and_continuing_homes_again() {
    let mut bench = Bench::new(plain(20), OnFault::Wait);
    bench.step_until(State::Dwelling);
    bench.device.stop(Cause::LimitSwitch(2));
    bench.settle();
    assert_eq!(bench.machine.fault(), Some(&Fault::Device(Cause::LimitSwitch(2))));
    assert!(!bench.machine.position().is_trusted());
    assert_eq!(bench.wish(Wish::ClearFault), Answer::Clearing);
    bench.settle();
    assert_eq!(bench.machine.state(), State::Paused);
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(bench.states.iter().filter(|state| **state == State::Homing).count(), 2);
    assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 20));
}

#[test]
fn a_fault_ends_a_run_that_nobody_watches() {
    let mut bench = Bench::new(plain(20), OnFault::Finish);
    bench.step_until(State::Dwelling);
    bench.device.stop(Cause::Detector);
    bench.settle();
    let fault = Fault::Device(Cause::Detector);
    assert_eq!(bench.outcome, Some(Outcome::Faulted(fault)));
}

#[test]
fn a_lost_link_never_moves_by_itself_and_trust_depends_on_the_boot() {
    for restarts in [false, true] {
        let mut bench = Bench::new(plain(20), OnFault::Wait);
        bench.step_until(State::Dwelling);
        bench.cut();
        assert_eq!(bench.machine.state(), State::Faulted);
        assert!(!bench.machine.position().is_trusted());
        if restarts {
            bench.device.restart();
        }
        bench.settle();
        assert_eq!(bench.machine.state(), State::Faulted);
        assert_eq!(bench.wish(Wish::Continue), Answer::Reconnecting);
        bench.settle();
        let homings = bench.states.iter().filter(|state| **state == State::Homing).count();
        assert_eq!(homings, if restarts { 2 } else { 1 });
        assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 20));
    }
}

#[test]
fn checks_are_judged_before_any_step() {
    let check = step(RESUME_IDS_FROM, ReadingKind::Reference);
    let mut bench = Bench::new(Program { checks: vec![check], ..plain(3) }, OnFault::Finish);
    bench.settle();
    assert_eq!(bench.taken[0], check);
    assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 4));
}

#[test]
fn a_reference_that_moved_stops_the_run_and_continue_accepts_it() {
    let check = step(RESUME_IDS_FROM, ReadingKind::Reference);
    let mut bench = Bench::new(Program { checks: vec![check], ..plain(3) }, OnFault::Wait);
    bench.verdict = Err("it moved".into());
    bench.settle();
    assert_eq!(bench.machine.fault(), Some(&Fault::ReferenceMoved("it moved".into())));
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!((bench.outcome, bench.taken.len()), (Some(Outcome::Complete), 4));
}

#[test]
fn warming_up_ends_when_stable_and_is_no_step() {
    let asked = WarmUp {
        tolerance_relative: 0.01,
        over: Duration::from_secs(1),
        timeout: Duration::from_secs(10),
    };
    let template = step(WARM_UP_IDS_FROM, ReadingKind::WarmUp);
    let mut bench =
        Bench::new(Program { warm_up: Some((asked, template, 5)), ..plain(3) }, OnFault::Finish);
    bench.settle();
    let warm_ups = bench.taken.iter().filter(|step| step.kind == ReadingKind::WarmUp);
    assert!(warm_ups.clone().count() >= 10);
    assert!(warm_ups.clone().all(|step| step.id >= WARM_UP_IDS_FROM + 5));
    assert_eq!((bench.outcome, bench.machine.progress()), (Some(Outcome::Complete), (3, 3)));
}

#[test]
fn a_dark_with_the_source_off_asks_and_waits() {
    let mut program = plain(3);
    program.steps[1].source_off = true;
    let mut bench = Bench::new(program, OnFault::Finish);
    bench.settle();
    assert_eq!((bench.machine.state(), bench.asked.clone()), (State::Paused, vec![Source::Off]));
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(
        (bench.machine.state(), bench.asked.clone()),
        (State::Paused, vec![Source::Off, Source::On])
    );
    bench.wish(Wish::Continue);
    bench.settle();
    assert_eq!(bench.outcome, Some(Outcome::Complete));
}

#[test]
fn a_full_queue_is_waited_for_and_voids_what_came_after() {
    let mut bench = Bench::new(plain(20), OnFault::Finish);
    bench.step_until(State::Moving);
    // The device refuses a move, but takes the dwell behind it.
    let at = bench.device.downward.iter().position(|r| matches!(r, Request::MoveTo(_))).unwrap();
    let refused = id_of(&bench.device.downward.remove(at).unwrap());
    bench.device.upward.push_back(Input::Rejected(refused, Rejection::QueueFull));
    bench.settle();
    assert_eq!(bench.taken, steps(20));
    assert_eq!(bench.outcome, Some(Outcome::Complete));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn every_reading_is_taken_once_whatever_happens(deeds in prop::collection::vec(0_u8..100, 1..400)) {
        let mut bench = Bench::new(plain(12), OnFault::Wait);
        for deed in deeds {
            if bench.outcome.is_some() {
                break;
            }
            match deed {
                0..30 => bench.device.hear(deed % 2 == 0),
                30..60 => bench.deliver(),
                60..82 => bench.device.work(),
                86..89 => { bench.wish(Wish::Pause); }
                89..93 => { bench.wish(Wish::Continue); }
                93 => { bench.wish(Wish::ClearFault); }
                94 => bench.device.stop(Cause::Stalled(1)),
                95 => bench.device.stop(Cause::LeaseExpired),
                96 if bench.is_linked => bench.cut(),
                97 if bench.is_linked => { bench.device.restart(); bench.is_linked = false; bench.tell(Input::Fault(Fault::Restarted)); }
                98 if bench.reconnects > 0 => {
                    bench.reconnects = 0;
                    bench.is_linked = true;
                    let connected = bench.device.identify();
                    bench.tell(Input::Connected(connected));
                }
                _ => bench.time_out(),
            }
        }
        for _ in 0..100 {
            bench.settle();
            if bench.outcome.is_some() {
                break;
            }
            bench.wish(Wish::Continue);
        }
        prop_assert_eq!(bench.outcome, Some(Outcome::Complete));
        let mut ids: Vec<_> = bench.taken.iter().map(|step| step.id).collect();
        ids.sort_unstable();
        prop_assert_eq!(ids, (0..12).collect::<Vec<_>>());
    }

    #[test]
    fn every_end_leaves_the_axes_at_rest(deeds in prop::collection::vec(0_u8..90, 1..300), at_once: bool) {
        let mut bench = Bench::new(plain(12), OnFault::Finish);
        for deed in deeds {
            match deed {
                0..30 => bench.device.hear(deed % 2 == 0),
                30..60 => bench.deliver(),
                60..80 => bench.device.work(),
                80 => bench.device.stop(Cause::Stalled(1)),
                81 => { bench.wish(Wish::Pause); }
                82 => { bench.wish(Wish::Continue); }
                _ => bench.time_out(),
            }
        }
        bench.wish(if at_once { Wish::Abort } else { Wish::Stop });
        bench.settle();
        prop_assert!(bench.outcome.is_some());
        prop_assert!(bench.device.queue.is_empty() && bench.device.downward.is_empty());
    }
}
