//! One appender a run: an advisory lock on a small file beside the journal.
//!
//! Not on the journal itself: closing any descriptor of a file drops the locks that SQLite holds
//! on it (SQLite, "How To Corrupt An SQLite Database File", section 2.2). The kernel lets go of
//! the lock when its process ends, however it ends, so a stale lock file does no harm.

use std::fs::{File, OpenOptions, TryLockError};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::JournalError;

/// Attempts against an owner that removes its lock file between our opening and locking it.
const ATTEMPTS_MAX: usize = 8;

/// Held for as long as this process may append.
#[derive(Debug)]
pub(super) struct AppendLock {
    path: PathBuf,
    // Holds the lock until it is closed.
    _file: File,
}

impl AppendLock {
    /// Locks the journal at `journal`, or says that another process has it.
    pub(super) fn take(journal: &Path) -> Result<Self, JournalError> {
        let mut path = journal.as_os_str().to_owned();
        path.push(".lock");
        let path = PathBuf::from(path);
        for _ in 0..ATTEMPTS_MAX {
            let file = OpenOptions::new()
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(|error| JournalError::io(&path, "make the lock file", &error))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => break,
                Err(TryLockError::Error(error)) => {
                    return Err(JournalError::io(&path, "lock", &error));
                }
            }
            if is_still_at(&file, &path) {
                return Ok(Self { path, _file: file });
            }
        }
        Err(JournalError::Locked { path: journal.to_owned() })
    }
}

impl Drop for AppendLock {
    fn drop(&mut self) {
        // While the lock is held, so that nobody else's file is removed. A file that stays behind
        // does no harm.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Whether `path` still names the file that was locked.
fn is_still_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(held), Ok(named)) => held.ino() == named.ino() && held.dev() == named.dev(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_lock_is_refused_until_the_first_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let journal = folder.path().join("run.sqlite");
        let first = AppendLock::take(&journal).unwrap();
        assert_eq!(
            AppendLock::take(&journal).unwrap_err(),
            JournalError::Locked { path: journal.clone() }
        );
        drop(first);
        AppendLock::take(&journal).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_stale_lock_file_does_no_harm() {
        let folder = tempfile::tempdir().unwrap();
        let journal = folder.path().join("run.sqlite");
        std::fs::write(folder.path().join("run.sqlite.lock"), "left by a killed process").unwrap();
        AppendLock::take(&journal).unwrap();
    }
}
