//! How many readings a second the journal takes, each rate with its limit beside it. One reading a
//! durable transaction (what a rig that waited for every commit would get), the inline writer of
//! virtual time (512 a transaction), and the writer's own thread of real time (whatever has
//! gathered while the commit before was on its way); then the last again with readings that come
//! at the rate asked for, to see how late they become durable. The disk's own limit is the time of
//! writing and syncing one page of a plain file. A disk that syncs in less than about a tenth of a millisecond does not reach a
//! medium that outlives a power failure; a virtual machine's often does not.
//!
//! All on the file system of the folder for temporary files: set TMPDIR to measure another.

use std::fs::File;
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use benches::{Arguments, Section, Spread, Table, Unmeasured, repeat, report, timed};
use clap::Parser;
use gonio::journal::{EffectWishes, Header, Journal, Record, Writer};
use gonio::rig::{Latched, Reading, ReadingKind};

/// Committed readings a second to aim at.
const AIM_PER_S: f64 = 5000.0;
/// What may wait in the threaded writer before the bench waits for it.
const AHEAD: u64 = 2048;
const PAGE_BYTES: usize = 4096;

/// Readings a second into the journal.
#[derive(Debug, Parser)]
struct Asked {
    /// Readings a repeat.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1000..=1_000_000))]
    readings: u32,
    /// Repeats.
    #[arg(long, default_value_t = 5)]
    repeats: usize,
    #[command(flatten)]
    arguments: Arguments,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build()?;
    let (many, few) = (asked.readings, (asked.readings / 40).max(100));
    let fresh = || -> Result<(tempfile::TempDir, Journal), Unmeasured> {
        let folder = tempfile::tempdir()?;
        let journal = Journal::create(&folder.path().join("run.sqlite"), &header(), &[], &[])?;
        Ok((folder, journal))
    };
    let sync = repeat(asked.repeats, || {
        let folder = tempfile::tempdir()?;
        write_and_sync(folder.path(), few)
    })?;
    let single = repeat(asked.repeats, || {
        let (_folder, mut journal) = fresh()?;
        Ok(timed(|| one_by_one(&mut journal, few))?.0)
    })?;
    let inline = repeat(asked.repeats, || {
        let (_folder, journal) = fresh()?;
        Ok(timed(|| runtime.block_on(in_bulk(Writer::inline(journal), many)))?.0)
    })?;
    let threaded = repeat(asked.repeats, || {
        let (_folder, journal) = fresh()?;
        let writer = Writer::threaded(journal)?;
        Ok(timed(|| runtime.block_on(in_bulk(writer, many)))?.0)
    })?;
    let (_folder, journal) = fresh()?;
    let lateness = runtime.block_on(paced(Writer::threaded(journal)?, AIM_PER_S))?;

    let mut table = Table::new(&["way", "readings", "a second", "s", "a transaction"]);
    let mut row = |way: &str, n: u32, time: &Spread, batch: &str| {
        let rate = format!("{:.0}", f64::from(n) / time.median());
        table.row([way.to_owned(), n.to_string(), rate, format!("{time:.3}"), batch.to_owned()]);
    };
    row("plain file: write a page and sync", few, &sync, "1");
    row("one by one, each durable", few, &single, "1");
    row("inline writer (virtual time)", many, &inline, "512");
    row("writer with a thread (real time)", many, &threaded, "up to 512");
    let mut section = Section::new("journal_rate", "Readings a second into the journal");
    section.say(&format!(
        "Median (least to most) of {} repeats. What limits: one by one, the disk's sync; in \
         bulk, SQLite on one core.",
        asked.repeats
    ));
    section.show(&table);
    section.say(&format!(
        "At {AIM_PER_S:.0} readings a second for 2 s, the writer with a thread makes a reading \
         durable after {:.1} ms (median), {:.1} ms (95 %), {:.1} ms (the latest).",
        1e3 * lateness.median(),
        1e3 * lateness.quantile(0.95),
        1e3 * lateness.quantile(1.0)
    ));
    let rate = f64::from(many) / threaded.median();
    section.aim("5,000 committed a second in real time", rate >= AIM_PER_S);
    section.aim("none committed later than 100 ms", lateness.quantile(1.0) <= 0.1);
    section.keep(table);
    Ok(section)
}

fn write_and_sync(folder: &Path, times: u32) -> Result<Duration, Unmeasured> {
    let mut file = File::create(folder.join("page"))?;
    // Long enough already: only contents are synced, not the file's length.
    file.write_all(&vec![0; PAGE_BYTES * times as usize])?;
    file.sync_all()?;
    file.seek(SeekFrom::Start(0))?;
    let page = [7_u8; PAGE_BYTES];
    let (time, ()) = timed(|| {
        for _ in 0..times {
            file.write_all(&page)?;
            file.sync_data()?;
        }
        Ok(())
    })?;
    Ok(time)
}

fn one_by_one(journal: &mut Journal, count: u32) -> Result<(), Unmeasured> {
    for id in 0..count {
        journal.append(&[record(id)])?;
    }
    demand(journal, count)
}

async fn in_bulk(mut writer: Writer, count: u32) -> Result<(), Unmeasured> {
    let mut progress = writer.progress();
    for id in 0..count {
        while writer.waiting() >= AHEAD {
            progress.changed().await?;
        }
        writer.push(record(id))?;
    }
    demand(&writer.finish().await?, count)
}

/// Hands readings over at their times for two seconds; how long each took to be durable.
async fn paced(mut writer: Writer, per_s: f64) -> Result<Spread, Unmeasured> {
    let mut progress = writer.progress();
    let began = Instant::now();
    let watch = std::thread::spawn(move || {
        // In a thread of its own: it sees a commit when it happens.
        let runtime = tokio::runtime::Builder::new_current_thread().build().ok()?;
        let mut commits: Vec<(u64, Duration)> = Vec::new();
        runtime.block_on(async {
            while progress.changed().await.is_ok() {
                commits.push((progress.borrow_and_update().committed, began.elapsed()));
            }
        });
        Some(commits)
    });
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // thousands
    let count = (2.0 * per_s) as u32;
    let mut pushed = Vec::new();
    for id in 0..count {
        let due = Duration::from_secs_f64(f64::from(id) / per_s);
        if let Some(early) = due.checked_sub(began.elapsed()) {
            tokio::time::sleep(early).await;
        }
        pushed.push(began.elapsed());
        writer.push(record(id))?;
    }
    demand(&writer.finish().await?, count)?;
    let commits = watch.join().ok().flatten();
    let commits = commits.ok_or_else(|| Unmeasured::because("the watching thread died"))?;
    let durable = |place: usize| commits.iter().find(|(count, _)| *count > place as u64);
    let waits: Option<Vec<f64>> = (0..pushed.len())
        .map(|place| Some(durable(place)?.1.saturating_sub(pushed[place]).as_secs_f64()))
        .collect();
    waits.map(Spread::of).ok_or_else(|| Unmeasured::because("a commit was not reported"))
}

fn demand(journal: &Journal, count: u32) -> Result<(), Unmeasured> {
    let found = journal.reader().reading_count()?;
    if found == u64::from(count) {
        return Ok(());
    }
    Err(Unmeasured::because(format!("{found} readings in the journal, expected {count}")))
}

fn header() -> Header {
    Header {
        program_version: "0".into(),
        seed: 1,
        simulated: true,
        rig_name: "none".into(),
        plan_name: "none".into(),
        plan_hash: "00".into(),
        started_utc: "2026-01-01T00:00:00Z".into(),
        effects: Vec::new(),
        effect_wishes: EffectWishes::default(),
    }
}

/// A reading as a run makes them: its numbers as long as real ones.
fn record(id: u32) -> Record {
    let t = f64::from(id);
    let latched = |k: i32| {
        let id = i32::try_from(id % 1_000_000).unwrap_or_default();
        Latched([id * 7 % 90_000, -id * 11 % 180_000, id % 20_000, k - id % 20_000])
    };
    Record::Reading(Reading {
        id,
        kind: ReadingKind::Target { index: id, repeat: 0 },
        gain: 0,
        n: 100,
        mean: 126_714.61 + libm::sin(t) / 3.0,
        variance: 17.525 + libm::cos(t) / 7.0,
        min: 126_703,
        max: 126_727,
        saturated: 0,
        commanded: latched(0),
        travel: Latched([0; 4]),
        start: latched(1),
        end: latched(1),
        start_us: i64::from(id) * 500_000,
        end_us: i64::from(id) * 500_000 + 50_000,
        time_s: 0.5 * t + 22.644_22,
        session: 0,
        device_times: gonio::rig::DeviceTimes::default(),
        link_retries: 0,
        unsettled: false,
    })
}
