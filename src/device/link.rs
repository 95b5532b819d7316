//! A stream of bytes to a device and back. What flows over it is none of its business.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use super::SerialError;

trait ByteStream: AsyncRead + AsyncWrite + Send {}

impl<S: AsyncRead + AsyncWrite + Send> ByteStream for S {}

/// A serial port, a pseudo-terminal or an in-memory stream.
pub struct Link {
    name: String,
    stream: Pin<Box<dyn ByteStream>>,
}

impl Link {
    /// Wraps a stream; `name` is what messages call it.
    pub fn new(name: &str, stream: impl AsyncRead + AsyncWrite + Send + 'static) -> Self {
        Self { name: name.to_owned(), stream: Box::pin(stream) }
    }

    /// What messages call it.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// A link that is being opened.
pub type Opening = Pin<Box<dyn Future<Output = Result<Link, SerialError>> + Send>>;

/// Opens the link to one device, as often as it is asked to: after a lost one too.
pub type Opener = Box<dyn FnMut() -> Opening + Send>;

/// How the links to a rig's devices are opened: one to a controller of gonio's own, or one to each
/// of the devices that the rig file lists, in its order, the photometer's last.
pub struct Openers(pub Vec<Opener>);

impl From<Opener> for Openers {
    fn from(opener: Opener) -> Self {
        Self(vec![opener])
    }
}

/// Makes an [`Opener`] of a closure.
pub fn opener<F, O>(mut open: F) -> Opener
where
    F: FnMut() -> O + Send + 'static,
    O: Future<Output = Result<Link, SerialError>> + Send + 'static,
{
    Box::new(move || Box::pin(open()))
}

impl std::fmt::Debug for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Link").field("name", &self.name).finish_non_exhaustive()
    }
}

impl AsyncRead for Link {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.stream.as_mut().poll_read(context, buffer)
    }
}

impl AsyncWrite for Link {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.stream.as_mut().poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.stream.as_mut().poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.stream.as_mut().poll_shutdown(context)
    }
}
