//! The real files: every one is read whole, and its numbers are those in its text. Breaks if the
//! reader grows too strict for what laboratories write, or mislays an axis.

use std::path::{Path, PathBuf};

use photometry_files::lm63::{self, IntensityUnit, Note, Opening, Photometry, Symmetry, Version};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(folder().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn real(name: &str) -> Photometry {
    lm63::read(&bytes(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

const ALL: [&str; 12] = [
    "B1 module.ies",
    "aerolamp.ies",
    "beacon.ies",
    "lumenizer_zone.ies",
    "nukit_lantern.ies",
    "nukit_torch.ies",
    "sterilray.ies",
    "ushio_b1.5.ies",
    "ushio_b1.ies",
    "uvpro222_b1.ies",
    "uvpro222_b2.ies",
    "visium.ies",
];

#[test]
fn all_real_files_are_read_as_milliwatts_per_steradian() {
    for name in ALL {
        let photometry = real(name);
        assert_eq!(photometry.intensity_unit(), IntensityUnit::MilliwattPerSteradian, "{name}");
        assert_eq!(photometry.version(), Version::Lm63In2002, "{name}");
        assert_eq!(photometry.symmetry(), Symmetry::None, "{name}");
        assert_eq!(photometry.lumens_per_lamp(), None, "{name} is absolute");
        assert!(photometry.flux() > 0.0, "{name}");
    }
}

#[test]
fn intensities_at_the_file_s_own_angles_are_the_file_s_own_numbers() {
    for name in ALL {
        let photometry = real(name);
        let text = String::from_utf8(bytes(name)).unwrap();
        let (_, numbers) = text.split_once("TILT=NONE").unwrap();
        let numbers: Vec<f64> =
            numbers.split_ascii_whitespace().map(|number| number.parse().unwrap()).collect();
        let (gammas, planes) = (photometry.gamma_deg().len(), photometry.c_deg().len());
        let factor = numbers[2] * numbers[10];
        let table = &numbers[13 + gammas + planes..];
        assert_eq!(table.len(), gammas * planes, "{name}");
        for (p, c) in photometry.c_deg().iter().enumerate() {
            for (g, gamma) in photometry.gamma_deg().iter().enumerate() {
                // Where several numbers speak of one direction, their average stands.
                if g == 0 || *gamma >= 180.0 || p == 0 || p == planes - 1 {
                    continue;
                }
                let expected = table[p * gammas + g] * factor;
                let got = photometry.intensity(*c, *gamma);
                assert!((got - expected).abs() <= 1e-13 * expected, "{name} at {c}, {gamma}");
            }
        }
    }
}

#[test]
fn the_flux_agrees_with_what_the_laboratory_states() {
    // Rounded to 3 digits in the file, before its multiplier of 1.32; its table to 1 mW/sr.
    let photometry = real("B1 module.ies");
    let stated: f64 = photometry.keyword("_TotalLuminaireLumens").unwrap().parse().unwrap();
    assert!((photometry.flux() / (stated * 1.32) - 1.0).abs() < 3e-3, "{}", photometry.flux());
}

#[test]
fn the_flux_is_the_integral_of_the_interpolated_intensity() {
    for name in ["ushio_b1.ies", "lumenizer_zone.ies"] {
        let photometry = real(name);
        // Midpoint rule on cells that divide the file's own: error (step)²/24 of curvature, 3e-5.
        let (rings, spokes) = (720, 288);
        let (d_gamma, d_c) = (90.0 / f64::from(rings), 360.0 / f64::from(spokes));
        let mut sum = 0.0;
        for ring in 0..rings {
            let gamma = (f64::from(ring) + 0.5) * d_gamma;
            for spoke in 0..spokes {
                let c = (f64::from(spoke) + 0.5) * d_c;
                sum += photometry.intensity(c, gamma) * gamma.to_radians().sin();
            }
        }
        let expected = sum * d_gamma.to_radians() * d_c.to_radians();
        assert!((photometry.flux() / expected - 1.0).abs() < 1e-4, "{name}: {expected}");
    }
}

#[test]
fn planes_that_disagree_at_the_pole_are_averaged_and_reported() {
    let photometry = real("ushio_b1.ies");
    let Some(Note::PlanesDisagree { low, high, mean, gamma_deg }) =
        photometry.notes().iter().find(|note| matches!(note, Note::PlanesDisagree { .. })).cloned()
    else {
        panic!("expected a note: {:?}", photometry.notes());
    };
    assert!(gamma_deg.abs() < f64::EPSILON);
    assert!((low - 120.242_195_453_886_48).abs() < 1e-12);
    assert!((high - 122.915_373_173_149_2).abs() < 1e-12);
    assert!(low < mean && mean < high);
    for c in [0.0, 33.0, 180.0, 359.9, -20.0] {
        assert!((photometry.intensity(c, 0.0) - mean).abs() < 1e-12);
    }
    // B1 module has one value there.
    let notes = real("B1 module.ies").notes().to_vec();
    assert!(!notes.iter().any(|note| matches!(note, Note::PlanesDisagree { .. })), "{notes:?}");
}

#[test]
fn light_at_the_horizon_is_kept_and_reported() {
    let photometry = real("sterilray.ies");
    let at_horizon = photometry.notes().iter().find_map(|note| match note {
        Note::AtOrBeyondHorizon { largest, c_deg, gamma_deg, .. } => {
            Some((*largest, *c_deg, *gamma_deg))
        }
        _ => None,
    });
    let (largest, c_deg, gamma_deg) = at_horizon.expect("it has light at 90°");
    assert!((photometry.intensity(c_deg, gamma_deg) - largest).abs() < 1e-15);
    assert!(largest > 0.4 && (gamma_deg - 90.0).abs() < f64::EPSILON);
}

#[test]
fn openings_are_where_the_files_put_them() {
    assert_eq!(
        real("ushio_b1.ies").opening(),
        Opening::Rectangle { length_m: 0.06, width_m: 0.045 }
    );
    assert_eq!(real("nukit_torch.ies").opening(), Opening::Point);
    let lantern = real("nukit_lantern.ies");
    assert!(lantern.notes().contains(&Note::Feet));
    let Opening::Rectangle { length_m, width_m } = lantern.opening() else {
        panic!("{:?}", lantern.opening());
    };
    assert!((length_m - 0.167 * 0.3048).abs() < 1e-15 && (width_m - 0.146 * 0.3048).abs() < 1e-15);
}

#[test]
fn continued_keywords_are_joined() {
    let lantern = real("nukit_lantern.ies");
    assert_eq!(
        lantern.keyword("LUMINAIRE"),
        Some(
            "Portable, formed white plastic housing with mini fan, specular reflector behind lamp, clear enclosure."
        )
    );
    assert_eq!(lantern.gamma_deg().len(), 361);
}

#[test]
fn a_file_cut_anywhere_before_its_last_number_is_refused() {
    // Within the last number a cut leaves another whole number: that no reader can see.
    for (name, stride) in [("B1 module.ies", 1), ("sterilray.ies", 13)] {
        let bytes = bytes(name);
        let trimmed = bytes.trim_ascii_end();
        let last = trimmed.iter().rposition(u8::is_ascii_whitespace).unwrap();
        for end in (0..=last).step_by(stride) {
            let error = lm63::read(&bytes[..end]).unwrap_err();
            let lines = bytes[..end].split(|byte| *byte == b'\n').count();
            assert!((1..=lines).contains(&error.line), "{name} cut at {end}: {error}");
        }
        for end in last..=bytes.len() {
            let _ = lm63::read(&bytes[..end]);
        }
    }
}
