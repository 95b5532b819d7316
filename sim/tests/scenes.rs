//! What could break: a scene that is misread, half read, or refused without saying where and why.

use core::f64::consts::{FRAC_PI_2, PI};

use sim::{Quantity, Region, Scene, Shape};
use spanned_toml::{Document, Source};

fn read_for(quantity: Quantity, text: &str, file: &str) -> Result<Scene, String> {
    let document = Document::parse(Source::new("scene.toml", text)).map_err(|e| e.to_string())?;
    let load = |name: &str| match name {
        "lamp.ies" => Ok(file.as_bytes().to_vec()),
        _ => Err("no such file".to_owned()),
    };
    Scene::read(&document, quantity, &load).map_err(|e| e.to_string())
}

fn read(text: &str) -> Result<Scene, String> {
    read_for(Quantity::Radiance, text, "")
}

/// A file of one plane: 100 units at all γ to 80°, then falling to zero at 90°.
fn lamp(unit: &str, opening: &str) -> String {
    format!(
        "IESNA:LM-63-2002\n[TEST] none\n[TESTLAB] none\n[ISSUEDATE] today\n[MANUFAC] nobody\n\
         {unit}TILT=NONE\n1 -1 1.0 3 1 1 2 {opening}\n1 1 5\n0 80 90\n0\n100 100 0\n"
    )
}

const MILLIWATTS: &str = "[_INTENSITYUNITS] mW/sr\n";
const PATCH: &str = "x_mm = [-10, 10]\ny_mm = [-20, 20]\n";

#[test]
fn levels_and_outlines_are_read_in_their_units() {
    let scene = read(
        "[[emitter]]\nkind = \"lambertian\"\nx_mm = [-10, 10]\ny_mm = [0, 5]\n\
         exitance_w_per_m2 = 6\n\
         [[emitter]]\nkind = \"cosine-power\"\nradius_mm = 4\ncentre_mm = [30, 0]\n\
         exponent = 8\nradiance_w_per_m2_sr = 2.5\n",
    )
    .unwrap();
    let [patch, lobe] = scene.emitters() else { panic!("{scene:?}") };
    assert_eq!(*patch.shape().unwrap(), Shape::Rectangle { x_m: (-0.01, 0.01), y_m: (0.0, 0.005) });
    assert!((patch.radiance(1.0, 2.0) - 6.0 / PI).abs() < 1e-15);
    assert_eq!(*lobe.shape().unwrap(), Shape::disk(0.03, 0.0, 0.004));
    assert!((lobe.radiance(0.5, 0.0) - 2.5 * 0.5_f64.cos().powi(8)).abs() < 1e-14);
    assert_eq!(scene.radiance(0.02, 0.0, 0.0, 0.0).to_bits(), 0, "dark between the two");
}

#[test]
fn a_photometric_file_makes_a_patch_of_its_own_size() {
    let text = "[[emitter]]\nkind = \"photometric-file\"\nfile = \"lamp.ies\"\n";
    let file = lamp(MILLIWATTS, "0.02 0.05 0");
    let scene = read_for(Quantity::Radiance, text, &file).unwrap();
    let emitter = &scene.emitters()[0];
    // Length along C0-C180, which is x; width across it.
    assert_eq!(*emitter.shape().unwrap(), Shape::rectangle(0.0, 0.0, 0.05, 0.02));
    let radiance = |theta: f64, intensity_w: f64| intensity_w / (0.05 * 0.02 * theta.cos());
    for (theta_deg, milliwatts) in [(0.0, 100.0), (60.0, 100.0), (85.0, 50.0)] {
        let theta = f64::to_radians(theta_deg);
        let found = emitter.radiance(theta, 1.0);
        assert!((found / radiance(theta, milliwatts / 1e3) - 1.0).abs() < 1e-12, "{theta_deg}°");
    }
    assert_eq!(emitter.radiance(FRAC_PI_2, 0.0).to_bits(), 0, "never divided by cos 90°");
    let stated = format!("{text}radius_mm = 10\n");
    let scene = read_for(Quantity::Radiance, &stated, &file).unwrap();
    assert_eq!(*scene.emitters()[0].shape().unwrap(), Shape::disk(0.0, 0.0, 0.01));
    let circle = lamp(MILLIWATTS, "-0.04 -0.04 0");
    let scene = read_for(Quantity::Radiance, text, &circle).unwrap();
    assert_eq!(*scene.emitters()[0].shape().unwrap(), Shape::disk(0.0, 0.0, 0.02));
}

#[test]
fn units_of_the_scene_and_of_the_rig_must_agree() {
    let text = "[[emitter]]\nkind = \"photometric-file\"\nfile = \"lamp.ies\"\n";
    let of = |quantity, unit| read_for(quantity, text, &lamp(unit, "0.02 0.05 0"));
    let candela = "";
    let refused = of(Quantity::Radiance, candela).unwrap_err();
    assert!(
        refused.contains("scene.toml:3:8") && refused.contains("calibrated for radiance"),
        "{refused}"
    );
    assert!(refused.contains("spectrum"), "{refused}");
    let refused = of(Quantity::Luminance, MILLIWATTS).unwrap_err();
    assert!(refused.contains("mW/sr") && refused.contains("calibrated for luminance"), "{refused}");
    let luminance = of(Quantity::Luminance, candela).unwrap();
    assert!((luminance.radiance(0.0, 0.0, 0.0, 0.0) / (100.0 / 1e-3) - 1.0).abs() < 1e-12);
    assert!(of(Quantity::Relative, MILLIWATTS).is_ok());
    let level = format!("[[emitter]]\nkind = \"lambertian\"\nluminance_cd_per_m2 = 5\n{PATCH}");
    assert!(read(&level).unwrap_err().contains("calibrated for radiance"));
    assert!(read_for(Quantity::Luminance, &level, "").is_ok());
}

#[test]
fn every_kind_of_mistake_is_refused_with_its_place() {
    let lambertian = "[[emitter]]\nkind = \"lambertian\"\n";
    let cases: [(String, &str, &str); 19] = [
        ("name = 3\n".into(), "scene.toml:1", "no emitter"),
        ("emitter = 3\n".into(), "scene.toml:1", "a list of tables"),
        (format!("nam = 3\n{lambertian}"), "scene.toml:1:1", "unknown key"),
        ("[[emitter]]\nkind = \"lambertain\"\n".into(), "scene.toml:2:8", "one of \"lambertian\""),
        (format!("{lambertian}{PATCH}"), "scene.toml:1", "radiance_w_per_m2_sr or exitance"),
        (
            format!("{lambertian}{PATCH}radiance_w_per_m2_sr = 1\nexitance_w_per_m2 = 3\n"),
            "scene.toml:6",
            "stated twice",
        ),
        (format!("{lambertian}radiance_w_per_m2_sr = 1\n"), "scene.toml:1", "no outline"),
        (
            format!("{lambertian}{PATCH}radiance_w_per_m2_sr = nan\n"),
            "scene.toml:5:24",
            "at least 0",
        ),
        (
            format!("{lambertian}{PATCH}radiance_w_per_m2_sr = -1\n"),
            "scene.toml:5:24",
            "at least 0",
        ),
        (
            format!("{lambertian}{PATCH}radiance_w_per_m2_sr = 1\nexponent = 2\n"),
            "scene.toml:6:1",
            "unknown key",
        ),
        (
            format!("{lambertian}{PATCH}radius_mm = 3\nradiance_w_per_m2_sr = 1\n"),
            "scene.toml:5",
            "a disk and a rectangle",
        ),
        (
            format!("{lambertian}x_mm = [0, 1]\nradiance_w_per_m2_sr = 1\n"),
            "scene.toml:3",
            "y_mm is missing",
        ),
        (
            format!("{lambertian}x_mm = [1, 1]\ny_mm = [0, 1]\nradiance_w_per_m2_sr = 1\n"),
            "scene.toml:3",
            "not below",
        ),
        (
            format!("{lambertian}radius_mm = 0\nradiance_w_per_m2_sr = 1\n"),
            "scene.toml:3",
            "above 0",
        ),
        (
            format!("{lambertian}centre_mm = [0, 0]\nradiance_w_per_m2_sr = 1\n"),
            "scene.toml:3",
            "without a radius",
        ),
        (
            format!(
                "{lambertian}{PATCH}radiance_w_per_m2_sr = 1\n\
                 {lambertian}radius_mm = 1\ncentre_mm = [10.5, 0]\nradiance_w_per_m2_sr = 1\n"
            ),
            "scene.toml:8",
            "overlaps emitter[0]",
        ),
        (
            format!("[[emitter]]\nkind = \"cosine-power\"\n{PATCH}exponent = -1\n"),
            "scene.toml:5",
            "at least 0",
        ),
        ("[[emitter]]\nkind = \"photometric-file\"\n".into(), "scene.toml:1", "missing key"),
        (
            "[[emitter]]\nkind = \"photometric-file\"\nfile = \"lmap.ies\"\n".into(),
            "scene.toml:3:8",
            "no such file",
        ),
    ];
    for (text, place, why) in cases {
        let problem = read(&text).expect_err(&text);
        assert!(problem.contains(place) && problem.contains(why), "{text}\n{problem}");
    }
}

#[test]
fn files_that_make_no_flat_patch_are_refused_by_name() {
    let text = "[[emitter]]\nkind = \"photometric-file\"\nfile = \"lamp.ies\"\n";
    let whole = lamp(MILLIWATTS, "0.02 0.05 0");
    let half = &whole[..whole.len() - 8];
    let no_size = lamp(MILLIWATTS, "0 0 0");
    let sides = lamp(MILLIWATTS, "0.02 0.05 0.01");
    let ellipse = lamp(MILLIWATTS, "-0.02 -0.05 0");
    let upward = whole.replace("0 80 90\n", "90 170 180\n");
    for (file, why) in [
        (half, "the file's end"),
        (&no_size, "opening is"),
        (&sides, "luminous sides"),
        (&ellipse, "an ellipse"),
        (&upward, "no intensities at two or more"),
        ("\u{7f}ELF", "LM-63"),
    ] {
        let problem = read_for(Quantity::Radiance, text, file).expect_err(why);
        assert!(problem.contains("lamp.ies: ") && problem.contains(why), "{why}\n{problem}");
    }
}

#[test]
fn the_luminaire_of_the_examples_is_read_whole() {
    let bytes = include_bytes!("../../examples/luminaire/ushio_b1.ies");
    let text = "[[emitter]]\nkind = \"photometric-file\"\nfile = \"ushio_b1.ies\"\n";
    let document = Document::parse(Source::new("scene.toml", text)).unwrap();
    let scene = Scene::read(&document, Quantity::Radiance, &|_| Ok(bytes.to_vec())).unwrap();
    let emitter = &scene.emitters()[0];
    assert_eq!(*emitter.shape().unwrap(), Shape::rectangle(0.0, 0.0, 0.06, 0.045));
    // A node of the file, C 22.5° and γ 25°: 89.124... mW/sr. C = -φ.
    let (theta, phi) = (25.0_f64.to_radians(), -22.5_f64.to_radians());
    let expected = 0.089_124_469_565_902_71 / (0.06 * 0.045 * theta.cos());
    assert!((emitter.radiance(theta, phi) / expected - 1.0).abs() < 1e-12);
    // The planes at C 22.5° and 337.5° differ: the sign of φ shows.
    assert!((emitter.radiance(theta, -phi) / expected - 1.0).abs() > 0.005);
    // The same flux as the reader of the file finds by its own formula.
    let photometry = photometry_files::lm63::read(bytes).unwrap();
    let flux_w = photometry.flux_within(90.0) / 1e3;
    let found = emitter.exitance_within(FRAC_PI_2) * emitter.shape().unwrap().area_m2();
    assert!((found / flux_w - 1.0).abs() < 1e-13, "{found} W beside {flux_w} W");
    assert!(
        scene.notes().iter().any(|note| note.contains("planes disagree")),
        "{:?}",
        scene.notes()
    );
    let region = Region { x_m: (-0.02, 0.02), y_m: (-0.02, 0.02), theta_max_rad: 1.3 };
    let (peak, ..) = emitter.peak_within(region.theta_max_rad).unwrap();
    assert!(peak > 44.0 && peak < 46.0, "{peak}");
}

#[test]
fn the_scenes_of_the_examples_are_read() {
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut scenes = 0;
    for example in std::fs::read_dir(&examples).unwrap() {
        let folder = example.unwrap().path();
        let path = folder.join("scene.toml");
        if path.exists() {
            let document = Document::read(&path).unwrap_or_else(|e| panic!("{e}"));
            let load = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
            let scene = Scene::read(&document, Quantity::Radiance, &load);
            let scene = scene.unwrap_or_else(|e| panic!("{e}"));
            let shines = scene.radiance(0.0, 0.0, 0.0, 0.0) > 0.0 || !scene.surfaces().is_empty();
            assert!(shines, "{}: dark", path.display());
            scenes += 1;
        }
    }
    assert!(scenes >= 3, "{scenes} scenes in {}", examples.display());
}
