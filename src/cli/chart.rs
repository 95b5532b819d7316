//! In which chart a CSV's rays are, and what its fit stands for: from the arguments, and where they
//! are silent from the samples themselves.

use fit::{Optics, Outline, Ray, Region};

use super::args::ChartArgs;
use super::failure::Failure;
use crate::export::RayChart;

const NAMES: [&str; 4] = ["surface", "perpendicular", "environment", "two-plane"];
/// A region's cone ends this far beyond the outermost sample of a CSV at most.
const THETA_MAX_RAD: f64 = core::f64::consts::FRAC_PI_2;

impl ChartArgs {
    /// The columns to read; refuses what belongs to other charts.
    pub(super) fn ray_chart(&self) -> Result<RayChart, Failure> {
        let chart = match (self.chart.as_str(), self.distance_mm) {
            ("surface", _) => RayChart::Surface,
            ("perpendicular", _) => RayChart::Perpendicular,
            ("environment", _) => RayChart::Environment,
            ("two-plane", Some(distance_mm)) if distance_mm > 0.0 && distance_mm.is_finite() => {
                RayChart::TwoPlane { distance_m: distance_mm * 1e-3 }
            }
            ("two-plane", Some(distance_mm)) => {
                let what = format!("--distance-mm: {distance_mm}; expected a number above 0");
                return Err(Failure::start(what));
            }
            ("two-plane", None) => {
                return Err(Failure::with_help(
                    "--chart two-plane: how far the planes are from each other is not known",
                    "add --distance-mm MM",
                ));
            }
            (name, _) => {
                return Err(Failure::with_help(
                    format!("--chart: `{name}` is not a chart"),
                    format!("expected one of {}", NAMES.join(", ")),
                ));
            }
        };
        let is = |name: &str| self.chart == name;
        let places = !is("environment");
        let foreign = [
            ("--distance-mm", self.distance_mm.is_some(), is("two-plane")),
            ("--s-mm", self.s_mm.is_some(), is("two-plane")),
            ("--t-mm", self.t_mm.is_some(), is("two-plane")),
            ("--radius-mm", self.radius_mm.is_some(), is("perpendicular")),
            ("--x-mm", self.x_mm.is_some(), places),
            ("--y-mm", self.y_mm.is_some(), places),
            ("--theta-max-deg", self.theta_max_deg.is_some(), !is("two-plane")),
        ];
        if let Some((flag, ..)) = foreign.into_iter().find(|(_, given, own)| *given && !own) {
            return Err(Failure::with_help(
                format!("{flag}: the {} chart has no such coordinate", self.chart),
                "leave it out, or name another --chart",
            ));
        }
        if let Some(mm) = self.radius_mm.filter(|mm| !(*mm > 0.0 && mm.is_finite())) {
            return Err(Failure::start(format!("--radius-mm: {mm}; expected a number above 0")));
        }
        let most = if matches!(chart, RayChart::Surface) { 90.0 } else { 180.0 };
        if let Some(deg) = self.theta_max_deg.filter(|deg| !(*deg > 0.0 && *deg <= most)) {
            let what = format!("--theta-max-deg: {deg}; expected an angle above 0, up to {most}");
            return Err(Failure::start(what));
        }
        Ok(chart)
    }

    /// Refuses all of it where a run's plan says what its fit stands for.
    pub(super) fn demand_none(&self) -> Result<(), Failure> {
        if self.chart != "surface" {
            return Err(Failure::with_help(
                format!("--chart {}: a run measures in the surface chart", self.chart),
                "give its samples.csv: between two planes rays may be x_mm, y_mm, theta_deg, phi_deg",
            ));
        }
        let given = self.x_mm.is_some()
            || self.y_mm.is_some()
            || self.s_mm.is_some()
            || self.t_mm.is_some()
            || self.distance_mm.is_some()
            || self.radius_mm.is_some()
            || self.theta_max_deg.is_some();
        if given {
            return Err(Failure::with_help(
                "--x-mm, --y-mm, --theta-max-deg: a run's plan says what it stands for",
                "leave them out; they are for a CSV",
            ));
        }
        Ok(())
    }

    /// What a fit of all these rays stands for.
    pub(super) fn region(
        &self,
        chart: RayChart,
        rays: &(impl Iterator<Item = Ray> + Clone),
    ) -> Region {
        let extent = |of: &dyn Fn(&Ray) -> f64| {
            let ends = (f64::INFINITY, f64::NEG_INFINITY);
            rays.clone().map(|ray| of(&ray)).fold(ends, |(a, b), v| (a.min(v), b.max(v)))
        };
        let metres = |(from, to): (f64, f64)| (from * 1e-3, to * 1e-3);
        let side = |given: Option<(f64, f64)>, of: &dyn Fn(&Ray) -> f64| {
            given.map_or_else(|| extent(of), metres)
        };
        let theta_max_rad = self
            .theta_max_deg
            .map_or_else(|| extent(&|ray| ray.theta_rad).1.max(f64::MIN_POSITIVE), f64::to_radians);
        let (x_m, y_m) = (side(self.x_mm, &|ray| ray.x_m), side(self.y_mm, &|ray| ray.y_m));
        match (chart, self.radius_mm) {
            (RayChart::Surface, _) => Region::surface(x_m, y_m, theta_max_rad.min(THETA_MAX_RAD)),
            (RayChart::Perpendicular, Some(mm)) => Region::object(mm * 1e-3, theta_max_rad),
            (RayChart::Perpendicular, None) => Region::perpendicular(x_m, y_m, theta_max_rad),
            (RayChart::Environment, _) => Region::environment(theta_max_rad),
            (RayChart::TwoPlane { distance_m }, _) => {
                let s_m = side(self.s_mm, &|ray| ray.beyond(distance_m).0);
                let t_m = side(self.t_mm, &|ray| ray.beyond(distance_m).1);
                Region::two_plane((x_m, y_m), (s_m, t_m), distance_m)
            }
        }
    }

    /// What all shares stand for, where the arguments say all of it.
    pub(super) fn whole_region(&self, chart: RayChart) -> Option<Region> {
        let has_place = self.x_mm.is_some() && self.y_mm.is_some();
        let has_cone = self.theta_max_deg.is_some();
        let is_whole = match chart {
            RayChart::Surface => has_place && has_cone,
            RayChart::Perpendicular => (has_place || self.radius_mm.is_some()) && has_cone,
            RayChart::Environment => has_cone,
            RayChart::TwoPlane { .. } => has_place && self.s_mm.is_some() && self.t_mm.is_some(),
        };
        is_whole.then(|| self.region(chart, &std::iter::empty()))
    }

    /// Refuses rays that are listed in another chart than the fit's.
    pub(super) fn demand_of(&self, region: &Region) -> Result<(), Failure> {
        let of_fit = region.chart.name();
        let is_same = self.chart == of_fit
            && match region.chart {
                fit::Chart::TwoPlane { distance_m, .. } => self
                    .distance_mm
                    .is_some_and(|mm| (mm * 1e-3 - distance_m).abs() <= 1e-9 * distance_m),
                _ => true,
            };
        if is_same {
            return Ok(());
        }
        Err(Failure::with_help(
            format!(
                "--at: its rays are in the {} chart, the fit is in the {of_fit} one",
                self.chart
            ),
            format!("add --chart {of_fit}, and between planes the fit's own --distance-mm"),
        ))
    }

    /// A detector's beam over the region: nothing shines beyond an object's sphere.
    pub(super) fn optics(&self, optics: Option<Optics>) -> Option<Optics> {
        let radius_m = self.radius_mm.map(|mm| mm * 1e-3);
        let disk = |radius_m| Outline::Disk { centre_m: (0.0, 0.0), radius_m };
        optics.map(|optics| Optics { outline: radius_m.map(disk).or(optics.outline), ..optics })
    }
}

/// The header that a CSV of a chart needs.
pub(super) fn csv_help(chart: RayChart) -> String {
    format!(
        "expected a header with {} and for example radiance_w_per_m2_sr, commas between, a point \
         for the decimals",
        chart.names().join(", ")
    )
}
