//! The wire between host and rig, and the device-side core that a microcontroller and the
//! simulated board run alike. `PROTOCOL.md` beside this crate is normative.
//!
//! From the wire upwards: [`frame`] packs and checks bytes, [`Decoder`] finds frames in a stream,
//! [`ToDevice`] and [`ToHost`] are messages with the session and boot that they belong to. Above
//! that, [`HostEndpoint`] is the host's end of the reliable link and [`DeviceEndpoint`] the
//! device's; [`DeviceCore`] does what requests say, on a [`Board`]; and [`Device`] is link and
//! core together, which is all that firmware or a simulator pumps.
//!
//! No networking, no clock, no heap: bytes and the time come in as arguments, bytes and events
//! are polled out. The crate does not know angles or radiance: positions are counts, readings
//! are ADC counts.
#![no_std]

mod board;
mod bounds;
mod codec;
mod decoder;
mod device;
mod device_core;
mod device_link;
pub mod frame;
mod host;
mod message;
mod motion;
mod packet;
mod sweep;
mod time;

pub use board::{Board, BoardFault, Illumination};
pub use codec::{CodecError, EventType, ReplyType, RequestType, WINDOW_WIRE_MAX};
pub use decoder::{BadFrames, Decoder};
pub use device::Device;
pub use device_core::{
    DeviceCore, LEASE, QUEUE_DEPTH, RESULTS_MAX, SEARCH_PERIOD, SETPOINT_PERIOD, WINDOWS_MAX,
};
pub use device_link::{DeviceEndpoint, Incoming, ReplyTo};
pub use host::{
    HostEndpoint, HostEvent, LinkCause, LinkStatistics, Nonsense, SubmitError, Ticket, WINDOW,
};
pub use message::{
    AXES_MAX, AxisCounts, AxisIdentity, AxisMask, Capabilities, Cause, CommandId, Done, Dwell,
    DwellResult, Event, Home, Identity, MoveTo, Rejection, Reply, Request, Shutter, Status, Sweep,
    Window,
};
pub use motion::Trapezoid;
pub use packet::{Foreign, NakReason, PROTOCOL, PacketError, Said, SessionTag, ToDevice, ToHost};
pub use sweep::{Cruise, SweepMotion};
pub use time::{Instant, Tick, TickUnwrapper};
