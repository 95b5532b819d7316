//! How the rig is reached: what rig.toml says about the wire.

use std::time::Duration;

use spanned_toml::{Problem, Table};

/// Serial lines run between these rates, baud.
const BAUD: core::ops::RangeInclusive<i64> = 1_200..=12_000_000;
const BAUD_DEFAULT: u32 = 1_000_000;
const BOOT_WAIT_MS_MAX: i64 = 60_000;
const BOOT_WAIT_MS_DEFAULT: u64 = 2_000;

/// The wire to the device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Link {
    /// Several devices, each on a port of its own: see [`super::Devices`].
    Devices,
    /// A simulated rig in this process; its wire is paced at this rate.
    Simulated {
        /// Bits a second, ten to the byte.
        baud: u32,
    },
    /// A serial port.
    Serial {
        /// Its path, or its name.
        port: String,
        /// Bits a second.
        baud: u32,
        /// Whether opening the port resets the board.
        reset_on_open: bool,
        /// How long the board then takes before it listens.
        boot_wait: Duration,
    },
}

impl Link {
    /// Reads the table `[link]`.
    ///
    /// `kind` is `"simulated"`, `"serial"` or `"devices"`, whose ports are in tables of their own;
    /// `baud` defaults to one million; a serial link needs `port`, and takes `reset_on_open`
    /// (default false) and `boot_wait_ms` (default 2000 where opening resets the board).
    pub(super) fn read(table: Table<'_>) -> Result<Self, Problem> {
        let kinds =
            [("simulated", Kind::Simulated), ("serial", Kind::Serial), ("devices", Kind::Devices)];
        let kind = table.required_choice("kind", &kinds)?;
        if kind == Kind::Devices {
            table.finish()?;
            return Ok(Self::Devices);
        }
        let baud = table.integer("baud", BAUD)?;
        let baud = baud.map_or(BAUD_DEFAULT, |baud| u32::try_from(baud).unwrap_or(BAUD_DEFAULT));
        let is_serial = kind == Kind::Serial;
        let link = if is_serial { serial(&table, baud)? } else { Self::Simulated { baud } };
        table.finish()?;
        Ok(link)
    }

    /// Bits a second; of several devices none speaks for all, and the rate is the default.
    pub fn baud(&self) -> u32 {
        match self {
            Self::Devices => BAUD_DEFAULT,
            Self::Simulated { baud } | Self::Serial { baud, .. } => *baud,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Devices,
    Serial,
    Simulated,
}

fn serial(table: &Table<'_>, baud: u32) -> Result<Link, Problem> {
    let port = table.required_text("port")?.to_owned();
    let reset_on_open = table.flag("reset_on_open")?.unwrap_or(false);
    let boot_wait_ms = table.integer("boot_wait_ms", 0..=BOOT_WAIT_MS_MAX)?;
    let default_ms = if reset_on_open { BOOT_WAIT_MS_DEFAULT } else { 0 };
    let boot_wait_ms = boot_wait_ms.map_or(default_ms, i64::unsigned_abs);
    Ok(Link::Serial { port, baud, reset_on_open, boot_wait: Duration::from_millis(boot_wait_ms) })
}
