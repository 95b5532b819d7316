//! What could break: a meter that reads what is not there, keeps an offset that was taken off, or
//! answers out of turn.

use super::*;
use crate::bench::Bench;
use crate::bench::tests::{board, noisy_board};
use crate::wire::Wire;

/// What the meter answers to these lines, each said when the last one's answer may have come.
fn talk(twin: MeterTwin, lines: &[&str]) -> Vec<String> {
    talk_on(board(), twin, lines)
}

fn talk_on(board: SimulatedBoard, twin: MeterTwin, lines: &[&str]) -> Vec<String> {
    let mut bench = Bench::new(board);
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
    assert_eq!(off[0], "+1.200000E-11A");
    assert!(value(&off[2]).abs() < 1e-24, "{}", off[2]);
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

/// The readings of fifty, and the seconds between two of them, at so many power line cycles.
fn fifty_at(nplc: f64) -> (Vec<f64>, f64) {
    let set = ["*RST", "FORM:ELEM READ,TIME", "CURR:RANG 1e-6", "SYST:ZCH OFF"].map(str::to_owned);
    let ask = [format!("CURR:NPLC {nplc}"), "TRIG:COUN 50".to_owned(), "READ?".to_owned()];
    let lines: Vec<String> =
        set.into_iter().chain(ask).chain((0..6).map(|_| String::new())).collect();
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let meter = MeterTwin::new(MeterMake::Keithley6485);
    let heard = talk_on(noisy_board(1e-10), meter, &lines);
    let elements: Vec<f64> = heard[0].split(',').map(value).collect();
    let readings = elements.iter().step_by(2).copied().collect();
    let times: Vec<f64> = elements.iter().skip(1).step_by(2).copied().collect();
    (readings, (times[49] - times[0]) / 49.0)
}

fn spread(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|value| (value - mean).powi(2));
    libm::sqrt(squares.sum::<f64>() / (values.len() - 1) as f64)
}

#[test]
fn a_picoammeter_integrates_over_the_power_line_cycles_that_it_was_told() {
    let [(short, short_s), (one, one_s), (ten, ten_s)] = [0.01, 1.0, 10.0].map(fifty_at);
    // Of a line of 50 Hz.
    for (found, expected) in [(short_s, 0.0002), (one_s, 0.02), (ten_s, 0.2)] {
        assert!((found / expected - 1.0).abs() < 0.01, "{found} s, not {expected} s");
    }
    let [short, one, ten] = [short, one, ten].map(|readings| spread(&readings));
    // White noise: ten times the time, a root of ten less. Fifty readings tell it to a tenth.
    assert!((one / ten / 10.0_f64.sqrt() - 1.0).abs() < 0.4, "{one} A beside {ten} A");
    assert!((short / one / 10.0 - 1.0).abs() < 0.4, "{short} A beside {one} A");
}

#[test]
fn a_meter_of_a_table_speaks_its_words_and_no_others() {
    let list = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    let words = ScpiWords {
        identity: "OPTOMETER".to_owned(),
        ends_with_cr: false,
        set_up: list(&["CONF:CURR"]),
        zero: list(&["ZERO:BEGIN", "ZERO:END"]),
        range: "CURR:RANG {} A".to_owned(),
        read: "MEAS?".to_owned(),
        element: 2,
        has_error_queue: true,
    };
    let meter = || MeterTwin::new(MeterMake::Scpi(Box::new(words.clone())));
    let lines = [
        "*IDN?",
        "CONF:CURR",
        "SYST:ERR?",
        "CURR:RANG 1e-6 A",
        "SYST:ERR?",
        "MEAS?",
        "ZERO:BEGIN",
        "ZERO:END",
        "MEAS?",
        "CURR:RANG 1 A",
        "SYST:ERR?",
        "READ?",
        "SYST:ERR?",
    ];
    let heard = talk(meter(), &lines);
    assert_eq!(heard[..3], ["SIMULATED,OPTOMETER,1,0", "0,\"No error\"", "0,\"No error\""]);
    let readings = [&heard[3], &heard[4]].map(|answer| {
        assert!(answer.starts_with("0,0,+"), "{answer}");
        value(answer.rsplit(',').next().unwrap())
    });
    assert!((readings[1] / seen_a() - 1.0).abs() < 2e-3, "{readings:?}");
    let errors = ["-222,\"Data out of range\"", "-113,\"Undefined header\""];
    assert_eq!(heard[5..], errors, "what is too much, and another maker's word");
}
