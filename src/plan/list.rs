//! A list of poses: CSV, as labs have it. The header names the columns `x_mm`, `y_mm`,
//! `theta_deg` and `phi_deg`, in any order.
//!
//! θ runs from 0 to 90°; φ may be written in any turn, and is wrapped. It does not know the
//! region or the rig.

use std::ops::Range;

use csv::StringRecord;
use radiometry::direction::wrap_deg;
use spanned_toml::{Bounds, Problem, Source};

use super::TARGETS_MAX;
use crate::rig::Pose;

const COLUMNS: [&str; 4] = ["x_mm", "y_mm", "theta_deg", "phi_deg"];
const BOUNDS: [Bounds; 4] = [
    Bounds::between(-10_000.0, 10_000.0),
    Bounds::between(-10_000.0, 10_000.0),
    Bounds::between(0.0, 90.0),
    Bounds::between(-720.0, 720.0),
];

/// Poses in the order of the file, each with its place in it.
pub(super) fn read(source: &Source) -> Result<Vec<(Pose, Range<usize>)>, Problem> {
    let text = source.text().strip_prefix('\u{feff}').unwrap_or(source.text());
    let offset = source.text().len() - text.len();
    let mut reader =
        csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().map_err(|e| unreadable(source, &e))?.clone();
    let columns = columns(source, &header)?;
    let mut poses = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| unreadable(source, &e))?;
        let span = line_at(source, offset, &record);
        poses.push((pose(source, &record, columns, header.len(), &span)?, span));
        if poses.len() > TARGETS_MAX as usize {
            return Err(Problem::of_file(
                source,
                &format!("more than {TARGETS_MAX} poses"),
                &format!("at most {TARGETS_MAX} poses"),
                "split the list into several plans",
            ));
        }
    }
    if poses.is_empty() {
        return Err(Problem::of_file(
            source,
            "no pose in the list",
            "a header line, and a line for each pose",
            "add a line: x_mm, y_mm, theta_deg, phi_deg",
        ));
    }
    Ok(poses)
}

/// Where each of [`COLUMNS`] stands.
fn columns(source: &Source, header: &StringRecord) -> Result<[usize; 4], Problem> {
    let expected = format!("the columns {}, each once", COLUMNS.join(", "));
    let line = 0..source.text().find('\n').unwrap_or(source.text().len());
    let problem =
        |what: &str, help: &str| Problem::at(source, line.clone(), "", what, &expected, help);
    if let Some(unknown) = header.iter().find(|name| !COLUMNS.contains(name)) {
        let help = if unknown.contains(';') {
            "separate columns by commas, and decimals by points"
        } else {
            "name the columns in the first line, and leave out what is no pose"
        };
        return Err(problem(&format!("unknown column \"{unknown}\""), help));
    }
    let mut places = [0; 4];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        let mut found = header.iter().enumerate().filter(|(_, column)| *column == name);
        *place = match (found.next(), found.next()) {
            (Some((i, _)), None) => i,
            (None, _) => return Err(problem(&format!("no column \"{name}\""), "add it")),
            _ => return Err(problem(&format!("two columns \"{name}\""), "remove one of them")),
        };
    }
    Ok(places)
}

fn pose(
    source: &Source,
    record: &StringRecord,
    columns: [usize; 4],
    width: usize,
    span: &Range<usize>,
) -> Result<Pose, Problem> {
    if record.len() != width {
        return Err(Problem::at(
            source,
            span.clone(),
            "",
            &format!("{} fields", record.len()),
            &format!("{width} fields, as in the first line"),
            "separate fields by commas, and decimals by points",
        ));
    }
    let mut values = [0.0; 4];
    for (i, value) in values.iter_mut().enumerate() {
        let text = record.get(columns[i]).unwrap_or_default();
        let parsed: Option<f64> = text.parse().ok();
        *value = parsed.filter(|value| BOUNDS[i].contain(*value)).ok_or_else(|| {
            let what = format!("found \"{text}\"");
            let help = match parsed {
                Some(number) if number.is_finite() => "correct the pose, or leave it out",
                _ => "write a plain number, with a point for the decimals",
            };
            Problem::at(source, span.clone(), COLUMNS[i], &what, &BOUNDS[i].to_string(), help)
        })?;
    }
    let [x_mm, y_mm, theta_deg, phi_deg] = values;
    Ok(Pose {
        x_m: x_mm / 1e3,
        y_m: y_mm / 1e3,
        theta_rad: theta_deg.to_radians(),
        phi_rad: wrap_deg(phi_deg).to_radians(),
    })
}

/// The record's line, without its end.
fn line_at(source: &Source, offset: usize, record: &StringRecord) -> Range<usize> {
    let byte = record.position().map_or(0, csv::Position::byte);
    let text = source.text();
    let mut start = (offset + usize::try_from(byte).unwrap_or(0)).min(text.len());
    start += text[start..].len() - text[start..].trim_start().len();
    let end = text[start..].find(['\r', '\n']).map_or(text.len(), |length| start + length);
    start..end
}

fn unreadable(source: &Source, e: &csv::Error) -> Problem {
    Problem::of_file(
        source,
        &format!("can't be read: {e}"),
        "a CSV file",
        "is this the right file?",
    )
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn list(text: &str) -> Result<Vec<Pose>, Problem> {
        let poses = read(&Source::new("poses.csv", text))?;
        Ok(poses.into_iter().map(|(pose, _)| pose).collect())
    }

    #[test]
    fn columns_come_in_any_order_and_azimuths_are_wrapped() {
        let poses =
            list("theta_deg,phi_deg,x_mm,y_mm\r\n90,270,1.5,-2\r\n\r\n0, 180 ,0,0\n").unwrap();
        assert_eq!(poses.len(), 2);
        assert_eq!(poses[0].x_m.to_bits(), 0.0015_f64.to_bits());
        assert!((poses[0].phi_rad + 0.5 * PI).abs() < 1e-15);
        assert_eq!(poses[1].phi_rad.to_bits(), PI.to_bits());
        assert_eq!(list("\u{feff}x_mm,y_mm,theta_deg,phi_deg\n0,0,1,2\n").unwrap().len(), 1);
    }

    #[test]
    fn problems_name_the_line_and_what_stands_there() {
        for (text, line, what) in [
            ("x_mm,y_mm,theta_deg,phi_deg\n0,0,1,2\n0,0,91,2\n", 3, "found \"91\""),
            ("x_mm,y_mm,theta_deg,phi_deg\n\n0,0,nan,2\n", 3, "found \"nan\""),
            ("x_mm,y_mm,theta_deg,phi_deg\n0,0,1\n", 2, "3 fields"),
            ("x_mm;y_mm;theta_deg;phi_deg\n0;0;1;2\n", 1, "unknown column"),
            ("x_mm,y_mm,theta_deg,theta_deg\n", 1, "two columns \"theta_deg\""),
            ("x_mm,y_mm,theta_deg\n0,0,1\n", 1, "no column \"phi_deg\""),
        ] {
            let problem = list(text).unwrap_err();
            assert_eq!(problem.line_and_column().map(|(line, _)| line), Some(line), "{problem}");
            assert!(problem.what().contains(what), "{problem}");
        }
    }

    #[test]
    fn an_empty_list_is_refused() {
        for text in ["", "x_mm,y_mm,theta_deg,phi_deg\n"] {
            assert!(list(text).is_err(), "{text:?}");
        }
    }
}
