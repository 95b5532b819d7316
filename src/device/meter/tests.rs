//! What could break: a number that is none taken for one, an answer for another question's, a
//! meter that is set otherwise than it was told to be, or a wait without an end. Word for word, as
//! the makers' manuals and users' programs have them.

use super::*;
use crate::device::photometer::{Exposed, Exposure};
use crate::rig::{Filter, Measures, Newport1830, Picoammeter, PowerMeter, ScpiTable};

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

fn line(full_scales: &[f64]) -> Line {
    Line { port: "test".to_owned(), baud: 9600, full_scales: full_scales.to_vec(), rate_hz: 50 }
}

fn picoammeter() -> Meter {
    let meter = Picoammeter { nplc: 1.0, average: 1, zero: true };
    Meter::of(&line(&[2e-9, 2e-6]), &PhotometerDriver::Keithley(meter))
}

fn power_meter(measures: Measures) -> Meter {
    let meter = PowerMeter { measures, wavelength_nm: Some(633.0), average: 10, zero: true };
    Meter::of(&line(&[1e-3]), &PhotometerDriver::Thorlabs(meter))
}

fn newport() -> Meter {
    let meter = Newport1830 {
        ranges: vec![4, 6],
        wavelength_nm: Some(633),
        filter: Filter::Medium,
        attenuator: false,
    };
    Meter::of(&line(&[1e-6, 1e-4]), &PhotometerDriver::Newport(meter))
}

const RANGE_1: Exposure = Exposure { range: 0, duration: Duration::from_millis(100), readings: 2 };

/// Says what the meter is to be said, and answers as listed; all words, and the events.
fn talk(meter: &mut Meter, answers: &[(&str, &str)]) -> (Vec<String>, Vec<PhotometerEvent>) {
    let mut answers = answers.iter().peekable();
    let (mut words, mut events) = (Vec::new(), Vec::new());
    let mut now = ms(1000);
    loop {
        while let Some(bytes) = meter.poll_transmit(now) {
            let word = String::from_utf8(bytes).unwrap();
            let word = word.trim_end_matches(['\r', '\n']).to_owned();
            if let Some((_, answer)) = answers.next_if(|(question, _)| *question == word) {
                now = now + Duration::from_millis(30);
                words.push(word);
                meter.handle_bytes(now, format!("{answer}\r\n").as_bytes());
            } else {
                words.push(word);
            }
        }
        while let Some(event) = meter.poll_event() {
            events.push(event);
        }
        if !events.is_empty() {
            assert_eq!(answers.next(), None, "not asked; asked: {words:?}");
            return (words, events);
        }
        let Some(next) = meter.poll_timeout() else { return (words, events) };
        now = now.max(next);
        meter.handle_timeout(now);
    }
}

fn opened(mut meter: Meter, answers: &[(&str, &str)]) -> Meter {
    meter.open(ms(0));
    let (words, events) = talk(&mut meter, answers);
    assert!(words.iter().all(|word| word.ends_with('?')), "it sets nothing: {words:?}");
    assert!(matches!(events[..], [PhotometerEvent::Ready(_)]), "{events:?}");
    assert_eq!(meter.poll_timeout(), None);
    meter
}

fn zeroed(mut meter: Meter, answers: &[(&str, &str)]) -> (Meter, Vec<String>) {
    meter.begin(ms(1000), PhotometerCommand::Zero);
    let (words, events) = talk(&mut meter, answers);
    assert_eq!(events, [PhotometerEvent::Zeroed]);
    (meter, words)
}

fn exposed(meter: &mut Meter, answers: &[(&str, &str)]) -> (Vec<String>, Exposed) {
    meter.begin(ms(1000), PhotometerCommand::Expose(RANGE_1));
    match talk(meter, answers) {
        (words, events) if events.len() == 1 => match events.into_iter().next() {
            Some(PhotometerEvent::Exposed(exposed)) => (words, exposed),
            other => panic!("{other:?} after {words:?}"),
        },
        (words, events) => panic!("{events:?} after {words:?}"),
    }
}

fn trouble(meter: &mut Meter, answers: &[(&str, &str)]) -> Trouble {
    meter.begin(ms(1000), PhotometerCommand::Expose(RANGE_1));
    match talk(meter, answers) {
        (_, events) if events.len() == 1 => match events.into_iter().next() {
            Some(PhotometerEvent::Trouble(trouble)) => trouble,
            other => panic!("{other:?}"),
        },
        (words, events) => panic!("{events:?} after {words:?}"),
    }
}

const KEITHLEY: (&str, &str) = ("*IDN?", "KEITHLEY INSTRUMENTS INC.,MODEL 6485,1234567,B02");
const FINE: (&str, &str) = ("SYST:ERR?", "0,\"No error\"");

fn ready_picoammeter() -> Meter {
    let meter = opened(picoammeter(), &[KEITHLEY]);
    zeroed(meter, &[FINE, ("*OPC?", "1"), FINE]).0
}

#[test]
fn a_picoammeter_is_zeroed_as_its_manual_says() {
    let meter = opened(picoammeter(), &[KEITHLEY]);
    let (_, words) = zeroed(meter, &[FINE, ("*OPC?", "1"), FINE]);
    let zero: Vec<&str> =
        words.iter().map(String::as_str).skip_while(|word| *word != "SYST:ZCH ON").collect();
    let expected = [
        "SYST:ZCH ON",
        "CURR:RANG 2e-9",
        "TRIG:COUN 1",
        "INIT",
        "*OPC?",
        "SYST:ZCOR:ACQ",
        "SYST:ZCOR ON",
        "SYST:ZCH OFF",
        "SYST:ERR?",
    ];
    assert_eq!(zero, expected);
    for word in ["*RST", "FORM:ELEM READ,TIME", "CURR:NPLC 1", "AVER OFF"] {
        assert!(words.iter().any(|said| said == word), "{word}");
    }
}

#[test]
fn readings_are_their_mean_and_their_spread() {
    let mut meter = ready_picoammeter();
    let answers = [
        ("CURR:RANG?", "+2.100000E-09"),
        ("READ?", "+1.000000E-09A,+1.000000E+01,+1.200000E-09A,+1.002000E+01"),
    ];
    let (words, exposed) = exposed(&mut meter, &answers);
    assert_eq!(words, ["CURR:RANG 2e-9", "CURR:RANG?", "TRIG:COUN 2", "READ?"]);
    assert!((exposed.mean - 1.1e-9).abs() < 1e-22, "{exposed:?}");
    assert!((exposed.variance - 2e-20).abs() < 1e-33, "{exposed:?}");
    assert_eq!((exposed.readings, exposed.saturated, exposed.range), (2, 0, 0));
    assert_eq!(exposed.device_time_s, Some(10.02));
    // The answer came sooner than its bytes can: no time is left for the readings, but no less.
    assert_eq!(exposed.began, exposed.ended);
    // The range is set already.
    meter.begin(ms(2000), PhotometerCommand::Expose(RANGE_1));
    let (words, _) = talk(&mut meter, &[("READ?", "+1.0E-09A,+1.0E+01,+1.2E-09A,+1.0E+01")]);
    assert_eq!(words, ["TRIG:COUN 2", "READ?"]);
}

#[test]
fn overrange_is_saturated_and_never_a_number() {
    let mut meter = ready_picoammeter();
    let answers = [
        ("CURR:RANG?", "+2.100000E-09"),
        ("READ?", "+9.900000E+37A,+1.0E+01,+1.200000E-09A,+1.0E+01"),
    ];
    let (_, exposed) = exposed(&mut meter, &answers);
    assert_eq!(exposed.saturated, 1);
    assert!((exposed.mean - 1.6e-9).abs() < 1e-22 && exposed.max <= 2e-9, "{exposed:?}");
    let mut meter = opened(newport(), &[("U?", "1"), ("R?", "0")]);
    let answers = [("W?", "0633"), ("R?", "4"), ("D?", "+1.2E-6"), ("D?", "+.99E-6")];
    let (_, exposed) = super::tests::exposed(&mut meter, &answers);
    assert_eq!(exposed.saturated, 1, "beyond any overrange");
}

#[test]
fn what_is_no_number_is_asked_again_and_then_named() {
    let mut meter = ready_picoammeter();
    let garbled = ("READ?", "+1.0E-09A,+1.0E+01,+1.2#-09A,+1.0E+01");
    let good = ("READ?", "+1.0E-09A,+1.0E+01,+1.2E-09A,+1.0E+01");
    let range = ("CURR:RANG?", "+2.100000E-09");
    let (_, exposed) = exposed(&mut meter, &[range, garbled, good]);
    assert_eq!(exposed.readings, 2);
    for bad in ["+9.91E37A,+1.0E+01,+1.2E-09A,+1.0E+01", "+1.0E-9W,0,+1.0E-9W,0", "ERROR"] {
        let bad = ("READ?", bad);
        let Trouble::Fault(fault) = trouble(&mut meter, &[bad, bad, bad]) else { panic!() };
        assert!(fault.name.contains("where a reading in A was asked for"), "{fault}");
        assert_eq!((fault.cause, fault.loses_position), (Cause::Detector, false));
    }
}

#[test]
fn a_meter_that_forgot_how_it_was_set_is_noticed() {
    let mut meter = ready_picoammeter();
    let range = ("CURR:RANG?", "+2.100000E-09");
    // As it comes up: one reading a trigger, with its status.
    let answers = [range, ("READ?", "+1.000000E-09A,+1.0E+01")];
    assert_eq!(trouble(&mut meter, &answers), Trouble::Restarted);
    let meter = &mut ready_picoammeter();
    let Trouble::Fault(fault) = trouble(meter, &[("CURR:RANG?", "+2.100000E-06")]) else {
        panic!()
    };
    assert!(fault.name.contains("\"+2.100000E-06\" to CURR:RANG?; expected 2e-9"), "{fault}");
}

#[test]
fn a_meter_that_stalls_is_silent_after_a_while_and_its_late_answer_is_nobody_s() {
    let mut meter = ready_picoammeter();
    let range = ("CURR:RANG?", "+2.100000E-09");
    let Trouble::Silent(words) = trouble(&mut meter, &[range]) else { panic!() };
    assert!(words.contains("no answer to READ? within 1.7 s"), "{words}");
    // A run that is stopped meanwhile: the next question waits for the answer to the last one.
    let mut meter = ready_picoammeter();
    meter.begin(ms(0), PhotometerCommand::Expose(RANGE_1));
    while meter.awaited.as_ref().is_none_or(|awaited| awaited.step.text != "CURR:RANG?") {
        assert!(meter.poll_transmit(ms(0)).is_some());
    }
    meter.abandon(ms(10));
    meter.begin(ms(20), PhotometerCommand::Expose(RANGE_1));
    assert_eq!(meter.poll_transmit(ms(20)), None);
    meter.handle_bytes(ms(30), b"+2.1E-09\r");
    assert_eq!(meter.poll_transmit(ms(30)), Some(b"TRIG:COUN 2\r".to_vec()));
}

#[test]
fn a_power_meter_is_asked_in_its_own_words() {
    let idn = ("*IDN?", "THORLABS,PM100D,P0001234,2.4.0");
    let head = ("SYST:SENS:IDN?", "\"S120C\",\"18012345\",\"01-Jan-2018\",1,18,289");
    let meter = opened(power_meter(Measures::Power), &[idn, head, ("SENS:POW:UNIT?", "W")]);
    let stat = "SENS:CORR:COLL:ZERO:STAT?";
    let (mut meter, words) = zeroed(meter, &[FINE, (stat, "1"), (stat, "1"), (stat, "0"), FINE]);
    for word in ["SENS:CORR:WAV 633", "SENS:AVER:COUN 10", "SENS:POW:RANG:AUTO 0", "CONF:POW"] {
        assert!(words.iter().any(|said| said == word), "{word}: {words:?}");
    }
    let range = ("SENS:POW:RANG:UPP?", "1.00000e-03");
    let answers = [range, ("READ?", "1.0e-4"), ("READ?", "1.2e-4")];
    let (words, exposed) = exposed(&mut meter, &answers);
    assert_eq!(words[..2], ["SENS:POW:RANG:UPP 1e-3", "SENS:POW:RANG:UPP?"]);
    assert!((exposed.mean - 1.1e-4).abs() < 1e-18 && exposed.readings == 2, "{exposed:?}");
    // Its zero never ends: in the light it does not.
    let meter = power_meter(Measures::Power);
    let mut meter = opened(meter, &[idn, head, ("SENS:POW:UNIT?", "W")]);
    meter.begin(ms(1000), PhotometerCommand::Zero);
    let busy = vec![(stat, "1"); 800];
    let mut answers = vec![FINE];
    answers.extend(&busy);
    let (_, events) = talk_until_event(&mut meter, &answers);
    assert!(matches!(events[..], [PhotometerEvent::Trouble(Trouble::Silent(_))]), "{events:?}");
}

/// As [`talk`], but answers may be left over.
fn talk_until_event(
    meter: &mut Meter,
    answers: &[(&str, &str)],
) -> (Vec<String>, Vec<PhotometerEvent>) {
    let mut words = Vec::new();
    let mut now = ms(1000);
    for (_, answer) in answers {
        let event = loop {
            if let Some(bytes) = meter.poll_transmit(now) {
                words.push(String::from_utf8_lossy(&bytes).trim().to_owned());
            }
            if let Some(event) = meter.poll_event() {
                break Some(event);
            }
            if meter.awaited.is_some() {
                break None;
            }
            let Some(next) = meter.poll_timeout() else { continue };
            now = now.max(next);
            meter.handle_timeout(now);
        };
        if let Some(event) = event {
            return (words, vec![event]);
        }
        now = now + Duration::from_millis(5);
        meter.handle_bytes(now, format!("{answer}\n").as_bytes());
        meter.handle_timeout(now);
    }
    (words, meter.poll_event().into_iter().collect())
}

#[test]
fn what_is_not_the_rig_file_s_meter_is_refused_before_it_is_set() {
    let refused = |mut meter: Meter, answers: &[(&str, &str)]| {
        meter.open(ms(0));
        // The first answers may be the rest of another program's.
        let answers = [answers, answers, answers].concat();
        let (words, events) = talk(&mut meter, &answers);
        assert!(words.iter().all(|word| word.ends_with('?')), "{words:?}");
        match &events[..] {
            [PhotometerEvent::Trouble(Trouble::Refused(refusal))] => refusal.to_string(),
            other => panic!("{other:?}"),
        }
    };
    let words = refused(picoammeter(), &[("*IDN?", "THORLABS,PM100D,P0001234,2.4.0")]);
    assert!(words.contains("it calls itself \"THORLABS,PM100D"), "{words}");
    let scales = line(&[1e-6]);
    let meter = Picoammeter { nplc: 1.0, average: 1, zero: true };
    let meter = Meter::of(&scales, &PhotometerDriver::Keithley(meter));
    let words = refused(meter, &[KEITHLEY]);
    assert!(words.contains("a range of 1e-6 A"), "{words}");
    let idn = ("*IDN?", "THORLABS,PM100D,P0001234,2.4.0");
    let head = ("SYST:SENS:IDN?", "\"S120C\"");
    let answers = [idn, head, ("SENS:POW:UNIT?", "DBM")];
    let words = refused(power_meter(Measures::Power), &answers);
    assert!(words.contains("it reads power in DBM; expected W"), "{words}");
    let words = refused(newport(), &[("U?", "2"), ("R?", "0")]);
    assert!(words.contains("unit 2"), "{words}");
    // A baud rate that yields garbage.
    let words = refused(picoammeter(), &[("*IDN?", "\u{fffd}x\u{fffd}")]);
    assert!(words.contains("or the baud rate"), "{words}");
}

#[test]
fn a_meter_that_is_not_there_is_asked_until_the_caller_has_no_patience() {
    let mut meter = picoammeter();
    meter.open(ms(0));
    let mut asked = 0;
    let mut now = ms(0);
    while now < ms(10_000) {
        asked += usize::from(meter.poll_transmit(now).is_some());
        now = now.max(meter.poll_timeout().unwrap());
        meter.handle_timeout(now);
    }
    assert_eq!(meter.poll_event(), None);
    assert!((5..20).contains(&asked), "{asked}");
}

#[test]
fn a_meter_by_its_table() {
    let table = ScpiTable {
        identity: "optometer".to_owned(),
        measures: Measures::Current,
        ends_with_cr: false,
        set_up: vec!["CONF:CURR".to_owned()],
        zero: vec![],
        range: "CURR:RANG {}".to_owned(),
        read: "MEAS?".to_owned(),
        element: 1,
        has_error_queue: true,
    };
    let meter = Meter::of(&line(&[1e-6]), &PhotometerDriver::Scpi(table));
    let meter = opened(meter, &[("*IDN?", "ACME,OPTOMETER 9,1,1")]);
    let (mut meter, words) = zeroed(meter, &[FINE]);
    assert_eq!(words, ["CONF:CURR", "SYST:ERR?"]);
    let answers = [FINE, ("MEAS?", "17,2.5E-7A,OK"), ("MEAS?", "18,3.5E-7A,OK")];
    let (words, exposed) = exposed(&mut meter, &answers);
    assert_eq!(words, ["CURR:RANG 1e-6", "SYST:ERR?", "MEAS?", "MEAS?"]);
    assert!((exposed.mean - 3e-7).abs() < 1e-21, "{exposed:?}");
    let error = ("SYST:ERR?", "-222,\"Parameter data out of range\"");
    meter.range = None;
    let Trouble::Fault(fault) = trouble(&mut meter, &[error]) else { panic!() };
    assert!(fault.name.contains("-222"), "{fault}");
}
