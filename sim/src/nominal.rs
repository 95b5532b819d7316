//! What the rig file states about a rig, as plain numbers in SI units and counts. The simulated
//! rig departs from it by what is uncertain, which is drawn; a host works with it as it stands.

/// What the detector is calibrated for. A scene's levels must be of the same kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Luminance, cd·m⁻²; responsivity in A·lm⁻¹.
    Luminance,
    /// Radiance, W·m⁻²·sr⁻¹; responsivity in A·W⁻¹.
    Radiance,
    /// Uncalibrated: radiance but for a factor. The scene speaks in radiometric units.
    Relative,
}

impl Quantity {
    /// What rig.toml calls it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Luminance => "luminance",
            Self::Radiance => "radiance",
            Self::Relative => "relative",
        }
    }
}

/// A rig as its file states it.
#[derive(Debug, Clone, PartialEq)]
pub struct Nominal {
    /// What the detector is calibrated for.
    pub quantity: Quantity,
    /// The arm θ, the turntable φ, the stage x, the stage y, in this order whatever their
    /// channels.
    pub axes: [NominalAxis; 4],
    /// The detector head.
    pub detector: NominalDetector,
}

/// An axis as stated. "Unit" is the radian for θ and φ, the metre for x and y.
#[derive(Debug, Clone, PartialEq)]
pub struct NominalAxis {
    /// The device's channel: each of 0 to 3 once.
    pub channel: u8,
    /// Where it stands at its count 0 as stated, units: elsewhere than at 0 where it is fixed.
    pub home: f64,
    /// Counts a unit; negative if counts fall while the axis's value rises.
    pub counts_per_unit: f64,
    /// Lowest and highest position, counts from the home mark.
    pub travel_counts: (i32, i32),
    /// Highest speed, counts a second.
    pub speed_counts_per_s: u32,
    /// Acceleration, counts a second squared.
    pub acceleration_counts_per_s2: u32,
    /// How long the axis needs to come to rest after its setpoint has, seconds.
    pub settle_s: f64,
    /// Whether the position that is reported is measured, or the setpoint.
    pub has_encoder: bool,
    /// Standard uncertainty of where the home mark stands, units.
    pub u_zero: f64,
    /// Standard uncertainty of finding the mark again, units.
    pub u_homing: f64,
    /// Standard uncertainty of the true position at a reported one, units.
    pub u_readback: f64,
}

/// The detector head as stated: an entrance pupil that looks at a spot on the sample, a
/// photodiode, its amplifier and its converter.
#[derive(Debug, Clone, PartialEq)]
pub struct NominalDetector {
    /// From the sample to the pupil, metres, and its standard uncertainty.
    pub distance_m: f64,
    /// See [`NominalDetector::distance_m`].
    pub u_distance_m: f64,
    /// The pupil's radius, metres, and its standard uncertainty.
    pub pupil_radius_m: f64,
    /// See [`NominalDetector::pupil_radius_m`].
    pub u_pupil_radius_m: f64,
    /// The spot's radius across the axis, metres, and its standard uncertainty.
    pub spot_radius_m: f64,
    /// See [`NominalDetector::spot_radius_m`].
    pub u_spot_radius_m: f64,
    /// Photocurrent per flux, A·W⁻¹ (A·lm⁻¹ for luminance).
    pub responsivity_a_per_w: f64,
    /// Its relative standard uncertainty.
    pub u_responsivity_relative: f64,
    /// Standard deviation of one ADC reading in the dark, referred to the input, amperes.
    pub read_noise_a: f64,
    /// Gain ranges, as the wire numbers them.
    pub gains: Vec<NominalGain>,
    /// The converter's resolution. Readings are signed: full scale is 2^(bits - 1).
    pub adc_bits: u8,
    /// ADC readings a second; each integrates over the time between two.
    pub adc_rate_hz: u32,
}

/// A gain range as stated.
#[derive(Debug, Clone, PartialEq)]
pub struct NominalGain {
    /// What files call it.
    pub name: String,
    /// The current at positive full scale, amperes.
    pub full_scale_a: f64,
    /// Its relative standard uncertainty.
    pub u_relative: f64,
}
