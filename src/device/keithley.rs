//! The driver of Keithley 6485 and 6487 picoammeters over RS-232: SCPI lines, a carriage return at
//! the end of each. It is a machine without I/O.
//!
//! | word | what it means here |
//! |---|---|
//! | accepted | sent: commands that set something are never answered, so that each group of them ends with `*OPC?` |
//! | done | all readings of a `READ?` came, each with value, time and status |
//!
//! Overflow reads +9.9E37, which is "saturated" and never a number. It does not know what is
//! looked at, nor who moves.

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{Cause, Instant};

use super::driver::{Driver, NamedFault, Promises, Refusal, Trouble};
use super::photometer::{
    Exposed, Exposure, Photometer, PhotometerCommand, PhotometerEvent, PhotometerFacts,
};

/// Values from here on are no currents: overflow is +9.9E37, "not a number" +9.91E37.
const OVERFLOW: f64 = 9.8e37;
/// A reading with time and status has fewer characters.
const READING_BYTES_MAX: u32 = 48;
/// The instrument's buffer of readings.
const READINGS_MAX: u32 = 2_500;
/// No answer is longer.
const LINE_MAX: usize = (READING_BYTES_MAX * READINGS_MAX) as usize;
/// What the instrument integrates over, power line cycles.
const NPLC: core::ops::RangeInclusive<f64> = 0.01..=50.0;

const ASK_AGAIN: Duration = Duration::from_millis(700);
const PATIENCE: Duration = Duration::from_secs(4);
/// Zeroing: a range switch and one reading.
const ZERO_WITHIN: Duration = Duration::from_secs(5);
/// What a reading may take beyond its integration and its way over the wire.
const READ_WITHIN: Duration = Duration::from_secs(3);

/// What is open.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Task {
    Identifying {
        until: Instant,
    },
    Listening {
        exposure: Exposure,
        began: Instant,
        until: Instant,
    },
    None,
    /// An answer of a command that was given up is still to come, or not.
    Zeroing {
        until: Instant,
    },
}

/// See the module.
#[derive(Debug)]
pub struct Keithley {
    name: String,
    baud: u32,
    /// Full scale of each range, ampere, and readings a second, as the rig file has them.
    full_scales_a: Vec<f64>,
    rate_hz: u32,
    line: Vec<u8>,
    outgoing: VecDeque<String>,
    identity: Option<String>,
    mains_hz: f64,
    task: Task,
    wake: Option<Instant>,
    bytes: u64,
    /// Exposures given up whose readings may still come.
    stale: u32,
    events: VecDeque<PhotometerEvent>,
}

impl Keithley {
    /// A driver for a meter at a port of this name and rate, with these ranges (full scale,
    /// ampere) and so many readings a second.
    pub fn new(port: &str, baud: u32, full_scales_a: Vec<f64>, rate_hz: u32) -> Self {
        Self {
            name: format!("keithley-6485 at {port}"),
            baud: baud.max(1),
            full_scales_a,
            rate_hz: rate_hz.max(1),
            line: Vec::new(),
            outgoing: VecDeque::new(),
            identity: None,
            mains_hz: 50.0,
            task: Task::None,
            wake: None,
            bytes: 0,
            stale: 0,
            events: VecDeque::new(),
        }
    }

    fn send(&mut self, commands: &[&str]) {
        self.outgoing.extend(commands.iter().map(|command| format!("{command}\r")));
    }

    fn fail(&mut self, trouble: Trouble) {
        self.task = Task::None;
        self.wake = None;
        self.events.push_back(PhotometerEvent::Trouble(trouble));
    }

    fn fault(&mut self, what: &str) {
        let (device, name) = (self.name.clone(), what.to_owned());
        let cause = Cause::Detector;
        self.fail(Trouble::Fault(NamedFault { device, name, cause, loses_position: false }));
    }

    fn hear(&mut self, now: Instant, line: &str) {
        match self.task {
            Task::Identifying { .. } => self.hear_identity(line),
            Task::Zeroing { .. } if line.trim() == "1" => {
                self.task = Task::None;
                self.wake = None;
                self.events.push_back(PhotometerEvent::Zeroed);
            }
            Task::Listening { .. } if self.stale > 0 => self.stale -= 1,
            Task::Listening { exposure, began, .. } => {
                self.hear_readings(now, exposure, began, line);
            }
            Task::None | Task::Zeroing { .. } => {}
        }
    }

    fn hear_identity(&mut self, line: &str) {
        if line.contains(',') {
            if !(line.contains("MODEL 6485") || line.contains("MODEL 6487")) {
                let refusal = Refusal {
                    device: self.name.clone(),
                    what: format!("it calls itself \"{}\"", line.trim()),
                    expected: "a Keithley 6485 or 6487".to_owned(),
                    help: "correct driver or port in [photometer]".to_owned(),
                };
                return self.fail(Trouble::Refused(refusal));
            }
            self.identity = Some(line.trim().to_owned());
        } else if let (Some(hz), Some(identity)) = (number(line), self.identity.clone()) {
            self.mains_hz = if hz > 55.0 { 60.0 } else { 50.0 };
            self.task = Task::None;
            self.wake = None;
            self.events.push_back(PhotometerEvent::Ready(PhotometerFacts { identity }));
        }
    }

    fn hear_readings(&mut self, now: Instant, exposure: Exposure, began: Instant, line: &str) {
        let words: Option<Vec<f64>> = line.split(',').map(number).collect();
        let Some(words) = words else { return self.fault("its answer is damaged") };
        let readings: Vec<&[f64]> = words.chunks(3).collect();
        let is_whole = readings.iter().all(|reading| reading.len() == 3);
        let count = u32::try_from(readings.len()).unwrap_or(u32::MAX);
        if !is_whole || count != exposure.readings.min(READINGS_MAX) {
            return self.fault("its answer has another number of readings than were asked for");
        }
        let full_scale = self.full_scales_a.get(usize::from(exposure.range)).copied();
        let full_scale = full_scale.unwrap_or(f64::NAN);
        let mut saturated = 0;
        let values: Vec<f64> = readings
            .iter()
            .map(|reading| {
                if reading[0].abs() < OVERFLOW {
                    return reading[0];
                }
                saturated += 1;
                full_scale.copysign(reading[0])
            })
            .collect();
        let n = f64::from(count);
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        self.task = Task::None;
        self.wake = None;
        // The answer's own way over the wire lies between the last reading and now.
        let answer_s = 10.0 * line.len() as f64 / f64::from(self.baud);
        let answer_us = u64::try_from(Duration::from_secs_f64(answer_s).as_micros());
        let ended = now.micros().saturating_sub(answer_us.unwrap_or_default());
        self.events.push_back(PhotometerEvent::Exposed(Exposed {
            range: exposure.range,
            readings: count,
            mean,
            variance: if count > 1 { squares / (n - 1.0) } else { 0.0 },
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            saturated,
            began,
            ended: Instant::from_micros(ended.max(began.micros())),
            device_time_s: readings.first().map(|reading| reading[1]),
        }));
    }
}

/// A number, which may have its unit's letter behind it.
fn number(word: &str) -> Option<f64> {
    let word = word.trim().trim_end_matches('A');
    word.parse::<f64>().ok().filter(|number| number.is_finite())
}

impl Driver for Keithley {
    fn open(&mut self, now: Instant) {
        self.line.clear();
        self.outgoing.clear();
        self.identity = None;
        self.bytes = 0;
        self.stale = 0;
        self.send(&["*IDN?", "SYST:LFR?"]);
        self.task = Task::Identifying { until: now + PATIENCE };
        self.wake = Some(now + ASK_AGAIN);
    }

    fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        for byte in bytes {
            match byte {
                b'\r' | b'\n' => {
                    let line = std::mem::take(&mut self.line);
                    if !line.is_empty() {
                        self.hear(now, &String::from_utf8_lossy(&line));
                    }
                }
                _ if self.line.len() < LINE_MAX => self.line.push(*byte),
                _ => {}
            }
        }
    }

    fn handle_timeout(&mut self, now: Instant) {
        if self.wake.is_none_or(|at| at > now) {
            return;
        }
        let name = self.name.clone();
        match self.task {
            Task::None => self.wake = None,
            Task::Identifying { until } if now < until => {
                self.line.clear();
                self.send(&["*IDN?", "SYST:LFR?"]);
                self.wake = Some(now + ASK_AGAIN);
            }
            Task::Identifying { .. } => {
                let heard = match self.bytes {
                    0 => "nothing was heard; is it on, and set to RS-232?".to_owned(),
                    n => format!("{n} bytes were heard, none of them its name; another baud rate?"),
                };
                self.fail(Trouble::Silent(format!("{name}: no answer to *IDN?: {heard}")));
            }
            Task::Listening { .. } | Task::Zeroing { .. } => {
                self.fail(Trouble::Silent(format!("{name}: it stopped answering")));
            }
        }
    }

    fn poll_transmit(&mut self, _now: Instant) -> Option<Vec<u8>> {
        self.outgoing.pop_front().map(String::into_bytes)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.wake
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn promises(&self) -> Promises {
        Promises {
            accepted: "the commands were sent; none of them is answered",
            done: "every reading came, with its value, time and status",
            watchdog: None,
        }
    }
}

impl Photometer for Keithley {
    fn begin(&mut self, now: Instant, command: PhotometerCommand) {
        match command {
            PhotometerCommand::Zero => {
                self.send(&[
                    "*RST",
                    "FORM:ELEM READ,TIME,STAT",
                    "SYST:ZCH ON",
                    "RANG 2e-9",
                    "INIT",
                    "SYST:ZCOR:ACQ",
                    "SYST:ZCOR ON",
                    "SYST:ZCH OFF",
                    "*OPC?",
                ]);
                let until = now + ZERO_WITHIN;
                self.task = Task::Zeroing { until };
                self.wake = Some(until);
            }
            PhotometerCommand::Expose(exposure) => {
                let full_scale = self.full_scales_a.get(usize::from(exposure.range)).copied();
                let nplc =
                    (self.mains_hz / f64::from(self.rate_hz)).clamp(*NPLC.start(), *NPLC.end());
                let readings = exposure.readings.clamp(1, READINGS_MAX);
                self.send(&[
                    &format!("RANG {:e}", full_scale.unwrap_or_default()),
                    &format!("NPLC {nplc}"),
                    &format!("TRIG:COUN {readings}"),
                    "READ?",
                ]);
                let wire_s = f64::from(10 * READING_BYTES_MAX * readings) / f64::from(self.baud);
                let wait = exposure.duration + READ_WITHIN + Duration::from_secs_f64(wire_s);
                let until = now + wait;
                let exposure = Exposure { readings, ..exposure };
                self.task = Task::Listening { exposure, began: now, until };
                self.wake = Some(until);
            }
        }
    }

    fn abandon(&mut self, _now: Instant) {
        if matches!(self.task, Task::Listening { .. }) {
            self.stale += 1;
        }
        self.task = Task::None;
        self.wake = None;
        self.outgoing.clear();
    }

    fn poll_event(&mut self) -> Option<PhotometerEvent> {
        self.events.pop_front()
    }
}
