//! Derived quantities as they are handed on: to fit.json, to a terminal, to pictures; and their
//! tables as CSV. Names and units are those of the detector's quantity.

use std::io::{self, Write};

use fit::derive::Derived;
use serde_json::{Map, Value, json};

use super::number::number;
use crate::rig::Quantity;

/// What kind of number it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DerivedKind {
    /// Along a ray.
    Radiance,
    /// Of a place, or mean over the region.
    Exitance,
    /// Of the region in a direction.
    Intensity,
    /// From the region.
    Flux,
    /// At a receiver.
    Irradiance,
    /// From side to side of a plane, degrees.
    Angle,
    /// A table of radiances by direction.
    Environment,
    /// A table of radiances by ray.
    TwoPlane,
}

/// A quantity that was asked for, and what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivedQuantity {
    /// Its own among the fit's quantities.
    pub name: String,
    /// What it is.
    pub kind: DerivedKind,
    /// Where and how, for people.
    pub asked: String,
    /// The value in SI units, angles in degrees; or why there is none.
    pub outcome: Result<DerivedOutcome, String>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub enum DerivedOutcome {
    /// One number.
    Number {
        /// With its uncertainty, its budget and its remarks.
        derived: Box<Derived>,
        /// Further numbers that belong to it, such as a peak's direction, by their keys.
        further: Vec<(&'static str, Option<f64>)>,
    },
    /// Many.
    Table(DerivedTable),
}

/// A table, as its CSV file will have it.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivedTable {
    /// Names of the columns, units included.
    pub columns: Vec<String>,
    /// Rows; what does not exist is `None`, an empty field.
    pub rows: Vec<Vec<Option<f64>>>,
}

impl DerivedKind {
    /// What it is called where the detector yields that quantity.
    pub const fn quantity(self, quantity: Quantity) -> &'static str {
        let [radiometric, photometric, relative] = match self {
            Self::Radiance => ["radiance", "luminance", "radiance_relative"],
            Self::Exitance => ["exitance", "luminous_exitance", "exitance_relative"],
            Self::Intensity => ["intensity", "luminous_intensity", "intensity_relative"],
            Self::Flux => ["flux", "luminous_flux", "flux_relative"],
            Self::Irradiance => ["irradiance", "illuminance", "irradiance_relative"],
            Self::Angle => ["angle", "angle", "angle"],
            Self::Environment => ["environment", "environment", "environment"],
            Self::TwoPlane => ["two_plane", "two_plane", "two_plane"],
        };
        match quantity {
            Quantity::Radiance => radiometric,
            Quantity::Luminance => photometric,
            Quantity::Relative => relative,
        }
    }

    /// Its unit; empty for a relative one.
    pub const fn unit(self, quantity: Quantity) -> &'static str {
        let [radiance, exitance, flux] = quantity.units();
        match (self, quantity) {
            (Self::Angle, _) => "°",
            (Self::Intensity, Quantity::Radiance) => "W/sr",
            (Self::Intensity, Quantity::Luminance) => "cd",
            (Self::Irradiance, Quantity::Luminance) => "lx",
            (Self::Intensity, Quantity::Relative) => "",
            (Self::Radiance | Self::Environment | Self::TwoPlane, _) => radiance,
            (Self::Exitance | Self::Irradiance, _) => exitance,
            (Self::Flux, _) => flux,
        }
    }
}

impl DerivedQuantity {
    /// The name of its table's file.
    pub fn file_name(&self) -> String {
        format!("derived-{}.csv", self.name)
    }

    /// What fit.json says of it.
    pub fn json(&self, quantity: Quantity) -> Value {
        let mut object = Map::new();
        let mut put = |key: &str, value: Value| object.insert(key.to_owned(), value);
        put("name", json!(self.name));
        put("quantity", json!(self.kind.quantity(quantity)));
        put("unit", json!(self.kind.unit(quantity)));
        put("asked", json!(self.asked));
        match &self.outcome {
            Ok(DerivedOutcome::Number { derived, further }) => {
                put("value", json!(derived.estimate.value));
                put("u", json!(derived.estimate.u));
                put("u_independent", json!(derived.estimate.u_independent));
                for (key, value) in further {
                    put(key, json!(value));
                }
                put("measured_fraction", json!(derived.measured_fraction));
                put("quadrature_bound", json!(derived.quadrature_bound));
                let parts =
                    derived.budget.iter().map(|part| json!({"name": part.name, "u": part.u}));
                put("budget", parts.collect());
                let remarks = derived.remarks.iter().map(|remark| json!(remark.to_string()));
                put("remarks", remarks.collect());
            }
            Ok(DerivedOutcome::Table(table)) => {
                put("file", json!(self.file_name()));
                put("rows", json!(table.rows.len()));
                put("columns", json!(table.columns));
            }
            Err(why) => {
                put("value", Value::Null);
                put("why", json!(why));
            }
        }
        Value::Object(object)
    }
}

impl DerivedTable {
    /// Writes it as CSV.
    pub fn write(&self, out: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(&self.columns)?;
        for row in &self.rows {
            csv.write_record(row.iter().map(|field| field.map(number).unwrap_or_default()))?;
        }
        csv.flush()
    }
}
