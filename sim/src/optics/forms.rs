//! The forms in which a beam can be averaged, cheapest first, and which of them is enough for a region.
//! How far each is off is found by the side of a much finer one, over axes that tell most.

use core::fmt;
use std::sync::Arc;

use radiometry::beam::{Beam, disk_rule};

use super::beams::{ByDirections, ByRays, Degrees, OverPatches, Rays, tabled};
use super::poses::{across_rays, anywhere_rays, inside_rays, widest_m};
use super::table::Wanted;
use super::weigh::{departure, of_patch};
use super::{Axis, Optics};
use crate::Region;
use crate::compile::{PART_OF_NOISE, Setting};
use crate::field::{Field, Goes, Patch, Ray};

/// What sampling may miss of a supremum.
pub(super) const MARGIN: f64 = 1.5;
/// Degrees of rules of directions, cheapest first, and the one that they are compared with.
const DIRECTIONS: [usize; 9] = [3, 5, 7, 9, 14, 20, 29, 39, 59];
const FINEST_DIRECTIONS: usize = 119;
/// Degrees over stop and pupil for what goes with the place, read from tables.
const PLACES: [(usize, usize); 9] =
    [(3, 1), (5, 1), (5, 3), (7, 3), (9, 3), (14, 3), (20, 3), (29, 3), (39, 3)];
const FINEST_PLACES: (usize, usize) = (79, 5);
/// The same of what is not, or goes with both.
const BOTH: [(usize, usize); 8] =
    [(3, 1), (3, 3), (5, 3), (7, 3), (7, 5), (9, 5), (14, 7), (14, 14)];
const FINEST_BOTH: (usize, usize) = (20, 20);
/// Of these so many compete in slow fields, and with what.
const SLOW_BOTH: usize = 6;
const SLOW_FINEST_BOTH: (usize, usize) = (14, 7);
/// Degrees over the pupil, with chords and points along them, across outlines.
const ACROSS: [(usize, (usize, usize)); 7] =
    [(3, (8, 2)), (3, (8, 4)), (5, (8, 4)), (7, (8, 4)), (9, (8, 4)), (14, (8, 4)), (14, (12, 8))];
const FINEST_ACROSS: (usize, (usize, usize)) = (20, (16, 8));
/// Of these so many compete in slow fields, with what, and on how many rays.
const SLOW_ACROSS: usize = 4;
const SLOW_FINEST_ACROSS: (usize, (usize, usize)) = (14, (8, 4));
const WORST_SLOW_ACROSS: usize = 4;
/// How much farther off than from the finest rule another rule may be next to outlines.
const OUTLINES: f64 = 2.0;
/// How many rays are looked at with the finest rule: of cheap fields, across outlines, and of slow
/// fields.
const WORST: usize = 64;
const WORST_ACROSS: usize = 24;
const WORST_SLOW: usize = 16;
/// What of the tolerance tables may use.
const PART_OF_TABLES: f64 = 0.1;
/// No table comes nearer, relative.
const TABLES_LEAST: f64 = 1e-9;

/// How the beam will be averaged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    /// By rays of these degrees over stop and pupil.
    Rays(usize, usize),
    /// Along outlines, and within them as each patch has it; how many cells the tables have that what
    /// goes with the place is read from.
    Patches(Degrees, usize),
}

impl Form {
    /// For a person.
    pub(crate) fn how(self, off: Off) -> String {
        let rays = |stop: usize, pupil: usize| disk_rule(stop).len() * disk_rule(pupil).len();
        match self {
            Self::Rays(stop, pupil) => {
                let rays = rays(stop, pupil);
                format!("mean over {rays} rays of pupil and spot; {off}")
            }
            Self::Patches(degrees, cells) => {
                let points = disk_rule(degrees.pupil).len();
                let directions = (degrees.directions + 1).div_ceil(4) * (degrees.directions + 1);
                let tables = match cells {
                    0 => String::new(),
                    _ => format!(" read from a table of {cells} cells"),
                };
                format!(
                    "where one patch fills the beam, its radiance (mean over {directions} \
                     directions if that goes with direction, over {} rays{tables} if with the \
                     place); across an outline, cut along it as {points} points of the pupil see \
                     it; {off}",
                    rays(degrees.rays.0, degrees.rays.1)
                )
            }
        }
    }
}

/// How far off a form is at most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Off {
    /// Relative to a reading, or to the noise floor where that is more.
    pub(crate) relative: f64,
    /// In parts of the noise of that reading.
    noise: f64,
}

impl Off {
    const NONE: Self = Self { relative: 0.0, noise: 0.0 };
    const UNKNOWN: Self = Self { relative: f64::INFINITY, noise: f64::INFINITY };

    fn max(self, other: Self) -> Self {
        Self { relative: self.relative.max(other.relative), noise: self.noise.max(other.noise) }
    }

    fn plus(self, other: Self) -> Self {
        Self { relative: self.relative + other.relative, noise: self.noise + other.noise }
    }

    fn times(self, factor: f64) -> Self {
        Self { relative: self.relative * factor, noise: self.noise * factor }
    }

    /// Between two readings.
    fn between(setting: &Setting<'_>, a: f64, b: f64) -> Self {
        let (off, reading) = ((a - b).abs(), a.max(b));
        let scale = reading.max(setting.floor);
        let part = |of: f64| if of > 0.0 { off / of } else { 0.0 };
        Self { relative: part(scale), noise: part(setting.noise(reading)) }
    }

    /// What of the tolerance it uses up, at most one for what will do. Where that is a tenth of the noise
    /// by default, it is so at each reading.
    fn of_allowed(self, setting: &Setting<'_>) -> f64 {
        let relative = self.relative / (setting.tolerance / 2.0);
        match setting.terms.tolerance {
            Some(_) => relative,
            None => relative.min(self.noise / (PART_OF_NOISE / 2.0)),
        }
    }
}

impl fmt::Display for Off {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "error at most {:.0e} of a reading and {:.0e} of its noise",
            self.relative, self.noise
        )
    }
}

/// What the beam looks at, with tables where they serve.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) field: Arc<dyn Field>,
    tables: Option<(Region, Wanted)>,
    cells: usize,
}

impl Seen {
    pub(super) fn bare(setting: &Setting<'_>) -> Self {
        Self { field: Arc::clone(&setting.field), tables: None, cells: 0 }
    }

    /// Tables of what goes with the place, as far as the beam reaches.
    pub(super) fn tabled(setting: &Setting<'_>, beam: &Beam) -> Self {
        let region = setting.region;
        let reach = widest_m(beam, region.theta_max_rad);
        let wider = |(low, high): (f64, f64)| (low - reach, high + reach);
        let wanted = Wanted {
            x_m: wider(region.x_m),
            y_m: wider(region.y_m),
            spot_m: 2.0 * beam.stop_radius_m(),
            floor: setting.floor,
            error: (PART_OF_TABLES * setting.tolerance).max(TABLES_LEAST),
        };
        match super::table::Tabled::new(&setting.field, &region, wanted) {
            Some(own) => {
                let cells = own.cells();
                Self { field: Arc::new(own), tables: Some((region, wanted)), cells }
            }
            None => Self::bare(setting),
        }
    }

    /// The same tables of what is chosen of the scene; these, if that is all of it.
    pub(super) fn again(&self, setting: &Setting<'_>, is_whole: bool) -> Self {
        if is_whole && self.has_tables() {
            return self.clone();
        }
        let field = &setting.field;
        let tabled = self.tables.and_then(|(region, wanted)| tabled(field, &region, wanted));
        Self { field: tabled.unwrap_or_else(|| Arc::clone(field)), ..self.clone() }
    }

    pub(super) fn has_tables(&self) -> bool {
        self.tables.is_some()
    }

    pub(super) fn build(&self, beam: Beam, form: Form) -> Arc<dyn Optics> {
        let field = &self.field;
        match (form, field.patches()) {
            (Form::Patches(degrees, _), Some(patches)) => {
                Arc::new(OverPatches::new(field, patches, beam, degrees, self.tables))
            }
            (Form::Patches(degrees, _), None) => Arc::new(ByRays {
                field: Arc::clone(field),
                rays: Rays::new(beam, degrees.rays.0, degrees.rays.1),
            }),
            (Form::Rays(stop, pupil), _) => {
                Arc::new(ByRays { field: Arc::clone(field), rays: Rays::new(beam, stop, pupil) })
            }
        }
    }
}

/// The cheapest form whose error stays within half the tolerance, as far as it can be had, and that
/// error.
pub(super) fn choose(setting: &Setting<'_>, beam: Beam, seen: &Seen) -> (Form, Off) {
    let Some(patches) = setting.field.patches() else {
        let rays = anywhere_rays(setting);
        let build = |(stop, pupil)| seen.build(beam, Form::Rays(stop, pupil));
        let ((stop, pupil), error) = of_both(setting, &rays, build);
        // Next to an outline the finest rule is off as well, by less.
        return (Form::Rays(stop, pupil), error.times(OUTLINES));
    };
    let mut degrees = Degrees {
        directions: DIRECTIONS[0],
        rays: BOTH[0],
        pupil: ACROSS[0].0,
        chords: ACROSS[0].1,
    };
    let mut worst = Off::NONE;
    for (i, patch) in patches.iter().enumerate() {
        let Goes::WithDirection { is_round } = patch.goes else { continue };
        let field = of_patch(setting, i, patch);
        let rays = inside_rays(setting, &beam, is_round);
        let build = |degree| -> Arc<dyn Optics> {
            let (field, directions) = (Arc::clone(&field), beam.directions(degree));
            Arc::new(ByDirections { field, directions })
        };
        let (degree, error) = Contest { setting, rays: &rays, count: WORST }.cheapest(
            &DIRECTIONS,
            FINEST_DIRECTIONS,
            build,
        );
        degrees.directions = degrees.directions.max(degree);
        worst = worst.max(error);
    }
    let goes = |patch: &Patch| matches!(patch.goes, Goes::WithPlace | Goes::WithBoth);
    if patches.iter().any(goes) {
        let (rays, error) = over_places(setting, beam, seen);
        degrees.rays = rays;
        worst = worst.max(error);
    }
    let rays = across_rays(setting, &beam, &patches);
    let across =
        |(pupil, chords)| seen.build(beam, Form::Patches(Degrees { pupil, chords, ..degrees }, 0));
    let (count, family, finest) = if setting.field.is_slow() {
        (WORST_SLOW_ACROSS, &ACROSS[..SLOW_ACROSS], SLOW_FINEST_ACROSS)
    } else {
        (WORST_ACROSS, &ACROSS[..], FINEST_ACROSS)
    };
    let every = if setting.field.is_slow() { rays.len().div_ceil(count).max(1) } else { 1 };
    let rays: Vec<Ray> = rays.into_iter().step_by(every).collect();
    let contest = Contest { setting, rays: &rays, count };
    let ((pupil, chords), error) = contest.cheapest(family, finest, across);
    (Form::Patches(Degrees { pupil, chords, ..degrees }, seen.cells), error.max(worst))
}

/// Rays over what goes with the place; what its tables are off is a part of the error.
fn over_places(setting: &Setting<'_>, beam: Beam, seen: &Seen) -> ((usize, usize), Off) {
    let rays = anywhere_rays(setting);
    let of = |seen: &Seen, (stop, pupil)| seen.build(beam, Form::Rays(stop, pupil));
    if !seen.has_tables() {
        return of_both(setting, &rays, |degrees| of(seen, degrees));
    }
    let (best, error) = if setting.field.is_slow() {
        // Beside patches with tables there are slow ones.
        of_both(setting, &rays, |degrees| of(seen, degrees))
    } else {
        let contest = Contest { setting, rays: &rays, count: WORST };
        contest.cheapest(&PLACES, FINEST_PLACES, |degrees| of(seen, degrees))
    };
    // By the same rays, with and without tables.
    let bare = Seen::bare(setting);
    let (tabled, direct) = (of(seen, COMPARED), of(&bare, COMPARED));
    let every = rays.len().div_ceil(WORST).max(1);
    let off = rays.iter().step_by(every).map(|ray| {
        let axis = Axis { spot: ray.point, direction: ray.direction };
        Off::between(setting, tabled.radiance(&axis), direct.radiance(&axis))
    });
    (best, error.plus(off.fold(Off::NONE, Off::max).times(MARGIN)))
}

/// Rays over what is read from no tables.
fn of_both(
    setting: &Setting<'_>,
    rays: &[Ray],
    build: impl Fn((usize, usize)) -> Arc<dyn Optics>,
) -> ((usize, usize), Off) {
    let contest = Contest { setting, rays, count: WORST_SLOW };
    if setting.field.is_slow() {
        return contest.cheapest(&BOTH[..SLOW_BOTH], SLOW_FINEST_BOTH, build);
    }
    contest.cheapest(&BOTH, FINEST_BOTH, build)
}

/// The rule by which tables are compared with what they stand for.
const COMPARED: (usize, usize) = (9, 1);

/// Rules that compete for a beam.
struct Contest<'c> {
    setting: &'c Setting<'c>,
    rays: &'c [Ray],
    /// On how many of the rays, those on which coarse rules differ most.
    count: usize,
}

impl Contest<'_> {
    /// The first of a family that is within half the tolerance of the finest rule on the worst of the
    /// rays, or the one that comes nearest; and by how much it is off at most.
    fn cheapest<F: Copy>(
        &self,
        family: &[F],
        finest: F,
        build: impl Fn(F) -> Arc<dyn Optics>,
    ) -> (F, Off) {
        let worst = self.worst(&*build(family[0]), &*build(family[family.len() / 3]));
        let finest = build(finest);
        let answers: Vec<(Axis, f64)> = worst
            .into_iter()
            .map(|ray| {
                let axis = Axis { spot: ray.point, direction: ray.direction };
                (axis, finest.radiance(&axis))
            })
            .collect();
        let mut best = (family[0], Off::UNKNOWN, f64::INFINITY);
        for own in family {
            let optics = build(*own);
            let (mut most, mut used) = (Off::NONE, 0.0_f64);
            for (axis, answer) in &answers {
                let off = Off::between(self.setting, optics.radiance(axis), *answer);
                let off = off.times(MARGIN);
                (most, used) = (most.max(off), used.max(off.of_allowed(self.setting)));
            }
            if used < best.2 {
                best = (*own, most, used);
            }
            if used <= 1.0 {
                break;
            }
        }
        (best.0, best.1)
    }

    /// The rays on which two rules differ most.
    fn worst(&self, coarse: &dyn Optics, finer: &dyn Optics) -> Vec<&Ray> {
        if self.rays.len() <= self.count {
            return self.rays.iter().collect();
        }
        let off = |ray| departure(self.setting, coarse, finer, ray);
        let mut worst: Vec<(f64, &Ray)> = self.rays.iter().map(|ray| (off(ray), ray)).collect();
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        worst.into_iter().take(self.count).map(|(_, ray)| ray).collect()
    }
}
