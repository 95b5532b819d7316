//! From a scene, a rig as stated and a seed to a rig as it is: every uncertain number drawn once,
//! every effect that is called for turned into a stage, and a row written for each effect, in or
//! out.

use core::f64::consts::PI;
use core::fmt;

use firmware_protocol::AXES_MAX;
use radiometry::throughput::coaxial_disks;

use crate::chance::draw;
use crate::detector::{Amplifier, Stages};
use crate::effect::EffectRow;
use crate::mechanics::AxisTruth;
use crate::rows;
use crate::simulated::AXIS_NAMES;
use crate::{Nominal, NominalDetector, Quantity, Region, Scene, Simulated, Truth};

/// A rig as it is: what the host will never see but through its readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Compiled {
    pub(crate) scene: Scene,
    pub(crate) nominal: Nominal,
    pub(crate) simulated: Simulated,
    pub(crate) seed: u64,
    pub(crate) axes: [AxisTruth; 4],
    /// Photocurrent per radiance: responsivity times throughput, both as drawn; A per W·m⁻²·sr⁻¹.
    pub(crate) current_per_radiance: f64,
    pub(crate) amplifier: Amplifier,
    rows: Vec<EffectRow>,
}

/// Why a scene and a rig don't make a simulated rig.
#[derive(Debug, Clone, PartialEq)]
pub enum CompileError {
    /// The axes' channels are not 0 to 3, each once.
    Channels([u8; 4]),
    /// A length of the detector, or its responsivity, came out of the draw at or below zero: its
    /// uncertainty is as large as itself. Name, value drawn.
    Drawn(&'static str, f64),
    /// A number of the rig that no rig has: name, value.
    Nominal(String, f64),
    /// The scene's levels are in another quantity than the detector is calibrated for.
    Quantity {
        /// The scene's.
        scene: Quantity,
        /// The rig's.
        rig: Quantity,
    },
}

/// Compiles a rig. The same arguments give the same rig, to the last bit.
pub fn compile(
    scene: Scene,
    nominal: Nominal,
    simulated: Simulated,
    seed: u64,
) -> Result<Compiled, CompileError> {
    if scene.quantity() != nominal.quantity {
        let (scene, rig) = (scene.quantity(), nominal.quantity);
        return Err(CompileError::Quantity { scene, rig });
    }
    check(&nominal)?;
    let current_per_radiance = draw_optics(&nominal.detector, seed)?;
    let amplifier = draw_amplifier(&nominal.detector, seed)?;
    let axes = core::array::from_fn(|i| {
        let (start, margin) = (simulated.start[i], simulated.limit_margin);
        AxisTruth::draw(AXIS_NAMES[i], &nominal.axes[i], start, margin, seed)
    });
    let mut compiled = Compiled {
        scene,
        nominal,
        simulated,
        seed,
        axes,
        current_per_radiance,
        amplifier,
        rows: Vec::new(),
    };
    compiled.rows = rows::write(&compiled);
    Ok(compiled)
}

impl Compiled {
    /// One row an effect, in or out.
    pub fn effects(&self) -> &[EffectRow] {
        &self.rows
    }

    /// What emits.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What leaves the sample, over a region.
    pub fn truth(&self, region: Region) -> Truth<'_> {
        Truth::new(&self.scene, region)
    }

    /// Photocurrent per radiance as drawn, A per W·m⁻²·sr⁻¹ (or per cd·m⁻²).
    pub fn current_per_radiance(&self) -> f64 {
        self.current_per_radiance
    }

    /// The stages that a photocurrent goes through on its way to the converter.
    pub(crate) fn stages(&self) -> Stages {
        Stages::called_for(&self.nominal.detector, self.simulated.dark_current_a, self.seed)
    }

    /// The largest photocurrent of any pose with θ up to 89°, amperes.
    pub(crate) fn brightest_a(&self) -> f64 {
        let emitters = self.scene.emitters().iter();
        let peaks = emitters.filter_map(|emitter| emitter.peak_within(GRAZING_RAD));
        let radiance = peaks.map(|(value, _, _)| value).fold(0.0, f64::max);
        radiance * self.current_per_radiance
    }
}

/// Bounds are taken up to here: beyond, a table's quotient with cos θ says nothing of a patch.
const GRAZING_RAD: f64 = 89.0 / 180.0 * PI;

fn check(nominal: &Nominal) -> Result<(), CompileError> {
    let channels: [u8; 4] = core::array::from_fn(|i| nominal.axes[i].channel);
    let mut sorted = channels;
    sorted.sort_unstable();
    if sorted != [0, 1, 2, 3] || nominal.axes.len() > AXES_MAX {
        return Err(CompileError::Channels(channels));
    }
    let positive = |name: String, value: f64| {
        let sound = value.is_finite() && value > 0.0;
        if sound { Ok(()) } else { Err(CompileError::Nominal(name, value)) }
    };
    let not_negative = |name: String, value: f64| {
        let sound = value.is_finite() && value >= 0.0;
        if sound { Ok(()) } else { Err(CompileError::Nominal(name, value)) }
    };
    for (name, axis) in AXIS_NAMES.iter().zip(&nominal.axes) {
        positive(format!("{name}: counts a unit"), axis.counts_per_unit.abs())?;
        positive(format!("{name}: speed"), f64::from(axis.speed_counts_per_s))?;
        positive(format!("{name}: acceleration"), f64::from(axis.acceleration_counts_per_s2))?;
        let travel = f64::from(axis.travel_counts.1) - f64::from(axis.travel_counts.0);
        positive(format!("{name}: travel"), travel)?;
        for (what, value) in [
            ("settle", axis.settle_s),
            ("u_zero", axis.u_zero),
            ("u_homing", axis.u_homing),
            ("u_readback", axis.u_readback),
        ] {
            not_negative(format!("{name}: {what}"), value)?;
        }
    }
    let detector = &nominal.detector;
    not_negative("read noise".into(), detector.read_noise_a)?;
    positive("adc rate".into(), f64::from(detector.adc_rate_hz))?;
    let bits = f64::from(detector.adc_bits);
    positive("adc bits".into(), if (2.0..=32.0).contains(&bits) { bits } else { -bits })?;
    positive("gain ranges".into(), detector.gains.len() as f64)?;
    for gain in &detector.gains {
        positive(format!("full scale of {}", gain.name), gain.full_scale_a)?;
    }
    Ok(())
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

fn draw_optics(detector: &NominalDetector, seed: u64) -> Result<f64, CompileError> {
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
    Ok(responsivity * throughput.m2_sr())
}

fn draw_amplifier(detector: &NominalDetector, seed: u64) -> Result<Amplifier, CompileError> {
    let mut full_scales_a = Vec::with_capacity(detector.gains.len());
    for (i, gain) in detector.gains.iter().enumerate() {
        let u = gain.full_scale_a * gain.u_relative;
        full_scales_a.push(draw_positive("gain", gain.full_scale_a, u, seed, i as u64)?);
    }
    Ok(Amplifier::new(&full_scales_a, detector.adc_bits))
}

impl fmt::Display for CompileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channels(found) => {
                write!(f, "the axes are on channels {found:?}, expected 0 to 3, each once")
            }
            Self::Drawn(name, value) => write!(
                f,
                "{name}: drawn as {value}, expected above 0: its stated uncertainty is too large"
            ),
            Self::Nominal(name, value) => write!(f, "{name}: {value} is not what a rig has"),
            Self::Quantity { scene, rig } => write!(
                f,
                "the scene's levels are {}, the rig's detector is calibrated for {}",
                scene.name(),
                rig.name()
            ),
        }
    }
}

impl core::error::Error for CompileError {}
