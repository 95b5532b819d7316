//! The driver against a board that a test speaks for, line by line, with what was recorded from
//! grbl 1.1h and what its documents say.

use std::time::Duration;

use firmware_protocol::{Cause, Instant};

use super::Grbl;
use crate::device::axes::{Axes as _, AxesCommand, AxesEvent};
use crate::device::driver::{Driver as _, Trouble};

const IDLE: &str = "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\n";
const BUILD: &str = "[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n";
const SETTINGS: &str = "$13=0\r\n$22=1\r\n$23=0\r\n$24=25.000\r\n$25=500.000\r\n\
                        $100=250.000\r\n$101=250.000\r\n$102=250.000\r\n\
                        $110=500.000\r\n$111=500.000\r\n$112=500.000\r\n\
                        $120=10.000\r\n$121=10.000\r\n$122=10.000\r\n\
                        $130=200.000\r\n$131=200.000\r\n$132=200.000\r\nok\r\n";

struct Talk {
    grbl: Grbl,
    now: Instant,
}

impl Talk {
    fn new(letters: &[char]) -> Self {
        let mut talk = Self { grbl: Grbl::new("/dev/grbl", letters, None), now: Instant::ZERO };
        talk.grbl.open(talk.now);
        talk
    }

    /// A board that was asked and has answered.
    fn opened(letters: &[char]) -> Self {
        let mut talk = Self::new(letters);
        assert_eq!(talk.sent(), "?");
        talk.says(IDLE);
        assert_eq!(talk.sent(), "$\n$I\n");
        talk.says("ok\r\n");
        talk.says(BUILD);
        assert_eq!(talk.sent(), "$$\n");
        talk.says(SETTINGS);
        assert!(matches!(talk.event(), Some(AxesEvent::Ready(_))));
        assert_eq!(talk.grbl.poll_timeout(), None);
        talk
    }

    /// It answers what has gone over the wire.
    fn says(&mut self, text: &str) {
        self.sent();
        self.grbl.handle_bytes(self.now, text.as_bytes());
    }

    /// All that goes over the wire now.
    fn sent(&mut self) -> String {
        let mut sent = Vec::new();
        while let Some(bytes) = self.grbl.poll_transmit(self.now) {
            sent.extend(bytes);
        }
        sent.iter().map(|byte| char::from(*byte)).collect()
    }

    fn event(&mut self) -> Option<AxesEvent> {
        self.grbl.poll_event()
    }

    fn begin(&mut self, command: AxesCommand) {
        self.grbl.begin(self.now, command);
    }

    /// Nothing is said until the driver has had enough; what it sent meanwhile.
    fn wait(&mut self) -> String {
        let mut sent = String::new();
        for _ in 0..200 {
            sent += &self.sent();
            let Some(at) = self.grbl.poll_timeout() else { break };
            self.now = at;
            self.grbl.handle_timeout(at);
        }
        sent
    }

    /// Time passes to the driver's next deadline.
    fn tick(&mut self) {
        if let Some(at) = self.grbl.poll_timeout() {
            self.now = at;
            self.grbl.handle_timeout(at);
        }
    }

    fn fault(&mut self) -> (String, Cause, bool) {
        match self.event() {
            Some(AxesEvent::Trouble(Trouble::Fault(fault))) => {
                (fault.to_string(), fault.cause, fault.loses_position)
            }
            other => panic!("{other:?}"),
        }
    }

    fn refusal(&mut self) -> String {
        match self.event() {
            Some(AxesEvent::Trouble(Trouble::Refused(refusal))) => refusal.to_string(),
            other => panic!("{other:?}"),
        }
    }

    fn silence(&mut self) -> String {
        match self.event() {
            Some(AxesEvent::Trouble(Trouble::Silent(what))) => what,
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_board_says_what_its_axes_can_do() {
    let mut talk = Talk::new(&['Z', 'X']);
    talk.says(IDLE);
    talk.says("ok\r\n");
    talk.says(BUILD);
    talk.says(SETTINGS);
    let Some(AxesEvent::Ready(facts)) = talk.event() else { panic!() };
    assert_eq!(facts.identity, "grbl 1.1h");
    assert_eq!((facts.axes[0].low, facts.axes[0].high), (-50_000, 0));
    assert_eq!((facts.axes[0].speed, facts.axes[0].acceleration), (2083, 2500));
    assert!(!facts.is_homed && facts.is_synchronous && facts.fault.is_none());
}

#[test]
fn a_board_that_boots_with_a_fresh_memory_is_waited_for() {
    let mut talk = Talk::new(&['X']);
    talk.says("error:7\r\n$0=10\r\n$110=500.000\r\n>:error:7\r\n");
    talk.sent();
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n>:error:7\r\n[MSG:'$H'|'$X' to unlock]\r\n");
    assert_eq!(talk.sent(), "?");
    talk.says("<Alarm|MPos:0.000,0.000,0.000|FS:0,0>\r\n");
    assert_eq!(talk.sent(), "$\n$I\n");
    talk.says("ok\r\n");
    talk.says(BUILD);
    talk.says(SETTINGS);
    assert!(matches!(talk.event(), Some(AxesEvent::Ready(_))));
}

#[test]
fn another_version_a_wrong_map_and_a_wrong_mode_are_refused_before_anything_moves() {
    let mut old = Talk::new(&['X']);
    old.says("\r\nGrbl 0.9j ['$' for help]\r\n");
    assert!(old.refusal().contains("it is grbl 0.9j; expected grbl 1.1"));

    let mut map = Talk::new(&['A']);
    map.says(IDLE);
    map.says("ok\r\n");
    map.says(BUILD);
    map.says(SETTINGS);
    let refusal = map.refusal();
    assert!(refusal.contains("no axis A") && refusal.contains("letters"), "{refusal}");

    let mut homeless = Talk::new(&['X']);
    homeless.says(IDLE);
    homeless.says("ok\r\n");
    homeless.says(BUILD);
    homeless.says(&SETTINGS.replace("$22=1", "$22=0"));
    assert!(homeless.refusal().contains("$22=0"));

    let mut check = Talk::new(&['X']);
    check.says("<Check|MPos:0.000,0.000,0.000|FS:0,0>\r\n");
    assert!(check.refusal().contains("check mode"));
}

#[test]
fn silence_and_garbage_are_told_apart() {
    let mut silent = Talk::new(&['X']);
    let sent = silent.wait();
    // A board that a limit locked is as silent, and wakes by a reset.
    let resets = sent.bytes().filter(|byte| *byte == 0x18).count();
    let others = sent.bytes().filter(|byte| !matches!(byte, 0x18 | b'?')).count();
    assert!(sent.len() > 5 && (resets, others) == (1, 0), "{sent}");
    assert!(silent.silence().contains("nothing was heard"));

    let mut garbled = Talk::new(&['X']);
    garbled.grbl.handle_bytes(garbled.now, &[0xf8, 0x80, 0x0a, 0x1f, 0xe0, 0x0a]);
    garbled.wait();
    let words = garbled.silence();
    assert!(words.contains("6 bytes") && words.contains("baud"), "{words}");
}

#[test]
fn a_board_that_a_limit_has_locked_is_reset_once() {
    // As grblHAL does it: it reports, and answers no line.
    let mut talk = Talk::new(&['X']);
    talk.says("<Alarm|MPos:1.000,0.000,0.000|FS:0,0>\r\n");
    assert_eq!(talk.sent(), "$\n$I\n");
    talk.tick();
    assert_eq!(talk.sent(), "\x18");
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n");
    assert_eq!(talk.sent(), "?");
    talk.says("<Alarm|MPos:1.000,0.000,0.000|FS:0,0>\r\n");
    assert_eq!(talk.sent(), "$\n$I\n");
    // One that answers nothing still is not asked for ever.
    talk.tick();
    assert!(talk.silence().contains("no answer from a grbl"));
    assert_eq!(talk.grbl.poll_timeout(), None);
}

#[test]
fn what_an_earlier_host_left_moving_is_brought_to_rest_first() {
    let mut talk = Talk::new(&['X']);
    assert_eq!(talk.sent(), "?");
    talk.says("<Run|MPos:1.000,0.000,0.000|FS:500,0>\r\n");
    assert_eq!(talk.sent(), "!");
    talk.tick();
    assert_eq!(talk.sent(), "?");
    talk.says("<Hold:1|MPos:1.500,0.000,0.000|FS:100,0>\r\n");
    talk.tick();
    talk.says("<Hold:0|MPos:1.600,0.000,0.000|FS:0,0>\r\n");
    assert!(talk.sent().ends_with('\u{18}'));
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n");
    assert_eq!(talk.sent(), "?");

    let mut jog = Talk::new(&['X']);
    jog.says("<Jog|MPos:1.000,0.000,0.000|FS:500,0>\r\n");
    assert!(jog.sent().ends_with('\u{85}'));
}

#[test]
fn a_move_is_done_when_it_was_read_back_and_not_before() {
    let mut talk = Talk::opened(&['X', 'Y']);
    talk.begin(AxesCommand::MoveTo(vec![-2500, -24_500]));
    assert_eq!(talk.sent(), "G21G53G0X-10.0000Y-98.0000\nG4P0\n");
    // Parsed, that is, and queued.
    talk.says("ok\r\n");
    assert_eq!(talk.event(), None);
    talk.tick();
    assert_eq!(talk.sent(), "?");
    talk.says("<Run|MPos:-1.000,-9.000,0.000|Bf:14,128|FS:500,0>\r\n");
    talk.tick();
    // Damaged on its way: it says nothing, not even that it is idle.
    talk.says("<Idle|MPos:-10.000,-98.0x0,0.000|FS:0,0>\r\n");
    assert_eq!(talk.event(), None);
    talk.says("ok\r\n");
    assert_eq!(talk.event(), None);
    assert!(talk.sent().ends_with('?'));
    talk.says("<Idle|MPos:-10.000,-98.000,0.000|FS:0,0|Ov:100,100,100>\r\n");
    let Some(AxesEvent::Done(located)) = talk.event() else { panic!() };
    assert_eq!(located.steps, [-2500, -24_500]);
    assert_eq!(talk.grbl.poll_timeout(), None);
}

#[test]
fn work_positions_count_once_their_offset_is_known() {
    let mut talk = Talk::opened(&['X']);
    talk.grbl.offset = None;
    talk.begin(AxesCommand::Locate);
    talk.says("<Idle|WPos:1.000,0.000,0.000|FS:0,0>\r\n");
    assert_eq!(talk.event(), None);
    talk.says("<Idle|WPos:1.000,0.000,0.000|FS:0,0|WCO:-3.000,0.000,0.000>\r\n");
    let Some(AxesEvent::Located(located)) = talk.event() else { panic!() };
    assert_eq!(located.steps, [-500]);
}

#[test]
fn a_digit_that_was_damaged_on_its_way_is_found_by_reading_back() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.sent();
    talk.says("ok\r\nok\r\n<Idle|MPos:-9.000,0.000,0.000|FS:0,0>\r\n");
    let (name, cause, loses_position) = talk.fault();
    assert!(name.contains("sent to step -250, and stands at -2250"), "{name}");
    assert_eq!((cause, loses_position), (Cause::Stalled(0), true));
}

#[test]
fn a_lost_line_is_noticed() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.sent();
    // The first line's end was lost: one line, and one answer.
    talk.says("ok\r\n");
    for _ in 0..3 {
        assert_eq!(talk.event(), None);
        talk.tick();
        talk.says("<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n");
    }
    let (name, _, loses_position) = talk.fault();
    assert!(name.contains("line was lost") && loses_position, "{name}");
}

#[test]
fn alarms_are_faults_with_names_and_are_left_as_they_allow() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.sent();
    talk.says("ok\r\nALARM:1\r\n[MSG:Reset to continue]\r\n");
    let (name, cause, loses_position) = talk.fault();
    assert!(name.contains("grbl at /dev/grbl: ALARM:1, hard limit"), "{name}");
    assert_eq!((cause, loses_position), (Cause::LimitSwitch(0), true));
    talk.begin(AxesCommand::Clear);
    assert_eq!(talk.sent(), "\u{18}");
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n");
    // It stays locked: only homing may move it now.
    assert_eq!((talk.event(), talk.sent().as_str()), (Some(AxesEvent::Cleared), ""));

    talk.begin(AxesCommand::MoveTo(vec![0]));
    talk.sent();
    talk.says("ALARM:2\r\n[MSG:Reset to continue]\r\n");
    assert!(!talk.fault().2);
    talk.begin(AxesCommand::Clear);
    talk.sent();
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n");
    assert_eq!(talk.sent(), "$X\n");
    talk.says("[MSG:Caution: Unlocked]\r\nok\r\n");
    assert_eq!(talk.event(), Some(AxesEvent::Cleared));
}

#[test]
fn a_refused_line_holds_the_board() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.sent();
    talk.says("error:20\r\n");
    let (name, ..) = talk.fault();
    assert!(name.contains("refused to move: error:20"), "{name}");
    assert_eq!(talk.sent(), "!");
}

#[test]
fn a_stop_overtakes_what_waits_and_keeps_the_position() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.grbl.stop(talk.now);
    // The lines that were not sent yet never are.
    assert_eq!(talk.sent(), "!?");
    talk.says("<Hold:1|MPos:-0.400,0.000,0.000|FS:100,0>\r\n");
    talk.tick();
    assert_eq!(talk.sent(), "?");
    talk.says("<Hold:0|MPos:-0.420,0.000,0.000|FS:0,0>\r\n");
    assert_eq!(talk.sent(), "\u{18}");
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n");
    assert_eq!(talk.sent(), "?");
    talk.says("<Idle|MPos:-0.420,0.000,0.000|FS:0,0>\r\n");
    let Some(AxesEvent::Stopped(Some(located))) = talk.event() else { panic!() };
    assert_eq!(located.steps, [-105]);
    assert_eq!(talk.grbl.poll_timeout(), None);
}

#[test]
fn a_board_that_does_not_brake_is_reset_and_its_position_given_up() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.sent();
    talk.grbl.stop(talk.now);
    let began = talk.now;
    let mut sent = String::new();
    while !sent.contains('\u{18}') {
        talk.tick();
        sent += &talk.sent();
        talk.says("<Run|MPos:-0.400,0.000,0.000|FS:100,0>\r\n");
        assert!(talk.now.since(began) < Duration::from_secs(10));
    }
    talk.says("ALARM:3\r\n\r\nGrbl 1.1h ['$' for help]\r\n");
    talk.says("<Alarm|MPos:-0.500,0.000,0.000|FS:0,0>\r\n");
    let (name, _, loses_position) = talk.fault();
    assert!(name.contains("ALARM:3") && loses_position, "{name}");
}

#[test]
fn homing_is_done_when_it_stands_and_a_stop_breaks_it_off() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::Home);
    assert_eq!(talk.sent(), "$H\n");
    talk.says("ok\r\n");
    assert_eq!(talk.event(), None);
    assert_eq!(talk.sent(), "?");
    talk.says("<Idle|MPos:-98.000,-98.000,-98.000|FS:0,0>\r\n");
    let Some(AxesEvent::Done(located)) = talk.event() else { panic!() };
    assert_eq!(located.steps, [-24_500]);

    talk.begin(AxesCommand::Home);
    talk.sent();
    talk.grbl.stop(talk.now);
    assert_eq!(talk.sent(), "\u{18}");
    talk.says("ALARM:6\r\n\r\nGrbl 1.1h ['$' for help]\r\n");
    talk.says("<Alarm|MPos:-98.000,-98.000,-98.000|FS:0,0>\r\n");
    assert!(talk.fault().0.contains("ALARM:6"));

    talk.begin(AxesCommand::Home);
    talk.sent();
    // limits.c and main.c: it starts over by itself, and answers the line no more.
    talk.says("ALARM:9\r\n\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n");
    let (name, cause, _) = talk.fault();
    assert!(name.contains("no limit switch within the travel"), "{name}");
    assert_eq!(cause, Cause::HomingMissed(0));
    assert_eq!(talk.event(), None, "nor is it a restart");
}

#[test]
fn half_a_line_that_somebody_left_is_spoilt_and_not_carried_out() {
    let mut talk = Talk::new(&['X']);
    talk.says(IDLE);
    // "G0X5" stood in its buffer: "G0X5$" is no g-code, and without the "$" it would have moved.
    assert_eq!(talk.sent(), "$\n$I\n");
    talk.says("error:1\r\n");
    talk.says(BUILD);
    talk.says(SETTINGS);
    assert!(matches!(talk.event(), Some(AxesEvent::Ready(_))));
}

#[test]
fn a_board_that_reads_no_lines_is_reset_and_one_whose_door_is_open_is_refused() {
    const BANNER: &str = "\r\nGrbl 1.1h ['$' for help]\r\n";
    for asleep in ["Sleep", "Door:0", "Door:1"] {
        let mut talk = Talk::new(&['X']);
        talk.says(&format!("<{asleep}|MPos:0.000,0.000,0.000|FS:0,0>\r\n"));
        assert_eq!(talk.sent(), "\u{18}", "{asleep}");
        talk.says(BANNER);
        talk.says(IDLE);
        assert_eq!(talk.sent(), "$\n$I\n", "{asleep}");
    }
    let mut talk = Talk::new(&['X']);
    talk.says("<Door:1|MPos:0.000,0.000,0.000|FS:0,0|Pn:D>\r\n");
    talk.says(BANNER);
    talk.says("[MSG:Check Door]\r\n<Door:1|MPos:0.000,0.000,0.000|FS:0,0|Pn:D>\r\n");
    let words = talk.refusal();
    assert!(words.contains("safety door is open") && words.contains("close the door"), "{words}");
}

#[test]
fn a_reset_that_an_alarm_swallowed_is_sent_again() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.sent();
    talk.says("ok\r\nALARM:1\r\n[MSG:Reset to continue]\r\n");
    talk.fault();
    talk.begin(AxesCommand::Clear);
    assert_eq!(talk.sent(), "\u{18}");
    talk.tick();
    assert_eq!(
        talk.sent(),
        "\u{18}",
        "protocol.c forgets the first one, that it was sent too soon"
    );
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n");
    assert_eq!(talk.event(), Some(AxesEvent::Cleared));
    talk.begin(AxesCommand::Clear);
    assert_eq!(talk.wait().matches('\u{18}').count(), 3);
    assert!(talk.silence().contains("no banner after a reset"));
}

#[test]
fn a_reset_nobody_asked_for_and_a_dead_board_are_told_apart() {
    let mut talk = Talk::opened(&['X']);
    talk.begin(AxesCommand::MoveTo(vec![-250]));
    talk.says("\r\nGrbl 1.1h ['$' for help]\r\n");
    assert_eq!(talk.event(), Some(AxesEvent::Trouble(Trouble::Restarted)));

    let mut dead = Talk::opened(&['X']);
    dead.begin(AxesCommand::MoveTo(vec![-250]));
    let began = dead.now;
    dead.wait();
    assert!(dead.silence().contains("no answer to ?"));
    assert!(dead.now.since(began) < Duration::from_millis(2_500));
}

#[test]
fn the_same_is_heard_however_the_bytes_are_cut() {
    let text = b"ok\r\nok\r\n<Idle|MPos:-1.000,0.000,0.000|FS:0,0>\r\n";
    for cut in 0..text.len() {
        let mut talk = Talk::opened(&['X']);
        talk.begin(AxesCommand::MoveTo(vec![-250]));
        talk.sent();
        let (head, tail) = text.split_at(cut);
        talk.grbl.handle_bytes(talk.now, head);
        talk.grbl.handle_bytes(talk.now, tail);
        assert!(matches!(talk.event(), Some(AxesEvent::Done(_))), "cut at {cut}");
    }
}
