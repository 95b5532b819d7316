//! What host and device say to each other, as one readable table.
//!
//! | type | request | answered by | then, later |
//! |---|---|---|---|
//! | 0x01 | `Identify` | `Identity` | |
//! | 0x02 | `Home` | `Accepted` or `Rejected` | `Started`, `Done` or `Failed` |
//! | 0x03 | `MoveTo` | `Accepted` or `Rejected` | `Started`, `Done` or `Failed` |
//! | 0x04 | `Dwell` | `Accepted` or `Rejected` | `Started`, `Sampled` or `Failed` |
//! | 0x05 | `Sweep` | `Accepted` or `Rejected` | `Started`, `Window`s, `Done` or `Failed` |
//! | 0x06 | `ReadStatus` | `Status` | |
//! | 0x07 | `Stop` | `Stopping` | `Failed(Stopped)` for each command that it ends |
//! | 0x08 | `ClearFault` | `Cleared` or `Rejected` | |
//! | 0x09 | `KeepAlive` | `Alive` | |
//! | 0x0a | `Acknowledge` | `Acknowledged` | |
//! | 0x0b | `Capabilities` | `Capabilities` | |
//! | 0x0c | `FetchWindow` | `Fetched` or `Rejected` | |
//!
//! Accepted means queued, not done. `Done`, `Sampled` and `Failed` stay on the device, and are
//! sent again, until the host acknowledges their command. A `Window` is said once and stays as
//! long as its command's result: the host fetches those that were lost on the way. Commands run
//! one at a time, in the order in which they were accepted.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::Tick;

/// The most axes that a device has.
pub const AXES_MAX: usize = 6;

/// The host's number for a command. Numbers rise within a device's boot, and a device executes
/// each at most once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct CommandId(pub u32);

/// One position an axis, in counts from its home mark, in channel order.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisCounts(pub Vec<i32, AXES_MAX>);

/// A set of axes: bit n is channel n.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisMask(pub u8);

/// Whether light reaches the detector while it dwells. Closed is how a dark reading is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shutter {
    /// The sample is seen.
    Open,
    /// The sample is not seen.
    Closed,
}

/// What a host asks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Who are you? Begins a session with this number, drawn by the host: sequence numbers
    /// start anew, and the device stops and forgets what an earlier session left.
    Identify(u32),
    /// Find the home marks of some axes.
    Home(Home),
    /// Go to absolute positions, all axes together.
    MoveTo(MoveTo),
    /// Integrate the detector at rest.
    Dwell(Dwell),
    /// Integrate in windows while moving.
    Sweep(Sweep),
    /// Where are you, and how are you?
    ReadStatus,
    /// Come to rest now, and forget what is queued. Exempt from sequence numbers.
    Stop,
    /// Leave the fault or the stop: commands are accepted again.
    ClearFault,
    /// Nothing but a sign of life.
    KeepAlive,
    /// The result of this command has arrived, and its windows have: they can be forgotten.
    Acknowledge(CommandId),
    /// What can you do beside what every device can? Since version 1.1.
    Capabilities,
    /// Say this window of this sweep again: counted from 0. Since version 1.1.
    FetchWindow(CommandId, u16),
}

/// Finds the home marks of the axes in the mask.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Home {
    /// The command's number.
    pub id: CommandId,
    /// Which axes.
    pub axes: AxisMask,
}

/// A time-synchronised move: all axes start together and arrive together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MoveTo {
    /// The command's number.
    pub id: CommandId,
    /// Absolute targets of all axes.
    pub targets: AxisCounts,
}

/// One integration of the detector.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dwell {
    /// The command's number.
    pub id: CommandId,
    /// The host's name for the reading. The device only hands it back, and to its board: a
    /// dwell that is repeated after a restart has another command number, but the same name.
    pub reading: u32,
    /// The gain range, below [`Identity::gains`].
    pub gain: u8,
    /// Whether the shutter is open.
    pub shutter: Shutter,
    /// Waiting at rest before the integration begins, microseconds.
    pub settle_us: u32,
    /// The integration, microseconds.
    pub duration_us: u32,
}

/// Integrates in windows that follow each other without a gap, while the axes move at constant
/// speed. [`crate::SweepMotion`] says how.
///
/// The axes go to where they set out from as with a [`MoveTo`], wait there, come to speed
/// together, keep it, and brake together behind the last window.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sweep {
    /// The command's number.
    pub id: CommandId,
    /// The host's name for the first window's reading; the others' follow it one by one.
    pub reading: u32,
    /// The gain range, below [`Identity::gains`].
    pub gain: u8,
    /// Waiting at rest before the axes set out, microseconds.
    pub settle_us: u32,
    /// At constant speed before the first window, microseconds: what the acceleration has
    /// excited dies away.
    pub lead_us: u32,
    /// The length of a window in ADC readings.
    pub readings: u32,
    /// How many windows.
    pub windows: u16,
    /// Where all axes are when the first window begins.
    pub from: AxisCounts,
    /// How far all axes go in each window.
    pub step: AxisCounts,
}

/// What a device answers to a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reply {
    /// To `Identify`.
    Identity(Identity),
    /// The command is queued.
    Accepted(CommandId),
    /// The command will not be executed.
    Rejected(CommandId, Rejection),
    /// To `ReadStatus`.
    Status(Status),
    /// To `Stop`: the axes are braking.
    Stopping,
    /// To `ClearFault`.
    Cleared,
    /// To `KeepAlive`.
    Alive,
    /// To `Acknowledge`; also for a result that was not there any more.
    Acknowledged(CommandId),
    /// To `Capabilities`.
    Capabilities(Capabilities),
    /// To `FetchWindow`.
    Fetched(Window),
}

/// What a device says unasked. Every one but `Started` and `Window` is repeated until it is
/// acknowledged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// The command began.
    Started(CommandId, Tick),
    /// A move or homing came to rest at its target.
    Done(Done),
    /// A dwell has its reading.
    Sampled(DwellResult),
    /// The command ended without doing what it should.
    Failed(CommandId, Cause, Tick),
    /// A window of a sweep has its reading. Since version 1.1.
    Window(Window),
}

/// Who a device is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// The protocol's major and minor version that the device speaks.
    pub protocol: (u8, u8),
    /// Drawn anew at every boot: a change means that the device restarted and is unhomed.
    pub boot_id: u32,
    /// Commands that can wait behind the running one.
    pub queue_depth: u8,
    /// Silence after which the device stops by itself, milliseconds.
    pub lease_ms: u32,
    /// Gain ranges that a dwell can name: 0 to `gains` - 1.
    pub gains: u8,
    /// ADC resolution, bits. Readings are signed: full scale is 2^(bits - 1).
    pub adc_bits: u8,
    /// ADC readings a second.
    pub adc_rate_hz: u32,
    /// One entry a channel.
    pub axes: Vec<AxisIdentity, AXES_MAX>,
}

/// What a device can do beside what every device can.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capabilities {
    /// How many windows of sweeps it keeps, and so the most that one sweep can have; 0: it can't
    /// sweep.
    pub windows: u16,
}

/// An axis as the device knows it, in counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisIdentity {
    /// Lowest position that it accepts.
    pub low: i32,
    /// Highest position that it accepts.
    pub high: i32,
    /// Highest speed, counts a second.
    pub speed: u32,
    /// Acceleration, counts a second squared.
    pub acceleration: u32,
}

/// How a device is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// As in [`Identity::boot_id`].
    pub boot_id: u32,
    /// Axes whose home mark was found in this boot.
    pub homed: AxisMask,
    /// Whether any axis moves.
    pub moving: bool,
    /// The latched fault, if any: commands are refused until `ClearFault`.
    pub fault: Option<Cause>,
    /// The command being executed.
    pub running: Option<CommandId>,
    /// Commands waiting behind it.
    pub queued: u8,
    /// Results that wait for their acknowledgement.
    pub unacknowledged: u8,
    /// The last command number accepted in this boot: the next must be greater.
    pub last_id: Option<CommandId>,
    /// Encoder positions now.
    pub readback: AxisCounts,
    /// The device's clock.
    pub tick: Tick,
}

/// The end of a move or homing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Done {
    /// Which command.
    pub id: CommandId,
    /// Encoder positions at the end.
    pub readback: AxisCounts,
    /// When.
    pub tick: Tick,
}

/// A raw reading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DwellResult {
    /// Which command.
    pub id: CommandId,
    /// As the command named it.
    pub reading: u32,
    /// The gain range that it was taken in.
    pub gain: u8,
    /// ADC readings taken.
    pub n: u32,
    /// Their mean, counts.
    pub mean: f64,
    /// Their variance (n - 1), counts squared; zero for a single reading.
    pub variance: f64,
    /// The smallest.
    pub min: i32,
    /// The largest.
    pub max: i32,
    /// How many stood at an end of the ADC's range.
    pub saturated: u32,
    /// Encoder positions when the integration began.
    pub start: AxisCounts,
    /// Encoder positions when it ended.
    pub end: AxisCounts,
    /// When it began.
    pub start_tick: Tick,
    /// When it ended.
    pub end_tick: Tick,
}

impl Eq for DwellResult {}

/// A raw reading of one window of a sweep. Gain, length and name are as its command says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Which command.
    pub id: CommandId,
    /// Which of its windows, from 0.
    pub index: u16,
    /// The mean of its ADC readings, counts.
    pub mean: f64,
    /// Their variance (n - 1), counts squared; zero for a single reading.
    pub variance: f64,
    /// The smallest.
    pub min: i32,
    /// The largest.
    pub max: i32,
    /// How many stood at an end of the ADC's range.
    pub saturated: u32,
    /// Encoder positions latched when it began.
    pub start: AxisCounts,
    /// How far they had come when it ended.
    pub moved: AxisCounts,
    /// When it began.
    pub start_tick: Tick,
    /// How long it lasted, microseconds.
    pub duration_us: u32,
}

impl Eq for Window {}

/// Why a device refuses a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Rejection {
    /// The number is not greater than the last one accepted in this boot.
    IdReused,
    /// The device is stopped by a fault; `ClearFault` first.
    Faulted(Cause),
    /// A target lies outside the axis's limits: channel, target.
    OutsideLimits(u8, i32),
    /// The queue is full, or results wait for their acknowledgement.
    QueueFull,
    /// The command makes no sense: no such axis, gain or duration.
    Senseless,
    /// An axis that must move has no home: channel.
    Unhomed(u8),
    /// This device can't do that.
    Unsupported,
    /// An axis would have to go faster than it can: channel. Since version 1.1.
    TooFast(u8),
    /// A sweep has more windows than the device keeps: the most. Since version 1.1.
    TooManyWindows(u16),
    /// The window that is asked for is not there. Since version 1.1.
    NoSuchWindow,
}

/// Why a command ended early, or why the device stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Cause {
    /// The detector did not answer.
    Detector,
    /// No home mark found: channel.
    HomingMissed(u8),
    /// The host was silent for longer than the lease.
    LeaseExpired,
    /// A limit switch opened: channel.
    LimitSwitch(u8),
    /// The axis did not follow: channel.
    Stalled(u8),
    /// The host asked to stop.
    Stopped,
}
