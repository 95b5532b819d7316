//! Ports that are no serial ports: a TCP connection to a terminal server or a meter with a network
//! socket (`tcp:HOST:PORT`), and the kernel's file of a USB test instrument (`/dev/usbtmc0`).
//! It knows bytes; of the second it knows that a message with a question mark is answered.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::Path;
use std::time::Duration;

use tokio::io::{AsyncBufReadExt as _, AsyncWriteExt as _, BufReader, DuplexStream, duplex};
use tokio::net::TcpStream;
use tokio::sync::mpsc;

use super::{Link, Opener, SerialError, SerialSettings, open_serial, opener};

const TCP: &str = "tcp:";
/// How long a host may take to answer.
const PATIENCE: Duration = Duration::from_secs(5);
/// What waits between the file and the driver.
const STREAM_BYTES: usize = 64 * 1024;
/// The longest answer of a USB instrument that is read at once.
const ANSWER_BYTES: usize = 64 * 1024;

/// Opens whatever a rig file calls a port.
pub fn port_opener(settings: SerialSettings) -> Opener {
    opener(move || {
        let settings = settings.clone();
        async move { open_port(&settings).await }
    })
}

async fn open_port(settings: &SerialSettings) -> Result<Link, SerialError> {
    let port = settings.port.as_str();
    let name = Path::new(port).file_name().and_then(|name| name.to_str()).unwrap_or_default();
    if let Some(address) = port.strip_prefix(TCP) {
        open_tcp(port, address).await
    } else if name.starts_with("usbtmc") {
        open_instrument(port)
    } else {
        open_serial(settings).await
    }
}

async fn open_tcp(port: &str, address: &str) -> Result<Link, SerialError> {
    let not_a_port = |detail: String| SerialError::NotAPort { port: port.to_owned(), detail };
    let connecting = tokio::time::timeout(PATIENCE, TcpStream::connect(address)).await;
    let stream = connecting
        .map_err(|_| not_a_port(format!("no answer within {} s", PATIENCE.as_secs())))?
        .map_err(|error| not_a_port(error.to_string()))?;
    // Words are short, and each waits for its answer.
    stream.set_nodelay(true).map_err(|error| not_a_port(error.to_string()))?;
    Ok(Link::new(port, stream))
}

fn open_instrument(path: &str) -> Result<Link, SerialError> {
    let port = path.to_owned();
    let file = OpenOptions::new().read(true).write(true).open(path).map_err(|error| match error
        .kind()
    {
        ErrorKind::NotFound => SerialError::Missing { port },
        ErrorKind::PermissionDenied => SerialError::Permission { port },
        ErrorKind::ResourceBusy => SerialError::InUse { port },
        _ => SerialError::NotAPort { port, detail: error.to_string() },
    })?;
    let (near, far) = duplex(STREAM_BYTES);
    let (words, to_file) = mpsc::unbounded_channel();
    let (from_file, answers) = mpsc::unbounded_channel();
    // The kernel's file knows no waiting but this: a thread stands at it. It ends with the link.
    std::thread::spawn(move || converse(file, to_file, &from_file));
    tokio::spawn(carry(far, words, answers));
    Ok(Link::new(path, near))
}

/// Says each message, and hears the answer of those that ask.
fn converse(
    mut file: File,
    mut words: mpsc::UnboundedReceiver<Vec<u8>>,
    answers: &mpsc::UnboundedSender<Vec<u8>>,
) {
    let mut answer = vec![0; ANSWER_BYTES];
    while let Some(word) = words.blocking_recv() {
        if file.write_all(&word).is_err() {
            return;
        }
        if !word.contains(&b'?') {
            continue;
        }
        match file.read(&mut answer) {
            Ok(0) => return,
            Ok(read) => {
                let said = answer.get(..read).unwrap_or_default().to_vec();
                if answers.send(said).is_err() {
                    return;
                }
            }
            // It did not answer in the kernel's time: who asked knows how long to wait.
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(_) => return,
        }
    }
}

/// Between the link and the thread, line by line; dropping the stream hangs the link up.
async fn carry(
    far: DuplexStream,
    words: mpsc::UnboundedSender<Vec<u8>>,
    mut answers: mpsc::UnboundedReceiver<Vec<u8>>,
) {
    let (from_host, mut to_host) = tokio::io::split(far);
    let mut from_host = BufReader::new(from_host);
    let mut line = Vec::new();
    loop {
        tokio::select! {
            biased;
            answer = answers.recv() => {
                let Some(mut answer) = answer else { return };
                if !answer.ends_with(b"\n") {
                    answer.push(b'\n');
                }
                if to_host.write_all(&answer).await.is_err() {
                    return;
                }
            }
            // What was read of a line before an answer came stays in `line`.
            read = from_host.read_until(b'\n', &mut line) => match read {
                Ok(1..) if words.send(std::mem::take(&mut line)).is_ok() => {}
                _ => return,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::AsyncReadExt as _;

    use super::*;

    fn settings(port: String) -> SerialSettings {
        SerialSettings { port, baud: 9600, reset_on_open: false, boot_wait: Duration::ZERO }
    }

    #[tokio::test]
    async fn a_socket_is_a_port_and_one_that_nobody_listens_to_is_named() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = format!("tcp:{}", listener.local_addr().unwrap());
        let mut link = open_port(&settings(port.clone())).await.unwrap();
        let (mut far, _) = listener.accept().await.unwrap();
        link.write_all(b"*IDN?\n").await.unwrap();
        let mut heard = [0; 6];
        far.read_exact(&mut heard).await.unwrap();
        assert_eq!(&heard, b"*IDN?\n");
        drop((far, listener));
        let error = open_port(&settings(port.clone())).await.unwrap_err().to_string();
        assert!(error.contains(&port), "{error}");
    }

    /// A pseudo-terminal stands for the kernel's file: it too is written and read in whole.
    #[tokio::test]
    async fn an_instrument_s_file_answers_what_asks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("usbtmc0");
        let mut device = sim::Pty::open(Some(&path)).unwrap();
        let mut link = open_port(&settings(path.display().to_string())).await.unwrap();
        link.write_all(b"CONF:POW\nREAD?\n").await.unwrap();
        let mut heard = Vec::new();
        while !heard.ends_with(b"READ?\n") {
            let mut bytes = [0; 64];
            let read = device.read(&mut bytes).await.unwrap();
            heard.extend_from_slice(&bytes[..read]);
        }
        assert_eq!(heard, b"CONF:POW\nREAD?\n");
        device.write_all(b"1.5E-3").await.unwrap();
        let mut answer = [0; 7];
        link.read_exact(&mut answer).await.unwrap();
        assert_eq!(&answer, b"1.5E-3\n");
        let missing = open_port(&settings("/dev/usbtmc987".to_owned())).await.unwrap_err();
        assert!(matches!(missing, SerialError::Missing { .. }));
    }
}
