//! Serial ports and pseudo-terminals as links. It does not know what is at the other end.

use std::io::ErrorKind;
use std::time::Duration;

use serialport::ErrorKind as PortError;
use tokio::io::AsyncReadExt as _;
use tokio::time::{Instant, timeout_at};
use tokio_serial::{SerialPortBuilderExt as _, SerialStream};

use super::{Link, Opener, opener};

/// How a port is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialSettings {
    /// Its path.
    pub port: String,
    /// Bits a second.
    pub baud: u32,
    /// Whether opening shall raise DTR, which resets many boards.
    pub reset_on_open: bool,
    /// How long the board then takes before it listens.
    pub boot_wait: Duration,
}

/// Why a port could not be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SerialError {
    /// Somebody has it open: a daemon, another terminal.
    #[error(
        "{port}: in use by another program; close it, or, where that is a daemon, hand it the plan with `gonio submit`"
    )]
    InUse {
        /// The port.
        port: String,
    },
    /// No such device: is it plugged in? `gonio ports` lists what there is.
    #[error("{port}: no such port; `gonio ports` lists those there are")]
    Missing {
        /// The port.
        port: String,
    },
    /// It is there, but not a terminal.
    #[error("{port}: not a serial port: {detail}")]
    NotAPort {
        /// The port.
        port: String,
        /// In the system's words.
        detail: String,
    },
    /// The user may not open it.
    #[error(
        "{port}: no permission; add yourself to the port's group (often `dialout`) and log in again"
    )]
    Permission {
        /// The port.
        port: String,
    },
}

/// Opens a port for this process alone, and waits until its board has booted, throwing away what
/// it said until then. Pseudo-terminals have no DTR; that is no fault.
pub async fn open_serial(settings: &SerialSettings) -> Result<Link, SerialError> {
    let mut stream = tokio_serial::new(&settings.port, settings.baud)
        .dtr_on_open(settings.reset_on_open)
        .open_native_async()
        .map_err(|error| named(&settings.port, &error))?;
    drain(&mut stream, settings.boot_wait).await;
    Ok(Link::new(&settings.port, stream))
}

/// Opens the port whenever it is asked to.
pub fn serial_opener(settings: SerialSettings) -> Opener {
    opener(move || {
        let settings = settings.clone();
        async move { open_serial(&settings).await }
    })
}

fn named(port: &str, error: &serialport::Error) -> SerialError {
    let port = port.to_owned();
    match error.kind {
        PortError::Io(ErrorKind::NotFound) => SerialError::Missing { port },
        PortError::Io(ErrorKind::PermissionDenied) => SerialError::Permission { port },
        PortError::NoDevice if error.description.contains("lock") => SerialError::InUse { port },
        PortError::NoDevice => match std::fs::exists(&port) {
            Ok(true) => SerialError::InUse { port },
            _ => SerialError::Missing { port },
        },
        _ => SerialError::NotAPort { port, detail: error.description.clone() },
    }
}

/// Reads and forgets until the time is over.
async fn drain(stream: &mut SerialStream, wait: Duration) {
    let deadline = Instant::now() + wait;
    let mut banner = [0; 256];
    while let Ok(Ok(1..)) = timeout_at(deadline, stream.read(&mut banner)).await {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(port: &str) -> SerialSettings {
        SerialSettings {
            port: port.to_owned(),
            baud: 115_200,
            reset_on_open: false,
            boot_wait: Duration::ZERO,
        }
    }

    #[tokio::test]
    async fn a_missing_port_and_a_file_are_told_apart() {
        let missing = open_serial(&settings("/dev/no-such-port")).await.unwrap_err();
        assert!(matches!(missing, SerialError::Missing { .. }), "{missing}");
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().to_string_lossy().into_owned();
        let error = open_serial(&settings(&path)).await.unwrap_err();
        assert!(matches!(error, SerialError::NotAPort { .. }), "{error}");
    }
}
