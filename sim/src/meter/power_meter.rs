//! The words of Thorlabs' PM100D with a photodiode head.

use core::time::Duration;

use firmware_protocol::Instant;

use super::scpi::{Word, scientific, words as scpi_words};
use super::{MeterTwin, Settings, full_scale, range_for};
use crate::SimulatedBoard;

const UNDEFINED: &str = "-113,\"Undefined header\"";
const OUT_OF_RANGE: &str = "-222,\"Data out of range\"";
/// How long its zeroing takes.
const ZEROING: Duration = Duration::from_millis(800);

impl MeterTwin {
    pub(super) fn obey_as_power_meter(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        line: &str,
    ) {
        for Word { header, argument } in scpi_words(line) {
            if header.ends_with('?') {
                self.answer_as_power_meter(board, now, &header, &argument);
            } else {
                self.set_power_meter(board, now, &header, &argument);
            }
        }
    }

    fn answer_as_power_meter(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        header: &str,
        argument: &str,
    ) {
        let gain = self.settings.gain.unwrap_or(0);
        let on = |flag: bool| if flag { "1" } else { "0" };
        let highest = board.nominal().detector.gains.iter().map(|gain| gain.full_scale_a);
        let highest = highest.fold(0.0, f64::max);
        let answer = match (header, argument.to_ascii_uppercase().as_str()) {
            ("*IDN?", _) => "THORLABS,PM100D,P0001234,2.4.0".to_owned(),
            ("*OPC?", _) => "1".to_owned(),
            ("*ESR?" | "*STB?" | "STAT:OPER?", _) => "0".to_owned(),
            ("SYST:ERR?", _) => return self.say_error(),
            ("SYST:LFR?", _) => "50".to_owned(),
            // Photodiode; power sensor, wavelength settable, responsivity settable.
            ("SYST:SENS:IDN?", _) => "S120C,18012345,01-Jan-2018,1,18,33".to_owned(),
            ("CORR:WAV?", "MIN") => scientific(400.0),
            ("CORR:WAV?", "MAX") => scientific(1100.0),
            ("CORR:WAV?", _) => scientific(self.settings.wavelength_nm),
            ("CORR:COLL:ZERO:STAT?", _) => on(self.zero_ends.is_some()).to_owned(),
            ("CORR:COLL:ZERO:MAGN?", _) => scientific(self.settings.correction),
            ("AVER?" | "AVER:COUN?", _) => self.settings.average.to_string(),
            ("POW:UNIT?", _) => if self.settings.unit == 1 { "W" } else { "DBM" }.to_owned(),
            ("POW:RANG:AUTO?" | "CURR:RANG:AUTO?", _) => {
                on(self.settings.gain.is_none()).to_owned()
            }
            ("POW:RANG?" | "CURR:RANG?", "MAX") => scientific(highest),
            ("POW:RANG?" | "CURR:RANG?", "MIN") => scientific(0.0),
            ("POW:RANG?" | "CURR:RANG?", _) => scientific(full_scale(board, gain)),
            ("CONF?", _) => if self.settings.is_power { "POW" } else { "CURR" }.to_owned(),
            ("READ?" | "MEAS?" | "MEAS:POW?" | "MEAS:CURR?", _) => {
                return self.integrate(board, now, true);
            }
            ("FETC?", _) => words(Some(self.settings.last)),
            _ => return self.fail(UNDEFINED),
        };
        self.say(&answer);
    }

    fn set_power_meter(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        header: &str,
        argument: &str,
    ) {
        let number = argument.parse::<f64>().ok().filter(|number| number.is_finite());
        let is_on = matches!(argument.to_ascii_uppercase().as_str(), "ON" | "1");
        let settings = &mut self.settings;
        match (header, number) {
            ("*RST", _) => *settings = Settings::at_power_up(&self.make),
            ("*CLS", _) => self.errors.clear(),
            ("CONF" | "CONF:POW", _) => settings.is_power = true,
            ("CONF:CURR", _) => settings.is_power = false,
            ("POW:UNIT", _) => {
                settings.unit = if argument.eq_ignore_ascii_case("W") { 1 } else { 2 }
            }
            ("CORR:WAV", Some(nm)) if (400.0..=1100.0).contains(&nm) => settings.wavelength_nm = nm,
            ("AVER:COUN" | "AVER", Some(count)) if (1.0..=1e4).contains(&count) => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // just checked
                let count = count as u32;
                settings.average = count;
            }
            ("POW:RANG:AUTO" | "CURR:RANG:AUTO", _) => {
                settings.gain = if is_on { None } else { settings.gain.or(Some(0)) };
            }
            ("POW:RANG" | "CURR:RANG", Some(range)) if range >= 0.0 => {
                settings.gain = Some(range_for(board, range));
            }
            ("CORR:COLL:ZERO:INIT" | "CORR:COLL:ZERO", _) => self.zero_ends = Some(now + ZEROING),
            ("CORR:COLL:ZERO:ABOR", _) => self.zero_ends = None,
            ("INIT" | "ABOR" | "CORR:BEAM" | "CORR", _) => {}
            ("CORR:WAV" | "AVER:COUN" | "POW:RANG" | "CURR:RANG", _) => self.fail(OUT_OF_RANGE),
            _ => self.fail(UNDEFINED),
        }
    }
}

/// A reading as the instrument writes it.
pub(super) fn words(value: Option<f64>) -> String {
    scientific(value.unwrap_or(9.9e37))
}
