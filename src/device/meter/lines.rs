//! Lines of text in a stream of bytes, and numbers in lines. Meters send no check with what they
//! say: what is no number is said to be none, and never taken for one.

/// The longest line that is kept: a trigger's worth of readings with their times.
pub(super) const LINE_BYTES_MAX: usize = 128 * 1024;

/// Finds lines in a stream, however it is cut. CR, LF and both end a line; empty lines are
/// passed over.
#[derive(Debug, Clone, Default)]
pub(super) struct Lines {
    held: Vec<u8>,
    /// The line is longer than lines are: what is left of it is thrown away.
    is_too_long: bool,
    dropped: u64,
}

impl Lines {
    /// Takes bytes in; the lines that they complete, in order. Bytes that are no ASCII are
    /// replaced, so that they make no number.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Vec<String> {
        let mut lines = Vec::new();
        for byte in bytes {
            match byte {
                b'\r' | b'\n' => lines.extend(self.finish()),
                _ if self.held.len() >= LINE_BYTES_MAX => {
                    self.is_too_long = true;
                    self.dropped += 1;
                }
                _ => self.held.push(*byte),
            }
        }
        lines
    }

    fn finish(&mut self) -> Option<String> {
        let held = std::mem::take(&mut self.held);
        if std::mem::take(&mut self.is_too_long) {
            return None;
        }
        let line = String::from_utf8_lossy(&held).trim().to_owned();
        (!line.is_empty()).then_some(line)
    }

    /// Forgets what has come of an unfinished line.
    pub(super) fn discard(&mut self) {
        self.held.clear();
        self.is_too_long = false;
    }
}

/// What a meter says that it reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Reading {
    /// A value, in the meter's unit.
    Value(f64),
    /// More than the range holds; on its negative side.
    Over {
        /// Whether it is below rather than above.
        is_negative: bool,
    },
}

/// SCPI's number for "more than can be measured" (SCPI-99, volume 1, 7.2.1.5).
const INFINITY: f64 = 9.9e37;
/// Its number for "none".
const NOT_A_NUMBER: f64 = 9.91e37;

/// Reads one number as a meter writes it, with or without a unit behind it. `None` for all else:
/// other text, another unit, NaN and SCPI's number for it.
pub(super) fn reading(text: &str, unit: &str) -> Option<Reading> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let suffix = text.get(digits.len()..).unwrap_or_default();
    if !suffix.is_empty() && !suffix.eq_ignore_ascii_case(unit) {
        return None;
    }
    let value = number(digits)?;
    let is_near = |mark: f64| (value.abs() / mark - 1.0).abs() < 1e-6;
    if is_near(NOT_A_NUMBER) {
        None
    } else if is_near(INFINITY) || value.abs() > INFINITY {
        Some(Reading::Over { is_negative: value < 0.0 })
    } else {
        Some(Reading::Value(value))
    }
}

/// A finite number: sign, digits, point, exponent, and nothing else. `.11E-9` is one.
pub(super) fn number(text: &str) -> Option<f64> {
    let is_numeric = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
    let text = text.trim();
    if text.is_empty() || !text.chars().all(is_numeric) {
        return None;
    }
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_as_instruments_write_them() {
        let value = |text: &str| reading(text, "A");
        assert_eq!(value("+1.234567E-09A"), Some(Reading::Value(1.234_567e-9)));
        assert_eq!(value("+.11E-9"), Some(Reading::Value(1.1e-10)), "Newport 1830-C");
        assert_eq!(value("-2.0e-12"), Some(Reading::Value(-2e-12)));
        assert_eq!(value("0"), Some(Reading::Value(0.0)));
        assert_eq!(value("+9.9E37"), Some(Reading::Over { is_negative: false }));
        assert_eq!(value("+9.900000E+37A"), Some(Reading::Over { is_negative: false }));
        assert_eq!(value("-9.9E37"), Some(Reading::Over { is_negative: true }));
        for none in [
            "+9.91E37",
            "",
            "A",
            "NAN",
            "nan",
            "inf",
            "1.2W",
            "1.2E-9AA",
            "1,2",
            "1.2E",
            "--1",
            "1.2 3",
            "\u{fffd}1",
            "0x10",
            "1e999",
        ] {
            assert_eq!(value(none), None, "{none}");
        }
    }

    #[test]
    fn a_line_without_an_end_does_not_pile_up() {
        let mut lines = Lines::default();
        for _ in 0..40 {
            assert!(lines.take(&[b'7'; 8192]).is_empty());
            assert!(lines.held.len() <= LINE_BYTES_MAX);
        }
        assert_eq!(lines.take(b"\r\n1\n"), ["1"], "and is no number when it ends");
    }

    proptest! {
        #[test]
        fn lines_come_however_they_are_cut(
            bytes in proptest::collection::vec(prop_oneof![Just(b'\r'), Just(b'\n'), any::<u8>()], 0..200),
            cut in 1_usize..9,
        ) {
            let whole = Lines::default().take(&bytes);
            let mut lines = Lines::default();
            let pieces: Vec<String> = bytes.chunks(cut).flat_map(|piece| lines.take(piece)).collect();
            prop_assert_eq!(&pieces, &whole);
            for line in whole {
                prop_assert!(!line.contains(['\r', '\n']));
                if let Some(Reading::Value(value)) = reading(&line, "A") {
                    prop_assert!(value.is_finite());
                }
            }
        }
    }
}
