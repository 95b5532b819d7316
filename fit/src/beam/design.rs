//! The rows of a fit: for each sample the point rule where that is enough, a rule over the beam
//! where it is not, as fine as is needed and no finer.
//!
//! Errors eᵢ of fitted readings of standard uncertainty uᵢ shift no derived quantity by more than
//! √Σ(eᵢ/uᵢ)² of its own independent u, however they conspire. So a row may err by a tenth of
//! uᵢ/√n. For beams that nothing cuts a bound says what a rule may err by for any field of the basis
//! as large as the largest sample ([`super::bound`]). For beams that the outline or the horizon cuts,
//! and for bases without such a bound, two rules are compared, each function of the basis at that size: an estimate. The finest rule is
//! taken where none is fine enough; [`BeamRows::quadrature`] says what that may amount to.

use radiometry::quadrature::Sum;

use super::bound::{Bound, Known};
use super::{Averager, Cover, Means, Optics, way};
use crate::basis::{Basis, Scratch, dot};
use crate::weights::Model;
use crate::{FitError, Ray, Sample};
use radiometry::beam::Beam;

/// How the rows of a fit stand for the beam.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BeamRows {
    /// Rows taken along the axis alone, since the beam's width doesn't show.
    pub point: usize,
    /// Rows averaged over a beam that the sample fills.
    pub averaged: usize,
    /// Rows averaged over a beam that the sample's outline cuts, or the horizon, or the end of the
    /// position polynomials.
    pub cut: usize,
    /// Rows of beams that miss the sample: zero.
    pub off_sample: usize,
    /// Directions that the averaged and cut rows took.
    pub directions: u64,
    /// By how much of its own independent u the quadrature may shift a derived quantity, at most:
    /// all rows erring as they may, each for the field that suits it worst.
    pub quadrature: f64,
}

impl BeamRows {
    /// These rows and others.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            point: self.point + other.point,
            averaged: self.averaged + other.averaged,
            cut: self.cut + other.cut,
            off_sample: self.off_sample + other.off_sample,
            directions: self.directions + other.directions,
            quadrature: self.quadrature.hypot(other.quadrature),
        }
    }
}

/// How one row is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Point,
    Smooth(usize),
    Across(usize),
    Off,
}

impl Kind {
    /// What is tried for a beam that nothing cuts, and for one that something does.
    const SMOOTH: &'static [Self] = &[
        Self::Point,
        Self::Smooth(0),
        Self::Smooth(1),
        Self::Smooth(2),
        Self::Smooth(3),
        Self::Smooth(4),
        Self::Smooth(5),
    ];
    const ACROSS: &'static [Self] = &[Self::Across(0), Self::Across(1), Self::Across(2)];
}

/// The rows of samples in a basis.
#[derive(Debug)]
pub(crate) struct Design<'s> {
    samples: &'s [Sample],
    basis: &'s Basis,
    beam: Option<Averaged>,
    /// Of readings taken in flight: the rays at their beginning and end.
    flown: &'s [Option<(Ray, Ray)>],
}

#[derive(Debug)]
struct Averaged {
    averager: Averager,
    kinds: Vec<Kind>,
    /// The rows that are no point's, one after the other, and where each begins; empty where that
    /// would be too much to keep.
    kept: Vec<f64>,
    places: Vec<usize>,
    /// What each row's quadrature may err by, in the samples' unit.
    errors: Vec<f64>,
    rows: BeamRows,
}

/// Another beam than the one that the rows stand for, with room of its own: what its averages find out
/// holds for it alone.
#[derive(Debug)]
pub(crate) struct Through {
    averager: Averager,
    means: Means,
}

/// Room for evaluations.
#[derive(Debug)]
pub(crate) struct Room {
    pub(crate) scratch: Scratch,
    means: Means,
    row: Vec<f64>,
    flight: Vec<f64>,
}

impl<'s> Design<'s> {
    /// Chooses, and averages.
    pub(crate) fn new(
        samples: &'s [Sample],
        basis: &'s Basis,
        optics: Option<&Optics>,
    ) -> Result<Self, FitError> {
        Self::of_a_share(samples, basis, optics, samples.len())
    }

    /// Of samples that are a share of `readings`, whose errors come together.
    pub(crate) fn of_a_share(
        samples: &'s [Sample],
        basis: &'s Basis,
        optics: Option<&Optics>,
        readings: usize,
    ) -> Result<Self, FitError> {
        let averaged = |optics| Averaged::new(samples, basis, optics, readings);
        Ok(Self { samples, basis, beam: optics.map(averaged).transpose()?, flown: &[] })
    }

    /// With the ways of readings that were taken in flight, sample by sample.
    pub(crate) fn in_flight(self, flown: &'s [Option<(Ray, Ray)>]) -> Self {
        Self { flown, ..self }
    }

    pub(crate) fn samples(&self) -> &'s [Sample] {
        self.samples
    }

    pub(crate) fn basis(&self) -> &'s Basis {
        self.basis
    }

    /// For samples that were weighted by these variances; `None` where there is no beam.
    pub(crate) fn rows(&self, variances: &[f64]) -> Option<BeamRows> {
        let beam = self.beam.as_ref()?;
        let squares: Sum = beam
            .errors
            .iter()
            .zip(variances)
            .map(|(error, variance)| error * error / variance)
            .collect();
        Some(BeamRows { quadrature: squares.value().sqrt(), ..beam.rows })
    }

    pub(crate) fn room(&self) -> Room {
        let basis = self.basis;
        let row = || vec![0.0; basis.len()];
        Room { scratch: basis.scratch(), means: Means::new(basis), row: row(), flight: row() }
    }

    /// The row of a sample.
    pub(crate) fn row(&self, i: usize, room: &mut Room, out: &mut [f64]) {
        match &self.beam {
            Some(beam) if beam.kinds[i] != Kind::Point => {
                if let Some(row) = beam.row(i, self.basis.len()) {
                    out.copy_from_slice(row);
                } else {
                    let ray = &self.samples[i].ray;
                    beam.averager.row(beam.kinds[i], ray, self.basis, &mut room.means, out);
                }
            }
            _ => self.basis.row(&self.samples[i].ray, &mut room.scratch, out),
        }
        self.add_flight(i, room, out);
    }

    /// The way of a sample, where the beam sees what the basis says along its axis: not where the
    /// outline cuts it.
    fn way(&self, i: usize) -> Option<&(Ray, Ray)> {
        let kind = self.beam.as_ref().map_or(Kind::Point, |beam| beam.kinds[i]);
        let is_whole = matches!(kind, Kind::Point | Kind::Smooth(_));
        self.flown.get(i).and_then(Option::as_ref).filter(|_| is_whole)
    }

    /// What a window's way adds to the row of its middle: the mean over it by Gauss's two points,
    /// less the middle, each along the axis. Exact for cubics along the way; that the beam is wide
    /// changes it in the fourth order only.
    fn add_flight(&self, i: usize, room: &mut Room, out: &mut [f64]) {
        let Some(way) = self.way(i) else { return };
        for (part, weight) in FLIGHT {
            let ray = way::along(way, part);
            self.basis.row(&ray, &mut room.scratch, &mut room.flight);
            out.iter_mut().zip(&room.flight).for_each(|(out, row)| *out += weight * row);
        }
    }

    /// What the fit says that a sample's reading is.
    pub(crate) fn level(&self, i: usize, coefficients: &[f64], room: &mut Room) -> f64 {
        let is_point = self.beam.as_ref().is_none_or(|beam| beam.kinds[i] == Kind::Point);
        if is_point && self.way(i).is_none() {
            return self.basis.value(coefficients, &self.samples[i].ray, &mut room.scratch);
        }
        let mut row = std::mem::take(&mut room.row);
        self.row(i, room, &mut row);
        let level = dot(&row, coefficients);
        room.row = row;
        level
    }

    /// What a sample would read along a ray, for changes alone: over a beam that nothing cuts the axis
    /// tells, over others the coarsest rule, whose error cancels.
    pub(crate) fn along(&self, i: usize, ray: &Ray, coefficients: &[f64], room: &mut Room) -> f64 {
        let is_cut = |beam: &&Averaged| matches!(beam.kinds[i], Kind::Across(_) | Kind::Off);
        let Some(Averaged { averager, .. }) = self.beam.as_ref().filter(is_cut) else {
            return self.basis.value(coefficients, ray, &mut room.scratch);
        };
        averager.row(Kind::Across(0), ray, self.basis, &mut room.means, &mut room.row);
        dot(&room.row, coefficients)
    }

    /// By how much a sample's reading changes when another ray is seen.
    pub(crate) fn change(
        &self,
        i: usize,
        seen: &Ray,
        coefficients: &[f64],
        room: &mut Room,
    ) -> f64 {
        let ray = &self.samples[i].ray;
        if seen == ray {
            return 0.0;
        }
        self.along(i, seen, coefficients, room) - self.along(i, ray, coefficients, room)
    }

    /// Another beam for the same readings, cut by the same outline; `None` where there is no beam.
    pub(crate) fn through(&self, beam: &Beam) -> Result<Option<Through>, FitError> {
        let other = |own: &Averaged| {
            let optics = Optics { beam: *beam, ..own.averager.optics };
            let averager = Averager::new(&optics, self.basis)?;
            Ok(Through { averager, means: Means::new(self.basis) })
        };
        self.beam.as_ref().map(other).transpose()
    }

    /// By how much the mean over a sample's beam changes when it is seen through another one. Nothing
    /// where the beam's width doesn't show.
    pub(crate) fn seen(
        &self,
        i: usize,
        through: &mut Through,
        coefficients: &[f64],
        room: &mut Room,
    ) -> f64 {
        let Some(beam @ Averaged { averager, kinds, .. }) = &self.beam else { return 0.0 };
        // The same rule for both, so that its error cancels.
        let kind = match kinds[i] {
            Kind::Point | Kind::Off => return 0.0,
            Kind::Across(_) => Kind::Across(0),
            smooth @ Kind::Smooth(_) => smooth,
        };
        let ray = &self.samples[i].ray;
        let mut level = |averager: &Averager, means: &mut Means| {
            averager.row(kind, ray, self.basis, means, &mut room.row);
            dot(&room.row, coefficients)
        };
        let other = level(&through.averager, &mut through.means);
        let kept = beam.row(i, self.basis.len()).filter(|_| kind == kinds[i]);
        other - kept.map_or_else(|| level(averager, &mut room.means), |row| dot(row, coefficients))
    }

    /// The field that an offset of all readings looks like, if it does like any.
    pub(crate) fn constant(&self) -> Option<Vec<f64>> {
        self.holds_constant().then(|| self.basis.unity())
    }

    /// Whether an offset of all readings is a constant field: not where something cuts a beam.
    pub(crate) fn holds_constant(&self) -> bool {
        self.beam.as_ref().is_none_or(|beam| beam.rows.cut == 0 && beam.rows.off_sample == 0)
    }
}

impl Averager {
    fn row(&self, kind: Kind, ray: &Ray, basis: &Basis, means: &mut Means, out: &mut [f64]) {
        match kind {
            Kind::Point => basis.row(ray, &mut basis.scratch(), out),
            Kind::Smooth(rule) => self.smooth_row(&self.smooth[rule], ray, basis, means, out),
            Kind::Across(rule) => self.across_row(&self.across[rule], ray, basis, means, out),
            Kind::Off => out.fill(0.0),
        }
    }

    /// The coarsest rule for a beam that nothing cuts, and what it may err by.
    fn rule_within(
        &self,
        (bound, known): (&Bound, &mut Known),
        theta_rad: f64,
        allowed: f64,
    ) -> (Kind, f64) {
        let point = known.of_point(bound, theta_rad);
        if point <= allowed {
            return (Kind::Point, point);
        }
        let mut last = (Kind::Point, point);
        for (i, rule) in self.smooth.iter().enumerate() {
            last = (Kind::Smooth(i), known.of_rule(bound, theta_rad, rule.degree));
            if last.1 <= allowed {
                break;
            }
        }
        last
    }
}

/// What a field of these coefficients makes of readings along rays: middling rules, for what needs
/// no more than a reading's level.
pub(crate) fn readings(
    rays: &[Ray],
    basis: &Basis,
    coefficients: &[f64],
    optics: &Optics,
) -> Result<Vec<f64>, FitError> {
    let averager = Averager::new(optics, basis)?;
    let (mut means, mut row) = (Means::new(basis), vec![0.0; basis.len()]);
    let reading = |ray: &Ray| {
        let kind = match averager.cover(ray) {
            Cover::Within => Kind::Smooth(1),
            Cover::Across => Kind::Across(0),
            Cover::Off => Kind::Off,
        };
        averager.row(kind, ray, basis, &mut means, &mut row);
        dot(&row, coefficients)
    };
    Ok(rays.iter().map(reading).collect())
}

impl Averaged {
    fn new(
        samples: &[Sample],
        basis: &Basis,
        optics: &Optics,
        readings: usize,
    ) -> Result<Self, FitError> {
        let averager = Averager::new(optics, basis)?;
        let model = Model::of(samples);
        let size = samples.iter().map(|s| s.value.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let share = PART_OF_U / (readings as f64).sqrt();
        let keeps = samples.len().saturating_mul(basis.len()) <= KEPT_NUMBERS_MAX;
        let mut new = Self {
            averager,
            kinds: Vec::with_capacity(samples.len()),
            kept: Vec::new(),
            places: Vec::new(),
            errors: Vec::with_capacity(samples.len()),
            rows: BeamRows::default(),
        };
        let mut choice = Choice::new(basis);
        for sample in samples {
            // In units of the field's size.
            let u = model.u_of(sample) / size;
            let (kind, error) = choice.of(&new.averager, &sample.ray, share * u);
            new.note(kind);
            new.errors.push(error * size);
            if keeps {
                new.places.push(new.kept.len());
                if matches!(kind, Kind::Smooth(_) | Kind::Across(_)) {
                    if let Kind::Smooth(_) = kind {
                        let (means, row) = (&mut choice.means, &mut choice.row);
                        new.averager.row(kind, &sample.ray, basis, means, row);
                    }
                    new.kept.extend_from_slice(&choice.row);
                }
            }
        }
        Ok(new)
    }

    fn note(&mut self, kind: Kind) {
        self.kinds.push(kind);
        let rows = &mut self.rows;
        let directions = match kind {
            Kind::Point | Kind::Off => 0,
            Kind::Smooth(rule) => self.averager.smooth[rule].nodes.len(),
            Kind::Across(rule) => self.averager.across[rule].nodes.len(),
        };
        rows.directions += directions as u64;
        *match kind {
            Kind::Point => &mut rows.point,
            Kind::Smooth(_) => &mut rows.averaged,
            Kind::Across(_) => &mut rows.cut,
            Kind::Off => &mut rows.off_sample,
        } += 1;
    }

    /// The row of a sample, if it was kept.
    fn row(&self, i: usize, length: usize) -> Option<&[f64]> {
        match self.kinds[i] {
            Kind::Smooth(_) | Kind::Across(_) => {
                self.kept.get(*self.places.get(i)?..)?.get(..length)
            }
            Kind::Point | Kind::Off => None,
        }
    }
}

/// Chooses rules; leaves the row of a cut beam behind.
struct Choice<'b> {
    basis: &'b Basis,
    means: Means,
    row: Vec<f64>,
    coarser: Vec<f64>,
    /// The largest value of each function.
    largest: Vec<f64>,
    /// Of the averager's bound.
    known: Known,
}

impl<'b> Choice<'b> {
    fn new(basis: &'b Basis) -> Self {
        let room = || vec![0.0; basis.len()];
        let largest = (0..basis.len()).map(|k| basis.largest(k)).collect();
        let (means, known) = (Means::new(basis), Known::default());
        Self { basis, means, row: room(), coarser: room(), largest, known }
    }

    /// The rule for a ray, and what it errs by, as a part of the field's size.
    fn of(&mut self, averager: &Averager, ray: &Ray, allowed: f64) -> (Kind, f64) {
        match averager.cover(ray) {
            Cover::Off => (Kind::Off, 0.0),
            Cover::Within => match &averager.bound {
                Some(bound) => {
                    averager.rule_within((bound, &mut self.known), ray.theta_rad, allowed)
                }
                None => self.compared(averager, ray, allowed, Kind::SMOOTH),
            },
            Cover::Across => self.compared(averager, ray, allowed, Kind::ACROSS),
        }
    }

    /// A finer rule differs from a coarser one by about what the coarser one errs.
    fn compared(
        &mut self,
        averager: &Averager,
        ray: &Ray,
        allowed: f64,
        kinds: &[Kind],
    ) -> (Kind, f64) {
        let Self { basis, means, row, coarser, largest, .. } = self;
        let mut last = (kinds[0], f64::INFINITY);
        averager.row(last.0, ray, basis, means, row);
        for kind in &kinds[1..] {
            std::mem::swap(row, coarser);
            last.0 = *kind;
            averager.row(last.0, ray, basis, means, row);
            let pairs = row.iter().zip(coarser.iter()).zip(largest.iter());
            let off = pairs.map(|((a, b), largest)| (a - b).abs() / largest).fold(0.0, f64::max);
            let (floor, gain) = match kind {
                // The point stands for the beam if the coarsest rule says so too.
                Kind::Smooth(0) if off <= allowed => return (Kind::Point, off),
                Kind::Smooth(_) => (0.0, GAIN),
                _ => (FLOOR, GAIN),
            };
            // The rules' errors fall at least as fast as from one of them to the next.
            last.1 = off * gain;
            if last.1 <= allowed.max(floor) {
                break;
            }
        }
        last
    }
}

/// Gauss's two points on a way, each half, and the middle taken off.
const FLIGHT: [(f64, f64); 3] =
    [(0.211_324_865_405_187_13, 0.5), (0.788_675_134_594_812_9, 0.5), (0.5, -1.0)];
/// The shift of a derived quantity by quadrature, in its own independent u, that is aimed at.
const PART_OF_U: f64 = 0.1;
/// What the next rule for cut beams errs by, over its difference from the one before.
const GAIN: f64 = 0.25;
/// A cut row is not taken more exactly than this: no outline is known so well.
const FLOOR: f64 = 1e-4;
/// Rows are kept from pass to pass up to this many numbers, 32 MB: beyond it they are averaged anew
/// in every pass, so that memory doesn't grow with readings times coefficients.
const KEPT_NUMBERS_MAX: usize = 1 << 22;
