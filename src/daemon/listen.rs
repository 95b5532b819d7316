//! Opens the place where the daemon listens, and the lock that makes it the only one of its rig.
//! It knows files and sockets, and nothing of what is said on them.

use std::fs::{DirBuilder, File, OpenOptions, Permissions, TryLockError};
use std::io;
use std::os::unix::fs::{
    DirBuilderExt as _, FileTypeExt as _, MetadataExt as _, PermissionsExt as _,
};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

use tokio::net::{TcpListener, UnixListener};

use super::Address;

/// The owner may connect, and nobody else.
const SOCKET_MODE: u32 = 0o600;
const LOCK_FILE: &str = "daemon.lock";

/// Why a daemon can't be had here.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// Another daemon owns the rig's data.
    #[error(
        "{}: another daemon is running on this data folder; use it with gonio submit, or stop it",
        path.display()
    )]
    Locked {
        /// The lock.
        path: PathBuf,
    },
    /// Somebody answers at the address.
    #[error("{address}: a daemon answers here already; use it, or choose another --listen")]
    Answered {
        /// The address.
        address: Address,
    },
    /// Something that is not a socket lies there. It is not removed.
    #[error("{}: exists and is not a socket; choose another --listen, or move it away", path.display())]
    Occupied {
        /// The path.
        path: PathBuf,
    },
    /// The system refused.
    #[error("{what}: cannot {doing}: {error}")]
    System {
        /// The file or address.
        what: String,
        /// What was tried.
        doing: &'static str,
        /// In the system's words.
        error: io::Error,
    },
}

/// Held by the one daemon of a data folder. The kernel lets go of it however the process ends.
#[derive(Debug)]
pub(super) struct DaemonLock(#[allow(dead_code)] File);

impl DaemonLock {
    pub(super) fn take(data: &Path) -> Result<Self, ListenError> {
        let path = data.join(LOCK_FILE);
        let fail = |doing| {
            let what = path.display().to_string();
            move |error| ListenError::System { what, doing, error }
        };
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(fail("be made"))?;
        match file.try_lock() {
            Ok(()) => Ok(Self(file)),
            Err(TryLockError::WouldBlock) => Err(ListenError::Locked { path }),
            Err(TryLockError::Error(error)) => Err(fail("be locked")(error)),
        }
    }
}

/// A socket in the file system that goes away with its daemon.
#[derive(Debug)]
pub(super) struct SocketFile {
    path: PathBuf,
    inode: u64,
}

impl Drop for SocketFile {
    fn drop(&mut self) {
        // Another daemon may have put its own there.
        if std::fs::symlink_metadata(&self.path).is_ok_and(|found| found.ino() == self.inode) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// An open door.
#[derive(Debug)]
pub(super) enum Listening {
    Tcp(TcpListener),
    Unix(UnixListener, SocketFile),
}

/// Opens the address. Must be called within a runtime.
pub(super) async fn listen(address: &Address) -> Result<(Listening, Address), ListenError> {
    match address {
        Address::Tcp(wanted) => {
            let bound = TcpListener::bind(wanted).await.and_then(|listener| {
                let actual = listener.local_addr()?;
                Ok((Listening::Tcp(listener), Address::Tcp(actual)))
            });
            bound.map_err(|error| match error.kind() {
                io::ErrorKind::AddrInUse => ListenError::Answered { address: address.clone() },
                _ => ListenError::System { what: address.to_string(), doing: "listen", error },
            })
        }
        Address::Unix(path) => {
            refuse_if_in_use(path)?;
            let (listener, file) = bind_privately(path).map_err(|error| ListenError::System {
                what: address.to_string(),
                doing: "listen",
                error,
            })?;
            Ok((Listening::Unix(listener, file), address.clone()))
        }
    }
}

/// A socket that nobody answers on was left by a daemon that was killed; anything else stays.
fn refuse_if_in_use(path: &Path) -> Result<(), ListenError> {
    let Ok(found) = std::fs::symlink_metadata(path) else { return Ok(()) };
    if !found.file_type().is_socket() {
        return Err(ListenError::Occupied { path: path.to_owned() });
    }
    match UnixStream::connect(path) {
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => {
            let what = path.display().to_string();
            Err(ListenError::System { what, doing: "be asked whether anybody listens", error })
        }
        Ok(_) => Err(ListenError::Answered { address: Address::Unix(path.to_owned()) }),
    }
}

/// Binds in a folder that only the owner may enter, sets the mode, and moves the socket into its
/// place: at no moment can anybody else connect, and a stale socket is replaced in one step.
fn bind_privately(path: &Path) -> io::Result<(UnixListener, SocketFile)> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    // As short as can be: the kernel bounds the path.
    let folder = parent.unwrap_or(Path::new(".")).join(format!(".g{}", std::process::id()));
    DirBuilder::new().mode(0o700).create(&folder)?;
    let bind = || {
        let inside = folder.join("s");
        let listener = UnixListener::bind(&inside)?;
        std::fs::set_permissions(&inside, Permissions::from_mode(SOCKET_MODE))?;
        let inode = std::fs::symlink_metadata(&inside)?.ino();
        std::fs::rename(&inside, path)?;
        Ok((listener, SocketFile { path: path.to_owned(), inode }))
    };
    let bound = bind();
    if bound.is_err() {
        let _ = std::fs::remove_file(folder.join("s"));
    }
    let _ = std::fs::remove_dir(&folder);
    bound
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unix(folder: &Path) -> Address {
        Address::Unix(folder.join("gonio.sock"))
    }

    #[tokio::test]
    async fn the_socket_is_its_owners_alone_and_goes_away_with_the_daemon() {
        let folder = tempfile::tempdir().unwrap();
        let address = unix(folder.path());
        let listening = listen(&address).await.unwrap();
        let mode = std::fs::metadata(folder.path().join("gonio.sock")).unwrap().mode();
        assert_eq!(mode & 0o777, SOCKET_MODE);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        drop(listening);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[tokio::test]
    async fn a_stale_socket_is_replaced_and_a_living_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let address = unix(folder.path());
        let Address::Unix(path) = &address else { unreachable!() };
        drop(std::os::unix::net::UnixListener::bind(path).unwrap());
        let first = listen(&address).await.unwrap();
        assert!(matches!(listen(&address).await, Err(ListenError::Answered { .. })));
        drop(first);
        listen(&address).await.unwrap();
    }

    #[tokio::test]
    async fn a_file_in_the_way_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("gonio.sock"), "mine").unwrap();
        let refused = listen(&unix(folder.path())).await;
        assert!(matches!(refused, Err(ListenError::Occupied { .. })));
        assert_eq!(std::fs::read(folder.path().join("gonio.sock")).unwrap(), b"mine");
    }

    #[tokio::test]
    async fn port_0_is_answered_with_the_real_one() {
        let (_first, address) = listen(&Address::parse("127.0.0.1:0").unwrap()).await.unwrap();
        assert!(matches!(address, Address::Tcp(actual) if actual.port() != 0));
        assert!(matches!(listen(&address).await, Err(ListenError::Answered { .. })));
    }

    #[test]
    fn a_data_folder_has_one_daemon() {
        let folder = tempfile::tempdir().unwrap();
        let first = DaemonLock::take(folder.path()).unwrap();
        assert!(matches!(DaemonLock::take(folder.path()), Err(ListenError::Locked { .. })));
        drop(first);
        DaemonLock::take(folder.path()).unwrap();
    }
}
