//! Numbers that must differ from one process to the next, drawn from wall time and the process:
//! a device takes a host with an old session number for the old host.

use std::time::{SystemTime, UNIX_EPOCH};

/// A session number for a new connection.
pub(crate) fn draw_session() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    // Fibonacci hashing (Knuth 1973, 6.4) spreads what changes in the low bits.
    #[allow(clippy::cast_possible_truncation)] // the low bits are the ones that change
    let mixed = (now.as_nanos() as u64 ^ (u64::from(std::process::id()) << 40))
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed >> 32) as u32
}

/// The time now, RFC 3339, to the second.
pub(crate) fn utc_now() -> String {
    jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

/// The time now as a part of a file's name.
pub(crate) fn utc_stamp() -> String {
    jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ").to_string()
}
