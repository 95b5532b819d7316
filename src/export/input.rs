//! CSV from elsewhere: samples to fit, and rays at which to evaluate a fit.
//!
//! Columns are found by name, further ones are ignored, lines that begin with # are comments. Our
//! own samples.csv is such a file. Numbers have a decimal point, whatever the locale.

use std::io::{self, Write};

use fit::{Estimate, Noise};
use radiometry::direction;

use super::number::number;
use super::repeats::Repeats;
use super::{ListedRay, RayChart, RayColumns};
use crate::rig::Quantity;
use crate::rig::calibration::{Flag, Flags};

/// The most rows that are read: at 100 bytes each, 5 GB.
const ROWS_MAX: usize = 50_000_000;
/// An azimuth may be stated in (-180, 180] or in [0, 360]; beyond a turn it is a slip.
const PHI_DEG_MAX: f64 = 360.0;
/// Of values and their u: the sums of a fit's squares stay in range.
const VALUE_MAX: f64 = 1e100;
const U_EXPECTED: &str = "a number greater than 0, up to 1e100";

/// A sample from a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputSample {
    /// Its line in the file, from 1.
    pub line: u64,
    /// Its ray, φ in (-180, 180].
    pub ray: RayColumns,
    /// Its value, negative ones included.
    pub value: f64,
    /// Its standard uncertainty, greater than 0; `None` where the file has no such column.
    pub u: Option<f64>,
    /// Its flags, those whose names are known.
    pub flags: Flags,
}

/// The samples of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct InputSamples {
    /// What the values are, by the name of their column.
    pub quantity: Quantity,
    /// The samples, in the file's order; never empty.
    pub samples: Vec<InputSample>,
}

/// Why a CSV file can't be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CsvError {
    /// Not text, or a line with another number of fields than the header.
    #[error("line {line}: {detail}")]
    Malformed {
        /// The line, from 1.
        line: u64,
        /// What was found.
        detail: String,
    },
    /// A column is not there: name it as expected, the unit included.
    #[error("line 1: no column {expected}; the columns are: {found}")]
    NoColumn {
        /// The name, or names of which one is needed.
        expected: String,
        /// The names that are there.
        found: String,
    },
    /// Two columns claim to be the same, or values of two quantities stand side by side: remove
    /// one.
    #[error("line 1: columns {first} and {second}: expected one of them")]
    Ambiguous {
        /// One.
        first: String,
        /// The other.
        second: String,
    },
    /// A field that is not the number that its column needs.
    #[error("line {line}, column {column}: \"{found}\"; expected {expected}")]
    Field {
        /// The line, from 1.
        line: u64,
        /// The column's name.
        column: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: &'static str,
    },
    /// A header and nothing below it.
    #[error("no rows below the header; expected at least one")]
    NoRows,
    /// A line that repeats another one in every field: a file that was appended to twice, say.
    #[error(
        "line {line} repeats line {first} in every field: counted twice, it would make u too small"
    )]
    Repeated {
        /// The later line.
        line: u64,
        /// The earlier one.
        first: u64,
    },
    /// More than is read at once.
    #[error("more than {limit} rows")]
    TooManyRows {
        /// The limit.
        limit: usize,
    },
}

/// Reads samples: `x_mm`, `y_mm`, `theta_deg`, `phi_deg` and one column of values, named after its
/// quantity as in samples.csv; with a column `u_` of that name, the samples' uncertainty. A line
/// that stands there twice is refused; real repeats differ in their noise, or in a further column.
pub fn read_samples(bytes: &[u8]) -> Result<InputSamples, CsvError> {
    read_samples_in(RayChart::Surface, bytes)
}

/// As [`read_samples`], with the ray's columns of a chart.
pub fn read_samples_in(chart: RayChart, bytes: &[u8]) -> Result<InputSamples, CsvError> {
    read_part(chart, bytes, &mut Repeats::default(), 0)
}

/// The same of a part of a file, so many lines further down.
pub(super) fn read_part(
    chart: RayChart,
    bytes: &[u8],
    repeats: &mut Repeats,
    lines_before: u64,
) -> Result<InputSamples, CsvError> {
    let mut table = Table::open(bytes)?;
    let rays = table.ray_columns(chart)?;
    let (quantity, value) = table.quantity()?;
    let u = table.find(&format!("u_{}", quantity.radiance_column()))?;
    let flags = table.find("flags")?;
    let is_value = |value: f64| value.abs() <= VALUE_MAX;
    let is_u = |u: f64| u > 0.0 && u <= VALUE_MAX;
    let mut samples = Vec::new();
    while let Some(row) = table.next_row(samples.len())? {
        if let Some(first) = repeats.note(row.record, row.line + lines_before) {
            return Err(CsvError::Repeated { line: row.line, first });
        }
        let sample = InputSample {
            line: row.line,
            ray: row.ray(&rays)?,
            value: row.number(&value, "a number from -1e100 to 1e100", is_value)?,
            u: u.as_ref().map(|u| row.number(u, U_EXPECTED, is_u)).transpose()?,
            flags: flags.as_ref().map_or(Flags::default(), |flags| row.flags(flags)),
        };
        samples.push(sample);
    }
    if samples.is_empty() { Err(CsvError::NoRows) } else { Ok(InputSamples { quantity, samples }) }
}

/// Reads rays by a chart's columns.
pub fn read_rays(chart: RayChart, bytes: &[u8]) -> Result<Vec<ListedRay>, CsvError> {
    let mut table = Table::open(bytes)?;
    let columns = table.columns_of(chart)?;
    let mut rays = Vec::new();
    while let Some(row) = table.next_row(rays.len())? {
        rays.push(row.listed(&columns)?);
    }
    if rays.is_empty() { Err(CsvError::NoRows) } else { Ok(rays) }
}

/// Writes a fit's values at listed rays: the ray, the value, its uncertainty, and the part of it
/// that is independent from reading to reading.
pub fn write_at(
    out: impl Write,
    quantity: Quantity,
    chart: RayChart,
    rays: impl IntoIterator<Item = (ListedRay, Estimate)>,
) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    let radiance = quantity.radiance_column();
    let (u, u_independent) = (format!("u_{radiance}"), format!("u_independent_{radiance}"));
    let values = [radiance, &u, &u_independent];
    csv.write_record(chart.names().iter().copied().chain(values))?;
    for (ray, Estimate { value, u, u_independent }) in rays {
        let fields = ray.numbers.into_iter().chain([value, u, u_independent]);
        csv.write_record(fields.map(number))?;
    }
    csv.flush()
}

impl InputSamples {
    /// The samples as the fit takes them, those left out whose flags exclude them. A stated u
    /// counts as independent from sample to sample. Without one `u_relative`, if given, stands for
    /// it, relative to the root mean square of all values: a u relative to each value would favour
    /// those that came out low. With neither, the fit estimates one from its residuals.
    pub fn fit_samples(&self, u_relative: Option<f64>) -> Vec<fit::Sample> {
        let noise = self.noise(u_relative);
        self.used().map(|sample| sample.fit_sample(noise)).collect()
    }

    /// Of samples that state no u.
    pub fn noise(&self, u_relative: Option<f64>) -> Noise {
        let Some(u_relative) = u_relative else { return Noise::Unknown };
        let squares: f64 = self.used().map(|sample| sample.value * sample.value).sum();
        let mean_square = squares / self.used().count().max(1) as f64;
        Noise::Fixed { variance: u_relative * u_relative * mean_square }
    }

    /// The same with saturated ones, which are lower limits: where those are among the others.
    pub fn fit_readings(&self, without_u: Noise) -> (Vec<fit::Sample>, Vec<usize>) {
        let samples = self.with_limits().map(|sample| sample.fit_sample(without_u)).collect();
        let places = self.with_limits().enumerate();
        (samples, places.filter(|(_, s)| !is_used(s.flags)).map(|(i, _)| i).collect())
    }

    /// The samples as the fit takes them, and the lines that they stand on.
    pub fn fit_samples_with_lines(&self) -> (Vec<fit::Sample>, Vec<u64>) {
        self.used().map(|sample| (sample.fit_sample(Noise::Unknown), sample.line)).unzip()
    }

    /// Those that are used, saturated ones among them.
    pub fn with_limits(&self) -> impl Iterator<Item = &InputSample> {
        self.samples.iter().filter(|sample| is_used(sample.flags) || is_limit(sample))
    }

    /// Those that have no part in the fit.
    pub fn left_out(&self) -> impl Iterator<Item = &InputSample> {
        self.samples.iter().filter(|sample| !is_used(sample.flags) && !is_limit(sample))
    }

    fn used(&self) -> impl Iterator<Item = &InputSample> {
        self.samples.iter().filter(|sample| is_used(sample.flags))
    }

    /// The same samples, so many lines further down.
    pub(super) fn later(mut self, lines: u64) -> Self {
        self.samples.iter_mut().for_each(|sample| sample.line += lines);
        self
    }

    /// Whether the file states an uncertainty.
    pub fn has_u(&self) -> bool {
        self.samples.iter().any(|sample| sample.u.is_some())
    }

    /// How many samples carry a flag.
    pub fn flagged(&self) -> usize {
        self.samples.iter().filter(|sample| !sample.flags.is_empty()).count()
    }
}

impl InputSample {
    fn fit_sample(&self, without_u: Noise) -> fit::Sample {
        let noise = self.u.map_or(without_u, |u| Noise::Fixed { variance: u * u });
        fit::Sample { ray: self.ray.ray(), value: self.value, noise }
    }
}

/// Where the sample that a beam reached beyond ends, a file doesn't say.
fn is_used(flags: Flags) -> bool {
    !flags.excludes_from_fit() && !flags.contains(Flag::OffSample)
}

/// Whether the sample's value is a lower limit: saturated, at its pose, and on the sample.
fn is_limit(sample: &InputSample) -> bool {
    let flags = sample.flags;
    let is_elsewhere = flags.contains(Flag::Unsettled) || flags.contains(Flag::OffSample);
    flags.contains(Flag::Saturated) && !is_elsewhere && sample.value > 0.0
}

impl CsvError {
    /// The same, so many lines further down.
    pub(super) fn later(mut self, lines: u64) -> Self {
        if let Self::Malformed { line, .. }
        | Self::Field { line, .. }
        | Self::Repeated { line, .. } = &mut self
        {
            *line += lines;
        }
        self
    }
}

struct Table<'b> {
    csv: csv::Reader<&'b [u8]>,
    lines: Lines<'b>,
    header: Vec<String>,
    record: csv::StringRecord,
}

/// Counts lines. The CSV reader says where it stood before a record, which may be ahead of line
/// ends and comments that it then passes over.
struct Lines<'b> {
    bytes: &'b [u8],
    passed: usize,
    line: u64,
}

/// Columns that name a ray.
struct Rays {
    chart: RayChart,
    columns: Vec<Column>,
}

struct Column {
    place: usize,
    name: String,
}

struct Row<'t> {
    line: u64,
    record: &'t csv::StringRecord,
}

impl<'b> Table<'b> {
    fn open(bytes: &'b [u8]) -> Result<Self, CsvError> {
        // Spreadsheets put a byte order mark in front.
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let mut csv =
            csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(bytes);
        let mut lines = Lines { bytes, passed: 0, line: 1 };
        let header = csv.headers().map_err(|error| lines.malformed(&error))?;
        let header: Vec<String> = header.iter().map(str::to_owned).collect();
        if let [only] = header.as_slice()
            && only.contains([';', '\t'])
        {
            let detail = format!("\"{only}\"; expected commas between fields, and decimal points");
            return Err(CsvError::Malformed { line: 1, detail });
        }
        Ok(Self { csv, lines, header, record: csv::StringRecord::new() })
    }

    /// The next row; `so_far` have been read.
    fn next_row(&mut self, so_far: usize) -> Result<Option<Row<'_>>, CsvError> {
        let read = self.csv.read_record(&mut self.record);
        if !read.map_err(|error| self.lines.malformed(&error))? {
            return Ok(None);
        }
        if so_far >= ROWS_MAX {
            return Err(CsvError::TooManyRows { limit: ROWS_MAX });
        }
        let line = self.lines.line_at(self.record.position());
        Ok(Some(Row { line, record: &self.record }))
    }

    fn find(&self, name: &str) -> Result<Option<Column>, CsvError> {
        let mut places = (0..self.header.len()).filter(|&place| self.header[place] == name);
        let place = places.next();
        if places.next().is_some() {
            let (first, second) = (name.to_owned(), name.to_owned());
            return Err(CsvError::Ambiguous { first, second });
        }
        Ok(place.map(|place| Column { place, name: name.to_owned() }))
    }

    /// The columns of a ray: the chart's own, or between planes the surface chart's where there is
    /// no `u_mm`.
    fn ray_columns(&self, chart: RayChart) -> Result<Rays, CsvError> {
        match chart {
            RayChart::TwoPlane { .. } if self.find("u_mm")?.is_none() => {
                let has_surface = self.find("x_mm")?.is_some();
                if has_surface {
                    self.columns_of(RayChart::Surface)
                } else {
                    self.columns_of(chart)
                }
            }
            _ => self.columns_of(chart),
        }
    }

    fn columns_of(&self, chart: RayChart) -> Result<Rays, CsvError> {
        let columns: Result<_, _> = chart.names().iter().map(|name| self.need(name)).collect();
        Ok(Rays { chart, columns: columns? })
    }

    fn need(&self, name: &str) -> Result<Column, CsvError> {
        self.find(name)?.ok_or_else(|| self.no_column(name))
    }

    fn no_column(&self, expected: &str) -> CsvError {
        let found = self.header.join(", ");
        let found = if found.is_empty() { "none: the file is empty".to_owned() } else { found };
        CsvError::NoColumn { expected: expected.to_owned(), found }
    }

    /// The one column that holds values.
    fn quantity(&self) -> Result<(Quantity, Column), CsvError> {
        const ALL: [Quantity; 3] = [Quantity::Radiance, Quantity::Luminance, Quantity::Relative];
        let mut found = None;
        for quantity in ALL {
            let Some(column) = self.find(quantity.radiance_column())? else { continue };
            if let Some((_, Column { name: first, .. })) = found {
                return Err(CsvError::Ambiguous { first, second: column.name });
            }
            found = Some((quantity, column));
        }
        found.ok_or_else(|| self.no_column(&ALL.map(Quantity::radiance_column).join(" or ")))
    }
}

impl Row<'_> {
    fn ray(&self, rays: &Rays) -> Result<RayColumns, CsvError> {
        let number = |place: usize| self.ray_number(rays, place);
        Ok(match rays.chart {
            RayChart::Surface | RayChart::Perpendicular => RayColumns {
                x_mm: number(0)?,
                y_mm: number(1)?,
                theta_deg: number(2)?,
                phi_deg: number(3)?,
            },
            RayChart::Environment => {
                let (theta_deg, phi_deg) = (number(0)?, number(1)?);
                RayColumns { x_mm: 0.0, y_mm: 0.0, theta_deg, phi_deg }
            }
            RayChart::TwoPlane { distance_m } => {
                let numbers = [number(0)?, number(1)?, number(2)?, number(3)?];
                RayChart::between(distance_m, numbers)
            }
        })
    }

    fn listed(&self, rays: &Rays) -> Result<ListedRay, CsvError> {
        let numbers = (0..rays.columns.len()).map(|place| self.ray_number(rays, place));
        Ok(ListedRay { numbers: numbers.collect::<Result<_, _>>()?, ray: self.ray(rays)?.ray() })
    }

    /// A number of a ray, by the name of its column.
    fn ray_number(&self, rays: &Rays, place: usize) -> Result<f64, CsvError> {
        let column = &rays.columns[place];
        match column.name.as_str() {
            "theta_deg" => self.number(column, rays.chart.theta_expected(), |theta| {
                (0.0..=rays.chart.theta_end_deg()).contains(&theta)
            }),
            "phi_deg" => {
                let expected = "an angle in (-180, 180], or in [0, 360]";
                let within = |phi: f64| (-PHI_DEG_MAX..=PHI_DEG_MAX).contains(&phi);
                self.number(column, expected, within).map(direction::wrap_deg)
            }
            _ => self.number(column, "a finite number", f64::is_finite),
        }
    }

    fn number(
        &self,
        column: &Column,
        expected: &'static str,
        is_sound: impl FnOnce(f64) -> bool,
    ) -> Result<f64, CsvError> {
        let text = self.record.get(column.place).unwrap_or_default();
        match text.parse() {
            Ok(number) if is_sound(number) => Ok(number),
            _ => Err(CsvError::Field {
                line: self.line,
                column: column.name.clone(),
                found: text.to_owned(),
                expected,
            }),
        }
    }

    fn flags(&self, column: &Column) -> Flags {
        let mut flags = Flags::default();
        for name in self.record.get(column.place).unwrap_or_default().split('|') {
            if let Some(flag) = Flag::ALL.into_iter().find(|flag| flag.name() == name) {
                flags.set(flag, true);
            }
        }
        flags
    }
}

impl Lines<'_> {
    /// The line, from 1, of the record that the CSV reader found from `position` on. Positions
    /// rise.
    fn line_at(&mut self, position: Option<&csv::Position>) -> u64 {
        let from = position.map_or(0, |position| usize::try_from(position.byte()).unwrap_or(0));
        while let Some(&byte) = self.bytes.get(self.passed) {
            let rest = &self.bytes[self.passed..];
            let passed = match byte {
                b'#' if self.passed >= from => rest.iter().position(|&b| b == b'\n'),
                b'\n' | b'\r' => Some(0),
                _ if self.passed < from => Some(0),
                _ => break,
            };
            // A comment without an end is the file's last line.
            let passed = passed.map_or(rest.len(), |place| place + 1);
            self.line += u64::from(rest[passed - 1] == b'\n');
            self.passed += passed;
        }
        self.line
    }

    fn malformed(&mut self, error: &csv::Error) -> CsvError {
        let line = self.line_at(error.position());
        let detail = match error.kind() {
            csv::ErrorKind::Utf8 { .. } => {
                "not UTF-8 text; expected comma-separated text".to_owned()
            }
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("{len} fields; expected {expected_len}, as in the header")
            }
            _ => error.to_string(),
        };
        CsvError::Malformed { line, detail }
    }
}
