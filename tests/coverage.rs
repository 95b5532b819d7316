//! Whether stated uncertainties are honest: over many runs, each of which draws scene, rig and noise
//! anew, errors in units of u scatter like normal numbers. Would break: a component drawn and not
//! stated, stated and not drawn, averaged away though readings share it, or a bias.
//!
//! The long version is `gonio study coverage` without `--short`; docs/measured.md has what it found.

mod bench;

use bench::Bench;
use serde_json::Value;

#[test]
fn what_is_stated_covers_the_truth_with_and_without_the_scale() {
    let bench = Bench::empty();
    let words = ["study", "coverage", "--scenes", "lambertian,lobe", "--short", "--out", "found"];
    // The seed is fixed, so that this passes always or never.
    let said = bench.gonio(&[&words[..], &["--json"]].concat()).well().json();
    let number = |pool: &Value, key: &str| pool[key].as_f64().unwrap();
    let pools = said["pools"].as_array().unwrap();
    // Two scenes and both together, on rigs of two kinds, five quantities each.
    assert_eq!(pools.len(), 3 * 2 * 5);
    for pool in pools.iter().filter(|pool| pool["scene"].is_null()) {
        let rms = number(pool, "rms_error_over_u");
        assert!((0.5..1.6).contains(&rms), "{pool}");
    }
    assert!(said["demands"].as_array().unwrap().iter().all(|d| d["met"] == true), "{said}");
    let csv = bench.text("found/coverage.csv");
    assert!(csv.starts_with("scene,scale,quantity,x_mm,"), "{csv}");
    // M, M within, flux, four I, twenty L.
    assert_eq!(csv.lines().count(), 1 + 2 * 2 * 27);
    assert!(bench.text("found/coverage.svg").contains("lobe"));
}

#[test]
fn runs_that_were_kept_are_not_made_again_and_say_the_same() {
    let bench = Bench::empty();
    let words =
        ["study", "coverage", "--scenes", "lambertian,photometric", "--runs", "2", "--json"];
    let study = |out: &str, cache: &[&str]| {
        let said = bench.gonio(&[&words[..], &["--out", out], cache].concat());
        (said.json()["pools"].clone(), bench.text(&format!("{out}/coverage.csv")))
    };
    let made = study("made", &["--cache", "kept"]);
    let kept = std::fs::read_dir(bench.path("kept")).unwrap().map(|file| file.unwrap().path());
    let kept: Vec<_> = kept.collect();
    // Two runs of each scene, on rigs of two kinds.
    assert_eq!(kept.len(), 8);
    assert_eq!(study("again", &["--cache", "kept"]), made);
    assert_eq!(study("without", &[]), made);
    // That they are taken from there: a run that says otherwise is believed.
    for file in &kept {
        let said = std::fs::read_to_string(file).unwrap();
        let mut run: Value = serde_json::from_str(&said).unwrap();
        run["scores"][0] = serde_json::json!([0.25, 0.125]);
        std::fs::write(file, run.to_string()).unwrap();
    }
    let (pools, _) = study("believed", &["--cache", "kept"]);
    let exitance = |pool: &&Value| pool["quantity"] == "exitance" && !pool["scene"].is_null();
    for pool in pools.as_array().unwrap().iter().filter(exitance) {
        assert_eq!(pool["rms_error_over_u"], 2.0, "{pool}");
    }
}

#[test]
fn of_lamps_whose_basis_is_chosen_the_exitance_beyond_what_was_measured_holds_too() {
    let bench = Bench::empty();
    let words = ["study", "coverage", "--scenes", "photometric", "--unpinned", "--runs", "8"];
    let more = ["--seed", "2", "--out", "found", "--json"];
    let said = bench.gonio(&[&words[..], &more].concat()).json();
    let is_asked = |pool: &&Value| {
        pool["scene"] == "photometric"
            && pool["scale"] == "known exactly"
            && pool["quantity"] == "exitance"
    };
    let pool = said["pools"].as_array().unwrap().iter().find(is_asked).unwrap();
    // By the chosen functions alone it was off by 9 u.
    let rms = pool["rms_error_over_u"].as_f64().unwrap();
    assert!((0.2..2.0).contains(&rms), "{pool}");
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_run() {
    let bench = Bench::empty();
    let study = |words: &[&str]| bench.gonio(&[&["study", "coverage"], words].concat());
    study(&["--scenes", "lambertain"]).refused(&["no `lambertain`", "lambertian, lobe"]);
    study(&["--doc", "measured.md", "--short"]).refused(&["--doc", "--date"]);
    study(&["--runs", "1"]).refused(&["from 2 to 1000000"]);
    assert_eq!(bench.names(), Vec::<String>::new());
    // A file is where the cache should be: nothing is made for a study that can't keep its runs.
    std::fs::write(bench.path("kept"), "").unwrap();
    study(&["--short", "--cache", "kept", "--out", "found"]).refused(&["--cache kept", "choose"]);
    assert_eq!(bench.names(), ["kept"]);
}

/// Radiances along a few rays of a run by this seed, with the part of u that all readings share.
fn radiances(bench: &Bench, seed: u64) -> Vec<(f64, f64)> {
    let (seed, out) = (seed.to_string(), format!("run-{seed}"));
    bench.gonio(&["run", "plan.toml", "--seed", &seed, "--out", &out]).well();
    let said = bench.gonio(&["fit", &out, "--at", "rays.csv"]).well();
    let number = |field: Option<&str>| field.unwrap().parse::<f64>().unwrap();
    let pair = |line: &str| {
        let [value, u, independent] = [4, 5, 6].map(|column| number(line.split(',').nth(column)));
        (value, (u * u - independent * independent).sqrt())
    };
    said.out.lines().skip(1).map(pair).collect()
}

#[test]
fn a_rig_that_stands_askew_is_off_by_what_its_alignment_says() {
    // A slope in x times the square of the cosine: the basis follows it.
    let scene = "[[emitter]]\nkind = \"image\"\nfile = \"ramp.pgm\"\nexponent = 2\nx_mm = [-60, 60]\n\
                 y_mm = [-60, 60]\nradiance_w_per_m2_sr = 50\n";
    let columns: Vec<String> = (0..4099).map(|i| (9_000 + 12 * i).to_string()).collect();
    let bench = || {
        let rays = "x_mm,y_mm,theta_deg,phi_deg\n0,0,40,0\n0,0,50,75\n0,0,60,150\n0,0,45,-120\n";
        Bench::small()
            .having("scene.toml", scene)
            .having("ramp.pgm", format!("P2\n4099 1\n65535\n{}\n", columns.join("\n")))
            .having("rays.csv", rays)
    };
    // Nothing is uncertain but the alignment.
    let known: String = (bench().text("rig.toml").lines())
        .map(|line| match line.split_once(" = ") {
            Some((key, _)) if key.starts_with("u_") => format!("{key} = 0\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    let straight = bench().having("rig.toml", &known);
    let askew = bench().having("rig.toml", known).with(
        "rig.toml",
        "[link]",
        "[alignment]\nu_offset_x_mm = 0.5\nu_offset_z_mm = 0.5\nu_tilt_deg = 0.3\n\n[link]",
    );
    let straight = radiances(&straight, 1);
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 1..=8 {
        for ((value, _), (off, own)) in straight.iter().zip(radiances(&askew, seed)) {
            assert!(own > 1e-3 * value, "{own} of {value}");
            squares += ((off - value) / own).powi(2);
            count += 1.0;
        }
    }
    let rms = (squares / count).sqrt();
    assert!((0.6..1.5).contains(&rms), "{rms}");
}
