//! What the daemon tells those who watch: one notice for each thing that happens, numbered by the
//! queue's file so that a watcher can ask for what it missed.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What kind of thing happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A person ended a run for good.
    Aborted,
    /// A run waits for something that only a person can do; the text says what.
    Asked,
    /// Everything of a run is measured and evaluated.
    Complete,
    /// A run goes on after a pause, a fault or an interruption.
    Continued,
    /// The daemon began to own the rig.
    DaemonStarted,
    /// The daemon lets the rig go.
    DaemonStopping,
    /// A run's readings are taken, and are being evaluated.
    Evaluating,
    /// A run could not start, or ended with targets missing.
    Failed,
    /// The rig is unwell.
    Fault,
    /// The rig was driven by hand.
    Hand,
    /// A run ended before its end, and waits for an explicit continue.
    Interrupted,
    /// A run came to rest because somebody asked.
    Paused,
    /// The trust in the axes' position changed.
    Position,
    /// How far a run is.
    Progress,
    /// A run began.
    Started,
    /// A run joined the queue.
    Submitted,
}

impl Kind {
    /// The name in the API.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Aborted => "aborted",
            Self::Asked => "asked",
            Self::Complete => "complete",
            Self::Continued => "continued",
            Self::DaemonStarted => "daemon_started",
            Self::DaemonStopping => "daemon_stopping",
            Self::Evaluating => "evaluating",
            Self::Failed => "failed",
            Self::Fault => "fault",
            Self::Hand => "hand",
            Self::Interrupted => "interrupted",
            Self::Paused => "paused",
            Self::Position => "position",
            Self::Progress => "progress",
            Self::Started => "started",
            Self::Submitted => "submitted",
        }
    }
}

/// Something that happened. Its sequence number is the event's id.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Notice {
    /// What kind of thing.
    pub kind: Kind,
    /// When, RFC 3339.
    pub time_utc: String,
    /// To which run, if to one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<i64>,
    /// One sentence for people; may be empty.
    pub text: String,
    /// With `progress`: how far the run is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub progress: Option<Progress>,
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// Readings taken.
    pub done: u64,
    /// Readings to take.
    pub total: u64,
    /// Rig time still needed, seconds, as far as can be told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eta_s: Option<f64>,
}

impl From<crate::run::Progress> for Progress {
    fn from(progress: crate::run::Progress) -> Self {
        let (done, total) = (progress.done as u64, progress.total as u64);
        // At most, where nobody knows better.
        let rest_s = progress.rest_most_s.unwrap_or(progress.rest_s);
        Self { done, total, eta_s: (total > 0).then_some(rest_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_in_the_json() {
        for kind in [Kind::Aborted, Kind::DaemonStarted, Kind::Progress, Kind::Submitted] {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
        }
    }
}
