//! The solver by itself, for `benches/peers/solver.sh`: a stream of made-up rows, or rows from
//! standard input. It measures no time: whoever starts it does.
//!
//! `solver stream N P` takes in N rows of P numbers in [-1, 1) and a right-hand side of coefficients
//! (j + 1)/P, and prints the largest error of a coefficient and its peak memory; numbers are splitmix64 of their place,
//! so that others can make the same. `solver rows P` reads lines of P numbers and a value and prints
//! the coefficients and the condition number. `solver local N THETA PHI` fits N readings of a smooth
//! field in splines of so many spans, penalised, and prints how many functions those are, the RMS error
//! over the readings' u, and its peak memory.

use std::error::Error;
use std::io::{self, BufRead};

use fit::triangle::Triangle;
use fit::{Angular, BasisSpec, Fine, Noise, Penalised, Penalty, Position, Ray, Region, Sample};
use std::f64::consts::{FRAC_PI_2, PI};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["stream", n, p] => stream(n.parse()?, p.parse()?),
        ["rows", p] => rows(p.parse()?),
        ["local", n, theta_spans, phi_spans] => {
            local(n.parse()?, theta_spans.parse()?, phi_spans.parse()?)
        }
        _ => Err("expected: stream N P, rows P, or local N THETA PHI".into()),
    }
}

fn stream(n: u64, p: usize) -> Result<(), Box<dyn Error>> {
    let expected: Vec<f64> = (1..=p).map(|j| j as f64 / p as f64).collect();
    let mut triangle = Triangle::new(p, 1);
    let mut row = vec![0.0; p + 1];
    let mut place = 0_u64;
    for _ in 0..n {
        row[p] = 0.0;
        for j in 0..p {
            place += 1;
            row[j] = number(place);
            row[p] += expected[j] * row[j];
        }
        triangle.absorb(&row);
    }
    let found = triangle.solve().ok_or("out of range")?.unknowns(0);
    let error = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("{error:e} {}", peak_kib()?);
    Ok(())
}

fn rows(p: usize) -> Result<(), Box<dyn Error>> {
    let mut triangle = Triangle::new(p, 1);
    for line in io::stdin().lock().lines() {
        let row: Vec<f64> = line?.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        if row.len() != p + 1 {
            return Err(format!("{} numbers in a line; expected {}", row.len(), p + 1).into());
        }
        triangle.absorb(&row);
    }
    let solution = triangle.solve().ok_or("out of range")?;
    let spectrum = solution.spectrum().ok_or("no singular values")?;
    for value in solution.unknowns(0) {
        println!("{value:e}");
    }
    println!("{:e}", spectrum.condition());
    Ok(())
}

fn local(n: u64, theta_spans: usize, phi_spans: usize) -> Result<(), Box<dyn Error>> {
    let field = |ray: &Ray| 1.0 + ray.theta_rad.cos() * (1.0 + 0.3 * (3.0 * ray.phi_rad).cos());
    let ray = |i: u64| Ray {
        x_m: 0.0,
        y_m: 0.0,
        theta_rad: (0.5 * (1.0 + number(2 * i + 1))).acos(),
        phi_rad: PI * number(2 * i + 2),
    };
    // Uniform, of unit variance times u².
    let noise = |i: u64| U * 3f64.sqrt() * number(u64::MAX / 2 + i);
    let sample = |i: u64| {
        let ray = ray(i);
        Sample { ray, value: field(&ray) + noise(i), noise: Noise::Fixed { variance: U * U } }
    };
    let samples: Vec<Sample> = (0..n).map(sample).collect();
    let angular = Angular::Splines { theta_spans, phi_spans, fine: Fine::NONE };
    let basis = BasisSpec { angular, position: Position::Legendre { degree: 0 } };
    let region = Region::surface((0.0, 0.0), (0.0, 0.0), FRAC_PI_2);
    let model = Penalised::new(basis, Penalty { power: 2.0, strength: 1.0 });
    let fit = fit::fit(&samples, &region, model, &[])?;
    let off = |i: u64| (fit.value(&ray(n + i)) - field(&ray(n + i))).powi(2);
    let rms = ((0..1000).map(off).sum::<f64>() / 1000.0).sqrt();
    println!("{} {:e} {}", fit.coefficients().len(), rms / U, peak_kib()?);
    Ok(())
}

/// Standard deviation of the readings' noise.
const U: f64 = 0.01;

/// The most memory that this program ever held, KiB. What `wait4` says counts the memory of whoever
/// started it, too.
fn peak_kib() -> Result<u64, Box<dyn Error>> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    Ok(line.ok_or("no VmHWM")?.trim_end_matches("kB").trim().parse()?)
}

/// splitmix64 (Steele, Lea & Flood 2014), its upper 53 bits in [-1, 1).
fn number(place: u64) -> f64 {
    let mut z = place.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-52) - 1.0
}
