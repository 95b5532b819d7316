//! Light that goes from surface to surface: radiosity, solved once where a scene is compiled. It knows
//! the direct light as numbers at places, and no detector.
//!
//! The balance is E = E₀ + ∫ ρ E cos θ cos θ' / π r² V dA over all surfaces that face each other
//! (Goral, Torrance, Greenberg and Battaile 1984; collocation on graded meshes: Atkinson 1997, *The
//! Numerical Solution of Integral Equations of the Second Kind*, ch. 9). On each cell E is a polynomial
//! through Gauss and Legendre's nodes; cells are halved where the coefficients do not decay, and
//! where what a cell sends out is not known well enough for the others.

mod chart;
mod gather;
mod mesh;

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;
use radiometry::projected::{self, RegionShadow, Source as Shining};
use radiometry::shape::Polygon;

use super::lamps::{Lighting, region_of};
use super::occluder_of;
use super::source::{position, shining};
use crate::CompileError;
use crate::scene::{Body, Scene};
use gather::{Between, gather};
use mesh::{Mesh, NODES, OnNodes, SIDE, roughness};

/// Cells at most, of all surfaces together.
const CELLS: usize = 96;
/// Rounds of halving at most.
const ROUNDS: usize = 40;
/// Sweeps of Gauss and Seidel at most.
const SWEEPS: usize = 5000;
/// What may be missing of the balance, relative to the brightest.
const SETTLED: f64 = 1e-13;
/// Places darker than this part of the brightest count as if they were as bright.
const DARK: f64 = 0.01;

/// How a scene's surfaces see one another. It does not depend on what lights them, but for the cells.
#[derive(Debug)]
pub(crate) struct Exchange {
    /// Which surfaces take part, by their places in the scene; the mesh counts them anew.
    members: Vec<usize>,
    albedos: Vec<f64>,
    mesh: Mesh,
    /// Of each leaf: from which leaves light comes, and how much.
    rows: Vec<Vec<(usize, Arc<Block>)>>,
    /// How far an irradiance may be off, relative to it, estimated.
    pub(super) error: f64,
}

/// Irradiance at each node of one leaf for an exitance of 1 at each node of another.
type Block = [OnNodes; NODES];

/// What an exchange is solved for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aim {
    /// Of irradiances, relative.
    pub(super) accuracy: f64,
    /// Errors of cells that are smaller than this count less, as their part of it: a corner where
    /// two surfaces end together has no limit, and is the rougher the nearer.
    pub(super) spot_m2: f64,
}

/// Two surfaces, by their places in the scene, and the form factor from the one to the other.
pub(super) struct Pair {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) form_factor: f64,
}

/// What the surfaces send to one another, once all is settled.
#[derive(Debug)]
pub(super) struct Interreflection {
    exchange: Arc<Exchange>,
    /// Irradiance by way of other surfaces at each leaf's nodes.
    indirect: Vec<OnNodes>,
}

/// Between cells that are known already.
#[derive(Default)]
struct Known {
    blocks: HashMap<(usize, usize), Option<Arc<Block>>>,
    direct: HashMap<usize, OnNodes>,
    /// Between two surfaces.
    between: HashMap<(usize, usize), Between>,
}

impl Exchange {
    /// Of the surfaces that see each other, as their lighting says; `None` if there are none.
    pub(super) fn new(
        scene: &Scene,
        lightings: &[Arc<Lighting>],
        aim: Aim,
    ) -> Result<Option<Self>, CompileError> {
        let pairs = scene.facing();
        let takes_part = |i: &usize| pairs.iter().any(|(a, b)| a == i || b == i);
        let members: Vec<usize> = (0..scene.surfaces().len()).filter(takes_part).collect();
        if members.is_empty() {
            return Ok(None);
        }
        let bodies: Vec<&Body> = members.iter().map(|i| scene.surfaces()[*i].body()).collect();
        let albedo = |i: &usize| scene.surfaces()[*i].reflection().albedo;
        let albedos = members.iter().map(albedo).collect();
        let mesh = Mesh::new(&bodies);
        let mut exchange = Self { members, albedos, mesh, rows: Vec::new(), error: f64::INFINITY };
        let mut known = Known::default();
        for _ in 0..ROUNDS {
            exchange.fill(scene, &mut known);
            let direct = exchange.direct(lightings, &mut known.direct);
            let indirect = exchange.settle(&direct)?;
            let wanted = exchange.judge(&direct, &indirect, aim);
            if exchange.error <= aim.accuracy || wanted.is_empty() {
                break;
            }
            let room = CELLS.saturating_sub(exchange.mesh.leaves.len());
            if room == 0 {
                break;
            }
            for (cell, axis) in wanted.into_iter().take(room) {
                exchange.mesh.halve(cell, axis);
            }
            exchange.mesh.count();
        }
        Ok(Some(exchange))
    }

    /// What the surfaces send to one another in the light of these lightings.
    pub(super) fn lit(
        self: &Arc<Self>,
        lightings: &[Arc<Lighting>],
    ) -> Result<Interreflection, CompileError> {
        let direct = self.direct(lightings, &mut HashMap::new());
        let indirect = self.settle(&direct)?;
        Ok(Interreflection { exchange: Arc::clone(self), indirect })
    }

    /// Pairs that see each other, the largest form factors first.
    pub(super) fn pairs(&self) -> Vec<Pair> {
        let count = self.members.len();
        let mut sent = vec![0.0; count * count];
        let mut areas = vec![0.0; count];
        for (leaf, row) in self.rows.iter().enumerate() {
            let cell = self.mesh.leaves[leaf];
            let (to, points) = (self.mesh.surface(cell), self.mesh.points(cell));
            areas[to] += points.iter().map(|point| point.density_m2).sum::<f64>();
            for (other, block) in row {
                let from = self.mesh.surface(self.mesh.leaves[*other]);
                let arriving = block.iter().zip(&points);
                sent[to * count + from] += arriving
                    .map(|(weights, point)| weights.iter().sum::<f64>() * point.density_m2)
                    .sum::<f64>();
            }
        }
        let mut pairs = Vec::new();
        for a in 0..count {
            // By reciprocity, what a receives of b's exitance is what b receives of a's.
            for b in (0..count).filter(|b| sent[a * count + *b] > 0.0 && *b != a) {
                let form_factor = sent[a * count + b] / areas[a];
                pairs.push(Pair { from: self.members[a], to: self.members[b], form_factor });
            }
        }
        pairs.sort_by(|p, q| q.form_factor.total_cmp(&p.form_factor));
        pairs
    }

    fn direct(
        &self,
        lightings: &[Arc<Lighting>],
        known: &mut HashMap<usize, OnNodes>,
    ) -> Vec<OnNodes> {
        let of = |cell: &usize| {
            *known.entry(*cell).or_insert_with(|| {
                let lighting = &lightings[self.members[self.mesh.surface(*cell)]];
                self.mesh.points(*cell).map(|point| lighting.irradiance(point.place, point.normal))
            })
        };
        self.mesh.leaves.iter().map(of).collect()
    }

    /// Finds what is not known yet of how leaves see each other.
    fn fill(&mut self, scene: &Scene, known: &mut Known) {
        let mut rows = Vec::with_capacity(self.mesh.leaves.len());
        for cell in &self.mesh.leaves {
            let mut row = Vec::new();
            for (leaf, other) in self.mesh.leaves.iter().enumerate() {
                let pair = (self.mesh.surface(*cell), self.mesh.surface(*other));
                if pair.0 == pair.1 {
                    continue;
                }
                let between =
                    known.between.entry(pair).or_insert_with(|| self.between(scene, pair));
                let block = known.blocks.entry((*cell, *other));
                let block = block.or_insert_with(|| self.block(*cell, *other, between));
                row.extend(block.as_ref().map(|block| (leaf, Arc::clone(block))));
            }
            rows.push(row);
        }
        self.rows = rows;
    }

    /// What may stand between two surfaces.
    fn between(&self, scene: &Scene, (to, from): (usize, usize)) -> Between {
        let body = |member: usize| scene.surfaces()[self.members[member]].body();
        let own = [to, from].map(|member| body(member).solid().and_then(|s| position(scene, &s)));
        let region = region_of(body(to));
        let source = body(from).solid().and_then(|solid| shining(&solid, "").ok());
        let mut between = Between::default();
        for (k, (_, solid)) in scene.opaque().into_iter().enumerate() {
            let occluder = occluder_of(&solid);
            let is_clear = match (&region, &source) {
                (Some(region), Some(source)) => {
                    projected::region_shadow(region, source, &occluder) == Ok(RegionShadow::Lit)
                }
                _ => false,
            };
            if !is_clear && !own.contains(&Some(k)) {
                between.solids.push(solid);
                between.occluders.push(occluder);
            }
        }
        between
    }

    /// `None` if no light comes from the other cell.
    fn block(&self, cell: usize, other: usize, between: &Between) -> Option<Arc<Block>> {
        let between = self.left_between(cell, other, between)?;
        let (chart, of) = (self.mesh.chart(other), &self.mesh.cells[other]);
        let block = self.mesh.points(cell).map(|point| gather(&point, chart, of, &between));
        let is_any = block.iter().flatten().any(|weight| *weight != 0.0);
        is_any.then(|| Arc::new(block))
    }

    /// Of what may stand between two surfaces, what may stand between two cells; `None` if one body hides
    /// the one from the other.
    fn left_between(&self, cell: usize, other: usize, between: &Between) -> Option<Between> {
        let polygon = |cell: usize| {
            let chart = self.mesh.chart(cell);
            let of = &self.mesh.cells[cell];
            chart.is_straight().then(|| Polygon::new(chart.outline(of.low, of.high)).ok()).flatten()
        };
        if between.solids.is_empty() {
            return Some(Between::default());
        }
        let (Some(region), Some(source)) = (polygon(cell), polygon(other)) else {
            return Some(between.clone());
        };
        let (region, source) = (projected::Region::Polygon(region), Shining::Polygon(source));
        let mut left = Between::default();
        for (solid, occluder) in between.solids.iter().zip(&between.occluders) {
            match projected::region_shadow(&region, &source, occluder) {
                Ok(RegionShadow::Umbra) => return None,
                Ok(RegionShadow::Lit) => {}
                Ok(RegionShadow::Mixed) | Err(_) => {
                    left.solids.push(solid.clone());
                    left.occluders.push(occluder.clone());
                }
            }
        }
        Some(left)
    }

    /// Irradiance by way of other surfaces, by the sweeps of Gauss and Seidel.
    fn settle(&self, direct: &[OnNodes]) -> Result<Vec<OnNodes>, CompileError> {
        let mut indirect = vec![[0.0; NODES]; direct.len()];
        let mut leaving: Vec<OnNodes> =
            direct.iter().enumerate().map(|(leaf, e)| e.map(|e| self.albedo(leaf) * e)).collect();
        let (mut last, mut brightest) = (f64::INFINITY, 0.0_f64);
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for (leaf, row) in self.rows.iter().enumerate() {
                let mut arriving = [0.0; NODES];
                for (other, block) in row {
                    let exitance = &leaving[*other];
                    for (sum, weights) in arriving.iter_mut().zip(block.iter()) {
                        *sum += weights.iter().zip(exitance).map(|(w, m)| w * m).sum::<f64>();
                    }
                }
                for (k, e) in arriving.into_iter().enumerate() {
                    change = change.max((e - indirect[leaf][k]).abs());
                    leaving[leaf][k] = self.albedo(leaf) * (direct[leaf][k] + e);
                    brightest = brightest.max(direct[leaf][k] + e);
                }
                indirect[leaf] = arriving;
            }
            // The rest of a geometric series of changes.
            let is_known = last.is_finite() && change < last;
            let rest = if is_known { change * change / (last - change) } else { f64::INFINITY };
            if change == 0.0 || rest <= SETTLED * brightest {
                return Ok(indirect);
            }
            last = change;
        }
        let names = self.members.iter().map(|i| format!("surface[{i}]")).collect::<Vec<_>>();
        Err(CompileError::Scene(format!(
            "the light between {} does not settle after {SWEEPS} reflections, expected surfaces that \
             absorb or a way out; lower an albedo",
            names.join(", ")
        )))
    }

    fn albedo(&self, leaf: usize) -> f64 {
        self.albedos[self.mesh.surface(self.mesh.leaves[leaf])]
    }

    /// Estimates the error, and says which cells to halve and how, the worst first.
    fn judge(
        &mut self,
        direct: &[OnNodes],
        indirect: &[OnNodes],
        Aim { accuracy, spot_m2 }: Aim,
    ) -> Vec<(usize, usize)> {
        let sum = |(e, i): (&OnNodes, &OnNodes)| core::array::from_fn(|k| e[k] + i[k]);
        let whole: Vec<OnNodes> = direct.iter().zip(indirect).map(sum).collect();
        let brightest = whole.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
        // What an error of one counts in each leaf.
        let weights = self.mesh.leaves.iter().zip(&whole).map(|(cell, e)| {
            let area_m2: f64 = self.mesh.points(*cell).iter().map(|p| p.density_m2).sum();
            let mean = e.iter().sum::<f64>() / NODES as f64;
            (area_m2 / spot_m2).min(1.0) / mean.max(DARK * brightest)
        });
        let weights: Vec<f64> = weights.collect();
        let sent = whole.iter().enumerate();
        let sent = sent.map(|(leaf, e)| roughness(e).map(|rough| self.albedo(leaf) * rough));
        let sent: Vec<[f64; 2]> = sent.collect();
        let own = indirect.iter().zip(&weights);
        let own = own.map(|(e, weight)| roughness(e).map(|rough| rough * weight));
        // Of each leaf: for its own sake, and for what it sends to others.
        let mut scores: Vec<[f64; 2]> = own.collect();
        let largest = |of: &[f64; 2]| of[0].max(of[1]);
        let own: Vec<f64> = scores.iter().map(largest).collect();
        let alike = libm::sqrt(whole.len() as f64);
        self.error = 0.0;
        for (leaf, row) in self.rows.iter().enumerate() {
            let mut squares = 0.0;
            for (other, block) in row {
                let part = block.iter().map(|weights| weights.iter().sum::<f64>());
                let part = part.fold(0.0, f64::max) * weights[leaf];
                // Errors of many cells are not all of one sign.
                squares += (largest(&sent[*other]) * part).powi(2);
                for (score, sent) in scores[*other].iter_mut().zip(sent[*other]) {
                    *score = score.max(sent * part * alike);
                }
            }
            self.error = self.error.max(own[leaf] + libm::sqrt(squares));
        }
        let leaves = scores.iter().zip(&self.mesh.leaves);
        let leaves = leaves.map(|(s, cell)| (largest(s), *cell, usize::from(s[1] > s[0])));
        let mut wanted: Vec<_> = leaves.filter(|(s, ..)| *s > accuracy / 2.0).collect();
        wanted.sort_by(|a, b| b.0.total_cmp(&a.0));
        // The worst decide how well the others have to be known.
        let worst = wanted.first().map_or(0.0, |(score, ..)| *score);
        wanted.retain(|(score, ..)| *score > WORSE * worst);
        wanted.into_iter().map(|(_, cell, axis)| (cell, axis)).collect()
    }
}

/// Cells this much better than the worst wait for the next round.
const WORSE: f64 = 0.05;

impl Interreflection {
    /// Places next to the corners and in the middle of all cells, which are the smallest where the
    /// light changes most.
    pub(super) fn places(&self) -> Vec<DVec3> {
        let mesh = &self.exchange.mesh;
        let some = |cell: &usize| {
            let points = mesh.points(*cell);
            [0, SIDE - 1, NODES / 2, NODES - SIDE, NODES - 1].map(|k| points[k].place)
        };
        mesh.leaves.iter().flat_map(some).collect()
    }

    /// What comes to a place of a surface by way of others, W·m⁻² or lm·m⁻².
    pub(super) fn irradiance(&self, surface: usize, place: DVec3) -> f64 {
        let exchange = &self.exchange;
        let member = exchange.members.iter().position(|i| *i == surface);
        let value = |member| exchange.mesh.value(member, place, &self.indirect);
        // Between the nodes a polynomial may swing below zero.
        member.map_or(0.0, value).max(0.0)
    }
}

#[cfg(test)]
mod tests;
