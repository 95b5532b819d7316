//! The driver of Dynamixel servos of the X series: Protocol 2.0 over a half-duplex bus, one
//! servo an axis.
//!
//! *Accepted* means that the servos' registers were read and nothing speaks against the command.
//! *Done* means that every servo has the goal, the time of its profile is over, it says that it
//! does not move, and its encoder reads within a tolerance of the goal. While axes move the
//! servos' bus watchdog is armed: they stop by themselves when nothing is said for
//! [`WATCHDOG`]. At rest it is not, and the servos hold with torque, also when the host has gone.
//!
//! It does not know poses or radiance, nor ports: positions are steps of a servo's encoder.

mod bus;
mod motion;
mod packet;
mod roll_call;
mod servo;
mod survey;
mod table;
#[cfg(test)]
mod tests;
mod units;

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{Cause, Instant};

use super::axes::{Axes, AxesCommand, AxesEvent, Located};
use super::driver::{Driver, NamedFault, Promises, Trouble};
use bus::{Bus, Heard};
use motion::Work;
pub use packet::ServoId;
pub(super) use roll_call::RollCall;
pub use roll_call::ServoFound;
use servo::{Servo, Ticks};
pub use servo::{ServoAxis, ShutterServo};
use survey::Survey;
use table::{Block, STATE};

/// Units of the watchdog's register.
const WATCHDOG_UNIT: Duration = Duration::from_millis(20);
/// What is written to it while axes move.
const WATCHDOG_UNITS: u8 = 25;
/// After this silence moving servos stop by themselves.
const WATCHDOG: Duration = Duration::from_millis(500);
/// How long answers are waited for while nothing moves. While axes move it is [`WATCHDOG`]: the
/// host bears with servos as long as they bear with it.
const PATIENCE_AT_REST: Duration = Duration::from_secs(2);

const _: () = assert!(WATCHDOG.as_millis() == WATCHDOG_UNIT.as_millis() * WATCHDOG_UNITS as u128);

/// The servos of a bus.
#[derive(Debug)]
pub struct Dynamixel {
    name: String,
    /// Those of the axes, and after them the shutter's, if one has it.
    servos: Vec<Servo>,
    shutter: Option<ShutterServo>,
    tolerance: u32,
    bus: Bus,
    doing: Doing,
    /// When to go on by itself.
    wake: Option<Instant>,
    /// Until when a bus on which nobody says anything may still be booting.
    boots_until: Instant,
    /// Whether the torque is on by our doing, or was found on: then it must stay on.
    is_engaged: bool,
    ticks: Ticks,
    events: VecDeque<AxesEvent>,
}

/// What the driver is at.
#[derive(Debug)]
enum Doing {
    Nothing,
    Survey(Survey),
    Work(Work),
}

impl Dynamixel {
    /// Servos behind a port of this name and speed, in the order of their axes, and one that
    /// holds a shutter. `tolerance`: how far from its goal one may come to rest, steps.
    pub fn new(
        port: &str,
        baud: u32,
        servos: Vec<ServoAxis>,
        shutter: Option<ShutterServo>,
        tolerance: u32,
    ) -> Self {
        let servos = servos.into_iter().chain(shutter.as_ref().map(ShutterServo::as_axis));
        Self {
            name: format!("dynamixel at {port}"),
            servos: servos.map(Servo::new).collect(),
            shutter,
            tolerance,
            bus: Bus::new(baud),
            doing: Doing::Nothing,
            wake: None,
            boots_until: Instant::ZERO,
            is_engaged: false,
            ticks: Ticks::default(),
            events: VecDeque::new(),
        }
    }

    /// The servos that move axes.
    fn axes(&self) -> &[Servo] {
        let shutter = usize::from(self.shutter.is_some());
        self.servos.get(..self.servos.len() - shutter).unwrap_or_default()
    }

    /// Asks all servos for their state; whoever says nothing for so long is silent.
    fn look(&mut self, patience: Duration) {
        let ids: Vec<ServoId> = self.servos.iter().map(Servo::id).collect();
        let is_fast = self.servos.iter().all(Servo::is_fast);
        self.bus.read_all(&ids, (STATE.address, STATE.length), is_fast, patience);
    }

    /// Takes the servos' states; the words for those who did not answer.
    fn take_states(&mut self, heard: Heard) -> Result<(), String> {
        for status in heard.answers {
            let servo = self.servos.iter_mut().find(|servo| servo.id() == status.id);
            if let Some(servo) = servo.filter(|_| status.result.is_ok()) {
                let block = Block { address: STATE.address, bytes: status.data };
                servo.take_state(block);
            }
        }
        match heard.missing[..] {
            [] => Ok(()),
            _ => Err(self.silence(&heard.missing)),
        }
    }

    fn silence(&self, missing: &[ServoId]) -> String {
        let silent = self.servos.iter().filter(|servo| missing.contains(&servo.id()));
        let silent: Vec<String> = silent.map(Servo::words).collect();
        let beside = if missing.len() < self.servos.len() {
            "the others do: check its cable and its power"
        } else {
            "nobody on the bus does: check the cable and the power"
        };
        format!("{}: no answer from {}; {beside}", self.name, silent.join(", "))
    }

    fn located(&mut self, now: Instant) -> Located {
        let steps = self.axes().iter().map(Servo::position).collect();
        let tick = self.servos.first().map(Servo::tick_ms);
        Located { steps, device_time_s: tick.map(|tick| self.ticks.read(now, tick)) }
    }

    /// The first servo that has raised a hardware error, as a fault.
    fn raised(&self) -> Option<NamedFault> {
        let mut servos = self.servos.iter().enumerate();
        let (n, servo) = servos.find(|(_, servo)| servo.hardware_error().is_raised())?;
        let error = servo.hardware_error();
        Some(NamedFault {
            device: self.name.clone(),
            name: format!("{}: {error}; its torque is off", servo.words()),
            cause: stalled(n),
            // It is left by a restart, after which turns are counted from zero.
            loses_position: error.is_of_encoder() || !servo.is_absolute(),
        })
    }

    fn fault(&self, name: String, cause: Cause) -> Trouble {
        let device = self.name.clone();
        Trouble::Fault(NamedFault { device, name, cause, loses_position: false })
    }

    fn say(&mut self, event: AxesEvent) {
        self.events.push_back(event);
    }

    /// Ends what is being done with an event.
    fn end(&mut self, event: AxesEvent) {
        self.doing = Doing::Nothing;
        self.wake = None;
        self.say(event);
    }

    /// Lets whoever asked hear the answers.
    fn go_on(&mut self, now: Instant) {
        while let Some(heard) = self.bus.poll_heard() {
            match std::mem::replace(&mut self.doing, Doing::Nothing) {
                Doing::Nothing => {}
                Doing::Survey(survey) => self.surveyed(now, survey, heard),
                Doing::Work(work) => self.worked(now, work, heard),
            }
        }
    }
}

/// The n-th servo did not do what it should.
fn stalled(n: usize) -> Cause {
    Cause::Stalled(u8::try_from(n).unwrap_or(u8::MAX))
}

impl Driver for Dynamixel {
    fn open(&mut self, now: Instant) {
        self.bus.reset();
        self.events.clear();
        self.is_engaged = false;
        self.ticks = Ticks::default();
        self.servos.iter_mut().for_each(Servo::forget);
        self.begin_survey(now);
    }

    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.bus.handle_bytes(now, bytes);
        self.go_on(now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.bus.handle_timeout(now);
        self.go_on(now);
        if self.wake.is_some_and(|wake| wake <= now) {
            self.wake = None;
            match &self.doing {
                Doing::Nothing => {}
                Doing::Survey(_) => self.ping_next(now),
                Doing::Work(_) => self.wake_up(now),
            }
        }
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<Vec<u8>> {
        self.bus.poll_transmit(now)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        [self.bus.poll_timeout(), self.wake].into_iter().flatten().min()
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn promises(&self) -> Promises {
        Promises {
            accepted: "every servo was read, has torque and no hardware error",
            done: "every servo has the goal, does not move, and its encoder reads within the \
                   tolerance of it",
            watchdog: Some(WATCHDOG),
        }
    }
}

impl Axes for Dynamixel {
    fn begin(&mut self, now: Instant, command: AxesCommand) {
        self.begin_work(now, command);
    }

    fn stop(&mut self, now: Instant) {
        self.begin_stop(now);
    }

    fn poll_event(&mut self) -> Option<AxesEvent> {
        self.events.pop_front()
    }
}
