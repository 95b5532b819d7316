//! Instructions a value, counted by callgrind: the same for a rig that nothing is wrong with and for
//! one of which every flaw was left out. Two counts of values, so that what comes before cancels.

use std::process::{Command, ExitCode};

use benches::{Section, Table, Unmeasured};

use crate::{cases, compiled, timed};

const RIGS: [(&str, &str); 3] = [
    ("bare", "nothing is called for"),
    ("left-out", "every flaw of detector and source is called for and left out by request"),
    ("flawed", "every flaw of detector and source is in"),
];
const FEW: u64 = 20_000;
const MANY: u64 = 520_000;
/// A test of something absent would be one at least. What comes before the values is not quite the same
/// twice: some thousands of instructions.
const SAME_WITHIN: f64 = 0.5;

/// Takes values and says nothing.
pub(crate) fn take(rig: &str, count: &str) -> ExitCode {
    let Ok(count) = count.parse::<u64>() else { return ExitCode::FAILURE };
    let case = if rig == "bare" { cases::bare() } else { cases::flawed() };
    let Ok(mut compiled) = case.and_then(|case| compiled(&case)) else {
        return ExitCode::FAILURE;
    };
    if rig == "left-out" {
        let names: Vec<String> = compiled.effects().iter().map(|row| row.name.clone()).collect();
        for name in names {
            if let Some(less) = compiled.less(&name) {
                compiled = less.into();
            }
        }
    }
    let mut act = timed::values(&compiled);
    for _ in 0..count {
        act();
    }
    ExitCode::SUCCESS
}

/// Adds what was counted, if valgrind is there to count it.
pub(crate) fn compare(section: &mut Section) -> Result<(), Unmeasured> {
    if Command::new("valgrind").arg("--version").output().is_err() {
        section.say("Instructions were not counted: there is no valgrind (Debian: `valgrind`).");
        return Ok(());
    }
    let mut shown = Table::new(&["rig", "instructions a value"]);
    let mut found = Vec::new();
    for (rig, what) in RIGS {
        let difference = counted(rig, MANY)? - counted(rig, FEW)?;
        let each = difference as f64 / (MANY - FEW) as f64;
        found.push(each);
        shown.row([what.to_owned(), format!("{each:.2}")]);
    }
    section.say(
        "A rig pays nothing for what is not in it: instructions a value, counted by callgrind. What \
         comes before the values varies by some hundredths of an instruction a value; a test of \
         something absent would be one at least.",
    );
    section.show(&shown);
    let is_equal = (found[0] - found[1]).abs() < SAME_WITHIN && found[2] > found[0];
    section.aim("as many instructions as if it were not called for", is_equal);
    Ok(())
}

/// Instructions of a whole run.
fn counted(rig: &str, values: u64) -> Result<i64, Unmeasured> {
    let program = std::env::current_exe()?;
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["--take", rig, &values.to_string()])
        .output()?;
    let said = String::from_utf8_lossy(&run.stderr);
    let line = said.lines().find_map(|line| line.split_once("Collected :"));
    let number = line.and_then(|(_, rest)| rest.trim().parse().ok());
    number
        .filter(|_| run.status.success())
        .ok_or_else(|| Unmeasured::because(format!("callgrind counted nothing for {rig}: {said}")))
}
