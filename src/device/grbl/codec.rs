//! What grbl 1.1 says, line by line. There is no checksum: a line that is not well-formed from end
//! to end is garbled as a whole, and no part of it is believed.
//!
//! Source: the documents and the sources of grbl 1.1h (interface, report.c). It does not know what
//! was asked.

/// No line of grbl's is longer: settings, reports and messages stay below 120.
const LINE_MAX: usize = 256;
/// More axes than any board with this protocol has.
const AXES_MAX: usize = 9;

/// Cuts bytes into lines. A line that is too long is dropped to its end.
#[derive(Debug, Clone, Default)]
pub(super) struct Lines {
    line: Vec<u8>,
    is_overlong: bool,
}

impl Lines {
    /// The message of the line that this byte ends; `None` inside a line and for empty ones.
    pub(super) fn take(&mut self, byte: u8) -> Option<Message> {
        if byte != b'\n' && byte != b'\r' {
            if self.line.len() < LINE_MAX {
                self.line.push(byte);
            } else {
                self.is_overlong = true;
            }
            return None;
        }
        let line = std::mem::take(&mut self.line);
        if std::mem::take(&mut self.is_overlong) {
            return Some(Message::Garbled);
        }
        if line.is_empty() {
            return None;
        }
        let is_text = line.iter().all(|byte| (0x20..0x7f).contains(byte));
        let text = std::str::from_utf8(&line).ok().filter(|_| is_text);
        Some(text.and_then(parse).unwrap_or(Message::Garbled))
    }
}

/// A line of grbl's.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    /// It stands still, and why; what was queued is gone.
    Alarm(u8),
    /// It has just been reset: the version that it shows.
    Banner(String),
    /// A line was refused.
    Error(u8),
    /// A message in brackets: `VER:1.1h.20190830:`, `OPT:V,15,128`, `MSG:...`.
    Feedback(String),
    /// Nothing that grbl says: damaged on the way, or somebody else.
    Garbled,
    /// A line was parsed, and what it asks for queued.
    Ok,
    /// `$110=500.000`
    Setting(u16, f64),
    /// A start-up block was executed, or refused: `>G54:ok`, `>:error:7`.
    StartUp,
    /// Its answer to `?`.
    Status(Report),
}

/// A status report.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Report {
    pub(super) state: State,
    /// Machine position, grbl's unit; where work positions are reported, what they are offset by
    /// must have been told.
    pub(super) position: Position,
    /// Work coordinate offset, now and then.
    pub(super) offset: Option<Vec<f64>>,
    /// Triggered inputs, as their letters.
    pub(super) pins: String,
}

/// A position as it is reported.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Position {
    Machine(Vec<f64>),
    Work(Vec<f64>),
}

/// The states of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    Alarm,
    Check,
    Door(u8),
    /// 0: at rest, 1: still braking.
    Hold(u8),
    Home,
    Idle,
    Jog,
    Run,
    Sleep,
}

impl State {
    pub(super) fn name(self) -> String {
        match self {
            Self::Alarm => "Alarm".to_owned(),
            Self::Check => "Check".to_owned(),
            Self::Door(n) => format!("Door:{n}"),
            Self::Hold(n) => format!("Hold:{n}"),
            Self::Home => "Home".to_owned(),
            Self::Idle => "Idle".to_owned(),
            Self::Jog => "Jog".to_owned(),
            Self::Run => "Run".to_owned(),
            Self::Sleep => "Sleep".to_owned(),
        }
    }
}

fn parse(line: &str) -> Option<Message> {
    if line == "ok" {
        return Some(Message::Ok);
    }
    if let Some(number) = line.strip_prefix("error:") {
        return number.parse().ok().map(Message::Error);
    }
    if let Some(number) = line.strip_prefix("ALARM:") {
        return number.parse().ok().map(Message::Alarm);
    }
    if let Some(report) = line.strip_prefix('<') {
        return read_report(report.strip_suffix('>')?).map(Message::Status);
    }
    if let Some(feedback) = line.strip_prefix('[') {
        return Some(Message::Feedback(feedback.strip_suffix(']')?.to_owned()));
    }
    if let Some(setting) = line.strip_prefix('$') {
        let (number, value) = setting.split_once('=')?;
        let number = number.parse().ok()?;
        // `$N0=` holds a line of g-code; it is no number, and none of ours.
        let value = value.split(' ').next()?.parse::<f64>().ok().filter(|v| v.is_finite())?;
        return Some(Message::Setting(number, value));
    }
    if let Some(block) = line.strip_prefix('>') {
        let (_, answer) = block.split_once(':')?;
        let error = answer.strip_prefix("error:").map(str::parse::<u8>);
        let is_answer = answer == "ok" || error.is_some_and(|number| number.is_ok());
        return is_answer.then_some(Message::StartUp);
    }
    let words: Vec<&str> = line.split(' ').collect();
    match words.as_slice() {
        [name, version, "['$'", ..] if name.to_ascii_lowercase().starts_with("grbl") => {
            Some(Message::Banner((*version).to_owned()))
        }
        _ => None,
    }
}

fn read_report(text: &str) -> Option<Report> {
    let mut fields = text.split('|');
    let state = read_state(fields.next()?)?;
    let mut position = None;
    let mut offset = None;
    let mut pins = String::new();
    for field in fields {
        let (name, value) = field.split_once(':')?;
        match name {
            "MPos" => position = Some(Position::Machine(numbers(value)?)),
            "WPos" => position = Some(Position::Work(numbers(value)?)),
            "WCO" => offset = Some(numbers(value)?),
            "Pn" => value.clone_into(&mut pins),
            // Feeds, buffers, overrides, accessories: only sometimes there, and not needed.
            _ => {}
        }
    }
    Some(Report { state, position: position?, offset, pins })
}

fn read_state(text: &str) -> Option<State> {
    let (name, sub) = text.split_once(':').map_or((text, None), |(name, sub)| (name, Some(sub)));
    let sub = sub.map(str::parse::<u8>).transpose().ok()?;
    Some(match (name, sub) {
        ("Alarm", _) => State::Alarm,
        ("Check", None) => State::Check,
        ("Door", Some(n)) => State::Door(n),
        ("Hold", Some(n)) => State::Hold(n),
        ("Home", None) => State::Home,
        ("Idle", None) => State::Idle,
        ("Jog", None) => State::Jog,
        ("Run", _) => State::Run,
        ("Sleep", None) => State::Sleep,
        _ => return None,
    })
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |word: &str| {
        let is_plain = word.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'.' | b'-'));
        word.parse::<f64>().ok().filter(|_| is_plain)
    };
    let numbers: Vec<f64> = text.split(',').map(number).collect::<Option<_>>()?;
    (1..=AXES_MAX).contains(&numbers.len()).then_some(numbers)
}

/// What an alarm means, and whether the axes may stand elsewhere than grbl counts.
pub(super) fn describe_alarm(number: u8) -> (String, bool) {
    let (what, loses_position) = match number {
        1 => ("hard limit: a limit switch opened in mid-move", true),
        2 => ("soft limit: a target lies outside the machine's travel", false),
        3 => ("reset while moving: steps may be lost", true),
        4 | 5 => ("the probe was not as it should be", true),
        6 => ("homing was broken off by a reset", true),
        7 => ("homing was broken off by the safety door", true),
        8 => ("homing could not clear the limit switch by its pull-off", true),
        9 => ("homing found no limit switch within the travel", true),
        10 => ("homing could not find the second switch of a dual axis", true),
        _ => ("an alarm that grbl 1.1 does not document", true),
    };
    (format!("ALARM:{number}, {what}"), loses_position)
}

/// What an error means, as far as this driver's lines can cause it.
pub(super) fn describe_error(number: u8) -> String {
    let what = match number {
        1 => "a word without a letter",
        2 => "a number that can't be read",
        3 => "an unknown $ command",
        5 => "homing is switched off ($22=0)",
        7 => "its stored settings were lost and reset",
        8 => "it was not idle",
        9 => "it is locked (home it first), or jogs",
        11 => "the line was too long",
        14 => "the stored line was too long",
        15 => "a jog outside the machine's travel",
        20 => "an unknown command: the line was damaged on its way",
        25 => "a word twice in one line: two lines ran into one another",
        _ => "refused",
    };
    format!("error:{number}, {what}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(text: &[u8]) -> Vec<Message> {
        let mut lines = Lines::default();
        text.iter().filter_map(|byte| lines.take(*byte)).collect()
    }

    fn report(text: &str) -> Report {
        match messages(text.as_bytes()).as_slice() {
            [Message::Status(report)] => report.clone(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn documented_reports_are_read_with_and_without_their_optional_fields() {
        let full = report("<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\n");
        assert_eq!(full.state, State::Idle);
        assert_eq!(full.position, Position::Machine(vec![0.0; 3]));
        assert_eq!(full.offset, Some(vec![0.0; 3]));
        let homed = report("<Idle|MPos:-98.000,-98.000,-98.000|FS:0,0|Ov:100,100,100>\r\n");
        assert_eq!(homed.position, Position::Machine(vec![-98.0; 3]));
        let held = report("<Hold:1|WPos:1.5,-2.0|Bf:15,128|FS:500,0|Pn:XZ>\n");
        assert_eq!((held.state, held.pins.as_str()), (State::Hold(1), "XZ"));
        assert_eq!(held.position, Position::Work(vec![1.5, -2.0]));
        assert_eq!(report("<Alarm|MPos:0.0,0.0,0.0|FS:0,0>\n").state, State::Alarm);
        assert_eq!(report("<Door:0|MPos:0.0,0.0,0.0,0.0|F:0>\n").state, State::Door(0));
    }

    #[test]
    fn a_damaged_report_is_not_believed_in_part() {
        for bad in [
            "<Idle|MPos:0.000,0.000,0.0x0|FS:0,0>\n",
            "<Idle|MPos:0.000,0.000,inf|FS:0,0>\n",
            "<Idle|MPos:0.000,,0.000|FS:0,0>\n",
            "<Idl|MPos:0.000,0.000,0.000|FS:0,0>\n",
            "<Idle|FS:0,0>\n",
            "<Idle|MPos:0.000,0.000,0.000|FS0,0>\n",
            "<Idle|MPos:0.000,0.000,0.000\n",
            "Idle|MPos:0.000,0.000,0.000|FS:0,0>\n",
            "<Hold|MPos:0.000,0.000,0.000>\n",
            "oK\n",
            "error:x\n",
            "ALARM:\n",
            "$110=5x0\n",
            ">Idle|MPos:0.000,0.000,0.000|FS:0,0>\n",
            "\x01\x02\x7f\n",
        ] {
            assert_eq!(messages(bad.as_bytes()), [Message::Garbled], "{bad:?}");
        }
        let long = [vec![b'a'; 1000], b"\nok\r\n".to_vec()].concat();
        assert_eq!(messages(&long), [Message::Garbled, Message::Ok]);
    }

    #[test]
    fn what_a_board_with_a_fresh_memory_says_is_understood() {
        let text = "error:7\r\n$0=10\r\n$110=500.000\r\n>:error:7\r\n\r\n\
                    Grbl 1.1h ['$' for help]\r\n>:error:7\r\n[MSG:'$H'|'$X' to unlock]\r\n";
        assert_eq!(
            messages(text.as_bytes()),
            [
                Message::Error(7),
                Message::Setting(0, 10.0),
                Message::Setting(110, 500.0),
                Message::StartUp,
                Message::Banner("1.1h".to_owned()),
                Message::StartUp,
                Message::Feedback("MSG:'$H'|'$X' to unlock".to_owned()),
            ]
        );
        let hal = "GrblHAL 1.1f ['$' or '$HELP' for help]\r\n";
        assert_eq!(messages(hal.as_bytes()), [Message::Banner("1.1f".to_owned())]);
    }

    #[test]
    fn a_message_is_the_same_however_its_bytes_are_cut() {
        let text = b"<Run|MPos:1.0,2.0,3.0|FS:500,0>\r\nok\r\nALARM:3\r\n";
        let whole = messages(text);
        assert_eq!(whole.len(), 3);
        for cut in 0..text.len() {
            let mut lines = Lines::default();
            let (head, tail) = text.split_at(cut);
            let mut found: Vec<Message> = head.iter().filter_map(|b| lines.take(*b)).collect();
            found.extend(tail.iter().filter_map(|b| lines.take(*b)));
            assert_eq!(found, whole);
        }
    }
}
