//! The fixed sequence of steps as rows, so that a resume needs neither the plan's reader nor its
//! optimiser to agree with those that made the run.

use std::time::Duration;

use firmware_protocol::Shutter;
use rusqlite::types::Type;
use rusqlite::{Connection, Row, params};

use super::append::kind_columns;
use super::read::{kind_from_row, latched_from_row};
use crate::plan::{Step, Swept};
use crate::rig::{AxisPositions, Latched, Pose};

const INSERT: &str = "
INSERT INTO steps (id, kind, target_index, target_repeat, x_m, y_m, theta_rad, phi_rad,
    axis_theta_rad, axis_phi_rad, axis_x_m, axis_y_m, theta, phi, x, y, via_theta, via_phi, via_x,
    via_y, settle_ns, gain, dwell_ns, shutter, source_off)
VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20,
    ?21, ?22, ?23, ?24, ?25)";

pub(super) const SELECT: &str = "
SELECT id, kind, target_index, target_repeat, x_m, y_m, theta_rad, phi_rad,
    axis_theta_rad, axis_phi_rad, axis_x_m, axis_y_m, theta, phi, x, y, via_theta, via_phi, via_x,
    via_y, settle_ns, gain, dwell_ns, shutter, source_off, first, count, travel_theta, travel_phi,
    travel_x, travel_y, lead_ns
FROM steps LEFT JOIN swept_steps USING (id) ORDER BY position";

const INSERT_SWEPT: &str = "INSERT INTO swept_steps VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";

pub(super) fn insert(connection: &Connection, step: &Step) -> rusqlite::Result<()> {
    let (kind, index, repeat) = kind_columns(step.kind);
    let pose = step.pose;
    let AxisPositions([axis_theta_rad, axis_phi_rad, axis_x_m, axis_y_m]) = step.positions;
    let Latched([theta, phi, x, y]) = step.counts;
    let via = |i: usize| step.via.map(|via| via.0[i]);
    connection.prepare_cached(INSERT)?.execute(params![
        step.id,
        kind,
        index,
        repeat,
        pose.map(|pose| pose.x_m),
        pose.map(|pose| pose.y_m),
        pose.map(|pose| pose.theta_rad),
        pose.map(|pose| pose.phi_rad),
        axis_theta_rad,
        axis_phi_rad,
        axis_x_m,
        axis_y_m,
        theta,
        phi,
        x,
        y,
        via(0),
        via(1),
        via(2),
        via(3),
        nanoseconds(step.settle)?,
        step.gain,
        nanoseconds(step.dwell)?,
        shutter_name(step.shutter),
        step.source_off,
    ])?;
    if let Some(Swept { first, count, travel: Latched([theta, phi, x, y]), lead }) = step.swept {
        let lead_ns = nanoseconds(lead)?;
        connection
            .prepare_cached(INSERT_SWEPT)?
            .execute(params![step.id, first, count, theta, phi, x, y, lead_ns])?;
    }
    Ok(())
}

pub(super) fn from_row(row: &Row<'_>) -> rusqlite::Result<Step> {
    let pose = match row.get::<_, Option<f64>>(4)? {
        None => None,
        Some(x_m) => {
            Some(Pose { x_m, y_m: row.get(5)?, theta_rad: row.get(6)?, phi_rad: row.get(7)? })
        }
    };
    let via = row.get::<_, Option<i32>>(16)?.map(|_| latched_from_row(row, 16)).transpose()?;
    Ok(Step {
        id: row.get(0)?,
        kind: kind_from_row(row, 1)?,
        pose,
        positions: AxisPositions([row.get(8)?, row.get(9)?, row.get(10)?, row.get(11)?]),
        counts: latched_from_row(row, 12)?,
        via,
        settle: duration(row, 20)?,
        gain: row.get(21)?,
        dwell: duration(row, 22)?,
        shutter: match row.get::<_, String>(23)?.as_str() {
            "closed" => Shutter::Closed,
            // The table admits no third name.
            _ => Shutter::Open,
        },
        source_off: row.get(24)?,
        swept: swept(row)?,
    })
}

fn swept(row: &Row<'_>) -> rusqlite::Result<Option<Swept>> {
    let Some(first) = row.get::<_, Option<u32>>(25)? else { return Ok(None) };
    let (count, travel) = (row.get(26)?, latched_from_row(row, 27)?);
    Ok(Some(Swept { first, count, travel, lead: duration(row, 31)? }))
}

fn shutter_name(shutter: Shutter) -> &'static str {
    match shutter {
        Shutter::Closed => "closed",
        Shutter::Open => "open",
    }
}

fn nanoseconds(duration: Duration) -> rusqlite::Result<i64> {
    i64::try_from(duration.as_nanos())
        .map_err(|error| rusqlite::Error::ToSqlConversionFailure(error.into()))
}

fn duration(row: &Row<'_>, column: usize) -> rusqlite::Result<Duration> {
    let nanoseconds: i64 = row.get(column)?;
    u64::try_from(nanoseconds).map(Duration::from_nanos).map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(column, Type::Integer, error.into())
    })
}
