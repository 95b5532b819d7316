//! What a run is asked for, and how far its answers lie from the truth.

use fit::{Ray, Region};

/// The normal distribution's 97.5 % quantile: half the 95 % interval in units of u.
const HALF_INTERVAL: f64 = 1.959_963_984_540_054;

/// A kind of quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// M, into the whole hemisphere.
    Exitance,
    /// M, into the region's own directions.
    ExitanceWithin,
    /// M times the region's area.
    Flux,
    /// I of the region as a whole.
    Intensity,
    /// L along a ray.
    Radiance,
}

impl Kind {
    /// All of them, in the order of tables.
    pub const ALL: [Self; 5] =
        [Self::Exitance, Self::ExitanceWithin, Self::Flux, Self::Intensity, Self::Radiance];

    /// As coverage.csv names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exitance => "exitance",
            Self::ExitanceWithin => "exitance_within_region",
            Self::Flux => "flux",
            Self::Intensity => "intensity",
            Self::Radiance => "radiance",
        }
    }
}

/// Something asked of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// What.
    pub kind: Kind,
    /// Along which ray; of an intensity its direction alone counts, of sums over all nothing.
    pub ray: Option<Ray>,
}

/// An answer, relative to the largest truth of its kind in the run: along a ray a lamp may be dark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// (value - truth) / largest truth.
    pub error: f64,
    /// u / largest truth.
    pub u: f64,
}

/// What a run says to a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// What was asked.
    pub kind: Kind,
    /// What the fit says.
    pub value: f64,
    /// Its u.
    pub u: f64,
    /// What it should say.
    pub truth: f64,
}

impl Score {
    /// Of all answers of one run.
    pub fn of(answers: &[Answer]) -> Vec<Self> {
        let largest = |kind: Kind| {
            let truths = answers.iter().filter(|answer| answer.kind == kind);
            truths.map(|answer| answer.truth.abs()).fold(0.0, f64::max)
        };
        let score = |answer: &Answer| {
            let scale = largest(answer.kind);
            Self { error: (answer.value - answer.truth) / scale, u: answer.u / scale }
        };
        answers.iter().map(score).collect()
    }

    /// The error in units of u.
    pub fn z(&self) -> f64 {
        self.error / self.u
    }

    /// Whether the 95 % interval holds the truth.
    pub fn is_covered(&self) -> bool {
        self.z().abs() <= HALF_INTERVAL
    }
}

/// What a run found, target by target.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// As [`targets`] lists them.
    pub scores: Vec<Score>,
}

/// M, M within, flux, I in four directions, and L on a grid of 10 directions by two places, all
/// within the region.
pub fn targets(region: &Region) -> Vec<Target> {
    let deg = f64::to_radians;
    let middle = |(low, high): (f64, f64)| f64::midpoint(low, high);
    let aside = |(low, high): (f64, f64)| low + 0.8 * (high - low);
    let (x_m, y_m) = (middle(region.x_m), middle(region.y_m));
    let mut all: Vec<Target> = [Kind::Exitance, Kind::ExitanceWithin, Kind::Flux]
        .map(|kind| Target { kind, ray: None })
        .to_vec();
    for (theta_deg, phi_deg) in [(0.0, 0.0), (30.0, 45.0), (55.0, 200.0), (70.0, -60.0)] {
        let (theta_rad, phi_rad) = (deg(theta_deg), deg(phi_deg));
        let ray = Some(Ray { x_m, y_m, theta_rad, phi_rad });
        all.push(Target { kind: Kind::Intensity, ray });
    }
    let rings = [25.0, 50.0, 72.0].map(|theta| [10.0, 130.0, -110.0].map(|phi| (theta, phi)));
    let directions = [(0.0, 0.0)].into_iter().chain(rings.into_iter().flatten());
    for (theta_deg, phi_deg) in directions {
        for (x_m, y_m) in [(x_m, y_m), (aside(region.x_m), aside(region.y_m))] {
            let (theta_rad, phi_rad) = (deg(theta_deg), deg(phi_deg));
            let ray = Some(Ray { x_m, y_m, theta_rad, phi_rad });
            all.push(Target { kind: Kind::Radiance, ray });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_along_a_dark_ray_is_relative_to_the_brightest_one() {
        let of = |kind, value, truth| Answer { kind, value, u: 0.1, truth };
        let answers = [
            of(Kind::Exitance, 8.0, 4.0),
            of(Kind::Radiance, 0.2, 0.0),
            of(Kind::Radiance, 2.2, 2.0),
        ];
        let scores = Score::of(&answers);
        let z: Vec<f64> = scores.iter().map(Score::z).collect();
        let expected = [40.0, 2.0, 2.0];
        assert!(z.iter().zip(expected).all(|(z, e)| (z - e).abs() < 1e-12), "{z:?}");
        let errors: Vec<f64> = scores.iter().map(|score| score.error).collect();
        assert!(errors.iter().zip([1.0, 0.1, 0.1]).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
