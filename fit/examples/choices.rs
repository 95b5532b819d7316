//! How far what is chosen from the readings is from the best that was tried: over lobes drawn at random, of
//! some width at some place, with a rim round the normal or without, read along some lines with some noise.
//!
//! `choices COUNT [FIRST]` prints one line a scene and a summary. The error is the throughput-weighted RMS over
//! the region, over that of the field; "missed" is the RMS error of readings left out over their u.

#[allow(dead_code, reason = "tests share them")]
#[path = "../tests/scenes/mod.rs"]
mod drawn;
mod laid_out;

use drawn::Die;
use fit::{Fit, Noise, Ray, Sample, Wish};
use laid_out::{PATCH, POINT, lobe, patches_of, truth_rays};
use std::error::Error;

/// What is drawn.
#[derive(Debug)]
struct Scene {
    /// exp(g (cos - 1)) about a direction.
    g: f64,
    theta_deg: f64,
    phi_deg: f64,
    /// Height of a rim at 50°, beside that of the lobe.
    rim: f64,
    step_deg: f64,
    lines: usize,
    /// Places along each side.
    side: usize,
    u: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<u64> = arguments.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    let (count, first) = match numbers.as_slice() {
        [count] => (*count, 0),
        [count, first] => (*count, *first),
        _ => return Err("expected: choices COUNT [FIRST]".into()),
    };
    println!("g,theta_deg,phi_deg,rim,step_deg,lines,side,u,missed,chosen,best");
    let mut ratios = Vec::new();
    for seed in first..first + count {
        let mut die = Die::new(1000 + seed);
        let scene = Scene::drawn(&mut die);
        let (missed, chosen, best) = scene.errors(&mut die)?;
        let Scene { g, theta_deg, phi_deg, rim, step_deg, lines, side, u } = scene;
        println!(
            "{g},{theta_deg},{phi_deg},{rim},{step_deg},{lines},{side},{u},{missed:.2},{chosen:.3e},{best:.3e}"
        );
        ratios.push((missed > SHARP, chosen / best));
    }
    said("all", ratios.iter().map(|(_, ratio)| *ratio).collect());
    for is_sharp in [false, true] {
        let of_kind = ratios.iter().filter(|(sharp, _)| *sharp == is_sharp);
        let name = if is_sharp { "missed by more than 3 u" } else { "missed by 3 u or less" };
        said(name, of_kind.map(|(_, ratio)| *ratio).collect());
    }
    Ok(())
}

/// The chosen one's error over the best one's.
fn said(of: &str, mut ratios: Vec<f64>) {
    ratios.sort_by(f64::total_cmp);
    let Some(worst) = ratios.last() else { return };
    let mean = libm::exp(ratios.iter().map(|r| libm::log(*r)).sum::<f64>() / ratios.len() as f64);
    let ninth = ratios[ratios.len() * 9 / 10];
    println!(
        "{of}: {} scenes; chosen over best: {mean:.3} geometric mean, 9 in 10 below {ninth:.2}, worst {worst:.2}",
        ratios.len()
    );
}

impl Scene {
    fn drawn(die: &mut Die) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place in a list
        let mut one = |of: &[f64]| of[(die.uniform() * of.len() as f64) as usize];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small whole numbers
        let whole = |number: f64| number as usize;
        Self {
            g: one(&[40.0, 80.0, 160.0, 320.0, 1300.0]),
            theta_deg: one(&[10.0, 30.0, 45.0, 60.0]),
            phi_deg: one(&[3.0, 47.0, 101.0]),
            rim: one(&[0.0, 0.0, 0.5]),
            step_deg: one(&[2.5, 4.0]),
            lines: whole(one(&[12.0, 18.0, 24.0, 36.0])),
            side: whole(one(&[1.0, 1.0, 2.0])),
            u: one(&[0.002, 0.01]),
        }
    }

    /// How far readings left out are missed, and the errors of what is chosen and of the best that was tried.
    fn errors(&self, die: &mut Die) -> Result<(f64, f64, f64), Box<dyn Error>> {
        let region = if self.side > 1 { PATCH } else { POINT };
        let rays = patches_of(&region, self.side, 80.0, self.step_deg, self.lines);
        let noise = Noise::Fixed { variance: self.u * self.u };
        let mut sample = |ray: &Ray| {
            let value = self.field(ray) + self.u * die.normal();
            Sample { ray: *ray, value, noise }
        };
        let samples: Vec<Sample> = rays.iter().map(&mut sample).collect();
        let (_, choice) = fit::choose(&samples, &region, &Wish::default(), None)?;
        let choice = choice.ok_or("nothing was chosen")?;
        let truth = truth_rays(&region, TRUTH)?;
        let mut errors = Vec::new();
        for candidate in choice.candidates.iter().filter(|candidate| candidate.score > -SCORE) {
            // What can't be fitted to all readings would not have been chosen.
            if let Ok(fit) = fit::fit(&samples, &region, candidate.model, &[]) {
                errors.push(self.error(&fit, &truth));
            }
        }
        let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
        Ok((choice.candidates[0].left_out_rms, errors[0], best))
    }

    fn error(&self, fit: &Fit, truth: &[Ray]) -> f64 {
        let (mut squares, mut whole) = (0.0, 0.0);
        for ray in truth {
            let field = self.field(ray);
            squares += (fit.value(ray) - field).powi(2);
            whole += field * field;
        }
        (squares / whole).sqrt()
    }

    fn field(&self, ray: &Ray) -> f64 {
        let across = (ray.theta_rad.to_degrees() - 50.0) / 3.0;
        let rim = self.rim * libm::exp(-0.5 * across * across);
        // A lobe that leans with the place: by 4° over a patch.
        let theta_deg = self.theta_deg + 100.0 * ray.x_m;
        0.2 * libm::cos(ray.theta_rad) + rim + lobe(ray, self.g, theta_deg, self.phi_deg)
    }
}

/// Candidates that foretell worse by more, in log density a reading, are far off.
const SCORE: f64 = 3.0;
/// Readings left out are missed by more than this many u where a lobe is narrower than the lines are apart.
const SHARP: f64 = 3.0;
const TRUTH: usize = 4000;
