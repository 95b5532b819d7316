//! From the rig file to a composer with its drivers.

use std::collections::{BTreeSet, VecDeque};

use super::Composer;
use super::meter::MeterPart;
use super::part::Part;
use crate::device::axes::Axes;
use crate::device::dynamixel::{Dynamixel, ServoAxis, ServoId, ShutterServo};
use crate::device::grbl::Grbl;
use crate::device::meter::{Line, Meter};
use crate::device::photometer::Photometer;
use crate::rig::{AxesDriver, AxesLink, Axis, AxisName, PhotometerLink, Port, Readback, Rig};

/// What messages call the port of a device that is simulated.
const SIMULATED: &str = "a simulated port";

impl Composer {
    /// Composes drivers to one: of the axes in the order of the rig file's links, and of the
    /// meter. `boot_id` is drawn anew for every composer: nobody can tell what its devices did
    /// before.
    pub fn new(
        rig: &Rig,
        links: &[AxesLink],
        axes: Vec<Box<dyn Axes>>,
        photometer: Box<dyn Photometer>,
        boot_id: u32,
    ) -> Self {
        let parts = links.iter().zip(axes).map(|(link, driver)| part(rig, link, driver));
        Self {
            parts: parts.collect(),
            meter: MeterPart {
                driver: photometer,
                full_scales: rig.detector.gains.iter().map(|gain| gain.full_scale_a).collect(),
                adc: rig.detector.adc,
                facts: None,
                awaited: None,
                is_zeroed: false,
                exposed: None,
                shutter: None,
                axes_time_s: None,
                is_at_fault: false,
                is_gone: false,
            },
            boot_id,
            homed: fixed(rig),
            fixed: fixed(rig),
            here: vec![0; rig.axes.len()],
            queue: VecDeque::new(),
            running: None,
            last_id: None,
            unacknowledged: BTreeSet::new(),
            fault: None,
            opening: None,
            halting: None,
            said: VecDeque::new(),
        }
    }
}

impl Composer {
    /// The drivers of a rig's devices, composed; `None` where a controller of gonio's own drives
    /// all of it.
    pub fn of(rig: &Rig, boot_id: u32) -> Option<Self> {
        let devices = rig.devices.as_ref()?;
        let axes = devices.axes.iter().map(|link| axes_driver(rig, link)).collect();
        let photometer = photometer_driver(rig, &devices.photometer);
        Some(Self::new(rig, &devices.axes, axes, photometer, boot_id))
    }
}

/// The channels of axes that nothing moves.
fn fixed(rig: &Rig) -> u8 {
    let fixed = rig.axes.iter().filter(|axis| axis.fixed.is_some());
    fixed.fold(0, |mask, axis| mask | 1 << axis.channel)
}

fn axes_driver(rig: &Rig, link: &AxesLink) -> Box<dyn Axes> {
    let port = port_name(link.port.as_ref());
    match &link.driver {
        AxesDriver::Dynamixel { ids, shutter, tolerance_steps } => {
            let servos = servos(rig, link, ids);
            let shutter = shutter.and_then(|shutter| {
                let id = ServoId::new(shutter.id)?;
                Some(ShutterServo { id, open: shutter.open_steps, closed: shutter.closed_steps })
            });
            Box::new(Dynamixel::new(port, link.baud, servos, shutter, *tolerance_steps))
        }
        AxesDriver::Grbl { letters, shutter } => Box::new(Grbl::new(port, letters, *shutter)),
    }
}

/// The servos of a bus, as the rig file has their axes: in steps from their own zeros.
fn servos(rig: &Rig, link: &AxesLink, ids: &[u8]) -> Vec<ServoAxis> {
    let places = link.axes.iter().zip(&link.zeros).zip(ids);
    let servo = |((name, zero), id): ((&AxisName, &f64), &u8)| {
        let axis = rig.axes.iter().find(|axis| axis.name == *name)?;
        let (low, high) = axis.count_limits();
        let zero = axis.counts(*zero);
        Some(ServoAxis {
            axis: name.name(),
            id: ServoId::new(*id)?,
            speed: axis.counts_per_s(),
            acceleration: axis.counts_per_s2(),
            travel: (low.saturating_add(zero), high.saturating_add(zero)),
        })
    };
    places.filter_map(servo).collect()
}

fn photometer_driver(rig: &Rig, link: &PhotometerLink) -> Box<dyn Photometer> {
    let line = Line {
        port: port_name(link.port.as_ref()).to_owned(),
        baud: link.baud,
        full_scales: rig.detector.gains.iter().map(|gain| gain.full_scale_a).collect(),
        rate_hz: rig.detector.adc.rate_hz,
    };
    Box::new(Meter::of(&line, &link.driver))
}

fn port_name(port: Option<&Port>) -> &str {
    port.map_or(SIMULATED, |port| &port.path)
}

fn part(rig: &Rig, link: &AxesLink, driver: Box<dyn Axes>) -> Part {
    let axes: Vec<&Axis> = link
        .axes
        .iter()
        .filter_map(|name| rig.axes.iter().find(|axis| axis.name == *name))
        .collect();
    let zeros = axes.iter().zip(&link.zeros).map(|(axis, zero)| axis.counts(*zero));
    Part {
        driver,
        channels: axes.iter().map(|axis| usize::from(axis.channel)).collect(),
        zeros: zeros.collect(),
        says_encoder: axes.iter().map(|axis| axis.readback == Readback::Encoder).collect(),
        facts: None,
        awaited: None,
        fault: None,
        is_gone: false,
    }
}
