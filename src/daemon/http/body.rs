//! What goes over the API as JSON, and in: plain data with units last in names. Angles are
//! degrees and lengths millimetres, as in the files that people write.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::daemon::Progress;
use crate::journal::QueuedRun;
use crate::rig::{AxisPositions, Pose, Reading, ReadingKind, Rig, forward};

/// The body of every answer that is not a success.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ErrorBody {
    /// What is wrong with which thing.
    pub error: String,
    /// What would have been right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// What to do about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
}

/// How the rig and its runs are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Status {
    /// The rig's name.
    pub rig: String,
    /// Whether it is a simulated one.
    pub simulated: bool,
    /// What it does: idle, homing, moving, settling, dwelling, stopping, paused, faulted,
    /// preparing, evaluating, `by_hand`.
    pub state: String,
    /// Whether the axes' position is trusted.
    pub position_trusted: bool,
    /// The evidence for it, or against it.
    pub position: String,
    /// What stops the axes when this program falls silent, device by device.
    #[serde(default)]
    pub watchdogs: Vec<String>,
    /// What is wrong, if the rig stands still because of it.
    pub fault: Option<String>,
    /// What a person is asked to do before continuing.
    pub question: Option<String>,
    /// The run that has the rig.
    pub current_run: Option<CurrentRun>,
    /// Runs that wait for their turn.
    pub queue_length: u64,
    /// Runs that wait for an explicit continue, after which the queue goes on.
    pub interrupted_runs: Vec<i64>,
    /// Rig time that the current run still needs, seconds, as far as can be told.
    pub eta_s: Option<f64>,
    /// The number of the latest event.
    pub latest_event: i64,
    /// The program's version.
    pub version: String,
}

/// The run that has the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CurrentRun {
    /// Its number.
    pub id: i64,
    /// The plan's name.
    pub name: String,
    /// How far it is.
    pub progress: Progress,
}

/// A run of the queue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Run {
    /// Its number.
    pub id: i64,
    /// The plan's name.
    pub name: String,
    /// How it stands: queued, running, paused, interrupted, complete, failed, aborted.
    pub state: String,
    /// Why it stands so, for a person; may be empty.
    pub detail: String,
    /// When it was submitted, RFC 3339.
    pub submitted_utc: String,
    /// Its folder on the daemon's machine.
    pub folder: String,
}

impl From<QueuedRun> for Run {
    fn from(run: QueuedRun) -> Self {
        Self {
            id: run.id,
            name: run.name,
            state: run.state.name().to_owned(),
            detail: run.detail,
            submitted_utc: run.submitted_utc,
            folder: run.folder.display().to_string(),
        }
    }
}

/// All runs, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Runs {
    /// All runs, oldest first.
    pub runs: Vec<Run>,
}

/// A plan with all files that it refers to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BundleBody {
    /// The seed of everything random; the daemon's own is used instead.
    #[serde(default)]
    pub seed: u64,
    /// What the plan is called if it doesn't say.
    #[serde(default)]
    pub name: Option<String>,
    /// The plan, and what it names.
    pub files: Vec<BundledFileBody>,
}

/// A file, by what it is to the run. Either `text` or `bytes` is there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BundledFileBody {
    /// plan, rig, scene or attachment.
    pub role: String,
    /// Its name as the file that names it has it.
    pub name: String,
    /// Its contents, if they are UTF-8.
    #[serde(default)]
    pub text: Option<String>,
    /// Its contents otherwise.
    #[serde(default)]
    pub bytes: Option<Vec<u8>>,
}

/// What was taken into the queue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Submitted {
    /// The run's number.
    pub id: i64,
    /// The plan's name.
    pub name: String,
    /// Its state: queued.
    pub state: String,
    /// Where its results will be, on the daemon's machine.
    pub folder: String,
    /// Runs before it: waiting, or under way.
    pub ahead: u64,
    /// Poses to measure.
    pub targets: u64,
    /// Readings to take, dark and reference ones included.
    pub readings: u64,
    /// The rig time that they are predicted to take, seconds.
    pub predicted_s: f64,
    /// Whether the data will be a simulation's.
    pub simulated: bool,
    /// What a person should know about how it will be run.
    pub notes: Vec<String>,
}

/// What came of asking something of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Asked {
    /// The run's number.
    pub id: i64,
    /// What happened, in one sentence.
    pub answer: String,
}

/// Nothing to say: `{}`, or no body at all.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Nothing {}

/// A pose to go to; what is left out stays as it is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JogBody {
    /// Direction to the detector from the sample's normal, in [0, 90].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub theta_deg: Option<f64>,
    /// Direction's azimuth, from +x towards +y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phi_deg: Option<f64>,
    /// Place on the sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x_mm: Option<f64>,
    /// Place on the sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y_mm: Option<f64>,
}

/// How to take one reading.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ReadBody {
    /// How long to integrate; 100 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dwell_ms: Option<f64>,
    /// The gain range by its name in rig.toml; the rig's first if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<String>,
}

/// Where the rig stands, and looks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Stands {
    /// The ray that it looks along.
    pub pose: PoseBody,
    /// Its axes; the arm's angle is signed.
    pub axes: AxesBody,
}

impl Stands {
    /// At these positions.
    pub fn at(positions: AxisPositions) -> Self {
        let [theta, phi, x, y] = positions.0;
        Self {
            pose: PoseBody::from(forward(positions)),
            axes: AxesBody {
                theta_deg: theta.to_degrees(),
                phi_deg: phi.to_degrees(),
                x_mm: x * 1e3,
                y_mm: y * 1e3,
            },
        }
    }
}

/// A ray from the sample to the detector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PoseBody {
    /// Where it leaves the sample.
    pub x_mm: f64,
    /// Where it leaves the sample.
    pub y_mm: f64,
    /// From the sample's normal, in [0, 90].
    pub theta_deg: f64,
    /// From +x towards +y, in (-180, 180].
    pub phi_deg: f64,
}

impl From<Pose> for PoseBody {
    fn from(pose: Pose) -> Self {
        Self {
            x_mm: pose.x_m * 1e3,
            y_mm: pose.y_m * 1e3,
            theta_deg: pose.theta_rad.to_degrees(),
            phi_deg: pose.phi_rad.to_degrees(),
        }
    }
}

/// Positions of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AxesBody {
    /// The arm, signed: it may cross the zenith.
    pub theta_deg: f64,
    /// The turntable.
    pub phi_deg: f64,
    /// The stage.
    pub x_mm: f64,
    /// The stage.
    pub y_mm: f64,
}

/// A raw reading: nothing is subtracted, converted or left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReadingBody {
    /// Its place in the plan's sequence.
    pub id: u32,
    /// Why it was taken: dark, reference, `warm_up`, target (by hand too).
    pub kind: String,
    /// The target's index in the plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<u32>,
    /// Which of the plan's repeats, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeat: Option<u32>,
    /// Seconds since the run began.
    pub time_s: f64,
    /// The ray that was measured, by readback.
    pub pose: PoseBody,
    /// The gain range.
    pub gain: String,
    /// ADC readings taken.
    pub n: u32,
    /// Their mean, counts.
    pub mean_counts: f64,
    /// Their variance (n - 1), counts squared.
    pub variance_counts2: f64,
    /// The mean as a current, dark current included.
    pub current_a: f64,
    /// How many ADC readings stood at an end of the range.
    pub saturated: u32,
    /// The setpoint was not reached when the integration began.
    pub unsettled: bool,
}

impl ReadingBody {
    /// What `rig` says of a reading.
    pub fn of(rig: &Rig, reading: &Reading) -> Self {
        let (kind, target, repeat) = match reading.kind {
            ReadingKind::Dark => ("dark", None, None),
            ReadingKind::Reference => ("reference", None, None),
            ReadingKind::WarmUp => ("warm_up", None, None),
            ReadingKind::Target { index, repeat } => ("target", Some(index), Some(repeat)),
        };
        let gain = rig.detector.gains.get(usize::from(reading.gain));
        let (_, pose) = rig.measured(reading);
        Self {
            id: reading.id,
            kind: kind.to_owned(),
            target,
            repeat,
            time_s: reading.time_s,
            pose: PoseBody::from(pose),
            gain: gain.map(|gain| gain.name.clone()).unwrap_or_default(),
            n: reading.n,
            mean_counts: reading.mean,
            variance_counts2: reading.variance,
            current_a: gain.map_or(0.0, |_| reading.mean * rig.detector.lsb_a(reading.gain)),
            saturated: reading.saturated,
            unsettled: reading.unsettled,
        }
    }
}

/// A page of a run's readings, in the order in which they were taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Readings {
    /// At most as many as were asked for.
    pub readings: Vec<ReadingBody>,
    /// What `after` is to be for the next page.
    pub next_after: u64,
    /// Whether there were more when this was answered.
    pub more: bool,
}
