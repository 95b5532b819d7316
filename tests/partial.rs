//! Shares of the readings, fitted apart and merged, as a script uses them.

mod bench;

use std::fmt::Write as _;

use bench::Bench;
use serde_json::Value;

const REGION: [&str; 5] =
    ["--x-mm=-5,5", "--y-mm=-5,5", "--theta-max-deg=80", "--angular-degree=4", "--partial"];

/// Samples of a field that a degree of 4 holds, with scatter, from one number to another.
fn samples(from: u32, to: u32, stated: bool) -> String {
    let mut text = "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr".to_owned();
    text.push_str(if stated { ",u_radiance_w_per_m2_sr\n" } else { "\n" });
    for i in from..to {
        let part = |step: f64| (f64::from(i) * step + 0.37).fract();
        let (x, y) = (10.0 * part(0.618_034) - 5.0, 10.0 * part(0.754_878) - 5.0);
        let (theta, phi) = (80.0 * part(0.569_84), 360.0 * part(0.438_579) - 180.0);
        let value = 60.0 - 20.0 * theta.to_radians().sin().powi(2) + part(0.233_7);
        write!(text, "{x},{y},{theta},{phi},{value}").unwrap();
        text.push_str(if stated { ",0.3\n" } else { "\n" });
    }
    text
}

fn bench() -> Bench {
    let bench = Bench::empty();
    for (name, stated) in [("", true), ("plain-", false)] {
        for (share, from, to) in [("all", 0, 900), ("a", 0, 10), ("b", 10, 700), ("c", 700, 900)] {
            std::fs::write(bench.path(&format!("{name}{share}.csv")), samples(from, to, stated))
                .unwrap();
        }
    }
    bench
}

fn part(bench: &Bench, share: &str) -> String {
    let (csv, bin) = (format!("{share}.csv"), format!("{share}.bin"));
    let arguments = [&["fit", &csv, "-o", &bin], &REGION[..]].concat();
    bench.gonio(&arguments).well();
    bin
}

fn assert_close(a: &Value, b: &Value, tolerance: f64) {
    if let (Value::Array(a), Value::Array(b)) = (a, b) {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).for_each(|(a, b)| assert_close(a, b, tolerance));
    } else {
        let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{a} {b}");
    }
}

#[test]
fn merged_shares_of_a_csv_are_the_fit_of_the_whole() {
    let bench = bench();
    for name in ["", "plain-"] {
        let parts = ["a", "b", "c"].map(|share| part(&bench, &format!("{name}{share}")));
        let [a, b, c] = &parts;
        let merged = bench.gonio(&["fit", "--merge", c, a, b, "-o", "fit.json", "--json"]);
        let merged = merged.well().json();
        assert_eq!(merged, bench.json("fit.json"));
        assert_eq!(merged["notes"][0], "merged from 3 partial fits");
        let all = part(&bench, &format!("{name}all"));
        let all = bench.gonio(&["fit", "--merge", &all, "--json"]).well().json();
        let whole = format!("{name}all.csv");
        let whole = bench.gonio(&["fit", &whole, "--angular-degree", "4", "--json"]);
        let whole = whole.well().json();
        for key in ["coefficients", "covariance", "condition", "chi2", "residual_rms"] {
            assert_close(&merged[key], &all[key], 1e-9);
        }
        // Without a region a CSV stands for where its samples lie, a little less than asked for
        // here; with constant position terms that is of no account to the field.
        for key in ["coefficients", "covariance", "chi2", "residual_rms", "n_used", "dof"] {
            assert_close(&merged[key], &whole[key], 1e-6);
        }
    }
}

#[test]
fn a_long_file_is_fitted_in_blocks_as_it_is_as_a_share() {
    let bench = Bench::empty();
    std::fs::write(bench.path("long.csv"), samples(0, 50_100, true)).unwrap();
    let share = part(&bench, "long");
    let share = bench.gonio(&["fit", "--merge", &share, "--json"]).well().json();
    let whole = ["fit", "long.csv", "--angular-degree=4", "--position-degree=0", "--json"];
    let whole = bench.gonio(&whole).well().json();
    assert_eq!(whole["notes"][1], "read in blocks, its samples not all in memory at once");
    assert_eq!(whole["notes"].as_array().unwrap().len(), 2, "{}", whole["notes"]);
    for key in ["coefficients", "covariance", "residual_rms", "n_used", "dof"] {
        assert_close(&share[key], &whole[key], 1e-6);
    }
}

#[test]
fn a_merge_states_its_gaps_and_what_its_functions_miss() {
    let bench = Bench::empty();
    let all = samples(0, 3_000, true);
    let mut lines = all.lines();
    let head = lines.next().unwrap();
    // With a ridge round the normal, and without an eighth of the azimuths.
    let ridged = |line: &str| {
        let mut numbers: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        numbers[4] += 5.0 * (-((numbers[2] - 40.0) / 20.0).powi(2)).exp();
        let fields: Vec<String> = numbers.iter().map(f64::to_string).collect();
        (!(30.0..75.0).contains(&numbers[3])).then(|| fields.join(","))
    };
    let lines: Vec<String> = lines.filter_map(ridged).collect();
    let write = |name: &str, lines: &[String]| {
        std::fs::write(bench.path(name), format!("{head}\n{}\n", lines.join("\n"))).unwrap();
    };
    write("all.csv", &lines);
    let mut merge = vec!["fit", "--merge", "--json"];
    let shares = ["0", "1", "2"].map(|name| {
        let third = lines.chunks(lines.len().div_ceil(3)).nth(name.parse().unwrap()).unwrap();
        write(&format!("{name}.csv"), third);
        part(&bench, name)
    });
    merge.extend(shares.iter().map(String::as_str));
    let merged = bench.gonio(&merge).well().json();
    let whole = [&["fit", "all.csv", "--json", "--position-degree=0"], &REGION[..4]].concat();
    let whole = bench.gonio(&whole).well().json();
    assert_knows_as_much(&merged, &whole, 1e-2);
    assert!(merged["truncation_gain"].as_f64().unwrap() > 12.0);
    assert!(merged["exitance_w_per_m2"]["measured_fraction"].as_f64().unwrap() < 0.9);
}

/// The same with every thirtieth sample far off, and all above 59.5 saturated there.
fn spoilt(count: u32) -> String {
    let mut lines = samples(0, count, true).lines().map(str::to_owned).collect::<Vec<_>>();
    lines[0].push_str(",flags");
    for (i, line) in lines.iter_mut().enumerate().skip(1) {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        let value: f64 = fields[4].parse().unwrap();
        let is_limit = value > 59.5;
        let value = if i % 30 == 0 { value - 7.0 } else { value.min(59.5) };
        fields[4] = value.to_string();
        fields.push(if is_limit { "saturated" } else { "" }.to_owned());
        *line = fields.join(",");
    }
    lines.join("\n")
}

#[test]
fn outliers_and_limits_weigh_in_blocks_as_in_memory() {
    let bench = Bench::empty();
    std::fs::write(bench.path("spoilt.csv"), spoilt(5_000)).unwrap();
    let pinned = ["--angular-degree=4", "--position-degree=0", "--u-scale=0.01", "--json"];
    for robust in ["none", "huber", "tukey"] {
        let robust = ["fit", "spoilt.csv", "--robust", robust];
        let kept = bench.gonio(&[&robust, &pinned[..]].concat()).well().json();
        let blocks = bench.gonio(&[&robust, &pinned[..], &["--in-blocks"]].concat()).well().json();
        assert_eq!(blocks["notes"][1], "read in blocks, its samples not all in memory at once");
        assert_same(&blocks, &kept);
        let counts = |why: &str| blocks["readings"][why].as_u64().unwrap();
        assert!(counts("limit_holding") > 100 && counts("limit_exceeded") > 0);
        assert!(robust[3] == "none" || counts("downweighted") > 100);
    }
}

/// The same field with the same u, truncation included.
fn assert_same(blocks: &Value, kept: &Value) {
    for key in ["coefficients", "condition", "residual_rms", "chi2", "n_used", "dof"] {
        assert_close(&blocks[key], &kept[key], 3e-4);
    }
    for path in ["/exitance_w_per_m2/u", "/peak_radiance/u", "/intensity_on_axis_w_per_sr/u"] {
        let [found, expected] = [blocks, kept].map(|fit| fit.pointer(path).unwrap());
        let ratio = found.as_f64().unwrap() / expected.as_f64().unwrap();
        assert!((ratio - 1.0).abs() < 1e-3, "{path}: {found} {expected}");
    }
    let gains = [blocks, kept].map(|fit| fit["truncation_gain"].as_f64());
    assert!(gains[0].is_some() == gains[1].is_some(), "{gains:?}");
    for key in ["n_flagged", "n_excluded", "drift", "region", "resolves"] {
        assert!(key == "drift" || !kept[key].is_null(), "{key}");
        assert_eq!(blocks[key], kept[key], "{key}");
    }
    for why in ["downweighted", "limit_exceeded", "limit_holding", "left_out", "remarkable"] {
        assert_eq!(blocks["readings"][why], kept["readings"][why], "{why}");
    }
    let listed = |fit: &Value| fit["readings"]["listed"].as_array().map_or(0, Vec::len);
    assert_eq!(listed(blocks), listed(kept));
}

#[test]
fn a_run_in_blocks_is_the_run_at_once() {
    // More than a block of readings, and the way through them as it comes.
    let bench = Bench::small()
        .with("plan.toml", "phi_step_deg = 45", "phi_step_deg = 10")
        .with("plan.toml", "theta_step_deg = 20", "theta_step_deg = 10")
        .with("plan.toml", "order = \"travel\"", "order = \"listed\"");
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    for robust in ["none", "tukey"] {
        let fit = ["fit", "out", "--angular-degree=2", "--robust", robust, "--json", "-o"];
        let kept = bench.gonio(&[&fit[..], &["kept.json"]].concat()).well().json();
        let blocks = [&fit[..], &["blocks.json", "--in-blocks"]].concat();
        let blocks = bench.gonio(&blocks).well().json();
        assert_eq!(blocks["notes"][0], "read in blocks, its samples not all in memory at once");
        assert_same(&blocks, &kept);
        assert!(blocks["n_used"].as_u64().unwrap() > 1024, "{}", blocks["n_used"]);
        assert_eq!(blocks["truth"]["exitance_w_per_m2"], kept["truth"]["exitance_w_per_m2"]);
    }
}

#[test]
fn the_basis_of_a_long_file_is_chosen_from_some_of_its_sweeps() {
    let bench = Bench::empty();
    let text = samples(0, 60_000, true);
    std::fs::write(bench.path("long.csv"), &text).unwrap();
    let whole = bench.gonio(&["fit", "long.csv", "--json"]).well().json();
    let chosen = &whole["choice"];
    let readings = chosen["n_readings"].as_u64().unwrap();
    assert!((100..=6000).contains(&readings), "{chosen}");
    assert_eq!(whole["n_used"], 60_000);
    assert_eq!(whole["notes"].as_array().unwrap().len(), 2, "{}", whole["notes"]);
    // A wrong sample is named by its line, were it left out of the choice or not.
    let mut lines: Vec<&str> = text.lines().collect();
    let wrong = lines[777].replacen(lines[777].split(',').nth(2).unwrap(), "95.5", 1);
    lines[777] = &wrong;
    std::fs::write(bench.path("wrong.csv"), lines.join("\n")).unwrap();
    bench.gonio(&["fit", "wrong.csv"]).refused(&["line 778", "95.5", "help: "]);
}

#[test]
fn splines_finer_in_a_patch_are_merged_as_they_are_fitted() {
    let bench = Bench::empty();
    // A patch through φ = 0, two spans on each side.
    let patched = "--basis splines --theta-spans 6 --phi-spans 12 --fine-spans 2,5,1 \
                   --fine-phi-spans 10,14,1 --position-degree 0 --penalty-power 2 --penalty-strength 0.1";
    let patched: Vec<&str> = patched.split_whitespace().collect();
    let region = &REGION[..3];
    for (share, from, to) in [("a", 0, 900), ("b", 900, 2000)] {
        std::fs::write(bench.path(&format!("{share}.csv")), samples(from, to, true)).unwrap();
        let (csv, bin) = (format!("{share}.csv"), format!("{share}.bin"));
        bench.gonio(&[&["fit", &csv, "--partial", "-o", &bin], region, &patched].concat()).well();
    }
    std::fs::write(bench.path("all.csv"), samples(0, 2000, true)).unwrap();
    let merged = bench.gonio(&["fit", "--merge", "b.bin", "a.bin", "--json"]).well().json();
    let whole = [&["fit", "all.csv", "--json"], &patched[..]].concat();
    let whole = bench.gonio(&whole).well().json();
    assert_eq!(merged["basis"], whole["basis"]);
    assert!(!merged["basis"]["fine_phi_spans"].is_null(), "{}", merged["basis"]);
    assert_close(&merged["coefficients"], &whole["coefficients"], 1e-6);
    // Elsewhere than in the patch it is another basis.
    let bin = ["fit", "a.csv", "--partial", "-o", "other.bin"];
    let other: Vec<&str> =
        patched.iter().map(|word| if *word == "10,14,1" { "9,13,1" } else { word }).collect();
    bench.gonio(&[&bin, region, &other].concat()).well();
    bench.gonio(&["fit", "--merge", "other.bin", "b.bin"]).refused(&["basis"]);
}

#[test]
fn gaps_and_other_bases_count_in_blocks_as_in_memory() {
    let bench = Bench::empty();
    let text = samples(0, 4_000, true);
    let is_kept = |line: &&str| {
        let phi_deg = line.split(',').nth(3).and_then(|phi| phi.parse::<f64>().ok());
        phi_deg.is_none_or(|phi_deg| !(20.0..90.0).contains(&phi_deg))
    };
    let kept: Vec<&str> = text.lines().filter(is_kept).collect();
    std::fs::write(bench.path("gap.csv"), kept.join("\n")).unwrap();
    let kept = bench.gonio(&["fit", "gap.csv", "--json"]).well().json();
    let blocks = bench.gonio(&["fit", "gap.csv", "--in-blocks", "--json"]).well().json();
    assert_eq!(blocks["choice"], kept["choice"]);
    let exitance = |fit: &Value| fit["exitance_w_per_m2"].clone();
    let (found, expected) = (exitance(&blocks), exitance(&kept));
    let names = |rows: &Value| -> Vec<String> {
        rows.as_array().unwrap().iter().map(|row| row["name"].to_string()).collect()
    };
    assert!(names(&expected["budget"]).contains(&"\"extrapolation\"".to_owned()), "{expected}");
    assert_eq!(names(&found["budget"]), names(&expected["budget"]));
    for (a, b) in
        found["budget"].as_array().unwrap().iter().zip(expected["budget"].as_array().unwrap())
    {
        assert_close(&a["u"], &b["u"], 1e-4);
    }
    let part = expected["measured_fraction"].as_f64().unwrap();
    assert!(part > 0.5 && part < 0.9, "{part}");
    assert_close(&found["measured_fraction"], &expected["measured_fraction"], 1e-3);
}

#[test]
fn a_share_is_looked_at_once_and_refuses_what_takes_more() {
    let bench = bench();
    for (flags, said) in [
        (["--robust", "tukey"], "--partial: robust: "),
        (["--symmetry", "rotational"], "--partial: symmetry: "),
        (["--drift", "yes"], "--partial: drift: "),
    ] {
        let arguments = [&["fit", "a.csv", "-o", "no.bin"], &flags[..], &REGION[..]].concat();
        bench.gonio(&arguments).refused(&[said, "help: "]);
    }
    let missing = ["fit", "nowhere.csv", "--partial", "-o", "no.bin"];
    bench.gonio(&missing).refused(&["nowhere.csv: cannot be read: No such file"]);
    let twice = format!("{}{}", samples(0, 20, true), samples(3, 4, true).lines().last().unwrap());
    std::fs::write(bench.path("twice.csv"), twice).unwrap();
    bench
        .gonio(&["fit", "twice.csv"])
        .refused(&["line 22 repeats line 5 in every field", "help: "]);
}

#[test]
fn a_run_is_a_share_too() {
    // More than a block of readings; and some that were taken in flight.
    let several = Bench::small().with("plan.toml", "phi_step_deg = 45", "phi_step_deg = 10").with(
        "plan.toml",
        "theta_step_deg = 20",
        "theta_step_deg = 10",
    );
    let swept = "kind = \"sweep\"\nnarrowest_feature_deg = 20";
    let flown = Bench::small()
        .with("plan.toml", "kind = \"raster\"", swept)
        .with("plan.toml", "theta_step_deg = 20\n", "")
        .with("plan.toml", "order = \"travel\"\n", "");
    for (bench, least) in [(several, 1025), (flown, 100)] {
        bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
        bench.gonio(&["fit", "out", "--partial", "-o", "out.bin"]).well();
        let merged = bench.gonio(&["fit", "--merge", "out.bin", "--json"]).well().json();
        let whole = bench.json("out/fit.json");
        assert!(merged["n_used"].as_u64().unwrap() >= least, "{}", merged["n_used"]);
        assert_eq!(merged["region"], whole["region"]);
        for key in ["coefficients", "covariance", "n_used", "dof", "n_flagged", "n_excluded"] {
            assert_close(&merged[key], &whole[key], 1e-6);
        }
        assert_knows_as_much(&merged, &whole, 1e-3);
    }
}

/// What was not looked for, what was not measured, and what the functions can't follow.
fn assert_knows_as_much(merged: &Value, whole: &Value, tolerance: f64) {
    let (resolves, expected) = (&merged["resolves"], &whole["resolves"]);
    assert_close(&resolves["measured_to_deg"], &expected["measured_to_deg"], 1e-9);
    for key in ["theta_deg", "phi_deg", "x_mm", "y_mm"] {
        assert_eq!(resolves[key]["limit"], expected[key]["limit"], "{key}");
        if !expected[key].is_null() {
            assert_close(&resolves[key]["width"], &expected[key]["width"], 3e-3);
        }
    }
    assert_eq!(merged["truncation_gain"].is_null(), whole["truncation_gain"].is_null());
    let (exitance, expected) = (&merged["exitance_w_per_m2"], &whole["exitance_w_per_m2"]);
    for key in ["u", "u_independent", "measured_fraction"] {
        assert_close(&exitance[key], &expected[key], tolerance);
    }
}

#[test]
fn what_cannot_be_merged_is_refused_and_says_why() {
    let bench = bench();
    let a = part(&bench, "a");
    let b = part(&bench, "plain-b");
    let merge = |other: &str| bench.gonio(&["fit", "--merge", &a, other, "-o", "no.json"]);
    merge(&b).refused(&["plain-b.bin: weights: ", "expected \"by the stated", "(a.bin)"]);
    let other = [&["fit", "c.csv", "-o", "c.bin"], &REGION[..2], &["--theta-max-deg=85"]];
    let other = [other.concat(), REGION[3..].to_vec()].concat();
    bench.gonio(&other).well();
    merge("c.bin").refused(&["c.bin: region: ", "expected {", "(a.bin)", "help: "]);
    let degree = [&["fit", "c.csv", "-o", "c.bin", "--partial"], &REGION[..3]].concat();
    bench.gonio(&degree).well();
    merge("c.bin").refused(&["c.bin: basis: ", "\"degree\":6", "\"degree\":4"]);
    merge("c.csv").refused(&["c.csv: no partial fit", "help: give files that"]);
    merge("gone.bin").refused(&["gone.bin: "]);
    let mut bytes = std::fs::read(bench.path(&a)).unwrap();
    bytes.truncate(bytes.len() - 100);
    std::fs::write(bench.path("cut.bin"), bytes).unwrap();
    merge("cut.bin").refused(&["cut.bin: ", "cut short"]);
    assert!(!bench.path("no.json").exists());
    // Ten readings do not tell fifteen coefficients.
    bench.gonio(&["fit", "--merge", &a]).refused(&["10 readings are fewer than the 15"]);
    bench.gonio(&["fit", "a.csv", "--partial", "-o", "x.bin"]).refused(&["no region", "--x-mm"]);
    let narrow = [&["fit", "b.csv", "-o", "x.bin", "--x-mm=-1,1"], &REGION[1..]].concat();
    bench.gonio(&narrow).refused(&["b.csv: line 3: ", "outside the region"]);
    assert!(!bench.path("x.bin").exists());
}
