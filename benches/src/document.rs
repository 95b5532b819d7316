//! A measurement's section: printed, and put into a document that holds one section a measurement,
//! each between a pair of marks, so that measuring again replaces it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use gonio::export::with_section;

use crate::{Arguments, Machine, Table, Unmeasured};

const PREFACE: &str = "# Measured

Every section below was written by the command that it names (the crate `benches/`, whose programs
open with their method); nothing here is typed by hand. Run the command again to replace it.
";

/// What a measurement found.
#[derive(Debug, Default)]
pub struct Section {
    name: &'static str,
    body: String,
    raw: Table,
    misses: usize,
}

impl Section {
    /// Named after its program; `title` is what was asked.
    pub fn new(name: &'static str, title: &str) -> Self {
        Self { name, body: format!("## {title}\n"), ..Self::default() }
    }

    /// Adds a paragraph.
    pub fn say(&mut self, text: &str) {
        let _ = write!(self.body, "\n{text}\n");
    }

    /// Adds a table.
    pub fn show(&mut self, table: &Table) {
        let _ = write!(self.body, "\n{table}");
    }

    /// Adds an aim, and whether it was met.
    pub fn aim(&mut self, aim: &str, is_met: bool) {
        self.misses += usize::from(!is_met);
        self.say(&format!("Aim: {aim}: **{}**.", if is_met { "met" } else { "missed" }));
    }

    /// The raw numbers, for `--output`.
    pub fn keep(&mut self, raw: Table) {
        self.raw = raw;
    }

    /// Aims that were missed.
    pub fn misses(&self) -> usize {
        self.misses
    }

    pub(crate) fn hand_out(
        &self,
        arguments: &Arguments,
        machine: &Machine,
    ) -> Result<(), Unmeasured> {
        let command = command();
        let machine = machine.describe(arguments)?;
        let text = format!("{}\n`{command}`  \n{machine}\n", self.body);
        println!("{text}");
        if let Some(path) = &arguments.output {
            fs::write(path, self.raw.csv())?;
        }
        if let Some(path) = &arguments.doc {
            let old = if path.exists() { fs::read_to_string(path)? } else { PREFACE.to_owned() };
            write_whole(path, &with_section(&old, self.name, &text))?;
        }
        Ok(())
    }
}

/// The command as a reader would give it, without what only concerns the document.
fn command() -> String {
    let mut words = std::env::args();
    let program = words.next().unwrap_or_default();
    let program = program.rsplit('/').next().unwrap_or_default().to_owned();
    let mut said = format!("cargo run --release -p benches --bin {program}");
    let mut separator = " --";
    while let Some(word) = words.next() {
        let value_follows = ["--doc", "--date", "--beside", "--gonio", "--output", "-o"];
        if value_follows.contains(&word.as_str()) {
            words.next();
        } else if !value_follows.iter().any(|name| word.starts_with(&format!("{name}="))) {
            let _ = write!(said, "{separator} {word}");
            separator = "";
        }
    }
    said
}

fn write_whole(path: &Path, text: &str) -> Result<(), Unmeasured> {
    let beside = path.with_extension("new");
    fs::write(&beside, text)?;
    fs::rename(&beside, path)?;
    Ok(())
}
