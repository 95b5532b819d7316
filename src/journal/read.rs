//! What is in a journal, as it stands, also while another process appends to it.

use std::path::{Path, PathBuf};

use rusqlite::types::{FromSql, FromSqlError, FromSqlResult, ValueRef};
use rusqlite::{Connection, OptionalExtension, Row};

use super::{
    EffectWishes, Event, EventKind, Header, Input, InputRole, JournalError, ReferenceCheck, Round,
    Session, Verdict, schema, steps,
};
use crate::plan::Step;
use crate::rig::{DeviceTimes, Latched, Reading, ReadingKind};

const READING: &str = "
SELECT position, id, kind, target_index, target_repeat, gain, n, mean, variance, min, max, saturated,
    commanded_theta, commanded_phi, commanded_x, commanded_y, start_theta, start_phi, start_x,
    start_y, end_theta, end_phi, end_x, end_y, start_us, end_us, time_s, session, link_retries,
    unsettled, coalesce(travel_theta, 0), coalesce(travel_phi, 0), coalesce(travel_x, 0),
    coalesce(travel_y, 0), axes_s, photometer_s
FROM readings LEFT JOIN swept_readings USING (id) LEFT JOIN device_times USING (id) ";

/// In which order readings come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// The plan's sequence: the same for a run that was interrupted and for one that was not.
    Id,
    /// As they were taken and committed.
    Taken,
    /// Those that are no target's, then by target and repeat: as samples.csv has them.
    Target,
}

/// A run's file, open for reading.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    connection: Connection,
}

impl Reader {
    /// Opens a run's file; works on a read-only medium too.
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let connection = schema::connect_read_only(path)?;
        schema::check(path, &connection)?;
        Ok(Self::new(path, connection))
    }

    pub(super) fn new(path: &Path, connection: Connection) -> Self {
        Self { path: path.to_owned(), connection }
    }

    pub(super) fn connection(&self) -> &Connection {
        &self.connection
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads every page once, and says what is damaged.
    pub fn check_pages(&self) -> Result<(), JournalError> {
        schema::check_pages(&self.path, &self.connection)
    }

    /// What was known when the run began.
    pub fn header(&self) -> Result<Header, JournalError> {
        let corrupt = |key: &str| JournalError::Corrupt {
            path: self.path.clone(),
            detail: format!("meta: {key}: missing or not as this program writes it"),
        };
        let found = |key: &str| {
            self.connection
                .query_row("SELECT value FROM meta WHERE key = ?1", [key], |row| row.get(0))
                .optional()
                .map_err(|error| self.fail(&error))
        };
        let text = |key: &str| found(key)?.ok_or_else(|| corrupt(key));
        let seed: String = text("seed")?;
        let simulated: String = text("simulated")?;
        let effects: String = text("effects")?;
        let wishes: Option<String> = found("effect_wishes")?;
        Ok(Header {
            program_version: text("program_version")?,
            seed: seed.parse().map_err(|_| corrupt("seed"))?,
            simulated: simulated.parse().map_err(|_| corrupt("simulated"))?,
            rig_name: text("rig_name")?,
            plan_name: text("plan_name")?,
            plan_hash: text("plan_hash")?,
            started_utc: text("started_utc")?,
            effects: serde_json::from_str(&effects).map_err(|_| corrupt("effects"))?,
            // Runs from before there were any have none.
            effect_wishes: wishes.map_or_else(
                || Ok(EffectWishes::default()),
                |wishes| serde_json::from_str(&wishes).map_err(|_| corrupt("effect_wishes")),
            )?,
        })
    }

    /// The input files, in the order in which they were handed in.
    pub fn inputs(&self) -> Result<Vec<Input>, JournalError> {
        self.rows("SELECT role, name, bytes FROM inputs ORDER BY position", |row| {
            Ok(Input {
                role: row.get::<_, Named<InputRole>>(0)?.0,
                name: row.get(1)?,
                bytes: row.get(2)?,
            })
        })
    }

    /// The decisions on the way, in their order; none of a run whose sequence was fixed beforehand.
    pub fn rounds(&self) -> Result<Vec<Round>, JournalError> {
        self.rows("SELECT number, steps, account FROM rounds ORDER BY number", |row| {
            Ok(Round { number: row.get(0)?, steps: row.get(1)?, account: row.get(2)? })
        })
    }

    /// The sequence of steps, in its order: fixed before the run, but for what rounds added.
    pub fn steps(&self) -> Result<Vec<Step>, JournalError> {
        self.rows(steps::SELECT, steps::from_row)
    }

    /// The sessions so far, the latest last.
    pub fn sessions(&self) -> Result<Vec<Session>, JournalError> {
        let sql = "SELECT number, boot_id, started_s, ended_s, reason FROM sessions
                   ORDER BY number";
        self.rows(sql, |row| {
            let ended: (Option<f64>, Option<String>) = (row.get(3)?, row.get(4)?);
            Ok(Session {
                number: row.get(0)?,
                boot_id: row.get(1)?,
                started_s: row.get(2)?,
                ended: ended.0.zip(ended.1),
            })
        })
    }

    /// What happened, in the order in which it was written.
    pub fn events(&self) -> Result<Vec<Event>, JournalError> {
        self.rows("SELECT session, time_s, kind, text FROM events ORDER BY position", |row| {
            Ok(Event {
                session: row.get(0)?,
                time_s: row.get(1)?,
                kind: row.get::<_, Named<EventKind>>(2)?.0,
                text: row.get(3)?,
            })
        })
    }

    /// What resumes concluded from the reference pose, in the order in which it was written.
    pub fn reference_checks(&self) -> Result<Vec<ReferenceCheck>, JournalError> {
        let sql = "SELECT session, reading, before, after, u_difference, verdict
                   FROM reference_checks ORDER BY position";
        self.rows(sql, |row| {
            Ok(ReferenceCheck {
                session: row.get(0)?,
                reading: row.get(1)?,
                before: row.get(2)?,
                after: row.get(3)?,
                u_difference: row.get(4)?,
                verdict: row.get::<_, Named<Verdict>>(5)?.0,
            })
        })
    }

    /// How many readings there are.
    pub fn reading_count(&self) -> Result<u64, JournalError> {
        let count: i64 = self
            .connection
            .query_row("SELECT count(*) FROM readings", [], |row| row.get(0))
            .map_err(|error| self.fail(&error))?;
        Ok(count.unsigned_abs())
    }

    /// The ids that are done, rising.
    pub fn reading_ids(&self) -> Result<Vec<u32>, JournalError> {
        self.rows("SELECT id FROM readings ORDER BY id", |row| row.get(0))
    }

    /// All readings. A million of them take about 200 MB; [`Reader::for_each_reading`] takes none.
    pub fn readings(&self, order: Order) -> Result<Vec<Reading>, JournalError> {
        let mut readings = Vec::new();
        self.for_each_reading(order, |reading| readings.push(reading))?;
        Ok(readings)
    }

    /// Hands over one reading after the other.
    pub fn for_each_reading(
        &self,
        order: Order,
        mut take: impl FnMut(Reading),
    ) -> Result<(), JournalError> {
        let order = match order {
            Order::Id => "ORDER BY id",
            Order::Taken => "ORDER BY position",
            Order::Target => "ORDER BY target_index, target_repeat, id",
        };
        let mut each = || {
            let mut statement = self.connection.prepare(&format!("{READING}{order}"))?;
            let mut rows = statement.query([])?;
            while let Some(row) = rows.next()? {
                take(reading_from_row(row)?);
            }
            Ok(())
        };
        each().map_err(|error| self.fail(&error))
    }

    /// At most `count` readings in the order in which they were taken, after the one at
    /// `position`; 0 begins, and positions rise. For those who follow a run.
    pub fn readings_after(
        &self,
        position: u64,
        count: u32,
    ) -> Result<Vec<(u64, Reading)>, JournalError> {
        // Beyond what SQLite counts there is nothing.
        let position = i64::try_from(position).unwrap_or(i64::MAX);
        let sql = format!("{READING} WHERE position > {position} ORDER BY position LIMIT {count}");
        self.rows(&sql, |row| Ok((row.get::<_, i64>(0)?.unsigned_abs(), reading_from_row(row)?)))
    }

    fn rows<T>(
        &self,
        sql: &str,
        each: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
    ) -> Result<Vec<T>, JournalError> {
        let collect = || -> rusqlite::Result<Vec<T>> {
            self.connection.prepare(sql)?.query_map([], each)?.collect()
        };
        collect().map_err(|error| self.fail(&error))
    }

    fn fail(&self, error: &rusqlite::Error) -> JournalError {
        JournalError::sqlite(&self.path, "read", error)
    }
}

/// The reading with this id.
pub(super) fn reading(connection: &Connection, id: u32) -> rusqlite::Result<Reading> {
    connection
        .prepare_cached(&format!("{READING} WHERE id = ?1"))?
        .query_row([id], reading_from_row)
}

fn reading_from_row(row: &Row<'_>) -> rusqlite::Result<Reading> {
    Ok(Reading {
        id: row.get(1)?,
        kind: kind_from_row(row, 2)?,
        gain: row.get(5)?,
        n: row.get(6)?,
        mean: row.get(7)?,
        variance: row.get(8)?,
        min: row.get(9)?,
        max: row.get(10)?,
        saturated: row.get(11)?,
        commanded: latched_from_row(row, 12)?,
        start: latched_from_row(row, 16)?,
        end: latched_from_row(row, 20)?,
        start_us: row.get(24)?,
        end_us: row.get(25)?,
        time_s: row.get(26)?,
        session: row.get(27)?,
        link_retries: row.get(28)?,
        unsettled: row.get(29)?,
        travel: latched_from_row(row, 30)?,
        device_times: DeviceTimes { axes_s: row.get(34)?, photometer_s: row.get(35)? },
    })
}

/// Counts from four columns, in the axes' order.
pub(super) fn latched_from_row(row: &Row<'_>, first: usize) -> rusqlite::Result<Latched> {
    Ok(Latched([row.get(first)?, row.get(first + 1)?, row.get(first + 2)?, row.get(first + 3)?]))
}

/// A kind from three columns: its name, the target's index and repeat.
pub(super) fn kind_from_row(row: &Row<'_>, first: usize) -> rusqlite::Result<ReadingKind> {
    let name: String = row.get(first)?;
    Ok(match name.as_str() {
        "dark" => ReadingKind::Dark,
        "reference" => ReadingKind::Reference,
        "warm_up" => ReadingKind::WarmUp,
        // The tables admit no fourth name.
        _ => ReadingKind::Target { index: row.get(first + 1)?, repeat: row.get(first + 2)? },
    })
}

/// A value that is kept by its name.
struct Named<T>(T);

macro_rules! named {
    ($($type:ty),+) => {$(
        impl FromSql for Named<$type> {
            fn column_result(value: ValueRef<'_>) -> FromSqlResult<Self> {
                let name = value.as_str()?;
                <$type>::from_name(name).map(Self).ok_or_else(|| {
                    FromSqlError::Other(format!("\"{name}\" is not a name that is known").into())
                })
            }
        }
    )+};
}

named!(InputRole, EventKind, Verdict);
