//! The tables, and the doors: how a connection is opened, and what is checked before it is
//! believed.
//!
//! Numbers are kept as SQLite keeps them, to the last bit, but for the sign of zero: -0 comes back
//! as 0.

use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags};

use super::JournalError;

/// Raised whenever a table changes.
pub(super) const VERSION: i64 = 4;

/// Version 1 had no sweeps; but for their tables it is the same.
const WITHOUT_SWEEPS: i64 = 1;

/// Version 2 had no rounds; but for their table it is the same.
const WITHOUT_ROUNDS: i64 = 2;

/// Version 3 had no rigs of several devices; but for their times it is the same.
const WITHOUT_DEVICE_TIMES: i64 = 3;

/// "GoNi": what `file` and SQLite call the application id.
pub(super) const APPLICATION_ID: i64 = 0x476f_4e69;

const PAGE_BYTES: u64 = 4096;

/// How long to wait while another connection checkpoints: it takes milliseconds.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// Axes are in the order theta, phi, x, y; positions in counts.
const TABLES: &str = "
CREATE TABLE meta (
    key TEXT NOT NULL PRIMARY KEY,
    value TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE inputs (
    position INTEGER PRIMARY KEY,
    role TEXT NOT NULL,
    name TEXT NOT NULL,
    bytes BLOB NOT NULL
) STRICT;
CREATE TABLE steps (
    position INTEGER PRIMARY KEY,
    id INTEGER NOT NULL UNIQUE,
    kind TEXT NOT NULL CHECK (kind IN ('dark', 'reference', 'warm_up', 'target')),
    target_index INTEGER,
    target_repeat INTEGER,
    x_m REAL,
    y_m REAL,
    theta_rad REAL,
    phi_rad REAL,
    axis_theta_rad REAL NOT NULL,
    axis_phi_rad REAL NOT NULL,
    axis_x_m REAL NOT NULL,
    axis_y_m REAL NOT NULL,
    theta INTEGER NOT NULL,
    phi INTEGER NOT NULL,
    x INTEGER NOT NULL,
    y INTEGER NOT NULL,
    via_theta INTEGER,
    via_phi INTEGER,
    via_x INTEGER,
    via_y INTEGER,
    settle_ns INTEGER NOT NULL,
    gain INTEGER NOT NULL,
    dwell_ns INTEGER NOT NULL,
    shutter TEXT NOT NULL CHECK (shutter IN ('closed', 'open')),
    source_off INTEGER NOT NULL CHECK (source_off IN (0, 1))
) STRICT;
CREATE TABLE sessions (
    number INTEGER PRIMARY KEY,
    boot_id INTEGER NOT NULL,
    started_s REAL NOT NULL,
    ended_s REAL,
    reason TEXT
) STRICT;
CREATE TABLE readings (
    position INTEGER PRIMARY KEY,
    id INTEGER NOT NULL UNIQUE,
    kind TEXT NOT NULL CHECK (kind IN ('dark', 'reference', 'warm_up', 'target')),
    target_index INTEGER,
    target_repeat INTEGER,
    gain INTEGER NOT NULL,
    n INTEGER NOT NULL,
    mean REAL NOT NULL,
    variance REAL NOT NULL,
    min INTEGER NOT NULL,
    max INTEGER NOT NULL,
    saturated INTEGER NOT NULL,
    commanded_theta INTEGER NOT NULL,
    commanded_phi INTEGER NOT NULL,
    commanded_x INTEGER NOT NULL,
    commanded_y INTEGER NOT NULL,
    start_theta INTEGER NOT NULL,
    start_phi INTEGER NOT NULL,
    start_x INTEGER NOT NULL,
    start_y INTEGER NOT NULL,
    end_theta INTEGER NOT NULL,
    end_phi INTEGER NOT NULL,
    end_x INTEGER NOT NULL,
    end_y INTEGER NOT NULL,
    start_us INTEGER NOT NULL,
    end_us INTEGER NOT NULL,
    time_s REAL NOT NULL,
    session INTEGER NOT NULL,
    link_retries INTEGER NOT NULL,
    unsettled INTEGER NOT NULL CHECK (unsettled IN (0, 1))
) STRICT;
CREATE TABLE events (
    position INTEGER PRIMARY KEY,
    session INTEGER NOT NULL,
    time_s REAL NOT NULL,
    kind TEXT NOT NULL,
    text TEXT NOT NULL
) STRICT;
CREATE TABLE reference_checks (
    position INTEGER PRIMARY KEY,
    session INTEGER NOT NULL,
    reading INTEGER NOT NULL,
    before REAL NOT NULL,
    after REAL NOT NULL,
    u_difference REAL NOT NULL,
    verdict TEXT NOT NULL
) STRICT;
";

/// What steps and readings have more that are windows of sweeps.
const SWEEPS: &str = "
CREATE {temporary} TABLE swept_steps (
    id INTEGER PRIMARY KEY,
    first INTEGER NOT NULL,
    count INTEGER NOT NULL,
    travel_theta INTEGER NOT NULL,
    travel_phi INTEGER NOT NULL,
    travel_x INTEGER NOT NULL,
    travel_y INTEGER NOT NULL,
    lead_ns INTEGER NOT NULL
) STRICT;
CREATE {temporary} TABLE swept_readings (
    id INTEGER PRIMARY KEY,
    travel_theta INTEGER NOT NULL,
    travel_phi INTEGER NOT NULL,
    travel_x INTEGER NOT NULL,
    travel_y INTEGER NOT NULL
) STRICT;
";

/// Decisions on the way, for runs whose sequence is not all fixed beforehand.
const ROUNDS: &str = "
CREATE {temporary} TABLE rounds (
    number INTEGER PRIMARY KEY,
    steps INTEGER NOT NULL,
    account TEXT NOT NULL
) STRICT;
";

/// What readings have more that several devices took together.
const DEVICE_TIMES: &str = "
CREATE {temporary} TABLE device_times (
    id INTEGER PRIMARY KEY,
    axes_s REAL,
    photometer_s REAL
) STRICT;
";

/// Before the first transaction.
pub(super) fn set_page_size(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "page_size", PAGE_BYTES.cast_signed())
}

/// Creates the tables in an open transaction, and marks the file as a journal.
pub(super) fn create(connection: &Connection) -> rusqlite::Result<()> {
    connection.execute_batch(TABLES)?;
    for tables in [SWEEPS, ROUNDS, DEVICE_TIMES] {
        connection.execute_batch(&tables.replace("{temporary}", ""))?;
    }
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    connection.pragma_update(None, "user_version", VERSION)
}

/// Opens the file for appending. What is in it is not looked at.
pub(super) fn connect(path: &Path) -> Result<Connection, JournalError> {
    open(path, path, OpenFlags::SQLITE_OPEN_READ_WRITE)
}

/// Opens the file for reading, also where the medium or the folder is read-only. Leaves nothing
/// beside it: a journal without a log and without a writer's lock stands as it is, while a reader
/// of another kind would make a log of its own, which only a writer may take away again.
pub(super) fn connect_read_only(path: &Path) -> Result<Connection, JournalError> {
    let immutable = || {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI;
        open(path, immutable_uri(path), flags)
    };
    let is_beside = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        Path::new(&name).exists()
    };
    if !is_beside("-wal") && !is_beside(".lock") {
        return immutable();
    }
    let connection = open(path, path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
    let probe = connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()));
    match probe {
        // A write-ahead log wants a file beside the journal; without one nobody is writing, and
        // the file stands as it is.
        Err(rusqlite::Error::SqliteFailure(failure, _))
            if failure.code == rusqlite::ErrorCode::CannotOpen
                || failure.code == rusqlite::ErrorCode::ReadOnly =>
        {
            immutable()
        }
        _ => Ok(connection),
    }
}

/// Says whether the file is there, without opening it: closing any descriptor of a file drops the
/// locks that SQLite holds on it for other connections of this process (SQLite, "How To Corrupt
/// An SQLite Database File", section 2.2).
fn check_exists(path: &Path) -> Result<(), JournalError> {
    let metadata =
        std::fs::metadata(path).map_err(|error| JournalError::io(path, "open", &error))?;
    if metadata.is_file() {
        return Ok(());
    }
    let found = "it is not a file".to_owned();
    Err(JournalError::NotAJournal { path: path.to_owned(), found })
}

/// Refuses other applications' databases, other schemas, and creations that were cut short.
pub(super) fn check(path: &Path, connection: &Connection) -> Result<(), JournalError> {
    let fail = |error| JournalError::sqlite(path, "read the journal's header", &error);
    let tables: i64 = connection
        .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
        .map_err(fail)?;
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
    let application_id = pragma("application_id").map_err(fail)?;
    if tables == 0 && application_id == 0 {
        return Err(JournalError::Empty { path: path.to_owned() });
    }
    if application_id != APPLICATION_ID {
        let found = format!("an SQLite file of another program (application id {application_id})");
        return Err(JournalError::NotAJournal { path: path.to_owned(), found });
    }
    let found = pragma("user_version").map_err(fail)?;
    let missing: &[&str] = match found {
        VERSION => &[],
        WITHOUT_DEVICE_TIMES => &[DEVICE_TIMES],
        WITHOUT_ROUNDS => &[ROUNDS, DEVICE_TIMES],
        WITHOUT_SWEEPS => &[SWEEPS, ROUNDS, DEVICE_TIMES],
        _ => {
            let path = path.to_owned();
            return Err(JournalError::Schema { path, found, expected: VERSION });
        }
    };
    if !missing.is_empty() {
        connection.execute_batch("PRAGMA temp_store = MEMORY;").map_err(fail)?;
    }
    for tables in missing {
        // Empty, for this connection alone, so that one way of reading does for all.
        let empty = tables.replace("{temporary}", "TEMPORARY");
        connection.execute_batch(&empty).map_err(fail)?;
    }
    check_length(path)
}

/// Refuses a file that was cut off inside its last page. SQLite would read zeros there, and so
/// take the last readings for others. While a log holds the pages, the file may be behind it.
fn check_length(path: &Path) -> Result<(), JournalError> {
    let mut log = path.as_os_str().to_owned();
    log.push("-wal");
    if std::fs::metadata(log).is_ok_and(|log| log.len() > 0) {
        return Ok(());
    }
    let bytes =
        std::fs::metadata(path).map_err(|error| JournalError::io(path, "open", &error))?.len();
    if bytes.is_multiple_of(PAGE_BYTES) {
        return Ok(());
    }
    let detail = format!("{bytes} bytes are not a whole number of pages of {PAGE_BYTES}");
    Err(JournalError::Corrupt { path: path.to_owned(), detail })
}

/// Reads every page once; the cost is that of reading the file.
pub(super) fn check_pages(path: &Path, connection: &Connection) -> Result<(), JournalError> {
    let finding: String = connection
        .query_row("PRAGMA quick_check(1)", [], |row| row.get(0))
        .map_err(|error| JournalError::sqlite(path, "check the journal", &error))?;
    if finding == "ok" {
        return Ok(());
    }
    Err(JournalError::Corrupt { path: path.to_owned(), detail: finding })
}

/// Durability: a write-ahead log, synced at every commit.
pub(super) fn make_durable(path: &Path, connection: &Connection) -> Result<(), JournalError> {
    let fail = |error| JournalError::sqlite(path, "turn on the write-ahead log", &error);
    let mode: String = connection
        .pragma_update_and_check(None, "journal_mode", "wal", |row| row.get(0))
        .map_err(fail)?;
    if mode != "wal" {
        return Err(JournalError::Storage {
            path: path.to_owned(),
            doing: "turn on the write-ahead log",
            detail: format!("this file system offers \"{mode}\" only; use a local disk"),
        });
    }
    connection.pragma_update(None, "synchronous", "full").map_err(fail)
}

/// Opens `name`, which is `path` or its URI.
fn open(path: &Path, name: impl AsRef<Path>, flags: OpenFlags) -> Result<Connection, JournalError> {
    let fail = |error| JournalError::sqlite(path, "open", &error);
    check_exists(path)?;
    // A connection is used by one thread at a time: its owner is not `Sync`.
    let flags = flags | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(name, flags).map_err(fail)?;
    connection.busy_timeout(BUSY_TIMEOUT).map_err(fail)?;
    connection
        .execute_batch("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;")
        .map_err(fail)?;
    Ok(connection)
}

/// `path` as SQLite's URI of a file that nobody changes.
fn immutable_uri(path: &Path) -> String {
    use std::fmt::Write as _;
    use std::os::unix::ffi::OsStrExt as _;
    let mut uri = String::from("file:");
    for &byte in path.as_os_str().as_bytes() {
        if byte.is_ascii_alphanumeric() || b"/._-".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            // Writing to a string does not fail.
            let _ = write!(uri, "%{byte:02x}");
        }
    }
    uri.push_str("?immutable=1");
    uri
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_nobody_may_lock_is_read_as_it_stands() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("odd näme?#%&immutable=0.sqlite");
        std::fs::write(&path, b"").unwrap();
        let connection = connect(&path).unwrap();
        create(&connection).unwrap();
        drop(connection);
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI;
        let connection = open(&path, immutable_uri(&path), flags).unwrap();
        check(&path, &connection).unwrap();
    }
}
