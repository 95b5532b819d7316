//! The states of a run, which may follow which, and what is known of the axes' position.
//!
//! Plain data: nothing here knows a link, a runtime or a file.

use std::fmt;

use firmware_protocol::{Cause, Rejection};

use crate::device::NamedFault;

/// What the rig does for a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// Nothing was asked of the device yet.
    Idle,
    /// The axes look for their home marks.
    Homing,
    /// The axes travel to the next pose.
    Moving,
    /// At the pose, waiting for vibration to die away.
    Settling,
    /// The detector integrates.
    Dwelling,
    /// Braking, and waiting for the end of what was queued.
    Stopping,
    /// At rest until somebody says continue.
    Paused,
    /// At rest because something is wrong, until somebody says continue.
    Faulted,
    /// The run is over.
    Done,
}

/// Which state may follow which. What is not here is a bug in the machine, and panics.
pub const LEGAL: [(State, &[State]); 9] = {
    use State::{Done, Dwelling, Faulted, Homing, Idle, Moving, Paused, Settling, Stopping};
    [
        (Idle, &[Homing, Moving, Settling, Dwelling, Paused, Faulted, Done]),
        (Homing, &[Moving, Settling, Dwelling, Stopping, Paused, Faulted, Done]),
        (Moving, &[Settling, Dwelling, Stopping, Paused, Faulted, Done]),
        (Settling, &[Moving, Dwelling, Stopping, Paused, Faulted, Done]),
        (Dwelling, &[Moving, Settling, Stopping, Paused, Faulted, Done]),
        (Stopping, &[Homing, Moving, Settling, Dwelling, Paused, Faulted, Done]),
        (Paused, &[Homing, Moving, Settling, Dwelling, Faulted, Done]),
        (Faulted, &[Homing, Moving, Settling, Dwelling, Paused, Done]),
        (Done, &[]),
    ]
};

impl State {
    /// Every state, in the order of [`LEGAL`].
    pub const ALL: [Self; 9] = [
        Self::Idle,
        Self::Homing,
        Self::Moving,
        Self::Settling,
        Self::Dwelling,
        Self::Stopping,
        Self::Paused,
        Self::Faulted,
        Self::Done,
    ];

    /// Whether `next` may follow.
    pub fn may_become(self, next: Self) -> bool {
        LEGAL.iter().any(|(from, to)| *from == self && to.contains(&next))
    }

    /// Whether commands run on the device, or are about to.
    pub const fn is_active(self) -> bool {
        matches!(self, Self::Homing | Self::Moving | Self::Settling | Self::Dwelling)
    }

    /// The name in events, status and logs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Homing => "homing",
            Self::Moving => "moving",
            Self::Settling => "settling",
            Self::Dwelling => "dwelling",
            Self::Stopping => "stopping",
            Self::Paused => "paused",
            Self::Faulted => "faulted",
            Self::Done => "done",
        }
    }
}

/// Whether the counts that the device reports say where the axes are, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// All axes found their home marks in this boot, and nothing happened since that could have
    /// lost counts.
    Trusted {
        /// The boot in which they did.
        boot_id: u32,
    },
    /// Counts may not mean what they say: home before measuring.
    Untrusted(Doubt),
}

/// Why the position is not trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doubt {
    /// Not homed, or not yet in this run.
    NotHomed,
    /// The device booted since.
    Restarted {
        /// The boot in which the axes were homed.
        was: u32,
        /// The boot it is in.
        is: u32,
    },
    /// Nobody knows what happened since the link was lost.
    LinkLost,
    /// Something that can lose counts: a stall, a limit switch, a missed or broken-off homing.
    Upset(Cause),
}

impl Position {
    /// Whether measuring may go on without homing.
    pub const fn is_trusted(self) -> bool {
        matches!(self, Self::Trusted { .. })
    }
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Trusted { boot_id } => write!(f, "trusted: homed in boot {boot_id:08x}"),
            Self::Untrusted(Doubt::NotHomed) => f.write_str("untrusted: not homed"),
            Self::Untrusted(Doubt::Restarted { was, is }) => write!(
                f,
                "untrusted: homed in boot {was:08x}, but the device is now in boot {is:08x}"
            ),
            Self::Untrusted(Doubt::LinkLost) => f.write_str("untrusted: the link was lost"),
            Self::Untrusted(Doubt::Upset(cause)) => {
                write!(f, "untrusted: {}", Fault::Device(*cause))
            }
        }
    }
}

/// Why a run stands still without having been asked to.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// The device stopped by itself.
    Device(Cause),
    /// One of the rig's devices stopped by itself, and has a name for why.
    Named(NamedFault),
    /// The device refused a command.
    Refused(Rejection),
    /// The link was lost: what the driver said.
    LinkLost(String),
    /// The device booted in mid-run.
    Restarted,
    /// The reference did not become stable in time.
    NotWarm {
        /// How long it was waited for, seconds.
        waited_s: f64,
        /// By how much it still changed over the window, relative; `None` if it could not be told.
        change_relative: Option<f64>,
    },
    /// After a resume the reference pose reads otherwise than before: the numbers.
    ReferenceMoved(String),
    /// Nobody can say what is measured next: why.
    Undecided(String),
    /// Readings can't be kept: what the journal said.
    Journal(String),
}

impl Fault {
    /// What the fault does to the position, if anything.
    pub(super) const fn doubt(&self) -> Option<Doubt> {
        match self {
            Self::Device(
                cause @ (Cause::HomingMissed(_) | Cause::LimitSwitch(_) | Cause::Stalled(_)),
            ) => Some(Doubt::Upset(*cause)),
            Self::Named(NamedFault { cause, loses_position: true, .. }) => {
                Some(Doubt::Upset(*cause))
            }
            Self::Refused(Rejection::Unhomed(_)) => Some(Doubt::NotHomed),
            Self::LinkLost(_) | Self::Restarted => Some(Doubt::LinkLost),
            _ => None,
        }
    }

    /// Whether there is nobody at the other end to talk to.
    pub const fn is_link(&self) -> bool {
        matches!(self, Self::LinkLost(_) | Self::Restarted)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(cause) => describe_cause(*cause, f),
            Self::Named(fault) => fault.fmt(f),
            Self::Refused(rejection) => describe_rejection(*rejection, f),
            Self::LinkLost(why) => write!(f, "link lost: {why}"),
            Self::Restarted => f.write_str("the device restarted: power, or its reset line"),
            Self::NotWarm { waited_s, change_relative: Some(change) } => write!(
                f,
                "the reference still changed by {:.3} % over the window after {waited_s:.0} s of \
                 warming up",
                change * 100.0
            ),
            Self::NotWarm { waited_s, change_relative: None } => {
                write!(f, "the reference gave no stable signal in {waited_s:.0} s of warming up")
            }
            Self::ReferenceMoved(numbers) => f.write_str(numbers),
            Self::Undecided(why) => write!(f, "what is measured next can't be decided: {why}"),
            Self::Journal(why) => write!(f, "the journal takes no more readings: {why}"),
        }
    }
}

fn describe_cause(cause: Cause, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match cause {
        Cause::Detector => f.write_str("the detector's converter does not answer"),
        Cause::HomingMissed(channel) => {
            write!(f, "channel {channel}: no home mark found within the travel")
        }
        Cause::LeaseExpired => {
            f.write_str("the device heard nothing from the host for too long, and stopped")
        }
        Cause::LimitSwitch(channel) => write!(f, "channel {channel}: limit switch open"),
        Cause::Stalled(channel) => write!(f, "channel {channel}: does not follow its setpoint"),
        Cause::Stopped => f.write_str("stopped"),
    }
}

fn describe_rejection(rejection: Rejection, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match rejection {
        Rejection::IdReused => {
            f.write_str("the device refused a command number: does another host drive it?")
        }
        Rejection::Faulted(cause) => {
            f.write_str("the device refused: ")?;
            describe_cause(cause, f)
        }
        Rejection::OutsideLimits(channel, target) => {
            write!(f, "channel {channel}: the device refused {target} counts as outside its limits")
        }
        Rejection::QueueFull => f.write_str("the device's queue stayed full"),
        Rejection::Senseless => f.write_str("the device could make no sense of a command"),
        Rejection::Unhomed(channel) => {
            write!(f, "channel {channel}: the device refused to move before homing")
        }
        Rejection::Unsupported => f.write_str("the device can't do what was asked"),
        Rejection::TooFast(channel) => {
            write!(f, "channel {channel}: the device refused a sweep as faster than it can move")
        }
        Rejection::TooManyWindows(most) => {
            write!(f, "the device keeps {most} windows, and was asked for a sweep with more")
        }
        Rejection::NoSuchWindow => f.write_str("the device has forgotten a window"),
    }
}

/// The name of [`Outcome::Reached`], which a resume looks for in the journal.
const REACHED: &str = "reached";

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Every step has its reading.
    Complete,
    /// A rule of the plan was met, this one; it ended the run before its last target.
    Reached(String),
    /// Somebody asked to stop at a safe point, and it did.
    Stopped,
    /// Somebody asked to stop at once, and it did.
    Aborted,
    /// It could not go on.
    Faulted(Fault),
}

impl Outcome {
    /// The name in events, status and the journal.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Reached(_) => REACHED,
            Self::Stopped => "stopped",
            Self::Aborted => "aborted",
            Self::Faulted(_) => "faulted",
        }
    }

    /// Whether the run ended as its plan wants it to.
    pub const fn is_as_planned(&self) -> bool {
        matches!(self, Self::Complete | Self::Reached(_))
    }

    /// Why a session ended, for the journal.
    pub fn reason(&self) -> String {
        match self {
            Self::Reached(rule) => format!("{REACHED}: {rule}"),
            Self::Faulted(fault) => format!("{}: {fault}", self.name()),
            other => other.name().to_owned(),
        }
    }

    /// The rule by which a session ended that has this [`Outcome::reason`].
    pub fn rule_in(reason: &str) -> Option<&str> {
        reason.strip_prefix(REACHED)?.strip_prefix(": ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_each_state_once_and_names_them_apart() {
        for (n, state) in State::ALL.into_iter().enumerate() {
            assert_eq!(LEGAL[n].0, state);
            assert!(!state.may_become(state));
            assert_eq!(State::ALL.iter().filter(|s| s.name() == state.name()).count(), 1);
        }
    }

    #[test]
    fn done_is_final_and_every_state_can_end() {
        for state in State::ALL {
            assert!(!State::Done.may_become(state));
            assert_eq!(state.may_become(State::Done), state != State::Done);
        }
    }

    #[test]
    fn a_rule_that_ended_a_run_is_found_again_in_the_journal() {
        let rule = "exitance to 0.5 % after 320 of 1000 targets";
        assert_eq!(Outcome::rule_in(&Outcome::Reached(rule.into()).reason()), Some(rule));
        for other in [Outcome::Complete, Outcome::Faulted(Fault::Restarted), Outcome::Stopped] {
            assert_eq!(Outcome::rule_in(&other.reason()), None);
        }
    }

    #[test]
    fn what_can_lose_counts_makes_the_position_doubtful() {
        assert!(Fault::Device(Cause::Stalled(1)).doubt().is_some());
        assert!(Fault::Device(Cause::LeaseExpired).doubt().is_none());
        assert!(Fault::LinkLost("gone".into()).doubt().is_some());
    }
}
