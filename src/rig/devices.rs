//! What a rig is put together of where no controller of gonio's own drives all of it: which port
//! carries what, and which axis is which there. It knows the names of drivers, not their words.

use std::collections::HashSet;
use std::time::Duration;

use spanned_toml::{Bounds, Problem, Table};

use super::meters::PhotometerDriver;
use super::{AXES, AxisName};

/// Serial lines run between these rates, baud.
const BAUD: core::ops::RangeInclusive<i64> = 300..=12_000_000;
const BOOT_WAIT_MS_MAX: i64 = 60_000;
/// No axis's zero lies further from its device's than this, in the file's unit.
const ZERO_MAX: f64 = 1e5;
/// Further than this from its goal no axis is where it was sent, steps of a servo's encoder.
const TOLERANCE_STEPS_MAX: i64 = 1024;
/// A servo holds against friction and load without an integrator unless it is set to.
const TOLERANCE_STEPS_DEFAULT: u32 = 12;
/// A shutter turns within one turn, and by more than its tolerance.
const SHUTTER_STEPS_MAX: i64 = 4095;
const SHUTTER_STEPS_MIN: u32 = 200;
/// The highest number of a servo on its bus.
const SERVO_ID_MAX: i64 = 252;
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
    /// Dynamixel servos of the X series on one bus.
    Dynamixel {
        /// The servo of each axis, in the order of [`AxesLink::axes`].
        ids: Vec<u8>,
        /// The servo that holds a shutter, if one does.
        shutter: Option<ShutterServo>,
        /// How far from its goal one may come to rest, steps of its encoder.
        tolerance_steps: u32,
    },
    /// A board with grbl 1.1.
    Grbl {
        /// The board's letter for each axis, in the order of [`AxesLink::axes`].
        letters: Vec<char>,
        /// The output that closes a shutter, if one does.
        shutter: Option<GrblOutput>,
    },
}

/// A servo that holds a shutter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShutterServo {
    /// Its number on the bus.
    pub id: u8,
    /// Where it stands when light reaches the detector, steps of its encoder.
    pub open_steps: i32,
    /// Where it stands when none does, steps of its encoder.
    pub closed_steps: i32,
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
    pub(super) fn read(
        root: &Table<'_>,
        has_ports: bool,
        gains: usize,
    ) -> Result<Option<Self>, Problem> {
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
        let photometer = read_photometer(meter, has_ports, gains, &mut ports)?;
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

#[derive(Debug, Clone, Copy)]
enum AxesKind {
    Dynamixel,
    Grbl,
}

/// The keys of `[[axes_link]]`.
///
/// `driver` "grbl" or "dynamixel" · `port`, `baud`, `reset_on_open`, `boot_wait_ms` as in `[link]`
/// · `letters` (grbl): the board's letter of each axis that it moves, `{ theta = "X", phi = "Y" }`
/// · `ids` (dynamixel): the servo of each axis, `{ theta = 1, phi = 2 }` · `tolerance_steps`
/// (dynamixel, default 12): how far from its goal a servo may come to rest · `zero_deg`,
/// `zero_mm`: where the axes' zeros lie, counted from the device's own, `{ theta = -95 }`, 0
/// where absent · `shutter` (grbl) flood or spindle: the output that closes one · `shutter`
/// (dynamixel): the servo that holds one, `{ id = 7, open_steps = 1024, closed_steps = 2048 }`.
fn read_axes_link(
    table: Table<'_>,
    has_ports: bool,
    ports: &mut HashSet<String>,
    driven: &mut HashSet<AxisName>,
) -> Result<AxesLink, Problem> {
    let kinds = [("grbl", AxesKind::Grbl), ("dynamixel", AxesKind::Dynamixel)];
    let kind = table.required_choice("driver", &kinds)?;
    let (axes, driver, key, baud) = match kind {
        AxesKind::Grbl => {
            let (axes, letters) = read_letters(&table)?;
            let outputs = [("flood", GrblOutput::Flood), ("spindle", GrblOutput::Spindle)];
            let shutter = table.choice("shutter", &outputs)?;
            (axes, AxesDriver::Grbl { letters, shutter }, "letters", 115_200)
        }
        AxesKind::Dynamixel => {
            let (axes, ids) = read_ids(&table)?;
            let tolerance = table.integer("tolerance_steps", 1..=TOLERANCE_STEPS_MAX)?;
            let tolerance_steps = tolerance.and_then(|steps| u32::try_from(steps).ok());
            let tolerance_steps = tolerance_steps.unwrap_or(TOLERANCE_STEPS_DEFAULT);
            let shutter = table.table("shutter")?.map(|table| read_shutter(table, &ids));
            let shutter = shutter.transpose()?;
            (axes, AxesDriver::Dynamixel { ids, shutter, tolerance_steps }, "ids", 57_600)
        }
    };
    if let Some(twice) = axes.iter().find(|axis| !driven.insert(**axis)) {
        return Err(table.problem(
            key,
            &format!("{} is moved by another [[axes_link]] already", twice.name()),
            "each axis in one [[axes_link]]",
            "remove it from one of the two",
        ));
    }
    let (port, baud) = read_port(&table, baud, has_ports, ports)?;
    let link = AxesLink { driver, port, baud, zeros: read_zeros(&table, &axes)?, axes };
    table.finish()?;
    Ok(link)
}

/// `shutter` of servos: `id` · `open_steps`, `closed_steps`.
fn read_shutter(table: Table<'_>, ids: &[u8]) -> Result<ShutterServo, Problem> {
    let id = table.required_integer("id", 0..=SERVO_ID_MAX)?;
    let id = u8::try_from(id).unwrap_or_default();
    if ids.contains(&id) {
        let (what, help) = (format!("servo {id} moves an axis"), "give the shutter's own servo");
        return Err(table.problem("id", &what, "a servo of its own", help));
    }
    let steps = |key: &str| {
        let steps = table.required_integer(key, 0..=SHUTTER_STEPS_MAX)?;
        Ok(i32::try_from(steps).unwrap_or_default())
    };
    let shutter =
        ShutterServo { id, open_steps: steps("open_steps")?, closed_steps: steps("closed_steps")? };
    if shutter.open_steps.abs_diff(shutter.closed_steps) < SHUTTER_STEPS_MIN {
        return Err(table.problem(
            "closed_steps",
            &format!("{} steps, beside {} open", shutter.closed_steps, shutter.open_steps),
            &format!("at least {SHUTTER_STEPS_MIN} steps apart"),
            "turn the servo by hand, and read its positions with `gonio ports --probe`",
        ));
    }
    table.finish()?;
    Ok(shutter)
}

fn read_ids(table: &Table<'_>) -> Result<(Vec<AxisName>, Vec<u8>), Problem> {
    let expected = "the servos' numbers by axis, as { theta = 1, phi = 2 }";
    let map = table.table("ids")?.ok_or_else(|| table.missing("ids", expected))?;
    let (mut axes, mut ids) = (Vec::new(), Vec::new());
    for axis in AXES {
        let Some(id) = map.integer(axis.name(), 0..=SERVO_ID_MAX)? else { continue };
        let id = u8::try_from(id).unwrap_or_default();
        if ids.contains(&id) {
            let what = format!("servo {id} moves another axis already");
            return Err(map.problem(axis.name(), &what, "a servo for each axis", expected));
        }
        axes.push(axis);
        ids.push(id);
    }
    if axes.is_empty() {
        return Err(table.problem("ids", "no axis", expected, "list the axes that they move"));
    }
    map.finish()?;
    Ok((axes, ids))
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

/// The keys of `[photometer]`: `driver` and those that go with it, see [`PhotometerDriver`] ·
/// `port`, `baud`, `reset_on_open`, `boot_wait_ms` as in `[link]`.
fn read_photometer(
    table: Table<'_>,
    has_ports: bool,
    gains: usize,
    ports: &mut HashSet<String>,
) -> Result<PhotometerLink, Problem> {
    let (driver, baud) = PhotometerDriver::read(&table, gains)?;
    let (port, baud) = read_port(&table, baud, has_ports, ports)?;
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
