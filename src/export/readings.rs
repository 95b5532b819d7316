//! readings.csv: every reading as the device gave it, darks and references included.

use std::io::{self, Write};

use super::RayColumns;
use super::number::number;
use crate::rig::{AXES, DeviceTimes, Latched, Reading, ReadingKind, Rig, forward};

/// Writes readings.csv, in the order handed in: counts, gain, commanded and latched positions in
/// counts, the poses that they mean, and the device's clock; where several devices are the rig,
/// what their own clocks read, empty for one without.
pub fn write_readings(
    out: impl Write,
    rig: &Rig,
    readings: impl IntoIterator<Item = io::Result<Reading>>,
) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(columns(rig))?;
    for reading in readings {
        csv.write_record(fields(rig, &reading?))?;
    }
    csv.flush()
}

fn columns(rig: &Rig) -> Vec<String> {
    let mut columns: Vec<String> = [
        "reading",
        "kind",
        "index",
        "repeat",
        "session",
        "time_s",
        "gain",
        "n",
        "mean_counts",
        "variance_counts2",
        "min_counts",
        "max_counts",
        "saturated",
    ]
    .map(str::to_owned)
    .into();
    columns.extend(RayColumns::NAMES.map(|name| format!("commanded_{name}")));
    columns.extend(RayColumns::NAMES.map(str::to_owned));
    for place in ["commanded", "start", "end"] {
        columns.extend(AXES.map(|axis| format!("{place}_{}_counts", axis.name())));
    }
    columns.extend(["start_us", "end_us", "link_retries", "unsettled"].map(str::to_owned));
    if rig.devices.is_some() {
        columns.extend(["axes_time_s", "photometer_time_s"].map(str::to_owned));
    }
    columns
}

fn fields(rig: &Rig, reading: &Reading) -> Vec<String> {
    let (kind, index, repeat) = match reading.kind {
        ReadingKind::Dark => ("dark", None, None),
        ReadingKind::Reference => ("reference", None, None),
        ReadingKind::WarmUp => ("warm_up", None, None),
        ReadingKind::Target { index, repeat } => ("target", Some(index), Some(repeat)),
    };
    let or_empty = |number: Option<u32>| number.map_or(String::new(), |n| n.to_string());
    // A range that the rig does not have is shown by its number.
    let gain = rig.detector.gains.get(usize::from(reading.gain));
    let mut fields = vec![
        reading.id.to_string(),
        kind.to_owned(),
        or_empty(index),
        or_empty(repeat),
        reading.session.to_string(),
        number(reading.time_s),
        gain.map_or_else(|| reading.gain.to_string(), |gain| gain.name.clone()),
        reading.n.to_string(),
        number(reading.mean),
        number(reading.variance),
        reading.min.to_string(),
        reading.max.to_string(),
        reading.saturated.to_string(),
    ];
    let commanded = forward(rig.positions(reading.commanded));
    for pose in [commanded, rig.measured(reading).1] {
        fields.extend(RayColumns::from(pose).numbers().map(number));
    }
    for Latched(counts) in [reading.commanded, reading.start, reading.end] {
        fields.extend(counts.map(|count| count.to_string()));
    }
    fields.extend([
        reading.start_us.to_string(),
        reading.end_us.to_string(),
        reading.link_retries.to_string(),
        u8::from(reading.unsettled).to_string(),
    ]);
    if rig.devices.is_some() {
        let DeviceTimes { axes_s, photometer_s } = reading.device_times;
        fields.extend([axes_s, photometer_s].map(|time| time.map_or(String::new(), number)));
    }
    fields
}
