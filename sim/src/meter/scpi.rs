//! Words of SCPI: long and short forms are one, and what may be left out is left out.

/// A word as it came over the line, brought to one form: short mnemonics joined by colons, with a
/// question mark where it is a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Word {
    pub(super) header: String,
    pub(super) argument: String,
}

/// The words of a line.
pub(super) fn words(line: &str) -> Vec<Word> {
    line.split(';').map(str::trim).filter(|word| !word.is_empty()).map(word).collect()
}

fn word(text: &str) -> Word {
    let (header, argument) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    let header = header.trim_start_matches(':').to_ascii_uppercase();
    let (header, mark) = match header.strip_suffix('?') {
        Some(header) => (header.to_owned(), "?"),
        None => (header, ""),
    };
    let nodes: Vec<&str> = header.split(':').collect();
    let is_optional = |place: usize, node: &str| {
        matches!(node, "DC" | "UPP" | "NEXT") || (place == 0 && matches!(node, "SENS" | "SENS1"))
    };
    let short = nodes.iter().enumerate().map(|(place, node)| (place, short(node)));
    let kept: Vec<&str> = short
        .filter(|(place, node)| nodes.len() == 1 || !is_optional(*place, node))
        .map(|(_, node)| node)
        .collect();
    Word { header: kept.join(":") + mark, argument: argument.trim().to_owned() }
}

/// Four letters, or three where the fourth is a vowel (SCPI-99, volume 1, 6.2.1).
fn short(node: &str) -> &str {
    let is_long = node.len() > 4 && node.is_ascii() && !node.starts_with('*');
    if !is_long {
        return node;
    }
    let has_vowel = node.as_bytes().get(3).is_some_and(|letter| b"AEIOU".contains(letter));
    node.get(..if has_vowel { 3 } else { 4 }).unwrap_or(node)
}

/// As instruments write numbers: `+1.234567E-09`.
pub(super) fn scientific(value: f64) -> String {
    let text = format!("{value:+.6e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{digits}E{sign}{:02}", exponent.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_short_are_one() {
        for (text, header, argument) in [
            (":SENSe:CURRent:DC:RANGe:UPPer 2e-9", "CURR:RANG", "2e-9"),
            ("curr:rang 2e-9", "CURR:RANG", "2e-9"),
            ("SYSTEM:ZCORRECT:ACQUIRE", "SYST:ZCOR:ACQ", ""),
            ("SYST:SENSOR:IDN?", "SYST:SENS:IDN?", ""),
            ("SENSE:CORRECTION:WAVELENGTH?", "CORR:WAV?", ""),
            ("*IDN?", "*IDN?", ""),
            ("READ?", "READ?", ""),
            ("SYST:ERR:NEXT?", "SYST:ERR?", ""),
        ] {
            let expected = Word { header: header.to_owned(), argument: argument.to_owned() };
            assert_eq!(words(text), [expected], "{text}");
        }
        assert_eq!(words("*CLS;:TRIG:COUN 3;READ?").len(), 3);
    }

    #[test]
    fn numbers_are_written_as_instruments_write_them() {
        assert_eq!(scientific(1.234_567e-9), "+1.234567E-09");
        assert_eq!(scientific(-2e-12), "-2.000000E-12");
        assert_eq!(scientific(0.0), "+0.000000E+00");
    }
}
