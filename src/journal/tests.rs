//! What could break: a reading lost, doubled or altered between the device and the file; a damaged
//! or foreign file taken for a run; an error that nobody hears of.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use firmware_protocol::Shutter;
use proptest::prelude::*;

use super::*;
use crate::plan::{Step, Swept};
use crate::rig::{AxisPositions, DeviceTimes, Latched, Pose, Reading, ReadingKind};

pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(super) fn path(&self) -> PathBuf {
        self.0.path().join("run.sqlite")
    }

    pub(super) fn journal(&self) -> Journal {
        Journal::create(&self.path(), &header(), &inputs(), &steps()).unwrap()
    }
}

fn header() -> Header {
    Header {
        program_version: "0.1.0".into(),
        seed: u64::MAX,
        simulated: true,
        rig_name: "bench".into(),
        plan_name: "lüster".into(),
        plan_hash: "00ff".into(),
        started_utc: "2026-11-22T01:02:03Z".into(),
        effects: vec!["emission[0]: emitter[0].kind".into(), "shot-noise: electrons".into()],
        effect_wishes: EffectWishes {
            tolerance: Some(1.0 / 3.0),
            force: vec!["finite-beam".into()],
            without: Vec::new(),
            ignores_plan: false,
        },
    }
}

fn inputs() -> Vec<Input> {
    vec![
        Input { role: InputRole::Plan, name: "plan.toml".into(), bytes: b"a = 1\n".to_vec() },
        Input { role: InputRole::Rig, name: "rig.toml".into(), bytes: vec![] },
        Input { role: InputRole::Attachment, name: "a/b.ies".into(), bytes: vec![0, 255, 10] },
    ]
}

pub(super) fn steps() -> Vec<Step> {
    let dark = Step {
        id: 0,
        kind: ReadingKind::Dark,
        pose: None,
        positions: AxisPositions([0.0; 4]),
        counts: Latched([0; 4]),
        via: None,
        settle: Duration::ZERO,
        gain: 0,
        dwell: Duration::from_millis(200),
        shutter: Shutter::Closed,
        source_off: false,
        swept: None,
    };
    let target = Step {
        id: 1,
        kind: ReadingKind::Target { index: 7, repeat: 2 },
        pose: Some(Pose { x_m: 0.01, y_m: -0.1 / 3.0, theta_rad: 0.5, phi_rad: -3.0 }),
        positions: AxisPositions([0.5, -3.0, 0.01, -0.1 / 3.0]),
        counts: Latched([1, -2, i32::MAX, i32::MIN]),
        via: Some(Latched([-5, 6, -7, 8])),
        settle: Duration::new(1, 1),
        gain: 3,
        dwell: Duration::from_micros(50_001),
        shutter: Shutter::Open,
        source_off: true,
        swept: None,
    };
    let travel = Latched([-500, 0, 3, 0]);
    let swept = Swept { first: 2, count: 12, travel, lead: Duration::from_millis(50) };
    let window = Step { id: 2, swept: Some(swept), ..target };
    vec![dark, target, window]
}

pub(super) fn reading(id: u32) -> Reading {
    Reading {
        id,
        kind: ReadingKind::Target { index: id, repeat: 0 },
        gain: 1,
        n: 100,
        mean: 1234.5 + f64::from(id) / 3.0,
        variance: 0.1,
        min: -5,
        max: 2000,
        saturated: 0,
        commanded: Latched([1, 2, 3, 4]),
        // Every third is a window of a sweep.
        travel: Latched([if id.is_multiple_of(3) { 250 } else { 0 }, 0, 0, 0]),
        start: Latched([1, 2, 3, 5]),
        end: Latched([1, 2, 3, 6]),
        start_us: i64::from(id) * 100_000,
        end_us: i64::from(id) * 100_000 + 50_000,
        time_s: f64::from(id) * 0.1,
        session: 0,
        device_times: DeviceTimes {
            axes_s: None,
            photometer_s: (id % 2 == 1).then_some(f64::from(id) * 0.1),
        },
        link_retries: 0,
        unsettled: false,
    }
}

pub(super) fn records(ids: std::ops::Range<u32>) -> Vec<Record> {
    ids.map(|id| Record::Reading(reading(id))).collect()
}

#[test]
fn everything_comes_back_as_it_went_in() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let event = Event {
        session: 0,
        time_s: 1.25,
        kind: EventKind::PositionTrust,
        text: "trusted: home marks found".into(),
    };
    let check = ReferenceCheck {
        session: 1,
        reading: 0x8000_0000,
        before: 1.0,
        after: 1.1,
        u_difference: 0.2,
        verdict: Verdict::Agrees,
    };
    let written = [
        Record::SessionBegan { number: 0, boot_id: u32::MAX, started_s: 0.0 },
        Record::Event(event.clone()),
        Record::Reading(reading(1)),
        Record::Reading(reading(0)),
        Record::SessionEnded { number: 0, ended_s: 2.5, reason: "stopped by the person".into() },
        Record::SessionBegan { number: 1, boot_id: 7, started_s: 2.5 },
        Record::ReferenceCheck(check.clone()),
    ];
    let appended = journal.append(&written).unwrap();
    assert_eq!(appended, Appended { readings: 2, duplicates: vec![] });
    journal.close().unwrap();

    let journal = Journal::open(&folder.path()).unwrap();
    let reader = journal.reader();
    assert_eq!(reader.header().unwrap(), header());
    assert_eq!(reader.inputs().unwrap(), inputs());
    assert_eq!(reader.steps().unwrap(), steps());
    assert_eq!(reader.events().unwrap(), [event]);
    assert_eq!(reader.reference_checks().unwrap(), [check]);
    assert_eq!(reader.readings(Order::Taken).unwrap(), [reading(1), reading(0)]);
    assert_eq!(reader.readings(Order::Id).unwrap(), [reading(0), reading(1)]);
    assert_eq!(reader.reading_ids().unwrap(), [0, 1]);
    assert_eq!(reader.reading_count().unwrap(), 2);
    assert_eq!(reader.readings_after(1, 5).unwrap(), [(2, reading(0))]);
    let sessions = reader.sessions().unwrap();
    assert_eq!(sessions[0].ended, Some((2.5, "stopped by the person".into())));
    assert_eq!(sessions[1], Session { number: 1, boot_id: 7, started_s: 2.5, ended: None });
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn numbers_come_back_to_the_last_bit(
        mean in any::<f64>().prop_filter("finite", |x| x.is_finite()),
        ends in any::<(i64, i64)>(), counts in any::<[i32; 4]>(), id in any::<u32>(),
    ) {
        let folder = Folder::new();
        let mut journal = folder.journal();
        let mut expected = reading(id);
        (expected.mean, expected.start, expected.start_us) = (mean, Latched(counts), ends.0);
        expected.end_us = ends.1;
        journal.append(&[Record::Reading(expected.clone())]).unwrap();
        let present = journal.reader().readings(Order::Id).unwrap().remove(0);
        // The sign of zero alone is lost.
        prop_assert_eq!((present.mean + 0.0).to_bits(), (mean + 0.0).to_bits());
        prop_assert_eq!(present, expected);
    }
}

#[test]
fn a_commit_is_synced_through_a_write_ahead_log() {
    let folder = Folder::new();
    let connection_pragma = |journal: &Journal, name: &str| -> String {
        let value = journal
            .reader()
            .connection()
            .pragma_query_value(None, name, |row| row.get::<_, rusqlite::types::Value>(0));
        format!("{:?}", value.unwrap())
    };
    drop(folder.journal());
    let journal = Journal::open(&folder.path()).unwrap();
    assert_eq!(connection_pragma(&journal, "journal_mode"), "Text(\"wal\")");
    assert_eq!(connection_pragma(&journal, "synchronous"), "Integer(2)");
}

#[test]
fn an_identical_reading_stands_once_and_a_different_one_is_refused() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    journal.append(&records(0..3)).unwrap();
    let appended = journal.append(&records(2..5)).unwrap();
    assert_eq!(appended, Appended { readings: 2, duplicates: vec![2] });

    let mut other = reading(1);
    other.mean += 1.0;
    let error = journal.append(&[Record::Reading(reading(9)), Record::Reading(other)]).unwrap_err();
    assert_eq!(error, JournalError::Conflict { id: 1 });
    // All or nothing: 9 came in the same transaction.
    assert_eq!(journal.reader().reading_ids().unwrap(), [0, 1, 2, 3, 4]);
    assert_eq!(journal.reader().readings(Order::Id).unwrap()[1], reading(1));
}

#[test]
fn a_number_that_is_not_finite_is_refused_by_name() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let mut bad = reading(3);
    bad.variance = f64::NAN;
    let error = journal.append(&[Record::Reading(bad)]).unwrap_err();
    assert_eq!(error.to_string(), "reading variance of reading 3: NaN is not a finite number");
    let began = Record::SessionBegan { number: 0, boot_id: 0, started_s: f64::INFINITY };
    assert!(matches!(journal.append(&[began]), Err(JournalError::NotFinite { .. })));
}

#[test]
fn an_existing_file_is_never_overwritten() {
    let folder = Folder::new();
    std::fs::write(folder.path(), "mine").unwrap();
    let error = Journal::create(&folder.path(), &header(), &[], &[]).unwrap_err();
    assert_eq!(error, JournalError::Exists { path: folder.path() });
    assert_eq!(std::fs::read(folder.path()).unwrap(), b"mine");
}

#[test]
fn a_journal_that_cannot_be_begun_leaves_nothing() {
    let folder = Folder::new();
    let twice = [steps(), steps()].concat();
    let error = Journal::create(&folder.path(), &header(), &[], &twice).unwrap_err();
    assert!(error.to_string().contains("write the header: UNIQUE constraint"), "{error}");
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 0);
}

#[test]
fn one_process_appends_and_others_read_meanwhile() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let locked = JournalError::Locked { path: folder.path() };
    assert_eq!(Journal::open(&folder.path()).unwrap_err(), locked);
    let reader = Reader::open(&folder.path()).unwrap();
    journal.append(&records(0..2)).unwrap();
    assert_eq!(reader.reading_ids().unwrap(), [0, 1]);
    drop(journal);
    Journal::open(&folder.path()).unwrap();
}

#[test]
fn a_closed_journal_is_one_file_that_reads_anywhere() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    journal.append(&records(0..2)).unwrap();
    journal.close().unwrap();
    let names: Vec<_> = std::fs::read_dir(folder.0.path()).unwrap().collect();
    assert_eq!(names.len(), 1, "{names:?}");
    let copy = folder.0.path().join("odd name?#%.sqlite");
    std::fs::copy(folder.path(), &copy).unwrap();
    assert_eq!(Reader::open(&copy).unwrap().reading_ids().unwrap(), [0, 1]);
}

#[test]
fn what_is_not_a_journal_is_named() {
    let folder = Folder::new();
    let path = folder.path();
    let open = || (Journal::open(&path).unwrap_err(), Reader::open(&path).unwrap_err());

    assert!(matches!(open(), (JournalError::Missing { .. }, JournalError::Missing { .. })));
    std::fs::write(&path, b"").unwrap();
    assert!(matches!(open(), (JournalError::Empty { .. }, JournalError::Empty { .. })));
    for junk in [b"xy".to_vec(), vec![0xff; 700], vec![b'x'; 100_000]] {
        std::fs::write(&path, junk).unwrap();
        let is_named = |error: &JournalError| matches!(error, JournalError::NotAJournal { .. });
        let (append, read) = open();
        assert!(is_named(&append) && is_named(&read), "{append} {read}");
    }
    std::fs::remove_file(&path).unwrap();
    let foreign = rusqlite::Connection::open(&path).unwrap();
    foreign.execute_batch("CREATE TABLE t (a)").unwrap();
    drop(foreign);
    let (error, _) = open();
    assert!(error.to_string().ends_with("an SQLite file of another program (application id 0)"));
    assert!(matches!(
        Journal::open(folder.0.path()).unwrap_err(),
        JournalError::NotAJournal { .. }
    ));
}

#[test]
fn a_round_and_its_steps_are_kept_together_or_not_at_all() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let before = steps();
    let next: Vec<Step> = before.iter().map(|step| Step { id: step.id + 1000, ..*step }).collect();
    let round = |number, steps: &[Step]| Record::Round {
        number,
        account: format!("{{\"round\": {number}}}"),
        steps: steps.to_vec(),
    };
    journal.append(&[round(0, &next), round(1, &[])]).unwrap();
    // A step's name is taken: nothing of the round stands.
    assert!(journal.append(&[round(2, &next)]).is_err());
    journal.close().unwrap();
    let reader = Reader::open(&folder.path()).unwrap();
    let kept = reader.rounds().unwrap();
    let count = u32::try_from(next.len()).unwrap();
    assert_eq!(kept.iter().map(|r| (r.number, r.steps)).collect::<Vec<_>>(), [(0, count), (1, 0)]);
    assert_eq!(kept[0].account, "{\"round\": 0}");
    assert_eq!(reader.steps().unwrap(), [before, next].concat());
}

#[test]
fn another_schema_is_refused() {
    let folder = Folder::new();
    let journal = folder.journal();
    journal.reader().connection().pragma_update(None, "user_version", 99).unwrap();
    drop(journal);
    let error = JournalError::Schema { path: folder.path(), found: 99, expected: 4 };
    assert_eq!(Journal::open(&folder.path()).unwrap_err(), error);
    assert_eq!(Reader::open(&folder.path()).unwrap_err(), error);
}

#[test]
fn a_truncated_or_scribbled_file_is_damaged_and_stays_as_it_is() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    journal.append(&records(0..2000)).unwrap();
    journal.close().unwrap();
    let whole = std::fs::read(folder.path()).unwrap();

    for length in [whole.len() - 1, whole.len() - 4096, whole.len() / 2, 4096, 600] {
        std::fs::write(folder.path(), &whole[..length]).unwrap();
        let error = Journal::open(&folder.path()).unwrap_err();
        assert!(matches!(error, JournalError::Corrupt { .. }), "{length}: {error}");
        assert_eq!(std::fs::read(folder.path()).unwrap(), &whole[..length]);
    }
    let mut scribbled = whole.clone();
    scribbled[whole.len() / 2..whole.len() / 2 + 4096].fill(0x55);
    std::fs::write(folder.path(), &scribbled).unwrap();
    let error = Journal::open(&folder.path()).unwrap_err();
    assert!(matches!(error, JournalError::Corrupt { .. }), "{error}");
    let reader = Reader::open(&folder.path()).unwrap();
    assert!(reader.check_pages().is_err());
}

#[test]
fn an_input_file_is_bounded() {
    let folder = Folder::new();
    let input =
        Input { role: InputRole::Scene, name: "big".into(), bytes: vec![0; (64 << 20) + 1] };
    let error = Journal::create(&folder.path(), &header(), &[input], &[]).unwrap_err();
    assert_eq!(error.to_string(), "big: 67108865 bytes are above the limit of 67108864 bytes");
    assert!(!folder.path().exists());
}

#[test]
fn a_long_text_is_cut_between_characters() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let text = "ä".repeat(3000);
    let event = Event { session: 0, time_s: 0.0, kind: EventKind::Note, text: format!("x{text}") };
    journal.append(&[Record::Event(event)]).unwrap();
    assert_eq!(journal.reader().events().unwrap()[0].text.len(), 4095);
}

pub(super) fn fill_the_disk_of(journal: &Journal) {
    let connection = journal.reader().connection();
    let pages: i64 = connection.pragma_query_value(None, "page_count", |row| row.get(0)).unwrap();
    let allowed: i64 = connection
        .pragma_update_and_check(None, "max_page_count", pages + 1, |row| row.get(0))
        .unwrap();
    assert_eq!(allowed, pages + 1);
}

#[test]
fn a_full_disk_is_named_and_what_was_committed_stays() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    journal.append(&records(0..4)).unwrap();
    fill_the_disk_of(&journal);
    let error = journal.append(&records(4..2000)).unwrap_err();
    assert!(matches!(error, JournalError::DiskFull { .. }), "{error}");
    drop(journal);
    let mut journal = Journal::open(&folder.path()).unwrap();
    assert_eq!(journal.reader().reading_ids().unwrap(), [0, 1, 2, 3]);
    // Space was found: the run goes on.
    journal.append(&records(4..2000)).unwrap();
}

const CHILD: &str = "GONIO_TEST_APPENDS_TO";

/// Not a test of its own: the child of the next one. Acknowledges on standard output.
#[test]
fn child_that_appends_until_it_is_killed() {
    let Some(path) = std::env::var_os(CHILD) else { return };
    let mut journal = Journal::open(Path::new(&path)).unwrap();
    let mut next = journal.reader().reading_ids().unwrap().last().map_or(0, |last| last + 1);
    let mut out = std::io::stdout();
    for count in [1, 7, 40].into_iter().cycle() {
        journal.append(&records(next..next + count)).unwrap();
        next += count;
        writeln!(out, "acknowledged {next}").unwrap();
        out.flush().unwrap();
    }
}

#[test]
fn a_kill_loses_nothing_that_was_acknowledged() {
    let folder = Folder::new();
    drop(folder.journal());
    let mut acknowledged = 0;
    for round in 0..12_u64 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "journal::tests::child_that_appends_until_it_is_killed"])
            .args(["--nocapture", "--test-threads=1"])
            .env(CHILD, folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut take = |line: std::io::Result<String>| {
            if let Some((_, next)) = line.unwrap().split_once("acknowledged ") {
                acknowledged = next.parse().unwrap();
                return true;
            }
            false
        };
        // Appending has begun; then at a moment that differs from round to round.
        while !take(lines.next().expect("the child acknowledges")) {}
        std::thread::sleep(Duration::from_micros(round * round * 331 % 9000));
        child.kill().unwrap();
        child.wait().unwrap();
        lines.for_each(|line| {
            take(line);
        });

        // Opening checks every page.
        let journal = Journal::open(&folder.path()).unwrap();
        let ids = journal.reader().reading_ids().unwrap();
        assert!(ids.len() >= acknowledged, "round {round}: {} of {acknowledged}", ids.len());
        assert!(ids.iter().copied().eq(0..u32::try_from(ids.len()).unwrap()));
    }
    assert!(acknowledged > 12);
}
