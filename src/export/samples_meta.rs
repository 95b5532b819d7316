//! samples.meta.json: what samples.csv can't say in columns.

use std::io::{self, Write};

use serde_json::{Value, json};

use super::RayColumns;
use crate::rig::calibration::{Calibrated, Component, Effect, Flag};
use crate::rig::{Axis, AxisName, Rig};

/// What samples.meta.json says beside what rig and samples say themselves.
#[derive(Debug, Clone, Copy)]
pub struct SamplesMeta<'a> {
    /// The rig that took the samples.
    pub rig: &'a Rig,
    /// What the samples share; of a long run it need not have them all.
    pub calibrated: &'a Calibrated,
    /// The program's version.
    pub program_version: &'a str,
    /// Whether the rig is a simulated one.
    pub simulated: bool,
    /// The seed of everything random.
    pub seed: u64,
    /// The plan's name.
    pub plan_name: &'a str,
    /// The hash of its file.
    pub plan_hash: &'a str,
    /// When the run began: UTC, RFC 3339.
    pub started_utc: &'a str,
    /// The samples.
    pub targets_measured: usize,
    /// Those that carry a flag.
    pub samples_flagged: usize,
    /// Target readings that the plan asks for, repeats counted.
    pub targets_planned: usize,
    /// The effects that the scene called for; empty on hardware.
    pub effects: &'a [String],
}

impl SamplesMeta<'_> {
    /// Writes it, indented.
    pub fn write(&self, mut out: impl Write) -> io::Result<()> {
        serde_json::to_writer_pretty(&mut out, &self.value())?;
        out.write_all(b"\n")
    }

    fn value(&self) -> Value {
        let quantity = self.rig.detector.quantity;
        let (measured, planned) = (self.targets_measured, self.targets_planned);
        json!({
            "program": format!("gonio {}", self.program_version),
            "simulated": self.simulated,
            "seed": self.seed,
            "effects": self.effects,
            "rig": self.rig.name,
            "plan": self.plan_name,
            "plan_hash": self.plan_hash,
            "started_utc": self.started_utc,
            "quantity": quantity.name(),
            "unit": quantity.units()[0],
            "columns": self.columns(),
            "chart": "surface: (x, y) on the sample's plane, direction (theta, phi)",
            "coordinates": COORDINATES,
            "complete": measured == planned,
            "targets": format!("{measured} of {planned} targets measured"),
            "targets_measured": measured,
            "targets_planned": planned,
            "samples_flagged": self.samples_flagged,
            "flags": Flag::ALL.map(Flag::name),
            "common_components": self.components(),
            "pose": self.rig.axes.iter().map(axis).collect::<Value>(),
            "dark": self.darks(),
            "reference": self.reference(),
        })
    }

    fn columns(&self) -> Value {
        let quantity = self.rig.detector.quantity;
        let (radiance, unit) = (quantity.radiance_column(), quantity.units()[0]);
        let of = |unit: &str, meaning: &str| json!({"unit": unit, "meaning": meaning});
        let [x, y, theta, phi] = RayColumns::NAMES;
        json!({
            "index": of("", "the plan's target"),
            "time_s": of("s", "from the start of the run to the start of the integration"),
            x: of("mm", "measured"),
            y: of("mm", "measured"),
            theta: of("deg", "measured, from the sample's normal"),
            phi: of("deg", "measured, from +x towards +y, in (-180, 180]"),
            radiance: of(unit, "mean over the dwell, dark level subtracted"),
            format!("u_{radiance}"): of(unit, "combined standard uncertainty, k = 1, of the \
                value along the stated ray"),
            format!("u_independent_{radiance}"): of(unit, "its part that is independent from \
                sample to sample"),
            format!("u_common_{radiance}"): of(unit, "its part that samples share: \
                common_components"),
            "dwell_s": of("s", "length of the integration"),
            "flags": of("", "empty, or names joined by |"),
            "repeat": of("", "which of the plan's repeats, from 0"),
            "reading": of("", "the row of readings.csv"),
        })
    }

    fn components(&self) -> Value {
        let quantity = self.rig.detector.quantity;
        let gain = |gain: u8| self.rig.detector.gains.get(usize::from(gain)).map(|gain| &gain.name);
        let one = |Component { name, u, effect }: &Component| match *effect {
            Effect::Scale { gain: None } | Effect::Beam { .. } => {
                json!({"name": name, "u_relative": u})
            }
            Effect::Scale { gain: Some(of) } => {
                json!({"name": name, "u_relative": u, "gain": gain(of)})
            }
            Effect::Offset { gain: of } => {
                json!({"name": name, "u": u, "unit": quantity.units()[0], "gain": gain(of)})
            }
            Effect::Axis { axis, session } => {
                let (factor, unit) = file_unit(axis);
                json!({"name": name, "u": u * factor, "unit": unit, "session": session})
            }
            Effect::Alignment { of } => {
                let (factor, unit) = if of.is_angle() { DEGREES } else { MILLIMETRES };
                json!({"name": name, "u": u * factor, "unit": unit})
            }
            Effect::Readback { axis } => {
                let (factor, unit) = file_unit(axis);
                json!({"name": name, "u": u * factor, "unit": unit, "shared_by": "position"})
            }
        };
        self.calibrated.components.iter().map(one).collect()
    }

    fn darks(&self) -> Value {
        let darks = self.calibrated.darks.iter().map(|dark| {
            let gain = self.rig.detector.gains.get(usize::from(dark.gain));
            json!({
                "gain": gain.map(|gain| &gain.name),
                "readings": dark.readings,
                "level_a": dark.level_a,
                "u": dark.u_radiance,
                "unit": self.rig.detector.quantity.units()[0],
            })
        });
        darks.collect()
    }

    fn reference(&self) -> Value {
        self.calibrated.drift().map_or(Value::Null, |drift| {
            json!({
                "readings": drift.readings,
                "mean": drift.mean,
                "spread": drift.spread,
                "drift_per_s": drift.per_s,
                "u_drift_per_s": drift.u_per_s,
                "chi2": drift.chi2,
                "unit": self.rig.detector.quantity.units()[0],
            })
        })
    }
}

fn axis(axis: &Axis) -> Value {
    let (factor, unit) = file_unit(axis.name);
    json!({
        "axis": axis.name.name(),
        "unit": unit,
        "u_readback": axis.u_readback * factor,
        "u_homing": axis.u_homing * factor,
        "u_zero": axis.u_zero * factor,
    })
}

/// From the program's unit of an axis to that of files, and its name.
const fn file_unit(axis: AxisName) -> (f64, &'static str) {
    match axis {
        AxisName::Theta | AxisName::Phi => DEGREES,
        AxisName::X | AxisName::Y => MILLIMETRES,
    }
}

const DEGREES: (f64, &str) = (180.0 / std::f64::consts::PI, "deg");
const MILLIMETRES: (f64, &str) = (1e3, "mm");

const COORDINATES: &str = "the sample's plane is z = 0, its outward normal +z, the origin on the \
turntable's axis, x and y right-handed in the plane; (theta, phi) points from the sample to the \
detector, theta from +z, phi from +x towards +y; CIE: gamma = theta, C = -phi modulo 360";
