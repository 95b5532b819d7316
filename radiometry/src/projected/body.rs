//! What shines and what stands in its way, in any unit of length. It does not know how they are seen.

use glam::DVec3;

use super::{Receiver, disk, polygon, sphere};
use crate::domain::DomainError;
use crate::shape::{Disk, HalfPlane, Polygon, Sphere};
use crate::wide::{in_units, unit_exponent};

/// What shines, uniformly.
/// Who needs it: the simulator, for lamps.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Both faces.
    Disk(Disk),
    /// All of it.
    Sphere(Sphere),
    /// Both faces.
    Polygon(Polygon),
}

/// What stands in the way.
/// Who needs it: the simulator, for baffles and shutters.
#[derive(Debug, Clone, PartialEq)]
pub enum Occluder {
    /// A knife edge.
    HalfPlane(HalfPlane),
    /// A disk in any position.
    Disk(Disk),
    /// A ball.
    Sphere(Sphere),
    /// Convex or not.
    Polygon(Polygon),
}

impl Source {
    /// Its projected solid angle with nothing in the way, sr.
    pub(super) fn whole(&self, receiver: &Receiver) -> Result<f64, DomainError> {
        Ok(match self {
            Self::Disk(shape) => disk(receiver, shape)?.sr(),
            Self::Sphere(shape) => sphere(receiver, shape)?.sr(),
            Self::Polygon(shape) => polygon(receiver, shape)?.sr(),
        })
    }

    fn largest_m(&self) -> f64 {
        match self {
            Self::Disk(disk) => of_round(disk.center_m(), disk.radius_m()),
            Self::Sphere(sphere) => of_round(sphere.center_m(), sphere.radius_m()),
            Self::Polygon(polygon) => of_polygon(polygon),
        }
    }

    fn in_units(&self, unit: i32) -> Result<Self, DomainError> {
        Ok(match self {
            Self::Disk(disk) => Self::Disk(disk_in(disk, unit)?),
            Self::Sphere(sphere) => Self::Sphere(sphere_in(sphere, unit)?),
            Self::Polygon(polygon) => Self::Polygon(polygon.in_units(unit)),
        })
    }
}

impl Occluder {
    fn largest_m(&self) -> f64 {
        match self {
            Self::HalfPlane(edge) => edge.x_max_m().abs().max(edge.z_m().abs()),
            Self::Disk(disk) => of_round(disk.center_m(), disk.radius_m()),
            Self::Sphere(sphere) => of_round(sphere.center_m(), sphere.radius_m()),
            Self::Polygon(polygon) => of_polygon(polygon),
        }
    }

    fn in_units(&self, unit: i32) -> Result<Self, DomainError> {
        let scale = |length: f64| libm::scalbn(length, -unit);
        Ok(match self {
            Self::HalfPlane(edge) => {
                Self::HalfPlane(HalfPlane::new(scale(edge.x_max_m()), scale(edge.z_m()))?)
            }
            Self::Disk(disk) => Self::Disk(disk_in(disk, unit)?),
            Self::Sphere(sphere) => Self::Sphere(sphere_in(sphere, unit)?),
            Self::Polygon(polygon) => Self::Polygon(polygon.in_units(unit)),
        })
    }
}

fn of_round(center: DVec3, radius: f64) -> f64 {
    center.abs().max_element().max(radius)
}

fn of_polygon(polygon: &Polygon) -> f64 {
    polygon.vertices().iter().map(|vertex| vertex.abs().max_element()).fold(0.0, f64::max)
}

fn disk_in(disk: &Disk, unit: i32) -> Result<Disk, DomainError> {
    Disk::new(in_units(disk.center_m(), unit), disk.axis(), libm::scalbn(disk.radius_m(), -unit))
}

fn sphere_in(ball: &Sphere, unit: i32) -> Result<Sphere, DomainError> {
    Sphere::new(in_units(ball.center_m(), unit), libm::scalbn(ball.radius_m(), -unit))
}

/// Everything in a unit of length that is a power of two, so that no square overflows.
pub(super) fn in_one_unit(
    receiver: &Receiver,
    source: &Source,
    occluders: &[Occluder],
) -> Result<(Receiver, Source, Vec<Occluder>), DomainError> {
    let lengths = [receiver.point_m().abs().max_element(), source.largest_m()];
    let unit = unit_exponent(lengths.into_iter().chain(occluders.iter().map(Occluder::largest_m)));
    let point = in_units(receiver.point_m(), unit);
    let occluders = occluders.iter().map(|body| body.in_units(unit)).collect::<Result<_, _>>()?;
    Ok((Receiver::new(point, receiver.normal())?, source.in_units(unit)?, occluders))
}
