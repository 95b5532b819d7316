//! `--derive`: what shall be derived from a fit, as a short text or a file, and what came of it.

use std::path::Path;

use fit::Fit;
use fit::derive::{DeriveError, Derived, EnvironmentCell, Field, TwoPlaneRay};
use spanned_toml::{Document, Source};

use super::failure::Failure;
use super::text::{percent, row, with_uncertainty};
use crate::export::{
    DerivedKind, DerivedOutcome, DerivedQuantity, DerivedTable, ExportError, write_atomically,
};
use crate::plan::{Asked, Wanted};
use crate::rig::Quantity;

/// Reads every SPEC: a file if its name ends in .toml, else `KIND KEY=VALUE ...`.
pub(crate) fn wanted(specs: &[String]) -> Result<Vec<Wanted>, Failure> {
    let mut all = Vec::new();
    for spec in specs {
        let path = Path::new(spec);
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml")) {
            all.extend(from_file(path)?);
        } else {
            let document = Document::parse(Source::new("--derive", &toml_of(spec)?))?;
            let root = document.root();
            all.extend(Wanted::read(&root)?);
            root.finish()?;
        }
    }
    Ok(all)
}

fn from_file(path: &Path) -> Result<Vec<Wanted>, Failure> {
    let document = Document::parse(Source::read(path)?)?;
    let root = document.root();
    let wanted = Wanted::read_all(&root)?;
    root.finish()?;
    if wanted.is_empty() {
        let what = format!("{}: asks for nothing; expected [[derive]] tables", path.display());
        return Err(Failure::with_help(what, "add [[derive]] and kind = \"flux\", for example"));
    }
    Ok(wanted)
}

/// The short form as the lines of a file: `intensity theta_deg=30` is `kind = "intensity"` and
/// `theta_deg = 30`. A list may be written `0,0,500`, and a word without quotes.
fn toml_of(spec: &str) -> Result<String, Failure> {
    let words = words(spec);
    let Some((kind, keys)) = words.split_first() else {
        let what = "--derive: found nothing; expected a kind and its keys, or a file";
        return Err(Failure::with_help(
            what,
            "for example --derive \"intensity theta_deg=30 phi_deg=0\"",
        ));
    };
    let mut text = format!("kind = {}\n", value_of(kind));
    for word in keys {
        let Some((key, value)) = word.split_once('=').filter(|(key, _)| !key.is_empty()) else {
            let what = format!("--derive \"{spec}\": found {word:?}; expected KEY=VALUE");
            return Err(Failure::with_help(what, "write theta_deg=30 without spaces about the ="));
        };
        text.push_str(&format!("{key} = {}\n", value_of(value)));
    }
    Ok(text)
}

/// Words between spaces; brackets and quotes hold theirs together.
fn words(spec: &str) -> Vec<String> {
    let (mut words, mut word, mut depth, mut quote) = (Vec::new(), String::new(), 0_u32, None);
    for c in spec.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth = depth.saturating_sub(1),
            (None, c) if c.is_whitespace() && depth == 0 => {
                if !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
                continue;
            }
            _ => {}
        }
        word.push(c);
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

fn value_of(value: &str) -> String {
    let is_written = value.starts_with(['[', '{', '"', '\'']) || value.parse::<f64>().is_ok();
    if is_written || value == "true" || value == "false" {
        value.to_owned()
    } else if value.contains(',') {
        format!("[{value}]")
    } else {
        format!("{value:?}")
    }
}

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
        let peak = if wanted.asked == Asked::PeakIntensity { "peak_" } else { "" };
        wanted.name.clone().unwrap_or_else(|| format!("{peak}{}", kind.quantity(quantity)))
    };
    let one = |kind: DerivedKind, outcome: Result<DerivedOutcome, DeriveError>| {
        let name = match (&wanted.asked, &wanted.name) {
            (Asked::BeamAngle { phi_rad, level, .. }, name) => {
                angle_name(name.as_deref(), *phi_rad, *level)
            }
            _ => base(kind),
        };
        let outcome = outcome.map_err(|error| error.to_string());
        DerivedQuantity { name, kind, asked: in_words(wanted), outcome }
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
        Asked::Environment(map) => {
            field.environment(map).map(|cells| DerivedOutcome::Table(cells_table(quantity, &cells)))
        }
        Asked::TwoPlane(grid) => {
            field.two_plane(grid).map(|rays| DerivedOutcome::Table(rays_table(quantity, &rays)))
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
        Asked::Irradiance(_) => DerivedKind::Irradiance,
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

/// C of a plane's azimuth, degrees in [0, 360).
fn c_deg(phi_rad: f64) -> f64 {
    let c_deg = (-phi_rad.to_degrees()).rem_euclid(360.0);
    // Radians to degrees and back costs a last digit, which nobody wrote.
    let rounded = (c_deg * 1e9).round() / 1e9;
    if rounded >= 360.0 { 0.0 } else { rounded }
}

fn angle_name(name: Option<&str>, phi_rad: f64, level: f64) -> String {
    let percent = (level * 1e4).round() / 1e2;
    let kind = match percent {
        50.0 => "beam_angle".to_owned(),
        10.0 => "field_angle".to_owned(),
        other => format!("angle_at_{other}_percent"),
    };
    let c_deg = c_deg(phi_rad);
    let opposite = (c_deg + 180.0) % 360.0;
    format!("{}-C{c_deg}-C{opposite}", name.unwrap_or(&kind))
}

/// What was asked for, for people.
fn in_words(wanted: &Wanted) -> String {
    use fit::derive::Medium;
    let deg = |rad: f64| (rad.to_degrees() * 1e9).round() / 1e9;
    let mm = |m: f64| (m * 1e12).round() / 1e9;
    let place = |p: glam::DVec3| format!("({}, {}, {}) mm", mm(p.x), mm(p.y), mm(p.z));
    let zone = |zone: &fit::derive::Zone| {
        format!("within {}° to {}° of the normal", deg(zone.from_rad), deg(zone.to_rad))
    };
    let text = match &wanted.asked {
        Asked::Radiance(ray) => format!(
            "from ({}, {}) mm at theta {}°, phi {}°",
            mm(ray.x_m),
            mm(ray.y_m),
            deg(ray.theta_rad),
            deg(ray.phi_rad)
        ),
        Asked::Exitance { at_m: Some((x, y)), zone: z } => {
            format!("at ({}, {}) mm, {}", mm(*x), mm(*y), zone(z))
        }
        Asked::Exitance { at_m: None, zone: z } => format!("mean over the region, {}", zone(z)),
        Asked::Intensity { theta_rad, phi_rad } => {
            format!("at theta {}°, phi {}°", deg(*theta_rad), deg(*phi_rad))
        }
        Asked::PeakIntensity => "largest within the cone that was measured".to_owned(),
        Asked::Flux(z) => zone(z),
        Asked::FluxInto(cone) => format!(
            "within {}° of theta {}°, phi {}°",
            deg(cone.half_angle_rad),
            deg(cone.axis_theta_rad),
            deg(cone.axis_phi_rad)
        ),
        Asked::Irradiance(receiver) => {
            let n = receiver.normal();
            let size = receiver.area_m2() * 1e6;
            let shape = if size > 0.0 { format!("{size:.6} mm² about ") } else { String::new() };
            let [x, y, z] = [n.x, n.y, n.z].map(|c| (c * 1e6).round() / 1e6);
            format!("at {shape}{} facing ({x}, {y}, {z})", place(receiver.place_m()))
        }
        Asked::BeamAngle { phi_rad, level, reference } => {
            let of = match reference {
                fit::derive::Reference::PlanePeak => "the plane's largest intensity",
                fit::derive::Reference::Centre => "the centre beam intensity",
            };
            let percent = (level * 1e4).round() / 1e2;
            let c = c_deg(*phi_rad);
            format!("at {percent} % of {of}, plane C{c}-C{}", (c + 180.0) % 360.0)
        }
        Asked::Environment(map) => {
            format!("seen from {}, {} x {} cells", place(map.place_m), map.rows, map.columns)
        }
        Asked::TwoPlane(grid) => {
            format!("between z = 0 and z = {} mm", mm(grid.distance_m))
        }
    };
    match wanted.medium {
        Medium::Air => text,
        Medium::Window(layer) => {
            format!("{text}; window of n = {} removed", layer.index.value)
        }
        Medium::Immersion(layer) => {
            format!("{text}; within the emitter's medium of n = {}", layer.index.value)
        }
    }
}

fn value_columns(quantity: Quantity) -> [String; 3] {
    let radiance = quantity.radiance_column();
    [radiance.to_owned(), format!("u_{radiance}"), format!("u_independent_{radiance}")]
}

fn cells_table(quantity: Quantity, cells: &[EnvironmentCell]) -> DerivedTable {
    let names = [
        "theta_deg",
        "phi_deg",
        "towards_x",
        "towards_y",
        "towards_z",
        "solid_angle_sr",
        "covered",
        "measured",
    ];
    let row = |cell: &EnvironmentCell| {
        let fields = [
            cell.theta_rad.to_degrees(),
            cell.phi_rad.to_degrees(),
            cell.towards.x,
            cell.towards.y,
            cell.towards.z,
            cell.solid_angle_sr,
            cell.covered,
            cell.measured,
            cell.radiance.value,
            cell.radiance.u,
            cell.radiance.u_independent,
        ];
        fields.map(Some).to_vec()
    };
    let columns = names.map(str::to_owned).into_iter().chain(value_columns(quantity));
    DerivedTable { columns: columns.collect(), rows: cells.iter().map(row).collect() }
}

fn rays_table(quantity: Quantity, rays: &[TwoPlaneRay]) -> DerivedTable {
    let names = ["u_mm", "v_mm", "s_mm", "t_mm", "theta_deg", "phi_deg", "measured"];
    let row = |ray: &TwoPlaneRay| {
        let place = ray.place;
        let fields = [
            place.u_m * 1e3,
            place.v_m * 1e3,
            place.s_m * 1e3,
            place.t_m * 1e3,
            ray.ray.theta_rad.to_degrees(),
            ray.ray.phi_rad.to_degrees(),
            f64::from(u8::from(ray.is_measured)),
        ];
        let value = ray.radiance;
        let values = [value.map(|v| v.value), value.map(|v| v.u), value.map(|v| v.u_independent)];
        fields.map(Some).into_iter().chain(values).collect()
    };
    let columns = names.map(str::to_owned).into_iter().chain(value_columns(quantity));
    DerivedTable { columns: columns.collect(), rows: rays.iter().map(row).collect() }
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
                        said.push_str(&format!(", {key} {value:.4}"));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_form_is_the_lines_of_a_file() {
        let text = toml_of("irradiance at_mm=0,0,500 normal=[0, 0, -1] name=desk").unwrap();
        let expected =
            "kind = \"irradiance\"\nat_mm = [0,0,500]\nnormal = [0, 0, -1]\nname = \"desk\"\n";
        assert_eq!(text, expected);
        let text =
            toml_of("flux window={index = 1.5, thickness_mm = 4} theta_max_deg=6e1").unwrap();
        assert!(text.contains("window = {index = 1.5, thickness_mm = 4}\ntheta_max_deg = 6e1"));
        assert_eq!(
            wanted(&["flux window.index=1.5 window.thickness_mm=4".to_owned()]).unwrap().len(),
            1
        );
        assert!(toml_of("  ").is_err() && toml_of("flux theta").is_err());
    }

    #[test]
    fn planes_are_named_by_c() {
        assert_eq!(angle_name(None, 0.0, 0.5), "beam_angle-C0-C180");
        assert_eq!(angle_name(None, -std::f64::consts::FRAC_PI_2, 0.1), "field_angle-C90-C270");
        assert_eq!(angle_name(Some("w"), -30f64.to_radians(), 0.25), "w-C30-C210");
    }
}
