//! Numbers as text: the fewest digits that read back to the same f64.

/// Magnitudes from here on ...
const PLAIN_FROM: f64 = 1e-5;
/// ... to here are written without an exponent.
const PLAIN_TO: f64 = 1e16;

/// The shortest decimal digits that read back to `x`, with an exponent only far from 1.
pub(super) fn number(x: f64) -> String {
    let is_plain = x == 0.0 || (PLAIN_FROM..PLAIN_TO).contains(&x.abs()) || !x.is_finite();
    if is_plain { format!("{x}") } else { format!("{x:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn digits_are_the_fewest_and_the_mark_is_a_point() {
        for (x, text) in [
            (0.1, "0.1"),
            (-0.0, "-0"),
            (180.0, "180"),
            (1e15, "1000000000000000"),
            (2.5e16, "2.5e16"),
            (1e-5, "0.00001"),
            (-9.25e-6, "-9.25e-6"),
            (5e-324, "5e-324"),
            (1.0 / 3.0, "0.3333333333333333"),
        ] {
            assert_eq!(number(x), text);
        }
    }

    proptest! {
        #[test]
        fn text_reads_back_to_the_same_bits(x in any::<f64>().prop_filter("", |x| x.is_finite())) {
            let back: f64 = number(x).parse().unwrap();
            prop_assert_eq!(back.to_bits(), x.to_bits());
        }
    }
}
