//! The logarithm and the arc tangent in double-double, for sums of them that cancel, and a difference that
//! does. They know numbers only.
//!
//! The first two by a table of 32nds and the odd series of what is left: |x| <= 1/44 or 1/64, so that ten terms
//! make 31 digits, the later of them in doubles; the steps of the table add up to some 1e-30.

use std::sync::OnceLock;

use crate::error_free::DoubleDouble;

/// Entries of the table are at k/32.
const STEPS: f64 = 32.0;
/// Terms of the series that want 32 digits, and all of them.
const WIDE_TERMS: usize = 4;
const TERMS: usize = 10;

struct Tables {
    /// ln(k/32), from k = 22 to 46.
    logarithms: Vec<DoubleDouble>,
    ln_2: DoubleDouble,
    /// atan(k/32), from 0 to 32.
    angles: Vec<DoubleDouble>,
    half_pi: DoubleDouble,
}

const FIRST: usize = 22;
const LAST: usize = 46;

/// ln x for a normal x above 0.
pub(crate) fn logarithm(x: DoubleDouble) -> DoubleDouble {
    let tables = tables();
    let rough = x.to_f64();
    let mut exponent = libm::ilogb(rough);
    if libm::scalbn(rough, -exponent) > 1.4 {
        exponent += 1;
    }
    let mantissa = x.scaled(-exponent);
    let place = libm::round(mantissa.to_f64() * STEPS);
    let near = DoubleDouble::from_f64(place / STEPS);
    let ratio = mantissa.sub(near).div(mantissa.add(near));
    let rest = odd_series(ratio, 1.0).scaled(1);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "22 to 46")]
    let whole = tables.logarithms[(place as usize).clamp(FIRST, LAST) - FIRST];
    tables.ln_2.mul(DoubleDouble::from_f64(f64::from(exponent))).add(whole).add(rest)
}

/// The angle of (x, y) for y >= 0, in [0, π]; 0 at the origin.
pub(crate) fn angle(y: DoubleDouble, x: DoubleDouble) -> DoubleDouble {
    let tables = tables();
    let zero = DoubleDouble::from_f64(0.0);
    let is_left = x.to_f64() < 0.0;
    let across = if is_left { x.neg() } else { x };
    let is_steep = y.to_f64() > across.to_f64();
    let (low, high) = if is_steep { (across, y) } else { (y, across) };
    if high.to_f64() == 0.0 {
        return zero;
    }
    let place = libm::round(low.to_f64() / high.to_f64() * STEPS);
    let near = DoubleDouble::from_f64(place / STEPS);
    let ratio = low.sub(near.mul(high)).div(high.add(near.mul(low)));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 32")]
    let mut angle = tables.angles[place as usize].add(odd_series(ratio, -1.0));
    if is_steep {
        angle = tables.half_pi.sub(angle);
    }
    if is_left {
        angle = tables.half_pi.scaled(1).sub(angle);
    }
    angle
}

/// x + s x³/3 + x⁵/5 + s x⁷/7 ...: atanh for s = 1, atan for s = -1, |x| up to 1/40.
fn odd_series(x: DoubleDouble, sign: f64) -> DoubleDouble {
    static INVERSES: OnceLock<Vec<DoubleDouble>> = OnceLock::new();
    let inverses = INVERSES.get_or_init(|| {
        let one = DoubleDouble::from_f64(1.0);
        (0..TERMS).map(|k| one.div(DoubleDouble::from_f64(2.0 * k as f64 + 1.0))).collect()
    });
    let square = x.mul(x).mul(DoubleDouble::from_f64(sign));
    let rough = square.to_f64();
    let tail = inverses[WIDE_TERMS..]
        .iter()
        .rev()
        .fold(0.0, |sum: f64, next| sum.mul_add(rough, next.to_f64()));
    let series = inverses[..WIDE_TERMS]
        .iter()
        .rev()
        .fold(DoubleDouble::from_f64(tail), |sum, next| sum.mul(square).add(*next));
    x.mul(series)
}

fn tables() -> &'static Tables {
    static TABLES: OnceLock<Tables> = OnceLock::new();
    TABLES.get_or_init(|| {
        let of = |x: f64| DoubleDouble::from_f64(x);
        // ln((k+1)/k) = 2 atanh(1/(2k+1))
        let step = |k: usize| odd_series(of(1.0).div(of(2.0 * k as f64 + 1.0)), 1.0).scaled(1);
        let mut logarithms = vec![of(0.0); LAST + 1 - FIRST];
        for k in 32..LAST {
            logarithms[k + 1 - FIRST] = logarithms[k - FIRST].add(step(k));
        }
        for k in (FIRST..32).rev() {
            logarithms[k - FIRST] = logarithms[k + 1 - FIRST].sub(step(k));
        }
        let ln_2 = (32..64).fold(of(0.0), |sum, k| sum.add(step(k)));
        // atan((k+1)/32) - atan(k/32) = atan(32/(32² + k(k+1)))
        let mut angles = vec![of(0.0)];
        for k in 0..32 {
            let k = f64::from(k);
            let step = odd_series(of(STEPS).div(of(STEPS * STEPS + k * (k + 1.0))), -1.0);
            angles.push(angles[angles.len() - 1].add(step));
        }
        let half_pi = angles[32].scaled(1);
        Tables { logarithms, ln_2, angles, half_pi }
    })
}

/// x - sin x for x >= 0, by its series where it is small.
pub(crate) fn less_its_sine(x: f64) -> f64 {
    if x > 1.0 {
        return x - libm::sin(x);
    }
    let square = x * x;
    let tail = [342.0, 272.0, 210.0, 156.0, 110.0, 72.0, 42.0, 20.0]
        .into_iter()
        .fold(1.0, |series, next| 1.0 - square / next * series);
    square * x / 6.0 * tail
}

#[cfg(test)]
mod tests {
    use super::*;

    fn off(found: DoubleDouble, high: f64, low: f64) -> f64 {
        found.sub(DoubleDouble::from_f64(high)).sub(DoubleDouble::from_f64(low)).to_f64().abs()
    }

    #[test]
    fn known_constants_have_twenty_nine_digits() {
        let of = DoubleDouble::from_f64;
        // Doubles next to ln 2, ln 10, π/4 and atan 2, and what is missing of them.
        let ln_2 = (core::f64::consts::LN_2, 2.319_046_813_846_299_6e-17);
        let ln_10 = (core::f64::consts::LN_10, -2.170_756_223_382_249_4e-16);
        let quarter = (core::f64::consts::FRAC_PI_4, 3.061_616_997_868_383e-17);
        assert!(off(logarithm(of(2.0)), ln_2.0, ln_2.1) < 1e-31);
        assert!(off(logarithm(of(10.0)), ln_10.0, ln_10.1) < 1e-30);
        let defect = off(angle(of(3.0), of(3.0)), quarter.0, quarter.1);
        // Thirty-two steps of the table.
        assert!(defect < 4e-30, "{defect:e}");
        let straight = (core::f64::consts::PI, 1.224_646_799_147_353_2e-16);
        assert!(off(angle(of(0.0), of(-2.0)), straight.0, straight.1) < 1e-29);
    }

    #[test]
    fn products_and_right_angles_add_up() {
        let of = DoubleDouble::from_f64;
        for i in 1..400 {
            let (x, y) = (of(0.01 * f64::from(i)), of(7.3 / f64::from(i)));
            let sum = logarithm(x).add(logarithm(y)).sub(logarithm(x.mul(y))).to_f64();
            assert!(sum.abs() < 1e-30, "{i}: {sum:e}");
            let both = angle(x, y).add(angle(y, x)).sub(tables().half_pi).to_f64();
            assert!(both.abs() < 1e-31, "{i}: {both:e}");
            let left = angle(x, y).add(angle(x, y.neg())).sub(tables().half_pi.scaled(1));
            assert!(left.to_f64().abs() < 1e-30, "{i}");
            assert!((logarithm(x).to_f64() - libm::log(x.to_f64())).abs() < 1e-15);
            assert!((angle(x, y).to_f64() - libm::atan2(x.to_f64(), y.to_f64())).abs() < 1e-15);
        }
    }
}
