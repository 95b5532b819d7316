//! A lit patch and a penumbra as the detector sees them, along its axis and over its whole beam:
//! `--answers` prints our values, their times and what they should be; without it, what
//! `benches/peers/lit.sh` measured beside it becomes a section of a document.
//!
//! What they should be is worked out here: the visible part of the lamp by a quadrature that knows
//! the edge's shadow line on it, the beam by a lattice of rays.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use benches::{Arguments, Section, Table, Unmeasured, call_ns, report};
use clap::Parser;
use glam::{DVec2, DVec3};
use radiometry::quadrature::gauss_legendre;
use sim::{
    Axis, Compiled, Nominal, NominalAxis, NominalDetector, NominalGain, Quantity, Ray, Region,
    Scene, Simulated, Terms, compile,
};
use spanned_toml::{Document, Source};

/// A lit patch and a penumbra, beside Mitsuba.
#[derive(Debug, Parser)]
struct Asked {
    /// What `benches/peers/lit.sh` wrote.
    measured: Option<PathBuf>,
    /// Print our own answers as CSV.
    #[arg(long)]
    answers: bool,
    #[command(flatten)]
    arguments: Arguments,
}

const SCENE: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.8\nx_mm = [-50, 50]\n\
                     y_mm = [-50, 50]\n[[lamp]]\nkind = \"disk\"\ncentre_mm = [0, 0, 1000]\n\
                     axis = [0, 0, -1]\nradius_mm = 40\nradiance_w_per_m2_sr = 1000\n";
const EDGE: &str = "[[occluder]]\nkind = \"half-plane\"\nx_max_mm = 0\nz_mm = 600\n";
const LAMP_M: (f64, f64) = (1.0, 0.04);
const EDGE_Z_M: f64 = 0.6;
const PUPIL_M: f64 = 0.006_25;
const SPOT_M: f64 = 0.002_5;
const DISTANCE_M: f64 = 0.3;
/// Of the axis: x, y, θ, φ.
const POSE: (f64, f64, f64, f64) = (0.01, 0.003, 0.5, 1.0);

fn main() -> ExitCode {
    let asked = Asked::parse();
    if asked.answers {
        return match answers() {
            Ok(text) => {
                print!("{text}");
                ExitCode::SUCCESS
            }
            Err(error) => {
                eprintln!("{error}");
                ExitCode::FAILURE
            }
        };
    }
    report(&asked.arguments, || {
        let path = asked.measured.as_ref();
        section(path.ok_or_else(|| Unmeasured::because("no file of measurements is named"))?)
    })
}

fn rig(has_edge: bool, has_beam: bool, tolerance: f64) -> Result<Arc<Compiled>, Unmeasured> {
    let text = format!("{SCENE}{}", if has_edge { EDGE } else { "" });
    let document = Document::parse(Source::new("scene.toml", text.as_str()));
    let document = document.map_err(|e| Unmeasured::because(e.to_string()))?;
    let load = |name: &str| Err(format!("{name}: no file is looked for here"));
    let scene = Scene::read(&document, Quantity::Radiance, &load);
    let scene = scene.map_err(|e| Unmeasured::because(e.to_string()))?;
    let side = (-0.02, 0.02);
    let mut terms = Terms {
        region: Some(Region { x_m: side, y_m: side, theta_max_rad: 1.0 }),
        tolerance: Some(tolerance),
        ..Terms::default()
    };
    let wish = if has_beam { &mut terms.force } else { &mut terms.without };
    wish.push("finite-beam".to_owned());
    Ok(Arc::new(compile(scene, nominal(), Simulated::default(), &terms)?))
}

/// Our answers: case, what it should be, tolerance, value, nanoseconds of a value in a scene that is compiled,
/// and of compiling it, with one value.
fn answers() -> Result<String, Unmeasured> {
    use std::fmt::Write as _;
    let mut text = "case,expected,tolerance,value,ns,compiled_ns\n".to_owned();
    let ray = Ray::new(POSE.0, POSE.1, POSE.2, POSE.3);
    let axis = Axis { spot: ray.point, direction: ray.direction };
    for (name, has_edge, has_beam) in [
        ("lit patch; axis", false, false),
        ("lit patch; beam", false, true),
        ("penumbra; axis", true, false),
        ("penumbra; beam", true, true),
    ] {
        let expected = if has_beam {
            over_beam(&axis, has_edge)
        } else {
            radiance(axis.spot.truncate(), has_edge, 48)
        };
        for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
            let began = Instant::now();
            let rig = rig(has_edge, has_beam, tolerance)?;
            let value = rig.seen_radiance(&axis);
            let compiled_ns = began.elapsed().as_secs_f64() * 1e9;
            let ns = call_ns(|| std::hint::black_box(rig.seen_radiance(&axis)));
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "{name},{expected:e},{tolerance:e},{value:e},{ns:.2},{compiled_ns:.0}"
            );
        }
    }
    Ok(text)
}

/// 0.8/π of the irradiance at a place: ∫ L h²/r⁴ over what is seen of the lamp's disk, whose shadow line
/// is straight.
fn radiance(place: DVec2, has_edge: bool, nodes: usize) -> f64 {
    let (height, radius) = LAMP_M;
    // Seen through the edge's plane at x > 0.
    let line = place.x - place.x * height / EDGE_Z_M;
    let from = if has_edge { (line / radius).clamp(-1.0, 1.0) } else { -1.0 };
    let (low, high) = (libm::asin(from), core::f64::consts::FRAC_PI_2);
    let rule = gauss_legendre(nodes);
    let mut sum = 0.0;
    for (u, weight) in &rule {
        let angle = f64::midpoint(low, high) + u * (high - low) / 2.0;
        let (x, half) = (radius * libm::sin(angle), radius * libm::cos(angle));
        for (v, part) in &rule {
            let apart = DVec2::new(x, v * half) - place;
            let square = apart.length_squared() + height * height;
            // dx = R cos t dt, dy = (half) dv.
            sum += weight * part * half * half * (high - low) / 2.0 * (height / square).powi(2);
        }
    }
    0.8 / core::f64::consts::PI * 1000.0 * sum
}

/// The mean over pupil and spot, by a lattice.
fn over_beam(axis: &Axis, has_edge: bool) -> f64 {
    const RAYS: u32 = 1 << 15;
    let (u, v) = axis.direction.any_orthonormal_pair();
    let disk = |radius: f64, a: f64, b: f64| {
        let at = DVec2::from_angle(core::f64::consts::TAU * b) * (radius * a.sqrt());
        u * at.x + v * at.y
    };
    // Powers of the root of t⁵ = t + 1 (Roberts 2018).
    let root = 1.167_303_978_261_418_7_f64;
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..RAYS {
        let at = |k: i32| (0.5 + f64::from(i) * root.powi(-k)).fract();
        let spot = axis.spot + disk(SPOT_M, at(1), at(2));
        let pupil = axis.spot + axis.direction * DISTANCE_M + disk(PUPIL_M, at(3), at(4));
        let direction = (pupil - spot).normalize();
        let weight = direction.dot(axis.direction).powi(4);
        let crossing: DVec3 = pupil - direction * (pupil.z / direction.z);
        sum += weight * radiance(crossing.truncate(), has_edge, 20);
        weights += weight;
    }
    sum / weights
}

/// What was measured: case, solver, effort, relative error, seconds.
struct Answer {
    case: String,
    solver: String,
    effort: String,
    error: f64,
    seconds: f64,
    /// On the clock, of compiling the scene with one value; none of Mitsuba's.
    compiled_seconds: Option<f64>,
}

fn section(path: &std::path::Path) -> Result<Section, Unmeasured> {
    let text = std::fs::read_to_string(path)?;
    let mut all = Vec::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [case, solver, effort, _, error, seconds, compiled] = cells[..] else {
            return Err(Unmeasured::because(format!("`{line}` has not seven columns")));
        };
        let [case, solver, effort] = [case, solver, effort].map(ToString::to_string);
        let (error, seconds) = (error.parse()?, seconds.parse()?);
        let compiled_seconds = if compiled.is_empty() { None } else { Some(compiled.parse()?) };
        all.push(Answer { case, solver, effort, error, seconds, compiled_seconds });
    }
    let mut section = Section::new("lit", "A lit patch and a penumbra, beside Mitsuba");
    section.say(
        "A Lambertian patch under a disk of light, bare and in the penumbra of an edge, as the \
         detector sees it along its axis and over its whole beam; one core, one run of \
         `benches/peers/lit.sh`, processor time a value, warm. Mitsuba 3.9.1 (`llvm_ad_rgb`, its \
         `path` integrator for direct light, all rays of a value in one kernel); its error is the \
         root mean square over 8 seeds. Ours: at tolerances of 1e-1 to 1e-5, in a scene that is \
         compiled: its effects are weighed, and over a beam the patch is read from a table made then. \
         What that takes once, with one value, on the clock, is the last column. Mitsuba solves the \
         more general problem: any shapes, any materials, textures, spectra and many bounces, and \
         many pixels at once, where the start of a kernel (most of its time at few samples) counts \
         once.",
    );
    let mut shown = Table::new(&[
        "case",
        "solver",
        "effort",
        "relative error",
        "time a value, µs",
        "compiling, µs",
    ]);
    let (mut least, mut quicker) = (f64::INFINITY, 0);
    for answer in &all {
        let Answer { case, solver, effort, error, seconds, compiled_seconds } = answer;
        let time = format!("{:.2}", seconds * 1e6);
        let compiling = compiled_seconds.map_or_else(String::new, |s| format!("{:.0}", s * 1e6));
        shown.row([case, solver, effort, &format!("{error:.1e}"), &time, &compiling]);
        if solver == "Mitsuba 3" {
            let ours = all.iter().filter(|other| {
                other.solver != *solver && other.case == *case && other.error <= *error
            });
            let quickest = ours.clone().map(|other| other.seconds).fold(f64::INFINITY, f64::min);
            least = least.min(seconds / quickest);
            let compiled = ours.filter_map(|other| other.compiled_seconds);
            quicker += usize::from(*seconds < compiled.fold(f64::INFINITY, f64::min));
        }
    }
    section.show(&shown);
    section.say(&format!(
        "At equal error, the least ratio of times over all of Mitsuba's rows: {least:.1}. One value \
         alone, compiling counted, takes longer than Mitsuba's warm one in {quicker} of its rows."
    ));
    section.aim("at equal error ten times faster than Mitsuba", least >= 10.0);
    Ok(section)
}

fn nominal() -> Nominal {
    let axis = |channel| NominalAxis {
        channel,
        home: 0.0,
        counts_per_unit: 20_000.0,
        travel_counts: (-72_000, 72_000),
        speed_counts_per_s: 24_000,
        acceleration_counts_per_s2: 48_000,
        settle_s: 0.0,
        has_encoder: true,
        u_zero: 0.0,
        u_homing: 0.0,
        u_readback: 0.0,
    };
    Nominal {
        quantity: Quantity::Radiance,
        axes: [0, 1, 2, 3].map(axis),
        detector: NominalDetector {
            distance_m: DISTANCE_M,
            u_distance_m: 0.0,
            pupil_radius_m: PUPIL_M,
            u_pupil_radius_m: 0.0,
            spot_radius_m: SPOT_M,
            u_spot_radius_m: 0.0,
            responsivity_a_per_w: 0.2,
            u_responsivity_relative: 0.0,
            read_noise_a: 0.0,
            gains: vec![NominalGain { name: "1 uA".into(), full_scale_a: 1e-6, u_relative: 0.0 }],
            adc_bits: 24,
            adc_rate_hz: 2000,
        },
    }
}
