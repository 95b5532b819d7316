//! From a scene, a rig as stated and the terms of a plan to a rig as it is: every effect weighed,
//! what is chosen turned into stages, every uncertain number drawn once, and a row written for
//! each effect, in or out.
//!
//! How a module takes part: it offers its candidates for a [`Setting`] (`candidates`), and builds
//! what was [`Chosen`] of them. The order of the rows is that in which light and counts meet them.

use core::fmt;
use std::sync::Arc;

use radiometry::DomainError;
use radiometry::throughput::coaxial_disks;

use crate::chance::draw;
use crate::check::check;
use crate::detector::{self, Amplifier, ELEMENTARY_CHARGE_C};
use crate::effect::{Chosen, EffectRow, decide};
use crate::field::{Field, Ray};
use crate::light;
use crate::mechanics::{self, AxisTruth, Kinematics, Moment};
use crate::optics::{Axis, FINITE_BEAM, Light, Optics, PointSampled};
use crate::stage::Stages;
use crate::time;
use crate::{Nominal, NominalDetector, Quantity, Region, Scene, Simulated, Terms, Truth};

/// A rig as it is: what the host will never see but through its readings.
#[derive(Debug, Clone)]
pub struct Compiled {
    pub(crate) scene: Arc<Scene>,
    pub(crate) nominal: Nominal,
    pub(crate) simulated: Simulated,
    pub(crate) seed: u64,
    pub(crate) axes: [AxisTruth; 4],
    pub(crate) kinematics: Arc<dyn Kinematics>,
    /// When a reading looks while the axes move.
    pub(crate) moments: Vec<Moment>,
    /// What the detector sees along a ray.
    seen: Arc<dyn Field>,
    /// What leaves the sample.
    field: Arc<dyn Field>,
    pub(crate) optics: Arc<dyn Optics>,
    /// Photocurrent per radiance: responsivity times throughput, both as drawn; A per W·m⁻²·sr⁻¹.
    pub(crate) current_per_radiance: f64,
    /// Photocurrent per flux as drawn, A·W⁻¹ (or A·lm⁻¹).
    pub(crate) responsivity: f64,
    pub(crate) amplifier: Amplifier,
    pub(crate) chosen: Chosen,
    region: Region,
    tolerance: f64,
}

/// Why a scene and a rig don't make a simulated rig.
#[derive(Debug, Clone, PartialEq)]
pub enum CompileError {
    /// Pupil, spot and distance make no beam.
    Beam(DomainError),
    /// The axes' channels are not 0 to 3, each once.
    Channels([u8; 4]),
    /// Keys that contradict each other: the one, and what it asks of the other.
    Contradiction(&'static str, &'static str),
    /// A length of the detector, or its responsivity, came out of the draw at or below zero: its
    /// uncertainty is as large as itself. Name, value drawn.
    Drawn(&'static str, f64),
    /// A wish for an effect that can't be granted.
    Effect {
        /// The effect.
        name: String,
        /// Whether it was to be in.
        is_forced: bool,
        /// Why not.
        why: String,
    },
    /// A number of the rig that no rig has: name, value.
    Nominal(String, f64),
    /// What the scene says makes no sense together.
    Scene(String),
    /// The scene's levels are in another quantity than the detector is calibrated for.
    Quantity {
        /// The scene's.
        scene: Quantity,
        /// The rig's.
        rig: Quantity,
    },
    /// A number of the terms that makes no sense: name, value, what was expected.
    Terms(&'static str, f64, &'static str),
    /// A wish for an effect that is none.
    UnknownEffect {
        /// As it was written.
        name: String,
        /// What was meant, perhaps.
        nearest: Option<String>,
        /// All that there are.
        known: Vec<String>,
    },
    /// The scene calls for something that is not simulated.
    Unsupported(String),
}

/// What every candidate is weighed by. Nothing in it is drawn: what a rig is compiled to does not
/// depend on the seed.
#[derive(Debug)]
pub(crate) struct Setting<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) nominal: &'s Nominal,
    pub(crate) simulated: &'s Simulated,
    pub(crate) terms: &'s Terms,
    /// Where readings will be taken.
    pub(crate) region: Region,
    /// What can be seen there.
    pub(crate) field: Arc<dyn Field>,
    /// Photocurrent per radiance as stated.
    pub(crate) current_per_radiance: f64,
    /// The largest radiance of the region.
    pub(crate) brightest: f64,
    /// The noise floor: the standard deviation of a dwell's mean in the dark, as a radiance.
    pub(crate) floor: f64,
    /// How much all that is left out may amount to, relative.
    pub(crate) tolerance: f64,
}

/// Compiles a rig. The same arguments give the same rig, to the last bit.
pub fn compile(
    scene: Scene,
    nominal: Nominal,
    simulated: Simulated,
    terms: &Terms,
) -> Result<Compiled, CompileError> {
    if scene.quantity() != nominal.quantity {
        let (scene, rig) = (scene.quantity(), nominal.quantity);
        return Err(CompileError::Quantity { scene, rig });
    }
    check(&nominal, &simulated, terms)?;
    let has_stray = simulated.detector.stray_light_fraction_of_flux != 0.0;
    if has_stray && !scene.surfaces().is_empty() {
        let what = "simulated.stray_light_fraction_of_flux of a scene with surfaces";
        return Err(CompileError::Unsupported(what.to_owned()));
    }
    let scene = Arc::new(scene);
    let mut setting = Setting::new(&scene, &nominal, &simulated, terms)?;
    let tolerance = setting.tolerance;
    let mut beam = Light::of(&setting).map_err(CompileError::Beam)?;
    let mut candidates = core::mem::take(&mut beam.candidates);
    candidates.extend(light::candidates(&setting)?);
    candidates.extend(mechanics::candidates(&setting));
    candidates.extend(time::candidates(&setting));
    candidates.extend(detector::candidates(&setting));
    let chosen = decide(candidates, tolerance, terms)?;
    let departing = detector::departing(&nominal.detector, &chosen);
    let is_in = |name: &str| chosen.has(name);
    setting.field = light::field(&scene, Some(nominal.detector.distance_m), &is_in)?;
    let (region, optics) = (setting.region, beam.optics(&setting, &chosen));
    let (seen, field) = (Arc::clone(&setting.field), light::field(&scene, None, &is_in)?);
    let (responsivity, throughput) = draw_optics(&departing, terms.seed)?;
    Ok(Compiled {
        current_per_radiance: responsivity * throughput,
        responsivity,
        amplifier: draw_amplifier(&departing, terms.seed)?,
        axes: mechanics::axes(&nominal, &simulated, terms.seed, &chosen),
        kinematics: mechanics::kinematics(&simulated, terms.seed, &chosen),
        moments: mechanics::moments(&nominal, &simulated, &chosen),
        scene,
        nominal,
        simulated,
        seed: terms.seed,
        seen,
        field,
        optics,
        chosen,
        region,
        tolerance,
    })
}

/// What is left out must not show beside the noise of one dwell.
const PART_OF_NOISE: f64 = 0.1;

impl<'s> Setting<'s> {
    fn new(
        scene: &'s Arc<Scene>,
        nominal: &'s Nominal,
        simulated: &'s Simulated,
        terms: &'s Terms,
    ) -> Result<Self, CompileError> {
        let detector = &nominal.detector;
        let throughput =
            coaxial_disks(detector.pupil_radius_m, detector.spot_radius_m, detector.distance_m)
                .map_err(|_| CompileError::Drawn("throughput", detector.distance_m))?;
        let region = terms.region.unwrap_or_else(|| scene.bounding_region());
        let field = light::field(scene, Some(detector.distance_m), &|_| true)?;
        let mut setting = Self {
            scene,
            nominal,
            simulated,
            terms,
            region,
            current_per_radiance: detector.responsivity_a_per_w * throughput.m2_sr(),
            brightest: field.brightest(&region),
            field,
            floor: 0.0,
            tolerance: 0.0,
        };
        setting.floor = setting.noise_a(0.0) / setting.current_per_radiance;
        let default = setting.relative_noise() * PART_OF_NOISE;
        setting.tolerance = terms.tolerance.unwrap_or(default);
        Ok(setting)
    }

    /// The largest photocurrent of the region, amperes.
    pub(crate) fn brightest_a(&self) -> f64 {
        self.brightest * self.current_per_radiance
    }

    /// Predicted standard deviation of a dwell's mean at a photocurrent, amperes: shot noise, read
    /// noise and the converter's steps.
    fn noise_a(&self, current_a: f64) -> f64 {
        let detector = &self.nominal.detector;
        let rate_hz = f64::from(detector.adc_rate_hz);
        let count_a = self.full_scale_a() / libm::scalbn(1.0, i32::from(detector.adc_bits) - 1);
        let variance = ELEMENTARY_CHARGE_C * current_a * rate_hz
            + detector.read_noise_a * detector.read_noise_a
            + count_a * count_a / 12.0;
        libm::sqrt(variance / (self.terms.dwell_s * rate_hz).max(1.0))
    }

    /// Of the range that a person would choose: the finest that the brightest ray does not fill.
    fn full_scale_a(&self) -> f64 {
        let ranges = self.nominal.detector.gains.iter().map(|gain| gain.full_scale_a);
        let coarsest = ranges.clone().fold(0.0, f64::max);
        let brightest_a = self.brightest_a();
        ranges.filter(|full_scale_a| *full_scale_a > brightest_a).fold(coarsest, f64::min)
    }

    /// Predicted relative noise of one dwell on the region's brightest ray.
    fn relative_noise(&self) -> f64 {
        let brightest_a = self.brightest_a();
        self.noise_a(brightest_a) / brightest_a.max(self.noise_a(0.0))
    }
}

impl Compiled {
    /// One row an effect, in or out.
    pub fn effects(&self) -> &[EffectRow] {
        &self.chosen.rows
    }

    /// The same rig with one of its effects left out, and nothing else changed: to see what that
    /// effect does, or what it costs. `None` for what is not in, or is part of what a reading is.
    pub fn less(&self, effect: &str) -> Option<Self> {
        let mut less = self.clone();
        less.chosen = self.chosen.less(effect)?;
        let departing = detector::departing(&self.nominal.detector, &less.chosen);
        // What was drawn before was sound; less of it is.
        let (responsivity, throughput) = draw_optics(&departing, self.seed).ok()?;
        less.responsivity = responsivity;
        less.current_per_radiance = responsivity * throughput;
        less.amplifier = draw_amplifier(&departing, self.seed).ok()?;
        less.axes = mechanics::axes(&self.nominal, &self.simulated, self.seed, &less.chosen);
        less.moments = mechanics::moments(&self.nominal, &self.simulated, &less.chosen);
        less.kinematics = mechanics::kinematics(&self.simulated, self.seed, &less.chosen);
        if !self.scene.is_flat_emitters() {
            let is_in = |name: &str| less.chosen.has(name);
            let distance_m = Some(self.nominal.detector.distance_m);
            less.seen = light::field(&self.scene, distance_m, &is_in).ok()?;
            less.field = light::field(&self.scene, None, &is_in).ok()?;
            less.optics = self.optics.looking_at(Arc::clone(&less.seen));
        }
        if !less.chosen.has(FINITE_BEAM) {
            less.optics = Arc::new(PointSampled(Arc::clone(&less.seen)));
        }
        Some(less)
    }

    /// What emits.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Where the effects were weighed.
    pub const fn region(&self) -> &Region {
        &self.region
    }

    /// How much all that was left out may change a reading, relative to it.
    pub const fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Radiance along a ray, as it leaves the sample.
    pub fn radiance(&self, ray: &Ray) -> f64 {
        self.field.radiance(ray)
    }

    /// What the detector sees from there: the mean radiance of its beam, or the radiance along its
    /// axis if the beam was left out.
    pub fn seen_radiance(&self, axis: &Axis) -> f64 {
        self.optics.radiance(axis)
    }

    /// What leaves the sample, over a region.
    pub fn truth(&self, region: Region) -> Truth<'_> {
        Truth::new(&self.scene, &*self.field, region)
    }

    /// ADC readings a second.
    pub fn adc_rate_hz(&self) -> u32 {
        self.nominal.detector.adc_rate_hz
    }

    /// Photocurrent per radiance as drawn, A per W·m⁻²·sr⁻¹ (or per cd·m⁻²).
    pub fn current_per_radiance(&self) -> f64 {
        self.current_per_radiance
    }

    /// The stages that a photocurrent goes through on its way to the converter.
    pub(crate) fn stages(&self) -> Stages {
        let mut stages = Stages::default();
        detector::stray_light(self, &mut stages);
        time::stages(self, &mut stages);
        detector::stages(self, &mut stages);
        stages
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

impl fmt::Display for CompileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Beam(error) => write!(f, "detector: {error}"),
            Self::Channels(found) => {
                write!(f, "the axes are on channels {found:?}, expected 0 to 3, each once")
            }
            Self::Contradiction(key, other) => write!(f, "{key} without {other}"),
            Self::Drawn(name, value) => write!(
                f,
                "{name}: drawn as {value}, expected above 0: its stated uncertainty is too large"
            ),
            Self::Effect { name, is_forced, why } => {
                let wish = if *is_forced { "forced in" } else { "left out" };
                write!(f, "effect {name} can't be {wish}: {why}")
            }
            Self::Nominal(name, value) => write!(f, "{name}: {value} is not what a rig has"),
            Self::Quantity { scene, rig } => write!(
                f,
                "the scene's levels are {}, the rig's detector is calibrated for {}",
                scene.name(),
                rig.name()
            ),
            Self::Scene(what) => f.write_str(what),
            Self::Terms(name, value, expected) => {
                write!(f, "{name} is {value}, expected {expected}")
            }
            Self::UnknownEffect { name, nearest, known } => {
                write!(f, "no effect is called {name}")?;
                if let Some(nearest) = nearest {
                    write!(f, "; did you mean {nearest}?")?;
                }
                write!(f, " The effects here: {}", known.join(", "))
            }
            Self::Unsupported(what) => write!(f, "not simulated: {what}"),
        }
    }
}

impl core::error::Error for CompileError {}
