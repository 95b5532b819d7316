//! The daemon's queue: which runs were asked for, in what state they are, and what happened, in
//! an SQLite file that survives a restart. It knows a run by its number, its folder and the
//! bytes of its plan; it does not know what a plan says.
//!
//! A run that was under way when the daemon died is `interrupted` when the queue is opened
//! again: motion never resumes by itself, so it waits for a person.

use std::path::{Path, PathBuf};

use rusqlite::{Connection, OptionalExtension as _, Row, params};

use super::{JournalError, schema};

/// Raised whenever a table changes.
const VERSION: i64 = 1;
/// "GoQu".
const APPLICATION_ID: i64 = 0x476f_5175;
/// Older events are forgotten: a watcher that is further behind asks for the status.
const EVENTS_KEPT: i64 = 10_000;

const TABLES: &str = "
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    name TEXT NOT NULL,
    folder TEXT NOT NULL,
    bundle BLOB NOT NULL,
    submitted_utc TEXT NOT NULL,
    state TEXT NOT NULL,
    detail TEXT NOT NULL
) STRICT;
CREATE TABLE events (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    body TEXT NOT NULL
) STRICT;
";

/// How a run of the queue stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QueueState {
    /// Ended for good by a person; what was measured is kept.
    Aborted,
    /// Everything measured.
    Complete,
    /// Could not start, or ended with targets missing.
    Failed,
    /// Was under way when the daemon ended; waits for an explicit continue.
    Interrupted,
    /// At rest by a person's wish; waits for an explicit continue.
    Paused,
    /// Waits for its turn.
    Queued,
    /// Under way.
    Running,
}

const STATES: [(QueueState, &str); 7] = [
    (QueueState::Aborted, "aborted"),
    (QueueState::Complete, "complete"),
    (QueueState::Failed, "failed"),
    (QueueState::Interrupted, "interrupted"),
    (QueueState::Paused, "paused"),
    (QueueState::Queued, "queued"),
    (QueueState::Running, "running"),
];

impl QueueState {
    /// The word in the file, the API and messages.
    pub fn name(self) -> &'static str {
        STATES.iter().find(|(state, _)| *state == self).map_or("", |(_, name)| name)
    }

    /// Whether nothing will change it any more.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Aborted | Self::Complete | Self::Failed)
    }

    fn from_name(name: &str) -> Option<Self> {
        STATES.iter().find(|(_, known)| *known == name).map(|(state, _)| *state)
    }
}

/// One run of the queue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueuedRun {
    /// Its number, from 1.
    pub id: i64,
    /// The plan's name.
    pub name: String,
    /// Where its folder is, or will be.
    pub folder: PathBuf,
    /// When it was submitted, as text.
    pub submitted_utc: String,
    /// How it stands.
    pub state: QueueState,
    /// Why it stands so, for a person; may be empty.
    pub detail: String,
}

/// The queue's file, open. One process owns it: the daemon that holds the rig's lock.
#[derive(Debug)]
pub struct Queue {
    path: PathBuf,
    connection: Connection,
}

impl Queue {
    /// Opens the queue, or makes it. Runs that were under way are interrupted from now on; their
    /// numbers are in the second value.
    pub fn open(path: &Path) -> Result<(Self, Vec<i64>), JournalError> {
        let fail = |error| JournalError::sqlite(path, "open the queue", &error);
        let connection = Connection::open(path).map_err(fail)?;
        schema::make_durable(path, &connection)?;
        let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
        let (application_id, version) =
            (pragma("application_id").map_err(fail)?, pragma("user_version").map_err(fail)?);
        let tables: i64 = connection
            .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
            .map_err(fail)?;
        if tables == 0 {
            connection
                .execute_batch(&format!(
                    "BEGIN IMMEDIATE; {TABLES} PRAGMA application_id = {APPLICATION_ID};
                     PRAGMA user_version = {VERSION}; COMMIT;"
                ))
                .map_err(fail)?;
        } else if application_id != APPLICATION_ID {
            let found =
                format!("an SQLite file of another program (application id {application_id})");
            return Err(JournalError::NotAJournal { path: path.to_owned(), found });
        } else if version != VERSION {
            let path = path.to_owned();
            return Err(JournalError::Schema { path, found: version, expected: VERSION });
        }
        let queue = Self { path: path.to_owned(), connection };
        let interrupted = queue.interrupt_unfinished()?;
        Ok((queue, interrupted))
    }

    /// Puts a run at the end of the queue, durably, and answers its number. `folder` is made from
    /// the number, which only the queue can give.
    pub fn submit(
        &mut self,
        name: &str,
        bundle: &[u8],
        submitted_utc: &str,
        folder: impl FnOnce(i64) -> PathBuf,
    ) -> Result<QueuedRun, JournalError> {
        let path = self.path.clone();
        let fail = |error| JournalError::sqlite(&path, "submit a run", &error);
        let transaction = self.connection.transaction().map_err(fail)?;
        transaction
            .execute(
                "INSERT INTO runs (name, folder, bundle, submitted_utc, state, detail)
                 VALUES (?1, '', ?2, ?3, 'queued', '')",
                params![name, bundle, submitted_utc],
            )
            .map_err(fail)?;
        let id = transaction.last_insert_rowid();
        let folder = folder(id);
        let text = folder.to_string_lossy();
        transaction
            .execute("UPDATE runs SET folder = ?1 WHERE id = ?2", params![text, id])
            .map_err(fail)?;
        transaction.commit().map_err(fail)?;
        Ok(QueuedRun {
            id,
            name: name.to_owned(),
            folder,
            submitted_utc: submitted_utc.to_owned(),
            state: QueueState::Queued,
            detail: String::new(),
        })
    }

    /// All runs, oldest first.
    pub fn runs(&self) -> Result<Vec<QueuedRun>, JournalError> {
        let fail = |error| JournalError::sqlite(&self.path, "list the runs", &error);
        let sql = "SELECT id, name, folder, submitted_utc, state, detail FROM runs ORDER BY id";
        let mut statement = self.connection.prepare_cached(sql).map_err(fail)?;
        let rows = statement.query_map([], read_run).map_err(fail)?;
        rows.collect::<Result<_, _>>().map_err(fail)
    }

    /// One run, if there is such a number.
    pub fn run(&self, id: i64) -> Result<Option<QueuedRun>, JournalError> {
        Ok(self.runs()?.into_iter().find(|run| run.id == id))
    }

    /// What was submitted with a run, byte for byte.
    pub fn bundle(&self, id: i64) -> Result<Option<Vec<u8>>, JournalError> {
        self.connection
            .query_row("SELECT bundle FROM runs WHERE id = ?1", [id], |row| row.get(0))
            .optional()
            .map_err(|error| JournalError::sqlite(&self.path, "read a run", &error))
    }

    /// The run whose turn it is: the oldest that waits.
    pub fn next(&self) -> Result<Option<QueuedRun>, JournalError> {
        Ok(self.runs()?.into_iter().find(|run| run.state == QueueState::Queued))
    }

    /// Notes how a run stands, durably.
    pub fn set_state(&self, id: i64, state: QueueState, detail: &str) -> Result<(), JournalError> {
        self.connection
            .execute(
                "UPDATE runs SET state = ?1, detail = ?2 WHERE id = ?3",
                params![state.name(), detail, id],
            )
            .map(|_| ())
            .map_err(|error| JournalError::sqlite(&self.path, "note a run's state", &error))
    }

    /// Notes an event (one JSON document) and answers its sequence number, which never repeats.
    pub fn record_event(&self, body: &str) -> Result<i64, JournalError> {
        let fail = |error| JournalError::sqlite(&self.path, "note an event", &error);
        self.connection.execute("INSERT INTO events (body) VALUES (?1)", [body]).map_err(fail)?;
        let sequence = self.connection.last_insert_rowid();
        self.connection
            .execute("DELETE FROM events WHERE sequence <= ?1", [sequence - EVENTS_KEPT])
            .map_err(fail)?;
        Ok(sequence)
    }

    /// The number of the latest event; 0 if nothing ever happened.
    pub fn latest_event(&self) -> Result<i64, JournalError> {
        self.connection
            .query_row("SELECT coalesce(max(sequence), 0) FROM events", [], |row| row.get(0))
            .map_err(|error| JournalError::sqlite(&self.path, "read events", &error))
    }

    /// Events after a sequence number, oldest first, at most `limit`.
    pub fn events_after(&self, after: i64, limit: u32) -> Result<Vec<(i64, String)>, JournalError> {
        let fail = |error| JournalError::sqlite(&self.path, "read events", &error);
        let sql =
            "SELECT sequence, body FROM events WHERE sequence > ?1 ORDER BY sequence LIMIT ?2";
        let mut statement = self.connection.prepare_cached(sql).map_err(fail)?;
        let rows = statement
            .query_map(params![after, limit], |row| Ok((row.get(0)?, row.get(1)?)))
            .map_err(fail)?;
        rows.collect::<Result<_, _>>().map_err(fail)
    }

    fn interrupt_unfinished(&self) -> Result<Vec<i64>, JournalError> {
        let under_way: Vec<i64> = self
            .runs()?
            .into_iter()
            .filter(|run| matches!(run.state, QueueState::Running | QueueState::Paused))
            .map(|run| run.id)
            .collect();
        for id in &under_way {
            self.set_state(
                *id,
                QueueState::Interrupted,
                "the daemon ended while it was under way",
            )?;
        }
        Ok(under_way)
    }
}

fn read_run(row: &Row<'_>) -> rusqlite::Result<QueuedRun> {
    let state: String = row.get(4)?;
    let state = QueueState::from_name(&state).ok_or_else(|| {
        rusqlite::Error::InvalidColumnType(4, "state".into(), rusqlite::types::Type::Text)
    })?;
    let folder: String = row.get(2)?;
    Ok(QueuedRun {
        id: row.get(0)?,
        name: row.get(1)?,
        folder: folder.into(),
        submitted_utc: row.get(3)?,
        state,
        detail: row.get(5)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submit(queue: &mut Queue, name: &str) -> i64 {
        let folder = |id| PathBuf::from(format!("{id}-{name}"));
        queue.submit(name, name.as_bytes(), "2026-11-22T00:00:00Z", folder).unwrap().id
    }

    #[test]
    fn a_restart_keeps_the_queue_and_interrupts_what_was_under_way() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("queue.sqlite");
        let (mut queue, interrupted) = Queue::open(&path).unwrap();
        assert!(interrupted.is_empty());
        let ids = ["a", "b", "c"].map(|name| submit(&mut queue, name));
        queue.set_state(ids[0], QueueState::Complete, "").unwrap();
        queue.set_state(ids[1], QueueState::Running, "").unwrap();
        let event = queue.record_event("{}").unwrap();
        drop(queue);

        let (queue, interrupted) = Queue::open(&path).unwrap();
        assert_eq!(interrupted, [ids[1]]);
        let states: Vec<_> = queue.runs().unwrap().iter().map(|run| run.state).collect();
        assert_eq!(states, [QueueState::Complete, QueueState::Interrupted, QueueState::Queued]);
        assert_eq!(queue.next().unwrap().unwrap().id, ids[2]);
        assert_eq!(queue.bundle(ids[2]).unwrap().unwrap(), b"c");
        assert_eq!(queue.events_after(event - 1, 10).unwrap(), [(event, "{}".to_owned())]);
        assert!(queue.record_event("{}").unwrap() > event);
    }

    #[test]
    fn another_programs_file_is_not_taken_for_a_queue() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("queue.sqlite");
        std::fs::write(&path, "not a database, but long enough to be looked at as one").unwrap();
        assert!(matches!(Queue::open(&path), Err(JournalError::NotAJournal { .. })));
    }

    #[test]
    fn every_state_has_a_word_of_its_own() {
        for (state, name) in STATES {
            assert_eq!(QueueState::from_name(name), Some(state));
            assert_eq!(state.name(), name);
        }
    }
}
