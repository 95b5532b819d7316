//! What the twin must share with the firmware that it stands for: the facts that were measured on
//! grbl 1.1h.

use std::time::Duration;

use firmware_protocol::Instant;

use super::GrblTwin;
use crate::bench::tests::board_of;
use crate::wire::Wire;
use crate::{Bench, NominalAxis, Simulated, SimulatedBoard};

/// 1000 steps a degree or a millimetre, ±50 of them, at 100 a second and 1000 a second squared.
fn board() -> SimulatedBoard {
    let axis = |channel: u8| NominalAxis {
        channel,
        home: 0.0,
        counts_per_unit: if channel < 2 { 1000.0_f64.to_degrees() } else { 1e6 },
        travel_counts: (-50_000, 50_000),
        speed_counts_per_s: 100_000,
        acceleration_counts_per_s2: 1_000_000,
        settle_s: 0.0,
        has_encoder: false,
        u_zero: 0.0,
        u_homing: 0.0,
        u_readback: 0.0,
    };
    board_of(axis, Simulated::default())
}

/// Three axes behind a wire of 115200 baud, switched on.
struct Desk {
    bench: Bench,
    now: Instant,
}

impl Desk {
    fn new() -> Self {
        let board = board();
        let axes = [(0, -60.0), (1, -60.0), (2, -60.0)];
        let twin = GrblTwin::new(board.nominal(), &axes);
        let mut bench = Bench::new(board);
        bench.plug(twin, Wire::new(115_200));
        bench.advance(Instant::ZERO);
        let mut desk = Self { bench, now: Instant::ZERO };
        assert!(desk.wait(100).contains("Grbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]"));
        desk
    }

    fn homed() -> Self {
        let mut desk = Self::new();
        assert_eq!(desk.tell("$H\n", 30_000), "ok\r\n");
        assert!(desk.tell("?", 50).starts_with("<Idle|MPos:-2.000,-2.000,-2.000|FS:0,0"));
        desk
    }

    /// What it says within so many milliseconds.
    fn wait(&mut self, ms: u64) -> String {
        let end = self.now + Duration::from_millis(ms);
        let mut heard = Vec::new();
        while self.now < end {
            self.now = self.bench.next().map_or(end, |at| at.max(self.now)).min(end);
            self.bench.advance(self.now);
            while let Some(bytes) = self.bench.receive(self.now, 0) {
                heard.extend(bytes);
            }
            if self.bench.next().is_some_and(|at| at <= self.now) {
                self.now = self.now + Duration::from_micros(1);
            }
        }
        String::from_utf8(heard).unwrap()
    }

    fn tell(&mut self, text: &str, ms: u64) -> String {
        let bytes: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        self.bench.send(self.now, 0, &bytes);
        self.wait(ms)
    }
}

#[test]
fn it_is_locked_until_it_is_homed_or_unlocked() {
    let mut desk = Desk::new();
    assert!(desk.tell("?", 50).starts_with("<Alarm|MPos:0.000,0.000,0.000|FS:0,0|WCO:"));
    assert_eq!(desk.tell("G0X-1\n", 50), "error:9\r\n");
    assert_eq!(desk.tell("$X\n", 50), "[MSG:Caution: Unlocked]\r\nok\r\n");
    assert!(desk.tell("?", 50).starts_with("<Idle|"));
}

#[test]
fn ok_is_parsed_and_a_pause_of_nothing_waits_for_the_motion() {
    let mut desk = Desk::homed();
    // 40 mm at 100 mm/s, and 0.1 s of ramps.
    assert_eq!(desk.tell("G21G53G0X-42.0000\n", 50), "ok\r\n");
    assert!(desk.tell("?", 50).starts_with("<Run|"));
    assert_eq!(desk.tell("$$\n", 50), "error:8\r\n");
    assert_eq!(desk.tell("G4P0\n", 200), "");
    assert_eq!(desk.wait(400), "ok\r\n");
    assert!(desk.tell("?", 50).starts_with("<Idle|MPos:-42.000,-2.000,-2.000|"));
}

#[test]
fn what_is_sent_blind_is_lost_without_a_word_and_what_is_counted_is_not() {
    let mut desk = Desk::homed();
    let lines: Vec<String> =
        (0..60).map(|n| format!("G1X-{}.000Y-20.0F600\n", 10 + n % 20)).collect();
    let heard = desk.tell(&lines.concat(), 60_000);
    let (answers, oks) = (heard.lines().count(), heard.lines().filter(|l| *l == "ok").count());
    assert!(answers < 60, "{answers} of 60 blind lines were answered");
    assert!(oks >= 15, "{oks}");

    let mut desk = Desk::homed();
    let (mut sent, mut acknowledged, mut in_flight) = (0, 0, Vec::new());
    let mut room = 128_usize;
    while acknowledged < 300 {
        while sent < 300 {
            let line = format!("G1X-{}.5Y-{}.25F6000\n", 10 + sent % 20, 20 + sent % 10);
            let Some(left) = room.checked_sub(line.len()) else { break };
            room = left;
            in_flight.push(line.len());
            desk.bench.send(desk.now, 0, line.as_bytes());
            sent += 1;
        }
        for answer in desk.wait(20).lines() {
            assert_eq!(answer, "ok");
            room += in_flight.remove(0);
            acknowledged += 1;
        }
    }
}

#[test]
fn a_hold_brakes_and_goes_on_and_a_reset_at_rest_keeps_the_position() {
    let mut desk = Desk::homed();
    desk.tell("G53G0X-42\n", 200);
    assert!(desk.tell("!?", 20).starts_with("<Hold:1|"));
    desk.wait(300);
    let held = desk.tell("?", 20);
    assert!(held.starts_with("<Hold:0|"), "{held}");
    assert_eq!(desk.tell("~", 1000), "");
    assert!(desk.tell("?", 20).starts_with("<Idle|MPos:-42.000,"));
    desk.tell("G53G0X-10\n", 150);
    desk.tell("!", 300);
    let held = desk.tell("?", 20);
    let banner = desk.tell("\u{18}", 200);
    assert_eq!(banner, "\r\nGrbl 1.1h ['$' for help]\r\n");
    let after = desk.tell("?", 20);
    let place = |report: &str| report.split('|').nth(1).unwrap().to_owned();
    assert!(after.starts_with("<Idle|") && place(&after) == place(&held), "{held} {after}");
}

#[test]
fn a_reset_in_motion_and_a_target_outside_are_alarms() {
    let mut desk = Desk::homed();
    desk.tell("G53G0X-42\n", 200);
    let heard = desk.tell("\u{18}", 200);
    assert!(heard.starts_with("ALARM:3\r\n"), "{heard}");
    assert!(heard.ends_with("Grbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n"));
    assert_eq!(desk.tell("G0X-1\n", 50), "error:9\r\n");

    let mut desk = Desk::homed();
    assert_eq!(desk.tell("G53G0X5\n", 50), "ALARM:2\r\n[MSG:Reset to continue]\r\n");
    // It looks at no line before it is reset.
    assert_eq!(desk.tell("$X\n", 50), "");
    // Nor does it hear a reset while it says the alarm.
    assert_eq!(desk.tell("\u{18}", 500), "");
    assert!(desk.tell("\u{18}", 200).contains("Grbl 1.1h"));
    assert!(desk.tell("$X\n", 50).ends_with("ok\r\n"));
    assert!(desk.tell("?", 50).starts_with("<Idle|MPos:-2.000,"));
}

#[test]
fn homing_answers_no_question_and_a_reset_breaks_it_off() {
    let mut desk = Desk::new();
    assert_eq!(desk.tell("$H\n", 200), "");
    assert_eq!(desk.tell("?", 100), "");
    assert!(desk.tell("\u{18}", 200).starts_with("ALARM:6\r\n"));
}

#[test]
fn the_settings_say_what_its_axes_are() {
    let mut desk = Desk::new();
    let heard = desk.tell("$$\n", 500);
    for line in ["$22=1", "$100=1000.000", "$110=6000.000", "$122=1000.000", "$13=0", "$30=1000"] {
        assert!(heard.lines().any(|l| l == line), "{line}\n{heard}");
    }
    assert!(heard.ends_with("ok\r\n"));
    assert_eq!(desk.tell("$I\n", 200), "[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n");
    assert!(desk.tell("$G\n", 200).starts_with("[GC:G0 G54 G17 G21 G90 G94 M5 M9"));
    assert!(desk.tell("$#\n", 500).ends_with("[PRB:0.000,0.000,0.000:0]\r\nok\r\n"));
}
