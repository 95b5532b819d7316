//! What could break: a column that moves, a digit that is lost on the way through a file, a bad
//! file that is half believed.

use proptest::prelude::*;

use super::*;
use crate::rig::calibration::{Flag, Flags, Sample, calibrate};
use crate::rig::{
    AxisPositions, Latched, ModelledVariance, Pose, Quantity, Reading, ReadingKind, Rig,
};

fn sample(value: f64, u: f64, pose: Pose) -> Sample {
    Sample {
        index: 7,
        repeat: 1,
        reading: 9,
        session: 0,
        gain: 0,
        time_s: 0.1 + 0.2,
        dwell_s: 0.05,
        pose,
        way: None,
        positions: AxisPositions([0.0; 4]),
        value,
        u_independent: 0.25,
        u_common: 0.125,
        u,
        noise: ModelledVariance { floor: 1.0, per_radiance: 0.0, read: 1.0, quantisation: 0.0 },
        u_scale_relative: 0.0,
        u_dark: 0.0,
        flags: Flags::default(),
    }
}

fn pose(x_m: f64, y_m: f64, theta_rad: f64, phi_rad: f64) -> Pose {
    Pose { x_m, y_m, theta_rad, phi_rad }
}

fn samples_csv(quantity: Quantity, samples: &[Sample]) -> String {
    let mut text = Vec::new();
    write_samples(&mut text, quantity, samples).unwrap();
    String::from_utf8(text).unwrap()
}

#[test]
fn samples_csv_is_as_the_contract_says() {
    let mut flagged = sample(-1.5, 1e-7, pose(0.002, -0.001, 0.0, std::f64::consts::PI));
    flagged.flags.set(Flag::Drift, true);
    flagged.flags.set(Flag::BelowNoise, true);
    assert_eq!(
        samples_csv(Quantity::Radiance, &[flagged]),
        "index,time_s,x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,u_radiance_w_per_m2_sr,\
         dwell_s,flags,u_independent_radiance_w_per_m2_sr,u_common_radiance_w_per_m2_sr,repeat,\
         reading\n\
         7,0.30000000000000004,2,-1,0,180,-1.5,1e-7,0.05,below_noise|drift,0.25,0.125,1,9\n"
    );
}

#[test]
fn other_quantities_have_their_own_columns() {
    for (quantity, columns) in [
        (Quantity::Luminance, ",luminance_cd_per_m2,u_luminance_cd_per_m2,dwell_s,"),
        (Quantity::Relative, ",radiance_relative,u_radiance_relative,dwell_s,"),
    ] {
        let text = samples_csv(quantity, &[sample(1.0, 0.1, pose(0.0, 0.0, 0.0, 0.0))]);
        assert!(text.contains(columns) && !text.contains("w_per_m2"), "{text}");
        assert_eq!(read_samples(text.as_bytes()).unwrap().quantity, quantity);
    }
}

proptest! {
    #[test]
    fn samples_come_back_to_the_same_bits(
        numbers in proptest::collection::vec((
            -1e3_f64..1e9, 1e-12_f64..1e3, -0.1_f64..0.1, -1e-9_f64..1e-9, 0.0_f64..1.57,
            -3.1_f64..3.15,
        ), 1..20),
        flags in 0..Flag::ALL.len(),
    ) {
        let mut samples: Vec<Sample> = numbers
            .into_iter()
            .map(|(value, u, x, y, theta, phi)| sample(value, u, pose(x, y, theta, phi)))
            .collect();
        samples[0].flags.set(Flag::ALL[flags], true);
        let text = samples_csv(Quantity::Radiance, &samples);
        let read = read_samples(text.as_bytes()).unwrap();
        prop_assert_eq!(read.samples.len(), samples.len());
        for ((i, read), sample) in read.samples.iter().enumerate().zip(&samples) {
            prop_assert_eq!(read.line, i as u64 + 2);
            prop_assert_eq!(read.value.to_bits(), sample.value.to_bits());
            prop_assert_eq!(read.u.unwrap().to_bits(), sample.u.to_bits());
            prop_assert_eq!(read.flags, sample.flags);
            // 3.15 radians are more than half a turn: a file has them the other way round.
            let mut written = RayColumns::from(sample.pose);
            if written.phi_deg > 180.0 {
                written.phi_deg -= 360.0;
            }
            prop_assert_eq!(read.ray.numbers().map(f64::to_bits), written.numbers().map(f64::to_bits));
        }
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = read_samples(&bytes);
        let _ = read_rays(RayChart::Surface, &bytes);
    }

    #[test]
    fn arbitrary_fields_never_panic(text in "[-0-9.e,naif\n\"#|]{0,80}") {
        let header = "x_mm,y_mm,theta_deg,phi_deg,radiance_relative\n";
        let _ = read_samples(format!("{header}{text}").as_bytes());
    }
}

#[test]
fn a_file_from_elsewhere_needs_five_columns_in_any_order() {
    let text = "\u{feff}# measured by hand\r\n\
        note, phi_deg ,luminance_cd_per_m2,theta_deg,y_mm,x_mm\r\n\
        \"a, b\",270,1.5e3, 45 ,0,-2.5\r\n\
        # the shutter stuck here\r\n\
        ,0,-3,0,0,0\r\n";
    let read = read_samples(text.as_bytes()).unwrap();
    assert_eq!(read.quantity, Quantity::Luminance);
    assert!(!read.has_u());
    let [first, second] = read.samples.as_slice() else { panic!("{read:?}") };
    let ray = RayColumns { x_mm: -2.5, y_mm: 0.0, theta_deg: 45.0, phi_deg: -90.0 };
    assert_eq!((first.ray, first.value.to_bits()), (ray, 1.5e3_f64.to_bits()));
    assert_eq!((first.line, second.line), (3, 5));
    assert!((first.ray.ray().x_m + 2.5e-3).abs() < 1e-18);
}

#[test]
fn a_bad_file_is_refused_with_line_column_and_remedy() {
    let header = "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,u_radiance_w_per_m2_sr";
    for (rows, message) in [
        (
            "0,0,0,0,1,0.1\n0,0,0,0,NaN,0.1",
            "line 3, column radiance_w_per_m2_sr: \"NaN\"; \
            expected a number from -1e100 to 1e100",
        ),
        ("0,inf,0,0,1,0.1", "line 2, column y_mm: \"inf\"; expected a finite number"),
        (
            "0,0,90.5,0,1,0.1",
            "line 2, column theta_deg: \"90.5\"; expected an angle in [0, 90] \
            (to 180 with --chart perpendicular or --chart environment)",
        ),
        (
            "0,0,-1,0,1,0.1",
            "line 2, column theta_deg: \"-1\"; expected an angle in [0, 90] \
            (to 180 with --chart perpendicular or --chart environment)",
        ),
        (
            "0,0,0,361,1,0.1",
            "line 2, column phi_deg: \"361\"; expected an angle in (-180, 180], \
            or in [0, 360]",
        ),
        (
            "0,0,0,0,1,0",
            "line 2, column u_radiance_w_per_m2_sr: \"0\"; expected a number greater \
            than 0, up to 1e100",
        ),
        (
            "0,0,0,0,-1e300,0.1",
            "line 2, column radiance_w_per_m2_sr: \"-1e300\"; expected a number from -1e100 to 1e100",
        ),
        (
            "0,0,0,0,,0.1",
            "line 2, column radiance_w_per_m2_sr: \"\"; expected a number from -1e100 to 1e100",
        ),
        (
            "0,0,0,0,1,1\n\n# a note\n\n0,0,0,0,1\n",
            "line 6: 5 fields; expected 6, as in the header",
        ),
        ("", "no rows below the header; expected at least one"),
    ] {
        let error = read_samples(format!("{header}\n{rows}\n").as_bytes()).unwrap_err();
        assert_eq!(error.to_string(), message);
    }
    for (text, message) in [
        (
            "x_mm;y_mm\n0,5;1\n",
            "line 1: \"x_mm;y_mm\"; expected commas between fields, and \
            decimal points",
        ),
        (
            "x_mm,y_mm,theta_deg\n",
            "line 1: no column phi_deg; the columns are: x_mm, y_mm, \
            theta_deg",
        ),
        (
            "x_mm,y_mm,theta_deg,phi_deg,value\n",
            "line 1: no column radiance_w_per_m2_sr or \
            luminance_cd_per_m2 or radiance_relative; the columns are: x_mm, y_mm, theta_deg, \
            phi_deg, value",
        ),
        (
            "x_mm,y_mm,x_mm,theta_deg,phi_deg\n",
            "line 1: columns x_mm and x_mm: expected one of \
            them",
        ),
        ("", "line 1: no column x_mm; the columns are: none: the file is empty"),
    ] {
        assert_eq!(read_samples(text.as_bytes()).unwrap_err().to_string(), message);
    }
    let binary = read_samples(b"\x89PNG\r\n\x1a\n\0\0\0\xff").unwrap_err();
    assert!(matches!(binary, CsvError::Malformed { .. } | CsvError::NoColumn { .. }), "{binary}");
}

#[test]
fn without_a_column_for_u_it_is_stated_or_left_to_the_fit() {
    let header = "x_mm,y_mm,theta_deg,phi_deg,radiance_relative,flags";
    let text = format!("{header}\n0,0,0,0,3,\n0,0,0,0,4,odd|drift\n0,0,0,0,9,saturated\n");
    let read = read_samples(text.as_bytes()).unwrap();
    assert_eq!(read.flagged(), 2);
    let noises = |u_relative| -> Vec<fit::Noise> {
        read.fit_samples(u_relative).iter().map(|sample| sample.noise).collect()
    };
    assert_eq!(noises(None), [fit::Noise::Unknown; 2]);
    // One for all, of the root mean square sqrt((9 + 16) / 2).
    assert_eq!(noises(Some(0.5)), [fit::Noise::Fixed { variance: 0.25 * 12.5 }; 2]);
    let stated = text.replace("flags", "u_radiance_relative").replace(",odd|drift", ",0.5");
    let stated = stated.replace("3,\n", "3,0.25\n").replace("saturated", "1");
    let samples = read_samples(stated.as_bytes()).unwrap().fit_samples(Some(0.5));
    assert_eq!(samples[0].noise, fit::Noise::Fixed { variance: 0.0625 });
}

#[test]
fn values_at_listed_rays_stand_beside_the_rays_as_listed() {
    let text = "theta_deg,phi_deg,y_mm,x_mm\n12.3,-45.6,0.1,7\n";
    let rays = read_rays(RayChart::Surface, text.as_bytes()).unwrap();
    let estimate = fit::Estimate { value: 1.5, u: 0.25, u_independent: 0.125 };
    let mut out = Vec::new();
    let rays = rays.into_iter();
    write_at(&mut out, Quantity::Radiance, RayChart::Surface, rays.map(|ray| (ray, estimate)))
        .unwrap();
    assert_eq!(
        String::from_utf8(out).unwrap(),
        "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,u_radiance_w_per_m2_sr,\
         u_independent_radiance_w_per_m2_sr\n7,0.1,12.3,-45.6,1.5,0.25,0.125\n"
    );
}

fn reading(id: u32, kind: ReadingKind) -> Reading {
    Reading {
        id,
        kind,
        gain: 1,
        n: 100,
        mean: 1234.5,
        variance: 0.1,
        min: -5,
        max: 2000,
        saturated: 0,
        commanded: Latched([10_000, 0, 1000, 0]),
        travel: Latched([0; 4]),
        start: Latched([10_000, 0, 1001, 0]),
        end: Latched([10_000, 0, 1001, 0]),
        start_us: 500_000,
        end_us: 550_000,
        time_s: 0.5,
        session: 0,
        device_times: crate::rig::DeviceTimes::default(),
        link_retries: 3,
        unsettled: true,
    }
}

#[test]
fn readings_csv_holds_every_kind_raw() {
    let rig = Rig::built_in().unwrap();
    let readings = [
        reading(0, ReadingKind::Dark),
        reading(1, ReadingKind::Reference),
        reading(2, ReadingKind::WarmUp),
        reading(3, ReadingKind::Target { index: 5, repeat: 1 }),
    ];
    let mut out = Vec::new();
    write_readings(&mut out, &rig, readings.into_iter().map(Ok)).unwrap();
    let text = String::from_utf8(out).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        "reading,kind,index,repeat,session,time_s,gain,n,mean_counts,variance_counts2,min_counts,\
         max_counts,saturated,commanded_x_mm,commanded_y_mm,commanded_theta_deg,\
         commanded_phi_deg,x_mm,y_mm,theta_deg,phi_deg,commanded_theta_counts,\
         commanded_phi_counts,commanded_x_counts,commanded_y_counts,start_theta_counts,\
         start_phi_counts,start_x_counts,start_y_counts,end_theta_counts,end_phi_counts,\
         end_x_counts,end_y_counts,start_us,end_us,link_retries,unsettled"
    );
    assert!(lines[1].starts_with("0,dark,,,0,0.5,100 nA,100,1234.5,0.1,-5,2000,0,1,0,10,0,1.001,"));
    assert!(lines[4].starts_with("3,target,5,1,"));
    assert!(lines[4].ends_with(",10000,0,1000,0,10000,0,1001,0,10000,0,1001,0,500000,550000,3,1"));
}

#[test]
fn the_metadata_say_what_is_missing_and_what_is_common() {
    let rig = Rig::built_in().unwrap();
    let readings =
        [reading(0, ReadingKind::Dark), reading(1, ReadingKind::Target { index: 0, repeat: 0 })];
    let calibrated = calibrate(&rig, &readings).unwrap();
    let meta = SamplesMeta {
        rig: &rig,
        calibrated: &calibrated,
        program_version: "0.1.0",
        simulated: true,
        seed: 1,
        plan_name: "luminaire",
        plan_hash: "00ff",
        started_utc: "2026-11-22T01:02:03Z",
        targets_measured: 1,
        samples_flagged: 0,
        targets_planned: 3,
        effects: &[],
    };
    let mut out = Vec::new();
    meta.write(&mut out).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&out).unwrap();
    assert_eq!(json["simulated"], true);
    assert_eq!(json["targets"], "1 of 3 targets measured");
    assert_eq!(json["complete"], false);
    assert_eq!(json["unit"], "W/(m² sr)");
    let components = json["common_components"].as_array().unwrap();
    let zero = components.iter().find(|component| component["name"] == "theta zero").unwrap();
    assert_eq!(zero["unit"], "deg");
    assert!((zero["u"].as_f64().unwrap() - 0.02).abs() < 1e-15);
    let header = samples_csv(rig.detector.quantity, &calibrated.samples);
    for column in header.lines().next().unwrap().split(',') {
        assert!(json["columns"][column].is_object(), "{column}");
    }
}

#[test]
fn accuracy_is_written_against_rig_time() {
    let exitance = fit::Estimate { value: 2.0, u: 0.5, u_independent: 0.25 };
    let flux = fit::Estimate { value: 4.0, u: 1.0, u_independent: 0.5 };
    let dark = fit::Estimate { value: -2.0, ..exitance };
    let points = [
        AccuracyPoint { rig_s: 1.5, readings: 10, exitance, flux },
        AccuracyPoint { rig_s: 3.0, readings: 20, exitance: dark, flux },
    ];
    let mut out = Vec::new();
    write_accuracy(&mut out, Quantity::Luminance, &points).unwrap();
    assert_eq!(
        String::from_utf8(out).unwrap(),
        "rig_s,readings,luminous_exitance_lm_per_m2,u_luminous_exitance_lm_per_m2,\
         u_independent_luminous_exitance_lm_per_m2,u_exitance_relative,luminous_flux_lm,\
         u_luminous_flux_lm\n1.5,10,2,0.5,0.25,0.25,4,1\n3,20,-2,0.5,0.25,,4,1\n"
    );
}
