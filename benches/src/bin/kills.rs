//! Is anything lost, doubled or altered when the program is killed? Each round begins `gonio run
//! --realtime` of a small plan on a quick rig, sends it SIGKILL at a random moment (while it starts,
//! homes, measures or fits), and carries on with `gonio resume`, which is killed too, up to twice,
//! before it may finish. Moments and how often are drawn from the round's number.
//!
//! Just before each kill the journal's committed readings are read from outside, as any other
//! process may. At the end: everything that was ever seen committed is still there, to the last bit;
//! every step of the plan was measured once; samples.csv has each target once; and its column of
//! radiances is that of a run with the same seed that was never interrupted (in virtual time, which
//! must not matter). Every round has a seed of its own, and so a rig and noise of its own.
//!
//! A resume measures the reference pose first and refuses to go on if it differs by more than 2 u,
//! which chance alone does once in 22 times. Such a round goes on with `--accept-drift`, is counted,
//! and must still show the same numbers. A kill before the journal existed leaves nothing to carry
//! on: the round begins again, and is counted.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use benches::{
    Arguments, Dice, Program, Section, Table, Unmeasured, binomial_band, copy_example, edit, report,
};
use clap::Parser;
use gonio::journal::{Order, Reader, Verdict};
use gonio::rig::Reading;

/// Kills in a round at most: of the run, and of its resumes.
const KILLS_MAX: u32 = 3;
/// A command that takes longer hangs.
const PATIENCE: Duration = Duration::from_mins(2);
/// Times that a round may be begun or resumed without getting further.
const TRIES: u32 = 12;

const PLAN: &str = r#"name = "kills"
rig = "rig.toml"
scene = "scene.toml"

[region]
x_mm = [-10, 10]
y_mm = [-10, 10]
theta_max_deg = 60

[schedule]
kind = "low-discrepancy"
count = 120

[dwell]
dwell_ms = 5

[dark]
method = "shutter"
every = 25
dwell_ms = 20

[reference]
x_mm = 0
y_mm = 0
theta_deg = 0
phi_deg = 0
every = 20
dwell_ms = 10

[fit]
angular_degree = 2
position_degree = 1
"#;

/// Kills and resumes.
#[derive(Debug, Parser)]
struct Asked {
    /// Rounds.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rounds: u32,
    /// Rounds at a time: they wait for motion more than they compute.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=64))]
    at_a_time: u32,
    #[command(flatten)]
    arguments: Arguments,
}

/// What happened in rounds.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    rounds: u32,
    kills: u32,
    /// Before there was a journal.
    early: u32,
    /// Before the first reading was committed.
    homing: u32,
    resumes_killed: u32,
    resumes: u32,
    checks: u32,
    /// More than 2 u between a reference reading before and after.
    beyond: u32,
    /// Readings seen committed before a kill, summed over kills.
    committed: u64,
    lost: u64,
    altered: u64,
    doubled: u64,
    missing: u64,
    unequal: u64,
    stuck: u32,
}

/// The run that is interrupted.
struct Whole {
    plan: PathBuf,
    wall: Duration,
    steps: usize,
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let program = Program::find(&asked.arguments)?;
    let folder = tempfile::tempdir()?;
    let plan = prepare(folder.path())?;
    let whole = uninterrupted(&program, plan, folder.path())?;
    let next = AtomicU32::new(0);
    let work = || -> Result<Tally, Unmeasured> {
        let mut tally = Tally::default();
        loop {
            let round = next.fetch_add(1, Ordering::Relaxed);
            if round >= asked.rounds {
                return Ok(tally);
            }
            one_round(&program, &whole, folder.path(), round, &mut tally)?;
        }
    };
    let parts: Vec<Result<Tally, Unmeasured>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..asked.at_a_time).map(|_| scope.spawn(work)).collect();
        let died = |_| Err(Unmeasured::because("a thread panicked"));
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(died)).collect()
    });
    let parts = parts.into_iter().collect::<Result<Vec<Tally>, _>>()?;
    Ok(section(&parts.into_iter().fold(Tally::default(), Tally::plus), &whole))
}

fn section(tally: &Tally, whole: &Whole) -> Section {
    let mut table = Table::new(&["what", "count"]);
    let rows: [(&str, u64); 15] = [
        ("rounds", tally.rounds.into()),
        ("kills", tally.kills.into()),
        ("of them before there was a journal", tally.early.into()),
        ("of them before the first reading (starting, homing)", tally.homing.into()),
        ("of them of a resume", tally.resumes_killed.into()),
        ("resumes", tally.resumes.into()),
        ("reference checks", tally.checks.into()),
        ("of them beyond 2 u", tally.beyond.into()),
        ("readings seen committed before a kill", tally.committed),
        ("of them lost", tally.lost),
        ("of them altered", tally.altered),
        ("readings or samples doubled", tally.doubled),
        ("steps or samples missing at the end", tally.missing),
        ("samples unlike the uninterrupted run's", tally.unequal),
        ("rounds that never got to their end", tally.stuck.into()),
    ];
    for (what, count) in rows {
        table.row([what.to_owned(), count.to_string()]);
    }
    let mut section = Section::new("kills", "Killed at random moments, and resumed");
    section.say(&format!(
        "A plan of {} readings, {:.1} s without interruption.",
        whole.steps,
        whole.wall.as_secs_f64()
    ));
    section.show(&table);
    let checks = tally.checks as usize;
    let (most, least) = binomial_band(checks);
    section.say(&format!(
        "Of {checks} reference checks chance alone puts {} to {} beyond 2 u, in 95 % of such \
         experiments; those were resumed with `--accept-drift`.",
        checks - least,
        checks - most
    ));
    let faults = tally.lost + tally.altered + tally.doubled + tally.missing + tally.unequal;
    section.aim("nothing lost, none twice, the same numbers", faults == 0 && tally.stuck == 0);
    section.keep(table);
    section
}

/// A small plan on a rig that is many times as quick as the example's.
fn prepare(folder: &Path) -> Result<PathBuf, Unmeasured> {
    let place = folder.join("plan");
    copy_example("lambertian", &place)?;
    std::fs::write(place.join("plan.toml"), PLAN)?;
    edit(&place.join("rig.toml"), |line| {
        let (key, rest) = line.split_once(" = ")?;
        let number = rest.split(' ').next()?.parse::<f64>();
        match key {
            "settle_ms" => Some("settle_ms = 2".to_owned()),
            key if key.starts_with("speed_") => Some(format!("{key} = {}", 20.0 * number.ok()?)),
            key if key.starts_with("acceleration_") => {
                Some(format!("{key} = {}", 400.0 * number.ok()?))
            }
            _ => None,
        }
    })?;
    Ok(place.join("plan.toml"))
}

fn uninterrupted(program: &Program, plan: PathBuf, folder: &Path) -> Result<Whole, Unmeasured> {
    let out = folder.join("whole");
    let run = program.well(&words("run", &plan, &["--realtime", "--out", &text(&out)]))?;
    let steps = Reader::open(&out.join("run.sqlite"))?.steps()?.len();
    Ok(Whole { plan, wall: run.wall, steps })
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn words(command: &str, what: &Path, more: &[&str]) -> Vec<String> {
    let words = [command, &text(what), "--json"];
    words.iter().chain(more).map(|&word| word.to_owned()).collect()
}

/// Index and radiance of every line of samples.csv, as they stand there.
fn columns(out: &Path) -> Result<Vec<(String, String)>, Unmeasured> {
    let text = std::fs::read_to_string(out.join("samples.csv"))?;
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let place = |name: &str| {
        let found = head.iter().position(|column| *column == name);
        found.ok_or_else(|| Unmeasured::because(format!("samples.csv has no column {name}")))
    };
    let (index, radiance) = (place("index")?, place("radiance_w_per_m2_sr")?);
    let cell = |line: &str, n: usize| line.split(',').nth(n).unwrap_or_default().to_owned();
    Ok(lines.map(|line| (cell(line, index), cell(line, radiance))).collect())
}

fn one_round(
    program: &Program,
    whole: &Whole,
    folder: &Path,
    round: u32,
    tally: &mut Tally,
) -> Result<(), Unmeasured> {
    let (out, twin) = (folder.join(format!("round {round}")), folder.join(format!("twin {round}")));
    let journal = out.join("run.sqlite");
    let seed = (round + 1).to_string();
    program.well(&words("run", &whole.plan, &["--seed", &seed, "--out", &text(&twin)]))?;
    let expected = columns(&twin)?;
    std::fs::remove_dir_all(&twin)?;
    let mut dice = Dice::new(u64::from(round));
    let mut seen: Vec<Reading> = Vec::new();
    let mut kills_left = 1 + dice.below(KILLS_MAX);
    let mut accepts = false;
    tally.rounds += 1;
    for _ in 0..TRIES {
        let is_begun = Reader::open(&journal).is_ok();
        let command = if is_begun {
            tally.resumes += 1;
            let accept =
                if accepts { &["--realtime", "--accept-drift"][..] } else { &["--realtime"] };
            words("resume", &out, accept)
        } else {
            // What a kill before the journal was whole leaves is of no use to anybody.
            let _ = std::fs::remove_dir_all(&out);
            words("run", &whole.plan, &["--realtime", "--seed", &seed, "--out", &text(&out)])
        };
        let deadline = if kills_left > 0 { whole.wall.mul_f64(dice.part()) } else { PATIENCE };
        if run_until(program, &command, deadline, &journal, &mut seen)? {
            if kills_left == 0 {
                break;
            }
            kills_left -= 1;
            tally.kills += 1;
            tally.resumes_killed += u32::from(is_begun);
            tally.early += u32::from(Reader::open(&journal).is_err());
            tally.homing += u32::from(seen.is_empty());
            tally.committed += seen.len() as u64;
            continue;
        }
        let reader = Reader::open(&journal)?;
        let checks = reader.reference_checks()?;
        let ids = reader.reading_ids()?;
        let is_complete = reader.steps()?.iter().all(|step| ids.binary_search(&step.id).is_ok());
        if is_complete && out.join("fit.json").exists() {
            tally.checks += u32::try_from(checks.len())?;
            let beyond = checks.iter().filter(|check| check.verdict != Verdict::Agrees).count();
            tally.beyond += u32::try_from(beyond)?;
            return compare(&expected, &out, &seen, tally);
        }
        accepts |= checks.last().is_some_and(|check| check.verdict == Verdict::Refused);
    }
    tally.stuck += 1;
    Ok(())
}

/// Runs a command until it ends or the deadline passes; then sees what is committed, and kills it.
fn run_until(
    program: &Program,
    words: &[String],
    deadline: Duration,
    journal: &Path,
    seen: &mut Vec<Reading>,
) -> Result<bool, Unmeasured> {
    let began = Instant::now();
    let mut child = program.command(words).spawn()?;
    loop {
        if child.try_wait()?.is_some() {
            return Ok(false);
        }
        let left = deadline.saturating_sub(began.elapsed());
        if left.is_zero() {
            break;
        }
        std::thread::sleep(left.min(Duration::from_millis(2)));
    }
    // Not there yet, or not yet a journal: then nothing is committed.
    let committed = Reader::open(journal).and_then(|reader| reader.readings(Order::Id));
    child.kill()?;
    child.wait()?;
    if let Ok(committed) = committed {
        let known: Vec<u32> = seen.iter().map(|reading| reading.id).collect();
        seen.extend(committed.into_iter().filter(|reading| !known.contains(&reading.id)));
    }
    Ok(true)
}

/// The end of a round against what was seen on the way and against the uninterrupted run.
fn compare(
    expected: &[(String, String)],
    out: &Path,
    seen: &[Reading],
    tally: &mut Tally,
) -> Result<(), Unmeasured> {
    let reader = Reader::open(&out.join("run.sqlite"))?;
    let readings = reader.readings(Order::Id)?;
    for reading in seen {
        match readings.iter().find(|kept| kept.id == reading.id) {
            None => tally.lost += 1,
            Some(kept) => tally.altered += u64::from(kept != reading),
        }
    }
    let steps: Vec<u32> = reader.steps()?.iter().map(|step| step.id).collect();
    let count = |id: u32| readings.iter().filter(|reading| reading.id == id).count();
    for id in steps {
        tally.missing += u64::from(count(id) == 0);
        tally.doubled += u64::from(count(id) > 1);
    }
    let samples = columns(out)?;
    for (index, radiance) in expected {
        let found: Vec<&String> =
            samples.iter().filter(|(of, _)| of == index).map(|(_, radiance)| radiance).collect();
        tally.missing += u64::from(found.is_empty());
        tally.doubled += (found.len() as u64).saturating_sub(1);
        tally.unequal += found.iter().filter(|found| **found != radiance).count() as u64;
    }
    std::fs::remove_dir_all(out)?;
    Ok(())
}

impl Tally {
    fn plus(self, other: Self) -> Self {
        Self {
            rounds: self.rounds + other.rounds,
            kills: self.kills + other.kills,
            early: self.early + other.early,
            homing: self.homing + other.homing,
            resumes_killed: self.resumes_killed + other.resumes_killed,
            resumes: self.resumes + other.resumes,
            checks: self.checks + other.checks,
            beyond: self.beyond + other.beyond,
            committed: self.committed + other.committed,
            lost: self.lost + other.lost,
            altered: self.altered + other.altered,
            doubled: self.doubled + other.doubled,
            missing: self.missing + other.missing,
            unequal: self.unequal + other.unequal,
            stuck: self.stuck + other.stuck,
        }
    }
}
