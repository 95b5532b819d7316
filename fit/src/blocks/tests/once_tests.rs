//! Fits that go on, which take each reading in once, against the fit of all.

use super::super::Live;
use super::*;

#[test]
fn a_live_fit_takes_each_reading_once_and_is_the_fit_of_all() {
    const FIRST: usize = 500;
    let mut source = Source::new(|_, _| Noise::Fixed { variance: 0.25 }, false);
    source.common = |from| {
        let tilt = move |i: usize, level: f64| level * 1e-3 * ((from + i) % 7) as f64;
        vec![
            Common { name: "scale".to_owned(), u: 0.01, shift: Shift::Scale },
            Common { name: "offset".to_owned(), u: 0.2, shift: Shift::Offset },
            Common { name: "tilt".to_owned(), u: 1.0, shift: Shift::Value(Box::new(tilt)) },
        ]
    };
    let (whole, _) = in_blocks(&mut source, BASIS.into(), Robust::None);
    let rest = source.samples.split_off(FIRST);
    let (mut totals, optics) = (Totals::default(), None);
    source
        .each(&mut |block| {
            totals.take(block);
            Ok(())
        })
        .unwrap();
    let (model, robust) = (BASIS.into(), Robust::None);
    let asked =
        Asked { region: REGION, model, robust, optics, with_truncation: false, others: &[] };
    let mut live = Live::begin(&mut source, &totals, &asked).unwrap();
    let begun = live.fit().unwrap().exitance();
    let (walks, mut from) = (source.walks, FIRST);
    for samples in rest.chunks(BLOCK) {
        let common = (source.common)(from);
        live.take(&Readings { common: &common, ..Readings::of(samples) }).unwrap();
        from += samples.len();
    }
    // Nothing is looked at again, and each reading counts once.
    assert_eq!((source.walks, live.readings()), (walks, READINGS as u64));
    let (found, whole) = (live.fit().unwrap(), whole.fit);
    for (a, b) in found.coefficients().iter().zip(whole.coefficients()) {
        assert!((a - b).abs() <= 1e-9 * (1.0 + b.abs()), "{a} {b}");
    }
    let [found, whole] = [found, whole].map(|fit| fit.exitance());
    assert!((found.u_independent / whole.u_independent - 1.0).abs() < 1e-9);
    // What a component does to a reading goes with the level there, which the first ones said.
    assert!((found.u / whole.u - 1.0).abs() < 1e-3, "{found:?} {whole:?}");
    assert!(found.u_independent < 0.6 * begun.u_independent, "{found:?} {begun:?}");
    // A reading of something else is none of these.
    assert!(live.take(&Readings::of(&rest[..1])).is_err());
    assert_eq!(live.readings(), READINGS as u64);
}
