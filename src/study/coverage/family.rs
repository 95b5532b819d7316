//! Families of scenes: what emits, its numbers drawn at random, and the plan that measures it.

use std::fmt::Write as _;

use super::lamp::Variant;
use super::{Draws, Lamp};

/// A kind of scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// The same radiance everywhere; drawn: its level. The basis follows it exactly, as it does the
    /// next two.
    Lambertian,
    /// cosⁿ, n even; drawn: level and n.
    Lobe,
    /// Brighter to one side, the more so the further; drawn: level, slope, and whether it is limb
    /// darkened by cos².
    Gradient,
    /// cosⁿ of any n; drawn: level and n. No polynomial follows it to the horizon.
    AnyLobe,
    /// A lobe about an axis off the normal on a base; drawn: level, n, tilt, azimuth, base.
    OffAxis,
    /// Brightest on a ring; drawn: level, the ring's angle, valley, sharpness.
    Batwing,
    /// After a measured photometric file, interpolated between its angles; drawn: the lamp, how far it
    /// is turned about its axis, how much wider or narrower its beam is, level.
    Photometric,
}

/// All of them.
pub const FAMILIES: [Family; 7] = [
    Family::Lambertian,
    Family::Lobe,
    Family::Gradient,
    Family::AnyLobe,
    Family::OffAxis,
    Family::Batwing,
    Family::Photometric,
];

/// How well the rig knows its own scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scale {
    /// Responsivity, throughput and gain as the rig file states them: the scale outweighs the rest.
    AsStated,
    /// Exactly: what is left is tested hard.
    Known,
}

impl Scale {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Known, Self::AsStated];

    /// As coverage.csv names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::AsStated => "as stated",
            Self::Known => "known exactly",
        }
    }
}

/// A file that a drawn scene refers to.
#[derive(Debug, Clone, PartialEq)]
pub struct Attachment {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

/// A scene as drawn, with the plan that measures it, as files would have them.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// plan.toml.
    pub plan: String,
    /// scene.toml.
    pub scene: String,
    /// rig.toml.
    pub rig: String,
    /// What the scene refers to.
    pub attachments: Vec<Attachment>,
}

impl Drawn {
    /// The same with a plan that leaves basis and penalty to the readings.
    #[must_use]
    pub fn unpinned(mut self) -> Self {
        if let Some(at) = self.plan.find(FIT) {
            self.plan.truncate(at);
        }
        self
    }
}

impl Family {
    /// As the command line and coverage.csv name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lambertian => "lambertian",
            Self::Lobe => "lobe",
            Self::Gradient => "gradient",
            Self::AnyLobe => "any-lobe",
            Self::OffAxis => "off-axis",
            Self::Batwing => "batwing",
            Self::Photometric => "photometric",
        }
    }

    /// Whether the basis can't follow every scene of it: other demands are made there.
    pub const fn is_limited_by_basis(self) -> bool {
        match self {
            Self::Lambertian | Self::Lobe | Self::Gradient => false,
            Self::AnyLobe | Self::OffAxis | Self::Batwing | Self::Photometric => true,
        }
    }

    /// One scene of it, seen by a rig of this description whose dark current is drawn too.
    /// [`Family::Photometric`] is one of the lamps.
    pub fn draw(self, draws: &mut Draws, scale: Scale, rig: &str, lamps: &[Lamp]) -> Drawn {
        let dark_a = draws.between(0.0, 2e-12);
        // Of the 10 nA range, which is full at a radiance of 1.9 on the built-in rig.
        let level = draws.log_between(0.03, 1.2);
        let mut attachments = Vec::new();
        let scene = match self {
            Self::Lambertian => emitter("lambertian", level, ""),
            Self::Lobe => power(level, draws.one_of([2.0, 4.0, 6.0])),
            Self::Gradient => {
                let slope = draws.between(-0.35, 0.35);
                attachments.push(Attachment { name: IMAGE.to_owned(), bytes: ramp(slope) });
                let exponent = draws.one_of([0, 2]);
                emitter("image", level, &format!("file = \"{IMAGE}\"\nexponent = {exponent}\n"))
            }
            Self::AnyLobe => power(level, draws.log_between(0.5, 12.0)),
            Self::OffAxis => off_axis(draws, level),
            Self::Batwing => {
                let ring_deg = draws.between(35.0, 60.0);
                let (valley, sharpness) = (draws.between(0.2, 0.8), draws.one_of([1, 2, 3]));
                let keys = format!(
                    "peak_theta_deg = {ring_deg}\nvalley = {valley}\nsharpness = {sharpness}\n"
                );
                emitter("batwing", level, &keys)
            }
            Self::Photometric => {
                let lamp = &lamps[draws.below(lamps.len())];
                let turn = draws.uniform();
                // What the basis misses of one lamp is one number; of its like it is as many.
                let wider_deg = draws.between(-WIDER_DEG, WIDER_DEG);
                let variant = Variant { turn, wider_deg };
                let bytes = lamp.file(variant, level, PATCH_M2).into_bytes();
                attachments.push(Attachment { name: TABLE.to_owned(), bytes });
                format!("[[emitter]]\nkind = \"photometric-file\"\nfile = \"{TABLE}\"\n{OUTLINE}")
            }
        };
        let rig = rig_text(rig, scale, dark_a);
        Drawn { plan: self.plan(), scene, rig, attachments }
    }

    /// Every reading at one place where the scene is the same all over, at six where it is not.
    fn plan(self) -> String {
        let (angular_degree, steps_deg) = match self {
            // At least 2 n + 1 C-planes for degree n: fewer alias its harmonics.
            Self::Lambertian => (2, ("16", "72")),
            Self::Gradient => (2, ("20", "72")),
            Self::Lobe => (6, ("12", "24")),
            Self::AnyLobe => (8, ("10", "20")),
            Self::OffAxis | Self::Batwing => (12, ("8", "14.4")),
            // Rings closer than the lamps' edges are wide: the basis is to be what limits, and of what
            // lies between readings no fit knows.
            Self::Photometric => (14, ("5", "12")),
        };
        let (places, position_degree) =
            if self == Self::Gradient { ((3, 2), 1) } else { ((1, 1), 0) };
        // Lamps end in a kink on the horizon, and are measured nearly up to there.
        let theta_max_deg = if self == Self::Photometric { 85 } else { 80 };
        let mut plan = String::from(PLAN);
        let (theta_step, phi_step) = steps_deg;
        // Writing to a string does not fail.
        let _ = write!(
            plan,
            "\n[region]\nx_mm = [-10, 10]\ny_mm = [-10, 10]\ntheta_max_deg = {theta_max_deg}\n\
             \n[schedule]\nkind = \"cgamma\"\nx_count = {}\ny_count = {}\nc_step_deg = {phi_step}\n\
             gamma_step_deg = {theta_step}\norder = \"travel\"\n{FIT}angular_degree = \
             {angular_degree}\nposition_degree = {position_degree}\n",
            places.0, places.1,
        );
        plan
    }
}

fn emitter(kind: &str, level: f64, keys: &str) -> String {
    format!("[[emitter]]\nkind = \"{kind}\"\n{OUTLINE}radiance_w_per_m2_sr = {level}\n{keys}")
}

fn power(level: f64, exponent: f64) -> String {
    emitter("cosine-power", level, &format!("exponent = {exponent}\n"))
}

fn off_axis(draws: &mut Draws, level: f64) -> String {
    let (tilt_deg, phi_deg) = (draws.between(5.0, 45.0), draws.between(-180.0, 180.0));
    let (exponent, base) = (draws.log_between(4.0, 16.0), draws.between(0.1, 0.5));
    let keys = format!(
        "base_weight = {base}\nlobes = [{{ theta_deg = {tilt_deg}, phi_deg = {phi_deg}, exponent = \
         {exponent} }}]\n"
    );
    emitter("lobes", level, &keys)
}

/// A grey image of one row, from 1 - 2 slope on its left to 1 + 2 slope on its right: at the region's
/// ends a sixth of that. Finer than any footprint.
pub(in crate::study) fn ramp(slope: f64) -> Vec<u8> {
    // The middle of the region, and the places aside that are asked for, then lie in the middle of
    // a column: what is asked of a staircase is its slope.
    let columns = 4099;
    let mut text = format!("P2\n{columns} 1\n65535\n");
    for column in 0..columns {
        let part = 2.0 * (f64::from(column) + 0.5) / f64::from(columns) - 1.0;
        let value = libm::round(65535.0 * (1.0 + 2.0 * slope * part) / 1.75);
        let _ = writeln!(text, "{}", value.max(0.0));
    }
    text.into_bytes()
}

/// The rig's description with this dark current, and its scale as it shall be known.
fn rig_text(rig: &str, scale: Scale, dark_a: f64) -> String {
    let key_of = |line: &str| line.split('=').next().map_or("", str::trim).to_owned();
    let mut text = String::new();
    for line in rig.lines() {
        let key = key_of(line);
        let line = match (key.as_str(), scale) {
            ("dark_current_a", _) => format!("dark_current_a = {dark_a:e}"),
            (key, Scale::Known) if SCALE_KEYS.contains(&key) => format!("{key} = 0"),
            _ => line.to_owned(),
        };
        text.push_str(&line);
        text.push('\n');
    }
    text
}

/// Where a plan pins its basis: its last table.
const FIT: &str = "\n[fit]\n";
const IMAGE: &str = "ramp.pgm";
const TABLE: &str = "table.ies";
/// Wide enough that no beam reaches beyond it.
const OUTLINE: &str = "x_mm = [-60, 60]\ny_mm = [-60, 60]\n";
const PATCH_M2: f64 = 0.12 * 0.12;
/// Half a step between the readings' rings and more: a lamp's edges then lie anywhere between them.
const WIDER_DEG: f64 = 5.0;

const SCALE_KEYS: [&str; 5] = [
    "u_distance_mm",
    "u_pupil_diameter_mm",
    "u_spot_diameter_mm",
    "u_responsivity_relative",
    "u_relative",
];

const PLAN: &str = r#"name = "coverage"
rig = "rig.toml"
scene = "scene.toml"

[dwell]
dwell_ms = 50
gain = "10 nA"

[dark]
method = "shutter"
every = 100
dwell_ms = 200

[reference]
x_mm = 0
y_mm = 0
theta_deg = 0
phi_deg = 0
every = 100
dwell_ms = 100
"#;

#[cfg(test)]
mod tests {
    use super::super::lamp;
    use super::*;

    #[test]
    fn a_draw_repeats_and_another_differs() {
        for family in FAMILIES {
            let lamps = [lamp::tests::lamp()];
            let draw = |seed| family.draw(&mut Draws::new(seed), Scale::Known, "", &lamps);
            assert_eq!(draw(1), draw(1));
            let (one, other) = (draw(1), draw(2));
            let differ = one.scene != other.scene || one.attachments != other.attachments;
            assert!(differ, "{}", family.name());
        }
    }

    #[test]
    fn a_scale_that_is_known_has_no_uncertainty() {
        let rig = "u_distance_mm = 0.3   # so far\ndistance_mm = 300\ndark_current_a = 1\n";
        let known = rig_text(rig, Scale::Known, 2e-12);
        assert_eq!(known, "u_distance_mm = 0\ndistance_mm = 300\ndark_current_a = 2e-12\n");
        assert!(rig_text(rig, Scale::AsStated, 0.0).contains("u_distance_mm = 0.3"));
    }
}
