//! plan.toml as people get it wrong.

use std::time::Duration;

use fit::{AngularKind, Around, Fine, Outline, Spans, Wish};
use spanned_toml::{Document, Problem, Source};

use super::*;
use crate::rig::Rig;

const FULL: &str = r#"
name = "luminaire"
rig = "rig.toml"
scene = "scene.toml"
[region]
x_mm = [-20, 20]
y_mm = [-10, 20]
theta_max_deg = 80
[schedule]
kind = "raster"
x_count = 3
y_count = 2
theta_step_deg = 5
phi_step_deg = 7.5
order = "travel"
repeat = 2
[dwell]
dwell_ms = 50
gain = "1 uA"
[dark]
every = 200
dwell_ms = 200
method = "shutter"
[reference]
x_mm = 1
y_mm = 2
theta_deg = 30
phi_deg = -180
every = 100
dwell_ms = 100
[warm_up]
tolerance_relative = 0.002
over_s = 60
timeout_s = 1800
[stop]
exitance_relative = 0.01
rig_time_s_max = 3600
[fit]
angular_degree = 8
position_degree = 2
"#;

fn read(text: &str) -> Result<Plan, Problem> {
    Plan::read(Document::parse(Source::new("plan.toml", text))?)
}

#[test]
fn every_key_is_read_in_si_units() {
    let plan = read(FULL).unwrap();
    assert_eq!(plan.name.as_deref(), Some("luminaire"));
    assert_eq!(
        (plan.rig.as_deref(), plan.scene.as_deref()),
        (Some("rig.toml"), Some("scene.toml"))
    );
    assert_eq!((plan.region.x_m, plan.region.y_m), ((-0.02, 0.02), (-0.01, 0.02)));
    assert_eq!(plan.dwell, Duration::from_millis(50));
    assert_eq!((plan.order, plan.repeat), (Order::Travel, 2));
    assert_eq!(plan.reference.pose.phi_rad.to_bits(), std::f64::consts::PI.to_bits());
    assert_eq!(plan.warm_up.unwrap().timeout, Duration::from_mins(30));
    assert_eq!(plan.stop.rig_time_max, Some(Duration::from_hours(1)));
    let degrees = Wish { angular_degree: Some(8), position_degree: Some(2), ..Wish::default() };
    assert_eq!(plan.fit, degrees);
}

#[test]
fn a_plan_pins_splines() {
    let pins = "theta_spans = 7\nphi_spans = 12\nfine_spans = [0, 2, 3]";
    let plan = read(&FULL.replace("angular_degree = 8", pins)).unwrap();
    let fine = Fine { from: 0, to: 2, halvings: 3, ..Fine::NONE };
    let spans = Some(Spans { theta: 7, phi: 12, fine });
    let kind = Some(AngularKind::Splines);
    assert_eq!(plan.fit, Wish { kind, spans, position_degree: Some(2), ..Wish::default() });
    // And a patch of directions, through φ = 0.
    let pins = pins.replace("[0, 2, 3]", "[5, 7, 0]\nfine_phi_spans = [11, 14, 2]");
    let plan = read(&FULL.replace("angular_degree = 8", &pins)).unwrap();
    let around = Around { from: 11, to: 14, halvings: 2 };
    let fine = Fine { from: 5, to: 7, halvings: 0, around };
    assert_eq!(plan.fit.spans, Some(Spans { theta: 7, phi: 12, fine }));
}

#[test]
fn what_a_plan_leaves_out_has_a_default() {
    let text = "[region]\nx_mm = [0, 10]\ny_mm = [-4, 4]\ntheta_max_deg = 90\n\
                [schedule]\nkind = \"low-discrepancy\"\ncount = 10\n\
                [dwell]\ndwell_ms = 10\n[dark]\nmethod = \"shutter\"\n\
                [fit]\nangular_degree = 2\nposition_degree = 0\n";
    let plan = read(text).unwrap();
    assert_eq!((plan.dark.every, plan.dark.dwell), (200, Duration::from_millis(40)));
    assert_eq!((plan.reference.every, plan.reference.dwell), (100, Duration::from_millis(20)));
    assert_eq!((plan.reference.pose.x_m, plan.reference.pose.theta_rad), (0.005, 0.0));
    assert_eq!((plan.gain, plan.warm_up, plan.stop), (None, None, Stop::default()));
    assert_eq!(plan.sample, None);
}

#[test]
fn the_sample_s_outline_is_a_rectangle_or_a_disk_that_holds_the_region() {
    let with = |sample: &str| read(&FULL.replace("[dark]", &format!("[sample]\n{sample}\n[dark]")));
    let rectangle = with("x_mm = [-30, 30]\ny_mm = [-10, 25]").unwrap().sample;
    let (x_m, y_m) = ((-0.03, 0.03), (-0.01, 0.025));
    assert_eq!(rectangle, Some(Outline::Rectangle { x_m, y_m }));
    let disk = with("radius_mm = 30\ncentre_mm = [0, 5]").unwrap().sample;
    assert_eq!(disk, Some(Outline::Disk { centre_m: (0.0, 0.005), radius_m: 0.03 }));
    assert!(with("radius_mm = 30").is_ok());
    for (sample, key) in [
        ("", "sample.x_mm"),
        ("x_mm = [-30, 30]", "sample.x_mm"),
        ("y_mm = [-30, 30]", "sample.y_mm"),
        ("radius_mm = -3", "sample.radius_mm"),
        ("centre_mm = [0, 0]", "sample.centre_mm"),
        ("x_mm = [-30, 30]\ny_mm = [-30, 30]\nradius_mm = 30", "sample.radius_mm"),
        ("x_mm = [-30, 30]\ny_mm = [-30, 30]\ncentre_mm = [0, 0]", "sample.centre_mm"),
        ("x_mm = [-30, 19]\ny_mm = [-30, 30]", "sample.x_mm"),
        ("radius_mm = 25", "sample.radius_mm"),
        ("radius_mm = 30\nrim_mm = 3", "sample.rim_mm"),
    ] {
        assert_eq!(with(sample).unwrap_err().key(), key, "{sample}");
    }
    let hash = |plan: Plan| plan.hash(&plan.lay_out(&Rig::built_in().unwrap(), None).unwrap());
    let without = hash(read(FULL).unwrap());
    assert_ne!(hash(with("radius_mm = 30").unwrap()), without);
}

#[test]
fn every_mistake_is_named_at_its_line() {
    for (from, to, key) in [
        ("x_mm = [-20, 20]", "x_mm = [20, -20]", "region.x_mm"),
        ("y_mm = [-10, 20]", "y_mm = [3, 3]", "region.y_mm"),
        ("theta_max_deg = 80", "theta_max_deg = 95", "region.theta_max_deg"),
        ("theta_max_deg = 80", "theta_max_deg = nan", "region.theta_max_deg"),
        ("x_count = 3", "x_count = 0", "schedule.x_count"),
        ("theta_step_deg = 5", "theta_step_deg = 0", "schedule.theta_step_deg"),
        ("phi_step_deg = 7.5", "phi_step_deg = 7", "schedule.phi_step_deg"),
        ("phi_step_deg = 7.5", "c_step_deg = 7.5", "schedule.phi_step_deg"),
        ("repeat = 2", "repeat = 2\ncount = 3", "schedule.count"),
        ("order = \"travel\"", "order = \"random\"", "schedule.order"),
        ("dwell_ms = 50", "dwell_ms = -50", "dwell.dwell_ms"),
        ("method = \"shutter\"", "method = \"off\"", "dark.method"),
        ("every = 200", "every = 0", "dark.every"),
        ("theta_deg = 30", "theta_deg = 91", "reference.theta_deg"),
        ("timeout_s = 1800", "timeout_s = 30", "warm_up.timeout_s"),
        ("exitance_relative", "exitence_relative", "stop.exitence_relative"),
        ("angular_degree = 8", "angular_degree = 8.5", "fit.angular_degree"),
        ("scene = \"scene.toml\"", "scenes = \"scene.toml\"", "scenes"),
        ("name = \"luminaire\"", "name = \"../luminaire\"", "name"),
        ("[fit]", "[fitting]", "fitting"),
        ("angular_degree = 8", "basis = \"zernicke\"", "fit.basis"),
        ("angular_degree = 8", "angular_degree = 8\nbasis = \"splines\"", "fit.angular_degree"),
        ("angular_degree = 8", "penalty_power = -1", "fit.penalty_power"),
        ("angular_degree = 8", "theta_spans = 8", "fit.theta_spans"),
        ("angular_degree = 8", "phi_spans = 0", "fit.phi_spans"),
        ("angular_degree = 8", "fine_spans = [0, 1, 1]", "fit.fine_spans"),
        (
            "angular_degree = 8",
            "theta_spans = 4\nphi_spans = 8\nfine_spans = [2, 5, 1]",
            "fit.fine_spans",
        ),
        ("angular_degree = 8", "fine_phi_spans = [0, 1, 1]", "fit.fine_phi_spans"),
        (
            "angular_degree = 8",
            "theta_spans = 4\nphi_spans = 8\nfine_phi_spans = [0, 1, 1]",
            "fit.fine_phi_spans",
        ),
        (
            "angular_degree = 8",
            "theta_spans = 4\nphi_spans = 8\nfine_spans = [2, 4, 1]\nfine_phi_spans = [8, 9, 1]",
            "fit.fine_phi_spans",
        ),
        (
            "angular_degree = 8",
            "basis = \"spherical\"\ntheta_spans = 4\nphi_spans = 8",
            "fit.theta_spans",
        ),
        ("angular_degree = 8", "theta_spans = 60\nphi_spans = 60", "fit.theta_spans"),
        ("angular_degree = 8", "cosine_columns = 2", "fit.cosine_columns"),
        ("angular_degree = 8", "position_spans = 4", "fit.position_spans"),
        ("angular_degree = 8", "robust = \"hubert\"", "fit.robust"),
        ("angular_degree = 8", "nonnegative = 1", "fit.nonnegative"),
        ("angular_degree = 8", "symmetry = \"round\"", "fit.symmetry"),
        ("angular_degree = 8", "symmetry_phi_deg = 10", "fit.symmetry_phi_deg"),
    ] {
        assert!(FULL.contains(from), "{from}");
        let problem = read(&FULL.replace(from, to)).unwrap_err();
        assert_eq!(problem.key(), key, "{problem}");
        assert!(problem.line_and_column().is_some(), "{problem}");
        assert!(problem.to_string().contains("expected"), "{problem}");
    }
}

#[test]
fn what_the_fit_leaves_open_is_left_to_the_readings() {
    let open = FULL.split("[fit]").next().unwrap();
    assert_eq!(read(open).unwrap().fit, Wish::default());
    assert!(read(open).unwrap().fit.decided().is_none());
    let pinned = format!("{open}[fit]\nbasis = \"even-harmonics\"\nangular_degree = 6\n");
    let fit = read(&pinned).unwrap().fit;
    assert_eq!((fit.kind, fit.angular_degree), (Some(AngularKind::EvenHarmonics), Some(6)));
    assert_eq!(fit.position_degree, None);
    let ruled = format!(
        "{pinned}robust = \"tukey\"\nnonnegative = true\nsymmetry = \"plane\"\n\
         symmetry_phi_deg = 90\ndrift = false\n"
    );
    let rules = read(&ruled).unwrap().fit.rules;
    let phi_rad = 90_f64.to_radians();
    let expected = fit::Rules {
        robust: fit::Robust::Tukey,
        nonnegative: true,
        symmetry: Some(fit::Symmetry::Plane { phi_rad }),
        drift: Some(false),
        ranges: None,
    };
    assert_eq!((fit.rules, rules), (fit::Rules::default(), expected));
}
