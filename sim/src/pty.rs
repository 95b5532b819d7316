//! A pseudo-terminal, seen from the device's side: what a simulated rig shows to programs that
//! open serial ports. It survives its clients: one that goes away and one that comes later are to
//! the device a line that was silent for a while. It knows bytes, not messages.

use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use tokio::io::unix::AsyncFd;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::Sleep;

/// How often a line without a client is looked at. The kernel tells when a client goes (the
/// master reads EIO), but not when the next one comes.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// The master's side of a pseudo-terminal, in raw mode. Reading waits while no client has it
/// open, and what is written meanwhile is lost, as on a wire with nobody at its end. The link is
/// removed when this is dropped.
#[derive(Debug)]
pub struct Pty {
    line: Line,
    path: PathBuf,
    link: Option<PathBuf>,
}

#[derive(Debug)]
enum Line {
    /// A client has it open, or none has had it yet.
    Up(AsyncFd<OwnedFd>),
    /// The last client went away.
    Down(OwnedFd, Pin<Box<Sleep>>),
    /// In between; never seen from outside.
    Turning,
}

impl Pty {
    /// Opens a new pseudo-terminal; with `link`, a symbolic link to it, for a name that stays. A
    /// link to a pseudo-terminal that is there already is taken over; any other file is not.
    ///
    /// Must be called within a tokio runtime with I/O and real time.
    pub fn open(link: Option<&Path>) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let path = PathBuf::from(ptsname(&master, Vec::new())?.to_string_lossy().into_owned());
        // Through the master, before anyone opens the other side: or its line discipline would
        // send the device's own words back to it.
        let mut termios = tcgetattr(&master)?;
        termios.make_raw();
        tcsetattr(&master, OptionalActions::Now, &termios)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        let line = Line::Up(watch(master)?);
        if let Some(link) = link {
            make_link(&path, link)?;
        }
        Ok(Self { line, path, link: link.map(Path::to_owned) })
    }

    /// Where clients open it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the last client has gone and none has come since.
    pub fn is_hung_up(&self) -> bool {
        matches!(self.line, Line::Down(..))
    }

    fn hang_up(&mut self) {
        if let Line::Up(line) = std::mem::replace(&mut self.line, Line::Turning) {
            // Registered anew when a client comes: tokio never forgets that a descriptor was
            // hung up, and would call it readable for ever.
            self.line = Line::Down(line.into_inner(), Box::pin(tokio::time::sleep(LOOK_AGAIN)));
        }
    }

    /// Looks whether somebody has opened the line again.
    fn poll_client(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let Line::Down(master, sleep) = &mut self.line else { return Poll::Ready(Ok(())) };
        loop {
            ready!(sleep.as_mut().poll(cx));
            if !is_hung_up(master)? {
                break;
            }
            sleep.set(tokio::time::sleep(LOOK_AGAIN));
        }
        if let Line::Down(master, _) = std::mem::replace(&mut self.line, Line::Turning) {
            self.line = Line::Up(watch(master)?);
        }
        Poll::Ready(Ok(()))
    }
}

impl AsyncRead for Pty {
    fn poll_read(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let pty = self.get_mut();
        loop {
            ready!(pty.poll_client(cx))?;
            let Line::Up(line) = &pty.line else { return Poll::Pending };
            let mut guard = ready!(line.poll_read_ready(cx))?;
            match rustix::io::read(line.get_ref(), buf.initialize_unfilled()) {
                Ok(n) if n > 0 => {
                    buf.advance(n);
                    return Poll::Ready(Ok(()));
                }
                Err(Errno::AGAIN) if !guard.ready().is_read_closed() => guard.clear_ready(),
                // Or one client went and the next came since we last looked.
                Ok(_) | Err(Errno::AGAIN | Errno::IO) => {
                    drop(guard);
                    pty.hang_up();
                }
                Err(Errno::INTR) => {}
                Err(e) => return Poll::Ready(Err(e.into())),
            }
        }
    }
}

impl AsyncWrite for Pty {
    fn poll_write(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let pty = self.get_mut();
        loop {
            let Line::Up(line) = &pty.line else { return Poll::Ready(Ok(bytes.len())) };
            let mut guard = ready!(line.poll_write_ready(cx))?;
            match rustix::io::write(line.get_ref(), bytes) {
                Ok(n) => return Poll::Ready(Ok(n)),
                Err(Errno::AGAIN) if !guard.ready().is_write_closed() => guard.clear_ready(),
                Err(Errno::AGAIN | Errno::IO) => {
                    drop(guard);
                    pty.hang_up();
                }
                Err(Errno::INTR) => {}
                Err(e) => return Poll::Ready(Err(e.into())),
            }
        }
    }

    /// Nothing is kept back here.
    fn poll_flush(self: Pin<&mut Self>, _cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link
            && std::fs::read_link(link).is_ok_and(|target| target == self.path)
        {
            let _ = std::fs::remove_file(link);
        }
    }
}

/// Asks the runtime to tell when the descriptor is ready.
#[expect(
    deprecated,
    reason = "its successor is unsafe for types that may hand out another descriptor later; \
              an OwnedFd holds one for life"
)]
fn watch(master: OwnedFd) -> io::Result<AsyncFd<OwnedFd>> {
    AsyncFd::new(master)
}

/// Whether the kernel says that no client has the other side open.
fn is_hung_up(master: &OwnedFd) -> io::Result<bool> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let mut fds = [PollFd::new(master, PollFlags::IN)];
    let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut fds, Some(&at_once))?;
    Ok(fds[0].revents().contains(PollFlags::HUP))
}

fn make_link(path: &Path, link: &Path) -> io::Result<()> {
    let names_a_terminal = |target: &PathBuf| target.starts_with("/dev/pts");
    if std::fs::read_link(link).is_ok_and(|target| names_a_terminal(&target)) {
        std::fs::remove_file(link)?;
    }
    std::os::unix::fs::symlink(path, link)
        .map_err(|e| io::Error::new(e.kind(), format!("link {}: {e}", link.display())))
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;
    use std::io::{Read, Write};

    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::time::timeout;

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(10);

    /// A client in a thread of its own, as programs are: sends, awaits as much back, closes.
    fn exchange(path: &Path, bytes: &'static [u8]) -> std::thread::JoinHandle<Vec<u8>> {
        let path = path.to_owned();
        std::thread::spawn(move || {
            let mut port = OpenOptions::new().read(true).write(true).open(path).unwrap();
            port.write_all(bytes).unwrap();
            let mut back = vec![0; bytes.len()];
            port.read_exact(&mut back).unwrap();
            back
        })
    }

    async fn echo(pty: &mut Pty, length: usize) {
        let mut bytes = vec![0; length];
        timeout(PATIENCE, pty.read_exact(&mut bytes)).await.expect("bytes in time").unwrap();
        timeout(PATIENCE, pty.write_all(&bytes)).await.expect("room in time").unwrap();
    }

    #[tokio::test]
    async fn a_line_serves_one_client_after_another() {
        let mut pty = Pty::open(None).unwrap();
        for words in [&b"\x00\x03\x04\x0d\x0a\x11\x13\xff"[..], b"again", b"and again"] {
            let client = exchange(pty.path(), words);
            echo(&mut pty, words.len()).await;
            assert_eq!(client.join().unwrap(), words, "raw: no byte is special");
            // The client has closed: the line goes down and stays silent, not ready.
            let nothing = timeout(Duration::from_millis(60), pty.read_u8()).await;
            assert!(nothing.is_err() && pty.is_hung_up());
            pty.write_all(b"nobody hears this").await.unwrap();
        }
    }

    #[tokio::test]
    async fn a_line_without_any_client_yet_waits() {
        let mut pty = Pty::open(None).unwrap();
        assert!(timeout(Duration::from_millis(60), pty.read_u8()).await.is_err());
        let client = exchange(pty.path(), b"late");
        echo(&mut pty, 4).await;
        assert_eq!(client.join().unwrap(), b"late");
    }

    #[tokio::test]
    async fn a_change_of_clients_that_nobody_watched_does_no_harm() {
        let mut pty = Pty::open(None).unwrap();
        let open = || OpenOptions::new().read(true).write(true).open(pty.path()).unwrap();
        drop(open());
        tokio::time::sleep(Duration::from_millis(5)).await;
        let mut next = open();
        assert!(timeout(Duration::from_millis(50), pty.read_u8()).await.is_err());
        next.write_all(b"x").unwrap();
        assert_eq!(timeout(PATIENCE, pty.read_u8()).await.unwrap().unwrap(), b'x');
    }

    #[tokio::test]
    async fn the_link_is_made_taken_over_and_removed() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("rig");
        let pty = Pty::open(Some(&link)).unwrap();
        assert_eq!(std::fs::read_link(&link).unwrap(), pty.path());
        let second = Pty::open(Some(&link)).unwrap();
        assert_eq!(std::fs::read_link(&link).unwrap(), second.path());
        drop(pty);
        assert!(link.is_symlink(), "it belongs to the second now");
        drop(second);
        assert!(!link.is_symlink());
        std::fs::write(&link, "a file").unwrap();
        assert_eq!(Pty::open(Some(&link)).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read_to_string(&link).unwrap(), "a file");
    }
}
