//! The scenes, as files would have them. All fill the plan's region and more, so that no beam
//! reaches beyond them.

use super::super::coverage::{Attachment, ramp};
use crate::study::Fineness;

/// What emits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scene {
    /// The same radiance everywhere.
    Lambertian,
    /// cos¹⁰⁰: 13.5° wide.
    Narrow,
    /// A lobe of 15° about (45°, 30°) on a Lambertian floor; the same all over the region.
    Gloss,
    /// Brightest on a ring.
    Batwing,
    /// A ridge at 72°, 7° wide in θ and 40° long in φ, on a floor.
    Grazing,
    /// Brighter to one side, limb darkened.
    Gradient,
    /// After a measured photometric file.
    Photometric,
    /// A panel across which the penumbra of an edge falls, 40 mm wide.
    Penumbra,
    /// The batwing, so dim that a reading's noise is twenty times as large beside it.
    Dim,
    /// A lobe 1.6° wide on a floor: narrower than the plan declares.
    Spike,
}

/// A scene's files.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFiles {
    /// scene.toml.
    pub text: String,
    /// What it refers to.
    pub attachments: Vec<Attachment>,
}

impl Scene {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Lambertian,
        Self::Narrow,
        Self::Gloss,
        Self::Batwing,
        Self::Grazing,
        Self::Gradient,
        Self::Photometric,
        Self::Penumbra,
        Self::Dim,
        Self::Spike,
    ];

    /// As the command line and cost.csv name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lambertian => "lambertian",
            Self::Narrow => "narrow",
            Self::Gloss => "gloss",
            Self::Batwing => "batwing",
            Self::Grazing => "grazing",
            Self::Gradient => "gradient",
            Self::Photometric => "photometric",
            Self::Penumbra => "penumbra",
            Self::Dim => "dim",
            Self::Spike => "spike",
        }
    }

    /// Whether it is among those that one plan shall serve without knowing which it is. The others
    /// ask questions of their own: who declares wrongly, and who knows that light is scarce.
    pub const fn is_common(self) -> bool {
        !matches!(self, Self::Dim | Self::Spike)
    }

    /// How finely it has to be looked at to see all of it.
    pub const fn fineness(self) -> Fineness {
        match self {
            // Its square is 1.1° wide: two nodes and more in each width.
            Self::Spike => Fineness { theta: 96, phi: 180, parts: 1, in_part: 3 },
            Self::Grazing => Fineness { theta: 48, phi: 96, parts: 1, in_part: 4 },
            _ => Fineness::USUAL,
        }
    }

    /// Its files. `photometric` is the file of [`Scene::Photometric`].
    pub fn files(self, photometric: &str) -> SceneFiles {
        let mut attachments = Vec::new();
        let text = match self {
            Self::Lambertian => emitter("lambertian", LEVEL, ""),
            Self::Narrow => emitter("cosine-power", LEVEL, "exponent = 100\n"),
            Self::Gloss => {
                let lobe = "base_weight = 0.1\nlobes = [{ theta_deg = 45, phi_deg = 30, \
                            exponent = 80 }]\n";
                emitter("lobes", LEVEL, lobe)
            }
            Self::Batwing => emitter("batwing", LEVEL, BATWING),
            Self::Dim => emitter("batwing", LEVEL_DIM, BATWING),
            Self::Grazing => {
                // Lobes at half their width from each other make a ridge.
                let lobe = |phi_deg: i32| {
                    format!("{{ theta_deg = 72, phi_deg = {phi_deg}, width_deg = 7 }}")
                };
                let lobes: Vec<String> = (-3..=3).map(|k| lobe(100 + 6 * k)).collect();
                let keys = format!("base_weight = 0.1\nlobes = [{}]\n", lobes.join(", "));
                emitter("lobes", LEVEL, &keys)
            }
            Self::Gradient => {
                attachments.push(Attachment { name: IMAGE.to_owned(), bytes: ramp(0.35) });
                emitter("image", LEVEL, &format!("file = \"{IMAGE}\"\nexponent = 2\n"))
            }
            Self::Photometric => {
                let bytes = scaled(photometric, LEVEL).into_bytes();
                attachments.push(Attachment { name: TABLE.to_owned(), bytes });
                format!("[[emitter]]\nkind = \"photometric-file\"\nfile = \"{TABLE}\"\n{OUTLINE}")
            }
            Self::Penumbra => PENUMBRA.to_owned(),
            Self::Spike => {
                let lobe = "base_weight = 0.1\nlobes = [{ theta_deg = 33.3, phi_deg = 47.1, \
                            width_deg = 1.6 }]\n";
                emitter("lobes", LEVEL, lobe)
            }
        };
        SceneFiles { text, attachments }
    }
}

fn emitter(kind: &str, level: f64, keys: &str) -> String {
    format!("[[emitter]]\nkind = \"{kind}\"\n{OUTLINE}radiance_w_per_m2_sr = {level}\n{keys}")
}

/// A file in LM-63, its intensities such that the patch of [`OUTLINE`] has about this radiance along
/// its normal: by the multiplier, the third number after the tilt.
fn scaled(file: &str, level: f64) -> String {
    let Some((head, tail)) = file.split_once("TILT=NONE") else { return file.to_owned() };
    let tail = tail.trim_start();
    let (numbers, rest) = tail.split_once('\n').unwrap_or((tail, ""));
    let mut words: Vec<String> = numbers.split_whitespace().map(str::to_owned).collect();
    if let Some(multiplier) = words.get_mut(2) {
        *multiplier = (level * PATCH_M2 / INTENSITY_W_PER_SR).to_string();
    }
    format!("{head}TILT=NONE\n{}\n{rest}", words.join(" "))
}

/// At this radiance, W·m⁻²·sr⁻¹, 20 ms of the built-in rig have a noise of 0.1 %: 3.6e-11 A of
/// light beside 3.2e-14 A of read noise and 1.7e-14 A of shot noise.
const LEVEL: f64 = 6.8e-3;
/// At this one 2 %: 1.6e-12 A beside read noise alone.
const LEVEL_DIM: f64 = 3e-4;

const OUTLINE: &str = "x_mm = [-60, 60]\ny_mm = [-60, 60]\n";
const PATCH_M2: f64 = 0.12 * 0.12;
/// Of the photometric file along its normal.
const INTENSITY_W_PER_SR: f64 = 0.1214;
const BATWING: &str = "peak_theta_deg = 55\nvalley = 0.33\nsharpness = 3\n";
const IMAGE: &str = "ramp.pgm";
const TABLE: &str = "table.ies";
const PENUMBRA: &str = r#"[[surface]]
kind = "lambertian"
albedo = 0.8
x_mm = [-60, 60]
y_mm = [-60, 60]

[[lamp]]
kind = "sphere"
centre_mm = [0, 0, 1000]
radius_mm = 20
radiance_w_per_m2_sr = 30

[[occluder]]
kind = "half-plane"
x_max_mm = 0
z_mm = 500
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photometric_file_takes_another_level_by_its_multiplier() {
        let file = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1.0 37 17\n1 1 15\n";
        let scaled = scaled(file, INTENSITY_W_PER_SR / PATCH_M2 * 2.0);
        assert!(scaled.contains("\n1 -1 2 37 17\n1 1 15\n"), "{scaled}");
    }
}
