//! rig.toml as people get it wrong.

use std::time::Duration;

use spanned_toml::{Document, Problem, Source};

use super::*;

const BUILT_IN: &str = include_str!("simulated.toml");

fn read(text: &str) -> Result<Rig, Problem> {
    Rig::read(Document::parse(Source::new("rig.toml", text))?)
}

/// The built-in rig with the first of some words replaced.
fn changed(from: &str, to: &str) -> Result<Rig, Problem> {
    assert!(BUILT_IN.contains(from), "{from}");
    read(&BUILT_IN.replacen(from, to, 1))
}

#[test]
fn the_built_in_rig_is_a_simulated_gantry() {
    let rig = Rig::built_in().unwrap();
    assert!(rig.is_simulated());
    for (axis, name) in rig.axes.iter().zip(AXES) {
        assert_eq!(axis.name, name);
    }
    let [theta, _, x, _] = &rig.axes;
    assert!((theta.speed.to_degrees() - 60.0).abs() < 1e-12);
    assert!((theta.counts_per_unit * 1.0_f64.to_radians() - 1000.0).abs() < 1e-9);
    assert_eq!((x.travel, x.settle), ((-0.05, 0.05), Duration::from_millis(50)));
    assert_eq!(rig.detector.gain_index("100 nA"), Some(1));
    assert_eq!(rig.link.baud(), 1_000_000);
    assert!(rig.document().root().table("simulated").unwrap().is_some());
}

#[test]
fn every_mistake_is_named_at_its_line() {
    for (from, to, key) in [
        ("travel_deg = [-95, 95]", "travel_deg = [95, -95]", "axes.theta.travel_deg"),
        ("travel_deg = [-95, 95]", "travel_deg = [5, 95]", "axes.theta.travel_deg"),
        ("travel_deg = [-95, 95]", "travel_mm = [-95, 95]", "axes.theta.travel_mm"),
        ("speed_deg_per_s = 60", "speed_deg_per_s = 0", "axes.theta.speed_deg_per_s"),
        (
            "acceleration_deg_per_s2 = 120",
            "acceleration_deg_per_s2 = 0",
            "axes.theta.acceleration_deg_per_s2",
        ),
        ("counts_per_deg = 1000", "counts_per_deg = 1e9", "axes.theta.counts_per_deg"),
        ("counts_per_deg = 1000", "counts_per_deg = 1e-3", "axes.theta.counts_per_deg"),
        ("channel = 1", "channel = 0", "axes.phi.channel"),
        ("channel = 1", "channel = 4", "axes.phi.channel"),
        ("settle_ms = 50", "settle_ms = -1", "axes.theta.settle_ms"),
        ("approach = \"either\"", "approach = \"up\"", "axes.theta.approach"),
        ("approach = \"either\"", "approach = \"either\"\nrun_up_deg = 1", "axes.theta.run_up_deg"),
        ("readback = \"encoder\"", "readback = \"guess\"", "axes.theta.readback"),
        ("u_zero_deg = 0.02 ", "u_zero_deg = nan #", "axes.theta.u_zero_deg"),
        ("[axes.y]", "[axes.z]", "axes.y"),
        ("quantity = \"radiance\"", "quantity = \"luminance\"", "detector.responsivity_a_per_lm"),
        ("quantity = \"radiance\"", "quantity = \"relative\"", "detector.responsivity_a_per_w"),
        (
            "read_noise_a",
            "spectral_mismatch = 1.02\nread_noise_a",
            "detector.u_spectral_mismatch_relative",
        ),
        ("read_noise_a", "spectral_mismatch = 0.02\nread_noise_a", "detector.spectral_mismatch"),
        (
            "read_noise_a",
            "u_spectral_mismatch_relative = 2\nread_noise_a",
            "detector.u_spectral_mismatch_relative",
        ),
        ("[link]", "[alignment]\nu_offset_x_mm = -0.1\n[link]", "alignment.u_offset_x_mm"),
        ("[link]", "[alignment]\nu_beam_deg = 11\n[link]", "alignment.u_beam_deg"),
        ("[link]", "[alignment]\nu_offset_mm = 0.1\n[link]", "alignment.u_offset_mm"),
        ("distance_mm = 300", "distance_mm = 0", "detector.distance_mm"),
        ("distance_mm = 300", "distance_mm = 1e200", "detector.distance_mm"),
        ("pupil_diameter_mm = 12.5", "pupil_diameter_mm = -12.5", "detector.pupil_diameter_mm"),
        ("name = \"100 nA\"", "name = \"1 uA\"", "detector.gain[1].name"),
        ("full_scale_a = 1e-6", "full_scale_a = inf", "detector.gain[0].full_scale_a"),
        ("bits = 20", "bits = 7", "detector.adc.bits"),
        ("rate_hz = 2000", "rate_hz = 0", "detector.adc.rate_hz"),
        ("kind = \"simulated\"", "kind = \"serial\"", "link.port"),
        ("kind = \"simulated\"", "kind = \"serial\"\nport = \"/dev/ttyUSB0\"", "simulated"),
        ("baud = 1_000_000", "baud = 300", "link.baud"),
        ("baud = 1_000_000", "port = \"/dev/ttyUSB0\"", "link.port"),
    ] {
        let problem = changed(from, to).unwrap_err();
        assert_eq!(problem.key(), key, "{problem}");
        assert!(problem.line_and_column().is_some(), "{problem}");
        assert!(problem.to_string().contains("expected"), "{problem}");
    }
}

#[test]
fn a_serial_link_waits_for_a_board_that_resets() {
    let serial = "kind = \"serial\"\nport = \"/dev/ttyUSB0\"\nreset_on_open = true";
    let text = BUILT_IN.replace("kind = \"simulated\"", serial);
    let text = text.split("[simulated]").next().unwrap();
    let rig = read(text).unwrap();
    let Link::Serial { port, reset_on_open, boot_wait, .. } = rig.link else {
        panic!("{:?}", rig.link)
    };
    assert_eq!((port.as_str(), reset_on_open, boot_wait.as_secs()), ("/dev/ttyUSB0", true, 2));
}

#[test]
fn alignment_is_known_exactly_unless_it_is_stated_otherwise() {
    assert_eq!(Rig::built_in().unwrap().alignment, Alignment::default());
    let rig =
        changed("[link]", "[alignment]\nu_offset_z_mm = 0.2\nu_tilt_deg = 0.1\n\n[link]").unwrap();
    let expected = Alignment {
        u_offset_m: [0.0, 0.0, 0.2e-3],
        u_tilt_rad: 0.1_f64.to_radians(),
        ..Alignment::default()
    };
    assert_eq!(rig.alignment, expected);
}

#[test]
fn quantities_other_than_radiance_carry_other_names() {
    let text = BUILT_IN
        .replace("\"radiance\"", "\"luminance\"")
        .replace("responsivity_a_per_w", "responsivity_a_per_lm");
    let quantity = read(&text).unwrap().detector.quantity;
    assert_eq!(quantity.radiance_column(), "luminance_cd_per_m2");
    assert_eq!(quantity.flux_key(), "luminous_flux_lm");
    let text = BUILT_IN
        .replace("\"radiance\"", "\"relative\"")
        .replace("responsivity_a_per_w = 0.2", "")
        .replace("u_responsivity_relative = 0.005", "");
    let mismatched =
        text.replace("read_noise_a", "u_spectral_mismatch_relative = 0.01\nread_noise_a");
    let problem = read(&mismatched).unwrap_err();
    assert!(problem.to_string().contains("without a calibration"), "{problem}");
    let detector = read(&text).unwrap().detector;
    assert_eq!(detector.quantity.radiance_column(), "radiance_relative");
    assert_eq!(detector.responsivity.to_bits(), 1.0_f64.to_bits());
}
