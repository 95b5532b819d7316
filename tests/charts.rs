//! Samples in charts other than the surface one, from a CSV to fit.json, as a user fits them.

mod bench;

use std::fmt::Write as _;

use bench::Bench;
use serde_json::Value;

const SIDES: [&str; 4] = ["--chart", "perpendicular", "--radius-mm", "50"];
const ALL_ROUND: [&str; 2] = ["--theta-max-deg", "180"];
const PLANES: [&str; 4] = ["--chart", "two-plane", "--distance-mm", "50"];

/// Evenly over the sphere: θ and φ, degrees, and 1 + cos θ/2 + 0.3 sin θ cos φ.
fn all_round(count: u32) -> impl Iterator<Item = (f64, f64, f64)> {
    (0..count).map(move |i| {
        let theta = (1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count)).acos();
        let phi = f64::from(i) * 2.399_963_229_728_653 % std::f64::consts::TAU;
        let value = 1.0 + 0.5 * theta.cos() + 0.3 * theta.sin() * phi.cos();
        (theta.to_degrees(), phi.to_degrees(), value)
    })
}

/// A tenth of a percent of noise that isn't drawn.
fn noise(i: u32) -> f64 {
    1.0 + 1e-3 * (f64::from((i * 7919) % 101) / 50.0 - 1.0)
}

fn bench() -> Bench {
    let bench = Bench::empty();
    let mut object =
        "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,u_radiance_w_per_m2_sr\n".to_owned();
    let mut room = "theta_deg,phi_deg,luminance_cd_per_m2\n".to_owned();
    for (i, (theta, phi, value)) in (0..).zip(all_round(300)) {
        let value = 100.0 * value * noise(i);
        writeln!(object, "0,0,{theta},{phi},{value},0.1").unwrap();
        writeln!(room, "{theta},{phi},{value}").unwrap();
    }
    let mut planes = "u_mm,v_mm,s_mm,t_mm,radiance_w_per_m2_sr,u_radiance_w_per_m2_sr\n".to_owned();
    for i in 1..400_u32 {
        let part = |power: i32| f64::from(i) * 1.167_303_978_261_418_7_f64.powi(-power) % 1.0;
        let (u, v) = (20.0 * part(1) - 10.0, 16.0 * part(2) - 8.0);
        let (s, t) = (20.0 * part(3) - 10.0, 16.0 * part(4) - 8.0);
        let value = 100.0 * noise(i);
        writeln!(planes, "{u},{v},{s},{t},{value},0.1").unwrap();
    }
    for (name, text) in [("object", object), ("room", room), ("planes", planes)] {
        std::fs::write(bench.path(&format!("{name}.csv")), text).unwrap();
    }
    bench
}

fn fitted(bench: &Bench, arguments: &[&str]) -> Value {
    let said = bench.gonio(&[&["fit"], arguments, &["--json"]].concat()).well();
    serde_json::from_str(&said.out).unwrap()
}

fn number(json: &Value, path: &str) -> f64 {
    json.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} in {json}"))
}

fn assert_near(json: &Value, path: &str, expected: f64, relative: f64) {
    let found = number(json, path);
    assert!((found / expected - 1.0).abs() < relative, "{path}: {found}, expected {expected}");
}

#[test]
fn an_object_has_intensity_and_flux_and_no_exitance() {
    let bench = bench();
    let json = fitted(&bench, &[&["object.csv"], &SIDES[..], &ALL_ROUND].concat());
    let area = std::f64::consts::PI * 0.05 * 0.05;
    assert_eq!(json["chart"], "perpendicular");
    assert!((number(&json, "/region/radius_mm") - 50.0).abs() < 1e-12);
    assert_near(&json, "/flux_w/value", 400.0 * std::f64::consts::PI * area, 5e-4);
    assert_near(&json, "/flux_w/measured_fraction", 1.0, 1e-9);
    let size = 0.5_f64.hypot(0.3);
    assert_near(&json, "/peak_intensity_w_per_sr/value", 100.0 * (1.0 + size) * area, 1e-3);
    assert_near(&json, "/peak_intensity_w_per_sr/theta_deg", 0.6_f64.atan().to_degrees(), 2e-2);
    assert_eq!(json["uncertainty_budget_flux_w"][0]["name"], "independent");
    // What all samples share stays apart, and does not average away.
    let scale = ["--u-scale", "0.02"];
    let shared = fitted(&bench, &[&["object.csv"], &SIDES[..], &ALL_ROUND, &scale].concat());
    let flux = number(&shared, "/flux_w/value");
    let independent = number(&shared, "/flux_w/u_independent");
    assert_near(&shared, "/flux_w/u", (0.02 * flux).hypot(independent), 1e-9);
    assert!((independent / number(&json, "/flux_w/u") - 1.0).abs() < 1e-6);
    assert_eq!(shared["uncertainty_budget_flux_w"][1]["name"], "scale");
    let keys = json.as_object().unwrap().keys();
    assert_eq!(keys.filter(|key| key.contains("exitance")).count(), 0);
    // What it has not is refused by name; the rest is there.
    let refused = bench.gonio(
        &[&["fit", "object.csv"], &SIDES[..], &ALL_ROUND, &["--derive", "exitance"]].concat(),
    );
    assert_eq!(refused.code, Some(1));
    assert!(refused.err.contains("perpendicular chart has no exitance"));
}

#[test]
fn an_environment_has_irradiances_at_its_point_and_a_map() {
    let bench = bench();
    let derive = |spec: &'static str| ["--derive", spec];
    let json = fitted(
        &bench,
        &[
            &["room.csv", "--chart", "environment"],
            &ALL_ROUND[..],
            &derive("illuminance normal=1,0,0"),
            &derive("cylindrical_illuminance axis=0,0,1"),
            &derive("environment name=map normal=0,0,1 rows=4 columns=6 cells=equal-area"),
        ]
        .concat(),
    );
    let pi = std::f64::consts::PI;
    assert_near(&json, "/illuminance_lx/value", 100.0 * pi * (1.0 + 1.0 / 3.0), 1e-3);
    assert_near(&json, "/spherical_illuminance_lx/value", 400.0 * pi, 1e-3);
    assert_near(&json, "/derived/0/value", 100.0 * pi * 1.2, 1e-3);
    assert_near(&json, "/derived/1/value", 100.0 * pi, 1e-3);
    assert_eq!(json["derived"][1]["name"], "cylindrical_illuminance-2");
    let map = std::fs::read_to_string(bench.path("derived-map.csv")).unwrap();
    assert_eq!(map.lines().count(), 25);
    // The last row looks straight down.
    let last: Vec<&str> = map.lines().last().unwrap().split(',').collect();
    assert!(last[0].parse::<f64>().unwrap() > 130.0 && last[8].parse::<f64>().unwrap() < 80.0);
}

#[test]
fn a_whole_sphere_is_drawn_and_other_charts_are_not() {
    let bench = bench();
    let draw = ["--picture", "all-round.svg"];
    bench.gonio(&[&["fit", "object.csv"], &SIDES[..], &ALL_ROUND, &draw].concat()).well();
    let svg = std::fs::read_to_string(bench.path("all-round.svg")).unwrap();
    assert!(svg.starts_with("<?xml") && svg.contains(">intensity I<") && svg.contains(">W/sr<"));
    assert_eq!(svg.matches("class=\"curve\"").count(), 2);
    let refused = bench.gonio(&[&["fit", "planes.csv"], &PLANES[..], &draw].concat());
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("--picture: there is none of the two-plane chart"));
}

#[test]
fn two_planes_have_the_flux_between_them_and_values_at_listed_rays() {
    let bench = bench();
    let region = ["--u-mm=-10,10", "--v-mm=-8,8", "--s-mm=-10,10", "--t-mm=-8,8"];
    let json = fitted(&bench, &[&["planes.csv"], &PLANES[..], &region].concat());
    let factor = radiometry::form_factor::parallel_rectangles(0.02, 0.016, 0.05).unwrap();
    let throughput = std::f64::consts::PI * 0.02 * 0.016 * factor.ratio();
    assert_near(&json, "/flux_w/value", 100.0 * throughput, 5e-4);
    assert!((number(&json, "/region/distance_mm") - 50.0).abs() < 1e-12);
    std::fs::write(bench.path("at.csv"), "t_mm,s_mm,v_mm,u_mm\n5,1.25,0,-2\n").unwrap();
    let out = bench.gonio(&[&["fit", "planes.csv"], &PLANES[..], &["--at", "at.csv"]].concat());
    let out = out.well().out;
    assert!(out.starts_with("u_mm,v_mm,s_mm,t_mm,radiance"), "{out}");
    let row: Vec<&str> = out.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(row[..4], ["-2", "0", "1.25", "5"]);
    assert!((row[4].parse::<f64>().unwrap() - 100.0).abs() < 0.2, "{out}");
}

#[test]
fn shares_of_different_charts_are_not_merged() {
    let bench = bench();
    let share = |out: &str, chart: &[&str]| {
        let rest = ["--theta-max-deg=180", "--angular-degree=3", "--partial", "-o", out];
        bench.gonio(&[&["fit", "object.csv"], chart, &rest].concat()).well();
    };
    share("object.bin", &SIDES);
    share("point.bin", &["--chart", "environment"]);
    let whole = fitted(&bench, &["--merge", "object.bin"]);
    let area = std::f64::consts::PI * 0.05 * 0.05;
    assert_near(&whole, "/flux_w/value", 400.0 * std::f64::consts::PI * area, 5e-4);
    let mixed = bench.gonio(&["fit", "--merge", "object.bin", "point.bin"]);
    assert_eq!(mixed.code, Some(2));
    assert!(mixed.err.contains("chart: \"environment\"; expected"), "{}", mixed.err);
}

#[test]
fn rays_of_another_chart_are_refused_with_what_to_do() {
    let bench = bench();
    for (arguments, message) in [
        (&["object.csv"][..], "expected an angle in [0, 90] (to 180 with --chart perpendicular"),
        (&["object.csv", "--chart", "round"], "expected one of surface, perpendicular"),
        (&["planes.csv", "--chart", "two-plane"], "add --distance-mm"),
        (&["room.csv", "--chart", "perpendicular"], "no column x_mm; the columns are: theta_deg"),
        (&["planes.csv", "--chart", "environment"], "no column theta_deg"),
        (&["room.csv", "--chart", "environment", "--radius-mm", "5"], "no such coordinate"),
        (&["object.csv", "--chart", "perpendicular", "--radius-mm", "-3"], "a number above 0"),
        (&["object.csv", "--chart", "perpendicular", "--basis", "zernike"], "expected spherical"),
    ] {
        let refused = bench.gonio(&[&["fit"], arguments].concat());
        assert_eq!(refused.code, Some(2), "{arguments:?}");
        assert!(refused.err.contains(message), "{arguments:?}: {}", refused.err);
    }
}
