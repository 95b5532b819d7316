//! A Keithley 6485 picoammeter, simulated: its SCPI over RS-232, reading the simulated board's
//! photocurrent. What it integrates over is the board's own time of a reading, whatever NPLC says.

use core::time::Duration;

use firmware_protocol::{Board as _, Illumination, Instant};

use crate::{SimulatedBoard, Twin};

/// What overflow reads.
const OVERFLOW: &str = "+9.900000E+37A";
const LINE_MAX: usize = 256;
/// Readings that one trigger takes at most.
const READINGS_MAX: u32 = 2_500;

/// See the module.
#[derive(Debug, Default)]
pub struct KeithleyTwin {
    line: Vec<u8>,
    /// The range, an index into the board's.
    gain: u8,
    count: u32,
    acquiring: Option<Acquiring>,
    outgoing: Vec<u8>,
}

#[derive(Debug)]
struct Acquiring {
    next: Instant,
    left: u32,
    words: Vec<String>,
}

impl KeithleyTwin {
    /// A meter that has just been switched on.
    pub fn new() -> Self {
        Self { count: 1, ..Self::default() }
    }

    fn say(&mut self, text: &str) {
        self.outgoing.extend_from_slice(text.as_bytes());
        self.outgoing.push(b'\r');
    }

    fn obey(&mut self, board: &mut SimulatedBoard, now: Instant, line: &str) {
        let (command, argument) = line.split_once(' ').unwrap_or((line, ""));
        match (command.trim_start_matches(':'), argument) {
            ("*IDN?", _) => self.say("KEITHLEY INSTRUMENTS INC.,MODEL 6485,1234567,B02   "),
            ("SYST:LFR?", _) => self.say("50"),
            ("*OPC?", _) => self.say("1"),
            ("*RST", _) => {
                *self = Self { outgoing: std::mem::take(&mut self.outgoing), ..Self::new() }
            }
            ("TRIG:COUN", count) => {
                self.count = count.parse().unwrap_or(1).clamp(1, READINGS_MAX);
            }
            ("RANG", range) => {
                if let Ok(full_scale) = range.parse::<f64>() {
                    self.gain = range_for(board, full_scale);
                }
            }
            ("READ?", _) => self.begin(board, now),
            // Set commands are never answered, understood or not.
            _ => {}
        }
    }

    fn begin(&mut self, board: &mut SimulatedBoard, now: Instant) {
        let reading = board.name_reading(self.gain);
        let illumination = Illumination { reading, gain: self.gain, shutter: board.shutter() };
        board.prepare_dwell(now, illumination);
        board.begin_dwell(now, illumination);
        let next = now + period(board);
        self.acquiring = Some(Acquiring { next, left: self.count, words: Vec::new() });
    }

    fn take(&mut self, board: &mut SimulatedBoard, now: Instant) {
        let Some(mut acquiring) = self.acquiring.take() else { return };
        if now < acquiring.next {
            self.acquiring = Some(acquiring);
            return;
        }
        let detector = &board.nominal().detector;
        let full_scale = detector.gains.get(usize::from(self.gain)).map_or(0.0, |g| g.full_scale_a);
        let half = libm::ldexp(1.0, i32::from(detector.adc_bits) - 1);
        let counts = board.convert(acquiring.next).map_or(f64::NAN, f64::from);
        let word = if (1.0 - half..half - 1.0).contains(&counts) {
            scientific(counts / half * full_scale) + "A"
        } else {
            OVERFLOW.to_owned()
        };
        let seconds = acquiring.next.micros() as f64 / 1e6;
        acquiring.words.push(format!("{word},{},+0.000000E+00", scientific(seconds)));
        acquiring.left -= 1;
        if acquiring.left == 0 {
            self.say(&acquiring.words.join(","));
        } else {
            acquiring.next = acquiring.next + period(board);
            self.acquiring = Some(acquiring);
        }
    }
}

fn period(board: &SimulatedBoard) -> Duration {
    Duration::from_micros(1_000_000 / u64::from(board.nominal().detector.adc_rate_hz.max(1)))
}

/// The lowest range that holds this current; the highest where none does.
fn range_for(board: &SimulatedBoard, current_a: f64) -> u8 {
    let gains = &board.nominal().detector.gains;
    let holds = gains.iter().enumerate().filter(|(_, gain)| gain.full_scale_a >= 0.999 * current_a);
    let lowest = holds.min_by(|(_, a), (_, b)| a.full_scale_a.total_cmp(&b.full_scale_a));
    u8::try_from(lowest.map_or(0, |(n, _)| n)).unwrap_or(0)
}

/// As the instrument writes numbers: `+1.234567E-09`.
fn scientific(value: f64) -> String {
    let text = format!("{value:+.6e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{digits}E{sign}{:02}", exponent.abs())
}

impl Twin for KeithleyTwin {
    fn handle_bytes(&mut self, board: &mut SimulatedBoard, now: Instant, bytes: &[u8]) {
        for byte in bytes {
            match byte {
                b'\r' | b'\n' => {
                    let line = std::mem::take(&mut self.line);
                    let text = String::from_utf8_lossy(&line).trim().to_owned();
                    if !text.is_empty() {
                        self.obey(board, now, &text);
                    }
                }
                _ if self.line.len() < LINE_MAX => self.line.push(*byte),
                _ => {}
            }
        }
    }

    fn handle_timeout(&mut self, board: &mut SimulatedBoard, now: Instant) {
        self.take(board, now);
    }

    fn poll_timeout(&self, _board: &SimulatedBoard) -> Option<Instant> {
        self.acquiring.as_ref().map(|acquiring| acquiring.next)
    }

    fn poll_transmit(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }
}

#[cfg(test)]
mod tests {
    use super::scientific;

    #[test]
    fn numbers_are_written_as_the_instrument_writes_them() {
        assert_eq!(scientific(1.234_567e-9), "+1.234567E-09");
        assert_eq!(scientific(-2e-12), "-2.000000E-12");
        assert_eq!(scientific(0.0), "+0.000000E+00");
    }
}
