//! What can be wrong with a run file, named so that a person knows what to do about it.

use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;

/// Why a journal could not be made, opened, appended to or read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JournalError {
    /// A run's file is never overwritten: choose another folder, or resume this one.
    #[error("{}: exists already; a run is never overwritten (resume it, or choose another folder)", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// There is no such file: the folder is not a run's, or its journal was moved.
    #[error("{}: no such file; expected a run's folder with its journal", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// The process ended before the journal was complete, hence before anything was measured:
    /// start the run again.
    #[error("{}: empty; its run ended before anything was measured (start it again)", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Another kind of file: look for run.sqlite in the run's folder.
    #[error("{}: not a run's journal: {found}", path.display())]
    NotAJournal {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        found: String,
    },
    /// Written by another version of the program: use that version.
    #[error("{}: journal schema {found}, expected {expected}: written by another version of gonio", path.display())]
    Schema {
        /// The file.
        path: PathBuf,
        /// The version in the file.
        found: i64,
        /// The version that this program reads.
        expected: i64,
    },
    /// Truncated or damaged: restore it from a copy; nothing is written to it.
    #[error("{}: truncated or damaged: {detail}", path.display())]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// What was found.
        detail: String,
    },
    /// One process appends to a run at a time: wait for the other one, or stop it.
    #[error("{}: another process is appending to this run", path.display())]
    Locked {
        /// The file.
        path: PathBuf,
    },
    /// Free some space, then resume; whatever was reported as committed is safe.
    #[error("{}: disk full: {detail}", path.display())]
    DiskFull {
        /// The file.
        path: PathBuf,
        /// In the words of SQLite.
        detail: String,
    },
    /// The file system refused: permissions, a medium that went away, or one without the locks
    /// and shared memory that a write-ahead log needs.
    #[error("{}: {doing}: {detail}", path.display())]
    Storage {
        /// The file.
        path: PathBuf,
        /// What was being done.
        doing: &'static str,
        /// In the words of SQLite or of the operating system.
        detail: String,
    },
    /// Two different readings claim one place in the sequence: a defect in the device or in this
    /// program. The first stays, the second is not written.
    #[error("reading {id}: already in the journal with other contents; the first one stays")]
    Conflict {
        /// The reading's id.
        id: u32,
    },
    /// A number that is not finite does not go into a journal.
    #[error("{what}: {value} is not a finite number")]
    NotFinite {
        /// Which number of which record.
        what: String,
        /// How it prints.
        value: String,
    },
    /// Larger than the journal takes.
    #[error("{what}: {bytes} bytes are above the limit of {limit} bytes")]
    TooLarge {
        /// What.
        what: String,
        /// Its size.
        bytes: usize,
        /// The limit.
        limit: usize,
    },
    /// The disk has not kept up for thousands of records: it stalls, or is about to fail.
    #[error("the journal is {records} records behind: the disk does not keep up")]
    Behind {
        /// Records handed over and not yet committed.
        records: usize,
    },
    /// The owner thread ended without naming a cause: a defect in this program.
    #[error("the journal's writer has stopped")]
    Stopped,
}

impl JournalError {
    /// Names a failure of SQLite on `path` while `doing` something.
    pub(super) fn sqlite(path: &Path, doing: &'static str, error: &rusqlite::Error) -> Self {
        let path = path.to_owned();
        let detail = error.to_string();
        match error {
            rusqlite::Error::SqliteFailure(failure, _) => match failure.code {
                ErrorCode::DiskFull => Self::DiskFull { path, detail },
                ErrorCode::DatabaseCorrupt => Self::Corrupt { path, detail },
                ErrorCode::NotADatabase => Self::NotAJournal { path, found: detail },
                ErrorCode::SystemIoFailure => {
                    let detail = format!("{detail}; a full disk, a limit, or a medium that went?");
                    Self::Storage { path, doing, detail }
                }
                _ => Self::Storage { path, doing, detail },
            },
            // A row that does not hold what this program writes.
            rusqlite::Error::FromSqlConversionFailure(..)
            | rusqlite::Error::IntegralValueOutOfRange(..)
            | rusqlite::Error::InvalidColumnType(..)
            | rusqlite::Error::Utf8Error(..)
            | rusqlite::Error::QueryReturnedNoRows => Self::Corrupt { path, detail },
            _ => Self::Storage { path, doing, detail },
        }
    }

    /// Names a failure of the operating system on `path` while `doing` something.
    pub(super) fn io(path: &Path, doing: &'static str, error: &std::io::Error) -> Self {
        let path = path.to_owned();
        match error.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { path },
            std::io::ErrorKind::AlreadyExists => Self::Exists { path },
            std::io::ErrorKind::StorageFull => Self::DiskFull { path, detail: error.to_string() },
            _ => Self::Storage { path, doing, detail: error.to_string() },
        }
    }
}
