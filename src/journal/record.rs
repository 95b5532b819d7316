//! What a journal holds, free of how it is stored.

use crate::plan::Step;
use crate::rig::Reading;

/// What is known when a run begins, and never changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// The program's version.
    pub program_version: String,
    /// The seed of everything random; 0 on hardware that draws nothing.
    pub seed: u64,
    /// Whether the rig is a simulated one.
    pub simulated: bool,
    /// The rig's name.
    pub rig_name: String,
    /// The plan's name.
    pub plan_name: String,
    /// A hash of the plan's file, lower-case hexadecimal.
    pub plan_hash: String,
    /// When the run began: UTC, RFC 3339, as the caller read it.
    pub started_utc: String,
    /// The effects that the scene called for, one line each; empty on hardware.
    pub effects: Vec<String>,
    /// What a person wanted of the effects, so that a resume compiles the same rig.
    pub effect_wishes: EffectWishes,
}

/// What a person wanted of a simulated rig's effects beyond what the plan implies.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct EffectWishes {
    /// How much all that is left out may change a reading; by the plan's noise if `None`.
    pub tolerance: Option<f64>,
    /// Effects that are in whatever they amount to.
    pub force: Vec<String>,
    /// Effects that are out whatever they amount to.
    pub without: Vec<String>,
    /// Whether they were weighed before any plan was known, as a daemon's rig is.
    #[serde(default)]
    pub ignores_plan: bool,
}

/// What an input file is to its run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum InputRole {
    /// plan.toml.
    Plan,
    /// rig.toml.
    Rig,
    /// scene.toml.
    Scene,
    /// A list of poses, a photometric file: whatever the three refer to.
    Attachment,
}

/// An input file, as it was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Input {
    /// What it is.
    pub role: InputRole,
    /// Its path as the file that names it has it, or its file name.
    pub name: String,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// A stretch of a run between two interruptions.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// 0, and one more after every resume.
    pub number: u32,
    /// The device's boot, as it identified itself.
    pub boot_id: u32,
    /// Run time at which it began, seconds.
    pub started_s: f64,
    /// Run time at which it ended, and why; `None` while it runs, and for ever if the process was
    /// killed or the power failed.
    pub ended: Option<(f64, String)>,
}

/// What kind of thing happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum EventKind {
    /// A pause ended.
    Continue,
    /// What one of the rig's devices calls itself, at the begin of a session.
    Device,
    /// The rig is unwell.
    Fault,
    /// The axes found their home marks.
    Homed,
    /// Anything else worth keeping.
    Note,
    /// A person or a rule halted the run.
    Pause,
    /// The position became trusted or lost its trust; the text gives the evidence.
    PositionTrust,
    /// Something was done again.
    Retry,
}

/// Something that happened during a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// In which session.
    pub session: u32,
    /// Run time, seconds.
    pub time_s: f64,
    /// What kind of thing.
    pub kind: EventKind,
    /// One sentence; longer than 4,096 bytes is cut off.
    pub text: String,
}

/// What a resume concluded from measuring the reference pose again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Verdict {
    /// |Δ| is at most 2 u(Δ).
    Agrees,
    /// It is not, and the run went on with its samples flagged.
    Flagged,
    /// It is not, and the run was not carried on.
    Refused,
}

/// A reference pose measured again by a resume. Values are in the detector's quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceCheck {
    /// The session that began with it.
    pub session: u32,
    /// The reading that it rests on, `0x8000_0000` or above.
    pub reading: u32,
    /// The value before the interruption.
    pub before: f64,
    /// The value after it.
    pub after: f64,
    /// The standard uncertainty of their difference, from independent and re-homing terms only.
    pub u_difference: f64,
    /// What followed.
    pub verdict: Verdict,
}

/// A decision of a run that decides on the way what it measures next. It is durable before any of
/// its steps is executed, and never made again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Round {
    /// Which decision: 0 was made after the steps that the run began with.
    pub number: u32,
    /// How many steps it added to the sequence; 0 ends the run.
    pub steps: u32,
    /// What it rests on, in whoever decides' own words; the journal doesn't look into it.
    pub account: String,
}

/// One line of the journal.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// Something happened.
    Event(Event),
    /// A reading was taken.
    Reading(Reading),
    /// A resume measured the reference pose again.
    ReferenceCheck(ReferenceCheck),
    /// It was decided what is measured next: these steps follow those that there are.
    Round {
        /// 0, and one more with every decision.
        number: u32,
        /// What the decision rests on.
        account: String,
        /// The steps; none at the end of the run.
        steps: Vec<Step>,
    },
    /// A session began.
    SessionBegan {
        /// 0, and one more after every resume.
        number: u32,
        /// The device's boot, as it identified itself.
        boot_id: u32,
        /// Run time, seconds.
        started_s: f64,
    },
    /// A session ended.
    SessionEnded {
        /// Which one.
        number: u32,
        /// Run time, seconds.
        ended_s: f64,
        /// Why: complete, stopped by the person, a fault.
        reason: String,
    },
}

/// Names in the file; `from_name` of anything else is a damaged file.
macro_rules! names {
    ($type:ty { $($variant:ident = $name:literal),+ $(,)? }) => {
        impl $type {
            /// The name in files.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }

            /// Its inverse.
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($name => Some(Self::$variant),)+ _ => None }
            }
        }
    };
}

names!(InputRole { Plan = "plan", Rig = "rig", Scene = "scene", Attachment = "attachment" });
names!(EventKind {
    Continue = "continue",
    Device = "device",
    Fault = "fault",
    Homed = "homed",
    Note = "note",
    Pause = "pause",
    PositionTrust = "position_trust",
    Retry = "retry",
});
names!(Verdict { Agrees = "agrees", Flagged = "flagged", Refused = "refused" });
