//! Speaks to a daemon: HTTP over its Unix socket or a loopback port. Every answer is bounded in
//! size and time, and a daemon that is not there is named with what to do about it.

use std::path::Path;
use std::time::Duration;

use http_body_util::{BodyExt as _, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::client::conn::http1;
use hyper::{Method, Request, Response, StatusCode, header};
use hyper_util::rt::TokioIo;
use serde::de::DeserializeOwned;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpStream, UnixStream};
use tokio::runtime::Runtime;

use super::acquire::Pace;
use super::args::DaemonAddress;
use super::failure::Failure;
use crate::daemon::http::body::ErrorBody;
use crate::daemon::{Address, Notice};

/// Where a daemon keeps its data if not told otherwise: `--data`'s default.
pub(crate) const DATA_DEFAULT: &str = "gonio-data";
/// The largest answer: a fit's covariance is the largest thing that a daemon says.
const ANSWER_BYTES_MAX: usize = 128 << 20;
/// The longest event.
const EVENT_BYTES_MAX: usize = 1 << 20;
const CONNECT_WITHIN: Duration = Duration::from_secs(5);
/// For what the daemon does at once.
const ANSWER_WITHIN: Duration = Duration::from_secs(30);
/// For what the rig does, and for checking a plan.
pub(crate) const WORK_WITHIN: Duration = Duration::from_mins(10);

type Body = Full<Bytes>;

/// A daemon at its address.
#[derive(Debug)]
pub(crate) struct Client {
    address: Address,
    runtime: Runtime,
}

/// Whether anybody listens there.
#[derive(Debug)]
enum Unreached {
    /// Nobody does.
    Absent(std::io::Error),
    /// Somebody does, but it goes wrong.
    Failed(Failure),
}

/// The default socket: in the user's runtime folder, else in the default data folder.
pub(crate) fn default_address(data: &Path) -> Result<Address, Failure> {
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty());
    Address::default_in(runtime.as_deref().map(Path::new), data).map_err(Failure::start)
}

impl Client {
    /// A client of the daemon at an address as given, or at the default one.
    pub(crate) fn of(address: &DaemonAddress) -> Result<Self, Failure> {
        let address = match &address.daemon {
            Some(text) => Address::parse(text).map_err(Failure::start)?,
            None => default_address(Path::new(DATA_DEFAULT))?,
        };
        let runtime = Pace::Real.runtime()?;
        Ok(Self { address, runtime })
    }

    /// Asks for something.
    pub(crate) fn get<T: DeserializeOwned>(&self, path: &str) -> Result<T, Failure> {
        let request = self.request(Method::GET, path, Vec::new())?;
        self.runtime.block_on(self.answer(request, ANSWER_WITHIN)).map_err(|e| self.named(e))
    }

    /// The same, but nobody being there is an answer too.
    pub(crate) fn get_if_there<T: DeserializeOwned>(
        &self,
        path: &str,
    ) -> Result<Option<T>, Failure> {
        let request = self.request(Method::GET, path, Vec::new())?;
        match self.runtime.block_on(self.answer(request, ANSWER_WITHIN)) {
            Ok(answer) => Ok(Some(answer)),
            Err(Unreached::Absent(_)) => Ok(None),
            Err(error) => Err(self.named(error)),
        }
    }

    /// Asks to do something, which may take that long.
    pub(crate) fn post<T: DeserializeOwned>(
        &self,
        path: &str,
        body: Vec<u8>,
        within: Duration,
    ) -> Result<T, Failure> {
        let request = self.request(Method::POST, path, body)?;
        self.runtime.block_on(self.answer(request, within)).map_err(|error| self.named(error))
    }

    /// Hands over one event after the other with its number, until the daemon ends or `take`
    /// says stop.
    pub(crate) fn follow(
        &self,
        after: u64,
        mut take: impl FnMut(i64, Notice) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let request = self.request(Method::GET, &format!("/events?after={after}"), Vec::new())?;
        self.runtime.block_on(async {
            let send = tokio::time::timeout(ANSWER_WITHIN, self.send(request));
            let response = send
                .await
                .map_err(|_| self.late(ANSWER_WITHIN))?
                .map_err(|error| self.named(error))?;
            let mut response = checked(response).await?;
            let mut lines = Lines::default();
            let mut number = 0;
            while let Some(frame) = response.frame().await {
                let frame = frame.map_err(|error| {
                    Failure::midway(format!("{}: the daemon is gone: {error}", self.address))
                })?;
                let Some(bytes) = frame.data_ref() else { continue };
                lines.take(bytes, |line| match line.split_once(':') {
                    Some(("id", id)) => {
                        number = id.trim().parse().unwrap_or(number);
                        Ok(())
                    }
                    Some(("data", data)) => take(number, self.parse(data.trim().as_bytes())?),
                    _ => Ok(()),
                })?;
            }
            Ok(())
        })
    }

    fn request(&self, method: Method, path: &str, body: Vec<u8>) -> Result<Request<Body>, Failure> {
        let host = match &self.address {
            Address::Tcp(address) => address.to_string(),
            Address::Unix(_) => "gonio".to_owned(),
        };
        Request::builder()
            .method(method)
            .uri(path)
            .header(header::HOST, host)
            .header(header::CONTENT_TYPE, "application/json")
            .body(Full::new(Bytes::from(body)))
            .map_err(|error| Failure::start(format!("{path}: {error}")))
    }

    async fn answer<T: DeserializeOwned>(
        &self,
        request: Request<Body>,
        within: Duration,
    ) -> Result<T, Unreached> {
        let whole = async {
            let response = checked(self.send(request).await?).await.map_err(Unreached::Failed)?;
            let bytes = receive(response).await.map_err(Unreached::Failed)?;
            self.parse(&bytes).map_err(Unreached::Failed)
        };
        tokio::time::timeout(within, whole)
            .await
            .unwrap_or_else(|_| Err(Unreached::Failed(self.late(within))))
    }

    async fn send(&self, request: Request<Body>) -> Result<Response<Incoming>, Unreached> {
        let connect = async {
            match &self.address {
                Address::Tcp(address) => Connected::of(TcpStream::connect(address).await?).await,
                Address::Unix(path) => Connected::of(UnixStream::connect(path).await?).await,
            }
        };
        let connected = tokio::time::timeout(CONNECT_WITHIN, connect)
            .await
            .map_err(|_| Unreached::Failed(self.late(CONNECT_WITHIN)))?;
        let Connected(mut sender) = connected.map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound | std::io::ErrorKind::ConnectionRefused => {
                Unreached::Absent(error)
            }
            _ => Unreached::Failed(Failure::start(format!("{}: {error}", self.address))),
        })?;
        sender.send_request(request).await.map_err(|error| {
            let what = format!("{}: whoever listens there answers no HTTP: {error}", self.address);
            Unreached::Failed(Failure::start(what))
        })
    }

    fn parse<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, Failure> {
        serde_json::from_slice(bytes).map_err(|error| {
            Failure::with_help(
                format!("{}: an answer that makes no sense: {error}", self.address),
                "is the daemon of the same version as this program?",
            )
        })
    }

    fn late(&self, within: Duration) -> Failure {
        Failure::start(format!("{}: no answer within {} s", self.address, within.as_secs()))
    }

    fn named(&self, error: Unreached) -> Failure {
        match error {
            Unreached::Absent(error) => Failure::with_help(
                format!("no daemon listens at {}: {error}", self.address),
                "start one with `gonio daemon --rig RIG`, or say with --daemon where it listens",
            ),
            Unreached::Failed(failure) => failure,
        }
    }
}

struct Connected(http1::SendRequest<Body>);

impl Connected {
    async fn of(
        stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    ) -> std::io::Result<Self> {
        let (sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(std::io::Error::other)?;
        // Its end is the answer's end, which is noticed there.
        tokio::spawn(connection);
        Ok(Self(sender))
    }
}

/// The response, unless it says no: then why, as the daemon said it.
async fn checked(response: Response<Incoming>) -> Result<Incoming, Failure> {
    let (parts, body) = response.into_parts();
    if parts.status.is_success() {
        return Ok(body);
    }
    let bytes = receive(body).await?;
    Err(refusal(parts.status, &bytes))
}

async fn receive(body: Incoming) -> Result<Bytes, Failure> {
    let collected = Limited::new(body, ANSWER_BYTES_MAX).collect().await;
    let collected = collected.map_err(|error| Failure::start(format!("the answer: {error}")))?;
    Ok(collected.to_bytes())
}

fn refusal(status: StatusCode, body: &[u8]) -> Failure {
    let Ok(ErrorBody { error, expected, help }) = serde_json::from_slice(body) else {
        return Failure::start(format!("the daemon answers {status}"));
    };
    let line = |name: &str, text: Option<String>| {
        text.map_or_else(String::new, |text| format!("\n  {name}: {text}"))
    };
    Failure::start(format!("{error}{}{}", line("expected", expected), line("help", help)))
}

/// Lines out of pieces that end anywhere.
#[derive(Debug, Default)]
struct Lines {
    rest: Vec<u8>,
}

impl Lines {
    fn take(
        &mut self,
        bytes: &[u8],
        mut each: impl FnMut(&str) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        self.rest.extend_from_slice(bytes);
        while let Some(end) = self.rest.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.rest.drain(..=end).collect();
            each(String::from_utf8_lossy(&line).trim_end())?;
        }
        if self.rest.len() > EVENT_BYTES_MAX {
            return Err(Failure::midway("the daemon sends an event without an end"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_whole_however_they_are_cut() {
        let text = b"id: 7\ndata: {\"a\": 1}\n\n: sign of life\n";
        for cut in 0..text.len() {
            let (mut lines, mut seen) = (Lines::default(), Vec::new());
            for piece in [&text[..cut], &text[cut..]] {
                let mut each = |line: &str| {
                    seen.push(line.to_owned());
                    Ok(())
                };
                lines.take(piece, &mut each).unwrap();
            }
            assert_eq!(seen, ["id: 7", "data: {\"a\": 1}", "", ": sign of life"]);
        }
        let endless = vec![b'x'; EVENT_BYTES_MAX + 1];
        assert!(Lines::default().take(&endless, |_| Ok(())).is_err());
    }

    #[test]
    fn a_daemon_that_is_not_there_is_named_with_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let address = format!("unix:{}/gonio.sock", folder.path().display());
        let client = Client::of(&DaemonAddress { daemon: Some(address.clone()) }).unwrap();
        let failure = format!("{:?}", client.get::<serde_json::Value>("/status").unwrap_err());
        assert!(failure.contains("code: 2") && failure.contains(&address), "{failure}");
        assert!(failure.contains("gonio daemon --rig"), "{failure}");
        assert!(client.get_if_there::<serde_json::Value>("/status").unwrap().is_none());
    }
}
