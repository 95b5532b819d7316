//! The rig as drawn: every number that the rig file states with an uncertainty, drawn once by the
//! seed, with what was chosen of the axes' flaws. It does not know light.

use std::sync::Arc;

use radiometry::throughput::coaxial_disks;

use super::CompileError;
use crate::chance::draw;
use crate::detector::{self, Amplifier};
use crate::effect::Chosen;
use crate::mechanics::{self, AxisTruth, Kinematics, Moment};
use crate::{Nominal, NominalDetector, Simulated};

/// What axes, detector and amplifier really are.
#[derive(Debug, Clone)]
pub(crate) struct Drawn {
    pub(crate) axes: [AxisTruth; 4],
    pub(crate) kinematics: Arc<dyn Kinematics>,
    /// When a reading looks while the axes move.
    pub(crate) moments: Vec<Moment>,
    /// Photocurrent per radiance: responsivity times throughput; A per W·m⁻²·sr⁻¹.
    pub(crate) current_per_radiance: f64,
    /// Photocurrent per flux, A·W⁻¹ (or A·lm⁻¹).
    pub(crate) responsivity: f64,
    pub(crate) amplifier: Amplifier,
}

impl Drawn {
    /// Fails if a length or a factor comes out at or below zero.
    pub(crate) fn new(
        nominal: &Nominal,
        simulated: &Simulated,
        seed: u64,
        chosen: &Chosen,
    ) -> Result<Self, CompileError> {
        let departing = detector::departing(&nominal.detector, chosen);
        let (responsivity, throughput) = draw_optics(&departing, seed)?;
        Ok(Self {
            axes: mechanics::axes(nominal, simulated, seed, chosen),
            kinematics: mechanics::kinematics(simulated, seed, chosen),
            moments: mechanics::moments(nominal, simulated, chosen),
            current_per_radiance: responsivity * throughput,
            responsivity,
            amplifier: draw_amplifier(&departing, seed)?,
        })
    }
}

impl Drawn {
    /// Whether an ADC reading in motion is the mean over its time.
    pub(crate) fn averages(&self) -> bool {
        self.moments.len() > 1
    }
}

/// A number with its standard uncertainty, drawn; still positive, or refused.
fn draw_positive(
    name: &'static str,
    nominal: f64,
    u: f64,
    seed: u64,
    key: u64,
) -> Result<f64, CompileError> {
    let drawn = if u > 0.0 { nominal + u * draw(seed, name, key) } else { nominal };
    let sound = drawn.is_finite() && drawn > 0.0 && u >= 0.0;
    if sound { Ok(drawn) } else { Err(CompileError::Drawn(name, drawn)) }
}

/// Responsivity and throughput.
fn draw_optics(detector: &NominalDetector, seed: u64) -> Result<(f64, f64), CompileError> {
    let drawn = |name, nominal, u| draw_positive(name, nominal, u, seed, 0);
    let responsivity = drawn(
        "responsivity",
        detector.responsivity_a_per_w,
        detector.responsivity_a_per_w * detector.u_responsivity_relative,
    )?;
    let pupil = drawn("pupil radius", detector.pupil_radius_m, detector.u_pupil_radius_m)?;
    let spot = drawn("spot radius", detector.spot_radius_m, detector.u_spot_radius_m)?;
    let distance = drawn("distance", detector.distance_m, detector.u_distance_m)?;
    let throughput = coaxial_disks(pupil, spot, distance)
        .map_err(|_| CompileError::Drawn("throughput", distance))?;
    Ok((responsivity, throughput.m2_sr()))
}

fn draw_amplifier(detector: &NominalDetector, seed: u64) -> Result<Amplifier, CompileError> {
    let mut full_scales_a = Vec::with_capacity(detector.gains.len());
    for (i, gain) in detector.gains.iter().enumerate() {
        let u = gain.full_scale_a * gain.u_relative;
        full_scales_a.push(draw_positive("gain", gain.full_scale_a, u, seed, i as u64)?);
    }
    Ok(Amplifier::new(&full_scales_a, detector.adc_bits))
}
