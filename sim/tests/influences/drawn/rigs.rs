//! Rigs with one effect each, of random size, before scenes of one patch.

use sim::{
    AxisFlaws, Drift, Emitter, EncoderError, Flicker, GainSwitching, MainsFlicker, MissedSteps,
    Nominal, NominalGain, Quantity, Region, Ringing, Scene, Shape, Simulated, SourceOverTime,
    Tabulated, Terms, Uncertain, WarmUp, compile,
};

use super::dice::Dice;
use crate::bench::exact_rig;

/// A rig and a scene with one effect to weigh.
pub(super) struct Case {
    pub(super) effect: &'static str,
    pub(super) scene: Scene,
    pub(super) nominal: Nominal,
    pub(super) simulated: Simulated,
    pub(super) terms: Terms,
    pub(super) measure: Measure,
    /// An outline across the region at this x, and how far the effect reaches, metres.
    pub(super) outline_m: Option<(f64, f64)>,
}

/// How the true influence is had.
pub(super) enum Measure {
    /// The largest over poses, of a dwell that begins at this device time, seconds.
    Poses(f64),
    /// The largest over moments that a dwell may begin at, in one pose.
    Moments,
    /// Of a dwell right after a change of range.
    Switched,
    /// The standard deviation over dwells, in one pose.
    Dwells,
    /// The root mean square over seeds, the largest over poses.
    Seeds,
    /// As `Seeds`, after all moves of the run have gone one way.
    Moved(u32),
    /// The largest over poses, each approached from both sides.
    Sides,
}

pub(super) type Draw = fn(&mut Dice) -> Case;

pub(super) const EFFECTS: [Draw; 28] = [
    stray_light,
    dark_current,
    dark_drift,
    non_linearity,
    gain_switching,
    warm_up,
    mains_flicker,
    detector_drift,
    random_walk,
    shot_noise,
    read_noise,
    flicker_noise,
    data_sheet,
    theta_zero,
    theta_homing,
    theta_scale,
    phi_zero,
    backlash,
    encoder_error,
    settling,
    ringing,
    missed_steps,
    non_orthogonality,
    wobble,
    axis_offset,
    x_zero,
    x_backlash,
    motion_smear,
];

pub(super) const REGION: Region =
    Region { x_m: (-0.02, 0.02), y_m: (-0.02, 0.02), theta_max_rad: 1.0 };
pub(super) const RATE_HZ: u32 = 2000;

/// The photocurrent of a radiance of one in the rig of the bench, amperes.
fn current_per_radiance() -> f64 {
    let scene = Scene::new(Quantity::Radiance);
    compile(scene, exact_rig(), Simulated::default(), &Terms::default())
        .unwrap()
        .current_per_radiance()
}

fn wide() -> Shape {
    Shape::rectangle(0.0, 0.0, 0.4, 0.4)
}

fn even(radiance: f64) -> Scene {
    Scene::new(Quantity::Radiance).with(Emitter::lambertian(wide(), radiance)).unwrap()
}

fn lobe(exponent: f64, radiance: f64) -> Scene {
    let emitter = Emitter::cosine_power(wide(), exponent, radiance);
    Scene::new(Quantity::Radiance).with(emitter).unwrap()
}

/// Three lobes round the normal, brighter at the side of one.
fn uneven(radiance: f64) -> Scene {
    let gamma: Vec<f64> = (0..=18).map(|i| 5.0 * f64::from(i)).collect();
    let c: Vec<f64> = (0..=24).map(|i| 15.0 * f64::from(i)).collect();
    let table = Tabulated::new(&c, &gamma, |c, gamma| {
        let lobes = 1.0 + 0.4 * (c - 70.0).to_radians().cos() + 0.3 * (3.0 * c).to_radians().sin();
        let level = 0.16 * radiance * gamma.to_radians().cos();
        level * (1.0 + gamma.to_radians().sin() * (lobes - 1.0))
    });
    Scene::new(Quantity::Radiance).with(Emitter::tabulated(wide(), table.unwrap())).unwrap()
}

/// A case with a signal of up to a quarter of full scale, and no flaw yet.
fn case(effect: &'static str, scene: Scene, radiance: f64, measure: Measure) -> Case {
    let signal_a = radiance * current_per_radiance();
    let mut nominal = exact_rig();
    nominal.detector.adc_bits = 32;
    nominal.detector.adc_rate_hz = RATE_HZ;
    nominal.detector.read_noise_a = signal_a * 1e-6;
    let full_scale_a = 4.0 * signal_a;
    nominal.detector.gains =
        vec![NominalGain { name: "only".into(), full_scale_a, u_relative: 0.0 }];
    let terms = Terms { region: Some(REGION), ..Terms::default() };
    Case {
        effect,
        scene,
        nominal,
        simulated: Simulated::default(),
        terms,
        measure,
        outline_m: None,
    }
}

fn of_even(effect: &'static str, dice: &mut Dice, measure: Measure) -> (Case, f64) {
    let radiance = dice.decades(-2.0, 3.0);
    (case(effect, even(radiance), radiance, measure), radiance * current_per_radiance())
}

fn of_lobe(effect: &'static str, dice: &mut Dice, measure: Measure) -> Case {
    let (radiance, exponent) = (dice.decades(-2.0, 3.0), dice.decades(0.0, 3.0));
    case(effect, lobe(exponent, radiance), radiance, measure)
}

fn stray_light(dice: &mut Dice) -> Case {
    let (mut case, signal_a) = of_even("stray-light", dice, Measure::Poses(0.0));
    let stray_a = signal_a * dice.decades(-7.0, 0.0);
    let flux = case.scene.flux();
    case.simulated.detector.stray_light_fraction_of_flux =
        stray_a / flux / case.nominal.detector.responsivity_a_per_w;
    case
}

fn dark_current(dice: &mut Dice) -> Case {
    let (mut case, signal_a) = of_even("dark-current", dice, Measure::Poses(0.0));
    let sign = if dice.uniform(0.0, 1.0) < 0.3 { -1.0 } else { 1.0 };
    case.simulated.dark_current_a = sign * signal_a * dice.decades(-7.0, 0.0);
    case
}

fn dark_drift(dice: &mut Dice) -> Case {
    let (mut case, signal_a) = of_even("dark-drift", dice, Measure::Poses(3600.0));
    case.simulated.dark_current_a = 0.1 * signal_a;
    case.simulated.detector.dark_drift_relative_per_h = dice.decades(-7.0, 1.0);
    case
}

fn non_linearity(dice: &mut Dice) -> Case {
    let mut case = of_lobe("non-linearity", dice, Measure::Poses(0.0));
    case.simulated.detector.non_linearity_relative_at_full_scale = dice.decades(-7.0, -0.5);
    case
}

fn gain_switching(dice: &mut Dice) -> Case {
    let (mut case, _) = of_even("gain-switching", dice, Measure::Switched);
    let full_scale_a = 3.0 * case.nominal.detector.gains[0].full_scale_a;
    let coarser = NominalGain { name: "coarser".into(), full_scale_a, u_relative: 0.0 };
    case.nominal.detector.gains.push(coarser);
    case.simulated.detector.gain_switching = Some(GainSwitching {
        step_relative: dice.decades(-7.0, -1.5),
        time_constant_s: dice.decades(-3.0, 1.0),
    });
    case
}

fn warm_up(dice: &mut Dice) -> Case {
    let (mut case, _) = of_even("warm-up", dice, Measure::Poses(0.0));
    let time_constant_s = dice.decades(-2.0, 4.0);
    let warm_up = WarmUp {
        amplitude_relative: -dice.decades(-7.0, 0.0),
        time_constant_s,
        age_s: time_constant_s * dice.uniform(0.0, 3.0),
    };
    let source = SourceOverTime { warm_up: Some(warm_up), ..SourceOverTime::default() };
    case.scene = case.scene.over_time_as(source);
    case
}

fn mains_flicker(dice: &mut Dice) -> Case {
    let (mut case, _) = of_even("mains-flicker", dice, Measure::Moments);
    let flicker = MainsFlicker {
        frequency_hz: dice.uniform(10.0, 400.0),
        depth_relative: dice.decades(-5.0, 0.0),
        phase_rad: None,
    };
    case.terms.dwell_s = dice.uniform(0.002, 0.2);
    let source = SourceOverTime { mains_flicker: Some(flicker), ..SourceOverTime::default() };
    case.scene = case.scene.over_time_as(source);
    case
}

fn detector_drift(dice: &mut Dice) -> Case {
    let (mut case, _) = of_even("detector-drift", dice, Measure::Poses(3600.0));
    case.simulated.detector.drift =
        Drift { relative_per_h: dice.decades(-7.0, -0.5), ..Drift::default() };
    case
}

fn random_walk(dice: &mut Dice) -> Case {
    let (mut case, _) = of_even("detector-drift", dice, Measure::Seeds);
    let walk = dice.decades(-6.0, -1.0);
    case.simulated.detector.drift =
        Drift { random_walk_relative_per_root_h: walk, ..Drift::default() };
    case
}

fn shot_noise(dice: &mut Dice) -> Case {
    of_even("shot-noise", dice, Measure::Dwells).0
}

fn read_noise(dice: &mut Dice) -> Case {
    let (mut case, signal_a) = of_even("read-noise", dice, Measure::Dwells);
    case.nominal.detector.read_noise_a = signal_a * dice.decades(-6.0, 0.0);
    case
}

fn flicker_noise(dice: &mut Dice) -> Case {
    let (mut case, signal_a) = of_even("flicker-noise", dice, Measure::Dwells);
    case.nominal.detector.read_noise_a = signal_a * dice.decades(-6.0, -1.0);
    let flicker =
        Flicker { corner_hz: dice.decades(-1.0, 3.0), lowest_hz: dice.decades(-3.0, 0.0) };
    case.simulated.detector.flicker = Some(flicker);
    case
}

/// One of the factors from radiance to counts.
fn data_sheet(dice: &mut Dice) -> Case {
    let names = ["responsivity", "pupil-size", "spot-size", "distance", "gain[0]"];
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below five
    let which = dice.uniform(0.0, names.len() as f64) as usize;
    let (mut case, _) = of_even(names[which], dice, Measure::Seeds);
    // Beyond some hundredths a draw is not far from zero, which is refused.
    let u = dice.decades(-7.0, -1.5);
    let detector = &mut case.nominal.detector;
    match which {
        0 => detector.u_responsivity_relative = u,
        1 => detector.u_pupil_radius_m = u * detector.pupil_radius_m,
        2 => detector.u_spot_radius_m = u * detector.spot_radius_m,
        3 => detector.u_distance_m = u * detector.distance_m,
        _ => detector.gains[0].u_relative = u,
    }
    case
}

fn theta_zero(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-zero", dice, Measure::Seeds);
    case.nominal.axes[0].u_zero = dice.decades(-8.0, -2.0);
    case
}

fn theta_homing(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-homing", dice, Measure::Seeds);
    case.nominal.axes[0].u_homing = dice.decades(-8.0, -2.0);
    case
}

fn theta_scale(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-scale", dice, Measure::Seeds);
    case.nominal.axes[0].u_readback = dice.decades(-8.0, -2.0);
    case
}

fn phi_zero(dice: &mut Dice) -> Case {
    let radiance = dice.decades(-2.0, 3.0);
    let mut case = case("phi-zero", uneven(radiance), radiance, Measure::Seeds);
    case.nominal.axes[1].u_zero = dice.decades(-7.0, -1.0);
    case
}

fn theta_flaws(case: &mut Case) -> &mut AxisFlaws {
    &mut case.simulated.axes[0]
}

fn backlash(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-backlash", dice, Measure::Sides);
    theta_flaws(&mut case).backlash = dice.decades(-7.0, -2.0);
    case
}

fn encoder_error(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-encoder-error", dice, Measure::Poses(0.0));
    theta_flaws(&mut case).encoder_error =
        Some(EncoderError { amplitude: dice.decades(-7.0, -2.0), period: dice.decades(-2.0, 0.5) });
    case
}

fn ringing(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-settle-ringing", dice, Measure::Sides);
    theta_flaws(&mut case).ringing = Some(Ringing {
        amplitude: dice.decades(-6.0, -2.0),
        frequency_hz: dice.decades(0.5, 2.0),
        damping_ratio: dice.decades(-2.0, -0.3),
    });
    case
}

/// Longer than the rig file states, which is nothing.
fn settling(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-settling", dice, Measure::Sides);
    // The axis's acceleration makes that a lag of 1e-7 to 0.2 rad.
    theta_flaws(&mut case).settle_s = Some(dice.decades(-3.0, -0.3));
    case
}

fn missed_steps(dice: &mut Dice) -> Case {
    let mut case = of_lobe("theta-missed-steps", dice, Measure::Moved(400));
    case.terms.run_s = 400.0 * case.terms.dwell_s;
    theta_flaws(&mut case).missed_steps = Some(MissedSteps {
        probability_per_move: dice.decades(-2.0, -1.0),
        counts: dice.uniform(0.5, 4.0).round(),
    });
    case
}

fn non_orthogonality(dice: &mut Dice) -> Case {
    let mut case = of_lobe("non-orthogonality", dice, Measure::Poses(0.0));
    let number = |dice: &mut Dice| Uncertain { value: dice.decades(-6.0, -2.0), u: 0.0 };
    case.simulated.misalignment.arm_axis_rad = number(dice);
    case.simulated.misalignment.beam_rad = number(dice);
    case
}

fn wobble(dice: &mut Dice) -> Case {
    let mut case = of_lobe("wobble", dice, Measure::Poses(0.0));
    let tilt = dice.decades(-6.0, -2.0);
    case.simulated.misalignment.wobble_rad = Uncertain { value: tilt, u: 0.0 };
    case
}

/// A patch that ends within the region.
fn of_outline(effect: &'static str, dice: &mut Dice, reach_m: f64, measure: Measure) -> Case {
    let radiance = dice.decades(-2.0, 3.0);
    let edge_m = dice.uniform(-0.005, 0.005);
    let shape = Shape::Rectangle { x_m: (-0.2, edge_m), y_m: (-0.2, 0.2) };
    let patch = Emitter::lambertian(shape, radiance);
    let scene = Scene::new(Quantity::Radiance).with(patch).unwrap();
    Case { outline_m: Some((edge_m, reach_m)), ..case(effect, scene, radiance, measure) }
}

fn axis_offset(dice: &mut Dice) -> Case {
    let offset_m = dice.decades(-4.0, -2.3);
    let mut case = of_outline("axis-offset", dice, offset_m, Measure::Poses(0.0));
    case.simulated.misalignment.axis_offset_m[0] = Uncertain { value: offset_m, u: 0.0 };
    case
}

fn x_zero(dice: &mut Dice) -> Case {
    let u_m = dice.decades(-4.0, -2.5);
    let mut case = of_outline("x-zero", dice, u_m, Measure::Seeds);
    case.nominal.axes[2].u_zero = u_m;
    case
}

fn x_backlash(dice: &mut Dice) -> Case {
    let play_m = dice.decades(-4.0, -2.5);
    let mut case = of_outline("x-backlash", dice, play_m, Measure::Sides);
    case.simulated.axes[2].backlash = play_m;
    case
}

fn motion_smear(dice: &mut Dice) -> Case {
    let mut case = ringing(dice);
    case.effect = "motion-smear";
    case.nominal.detector.adc_rate_hz = RATE_HZ;
    // What rings is in, however little it matters.
    case.terms.tolerance = Some(0.0);
    case
}
