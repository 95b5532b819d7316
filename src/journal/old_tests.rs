//! Journals of earlier versions: each lacks some tables, and is read and carried on all the same.

use super::tests::{Folder, reading, records, steps};
use super::{Journal, Order, Reader, Record};
use crate::rig::{DeviceTimes, Latched, Reading};

#[test]
fn a_journal_from_before_there_were_sweeps_is_read_and_carried_on() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let device_times = DeviceTimes::default();
    let at_rest = |id| Reading { travel: Latched([0; 4]), device_times, ..reading(id) };
    journal.append(&[Record::Reading(at_rest(0))]).unwrap();
    let old = "DROP TABLE swept_steps; DROP TABLE swept_readings; DROP TABLE rounds; \
               DROP TABLE device_times; PRAGMA user_version = 1;";
    journal.reader().connection().execute_batch(old).unwrap();
    journal.close().unwrap();
    let readings = |reader: &Reader| reader.readings(Order::Id).unwrap();
    assert_eq!(readings(&Reader::open(&folder.path()).unwrap()), [at_rest(0)]);
    let mut journal = Journal::open(&folder.path()).unwrap();
    assert!(journal.reader().steps().unwrap().iter().all(|step| step.swept.is_none()));
    journal.append(&[Record::Reading(at_rest(1))]).unwrap();
    assert_eq!(readings(journal.reader()), [at_rest(0), at_rest(1)]);
}

#[test]
fn a_journal_from_before_there_were_rounds_is_read_and_carried_on() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    journal.append(&records(0..1)).unwrap();
    let old = "DROP TABLE rounds; DROP TABLE device_times; PRAGMA user_version = 2;";
    journal.reader().connection().execute_batch(old).unwrap();
    journal.close().unwrap();
    assert_eq!(Reader::open(&folder.path()).unwrap().rounds().unwrap(), []);
    let mut journal = Journal::open(&folder.path()).unwrap();
    journal.append(&records(1..2)).unwrap();
    let reader = journal.reader();
    assert_eq!(reader.readings(Order::Id).unwrap(), [reading(0), reading(1)]);
    assert_eq!(reader.steps().unwrap(), steps());
}

#[test]
fn a_journal_from_before_devices_had_times_is_read_and_carried_on() {
    let folder = Folder::new();
    let mut journal = folder.journal();
    let one_controller = |id| Reading { device_times: DeviceTimes::default(), ..reading(id) };
    journal.append(&[Record::Reading(one_controller(1))]).unwrap();
    let old = "DROP TABLE device_times; PRAGMA user_version = 3;";
    journal.reader().connection().execute_batch(old).unwrap();
    journal.close().unwrap();
    let readings = |reader: &Reader| reader.readings(Order::Id).unwrap();
    assert_eq!(readings(&Reader::open(&folder.path()).unwrap()), [one_controller(1)]);
    let mut journal = Journal::open(&folder.path()).unwrap();
    journal.append(&[Record::Reading(one_controller(2))]).unwrap();
    assert_eq!(readings(journal.reader()), [one_controller(1), one_controller(2)]);
}
