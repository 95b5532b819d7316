//! How long devices of other makes are waited for beside their motion and their integration. It knows how often
//! they are asked and how much they say, not their words.

use std::time::Duration;

use super::devices::{AxesDriver, AxesLink, Devices, Port, ShutterServo};
use super::{Rig, meters::PhotometerDriver};

/// Between two looks at servos that move: 25 of them in the servos' patience.
pub const SERVO_LOOK_AGAIN: Duration = Duration::from_millis(20);
/// A shutter's speed, steps a second: an eighth of a turn in two tenths of one.
pub const SHUTTER_SPEED: u32 = 4096;
/// Its acceleration, steps a second squared.
pub const SHUTTER_ACCELERATION: u32 = 40_960;

/// Of each servo's answer to a look: the table from torque to position, and what frames it.
const SERVO_ANSWER_BYTES: u64 = 80;
/// `+1.234567E-09A,+1.234567E+03,` of each reading: value and time.
const KEITHLEY_READING_BYTES: u64 = 29;
/// On a serial line, with start and stop.
const BITS_A_BYTE: u64 = 10;

impl Rig {
    /// How long a meter of another make takes to tell so many readings, seconds; of gonio's own
    /// controller, which tells their sum, nothing that counts.
    pub fn answer_s(&self, readings: u32) -> f64 {
        self.devices.as_ref().map_or(0.0, |devices| devices.answer_s(readings))
    }

    /// How much later than it is so axes of another make are known to stand, on the mean, seconds; nothing that
    /// counts of those which say it by themselves.
    pub fn arrival_s(&self) -> f64 {
        let links = self.devices.iter().flat_map(|devices| &devices.axes);
        links.map(AxesLink::arrival_s).fold(0.0, f64::max)
    }

    /// How long a servo that holds a shutter takes to close it, or to open it, and to be known to have, seconds.
    pub fn shutter_s(&self) -> f64 {
        let links = self.devices.iter().flat_map(|devices| &devices.axes);
        links.map(AxesLink::shutter_s).fold(0.0, f64::max)
    }
}

impl Devices {
    /// How long the meter takes to tell so many readings, seconds: its answer's way over a serial
    /// line, which a network or USB has no match for.
    fn answer_s(&self, readings: u32) -> f64 {
        let is_elsewhere =
            |port: &Port| ["tcp:", "/dev/usbtmc"].iter().any(|kind| port.path.starts_with(kind));
        let meter = &self.photometer;
        if meter.port.as_ref().is_some_and(is_elsewhere) {
            return 0.0;
        }
        // A picoammeter tells every one of them with its time; the others tell one mean.
        match meter.driver {
            PhotometerDriver::Keithley(_) => {
                line_s(u64::from(readings) * KEITHLEY_READING_BYTES, meter.baud)
            }
            _ => 0.0,
        }
    }
}

impl AxesLink {
    /// Servos are asked before they set out, and then again and again: their answers' way, before, within and at
    /// the end of a look's interval, in whose middle they come to rest on the mean.
    fn arrival_s(&self) -> f64 {
        let AxesDriver::Dynamixel { ids, shutter, .. } = &self.driver else { return 0.0 };
        let servos = ids.len() + usize::from(shutter.is_some());
        let answer_s = line_s(servos as u64 * SERVO_ANSWER_BYTES, self.baud);
        0.5 * SERVO_LOOK_AGAIN.as_secs_f64() + 2.5 * answer_s
    }

    fn shutter_s(&self) -> f64 {
        let AxesDriver::Dynamixel { shutter: Some(shutter), .. } = &self.driver else { return 0.0 };
        shutter.turn_s() + self.arrival_s()
    }
}

impl ShutterServo {
    /// From open to closed, by its profile.
    fn turn_s(&self) -> f64 {
        let steps = f64::from(self.open_steps.abs_diff(self.closed_steps));
        let (speed, acceleration) = (f64::from(SHUTTER_SPEED), f64::from(SHUTTER_ACCELERATION));
        if steps > speed * speed / acceleration {
            steps / speed + speed / acceleration
        } else {
            2.0 * libm::sqrt(steps / acceleration)
        }
    }
}

fn line_s(bytes: u64, baud: u32) -> f64 {
    (BITS_A_BYTE * bytes) as f64 / f64::from(baud)
}
