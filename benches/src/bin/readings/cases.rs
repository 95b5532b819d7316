//! A bare rig, and one scene or flaw for each effect, which calls for that effect.

use benches::Unmeasured;
use sim::{
    AxisFlaws, Drift, EncoderError, Flicker, GainSwitching, Nominal, NominalAxis, NominalDetector,
    NominalGain, Quantity, Region, Ringing, Scene, Simulated, Terms, Uncertain,
};
use spanned_toml::{Document, Source};

/// Everything that a rig is compiled from.
pub(crate) struct Case {
    /// The row that is timed.
    pub(crate) effect: &'static str,
    /// What is special, where an effect has more than one price.
    pub(crate) note: &'static str,
    pub(crate) group: usize,
    pub(crate) scene: Scene,
    pub(crate) nominal: Nominal,
    pub(crate) simulated: Simulated,
}

pub(crate) const GROUPS: [&str; 4] = ["beam", "light", "detector and time", "mechanics"];
pub(crate) const MECHANICS: usize = 3;

const PATCH: &str = "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-200, 200]\ny_mm = [-200, 200]\n\
                     radiance_w_per_m2_sr = 10\n";
const LOBE: &str = "[[emitter]]\nkind = \"cosine-power\"\nexponent = 8\nx_mm = [-200, 200]\n\
                    y_mm = [-200, 200]\nradiance_w_per_m2_sr = 10\n";
const SMALL: &str = "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-3, 3]\ny_mm = [-3, 3]\n\
                     radiance_w_per_m2_sr = 10\n";
const PANEL: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.8\nx_mm = [-50, 50]\n\
                     y_mm = [-50, 50]\n";
const BALL_LAMP: &str = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [-70, 40, 400]\n\
                         radius_mm = 25\nradiance_w_per_m2_sr = 1000\n";
const DISK_LAMP: &str = "[[lamp]]\nkind = \"disk\"\ncentre_mm = [0, 0, 1000]\naxis = [0, 0, -1]\n\
                         radius_mm = 40\nradiance_w_per_m2_sr = 1000\n";
const SQUARE_LAMP: &str = "[[lamp]]\nkind = \"polygon\"\ncorners_mm = [[-40, -40, 1000], \
                           [40, -40, 1000], [40, 40, 1000], [-40, 40, 1000]]\n\
                           radiance_w_per_m2_sr = 1000\n";
const SUN: &str = "[[lamp]]\nkind = \"sun\"\ntheta_deg = 50\nphi_deg = 30\n";
const EDGE: &str = "[[occluder]]\nkind = \"half-plane\"\nx_max_mm = 0\nz_mm = 600\n";
const BALL: &str = "[[occluder]]\nkind = \"sphere\"\ncentre_mm = [30, 0, 100]\nradius_mm = 5\n";
const WINDOW: &str = "[[window]]\nz_mm = 20\nthickness_mm = 3\nindex = 1.5\n\
                      absorption_per_mm = 0.001\nbelongs_to = \"beam\"\n";
const WARMING: &str = "[source.warm_up]\namplitude_relative = -0.05\ntime_constant_s = 600\n";
const FLICKERING: &str = "[source.mains_flicker]\nfrequency_hz = 97\ndepth_relative = 0.1\n";

/// Tolerates nothing; the beam and the noise that every rig has are in where they are asked for.
pub(crate) fn terms(effect: &str) -> Terms {
    let others = ["finite-beam", "shot-noise"].into_iter().filter(|name| *name != effect);
    let without = others.map(str::to_owned).collect();
    let side = (-0.01, 0.01);
    let region = Some(Region { x_m: side, y_m: side, theta_max_rad: 1.0 });
    let force = if effect.is_empty() { Vec::new() } else { vec![effect.to_owned()] };
    Terms { region, tolerance: Some(1e-4), force, without, ..Terms::default() }
}

fn scene(text: &str) -> Result<Scene, Unmeasured> {
    let document = Document::parse(Source::new("scene.toml", text));
    let document = document.map_err(|e| Unmeasured::because(e.to_string()))?;
    let load = |name: &str| Err(format!("{name}: no file is looked for here"));
    Scene::read(&document, Quantity::Radiance, &load)
        .map_err(|e| Unmeasured::because(e.to_string()))
}

fn of(
    effect: &'static str,
    note: &'static str,
    group: usize,
    text: &str,
) -> Result<Case, Unmeasured> {
    let (nominal, simulated) = (rig(), Simulated::default());
    Ok(Case { effect, note, group, scene: scene(text)?, nominal, simulated })
}

/// A Lambertian patch, a point beam, no noise.
pub(crate) fn bare() -> Result<Case, Unmeasured> {
    of("", "", 0, PATCH)
}

/// The same patch, and every flaw of detector and source.
pub(crate) fn flawed() -> Result<Case, Unmeasured> {
    let mut case = of("", "", 0, &format!("{PATCH}{WARMING}{FLICKERING}"))?;
    case.nominal.detector.read_noise_a = 1e-12;
    for (_, flaw) in FLAWS {
        flaw(&mut case.simulated);
    }
    Ok(case)
}

/// A name, and what makes it be called for.
type Flaw = (&'static str, fn(&mut Simulated));

const FLAWS: [Flaw; 6] = [
    ("dark-current", |rig| rig.dark_current_a = 1e-11),
    ("non-linearity", |rig| rig.detector.non_linearity_relative_at_full_scale = 0.01),
    ("stray-light", |rig| rig.detector.stray_light_fraction_of_flux = 1e-6),
    ("gain-switching", |rig| {
        let (step_relative, time_constant_s) = (0.01, 10.0);
        rig.detector.gain_switching = Some(GainSwitching { step_relative, time_constant_s });
    }),
    ("detector-drift", |rig| {
        rig.detector.drift = Drift { relative_per_h: 0.1, ..Drift::default() };
    }),
    ("flicker-noise", |rig| {
        rig.detector.flicker = Some(Flicker { corner_hz: 100.0, lowest_hz: 0.01 });
    }),
];

const MISFITS: [Flaw; 5] = [
    ("non-orthogonality", |rig| {
        rig.misalignment.arm_axis_rad = Uncertain { value: 0.01, u: 0.0 };
    }),
    ("wobble", |rig| rig.misalignment.wobble_rad = Uncertain { value: 0.01, u: 0.0 }),
    ("theta-backlash", |rig| {
        rig.axes[0] = AxisFlaws { backlash: 1e-3, ..AxisFlaws::default() };
    }),
    ("theta-encoder-error", |rig| {
        rig.axes[0].encoder_error = Some(EncoderError { amplitude: 1e-3, period: 0.1 });
    }),
    ("theta-settle-ringing", |rig| {
        let ringing = Ringing { amplitude: 1e-2, frequency_hz: 20.0, damping_ratio: 0.05 };
        rig.axes[0].ringing = Some(ringing);
    }),
];

/// One case for each effect and price.
pub(crate) fn all() -> Result<Vec<Case>, Unmeasured> {
    let mut cases = Vec::new();
    for (effect, note, group, text) in [
        ("finite-beam", "filled by a cos^8 patch", 0, LOBE.to_owned()),
        ("finite-beam", "across an outline", 0, SMALL.to_owned()),
        ("finite-beam", "over a penumbra", 0, format!("{PANEL}{DISK_LAMP}{EDGE}")),
        ("lamp[0]", "sphere", 1, format!("{PANEL}{BALL_LAMP}")),
        ("lamp[0]", "disk", 1, format!("{PANEL}{DISK_LAMP}")),
        ("lamp[0]", "polygon", 1, format!("{PANEL}{SQUARE_LAMP}")),
        ("lamp[0]", "sun", 1, format!("{PANEL}{SUN}")),
        ("shadow[0]", "disk behind an edge", 1, format!("{PANEL}{DISK_LAMP}{EDGE}")),
        ("shadow[0]", "square behind an edge", 1, format!("{PANEL}{SQUARE_LAMP}{EDGE}")),
        ("beam-shadow[0]", "ball", 1, format!("{PATCH}{BALL}")),
        ("window[0]", "of the beam", 1, format!("{PATCH}{WINDOW}")),
        ("warm-up", "", 2, format!("{PATCH}{WARMING}")),
        ("mains-flicker", "", 2, format!("{PATCH}{FLICKERING}")),
        ("shot-noise", "", 2, PATCH.to_owned()),
    ] {
        cases.push(of(effect, note, group, &text)?);
    }
    let mut read = of("read-noise", "", 2, PATCH)?;
    read.nominal.detector.read_noise_a = 1e-12;
    cases.push(read);
    for (effect, flaw) in FLAWS {
        let mut case = of(effect, "", 2, PATCH)?;
        flaw(&mut case.simulated);
        case.nominal.detector.read_noise_a = 1e-12;
        cases.push(case);
    }
    for (effect, flaw) in MISFITS {
        let mut case = of(effect, "", MECHANICS, LOBE)?;
        flaw(&mut case.simulated);
        cases.push(case);
    }
    Ok(cases)
}

/// A rig without any uncertainty and without noise but what nature adds.
fn rig() -> Nominal {
    const COUNTS_PER_RAD: f64 = 400.0 * 180.0 / core::f64::consts::PI;
    let axis = |channel, counts_per_unit: f64, travel: i32| NominalAxis {
        channel,
        home: 0.0,
        counts_per_unit,
        travel_counts: (-travel, travel),
        speed_counts_per_s: 24_000,
        acceleration_counts_per_s2: 48_000,
        settle_s: 0.0,
        has_encoder: true,
        u_zero: 0.0,
        u_homing: 0.0,
        u_readback: 0.0,
    };
    let gain = |(name, full_scale_a): (&str, f64)| NominalGain {
        name: name.to_owned(),
        full_scale_a,
        u_relative: 0.0,
    };
    Nominal {
        quantity: Quantity::Radiance,
        axes: [
            axis(0, COUNTS_PER_RAD, 38_000),
            axis(1, COUNTS_PER_RAD, 72_000),
            axis(2, 200_000.0, 10_000),
            axis(3, 200_000.0, 10_000),
        ],
        detector: NominalDetector {
            distance_m: 0.3,
            u_distance_m: 0.0,
            pupil_radius_m: 0.006_25,
            u_pupil_radius_m: 0.0,
            spot_radius_m: 0.002_5,
            u_spot_radius_m: 0.0,
            responsivity_a_per_w: 0.2,
            u_responsivity_relative: 0.0,
            read_noise_a: 0.0,
            gains: [("1 uA", 1e-6), ("10 uA", 1e-5)].map(gain).to_vec(),
            adc_bits: 24,
            adc_rate_hz: 2000,
        },
    }
}
