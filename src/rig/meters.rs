//! `[photometer]`: which meter reads the detector, and how it shall be set. It knows the names of
//! what can be set, and no meter's words.

use spanned_toml::{Bounds, Problem, Table};

/// A driver for a meter, with what it alone needs to know.
#[derive(Debug, Clone, PartialEq)]
pub enum PhotometerDriver {
    /// A Keithley 6485 or 6487 picoammeter.
    Keithley(Picoammeter),
    /// A Newport 1830-C power meter.
    Newport(Newport1830),
    /// Any other that speaks SCPI.
    Scpi(ScpiTable),
    /// A Thorlabs PM100D, PM400, PM100USB or the like.
    Thorlabs(PowerMeter),
}

/// How a picoammeter is set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picoammeter {
    /// Integration of one conversion, power line cycles: 0.01 to 60.
    pub nplc: f64,
    /// Conversions that make a reading, 1 to 100: its digital filter, repeating.
    pub average: u32,
    /// Whether its own offset is measured and taken off, with its input disconnected inside.
    pub zero: bool,
}

/// How a power meter of Thorlabs' is set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerMeter {
    /// What is read.
    pub measures: Measures,
    /// The wavelength whose calibration it applies, nanometres.
    pub wavelength_nm: Option<f64>,
    /// Its own samples that make a reading.
    pub average: u32,
    /// Whether it is zeroed: the head must be in the dark then.
    pub zero: bool,
}

/// What is read of a meter's head.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measures {
    /// The photodiode's current, amperes.
    Current,
    /// Power by the head's own calibration, watts.
    Power,
}

impl Measures {
    /// The unit as meters write it.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Current => "A",
            Self::Power => "W",
        }
    }
}

/// How a Newport 1830-C is set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Newport1830 {
    /// The number of each range of `[[detector.gain]]`, 1 to 8.
    pub ranges: Vec<u8>,
    /// The wavelength whose calibration it applies, nanometres.
    pub wavelength_nm: Option<u16>,
    /// Its filter.
    pub filter: Filter,
    /// Whether the head carries its attenuator.
    pub attenuator: bool,
}

/// How fast a Newport's filter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// None.
    Fast,
    /// Some readings.
    Medium,
    /// Many readings.
    Slow,
}

/// Words of a SCPI meter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScpiTable {
    /// What must occur in its answer to `*IDN?`.
    pub identity: String,
    /// In which unit it reads.
    pub measures: Measures,
    /// Whether lines to it end with CR rather than LF.
    pub ends_with_cr: bool,
    /// Sets what stays, one word after the other.
    pub set_up: Vec<String>,
    /// Takes its own offset off.
    pub zero: Vec<String>,
    /// Sets a range: `{}` stands for its full scale.
    pub range: String,
    /// Asks for one reading.
    pub read: String,
    /// Which of the answer's elements, divided by commas, is the reading; from 0.
    pub element: usize,
    /// Whether it has SCPI's queue of errors, which is asked after it was set.
    pub has_error_queue: bool,
}

const WAVELENGTH_NM: Bounds = Bounds::between(100.0, 20_000.0);
const AVERAGE_MAX: i64 = 10_000;
/// No answer has more elements than this.
const ELEMENTS_MAX: i64 = 63;

#[derive(Debug, Clone, Copy)]
enum Kind {
    Keithley,
    Newport,
    Scpi,
    Thorlabs,
}

impl PhotometerDriver {
    /// Reads `driver` and the keys that go with it; `gains` is how many ranges the detector has.
    /// Also the baud rate that its maker sets.
    ///
    /// "keithley-6485" and "keithley-6487": `nplc` (default 1) · `average` (default 1) · `zero`
    /// (default true).
    /// "thorlabs-pm100": `measures` "current" or "power" · `wavelength_nm` · `average` (default 1)
    /// · `zero` (default false: the head must be dark).
    /// "newport-1830c": `ranges`, the number of each range · `wavelength_nm` · `filter` "fast",
    /// "medium" or "slow" (default medium) · `attenuator` (default false).
    /// "scpi": `identity` · `measures` · `ends_with` "cr" or "lf" (default) · `set_up`, `zero`: lists
    /// of words · `range`: a word in which `{}` stands for the full scale · `read` · `element`
    /// (default 0) · `error_queue` (default true).
    pub(super) fn read(table: &Table<'_>, gains: usize) -> Result<(Self, u32), Problem> {
        let kinds = [
            ("keithley-6485", Kind::Keithley),
            ("keithley-6487", Kind::Keithley),
            ("newport-1830c", Kind::Newport),
            ("scpi", Kind::Scpi),
            ("thorlabs-pm100", Kind::Thorlabs),
        ];
        Ok(match table.required_choice("driver", &kinds)? {
            Kind::Keithley => (Self::Keithley(read_picoammeter(table)?), 9_600),
            Kind::Newport => (Self::Newport(read_newport(table, gains)?), 9_600),
            Kind::Scpi => (Self::Scpi(read_scpi(table)?), 9_600),
            Kind::Thorlabs => (Self::Thorlabs(read_power_meter(table)?), 115_200),
        })
    }
}

fn read_picoammeter(table: &Table<'_>) -> Result<Picoammeter, Problem> {
    Ok(Picoammeter {
        nplc: table.number("nplc", Bounds::between(0.01, 60.0))?.unwrap_or(1.0),
        average: read_average(table, 100)?,
        zero: table.flag("zero")?.unwrap_or(true),
    })
}

fn read_average(table: &Table<'_>, most: i64) -> Result<u32, Problem> {
    let average = table.integer("average", 1..=most)?.unwrap_or(1);
    Ok(u32::try_from(average).unwrap_or(1))
}

fn read_measures(table: &Table<'_>) -> Result<Measures, Problem> {
    let words = [("current", Measures::Current), ("power", Measures::Power)];
    table.required_choice("measures", &words)
}

fn read_power_meter(table: &Table<'_>) -> Result<PowerMeter, Problem> {
    Ok(PowerMeter {
        measures: read_measures(table)?,
        wavelength_nm: table.number("wavelength_nm", WAVELENGTH_NM)?,
        average: read_average(table, AVERAGE_MAX)?,
        zero: table.flag("zero")?.unwrap_or(false),
    })
}

fn read_newport(table: &Table<'_>, gains: usize) -> Result<Newport1830, Problem> {
    let expected = "the number of each [[detector.gain]], 1 to 8, in their order";
    let listed = table.numbers("ranges", Bounds::between(1.0, 8.0), gains..=gains)?;
    let listed = listed.ok_or_else(|| table.missing("ranges", expected))?;
    if let Some(part) = listed.iter().find(|number| number.fract() != 0.0) {
        let found = format!("{part} is no number of a range");
        return Err(table.problem("ranges", &found, expected, "list one for each"));
    }
    let filters = [("fast", Filter::Fast), ("medium", Filter::Medium), ("slow", Filter::Slow)];
    let wavelength_nm = table.integer("wavelength_nm", 300..=1100)?;
    Ok(Newport1830 {
        ranges: listed.into_iter().map(range_number).collect(),
        wavelength_nm: wavelength_nm.and_then(|nm| u16::try_from(nm).ok()),
        filter: table.choice("filter", &filters)?.unwrap_or(Filter::Medium),
        attenuator: table.flag("attenuator")?.unwrap_or(false),
    })
}

/// A whole number from 1 to 8.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked by the reader
fn range_number(number: f64) -> u8 {
    number as u8
}

fn read_scpi(table: &Table<'_>) -> Result<ScpiTable, Problem> {
    let words = |key: &str| -> Result<Vec<String>, Problem> {
        let words = table.texts(key)?.unwrap_or_default();
        words.into_iter().map(|word| one_line(table, key, word)).collect()
    };
    let word = |key: &str| one_line(table, key, table.required_text(key)?);
    let ends = [("cr", true), ("lf", false)];
    let element = table.integer("element", 0..=ELEMENTS_MAX)?.unwrap_or(0);
    Ok(ScpiTable {
        identity: word("identity")?,
        measures: read_measures(table)?,
        ends_with_cr: table.choice("ends_with", &ends)?.unwrap_or(false),
        set_up: words("set_up")?,
        zero: words("zero")?,
        range: word("range")?,
        read: word("read")?,
        element: usize::try_from(element).unwrap_or(0),
        has_error_queue: table.flag("error_queue")?.unwrap_or(true),
    })
}

/// A word for a meter: one line of ASCII, or it would be several.
fn one_line(table: &Table<'_>, key: &str, word: &str) -> Result<String, Problem> {
    if !word.is_empty() && word.chars().all(|c| matches!(c, ' '..='~')) {
        return Ok(word.to_owned());
    }
    Err(table.problem(
        key,
        &format!("{word:?}"),
        "words of printable ASCII, without an end of the line",
        "say with ends_with how lines end",
    ))
}
