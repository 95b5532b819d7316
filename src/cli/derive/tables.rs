//! Maps as the columns of a CSV file: millimetres and degrees.

use fit::derive::{EnvironmentCell, TwoPlaneRay};

use crate::export::DerivedTable;
use crate::rig::Quantity;

fn value_columns(quantity: Quantity) -> [String; 3] {
    let radiance = quantity.radiance_column();
    [radiance.to_owned(), format!("u_{radiance}"), format!("u_independent_{radiance}")]
}

pub(super) fn cells(quantity: Quantity, cells: &[EnvironmentCell]) -> DerivedTable {
    let names = [
        "theta_deg",
        "phi_deg",
        "towards_x",
        "towards_y",
        "towards_z",
        "solid_angle_sr",
        "covered",
        "measured",
    ];
    let row = |cell: &EnvironmentCell| {
        let fields = [
            cell.theta_rad.to_degrees(),
            cell.phi_rad.to_degrees(),
            cell.towards.x,
            cell.towards.y,
            cell.towards.z,
            cell.solid_angle_sr,
            cell.covered,
            cell.measured,
            cell.radiance.value,
            cell.radiance.u,
            cell.radiance.u_independent,
        ];
        fields.map(Some).to_vec()
    };
    let columns = names.map(str::to_owned).into_iter().chain(value_columns(quantity));
    DerivedTable { columns: columns.collect(), rows: cells.iter().map(row).collect() }
}

pub(super) fn rays(quantity: Quantity, rays: &[TwoPlaneRay]) -> DerivedTable {
    let names = ["u_mm", "v_mm", "s_mm", "t_mm", "theta_deg", "phi_deg", "measured"];
    let row = |ray: &TwoPlaneRay| {
        let place = ray.place;
        let fields = [
            place.u_m * 1e3,
            place.v_m * 1e3,
            place.s_m * 1e3,
            place.t_m * 1e3,
            ray.ray.theta_rad.to_degrees(),
            ray.ray.phi_rad.to_degrees(),
            f64::from(u8::from(ray.is_measured)),
        ];
        let value = ray.radiance;
        let values = [value.map(|v| v.value), value.map(|v| v.u), value.map(|v| v.u_independent)];
        fields.map(Some).into_iter().chain(values).collect()
    };
    let columns = names.map(str::to_owned).into_iter().chain(value_columns(quantity));
    DerivedTable { columns: columns.collect(), rows: rays.iter().map(row).collect() }
}
