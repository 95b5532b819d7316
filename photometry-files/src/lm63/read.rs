//! Bytes to [`Photometry`]: the order of things in the file, and every check on them.

use super::error::{Lm63Error, Problem, shortened};
use super::label::{self, IntensityUnit, Keyword, Version};
use super::note::Note;
use super::numbers::Numbers;
use super::opening::{Dimensions, Opening};
use super::photometry::{Photometry, Symmetry, Tilt};

/// Larger than any such file: 0.1° in both angles would be 100 MB of text and no luminaire.
const BYTES_MAX: usize = 16 << 20;
/// Angles in one direction; 0.05° all round is 7200.
const ANGLES_MAX: u32 = 10_000;
/// Characters in a line, with its end, by the standard.
const LINE_MAX: usize = 256;
/// With all factors, in the file's unit: above the Sun's 3e27 cd, and sums stay far from overflow.
const INTENSITY_MAX: f64 = 1e30;
/// Either way, in the file's unit of length; far above any luminaire's.
const DIMENSION_MAX: f64 = 1e4;
/// What some editors put before the first line.
const BYTE_ORDER_MARK: char = '\u{feff}';
/// Metres in a foot, exactly.
const FOOT_M: f64 = 0.3048;

/// Reads a whole file.
///
/// ```
/// let file = b"IESNA:LM-63-2002\n[TEST] 1\nTILT=NONE\n\
///     1 -1 2 3 1 1 2 0.1 0.2 0\n1 1 10\n0 45 90\n0\n100 50 0\n";
/// let photometry = photometry_files::lm63::read(file)?;
/// assert_eq!(photometry.intensity(77.0, 22.5), 150.0);
/// # Ok::<(), photometry_files::lm63::Lm63Error>(())
/// ```
pub fn read(bytes: &[u8]) -> Result<Photometry, Lm63Error> {
    if bytes.len() > BYTES_MAX {
        let problem = Problem::TooLarge { bytes: bytes.len(), most: BYTES_MAX };
        return Err(Lm63Error { line: 1, problem });
    }
    refuse_control_characters(bytes)?;
    // Keywords may hold letters beyond ASCII in whichever encoding; the numbers never do.
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<&str> = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&text).lines().collect();
    let label = read_label(&lines)?;
    let mut numbers = Numbers::after(&lines, label.lines);
    let tilt = if label.tilt_included { Some(read_tilt(&mut numbers)?) } else { None };
    let header = read_header(&mut numbers, label.version)?;
    let table = read_table(&mut numbers, &header)?;
    numbers.finish()?;
    Ok(assemble(label, tilt, &header, table, &lines))
}

/// What stands before the numbers.
struct Label {
    version: Version,
    keywords: Vec<Keyword>,
    unit: Option<IntensityUnit>,
    tilt_included: bool,
    /// How many lines it has, `TILT=` included.
    lines: usize,
}

/// The thirteen numbers before the angles.
struct Header {
    lamps: usize,
    lumens_per_lamp: Option<f64>,
    factor: f64,
    future_use: Option<f64>,
    gammas: usize,
    planes: usize,
    feet: bool,
    opening: Opening,
    input_w: f64,
}

struct Table {
    symmetry: Symmetry,
    gamma_deg: Vec<f64>,
    c_deg: Vec<f64>,
    planes: Vec<Vec<f64>>,
}

fn refuse_control_characters(bytes: &[u8]) -> Result<(), Lm63Error> {
    let control = |byte: &u8| byte.is_ascii_control() && !matches!(byte, b'\t' | b'\n' | b'\r');
    let Some(at) = bytes.iter().position(control) else {
        return Ok(());
    };
    let line = bytes[..at].split(|byte| *byte == b'\n').count();
    Err(Lm63Error { line, problem: Problem::ControlCharacter { byte: bytes[at] } })
}

fn read_label(lines: &[&str]) -> Result<Label, Lm63Error> {
    let at = |line: usize| move |problem| Lm63Error { line, problem };
    let version = label::version(lines.first().copied().unwrap_or_default()).map_err(at(1))?;
    let first = usize::from(version != Version::Lm63In1986);
    let mut keywords = Vec::new();
    for (index, text) in lines.iter().enumerate().skip(first) {
        let line = index + 1;
        let Some(tilt) = after_tilt(text) else {
            label::take_line(&mut keywords, version, line, text).map_err(at(line))?;
            continue;
        };
        let tilt_included = tilt.eq_ignore_ascii_case("INCLUDE");
        if !tilt_included && !tilt.eq_ignore_ascii_case("NONE") {
            return Err(at(line)(Problem::TiltFile { name: shortened(tilt) }));
        }
        let unit = label::intensity_unit(&keywords)
            .map_err(|(line, problem)| Lm63Error { line, problem })?;
        return Ok(Label { version, keywords, unit, tilt_included, lines: line });
    }
    Err(at(lines.len().max(1))(Problem::EndOfFile { expected: "a line `TILT=`".to_owned() }))
}

/// What follows `TILT=`, if the line is that line.
fn after_tilt(line: &str) -> Option<&str> {
    let (name, value) = line.split_once('=')?;
    name.trim().eq_ignore_ascii_case("TILT").then(|| value.trim())
}

fn read_tilt(numbers: &mut Numbers<'_>) -> Result<Tilt, Lm63Error> {
    let lamp_geometry = numbers.count("the lamp-to-luminaire geometry", "1, 2 or 3", 1..=3)?;
    let count = numbers.count("the number of tilt angles", "1 to 10000", 1..=ANGLES_MAX)?;
    let angles_deg = numbers.angles("tilt", count)?;
    let factors = (1..=count)
        .map(|index| numbers.next(|| format!("tilt factor {index} of {count}")))
        .collect::<Result<_, _>>()?;
    Ok(Tilt { lamp_geometry, angles_deg, factors })
}

fn read_header(numbers: &mut Numbers<'_>, version: Version) -> Result<Header, Lm63Error> {
    let positive = |found: f64| found > 0.0;
    let not_negative = |found: f64| found >= 0.0;
    let lamps = numbers.count("the number of lamps", "0 to 10000", 0..=10_000)?;
    let absolute_or_rated = |found: f64| found >= 0.0 || (found + 1.0).abs() < f64::EPSILON;
    let lumens = numbers.admissible("lumens per lamp", "-1, 0 or more", absolute_or_rated)?;
    let multiplier = numbers.admissible("the multiplier", "more than 0", positive)?;
    let gammas = numbers.count("the number of vertical angles", "2 to 10000", 2..=ANGLES_MAX)?;
    let planes = numbers.count("the number of horizontal angles", "1 to 10000", 1..=ANGLES_MAX)?;
    match numbers.count("the photometric type", "1 (C), 2 (B) or 3 (A)", 1..=3)? {
        1 => {}
        2 => return Err(numbers.error(Problem::PhotometricType { letter: 'B' })),
        _ => return Err(numbers.error(Problem::PhotometricType { letter: 'A' })),
    }
    let feet = numbers.count("the unit of length", "1 (feet) or 2 (metres)", 1..=2)? == 1;
    let metres = if feet { FOOT_M } else { 1.0 };
    let mut dimension = |what| {
        let bounded = |found: f64| found.abs() <= DIMENSION_MAX;
        numbers.admissible(what, "within ±1e4", bounded).map(|size| size * metres)
    };
    let width_m = dimension("the luminous opening's width")?;
    let length_m = dimension("the luminous opening's length")?;
    let height_m = dimension("the luminous opening's height")?;
    let ballast = numbers.admissible("the ballast factor", "more than 0", positive)?;
    // The ballast-lamp photometric factor until 1991, 1 in 1995 and 2002, a code of origin in 2019.
    let third =
        numbers.admissible("the number after the ballast factor", "0 or more", not_negative)?;
    let legacy = version <= Version::Lm63In1991;
    let kept_at_1 = matches!(version, Version::Lm63In1995 | Version::Lm63In2002);
    let input_w = numbers.admissible("the input power", "0 W or more", not_negative)?;
    Ok(Header {
        lamps,
        lumens_per_lamp: (lumens >= 0.0).then_some(lumens),
        factor: multiplier * ballast * if legacy { third } else { 1.0 },
        future_use: (kept_at_1 && (third - 1.0).abs() > f64::EPSILON).then_some(third),
        gammas,
        planes,
        feet,
        opening: Dimensions { width_m, length_m, height_m }.opening(version),
        input_w,
    })
}

fn read_table(numbers: &mut Numbers<'_>, header: &Header) -> Result<Table, Lm63Error> {
    let (gammas, planes) = (header.gammas, header.planes);
    // Each number takes a character and, but for the last, a separator.
    let announced = gammas * planes + gammas + planes;
    if announced > numbers.bytes_left() / 2 + 1 {
        let bytes_left = numbers.bytes_left();
        return Err(numbers.error(Problem::MoreThanTheFileHolds { gammas, planes, bytes_left }));
    }
    let gamma_deg = numbers.angles("vertical", gammas)?;
    check_gammas(numbers, &gamma_deg)?;
    let c_deg = numbers.angles("horizontal", planes)?;
    let symmetry = symmetry(numbers, &c_deg)?;
    let mut intensities = Vec::with_capacity(planes);
    for c in &c_deg {
        let mut plane = Vec::with_capacity(gammas);
        for gamma in &gamma_deg {
            plane.push(read_intensity(numbers, header.factor, *c, *gamma)?);
        }
        intensities.push(plane);
    }
    Ok(Table { symmetry, gamma_deg, c_deg, planes: intensities })
}

fn read_intensity(
    numbers: &mut Numbers<'_>,
    factor: f64,
    c_deg: f64,
    gamma_deg: f64,
) -> Result<f64, Lm63Error> {
    let what = || format!("the intensity at C {c_deg}°, γ {gamma_deg}°");
    let found = numbers.next(what)?;
    let intensity = found * factor;
    if (0.0..=INTENSITY_MAX).contains(&intensity) {
        return Ok(intensity);
    }
    let expected = "0 to 1e30 with all factors";
    Err(numbers.error(Problem::Inadmissible { what: what(), expected, found }))
}

/// By the standard γ covers the lower half, the upper half or both, whole.
fn check_gammas(numbers: &Numbers<'_>, gamma_deg: &[f64]) -> Result<(), Lm63Error> {
    let (first, last) = (gamma_deg[0], gamma_deg[gamma_deg.len() - 1]);
    let refuse = |what: &str, expected, found| {
        Err(numbers.error(Problem::Inadmissible { what: what.to_owned(), expected, found }))
    };
    if !is(first, 0.0) && !is(first, 90.0) {
        return refuse("the first vertical angle", "0 or 90°", first);
    }
    if !is(last, 90.0) && !is(last, 180.0) {
        return refuse("the last vertical angle", "90 or 180°", last);
    }
    Ok(())
}

/// What the range of the planes says about the planes that aren't there.
fn symmetry(numbers: &Numbers<'_>, c_deg: &[f64]) -> Result<Symmetry, Lm63Error> {
    let (first, last) = (c_deg[0], c_deg[c_deg.len() - 1]);
    let refuse = |what: &str, expected, found| {
        Err(numbers.error(Problem::Inadmissible { what: what.to_owned(), expected, found }))
    };
    match (is(first, 0.0), is(first, 90.0)) {
        (true, _) if is(last, 0.0) => Ok(Symmetry::Rotational),
        (true, _) if is(last, 90.0) => Ok(Symmetry::Quadrant),
        (true, _) if is(last, 180.0) => Ok(Symmetry::AboutC0),
        (true, _) if is(last, 360.0) => Ok(Symmetry::None),
        (true, _) => refuse("the last horizontal angle", "0, 90, 180 or 360°", last),
        (_, true) if is(last, 270.0) => Ok(Symmetry::AboutC90),
        (_, true) => refuse("the last horizontal angle", "270° after a first one of 90°", last),
        _ => refuse("the first horizontal angle", "0 or 90°", first),
    }
}

/// Whole degrees in a decimal number are exact.
#[expect(
    clippy::float_cmp,
    reason = "the ends of the ranges are exact, and interpolation relies on it"
)]
fn is(angle: f64, whole: f64) -> bool {
    angle == whole
}

fn assemble(
    label: Label,
    tilt: Option<Tilt>,
    header: &Header,
    table: Table,
    lines: &[&str],
) -> Photometry {
    let mut notes = Vec::new();
    let unit = label.unit.unwrap_or(IntensityUnit::Candela);
    if label.unit.is_none() {
        notes.push(Note::UnitAssumed { unit });
    }
    if tilt.is_some() {
        notes.push(Note::TiltNotApplied);
    }
    if header.feet {
        notes.push(Note::Feet);
    }
    if matches!(header.opening, Opening::Unlisted { .. }) {
        notes.push(Note::UnlistedOpening);
    }
    notes.extend(header.future_use.map(|found| Note::FutureUse { found }));
    notes.extend(long_lines(lines));
    let mut photometry = Photometry {
        version: label.version,
        keywords: label.keywords,
        tilt,
        lamps: header.lamps,
        lumens_per_lamp: header.lumens_per_lamp,
        input_w: header.input_w,
        opening: header.opening,
        intensity_unit: unit,
        symmetry: table.symmetry,
        gamma_deg: table.gamma_deg,
        c_deg: table.c_deg,
        planes: table.planes,
        notes,
    };
    photometry.settle();
    photometry
}

fn long_lines(lines: &[&str]) -> Option<Note> {
    // Two characters of the standard's 256 are the line's end.
    let long = |line: &&str| line.chars().count() + 2 > LINE_MAX;
    let first = lines.iter().position(long)?;
    let longest = lines.iter().map(|line| line.chars().count()).max()?;
    Some(Note::LongLines { first_line: first + 1, longest })
}
