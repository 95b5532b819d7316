//! How hardware is spoken to: links, which know bytes, and drivers, which know what bytes mean to
//! one kind of device. A simulated rig is one more link; nothing here can tell.
//!
//! This room does not know poses, radiance or files.

mod agreement;
mod link;
mod native;
mod ports;
mod serial;

pub use agreement::{Disagreement, QUEUE_DEPTH_MIN, check_agreement};
pub use link::{Link, Opener, Opening, opener};
pub use native::{ConnectError, DeviceEvent, LinkLost, Native};
pub use ports::{PortEntry, list_ports};
pub use serial::{SerialError, SerialSettings, open_serial, serial_opener};
