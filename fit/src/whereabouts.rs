//! Where the readings of shares lie: what a fit says of its poses ([`Resolves`], gaps), of readings that were
//! forgotten one by one, on several machines perhaps. It knows no values.

use crate::beam::Optics;
use crate::choice::Loose;
use crate::measured::{Looked, Measured};
use crate::poses::Poses;
use crate::stored::Numbers;
use crate::{BasisSpec, Region, Resolves, Sample};

/// Poses, directions and sweeps, in memory that does not go with the number of readings.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Whereabouts {
    region: Region,
    poses: Poses,
    looked: Looked,
    loose: Loose,
}

impl Whereabouts {
    /// Of no reading of a region yet.
    pub(crate) fn new(region: &Region) -> Self {
        Self {
            region: *region,
            poses: Poses::unprobed(region),
            looked: Looked::new(),
            loose: Loose::new(region),
        }
    }

    /// Takes samples of finite poses in.
    pub(crate) fn take(&mut self, samples: &[Sample]) {
        self.poses.take(samples);
        self.looked.take(samples);
        self.loose.take(samples);
    }

    /// Takes in where another share of the same region lies.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.poses.merge(&other.poses);
        self.looked.merge(&other.looked);
        self.loose.merge(&other.loose);
    }

    /// Distinct positions along the axis that has more of them.
    pub(crate) fn places(&self) -> usize {
        self.poses.places()
    }

    pub(crate) fn measured(&self) -> Measured {
        self.looked.measured()
    }

    pub(crate) fn resolves(&self, basis: BasisSpec, optics: Option<&Optics>) -> Resolves {
        let poses = self.poses.probed(self.looked.directions());
        let kind = self.loose.kind(&poses.grid());
        Resolves::by(&poses, kind, &self.region, basis, optics)
    }

    /// The numbers that it consists of, for [`stored`](Self::stored).
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let mut out = Vec::new();
        self.poses.put(&mut out);
        self.looked.put(&mut out);
        self.loose.put(&mut out);
        out
    }

    /// Takes stored numbers up; `None` where they are not such ones.
    pub(crate) fn stored(numbers: &[f64], region: &Region) -> Option<Self> {
        let mut numbers = Numbers::of(numbers);
        let poses = Poses::stored(&mut numbers, region)?;
        let looked = Looked::stored(&mut numbers)?;
        let loose = Loose::stored(&mut numbers, region)?;
        numbers.is_empty().then_some(Self { region: *region, poses, looked, loose })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scattered::{BASIS, REGION, part, reading};
    use crate::{Noise, Ray};

    fn samples(count: usize, ray: impl Fn(usize) -> Ray) -> Vec<Sample> {
        (0..count).map(|i| Sample { ray: ray(i), value: 1.0, noise: Noise::Unknown }).collect()
    }

    /// By turns into three shares, each stored and taken up again before they come together.
    fn merged(samples: &[Sample]) -> Whereabouts {
        let mut shares = [(); 3].map(|()| Whereabouts::new(&REGION));
        for (k, sweep) in samples.chunks(10).enumerate() {
            shares[k % 3].take(sweep);
        }
        let mut all = Whereabouts::new(&REGION);
        for share in shares {
            let stored = Whereabouts::stored(&share.numbers(), &REGION);
            assert_eq!(stored.as_ref(), Some(&share));
            all.merge(&share);
        }
        all
    }

    #[test]
    fn shares_say_of_their_poses_what_all_readings_together_do() {
        // A readback's scatter, across the edges of cells.
        let off = |i: usize| 4e-5 * (part(i, 0.618_034) - 0.5);
        let meridian = |i: usize| Ray {
            x_m: 5e-3 * (i / 100 % 3) as f64 + 1e-2 * off(i),
            y_m: 0.0,
            theta_rad: 0.12 * (i % 10) as f64 + 0.1 + off(i),
            phi_rad: 0.4 * (i / 10) as f64 + off(i),
        };
        let ring = |i: usize| Ray {
            x_m: 0.0,
            y_m: 0.0,
            theta_rad: 0.06 * (i / 10) as f64 + 0.2 + off(i),
            phi_rad: 0.63 * (i % 10) as f64,
        };
        let scan = |i: usize| Ray {
            x_m: 1e-3 * (i % 10) as f64,
            y_m: 0.0,
            theta_rad: 0.2 + part(i / 10, 0.8) + off(i),
            phi_rad: 0.613 * (i / 10) as f64,
        };
        let all = [
            samples(900, |i| reading(i).0),
            samples(300, meridian),
            samples(200, ring),
            samples(200, scan),
        ];
        for samples in all {
            let found = merged(&samples).resolves(BASIS, None);
            let expected = Resolves::of(&samples, &REGION, BASIS, None);
            assert!((found.measured_to_rad - expected.measured_to_rad).abs() <= 0.0);
            let pairs = [
                (Some(found.theta_rad), Some(expected.theta_rad)),
                (found.phi_rad, expected.phi_rad),
                (found.x_m, expected.x_m),
                (found.y_m, expected.y_m),
            ];
            for (found, expected) in pairs {
                let (Some(found), Some(expected)) = (found, expected) else {
                    assert_eq!(found, expected);
                    continue;
                };
                assert_eq!(found.limit, expected.limit);
                // Directions are kept to a thousandth of a radian.
                assert!(
                    (found.width / expected.width - 1.0).abs() < 3e-3,
                    "{found:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn a_gap_is_seen_in_shares_as_in_the_whole() {
        let samples = samples(3000, |i| Ray { phi_rad: 5.0 * part(i, 0.438_579), ..reading(i).0 });
        let (found, expected) = (merged(&samples).measured(), Measured::of(&samples));
        for (theta_rad, phi_rad, is_held) in [(0.9, 2.5, true), (0.9, 5.7, false)] {
            assert_eq!(found.holds(theta_rad, phi_rad, &REGION), is_held);
            assert_eq!(expected.holds(theta_rad, phi_rad, &REGION), is_held);
        }
    }

    #[test]
    fn numbers_that_are_not_its_own_are_not_taken_up() {
        let numbers = merged(&samples(300, |i| reading(i).0)).numbers();
        assert!(Whereabouts::stored(&numbers, &REGION).is_some());
        for at in [0, 2, 3, numbers.len() / 2, numbers.len() - 1] {
            let mut wrong = numbers.clone();
            wrong[at] = f64::NAN;
            assert!(Whereabouts::stored(&wrong, &REGION).is_none(), "{at}");
            assert!(Whereabouts::stored(&numbers[..at], &REGION).is_none(), "{at}");
        }
        let long = [numbers.as_slice(), &[0.0]].concat();
        assert!(Whereabouts::stored(&long, &REGION).is_none());
    }
}
