//! The long-running owner of a rig: a queue that survives a restart, HTTP for programs and
//! people, and events with numbers.
//!
//! HTTP and the queue go by the real clock on the runtime that calls [`Daemon::serve`]; the rig lives on a
//! thread of its own ([`RigThread`]). How files become a run and readings become results is
//! the [`Workshop`]'s: the daemon knows no file that people write, and not what a rig is made of.

mod address;
mod book;
mod conductor;
mod hand;
pub mod http;
mod listen;
mod notice;
mod rig_thread;
mod workshop;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use tokio::sync::{mpsc, watch};
use tokio_util::sync::CancellationToken;

pub use address::{Address, AddressError};
pub use conductor::Shutdown;
pub use listen::ListenError;
pub use notice::{Kind, Notice, Progress};
pub use rig_thread::RigThread;
pub use workshop::{Checked, Finished, Prepared, Refusal, Workshop};

use book::Book;
use conductor::{Activity, Conductor};
use http::Desk;
use listen::{DaemonLock, Listening, listen};

use crate::journal::{JournalError, Queue};
use crate::run::{OwnerHandle, Source};

/// Orders that wait for the conductor, at most.
const ORDERS: usize = 64;
/// How long open requests may take to end once the rig is at rest.
const CLOSE_WITHIN: Duration = Duration::from_secs(6);

/// Where a daemon keeps its data, and where it listens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Config {
    /// The folder of the queue and of the runs; made if it is not there.
    pub data: PathBuf,
    /// Where to listen.
    pub listen: Address,
}

/// Why a daemon could not begin, or had to end.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The data folder can't be made.
    #[error("{}: cannot be made: {error}", path.display())]
    Data {
        /// The folder.
        path: PathBuf,
        /// In the system's words.
        error: std::io::Error,
    },
    /// Another daemon is there, or the address can't be had.
    #[error(transparent)]
    Listen(#[from] ListenError),
    /// The queue can't be read, or written any more.
    #[error("the queue: {0}")]
    Queue(#[from] JournalError),
    /// The server ended by itself.
    #[error("the server: {0}")]
    Server(std::io::Error),
}

/// A daemon that is open for requests.
pub struct Daemon<W: Workshop> {
    conductor: Conductor<W>,
    router: Router,
    listening: Listening,
    address: Address,
    closing: CancellationToken,
    // Let go of last.
    _lock: DaemonLock,
}

impl<W: Workshop> Daemon<W> {
    /// Takes the data folder's lock, opens the queue and the address. Nothing moves yet.
    pub async fn open(
        config: &Config,
        workshop: W,
        owner: OwnerHandle,
        shutdown: Shutdown,
    ) -> Result<Self, DaemonError> {
        let data = std::path::absolute(&config.data).unwrap_or_else(|_| config.data.clone());
        std::fs::create_dir_all(&data)
            .map_err(|error| DaemonError::Data { path: data.clone(), error })?;
        let lock = DaemonLock::take(&data)?;
        let (listening, address) = listen(&config.listen).await?;
        let (queue, interrupted) = Queue::open(&data.join("queue.sqlite"))?;
        let workshop = Arc::new(workshop);
        let clock = Arc::clone(&workshop);
        let book = Book::new(queue, Arc::new(move || clock.utc_now()));
        book.tell(Kind::DaemonStarted, None, &workshop.rig().name, None).await?;
        for id in interrupted {
            let text = "the daemon ended while it was under way";
            book.tell(Kind::Interrupted, Some(id), text, None).await?;
        }
        let (orders, waiting) = mpsc::channel(ORDERS);
        let (activity, watched) = watch::channel(Activity::default());
        let closing = CancellationToken::new();
        let desk = Desk::new(
            Arc::clone(&workshop),
            book.clone(),
            orders,
            watched,
            owner.watch(),
            closing.clone(),
            data,
        );
        let router = http::router(desk, matches!(address, Address::Tcp(_)));
        let conductor = Conductor::new(workshop, book, owner, waiting, activity, shutdown);
        Ok(Self { conductor, router, listening, address, closing, _lock: lock })
    }

    /// Where it listens: with port 0, the port that it got.
    pub fn address(&self) -> &Address {
        &self.address
    }

    /// Serves until a shutdown. When this returns the axes are at rest, the run that had the rig
    /// waits for a person, and everybody who watched has been told.
    pub async fn serve(self) -> Result<(), DaemonError> {
        let Self { conductor, router, listening, closing, .. } = self;
        let closed = closing.clone();
        let conducting = async {
            let conducted = conductor.conduct().await;
            closing.cancel();
            conducted
        };
        let grace = closed.clone().cancelled_owned();
        let serving = async {
            match listening {
                Listening::Tcp(listener) => {
                    axum::serve(listener, router).with_graceful_shutdown(grace).await
                }
                Listening::Unix(listener, _file) => {
                    axum::serve(listener, router).with_graceful_shutdown(grace).await
                }
            }
        };
        // A client that neither reads nor leaves must not keep the daemon.
        let serving = async {
            tokio::select! {
                biased;
                served = serving => served,
                () = async { closed.cancelled().await; tokio::time::sleep(CLOSE_WITHIN).await } => Ok(()),
            }
        };
        let (conducted, served) = tokio::join!(conducting, serving);
        conducted?;
        served.map_err(DaemonError::Server)
    }
}

/// What a person is asked to do before saying continue.
const fn question(source: Source) -> &'static str {
    match source {
        Source::Off => "switch the source off, then continue: dark readings follow",
        Source::On => "switch the source on again, then continue",
    }
}
