//! A plan's text with some keys of it changed, all else kept: comments, order, blank lines. It
//! knows lines, headers of tables and keys; who changes a text reads it again, and so finds out
//! what this can't change (inline tables, dotted keys, texts over several lines).

use std::fmt::Write as _;

use spanned_toml::{Document, Source};

use super::Plan;

/// A key to set, or to take out.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// The table that it is in; empty for the top of the file.
    pub table: &'static str,
    /// The key.
    pub key: &'static str,
    /// What it becomes, as the file says it; `None` takes it out.
    pub value: Option<String>,
}

impl Change {
    /// Sets a key.
    #[expect(clippy::needless_pass_by_value, reason = "numbers and texts alike, each as it stands")]
    pub fn set(table: &'static str, key: &'static str, value: impl ToString) -> Self {
        Self { table, key, value: Some(value.to_string()) }
    }

    /// Takes a key out, if it is there.
    pub const fn remove(table: &'static str, key: &'static str) -> Self {
        Self { table, key, value: None }
    }
}

impl Plan {
    /// The plan with keys of its text changed, read again; `None` where that is no plan any more.
    /// What a text can't be changed in is as it was: who asks compares.
    pub fn changed(&self, changes: &[Change]) -> Option<Self> {
        let source = self.document().source();
        let text = rewrite(source.text(), changes);
        Self::read(Document::parse(Source::new(source.name(), &text)).ok()?).ok()
    }
}

/// The text with the changes made. A key that is not there is put at the end of its table, behind
/// its last key; a table that is not there is added at the end.
pub fn rewrite(text: &str, changes: &[Change]) -> String {
    // What a line ends with before its line feed stays with it; new lines end as the first one does.
    let body = text.strip_suffix('\n').unwrap_or(text);
    let end =
        if body.split('\n').next().is_some_and(|line| line.ends_with('\r')) { "\r" } else { "" };
    let mut lines: Vec<String> = body.split('\n').map(str::to_owned).collect();
    for change in changes {
        apply(&mut lines, change, end);
    }
    let mut text = lines.join("\n");
    text.push('\n');
    text
}

fn apply(lines: &mut Vec<String>, change: &Change, end: &str) {
    let Some((from, to)) = span_of(lines, change.table) else {
        if let Some(value) = &change.value {
            lines.extend([end.to_owned(), format!("[{}]{end}", change.table)]);
            lines.push(format!("{} = {value}{end}", change.key));
        }
        return;
    };
    let place = (from..to).find(|&i| key_of(&lines[i]) == Some(change.key));
    match (place, &change.value) {
        (Some(place), Some(value)) => lines[place] = with_value(&lines[place], change.key, value),
        (Some(place), None) => {
            lines.remove(place);
        }
        (None, Some(value)) => {
            let last = (from..to).rev().find(|&i| key_of(&lines[i]).is_some());
            let place = last.map_or(from, |last| last + 1);
            lines.insert(place, format!("{} = {value}{end}", change.key));
        }
        (None, None) => {}
    }
}

/// The lines of a table, from below its header to the next one.
fn span_of(lines: &[String], table: &str) -> Option<(usize, usize)> {
    let is_header = |line: &String| line.trim_start().starts_with('[');
    let from = if table.is_empty() {
        0
    } else {
        let name = |line: &String| {
            let line = line.trim_start().strip_prefix('[')?;
            (!line.starts_with('[')).then(|| line.split(']').next().unwrap_or("").trim() == table)
        };
        lines.iter().position(|line| name(line) == Some(true))? + 1
    };
    let to = lines[from..].iter().position(is_header).map_or(lines.len(), |i| from + i);
    Some((from, to))
}

/// The key that a line sets.
fn key_of(line: &str) -> Option<&str> {
    let (key, _) = line.split_once('=')?;
    let key = key.trim();
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    (!key.is_empty() && key.chars().all(is_bare)).then_some(key)
}

/// The line with another value; its comment stays where it is, if there is room.
fn with_value(line: &str, key: &str, value: &str) -> String {
    let (line, end) = line.strip_suffix('\r').map_or((line, ""), |line| (line, "\r"));
    let indent: String = line.chars().take_while(|c| c.is_whitespace()).collect();
    let mut new = format!("{indent}{key} = {value}");
    if let Some(at) = comment_of(line) {
        let width = line[..at].chars().count().max(new.chars().count() + 1);
        let pad = width - new.chars().count();
        // Writing to a string does not fail.
        let _ = write!(new, "{:pad$}{}", "", &line[at..]);
    }
    new.push_str(end);
    new
}

/// Where a line's comment begins: at the first `#` outside quotes.
fn comment_of(line: &str) -> Option<usize> {
    let mut quote = None;
    for (at, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') => return Some(at),
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if c == open => quote = None,
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = "# A plan.\nname = \"a # b\"      # its name\n\n[dwell]   # at rest\n\
                        dwell_ms = 50             # long\n\n# the rest\n[fit]\nangular_degree = 4\n";

    #[test]
    fn values_change_and_all_else_stays() {
        let changes = [
            Change::set("", "name", "\"c\""),
            Change::set("dwell", "dwell_ms", 12.5),
            Change::set("dwell", "gain", "\"1 uA\""),
            Change::set("expect", "beam_angle_deg", 40),
            Change::remove("fit", "nothing"),
        ];
        let expected = "# A plan.\nname = \"c\"          # its name\n\n[dwell]   # at rest\n\
                        dwell_ms = 12.5           # long\ngain = \"1 uA\"\n\n# the rest\n[fit]\n\
                        angular_degree = 4\n\n[expect]\nbeam_angle_deg = 40\n";
        assert_eq!(rewrite(PLAN, &changes), expected);
    }

    #[test]
    fn a_key_is_taken_out_of_its_own_table_alone() {
        let text = "count = 1\n[schedule]\ncount = 2\norder = \"travel\"\n[[derive]]\ncount = 3\n";
        let changes = [Change::remove("schedule", "count"), Change::remove("derive", "count")];
        assert_eq!(
            rewrite(text, &changes),
            "count = 1\n[schedule]\norder = \"travel\"\n[[derive]]\ncount = 3\n"
        );
    }

    #[test]
    fn lines_end_as_they_did() {
        let crlf = PLAN.replace('\n', "\r\n");
        let changes = [
            Change::set("dwell", "dwell_ms", 12.5),
            Change::set("dwell", "gain", "\"1 uA\""),
            Change::set("fit", "angular_degree", 6),
            Change::set("expect", "beam_angle_deg", 40),
        ];
        assert_eq!(rewrite(&crlf, &changes), rewrite(PLAN, &changes).replace('\n', "\r\n"));
    }

    #[test]
    fn no_change_is_the_same_text() {
        let mixed = PLAN.replacen('\n', "\r\n", 3);
        assert_eq!(rewrite(&mixed, &[]), mixed);
        assert_eq!(rewrite(PLAN, &[]), PLAN);
    }
}
