//! The bases at degrees far beyond what is fitted, at the pole, at the rim and next to both, against
//! independent forms: cosine sums for Zernike's polynomials, addition theorems for the harmonics, and the
//! values at the ends that are known exactly.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use radiometry::basis::zernike::ansi_order;
use radiometry::basis::{
    HemisphericalHarmonics, Legendre, LegendreProducts, SphericalHarmonics, Zernike, harmonics,
    legendre, zernike,
};
use radiometry::direction::{angle_between, unit};
use radiometry::quadrature::{Sum, gauss_legendre};

const DEGREE: usize = 200;

/// Rₙᵐ(r) as the m-th Fourier coefficient of Uₙ(r cos ψ), Uₙ(cos a) = sin((n+1)a)/sin a (Janssen and
/// Dirksen 2007, "Computing Zernike polynomials of arbitrary degree using the discrete Fourier
/// transform", eq. 4): no recurrence, no factorials, every term at most n + 1. `one_minus_r` in place
/// of r, so that the rim is resolved.
fn radial_by_cosines(n: usize, m: usize, one_minus_r: f64) -> f64 {
    let count = 2 * (n + m + 2);
    let r = 1.0 - one_minus_r;
    let terms = (0..count).map(|k| {
        let psi = PI * k as f64 / count as f64 * 2.0;
        // cos a = r cos ψ by the half angle, mirrored where it is nearer to π: Uₙ(-x) = (-1)ⁿ Uₙ(x).
        let is_mirrored = psi.cos() < 0.0;
        let sin_half = if is_mirrored { (psi / 2.0).cos() } else { (psi / 2.0).sin() };
        let a = 2.0 * (one_minus_r / 2.0 + r * sin_half * sin_half).sqrt().asin();
        let sign = if is_mirrored && n % 2 == 1 { -1.0 } else { 1.0 };
        let order = n as f64 + 1.0;
        let chebyshev = if a == 0.0 { order } else { (order * a).sin() / a.sin() };
        sign * chebyshev * (m as f64 * psi).cos()
    });
    terms.collect::<Sum>().value() / count as f64
}

#[test]
fn zernike_radials_hold_to_degree_200_from_the_pole_to_the_rim() {
    let places = [
        1.0,
        1.0 - 1e-12,
        1.0 - 1e-9,
        1.0 - 1e-5,
        0.9,
        0.5,
        0.1,
        0.03,
        1e-3,
        1e-5,
        1e-9,
        1e-12,
        0.0,
        0.995,
        0.99,
        0.98,
        0.95,
        0.8,
        0.7,
        0.6,
        0.4,
        0.3,
        0.2,
    ];
    for n in [2, 7, 20, 41, 60, 61, 100, 199, DEGREE] {
        let mut worst = (0.0, 0, 0.0);
        for m in (n % 2..=n).step_by(2) {
            for one_minus_r in places {
                let r = 1.0 - one_minus_r;
                let found = zernike::radial(n, m, r).unwrap();
                let error = (found - radial_by_cosines(n, m, 1.0 - r)).abs();
                worst = if error > worst.0 { (error, m, r) } else { worst };
            }
        }
        assert!(worst.0 < if n <= 61 { 2e-14 } else { 4e-13 }, "R_{n}: {worst:?}");
    }
}

/// At the rim and at the pole the values are known: 1, and (-1)^(n/2) for m = 0.
#[test]
#[expect(clippy::float_cmp, reason = "the claim is exactness")]
fn zernike_is_exact_on_the_rim_and_at_the_pole() {
    let mut values = vec![0.0; Zernike::new(DEGREE).len()];
    let basis = Zernike::new(DEGREE);
    basis.evaluate_direction(DVec3::X, &mut values);
    for (j, value) in values.iter().enumerate() {
        let (n, m) = ansi_order(j);
        let both_signs = if m == 0 { 1.0 } else { 2.0 };
        let norm = (both_signs * (n as f64 + 1.0) / PI).sqrt();
        assert_eq!(*value, if m < 0 { 0.0 } else { norm }, "Z_{n}^{m} at the rim");
    }
    basis.evaluate_direction(DVec3::Z, &mut values);
    for (j, value) in values.iter().enumerate() {
        let (n, m) = ansi_order(j);
        let norm = ((n as f64 + 1.0) / PI).sqrt();
        let sign = if n % 4 == 0 { 1.0 } else { -1.0 };
        let expected = if m == 0 { sign * norm } else { 0.0 };
        assert!((value - expected).abs() < 4e-14 * norm, "Z_{n}^{m} at the pole: {value}");
    }
    for n in (0..=10_000).step_by(501) {
        let expected = if n % 2 == 1 { 0.0 } else { f64::from(1 - i32::from(n % 4 == 2) * 2) };
        assert_eq!(zernike::radial(n, n % 2, 1.0).unwrap(), 1.0);
        assert!((zernike::radial(n, 0, 0.0).unwrap() - expected).abs() < 1e-12, "{n}");
    }
}

/// Next to the pole Zₙᵐ is its leading power, and next to the horizon its value at the rim plus its slope there.
#[test]
fn zernike_members_hold_next_to_pole_and_rim() {
    let basis = Zernike::new(DEGREE);
    let mut values = vec![0.0; basis.len()];
    for theta in [1e-9, 1e-12, 1e-300] {
        basis.evaluate(theta, 0.3, &mut values);
        for n in (1..DEGREE).step_by(2) {
            // Rₙ¹(r) = (-1)^((n-1)/2) (n+1)/2 r + ...
            let sign = if n % 4 == 1 { 1.0 } else { -1.0 };
            let norm = (2.0 * (n as f64 + 1.0) / PI).sqrt();
            let expected = sign * norm * (n as f64 + 1.0) / 2.0 * theta * 0.3f64.cos();
            let found = values[usize::midpoint(n * (n + 2), 1)];
            assert!(
                (found / expected - 1.0).abs() < 1e-11,
                "Z_{n}^1({theta:e}): {found:e} {expected:e}"
            );
        }
    }
    for up in [1e-6_f64, 1e-9] {
        let direction = DVec3::new((1.0 - up * up).sqrt(), 0.0, up);
        basis.evaluate_direction(direction, &mut values);
        for n in [2, 60, DEGREE] {
            for m in (0..=n).step_by(2) {
                let both_signs = if m == 0 { 1.0 } else { 2.0 };
                let norm = (both_signs * (n as f64 + 1.0) / PI).sqrt();
                // R'(1) = (n(n+2) - m²)/2 - ... over r: dRₙᵐ/dr = m + k(k+m+1)·2 with n = m + 2k.
                let k = (n - m) / 2;
                let slope = (m + 2 * k * (k + m + 1)) as f64;
                let expected = norm * (1.0 - slope * up * up / 2.0);
                let found = values[usize::midpoint(n * (n + 2), m)];
                let second = (slope * up * up).powi(2);
                assert!(
                    (found / expected - 1.0).abs() < 1e-14 + second,
                    "Z_{n}^{m}: {found} {expected}"
                );
            }
        }
    }
}

/// Σ over m of Yₗᵐ(a) Yₗᵐ(b) is (2l+1)/4π Pₗ(a·b): every harmonic of a degree takes part.
#[test]
fn spherical_harmonics_obey_the_addition_theorem_to_degree_200() {
    let basis = SphericalHarmonics::new(DEGREE).unwrap();
    let directions = [
        unit(1e-9, 0.4),
        unit(1e-5, -2.0),
        unit(0.3, 1.0),
        unit(1.2, 2.9),
        unit(FRAC_PI_2, -0.7),
        unit(PI - 1e-9, 0.1),
        DVec3::Z,
        -DVec3::Z,
        DVec3::X,
    ];
    let values: Vec<Vec<f64>> = directions
        .iter()
        .map(|direction| {
            let mut values = vec![0.0; basis.len()];
            basis.evaluate(*direction, &mut values);
            values
        })
        .collect();
    for (a, from) in directions.iter().zip(&values) {
        for (b, to) in directions.iter().zip(&values) {
            let cos = angle_between(*a, *b).cos().clamp(-1.0, 1.0);
            for l in 0..=DEGREE {
                let members = l * l..(l + 1) * (l + 1);
                let sum: Sum = members.map(|index| from[index] * to[index]).collect();
                let scale = (2.0 * l as f64 + 1.0) / (4.0 * PI);
                let expected = scale * legendre::polynomial(l, cos).unwrap();
                // The unit vectors' and the cosine's roundings, at the slope l(l+1)/2.
                let allowed = scale * (4e-14 + 4e-16 * (l * (l + 1)) as f64);
                let error = (sum.value() - expected).abs();
                assert!(error < allowed, "l = {l}, {a} and {b}: {error:e}");
            }
        }
    }
}

/// The squeezed harmonics of a degree sum to (2l+1)/2π everywhere on the hemisphere.
#[test]
fn hemispherical_harmonics_obey_it_from_pole_to_rim() {
    let basis = HemisphericalHarmonics::new(DEGREE).unwrap();
    let mut values = vec![0.0; basis.len()];
    for theta in [0.0, 1e-9, 1e-5, 0.4, 1.0, FRAC_PI_2 - 1e-5, FRAC_PI_2 - 1e-9, FRAC_PI_2] {
        let direction = unit(theta, 2.2);
        basis.evaluate(DVec3::new(direction.x, direction.y, direction.z.max(0.0)), &mut values);
        for l in 0..=DEGREE {
            let sum: Sum = values[l * l..(l + 1) * (l + 1)].iter().map(|v| v * v).collect();
            let expected = (2.0 * l as f64 + 1.0) / (2.0 * PI);
            let error = (sum.value() / expected - 1.0).abs();
            assert!(
                error < 4e-14 + 4e-16 * (l * (l + 1)) as f64,
                "l = {l}, θ = {theta}: {error:e}"
            );
        }
    }
}

/// Single harmonics far beyond: their squares sum to (2l+1)/4π, those of m > 0 twice.
#[test]
fn amplitudes_sum_as_they_should_at_degree_1000() {
    for l in [200, 500, 1000] {
        for theta in [1e-9, 1e-4, 0.02, 0.7, FRAC_PI_2, PI - 1e-6] {
            let squares = (0..=l).map(|m| {
                let amplitude = harmonics::amplitude(l, m, theta).unwrap();
                let both_signs = if m == 0 { 1.0 } else { 2.0 };
                both_signs * amplitude * amplitude
            });
            let sum = squares.collect::<Sum>().value();
            let expected = (2.0 * l as f64 + 1.0) / (4.0 * PI);
            assert!((sum / expected - 1.0).abs() < 1e-12, "l = {l}, θ = {theta}: {sum} {expected}");
        }
    }
}

/// Pₖ(cos θ) = Σ over j of aⱼ aₖ₋ⱼ cos((k - 2j)θ), aⱼ = (2j choose j)/4ʲ (Szegő 4.9.3): positive
/// coefficients, no recurrence.
#[test]
fn legendre_holds_to_degree_200_next_to_its_ends() {
    let mut central = vec![1.0];
    for j in 1..=DEGREE {
        central.push(central[j - 1] * (2.0 * j as f64 - 1.0) / (2.0 * j as f64));
    }
    let basis = Legendre::new(DEGREE);
    let mut values = vec![0.0; basis.len()];
    for one_minus_t in [0.0, 1e-12, 1e-9, 1e-5, 0.1, 0.7, 1.0, 1.4, 2.0 - 1e-12, 2.0] {
        let t = 1.0 - one_minus_t;
        basis.evaluate(t, &mut values);
        // Of the double t, which is not 1 - one_minus_t to the last digit.
        let theta = 2.0 * ((1.0 - t) / 2.0).sqrt().asin();
        for k in [1, 2, 20, 59, 60, 61, 150, DEGREE] {
            let sum: Sum = (0..=k)
                .map(|j| central[j] * central[k - j] * ((k as f64 - 2.0 * j as f64) * theta).cos())
                .collect();
            let found = legendre::polynomial(k, t).unwrap();
            // Next to -1 the arc sine itself has half its digits.
            let allowed =
                2e-14 + 1e-16 * (k * k) as f64 + if t < -0.99 { 1e-8 * k as f64 } else { 0.0 };
            assert!((found - sum.value()).abs() < allowed, "P_{k}({t}): {found} {}", sum.value());
            let mirrored = legendre::polynomial(k, -t).unwrap();
            let sign = if k % 2 == 1 { -1.0 } else { 1.0 };
            let odd_at_zero = if t == 0.0 { 1e-14 } else { 0.0 };
            assert!((mirrored - sign * found).abs() <= odd_at_zero, "P_{k} is even or odd");
            let scaled = values[k] / (2.0 * k as f64 + 1.0).sqrt();
            assert!((scaled - found).abs() < 4e-16, "the basis's P_{k}({t})");
        }
    }
}

/// They are the products that they say, in the order that they say, and orthonormal in the mean.
#[test]
fn legendre_products_are_products() {
    let (products, single) = (LegendreProducts::new(6), Legendre::new(6));
    let degrees: Vec<_> = products.degrees().collect();
    assert_eq!((degrees.len(), products.len(), degrees[4]), (28, 28, (1, 1)));
    let (mut along_x, mut along_y) = (vec![0.0; 7], vec![0.0; 7]);
    let mut values = vec![0.0; 28];
    let mut gram = vec![Sum::default(); 28 * 28];
    let rule = gauss_legendre(8);
    for (x, weight_x) in &rule {
        for (y, weight_y) in &rule {
            products.evaluate(*x, *y, &mut values);
            single.evaluate(*x, &mut along_x);
            single.evaluate(*y, &mut along_y);
            for (i, (a, b)) in degrees.iter().enumerate() {
                assert!((values[i] - along_x[*a] * along_y[*b]).abs() < 1e-14, "{a}, {b}");
                for j in 0..28 {
                    gram[28 * i + j].add(weight_x * weight_y / 4.0 * values[i] * values[j]);
                }
            }
        }
    }
    for (place, mean) in gram.iter().enumerate() {
        let expected = f64::from(u8::from(place / 28 == place % 28));
        assert!((mean.value() - expected).abs() < 2e-14, "{place}: {}", mean.value());
    }
}
