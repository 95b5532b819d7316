//! `--derive`: what shall be derived from a fit, as a short text or a file, and what came of it.

mod spec;
mod tables;
mod words;

use std::fmt::Write as _;
use std::path::Path;

use fit::derive::{DeriveError, Derived, Field, PointReceiver};
use fit::{Chart, Fit};

use self::words::{angle_name, in_words};
use super::text::{percent, row, with_uncertainty};
use crate::export::{DerivedKind, DerivedOutcome, DerivedQuantity, ExportError, write_atomically};
use crate::plan::{Asked, Wanted};
use crate::rig::Quantity;

pub(crate) use spec::wanted;

/// Derives all of it; what can't be derived says why.
pub(crate) fn derive(fit: &Fit, quantity: Quantity, wanted: &[Wanted]) -> Vec<DerivedQuantity> {
    let mut all: Vec<DerivedQuantity> = Vec::new();
    for one in wanted {
        for mut found in derived(fit, quantity, one) {
            if one.name.is_none() && !matches!(one.asked, Asked::BeamAngle { .. }) {
                found.name = format!("{}-{}", found.name, all.len() + 1);
            }
            while all.iter().any(|other| other.name == found.name) {
                found.name.push_str("-again");
            }
            all.push(found);
        }
    }
    all
}

fn derived(fit: &Fit, quantity: Quantity, wanted: &Wanted) -> Vec<DerivedQuantity> {
    let base = |kind: DerivedKind| {
        let before = match wanted.asked {
            Asked::PeakIntensity => "peak_",
            Asked::IrradianceAtPoint(PointReceiver::Cylinder { .. }) => "cylindrical_",
            Asked::IrradianceAtPoint(PointReceiver::Sphere) => "spherical_",
            _ => "",
        };
        wanted.name.clone().unwrap_or_else(|| format!("{before}{}", kind.quantity(quantity)))
    };
    let one = |kind: DerivedKind, outcome: Result<DerivedOutcome, DeriveError>| {
        let name = match (&wanted.asked, &wanted.name) {
            (Asked::BeamAngle { phi_rad, level, .. }, name) => {
                angle_name(name.as_deref(), *phi_rad, *level)
            }
            _ => base(kind),
        };
        let outcome = outcome.map_err(|error| error.to_string());
        let asked = match (&wanted.asked, fit.region().chart) {
            (Asked::Flux(_), Chart::TwoPlane { .. }) => "through both rectangles".to_owned(),
            (Asked::Environment(map), Chart::Environment) => {
                format!("resampled all round, {} x {} cells", map.rows, map.columns)
            }
            _ => in_words(wanted),
        };
        DerivedQuantity { name, kind, asked, outcome }
    };
    let number = |derived: Derived| DerivedOutcome::Number {
        derived: Box::new(derived),
        further: Vec::new(),
    };
    let field = match Field::without(fit, wanted.medium) {
        Ok(field) => field,
        Err(error) => return vec![one(kind_of(&wanted.asked), Err(error))],
    };
    let kind = kind_of(&wanted.asked);
    let outcome = match &wanted.asked {
        Asked::Radiance(ray) => field.radiance(ray).map(number),
        Asked::Exitance { at_m: Some((x_m, y_m)), zone } => {
            field.exitance_at(*x_m, *y_m, *zone).map(number)
        }
        Asked::Exitance { at_m: None, zone } => field.mean_exitance(*zone).map(number),
        Asked::Intensity { theta_rad, phi_rad } => {
            field.intensity(*theta_rad, *phi_rad).map(number)
        }
        Asked::PeakIntensity => peak(&field),
        Asked::Flux(zone) => field.flux(*zone).map(number),
        Asked::FluxInto(cone) => field.flux_into(cone).map(number),
        Asked::BeamAngle { phi_rad, level, reference } => {
            field.beam_angle(*phi_rad, *level, *reference).map(|angle| number(angle.in_degrees()))
        }
        Asked::IrradianceAtPoint(receiver) => field.irradiance_at_point(receiver).map(number),
        Asked::Environment(map) => field
            .environment(map)
            .map(|cells| DerivedOutcome::Table(tables::cells(quantity, &cells))),
        Asked::TwoPlane(grid) => {
            field.two_plane(grid).map(|rays| DerivedOutcome::Table(tables::rays(quantity, &rays)))
        }
        Asked::Irradiance(receiver) => match field.received(receiver) {
            Err(error) => Err(error),
            Ok(received) => {
                let mut both = vec![one(kind, Ok(number(received.irradiance)))];
                if let Some(flux) = received.flux {
                    let mut flux = one(DerivedKind::Flux, Ok(number(flux)));
                    flux.name = format!("{}-{}", base(kind), DerivedKind::Flux.quantity(quantity));
                    both.push(flux);
                }
                return both;
            }
        },
    };
    vec![one(kind, outcome)]
}

fn kind_of(asked: &Asked) -> DerivedKind {
    match asked {
        Asked::Radiance(_) => DerivedKind::Radiance,
        Asked::Exitance { .. } => DerivedKind::Exitance,
        Asked::Intensity { .. } | Asked::PeakIntensity => DerivedKind::Intensity,
        Asked::Flux(_) | Asked::FluxInto(_) => DerivedKind::Flux,
        Asked::Irradiance(_) | Asked::IrradianceAtPoint(_) => DerivedKind::Irradiance,
        Asked::BeamAngle { .. } => DerivedKind::Angle,
        Asked::Environment(_) => DerivedKind::Environment,
        Asked::TwoPlane(_) => DerivedKind::TwoPlane,
    }
}

fn peak(field: &Field<'_>) -> Result<DerivedOutcome, DeriveError> {
    let peak = field.peak_intensity()?;
    Ok(DerivedOutcome::Number {
        derived: Box::new(peak.intensity),
        further: vec![
            ("theta_deg", Some(peak.theta_rad.to_degrees())),
            ("phi_deg", Some(peak.phi_rad.to_degrees())),
            ("u_theta_deg", peak.u_theta_rad.map(f64::to_degrees)),
            ("u_across_deg", peak.u_across_rad.map(f64::to_degrees)),
        ],
    })
}

/// Writes the tables into a folder, each whole or not at all.
pub(crate) fn write_tables(folder: &Path, derived: &[DerivedQuantity]) -> Result<(), ExportError> {
    for quantity in derived {
        if let Ok(DerivedOutcome::Table(table)) = &quantity.outcome {
            write_atomically(&folder.join(quantity.file_name()), |out| table.write(out))?;
        }
    }
    Ok(())
}

/// Rows of a summary.
pub(crate) fn rows(derived: &[DerivedQuantity], quantity: Quantity) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for one in derived {
        let said = match &one.outcome {
            Ok(DerivedOutcome::Number { derived, further }) => {
                let estimate = derived.estimate;
                let mut said =
                    with_uncertainty(estimate.value, estimate.u, one.kind.unit(quantity));
                for (key, value) in further {
                    if let Some(value) = value {
                        let _ = write!(said, ", {key} {value:.4}");
                    }
                }
                said
            }
            Ok(DerivedOutcome::Table(table)) => {
                format!("{} rows in {}", table.rows.len(), one.file_name())
            }
            Err(why) => format!("none: {why}"),
        };
        rows.push(row(&one.name, said));
        rows.push(row("", one.asked.clone()));
        if let Ok(DerivedOutcome::Number { derived, .. }) = &one.outcome {
            if let Some(fraction) = derived.measured_fraction.filter(|fraction| *fraction < 1.0) {
                rows.push(row(
                    "",
                    format!("{} of it from where it was measured", percent(fraction)),
                ));
            }
            rows.extend(derived.remarks.iter().map(|remark| row("", format!("note: {remark}"))));
        }
    }
    rows
}
