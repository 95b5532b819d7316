//! What many samples share: being off by it shifts them all together, so that no average over them
//! makes it smaller.

use super::{Calibrated, Dark, Sample, Spread};
use radiometry::beam::Beam;

use crate::rig::{AXES, AxisName, AxisPositions, Misalignment, Pose, Rig, forward};

/// A source of uncertainty that samples share. Components are independent of each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// What it is, as a budget's row names it.
    pub name: String,
    /// Its standard uncertainty: relative for [`Effect::Scale`] and [`Effect::Beam`], in the unit of radiance for
    /// [`Effect::Offset`], radians or metres for what moves rays.
    pub u: f64,
    /// What it does, and to which samples.
    pub effect: Effect,
}

/// What being off by a component does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// Values are too large by the factor 1 + u.
    Scale {
        /// In this gain range alone; `None` in all.
        gain: Option<u8>,
    },
    /// The beam is another one than the rig's file says, as far off as it may be by u of one of its
    /// lengths, to the side where the throughput grows. Values are too large by the factor 1 + u,
    /// and each is the mean over the footprint of that beam.
    Beam {
        /// What was really seen through.
        beam: Beam,
    },
    /// Values are too large by u.
    Offset {
        /// In this gain range alone.
        gain: u8,
    },
    /// The axis stands u further on than its position says.
    Axis {
        /// Which axis.
        axis: AxisName,
        /// In this session alone; `None` in all.
        session: Option<u32>,
    },
    /// The axis stands u further on than its readback says, by a draw of its own at each position:
    /// samples of one position share it, others do not.
    Readback {
        /// Which axis.
        axis: AxisName,
    },
    /// The rig stands askew by u, in all sessions.
    Alignment {
        /// In which way.
        of: Misalignment,
    },
}

impl Component {
    /// Whether it concerns the sample.
    pub fn concerns(&self, sample: &Sample) -> bool {
        match self.effect {
            Effect::Readback { .. } | Effect::Alignment { .. } | Effect::Beam { .. } => true,
            Effect::Scale { gain } => gain.is_none_or(|gain| gain == sample.gain),
            Effect::Offset { gain } => gain == sample.gain,
            Effect::Axis { session, .. } => session.is_none_or(|session| session == sample.session),
        }
    }

    /// By how much the sample's value is too large if the component is off by one u, at the
    /// sample's level; 0 for what moves rays.
    pub fn excess(&self, sample: &Sample, level: f64) -> f64 {
        match self.effect {
            Effect::Scale { .. } | Effect::Beam { .. } if self.concerns(sample) => self.u * level,
            Effect::Offset { .. } if self.concerns(sample) => self.u,
            _ => 0.0,
        }
    }

    /// The ray that was really seen if the component is off by so many u.
    pub fn ray_seen(&self, sample: &Sample, times: f64) -> Pose {
        match self.effect {
            Effect::Axis { axis, .. } | Effect::Readback { axis } if self.concerns(sample) => {
                let AxisPositions(mut positions) = sample.positions;
                for (position, name) in positions.iter_mut().zip(AXES) {
                    *position += if name == axis { times * self.u } else { 0.0 };
                }
                forward(AxisPositions(positions))
            }
            Effect::Alignment { of } => of.ray_seen(sample.positions, times * self.u),
            _ => sample.pose,
        }
    }
}

impl Calibrated {
    /// The components that scale all samples alike: the detector's responsivity and throughput, and
    /// the gain where only one range was used.
    pub fn scales(&self) -> Vec<&str> {
        let is_everywhere = |gain: u8| self.samples.iter().all(|sample| sample.gain == gain);
        let is_scale = |effect: Effect| match effect {
            Effect::Scale { gain } => gain.is_none_or(is_everywhere),
            Effect::Beam { .. } => true,
            _ => false,
        };
        let scales = self.components.iter().filter(|component| is_scale(component.effect));
        scales.map(|component| component.name.as_str()).collect()
    }
}

/// The components of a rig's samples of such a spread, those with u = 0 left out.
pub(super) fn of(rig: &Rig, darks: &[Dark], spread: &Spread) -> Vec<Component> {
    let detector = &rig.detector;
    let everywhere = Effect::Scale { gain: None };
    let mut all = vec![
        component("responsivity", detector.u_responsivity_relative, everywhere),
        component("spectral mismatch", detector.u_spectral_mismatch_relative, everywhere),
    ];
    all.extend(detector.beams_off().into_iter().map(|(length, u, beam)| {
        // An error only where u is as large as the length itself.
        let effect = beam.map_or(everywhere, |beam| Effect::Beam { beam });
        component(&format!("throughput @ {length}"), u, effect)
    }));
    for dark in darks.iter().filter(|dark| spread.gains.contains(&dark.gain)) {
        let gain = &detector.gains[usize::from(dark.gain)];
        let scale = Effect::Scale { gain: Some(dark.gain) };
        all.push(component(&format!("gain {}", gain.name), gain.u_relative, scale));
        let offset = Effect::Offset { gain: dark.gain };
        all.push(component(&format!("dark {}", gain.name), dark.u_radiance, offset));
    }
    for axis in &rig.axes {
        let name = axis.name.name();
        let zero = Effect::Axis { axis: axis.name, session: None };
        all.push(component(&format!("{name} zero"), axis.u_zero, zero));
        for &session in &spread.sessions {
            let homing = Effect::Axis { axis: axis.name, session: Some(session) };
            all.push(component(&format!("{name} homing {session}"), axis.u_homing, homing));
        }
        let readback = Effect::Readback { axis: axis.name };
        all.push(component(&format!("{name} readback"), axis.u_readback, readback));
    }
    let parts = rig.alignment.parts().into_iter();
    all.extend(parts.map(|(of, u)| component(of.name(), u, Effect::Alignment { of })));
    all.retain(|component| component.u > 0.0);
    all
}

fn component(name: &str, u: f64, effect: Effect) -> Component {
    Component { name: name.to_owned(), u, effect }
}
