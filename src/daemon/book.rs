//! The queue's file as tasks use it: every call on a thread that may wait for the disk, and a
//! number that rises whenever something was noted.

use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::watch;

use super::notice::{Kind, Notice, Progress};
use crate::journal::{JournalError, Queue, QueueState, QueuedRun};

/// Shared by all who read or write the queue.
#[derive(Clone)]
pub(super) struct Book {
    queue: Arc<Mutex<Queue>>,
    latest: Arc<watch::Sender<i64>>,
    utc_now: Arc<dyn Fn() -> String + Send + Sync>,
}

impl Book {
    pub(super) fn new(queue: Queue, utc_now: Arc<dyn Fn() -> String + Send + Sync>) -> Self {
        let (latest, _) = watch::channel(0);
        Self { queue: Arc::new(Mutex::new(queue)), latest: Arc::new(latest), utc_now }
    }

    /// The number of the latest notice since the daemon started; changes with each.
    pub(super) fn latest(&self) -> watch::Receiver<i64> {
        self.latest.subscribe()
    }

    /// The wall time now.
    pub(super) fn utc_now(&self) -> String {
        (self.utc_now)()
    }

    /// Does something with the queue on a thread that may wait.
    pub(super) async fn with<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Queue) -> Result<T, JournalError> + Send + 'static,
    ) -> Result<T, JournalError> {
        let queue = Arc::clone(&self.queue);
        // Every change is a transaction: what a panic left behind is whole.
        let locked = move || work(&mut queue.lock().unwrap_or_else(PoisonError::into_inner));
        tokio::task::spawn_blocking(locked).await.unwrap_or(Err(JournalError::Stopped))
    }

    pub(super) async fn run(&self, id: i64) -> Result<Option<QueuedRun>, JournalError> {
        self.with(move |queue| queue.run(id)).await
    }

    /// Notes how a run stands, and tells.
    pub(super) async fn set_state(
        &self,
        id: i64,
        state: QueueState,
        kind: Kind,
        text: &str,
    ) -> Result<(), JournalError> {
        let detail = text.to_owned();
        self.with(move |queue| queue.set_state(id, state, &detail)).await?;
        self.tell(kind, Some(id), text, None).await
    }

    /// Notes that something happened.
    pub(super) async fn tell(
        &self,
        kind: Kind,
        run: Option<i64>,
        text: &str,
        progress: Option<Progress>,
    ) -> Result<(), JournalError> {
        let notice =
            Notice { kind, time_utc: self.utc_now(), run, text: text.to_owned(), progress };
        let body = serde_json::to_string(&notice).unwrap_or_default();
        let sequence = self.with(move |queue| queue.record_event(&body)).await?;
        self.latest.send_if_modified(|latest| {
            let is_newer = sequence > *latest;
            *latest = sequence.max(*latest);
            is_newer
        });
        Ok(())
    }
}
