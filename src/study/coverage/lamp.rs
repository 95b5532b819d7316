//! A measured lamp as a scene of the study: its photometric file, turned about its axis, its beam made
//! wider or narrower, and brought to another level. It does not know which lamps there are, nor what a
//! fit makes of them.

use std::fmt::Write as _;

use photometry_files::lm63::{Photometry, Symmetry};

/// What makes another lamp of one that was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variant {
    /// Parts of a turn about its axis, to whole planes.
    pub turn: f64,
    /// How much wider its beam is at 45°, degrees: angles γ become γ + this sin 2γ, which leaves the axis
    /// and the lamp's own plane where they are. Within ±28°, so that angles keep their order.
    pub wider_deg: f64,
}

/// A lamp's intensities.
#[derive(Debug, Clone, PartialEq)]
pub struct Lamp {
    gamma_deg: Vec<f64>,
    c_deg: Vec<f64>,
    /// By plane, then by γ.
    planes: Vec<Vec<f64>>,
}

impl Lamp {
    /// Of a file whose planes go all round in equal steps; `None` of any other, and of one that shines
    /// nowhere within 80° of its axis. In its own plane it is taken to be dark, as a flat patch is:
    /// some files say otherwise by a few thousandths.
    pub fn of(photometry: &Photometry) -> Option<Self> {
        let (c_deg, gamma_deg) = (photometry.c_deg().to_vec(), photometry.gamma_deg().to_vec());
        let step = 360.0 / (c_deg.len() as f64 - 1.0);
        let is_even = c_deg.iter().enumerate().all(|(k, c)| (c - k as f64 * step).abs() < 1e-6);
        let is_whole = photometry.symmetry() == Symmetry::None && is_even;
        let mut planes = photometry.planes().to_vec();
        for (k, _) in gamma_deg.iter().enumerate().filter(|(_, gamma)| **gamma >= 90.0) {
            for plane in &mut planes {
                plane[k] = 0.0;
            }
        }
        let lamp = Self { gamma_deg, c_deg, planes };
        (is_whole && lamp.brightest(&lamp.gamma_deg) > 0.0).then_some(lamp)
    }

    /// I / cos γ where it is largest within 80°: the radiance along the brightest ray, times the area.
    fn brightest(&self, gamma_deg: &[f64]) -> f64 {
        let along = |plane: &Vec<f64>| {
            let angles = gamma_deg.iter().zip(plane).take_while(|(gamma, _)| **gamma <= 80.0);
            angles.map(|(gamma, value)| value / libm::cos(gamma.to_radians())).fold(0.0, f64::max)
        };
        self.planes.iter().map(along).fold(0.0, f64::max)
    }

    /// An LM-63 file of a variant of the lamp; its intensities such that a patch of this area has this
    /// radiance along its brightest ray.
    pub fn file(&self, variant: Variant, radiance: f64, area_m2: f64) -> String {
        let Variant { turn, wider_deg } = variant;
        let wider = |gamma: &f64| gamma + wider_deg * libm::sin(2.0 * gamma.to_radians());
        // The last angles as they are: a sine of half a turn is not quite zero.
        let is_own = |gamma: &f64| [0.0, 90.0, 180.0].contains(gamma);
        let own = self.gamma_deg.iter();
        let gamma_deg: Vec<f64> =
            own.map(|gamma| if is_own(gamma) { *gamma } else { wider(gamma) }).collect();
        let scale = radiance * area_m2 / self.brightest(&gamma_deg);
        // The last plane is the first one again.
        let round = self.planes.len() - 1;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below `round`
        let first = (turn.rem_euclid(1.0) * round as f64) as usize;
        let mut text = String::from("IESNA:LM-63-2002\n[_INTENSITYUNITS] W/sr\nTILT=NONE\n");
        let (gammas, planes) = (self.gamma_deg.len(), self.c_deg.len());
        // Writing to a string does not fail.
        let _ = write!(text, "1 -1 1.0 {gammas} {planes} 1 2 0.1 0.1 0.0\n1 1 0\n");
        let mut line = |values: &mut dyn Iterator<Item = f64>| {
            let words: Vec<String> = values.map(|value| value.to_string()).collect();
            text.push_str(&words.join(" "));
            text.push('\n');
        };
        line(&mut gamma_deg.iter().copied());
        line(&mut self.c_deg.iter().copied());
        for plane in 0..planes {
            line(&mut self.planes[(first + plane) % round].iter().map(|value| scale * value));
        }
        text
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Brighter the further round.
    pub(in crate::study::coverage) fn lamp() -> Lamp {
        let file = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1.0 3 5 1 2 0.1 0.1 0.0\n1 1 0\n0 60 90\n\
                    0 90 180 270 360\n10 1 0\n10 2 0\n10 3 0\n10 7 0\n10 1 0\n";
        let photometry = photometry_files::lm63::read(file.as_bytes()).expect("a sound file");
        Lamp::of(&photometry).expect("planes all round")
    }

    #[test]
    fn a_turned_lamp_has_its_planes_further_on_and_the_radiance_asked_for() {
        let lamp = lamp();
        // Along 60° of the fourth plane L A = 7 / cos 60°.
        let file = lamp.file(Variant { turn: 0.3, wider_deg: 0.0 }, 2.0, 0.5);
        let read = photometry_files::lm63::read(file.as_bytes()).expect("a sound file");
        let at = |c| read.intensity(c, 60.0) / 0.5 / 0.5;
        let found = [0.0, 90.0, 180.0, 270.0, 360.0].map(at);
        let expected = [2.0, 3.0, 7.0, 1.0, 2.0].map(|part| 2.0 * part / 7.0);
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{found:?} {expected:?}");
    }

    #[test]
    fn a_wider_lamp_has_its_shoulder_further_out_and_ends_where_it_did() {
        let narrow = lamp().file(Variant { turn: 0.0, wider_deg: 0.0 }, 2.0, 0.5);
        let wide = lamp().file(Variant { turn: 0.0, wider_deg: 4.0 }, 2.0, 0.5);
        let [narrow, wide] = [narrow, wide]
            .map(|file| photometry_files::lm63::read(file.as_bytes()).expect("a sound file"));
        // 60° + 4° sin 120°.
        let shoulder_deg = 60.0 + 2.0 * 3.0_f64.sqrt();
        let angles = wide.gamma_deg();
        assert!((angles[1] - shoulder_deg).abs() < 1e-9, "{angles:?}");
        assert_eq!(
            (angles[0].to_bits(), angles[2].to_bits()),
            (0.0_f64.to_bits(), 90.0_f64.to_bits())
        );
        // The same radiance along the brightest ray, which lies further out.
        let radiance = |lamp: &Photometry, gamma: f64| {
            lamp.intensity(270.0, gamma) / libm::cos(gamma.to_radians())
        };
        let (a, b) = (radiance(&narrow, 60.0), radiance(&wide, shoulder_deg));
        assert!((a - 1.0).abs() < 1e-12 && (b - 1.0).abs() < 1e-12, "{a} {b}");
    }

    #[test]
    fn a_lamp_of_one_plane_is_none() {
        let file =
            "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1.0 2 1 1 2 0.1 0.1 0.0\n1 1 0\n0 90\n0\n1 0\n";
        let photometry = photometry_files::lm63::read(file.as_bytes()).expect("a sound file");
        assert_eq!(Lamp::of(&photometry), None);
    }
}
