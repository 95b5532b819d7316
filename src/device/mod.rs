//! How hardware is spoken to: links, which know bytes, and drivers, which know what bytes mean to
//! one kind of device. A simulated rig is one more link; nothing here can tell.
//!
//! [`Controller`] is what a run drives. Behind it stands a controller of gonio's own (`native`),
//! or a [`Composer`] with a driver for each of several devices: [`Axes`] move, a [`Photometer`]
//! reads.
//!
//! This room does not know poses, radiance or files.

mod agreement;
mod axes;
mod composed;
mod controller;
mod driver;
mod dynamixel;
mod grbl;
mod line_ports;
mod link;
mod meter;
mod native;
mod photometer;
mod ports;
mod probe;
mod serial;

pub use agreement::{Disagreement, QUEUE_DEPTH_MIN, check_agreement};
pub use axes::{Axes, AxesCommand, AxesEvent, AxesFacts, AxisFacts, Located};
pub use composed::Composer;
pub use controller::{ConnectError, Controller, DeviceEvent, LinkLost};
pub use driver::{Driver, NamedFault, Promises, Refusal, Trouble};
pub use dynamixel::{Dynamixel, ServoAxis, ServoFound, ServoId, ShutterServo};
pub use grbl::{Grbl, Greeting};
pub use line_ports::port_opener;
pub use link::{Link, Opener, Openers, Opening, opener};
pub use meter::{Line, Meter};
pub use photometer::{
    Exposed, Exposure, Photometer, PhotometerCommand, PhotometerEvent, PhotometerFacts,
};
pub use ports::{PortEntry, list_ports};
pub use probe::{Found, probe};
pub use serial::{SerialError, SerialSettings, open_serial, serial_opener};
