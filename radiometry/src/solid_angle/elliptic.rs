//! Elliptic integrals in Carlson's symmetric form: complete and incomplete ones alike, without a
//! difference in them. They know numbers only.
//!
//! By duplication (Carlson 1995, "Numerical computation of real or complex elliptic integrals",
//! Numerical Algorithms 10:13): each step brings the arguments four times closer together, and a
//! series of order five in what is left of their differences ends it.

/// Of the arguments' spread, where the series' first neglected terms (of order six) are below an ulp.
const SPREAD: f64 = 1e-3;
/// From the largest double to the smallest there are 2100 halvings of the exponent; each step
/// removes two of the smaller argument's.
const STEPS_MAX: usize = 1100;

/// RF(x, y, z) = ½ ∫ dt/√((t+x)(t+y)(t+z)) over [0, ∞): arguments not negative, at most one zero.
pub(super) fn rf(x: f64, y: f64, z: f64) -> f64 {
    let (mut x, mut y, mut z) = (x, y, z);
    for _ in 0..STEPS_MAX {
        let mean = (x + y + z) / 3.0;
        let [dx, dy, dz] = [x, y, z].map(|value| 1.0 - value / mean);
        if dx.abs().max(dy.abs()).max(dz.abs()) < SPREAD {
            let (e2, e3) = (dx.mul_add(dy, -(dz * dz)), dx * dy * dz);
            let series = 1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0;
            return series / mean.sqrt();
        }
        let lambda = duplication(x, y, z);
        (x, y, z) = ((x + lambda) / 4.0, (y + lambda) / 4.0, (z + lambda) / 4.0);
    }
    f64::NAN
}

/// RJ(x, y, z, p) = 3/2 ∫ dt/((t+p)√((t+x)(t+y)(t+z))) over [0, ∞): x, y, z as above, p above 0 (and
/// not far below the others, unless one is 0: digits go with the ratio of the roots).
pub(super) fn rj(x: f64, y: f64, z: f64, p: f64) -> f64 {
    let (mut x, mut y, mut z, mut p) = (x, y, z, p);
    let (mut sum, mut factor) = (0.0, 1.0);
    for _ in 0..STEPS_MAX {
        let mean = (x + y + z + 2.0 * p) / 5.0;
        let [dx, dy, dz, dp] = [x, y, z, p].map(|value| 1.0 - value / mean);
        if dx.abs().max(dy.abs()).max(dz.abs()).max(dp.abs()) < SPREAD {
            let product = dx * dy * dz;
            let e2 = dx * dy + dx * dz + dy * dz - 3.0 * dp * dp;
            let e3 = product + 2.0 * e2 * dp + 4.0 * dp * dp * dp;
            let e4 = (2.0 * product + e2 * dp + 3.0 * dp * dp * dp) * dp;
            let e5 = product * dp * dp;
            let series = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0
                - 3.0 * e4 / 22.0
                - 9.0 * e2 * e3 / 52.0
                + 3.0 * e5 / 26.0;
            return 6.0 * sum + factor * series / (mean * mean.sqrt());
        }
        let (rx, ry, rz, rp) = (x.sqrt(), y.sqrt(), z.sqrt(), p.sqrt());
        // d = (√p+√x)(√p+√y)(√p+√z), e = (p-x)(p-y)(p-z)/d² per duplication.
        let d = (rp + rx) * (rp + ry) * (rp + rz);
        let e = (rp - rx) / (rp + rx) * ((rp - ry) / (rp + ry)) * ((rp - rz) / (rp + rz));
        sum += factor / d * rc_of_one(1.0 + e);
        let lambda = duplication(x, y, z);
        factor /= 4.0;
        (x, y, z) = ((x + lambda) / 4.0, (y + lambda) / 4.0, (z + lambda) / 4.0);
        p = (p + lambda) / 4.0;
    }
    f64::NAN
}

fn duplication(x: f64, y: f64, z: f64) -> f64 {
    let (x, y, z) = (x.sqrt(), y.sqrt(), z.sqrt());
    x * (y + z) + y * z
}

/// RC(1, y) = RF(1, y, y), y above 0: atan √(y-1)/√(y-1), or its hyperbolic twin below 1.
fn rc_of_one(y: f64) -> f64 {
    let excess = y - 1.0;
    if excess.abs() < 1e-2 {
        // Σ (-excess)ᵏ/(2k+1)
        let terms = (0..9).rev().map(|k| 1.0 / (2.0 * f64::from(k) + 1.0));
        return terms.fold(0.0, |sum, term| term - excess * sum);
    }
    if excess > 0.0 {
        let root = excess.sqrt();
        libm::atan(root) / root
    } else {
        let root = (-excess).sqrt();
        libm::atanh(root) / root
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_as_published() {
        // Carlson 1995, section 3.
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 4e-15, "{found} {expected}");
        };
        close(rf(1.0, 2.0, 0.0), 1.311_028_777_146_06);
        close(rf(2.0, 3.0, 4.0), 0.584_082_841_677_151_7);
        close(rj(0.0, 1.0, 2.0, 3.0), 0.776_886_237_785_823_3);
        close(rj(2.0, 3.0, 4.0, 5.0), 0.142_975_796_671_567_54);
        close(rc_of_one(0.5), 2f64.sqrt() * 1f64.asinh());
        close(rf(5.0, 5.0, 5.0), 5f64.powf(-0.5));
        close(rj(3.0, 3.0, 3.0, 3.0), 3f64.powf(-1.5));
    }

    #[test]
    fn they_are_homogeneous_from_the_smallest_to_the_largest() {
        for exponent in [-140, -20, 20, 140] {
            let scale = libm::scalbn(1.0, 2 * exponent);
            let root = libm::scalbn(1.0, exponent);
            let one = rf(0.3, 1e-9, 2.0);
            assert!((rf(0.3 * scale, 1e-9 * scale, 2.0 * scale) * root / one - 1.0).abs() < 1e-15);
            let one = rj(0.3, 0.0, 2.0, 1e-7);
            let scaled = rj(0.3 * scale, 0.0, 2.0 * scale, 1e-7 * scale);
            assert!((scaled * root * root * root / one - 1.0).abs() < 1e-14);
        }
    }
}
