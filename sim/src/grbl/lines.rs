//! Carrying out lines: what a simulated grbl does with each, and when it answers.

use firmware_protocol::{Instant, Shutter};

use super::homing::Homing;
use super::motion::Block;
use super::words::{self, Line};
use super::{GrblTwin, LINE_BYTES_MAX, PARSE_US, PLANNER_BLOCKS, State, Waiting};
use crate::SimulatedBoard;

impl GrblTwin {
    /// Reads and carries out lines, as long as none has to wait.
    pub(super) fn read_lines(&mut self, board: &mut SimulatedBoard, now: Instant) {
        while self.busy_until <= now && self.would_read() {
            while !self.has_line {
                match self.received.pop_front() {
                    Some(b'\n' | b'\r') => self.has_line = true,
                    Some(byte) if self.line.len() <= LINE_BYTES_MAX => self.line.push(byte),
                    Some(_) => {}
                    None => return,
                }
            }
            if self.is_full() {
                return;
            }
            self.has_line = false;
            let bytes = std::mem::take(&mut self.line);
            let text = String::from_utf8_lossy(&bytes).trim().to_owned();
            self.busy_until = Instant::from_micros(now.micros() + PARSE_US);
            let answer = if text.len() > LINE_BYTES_MAX {
                Err(11)
            } else if let Some(command) = text.strip_prefix('$') {
                self.command(board, now, command)
            } else {
                self.code(board, now, &text)
            };
            match answer {
                Ok(true) => self.say("ok"),
                Ok(false) => {}
                Err(number) => self.say(&format!("error:{number}")),
            }
        }
    }

    fn is_full(&self) -> bool {
        self.blocks.len() >= PLANNER_BLOCKS
    }

    /// Whether it would take bytes out of its buffer, or carry out the line that it took. A line
    /// that waits for room among the blocks has left the buffer; no byte behind it has.
    pub(super) fn would_read(&self) -> bool {
        let is_stuck = matches!(self.state, State::Alarm(Some(_)));
        let is_free = self.boots_at.is_none() && self.waiting.is_none() && self.homing.is_none();
        let has_work = if self.has_line { !self.is_full() } else { !self.received.is_empty() };
        is_free && !is_stuck && has_work
    }

    /// A line that begins with `$`. Whether it is answered now.
    fn command(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        text: &str,
    ) -> Result<bool, u8> {
        let is_at_rest = matches!(self.state, State::Idle | State::Alarm(_));
        match text {
            "" => {
                self.say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]");
            }
            "G" => self.list_modes(),
            _ if !is_at_rest => return Err(8),
            "$" => self.list_settings(),
            "I" => self.list_build(),
            "#" => self.list_offsets(),
            "X" => {
                if self.state == State::Alarm(None) {
                    self.say("[MSG:Caution: Unlocked]");
                    self.state = State::Idle;
                }
            }
            "C" => self.state = State::Check,
            "H" => {
                self.homing = Some(Homing::begin(self, board, now));
                self.state = State::Home;
                return Ok(false);
            }
            _ => return Err(3),
        }
        Ok(true)
    }

    /// A line of g-code. Whether it is answered now.
    fn code(&mut self, board: &mut SimulatedBoard, now: Instant, text: &str) -> Result<bool, u8> {
        if text.is_empty() {
            return Ok(true);
        }
        if matches!(self.state, State::Alarm(_)) {
            return Err(9);
        }
        let line = words::read(text, self.axes.len())?;
        self.set_modes(&line);
        let output = line.coolant.is_some() || line.spindle.is_some();
        if let Some(on) = line.coolant {
            self.outputs.is_flood = on;
        }
        if let Some(on) = line.spindle {
            self.outputs.is_spindle = on;
        }
        if output || line.pause_s.is_some() {
            // The outputs close the shutter, when motion has drained.
            let is_closed = self.outputs.is_flood || self.outputs.is_spindle;
            let shutter = if is_closed { Shutter::Closed } else { Shutter::Open };
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
            let pause_us = (line.pause_s.unwrap_or(0.0) * 1e6) as u64;
            let shutter = output.then_some(shutter);
            self.waiting = Some(Waiting::Drain { pause_us, shutter });
            self.wait_on(board, now);
            return Ok(false);
        }
        if line.axes.is_empty() {
            return Ok(true);
        }
        self.queue(board, now, &line)
    }

    fn set_modes(&mut self, line: &Line) {
        self.motion = line.motion.unwrap_or(self.motion);
        self.modes.is_inches = line.is_inches.unwrap_or(self.modes.is_inches);
        self.modes.is_incremental = line.is_incremental.unwrap_or(self.modes.is_incremental);
        self.feed = line.feed.map_or(self.feed, |feed| feed * self.unit());
    }

    fn unit(&self) -> f64 {
        if self.modes.is_inches { 25.4 } else { 1.0 }
    }

    fn queue(&mut self, board: &mut SimulatedBoard, now: Instant, line: &Line) -> Result<bool, u8> {
        if self.motion == 1 && self.feed <= 0.0 {
            return Err(22);
        }
        let mut target = self.planned.clone();
        for (n, value) in &line.axes {
            let (Some(axis), Some(slot)) = (self.axes.get(*n), target.get_mut(*n)) else {
                return Err(20);
            };
            let steps = libm::round(value * self.unit() * axis.steps_per_unit);
            *slot =
                if self.modes.is_incremental && !line.is_machine { *slot + steps } else { steps };
        }
        let is_outside =
            self.axes.iter().zip(&target).any(|(axis, steps)| {
                *steps > 0.0 || *steps < -axis.travel_units * axis.steps_per_unit
            });
        if is_outside {
            self.alarm(now, 2);
            return Ok(false);
        }
        if self.state == State::Check {
            return Ok(true);
        }
        let units = self.axes.iter().zip(&self.planned).zip(&target);
        let length = units.map(|((axis, from), to)| (to - from) / axis.steps_per_unit);
        let length = libm::sqrt(length.map(|units| units * units).sum());
        let lengths_per_s = (self.motion == 1 && length > 0.0).then(|| self.feed / 60.0 / length);
        self.planned.clone_from(&target);
        self.blocks.push_back(Block { target, lengths_per_s });
        self.moves = self.moves.wrapping_add(1);
        if self.state == State::Idle {
            self.set_out(board, now);
        }
        Ok(true)
    }

    /// Whether what a line waited for has come: then it is answered.
    pub(super) fn wait_on(&mut self, board: &mut SimulatedBoard, now: Instant) {
        if let Some(Waiting::Drain { pause_us, shutter }) = self.waiting
            && self.state == State::Idle
            && !self.is_moving()
        {
            let until = Instant::from_micros(now.micros() + pause_us);
            self.waiting = Some(Waiting::Pause { until, shutter });
        }
        if let Some(Waiting::Pause { until, shutter }) = self.waiting
            && until <= now
        {
            if let Some(shutter) = shutter {
                board.put_shutter(shutter);
            }
            self.waiting = None;
            self.say("ok");
        }
    }
}
