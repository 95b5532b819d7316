//! The spot detector: which quantity it yields, through which beam, with which ranges.
//!
//! It does not know what is looked at: the sample's radiance comes in as an argument.

use std::time::Duration;

use radiometry::DomainError;
use radiometry::beam::Beam;
use radiometry::throughput::CoaxialDisks;

/// Elementary charge, coulomb (exact, SI 2019).
const ELEMENTARY_CHARGE_C: f64 = 1.602_176_634e-19;
/// Above this standard deviation of one ADC reading, in least significant bits, quantisation
/// errors of successive readings are as good as independent (Widrow and Kollár 2008, ch. 9: the
/// residual dependence is below 2 %).
const DITHER_LSB_MIN: f64 = 0.5;

/// Why a beam always has a throughput.
const CHECKED: &str = "spot, pupil and distance were checked when the rig was read";

/// What the detector's calibration makes of its current.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// cd/m²: a photometric detector, its responsivity in A/lm.
    Luminance,
    /// W/(m² sr): a radiometric detector, its responsivity in A/W.
    Radiance,
    /// No unit: current through throughput, in A/(m² sr).
    Relative,
}

/// A gain range.
#[derive(Debug, Clone, PartialEq)]
pub struct Gain {
    /// As plans name it.
    pub name: String,
    /// The current at which the ADC is full, ampere.
    pub full_scale_a: f64,
    /// Relative standard uncertainty of that current; the same for all readings in this range.
    pub u_relative: f64,
}

/// The analog-to-digital converter: signed, full scale at 2^(bits - 1) counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Adc {
    /// Resolution, sign included.
    pub bits: u8,
    /// Readings a second, each integrating from the one before it.
    pub rate_hz: u32,
}

/// The spot detector.
#[derive(Debug, Clone, PartialEq)]
pub struct Detector {
    /// What it yields.
    pub quantity: Quantity,
    /// From the sample's plane to the entrance pupil, metres.
    pub distance_m: f64,
    /// Standard uncertainty of the distance, metres.
    pub u_distance_m: f64,
    /// Radius of the entrance pupil, metres.
    pub pupil_radius_m: f64,
    /// Its standard uncertainty, metres.
    pub u_pupil_radius_m: f64,
    /// Radius of the spot that it sees on a sample facing it, metres.
    pub spot_radius_m: f64,
    /// Its standard uncertainty, metres.
    pub u_spot_radius_m: f64,
    /// A/W, or A/lm for luminance; 1 for a relative detector.
    pub responsivity: f64,
    /// Its relative standard uncertainty.
    pub u_responsivity_relative: f64,
    /// The spectral mismatch correction factor (CIE S 017, 17-1224: by what a reading of the
    /// source is multiplied, since the responsivity is that for the calibration's spectrum); 1 for none.
    pub spectral_mismatch: f64,
    /// Its relative standard uncertainty.
    pub u_spectral_mismatch_relative: f64,
    /// Standard deviation of one ADC reading without light, referred to the input, ampere.
    pub read_noise_a: f64,
    /// The gain ranges, in the order in which the device numbers them; never empty.
    pub gains: Vec<Gain>,
    /// The converter.
    pub adc: Adc,
}

/// The variance of a dwell's mean as a straight line in the radiance that it saw, in squares of
/// the detector's radiance unit: `floor + per_radiance * max(radiance, 0)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelledVariance {
    /// Without light: read noise, quantisation, and the dark current's shot noise.
    pub floor: f64,
    /// More for each unit of radiance: its shot noise.
    pub per_radiance: f64,
    /// Of the floor: read noise.
    pub read: f64,
    /// Of the floor: quantisation.
    pub quantisation: f64,
}

impl Quantity {
    /// The column of the quantity in samples.csv; its uncertainty's column begins with `u_`.
    pub const fn radiance_column(self) -> &'static str {
        match self {
            Self::Luminance => "luminance_cd_per_m2",
            Self::Radiance => "radiance_w_per_m2_sr",
            Self::Relative => "radiance_relative",
        }
    }

    /// The key of the exitance in fit.json.
    pub const fn exitance_key(self) -> &'static str {
        match self {
            Self::Luminance => "luminous_exitance_lm_per_m2",
            Self::Radiance => "exitance_w_per_m2",
            Self::Relative => "exitance_relative",
        }
    }

    /// The key in fit.json of the exitance into the region's directions alone.
    pub const fn exitance_within_region_key(self) -> &'static str {
        match self {
            Self::Luminance => "luminous_exitance_within_region_lm_per_m2",
            Self::Radiance => "exitance_within_region_w_per_m2",
            Self::Relative => "exitance_within_region_relative",
        }
    }

    /// The key of the flux in fit.json.
    pub const fn flux_key(self) -> &'static str {
        match self {
            Self::Luminance => "luminous_flux_lm",
            Self::Radiance => "flux_w",
            Self::Relative => "flux_relative",
        }
    }

    /// The key of the intensity along the normal in fit.json.
    pub const fn intensity_on_axis_key(self) -> &'static str {
        match self {
            Self::Luminance => "luminous_intensity_on_axis_cd",
            Self::Radiance => "intensity_on_axis_w_per_sr",
            Self::Relative => "intensity_on_axis_relative",
        }
    }

    /// The key of the highest radiance in fit.json.
    pub const fn peak_key(self) -> &'static str {
        match self {
            Self::Luminance => "peak_luminance",
            Self::Radiance => "peak_radiance",
            Self::Relative => "peak_radiance_relative",
        }
    }

    /// The unit of radiance, exitance and flux as people read them; empty for a relative one.
    pub const fn units(self) -> [&'static str; 3] {
        match self {
            Self::Luminance => ["cd/m²", "lm/m²", "lm"],
            Self::Radiance => ["W/(m² sr)", "W/m²", "W"],
            Self::Relative => ["", "", ""],
        }
    }

    /// The word in rig.toml.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Luminance => "luminance",
            Self::Radiance => "radiance",
            Self::Relative => "relative",
        }
    }
}

impl Adc {
    /// Counts at full scale: 2^(bits - 1).
    pub fn full_scale_counts(self) -> f64 {
        libm::ldexp(1.0, i32::from(self.bits) - 1)
    }

    /// ADC readings that fit into a dwell; at least one.
    pub fn readings_in(self, dwell: Duration) -> u32 {
        let whole = dwell.as_micros() * u128::from(self.rate_hz) / 1_000_000;
        u32::try_from(whole).unwrap_or(u32::MAX).max(1)
    }
}

impl Detector {
    /// The place of a gain range in [`Detector::gains`], by its name.
    pub fn gain_index(&self, name: &str) -> Option<u8> {
        self.gains.iter().position(|gain| gain.name == name).and_then(|i| u8::try_from(i).ok())
    }

    /// The throughput T of its beam, m² sr: that of two coaxial disks, spot and pupil, exactly.
    pub fn throughput_m2_sr(&self) -> f64 {
        self.disks().and_then(CoaxialDisks::throughput).expect(CHECKED).m2_sr()
    }

    /// The relative standard uncertainty of the throughput, from those of spot, pupil and
    /// distance by its partial derivatives. The same for all readings of a rig.
    pub fn u_throughput_relative(&self) -> f64 {
        libm::sqrt(self.throughput_terms().iter().map(|term| term * term).sum())
    }

    /// By how much the throughput grows, relative, as the spot's radius, the pupil's and the distance
    /// grow by u each.
    fn throughput_terms(&self) -> [f64; 3] {
        let partials = self.disks().and_then(CoaxialDisks::partials).expect(CHECKED);
        let terms = [
            partials.per_radius_1 * self.u_spot_radius_m,
            partials.per_radius_2 * self.u_pupil_radius_m,
            partials.per_distance * self.u_distance_m,
        ];
        terms.map(|term| term / self.throughput_m2_sr())
    }

    /// The beams that are off by u of one of their lengths to the side where the throughput grows, by
    /// how much it grows, relative, and which length; `None` where there is no such beam.
    pub(super) fn beams_off(&self) -> [(&'static str, f64, Option<Beam>); 3] {
        let [spot, pupil, distance] = self.throughput_terms();
        let off = |u_m: f64, term: f64| if term < 0.0 { -u_m } else { u_m };
        let (pupil_m, spot_m, distance_m) =
            (self.pupil_radius_m, self.spot_radius_m, self.distance_m);
        let other_spot = spot_m + off(self.u_spot_radius_m, spot);
        let other_pupil = pupil_m + off(self.u_pupil_radius_m, pupil);
        let other_distance = distance_m + off(self.u_distance_m, distance);
        [
            ("spot", spot.abs(), Beam::of_spot(pupil_m, other_spot, distance_m).ok()),
            ("pupil", pupil.abs(), Beam::of_spot(other_pupil, spot_m, distance_m).ok()),
            ("distance", distance.abs(), Beam::of_spot(pupil_m, spot_m, other_distance).ok()),
        ]
    }

    /// The relative standard uncertainty of what all its readings are multiplied by, the range's
    /// gain aside.
    pub fn u_scale_relative(&self) -> f64 {
        let current = libm::hypot(self.u_responsivity_relative, self.u_spectral_mismatch_relative);
        libm::hypot(current, self.u_throughput_relative())
    }

    /// Its beam, every ray through pupil and spot; an error only for lengths that the rig reader
    /// refuses.
    pub fn beam(&self) -> Result<Beam, DomainError> {
        Beam::of_spot(self.pupil_radius_m, self.spot_radius_m, self.distance_m)
    }

    /// Spot and pupil; an error only for lengths that the rig reader refuses.
    pub(super) fn disks(&self) -> Result<CoaxialDisks, DomainError> {
        CoaxialDisks::new(self.spot_radius_m, self.pupil_radius_m, self.distance_m)
    }

    /// One count in ampere.
    pub fn lsb_a(&self, gain: u8) -> f64 {
        self.full_scale_a(gain) / self.adc.full_scale_counts()
    }

    /// Ampere for one unit of the source's radiance: responsivity times throughput, by the spectral
    /// mismatch less.
    pub fn a_per_radiance(&self) -> f64 {
        self.responsivity * self.throughput_m2_sr() / self.spectral_mismatch
    }

    /// The radiance at which the range is full, the dark current aside.
    pub fn saturation_radiance(&self, gain: u8) -> f64 {
        self.full_scale_a(gain) / self.a_per_radiance()
    }

    /// The variance to expect of the mean of `n` ADC readings, never looked up in the readings
    /// themselves (a weight that follows its own reading's noise biases a fit).
    ///
    /// In ampere squared, at the current I: q I rate / n (shot noise, each reading integrating
    /// over 1 / rate) + read noise² / n + lsb² / 12, the last divided by n only where read noise
    /// dithers it.
    pub fn modelled_variance(&self, gain: u8, n: u32, dark_a: f64) -> ModelledVariance {
        let n = f64::from(n.max(1));
        let shot_a2_per_a = ELEMENTARY_CHARGE_C * f64::from(self.adc.rate_hz) / n;
        let lsb_a = self.lsb_a(gain);
        let is_dithered = self.read_noise_a > DITHER_LSB_MIN * lsb_a;
        let quantisation_a2 = lsb_a * lsb_a / 12.0 / if is_dithered { n } else { 1.0 };
        let read_a2 = self.read_noise_a * self.read_noise_a / n;
        let floor_a2 = read_a2 + quantisation_a2 + shot_a2_per_a * dark_a.max(0.0);
        let a_per_radiance = self.a_per_radiance();
        let a2_per_square = a_per_radiance * a_per_radiance;
        ModelledVariance {
            floor: floor_a2 / a2_per_square,
            per_radiance: shot_a2_per_a / a_per_radiance,
            read: read_a2 / a2_per_square,
            quantisation: quantisation_a2 / a2_per_square,
        }
    }

    /// Full scale of a range, ampere; NaN for one that does not exist.
    fn full_scale_a(&self, gain: u8) -> f64 {
        self.gains.get(usize::from(gain)).map_or(f64::NAN, |gain| gain.full_scale_a)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Rig;
    use super::*;

    fn detector() -> Detector {
        Rig::built_in().unwrap().detector
    }

    #[test]
    fn far_away_the_throughput_is_both_areas_over_the_squared_distance() {
        let detector = Detector { distance_m: 300.0, ..detector() };
        let areas = std::f64::consts::PI.powi(2)
            * detector.spot_radius_m.powi(2)
            * detector.pupil_radius_m.powi(2);
        assert!((detector.throughput_m2_sr() * 300.0 * 300.0 / areas - 1.0).abs() < 1e-8);
    }

    #[test]
    fn the_throughput_s_uncertainty_adds_twice_the_relative_ones_of_the_lengths() {
        let detector = Detector {
            distance_m: 300.0,
            u_distance_m: 3.0,
            u_pupil_radius_m: 0.0,
            u_spot_radius_m: 0.0,
            ..detector()
        };
        assert!((detector.u_throughput_relative() - 0.02).abs() < 1e-9);
        let u_pupil_radius_m = 0.01 * detector.pupil_radius_m;
        let both = Detector { u_pupil_radius_m, ..detector };
        assert!((both.u_throughput_relative() - 0.02 * 2.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn the_beams_that_may_be_have_the_throughput_that_they_are_said_to_have() {
        let detector = detector();
        let whole = detector.throughput_m2_sr();
        let mut squares = 0.0;
        for (length, u, beam) in detector.beams_off() {
            let growth = beam.unwrap().throughput().unwrap().m2_sr() / whole - 1.0;
            // A second order of what is off.
            assert!(u > 0.0 && (growth - u).abs() < u * u, "{length}: {growth} {u}");
            squares += u * u;
        }
        assert!((libm::sqrt(squares) / detector.u_throughput_relative() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn shot_noise_falls_with_the_dwell_and_not_with_the_rate() {
        let slow = detector();
        let fast = Detector { adc: Adc { rate_hz: 8000, ..slow.adc }, ..slow.clone() };
        let dwell = Duration::from_millis(50);
        let slope = |detector: &Detector, dwell: Duration| {
            detector.modelled_variance(0, detector.adc.readings_in(dwell), 0.0).per_radiance
        };
        assert!((slope(&slow, dwell) / slope(&fast, dwell) - 1.0).abs() < 1e-12);
        assert!((slope(&slow, dwell) / slope(&slow, 4 * dwell) - 4.0).abs() < 1e-12);
        // q I / t, in the radiance's unit.
        let current_a = slow.a_per_radiance();
        let expected = ELEMENTARY_CHARGE_C * current_a / 0.05 / (current_a * current_a);
        assert!((slope(&slow, dwell) / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn quantisation_averages_out_only_where_noise_dithers_it() {
        let of = |read_noise_a: f64, n: u32| {
            let detector = Detector { read_noise_a, ..detector() };
            let lsb = detector.lsb_a(0) / detector.a_per_radiance();
            detector.modelled_variance(0, n, 0.0).floor / (lsb * lsb / 12.0)
        };
        assert!((of(0.0, 1) - 1.0).abs() < 1e-12 && (of(0.0, 100) - 1.0).abs() < 1e-12);
        let lsb_a = detector().lsb_a(0);
        assert!((of(lsb_a, 1) / of(lsb_a, 100) - 100.0).abs() < 1e-9);
    }

    #[test]
    fn the_dark_current_s_shot_noise_is_in_the_floor() {
        let detector = detector();
        let dark_a = 1e-9;
        let more = detector.modelled_variance(0, 100, dark_a).floor
            - detector.modelled_variance(0, 100, 0.0).floor;
        let slope = detector.modelled_variance(0, 100, 0.0).per_radiance;
        assert!((more / (slope * dark_a / detector.a_per_radiance()) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn full_scale_is_half_the_codes() {
        let detector = detector();
        assert!((detector.adc.full_scale_counts() - 524_288.0).abs() < 1e-9);
        assert!((detector.lsb_a(0) * 524_288.0 / 1e-6 - 1.0).abs() < 1e-15);
        assert!(
            (detector.saturation_radiance(1) * 10.0 / detector.saturation_radiance(0) - 1.0).abs()
                < 1e-12
        );
    }
}
