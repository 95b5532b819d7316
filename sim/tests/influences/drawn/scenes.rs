//! Random scenes, each with one effect of light whose influence is spread over eight decades, and
//! the search for its true influence.

use core::f64::consts::PI;
use std::fmt::Write as _;

use glam::DVec3;
use sim::{Axis, Compiled, Nominal, Quantity, Ray, Region, Scene, Simulated, Terms, compile};
use spanned_toml::{Document, Source};

use super::Weighed;
use super::dice::Dice;
use crate::bench::exact_rig;

/// A scene and the effect that is weighed in it.
pub(super) struct Case {
    pub(super) effect: &'static str,
    pub(super) scene: String,
    /// Axes at which the effect is likely to be the strongest: x and y in mm, θ and φ in radians.
    likely: Vec<[f64; 4]>,
    has_beam: bool,
}

const HALF_MM: f64 = 10.0;
const THETA_MAX: f64 = 1.0;
const PANEL: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.8\nx_mm = [-50, 50]\n\
                     y_mm = [-50, 50]\n";

pub(super) type Draw = fn(&mut Dice) -> Case;

/// Shadows are tried twice: of a disk and of a ball.
pub(super) const EFFECTS: [Draw; 14] = [
    weak_lamp,
    shadow,
    shadow,
    gloss,
    window,
    lamp_in_beam,
    beam_shadow,
    finite_beam,
    beam_over_a_panel,
    beam_past_a_ball,
    interreflection,
    gloss_under_a_sky,
    shadow_under_a_sky,
    window_over_a_lit_panel,
];

fn case(effect: &'static str, scene: String) -> Case {
    Case { effect, scene, likely: Vec::new(), has_beam: false }
}

/// Beside a strong one.
fn weak_lamp(dice: &mut Dice) -> Case {
    let mut scene = PANEL.to_owned();
    for radiance in [100.0, 100.0 * dice.decades(-8.0, 0.0)] {
        let (x, y) = (dice.uniform(-100.0, 100.0), dice.uniform(-100.0, 100.0));
        let (z, r) = (dice.uniform(350.0, 600.0), dice.uniform(5.0, 40.0));
        // Apart from each other, whatever is drawn.
        let y = if radiance < 100.0 { y + 300.0 } else { y };
        let _ = write!(
            scene,
            "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [{x}, {y}, {z}]\nradius_mm = {r}\n\
             radiance_w_per_m2_sr = {radiance}\n"
        );
    }
    case("lamp[1]", scene)
}

/// Of a ball before a disk or a ball, from next to nothing to all of it.
fn shadow(dice: &mut Dice) -> Case {
    let lamp = DVec3::new(dice.uniform(-80.0, 80.0), dice.uniform(-80.0, 80.0), 900.0);
    let (radius, height) = (dice.uniform(10.0, 40.0), dice.uniform(400.0, 700.0));
    let place = DVec3::new(dice.uniform(-8.0, 8.0), dice.uniform(-8.0, 8.0), 0.0);
    let part = height / lamp.z;
    let centre = place + (lamp - place) * part;
    let ball = radius * part * dice.decades(-4.0, 0.2);
    let kind = if dice.uniform(0.0, 1.0) < 0.5 {
        "kind = \"disk\"\naxis = [0, 0, -1]"
    } else {
        "kind = \"sphere\""
    };
    let scene = format!(
        "{PANEL}[[lamp]]\n{kind}\ncentre_mm = [{}, {}, {}]\nradius_mm = {radius}\n\
         radiance_w_per_m2_sr = 100\n\
         [[occluder]]\nkind = \"sphere\"\ncentre_mm = [{}, {}, {}]\nradius_mm = {ball}\n",
        lamp.x, lamp.y, lamp.z, centre.x, centre.y, centre.z
    );
    // Where the ball's middle is before some place of the lamp.
    let mut likely = vec![[place.x, place.y, 0.0, 0.0]];
    for _ in 0..60 {
        let (along, turn) = (radius * dice.uniform(0.0, 1.0).sqrt(), dice.uniform(-PI, PI));
        let shining = lamp + DVec3::new(along * turn.cos(), along * turn.sin(), 0.0);
        let away = centre - shining;
        let foot = shining - away * (shining.z / away.z);
        likely.push([foot.x, foot.y, 0.0, 0.0]);
    }
    Case { likely, ..case("shadow[0]", scene) }
}

/// From a gleam to a mirror, of a lamp whose image is seen from the region.
fn gloss(dice: &mut Dice) -> Case {
    let (gloss, exponent) = (dice.decades(-8.0, -0.35), dice.decades(-1.0, 3.0));
    let (x, y) = (dice.uniform(-150.0, 150.0), dice.uniform(-150.0, 150.0));
    let (z, r) = (dice.uniform(350.0, 600.0), dice.uniform(5.0, 40.0));
    let scene = format!(
        "[[surface]]\nkind = \"glossy\"\nalbedo = 0.5\ngloss = {gloss}\nexponent = {exponent}\n\
         x_mm = [-50, 50]\ny_mm = [-50, 50]\n\
         [[lamp]]\nkind = \"sphere\"\ncentre_mm = [{x}, {y}, {z}]\nradius_mm = {r}\n\
         radiance_w_per_m2_sr = 100\n"
    );
    let corners =
        [-HALF_MM, 0.0, HALF_MM].into_iter().flat_map(|x| [-HALF_MM, HALF_MM].map(|y| [x, y]));
    let image = |[at_x, at_y]: [f64; 2]| {
        let away = DVec3::new(x - at_x, y - at_y, z);
        let theta = (away.truncate().length() / z).atan();
        [at_x, at_y, theta, (-away.y).atan2(-away.x)]
    };
    Case { likely: corners.map(image).collect(), ..case("gloss[0]", scene) }
}

fn window(dice: &mut Dice) -> Case {
    let (index, absorption) = (1.0 + dice.decades(-5.0, -0.1), dice.decades(-9.0, -1.0));
    let (thickness, exponent) = (dice.uniform(1.0, 6.0), dice.uniform(0.0, 4.0));
    let scene = format!(
        "[[emitter]]\nkind = \"cosine-power\"\nexponent = {exponent}\nx_mm = [-90, 90]\n\
         y_mm = [-90, 90]\nradiance_w_per_m2_sr = 10\n\
         [[window]]\nz_mm = 5\nthickness_mm = {thickness}\nindex = {index}\n\
         absorption_per_mm = {absorption}\nbelongs_to = \"beam\"\n"
    );
    let likely = (0..8).map(|k| [0.0, 0.0, THETA_MAX, f64::from(k) - PI]).collect();
    Case { likely, ..case("window[0]", scene) }
}

/// Nearly as bright as what it hides.
fn lamp_in_beam(dice: &mut Dice) -> Case {
    let radiance = 10.0 * (1.0 + dice.decades(-8.0, 0.5));
    let (x, y, z) = (dice.uniform(-60.0, 60.0), dice.uniform(-60.0, 60.0), 150.0);
    let radius = dice.uniform(3.0, 20.0);
    let scene = format!(
        "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-90, 90]\ny_mm = [-90, 90]\n\
         radiance_w_per_m2_sr = 10\n\
         [[lamp]]\nkind = \"sphere\"\ncentre_mm = [{x}, {y}, {z}]\nradius_mm = {radius}\n\
         radiance_w_per_m2_sr = {radiance}\n"
    );
    let away = DVec3::new(x, y, z);
    let (theta, phi) = ((away.truncate().length() / z).atan(), y.atan2(x));
    Case { likely: vec![[0.0, 0.0, theta, phi]], ..case("lamp-in-beam[0]", scene) }
}

/// Of a ball of some millimetres between sample and detector: where it hides the sample, all.
fn beam_shadow(dice: &mut Dice) -> Case {
    let (x, y, z) = (dice.uniform(-60.0, 60.0), dice.uniform(-60.0, 60.0), 150.0);
    let radius = dice.decades(0.0, 1.3);
    let scene = format!(
        "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-90, 90]\ny_mm = [-90, 90]\n\
         radiance_w_per_m2_sr = 10\n\
         [[occluder]]\nkind = \"sphere\"\ncentre_mm = [{x}, {y}, {z}]\nradius_mm = {radius}\n"
    );
    let away = DVec3::new(x, y, z);
    let (theta, phi) = ((away.truncate().length() / z).atan(), y.atan2(x));
    Case { likely: vec![[0.0, 0.0, theta, phi]], ..case("beam-shadow[0]", scene) }
}

/// Over a lobe that is hardly one, or is steep; and near an outline.
fn finite_beam(dice: &mut Dice) -> Case {
    let exponent = dice.decades(-6.0, 2.0);
    let half = if dice.uniform(0.0, 1.0) < 0.5 { 90.0 } else { dice.uniform(11.0, 30.0) };
    let scene = format!(
        "[[emitter]]\nkind = \"cosine-power\"\nexponent = {exponent}\nx_mm = [-{half}, {half}]\n\
         y_mm = [-{half}, {half}]\nradiance_w_per_m2_sr = 10\n"
    );
    let mut likely = Vec::new();
    for corner in [[-HALF_MM, 0.0], [HALF_MM, HALF_MM], [0.0, -HALF_MM], [HALF_MM, 0.0]] {
        likely.extend((0..8).map(|k| [corner[0], corner[1], THETA_MAX, f64::from(k) * PI / 4.0]));
    }
    Case { likely, has_beam: true, ..case("finite-beam", scene) }
}

/// Over a panel that a lamp lights nearly evenly, or that lies in the penumbra of an edge.
fn beam_over_a_panel(dice: &mut Dice) -> Case {
    let height = 1000.0 * dice.decades(0.0, 2.0);
    let radius = height * dice.uniform(0.02, 0.05);
    let mut scene = format!(
        "{PANEL}[[lamp]]\nkind = \"sphere\"\ncentre_mm = [{}, 0, {height}]\nradius_mm = {radius}\n\
         radiance_w_per_m2_sr = 1000\n",
        dice.uniform(-50.0, 50.0)
    );
    if dice.uniform(0.0, 1.0) < 0.5 {
        let edge = dice.uniform(-4.0, 4.0);
        let _ =
            write!(scene, "[[occluder]]\nkind = \"half-plane\"\nx_max_mm = {edge}\nz_mm = 450\n");
    }
    let mut likely = Vec::new();
    for corner in [[-HALF_MM, -HALF_MM], [HALF_MM, HALF_MM], [-HALF_MM, HALF_MM], [HALF_MM, 0.0]] {
        likely.extend((0..8).map(|k| [corner[0], corner[1], THETA_MAX, f64::from(k) * PI / 4.0]));
    }
    Case { likely, has_beam: true, ..case("finite-beam", scene) }
}

/// Nearly as bright as what is behind it.
fn beam_past_a_ball(dice: &mut Dice) -> Case {
    let radiance = 10.0 * (1.0 + dice.decades(-8.0, 0.5));
    let (x, y, z) = (dice.uniform(-40.0, 40.0), dice.uniform(-40.0, 40.0), 120.0);
    let radius = dice.uniform(2.0, 20.0);
    let scene = format!(
        "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-90, 90]\ny_mm = [-90, 90]\n\
         radiance_w_per_m2_sr = 10\n\
         [[emitter]]\nkind = \"lambertian\"\ncentre_mm = [{x}, {y}, {z}]\nradius_mm = {radius}\n\
         radiance_w_per_m2_sr = {radiance}\n"
    );
    let limb = |k: u32| {
        let turn = f64::from(k) * PI / 8.0;
        let (x, y) = (x + radius * turn.cos(), y + radius * turn.sin());
        [0.0, 0.0, (x.hypot(y) / z).atan(), y.atan2(x)]
    };
    Case { likely: (0..16).map(limb).collect(), has_beam: true, ..case("finite-beam", scene) }
}

/// Of a wall beside the region, from nearly black to bright, that a lamp lights.
fn interreflection(dice: &mut Dice) -> Case {
    let (albedo, x) = (dice.decades(-7.0, -0.05), dice.uniform(11.0, 30.0));
    let (high, lamp_x) = (dice.uniform(5.0, 40.0), dice.uniform(-200.0, -60.0));
    let scene = format!(
        "{PANEL}[[surface]]\nkind = \"lambertian\"\nalbedo = {albedo}\n\
         corners_mm = [[{x}, 40, 0], [{x}, -40, 0], [{x}, -40, {high}], [{x}, 40, {high}]]\n\
         [[lamp]]\nkind = \"sphere\"\ncentre_mm = [{lamp_x}, 0, 400]\nradius_mm = 20\n\
         radiance_w_per_m2_sr = 100\n"
    );
    let likely = [-6.0, 0.0, 6.0].map(|y| [HALF_MM, y, 0.0, 0.0]).to_vec();
    Case { likely, ..case("interreflection", scene) }
}

/// Of a sky of a few pixels, from a gleam to a mirror.
fn gloss_under_a_sky(dice: &mut Dice) -> Case {
    let (gloss, exponent) = (dice.decades(-8.0, -0.35), dice.decades(-1.0, 2.0));
    let scene = format!(
        "[[surface]]\nkind = \"glossy\"\nalbedo = 0.5\ngloss = {gloss}\nexponent = {exponent}\n\
         x_mm = [-50, 50]\ny_mm = [-50, 50]\n\
         [[lamp]]\nkind = \"environment\"\nfile = \"sky.pgm\"\nradiance_w_per_m2_sr = 10\n"
    );
    case("gloss[0]", scene)
}

/// Of a ball above the region, as small as a grain.
fn shadow_under_a_sky(dice: &mut Dice) -> Case {
    let place = [dice.uniform(-8.0, 8.0), dice.uniform(-8.0, 8.0)];
    let (z, radius) = (dice.uniform(320.0, 500.0), 100.0 * dice.decades(-3.5, 0.0));
    let scene = format!(
        "{PANEL}[[lamp]]\nkind = \"environment\"\nfile = \"sky.pgm\"\nradiance_w_per_m2_sr = 10\n\
         [[occluder]]\nkind = \"sphere\"\ncentre_mm = [{}, {}, {z}]\nradius_mm = {radius}\n",
        place[0], place[1]
    );
    let likely = vec![[place[0], place[1], 0.0, 0.0]];
    Case { likely, ..case("shadow[0]", scene) }
}

/// Of the sample, over a panel that a disk or the sky lights.
fn window_over_a_lit_panel(dice: &mut Dice) -> Case {
    let (index, absorption) = (1.0 + dice.decades(-5.0, -0.1), dice.decades(-9.0, -1.0));
    let (z, thickness) = (dice.uniform(5.0, 30.0), dice.uniform(1.0, 6.0));
    let lamp = if dice.uniform(0.0, 1.0) < 0.5 {
        let (x, r) = (dice.uniform(-200.0, 200.0), dice.uniform(10.0, 50.0));
        format!("kind = \"disk\"\ncentre_mm = [{x}, 0, 400]\naxis = [0, 0, -1]\nradius_mm = {r}\n")
    } else {
        "kind = \"environment\"\nfile = \"sky.pgm\"\n".to_owned()
    };
    let scene = format!(
        "{PANEL}[[lamp]]\n{lamp}radiance_w_per_m2_sr = 10\n\
         [[window]]\nz_mm = {z}\nthickness_mm = {thickness}\nindex = {index}\n\
         absorption_per_mm = {absorption}\nbelongs_to = \"sample\"\n"
    );
    let likely = (0..8).map(|k| [0.0, 0.0, THETA_MAX, f64::from(k) - PI]).collect();
    Case { likely, ..case("window[0]", scene) }
}

fn read(text: &str) -> Scene {
    let document = Document::parse(Source::new("scene.toml", text)).unwrap();
    let load = |name: &str| match name {
        "sky.pgm" => Ok(b"P2 4 4 9\n4 1 0 9 1 2 3 1 0 0 0 0 0 0 0 0\n".to_vec()),
        _ => Err("no such file".to_owned()),
    };
    Scene::read(&document, Quantity::Radiance, &load).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// One range, whose counts alone are the noise floor.
fn rig() -> Nominal {
    let mut nominal = exact_rig();
    nominal.detector.adc_bits = 32;
    nominal.detector.gains.truncate(1);
    nominal
}

/// The standard deviation of a dwell's mean in the dark, amperes.
fn floor_a(nominal: &Nominal) -> f64 {
    let (detector, dwell_s) = (&nominal.detector, Terms::default().dwell_s);
    let count_a = detector.gains[0].full_scale_a / 2.0_f64.powi(31);
    count_a / (12.0 * dwell_s * f64::from(detector.adc_rate_hz)).sqrt()
}

impl Case {
    /// With the effect forced in, and the same rig without it.
    fn compiled(&self, nominal: &Nominal) -> (Compiled, Compiled) {
        let side = (-HALF_MM * 1e-3, HALF_MM * 1e-3);
        let region = Region { x_m: side, y_m: side, theta_max_rad: THETA_MAX };
        let mut terms = Terms { region: Some(region), tolerance: Some(1e-9), ..Terms::default() };
        if !self.has_beam {
            terms.without.push("finite-beam".into());
        }
        let mut less = terms.clone();
        terms.force.push(self.effect.into());
        less.without.push(self.effect.into());
        let compiled = |terms| {
            compile(read(&self.scene), nominal.clone(), Simulated::default(), terms)
                .unwrap_or_else(|e| panic!("{e}\n{}", self.scene))
        };
        (compiled(&terms), compiled(&less))
    }

    /// The bound of its row, and the largest influence that a search finds.
    pub(super) fn weighed(&self, dice: &mut Dice) -> Weighed {
        let nominal = rig();
        let (with, without) = self.compiled(&nominal);
        let floor = floor_a(&nominal) / with.current_per_radiance();
        let row = with.effects().iter().find(|row| row.name == self.effect).expect("a row");
        assert!(row.included && row.cause.is_some(), "{row:?}");
        let bound = row.bound.expect("a bound").value;
        let influence = |at: &[f64; 4]| {
            let ray = Ray::new(at[0] * 1e-3, at[1] * 1e-3, at[2], at[3]);
            let axis = Axis { spot: ray.point, direction: ray.direction };
            let (a, b) = (with.seen_radiance(&axis), without.seen_radiance(&axis));
            (a - b).abs() / a.max(b).max(floor)
        };
        Weighed {
            effect: self.effect.to_owned(),
            bound,
            found: self.search(&influence, dice),
            chance: 1.0 + 1e-9,
            // Rounding.
            seen: 1e-9,
        }
    }

    /// At the likely places, at random ones, and uphill from the best of them.
    fn search(&self, influence: &dyn Fn(&[f64; 4]) -> f64, dice: &mut Dice) -> f64 {
        let within = |at: [f64; 4]| {
            let side = |x: f64| x.clamp(-HALF_MM, HALF_MM);
            [side(at[0]), side(at[1]), at[2].clamp(0.0, THETA_MAX), at[3]]
        };
        let mut tried: Vec<(f64, [f64; 4])> = Vec::new();
        let random = (0..400).map(|_| {
            let (x, y) = (dice.uniform(-HALF_MM, HALF_MM), dice.uniform(-HALF_MM, HALF_MM));
            [x, y, THETA_MAX * dice.uniform(0.0, 1.0).sqrt(), dice.uniform(-PI, PI)]
        });
        for at in self.likely.iter().copied().map(within).chain(random) {
            tried.push((influence(&at), at));
        }
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best = tried[0];
        for (mut value, mut at) in tried.into_iter().take(3) {
            let mut step = 0.2;
            for _ in 0..120 {
                let mut next = at;
                for (k, span) in [2.0 * HALF_MM, 2.0 * HALF_MM, THETA_MAX, PI].iter().enumerate() {
                    next[k] += step * span * dice.uniform(-1.0, 1.0);
                }
                let next = within(next);
                let found = influence(&next);
                if found > value {
                    (value, at) = (found, next);
                } else {
                    step = (step * 0.93).max(1e-6);
                }
            }
            if value > best.0 {
                best = (value, at);
            }
        }
        best.0
    }
}
