//! Throughput, the charts of rays, and convex bodies.

use radiometry::chart::{Environment, Perpendicular, Surface, TwoPlane};
use radiometry::convex::{self, ConvexBody};
use radiometry::quantity::{ProjectedArea, Throughput};
use radiometry::throughput;

use super::Row;
use super::{Call, Kind, value};
use crate::Unmeasured;

pub(super) fn call(quantity: &str, row: Row<'_>) -> Result<Option<Call>, Unmeasured> {
    Ok(Some(match quantity {
        "throughput-coaxial-disks" => {
            Call::new(Kind::Closed, row.numbers(["r1", "r2", "h"])?, |[r1, r2, h]| {
                value(throughput::coaxial_disks(*r1, *r2, *h), Throughput::m2_sr)
            })
        }
        "mean-projected-area" => Call::new(Kind::Closed, body(row.object("shape"))?, |body| {
            value(convex::mean_projected_area(*body), ProjectedArea::m2)
        }),
        "throughput-convex-body" => Call::new(Kind::Closed, body(row.object("shape"))?, |body| {
            value(convex::throughput(*body), Throughput::m2_sr)
        }),
        "chart-density-surface" => Call::new(Kind::Closed, row.number("theta")?, |theta_rad| {
            Surface { x_m: 0.0, y_m: 0.0, theta_rad: *theta_rad, phi_rad: 0.0 }.density()
        }),
        "chart-density-perpendicular" => {
            Call::new(Kind::Closed, row.number("theta")?, |theta_rad| {
                Perpendicular { theta_rad: *theta_rad, phi_rad: 0.0, x_m: 0.0, y_m: 0.0 }.density()
            })
        }
        "chart-density-environment" => Call::new(Kind::Closed, row.number("theta")?, |theta_rad| {
            Environment { theta_rad: *theta_rad, phi_rad: 0.0 }.density()
        }),
        "chart-density-two-plane" => {
            let [u_m, v_m, s_m, t_m, distance_m] = row.numbers(["u", "v", "s", "t", "distance"])?;
            let chart = TwoPlane { u_m, v_m, s_m, t_m, distance_m };
            Call::new(Kind::Closed, chart, TwoPlane::density)
        }
        _ => return Ok(None),
    }))
}

fn body(shape: Row<'_>) -> Result<ConvexBody, Unmeasured> {
    let edges = || shape.numbers(["a", "b", "c"]);
    let round = || shape.numbers(["radius", "height"]);
    Ok(match shape.text("kind") {
        "sphere" => ConvexBody::Sphere { radius_m: shape.number("radius")? },
        "box" => ConvexBody::Box { edges_m: edges()? },
        "ellipsoid" => ConvexBody::Ellipsoid { semi_axes_m: edges()? },
        "cylinder" => {
            let [radius_m, height_m] = round()?;
            ConvexBody::Cylinder { radius_m, height_m }
        }
        _ => {
            let [radius_m, height_m] = round()?;
            ConvexBody::Cone { radius_m, height_m }
        }
    })
}
