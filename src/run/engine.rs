//! The engine: pumps driver, machine and journal for one run, and hears what people ask.
//!
//! It decides nothing: the machine does. Waiting has an order: what people ask, time-outs, the
//! device, the journal.

mod deciding;

use std::collections::BTreeMap;
use std::time::Duration;

use firmware_protocol::{CommandId, Event, Instant, Reply, RequestType};
use tokio::sync::{mpsc, watch};

use super::clock::RunClock;
use super::course::Course;
use super::decider::{Decided, Decider, Next};
use super::desk::{Desk, Order};
use super::events::{Happening, Progress};
use super::hardware::{Hardware, ReachError, Reached};
use super::job::{Check, Ended, Job};
use super::machine::{Action, Connected, Input, Machine, Program, Setup, Taken, Wish};
use super::reading::{Taking, reading};
use super::rule::{Said, Watch};
use super::state::{Fault, Outcome, Position, State};
use crate::device::{DeviceEvent, LinkLost};
use crate::journal::{self, EventKind, JournalError, Record, Writer};
use crate::plan::{RESUME_IDS_FROM, WARM_UP_IDS_FROM};
use crate::rig::{DeviceTimes, Reading};

/// How often progress is told while the axes move or the detector integrates.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

enum Woken {
    Order(Option<Order>),
    TimedOut,
    Device(DeviceEvent),
    Rule(Said),
    Journal,
    Decided(Result<Decided, String>),
}

pub(super) struct Engine<'a> {
    hardware: &'a mut Hardware,
    orders: &'a mut mpsc::Receiver<Order>,
    desk: &'a mut Desk,
    machine: Machine,
    check: Option<Check>,
    checked: Vec<Reading>,
    journal: Writer,
    committed: watch::Receiver<journal::Progress>,
    lost: Option<JournalError>,
    unreached: Option<ReachError>,
    clock: RunClock,
    course: Course,
    // Frames sent again, for commands that needed it.
    retries: BTreeMap<CommandId, u32>,
    // What devices' clocks read, until the result that follows.
    clocks: Option<(CommandId, DeviceTimes)>,
    origin: tokio::time::Instant,
    boot_id: Option<u32>,
    outcome: Option<Outcome>,
    wants_link: bool,
    session: u32,
    session_began_s: f64,
    rule: Option<Watch>,
    decider: Option<Decider>,
    tell_at: tokio::time::Instant,
}

impl<'a> Engine<'a> {
    pub(super) fn new(
        hardware: &'a mut Hardware,
        orders: &'a mut mpsc::Receiver<Order>,
        desk: &'a mut Desk,
        job: Job,
        journal: Writer,
    ) -> Self {
        let course = Course::new(&hardware.rig, &job);
        let Job { steps, warm_up, mut check, session, session_began_s, rule, decider, .. } = job;
        let setup =
            Setup { rig: hardware.rig.clone(), home_first: job.home_first, on_fault: job.on_fault };
        let checks = check.as_mut().map(|check| std::mem::take(&mut check.steps));
        let checks = checks.unwrap_or_default();
        let program = Program { warm_up, checks, steps, is_open: decider.is_some() };
        Self {
            hardware,
            orders,
            desk,
            machine: Machine::new(setup, program),
            check,
            checked: Vec::new(),
            committed: journal.progress(),
            journal,
            lost: None,
            unreached: None,
            clock: RunClock::default(),
            course,
            retries: BTreeMap::new(),
            clocks: None,
            origin: tokio::time::Instant::now(),
            boot_id: None,
            outcome: None,
            wants_link: true,
            session,
            session_began_s,
            rule,
            decider,
            tell_at: tokio::time::Instant::now(),
        }
    }

    /// Runs to the end, whatever that is.
    pub(super) async fn run(mut self) -> Ended {
        self.desk.begin(self.course.progress());
        loop {
            if std::mem::take(&mut self.wants_link) {
                self.connect().await;
            }
            self.act().await;
            if let Some(outcome) = self.outcome.take() {
                return self.end(outcome).await;
            }
            if !self.wants_link {
                let woken = self.wait().await;
                self.wake(woken).await;
            }
        }
    }

    fn now(&self) -> Instant {
        Instant::ZERO + self.origin.elapsed()
    }

    async fn wait(&mut self) -> Woken {
        let until = self.machine.poll_timeout();
        let until = until.map(|at| self.origin + at.since(Instant::ZERO));
        let tell_at = self.machine.state().is_active().then_some(self.tell_at);
        let until = until.into_iter().chain(tell_at).min();
        let rule = self.rule.as_mut();
        let decider = self.decider.as_mut();
        let controller = self.hardware.controller.as_mut();
        tokio::select! {
            biased;
            order = self.orders.recv(), if !self.desk.is_closing => Woken::Order(order),
            () = tokio::time::sleep_until(until.unwrap_or(self.origin)), if until.is_some() => {
                Woken::TimedOut
            }
            event = async {
                match controller {
                    Some(controller) => controller.next_event().await,
                    None => std::future::pending().await,
                }
            } => Woken::Device(event),
            said = async {
                match rule {
                    Some(rule) => rule.said().await,
                    None => std::future::pending().await,
                }
            } => Woken::Rule(said),
            decided = async {
                match decider {
                    Some(decider) => decider.answer().await,
                    None => std::future::pending().await,
                }
            } => Woken::Decided(decided),
            Ok(()) = self.committed.changed() => Woken::Journal,
        }
    }

    async fn wake(&mut self, woken: Woken) {
        let now = self.now();
        match woken {
            Woken::Order(order) => self.obey(order),
            Woken::TimedOut => {
                self.machine.handle_timeout(now);
                if self.tell_at <= tokio::time::Instant::now() {
                    self.tell_progress();
                }
            }
            Woken::Rule(said) => self.heed(said),
            Woken::Device(event) => self.hear(event),
            Woken::Decided(decided) => self.decided(decided).await,
            Woken::Journal => {
                let failure = self.committed.borrow_and_update().failure.clone();
                if let Some(failure) = failure {
                    self.journal_failed(failure);
                }
            }
        }
    }

    /// Somebody asks something; nobody left to ask means that nobody wants the run.
    fn obey(&mut self, order: Option<Order>) {
        let now = self.now();
        match order {
            Some(Order::Wish(wish, reply)) => {
                let answer = self.machine.handle_request(now, wish);
                let _ = reply.send(Some(answer));
            }
            Some(Order::ShutDown) | None => {
                self.desk.is_closing = true;
                self.machine.handle_request(now, Wish::Abort);
            }
            Some(other) => other.refuse(),
        }
    }

    /// Opens a session, while people may still ask for the end of it all.
    async fn connect(&mut self) {
        let reached = {
            let reach = self.hardware.reach();
            tokio::pin!(reach);
            loop {
                let now = Instant::ZERO + self.origin.elapsed();
                tokio::select! {
                    biased;
                    order = self.orders.recv(), if !self.desk.is_closing => match order {
                        Some(Order::Wish(wish, reply)) => {
                            let answer = self.machine.handle_request(now, wish);
                            let _ = reply.send(Some(answer));
                        }
                        Some(Order::ShutDown) | None => {
                            self.desk.is_closing = true;
                            self.machine.handle_request(now, Wish::Abort);
                        }
                        Some(other) => other.refuse(),
                    },
                    reached = &mut reach => break reached,
                }
                if self.machine.state() == State::Done {
                    return;
                }
            }
        };
        match reached {
            Ok(reached) => self.connected(&reached),
            Err(error) => self.unreached(&error),
        }
    }

    fn connected(&mut self, reached: &Reached) {
        let Reached { identity, status, windows, devices } = reached;
        let now = self.now();
        self.unreached = None;
        match self.boot_id.replace(identity.boot_id) {
            Some(boot_id) if boot_id == identity.boot_id => {
                self.clock.micros(status.tick, now);
            }
            Some(_) => self.clock.restart(status.tick, now),
            None => {
                self.clock.restart(status.tick, now);
                self.record(Record::SessionBegan {
                    number: self.session,
                    boot_id: identity.boot_id,
                    started_s: self.session_began_s,
                });
                for device in devices {
                    self.note(EventKind::Device, device);
                }
            }
        }
        let connected = Connected {
            boot_id: identity.boot_id,
            queue_depth: identity.queue_depth,
            homed: status.homed,
            last_id: status.last_id,
            fault: status.fault,
            windows: *windows,
        };
        self.machine.handle(now, Input::Connected(connected));
    }

    fn unreached(&mut self, error: &ReachError) {
        if self.boot_id.is_none() {
            self.unreached = Some(error.clone());
        }
        let now = self.now();
        self.machine.handle(now, Input::Fault(Fault::LinkLost(error.to_string())));
    }

    fn hear(&mut self, event: DeviceEvent) {
        let input = match event {
            DeviceEvent::Event(event) => Input::Event(event),
            DeviceEvent::LinkLost(lost) => {
                if matches!(lost, LinkLost::HungUp { .. }) {
                    self.hardware.let_go();
                }
                Input::Fault(Fault::LinkLost(lost.to_string()))
            }
            DeviceEvent::Restarted { .. } => Input::Fault(Fault::Restarted),
            DeviceEvent::Clocks(id, times) => {
                self.clocks = Some((id, times));
                return;
            }
            DeviceEvent::Fault(fault) => Input::Fault(Fault::Named(fault)),
            DeviceEvent::Reply { request, reply, retries } => match reply {
                Reply::Accepted(id) => {
                    if retries > 0 {
                        self.retries.insert(id, retries.into());
                    }
                    Input::Accepted(id)
                }
                Reply::Rejected(_, why) if request == RequestType::ClearFault => {
                    Input::ClearRefused(why)
                }
                Reply::Rejected(id, _) if request == RequestType::FetchWindow => {
                    Input::WindowGone(id)
                }
                Reply::Rejected(id, why) => Input::Rejected(id, why),
                Reply::Fetched(window) => Input::Event(Event::Window(window)),
                Reply::Stopping => Input::Stopping,
                Reply::Cleared => Input::Cleared,
                Reply::Acknowledged(_)
                | Reply::Alive
                | Reply::Capabilities(_)
                | Reply::Identity(_)
                | Reply::Status(_) => return,
            },
        };
        let now = self.now();
        self.machine.handle(now, input);
    }

    /// Carries out what the machine decided, in order.
    async fn act(&mut self) {
        while let Some(action) = self.machine.poll_action() {
            match action {
                Action::Send(request) => {
                    if let Some(controller) = &self.hardware.controller {
                        controller.submit(request);
                    }
                }
                Action::Record(taken) => self.take(*taken),
                Action::Became(state) => self.became(state).await,
                Action::Position(position) => self.position(position),
                Action::Fault(fault) => {
                    self.note(EventKind::Fault, &fault.to_string());
                    self.desk.tell(Happening::Fault(fault));
                }
                Action::AskSource(source) => self.desk.tell(Happening::AskSource(source)),
                Action::Judge => self.judge(),
                Action::Decide => {
                    if let Some(decided) = self.decider.as_mut().and_then(Decider::ask) {
                        self.decided(decided).await;
                    }
                }
                Action::Reconnect => self.wants_link = true,
                Action::Finish(outcome) => self.outcome = Some(outcome),
            }
        }
    }

    async fn became(&mut self, state: State) {
        match state {
            State::Paused => self.note(EventKind::Pause, "at rest"),
            State::Faulted | State::Stopping | State::Homing => {}
            _ if matches!(self.desk.state(), State::Paused | State::Faulted) => {
                self.note(EventKind::Continue, state.name());
            }
            _ => {}
        }
        self.course.became(state, self.now_s());
        self.desk.tell(Happening::State(state));
        if !matches!(state, State::Moving | State::Settling | State::Dwelling) {
            self.tell_link();
            self.tell_progress();
        }
        // Whoever stands still can wait for the disk.
        if matches!(state, State::Paused | State::Faulted)
            && let Err(error) = self.journal.flush().await
        {
            self.journal_failed(error);
        }
    }

    fn position(&mut self, position: Position) {
        self.course.trust(position.is_trusted(), self.now_s());
        if position.is_trusted() {
            self.note(EventKind::Homed, &position.to_string());
        } else {
            self.note(EventKind::PositionTrust, &position.to_string());
        }
        self.desk.tell(Happening::Position(position));
    }

    /// Takes a reading over: the acknowledgement is the machine's next action.
    fn take(&mut self, taken: Taken) {
        let Taken { step, id, result } = taken;
        let now = self.now();
        let start_us = self.clock.micros(result.start_tick, now);
        let end_us = self.clock.micros(result.end_tick, now);
        let taking = Taking {
            session: self.session,
            session_began_s: self.session_began_s,
            start_us,
            end_us,
            device_times: self
                .clocks
                .take()
                .filter(|(of, _)| *of == id)
                .map(|(_, times)| times)
                .unwrap_or_default(),
            link_retries: self.retries.remove(&id).unwrap_or_default(),
        };
        self.retries.retain(|command, _| *command > id);
        let reading = reading(&self.hardware.rig, &step, &result, taking);
        self.record(Record::Reading(reading.clone()));
        let end_s = self.session_began_s + end_us as f64 * 1e-6;
        if step.id >= RESUME_IDS_FROM {
            self.checked.push(reading.clone());
        }
        self.course.take(&step, end_s);
        if let Some(decider) = self.decider.as_mut().filter(|_| step.id < WARM_UP_IDS_FROM) {
            decider.show(&reading);
        }
        let said = self.rule.as_mut().map_or(Said::Nothing, |rule| rule.show(&reading));
        let here = step.rests_at(&self.hardware.rig);
        let is_late = self.course.is_late(here, &self.machine.steps_ahead());
        self.desk.tell(Happening::Reading(Box::new(reading)));
        self.tell_progress();
        let is_met = matches!(said, Said::Enough(_));
        self.heed(said);
        if !is_met && is_late {
            let Progress { done, total, .. } = self.course.progress();
            self.conclude(format!("the rig's time is used up after {done} of {total} readings"));
        }
    }

    /// Run time, seconds.
    fn now_s(&self) -> f64 {
        self.session_began_s + self.clock.now(self.now()) as f64 * 1e-6
    }

    fn tell_progress(&mut self) {
        let progress = self.course.look(self.now_s());
        self.tell_at = tokio::time::Instant::now() + PROGRESS_EVERY;
        self.desk.tell(Happening::Progress(progress));
    }

    fn note(&mut self, kind: EventKind, text: &str) {
        let (session, time_s) = (self.session, self.course.progress().rig_s);
        self.record(Record::Event(journal::Event { session, time_s, kind, text: text.to_owned() }));
    }

    fn record(&mut self, record: Record) {
        if self.lost.is_some() {
            return;
        }
        if let Err(error) = self.journal.push(record) {
            self.journal_failed(error);
        }
    }

    /// What can't be kept is not worth measuring.
    fn journal_failed(&mut self, error: JournalError) {
        if self.lost.is_none() {
            let fault = Fault::Journal(error.to_string());
            self.lost = Some(error);
            let now = self.now();
            self.machine.handle(now, Input::Fault(fault));
        }
    }

    fn tell_link(&mut self) {
        if let Some(controller) = &self.hardware.controller {
            let statistics = controller.statistics();
            self.desk.tell(Happening::Link(statistics));
        }
    }

    async fn end(mut self, outcome: Outcome) -> Ended {
        let Progress { done, total, rig_s, .. } = self.course.look(self.now_s());
        if self.boot_id.is_some() {
            let (number, reason) = (self.session, outcome.reason());
            self.record(Record::SessionEnded { number, ended_s: rig_s, reason });
        }
        if self.lost.is_none() {
            self.lost = self.journal.flush().await.err();
        }
        self.desk.tell(Happening::Finished(outcome.clone()));
        let (journal, lost, unreached) = (self.journal, self.lost, self.unreached);
        Ended { outcome, done, total, rig_s, journal, lost, unreached }
    }
}
