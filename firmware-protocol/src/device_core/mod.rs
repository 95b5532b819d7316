//! The device's behaviour, from a request to the board and back to an event: what a
//! microcontroller and the simulated board run alike.
//!
//! It does not know frames, bytes, sequence numbers or who listens, and it reads no clock.
//!
//! Everything happens at a moment that was known before: an axis arrives, a settling ends, an
//! ADC reading ends, the lease runs out. Whenever the core is called, it first catches up all
//! moments that have passed, in order, each with its own exact microsecond. So it does not
//! matter how coarsely its caller wakes: the next command starts when the one before it ended,
//! not when somebody noticed.

mod admission;
mod axes;
mod dwelling;
mod homing;
mod path;
mod queue;
mod results;
mod statistics;
mod sweeping;
mod windows;

use core::time::Duration;

use crate::{
    AxisCounts, Board, BoardFault, Capabilities, Cause, CommandId, Done, Event, Identity, Instant,
    PROTOCOL, Rejection, Reply, Request, Status,
};
use axes::Axes;
use dwelling::Dwelling;
use homing::Homing;
use queue::{Command, Queue};
use results::Results;
use sweeping::Sweeping;
use windows::Windows;

pub use homing::SEARCH_PERIOD;

/// How often a board that must be called on time gets a moving axis's setpoint.
pub const SETPOINT_PERIOD: Duration = Duration::from_millis(1);

/// The host's silence after which a device with work to do stops by itself.
pub const LEASE: Duration = Duration::from_millis(500);

/// Commands that can wait behind the running one.
pub const QUEUE_DEPTH: usize = 8;

/// Results that a device keeps until they are acknowledged. Commands that run or wait have
/// their place in it reserved.
pub const RESULTS_MAX: usize = 16;

/// Windows of sweeps that a device keeps until their sweep is acknowledged: 60 kB. A sweep starts
/// when all of its windows have a place, so that none is ever lost.
pub const WINDOWS_MAX: usize = 512;

/// Faults that a board can report at one moment; more wait for the next.
const FAULTS_AT_ONCE: usize = 8;

/// The device-side machine. Time never goes back: a call with an earlier `now` counts as one
/// with the latest `now` seen.
pub struct DeviceCore<B> {
    board: B,
    axes: Axes,
    queue: Queue,
    results: Results,
    windows: Windows,
    running: Option<Running>,
    fault: Option<Cause>,
    /// The session of the last `Identify`.
    session: Option<u32>,
    /// When the host was last heard.
    heard: Instant,
    /// Everything up to here has happened.
    clock: Instant,
}

struct Running {
    id: CommandId,
    work: Work,
}

#[allow(clippy::large_enum_variant)] // there is one of it, and no heap
enum Work {
    Moving,
    Homing(Homing),
    Dwelling(Dwelling),
    Sweeping(Sweeping),
}

impl<B: Board> DeviceCore<B> {
    /// A device that has just booted: at rest, unhomed, nothing to do.
    pub fn new(board: B) -> Self {
        Self {
            axes: Axes::new(board.axes()),
            board,
            queue: Queue::default(),
            results: Results::default(),
            windows: Windows::default(),
            running: None,
            fault: None,
            session: None,
            heard: Instant::ZERO,
            clock: Instant::ZERO,
        }
    }

    /// Who this device is.
    pub fn identity(&self) -> Identity {
        let (adc_bits, adc_rate_hz) = self.board.adc();
        Identity {
            protocol: PROTOCOL,
            boot_id: self.board.boot_id(),
            queue_depth: narrow(QUEUE_DEPTH),
            lease_ms: u32::try_from(LEASE.as_millis()).unwrap_or(u32::MAX),
            gains: self.board.gains(),
            adc_bits,
            adc_rate_hz,
            axes: self.axes.identities().clone(),
        }
    }

    /// What this device can do beside what every device can.
    pub fn capabilities() -> Capabilities {
        Capabilities { windows: u16::try_from(WINDOWS_MAX).unwrap_or(u16::MAX) }
    }

    /// How the device is.
    pub fn status(&mut self, now: Instant) -> Status {
        self.catch_up(now);
        self.axes.follow(self.clock, &mut self.board);
        Status {
            boot_id: self.board.boot_id(),
            homed: self.axes.homed(),
            moving: !self.axes.is_at_rest(),
            fault: self.fault,
            running: self.running.as_ref().map(|running| running.id),
            queued: narrow(self.queue.len()),
            unacknowledged: narrow(self.results.len()),
            last_id: self.queue.last_id(),
            readback: self.axes.readback(self.clock, &mut self.board),
            tick: self.clock.tick(),
        }
    }

    /// Answers a request, which also is a sign of life. The same request twice is two requests:
    /// only the link knows repetitions, and it holds their answers. But for `Identify`: the
    /// session that is on already is not begun anew.
    pub fn handle_request(&mut self, now: Instant, request: &Request) -> Reply {
        self.link_heard(now);
        match request {
            Request::Identify(session) => {
                if self.session.replace(*session) != Some(*session) {
                    self.forget();
                }
                Reply::Identity(self.identity())
            }
            Request::Home(home) => self.offer(Command::Home(home.clone())),
            Request::MoveTo(move_to) => self.offer(Command::MoveTo(move_to.clone())),
            Request::Dwell(dwell) => self.offer(Command::Dwell(dwell.clone())),
            Request::Sweep(sweep) => self.offer(Command::Sweep(sweep.clone())),
            Request::ReadStatus => Reply::Status(self.status(now)),
            Request::Stop => {
                self.stop(Cause::Stopped);
                Reply::Stopping
            }
            Request::ClearFault => {
                self.fault = None;
                Reply::Cleared
            }
            Request::KeepAlive => Reply::Alive,
            Request::Acknowledge(id) => {
                if self.results.acknowledge(*id) {
                    self.windows.release(*id);
                    // A sweep may have waited for their places.
                    self.start_next();
                }
                Reply::Acknowledged(*id)
            }
            Request::Capabilities => Reply::Capabilities(Self::capabilities()),
            Request::FetchWindow(id, index) => match self.windows.get(*id, *index) {
                Some(window) => Reply::Fetched(window.clone()),
                None => Reply::Rejected(*id, Rejection::NoSuchWindow),
            },
        }
    }

    /// A valid frame came from the host, whatever it said: the lease begins anew.
    pub fn link_heard(&mut self, now: Instant) {
        self.catch_up(now);
        self.heard = self.clock;
    }

    /// Lets happen what is due by now. Needed at [`DeviceCore::poll_timeout`], harmless at any
    /// time; a board whose interrupt noticed a fault calls it at once.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.catch_up(now);
    }

    /// What happened, in order; each event once. Call it after every call that hands in a time,
    /// until it answers `None`. Results can be had again from
    /// [`DeviceCore::pending_results`]. Windows come before the result of their sweep.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.windows.poll().map(Event::Window).or_else(|| self.results.poll())
    }

    /// Results that [`DeviceCore::poll_event`] gave and the host has not acknowledged, oldest
    /// first: what a link says again when it has waited long enough.
    pub fn pending_results(&self) -> impl Iterator<Item = &Event> {
        self.results.pending()
    }

    /// When [`DeviceCore::handle_timeout`] is to be called next, if no request comes before;
    /// `None` while nothing will happen by itself.
    ///
    /// It is the earliest of: an axis comes to rest, a searching axis is looked after
    /// ([`SEARCH_PERIOD`]), a settling or an ADC reading ends, the lease runs out, the board
    /// asks for it ([`Board::wake_at`]), a moving axis wants its setpoint
    /// ([`SETPOINT_PERIOD`]). A board that [answers late](Board::answers_late) gets no setpoints
    /// in between, of a dwell the end of the settling and the end, and of a sweep the ends of its
    /// windows. It may change after
    /// every call that hands in a time, and when the board is changed through
    /// [`DeviceCore::board_mut`].
    pub fn poll_timeout(&self) -> Option<Instant> {
        let is_live = !self.board.answers_late();
        let setpoint = (is_live && !self.axes.is_at_rest()).then(|| self.clock + SETPOINT_PERIOD);
        let wake = match &self.running {
            Some(Running { work: Work::Dwelling(dwelling), .. }) if !is_live => {
                Some(dwelling.wake())
            }
            Some(Running { work: Work::Sweeping(sweeping), .. }) if !is_live => {
                sweeping.wake(&self.axes, self.clock)
            }
            _ => self.work_due(),
        };
        [self.axes.next_end(), wake, self.lease_end(), self.board_due(), setpoint]
            .into_iter()
            .flatten()
            .min()
    }

    /// The hardware underneath.
    pub const fn board(&self) -> &B {
        &self.board
    }

    /// The hardware underneath, to be changed from outside: by an interrupt, or by a test.
    pub const fn board_mut(&mut self) -> &mut B {
        &mut self.board
    }

    /// Lets everything happen that is due by `now`, in order, and reads the board.
    fn catch_up(&mut self, now: Instant) {
        let now = now.max(self.clock);
        while let Some(at) = self.next_due().filter(|at| *at <= now) {
            self.clock = at.max(self.clock);
            self.happen();
        }
        self.clock = now;
        if !self.board.answers_late() {
            self.axes.follow(now, &mut self.board);
        }
        self.ask_board();
    }

    /// The next moment at which something happens.
    fn next_due(&self) -> Option<Instant> {
        [self.axes.next_end(), self.work_due(), self.lease_end(), self.board_due()]
            .into_iter()
            .flatten()
            .min()
    }

    /// When the running command goes on by itself: at once, if it only waited for the axes.
    fn work_due(&self) -> Option<Instant> {
        match &self.running.as_ref()?.work {
            Work::Moving => self.axes.is_at_rest().then_some(self.clock),
            Work::Homing(homing) => homing.due(),
            Work::Dwelling(dwelling) => Some(dwelling.due()),
            Work::Sweeping(sweeping) => sweeping.due(&self.axes, self.clock),
        }
    }

    /// When the lease runs out: a device with nothing to stop has none.
    fn lease_end(&self) -> Option<Instant> {
        let is_armed = self.running.is_some() || !self.queue.is_empty();
        is_armed.then(|| self.heard + LEASE)
    }

    /// When the board wants to be asked. What has passed was asked for.
    fn board_due(&self) -> Option<Instant> {
        self.board.wake_at().filter(|at| *at > self.clock)
    }

    /// What is due at this moment. A command that ends just when the lease runs out has ended.
    fn happen(&mut self) {
        self.axes.follow(self.clock, &mut self.board);
        self.ask_board();
        self.work();
        self.start_next();
        if self.lease_end().is_some_and(|end| end <= self.clock) {
            self.stop(Cause::LeaseExpired);
        }
    }

    /// Carries the running command on.
    fn work(&mut self) {
        let now = self.clock;
        let Some(Running { id, work }) = &mut self.running else { return };
        let id = *id;
        let ended = match work {
            Work::Moving => Ok(self.axes.is_at_rest().then_some(None)),
            Work::Homing(homing) => homing
                .progress(now, &mut self.axes, &mut self.board)
                .map(|is_home| is_home.then_some(None)),
            Work::Dwelling(dwelling) if dwelling.due() <= now => dwelling
                .progress(&self.axes, &mut self.board)
                .map(|result| result.map(|result| Some(Event::Sampled(result))))
                .map_err(Cause::from),
            Work::Dwelling(_) => Ok(None),
            Work::Sweeping(sweeping) => sweeping
                .progress(now, &mut self.axes, &mut self.board, &mut self.windows)
                .map(|is_over| is_over.then_some(None))
                .map_err(Cause::from),
        };
        match ended {
            Ok(None) => {}
            Ok(Some(event)) => {
                self.running = None;
                let event = event.unwrap_or_else(|| Event::Done(self.done(id)));
                self.results.keep(id, event);
            }
            Err(cause) => self.stop(cause),
        }
    }

    fn done(&mut self, id: CommandId) -> Done {
        let readback: AxisCounts = self.axes.readback(self.clock, &mut self.board);
        Done { id, readback, tick: self.clock.tick() }
    }

    /// Starts the next command as soon as the axes rest.
    fn start_next(&mut self) {
        if self.running.is_some() || !self.axes.is_at_rest() {
            return;
        }
        if let Some(Command::Sweep(sweep)) = self.queue.front()
            && !self.windows.has_room(sweep.windows)
        {
            return;
        }
        let Some(command) = self.queue.pop() else { return };
        let now = self.clock;
        let id = command.id();
        self.results.started(id, now.tick());
        let work = match command {
            Command::Home(home) => {
                Work::Homing(Homing::begin(home.axes, now, &mut self.axes, &mut self.board))
            }
            Command::MoveTo(move_to) => {
                let targets = move_to.targets.0.iter().copied().map(f64::from);
                self.axes.go_to(now, targets, &mut self.board);
                Work::Moving
            }
            Command::Dwell(dwell) => Work::Dwelling(Dwelling::begin(dwell, now, &mut self.board)),
            Command::Sweep(sweep) => match self.motion_of(&sweep) {
                Ok(motion) => {
                    let (axes, board) = (&mut self.axes, &mut self.board);
                    Work::Sweeping(Sweeping::begin(sweep, motion, now, axes, board))
                }
                // It was checked when it was accepted.
                Err(_) => Work::Moving,
            },
        };
        self.running = Some(Running { id, work });
    }

    /// Asks the board for faults, at this moment.
    fn ask_board(&mut self) {
        for _ in 0..FAULTS_AT_ONCE {
            let Some(fault) = self.board.fault(self.clock) else { return };
            if let (
                BoardFault::LimitSwitch(channel),
                Some(Running { work: Work::Homing(homing), .. }),
            ) = (fault, &mut self.running)
                && homing.turn(channel, self.clock, &mut self.axes)
            {
                continue;
            }
            self.stop(fault.into());
        }
    }

    /// Comes to rest and stays there until the fault is cleared: every axis brakes, every
    /// command fails. The first cause stays the reason. An axis that ran into a switch or lost
    /// its steps has no home any more; after a controlled stop it has.
    fn stop(&mut self, cause: Cause) {
        self.axes.brake_all(self.clock);
        if let Cause::LimitSwitch(channel) | Cause::Stalled(channel) = cause {
            self.axes.unhome(channel);
        }
        self.fault.get_or_insert(cause);
        let tick = self.clock.tick();
        if let Some(Running { id, .. }) = self.running.take() {
            self.results.keep(id, Event::Failed(id, cause, tick));
        }
        self.windows.hush();
        while let Some(command) = self.queue.pop() {
            self.results.keep(command.id(), Event::Failed(command.id(), cause, tick));
        }
    }

    /// A new session knows nothing of what an earlier one asked for. A fault stays latched.
    fn forget(&mut self) {
        self.axes.brake_all(self.clock);
        self.running = None;
        self.queue.clear();
        self.results.clear();
        self.windows.clear();
    }
}

impl From<BoardFault> for Cause {
    fn from(fault: BoardFault) -> Self {
        match fault {
            BoardFault::LimitSwitch(channel) => Self::LimitSwitch(channel),
            BoardFault::Stalled(channel) => Self::Stalled(channel),
            BoardFault::Detector => Self::Detector,
        }
    }
}

/// A length of a short list as it goes over the wire.
fn narrow(length: usize) -> u8 {
    u8::try_from(length).unwrap_or(u8::MAX)
}
