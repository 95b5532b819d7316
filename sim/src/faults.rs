//! What goes wrong with a device of another make, and when: rig.toml's `[[simulated.fault]]`.
//!
//! A fault is set off by what its device does, not by a clock, so that it falls into the same
//! reading however long a host thinks. It knows no make: what a line suffers the [`Bench`] sees to,
//! and the rest is handed to the device.
//!
//! [`Bench`]: crate::Bench

use core::fmt;
use core::time::Duration;

use firmware_protocol::Instant;
use spanned_toml::{Bounds, Problem, Table};

/// One thing that goes wrong once.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceFault {
    /// The device, by its driver's word in the rig file.
    pub device: String,
    /// What goes wrong.
    pub kind: FaultKind,
    /// In the n-th move since it was switched on, or the n-th reading of a meter, from 1.
    pub nth: u32,
    /// So much later than that.
    pub delay: Duration,
    /// For so long; `None`: for good.
    pub lasts: Option<Duration>,
}

/// What can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// A board of axes meets a limit switch.
    Alarm,
    /// Nothing that it is told arrives.
    Deaf,
    /// One byte in five of what it says has a bit flipped.
    Garbled,
    /// It does what it was told, and says nothing.
    Mute,
    /// This servo is too hot, and lets go of its torque.
    Overheating(u8),
    /// This servo is asked for more torque than it has, and lets go of it.
    Overload(u8),
    /// The plug is out, and with it the port.
    Unplugged,
}

const WORDS: [(&str, FaultKind); 7] = [
    ("alarm", FaultKind::Alarm),
    ("deaf", FaultKind::Deaf),
    ("garbled", FaultKind::Garbled),
    ("mute", FaultKind::Mute),
    ("overheating", FaultKind::Overheating(0)),
    ("overload", FaultKind::Overload(0)),
    ("unplugged", FaultKind::Unplugged),
];

/// Every fifth byte.
const GARBLED_EVERY: u32 = 5;
const FLIPPED: u8 = 0b10;

impl DeviceFault {
    /// Reads one table of the list; unknown keys are refused.
    pub fn read(table: Table<'_>) -> Result<Self, Problem> {
        let device = table.required_text("device")?.to_owned();
        let kind = table.required_choice("kind", &WORDS)?;
        let nth = table.required_integer("nth", 1..=1_000_000)?;
        let ms = Bounds::between(0.0, 86_400_000.0);
        let duration = |ms: f64| Duration::from_secs_f64(ms / 1000.0);
        let delay = duration(table.number("after_ms", ms)?.unwrap_or(0.0));
        let lasts = table.number("lasts_ms", ms)?.map(duration);
        let servo = table.integer("servo", 0..=252)?;
        let servo = servo.and_then(|servo| u8::try_from(servo).ok());
        let needs = |key: &str, expected: &str| {
            table.problem(key, "does not go with this kind", expected, "correct one of them")
        };
        let kind = match (kind, servo) {
            (FaultKind::Overheating(_), Some(servo)) => FaultKind::Overheating(servo),
            (FaultKind::Overload(_), Some(servo)) => FaultKind::Overload(servo),
            (FaultKind::Overheating(_) | FaultKind::Overload(_), None) => {
                return Err(table.missing("servo", "the number of a servo on the bus"));
            }
            (_, Some(_)) => return Err(needs("servo", "\"overload\" or \"overheating\"")),
            (kind, None) => kind,
        };
        if lasts.is_some() && !kind.is_on_line() {
            return Err(needs("lasts_ms", "a fault of the line: the others last until cleared"));
        }
        table.finish()?;
        let nth = u32::try_from(nth).unwrap_or(u32::MAX);
        Ok(Self { device, kind, nth, delay, lasts })
    }
}

impl FaultKind {
    /// Whether the line has it, not the device.
    const fn is_on_line(self) -> bool {
        matches!(self, Self::Deaf | Self::Garbled | Self::Mute | Self::Unplugged)
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let same = |kind: &Self| core::mem::discriminant(kind) == core::mem::discriminant(self);
        let word = WORDS.iter().find(|(_, kind)| same(kind)).map_or("", |(word, _)| word);
        match self {
            Self::Overheating(servo) | Self::Overload(servo) => write!(f, "servo {servo}: {word}"),
            _ => f.write_str(word),
        }
    }
}

/// How far a fault has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Course {
    Waiting,
    /// Its device did what sets it off: it begins then.
    Set(Instant),
    /// Until then; `None`: for good.
    On(Option<Instant>),
    Over,
}

/// What a fault came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turn {
    Began(FaultKind),
    Ended(FaultKind),
}

/// The faults of one line.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    list: Vec<(DeviceFault, Course)>,
    said_bytes: u32,
}

impl Faults {
    pub(crate) fn add(&mut self, fault: DeviceFault) {
        self.list.push((fault, Course::Waiting));
    }

    /// The device has done so many things by now.
    pub(crate) fn notice(&mut self, now: Instant, deeds: u32) {
        for (fault, course) in &mut self.list {
            if *course == Course::Waiting && fault.nth <= deeds {
                *course = Course::Set(now + fault.delay);
            }
        }
    }

    /// When the next of them begins or ends.
    pub(crate) fn next(&self) -> Option<Instant> {
        self.list.iter().filter_map(|(_, course)| course.next()).min()
    }

    /// The first that begins or ends by now.
    pub(crate) fn turn(&mut self, now: Instant) -> Option<Turn> {
        let is_due = |course: &Course| course.next().is_some_and(|at| at <= now);
        let (fault, course) = self.list.iter_mut().find(|(_, course)| is_due(course))?;
        if let Course::Set(at) = course {
            let until = fault.lasts.map(|lasts| *at + lasts);
            let stays = fault.kind.is_on_line();
            *course = if stays { Course::On(until) } else { Course::Over };
            Some(Turn::Began(fault.kind))
        } else {
            *course = Course::Over;
            Some(Turn::Ended(fault.kind))
        }
    }

    pub(crate) fn has(&self, kind: FaultKind) -> bool {
        self.list
            .iter()
            .any(|(fault, course)| fault.kind == kind && matches!(course, Course::On(_)))
    }

    /// Whether what is told to the device arrives.
    pub(crate) fn hears(&self) -> bool {
        !self.has(FaultKind::Deaf) && !self.has(FaultKind::Unplugged)
    }

    /// What comes out of the line of what the device says.
    pub(crate) fn passes(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        if self.has(FaultKind::Mute) || self.has(FaultKind::Unplugged) {
            return Vec::new();
        }
        if self.has(FaultKind::Garbled) {
            for byte in &mut bytes {
                self.said_bytes = self.said_bytes.wrapping_add(1);
                if self.said_bytes.is_multiple_of(GARBLED_EVERY) {
                    *byte ^= FLIPPED;
                }
            }
        }
        bytes
    }
}

impl Course {
    const fn next(self) -> Option<Instant> {
        match self {
            Self::Set(at) => Some(at),
            Self::On(until) => until,
            Self::Waiting | Self::Over => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use spanned_toml::{Document, Source};

    use super::*;

    fn read(text: &str) -> Result<DeviceFault, Problem> {
        let text = format!("[[fault]]\n{text}\n");
        let document = Document::parse(Source::new("rig.toml", &text)).unwrap();
        DeviceFault::read(document.root().tables("fault").unwrap().remove(0))
    }

    #[test]
    fn faults_are_read_and_what_does_not_go_together_is_refused() {
        let fault = read("device = 'grbl'\nkind = 'unplugged'\nnth = 3\nlasts_ms = 50").unwrap();
        assert_eq!((fault.nth, fault.lasts), (3, Some(Duration::from_millis(50))));
        let fault = read("device = 'dynamixel'\nkind = 'overload'\nnth = 1\nservo = 2").unwrap();
        assert_eq!(fault.kind, FaultKind::Overload(2));
        for (bad, word) in [
            ("device = 'grbl'\nkind = 'alarm'\nnth = 0", "nth"),
            ("device = 'grbl'\nkind = 'alarm'\nnth = 1\nlasts_ms = 1", "lasts_ms"),
            ("device = 'grbl'\nkind = 'alarm'\nnth = 1\nservo = 1", "servo"),
            ("device = 'dynamixel'\nkind = 'overload'\nnth = 1", "servo"),
            ("device = 'grbl'\nkind = 'alrm'\nnth = 1", "kind"),
            ("device = 'grbl'\nkind = 'alarm'\nnth = 1\nafter_s = 1", "after_ms"),
        ] {
            let problem = read(bad).unwrap_err().to_string();
            assert!(problem.contains(word), "{problem}");
        }
    }

    #[test]
    fn a_fault_of_the_line_begins_after_its_deed_and_ends() {
        let mut faults = Faults::default();
        let text = "device = 'grbl'\nkind = 'mute'\nnth = 2\nafter_ms = 1\nlasts_ms = 2";
        faults.add(read(text).unwrap());
        let at = |ms: u64| Instant::from_micros(1000 * ms);
        faults.notice(at(5), 1);
        assert_eq!((faults.next(), faults.turn(at(9))), (None, None));
        faults.notice(at(10), 2);
        assert_eq!(faults.next(), Some(at(11)));
        assert_eq!(faults.turn(at(11)), Some(Turn::Began(FaultKind::Mute)));
        assert_eq!(faults.passes(vec![1, 2]), []);
        assert!(faults.hears());
        assert_eq!(faults.turn(at(12)), None);
        assert_eq!(faults.turn(at(13)), Some(Turn::Ended(FaultKind::Mute)));
        assert_eq!(faults.passes(vec![1, 2]), [1, 2]);
        faults.notice(at(20), 7);
        assert_eq!(faults.next(), None, "it happens once");
    }
}
