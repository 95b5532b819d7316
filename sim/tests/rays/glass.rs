//! A plane-parallel plate as a photon finds it: Snell's law and Fresnel's at each face, one
//! polarisation a photon, back and forth until it is out.

use glam::DVec3;

use crate::dice::Dice;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Glass {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) index: f64,
    pub(crate) absorption: f64,
}

/// Where a photon leaves, into which direction, and how much of it is left.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Out {
    pub(crate) at: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) part: f64,
}

impl Glass {
    /// A photon that arrives at one of the faces from outside. `is_s`: its field lies along the
    /// faces.
    pub(crate) fn pass(&self, at: DVec3, direction: DVec3, is_s: bool, dice: &mut Dice) -> Out {
        let cos = direction.z.abs();
        // Snell: what lies along the faces is divided by the index.
        let along = DVec3::new(direction.x, direction.y, 0.0) / self.index;
        let inner = (1.0 - along.length_squared()).sqrt();
        let reflectance = {
            let (outside, inside) =
                if is_s { (cos, self.index * inner) } else { (self.index * cos, inner) };
            ((outside - inside) / (outside + inside)).powi(2)
        };
        if dice.roll() < reflectance {
            let direction = DVec3::new(direction.x, direction.y, -direction.z);
            return Out { at, direction, part: 1.0 };
        }
        let (mut at, mut rise, mut part) = (at, inner.copysign(direction.z), 1.0);
        loop {
            let length = (self.high - self.low) / inner;
            at += (along + DVec3::Z * rise) * length;
            at.z = if rise > 0.0 { self.high } else { self.low };
            part *= (-self.absorption * length).exp();
            if dice.roll() >= reflectance {
                let direction = DVec3::new(direction.x, direction.y, cos.copysign(rise));
                return Out { at, direction, part };
            }
            rise = -rise;
        }
    }
}
