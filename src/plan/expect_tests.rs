//! What `[expect]` takes, and what it refuses by name.

use spanned_toml::{Document, Problem, Source};

use super::{Change, Expect, Plan};
use crate::rig::{Quantity, Rig};

fn read(expect: &str) -> Result<Plan, Problem> {
    let text = format!(
        "[region]\nx_mm = [-1, 1]\ny_mm = [-1, 1]\ntheta_max_deg = 80\n[schedule]\n\
         kind = \"low-discrepancy\"\ncount = 50\n[dwell]\ndwell_ms = 50\n[dark]\n\
         method = \"shutter\"\n[fit]\nangular_degree = 2\nposition_degree = 0\n{expect}"
    );
    Plan::read(Document::parse(Source::new("plan.toml", &text)).unwrap())
}

#[test]
fn without_it_nothing_is_expected() {
    assert_eq!(read("").unwrap().expect, Expect::default());
}

#[test]
fn its_keys_have_their_units() {
    let expect = "[expect]\nradiance_w_per_m2_sr = 40\nbeam_angle_deg = 60\n\
                  narrowest_feature_deg = 90\nnarrowest_feature_mm = 3\n";
    let Expect { level, beam_angle_rad, narrowest_feature_rad, narrowest_feature_m } =
        read(expect).unwrap().expect;
    assert_eq!(level, Some((Quantity::Radiance, 40.0)));
    assert!((beam_angle_rad.unwrap() - 60_f64.to_radians()).abs() < 1e-15);
    assert!((narrowest_feature_rad.unwrap() - 90_f64.to_radians()).abs() < 1e-15);
    assert!((narrowest_feature_m.unwrap() - 0.003).abs() < 1e-18);
}

#[test]
fn it_changes_no_hash() {
    let rig = Rig::built_in().unwrap();
    let hash = |text: &str| {
        let plan = read(text).unwrap();
        plan.hash(&plan.lay_out(&rig, None).unwrap())
    };
    assert_eq!(hash(""), hash("[expect]\nradiance_w_per_m2_sr = 40\nbeam_angle_deg = 60\n"));
}

#[test]
fn what_cannot_be_is_refused_at_its_key() {
    for (expect, key) in [
        ("radiance_w_per_m2_sr = 0", "radiance_w_per_m2_sr"),
        ("radiance_w_per_m2_sr = 1\nradiance_relative = 1", "radiance_relative"),
        ("beam_angle_deg = 180", "beam_angle_deg"),
        ("narrowest_feature_mm = -1", "narrowest_feature_mm"),
        ("radiance = 1", "radiance"),
    ] {
        let problem = read(&format!("[expect]\n{expect}\n")).unwrap_err();
        assert_eq!(problem.key(), format!("expect.{key}"), "{problem}");
    }
    let other = read("[expect]\nluminance_cd_per_m2 = 100\n").unwrap();
    let problem = other.lay_out(&Rig::built_in().unwrap(), None).unwrap_err();
    assert_eq!(problem.key(), "expect.luminance_cd_per_m2", "{problem}");
    assert!(problem.to_string().contains("radiance_w_per_m2_sr"), "{problem}");
}

#[test]
fn the_gain_that_suits_it_is_the_most_sensitive_that_bears_it() {
    let rig = Rig::built_in().unwrap();
    let asked = |expect: &str| {
        let plan = read(expect).unwrap();
        let plan = plan.changed(&[Change::set("dwell", "gain", "\"expected\"")]).unwrap();
        plan.lay_out(&rig, None).map(|sequence| sequence.steps[0].gain)
    };
    let level = |radiance: f64| format!("[expect]\nradiance_w_per_m2_sr = {radiance}\n");
    for gain in 0..u8::try_from(rig.detector.gains.len()).unwrap() {
        let most = 0.6 * rig.detector.saturation_radiance(gain);
        assert_eq!(asked(&level(0.999 * most)).unwrap(), gain, "{most}");
        let next = asked(&level(1.001 * most));
        assert!(next.as_ref().map_or(gain == 0, |next| *next < gain), "{next:?}");
    }
    let problem = asked("").unwrap_err();
    assert_eq!(problem.key(), "dwell.gain", "{problem}");
    assert!(problem.to_string().contains("radiance_w_per_m2_sr"), "{problem}");
}
