//! Light meters of other makes, simulated: each speaks its maker's words over a line and reads the
//! board's photocurrent, with an offset of its own until that is taken off.
//!
//! What one reading integrates over is the board's own time of a reading; a picoammeter's is as many
//! power line cycles as it was told, on a line of 50 Hz. It shares no code with any driver and does
//! not know the host.

mod newport;
mod picoammeter;
mod power_meter;
mod scpi;
mod table;

use core::time::Duration;
use std::collections::VecDeque;

use firmware_protocol::{Board as _, Illumination, Instant};

use crate::{SimulatedBoard, Twin};
pub use table::ScpiWords;

/// Whose meter it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MeterMake {
    /// A picoammeter of Keithley's, 6485.
    Keithley6485,
    /// An optical power meter of Newport's, 1830-C.
    Newport1830C,
    /// Any that speaks what a table says.
    Scpi(Box<ScpiWords>),
    /// A power meter of Thorlabs', PM100D, with a photodiode head.
    ThorlabsPm100,
}

/// Power line cycles a second.
const LINE_HZ: f64 = 50.0;
/// A line to a meter is this long at most; more is lost.
const LINE_BYTES_MAX: usize = 512;
/// What every reading is off by until it is taken off: more than a picoammeter's noise, less than
/// its lowest range. Amperes, or watts of a meter that reads watts.
const OFFSET: f64 = 12e-12;

/// A meter.
#[derive(Debug)]
pub struct MeterTwin {
    make: MeterMake,
    line: Vec<u8>,
    said: Vec<u8>,
    settings: Settings,
    errors: VecDeque<&'static str>,
    integrating: Option<Integrating>,
    /// What waits until the readings are done.
    waiting: VecDeque<String>,
    zero_ends: Option<Instant>,
    /// How often it was asked for readings.
    asked: u32,
    /// How many more readings it answers; `None`: it never stalls.
    stalls_after: Option<u32>,
}

/// How it is set.
#[derive(Debug, Clone)]
struct Settings {
    /// The range, an index into the board's; `None`: it looks for one by itself.
    gain: Option<u8>,
    /// Whether words about time are part of a reading.
    elements: &'static str,
    count: u32,
    average: u32,
    /// How many conversions make a reading: as many while that filter is on.
    conversions: u32,
    nplc: f64,
    zero_check: bool,
    zero_correct: bool,
    /// What is taken off, once it was measured.
    correction: f64,
    last: f64,
    wavelength_nm: f64,
    is_power: bool,
    /// Newport's: 1 W, 2 dBm, 3 dB, 4 relative.
    unit: u8,
    filter: u8,
    attenuator: u8,
}

/// Readings under way.
#[derive(Debug)]
struct Integrating {
    /// Which reading it is, for what is drawn for it.
    reading: u32,
    pace: Pace,
    /// The board's samples of the reading under way: how many, and what they add up to.
    samples: u32,
    sum: Option<f64>,
    next: Instant,
    left: u32,
    readings: Vec<(Option<f64>, Instant)>,
    /// Whether they are asked for, or only to be taken.
    is_asked: bool,
}

/// What a reading is made of.
#[derive(Debug, Clone, Copy)]
struct Pace {
    /// The board's samples.
    samples: u32,
    /// From one to the next.
    step: Duration,
    /// White noise beside theirs, where it is shorter than one: as a part of theirs, squared.
    more_noise: f64,
}

impl Pace {
    fn of(meter: &MeterTwin, board: &SimulatedBoard) -> Self {
        let period = period(board);
        let plain = Self { samples: 1, step: period, more_noise: 0.0 };
        if meter.make != MeterMake::Keithley6485 {
            return plain;
        }
        let settings = &meter.settings;
        let seconds = settings.nplc * f64::from(settings.conversions) / LINE_HZ;
        let ratio = seconds / period.as_secs_f64();
        if ratio < 0.99 {
            let step = Duration::from_secs_f64(seconds);
            return Self { step, more_noise: 1.0 / ratio - 1.0, ..plain };
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
        Self { samples: libm::round(ratio).max(1.0) as u32, ..plain }
    }
}

impl MeterTwin {
    /// A meter that has just been switched on.
    pub fn new(make: MeterMake) -> Self {
        Self {
            settings: Settings::at_power_up(&make),
            make,
            line: Vec::new(),
            said: Vec::new(),
            errors: VecDeque::new(),
            integrating: None,
            waiting: VecDeque::new(),
            zero_ends: None,
            asked: 0,
            stalls_after: None,
        }
    }

    /// The meter that answers so many questions for readings and then says nothing more.
    #[must_use]
    pub fn with_stall(mut self, after: u32) -> Self {
        self.stalls_after = Some(after);
        self
    }

    /// The meter set to another unit than watts, by its keys.
    #[must_use]
    pub fn with_unit(mut self, unit: u8) -> Self {
        self.settings.unit = unit;
        self
    }

    fn is_stalled(&self) -> bool {
        self.stalls_after == Some(0)
    }

    fn say(&mut self, text: &str) {
        if self.is_stalled() {
            return;
        }
        self.said.extend_from_slice(text.as_bytes());
        self.said.extend_from_slice(match &self.make {
            MeterMake::Keithley6485 => b"\r",
            MeterMake::Scpi(words) if words.ends_with_cr => b"\r",
            _ => b"\n",
        });
    }

    fn fail(&mut self, error: &'static str) {
        if self.errors.len() < 10 {
            self.errors.push_back(error);
        }
    }

    fn say_error(&mut self) {
        let error = self.errors.pop_front().unwrap_or("0,\"No error\"");
        self.say(error);
    }

    fn obey(&mut self, board: &mut SimulatedBoard, now: Instant, line: &str) {
        match self.make.clone() {
            MeterMake::Keithley6485 => self.obey_as_picoammeter(board, now, line),
            MeterMake::Newport1830C => self.obey_as_newport(board, now, line),
            MeterMake::Scpi(words) => self.obey_as_table(board, now, &words, line),
            MeterMake::ThorlabsPm100 => self.obey_as_power_meter(board, now, line),
        }
    }

    /// Begins to take readings.
    fn integrate(&mut self, board: &mut SimulatedBoard, now: Instant, is_asked: bool) {
        if is_asked && let Some(left) = &mut self.stalls_after {
            *left = left.saturating_sub(1);
        }
        let gain = self.settings.gain.unwrap_or_else(|| lowest_that_holds(board, now));
        self.asked += u32::from(is_asked);
        // What is only taken to be zeroed is no reading: those that follow keep their names.
        let reading = if is_asked { board.name_reading(gain) } else { 0 };
        let illumination = Illumination { reading, gain, shutter: board.shutter() };
        board.prepare_dwell(now, illumination);
        board.begin_dwell(now, illumination);
        let pace = Pace::of(self, board);
        self.integrating = Some(Integrating {
            reading,
            pace,
            samples: 0,
            sum: Some(0.0),
            next: now + pace.step,
            left: self.settings.count.max(1),
            readings: Vec::new(),
            is_asked,
        });
    }

    /// A sample is over, and perhaps a reading.
    fn take(&mut self, board: &mut SimulatedBoard) {
        let Some(mut integrating) = self.integrating.take() else { return };
        let gain = self.settings.gain.unwrap_or(0);
        let sample = self.measure(board, integrating.next, gain);
        integrating.sum = integrating.sum.zip(sample).map(|(sum, sample)| sum + sample);
        integrating.samples += 1;
        if integrating.samples < integrating.pace.samples {
            integrating.next = integrating.next + integrating.pace.step;
            self.integrating = Some(integrating);
            return;
        }
        let more = shorter(board, &integrating);
        let value = integrating.sum.map(|sum| sum / f64::from(integrating.samples) + more);
        (integrating.samples, integrating.sum) = (0, Some(0.0));
        self.settings.last = value.unwrap_or(self.settings.last);
        integrating.readings.push((value, integrating.next));
        integrating.left -= 1;
        if integrating.left > 0 {
            integrating.next = integrating.next + integrating.pace.step;
            self.integrating = Some(integrating);
            return;
        }
        if integrating.is_asked {
            let text = self.readings_in_words(&integrating.readings);
            self.say(&text);
        }
    }

    /// The value that ends now; `None` where it does not fit the range.
    fn measure(&self, board: &mut SimulatedBoard, now: Instant, gain: u8) -> Option<f64> {
        let detector = &board.nominal().detector;
        let full_scale = detector.gains.get(usize::from(gain)).map_or(0.0, |g| g.full_scale_a);
        let half = libm::ldexp(1.0, i32::from(detector.adc_bits) - 1);
        let counts = board.convert(now).map_or(f64::NAN, f64::from);
        if !(1.0 - half..half - 1.0).contains(&counts) {
            return None;
        }
        let light = if self.settings.zero_check { 0.0 } else { counts / half * full_scale };
        let offset = if self.settings.zero_correct { self.settings.correction } else { 0.0 };
        Some(light + OFFSET - offset)
    }

    fn readings_in_words(&self, readings: &[(Option<f64>, Instant)]) -> String {
        let words = readings.iter().map(|(value, at)| match &self.make {
            MeterMake::Keithley6485 => self.picoammeter_words(*value, *at),
            MeterMake::Newport1830C => newport::words(*value),
            MeterMake::Scpi(words) => words.answer(*value),
            MeterMake::ThorlabsPm100 => power_meter::words(*value),
        });
        words.collect::<Vec<_>>().join(",")
    }
}

impl Settings {
    fn at_power_up(make: &MeterMake) -> Self {
        Self {
            gain: None,
            elements: "READ,UNIT,TIME,STAT",
            count: 1,
            average: if *make == MeterMake::Keithley6485 { 10 } else { 1 },
            conversions: 1,
            nplc: 6.0,
            zero_check: *make == MeterMake::Keithley6485,
            zero_correct: false,
            correction: 0.0,
            last: 0.0,
            wavelength_nm: 635.0,
            is_power: true,
            unit: 1,
            filter: 2,
            attenuator: 0,
        }
    }
}

/// What a reading that is shorter than one of the board's has of noise beside it.
fn shorter(board: &SimulatedBoard, integrating: &Integrating) -> f64 {
    let more = integrating.pace.more_noise;
    if more <= 0.0 {
        return 0.0;
    }
    let sigma = board.nominal().detector.read_noise_a * libm::sqrt(more);
    let key = integrating.readings.len() as u64;
    sigma * crate::chance::draw(u64::from(integrating.reading), "short-integration", key)
}

/// The board's time of a reading.
fn period(board: &SimulatedBoard) -> Duration {
    Duration::from_micros(1_000_000 / u64::from(board.nominal().detector.adc_rate_hz.max(1)))
}

/// The range with the lowest full scale that is no less than this; the highest where none is.
fn range_for(board: &SimulatedBoard, full_scale: f64) -> u8 {
    let gains = board.nominal().detector.gains.iter().enumerate();
    let by_scale = |a: f64, b: f64| a.total_cmp(&b);
    let holds = gains.clone().filter(|(_, gain)| gain.full_scale_a >= 0.95 * full_scale);
    let lowest = holds.min_by(|(_, a), (_, b)| by_scale(a.full_scale_a, b.full_scale_a));
    let best = lowest.or(gains.max_by(|(_, a), (_, b)| by_scale(a.full_scale_a, b.full_scale_a)));
    best.and_then(|(place, _)| u8::try_from(place).ok()).unwrap_or(0)
}

/// The upper end of a range.
fn full_scale(board: &SimulatedBoard, gain: u8) -> f64 {
    board.nominal().detector.gains.get(usize::from(gain)).map_or(0.0, |gain| gain.full_scale_a)
}

/// The lowest range that what is seen now fits.
fn lowest_that_holds(board: &SimulatedBoard, now: Instant) -> u8 {
    range_for(board, board.light_now_a(now) * 1.2 + OFFSET)
}

impl Twin for MeterTwin {
    fn handle_bytes(&mut self, board: &mut SimulatedBoard, now: Instant, bytes: &[u8]) {
        for byte in bytes {
            match byte {
                b'\r' | b'\n' => {
                    let line = std::mem::take(&mut self.line);
                    let text = String::from_utf8_lossy(&line).trim().to_owned();
                    if text.is_empty() {
                        continue;
                    }
                    // One word after the other: what comes while it reads waits.
                    self.waiting.push_back(text);
                    self.go_on(board, now);
                }
                _ if self.line.len() < LINE_BYTES_MAX => self.line.push(*byte),
                _ => {}
            }
        }
    }

    fn handle_timeout(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if self.integrating.as_ref().is_some_and(|integrating| integrating.next <= now) {
            self.take(board);
        }
        if self.zero_ends.is_some_and(|at| at <= now) {
            self.zero_ends = None;
            self.settings.correction = OFFSET;
            self.settings.zero_correct = true;
        }
        self.go_on(board, now);
    }

    fn poll_timeout(&self, _board: &SimulatedBoard) -> Option<Instant> {
        let next = self.integrating.as_ref().map(|integrating| integrating.next);
        [next, self.zero_ends].into_iter().flatten().min()
    }

    fn deeds(&self) -> u32 {
        self.asked
    }

    fn poll_transmit(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.said)
    }
}

impl MeterTwin {
    fn go_on(&mut self, board: &mut SimulatedBoard, now: Instant) {
        while self.integrating.is_none() {
            let Some(line) = self.waiting.pop_front() else { return };
            self.obey(board, now, &line);
        }
    }
}

#[cfg(test)]
mod tests;
