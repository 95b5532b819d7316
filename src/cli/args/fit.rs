//! The arguments of `gonio fit`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::RangedU64ValueParser;

use super::ChartArgs;

#[derive(Debug, Args)]
pub(crate) struct FitArgs {
    /// A run's folder, or a CSV with x_mm, y_mm, theta_deg, phi_deg and a radiance. With --merge
    /// the first partial fit.
    #[arg(value_name = "DIR_or_CSV")]
    pub(crate) source: PathBuf,
    /// Further partial fits, with --merge.
    #[arg(value_name = "PART", requires = "merge")]
    pub(crate) further: Vec<PathBuf>,
    /// Fit these samples as a share of more, and write what they say to -o, to be merged.
    #[arg(long, requires = "output", conflicts_with_all = ["merge", "at", "json"])]
    pub(crate) partial: bool,
    /// Merge partial fits: the fit of all their samples.
    #[arg(long, conflicts_with_all = ["basis", "angular_degree", "cosine_columns", "theta_spans",
        "phi_spans", "fine_spans", "fine_phi_spans", "position_degree", "position_spans", "penalty_power",
        "penalty_strength", "rig"])]
    pub(crate) merge: bool,
    #[command(flatten)]
    pub(crate) chart: ChartArgs,
    /// Functions of the direction: zernike, hemispherical, even-harmonics, spherical or splines; in
    /// the perpendicular and the environment chart spherical, between two planes legendre. Default: what
    /// the plan pins, or else the one that predicts left-out sweeps best.
    #[arg(long, value_name = "NAME")]
    pub(crate) basis: Option<String>,
    /// Degree of the functions of direction (Zernike's, unless --basis names others), without a
    /// penalty unless one is given. Default: as for --basis.
    #[arg(long, value_name = "N")]
    pub(crate) angular_degree: Option<usize>,
    /// Beside Zernike polynomials of a degree: how many functions cos θ Z(2k,0). Default: none.
    #[arg(long, value_name = "N", value_parser = count(0..=8))]
    pub(crate) cosine_columns: Option<usize>,
    /// Pin splines: equal spans of θ from the normal to the horizon. What isn't named of their penalty is
    /// chosen; of more than 2000 splines its strength has to be.
    #[arg(long, value_name = "N", requires = "phi_spans", value_parser = count(1..=4096))]
    pub(crate) theta_spans: Option<usize>,
    /// Pin splines: equal spans of φ round the horizon.
    #[arg(long, value_name = "N", requires = "theta_spans", value_parser = count(1..=4096))]
    pub(crate) phi_spans: Option<usize>,
    /// Where those spans of θ are halved, and how often: the first, the one after the last, halvings.
    #[arg(
        long,
        value_name = "FIRST,AFTER_LAST,HALVINGS",
        requires = "theta_spans",
        value_delimiter = ','
    )]
    pub(crate) fine_spans: Option<Vec<f64>>,
    /// Where within these spans of φ are halved too, counted on beyond a full turn: the first, the one
    /// after the last, halvings.
    #[arg(
        long,
        value_name = "FIRST,AFTER_LAST,HALVINGS",
        requires = "fine_spans",
        value_delimiter = ','
    )]
    pub(crate) fine_phi_spans: Option<Vec<f64>>,
    /// Power of the degree that is held against rough fields, 0 to 18 (of splines 1 or 2); 0 for
    /// plain least squares.
    #[arg(long, value_name = "POWER", allow_negative_numbers = true)]
    pub(crate) penalty_power: Option<f64>,
    /// How strongly it is held: the inverse variance of a coefficient of degree 0.
    #[arg(long, value_name = "STRENGTH", allow_negative_numbers = true)]
    pub(crate) penalty_strength: Option<f64>,
    /// Highest total degree of the polynomials over position.
    #[arg(long, value_name = "N")]
    pub(crate) position_degree: Option<usize>,
    /// Pin splines over position: equal spans along each side of the region.
    #[arg(long, value_name = "N", conflicts_with = "position_degree", value_parser = count(1..=64))]
    pub(crate) position_spans: Option<usize>,
    /// Reweigh readings that don't belong: huber, tukey or none. Tukey's leaves a reading out that is
    /// six standard deviations off. Default: what the plan's [fit] says, or none, since a lobe
    /// narrower than the basis follows looks like such readings.
    #[arg(long, value_name = "NAME", conflicts_with = "merge")]
    pub(crate) robust: Option<String>,
    /// Hold the field above zero.
    #[arg(long)]
    pub(crate) nonnegative: bool,
    /// Ask for a field that is the same turned (rotational) or mirrored (plane, quadrant) about the
    /// region's middle, if the readings bear it; exit code 1 if they don't.
    #[arg(long, value_name = "NAME")]
    pub(crate) symmetry: Option<String>,
    /// The azimuth of the mirror of --symmetry. Default: 0.
    #[arg(long, value_name = "DEG", requires = "symmetry", allow_negative_numbers = true)]
    pub(crate) symmetry_phi_deg: Option<f64>,
    /// Fit a run's drift by its reference readings along with the field (yes), or don't (no). Default:
    /// what the plan says, or where the reference readings show one.
    #[arg(long, value_name = "yes|no", value_parser = yes_or_no, conflicts_with = "merge")]
    pub(crate) drift: Option<bool>,
    /// Evaluate L and u(L) at the rays of this CSV (x_mm, y_mm, theta_deg, phi_deg, or the chart's).
    #[arg(long, value_name = "FILE")]
    pub(crate) at: Option<PathBuf>,
    /// Derive a quantity with its uncertainty: "KIND KEY=VALUE ..." or a .toml file of [[derive]]
    /// tables; may be given several times. Kinds: radiance, exitance, intensity, peak_intensity,
    /// centre_beam_intensity, flux, irradiance, beam_angle, field_angle, environment, two_plane;
    /// at the point of an environment cylindrical_irradiance and spherical_irradiance too.
    /// Example: --derive "irradiance at_mm=0,0,500 normal=0,0,-1"
    #[arg(long, value_name = "SPEC")]
    pub(crate) derive: Vec<String>,
    /// Propagate distributions (JCGM 101) by so many trials, 100 to 1000000: readings and what they
    /// share are drawn again and refitted. Mean, u and 95 % intervals of exitance, flux, intensity
    /// along the normal, peak and its direction, and of what --derive asks for.
    #[arg(long, value_name = "N", conflicts_with_all = ["partial", "merge"])]
    pub(crate) monte_carlo: Option<usize>,
    /// The seed of what --monte-carlo draws.
    #[arg(long, value_name = "S", default_value_t = 1, requires = "monte_carlo")]
    pub(crate) seed: u64,
    /// For a CSV without a column of uncertainties: each one's, relative to the RMS of all. Of
    /// partial fits --merge takes it.
    #[arg(long, value_name = "U")]
    pub(crate) u_relative: Option<f64>,
    /// For a CSV: the relative standard uncertainty of the scale that all its samples share, a
    /// responsivity say. It does not average away, and is kept apart from what is independent.
    #[arg(long, value_name = "U", conflicts_with_all = ["partial", "merge"],
        allow_negative_numbers = true)]
    pub(crate) u_scale: Option<f64>,
    /// For a CSV: the rig whose detector read it (a file, or "simulated"), for its beam's width.
    /// Default: a sample is the radiance along its ray.
    #[arg(long, value_name = "RIG")]
    pub(crate) rig: Option<PathBuf>,
    /// Where to write fit.json. Default: the run's folder; of a CSV it is not written.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// With --chart perpendicular or environment: draw the field in all directions, as an SVG file.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["partial", "merge"])]
    pub(crate) picture: Option<PathBuf>,
    /// Read the readings again and again, in blocks, instead of keeping them: bounded memory. Default:
    /// of a CSV of more than 50000 rows, of a run of more than 200000 readings.
    #[arg(long, conflicts_with_all = ["partial", "merge", "picture", "monte_carlo"])]
    pub(crate) in_blocks: bool,
    /// Print fit.json.
    #[arg(long)]
    pub(crate) json: bool,
}

fn yes_or_no(text: &str) -> Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err("expected yes or no".to_owned()),
    }
}

/// A count within bounds.
fn count(range: std::ops::RangeInclusive<u64>) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::<usize>::new().range(range)
}
