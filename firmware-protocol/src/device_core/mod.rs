//! The device's behaviour, from a request to the board and back to an event: what a
//! microcontroller and the simulated board run alike.
//!
//! It does not know frames, bytes, sequence numbers or who listens.

use core::time::Duration;

/// How often a board that must be called on time gets a moving axis's setpoint.
pub const SETPOINT_PERIOD: Duration = Duration::from_millis(1);

/// How often a simulated board is asked whether a searching axis has passed its home mark.
pub const SEARCH_PERIOD: Duration = Duration::from_millis(5);

/// The host's silence after which a device with work to do stops by itself.
pub const LEASE: Duration = Duration::from_millis(500);

/// Commands that can wait behind the running one.
pub const QUEUE_DEPTH: usize = 8;

/// Results that a device keeps until they are acknowledged. Commands that run or wait have
/// their place in it reserved.
pub const RESULTS_MAX: usize = 16;
