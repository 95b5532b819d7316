//! Sources partly hidden by opaque bodies: umbra, penumbra and antumbra. It does not know how
//! bodies come to be where they are.
//!
//! What is seen of the source is a set of directions bounded by arcs of its outline, of the
//! occluders' and of the horizon. Its projected solid angle is ½ ∮ n·((u - u₀) × du) over them, a sum
//! in which the arcs need not even be in order: each is kept or dropped by what lies beside it. Circles
//! and straight edges are exact; a disk's rim is integrated.

use super::Receiver;
use super::body::{Occluder, Source, in_one_unit};
use super::scene::{Before, Scene};
use crate::estimate::{Estimate, EstimateError, Tolerance};

/// Projected solid angle, sr, of the part of a source above the horizon that an opaque body leaves
/// visible: 0 in the umbra, the whole source's where nothing is hidden. A body behind the
/// source hides nothing; bodies that penetrate each other are refused. The relative tolerance refers to the unoccluded
/// source, since what a shadow leaves may be as small as it likes; a source may look as small as it
/// likes, too. Sim: baffles and shutters; the lecture's penumbra.
///
/// ```
/// use glam::DVec3;
/// use radiometry::Tolerance;
/// use radiometry::projected::{Occluder, Receiver, Source, occluded};
/// use radiometry::shape::{HalfPlane, Sphere};
/// // Half of a ball behind a knife edge through its middle.
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ball = Source::Sphere(Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.0)?);
/// let edge = Occluder::HalfPlane(HalfPlane::new(0.0, 0.5)?);
/// let seen = occluded(&up, &ball, &edge, Tolerance::default())?;
/// assert!((seen.value - std::f64::consts::PI / 8.0).abs() <= seen.error_bound);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn occluded(
    receiver: &Receiver,
    source: &Source,
    occluder: &Occluder,
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    occluded_by(receiver, source, core::slice::from_ref(occluder), tolerance)
}

/// The same behind any number of bodies, whose shadows may overlap in any way: what any of them
/// hides is hidden once. Each may be in front of the source or behind it, and they may penetrate
/// each other, but not the source.
/// Who needs it: the simulator: baffles and shutters together.
///
/// ```
/// use glam::DVec3;
/// use radiometry::Tolerance;
/// use radiometry::projected::{Occluder, Receiver, Source, occluded_by};
/// use radiometry::shape::{Disk, HalfPlane, Sphere};
/// // A knife edge through the middle of a ball, and the same again, nearer.
/// let up = Receiver::new(DVec3::ZERO, DVec3::Z)?;
/// let ball = Source::Sphere(Sphere::new(DVec3::new(0.0, 0.0, 2.0), 1.0)?);
/// let edges = [0.5, 0.25].map(|z| HalfPlane::new(0.0, z).map(Occluder::HalfPlane));
/// let edges = edges.into_iter().collect::<Result<Vec<_>, _>>()?;
/// let seen = occluded_by(&up, &ball, &edges, Tolerance::default())?;
/// assert!((seen.value - std::f64::consts::PI / 8.0).abs() <= seen.error_bound);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn occluded_by(
    receiver: &Receiver,
    source: &Source,
    occluders: &[Occluder],
    tolerance: Tolerance,
) -> Result<Estimate, EstimateError> {
    let whole = source.whole(receiver)?;
    let (receiver, source, occluders) = in_one_unit(receiver, source, occluders)?;
    let unoccluded = Estimate::closed(whole, 1000.0);
    let scene = match Scene::before(&receiver, &source, &occluders)? {
        Before::Bodies(scene) if whole > 0.0 => scene,
        Before::Umbra if whole > 0.0 => return Ok(Estimate::closed(0.0, 0.0)),
        _ => return Ok(unoccluded),
    };
    let visible = scene.visible()?;
    let estimate = if visible.is_shadowed {
        visible.contour(whole, tolerance)?.clamped(0.0, whole)
    } else {
        unoccluded
    };
    let absolute = tolerance.allowed(whole);
    estimate.within(Tolerance::new(0.0, absolute, tolerance.budget())?)
}
