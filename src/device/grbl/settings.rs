//! What a board says about itself: its version, its buffer and its settings, and what they make of
//! its axes.

use std::collections::BTreeMap;

use crate::device::axes::AxisFacts;
use crate::rig::Readback;

/// The receive buffer of grbl 1.1 where `$I` does not say.
const BUFFER_BYTES: usize = 128;
/// The letters of a board that does not list its own.
const LETTERS: &str = "XYZABCUVW";

/// Numbers of settings; those of axes are the first axis's.
mod number {
    pub(super) const HOMING_DIRECTIONS: u16 = 23;
    pub(super) const HOMING_FEED: u16 = 24;
    pub(super) const HOMING_SEEK: u16 = 25;
    pub(super) const HOMING_CYCLE: u16 = 22;
    pub(super) const REPORT_INCHES: u16 = 13;
    pub(super) const STEPS_PER_UNIT: u16 = 100;
    pub(super) const RATE: u16 = 110;
    pub(super) const ACCELERATION: u16 = 120;
    pub(super) const TRAVEL: u16 = 130;
}

/// What `$I` and `$$` gave.
#[derive(Debug, Clone, Default)]
pub(super) struct Board {
    /// As in `[VER:1.1h.20190830:]`.
    pub(super) version: Option<String>,
    options: Option<String>,
    letters: Option<String>,
    settings: BTreeMap<u16, f64>,
    /// How many axes its reports have.
    pub(super) axes: usize,
}

/// Why a board can't be driven as the rig file has it: what was found, what was expected, what to
/// do.
pub(super) type Unfit = (String, String, String);

impl Board {
    /// A message in brackets.
    pub(super) fn note(&mut self, feedback: &str) {
        if let Some(version) = feedback.strip_prefix("VER:") {
            // Before the date of its build: `1.1h.20190830`.
            let version = version.split(':').next().unwrap_or_default();
            let parts: Vec<&str> = version.split('.').take(2).collect();
            self.version = Some(parts.join("."));
        } else if let Some(options) = feedback.strip_prefix("OPT:") {
            self.options = Some(options.to_owned());
        } else if let Some(axes) = feedback.strip_prefix("AXS:") {
            self.letters = axes.split(':').nth(1).map(str::to_owned);
        } else if feedback.starts_with(|first: char| first.is_ascii_digit()) {
            // How versions before 1.1 answer, and the first ones of it: `[0.9j.20160316:]`.
            let version = feedback.split(':').next().unwrap_or_default();
            self.version = Some(version.to_owned());
        }
    }

    pub(super) fn set(&mut self, number: u16, value: f64) {
        self.settings.insert(number, value);
    }

    /// Bytes that its receive buffer holds.
    pub(super) fn buffer(&self) -> usize {
        let bytes =
            self.options.as_ref().and_then(|options| options.split(',').nth(2)?.parse().ok());
        bytes.unwrap_or(BUFFER_BYTES)
    }

    /// Whether it speaks the protocol of grbl 1.1.
    pub(super) fn check_version(&self) -> Result<(), Unfit> {
        let version = self.version.as_deref().unwrap_or("of no version");
        if version.starts_with("1.1") {
            return Ok(());
        }
        let help = "flash grbl 1.1, or a descendant that speaks its protocol";
        Err((format!("it is grbl {version}"), "grbl 1.1".to_owned(), help.to_owned()))
    }

    /// Where the axes with these letters stand in its reports.
    pub(super) fn places(&self, letters: &[char]) -> Result<Vec<usize>, Unfit> {
        let known = self.letters.as_deref().unwrap_or(LETTERS);
        let known: Vec<char> = known.chars().take(self.axes).collect();
        let place = |letter: &char| {
            known.iter().position(|known| known == letter).ok_or_else(|| {
                let known: String = known.iter().collect();
                (
                    format!("it has no axis {letter}, but {} axes: {known}", self.axes),
                    format!("one of {known} for each axis"),
                    "correct letters in its [[axes_link]]".to_owned(),
                )
            })
        };
        letters.iter().map(place).collect()
    }

    fn required(&self, number: u16) -> Result<f64, Unfit> {
        self.settings.get(&number).copied().ok_or_else(|| {
            let help = "flash grbl 1.1 for as many axes as the rig file lists";
            (format!("it has no setting ${number}"), format!("${number}=..."), help.to_owned())
        })
    }

    fn per_axis(&self, first: u16, place: usize) -> Result<f64, Unfit> {
        self.required(first + u16::try_from(place).unwrap_or(u16::MAX - first))
    }

    /// Steps in one of grbl's units.
    pub(super) fn steps_per_unit(&self, place: usize) -> Result<f64, Unfit> {
        let steps = self.per_axis(number::STEPS_PER_UNIT, place)?;
        if steps > 0.0 {
            return Ok(steps);
        }
        let number = usize::from(number::STEPS_PER_UNIT) + place;
        let help = "set the steps of the axis";
        Err((format!("${number} is {steps}"), "more than 0".to_owned(), help.to_owned()))
    }

    /// An axis in steps. grbl counts its machine positions downwards from the home switches, to
    /// minus the travel; a board that sets its origin there (option Z) counts away from them.
    pub(super) fn facts(&self, place: usize) -> Result<AxisFacts, Unfit> {
        let steps = self.steps_per_unit(place)?;
        let travel = self.per_axis(number::TRAVEL, place)? * steps;
        let is_from_below = self.homes_downwards(place) && self.has_option('Z');
        let (low, high) = if is_from_below { (0.0, travel) } else { (-travel, 0.0) };
        Ok(AxisFacts {
            low: whole(low),
            high: whole(high),
            speed: rate(self.per_axis(number::RATE, place)? * steps / 60.0),
            acceleration: rate(self.per_axis(number::ACCELERATION, place)? * steps),
            // It counts the steps that it sent.
            readback: Readback::Steps,
        })
    }

    fn homes_downwards(&self, place: usize) -> bool {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a mask of 8 bits
        let mask = self.settings.get(&number::HOMING_DIRECTIONS).copied().unwrap_or(0.0) as u8;
        u32::try_from(place).is_ok_and(|place| mask.checked_shr(place).unwrap_or(0) & 1 == 1)
    }

    fn has_option(&self, letter: char) -> bool {
        let options = self.options.as_deref().unwrap_or_default();
        options.split(',').next().unwrap_or_default().contains(letter)
    }

    /// Homing is on, and positions are in millimetres.
    pub(super) fn check_modes(&self) -> Result<(), Unfit> {
        if self.required(number::HOMING_CYCLE)? < 1.0 {
            let expected = "$22=1: positions count from home marks".to_owned();
            let help = "fit home switches and send $22=1";
            return Err(("homing is switched off ($22=0)".to_owned(), expected, help.to_owned()));
        }
        if self.settings.get(&number::REPORT_INCHES).is_some_and(|inches| *inches >= 1.0) {
            let expected = "$13=0: positions in millimetres".to_owned();
            return Err((
                "it reports inches ($13=1)".to_owned(),
                expected,
                "send $13=0".to_owned(),
            ));
        }
        Ok(())
    }

    /// The longest that homing can take, seconds: grbl seeks one and a half travels, and locates
    /// each switch again slowly, axis after axis at worst.
    pub(super) fn homing_s(&self) -> f64 {
        let seek = self.settings.get(&number::HOMING_SEEK).copied().unwrap_or(500.0).max(1.0);
        let feed = self.settings.get(&number::HOMING_FEED).copied().unwrap_or(25.0).max(1.0);
        let places = 0..u16::try_from(self.axes).unwrap_or(0);
        let travels = places.filter_map(|place| self.settings.get(&(number::TRAVEL + place)));
        travels.map(|travel| 60.0 * (1.5 * travel / seek + 20.0 / feed)).sum::<f64>() + 10.0
    }
}

/// The nearest step; saturates far outside any travel.
#[allow(clippy::cast_possible_truncation)] // saturating, as documented
pub(super) fn whole(steps: f64) -> i32 {
    libm::round(steps) as i32
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating; a rate is positive
fn rate(steps: f64) -> u32 {
    libm::round(steps) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board() -> Board {
        let mut board = Board { axes: 3, ..Board::default() };
        board.note("VER:1.1h.20190830:");
        board.note("OPT:V,15,128");
        for (number, value) in [
            (13, 0.0),
            (22, 1.0),
            (23, 2.0),
            (24, 25.0),
            (25, 500.0),
            (100, 250.0),
            (101, 250.0),
            (110, 600.0),
            (111, 600.0),
            (120, 10.0),
            (121, 10.0),
            (130, 200.0),
            (131, 100.0),
        ] {
            board.set(number, value);
        }
        board
    }

    #[test]
    fn settings_make_an_axis_in_steps() {
        let facts = board().facts(0).unwrap();
        assert_eq!((facts.low, facts.high), (-50_000, 0));
        assert_eq!((facts.speed, facts.acceleration), (2500, 2500));
        let mut origin = board();
        origin.note("OPT:VZ,15,128");
        let facts = origin.facts(1).unwrap();
        assert_eq!((facts.low, facts.high), (0, 25_000));
        assert_eq!(origin.facts(0).unwrap().low, -50_000);
        assert_eq!(board().buffer(), 128);
    }

    #[test]
    fn another_version_axes_that_are_not_there_and_modes_are_refused() {
        assert!(board().check_version().is_ok() && board().check_modes().is_ok());
        let mut old = Board::default();
        old.note("0.9j.20160316:");
        assert!(old.check_version().unwrap_err().0.contains("0.9j"));
        assert_eq!(board().places(&['Z', 'X']).unwrap(), [2, 0]);
        assert!(board().places(&['A']).unwrap_err().0.contains("3 axes: XYZ"));
        let mut four = Board { axes: 4, ..board() };
        four.note("AXS:4:XYZC");
        assert_eq!(four.places(&['C']).unwrap(), [3]);
        assert!(board().facts(2).unwrap_err().0.contains("$102"));
        let mut inches = board();
        inches.set(13, 1.0);
        assert!(inches.check_modes().is_err());
        let mut homeless = board();
        homeless.set(22, 0.0);
        assert!(homeless.check_modes().unwrap_err().0.contains("$22"));
    }
}
