//! The words of Newport's 1830-C: a letter and a number. It never says that it did not understand.

use firmware_protocol::Instant;

use super::MeterTwin;
use crate::SimulatedBoard;

/// Its ranges have numbers from 1, the most sensitive first.
const RANGES: u8 = 8;

impl MeterTwin {
    pub(super) fn obey_as_newport(&mut self, board: &mut SimulatedBoard, now: Instant, line: &str) {
        let mut characters = line.chars();
        let letter = characters.next().unwrap_or(' ').to_ascii_uppercase();
        let argument = characters.as_str().trim();
        let settings = &mut self.settings;
        if argument == "?" {
            let answer = match letter {
                'D' => return self.integrate(board, now, true),
                'U' => settings.unit.to_string(),
                'R' => settings.gain.map_or(0, |gain| number_of(board, gain)).to_string(),
                'W' => format!("{:04.0}", settings.wavelength_nm),
                'F' => settings.filter.to_string(),
                'A' => settings.attenuator.to_string(),
                'Z' => u8::from(settings.zero_correct).to_string(),
                'Q' => "0".to_owned(),
                _ => return,
            };
            return self.say(&answer);
        }
        let Ok(number) = argument.parse::<u16>() else { return };
        let digit = u8::try_from(number).unwrap_or(u8::MAX);
        match (letter, digit) {
            ('U', 1..=4) => settings.unit = digit,
            ('R', 0) => settings.gain = None,
            ('R', 1..=RANGES) => settings.gain = Some(gain_of(board, digit)),
            ('F', 1..=3) => settings.filter = digit,
            ('A', 0 | 1) => settings.attenuator = digit,
            ('Z', 0) => settings.zero_correct = false,
            ('Z', 1) => {
                settings.correction = settings.last;
                settings.zero_correct = true;
            }
            ('W', _) if (300..=1100).contains(&number) => {
                settings.wavelength_nm = f64::from(number);
            }
            _ => {}
        }
    }
}

/// The board's ranges from the most sensitive on.
fn by_scale(board: &SimulatedBoard) -> Vec<u8> {
    let gains = &board.nominal().detector.gains;
    let mut places: Vec<usize> = (0..gains.len()).collect();
    places.sort_by(|a, b| gains[*a].full_scale_a.total_cmp(&gains[*b].full_scale_a));
    places.into_iter().filter_map(|place| u8::try_from(place).ok()).collect()
}

/// The board's range of a number; the least sensitive for numbers beyond.
fn gain_of(board: &SimulatedBoard, number: u8) -> u8 {
    let gains = by_scale(board);
    gains.get(usize::from(number) - 1).or(gains.last()).copied().unwrap_or(0)
}

fn number_of(board: &SimulatedBoard, gain: u8) -> u8 {
    let place = by_scale(board).iter().position(|known| *known == gain);
    place.and_then(|place| u8::try_from(place + 1).ok()).unwrap_or(0)
}

/// A reading as the instrument writes it: `+.11E-9`; where it is overrange, more than any range.
pub(super) fn words(value: Option<f64>) -> String {
    let value = value.unwrap_or(99.0);
    let sign = if value < 0.0 { '-' } else { '+' };
    let nano = value.abs() / 1e-9;
    format!("{sign}{nano:.5}E-9")
}
