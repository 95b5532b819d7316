//! How wide the beam is in a plane through the normal: the angle between the outermost directions in
//! which the intensity is a share of a reference intensity. At 50 % it is the beam angle, at 10 % the
//! field angle (ANSI/IES LS-1: of the maximum in the plane; IEC TR 61341: of the centre beam
//! intensity; CIE S 017's half-peak divergence is the former).
//!
//! Its u is to first order. Where I(γ) = k I₀ holds, a small change of the field moves γ by
//! (k δI₀ - δI(γ))/I'(γ); the maximum's own place has no part in δI₀, as the curve is level there.

use super::sum::Node;
use super::{DeriveError, Derived, Field, Remark};
use crate::{Estimate, Functional};
use std::f64::consts::PI;

/// What the share is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The largest intensity in the plane.
    PlanePeak,
    /// The intensity along the normal.
    Centre,
}

/// The intensity over the region's area in a plane, against the signed angle γ from the normal:
/// above 0 at the plane's azimuth, below 0 opposite.
struct Profile<'p, 'f> {
    field: &'p Field<'f>,
    phi_rad: f64,
    /// As far as was measured.
    end_rad: f64,
    /// Between points of the first look.
    step_rad: f64,
    values: Vec<f64>,
}

/// A crossing of the level.
struct Crossing {
    gamma_rad: f64,
    /// What shifts it, to first order.
    shift: Functional,
    is_bent: bool,
}

impl Field<'_> {
    /// The angle in the plane of azimuth `phi_rad` and its opposite between the outermost
    /// directions whose intensity is `level` of the reference, radians. Where it is above the level
    /// up to the end of the cone that was measured, there is none.
    pub fn beam_angle(
        &self,
        phi_rad: f64,
        level: f64,
        reference: Reference,
    ) -> Result<Derived, DeriveError> {
        self.demand_leaving("beam angle")?;
        if !(level > 0.0 && level < 1.0) {
            let expected = "a share above 0 and below 1";
            return Err(DeriveError::Domain { what: "level", value: level, expected });
        }
        if !phi_rad.is_finite() {
            let expected = "a finite angle";
            return Err(DeriveError::Domain { what: "phi_rad", value: phi_rad, expected });
        }
        let profile = Profile::new(self, phi_rad)?;
        let (top_rad, is_tied) = match reference {
            Reference::PlanePeak => profile.top()?,
            Reference::Centre => (0.0, false),
        };
        let top = profile.functional(top_rad)?;
        let threshold = level * self.fit.of(&top).value;
        if threshold <= 0.0 {
            return Err(DeriveError::NoPeak);
        }
        let not_reached = DeriveError::NotReached { level, theta_max_rad: profile.end_rad };
        let (low, high) = profile.outermost(threshold).ok_or(not_reached)?;
        let (low, high) = (
            profile.crossing(low, threshold, level, &top)?,
            profile.crossing(high, threshold, level, &top)?,
        );
        let angle_rad = high.gamma_rad - low.gamma_rad;
        let shift = high.shift.plus(-1.0, &low.shift);
        let mut derived = self.first_order(angle_rad, &shift, |medium| {
            let field = Field { fit: self.fit, medium };
            field.undisturbed_angle(phi_rad, level, reference)
        });
        let between = |gamma_rad: f64| gamma_rad > low.gamma_rad && gamma_rad < high.gamma_rad;
        let mut inner = (0..profile.values.len()).filter(|&i| between(profile.gamma_rad(i)));
        let remarks = [
            (is_tied, Remark::Tie),
            (inner.any(|i| profile.values[i] < threshold), Remark::Dips),
            (low.is_bent || high.is_bent, Remark::Bent),
            (top_rad.abs() >= profile.end_rad, Remark::AtRim),
        ];
        derived.remarks.extend(remarks.into_iter().filter(|(holds, _)| *holds).map(|(_, r)| r));
        Ok(derived)
    }

    /// The angle alone.
    fn undisturbed_angle(&self, phi_rad: f64, level: f64, reference: Reference) -> Option<f64> {
        let profile = Profile::new(self, phi_rad).ok()?;
        let top_rad = match reference {
            Reference::PlanePeak => profile.top().ok()?.0,
            Reference::Centre => 0.0,
        };
        let threshold = level * profile.value(top_rad).ok()?;
        let (low, high) = profile.outermost(threshold)?;
        let [low, high] = [low, high].map(|bracket| profile.root(bracket, threshold).ok());
        Some(high? - low?)
    }
}

impl<'p, 'f> Profile<'p, 'f> {
    fn new(field: &'p Field<'f>, phi_rad: f64) -> Result<Self, DeriveError> {
        let measured_rad = field.fit.region().theta_max_rad.min(field.theta_end_rad());
        let end_rad = field.medium.inner_theta_rad(measured_rad);
        let half = (POINTS_A_LINE * field.lines()).clamp(POINTS_MIN, POINTS_MAX);
        let step_rad = end_rad / half as f64;
        let mut profile = Self { field, phi_rad, end_rad, step_rad, values: Vec::new() };
        profile.values =
            (0..=2 * half).map(|i| profile.value(profile.at(i, half))).collect::<Result<_, _>>()?;
        Ok(profile)
    }

    fn at(&self, i: usize, half: usize) -> f64 {
        let steps = i as f64 - half as f64;
        (steps * self.step_rad).clamp(-self.end_rad, self.end_rad)
    }

    fn gamma_rad(&self, i: usize) -> f64 {
        self.at(i, self.values.len() / 2)
    }

    fn functional(&self, gamma_rad: f64) -> Result<Functional, DeriveError> {
        let phi_rad = if gamma_rad < 0.0 { self.phi_rad + PI } else { self.phi_rad };
        let node = Node::Towards { theta_rad: gamma_rad.abs(), phi_rad };
        Ok(self.field.functional(node)?.times(self.field.projection(gamma_rad)))
    }

    fn value(&self, gamma_rad: f64) -> Result<f64, DeriveError> {
        Ok(self.field.fit.of_value(&self.functional(gamma_rad)?))
    }

    /// Where the intensity is largest, and whether another lobe might be as large.
    fn top(&self) -> Result<(f64, bool), DeriveError> {
        let last = self.values.len() - 1;
        let is_lobe = |i: usize| {
            let before = if i > 0 { self.values[i - 1] } else { f64::NEG_INFINITY };
            let after = if i < last { self.values[i + 1] } else { f64::NEG_INFINITY };
            self.values[i] >= before && self.values[i] > after
        };
        let mut lobes: Vec<usize> = (0..=last).filter(|&i| is_lobe(i)).collect();
        lobes.sort_by(|&i, &j| self.values[j].total_cmp(&self.values[i]));
        let Some(&first) = lobes.first() else { return Ok((0.0, false)) };
        let top_rad = self.climbed(self.gamma_rad(first))?;
        let Some(&second) = lobes.get(1) else { return Ok((top_rad, false)) };
        let other_rad = self.climbed(self.gamma_rad(second))?;
        let apart = self.functional(top_rad)?.plus(-1.0, &self.functional(other_rad)?);
        let Estimate { value, u, .. } = self.field.fit.of(&apart);
        Ok((top_rad, value.abs() < TIE_U * u))
    }

    /// The top of the lobe about a point, by ever smaller steps.
    fn climbed(&self, from_rad: f64) -> Result<f64, DeriveError> {
        let (mut gamma_rad, mut value) = (from_rad, self.value(from_rad)?);
        let mut step_rad = 0.5 * self.step_rad;
        while step_rad > STEP_LAST_RAD {
            let mut has_risen = false;
            for next in [gamma_rad + step_rad, gamma_rad - step_rad] {
                if next.abs() <= self.end_rad {
                    let higher = self.value(next)?;
                    if higher > value {
                        (gamma_rad, value, has_risen) = (next, higher, true);
                        break;
                    }
                }
            }
            if !has_risen {
                step_rad *= 0.5;
            }
        }
        Ok(gamma_rad)
    }

    /// The steps from below the level to above it farthest out, on both sides.
    fn outermost(&self, threshold: f64) -> Option<([f64; 2], [f64; 2])> {
        let last = self.values.len() - 1;
        let is_above = |i: usize| self.values[i] >= threshold;
        let low = (0..=last).find(|&i| is_above(i)).filter(|&i| i > 0)?;
        let high = (0..=last).rev().find(|&i| is_above(i)).filter(|&i| i < last)?;
        let low = [self.gamma_rad(low - 1), self.gamma_rad(low)];
        Some((low, [self.gamma_rad(high + 1), self.gamma_rad(high)]))
    }

    /// By halving: [below the level, above it].
    fn root(&self, [mut below, mut above]: [f64; 2], threshold: f64) -> Result<f64, DeriveError> {
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(below, above);
            if self.value(middle)? >= threshold { above = middle } else { below = middle }
        }
        Ok(f64::midpoint(below, above))
    }

    fn crossing(
        &self,
        bracket: [f64; 2],
        threshold: f64,
        level: f64,
        top: &Functional,
    ) -> Result<Crossing, DeriveError> {
        let gamma_rad = self.root(bracket, threshold)?;
        let h = SLOPE_STEP_RAD.min(self.end_rad - gamma_rad.abs()).max(SLOPE_STEP_MIN_RAD);
        let at = |gamma_rad: f64| self.value(gamma_rad.clamp(-self.end_rad, self.end_rad));
        let (before, here, after) = (at(gamma_rad - h)?, at(gamma_rad)?, at(gamma_rad + h)?);
        let slope = (after - before) / (2.0 * h);
        if slope == 0.0 {
            return Err(DeriveError::NoPeak);
        }
        let bend = (after - 2.0 * here + before) / (h * h);
        let moves = top.clone().times(level).plus(-1.0, &self.functional(gamma_rad)?);
        let shift = moves.times(1.0 / slope);
        let u_rad = self.field.fit.of(&shift).u;
        Ok(Crossing { gamma_rad, shift, is_bent: 0.5 * (bend * u_rad / slope).abs() > BEND })
    }
}

/// Points of the first look on each side, for each line that the basis may draw.
const POINTS_A_LINE: usize = 12;
const POINTS_MIN: usize = 180;
const POINTS_MAX: usize = 1800;
/// 1e-9 of a radian is nothing beside any u.
const STEP_LAST_RAD: f64 = 1e-7;
const HALVINGS: usize = 48;
/// The step of differences: their error is the third derivative times its square.
const SLOPE_STEP_RAD: f64 = 1e-4;
const SLOPE_STEP_MIN_RAD: f64 = 1e-6;
/// Lobes whose difference is less than this many of its u may be either way round.
const TIE_U: f64 = 2.0;
/// The second order's share of the first, one u away, that is remarked upon.
const BEND: f64 = 0.1;
