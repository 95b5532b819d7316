//! What could break: a scene of lamps, surfaces, occluders and windows that is misread, or refused
//! without saying where and why.

use core::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use sim::{Body, LampSource, Law, Quantity, Scene, Solid, WindowOwner};
use spanned_toml::{Document, Source};

fn read_for(quantity: Quantity, text: &str) -> Result<Scene, String> {
    let document = Document::parse(Source::new("scene.toml", text)).map_err(|e| e.to_string())?;
    let load = |name: &str| match name {
        "image.pgm" => Ok(b"P2 2 2 4\n0 1\n2 4\n".to_vec()),
        "short.pgm" => Ok(b"P2 2 2 4\n0 1\n2".to_vec()),
        "dark.pgm" => Ok(b"P2 1 1 4\n0\n".to_vec()),
        "large.pgm" => Ok(b"P5 20000 20000 255\n".to_vec()),
        _ => Err(format!("{name}: no such file")),
    };
    Scene::read(&document, quantity, &load).map_err(|e| e.to_string())
}

fn read(text: &str) -> Result<Scene, String> {
    read_for(Quantity::Radiance, text)
}

const PANEL: &str = "[[surface]]\nkind = \"lambertian\"\nalbedo = 0.5\nx_mm = [-10, 10]\n\
                     y_mm = [-10, 10]\n";
const LAMP: &str = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [0, 0, 300]\nradius_mm = 20\n\
                    radiance_w_per_m2_sr = 100\n";

#[test]
fn every_body_and_law_is_read_in_its_units() {
    let scene = read(
        "[[emitter]]\nkind = \"batwing\"\ncorners_mm = [[0, 0], [2, 0], [0, 2]]\n\
         peak_theta_deg = 40\nvalley = 0.25\nradiance_w_per_m2_sr = 8\n\
         [[emitter]]\nkind = \"lobes\"\nradius_mm = 1\ncentre_mm = [10, 0]\nexitance_w_per_m2 = 3\n\
         lobes = [{ theta_deg = 30, phi_deg = 90, exponent = 40 }, { theta_deg = 0, width_deg = 60, \
         weight = 0.5 }]\n\
         [[emitter]]\nkind = \"lambertian\"\ncentre_mm = [30, 0, 10]\nradius_mm = 5\nflux_w = 2\n\
         [[emitter]]\nkind = \"image\"\nfile = \"image.pgm\"\nx_mm = [-30, -10]\ny_mm = [0, 10]\n\
         flux_w = 7\n\
         [[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 1\n\
         corners_mm = [[50, 0, 0], [50, 5, 0], [50, 5, 5], [50, 0, 5]]\n",
    )
    .unwrap();
    let [batwing, lobes, ball, image, wall] = scene.emitters() else { panic!("{scene:?}") };
    let (peak, theta, _) = batwing.peak_within(FRAC_PI_2).unwrap();
    assert!((peak - 8.0).abs() < 1e-12 && (theta.to_degrees() - 40.0).abs() < 1e-12);
    assert!((batwing.radiance(0.0, 0.0) - 2.0).abs() < 1e-12);
    assert!((batwing.body().area_m2() - 2e-6).abs() < 1e-20);
    assert!((lobes.exitance_within(FRAC_PI_2) - 3.0).abs() < 1e-10);
    let Law::Lobes(of) = lobes.law() else { panic!("{lobes:?}") };
    // Half its peak at half its full width.
    let half = 30f64.to_radians().cos().powf(of.lobes()[1].exponent);
    assert!((half - 0.5).abs() < 1e-12);
    assert!((of.lobes()[0].axis - DVec3::new(0.0, 0.5, 0.75f64.sqrt())).length() < 1e-15);
    // L = Φ / (π 4π r²).
    let expected = 2.0 / (4.0 * PI * PI * 25e-6);
    assert!((ball.level() / expected - 1.0).abs() < 1e-14);
    let flux = image.area_within_m2((-1.0, 1.0), (-1.0, 1.0)) * image.exitance_within(FRAC_PI_2);
    assert!((flux - 7.0).abs() < 1e-13, "{flux}");
    // The last pixel of the last row: lowest y, highest x; 4 of the sum of 7, of a quarter.
    let found = scene.radiance(-0.012, 0.001, 0.3, 0.0);
    let expected = 7.0 * (4.0 / 7.0) / (PI * 2e-4 / 4.0);
    assert!((found / expected - 1.0).abs() < 1e-13, "{found} {expected}");
    assert!(matches!(wall.body(), Body::Raised(Solid::Polygon(_))));
}

#[test]
fn lamps_occluders_and_windows_are_read_in_their_units() {
    let text = format!(
        "{PANEL}[[lamp]]\nkind = \"sun\"\ntheta_deg = 60\nphi_deg = 90\n\
         [[lamp]]\nkind = \"environment\"\nfile = \"image.pgm\"\nradiance_w_per_m2_sr = 4\n\
         [[lamp]]\nkind = \"disk\"\ncentre_mm = [0, 0, 200]\naxis = [0, 0, -2]\nradius_mm = 5\n\
         exitance_w_per_m2 = 6\n\
         [[occluder]]\nkind = \"half-plane\"\nx_max_mm = -3\nz_mm = 50\n\
         [[window]]\nz_mm = 60\nthickness_mm = 4\nindex = 1.5\nabsorption_per_mm = 0.01\n\
         belongs_to = \"sample\"\n"
    );
    let scene = read(&text).unwrap();
    let [sun, sky, disk] = scene.lamps() else { panic!("{scene:?}") };
    let LampSource::Distant { towards, half_angle_rad } = sun.source() else { panic!("{sun:?}") };
    assert!((*towards - DVec3::new(0.0, 0.75f64.sqrt(), 0.5)).length() < 1e-15);
    assert!((half_angle_rad.to_degrees() - 0.25).abs() < 1e-15);
    // The lecture's Sun.
    assert!((sun.radiance() / 2.262_121_500_238_614e7 - 1.0).abs() < 1e-14);
    assert_eq!(sky.kind(), "environment");
    assert!((disk.radiance() - 6.0 / PI).abs() < 1e-15);
    assert_eq!(scene.occluders().len(), 1);
    let window = scene.windows()[0];
    assert!((window.absorption_per_m - 10.0).abs() < 1e-12 && (window.z_m - 0.06).abs() < 1e-15);
    assert_eq!(window.belongs_to, WindowOwner::Sample);
    let lux = "[[lamp]]\nkind = \"sun\"\ntheta_deg = 0\nilluminance_lx = 1e5\n";
    let refused = read(&format!("{PANEL}{lux}")).unwrap_err();
    assert!(refused.contains("calibrated for radiance"), "{refused}");
    assert!(read_for(Quantity::Luminance, &format!("{PANEL}{lux}")).is_ok());
}

/// Text, place and reason.
type Mistake = (String, &'static str, &'static str);

fn all_refused(cases: &[Mistake]) {
    for (text, place, why) in cases {
        let problem = read(text).expect_err(text);
        assert!(problem.contains(place) && problem.contains(why), "{text}\n{problem}");
    }
}

#[test]
fn mistakes_of_emitters_are_refused_with_their_place() {
    let ball = "[[emitter]]\nkind = \"lambertian\"\nradiance_w_per_m2_sr = 1\n";
    let image = "[[emitter]]\nkind = \"image\"\nx_mm = [0, 1]\ny_mm = [0, 1]\n\
                 radiance_w_per_m2_sr = 1\n";
    let lobes = "[[emitter]]\nkind = \"lobes\"\nradius_mm = 1\nradiance_w_per_m2_sr = 1\n";
    all_refused(&[
        (
            format!("{ball}radius_mm = 5\ncentre_mm = [0, 0, 3]\n"),
            "scene.toml:4",
            "below the sample",
        ),
        (
            format!("{ball}corners_mm = [[0, 0, 0], [1, 0, 0], [1, 1, -1], [0, 1, -1]]\n"),
            "scene.toml:4",
            "below the sample",
        ),
        (
            format!("{ball}corners_mm = [[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]]\n"),
            "scene.toml:4:14",
            "plane",
        ),
        (
            format!("{ball}corners_mm = [[0, 0], [1, 1], [1, 0], [0, 1]]\n"),
            "scene.toml:4:14",
            "cross",
        ),
        (
            format!("{ball}corners_mm = [[0, 0], [1, 1, 1], [1, 0]]\n"),
            "scene.toml:4:14",
            "some none",
        ),
        (format!("{ball}corners_mm = [[0, 0], [1]]\n"), "scene.toml:4:14", "3 to 256 lists"),
        (
            format!("{ball}corners_mm = [[0, 0], [1, 0], [0, 1]]\nradius_mm = 1\n"),
            "scene.toml:4",
            "a polygon and a disk",
        ),
        (format!("{ball}flux_w = 2\nradius_mm = 1\n"), "scene.toml:4", "stated twice"),
        (format!("{image}file = \"missing.pgm\"\n"), "scene.toml:6:8", "no such file"),
        (format!("{image}file = \"short.pgm\"\n"), "scene.toml:6:8", "3 of 4 pixels"),
        (format!("{image}file = \"large.pgm\"\n"), "scene.toml:6:8", "at most 16777216"),
        (
            "[[emitter]]\nkind = \"image\"\nx_mm = [0, 1]\ny_mm = [0, 1]\nflux_w = 1\n\
             file = \"dark.pgm\"\n"
                .into(),
            "scene.toml:5",
            "nothing emits",
        ),
        (
            "[[emitter]]\nkind = \"image\"\nradius_mm = 3\nflux_w = 1\nfile = \"image.pgm\"\n"
                .into(),
            "scene.toml:",
            "fills a rectangle",
        ),
        (lobes.into(), "scene.toml:", "no lobe"),
        (
            format!("{lobes}lobes = [{{ theta_deg = 10, exponent = 3, width_deg = 30 }}]\n"),
            "scene.toml:5",
            "stated twice",
        ),
        (
            format!("{lobes}lobes = [{{ theta_deg = 95, exponent = 3 }}]\n"),
            "scene.toml:5:24",
            "at most 90",
        ),
        (
            "[[emitter]]\nkind = \"lobes\"\nradius_mm = 1\ncentre_mm = [0, 0, 9]\nflux_w = 1\n\
             lobes = [{ theta_deg = 10, exponent = 3 }]\n"
                .into(),
            "scene.toml:2:8",
            "not supported",
        ),
    ]);
}

#[test]
fn mistakes_of_lit_scenes_are_refused_with_their_place() {
    let glossy = "[[surface]]\nkind = \"glossy\"\nradius_mm = 1\nexponent = 20\nalbedo = 0.5\n";
    let window = |z: &str, index: &str| {
        format!(
            "{PANEL}{LAMP}[[window]]\nz_mm = {z}\nthickness_mm = 5\nindex = {index}\n\
             belongs_to = \"sample\"\n"
        )
    };
    all_refused(&[
        (PANEL.into(), "scene.toml", "nothing lights"),
        (LAMP.into(), "scene.toml", "no emitter and no surface"),
        (format!("{PANEL}{PANEL}{LAMP}"), "scene.toml:9", "overlaps surface[0]"),
        (format!("{glossy}gloss = 0.6\n{LAMP}"), "scene.toml:6", "more than 1 in all"),
        (format!("{PANEL}{LAMP}{LAMP}"), "scene.toml:14", "lamp[0] penetrate"),
        (
            format!("{PANEL}{LAMP}[[occluder]]\nkind = \"half-plane\"\nx_max_mm = 0\nz_mm = 290\n"),
            "scene.toml:14",
            "lamp[0] penetrate",
        ),
        (
            format!("{PANEL}{LAMP}[[occluder]]\nkind = \"half-plane\"\nx_max_mm = 0\nz_mm = -1\n"),
            "scene.toml:14",
            "below the sample",
        ),
        (
            format!(
                "{PANEL}{LAMP}[[occluder]]\nkind = \"disk\"\nradius_mm = 2\ncentre_mm = [0, 0, 5]\n"
            ),
            "axis",
            "missing key",
        ),
        (
            format!("{PANEL}{LAMP}[[occluder]]\nkind = \"sphere\"\nradius_mm = 2\n"),
            "centre_mm",
            "missing key",
        ),
        (window("20", "0.9"), "scene.toml:14:9", "at least 1"),
        (window("-2", "1.5"), "scene.toml:12", "below the sample"),
        (window("318", "1.5"), "scene.toml:12", "lamp[0] penetrate"),
        (format!("{PANEL}{LAMP}[[windo]]\n"), "scene.toml:11", "unknown key"),
        (
            format!("{PANEL}[[lamp]]\nkind = \"sun\"\ntheta_deg = 90\n"),
            "scene.toml:8",
            "at most 89.999",
        ),
        (
            format!("{PANEL}[[lamp]]\nkind = \"environment\"\nfile = \"short.pgm\"\n"),
            "scene.toml:8:8",
            "3 of 4 pixels",
        ),
        (format!("{PANEL}{LAMP}exitance_w_per_m2 = 2\n"), "scene.toml:11", "stated twice"),
    ]);
}

#[test]
fn glossy_surfaces_that_are_not_simulated_are_refused_with_their_place() {
    let glossy = "[[surface]]\nkind = \"glossy\"\nradius_mm = 1\nexponent = 20\nalbedo = 0.5\n";
    let wall = |kind: &str| {
        format!(
            "[[surface]]\nkind = \"{kind}\n\
             corners_mm = [[-30, -9, 0], [-30, 9, 0], [-30, 9, 9], [-30, -9, 9]]\n"
        )
    };
    all_refused(&[
        (
            format!("{glossy}gloss = 0.1\n{LAMP}{}", wall("lambertian\"\nalbedo = 0.5")),
            "scene.toml:2:8",
            "between surface[0], glossy, and surface[1]",
        ),
        (
            format!("{PANEL}{LAMP}{}", wall("glossy\"\ngloss = 0.5\nexponent = 9")),
            "scene.toml:12:8",
            "between surface[1], glossy, and surface[0]",
        ),
        (
            format!(
                "{glossy}gloss = 0.1\n{LAMP}[[window]]\nz_mm = 9\nthickness_mm = 5\n\
                 index = 1.5\nbelongs_to = \"sample\"\n"
            ),
            "scene.toml:2:8",
            "surface[0], glossy, under window[0]",
        ),
    ]);
    assert!(read(&format!("{glossy}gloss = 0.1\n{LAMP}")).is_ok());
}
