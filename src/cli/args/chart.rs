//! The arguments of `gonio fit` that say in which chart a CSV's rays are, and what its fit stands for.

use clap::Args;

/// The chart and the region, as the command line has them.
#[derive(Debug, Clone, Args)]
pub(crate) struct ChartArgs {
    /// Of a CSV: the chart that its rays are in: surface, perpendicular (a whole object, theta to
    /// 180), environment (what arrives at a point) or two-plane (u_mm, v_mm, s_mm, t_mm).
    #[arg(long, value_name = "NAME", default_value = "surface")]
    pub(crate) chart: String,
    /// Of a CSV: from where to where the region lies; with --partial the same for each share.
    /// Default: as far as the samples. Between planes the first one's u.
    #[arg(long, visible_alias = "u-mm", value_name = "A,B", value_parser = interval,
        allow_hyphen_values = true)]
    pub(crate) x_mm: Option<(f64, f64)>,
    /// As --x-mm.
    #[arg(long, visible_alias = "v-mm", value_name = "A,B", value_parser = interval,
        allow_hyphen_values = true)]
    pub(crate) y_mm: Option<(f64, f64)>,
    /// With --chart two-plane: from where to where the second rectangle lies. Default: as far as
    /// the rays.
    #[arg(long, value_name = "A,B", value_parser = interval, allow_hyphen_values = true)]
    pub(crate) s_mm: Option<(f64, f64)>,
    /// As --s-mm.
    #[arg(long, value_name = "A,B", value_parser = interval, allow_hyphen_values = true)]
    pub(crate) t_mm: Option<(f64, f64)>,
    /// With --chart two-plane: from the plane of u and v to that of s and t.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub(crate) distance_mm: Option<f64>,
    /// With --chart perpendicular: the object lies within this distance from the origin.
    #[arg(long, value_name = "MM", allow_negative_numbers = true,
        conflicts_with_all = ["x_mm", "y_mm"])]
    pub(crate) radius_mm: Option<f64>,
    /// Of a CSV: the half angle of the cone that the fit stands for. Default: that of the samples.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) theta_max_deg: Option<f64>,
}

/// Two numbers, a comma between.
fn interval(text: &str) -> Result<(f64, f64), String> {
    let numbers = || {
        let (from, to) = text.split_once(',')?;
        Some((from.trim().parse::<f64>().ok()?, to.trim().parse::<f64>().ok()?))
    };
    numbers()
        .filter(|(from, to)| from.is_finite() && to.is_finite() && from <= to)
        .ok_or_else(|| "expected from and to in mm with a comma between, -20,20 say".to_owned())
}
