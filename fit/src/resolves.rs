//! The narrowest feature that a fit can show: no narrower than its basis bends, than the readings lie
//! apart, than the beam is wide. It looks at poses, not at values.

use crate::basis::{Angular, BasisSpec, Position};
use crate::beam::Optics;
use crate::choice::SweepKind;
use crate::grid::Grid;
use crate::poses::Poses;
use crate::{Chart, Region, Sample};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// What keeps a narrower feature from being seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// The functions of the fit bend no faster.
    Basis,
    /// The largest gap between readings.
    Sampling,
    /// The detector's beam.
    Beam,
}

impl Limit {
    /// As files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Basis => "basis",
            Self::Sampling => "sampling",
            Self::Beam => "beam",
        }
    }
}

/// A width, and what it is due to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Width {
    /// Full width at half height: radians, or metres.
    pub width: f64,
    /// The largest of the three.
    pub limit: Limit,
}

/// The narrowest features that plan, beam and basis can show. What is narrower is smeared out, or
/// falls between the readings and isn't seen at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolves {
    /// From the normal, radians.
    pub theta_rad: Width,
    /// Around the normal, radians of azimuth at the edge of the region's cone. `None`: readings at
    /// the normal alone.
    pub phi_rad: Option<Width>,
    /// Over the sample, metres. `None`: taken for alike everywhere, or a single place.
    pub x_m: Option<Width>,
    /// Over the sample, metres.
    pub y_m: Option<Width>,
    /// Nothing was measured beyond this angle, radians.
    pub measured_to_rad: f64,
}

impl Resolves {
    /// For readings along these samples' rays, in a basis.
    pub fn of(
        samples: &[Sample],
        region: &Region,
        basis: BasisSpec,
        optics: Option<&Optics>,
    ) -> Self {
        let poses = Poses::of(samples, region);
        let mut tally = poses.tally();
        tally.take(samples);
        Self::by(&poses, tally.kind(), region, basis, optics)
    }

    /// For readings of such poses, which come in sweeps of a kind.
    pub(crate) fn by(
        poses: &Poses,
        kind: SweepKind,
        region: &Region,
        basis: BasisSpec,
        optics: Option<&Optics>,
    ) -> Self {
        let (grid, measured_to_rad) = (poses.grid(), poses.measured_to_rad());
        let (theta_gap, phi_gap) = gaps(poses, kind, region, &grid);
        let (theta_basis, phi_basis) = bends(basis.angular, region);
        let (angle, spot) = optics.map_or((0.0, 0.0), |optics| {
            let beam = &optics.beam;
            let radii = beam.stop_radius_m() + beam.pupil_radius_m();
            (radii / beam.separation_m(), 2.0 * beam.stop_radius_m())
        });
        let edge = libm::sin(measured_to_rad.min(FRAC_PI_2));
        let side = |(from, to): (f64, f64), places: &[f64]| {
            let bend = match basis.position {
                Position::Legendre { degree: 0 } => return None,
                Position::Legendre { degree } => (to - from) / degree as f64,
                Position::Splines { spans } => 2.0 * (to - from) / spans.max(1) as f64,
            };
            (to > from).then(|| largest(bend, widest(places, (from, to)), spot))
        };
        Self {
            theta_rad: largest(theta_basis, theta_gap, angle),
            phi_rad: (edge > 0.0).then(|| largest(phi_basis, phi_gap, angle / edge)),
            x_m: side(region.x_m, &grid.x_m),
            y_m: side(region.y_m, &grid.y_m),
            measured_to_rad,
        }
    }
}

fn largest(basis: f64, sampling: f64, beam: f64) -> Width {
    let mut width = Width { width: basis, limit: Limit::Basis };
    for (other, limit) in [(sampling, Limit::Sampling), (beam, Limit::Beam)] {
        if other > width.width {
            width = Width { width: other, limit };
        }
    }
    width
}

/// Half a period of the fastest function in θ, and round the horizon; of splines the width of one.
fn bends(angular: Angular, region: &Region) -> (f64, f64) {
    let period = |n: usize| if n == 0 { f64::INFINITY } else { PI / n as f64 };
    match angular {
        Angular::Zernike { degree, cosine_columns } => {
            // With a few columns of cos θ alone θ is followed as far as they go.
            (period(degree.max(2 * cosine_columns)), period(degree))
        }
        Angular::EvenHarmonics { degree } | Angular::Spherical { degree } => {
            (period(degree), period(degree))
        }
        Angular::SecondPlane { degree } => {
            // As an angle seen from the first plane.
            let Chart::TwoPlane { distance_m, s_m, t_m } = region.chart else {
                return (f64::INFINITY, f64::INFINITY);
            };
            let widest_m = (s_m.1 - s_m.0).max(t_m.1 - t_m.0);
            let bend = widest_m / degree as f64 / distance_m;
            (bend, bend / libm::sin(region.theta_max_rad))
        }
        // A quarter turn of θ is half a turn of theirs.
        Angular::Hemispherical { degree } => (period(degree) / 2.0, period(degree)),
        Angular::Splines { theta_spans, phi_spans, fine } => {
            let narrowest = |spans: usize, halvings: usize| {
                let halvings = if fine.is_none() { 0 } else { halvings.min(52) };
                spans.max(1) as f64 * (1_u64 << halvings) as f64
            };
            let along = narrowest(theta_spans, fine.halvings);
            (PI / along, 2.0 * TAU / narrowest(phi_spans, fine.around.halvings))
        }
    }
}

/// Of sweeps the largest steps along and across; of scattered readings the widest hole either way.
fn gaps(poses: &Poses, kind: SweepKind, region: &Region, grid: &Grid) -> (f64, f64) {
    let theta_to = poses.measured_to_rad().min(FRAC_PI_2);
    if matches!(kind, SweepKind::Theta | SweepKind::Phi) {
        let theta = widest(&grid.theta_rad, (0.0, region.theta_max_rad));
        // A line through the normal has readings on both sides or on one.
        return (theta, poses.widest_turn_rad(0.5 * theta_to));
    }
    let hole = poses.hole_rad();
    (hole, hole / libm::sin(theta_to).max(f64::MIN_POSITIVE))
}

/// The widest step between neighbours; from an end to the first of them counts twice.
fn widest(places: &[f64], (from, to): (f64, f64)) -> f64 {
    let between = places.windows(2).map(|ends| ends[1] - ends[0]).fold(0.0, f64::max);
    let before = places.first().map_or(to - from, |first| first - from);
    let after = places.last().map_or(to - from, |last| to - last);
    between.max(2.0 * before).max(2.0 * after)
}
