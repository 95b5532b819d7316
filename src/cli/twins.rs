//! Simulated devices of other makes around one board: those of a rig file, or those that are asked
//! for by name.

use std::sync::Arc;

use super::args::Make;
use super::failure::Failure;
use super::setup::Stage;
use super::simulated::wire;
use crate::rig::{
    AXES, AxesDriver, AxesLink, Axis, AxisName, Devices, GrblOutput, PhotometerDriver, Rig,
    ScpiTable, ShutterServo,
};

/// Room between an axis's travel and its switch: five degrees or millimetres.
const ROOM_RAD: f64 = 0.087_266;
const ROOM_M: f64 = 0.005;

/// A device and its line.
#[derive(Debug, Clone)]
pub(super) struct Line {
    device: Device,
    /// Bits a second.
    pub(super) baud: u32,
}

#[derive(Debug, Clone)]
enum Device {
    Axes(AxesLink),
    Meter(sim::MeterMake),
}

impl Line {
    /// What it is, in words.
    pub(super) fn name(&self) -> &'static str {
        match &self.device {
            Device::Axes(link) => match link.driver {
                AxesDriver::Dynamixel { .. } => "bus of Dynamixel servos",
                AxesDriver::Grbl { .. } => "grbl board",
            },
            Device::Meter(sim::MeterMake::Keithley6485) => "Keithley 6485",
            Device::Meter(sim::MeterMake::Newport1830C) => "Newport 1830-C",
            Device::Meter(sim::MeterMake::Scpi(_)) => "meter as the rig file describes it",
            Device::Meter(sim::MeterMake::ThorlabsPm100) => "Thorlabs PM100D",
        }
    }

    /// Its driver's word in a rig file.
    const fn driver(&self) -> &'static str {
        match &self.device {
            Device::Axes(link) => match link.driver {
                AxesDriver::Dynamixel { .. } => "dynamixel",
                AxesDriver::Grbl { .. } => "grbl",
            },
            Device::Meter(sim::MeterMake::Keithley6485) => "keithley-6485",
            Device::Meter(sim::MeterMake::Newport1830C) => "newport-1830c",
            Device::Meter(sim::MeterMake::Scpi(_)) => "scpi",
            Device::Meter(sim::MeterMake::ThorlabsPm100) => "thorlabs-pm100",
        }
    }

    /// Whether this can go wrong with it.
    fn suffers(&self, kind: sim::FaultKind) -> bool {
        match kind {
            sim::FaultKind::Alarm => self.driver() == "grbl",
            sim::FaultKind::Overheating(id) | sim::FaultKind::Overload(id) => match &self.device {
                Device::Axes(AxesLink { driver: AxesDriver::Dynamixel { ids, .. }, .. }) => {
                    ids.contains(&id)
                }
                _ => false,
            },
            _ => true,
        }
    }

    const fn is(&self, make: Make) -> bool {
        match &self.device {
            Device::Axes(link) => match link.driver {
                AxesDriver::Dynamixel { .. } => matches!(make, Make::Dynamixel),
                AxesDriver::Grbl { .. } => matches!(make, Make::Grbl),
            },
            Device::Meter(meter) => match meter {
                sim::MeterMake::Keithley6485 => matches!(make, Make::Scpi | Make::Keithley),
                sim::MeterMake::Newport1830C => matches!(make, Make::Newport),
                sim::MeterMake::Scpi(_) => matches!(make, Make::Scpi),
                sim::MeterMake::ThorlabsPm100 => matches!(make, Make::Scpi | Make::Thorlabs),
            },
        }
    }
}

/// The devices of a rig file, the meter as the last.
pub(super) fn of(devices: &Devices) -> Vec<Line> {
    let axes = devices.axes.iter();
    let axes = axes.map(|link| Line { device: Device::Axes(link.clone()), baud: link.baud });
    let meter = match &devices.photometer.driver {
        PhotometerDriver::Keithley(_) => sim::MeterMake::Keithley6485,
        PhotometerDriver::Scpi(table) => sim::MeterMake::Scpi(Box::new(words(table))),
        PhotometerDriver::Newport(_) => sim::MeterMake::Newport1830C,
        PhotometerDriver::Thorlabs(_) => sim::MeterMake::ThorlabsPm100,
    };
    axes.chain([Line { device: Device::Meter(meter), baud: devices.photometer.baud }]).collect()
}

/// A table's words, for the instrument that speaks them.
fn words(table: &ScpiTable) -> sim::ScpiWords {
    sim::ScpiWords {
        identity: table.identity.clone(),
        ends_with_cr: table.ends_with_cr,
        set_up: table.set_up.clone(),
        zero: table.zero.clone(),
        range: table.range.clone(),
        read: table.read.clone(),
        element: table.element,
        has_error_queue: table.has_error_queue,
    }
}

/// The devices that are asked for; all of the rig file's where none is. `None`: gonio's own
/// controller. What the rig file has is as it has it; of what it has not, all axes are on one
/// device.
pub(super) fn wanted(makes: &[Make], rig: &Rig) -> Option<Vec<Line>> {
    let there = rig.devices.as_ref().map(of);
    if makes.is_empty() {
        return there;
    }
    let makes = makes.iter().filter(|make| **make != Make::Native);
    let wanted = makes.map(|make| {
        let known = there.iter().flatten().find(|line| line.is(*make)).cloned();
        known.unwrap_or_else(|| by_name(*make, rig))
    });
    let wanted: Vec<Line> = wanted.collect();
    (!wanted.is_empty()).then_some(wanted)
}

fn by_name(make: Make, rig: &Rig) -> Line {
    let moved: Vec<&Axis> = rig.axes.iter().filter(|axis| axis.fixed.is_none()).collect();
    let axes = |driver: AxesDriver, zeros: Vec<f64>, baud: u32| {
        let axes = moved.iter().map(|axis| axis.name).collect();
        let link = AxesLink { driver, port: None, baud, axes, zeros };
        Line { device: Device::Axes(link), baud }
    };
    let meter = |make: sim::MeterMake, baud: u32| Line { device: Device::Meter(make), baud };
    match make {
        Make::Dynamixel => {
            let ids = (1..).take(moved.len()).collect();
            let driver = AxesDriver::Dynamixel { ids, shutter: None, tolerance_steps: 12 };
            axes(driver, vec![0.0; moved.len()], 57_600)
        }
        Make::Grbl => {
            // It homes upwards, and counts down from its switches.
            let room = |axis: &Axis| if axis.name.is_rotary() { ROOM_RAD } else { ROOM_M };
            let zeros = moved.iter().map(|axis| -axis.travel.1 - room(axis)).collect();
            let letters = ['X', 'Y', 'Z', 'A'].into_iter().take(moved.len()).collect();
            let shutter = Some(GrblOutput::Flood);
            axes(AxesDriver::Grbl { letters, shutter }, zeros, 115_200)
        }
        Make::Keithley | Make::Native | Make::Scpi => meter(sim::MeterMake::Keithley6485, 9_600),
        Make::Newport => meter(sim::MeterMake::Newport1830C, 9_600),
        Make::Thorlabs => meter(sim::MeterMake::ThorlabsPm100, 115_200),
    }
}

/// Every fault that the rig file plans must happen to a device that is there and can suffer it.
pub(super) fn check_faults(rig: &Rig, lines: &[Line]) -> Result<(), Failure> {
    let Some(simulated) = rig.document().root().table("simulated")? else { return Ok(()) };
    let faults = simulated.tables("fault")?.into_iter().map(sim::DeviceFault::read);
    for (table, fault) in simulated.tables("fault")?.into_iter().zip(faults) {
        let fault = fault?;
        let device = &fault.device;
        let refused = |key: &str, what: String, expected: String| {
            Failure::from(table.problem(key, &what, &expected, "correct it, or remove this fault"))
        };
        let Some(line) = lines.iter().find(|line| line.driver() == *device) else {
            let there: Vec<&str> = lines.iter().map(Line::driver).collect();
            let there = if there.is_empty() {
                "none: gonio's own controller has [simulated.link]".to_owned()
            } else {
                there.join(", ")
            };
            let what = format!("{device}: no such device is simulated");
            return Err(refused("device", what, there));
        };
        if !line.suffers(fault.kind) {
            let what = format!("{}: nothing that a {} suffers", fault.kind, line.name());
            let expected = "alarm of a grbl, overload and overheating of a bus's servo".to_owned();
            return Err(refused("kind", what, expected));
        }
    }
    Ok(())
}

/// What happened to a device, for a person who looks on.
pub(super) fn note_of(note: sim::Note, lines: &[Line]) -> String {
    use sim::Note as N;
    let seconds = |at: firmware_protocol::Instant| {
        std::time::Duration::from_micros(at.micros()).as_secs_f64()
    };
    let name = |line: usize| lines.get(line).map_or("device", Line::name);
    match note {
        N::Began(at, line, kind) => format!("{:.3} s: the {}: {kind}", seconds(at), name(line)),
        N::Ended(at, line, kind) => {
            format!("{:.3} s: the {}: no longer {kind}", seconds(at), name(line))
        }
        N::AtRest(since) => format!("{:.3} s: the axes stand", seconds(since)),
    }
}

/// The devices around one board.
pub(super) fn bench(stage: &Stage, lines: &[Line], boot: u32) -> sim::Bench {
    let board = sim::SimulatedBoard::new(Arc::clone(&stage.compiled), boot);
    let nominal = board.nominal().clone();
    let mut bench = sim::Bench::new(board);
    for line in lines {
        let wire = wire(stage, line.baud);
        match &line.device {
            Device::Axes(link) => match &link.driver {
                AxesDriver::Dynamixel { ids, shutter, .. } => {
                    let mut servos = servos(&nominal, ids, link);
                    servos.extend(shutter.map(|shutter| {
                        let ShutterServo { id, open_steps, closed_steps } = shutter;
                        sim::ServoSetting::shutter(id, open_steps, closed_steps)
                    }));
                    let bus = sim::DynamixelBus::new(servos, bench.board_mut());
                    bench.plug(bus, wire);
                }
                AxesDriver::Grbl { letters, .. } => {
                    let twin = sim::GrblTwin::new(&nominal, &by_letter(letters, link));
                    bench.plug(twin, wire);
                }
            },
            Device::Meter(make) => {
                bench.plug(sim::MeterTwin::new(make.clone()), wire);
            }
        }
    }
    for fault in &stage.device_faults {
        if let Some(line) = lines.iter().position(|line| line.driver() == fault.device) {
            bench.plan_fault(line, fault.clone());
        }
    }
    bench
}

/// The servos of a bus: which channel each moves, and where its zero stands on its encoder.
fn servos(nominal: &sim::Nominal, ids: &[u8], link: &AxesLink) -> Vec<sim::ServoSetting> {
    let servo = |((id, name), zero): ((&u8, &AxisName), &f64)| {
        let place = AXES.iter().position(|axis| axis == name)?;
        let axis = nominal.axes.get(place)?;
        #[allow(clippy::cast_possible_truncation)] // the rig reader checked that counts fit
        let zero_steps = (zero * axis.counts_per_unit).round() as i32;
        let turn = 0..sim::ServoSetting::STEPS_A_TURN;
        let (low, high) = axis.travel_counts;
        let is_within = turn.contains(&(low + zero_steps)) && turn.contains(&(high + zero_steps));
        let setting = sim::ServoSetting::new(*id, axis.channel);
        let operating_mode = if is_within { 3 } else { 4 };
        Some(sim::ServoSetting { zero_steps, operating_mode, ..setting })
    };
    ids.iter().zip(&link.axes).zip(&link.zeros).filter_map(servo).collect()
}

/// What a grbl's axes move, in its own order: the place in the rig, and the zero in degrees or
/// millimetres.
fn by_letter(letters: &[char], link: &AxesLink) -> Vec<(usize, f64)> {
    let mut axes: Vec<(char, usize, f64)> = Vec::new();
    for ((letter, name), zero) in letters.iter().zip(&link.axes).zip(&link.zeros) {
        let place = AXES.iter().position(|axis| axis == name).unwrap_or_default();
        let zero = if name.is_rotary() { zero.to_degrees() } else { zero * 1e3 };
        axes.push((*letter, place, zero));
    }
    axes.sort_by_key(|(letter, ..)| "XYZABCUVW".find(*letter));
    axes.into_iter().map(|(_, place, zero)| (place, zero)).collect()
}
