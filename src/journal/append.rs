//! The journal as its one appender sees it.

use std::fs::{File, OpenOptions};
use std::path::Path;

use rusqlite::{Connection, Transaction, TransactionBehavior, params};

use super::lock::AppendLock;
use super::{Header, Input, JournalError, Reader, Record, read, schema, steps};
use crate::plan::Step;
use crate::rig::{DeviceTimes, Latched, Reading, ReadingKind};

/// The largest input file that a journal takes, bytes.
const INPUT_BYTES_MAX: usize = 64 << 20;
/// The longest text of an event or a reason, bytes; longer ones are cut.
const TEXT_BYTES_MAX: usize = 4096;

const INSERT_READING: &str = "
INSERT INTO readings (id, kind, target_index, target_repeat, gain, n, mean, variance, min, max,
    saturated, commanded_theta, commanded_phi, commanded_x, commanded_y, start_theta, start_phi,
    start_x, start_y, end_theta, end_phi, end_x, end_y, start_us, end_us, time_s, session,
    link_retries, unsettled)
VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20,
    ?21, ?22, ?23, ?24, ?25, ?26, ?27, ?28, ?29)
ON CONFLICT (id) DO NOTHING";

/// A run's file, open for appending. One process holds it at a time.
#[derive(Debug)]
pub struct Journal {
    reader: Reader,
    // Dropped after the connection.
    _lock: AppendLock,
}

/// What one transaction wrote.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Appended {
    /// Readings that are new.
    pub readings: usize,
    /// Ids of readings that were there already, identical to the last bit; they stand once.
    pub duplicates: Vec<u32>,
}

impl Journal {
    /// Makes the file, with all that is known before anything moves. Once this returns the run
    /// can be resumed from the file alone. A file that exists is refused.
    pub fn create(
        path: &Path,
        header: &Header,
        inputs: &[Input],
        steps: &[Step],
    ) -> Result<Self, JournalError> {
        check_inputs(inputs)?;
        let lock = AppendLock::take(path)?;
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(path)
            .map_err(|error| JournalError::io(path, "create", &error))?;
        match begin(path, header, inputs, steps) {
            Ok(connection) => Ok(Self { reader: Reader::new(path, connection), _lock: lock }),
            Err(error) => {
                // Ours, made a moment ago, and without a run in it.
                let _ = std::fs::remove_file(path);
                Err(error)
            }
        }
    }

    /// Opens an interrupted run's file to carry it on; every page is checked first.
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        // Asked first: a lock file must not appear beside what is not there.
        Reader::open(path)?;
        let lock = AppendLock::take(path)?;
        let connection = schema::connect(path)?;
        schema::check(path, &connection)?;
        schema::check_pages(path, &connection)?;
        schema::make_durable(path, &connection)?;
        Ok(Self { reader: Reader::new(path, connection), _lock: lock })
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        self.reader.path()
    }

    /// What is in it.
    pub fn reader(&self) -> &Reader {
        &self.reader
    }

    /// Appends all records or none, in one durable transaction: once this returns they survive a
    /// kill and a power failure. A reading whose id is taken is an error unless it is identical.
    pub fn append(&mut self, records: &[Record]) -> Result<Appended, JournalError> {
        for record in records {
            check_finite(record)?;
        }
        let fail = |error| JournalError::sqlite(self.reader.path(), "append", &error);
        // `&mut self` keeps transactions from nesting.
        let transaction =
            Transaction::new_unchecked(self.reader.connection(), TransactionBehavior::Immediate)
                .map_err(fail)?;
        let mut appended = Appended::default();
        for record in records {
            match insert(&transaction, record).map_err(fail)? {
                Inserted::Taken(reading) => {
                    let present = read::reading(&transaction, reading.id).map_err(fail)?;
                    if present != *reading {
                        return Err(JournalError::Conflict { id: reading.id });
                    }
                    appended.duplicates.push(reading.id);
                }
                Inserted::New if matches!(record, Record::Reading(_)) => appended.readings += 1,
                Inserted::New => {}
            }
        }
        transaction.commit().map_err(fail)?;
        Ok(appended)
    }

    /// Folds the write-ahead log into the file, so that the file alone is the whole run, and
    /// closes it.
    pub fn close(self) -> Result<(), JournalError> {
        self.reader
            .connection()
            .query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))
            .map_err(|error| JournalError::sqlite(self.reader.path(), "fold in the log", &error))
    }
}

enum Inserted<'a> {
    New,
    Taken(&'a Reading),
}

fn insert<'a>(connection: &Connection, record: &'a Record) -> rusqlite::Result<Inserted<'a>> {
    match record {
        Record::Reading(reading) => {
            if insert_reading(connection, reading)? == 0 {
                return Ok(Inserted::Taken(reading));
            }
            if reading.travel != Latched::ZERO {
                let Latched([theta, phi, x, y]) = reading.travel;
                connection
                    .prepare_cached("INSERT INTO swept_readings VALUES (?1, ?2, ?3, ?4, ?5)")?
                    .execute(params![reading.id, theta, phi, x, y])?;
            }
            if reading.device_times != DeviceTimes::default() {
                let DeviceTimes { axes_s, photometer_s } = reading.device_times;
                connection
                    .prepare_cached("INSERT INTO device_times VALUES (?1, ?2, ?3)")?
                    .execute(params![reading.id, axes_s, photometer_s])?;
            }
        }
        Record::Event(event) => {
            connection
                .prepare_cached(
                    "INSERT INTO events (session, time_s, kind, text) VALUES (?1, ?2, ?3, ?4)",
                )?
                .execute(params![
                    event.session,
                    event.time_s,
                    event.kind.name(),
                    cut(&event.text)
                ])?;
        }
        Record::ReferenceCheck(check) => {
            connection
                .prepare_cached(
                    "INSERT INTO reference_checks
                     (session, reading, before, after, u_difference, verdict)
                     VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
                )?
                .execute(params![
                    check.session,
                    check.reading,
                    check.before,
                    check.after,
                    check.u_difference,
                    check.verdict.name()
                ])?;
        }
        Record::Round { number, account, steps } => {
            let count = i64::try_from(steps.len()).unwrap_or(i64::MAX);
            connection.execute(
                "INSERT INTO rounds VALUES (?1, ?2, ?3)",
                params![number, count, account],
            )?;
            for step in steps {
                steps::insert(connection, step)?;
            }
        }
        Record::SessionBegan { number, boot_id, started_s } => {
            connection.execute(
                "INSERT INTO sessions (number, boot_id, started_s) VALUES (?1, ?2, ?3)",
                params![number, boot_id, started_s],
            )?;
        }
        Record::SessionEnded { number, ended_s, reason } => {
            let changed = connection.execute(
                "UPDATE sessions SET ended_s = ?2, reason = ?3 WHERE number = ?1",
                params![number, ended_s, cut(reason)],
            )?;
            if changed == 0 {
                return Err(rusqlite::Error::StatementChangedRows(0));
            }
        }
    }
    Ok(Inserted::New)
}

fn insert_reading(connection: &Connection, reading: &Reading) -> rusqlite::Result<usize> {
    let (kind, index, repeat) = kind_columns(reading.kind);
    let [commanded_theta, commanded_phi, commanded_x, commanded_y] = reading.commanded.0;
    let [start_theta, start_phi, start_x, start_y] = reading.start.0;
    let [end_theta, end_phi, end_x, end_y] = reading.end.0;
    connection.prepare_cached(INSERT_READING)?.execute(params![
        reading.id,
        kind,
        index,
        repeat,
        reading.gain,
        reading.n,
        reading.mean,
        reading.variance,
        reading.min,
        reading.max,
        reading.saturated,
        commanded_theta,
        commanded_phi,
        commanded_x,
        commanded_y,
        start_theta,
        start_phi,
        start_x,
        start_y,
        end_theta,
        end_phi,
        end_x,
        end_y,
        reading.start_us,
        reading.end_us,
        reading.time_s,
        reading.session,
        reading.link_retries,
        reading.unsettled,
    ])
}

/// The columns that a kind takes up: its name, the target's index and repeat.
pub(super) fn kind_columns(kind: ReadingKind) -> (&'static str, Option<u32>, Option<u32>) {
    match kind {
        ReadingKind::Dark => ("dark", None, None),
        ReadingKind::Reference => ("reference", None, None),
        ReadingKind::WarmUp => ("warm_up", None, None),
        ReadingKind::Target { index, repeat } => ("target", Some(index), Some(repeat)),
    }
}

fn begin(
    path: &Path,
    header: &Header,
    inputs: &[Input],
    steps: &[Step],
) -> Result<Connection, JournalError> {
    let mut connection = schema::connect(path)?;
    fill(&mut connection, header, inputs, steps)
        .map_err(|error| JournalError::sqlite(path, "write the header", &error))?;
    schema::make_durable(path, &connection)?;
    sync_folder_of(path)?;
    Ok(connection)
}

/// Everything in one transaction, still under the rollback journal: a kill leaves an empty file.
fn fill(
    connection: &mut Connection,
    header: &Header,
    inputs: &[Input],
    steps: &[Step],
) -> rusqlite::Result<()> {
    schema::set_page_size(connection)?;
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    schema::create(&transaction)?;
    let effects = serde_json::Value::from(header.effects.clone()).to_string();
    // Names and numbers always have a form as JSON.
    let wishes = serde_json::to_string(&header.effect_wishes).unwrap_or_default();
    for (key, value) in [
        ("program_version", header.program_version.as_str()),
        ("seed", &header.seed.to_string()),
        ("simulated", if header.simulated { "true" } else { "false" }),
        ("rig_name", &header.rig_name),
        ("plan_name", &header.plan_name),
        ("plan_hash", &header.plan_hash),
        ("started_utc", &header.started_utc),
        ("effects", &effects),
        ("effect_wishes", &wishes),
    ] {
        transaction.execute("INSERT INTO meta VALUES (?1, ?2)", params![key, value])?;
    }
    for input in inputs {
        transaction.execute(
            "INSERT INTO inputs (role, name, bytes) VALUES (?1, ?2, ?3)",
            params![input.role.name(), input.name, input.bytes],
        )?;
    }
    for step in steps {
        steps::insert(&transaction, step)?;
    }
    transaction.commit()
}

fn check_inputs(inputs: &[Input]) -> Result<(), JournalError> {
    for input in inputs {
        let (bytes, limit) = (input.bytes.len(), INPUT_BYTES_MAX);
        if bytes > limit {
            return Err(JournalError::TooLarge { what: input.name.clone(), bytes, limit });
        }
    }
    Ok(())
}

fn check_finite(record: &Record) -> Result<(), JournalError> {
    let numbers: &[(&str, f64)] = match record {
        Record::Event(event) => &[("event time_s", event.time_s)],
        Record::Reading(reading) => &[
            ("reading mean", reading.mean),
            ("reading variance", reading.variance),
            ("reading time_s", reading.time_s),
        ],
        Record::ReferenceCheck(check) => &[
            ("reference check before", check.before),
            ("reference check after", check.after),
            ("reference check u_difference", check.u_difference),
        ],
        // Laid out on a rig: its numbers are finite.
        Record::Round { .. } => &[],
        Record::SessionBegan { started_s, .. } => &[("session started_s", *started_s)],
        Record::SessionEnded { ended_s, .. } => &[("session ended_s", *ended_s)],
    };
    match numbers.iter().find(|(_, value)| !value.is_finite()) {
        None => Ok(()),
        Some((what, value)) => {
            let what = match record {
                Record::Reading(reading) => format!("{what} of reading {}", reading.id),
                _ => (*what).to_owned(),
            };
            Err(JournalError::NotFinite { what, value: value.to_string() })
        }
    }
}

/// At most [`TEXT_BYTES_MAX`] bytes of `text`, cut between characters.
fn cut(text: &str) -> &str {
    &text[..text.floor_char_boundary(TEXT_BYTES_MAX)]
}

/// A new file's name is durable only once its folder is.
fn sync_folder_of(path: &Path) -> Result<(), JournalError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    File::open(folder)
        .and_then(|folder| folder.sync_all())
        .map_err(|error| JournalError::io(folder, "sync the folder", &error))
}
