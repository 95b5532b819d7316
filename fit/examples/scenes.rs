//! Scenes of which the truth is known, for `benches/peers/fits.sh`: readings and truth to files that
//! other programs read too, and our own fit of them with everything chosen from the readings.
//!
//! `scenes DIR` writes `NAME.readings.csv` (place and direction in metres and radians, value, u),
//! `NAME.truth.csv` (the same without u, at rays drawn evenly in throughput over the region),
//! `NAME.ours.csv` (our value and its u at each of them) for every scene, and `scenes.csv` (what was
//! read and chosen, processor time). Noise comes from a seed.

#[allow(dead_code, reason = "tests share them")]
#[path = "../tests/scenes/mod.rs"]
mod drawn;
mod laid_out;

use drawn::Die;
use fit::{Noise, Optics, Ray, Region, Sample, Wish};
use glam::{DVec3, dvec3};
use laid_out::{PATCH, POINT, lobe, patches_of, truth_rays};
use radiometry::beam::Beam;
use radiometry::direction::{angles, unit};
use radiometry::quadrature::Sobol;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// A field, how it is read, and what a reading errs by.
struct Scene {
    name: &'static str,
    field: fn(&Ray) -> f64,
    region: Region,
    rays: Vec<Ray>,
    u: f64,
    beam: Option<Beam>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [directory, only @ ..] = arguments.as_slice() else {
        return Err("expected: scenes DIR [NAME ..]".into());
    };
    let directory = Path::new(directory);
    std::fs::create_dir_all(directory)?;
    let mut table = String::from("scene,readings,u,coefficients,basis,choice_s,fit_s\n");
    for scene in scenes()? {
        if only.is_empty() || only.iter().any(|name| name == scene.name) {
            table.push_str(&of_scene(&scene, directory)?);
        }
    }
    std::fs::write(directory.join("scenes.csv"), table)?;
    Ok(())
}

fn scenes() -> Result<Vec<Scene>, Box<dyn Error>> {
    let scene = |name, field, rays, u| Scene { name, field, region: POINT, rays, u, beam: None };
    let spot = Beam::of_spot(0.00625, 0.0025, 0.3)?;
    let off_gap = |ray: &Ray| !(35.0..45.0).contains(&ray.theta_rad.to_degrees());
    Ok(vec![
        scene("limb", limb, sweeps(80.0, 5.0, 8), 0.002),
        scene("batwing", batwing, sweeps(80.0, 4.0, 18), 0.002),
        scene("gap", batwing, sweeps(80.0, 4.0, 18).into_iter().filter(off_gap).collect(), 0.002),
        scene("gloss", gloss, sweeps(80.0, 2.5, 18), 0.002),
        scene("grazing", grazing, sweeps(88.0, 2.0, 12), 0.002),
        scene("cos400", cos400, sweeps(80.0, 1.0, 12), 0.002),
        scene("cos2000", cos2000, sweeps(80.0, 0.5, 12), 0.002),
        Scene {
            rays: patches(&PATCH, 3, 5.0, 9),
            region: PATCH,
            ..scene("moving", moving, vec![], 0.002)
        },
        Scene {
            rays: patches(&STRIPE, 15, 20.0, 2),
            region: STRIPE,
            beam: Some(spot),
            ..scene("stripe", stripe, vec![], 0.002)
        },
    ])
}

const STRIPE: Region = Region::surface((-0.012, 0.012), (-0.012, 0.012), 60.0 * PI / 180.0);

// Fields; the largest value of each is about 1.

fn limb(ray: &Ray) -> f64 {
    0.4 + 0.6 * libm::cos(ray.theta_rad)
}

fn batwing(ray: &Ray) -> f64 {
    0.2 + lobe(ray, 25.0, 35.0, 0.0) + lobe(ray, 25.0, 35.0, 180.0)
}

fn gloss(ray: &Ray) -> f64 {
    0.2 + lobe(ray, 80.0, 45.0, 30.0)
}

/// 3° in θ by 35° in φ, at 78°.
fn grazing(ray: &Ray) -> f64 {
    let across = (ray.theta_rad - 78f64.to_radians()) / 3f64.to_radians();
    0.2 + libm::exp(-0.5 * across * across) * libm::exp(2.7 * (libm::cos(ray.phi_rad) - 1.0))
}

/// An LED whose axis leans by 2°.
fn cos400(ray: &Ray) -> f64 {
    leaning(ray, 400.0)
}

fn cos2000(ray: &Ray) -> f64 {
    leaning(ray, 2000.0)
}

fn leaning(ray: &Ray, power: f64) -> f64 {
    libm::pow(unit(ray.theta_rad, ray.phi_rad).dot(unit(2f64.to_radians(), 0.7)).max(0.0), power)
}

/// A lobe that moves by 4° over the patch.
fn moving(ray: &Ray) -> f64 {
    let (theta_deg, phi_deg) = (35.0 + 100.0 * ray.x_m, 30.0 + 150.0 * ray.y_m);
    0.2 + lobe(ray, 30.0, theta_deg, phi_deg)
}

/// A bright line, 3.5 mm wide at half height, under a spot of 5 mm.
fn stripe(ray: &Ray) -> f64 {
    let across = ray.x_m / 0.0015;
    (0.1 + 0.9 * libm::exp(-0.5 * across * across)) * (0.5 + 0.5 * libm::cos(ray.theta_rad))
}

// Plans

/// Lines through the normal, `lines` of them half a turn round, read every `step_deg`.
fn sweeps(to_deg: f64, step_deg: f64, lines: usize) -> Vec<Ray> {
    patches_of(&POINT, 1, to_deg, step_deg, lines)
}

/// The same at places spread over a region.
fn patches(region: &Region, side: usize, step_deg: f64, lines: usize) -> Vec<Ray> {
    patches_of(region, side, region.theta_max_rad.to_degrees(), step_deg, lines)
}

/// (1/T) ∫ L dT by counting rays between points of pupil and spot, dT = cos cos dA dA / r².
fn read(beam: &Beam, ray: &Ray, field: fn(&Ray) -> f64) -> Result<f64, Box<dyn Error>> {
    let axis = unit(ray.theta_rad, ray.phi_rad);
    let side = unit(FRAC_PI_2, ray.phi_rad + FRAC_PI_2);
    let down = side.cross(axis);
    let h = beam.separation_m();
    let mut sobol = Sobol::<4>::new()?;
    let (mut sum, mut whole) = (0.0, 0.0);
    for _ in 0..BEAM_RAYS {
        let t = sobol.next_point().map(|bits| (f64::from(bits) + 0.5) * 2f64.powi(-32));
        let on_disk = |square: f64, turn: f64| -> DVec3 {
            let (sin, cos) = libm::sincos(TAU * turn);
            (down * cos + side * sin) * square.sqrt()
        };
        let spot = dvec3(ray.x_m, ray.y_m, 0.0) + on_disk(t[0], t[1]) * beam.stop_radius_m();
        let centre = dvec3(ray.x_m, ray.y_m, 0.0) + axis * h;
        let between = centre + on_disk(t[2], t[3]) * beam.pupil_radius_m() - spot;
        let weight = (h / between.length_squared()).powi(2);
        whole += weight;
        let place = spot - between * (spot.z / between.z);
        let (theta_rad, phi_rad) = angles(between);
        sum += weight * field(&Ray { x_m: place.x, y_m: place.y, theta_rad, phi_rad });
    }
    Ok(sum / whole)
}

// What is written

fn of_scene(scene: &Scene, directory: &Path) -> Result<String, Box<dyn Error>> {
    let noise = Noise::Fixed { variance: scene.u * scene.u };
    let mut die = Die::new(3);
    let mut samples = Vec::with_capacity(scene.rays.len());
    for ray in &scene.rays {
        let exact = match &scene.beam {
            Some(beam) => read(beam, ray, scene.field)?,
            None => (scene.field)(ray),
        };
        samples.push(Sample { ray: *ray, value: exact + scene.u * die.normal(), noise });
    }
    let optics = scene.beam.map(|beam| Optics { beam, outline: None });
    let began = Instant::now();
    let wish = Wish::default();
    let (model, _) = fit::choose(&samples, &scene.region, &wish, optics.as_ref())?;
    let chosen = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let fit = fit::fit_seen(&samples, &scene.region, model, &[], optics.as_ref())?;
    let fitted = began.elapsed().as_secs_f64();
    let (mut readings, mut truth, mut ours) = (String::new(), String::new(), String::new());
    for Sample { ray, value, .. } in &samples {
        writeln!(readings, "{},{value:e},{:e}", in_numbers(ray), scene.u)?;
    }
    for ray in truth_rays(&scene.region, TRUTH)? {
        writeln!(truth, "{},{:e}", in_numbers(&ray), (scene.field)(&ray))?;
        let found = fit.radiance(&ray);
        writeln!(ours, "{:e},{:e}", found.value, found.u)?;
    }
    for (kind, text) in [("readings", readings), ("truth", truth), ("ours", ours)] {
        std::fs::write(directory.join(format!("{}.{kind}.csv", scene.name)), text)?;
    }
    let coefficients = fit.coefficients().len();
    let basis = format!("{:?}", model.basis).replace(',', ";");
    let (name, u, count) = (scene.name, scene.u, samples.len());
    Ok(format!("{name},{count},{u:e},{coefficients},{basis},{chosen:.3},{fitted:.3}\n"))
}

fn in_numbers(ray: &Ray) -> String {
    format!("{:e},{:e},{:e},{:e}", ray.x_m, ray.y_m, ray.theta_rad, ray.phi_rad)
}

/// Rays that the truth is told along.
const TRUTH: usize = 20_000;
/// Rays of a beam, quasi-random: an error well below the noise.
const BEAM_RAYS: usize = 1 << 12;
