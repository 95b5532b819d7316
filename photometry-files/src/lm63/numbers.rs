//! The numbers of the file, one after another, each with its line. Line breaks have no meaning
//! among them; separators are blanks and commas.

use super::error::{Lm63Error, Problem, shortened};

/// What is left of the file's numbers.
pub(super) struct Numbers<'a> {
    lines: std::iter::Enumerate<std::slice::Iter<'a, &'a str>>,
    rest: &'a str,
    /// Counted from 1; the last line read.
    line: usize,
    /// On the lines after it.
    bytes_left: usize,
}

impl<'a> Numbers<'a> {
    /// The numbers on `lines`, of which the first `read` are already read.
    pub(super) fn after(lines: &'a [&'a str], read: usize) -> Self {
        let mut rest = lines.iter().enumerate();
        let bytes_left = lines.iter().skip(read).map(|line| line.len() + 1).sum();
        if let Some(last) = read.checked_sub(1) {
            rest.nth(last);
        }
        Self { lines: rest, rest: "", line: read, bytes_left }
    }

    /// No more numbers than half of this can follow.
    pub(super) fn bytes_left(&self) -> usize {
        self.bytes_left + self.rest.len()
    }

    /// The next number, finite.
    pub(super) fn next(&mut self, what: impl Fn() -> String) -> Result<f64, Lm63Error> {
        let Some(token) = self.token() else {
            return Err(self.error(Problem::EndOfFile { expected: what() }));
        };
        // The library also reads `inf` and `nan`, which are no numbers of this format.
        let plain = token
            .bytes()
            .all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
        match token.parse::<f64>() {
            Ok(number) if plain && number.is_finite() => Ok(number),
            _ => Err(self.error(Problem::NotANumber { what: what(), found: shortened(token) })),
        }
    }

    /// The next number, which has to satisfy a rule.
    pub(super) fn admissible(
        &mut self,
        what: &'static str,
        expected: &'static str,
        rule: impl Fn(f64) -> bool,
    ) -> Result<f64, Lm63Error> {
        let found = self.next(|| what.to_owned())?;
        if rule(found) {
            Ok(found)
        } else {
            let what = what.to_owned();
            Err(self.error(Problem::Inadmissible { what, expected, found }))
        }
    }

    /// The next number, which has to be whole and in a range that is far below 2^32.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, and within the range of u32, as checked"
    )]
    pub(super) fn count(
        &mut self,
        what: &'static str,
        expected: &'static str,
        range: std::ops::RangeInclusive<u32>,
    ) -> Result<usize, Lm63Error> {
        let (low, high) = (f64::from(*range.start()), f64::from(*range.end()));
        let whole = |found: f64| found.fract() == 0.0 && (low..=high).contains(&found);
        self.admissible(what, expected, whole).map(|found| found as usize)
    }

    /// Angles in degrees, each above the one before it.
    pub(super) fn angles(
        &mut self,
        name: &'static str,
        count: usize,
    ) -> Result<Vec<f64>, Lm63Error> {
        let mut angles: Vec<f64> = Vec::with_capacity(count);
        for index in 1..=count {
            let what = || format!("{name} angle {index} of {count}");
            let found = self.next(what)?;
            if let Some(&previous) = angles.last()
                && found <= previous
            {
                return Err(self.error(Problem::NotRising { what: what(), previous, found }));
            }
            angles.push(found);
        }
        Ok(angles)
    }

    /// Nothing may follow.
    pub(super) fn finish(mut self) -> Result<(), Lm63Error> {
        match self.token() {
            Some(found) => {
                let found = shortened(found);
                Err(self.error(Problem::Trailing { found }))
            }
            None => Ok(()),
        }
    }

    pub(super) fn error(&self, problem: Problem) -> Lm63Error {
        Lm63Error { line: self.line.max(1), problem }
    }

    fn token(&mut self) -> Option<&'a str> {
        let separator = |c: char| c == ',' || c.is_ascii_whitespace();
        loop {
            let trimmed = self.rest.trim_start_matches(separator);
            if trimmed.is_empty() {
                let (index, line) = self.lines.next()?;
                self.bytes_left = self.bytes_left.saturating_sub(line.len() + 1);
                (self.line, self.rest) = (index + 1, line);
                continue;
            }
            let end = trimmed.find(separator).unwrap_or(trimmed.len());
            self.rest = &trimmed[end..];
            return Some(&trimmed[..end]);
        }
    }
}
