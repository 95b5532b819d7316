//! What a simulated grbl says about itself: status reports, settings and build.

use firmware_protocol::Instant;

use super::words::LETTERS;
use super::{GrblTwin, PLANNER_BLOCKS, PULL_OFF, RX_BYTES, State};

/// Offsets and overrides come with one report in so many.
const OFFSETS_EVERY: u32 = 30;

impl GrblTwin {
    /// The answer to `?`.
    pub(super) fn report(&mut self, now: Instant) {
        let holds_still = self.leg.as_ref().is_none_or(|leg| leg.ends_at() <= now);
        let state = match self.state {
            State::Alarm(_) => "Alarm",
            State::Check => "Check",
            State::Hold if holds_still => "Hold:0",
            State::Hold => "Hold:1",
            State::Home => "Home",
            State::Idle => "Idle",
            State::Run => "Run",
        };
        let here = self.here(now);
        let units = self.axes.iter().zip(here).map(|(axis, steps)| steps / axis.steps_per_unit);
        let position: Vec<String> = units.map(|units| format!("{units:.3}")).collect();
        let mut text = format!("<{state}|MPos:{}|FS:0,0", position.join(","));
        match self.reports % OFFSETS_EVERY {
            0 => {
                let zeros: Vec<&str> = self.axes.iter().map(|_| "0.000").collect();
                text.push_str("|WCO:");
                text.push_str(&zeros.join(","));
            }
            1 => {
                text.push_str("|Ov:100,100,100");
                let outputs = [(self.outputs.is_spindle, 'S'), (self.outputs.is_flood, 'F')];
                let on: String =
                    outputs.iter().filter(|(is_on, _)| *is_on).map(|(_, letter)| letter).collect();
                if !on.is_empty() {
                    text.push_str("|A:");
                    text.push_str(&on);
                }
            }
            _ => {}
        }
        self.reports = self.reports.wrapping_add(1);
        text.push('>');
        self.say(&text);
    }

    /// The answer to `$$`.
    pub(super) fn list_settings(&mut self) {
        let common: [(u16, f64); 22] = [
            (0, 10.0),
            (1, 25.0),
            (2, 0.0),
            (3, 0.0),
            (4, 0.0),
            (5, 0.0),
            (6, 0.0),
            (10, 1.0),
            (11, 0.01),
            (12, 0.002),
            (13, 0.0),
            (20, 1.0),
            (21, 1.0),
            (22, 1.0),
            (23, 0.0),
            (24, 25.0),
            (25, self.homing_seek()),
            (26, 250.0),
            (27, PULL_OFF),
            (30, 1000.0),
            (31, 0.0),
            (32, 0.0),
        ];
        for (number, value) in common {
            let is_whole = matches!(number, 0..=10 | 13 | 20..=23 | 26 | 30..);
            let text = if is_whole {
                format!("${number}={value:.0}")
            } else {
                format!("${number}={value:.3}")
            };
            self.say(&text);
        }
        let axes = self.axes.clone();
        for (first, value) in [(100, 0), (110, 1), (120, 2), (130, 3)] {
            for (n, axis) in axes.iter().enumerate() {
                let value = match value {
                    0 => axis.steps_per_unit,
                    1 => 60.0 * axis.limits.speed / axis.steps_per_unit,
                    2 => axis.limits.acceleration / axis.steps_per_unit,
                    _ => axis.travel_units,
                };
                self.say(&format!("${}={value:.3}", first + n));
            }
        }
    }

    fn homing_seek(&self) -> f64 {
        let seek = self.axes.iter().map(|axis| 15.0 * axis.limits.speed / axis.steps_per_unit);
        seek.fold(f64::INFINITY, f64::min)
    }

    /// The answer to `$I`.
    pub(super) fn list_build(&mut self) {
        self.say("[VER:1.1h.20190830:]");
        if self.axes.len() > 3 {
            // As boards with more axes than three list them.
            let letters: String = LETTERS.chars().take(self.axes.len()).collect();
            self.say(&format!("[AXS:{}:{letters}]", self.axes.len()));
        }
        self.say(&format!("[OPT:V,{PLANNER_BLOCKS},{RX_BYTES}]"));
    }

    /// The answer to `$G`.
    pub(super) fn list_modes(&mut self) {
        let motion = self.motion;
        let units = if self.modes.is_inches { 20 } else { 21 };
        let distance = if self.modes.is_incremental { 91 } else { 90 };
        let spindle = if self.outputs.is_spindle { 3 } else { 5 };
        let coolant = if self.outputs.is_flood { 8 } else { 9 };
        let feed = self.feed;
        self.say(&format!(
            "[GC:G{motion} G54 G17 G{units} G{distance} G94 M{spindle} M{coolant} T0 F{feed:.0} S0]"
        ));
    }

    /// The answer to `$#`: no offsets, and nothing probed.
    pub(super) fn list_offsets(&mut self) {
        let zeros = vec!["0.000"; self.axes.len()].join(",");
        for name in ["G54", "G55", "G56", "G57", "G58", "G59", "G28", "G30", "G92"] {
            self.say(&format!("[{name}:{zeros}]"));
        }
        self.say("[TLO:0.000]");
        self.say(&format!("[PRB:{zeros}:0]"));
    }
}
