//! What could break: a meter that reads what is not there, keeps an offset that was taken off, or
//! answers out of turn.

use super::*;
use crate::bench::Bench;
use crate::bench::tests::board;
use crate::wire::Wire;

/// What the meter answers to these lines, each said when the last one's answer may have come.
fn talk(twin: MeterTwin, lines: &[&str]) -> Vec<String> {
    let mut bench = Bench::new(board());
    let end = if twin.make == MeterMake::Keithley6485 { "\r" } else { "\n" };
    bench.plug(twin, Wire::new(115_200));
    let mut now = Instant::ZERO;
    let mut heard = String::new();
    for line in lines {
        bench.send(now, 0, format!("{line}{end}").as_bytes());
        now = now + Duration::from_secs(2);
        bench.advance(now);
        while let Some(bytes) = bench.receive(now, 0) {
            heard += &String::from_utf8(bytes).unwrap();
        }
    }
    heard.split_terminator(['\r', '\n']).map(str::to_owned).collect()
}

fn value(text: &str) -> f64 {
    text.trim_end_matches('A').parse().unwrap()
}

/// The photocurrent where the board stands at boot, as its own controller reads it.
fn seen_a() -> f64 {
    let mut board = board();
    let now = Instant::from_micros(1_000_000);
    let illumination =
        Illumination { reading: 1, gain: 0, shutter: firmware_protocol::Shutter::Open };
    board.prepare_dwell(now, illumination);
    board.begin_dwell(now, illumination);
    f64::from(board.convert(now).unwrap()) / 8_388_608.0 * 1e-6
}

#[test]
fn a_picoammeter_reads_the_photocurrent_once_its_offset_is_off() {
    let set = ["*RST", "FORM:ELEM READ", "CURR:RANG 1e-6", "CURR:RANG:AUTO OFF"];
    let zero = ["SYST:ZCH ON", "INIT", "*OPC?", "SYST:ZCOR:ACQ", "SYST:ZCOR ON", "SYST:ZCH OFF"];
    let seen = seen_a();
    // With its input disconnected it reads what it is off by, and then nothing.
    let off = [&set[..], &["READ?"], &zero[..], &["SYST:ZCH ON", "READ?"]].concat();
    let off = talk(MeterTwin::new(MeterMake::Keithley6485), &off);
    assert_eq!((off[0].as_str(), off[2].as_str()), ("+1.200000E-11A", "+0.000000E+00A"));
    let lines = [&set[..], &zero[..], &["TRIG:COUN 3", "READ?", "SYST:ERR?"]].concat();
    let zeroed = talk(MeterTwin::new(MeterMake::Keithley6485), &lines);
    assert_eq!((zeroed[0].as_str(), zeroed.len()), ("1", 3));
    let readings: Vec<f64> = zeroed[1].split(',').map(value).collect();
    assert_eq!(readings.len(), 3);
    for reading in readings {
        assert!((reading / seen - 1.0).abs() < 2e-3, "{reading} beside {seen}");
    }
    assert_eq!(zeroed[2], "0,\"No error\"");
}

#[test]
fn what_it_does_not_know_is_an_error_and_never_an_answer() {
    let lines = ["CURR:RANGE:FOO 1", "BAR?", "CURR:RANG 7", "SYST:ERR?", "SYST:ERR?", "SYST:ERR?"];
    let heard = talk(MeterTwin::new(MeterMake::Keithley6485), &lines);
    assert_eq!(heard.len(), 3);
    assert!(heard[0].starts_with("-113") && heard[1].starts_with("-113"), "{heard:?}");
    assert!(heard[2].starts_with("-222"), "{heard:?}");
}

#[test]
fn a_power_meter_zeroes_and_reads() {
    let lines = [
        "*IDN?",
        "SENS:CORR:COLL:ZERO:INIT;:SENS:CORR:COLL:ZERO:STAT?",
        "SENS:CORR:COLL:ZERO:STAT?",
        "SENSE:POWER:DC:RANGE:UPPER 1e-6",
        "MEAS:POW?",
    ];
    let heard = talk(MeterTwin::new(MeterMake::ThorlabsPm100), &lines);
    assert!(heard[0].starts_with("THORLABS,PM100D"), "{heard:?}");
    assert_eq!((heard[1].as_str(), heard[2].as_str()), ("1", "0"));
    assert!((value(&heard[3]) / seen_a() - 1.0).abs() < 2e-3, "{heard:?}");
}

#[test]
fn a_newport_answers_in_its_own_way() {
    let lines = ["U?", "R1", "R?", "W633", "W?", "NONSENSE", "D?"];
    let heard = talk(MeterTwin::new(MeterMake::Newport1830C), &lines);
    assert_eq!(heard[..3], ["1", "1", "0633"]);
    assert!((value(&heard[3]) / (seen_a() + OFFSET) - 1.0).abs() < 2e-3, "{heard:?}");
}

#[test]
fn what_does_not_fit_the_range_reads_as_the_makers_say_and_a_stalled_meter_says_nothing() {
    // Its only range ends far below what is seen in this light.
    let heard = talk(
        MeterTwin::new(MeterMake::Keithley6485).with_stall(2),
        &["*RST", "SYST:ZCH OFF", "FORM:ELEM READ", "READ?", "READ?", "READ?", "*IDN?"],
    );
    assert_eq!(heard.len(), 1, "it answers one, and stalls in the second: {heard:?}");
}
