//! What the wider model keeps of readings that are forgotten one by one, on several machines perhaps: their rows
//! in a triangle, and mean rows by direction. The readings' own fit may be made later, of several shares
//! together; what this says of it is what walks through all of them would say, but for how finely
//! directions are told apart.
//!
//! How fine the finer functions are goes with the basis alone, since nobody knows yet at how many places is
//! measured: once that is known, those of the position that no place tells are left out.

use std::collections::BTreeMap;
use std::sync::Arc;

use faer::Mat;
use glam::DVec3;

use super::heard::Heard;
use super::left_out::{Group, LeftOut};
use super::look::{Look, Rows};
use super::uneven::{CELLS_A_UNIT, CELLS_MAX, cell};
use super::wider::{Noise, SCALE_MOST, Widened, Wider};
use super::{Finer, most_of_position};
use crate::basis::{Basis, dot};
use crate::stored::{Numbers, whole};
use crate::triangle::{Solution, Triangle};
use crate::{Fit, FitError};

/// What readings say of a fit's functions, of what they share, and of finer functions.
#[derive(Debug, Clone)]
pub(crate) struct Remembered {
    finer: Finer,
    beyond: Arc<Basis>,
    /// The fit's functions.
    own: usize,
    /// What the readings share, as far as it shows in residuals.
    names: Vec<String>,
    look: Look,
    groups: Groups,
}

impl Remembered {
    /// Of no reading yet; `None` where nothing finer is looked for, see [`Fit::with_truncation`].
    pub(crate) fn new(own: &Basis, names: Vec<String>) -> Result<Option<Self>, FitError> {
        let (spec, region) = (own.spec(), own.region());
        let has_extent = region.x_m.0 < region.x_m.1 || region.y_m.0 < region.y_m.1;
        let places = if has_extent { usize::MAX } else { 1 };
        let Some(finer) = Finer::of(spec, region, places) else { return Ok(None) };
        let beyond = Arc::new(Basis::new(finer.spec, *region)?);
        let own = own.len();
        let columns = own + names.len() + finer.kept.len();
        let (look, groups) = (Look::new(columns, false), Groups::new(columns));
        Ok(Some(Self { finer, beyond, own, names, look, groups }))
    }

    /// What finer functions are of.
    pub(crate) fn beyond(&self) -> Arc<Basis> {
        Arc::clone(&self.beyond)
    }

    /// What the readings share, as far as it shows in residuals.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    pub(crate) fn take(&mut self, heard: &Heard<'_>) -> Result<(), FitError> {
        let Self { look, groups, finer, .. } = self;
        look.take(heard, &finer.kept, |i, row| {
            groups.take(heard.towards(i), heard.values[i], heard.variance(i, false), row);
        })
    }

    /// Takes in what another share of the same basis says. What shows in the residuals of one alone shows in
    /// few of them, and is left out.
    pub(crate) fn merge(&mut self, other: &Self) {
        let mut other = other.clone();
        if self.names != other.names {
            let (own, others) = (self.names.clone(), other.names.clone());
            self.keep_names(&others);
            other.keep_names(&own);
        }
        self.look.merge(&other.look);
        self.groups.merge(&other.groups);
    }

    /// The fit with what its functions can't follow in u, if there is any. A row of unit weight has the variance
    /// `unit`, which may not have been stated but found; readings scatter by `u_factor` beyond it.
    pub(crate) fn widened(
        mut self,
        fit: &Fit,
        places: usize,
        (unit, is_unknown): (f64, bool),
        u_factor: f64,
    ) -> Result<Option<Widened>, FitError> {
        self.narrow(fit, places);
        let Self { finer, names, mut look, mut groups, .. } = self;
        look.multiply(unit);
        groups.multiply(unit);
        // By how much they scatter beyond what is stated nobody asks here, only whether.
        let is_beyond = is_unknown || u_factor > 1.0 || look.least < 1.0;
        if !is_unknown {
            look.most = SCALE_MOST;
        }
        let noise = (is_unknown, f64::from(u8::from(is_beyond)));
        let wider = Wider::of_shares(fit, finer, &names, noise)?;
        wider.concluded(look, |noise, solution| Ok(groups.left_out(noise, solution, u_factor)))
    }

    fn columns(&self) -> usize {
        self.own + self.names.len() + self.finer.kept.len()
    }

    /// Leaves out finer functions that no place tells of.
    fn narrow(&mut self, fit: &Fit, places: usize) {
        let own = fit.basis();
        if self.finer.spec.position.degree().unwrap_or(0) <= most_of_position(own, places) {
            return;
        }
        let (finer, is_left) = self.finer.narrowed(own, places);
        let known = vec![true; self.own + self.names.len()];
        self.keep(&[known, is_left].concat());
        self.finer = finer;
    }

    fn keep_names(&mut self, others: &[String]) {
        let is_kept: Vec<bool> = self.names.iter().map(|name| others.contains(name)).collect();
        let (own, finer) = (vec![true; self.own], vec![true; self.finer.kept.len()]);
        self.keep(&[own, is_kept, finer].concat());
        self.names.retain(|name| others.contains(name));
    }

    fn keep(&mut self, is_kept: &[bool]) {
        self.look.found.triangle = self.look.found.triangle.keeping(is_kept);
        self.groups.keep(is_kept);
    }

    /// The numbers that it consists of, for [`stored`](Self::stored).
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let Look { found, least, scatter, plain, .. } = &self.look;
        let rows = found.triangle.rows() as f64;
        let mut out = vec![found.logs, found.counted, rows, *least, scatter[0], scatter[1], *plain];
        out.extend(found.triangle.packed());
        self.groups.put(&mut out);
        out
    }

    /// Takes stored numbers up; `None` where they are not such ones.
    pub(crate) fn stored(
        numbers: &[f64],
        own: &Basis,
        names: Vec<String>,
    ) -> Result<Option<Self>, FitError> {
        let Some(new) = Self::new(own, names)? else { return Ok(None) };
        Ok(new.filled(&mut Numbers::of(numbers)))
    }

    fn filled(mut self, numbers: &mut Numbers<'_>) -> Option<Self> {
        let columns = self.columns();
        let look = &mut self.look;
        (look.found.logs, look.found.counted) = (numbers.number()?, numbers.number()?);
        let rows = numbers.count(usize::MAX)? as u64;
        look.least = numbers.number().filter(|least| (0.0..=1.0).contains(least))?;
        let mut positive = || numbers.number().filter(|number| *number >= 0.0);
        (look.scatter, look.plain) = ([positive()?, positive()?], positive()?);
        let packed = numbers.some((columns + 1) * (columns + 2) / 2)?;
        look.found.triangle = Triangle::from_packed(columns, 1, rows, &packed);
        self.groups = Groups::stored(numbers, columns)?;
        numbers.is_empty().then_some(self)
    }
}

impl Look {
    fn merge(&mut self, other: &Self) {
        let Rows { triangle, logs, counted, .. } = &mut self.found;
        triangle.merge(&other.found.triangle);
        *logs += other.found.logs;
        *counted += other.found.counted;
        self.least = self.least.min(other.least);
        self.scatter[0] += other.scatter[0];
        self.scatter[1] += other.scatter[1];
        self.plain += other.plain;
    }

    /// All variances by a factor.
    fn multiply(&mut self, factor: f64) {
        let Rows { triangle, logs, counted, .. } = &mut self.found;
        *triangle = triangle.scaled(1.0 / factor.sqrt());
        *logs += *counted * libm::log(factor);
        self.scatter = self.scatter.map(|sum| sum * factor);
    }
}

/// Readings of about one direction together, and their rows: of as small a part of the sphere as leaves
/// few enough of them.
#[derive(Debug, Clone)]
struct Groups {
    columns: usize,
    cells_a_unit: f64,
    cells: BTreeMap<[i32; 3], Sums>,
}

/// Sums over readings.
#[derive(Debug, Clone)]
struct Sums {
    count: f64,
    values: f64,
    variances: f64,
    towards: DVec3,
    row: Vec<f64>,
}

impl Groups {
    fn new(columns: usize) -> Self {
        Self { columns, cells_a_unit: CELLS_A_UNIT, cells: BTreeMap::new() }
    }

    /// As many as a few megabytes hold.
    fn most(&self) -> usize {
        (NUMBERS_MAX / self.columns.max(1)).clamp(CELLS_LEAST, CELLS_MAX)
    }

    fn take(&mut self, towards: DVec3, value: f64, variance: f64, row: &[f64]) {
        let one = |row| Sums { count: 1.0, values: value, variances: variance, towards, row };
        match self.cells.get_mut(&cell(self.cells_a_unit, towards)) {
            Some(own) => own.add(&one(Vec::new()), row),
            None => self.insert(one(row.to_vec())),
        }
    }

    fn merge(&mut self, other: &Self) {
        while self.cells_a_unit > other.cells_a_unit {
            self.coarsen();
        }
        other.cells.values().for_each(|sums| self.insert(sums.clone()));
    }

    fn insert(&mut self, sums: Sums) {
        match self.cells.entry(cell(self.cells_a_unit, sums.direction())) {
            std::collections::btree_map::Entry::Occupied(mut own) => {
                own.get_mut().add(&sums, &sums.row);
            }
            std::collections::btree_map::Entry::Vacant(free) => {
                free.insert(sums);
            }
        }
        while self.cells.len() > self.most() {
            self.coarsen();
        }
    }

    fn coarsen(&mut self) {
        self.cells_a_unit *= 0.5;
        let finer = std::mem::take(&mut self.cells);
        for sums in finer.into_values() {
            self.insert(sums);
        }
    }

    fn multiply(&mut self, factor: f64) {
        self.cells.values_mut().for_each(|sums| sums.variances *= factor);
    }

    fn keep(&mut self, is_kept: &[bool]) {
        for sums in self.cells.values_mut() {
            let mut kept = is_kept.iter();
            sums.row.retain(|_| kept.next() == Some(&true));
        }
        self.columns = is_kept.iter().filter(|is_kept| **is_kept).count();
    }

    /// What all others foretell of them; `solution` is of all rows and priors, and the fit took readings to
    /// scatter by `u_factor` more than their rows were told.
    fn left_out(&self, noise: Noise, solution: &Solution, u_factor: f64) -> LeftOut {
        let unknowns = solution.unknowns(0);
        let mut rows = Mat::zeros(self.columns, self.cells.len());
        let mut groups = Vec::with_capacity(self.cells.len());
        for (k, sums) in self.cells.values().enumerate() {
            let mean = rows.col_as_slice_mut(k);
            mean.iter_mut().zip(&sums.row).for_each(|(mean, sum)| *mean = sum / sums.count);
            groups.push(Group {
                count: sums.count,
                found: u_factor * u_factor * sums.variances,
                stated: sums.variances,
                residual: sums.values / sums.count - dot(mean, &unknowns),
                towards: sums.direction(),
            });
        }
        // Their rows know of these variances alone.
        let noise = Noise { is_stated: true, ..noise };
        LeftOut::of(groups, rows, &solution.inverse_matrix(), noise)
    }

    fn put(&self, out: &mut Vec<f64>) {
        out.extend([self.cells_a_unit, self.cells.len() as f64]);
        for Sums { count, values, variances, towards, row } in self.cells.values() {
            out.extend([*count, *values, *variances, towards.x, towards.y, towards.z]);
            out.extend(row);
        }
    }

    fn stored(numbers: &mut Numbers<'_>, columns: usize) -> Option<Self> {
        let mut groups = Self::new(columns);
        let halvings = whole(libm::log2(CELLS_A_UNIT / numbers.number()?))?;
        let halvings = i32::try_from(halvings).ok().filter(|n| (0..=HALVINGS_MAX).contains(n))?;
        groups.cells_a_unit *= f64::powi(0.5, halvings);
        for _ in 0..numbers.count(groups.most())? {
            let (count, values, variances) =
                (numbers.number()?, numbers.number()?, numbers.number()?);
            let towards = DVec3::new(numbers.number()?, numbers.number()?, numbers.number()?);
            let row = numbers.some(columns)?;
            let sums = Sums { count, values, variances, towards, row };
            groups.insert((count >= 1.0 && variances > 0.0).then_some(sums)?);
        }
        Some(groups)
    }
}

impl Sums {
    fn add(&mut self, other: &Self, row: &[f64]) {
        self.count += other.count;
        self.values += other.values;
        self.variances += other.variances;
        self.towards += other.towards;
        self.row.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }

    fn direction(&self) -> DVec3 {
        self.towards.normalize_or(DVec3::Z)
    }
}

/// Of all rows of groups: four megabytes.
const NUMBERS_MAX: usize = 1 << 19;
/// However many functions there are.
const CELLS_LEAST: usize = 64;
/// Cells twice as wide, again and again: up to where there are fewer than [`CELLS_LEAST`] of them.
const HALVINGS_MAX: i32 = 8;
