//! Any bodies before any source, from bytes: a projected solid angle within the hemisphere or an
//! error, the shadow that it belongs to, and the polygon kernels besides.
#![no_main]

use std::f64::consts::PI;

use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use radiometry::projected::{
    Occluder, Receiver, Region, Shadow, Source, occluded_by, region_shadow, shadow,
};
use radiometry::shape::{Disk, HalfPlane, Polygon, Sphere};
use radiometry::{Estimate, EstimateError, Tolerance, solid_angle};

/// Numbers from bytes: small ones that meet each other often, or any double at all.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn number(&mut self) -> Option<f64> {
        let kind = self.byte()?;
        if kind < 200 {
            return Some((f64::from(kind) - 100.0) / 16.0);
        }
        if kind < 240 {
            let exponent = i32::from(self.byte()?) - 128;
            return Some((f64::from(kind) - 220.0) / 16.0 * f64::from(exponent / 4).exp2());
        }
        let (bits, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(f64::from_le_bytes(*bits))
    }

    fn vector(&mut self) -> Option<DVec3> {
        Some(DVec3::new(self.number()?, self.number()?, self.number()?))
    }

    fn occluder(&mut self) -> Option<Occluder> {
        Some(match self.byte()? % 4 {
            0 => Occluder::Disk(Disk::new(self.vector()?, self.vector()?, self.number()?).ok()?),
            1 => Occluder::Sphere(Sphere::new(self.vector()?, self.number()?).ok()?),
            2 => Occluder::HalfPlane(HalfPlane::new(self.number()?, self.number()?).ok()?),
            _ => Occluder::Polygon(self.polygon()?),
        })
    }

    /// In a plane by construction, convex or not.
    fn polygon(&mut self) -> Option<Polygon> {
        let (corner, x, y) = (self.vector()?, self.vector()?, self.vector()?);
        let count = 3 + self.byte()? % 4;
        let vertices = (0..count).map(|_| Some(corner + x * self.number()? + y * self.number()?));
        Polygon::new(vertices.collect::<Option<_>>()?).ok()
    }
}

fn in_range(found: &Estimate) {
    assert!((0.0..=PI).contains(&found.value) && found.error_bound >= 0.0, "{found:?}");
}

fn run(bytes: &[u8]) -> Option<()> {
    let mut bytes = Bytes(bytes);
    let at = Receiver::new(bytes.vector()?, bytes.vector()?).ok()?;
    let source = match bytes.occluder()? {
        Occluder::Disk(disk) => Source::Disk(disk),
        Occluder::Sphere(ball) => Source::Sphere(ball),
        Occluder::Polygon(polygon) => Source::Polygon(polygon),
        Occluder::HalfPlane(_) => return None,
    };
    let mut bodies = Vec::new();
    while let Some(body) = bytes.occluder() {
        bodies.push(body);
    }
    bodies.truncate(6);
    if let Source::Polygon(polygon) = &source {
        let found = solid_angle::polygon(at.point_m(), polygon);
        assert!(found.is_ok_and(|found| (0.0..=4.0 * PI).contains(&found.sr())) || found.is_err());
        if let Some(body) = bodies.first() {
            let _ = region_shadow(&Region::Polygon(polygon.clone()), &source, body);
        }
    }
    let shade = shadow(&at, &source, &bodies);
    match occluded_by(&at, &source, &bodies, Tolerance::default()) {
        Ok(found) => {
            in_range(&found);
            match shade {
                Ok(Shadow::Umbra | Shadow::Unseen) => assert!(found.value <= found.error_bound),
                Ok(_) => {}
                Err(error) => panic!("{found:?}, but {error}"),
            }
        }
        Err(EstimateError::Unmet { estimate, .. }) => in_range(&estimate),
        Err(EstimateError::Domain(_)) => {}
        Err(error @ EstimateError::Integrand { .. }) => panic!("{error}"),
    }
    Some(())
}

fuzz_target!(|bytes: &[u8]| {
    let _ = run(bytes);
});
