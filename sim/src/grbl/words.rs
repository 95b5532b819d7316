//! The lines that a simulated grbl understands, as numbers. What it does not understand it
//! refuses, with the number that grbl 1.1 gives.

/// A line of g-code.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Line {
    /// G0 to G3 as a number; only lines to go along are known.
    pub(super) motion: Option<u8>,
    pub(super) is_machine: bool,
    pub(super) is_incremental: Option<bool>,
    pub(super) is_inches: Option<bool>,
    /// G4: seconds.
    pub(super) pause_s: Option<f64>,
    /// M3 and M4 (on), M5 (off).
    pub(super) spindle: Option<bool>,
    /// M7 and M8 (on), M9 (off).
    pub(super) coolant: Option<bool>,
    pub(super) feed: Option<f64>,
    /// By the number of the axis.
    pub(super) axes: Vec<(usize, f64)>,
}

/// The letters of axes, in order.
pub(super) const LETTERS: &str = "XYZABC";

/// Reads a line, or says the number of its error.
pub(super) fn read(text: &str, axes: usize) -> Result<Line, u8> {
    let mut line = Line::default();
    let mut pause = None;
    let mut is_pause = false;
    let mut seen: Vec<(char, i64)> = Vec::new();
    for (letter, number) in split(&strip(text))? {
        #[allow(clippy::cast_possible_truncation)] // words have three digits
        let code = libm::round(number * 10.0) as i64;
        let group = match letter {
            'G' => modal_group(code).ok_or(20)?,
            'M' => 100 + code,
            _ => 0,
        };
        if seen.contains(&(letter, group)) {
            // Two of a modal group: 21; the same word twice: 25.
            return Err(if letter == 'G' { 21 } else { 25 });
        }
        seen.push((letter, group));
        match (letter, code) {
            ('G', 0) => line.motion = Some(0),
            ('G', 10) => line.motion = Some(1),
            ('G', 40) => is_pause = true,
            ('G', 200) => line.is_inches = Some(true),
            ('G', 210) => line.is_inches = Some(false),
            ('G', 530) => line.is_machine = true,
            ('G', 900) => line.is_incremental = Some(false),
            ('G', 910) => line.is_incremental = Some(true),
            ('M', 30 | 40) => line.spindle = Some(true),
            ('M', 50) => line.spindle = Some(false),
            ('M', 70 | 80) => line.coolant = Some(true),
            ('M', 90) => line.coolant = Some(false),
            // Modes that this machine has no other of, and ends of programs.
            ('G', 170 | 400 | 490 | 540 | 800 | 940) | ('M', 0 | 10 | 20 | 300) => {}
            ('F', _) if number > 0.0 => line.feed = Some(number),
            ('F' | 'S' | 'T' | 'N', _) if number >= 0.0 => {}
            ('P', _) if number >= 0.0 => pause = Some(number),
            ('F' | 'S' | 'T' | 'N' | 'P', _) => return Err(4),
            ('G' | 'M', _) => return Err(20),
            (letter, _) => {
                let axis = LETTERS.chars().position(|known| known == letter);
                let axis = axis.filter(|axis| *axis < axes).ok_or(20)?;
                line.axes.push((axis, number));
            }
        }
    }
    line.pause_s = match (is_pause, pause) {
        (true, None) => return Err(28),
        (true, pause) => pause,
        (false, _) => None,
    };
    Ok(line)
}

/// What can stand only once in a line.
fn modal_group(code: i64) -> Option<i64> {
    Some(match code {
        0 | 10 | 800 => 1,
        40 | 530 => 2,
        170 => 3,
        900 | 910 => 4,
        940 => 5,
        200 | 210 => 6,
        400 => 7,
        490 => 8,
        540 => 9,
        _ => return None,
    })
}

/// Without spaces and comments, in capitals.
fn strip(text: &str) -> String {
    let mut is_comment = false;
    let mut stripped = String::new();
    for character in text.chars() {
        match character {
            ';' => break,
            '(' => is_comment = true,
            ')' => is_comment = false,
            _ if is_comment || character.is_whitespace() || character == '/' => {}
            _ => stripped.push(character.to_ascii_uppercase()),
        }
    }
    stripped
}

fn split(text: &str) -> Result<Vec<(char, f64)>, u8> {
    let mut words = Vec::new();
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_alphabetic() {
            return Err(1);
        }
        let body = rest.get(1..).unwrap_or_default();
        let length = body.find(|c: char| !matches!(c, '0'..='9' | '.' | '-' | '+'));
        let (number, tail) = body.split_at(length.unwrap_or(body.len()));
        let number = number.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or(2)?;
        words.push((letter, number));
        rest = tail;
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_refused_with_grbl_s_numbers() {
        let line = read("g21 g53 G0 x-98.0000Y.5 (comment) ; more", 3).unwrap();
        assert_eq!(line.axes, [(0, -98.0), (1, 0.5)]);
        assert!(line.is_machine && line.motion == Some(0) && line.is_inches == Some(false));
        assert_eq!(read("G4P0", 3).unwrap().pause_s, Some(0.0));
        assert_eq!(read("G1X1F300", 3).unwrap().feed, Some(300.0));
        for (text, error) in [
            ("G0 A1", 20),
            ("G0 X", 2),
            ("12", 1),
            ("G77", 20),
            ("G0G1X1", 21),
            ("G0X1X2", 25),
            ("G4", 28),
            ("G1X1F-3", 4),
            ("G21G53G0X1.0G21G53G0X2.0", 21),
        ] {
            assert_eq!(read(text, 3), Err(error), "{text}");
        }
    }
}
