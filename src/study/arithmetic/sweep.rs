//! Errors against times: every study by every method, at one effort after another.

use std::hint::black_box;

use serde_json::{Value, json};

use super::kernel::{self, Kind};
use super::{Method, Problem, Unmeasured, cases};

/// What is computed: a title, the case with the closed form or the kernel's own integral, and further
/// cases of the same value. The first one's integral is what the other methods do.
pub const STUDIES: [(&str, &[&str]); 12] = [
    ("square, 1 above its middle", &["poly004"]),
    ("disk, oblique receiver", &["disk022"]),
    ("ball, receiver tilted by 45°", &["sph015"]),
    ("disk behind a disk (penumbra)", &["pen029"]),
    ("rectangle behind a disk", &["pen056"]),
    ("disk to disk", &["ff_coax_disks01"]),
    ("disk to disk, off axis", &["ff_disk_disk_offset01"]),
    ("ball to ball", &["ff_sphere_sphere01"]),
    ("square to square, face to face", &["ff_par_rect01-polygons", "ff_par_rect01"]),
    ("square to square, common edge", &["ff_perp_rect01-polygons", "ff_perp_rect01"]),
    ("rectangles with a common edge, 53°", &["ff_wedge01"]),
    ("triangle to triangle", &["ff_polygons01-polygons"]),
];

const CLOSED: &str = "radiometry: closed form";
const INTEGRAL: &str = "radiometry: its own integral";
/// As curves are named, in the order of legends.
pub const METHODS: [&str; 5] =
    [CLOSED, INTEGRAL, "adaptive cubature", "quasi-Monte Carlo", "Monte Carlo"];
/// Relative, asked of what integrates to a tolerance.
const TOLERANCES: [f64; 7] = [1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12];

/// How much is asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Seeds of each random method.
    pub seeds: u64,
    /// A single value takes no longer than this; a ladder ends with it. Seconds.
    pub longest_s: f64,
}

/// One point of a curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Spot {
    /// Of which study.
    pub study: &'static str,
    /// By which method.
    pub method: String,
    /// With what effort; empty where there is no choice.
    pub effort: String,
    /// Time of one value.
    pub seconds: f64,
    /// Relative; of random methods the root mean square over the seeds.
    pub error: f64,
}

/// Every study by every method. `seconds_of` says how long a call takes, of which it may make as
/// many as it likes, in so many batches.
pub fn sweep(
    effort: Effort,
    mut seconds_of: impl FnMut(usize, &mut dyn FnMut()) -> f64,
) -> Result<Vec<Spot>, Unmeasured> {
    let cases = cases()?;
    let find = |id: &str| {
        let found = cases.iter().find(|case| case["id"] == json!(id));
        found.ok_or_else(|| Unmeasured::because(format!("no reference case {id}")))
    };
    let mut spots = Vec::new();
    for (study, ids) in STUDIES {
        for id in ids {
            kernel_spots(study, find(id)?, &mut seconds_of, &mut spots)?;
        }
        let case = find(ids[0])?;
        let (problem, exact) = (Problem::of_case(case)?, exact(case)?);
        for ladder in ladders() {
            for method in ladder {
                let error = method_error(&problem, exact, method, effort.seeds)?;
                let seconds = seconds_of(3, &mut || {
                    let _ = black_box(method.integrate(&problem, 0));
                });
                let (name, effort_made) = (method.name().to_owned(), method.effort());
                spots.push(Spot { study, method: name, effort: effort_made, seconds, error });
                if seconds > effort.longest_s {
                    break;
                }
            }
        }
    }
    Ok(spots)
}

fn exact(case: &Value) -> Result<f64, Unmeasured> {
    Ok(case["expected"].as_str().unwrap_or_default().parse()?)
}

/// The kernel itself: once, or for each tolerance where it integrates.
fn kernel_spots(
    study: &'static str,
    case: &Value,
    seconds_of: &mut impl FnMut(usize, &mut dyn FnMut()) -> f64,
    spots: &mut Vec<Spot>,
) -> Result<(), Unmeasured> {
    let exact = exact(case)?;
    let quantity = case["quantity"].as_str().unwrap_or_default();
    let call = |inputs: &Value| {
        let call = kernel::call(quantity, inputs)?;
        call.ok_or_else(|| Unmeasured::because(format!("no kernel {quantity}")))
    };
    let mut spot = |inputs: &Value, method: &str, effort: String| {
        let call = call(inputs)?;
        let error = (call.answer() / exact - 1.0).abs();
        let seconds = seconds_of(11, &mut || {
            black_box(call.answer());
        });
        spots.push(Spot { study, method: method.to_owned(), effort, seconds, error });
        Ok::<_, Unmeasured>(())
    };
    if call(&case["inputs"])?.kind != Kind::Integral {
        return spot(&case["inputs"], CLOSED, String::new());
    }
    for tolerance in TOLERANCES {
        let mut inputs = case["inputs"].clone();
        inputs["relative_tolerance"] = json!(tolerance);
        spot(&inputs, INTEGRAL, format!("tolerance {tolerance:.0e}"))?;
    }
    Ok(())
}

fn ladders() -> [Vec<Method>; 3] {
    let adaptive = |tolerance| Method::Adaptive { tolerance, budget: 10_000_000 };
    [
        TOLERANCES.map(adaptive).to_vec(),
        (11..=21).step_by(2).map(|power| Method::QuasiMonteCarlo(1 << power)).collect(),
        (6..=22).step_by(2).map(|power| Method::MonteCarlo(1 << power)).collect(),
    ]
}

fn method_error(
    problem: &Problem,
    exact: f64,
    method: Method,
    seeds: u64,
) -> Result<f64, Unmeasured> {
    let seeds = if method.is_random() { seeds.max(1) } else { 1 };
    let error = |seed| Ok(method.integrate(problem, seed)? / exact - 1.0);
    let errors: Vec<f64> = (0..seeds).map(error).collect::<Result<_, Unmeasured>>()?;
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    Ok(libm::sqrt(squares / errors.len() as f64))
}

/// The shortest time from which on every further effort of a method stays within the error.
pub fn fastest(spots: &[Spot], study: &str, method: &str, within: f64) -> Option<f64> {
    let of = spots.iter().filter(|spot| spot.study == study && spot.method == method);
    let reached = of.rev().take_while(|spot| spot.error <= within);
    reached.map(|spot| spot.seconds).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cases_are_those_of_the_reference_and_each_study_has_its_own() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/cases.jsonl");
        let all = std::fs::read_to_string(path).unwrap();
        assert!(super::super::CASES.lines().all(|line| all.lines().any(|other| other == line)));
        let cases = cases().unwrap();
        for (study, ids) in STUDIES {
            for id in ids {
                let case = cases.iter().find(|case| case["id"] == json!(id)).expect(study);
                assert!(Problem::of_case(case).is_ok() || *id != ids[0], "{study}");
            }
        }
    }

    #[test]
    fn every_study_is_answered_by_every_method_within_what_it_promises() {
        // A clock that counts: nothing takes long, so that ladders are cut after their first effort.
        let spots = sweep(Effort { seeds: 2, longest_s: 0.0 }, |_, _| 1.0).unwrap();
        for (study, _) in STUDIES {
            let of = |method: &str| -> Vec<&Spot> {
                spots.iter().filter(|s| s.study == study && s.method == method).collect()
            };
            let ours: Vec<&Spot> = [of(CLOSED), of(INTEGRAL)].concat();
            assert!(!ours.is_empty() && ours.iter().all(|spot| spot.error < 2e-2), "{ours:?}");
            assert!(ours.iter().any(|spot| spot.error < 1e-9), "{ours:?}");
            for method in &METHODS[2..] {
                let found = of(method);
                assert!(found.len() == 1 && found[0].error < 0.5, "{study}, {found:?}");
            }
        }
        assert_eq!(fastest(&spots, STUDIES[0].0, CLOSED, 1e-6), Some(1.0));
        assert_eq!(fastest(&spots, STUDIES[0].0, "Monte Carlo", 1e-12), None);
    }
}
