//! What the servos are told to do, and how it is known that they did.

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{Cause, Instant, Shutter};

use super::bus::Heard;
use super::packet::{Instruction, ServoId};
use super::servo::Servo;
use super::table::{BUS_WATCHDOG, GOAL_POSITION, PROFILE_ACCELERATION, TORQUE_ENABLE};
use super::{Doing, Dynamixel, PATIENCE_AT_REST, WATCHDOG, WATCHDOG_UNITS, stalled};
use crate::device::axes::{AxesCommand, AxesEvent};
use crate::device::driver::Trouble;
use crate::rig::SERVO_LOOK_AGAIN;

/// A write of which nobody says that it arrived is repeated so often.
const TELLS: u8 = 3;
/// How much longer than its profile a move may take: by half, and by this.
const LATE: Duration = Duration::from_secs(2);
/// How long braking may take.
const BRAKING_MAX: Duration = Duration::from_secs(5);
/// How long a servo takes to start anew, and how often it is asked whether it has.
const REBOOT: Duration = Duration::from_millis(500);
const REBOOT_LOOKS: u8 = 10;

/// A command and how far it has come.
#[derive(Debug)]
pub(super) struct Work {
    command: Command,
    stage: Stage,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Command {
    Clear,
    Home,
    Locate,
    /// A goal for each servo that shall move, the shutter's among them; then what it says.
    MoveTo(Goals, Option<Shutter>),
    Stop,
}

/// A goal for each servo; none for those that stay where they are.
type Goals = Vec<Option<i32>>;

#[derive(Debug)]
enum Stage {
    /// All were asked how they are.
    Looking,
    /// These still have to be given torque; the first was told.
    Engaging(VecDeque<ServoId>),
    Moving(Moving),
    /// They were told to brake; until when, and whether all stood when last seen.
    Braking(Instant, bool),
    /// These still have to be restarted; the first was told.
    Restarting(VecDeque<ServoId>),
    /// They were told to restart, and are waited for, so many times more.
    Waking(u8),
}

#[derive(Debug, Clone, Copy)]
struct Moving {
    /// When the profiles are over.
    due: Instant,
    /// When it is too late.
    late: Instant,
    /// How often the goal was told.
    told: u8,
}

impl Dynamixel {
    pub(super) fn begin_work(&mut self, _now: Instant, command: AxesCommand) {
        let command = match command {
            AxesCommand::Home => Command::Home,
            AxesCommand::MoveTo(steps) => match self.goals(&steps) {
                Ok(goals) => Command::MoveTo(goals, None),
                Err(trouble) => return self.say(AxesEvent::Trouble(trouble)),
            },
            AxesCommand::Locate => Command::Locate,
            AxesCommand::Clear => Command::Clear,
            AxesCommand::PutShutter(shutter) => match self.shutter_goals(shutter) {
                Ok(goals) => Command::MoveTo(goals, Some(shutter)),
                Err(trouble) => return self.say(AxesEvent::Trouble(trouble)),
            },
        };
        self.doing = Doing::Work(Work { command, stage: Stage::Looking });
        self.look(PATIENCE_AT_REST);
    }

    /// Goals for the axes alone.
    fn goals(&self, steps: &[i32]) -> Result<Goals, Trouble> {
        let axes = self.axes().len();
        if steps.len() != axes {
            let what = format!("{} goals for {axes} servos", steps.len());
            return Err(self.fault(what, Cause::Stopped));
        }
        let goals = steps.iter().copied().map(Some);
        Ok(goals.chain(self.shutter.iter().map(|_| None)).collect())
    }

    /// A goal for the shutter alone.
    fn shutter_goals(&self, to: Shutter) -> Result<Goals, Trouble> {
        let shutter = self.shutter.as_ref();
        let shutter = shutter.ok_or_else(|| self.fault("no shutter".to_owned(), Cause::Stopped))?;
        let goal = if to == Shutter::Open { shutter.open } else { shutter.closed };
        Ok(self.axes().iter().map(|_| None).chain([Some(goal)]).collect())
    }

    /// Brakes at once, by what was last seen; what is being asked is heard out.
    pub(super) fn begin_stop(&mut self, now: Instant) {
        let stage = match &self.doing {
            Doing::Work(Work { stage: Stage::Moving(_), .. }) => {
                self.brake(&[]);
                Stage::Braking(now + BRAKING_MAX, false)
            }
            _ => Stage::Looking,
        };
        let is_asking = matches!(stage, Stage::Braking(..)) && self.wake.take().is_none();
        self.doing = Doing::Work(Work { command: Command::Stop, stage });
        if !is_asking {
            self.look(WATCHDOG);
        }
    }

    /// Tells every servo that may move to come to rest as its profile says; but for those of which
    /// it is not known where they are: by an old position they would be sent back.
    fn brake(&mut self, unseen: &[ServoId]) {
        let moved = match &self.doing {
            Doing::Work(Work { command: Command::MoveTo(goals, _), .. }) => goals.clone(),
            _ => Vec::new(),
        };
        let goal = |(n, servo): (usize, &Servo)| {
            let is_sent = moved.get(n).is_some_and(Option::is_some);
            let is_seen = !unseen.contains(&servo.id());
            (is_seen && (is_sent || !servo.stands())).then(|| servo.braked())
        };
        let goals: Goals = self.servos.iter().enumerate().map(goal).collect();
        self.tell_goals(&goals);
    }

    fn tell_goals(&mut self, goals: &[Option<i32>]) {
        let servos = self.servos.iter().zip(goals);
        let data: Vec<_> = servos
            .filter_map(|(servo, goal)| Some((servo.id(), goal.as_ref()?.to_le_bytes().to_vec())))
            .collect();
        if data.is_empty() {
            return;
        }
        let (address, length) = (GOAL_POSITION.address, GOAL_POSITION.length);
        self.bus.tell(&Instruction::SyncWrite { address, length, data });
    }

    /// Profiles and goals, as they stand in the table.
    fn tell_motion(&mut self, goals: &[Option<i32>]) {
        let servos = self.servos.iter().zip(goals);
        let data = servos.filter_map(|(servo, goal)| Some((servo.id(), servo.motion((*goal)?))));
        let address = PROFILE_ACCELERATION.address;
        let length = GOAL_POSITION.address + GOAL_POSITION.length - address;
        let instruction = Instruction::SyncWrite { address, length, data: data.collect() };
        self.bus.tell(&instruction);
    }

    fn tell_watchdog(&mut self, units: u8) {
        let data = self.servos.iter().map(|servo| (servo.id(), vec![units])).collect();
        let (address, length) = (BUS_WATCHDOG.address, BUS_WATCHDOG.length);
        self.bus.tell(&Instruction::SyncWrite { address, length, data });
    }

    /// The time has come to look again, or to wait no longer.
    pub(super) fn wake_up(&mut self, _now: Instant) {
        self.look(WATCHDOG);
    }

    /// An answer came to what the command's stage asked.
    pub(super) fn worked(&mut self, now: Instant, work: Work, heard: Heard) {
        let Work { command, stage } = work;
        match stage {
            Stage::Engaging(waiting) => return self.engaged(now, command, waiting, &heard),
            Stage::Restarting(waiting) => return self.restarted(now, waiting),
            Stage::Waking(looks) => return self.woken(now, command, looks, heard),
            _ => {}
        }
        let missing = heard.missing.clone();
        if let Err(silence) = self.take_states(heard) {
            let is_stop = command == Command::Stop;
            // Whoever answers comes to rest; the others' watchdog stops them.
            if is_stop || matches!(stage, Stage::Moving(_)) {
                self.doing = Doing::Work(Work { command, stage });
                self.brake(&missing);
            }
            return self.end(if is_stop {
                AxesEvent::Stopped(None)
            } else {
                AxesEvent::Trouble(Trouble::Silent(silence))
            });
        }
        match stage {
            Stage::Moving(moving) => self.moving(now, command, moving),
            Stage::Braking(until, stood) => self.braking(now, until, stood),
            _ => self.looked(now, command),
        }
    }

    /// All said how they are: whether the command can be.
    fn looked(&mut self, now: Instant, command: Command) {
        if command == Command::Clear {
            return self.restart(now);
        }
        if command == Command::Stop {
            self.brake(&[]);
            self.doing =
                Doing::Work(Work { command, stage: Stage::Braking(now + BRAKING_MAX, false) });
            self.wake = Some(now + SERVO_LOOK_AGAIN);
            return;
        }
        if let Some(fault) = self.raised() {
            return self.end(AxesEvent::Trouble(Trouble::Fault(fault)));
        }
        let is_limp = |servo: &&Servo| !servo.has_torque();
        if self.is_engaged && self.servos.iter().any(|servo| is_limp(&servo)) {
            self.is_engaged = false;
            return self.end(AxesEvent::Trouble(Trouble::Restarted));
        }
        if command == Command::Locate {
            let located = self.located(now);
            return self.end(AxesEvent::Located(located));
        }
        let limp: VecDeque<ServoId> = self.servos.iter().filter(is_limp).map(Servo::id).collect();
        if limp.is_empty() {
            return self.set_out(now, command);
        }
        // Their goal is where they stand, so that torque moves nothing.
        self.tell_watchdog(0);
        let here: Goals = self.servos.iter().map(|servo| Some(servo.position())).collect();
        self.tell_goals(&here);
        self.engage(now, command, limp);
    }

    fn engage(&mut self, now: Instant, command: Command, limp: VecDeque<ServoId>) {
        let Some(id) = limp.front().copied() else { return self.set_out(now, command) };
        let instruction = Instruction::Write { id, address: TORQUE_ENABLE.address, data: vec![1] };
        self.bus.ask(id, &instruction, 0, PATIENCE_AT_REST);
        self.doing = Doing::Work(Work { command, stage: Stage::Engaging(limp) });
    }

    fn engaged(
        &mut self,
        now: Instant,
        command: Command,
        mut limp: VecDeque<ServoId>,
        heard: &Heard,
    ) {
        let Some(id) = limp.pop_front() else { return };
        match heard.answers.first().map(|status| status.result) {
            Some(Ok(())) => self.engage(now, command, limp),
            Some(Err(error)) => {
                let trouble = self.fault(format!("{id}: no torque: {error}"), Cause::Stopped);
                self.end(AxesEvent::Trouble(trouble));
            }
            None => {
                let silence = self.silence(&heard.missing);
                self.end(AxesEvent::Trouble(Trouble::Silent(silence)));
            }
        }
    }

    fn set_out(&mut self, now: Instant, command: Command) {
        self.is_engaged = true;
        let Command::MoveTo(goals, _) = &command else { return self.adopt(now) };
        let servos = self.servos.iter().zip(goals);
        let profiles = servos.filter_map(|(servo, goal)| Some(servo.duration((*goal)?)));
        let duration = profiles.max().unwrap_or_default();
        let moving = Moving { due: now + duration, late: now + duration * 3 / 2 + LATE, told: 0 };
        self.tell_move(now, command, moving);
    }

    fn tell_move(&mut self, now: Instant, command: Command, mut moving: Moving) {
        if let Command::MoveTo(goals, _) = &command {
            // Zero first: it leaves a strike, without which goals are not taken.
            self.tell_watchdog(0);
            self.tell_motion(goals);
            self.tell_watchdog(WATCHDOG_UNITS);
        }
        moving.told += 1;
        self.doing = Doing::Work(Work { command, stage: Stage::Moving(moving) });
        self.wake = Some(now + SERVO_LOOK_AGAIN);
    }

    /// The servos' encoders are absolute: a home is where they say that they are, if that can be.
    fn adopt(&mut self, now: Instant) {
        let mut servos = self.axes().iter().enumerate();
        let outside = servos.find(|(_, servo)| servo.is_outside(self.tolerance));
        if let Some((n, servo)) = outside {
            let (low, high) = servo.axis.travel;
            let what = format!(
                "{}: stands at {} steps, outside its travel from {low} to {high}; turn it back \
                 by hand with the power off",
                servo.words(),
                servo.position()
            );
            let cause = Cause::HomingMissed(u8::try_from(n).unwrap_or(u8::MAX));
            let trouble = self.fault(what, cause);
            return self.end(AxesEvent::Trouble(trouble));
        }
        let located = self.located(now);
        self.end(AxesEvent::Done(located));
    }

    fn moving(&mut self, now: Instant, command: Command, moving: Moving) {
        let Command::MoveTo(goals, shutter) = &command else { return };
        let told: Vec<(usize, i32)> =
            goals.iter().enumerate().filter_map(|(n, goal)| Some((n, (*goal)?))).collect();
        if let Some(trouble) = self.trouble_in_motion() {
            return self.give_up(command, moving, trouble);
        }
        let deaf = told.iter().find(|(n, goal)| {
            let servo = self.servos.get(*n);
            servo.is_some_and(|servo| !servo.has_taken(*goal, WATCHDOG_UNITS))
        });
        if let Some((n, _)) = deaf {
            if moving.told < TELLS {
                return self.tell_move(now, command, moving);
            }
            let words = self.servos.get(*n).map(Servo::words).unwrap_or_default();
            let trouble =
                self.fault(format!("{words}: it does not take its goal and profile"), stalled(*n));
            return self.give_up(command, moving, trouble);
        }
        let servos = || told.iter().filter_map(|(n, goal)| Some((*n, self.servos.get(*n)?, *goal)));
        let off = |servo: &Servo, goal: i32| servo.position().abs_diff(goal);
        let is_there =
            servos().all(|(_, servo, goal)| servo.stands() && off(servo, goal) <= self.tolerance);
        if is_there && now >= moving.due {
            let shutter = *shutter;
            self.tell_watchdog(0);
            let located = self.located(now);
            return self.end(match shutter {
                Some(shutter) => AxesEvent::ShutterIs(shutter),
                None => AxesEvent::Done(located),
            });
        }
        if now < moving.late {
            self.doing = Doing::Work(Work { command, stage: Stage::Moving(moving) });
            self.wake = Some(now + SERVO_LOOK_AGAIN);
            return;
        }
        let farthest = servos().max_by_key(|(_, servo, goal)| off(servo, *goal));
        let Some((n, servo, goal)) = farthest else { return };
        let what = format!(
            "{}: stands {} steps from its goal {goal} at {}; at most {} are allowed",
            servo.words(),
            off(servo, goal),
            servo.position(),
            self.tolerance
        );
        let trouble = self.fault(what, stalled(n));
        self.give_up(command, moving, trouble);
    }

    /// What keeps a move from going on: an error, torque that is gone, or a strike.
    fn trouble_in_motion(&mut self) -> Option<Trouble> {
        if let Some(fault) = self.raised() {
            return Some(Trouble::Fault(fault));
        }
        if self.servos.iter().any(|servo| !servo.has_torque()) {
            self.is_engaged = false;
            return Some(Trouble::Restarted);
        }
        let servo = self.servos.iter().find(|servo| servo.watchdog_struck())?;
        let what = format!(
            "{}: its bus watchdog has struck: nothing was heard for {} ms",
            servo.words(),
            WATCHDOG.as_millis()
        );
        Some(self.fault(what, Cause::LeaseExpired))
    }

    /// The move is over: those that still go come to rest.
    fn give_up(&mut self, command: Command, moving: Moving, trouble: Trouble) {
        self.doing = Doing::Work(Work { command, stage: Stage::Moving(moving) });
        self.brake(&[]);
        self.end(AxesEvent::Trouble(trouble));
    }

    fn braking(&mut self, now: Instant, until: Instant, stood: bool) {
        let stands = self.servos.iter().all(Servo::stands);
        if stands && stood {
            self.tell_watchdog(0);
            let located = self.located(now);
            return self.end(AxesEvent::Stopped(Some(located)));
        }
        if now >= until {
            return self.end(AxesEvent::Stopped(None));
        }
        let stage = Stage::Braking(until, stands);
        self.doing = Doing::Work(Work { command: Command::Stop, stage });
        self.wake = Some(now + SERVO_LOOK_AGAIN);
    }

    /// A hardware error is left by a restart alone.
    fn restart(&mut self, now: Instant) {
        let raised = self.servos.iter().filter(|servo| servo.hardware_error().is_raised());
        let raised: VecDeque<ServoId> = raised.map(Servo::id).collect();
        if raised.is_empty() {
            return self.end(AxesEvent::Cleared);
        }
        self.is_engaged = false;
        self.tell_restart(now, raised);
    }

    fn tell_restart(&mut self, now: Instant, waiting: VecDeque<ServoId>) {
        let stage = if let Some(id) = waiting.front().copied() {
            self.bus.ask_once(id, &Instruction::Reboot(id), REBOOT);
            Stage::Restarting(waiting)
        } else {
            self.wake = Some(now + REBOOT);
            Stage::Waking(REBOOT_LOOKS)
        };
        self.doing = Doing::Work(Work { command: Command::Clear, stage });
    }

    /// Whether its answer was lost or the words, a look tells: they are not said twice, because a
    /// servo that is starting would start again.
    fn restarted(&mut self, now: Instant, mut waiting: VecDeque<ServoId>) {
        waiting.pop_front();
        self.tell_restart(now, waiting);
    }

    fn woken(&mut self, now: Instant, command: Command, looks: u8, heard: Heard) {
        match self.take_states(heard) {
            Ok(()) => self.end(match self.raised() {
                Some(fault) => AxesEvent::Trouble(Trouble::Fault(fault)),
                None => AxesEvent::Cleared,
            }),
            Err(_) if looks > 0 => {
                self.doing = Doing::Work(Work { command, stage: Stage::Waking(looks - 1) });
                self.wake = Some(now + SERVO_LOOK_AGAIN);
            }
            Err(silence) => self.end(AxesEvent::Trouble(Trouble::Silent(silence))),
        }
    }
}
