//! Between an engine that must not wait and a disk that makes it wait.
//!
//! [`Writer::inline`] is for virtual time: it commits on the caller's thread, by count and at
//! every flush, so that a run's outcome doesn't depend on how fast the disk was. Records that are
//! not committed when the process dies are measured again.
//!
//! [`Writer::threaded`] is for real time: a slow sync on the engine's thread would let the
//! device's lease run out. Its owner thread commits whatever has gathered as soon as the commit
//! before it is done, so that a record waits for at most one commit, and needs no clock.

use std::sync::mpsc;
use std::thread::JoinHandle;

use tokio::sync::{oneshot, watch};

use super::{Journal, JournalError, Record};

/// Records in one transaction, at most.
const BATCH_RECORDS: usize = 512;
/// Records handed over and not yet committed, at most: tens of seconds of readings. Whoever is
/// further ahead has a disk that stalls.
const WAITING_RECORDS: usize = 4096;
/// Room for flushes beside them.
const FLUSHES: usize = 16;

/// How far the journal is.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Progress {
    /// Records that are durable, of those pushed; they are committed in the order of pushing.
    pub committed: u64,
    /// Readings among them that are new.
    pub readings: u64,
    /// Readings among them that were in the journal already, identical.
    pub duplicates: u64,
    /// Why nothing more is written. The run must stop.
    pub failure: Option<JournalError>,
}

/// Takes records one by one, makes them durable in batches, and says which are.
#[derive(Debug)]
pub struct Writer {
    pushed: u64,
    progress: watch::Receiver<Progress>,
    form: Form,
}

#[derive(Debug)]
enum Form {
    Inline {
        ledger: Ledger,
        waiting: Vec<Record>,
    },
    Threaded {
        orders: Option<mpsc::SyncSender<Order>>,
        thread: Option<JoinHandle<Option<Journal>>>,
    },
}

enum Order {
    Append(Record),
    /// Answered once everything before it is durable, or never.
    Flush(oneshot::Sender<()>),
}

impl Writer {
    /// Commits on the caller's thread: at every 512 records and at every flush.
    pub fn inline(journal: Journal) -> Self {
        let (ledger, progress) = Ledger::new(journal);
        Self { pushed: 0, progress, form: Form::Inline { ledger, waiting: Vec::new() } }
    }

    /// Commits on a thread of its own, at once.
    pub fn threaded(journal: Journal) -> Result<Self, JournalError> {
        let path = journal.path().to_owned();
        let (ledger, progress) = Ledger::new(journal);
        let (orders, inbox) = mpsc::sync_channel(WAITING_RECORDS + FLUSHES);
        let thread = std::thread::Builder::new()
            .name("journal".to_owned())
            .spawn(move || own(ledger, &inbox))
            .map_err(|error| JournalError::io(&path, "start the journal's thread", &error))?;
        let form = Form::Threaded { orders: Some(orders), thread: Some(thread) };
        Ok(Self { pushed: 0, progress, form })
    }

    /// Hands a record over without waiting. It is not durable yet: [`Writer::progress`] says when.
    /// An error is final, and names why the run must stop.
    pub fn push(&mut self, record: Record) -> Result<(), JournalError> {
        let behind = self.waiting() >= WAITING_RECORDS as u64;
        match &mut self.form {
            Form::Inline { ledger, waiting } => {
                ledger.check()?;
                waiting.push(record);
                self.pushed += 1;
                if waiting.len() >= BATCH_RECORDS { ledger.commit(waiting) } else { Ok(()) }
            }
            Form::Threaded { orders, .. } => {
                if behind {
                    return Err(JournalError::Behind { records: WAITING_RECORDS });
                }
                send(orders.as_ref(), Order::Append(record), &self.progress)?;
                self.pushed += 1;
                Ok(())
            }
        }
    }

    /// Makes everything pushed so far durable, and returns when it is.
    pub async fn flush(&mut self) -> Result<(), JournalError> {
        match &mut self.form {
            Form::Inline { ledger, waiting } => ledger.commit(waiting),
            Form::Threaded { orders, .. } => {
                let (done, flushed) = oneshot::channel();
                send(orders.as_ref(), Order::Flush(done), &self.progress)?;
                flushed.await.map_err(|_| failure(&self.progress))
            }
        }
    }

    /// Records pushed and not yet durable. An engine that keeps this small loses little.
    pub fn waiting(&self) -> u64 {
        self.pushed.saturating_sub(self.progress.borrow().committed)
    }

    /// How far the journal is; changes with every commit and on failure.
    pub fn progress(&self) -> watch::Receiver<Progress> {
        self.progress.clone()
    }

    /// Makes everything durable and gives the journal back. May wait for the disk.
    pub async fn finish(mut self) -> Result<Journal, JournalError> {
        self.flush().await?;
        match &mut self.form {
            Form::Inline { ledger, .. } => ledger.journal.take().ok_or(JournalError::Stopped),
            Form::Threaded { orders, thread } => {
                drop(orders.take());
                let ended = thread.take().and_then(|thread| thread.join().ok());
                ended.flatten().ok_or(JournalError::Stopped)
            }
        }
    }
}

impl Drop for Writer {
    /// Commits what it still can. What could not be committed never counted.
    fn drop(&mut self) {
        match &mut self.form {
            Form::Inline { ledger, waiting } => {
                let _ = ledger.commit(waiting);
            }
            Form::Threaded { orders, thread } => {
                drop(orders.take());
                if let Some(thread) = thread.take() {
                    let _ = thread.join();
                }
            }
        }
    }
}

fn send(
    orders: Option<&mpsc::SyncSender<Order>>,
    order: Order,
    progress: &watch::Receiver<Progress>,
) -> Result<(), JournalError> {
    let Some(orders) = orders else { return Err(JournalError::Stopped) };
    orders.try_send(order).map_err(|refused| match refused {
        mpsc::TrySendError::Full(_) => JournalError::Behind { records: WAITING_RECORDS },
        mpsc::TrySendError::Disconnected(_) => failure(progress),
    })
}

fn failure(progress: &watch::Receiver<Progress>) -> JournalError {
    progress.borrow().failure.clone().unwrap_or(JournalError::Stopped)
}

/// The journal and its published progress.
#[derive(Debug)]
struct Ledger {
    // `None` once it was given back.
    journal: Option<Journal>,
    progress: watch::Sender<Progress>,
}

impl Ledger {
    fn new(journal: Journal) -> (Self, watch::Receiver<Progress>) {
        let (progress, receiver) = watch::channel(Progress::default());
        (Self { journal: Some(journal), progress }, receiver)
    }

    fn check(&self) -> Result<(), JournalError> {
        match &self.progress.borrow().failure {
            None => Ok(()),
            Some(failure) => Err(failure.clone()),
        }
    }

    /// Commits and empties `waiting`; after a failure nothing is written any more.
    fn commit(&mut self, waiting: &mut Vec<Record>) -> Result<(), JournalError> {
        self.check()?;
        if waiting.is_empty() {
            return Ok(());
        }
        let Some(journal) = &mut self.journal else { return Err(JournalError::Stopped) };
        match journal.append(waiting) {
            Ok(appended) => {
                self.progress.send_modify(|progress| {
                    progress.committed += waiting.len() as u64;
                    progress.readings += appended.readings as u64;
                    progress.duplicates += appended.duplicates.len() as u64;
                });
                waiting.clear();
                Ok(())
            }
            Err(error) => {
                self.progress.send_modify(|progress| progress.failure = Some(error.clone()));
                Err(error)
            }
        }
    }
}

/// The owner thread: gather, commit, answer, until nobody can send any more or the disk fails.
fn own(mut ledger: Ledger, inbox: &mpsc::Receiver<Order>) -> Option<Journal> {
    let mut waiting = Vec::with_capacity(BATCH_RECORDS);
    let mut flushes = Vec::new();
    while let Ok(first) = inbox.recv() {
        let more = std::iter::from_fn(|| inbox.try_recv().ok());
        for order in std::iter::once(first).chain(more).take(BATCH_RECORDS) {
            match order {
                Order::Append(record) => waiting.push(record),
                Order::Flush(done) => flushes.push(done),
            }
        }
        if ledger.commit(&mut waiting).is_err() {
            break;
        }
        for done in flushes.drain(..) {
            // Whoever asked may have gone.
            let _ = done.send(());
        }
    }
    ledger.journal
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Folder, fill_the_disk_of, reading, records};
    use super::*;

    #[test]
    fn an_inline_writer_commits_by_count_and_at_a_flush() {
        let folder = Folder::new();
        let mut writer = Writer::inline(folder.journal());
        let progress = writer.progress();
        for record in records(0..511) {
            writer.push(record).unwrap();
        }
        assert_eq!((progress.borrow().committed, writer.waiting()), (0, 511));
        writer.push(Record::Reading(reading(511))).unwrap();
        assert_eq!((progress.borrow().committed, writer.waiting()), (512, 0));
        writer.push(Record::Reading(reading(0))).unwrap();
        block_on(writer.flush()).unwrap();
        let expected = Progress { committed: 513, readings: 512, duplicates: 1, failure: None };
        assert_eq!(*progress.borrow(), expected);
        let journal = block_on(writer.finish()).unwrap();
        assert_eq!(journal.reader().reading_count().unwrap(), 512);
    }

    #[test]
    fn a_threaded_writer_commits_unasked_and_answers_a_flush() {
        let folder = Folder::new();
        let mut writer = Writer::threaded(folder.journal()).unwrap();
        let mut progress = writer.progress();
        writer.push(Record::Reading(reading(0))).unwrap();
        block_on(progress.wait_for(|progress| progress.committed == 1)).unwrap();
        for record in records(0..3000) {
            writer.push(record).unwrap();
        }
        block_on(writer.flush()).unwrap();
        assert_eq!(progress.borrow().readings, 3000);
        assert_eq!(progress.borrow().duplicates, 1);
        let journal = block_on(writer.finish()).unwrap();
        assert_eq!(journal.reader().reading_count().unwrap(), 3000);
    }

    #[test]
    fn a_dropped_writer_commits_what_it_has() {
        for threaded in [false, true] {
            let folder = Folder::new();
            let journal = folder.journal();
            let mut writer =
                if threaded { Writer::threaded(journal).unwrap() } else { Writer::inline(journal) };
            for record in records(0..10) {
                writer.push(record).unwrap();
            }
            drop(writer);
            let journal = Journal::open(&folder.path()).unwrap();
            assert_eq!(journal.reader().reading_count().unwrap(), 10, "threaded: {threaded}");
        }
    }

    #[test]
    fn a_writer_names_a_full_disk_and_takes_nothing_more() {
        for threaded in [false, true] {
            let folder = Folder::new();
            let journal = folder.journal();
            fill_the_disk_of(&journal);
            let mut writer =
                if threaded { Writer::threaded(journal).unwrap() } else { Writer::inline(journal) };
            let progress = writer.progress();
            let pushed = records(0..2000).into_iter().try_for_each(|record| writer.push(record));
            let error = pushed.and_then(|()| block_on(writer.flush())).unwrap_err();
            assert!(matches!(error, JournalError::DiskFull { .. }), "{error}");
            assert_eq!(progress.borrow().failure, Some(error.clone()));
            assert_eq!(writer.push(Record::Reading(reading(0))).unwrap_err(), error);
            assert_eq!(block_on(writer.flush()).unwrap_err(), error);
            let committed = progress.borrow().readings;
            assert_eq!(block_on(writer.finish()).unwrap_err(), error);
            let journal = Journal::open(&folder.path()).unwrap();
            assert_eq!(journal.reader().reading_count().unwrap(), committed);
        }
    }

    /// Real time, no paused clock: the owner thread is outside of the runtime.
    fn block_on<F: Future>(future: F) -> F::Output {
        tokio::runtime::Builder::new_current_thread().build().unwrap().block_on(future)
    }
}
