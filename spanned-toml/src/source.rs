//! A file's text with its name, and the document parsed from it.

use std::io::Read;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use toml::de::DeTable;

use crate::value::Entries;
use crate::{Problem, Table};

/// The largest file that is read, in bytes. A written file of a megabyte is a mistake: it is a
/// recording, or the wrong file.
const SOURCE_BYTES_MAX: u64 = 1 << 20;

/// What some editors put before the text. Nobody sees it, so that it counts as no column.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// A file's text and the name to call it by in messages. Cheap to clone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    name: Arc<str>,
    text: Arc<str>,
}

impl Source {
    /// Text that is already in memory. A byte order mark before it is no part of it.
    pub fn new(name: &str, text: &str) -> Self {
        let text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
        Self { name: name.into(), text: text.into() }
    }

    /// Reads a file of at most one mebibyte of UTF-8 text.
    pub fn read(path: &Path) -> Result<Self, Problem> {
        let name = path.display().to_string();
        let problem = |what: String, expected: &str, help: &str| {
            Problem::of_file(&Self::new(&name, ""), &what, expected, help)
        };
        let mut bytes = Vec::new();
        std::fs::File::open(path)
            .and_then(|file| file.take(SOURCE_BYTES_MAX + 1).read_to_end(&mut bytes))
            .map_err(|e| {
                problem(
                    format!("cannot be read: {e}"),
                    "a readable text file",
                    "check the path and its permissions",
                )
            })?;
        if bytes.len() as u64 > SOURCE_BYTES_MAX {
            return Err(problem(
                "is larger than 1 MiB".into(),
                "a TOML file written by a person",
                "is this the right file?",
            ));
        }
        let text = String::from_utf8(bytes).map_err(|e| {
            problem(
                format!("is not text: byte {} is not UTF-8", e.utf8_error().valid_up_to()),
                "a TOML file in UTF-8",
                "is this the right file?",
            )
        })?;
        if let Some(byte) = text.find('\0') {
            let help = "is this the right file?";
            return Err(problem(format!("is not text: byte {byte} is 0"), "a TOML file", help));
        }
        let source = Self::new(&name, &text);
        if source.text.trim().is_empty() {
            let help = "is this the right file, and was it saved?";
            return Err(problem("is empty".into(), "a TOML file", help));
        }
        Ok(source)
    }

    /// What messages call the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Line and column of a byte offset, both from 1; the column counts characters.
    pub(crate) fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let before = self.text.get(..offset).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// A parsed TOML file.
#[derive(Debug, Clone)]
pub struct Document {
    source: Source,
    root: Arc<Entries>,
}

impl Document {
    /// Parses the text. The problem names the place of the first syntax error.
    pub fn parse(source: Source) -> Result<Self, Problem> {
        let root = DeTable::parse(source.text()).map(|root| Entries::from(root.get_ref()));
        match root {
            Ok(root) => Ok(Self { root: Arc::new(root), source }),
            Err(e) => Err(Problem::at(
                &source,
                e.span().unwrap_or(0..0),
                "",
                e.message(),
                "a TOML file",
                "see https://toml.io for the syntax",
            )),
        }
    }

    /// Reads and parses a file.
    pub fn read(path: &Path) -> Result<Self, Problem> {
        Self::parse(Source::read(path)?)
    }

    /// The text and name that it was parsed from.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The top-level table.
    pub fn root(&self) -> Table<'_> {
        Table::new(&self.source, String::new(), whole(&self.source), &self.root)
    }
}

/// What the reader finds wrong with the root as a whole is shown at the file's first line.
fn whole(source: &Source) -> Range<usize> {
    0..source.text().find('\n').unwrap_or(source.text().len())
}
