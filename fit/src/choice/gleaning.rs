//! Whole sweeps out of a stream of readings that is too long to be kept, for a basis to be chosen
//! from. Knows neither the readings' number beforehand nor any file.
//!
//! What shares place and azimuth line stays or goes together, by a hash of both: which sweeps stay
//! depends neither on their order nor on the values. Each time there is no more room half of the
//! sweeps go, or where few are left every second reading of each.

use std::collections::BTreeMap;

use crate::Sample;

/// Readings taken out of a stream, never more than a bound.
///
/// ```
/// use fit::{Gleaning, Noise, Ray, Sample};
///
/// let mut gleaning = Gleaning::new(1000);
/// for i in 0..100_000_u32 {
///     // 500 sweeps of 200 readings.
///     let (line, step) = (f64::from(i / 200), f64::from(i % 200));
///     let ray = Ray { x_m: 0.0, y_m: 0.0, theta_rad: 0.007 * step, phi_rad: 0.006 * line };
///     gleaning.take(&[Sample { ray, value: 1.0, noise: Noise::Unknown }]);
/// }
/// let few = gleaning.into_samples();
/// assert!(few.len() > 100 && few.len() <= 1000);
/// ```
#[derive(Debug, Clone)]
pub struct Gleaning {
    most: usize,
    /// Of 2^this sweeps one stays.
    sweeps: u32,
    /// Of 2^this readings of a sweep one stays.
    readings: u32,
    kept: BTreeMap<[i64; 3], Sweep>,
    count: usize,
}

/// One sweep: how many readings it has had, and those of them that were kept.
#[derive(Debug, Clone, Default)]
struct Sweep {
    seen: u64,
    kept: Vec<Sample>,
}

impl Gleaning {
    /// At most `most` readings.
    pub const fn new(most: usize) -> Self {
        Self { most, sweeps: 0, readings: 0, kept: BTreeMap::new(), count: 0 }
    }

    /// Readings in the order in which they come; what is not finite is left to who fits.
    pub fn take(&mut self, samples: &[Sample]) {
        for sample in samples {
            let key = key(sample);
            if !self.stays(&key) {
                continue;
            }
            let sweep = self.kept.entry(key).or_default();
            if sweep.seen.is_multiple_of(1 << self.readings) {
                sweep.kept.push(*sample);
                self.count += 1;
            }
            sweep.seen += 1;
            while self.count > self.most {
                self.halve();
            }
        }
    }

    /// What was kept, by line and place.
    pub fn into_samples(self) -> Vec<Sample> {
        self.kept.into_values().flat_map(|sweep| sweep.kept).collect()
    }

    fn stays(&self, key: &[i64; 3]) -> bool {
        hash(key).trailing_zeros() >= self.sweeps
    }

    fn halve(&mut self) {
        if self.kept.len() > SWEEPS_LEAST {
            self.sweeps += 1;
            let sweeps = self.sweeps;
            self.kept.retain(|key, _| hash(key).trailing_zeros() >= sweeps);
        } else {
            self.readings += 1;
            for sweep in self.kept.values_mut() {
                sweep.kept = sweep.kept.iter().copied().step_by(2).collect();
            }
        }
        self.count = self.kept.values().map(|sweep| sweep.kept.len()).sum();
    }
}

/// The azimuth line, and the place: readings of one sweep differ by less, as a rule, than what is
/// rounded away, and those at rest of one pose always do.
#[allow(clippy::cast_possible_truncation)] // angles and metres; NaN is 0
fn key(sample: &Sample) -> [i64; 3] {
    let ray = &sample.ray;
    let rounded = |value: f64, per_unit: f64| libm::round(value * per_unit) as i64;
    let line = rounded(ray.phi_rad.rem_euclid(core::f64::consts::PI), LINES_PER_RAD);
    // The line of 180° is that of 0°.
    let line = if line == rounded(core::f64::consts::PI, LINES_PER_RAD) { 0 } else { line };
    [line, rounded(ray.x_m, PLACES_PER_M), rounded(ray.y_m, PLACES_PER_M)]
}

/// The finaliser of Steele, Lea and Flood's `SplitMix` (2014) over the three numbers.
pub(super) fn hash(key: &[i64; 3]) -> u64 {
    key.iter().fold(0, |hash, number| {
        let mixed = (hash ^ number.cast_unsigned()).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    })
}

/// Sweeps that are kept at least, where there are so many.
const SWEEPS_LEAST: usize = 128;
/// Azimuths within an eighth of a degree of a multiple of a quarter are one line.
const LINES_PER_RAD: f64 = 4.0 * 180.0 / core::f64::consts::PI;
/// Places within 50 µm are one.
const PLACES_PER_M: f64 = 1e4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Noise, Ray};

    fn reading(line: u32, step: u32, x_m: f64) -> Sample {
        // A readback that is off by less than it is rounded to.
        let jitter = 1e-3 * libm::sin(f64::from(line * 77 + step));
        let phi_rad = (5.0 * f64::from(line)).to_radians() + jitter;
        let ray = Ray { x_m, y_m: 0.0, theta_rad: 0.01 * f64::from(step), phi_rad };
        Sample { ray, value: f64::from(step), noise: Noise::Unknown }
    }

    fn gleaned(most: usize, mut all: Vec<Sample>, back: bool) -> Vec<Sample> {
        if back {
            all.reverse();
        }
        let mut gleaning = Gleaning::new(most);
        for block in all.chunks(77) {
            gleaning.take(block);
            assert!(gleaning.kept.values().map(|sweep| sweep.kept.len()).sum::<usize>() <= most);
        }
        let mut samples = gleaning.into_samples();
        samples.sort_by(|a, b| {
            let by = |s: &Sample| [s.ray.x_m, s.ray.phi_rad, s.ray.theta_rad];
            by(a).partial_cmp(&by(b)).unwrap()
        });
        samples
    }

    #[test]
    fn whole_sweeps_stay_whatever_their_order() {
        let places: Vec<f64> = (0..40).map(|i| 1e-3 * f64::from(i)).collect();
        let all: Vec<Sample> =
            places.iter().flat_map(|x| (0..36 * 50).map(|i| reading(i / 50, i % 50, *x))).collect();
        let few = gleaned(20_000, all.clone(), false);
        assert!(few.len() > 5000 && few.len().is_multiple_of(50), "{}", few.len());
        for sweep in few.chunk_by(|a, b| key(a) == key(b)) {
            assert_eq!(sweep.len(), 50);
        }
        assert_eq!(few, gleaned(20_000, all, true));
    }

    #[test]
    fn of_few_long_sweeps_none_goes() {
        let all: Vec<Sample> = (0..12 * 4000).map(|i| reading(i / 4000, i % 4000, 0.0)).collect();
        let few = gleaned(3000, all.clone(), false);
        let sweeps: Vec<usize> =
            few.chunk_by(|a, b| key(a) == key(b)).map(<[Sample]>::len).collect();
        assert_eq!(sweeps.len(), 12);
        assert!(sweeps.iter().all(|length| *length == 125 || *length == 250), "{sweeps:?}");
        // What fits is kept as it is.
        assert_eq!(gleaned(48_000, all.clone(), false).len(), all.len());
    }
}
