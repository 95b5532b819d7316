//! Where a daemon listens, as people write it: `unix:PATH` or `ADDR:PORT`. It opens nothing.

use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

/// The socket's file, in the user's runtime folder or in the data folder.
const SOCKET_FILE: &str = "gonio.sock";
/// What the kernel's `sockaddr_un` holds beside its final zero (Linux unix(7)).
const SOCKET_PATH_BYTES_MAX: usize = 107;

/// A place to listen or to connect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A port of this machine.
    Tcp(SocketAddr),
    /// A socket in the file system: its mode says who may connect.
    Unix(PathBuf),
}

/// Why a text is no address that a daemon listens at.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// Neither form.
    #[error("{text}: not an address; expected unix:PATH, or ADDR:PORT such as 127.0.0.1:8080")]
    Neither {
        /// What was given.
        text: String,
    },
    /// Reachable from elsewhere: there is nothing yet that asks who is there.
    #[error(
        "{address}: not a loopback address; expected 127.0.0.1 or [::1], or unix:PATH (to reach a \
         daemon from another machine, forward its socket with ssh -L)"
    )]
    NotLoopback {
        /// The address.
        address: SocketAddr,
    },
    /// The kernel takes no longer ones.
    #[error("{}: {bytes} bytes; a socket's path has at most {SOCKET_PATH_BYTES_MAX}", path.display())]
    TooLong {
        /// The path.
        path: PathBuf,
        /// Its length.
        bytes: usize,
    },
}

impl Address {
    /// Reads `unix:PATH` or `ADDR:PORT`; `localhost:PORT` is 127.0.0.1.
    pub fn parse(text: &str) -> Result<Self, AddressError> {
        if let Some(path) = text.strip_prefix("unix:").filter(|path| !path.is_empty()) {
            return Self::unix(PathBuf::from(path));
        }
        let numeric = text
            .strip_prefix("localhost:")
            .map_or_else(|| text.to_owned(), |port| format!("127.0.0.1:{port}"));
        let address: SocketAddr =
            numeric.parse().map_err(|_| AddressError::Neither { text: text.to_owned() })?;
        if !address.ip().is_loopback() {
            return Err(AddressError::NotLoopback { address });
        }
        Ok(Self::Tcp(address))
    }

    /// The socket in the user's runtime folder, or in the data folder where there is none.
    pub fn default_in(runtime: Option<&Path>, data: &Path) -> Result<Self, AddressError> {
        Self::unix(runtime.unwrap_or(data).join(SOCKET_FILE))
    }

    fn unix(path: PathBuf) -> Result<Self, AddressError> {
        let bytes = path.as_os_str().len();
        if bytes > SOCKET_PATH_BYTES_MAX {
            return Err(AddressError::TooLong { path, bytes });
        }
        Ok(Self::Unix(path))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Unix(path) => write!(f, "unix:{}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_read_back_as_they_print() {
        for text in ["unix:/run/user/7/gonio.sock", "127.0.0.1:8080", "[::1]:0"] {
            assert_eq!(Address::parse(text).unwrap().to_string(), text);
        }
        assert_eq!(Address::parse("localhost:80").unwrap().to_string(), "127.0.0.1:80");
    }

    #[test]
    fn what_others_could_reach_is_refused_by_name() {
        for text in ["0.0.0.0:80", "192.168.1.7:80", "[::]:80"] {
            let error = Address::parse(text).unwrap_err();
            assert!(matches!(error, AddressError::NotLoopback { .. }), "{error}");
            assert!(error.to_string().starts_with(text), "{error}");
        }
    }

    #[test]
    fn nonsense_says_what_was_expected() {
        for text in ["", "unix:", "gonio.sock", "127.0.0.1", "127.0.0.1:99999", "example.org:80"] {
            assert!(matches!(Address::parse(text), Err(AddressError::Neither { .. })), "{text}");
        }
        let long = format!("unix:/{}", "x".repeat(120));
        assert!(matches!(Address::parse(&long), Err(AddressError::TooLong { bytes: 121, .. })));
    }

    #[test]
    fn the_runtime_folder_comes_first() {
        let (runtime, data) = (Path::new("/run/user/7"), Path::new("data"));
        let shown = |runtime| Address::default_in(runtime, data).unwrap().to_string();
        assert_eq!(shown(Some(runtime)), "unix:/run/user/7/gonio.sock");
        assert_eq!(shown(None), "unix:data/gonio.sock");
    }
}
