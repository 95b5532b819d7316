//! `gonio fit --derive` and a plan's `[[derive]]`: what comes out, and what is refused.

mod bench;

use bench::Bench;
use std::f64::consts::PI;
use std::fmt::Write as _;

/// A lawn of samples of a Lambertian field of 100, over 20 mm by 20 mm.
fn samples(column: &str, u: &str) -> String {
    let mut text =
        format!("x_mm,y_mm,theta_deg,phi_deg,{column}{}\n", if u.is_empty() { "" } else { ",u_" });
    text = text.replace(",u_\n", &format!(",u_{column}\n"));
    for place in 0..9 {
        let (x, y) = (f64::from(place % 3) * 10.0 - 10.0, f64::from(place / 3) * 10.0 - 10.0);
        for ring in 0..8 {
            for spoke in 0..14 {
                let (theta, phi) = (f64::from(ring) * 10.0, f64::from(spoke) * 360.0 / 14.0);
                writeln!(text, "{x},{y},{theta},{phi},100{u}").unwrap();
            }
        }
    }
    text
}

fn bench() -> Bench {
    Bench::empty().having("s.csv", samples("radiance_w_per_m2_sr", ",0.5"))
}

#[track_caller]
fn number(document: &serde_json::Value, path: &str) -> f64 {
    let found = document.pointer(path).and_then(serde_json::Value::as_f64);
    found.unwrap_or_else(|| panic!("no number at {path} in {document}"))
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 1e-4, "found {found}, expected {expected}");
}

#[test]
fn a_lambertian_field_has_its_closed_forms() {
    let specs = [
        "irradiance at_mm=0,0,100 normal=0,0,-1 name=desk",
        "exitance x_mm=5 y_mm=0 theta_max_deg=60",
        "intensity c_deg=90 gamma_deg=60",
        "beam_angle c_deg=0",
        "flux half_angle_deg=30",
        "flux solid_angle_sr=1 axis_theta_deg=20",
        "radiance x_mm=0 y_mm=0 theta_deg=30 phi_deg=0 window.index=1.5 window.thickness_mm=1",
    ];
    let mut arguments = vec!["fit", "s.csv", "--json", "-o", "fit.json"];
    for spec in specs {
        arguments.extend(["--derive", spec]);
    }
    let bench = bench();
    let said = bench.gonio(&arguments).well();
    let fit = said.json();
    assert_eq!(fit["derived"], bench.json("fit.json")["derived"]);
    // A square of half side a at distance h on its axis (Howell B-4, four corners).
    let t = 0.1_f64;
    let corner = 2.0 * t / (1.0 + t * t).sqrt() * (t / (1.0 + t * t).sqrt()).atan();
    near(number(&fit, "/derived/0/value"), 100.0 * 2.0 * corner);
    assert_eq!(fit["derived"][0]["name"], "desk");
    assert_eq!(fit["derived"][0]["unit"], "W/m²");
    assert_eq!(fit["derived"][0]["quantity"], "irradiance");
    near(number(&fit, "/derived/1/value"), 100.0 * PI * 0.75);
    near(number(&fit, "/derived/2/value"), 100.0 * 4e-4 * 0.5);
    near(number(&fit, "/derived/3/value"), 120.0);
    assert_eq!(fit["derived"][3]["name"], "beam_angle-C0-C180");
    near(number(&fit, "/derived/4/value"), 100.0 * PI * 0.25 * 4e-4);
    // A cap's vector area: π sin² α cos of the axis, α from 2π (1 - cos α) = 1 sr.
    let cos = 1.0 - 0.5 / PI;
    let expected = 100.0 * PI * (1.0 - cos * cos) * 20f64.to_radians().cos() * 4e-4;
    near(number(&fit, "/derived/5/value"), expected);
    // Through a clear pane of n = 1.5 at 30°: tabulated by `gonio calc` as well.
    assert!(number(&fit, "/derived/6/value") > 100.0 / 0.93);
    for quantity in fit["derived"].as_array().unwrap() {
        let squares: f64 = quantity["budget"]
            .as_array()
            .unwrap()
            .iter()
            .map(|part| part["u"].as_f64().unwrap().powi(2))
            .sum();
        near(number(quantity, "/u"), squares.sqrt());
        assert!(number(quantity, "/quadrature_bound") <= 0.1 * number(quantity, "/u"));
    }
}

#[test]
fn tables_are_files_beside_the_fit() {
    let bench = bench().having(
        "wanted.toml",
        "[[derive]]\nkind = \"environment\"\nname = \"seen\"\nat_mm = [0, 0, 10]\n\
         normal = [0, 0, -1]\nrows = 4\ncolumns = 8\ncells = \"equal-area\"\n\
         [[derive]]\nkind = \"two_plane\"\nname = \"planes\"\ndistance_mm = 50\n\
         u_mm = [-5, 5]\nu_count = 2\nv_mm = [-5, 5]\nv_count = 1\n\
         s_mm = [-20, 20]\ns_count = 3\nt_mm = [0, 20]\nt_count = 2\n",
    );
    let said = bench.gonio(&["fit", "s.csv", "--derive", "wanted.toml"]).well();
    assert!(said.out.contains("32 rows in derived-seen.csv"), "{said}");
    let seen = bench.text("derived-seen.csv");
    assert_eq!(seen.lines().count(), 33);
    let header = "theta_deg,phi_deg,towards_x,towards_y,towards_z,solid_angle_sr,covered,measured,\
                  radiance_w_per_m2_sr,u_radiance_w_per_m2_sr,u_independent_radiance_w_per_m2_sr";
    assert_eq!(seen.lines().next(), Some(header));
    // Straight below, all of a cell is the sample; the map adds up to the irradiance.
    let fields =
        |line: &str| line.split(',').map(|f| f.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let first = fields(seen.lines().nth(1).unwrap());
    near(first[6], 1.0);
    near(first[8], 100.0);
    assert!(first[4] < 0.0 && first[9] > 0.0);
    let planes = bench.text("derived-planes.csv");
    assert_eq!(planes.lines().count(), 13);
    assert!(planes.starts_with("u_mm,v_mm,s_mm,t_mm,theta_deg,phi_deg,measured,radiance_w"));
    let ray = fields(planes.lines().nth(1).unwrap());
    near(ray[0], -5.0);
    near(ray[4], (15f64 / 50.0).atan().to_degrees());
}

#[test]
fn what_the_field_does_not_reach_is_said_and_costs_the_exit_code() {
    let said = bench().gonio(&["fit", "s.csv", "--json", "--derive", "field_angle c_deg=0"]);
    assert_eq!(said.code, Some(1), "{said}");
    let fit = said.json();
    assert!(fit["derived"][0]["value"].is_null());
    let why = fit["derived"][0]["why"].as_str().unwrap();
    assert!(why.contains("does not fall to 10.000 % of its reference within 70.0°"), "{why}");
    said.says(&["field_angle-C0-C180, at 10 % of the plane's largest intensity"]);
}

#[test]
fn photometric_and_relative_quantities_have_their_own_names() {
    for (column, name, unit) in [
        ("luminance_cd_per_m2", "illuminance-1", "lx"),
        ("radiance_relative", "irradiance_relative-1", ""),
    ] {
        let bench = Bench::empty().having("s.csv", samples(column, ",0.5"));
        let spec = "irradiance at_mm=0,0,100 normal=0,0,-1";
        let fit = bench.gonio(&["fit", "s.csv", "--json", "--derive", spec]).well().json();
        assert_eq!(fit["derived"][0]["name"], name);
        assert_eq!(fit["derived"][0]["unit"], unit);
    }
}

#[test]
fn a_plan_asks_for_what_its_fit_file_holds() {
    let plan = "\n[[derive]]\nkind = \"flux\"\nname = \"forward\"\ntheta_max_deg = 30\n";
    let text = Bench::small().text("plan.toml") + plan;
    let bench = Bench::small().having("plan.toml", text);
    let said = bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    assert!(said.out.contains("forward"), "{said}");
    let forward = number(&bench.json("out/fit.json"), "/derived/0/value");
    let whole = number(&bench.json("out/fit.json"), "/flux_w/value");
    assert!((forward / whole - 0.25).abs() < 0.01, "{forward} of {whole}");
    let spec = "flux name=wide theta_max_deg=60";
    bench.gonio(&["fit", "out", "--derive", spec]).well();
    let again = bench.json("out/fit.json");
    assert_eq!(again["derived"][0]["name"], "forward");
    assert!((number(&again, "/derived/1/value") / whole - 0.75).abs() < 0.01);
}

/// The request is refused with every part, and nothing is written.
#[track_caller]
fn refused(spec: &str, parts: &[&str]) {
    let bench = bench();
    let before = bench.names();
    bench.gonio(&["fit", "s.csv", "-o", "fit.json", "--derive", spec]).refused(parts);
    assert_eq!(bench.names(), before, "{spec}");
}

#[test]
fn requests_that_mean_nothing_are_refused_at_their_place() {
    refused(
        "irradiance at_mm=0,0,-5 normal=0,0,-1",
        &["--derive:2:", "z = -5 mm", "above the sample"],
    );
    refused("irradiance at_mm=0,0,0 normal=0,0,-1", &["at_mm", "z = 0 mm", "help:"]);
    refused("irradiance at=0,0,5 normal=0,0,-1", &["at: unknown key", "did you mean `at_mm`?"]);
    refused("irradiance at_mm=0,0,5", &["normal: missing key", "three numbers"]);
    refused("irradiance at_mm=0,0,5 normal=0,0,0", &["its normal has no direction"]);
    refused("irradiance at_mm=0,0,5 normal=1,0,0 radius_mm=9", &["z = -4", "above the sample"]);
    refused("irradiance at_mm=0,0,5 normal=0,0,-1 radius=9", &["did you mean `radius_mm`?"]);
    refused("irradiance vertices_mm=[[0,0,1],[1,0,1],[2,0,1]]", &["no area", "vertices_mm"]);
    refused("irradiance vertices_mm=[[0,0,1],[1,0,1],[1,1,2],[0,1,1]]", &["vertices_mm", "plane"]);
    refused("iradiance at_mm=0,0,5", &["kind: found the text \"iradiance\"", "did you mean"]);
    refused("intensity theta=30 phi_deg=0", &["theta: unknown key", "did you mean `theta_deg`?"]);
    refused("intensity theta_deg=95 phi_deg=0", &["at most 90", "--derive:2:"]);
    refused("exitance theta_min_deg=50 theta_max_deg=40", &["50 is not below 40"]);
    refused("flux half_angle_deg=10 solid_angle_sr=1", &["one of the two"]);
    refused("beam_angle level=1.5", &["level", "at most 0.999"]);
    refused("two_plane distance_mm=-3", &["distance_mm: found the integer -3", "above 0"]);
    refused("flux window.index=0.5 window.thickness_mm=3", &["window.index", "at least 1"]);
    refused("flux window.index=1.5 window.thickness=3", &["did you mean `thickness_mm`?"]);
    let immersed =
        "irradiance at_mm=0,0,5 normal=0,0,-1 immersion.index=1.5 immersion.thickness_mm=0";
    refused(immersed, &["the receiver lies in air"]);
    refused("flux foo", &["expected KEY=VALUE"]);
    refused("flux name=../up", &["can't name a file"]);
    refused("", &["found nothing"]);
    refused("gone.toml", &["gone.toml: cannot be read"]);
    let bench = bench().having(
        "w.toml",
        "[[derive]]\nkind = \"flux\"\n[[derive]]\nkind = \"flux\"\nnaem = \"a\"\n",
    );
    bench.gonio(&["fit", "s.csv", "--derive", "w.toml"]).refused(&["w.toml:5:1", "`name`"]);
    let bench = bench.having("w.toml", "[derived]\n");
    bench.gonio(&["fit", "s.csv", "--derive", "w.toml"]).refused(&["w.toml:1:", "`derive`"]);
}

#[test]
fn trials_agree_with_u_where_all_is_linear_and_repeat_by_their_seed() {
    let bench = bench();
    let run = |seed: &str| {
        let arguments = [
            "fit",
            "s.csv",
            "--json",
            "--angular-degree",
            "2",
            "--u-scale",
            "0.002",
            "--monte-carlo",
            "2000",
            "--seed",
            seed,
            "--derive",
            "beam_angle c_deg=0",
            "--derive",
            "irradiance at_mm=0,0,100 normal=0,0,-1",
            "-o",
            "fit.json",
        ];
        bench.gonio(&arguments).well().json()
    };
    let fit = run("5");
    assert_eq!(fit["monte_carlo"], bench.json("fit.json")["monte_carlo"]);
    assert_eq!(fit["monte_carlo"], run("5")["monte_carlo"]);
    assert_ne!(fit["monte_carlo"], run("6")["monte_carlo"]);
    assert_eq!(fit["monte_carlo"]["trials"], 2000);
    let numbers = fit["monte_carlo"]["numbers"].as_array().unwrap();
    let names: Vec<&str> = numbers.iter().filter_map(|number| number["name"].as_str()).collect();
    let expected = [
        "exitance",
        "flux",
        "intensity_along_normal",
        "radiance_along_peak_ray",
        "peak_radiance",
        "beam_angle-C0-C180",
        "irradiance-2",
    ];
    assert_eq!(names, expected);
    for one in numbers {
        let of = |path: &str| number(one, path);
        // The u of 2000 trials is known to 1.6 %.
        let ratio = of("/trials/u") / of("/linear/u");
        assert!((0.92..1.08).contains(&ratio) || one["name"] == "peak_radiance", "{one}");
        assert!(of("/trials/interval_95/0") < of("/trials/mean"));
        assert!(of("/trials/interval_95/1") > of("/trials/mean"));
        let width = |key: &str| of(&format!("{key}/1")) - of(&format!("{key}/0"));
        assert!(width("/trials/shortest_95") <= width("/trials/interval_95"), "{one}");
    }
    // The largest of noisy values lies above the field's.
    let (peak, along) = (&numbers[4], &numbers[3]);
    assert!(number(peak, "/trials/mean") > number(along, "/trials/mean"));
    assert!(number(&fit, "/monte_carlo/peak_direction/within_95_deg") > 1.0);
    let text =
        bench.gonio(&["fit", "s.csv", "--monte-carlo", "200", "--angular-degree", "2"]).well();
    assert!(text.out.contains("200 trials, seed 1"), "{}", text.out);
}

#[test]
fn trials_that_make_no_sense_are_refused() {
    let bench = bench();
    let refused = |arguments: &[&str], needle: &str| {
        let said = bench.gonio(&[&["fit", "s.csv"], arguments].concat());
        assert_eq!(said.code, Some(2), "{}", said.err);
        assert!(said.err.contains(needle), "{}", said.err);
    };
    refused(&["--monte-carlo", "99"], "99 trials; expected 100 to 1000000");
    refused(&["--monte-carlo", "1000001"], "expected 100 to 1000000");
    refused(&["--monte-carlo", "many"], "invalid value");
    refused(&["--seed", "3"], "--monte-carlo");
    let symmetric = ["--monte-carlo", "100", "--symmetry", "rotational", "--angular-degree", "2"];
    refused(&symmetric, "plain least squares");
}
