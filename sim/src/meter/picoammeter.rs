//! The words of Keithley's 6485.

use firmware_protocol::Instant;

use super::scpi::{Word, scientific, words};
use super::{MeterTwin, Settings, full_scale, range_for};
use crate::SimulatedBoard;

/// Readings that one trigger takes at most.
const READINGS_MAX: u32 = 2500;
/// A range holds so much more than its name.
const OVERRANGE: f64 = 1.05;
const UNDEFINED: &str = "-113,\"Undefined header\"";
const OUT_OF_RANGE: &str = "-222,\"Parameter data out of range\"";

impl MeterTwin {
    pub(super) fn obey_as_picoammeter(
        &mut self,
        board: &mut SimulatedBoard,
        now: Instant,
        line: &str,
    ) {
        for Word { header, argument } in words(line) {
            let header = match header.as_str() {
                // What measures current may be left out.
                "RANG" | "RANG?" | "RANG:AUTO" | "NPLC" | "NPLC?" => format!("CURR:{header}"),
                _ => header,
            };
            if header.ends_with('?') {
                self.answer_as_picoammeter(board, now, &header);
            } else {
                self.set_picoammeter(board, now, &header, &argument);
            }
        }
    }

    fn answer_as_picoammeter(&mut self, board: &mut SimulatedBoard, now: Instant, header: &str) {
        let gain = self.settings.gain.unwrap_or(0);
        let on = |flag: bool| if flag { "1" } else { "0" };
        let answer = match header {
            "*IDN?" => "KEITHLEY INSTRUMENTS INC.,MODEL 6485,1234567,B02   ".to_owned(),
            "*OPC?" => "1".to_owned(),
            "*ESR?" | "*STB?" | "STAT:MEAS?" => "0".to_owned(),
            "SYST:LFR?" => "50".to_owned(),
            "SYST:ERR?" => return self.say_error(),
            "SYST:ZCH?" => on(self.settings.zero_check).to_owned(),
            "SYST:ZCOR?" => on(self.settings.zero_correct).to_owned(),
            "CURR:RANG?" => scientific(full_scale(board, gain) * OVERRANGE),
            "CURR:RANG:AUTO?" => on(self.settings.gain.is_none()).to_owned(),
            "CURR:NPLC?" => scientific(self.settings.nplc),
            "AVER:COUN?" => self.settings.average.to_string(),
            "TRIG:COUN?" => self.settings.count.to_string(),
            "FORM:ELEM?" => self.settings.elements.to_owned(),
            "READ?" | "MEAS?" | "MEAS:CURR?" => return self.integrate(board, now, true),
            "FETC?" | "SENS:DATA?" | "DATA?" => {
                self.picoammeter_words(Some(self.settings.last), now)
            }
            _ => return self.fail(UNDEFINED),
        };
        self.say(&answer);
    }

    fn set_picoammeter(
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
            ("*RST" | "SYST:PRES", _) => {
                // A reset leaves zero check on, and the filter off.
                *settings = Settings { average: 1, nplc: 1.0, ..Settings::at_power_up(&self.make) };
            }
            ("*CLS", _) => self.errors.clear(),
            ("FORM:ELEM", _) => {
                let has = |name: &str| argument.to_ascii_uppercase().contains(name);
                settings.elements = match (has("TIME"), has("STAT")) {
                    _ if has("ALL") || has("DEF") => "READ,UNIT,TIME,STAT",
                    (true, true) => "READ,TIME,STAT",
                    (true, false) => "READ,TIME",
                    (false, true) => "READ,STAT",
                    (false, false) => "READ",
                };
            }
            ("SYST:ZCH" | "SYST:ZCH:STAT", _) => settings.zero_check = is_on,
            ("SYST:ZCOR" | "SYST:ZCOR:STAT", _) => settings.zero_correct = is_on,
            ("SYST:ZCOR:ACQ", _) if settings.zero_check => {
                let before = if settings.zero_correct { settings.correction } else { 0.0 };
                settings.correction = settings.last + before;
            }
            ("SYST:ZCOR:ACQ", _) => self.fail("-221,\"Settings conflict\""),
            ("CURR:RANG", Some(range)) if range.abs() <= 0.021 => {
                settings.gain = Some(range_for(board, range.abs()));
            }
            ("CURR:RANG:AUTO", _) => {
                settings.gain = if is_on { None } else { settings.gain.or(Some(0)) };
            }
            ("CURR:NPLC", Some(nplc)) if (0.01..=60.0).contains(&nplc) => settings.nplc = nplc,
            ("AVER:COUN", Some(count)) if (2.0..=100.0).contains(&count) => {
                settings.average = whole(count);
                if settings.conversions > 1 {
                    settings.conversions = settings.average;
                }
            }
            ("AVER" | "AVER:STAT", _) => {
                settings.conversions = if is_on { settings.average } else { 1 };
            }
            (
                "AVER:TCON" | "SYST:AZER" | "DISP:ENAB" | "FUNC" | "CONF" | "CONF:CURR" | "ABOR"
                | "SYST:REM" | "SYST:LOC" | "ARM:COUN" | "ARM:SOUR" | "TRIG:SOUR" | "TRIG:DEL"
                | "MED",
                _,
            ) => {}
            ("TRIG:COUN", Some(count)) if (1.0..=f64::from(READINGS_MAX)).contains(&count) => {
                settings.count = whole(count);
            }
            ("INIT" | "INIT:IMM", _) => self.integrate(board, now, false),
            ("CURR:RANG" | "CURR:NPLC" | "AVER:COUN" | "TRIG:COUN", _) => self.fail(OUT_OF_RANGE),
            _ => self.fail(UNDEFINED),
        }
    }

    /// A reading with its elements, as the instrument writes them.
    pub(super) fn picoammeter_words(&self, value: Option<f64>, at: Instant) -> String {
        let value = value.unwrap_or(9.9e37);
        let time = scientific(at.micros() as f64 / 1e6);
        let reading = scientific(value) + "A";
        match self.settings.elements {
            "READ" => reading,
            "READ,TIME" => format!("{reading},{time}"),
            "READ,STAT" => format!("{reading},+0.000000E+00"),
            _ => format!("{reading},{time},+0.000000E+00"),
        }
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked by the caller
fn whole(number: f64) -> u32 {
    number as u32
}
