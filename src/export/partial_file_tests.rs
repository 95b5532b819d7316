//! Partial fits as files: back as they were, and refused when they are not.

use super::*;
use fit::partial::{Accumulator, Weighting};
use fit::{BasisSpec, Noise, Outline, Ray, Region, Sample};
use radiometry::beam::Beam;

const BASIS: BasisSpec = BasisSpec::zernike(2, 0);

fn file(region_deg: f64, readings: u32) -> PartialFile {
    let ray = |i: u32| Ray {
        x_m: 0.0,
        y_m: 0.0,
        theta_rad: f64::from(i % 7) * 0.2,
        phi_rad: f64::from(i / 7) * 0.9,
    };
    let noise = Noise::Fixed { variance: 0.04 };
    let sample = |i: u32| Sample { ray: ray(i), value: 50.0 + 0.1 * f64::from(i % 3), noise };
    let theta_max_rad = region_deg.to_radians();
    let region = Region::surface((0.0, 0.0), (0.0, 0.0), theta_max_rad);
    let share = Accumulator::new(region, BASIS, None, Weighting::Stated).unwrap();
    let mut share = share.with_truncation().unwrap();
    share.absorb(&(0..readings).map(sample).collect::<Vec<_>>()).unwrap();
    PartialFile {
        partial: share.finish(),
        quantity: Quantity::Luminance,
        optics: None,
        simulated: false,
        n_flagged: 3,
        n_excluded: 2,
    }
}

fn bytes(file: &PartialFile) -> Vec<u8> {
    let mut bytes = Vec::new();
    file.write(&mut bytes).unwrap();
    bytes
}

#[test]
fn a_file_comes_back_to_the_last_bit() {
    for readings in [0, 40] {
        let file = file(80.0, readings);
        let read = ReadPartial::read(&bytes(&file)).unwrap();
        assert_eq!(read.partial.parts(), file.partial.parts());
        assert!(file.partial.parts().finer.is_some());
        assert_eq!((read.quantity, read.n_flagged, read.n_excluded), (Quantity::Luminance, 3, 2));
    }
}

#[test]
fn the_beam_comes_back_with_the_sample_s_outline() {
    let beam = Beam::of_tube(0.006, 0.002, 0.28, 0.01).unwrap();
    let outlines = [
        None,
        Some(Outline::Rectangle { x_m: (-0.02, 0.03), y_m: (-0.01, 0.01) }),
        Some(Outline::Disk { centre_m: (0.001, 0.0), radius_m: 0.02 }),
    ];
    for outline in outlines {
        let optics = Some(Optics { beam, outline });
        let file = PartialFile { optics, ..file(80.0, 40) };
        assert_eq!(ReadPartial::read(&bytes(&file)).unwrap().optics, optics);
    }
}

#[test]
fn no_file_that_was_cut_or_changed_is_taken() {
    let whole = bytes(&file(80.0, 40));
    for length in (0..2000).chain((2000..whole.len()).step_by(97)) {
        assert!(ReadPartial::read(&whole[..length]).is_err(), "{length} bytes");
    }
    for at in (0..2000).chain((2000..whole.len()).step_by(97)) {
        let mut changed = whole.clone();
        changed[at] ^= 0x10;
        assert!(ReadPartial::read(&changed).is_err(), "byte {at}");
    }
    let said = |bytes: &[u8]| ReadPartial::read(bytes).unwrap_err().to_string();
    assert!(said(b"x_mm,y_mm").contains("gonio-pf"));
    let mut flipped = whole.clone();
    flipped[whole.len() - 20] ^= 1;
    assert!(said(&flipped).contains("corrupt"));
    let mut newer = whole.clone();
    newer[8] = 3;
    assert!(said(&newer).starts_with("version 3 of partial fits; expected 2: write it again"));
    assert!(said(&whole[..whole.len() - 3]).contains("cut short"));
    assert!(said(&[&whole[..], &[0; 8]].concat()).contains("not all of it"));
}

#[test]
fn shares_of_another_region_are_told_apart() {
    let read = |degrees| ReadPartial::read(&bytes(&file(degrees, 40))).unwrap();
    assert!(read(80.0).check(&read(80.0)).is_ok());
    let error = read(80.0).check(&read(75.0)).unwrap_err().to_string();
    assert!(error.starts_with("region: {") && error.contains("expected {"), "{error}");
}
