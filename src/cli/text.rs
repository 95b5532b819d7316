//! Numbers and tables as people read them.

pub(crate) use crate::study::percent;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

/// Columns of a terminal that nobody made wider.
const WIDTH: usize = 80;

/// Rows in columns, each as wide as its widest cell; the last column is not padded.
pub(crate) fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max()
    };
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::from(" ");
        for (cell, width) in row.iter().zip(&widths) {
            let pad = width - cell.chars().count();
            // Writing to a string does not fail.
            let _ = write!(line, " {cell}{:pad$} ", "");
        }
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}

/// A row of a table of names and values.
pub(crate) fn row(name: &str, value: impl Into<String>) -> Vec<String> {
    vec![name.to_owned(), value.into()]
}

/// A text in lines of at most [`WIDTH`], each behind so many spaces; a longer word stands alone.
pub(crate) fn wrapped(text: &str, indent: usize) -> String {
    let mut wrapped = String::new();
    let mut width = WIDTH;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if width + 1 + length > WIDTH {
            let line_end = if wrapped.is_empty() { "" } else { "\n" };
            // Writing to a string does not fail.
            let _ = write!(wrapped, "{line_end}{:indent$}{word}", "");
            width = indent + length;
        } else {
            let _ = write!(wrapped, " {word}");
            width += 1 + length;
        }
    }
    wrapped.push('\n');
    wrapped
}

/// A path as a shell reads it back.
pub(crate) fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+:@%,".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text;
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// A duration in the unit that a person would choose.
pub(crate) fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        return format!("{:.0} ms", seconds * 1e3);
    }
    if seconds < 59.95 {
        return format!("{seconds:.1} s");
    }
    let whole = Duration::from_secs_f64(seconds.min(1e9).round()).as_secs();
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours == 0 {
        format!("{minutes} min {seconds:02} s")
    } else {
        format!("{hours} h {minutes:02} min")
    }
}

/// A value and its standard uncertainty, both to the uncertainty's second digit.
pub(crate) fn with_uncertainty(value: f64, u: f64, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    if !(u > 0.0 && u.is_finite()) {
        return format!("{value} ± {u}{unit}");
    }
    let exponent = libm::floor(libm::log10(u));
    let magnitude = libm::floor(libm::log10(value.abs().max(u)));
    // The two are between -308 and 308.
    #[allow(clippy::cast_possible_truncation)]
    let (exponent, magnitude) = (exponent as i32, magnitude as i32);
    if (-4..6).contains(&magnitude) {
        let decimals = usize::try_from(1 - exponent).unwrap_or(0);
        return format!("{value:.decimals$} ± {u:.decimals$}{unit}");
    }
    let scale = libm::exp10(f64::from(magnitude));
    let decimals = usize::try_from(1 - exponent + magnitude).unwrap_or(0);
    format!("({:.decimals$} ± {:.decimals$})e{magnitude}{unit}", value / scale, u / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertainties_show_two_digits_and_values_as_many() {
        assert_eq!(with_uncertainty(314.159, 0.23, "W"), "314.16 ± 0.23 W");
        assert_eq!(with_uncertainty(-0.001_234, 0.000_56, ""), "-0.00123 ± 0.00056");
        assert_eq!(with_uncertainty(3.2e-7, 4e-9, "A"), "(3.200 ± 0.040)e-7 A");
        assert_eq!(with_uncertainty(12_345.0, 230.0, "W"), "12345 ± 230 W");
        assert_eq!(with_uncertainty(1.0, 0.0, "W"), "1 ± 0 W");
    }

    #[test]
    fn durations_and_percentages_read_well() {
        assert_eq!(duration(0.05), "50 ms");
        assert_eq!(duration(3.25), "3.2 s");
        assert_eq!(duration(59.97), "1 min 00 s");
        assert_eq!(duration(125.0), "2 min 05 s");
        assert_eq!(duration(7260.0), "2 h 01 min");
        assert_eq!(percent(0.012_34), "1.23 %");
        assert_eq!(percent(-0.000_45), "-0.0450 %");
    }

    #[test]
    fn paths_can_be_pasted_into_a_shell() {
        assert_eq!(
            shell_word(Path::new("runs/lamp-20261122T101500Z")),
            "runs/lamp-20261122T101500Z"
        );
        assert_eq!(shell_word(Path::new("my runs/no. 1")), "'my runs/no. 1'");
        assert_eq!(shell_word(Path::new("Kim's")), "'Kim'\\''s'");
    }

    #[test]
    fn long_texts_stay_within_a_terminal() {
        let text = wrapped(&"word ".repeat(40), 7);
        assert!(
            text.lines().all(|line| line.chars().count() <= WIDTH && line.starts_with("       w"))
        );
        assert_eq!(text.split_whitespace().count(), 40);
    }

    #[test]
    fn columns_line_up() {
        let rows = [vec!["a".into(), "bb".into()], vec!["ccc".into(), "d".into()]];
        assert_eq!(table(&rows), "  a    bb\n  ccc  d\n");
    }
}
