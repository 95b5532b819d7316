//! What a rig is put together of where no controller of gonio's own drives all of it: which port
//! carries what, and which axis is which there. It knows the names of drivers, not their words.

use std::collections::HashSet;
use std::time::Duration;

use spanned_toml::{Bounds, Problem, Table};

use super::{AXES, AxisName};

/// Serial lines run between these rates, baud.
const BAUD: core::ops::RangeInclusive<i64> = 300..=12_000_000;
const BOOT_WAIT_MS_MAX: i64 = 60_000;
/// No axis's zero lies further from its device's than this, in the file's unit.
const ZERO_MAX: f64 = 1e5;
/// grbl knows no others.
const LETTERS: &str = "XYZABCUVW";

/// The devices of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Devices {
    /// What moves the axes; each axis is moved by one of them, or by none and fixed.
    pub axes: Vec<AxesLink>,
    /// What reads the detector.
    pub photometer: PhotometerLink,
}

/// What moves some axes, and where it is.
#[derive(Debug, Clone, PartialEq)]
pub struct AxesLink {
    /// What it is.
    pub driver: AxesDriver,
    /// Where it is; `None` only on a simulated rig.
    pub port: Option<Port>,
    /// Bits a second, of a simulated one too.
    pub baud: u32,
    /// The axes that it moves, in the order of [`AXES`].
    pub axes: Vec<AxisName>,
    /// Where each one's zero lies from the device's, radians or metres.
    pub zeros: Vec<f64>,
}

/// A driver for axes, with what it alone needs to know.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AxesDriver {
    /// A board with grbl 1.1.
    Grbl {
        /// The board's letter for each axis, in the order of [`AxesLink::axes`].
        letters: Vec<char>,
        /// The output that closes a shutter, if one does.
        shutter: Option<GrblOutput>,
    },
}

/// A switched output of a grbl board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GrblOutput {
    /// Flood coolant: M8 on, M9 off.
    Flood,
    /// The spindle: M3 on, M5 off.
    Spindle,
}

/// What reads the detector, and where it is.
#[derive(Debug, Clone, PartialEq)]
pub struct PhotometerLink {
    /// What it is.
    pub driver: PhotometerDriver,
    /// Where it is; `None` only on a simulated rig.
    pub port: Option<Port>,
    /// Bits a second, of a simulated one too.
    pub baud: u32,
}

/// A driver for a meter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PhotometerDriver {
    /// A Keithley 6485 or 6487 picoammeter over RS-232.
    Keithley6485,
}

/// A serial port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Its path.
    pub path: String,
    /// Bits a second.
    pub baud: u32,
    /// Whether opening it resets the board.
    pub reset_on_open: bool,
    /// How long the board then takes before it listens.
    pub boot_wait: Duration,
}

impl Devices {
    /// Reads `[[axes_link]]` and `[photometer]`; `None` where the file has neither. `has_ports`
    /// is false on a simulated rig, which needs none.
    pub(super) fn read(root: &Table<'_>, has_ports: bool) -> Result<Option<Self>, Problem> {
        let tables = root.tables("axes_link")?;
        let meter = root.table("photometer")?;
        if tables.is_empty() && meter.is_none() {
            return Ok(None);
        }
        let mut ports = HashSet::new();
        let mut driven = HashSet::new();
        let mut axes = Vec::new();
        for table in tables {
            let link = read_axes_link(table, has_ports, &mut ports, &mut driven)?;
            axes.push(link);
        }
        if axes.is_empty() {
            return Err(root.missing("axes_link", "at least one [[axes_link]] beside [photometer]"));
        }
        let meter = meter.ok_or_else(|| {
            root.missing("photometer", "a table [photometer] beside [[axes_link]]")
        })?;
        let photometer = read_photometer(meter, has_ports, &mut ports)?;
        Ok(Some(Self { axes, photometer }))
    }

    /// Their ports, the meter's last; none on a simulated rig.
    pub fn ports(&self) -> impl Iterator<Item = &Port> {
        let axes = self.axes.iter().map(|link| link.port.as_ref());
        axes.chain([self.photometer.port.as_ref()]).flatten()
    }

    /// Which of them moves an axis, and as which of its own; `None` where none does.
    pub fn place_of(&self, axis: AxisName) -> Option<(usize, usize)> {
        self.axes.iter().enumerate().find_map(|(n, link)| {
            let place = link.axes.iter().position(|known| *known == axis)?;
            Some((n, place))
        })
    }
}

/// The keys of `[[axes_link]]`.
///
/// `driver` "grbl" · `port`, `baud`, `reset_on_open`, `boot_wait_ms` as in `[link]` · `letters`
/// (grbl): the board's letter of each axis that it moves, `{ theta = "X", phi = "Y" }` ·
/// `zero_deg`, `zero_mm`: where the axes' zeros lie, counted from the device's own,
/// `{ theta = -95 }`, 0 where absent · `shutter` (grbl) flood or spindle: the output that closes
/// one.
fn read_axes_link(
    table: Table<'_>,
    has_ports: bool,
    ports: &mut HashSet<String>,
    driven: &mut HashSet<AxisName>,
) -> Result<AxesLink, Problem> {
    table.required_choice("driver", &[("grbl", ())])?;
    let (axes, letters) = read_letters(&table)?;
    if let Some(twice) = axes.iter().find(|axis| !driven.insert(**axis)) {
        return Err(table.problem(
            "letters",
            &format!("{} is moved by another [[axes_link]] already", twice.name()),
            "each axis in one [[axes_link]]",
            "remove it from one of the two",
        ));
    }
    let outputs = [("flood", GrblOutput::Flood), ("spindle", GrblOutput::Spindle)];
    let driver = AxesDriver::Grbl { letters, shutter: table.choice("shutter", &outputs)? };
    let (port, baud) = read_port(&table, 115_200, has_ports, ports)?;
    let link = AxesLink { driver, port, baud, zeros: read_zeros(&table, &axes)?, axes };
    table.finish()?;
    Ok(link)
}

fn read_letters(table: &Table<'_>) -> Result<(Vec<AxisName>, Vec<char>), Problem> {
    let expected = "the board's letters by axis, as { theta = \"X\", phi = \"Y\" }";
    let map = table.table("letters")?.ok_or_else(|| table.missing("letters", expected))?;
    let (mut axes, mut letters) = (Vec::new(), Vec::new());
    for axis in AXES {
        let Some(text) = map.text(axis.name())? else { continue };
        let mut characters = text.chars();
        let refused = |what: &str| {
            map.problem(axis.name(), what, "one of X, Y, Z, A, B, C, U, V, W, each once", expected)
        };
        let letter = match (characters.next(), characters.next()) {
            (Some(letter), None) if LETTERS.contains(letter) => letter,
            _ => return Err(refused(&format!("\"{text}\" is no letter of an axis"))),
        };
        if letters.contains(&letter) {
            return Err(refused(&format!("{letter} is another axis's already")));
        }
        axes.push(axis);
        letters.push(letter);
    }
    if axes.is_empty() {
        return Err(table.problem("letters", "no axis", expected, "list the axes that it moves"));
    }
    map.finish()?;
    Ok((axes, letters))
}

fn read_zeros(table: &Table<'_>, axes: &[AxisName]) -> Result<Vec<f64>, Problem> {
    let tables = [table.table("zero_deg")?, table.table("zero_mm")?];
    let mut zeros = Vec::new();
    for axis in axes {
        let own = &tables[usize::from(!axis.is_rotary())];
        let bounds = Bounds::between(-ZERO_MAX, ZERO_MAX);
        let zero = own.as_ref().map(|table| table.number(axis.name(), bounds)).transpose()?;
        let zero = zero.flatten().unwrap_or(0.0);
        zeros.push(if axis.is_rotary() { zero.to_radians() } else { zero / 1e3 });
    }
    tables.into_iter().flatten().try_for_each(Table::finish)?;
    Ok(zeros)
}

/// The keys of `[photometer]`: `driver` "keithley-6485" · `port`, `baud`, `reset_on_open`,
/// `boot_wait_ms` as in `[link]`.
fn read_photometer(
    table: Table<'_>,
    has_ports: bool,
    ports: &mut HashSet<String>,
) -> Result<PhotometerLink, Problem> {
    let drivers = [("keithley-6485", PhotometerDriver::Keithley6485)];
    let driver = table.required_choice("driver", &drivers)?;
    let (port, baud) = read_port(&table, 9_600, has_ports, ports)?;
    table.finish()?;
    Ok(PhotometerLink { driver, port, baud })
}

/// The port of a table; on a simulated rig it is checked as well, and not used.
fn read_port(
    table: &Table<'_>,
    baud_default: u32,
    has_ports: bool,
    ports: &mut HashSet<String>,
) -> Result<(Option<Port>, u32), Problem> {
    let path = table.text("port")?;
    let baud = table.integer("baud", BAUD)?;
    let baud = baud.and_then(|baud| u32::try_from(baud).ok()).unwrap_or(baud_default);
    let reset_on_open = table.flag("reset_on_open")?.unwrap_or(false);
    let boot_wait_ms = table.integer("boot_wait_ms", 0..=BOOT_WAIT_MS_MAX)?;
    let boot_wait_ms = boot_wait_ms.map_or(0, i64::unsigned_abs);
    let Some(path) = path else {
        let missing = || table.missing("port", "the path of the device's port");
        return if has_ports { Err(missing()) } else { Ok((None, baud)) };
    };
    if !ports.insert(path.to_owned()) {
        return Err(table.problem(
            "port",
            &format!("\"{path}\" is another device's port already"),
            "a port of its own for each device",
            "correct one of the two; `gonio ports` lists those there are",
        ));
    }
    let boot_wait = Duration::from_millis(boot_wait_ms);
    let port = Port { path: path.to_owned(), baud, reset_on_open, boot_wait };
    Ok((Some(port), baud))
}
