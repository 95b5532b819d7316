//! Asking an unknown thing who it is, without moving it and without changing anything: first in
//! words that harm nobody, and last in frames of gonio's own, whose bytes mean something else to
//! others.

use std::time::Duration;

use firmware_protocol::Identity;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::time::{Instant, timeout_at};

use super::controller::{ConnectError, Controller};
use super::dynamixel::{RollCall, ServoFound};
use super::grbl::{Greeting, Listener};
use super::link::Link;

/// How long an answer may take: fifty characters at 9600 baud, and the thought before them.
const LISTEN: Duration = Duration::from_millis(700);
/// A board that was reset by opening its port hears the last of them.
const ROUNDS: u32 = 3;
/// No name of an instrument is longer.
const LINE_MAX: usize = 256;

/// Who answered.
#[derive(Debug, Clone, PartialEq)]
pub enum Found {
    /// A controller of gonio's own.
    Controller(Identity),
    /// A board with grbl.
    Grbl(Greeting),
    /// A thing that answers to `*IDN?`, with what it calls itself.
    Instrument(String),
    /// A Newport 1830-C, which has no name: known by how it answers `U?` and `R?`.
    Newport {
        /// Its unit: 1 W, 2 dBm, 3 dB, 4 relative.
        unit: u8,
        /// Its range, 1 to 8; 0 where it looks for one by itself.
        range: u8,
    },
    /// Dynamixel servos.
    Servos(Vec<ServoFound>),
}

/// Asks who is there. `session` and `patience` are for a controller of gonio's own, as in
/// [`Controller::connect`].
pub async fn probe(
    mut link: Link,
    session: u32,
    baud: u32,
    patience: Duration,
) -> Result<Found, ConnectError> {
    let mut listener = Listener::default();
    for round in 0..ROUNDS {
        // `?` is a question to grbl, and no whole command to anybody else.
        say(&mut link, b"?").await?;
        if hear(&mut link, |byte| listener.take(byte)).await?.is_some() {
            // Ends half a line that somebody may have left; asks for the build, at rest alone.
            if listener.is_at_rest() {
                say(&mut link, b"\n$I\n").await?;
                hear(&mut link, |byte| listener.take_build(byte)).await?;
            }
            return Ok(Found::Grbl(listener.greeting()));
        }
        say(&mut link, b"\n*IDN?\n").await?;
        let mut line = Vec::new();
        if let Some(name) = hear(&mut link, |byte| name(&mut line, byte)).await? {
            return Ok(Found::Instrument(name));
        }
        // These boot with no port: once is enough.
        if round == 0
            && let Some(found) = without_a_name(&mut link).await?
        {
            return Ok(found);
        }
    }
    let (controller, identity) = Controller::connect(link, session, baud, patience).await?;
    controller.close().await;
    Ok(Found::Controller(identity))
}

/// Those who answer neither `?` nor `*IDN?`.
async fn without_a_name(link: &mut Link) -> Result<Option<Found>, ConnectError> {
    say(link, b"U?\n").await?;
    let mut line = Vec::new();
    if let Some(unit @ 1..=4) = hear(link, |byte| digit(&mut line, byte)).await? {
        say(link, b"R?\n").await?;
        if let Some(range @ 0..=8) = hear(link, |byte| digit(&mut line, byte)).await? {
            return Ok(Some(Found::Newport { unit, range }));
        }
    }
    let mut call = RollCall::default();
    say(link, &RollCall::question()).await?;
    hear(link, |byte| {
        call.take(&[byte]);
        None::<()>
    })
    .await?;
    let servos = call.found();
    Ok((!servos.is_empty()).then_some(Found::Servos(servos)))
}

/// A line that is one digit.
fn digit(line: &mut Vec<u8>, byte: u8) -> Option<u8> {
    if byte != b'\n' && byte != b'\r' {
        line.push(byte);
        line.truncate(LINE_MAX);
        return None;
    }
    let line = std::mem::take(line);
    match line.trim_ascii() {
        [digit @ b'0'..=b'9'] => Some(digit - b'0'),
        _ => None,
    }
}

/// What a thing calls itself: four words with commas between them (IEEE 488.2, 10.14).
fn name(line: &mut Vec<u8>, byte: u8) -> Option<String> {
    if byte != b'\n' && byte != b'\r' {
        line.push(byte);
        line.truncate(LINE_MAX);
        return None;
    }
    let line = std::mem::take(line);
    let text = String::from_utf8(line).ok()?;
    let is_name = text.matches(',').count() >= 2 && text.chars().all(|c| !c.is_control());
    is_name.then(|| text.trim().to_owned())
}

async fn say(link: &mut Link, bytes: &[u8]) -> Result<(), ConnectError> {
    let port = link.name().to_owned();
    let written = link.write_all(bytes).await;
    written.map_err(|error| ConnectError::HungUp { port, detail: error.to_string() })
}

/// Listens until it is understood, or for long enough.
async fn hear<T>(
    link: &mut Link,
    mut take: impl FnMut(u8) -> Option<T>,
) -> Result<Option<T>, ConnectError> {
    let deadline = Instant::now() + LISTEN;
    let mut bytes = [0; 256];
    loop {
        let Ok(read) = timeout_at(deadline, link.read(&mut bytes)).await else { return Ok(None) };
        let port = link.name().to_owned();
        let gone = |detail: String| ConnectError::HungUp { port, detail };
        match read {
            Ok(0) => return Err(gone("end of the stream".to_owned())),
            Err(error) => return Err(gone(error.to_string())),
            Ok(n) => {
                let understood = bytes.get(..n).unwrap_or_default().iter().find_map(|b| take(*b));
                if understood.is_some() {
                    return Ok(understood);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::duplex;

    use super::*;

    /// A device that answers what it is asked.
    async fn found(
        answer: impl Fn(&str) -> &'static str + Send + 'static,
    ) -> Result<Found, ConnectError> {
        let (host, mut device) = duplex(4096);
        tokio::spawn(async move {
            let mut bytes = [0; 256];
            while let Ok(n @ 1..) = device.read(&mut bytes).await {
                let asked = String::from_utf8_lossy(&bytes[..n]).into_owned();
                assert!(!asked.contains('!') && !asked.contains('\u{18}'), "{asked}");
                if device.write_all(answer(&asked).as_bytes()).await.is_err() {
                    return;
                }
            }
        });
        probe(Link::new("test", host), 1, 9600, Duration::from_secs(1)).await
    }

    #[tokio::test(start_paused = true)]
    async fn a_grbl_and_an_instrument_are_known_by_harmless_questions() {
        let grbl = found(|asked| match asked {
            "?" => "<Idle|MPos:1.000,2.000,3.000|FS:0,0>\r\n",
            _ => "ok\r\n[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n",
        });
        let Found::Grbl(greeting) = grbl.await.unwrap() else { panic!() };
        assert_eq!((greeting.version.as_deref(), greeting.axes), (Some("1.1h"), 3));
        assert_eq!(greeting.state, "Idle");
        // One that moves is not asked for more.
        let running = found(|asked| match asked {
            "?" => "<Run|MPos:1.000,2.000,3.000|FS:0,0>\r\n",
            other => panic!("{other}"),
        });
        let Found::Grbl(greeting) = running.await.unwrap() else { panic!() };
        assert_eq!((greeting.version, greeting.state.as_str()), (None, "Run"));
        let meter = found(|asked| match asked {
            "?" => "",
            _ => "KEITHLEY INSTRUMENTS INC.,MODEL 6485,1234567,B02\r",
        });
        let name = "KEITHLEY INSTRUMENTS INC.,MODEL 6485,1234567,B02".to_owned();
        assert_eq!(meter.await.unwrap(), Found::Instrument(name));
    }

    #[tokio::test(start_paused = true)]
    async fn a_newport_is_known_by_its_answers_and_is_told_nothing() {
        let newport = found(|asked| match asked {
            "U?\n" => "1\n",
            "R?\n" => "0\n",
            other => {
                assert!(!other.contains(char::is_numeric), "{other}");
                ""
            }
        });
        assert_eq!(newport.await.unwrap(), Found::Newport { unit: 1, range: 0 });
    }

    #[tokio::test(start_paused = true)]
    async fn nobody_is_no_kind() {
        let (host, _device) = duplex(4096);
        let nobody = probe(Link::new("test", host), 1, 9600, Duration::from_secs(1)).await;
        assert!(matches!(nobody, Err(ConnectError::Silent { .. })), "{nobody:?}");
    }
}
