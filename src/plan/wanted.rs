//! What shall be derived from the fit, as people write it: one table each, `[[derive]]`, in a plan
//! or in a file of its own. Lengths are millimetres and angles degrees in the file; metres and
//! radians from here on. Knows no fit: whether the field reaches a level is seen later.

use fit::Ray;
use fit::derive::{
    ALL_DIRECTIONS, Cells, Cone, EnvironmentMap, HEMISPHERE, Layer, Medium, PointReceiver,
    Receiver, Reference, TwoPlaneGrid, Uncertain, Zone,
};
use glam::DVec3;
use radiometry::direction::wrap;
use spanned_toml::{Bounds, Problem, Table};

/// A quantity that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// `name`: what to call it, and its file; `None` where the file does not say.
    pub name: Option<String>,
    /// `kind`, and the keys that belong to it.
    pub asked: Asked,
    /// `window` or `immersion`: what stood in front of the sample, and is to be removed.
    pub medium: Medium,
}

/// Which quantity, where.
#[derive(Debug, Clone, PartialEq)]
pub enum Asked {
    /// Along a ray.
    Radiance(Ray),
    /// At a place, or mean over the region, into a zone.
    Exitance {
        /// Where, metres.
        at_m: Option<(f64, f64)>,
        /// Into which directions.
        zone: Zone,
    },
    /// Of the region as a whole in a direction.
    Intensity {
        /// From the normal, radians.
        theta_rad: f64,
        /// From +x towards +y, radians.
        phi_rad: f64,
    },
    /// The largest intensity.
    PeakIntensity,
    /// Into a zone about the normal.
    Flux(Zone),
    /// Into a cone about any axis.
    FluxInto(Cone),
    /// At a receiver.
    Irradiance(Receiver),
    /// At the point of an environment.
    IrradianceAtPoint(PointReceiver),
    /// From side to side of a plane.
    BeamAngle {
        /// The plane's azimuth, radians.
        phi_rad: f64,
        /// Share of the reference intensity.
        level: f64,
        /// What it is a share of.
        reference: Reference,
    },
    /// Seen from a point.
    Environment(EnvironmentMap),
    /// Resampled between two planes.
    TwoPlane(TwoPlaneGrid),
}

#[derive(Clone, Copy)]
enum Kind {
    Radiance,
    Exitance,
    Intensity,
    CentreIntensity,
    PeakIntensity,
    Flux,
    Irradiance,
    CylindricalIrradiance,
    SphericalIrradiance,
    BeamAngle,
    FieldAngle,
    Environment,
    TwoPlane,
}

/// Photometric names stand beside the radiometric ones; which unit comes out is the detector's.
const KINDS: [(&str, Kind); 22] = [
    ("radiance", Kind::Radiance),
    ("luminance", Kind::Radiance),
    ("exitance", Kind::Exitance),
    ("luminous_exitance", Kind::Exitance),
    ("intensity", Kind::Intensity),
    ("luminous_intensity", Kind::Intensity),
    ("centre_beam_intensity", Kind::CentreIntensity),
    ("center_beam_intensity", Kind::CentreIntensity),
    ("peak_intensity", Kind::PeakIntensity),
    ("flux", Kind::Flux),
    ("luminous_flux", Kind::Flux),
    ("irradiance", Kind::Irradiance),
    ("illuminance", Kind::Irradiance),
    ("cylindrical_irradiance", Kind::CylindricalIrradiance),
    ("cylindrical_illuminance", Kind::CylindricalIrradiance),
    ("spherical_irradiance", Kind::SphericalIrradiance),
    ("spherical_illuminance", Kind::SphericalIrradiance),
    ("beam_angle", Kind::BeamAngle),
    ("field_angle", Kind::FieldAngle),
    ("environment", Kind::Environment),
    ("environment_map", Kind::Environment),
    ("two_plane", Kind::TwoPlane),
];
/// Receivers and planes are nearer than a kilometre.
const LENGTH_MM: Bounds = Bounds::between(-1e6, 1e6);
const SIZE_MM: Bounds = Bounds::positive_up_to(1e6);
const COMPONENT: Bounds = Bounds::between(-1e6, 1e6);
/// Over the hemisphere, and all round.
const HEMISPHERE_DEG: f64 = 90.0;
const SPHERE_DEG: f64 = 180.0;
const PHI_DEG: Bounds = Bounds::between(-720.0, 720.0);
/// A hemisphere's worth.
const HEMISPHERE_SR: f64 = core::f64::consts::TAU;
const LEVEL: Bounds = Bounds::between(1e-3, 0.999);
const INDEX: Bounds = Bounds::between(1.0, 10.0);
const ABSORPTION_PER_MM: Bounds = Bounds::between(0.0, 1e3);
const COUNT_MAX: i64 = 2_000;
const VERTICES_MAX: usize = 200;
const NAME_BYTES_MAX: usize = 60;
/// Most of them in one file.
const WANTED_MAX: usize = 200;
const BEAM_LEVEL: f64 = 0.5;
const FIELD_LEVEL: f64 = 0.1;
/// Rays of a two-plane grid.
const RAYS_MAX: f64 = 1e6;
const ROWS: usize = 18;
const COLUMNS: usize = 72;

impl Wanted {
    /// Reads every `[[derive]]` of a file's top, over a hemisphere of directions or `all_round`. A
    /// beam angle without a plane is two of them.
    pub fn read_all(root: &Table<'_>, all_round: bool) -> Result<Vec<Self>, Problem> {
        let tables = root.tables("derive")?;
        if tables.len() > WANTED_MAX {
            let what = format!("{} quantities", tables.len());
            let expected = format!("at most {WANTED_MAX}");
            return Err(root.problem("derive", &what, &expected, "ask for them in parts"));
        }
        let mut all: Vec<Self> = Vec::new();
        for table in tables {
            let wanted = Self::read(&table, all_round)?;
            let name = wanted.first().and_then(|w| w.name.clone());
            if name.is_some() && all.iter().any(|other| other.name == name) {
                let what = "is another quantity's name already";
                return Err(table.problem("name", what, "a name of its own", "change one of them"));
            }
            table.finish()?;
            all.extend(wanted);
        }
        Ok(all)
    }

    /// Reads one table; whoever calls it finishes the table.
    pub fn read(table: &Table<'_>, all_round: bool) -> Result<Vec<Self>, Problem> {
        let end_deg = if all_round { SPHERE_DEG } else { HEMISPHERE_DEG };
        let kind = table.required_choice("kind", &KINDS)?;
        let name = read_name(table)?;
        let medium = read_medium(table)?;
        let asked = match kind {
            Kind::Radiance => vec![Asked::Radiance(read_ray(table, end_deg)?)],
            Kind::Exitance => {
                let (at_m, zone) = (read_place(table)?, read_zone(table, HEMISPHERE, end_deg)?);
                vec![Asked::Exitance { at_m, zone }]
            }
            Kind::Intensity => {
                let (theta_rad, phi_rad) = read_direction(table, end_deg)?;
                vec![Asked::Intensity { theta_rad, phi_rad }]
            }
            Kind::CentreIntensity => vec![Asked::Intensity { theta_rad: 0.0, phi_rad: 0.0 }],
            Kind::PeakIntensity => vec![Asked::PeakIntensity],
            Kind::Flux => vec![read_flux(table, end_deg)?],
            Kind::Irradiance => vec![read_irradiance(table, all_round)?],
            Kind::CylindricalIrradiance => {
                let axis = read_axis(table, "axis")?;
                vec![Asked::IrradianceAtPoint(PointReceiver::Cylinder { axis })]
            }
            Kind::SphericalIrradiance => {
                vec![Asked::IrradianceAtPoint(PointReceiver::Sphere)]
            }
            Kind::BeamAngle => {
                let level = table.number("level", LEVEL)?.unwrap_or(BEAM_LEVEL);
                read_angles(table, level)?
            }
            Kind::FieldAngle => read_angles(table, FIELD_LEVEL)?,
            Kind::Environment => vec![Asked::Environment(read_environment(table, all_round)?)],
            Kind::TwoPlane => vec![Asked::TwoPlane(read_two_plane(table)?)],
        };
        let is_in_air = matches!(
            asked[0],
            Asked::Irradiance(_) | Asked::IrradianceAtPoint(_) | Asked::Environment(_)
        );
        if is_in_air && matches!(medium, Medium::Immersion(_)) {
            return Err(table.problem(
                "immersion",
                "the receiver lies in air",
                "no immersion, or a quantity of the emitter itself",
                "leave it out: what arrives in air is measured in air",
            ));
        }
        Ok(asked.into_iter().map(|asked| Self { name: name.clone(), asked, medium }).collect())
    }
}

/// Files are called after it.
fn read_name(table: &Table<'_>) -> Result<Option<String>, Problem> {
    let Some(name) = table.text("name")? else { return Ok(None) };
    let is_plain = |c: char| c.is_alphanumeric() || "-_".contains(c);
    if name.chars().all(is_plain) && name.len() <= NAME_BYTES_MAX {
        return Ok(Some(name.to_owned()));
    }
    Err(table.problem(
        "name",
        &format!("\"{name}\" can't name a file"),
        &format!("at most {NAME_BYTES_MAX} letters, digits, '-' and '_'"),
        "tables are kept in files named after it",
    ))
}

fn read_place(table: &Table<'_>) -> Result<Option<(f64, f64)>, Problem> {
    if !table.has("x_mm") && !table.has("y_mm") {
        table.leave("x_mm");
        table.leave("y_mm");
        return Ok(None);
    }
    let x_mm = table.required_number("x_mm", LENGTH_MM)?;
    Ok(Some((x_mm / 1e3, table.required_number("y_mm", LENGTH_MM)? / 1e3)))
}

/// θ and φ, or γ and C: γ = θ, C = -φ.
fn read_direction(table: &Table<'_>, end_deg: f64) -> Result<(f64, f64), Problem> {
    if table.has("gamma_deg") || table.has("c_deg") {
        let gamma_deg = table.required_number("gamma_deg", Bounds::between(0.0, end_deg))?;
        let c_deg = table.required_number("c_deg", PHI_DEG)?;
        return Ok((gamma_deg.to_radians(), wrap(-c_deg.to_radians())));
    }
    let theta_deg = table.required_number("theta_deg", Bounds::between(0.0, end_deg))?;
    let phi_deg = table.required_number("phi_deg", PHI_DEG)?;
    table.leave("gamma_deg");
    table.leave("c_deg");
    Ok((theta_deg.to_radians(), wrap(phi_deg.to_radians())))
}

fn read_ray(table: &Table<'_>, end_deg: f64) -> Result<Ray, Problem> {
    let x_mm = table.required_number("x_mm", LENGTH_MM)?;
    let y_mm = table.required_number("y_mm", LENGTH_MM)?;
    let (theta_rad, phi_rad) = read_direction(table, end_deg)?;
    Ok(Ray { x_m: x_mm / 1e3, y_m: y_mm / 1e3, theta_rad, phi_rad })
}

/// `theta_min_deg` and `theta_max_deg`; all of `whole` without them.
fn read_zone(table: &Table<'_>, whole: Zone, end_deg: f64) -> Result<Zone, Problem> {
    let from_deg = table.number("theta_min_deg", Bounds::between(0.0, end_deg))?;
    let to_deg = table.number("theta_max_deg", Bounds::positive_up_to(end_deg))?;
    let from_rad = from_deg.unwrap_or(0.0).to_radians();
    let to_rad = to_deg.map_or(whole.to_rad, f64::to_radians);
    if from_rad < to_rad {
        return Ok(Zone { from_rad, to_rad });
    }
    Err(table.problem(
        "theta_min_deg",
        &format!("{} is not below {}", from_rad.to_degrees(), to_rad.to_degrees()),
        "theta_min_deg below theta_max_deg (90 where it is not given)",
        "swap the two, or widen the zone",
    ))
}

/// A cone by its half angle or its solid angle, about the normal or another axis; else a zone.
fn read_flux(table: &Table<'_>, end_deg: f64) -> Result<Asked, Problem> {
    let half_deg = table.number("half_angle_deg", Bounds::positive_up_to(end_deg))?;
    let solid_angle_sr = table.number(
        "solid_angle_sr",
        Bounds::positive_up_to(HEMISPHERE_SR * end_deg / HEMISPHERE_DEG),
    )?;
    let half_angle_rad = match (half_deg, solid_angle_sr) {
        (None, None) => {
            let whole = if end_deg > HEMISPHERE_DEG { ALL_DIRECTIONS } else { HEMISPHERE };
            return Ok(Asked::Flux(read_zone(table, whole, end_deg)?));
        }
        (Some(_), Some(_)) => {
            let what = "the cone has a half angle and a solid angle";
            let help = "remove one: 2π (1 - cos half angle) is the other";
            return Err(table.problem("solid_angle_sr", what, "one of the two", help));
        }
        (Some(half_deg), None) => half_deg.to_radians(),
        // 2π (1 - cos α), by its half angle.
        (None, Some(sr)) => 2.0 * libm::asin((sr / (2.0 * core::f64::consts::TAU)).sqrt()),
    };
    let axis_theta_deg =
        table.number("axis_theta_deg", Bounds::between(0.0, end_deg))?.unwrap_or(0.0);
    let axis_phi_deg = table.number("axis_phi_deg", PHI_DEG)?.unwrap_or(0.0);
    let axis_theta_rad = axis_theta_deg.to_radians();
    let axis_phi_rad = wrap(axis_phi_deg.to_radians());
    Ok(Asked::FluxInto(Cone { axis_theta_rad, axis_phi_rad, half_angle_rad }))
}

fn required_vector(table: &Table<'_>, key: &str, bounds: Bounds) -> Result<DVec3, Problem> {
    let found = table.numbers(key, bounds, 3..=3)?;
    let found = found.ok_or_else(|| table.missing(key, "a list of three numbers"))?;
    Ok(DVec3::new(found[0], found[1], found[2]))
}

/// A vector that is a direction.
fn read_axis(table: &Table<'_>, key: &str) -> Result<DVec3, Problem> {
    let axis = required_vector(table, key, COMPONENT)?;
    if axis == DVec3::ZERO {
        let help = "[0, 0, 1] points along +z";
        return Err(table.problem(key, "has no direction", "three numbers, not all 0", help));
    }
    Ok(axis)
}

/// A receiver somewhere; where directions go all round, without a place, at the point itself.
fn read_irradiance(table: &Table<'_>, all_round: bool) -> Result<Asked, Problem> {
    if !all_round || table.has("vertices_mm") || table.has("at_mm") {
        return Ok(Asked::Irradiance(read_receiver(table)?));
    }
    table.leave("vertices_mm");
    table.leave("at_mm");
    let normal = read_axis(table, "normal")?;
    Ok(Asked::IrradianceAtPoint(PointReceiver::Face { normal }))
}

/// `vertices_mm`, a polygon; or `at_mm` and `normal`, a point; with `radius_mm` a disk.
fn read_receiver(table: &Table<'_>) -> Result<Receiver, Problem> {
    let vertices = table.points("vertices_mm", LENGTH_MM, 3..=VERTICES_MAX, 3..=3)?;
    let (key, receiver) = if let Some(vertices) = vertices {
        let vertices = vertices.iter().map(|v| DVec3::new(v[0], v[1], v[2]) / 1e3).collect();
        ("vertices_mm", Receiver::polygon(vertices))
    } else {
        let at_m = required_vector(table, "at_mm", LENGTH_MM)? / 1e3;
        let normal = required_vector(table, "normal", COMPONENT)?;
        let radius_mm = table.number("radius_mm", SIZE_MM)?;
        let point = || Receiver::point(at_m, normal);
        ("at_mm", radius_mm.map_or_else(point, |mm| Receiver::disk(at_m, normal, mm / 1e3)))
    };
    receiver.map_err(|error| {
        let expected = "a flat receiver, all of it above the sample's plane z = 0";
        table.problem(key, &error.to_string(), expected, "z is the third number, in millimetres")
    })
}

/// One plane by its azimuth, or both principal ones.
fn read_angles(table: &Table<'_>, level: f64) -> Result<Vec<Asked>, Problem> {
    let references = [("plane_peak", Reference::PlanePeak), ("centre", Reference::Centre)];
    let reference = table.choice("of", &references)?.unwrap_or(Reference::PlanePeak);
    let planes_deg = match table.number("c_deg", PHI_DEG)? {
        Some(c_deg) => vec![c_deg],
        None => vec![0.0, 90.0],
    };
    let angle = |c_deg: f64| {
        let phi_rad = wrap(-c_deg.to_radians());
        Asked::BeamAngle { phi_rad, level, reference }
    };
    Ok(planes_deg.into_iter().map(angle).collect())
}

fn read_environment(table: &Table<'_>, all_round: bool) -> Result<EnvironmentMap, Problem> {
    let normal = required_vector(table, "normal", COMPONENT)?;
    let at_m = if table.has("at_mm") || !all_round {
        required_vector(table, "at_mm", LENGTH_MM)? / 1e3
    } else {
        // An environment that was measured itself has one point.
        table.leave("at_mm");
        DVec3::ZERO
    };
    let place = if table.has("at_mm") { at_m } else { DVec3::Z };
    Receiver::point(place, normal).map_err(|error| {
        let expected = "a point above the sample's plane z = 0, with a normal";
        table.problem(
            "at_mm",
            &error.to_string(),
            expected,
            "z is the third number, in millimetres",
        )
    })?;
    let cells = [("lat-long", Cells::LatLong), ("equal-area", Cells::EqualArea)];
    Ok(EnvironmentMap {
        place_m: at_m,
        normal,
        cells: table.choice("cells", &cells)?.unwrap_or(Cells::LatLong),
        rows: read_count(table, "rows")?.unwrap_or(ROWS),
        columns: read_count(table, "columns")?.unwrap_or(COLUMNS),
    })
}

fn read_count(table: &Table<'_>, key: &str) -> Result<Option<usize>, Problem> {
    Ok(table.integer(key, 1..=COUNT_MAX)?.and_then(|count| usize::try_from(count).ok()))
}

fn read_two_plane(table: &Table<'_>) -> Result<TwoPlaneGrid, Problem> {
    let distance_m = table.required_number("distance_mm", SIZE_MM)? / 1e3;
    let side = |key: &str| -> Result<(f64, f64, usize), Problem> {
        let (from, to) = table.required_interval(&format!("{key}_mm"), LENGTH_MM)?;
        let count = format!("{key}_count");
        let expected = format!("an integer from 1 to {COUNT_MAX}");
        let count = read_count(table, &count)?.ok_or_else(|| table.missing(&count, &expected))?;
        Ok((from / 1e3, to / 1e3, count))
    };
    let grid =
        TwoPlaneGrid { distance_m, u: side("u")?, v: side("v")?, s: side("s")?, t: side("t")? };
    let rays = [grid.u, grid.v, grid.s, grid.t].iter().map(|side| side.2 as f64).product::<f64>();
    if rays > RAYS_MAX {
        let what = format!("the grid has {rays:.3e} rays");
        let help = "take fewer places a side";
        return Err(table.problem("u_count", &what, "at most 1000000", help));
    }
    Ok(grid)
}

/// `window` or `immersion`: a table of `index`, `thickness_mm`, `absorption_per_mm` and their `u_`.
fn read_medium(table: &Table<'_>) -> Result<Medium, Problem> {
    let window = table.table("window")?;
    let immersion = table.table("immersion")?;
    match (window, immersion) {
        (None, None) => Ok(Medium::Air),
        (Some(window), None) => Ok(Medium::Window(read_layer(window, SIZE_MM)?)),
        (None, Some(layer)) => Ok(Medium::Immersion(read_layer(layer, Bounds::between(0.0, 1e6))?)),
        (Some(_), Some(_)) => Err(table.problem(
            "immersion",
            "a window and an immersion at once",
            "one of the two",
            "a window has air on both sides; an immersed emitter has none",
        )),
    }
}

fn read_layer(table: Table<'_>, thickness: Bounds) -> Result<Layer, Problem> {
    let index = table.required_number("index", INDEX)?;
    let thickness_mm = table.required_number("thickness_mm", thickness)?;
    let absorption = table.number("absorption_per_mm", ABSORPTION_PER_MM)?.unwrap_or(0.0);
    let u = |key: &str| table.number(key, Bounds::NON_NEGATIVE).map(Option::unwrap_or_default);
    let layer = Layer {
        index: Uncertain { value: index, u: u("u_index")? },
        thickness_m: Uncertain { value: thickness_mm / 1e3, u: u("u_thickness_mm")? / 1e3 },
        absorption_per_m: Uncertain { value: absorption * 1e3, u: u("u_absorption_per_mm")? * 1e3 },
    };
    table.finish()?;
    Ok(layer)
}
