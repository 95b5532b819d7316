//! The program under test, as a stranger runs it: by its command line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::{Arguments, Unmeasured};

/// `gonio`, of the same build.
#[derive(Debug, Clone)]
pub struct Program {
    path: PathBuf,
}

/// What one command said.
#[derive(Debug)]
pub struct Run {
    /// Wall time, from the start of the process to its end.
    pub wall: Duration,
    /// Its exit code; `None` after a signal.
    pub code: Option<i32>,
    /// Its JSON document.
    pub json: Value,
    /// What it said on standard error.
    pub error: String,
}

impl Program {
    /// Finds it.
    pub fn find(arguments: &Arguments) -> Result<Self, Unmeasured> {
        let beside = || Some(std::env::current_exe().ok()?.with_file_name("gonio"));
        let path = arguments.gonio.clone().or_else(beside).unwrap_or_else(|| "gonio".into());
        if !path.exists() {
            let shown = path.display();
            return Err(Unmeasured::because(format!(
                "{shown}: no such program; build it with `cargo build --release`"
            )));
        }
        Ok(Self { path })
    }

    /// A command of it, silent, without a person.
    pub fn command<S: AsRef<std::ffi::OsStr>>(&self, arguments: &[S]) -> Command {
        let mut command = Command::new(&self.path);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    /// Runs a command that prints one JSON document, to its end.
    pub fn run<S: AsRef<std::ffi::OsStr>>(&self, arguments: &[S]) -> Result<Run, Unmeasured> {
        let began = Instant::now();
        let Output { status, stdout, stderr } =
            self.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).output()?;
        let wall = began.elapsed();
        let error = String::from_utf8_lossy(&stderr).into_owned();
        let json = serde_json::from_slice(&stdout).unwrap_or(Value::Null);
        Ok(Run { wall, code: status.code(), json, error })
    }

    /// As [`Program::run`], of a command that must end well.
    pub fn well<S: AsRef<std::ffi::OsStr>>(&self, arguments: &[S]) -> Result<Run, Unmeasured> {
        let run = self.run(arguments)?;
        if run.code == Some(0) {
            return Ok(run);
        }
        let said: Vec<String> =
            arguments.iter().map(|word| word.as_ref().to_string_lossy().into_owned()).collect();
        Err(Unmeasured::because(format!(
            "`gonio {}` ended with {:?}: {}",
            said.join(" "),
            run.code,
            run.error
        )))
    }
}

impl Run {
    /// A number of its document, by the path of keys and places in lists that leads to it.
    pub fn number(&self, keys: &str) -> Result<f64, Unmeasured> {
        let found = keys.split('.').try_fold(&self.json, |value, key| match key.parse::<usize>() {
            Ok(place) => value.get(place),
            Err(_) => value.get(key),
        });
        found.and_then(Value::as_f64).ok_or_else(|| {
            Unmeasured::because(format!("the program's JSON has no number at {keys}"))
        })
    }
}

/// Copies an example's files into a folder, for changes that are no part of the repository.
pub fn copy_example(name: &str, folder: &Path) -> Result<(), Unmeasured> {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    std::fs::create_dir_all(folder)?;
    for entry in std::fs::read_dir(examples.join(name))? {
        let path = entry?.path();
        if let Some(file) = path.file_name() {
            std::fs::copy(&path, folder.join(file))?;
        }
    }
    Ok(())
}

/// Writes a file's lines anew; a line for which nothing is returned stays. One at least must change.
pub fn edit(path: &Path, mut change: impl FnMut(&str) -> Option<String>) -> Result<(), Unmeasured> {
    let text = std::fs::read_to_string(path)?;
    let mut changes = 0;
    let mut changed = String::new();
    for line in text.lines() {
        let new = change(line);
        changes += usize::from(new.is_some());
        changed.push_str(new.as_deref().unwrap_or(line));
        changed.push('\n');
    }
    if changes == 0 {
        let shown = path.display();
        return Err(Unmeasured::because(format!("{shown}: nothing in it was there to change")));
    }
    std::fs::write(path, changed)?;
    Ok(())
}
