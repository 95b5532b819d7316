//! What a laboratory does with a grid of readings that fits nothing: a cubic spline along θ, then
//! round φ, then along x and y. It takes readings as radiances at their targets, whatever the beam
//! and the way of a window were.

use core::f64::consts::{PI, TAU};
use core::fmt;

use super::spline::{Cubic, weights};
use crate::rig::Pose;
use crate::study::Nodes;

/// Poses closer than this share a coordinate: counts of an encoder round in the fifth digit.
const SAME_RAD: f64 = 2e-4;
const SAME_M: f64 = 2e-5;

/// Why readings can't be interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoGrid {
    /// There are none.
    Empty,
    /// A place lacks meridians that others have, or places don't make columns and rows.
    Holes,
    /// Fewer than three meridians: nothing goes round.
    Meridians,
    /// A meridian has no reading besides the pole's.
    Meridian,
}

impl fmt::Display for NoGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Empty => "no readings",
            Self::Holes => "the readings make no whole grid of places and meridians",
            Self::Meridians => "fewer than three meridians",
            Self::Meridian => "a meridian without readings",
        })
    }
}

/// Values at all nodes, in the order of [`Nodes::rays`], from readings on a grid: places in columns
/// and rows, the same meridians at each. The angles along a meridian are its own affair.
///
/// Where a meridian has one opposite it, θ runs through the pole along both; else it begins at the
/// pole. Ends are not-a-knot; fewer than four columns make the polynomial through them.
pub fn interpolate(readings: &[(Pose, f64)], nodes: &Nodes) -> Result<Vec<f64>, NoGrid> {
    let grid = Grid::of(readings)?;
    let (x, y) = (places_of(&grid.x_m, nodes.x_m())?, places_of(&grid.y_m, nodes.y_m())?);
    let first = grid.phi_rad[0];
    let turned: Vec<f64> =
        nodes.phi_rad().map(|phi| first + (phi - first).rem_euclid(TAU)).collect();
    let round = |v: Vec<f64>| Cubic::periodic(grid.phi_rad.clone(), v, TAU);
    let phi = weights(grid.phi_rad.len(), round, &turned).ok_or(NoGrid::Meridians)?;
    let theta: Vec<f64> = nodes.theta_rad().collect();
    let at_places = grid.directions(&theta, &phi)?;
    let directions = theta.len() * phi.len();
    let mut values = Vec::with_capacity(x.len() * y.len() * directions);
    for of_x in &x {
        for of_y in &y {
            let mut mean = vec![0.0; directions];
            for (i, wx) in of_x.iter().enumerate() {
                for (j, wy) in of_y.iter().enumerate() {
                    let from = &at_places[i * grid.y_m.len() + j];
                    for (sum, value) in mean.iter_mut().zip(from) {
                        *sum += wx * wy * value;
                    }
                }
            }
            values.extend(mean);
        }
    }
    Ok(values)
}

fn places_of(at: &[f64], nodes: impl Iterator<Item = f64>) -> Result<Vec<Vec<f64>>, NoGrid> {
    let nodes: Vec<f64> = nodes.collect();
    let along = |v: Vec<f64>| Cubic::not_a_knot(at.to_vec(), v);
    weights(at.len(), along, &nodes).ok_or(NoGrid::Holes)
}

/// Readings by place and meridian.
struct Grid {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    phi_rad: Vec<f64>,
    /// By column, row and meridian: θ and values, ascending, without the pole.
    meridians: Vec<Vec<(f64, f64)>>,
    /// By place: the mean of the readings at the pole, if there are any.
    poles: Vec<Option<f64>>,
}

impl Grid {
    fn of(readings: &[(Pose, f64)]) -> Result<Self, NoGrid> {
        let x_m = distinct(readings.iter().map(|(pose, _)| pose.x_m), SAME_M);
        let y_m = distinct(readings.iter().map(|(pose, _)| pose.y_m), SAME_M);
        let away = || readings.iter().filter(|(pose, _)| pose.theta_rad > SAME_RAD);
        let turn = |pose: &Pose| (pose.phi_rad + SAME_RAD).rem_euclid(TAU) - SAME_RAD;
        let phi_rad = distinct(away().map(|(pose, _)| turn(pose)), SAME_RAD);
        let places = x_m.len() * y_m.len();
        if places * phi_rad.len() == 0 {
            return Err(NoGrid::Empty);
        }
        let mut grid = Self {
            meridians: vec![Vec::new(); places * phi_rad.len()],
            poles: vec![None; places],
            x_m,
            y_m,
            phi_rad,
        };
        let mut at_poles = vec![(0.0, 0_u32); places];
        for (pose, value) in readings {
            let column = nearest(&grid.x_m, pose.x_m);
            let place = column * grid.y_m.len() + nearest(&grid.y_m, pose.y_m);
            if pose.theta_rad > SAME_RAD {
                let meridian = nearest(&grid.phi_rad, turn(pose));
                let line = place * grid.phi_rad.len() + meridian;
                grid.meridians[line].push((pose.theta_rad, *value));
            } else {
                at_poles[place].0 += value;
                at_poles[place].1 += 1;
            }
        }
        let mean = |(sum, count): (f64, u32)| (count > 0).then(|| sum / f64::from(count));
        grid.poles = at_poles.into_iter().map(mean).collect();
        if grid.meridians.iter().any(Vec::is_empty) {
            return Err(NoGrid::Holes);
        }
        for line in &mut grid.meridians {
            line.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        Ok(grid)
    }

    /// At every place the values into the directions, φ fastest.
    fn directions(&self, theta: &[f64], phi: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, NoGrid> {
        let count = self.phi_rad.len();
        let mut places = Vec::new();
        for place in 0..self.x_m.len() * self.y_m.len() {
            let along: Result<Vec<Vec<f64>>, NoGrid> =
                (0..count).map(|meridian| self.along(place, meridian, theta)).collect();
            let along = along?;
            let mut values = Vec::with_capacity(theta.len() * phi.len());
            for t in 0..theta.len() {
                let sum =
                    |row: &Vec<f64>| row.iter().zip(&along).map(|(w, line)| w * line[t]).sum();
                values.extend(phi.iter().map(|row| -> f64 { sum(row) }));
            }
            places.push(values);
        }
        Ok(places)
    }

    /// The values along a meridian.
    fn along(&self, place: usize, meridian: usize, theta: &[f64]) -> Result<Vec<f64>, NoGrid> {
        let line = |meridian: usize| &self.meridians[place * self.phi_rad.len() + meridian];
        let phi = self.phi_rad[meridian];
        let is_opposite = |other: &f64| ((other - phi).abs() - PI).abs() < SAME_RAD;
        let opposite = self.phi_rad.iter().position(is_opposite);
        let behind = opposite.into_iter().flat_map(|other| line(other).iter().rev());
        let behind = behind.map(|(theta, value)| (-theta, *value));
        let pole = self.poles[place].map(|value| (0.0, value));
        let points = behind.chain(pole).chain(line(meridian).iter().copied());
        let (at, values) = points.unzip();
        let spline = Cubic::not_a_knot(at, values).ok_or(NoGrid::Meridian)?;
        Ok(theta.iter().map(|theta| spline.value(*theta)).collect())
    }
}

/// Values that differ by more than `same`, ascending, each the mean of those that don't.
fn distinct(values: impl Iterator<Item = f64>, same: f64) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let close = values.chunk_by(|a, b| b - a <= same);
    close.map(|group| group.iter().sum::<f64>() / group.len() as f64).collect()
}

fn nearest(among: &[f64], value: f64) -> usize {
    let above = among.partition_point(|x| *x < value).min(among.len() - 1);
    let below = above.saturating_sub(1);
    if (among[above] - value).abs() < (among[below] - value).abs() { above } else { below }
}

#[cfg(test)]
mod tests {
    use fit::{Ray, Region};

    use super::*;
    use crate::study::{Fineness, Score};

    const REGION: Region = Region::surface((-0.015, 0.015), (-0.01, 0.01), 1.4);
    const COARSE: Fineness = Fineness { theta: 12, phi: 16, parts: 1, in_part: 5 };

    /// A raster with the pole once a place, as a plan has it.
    fn raster(
        places: u32,
        meridians: u32,
        circles: u32,
        field: impl Fn(&Ray) -> f64,
    ) -> Vec<(Pose, f64)> {
        let part = |i: u32| 2.0 * f64::from(i) / f64::from(places - 1).max(1.0) - 1.0;
        let mut readings = Vec::new();
        for (i, j) in (0..places).flat_map(|i| (0..places).map(move |j| (i, j))) {
            for (m, t) in
                (0..meridians).flat_map(|m| (u32::from(m > 0)..=circles).map(move |t| (m, t)))
            {
                let pose = Pose {
                    x_m: 0.015 * part(i),
                    y_m: 0.01 * part(j),
                    theta_rad: 1.4 * f64::from(t) / f64::from(circles),
                    phi_rad: TAU * f64::from(m) / f64::from(meridians) - PI + 1e-7 * f64::from(m),
                };
                let Pose { x_m, y_m, theta_rad, phi_rad } = pose;
                readings.push((pose, field(&Ray { x_m, y_m, theta_rad, phi_rad })));
            }
        }
        readings
    }

    fn error(readings: &[(Pose, f64)], field: impl Fn(&Ray) -> f64) -> f64 {
        let nodes = Nodes::of(&REGION, COARSE);
        let found = interpolate(readings, &nodes).unwrap();
        let truth: Vec<f64> = nodes.rays().map(|(ray, _)| field(&ray)).collect();
        Score::of_values(&nodes, &found, &truth).unwrap().rms_relative
    }

    #[test]
    fn polynomials_of_the_third_degree_in_x_and_y_and_even_ones_in_theta_are_exact() {
        let field = |ray: &Ray| {
            let (x, y, theta) = (100.0 * ray.x_m, 100.0 * ray.y_m, ray.theta_rad);
            (1.0 + x - x * x * x) * (2.0 - y * y + 0.3 * y * y * y) * (1.0 - 0.2 * theta * theta)
        };
        assert!(error(&raster(4, 4, 3, field), field) < 1e-12);
        // An odd number of meridians has none opposite: along each from the pole.
        assert!(error(&raster(4, 5, 4, field), field) < 1e-12);
        // Three columns hold a parabola, and no cubic.
        assert!(error(&raster(3, 4, 3, field), field) > 1e-3);
    }

    #[test]
    fn a_lobe_aside_is_followed_with_the_fourth_power_of_the_step() {
        let field = |ray: &Ray| {
            let toward = radiometry::direction::unit(0.7, 0.5);
            let cosine = toward.dot(radiometry::direction::unit(ray.theta_rad, ray.phi_rad));
            libm::exp(10.0 * (cosine - 1.0))
        };
        let [coarse, fine] =
            [(14, 17), (28, 34)].map(|(m, t)| error(&raster(1, m, t, field), field));
        assert!(fine < 2e-3 && (8.0..60.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        let nodes = Nodes::of(&REGION, COARSE);
        let refused = |readings: &[(Pose, f64)]| interpolate(readings, &nodes).unwrap_err();
        assert_eq!(refused(&[]), NoGrid::Empty);
        assert_eq!(refused(&raster(2, 2, 3, |_| 1.0)), NoGrid::Meridians);
        let mut holes = raster(2, 4, 3, |_| 1.0);
        holes.retain(|(pose, _)| pose.x_m < 0.0 || pose.phi_rad < 1.0);
        assert_eq!(refused(&holes), NoGrid::Holes);
    }
}
