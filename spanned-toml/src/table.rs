//! One table of a document: values by key, checked as they are read.

mod lists;

use std::cell::RefCell;
use std::ops::{Range, RangeInclusive};

use crate::value::{Entries, Entry, Kind, Value};
use crate::{Bounds, Problem, Source};

/// Two words this many edits apart, or fewer, are offered as each other's correction.
const NEAREST_EDITS_MAX: usize = 4;
/// A word is taken for a misspelt one if this many letters of it stand for each edit.
const WORD_LETTERS_PER_EDIT: usize = 3;
/// Words that keys end with to say a number's unit: one for another is a slip of its own.
const UNITS: [&str; 14] =
    ["a", "cm", "deg", "h", "hz", "khz", "m", "min", "mm", "ms", "rad", "s", "um", "us"];
/// Characters of a file's key or value that a message repeats; no word that is known is longer.
const SHOWN_MAX: usize = 60;
const TABLE: &str = "a table";

/// A table being read. Ask for each key that may stand in it, then call [`Table::finish`].
#[derive(Debug)]
pub struct Table<'d> {
    source: &'d Source,
    path: String,
    span: Range<usize>,
    entries: &'d Entries,
    asked: RefCell<Vec<String>>,
}

impl<'d> Table<'d> {
    pub(crate) fn new(
        source: &'d Source,
        path: String,
        span: Range<usize>,
        entries: &'d Entries,
    ) -> Self {
        Self { source, path, span, entries, asked: RefCell::new(Vec::new()) }
    }

    /// A finite number inside `bounds`; an integer is taken as a number.
    pub fn number(&self, key: &str, bounds: Bounds) -> Result<Option<f64>, Problem> {
        self.look_up(key).map(|value| self.read_number(key, value, bounds)).transpose()
    }

    /// As [`Table::number`], but it must be there.
    pub fn required_number(&self, key: &str, bounds: Bounds) -> Result<f64, Problem> {
        self.number(key, bounds)?.ok_or_else(|| self.missing(key, &bounds.to_string()))
    }

    /// An integer inside `range`.
    pub fn integer(&self, key: &str, range: RangeInclusive<i64>) -> Result<Option<i64>, Problem> {
        let expected = format!("an integer from {} to {}", range.start(), range.end());
        let Some(value) = self.look_up(key) else { return Ok(None) };
        match value.kind {
            Kind::Integer(integer) if range.contains(&integer) => Ok(Some(integer)),
            _ => Err(self.unexpected(key, value, &expected)),
        }
    }

    /// As [`Table::integer`], but it must be there.
    pub fn required_integer(&self, key: &str, range: RangeInclusive<i64>) -> Result<i64, Problem> {
        let expected = format!("an integer from {} to {}", range.start(), range.end());
        self.integer(key, range)?.ok_or_else(|| self.missing(key, &expected))
    }

    /// A string that is not empty.
    pub fn text(&self, key: &str) -> Result<Option<&'d str>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(None) };
        match &value.kind {
            Kind::Text(text) if !text.trim().is_empty() => Ok(Some(text)),
            _ => Err(self.unexpected(key, value, "a text that is not empty, in quotes")),
        }
    }

    /// As [`Table::text`], but it must be there.
    pub fn required_text(&self, key: &str) -> Result<&'d str, Problem> {
        self.text(key)?.ok_or_else(|| self.missing(key, "a text in quotes"))
    }

    /// `true` or `false`.
    pub fn flag(&self, key: &str) -> Result<Option<bool>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(None) };
        match value.kind {
            Kind::Boolean(flag) => Ok(Some(flag)),
            _ => Err(self.unexpected(key, value, "true or false")),
        }
    }

    /// One of a few words, each with what it stands for.
    pub fn choice<T: Clone>(&self, key: &str, choices: &[(&str, T)]) -> Result<Option<T>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(None) };
        choices
            .iter()
            .find(|(word, _)| matches!(&value.kind, Kind::Text(found) if found == word))
            .map(|(_, meaning)| Some(meaning.clone()))
            .ok_or_else(|| {
                let words: Vec<String> = choices.iter().map(|(word, _)| (*word).into()).collect();
                let near = match &value.kind {
                    Kind::Text(found) => nearest(found, &words),
                    _ => None,
                };
                let help = near.map_or(String::new(), |near| format!("did you mean \"{near}\"?"));
                self.unexpected_with(key, value, &one_of(choices), &help)
            })
    }

    /// As [`Table::choice`], but it must be there.
    pub fn required_choice<T: Clone>(
        &self,
        key: &str,
        choices: &[(&str, T)],
    ) -> Result<T, Problem> {
        self.choice(key, choices)?.ok_or_else(|| self.missing(key, &one_of(choices)))
    }

    /// A list of numbers, each inside `bounds`, as many as `len` allows.
    pub fn numbers(
        &self,
        key: &str,
        bounds: Bounds,
        len: RangeInclusive<usize>,
    ) -> Result<Option<Vec<f64>>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(None) };
        let expected = format!("a list of {} to {} numbers, each {bounds}", len.start(), len.end());
        let list = match &value.kind {
            Kind::Array(list) if len.contains(&list.len()) => list,
            _ => return Err(self.unexpected(key, value, &expected)),
        };
        list.iter()
            .map(|item| self.read_number(key, item, bounds))
            .collect::<Result<_, _>>()
            .map(Some)
    }

    /// `[low, high]` with `low < high`, both inside `bounds`.
    pub fn interval(&self, key: &str, bounds: Bounds) -> Result<Option<(f64, f64)>, Problem> {
        let Some(pair) = self.numbers(key, bounds, 2..=2)? else { return Ok(None) };
        if pair[0] < pair[1] {
            return Ok(Some((pair[0], pair[1])));
        }
        Err(self.problem(
            key,
            &format!("{} is not below {}", pair[0], pair[1]),
            "[low, high] with low below high",
            "swap the two numbers, or widen the interval",
        ))
    }

    /// As [`Table::interval`], but it must be there.
    pub fn required_interval(&self, key: &str, bounds: Bounds) -> Result<(f64, f64), Problem> {
        self.interval(key, bounds)?
            .ok_or_else(|| self.missing(key, "[low, high] with low below high"))
    }

    /// A table within this one.
    pub fn table(&self, key: &str) -> Result<Option<Table<'d>>, Problem> {
        self.look_up(key).map(|value| self.read_table(key, key, value)).transpose()
    }

    /// As [`Table::table`], but it must be there.
    pub fn required_table(&self, key: &str) -> Result<Table<'d>, Problem> {
        self.table(key)?.ok_or_else(|| self.missing(key, TABLE))
    }

    /// A list of tables (`[[key]]`), empty if the key is absent.
    pub fn tables(&self, key: &str) -> Result<Vec<Table<'d>>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(Vec::new()) };
        let Kind::Array(list) = &value.kind else {
            return Err(self.unexpected(key, value, "a list of tables ([[key]])"));
        };
        list.iter()
            .enumerate()
            .map(|(i, item)| self.read_table(key, &format!("{key}[{i}]"), item))
            .collect()
    }

    /// Whether the key stands in the file. Does not count as asking for it.
    pub fn has(&self, key: &str) -> bool {
        self.entries.get(key).is_some()
    }

    /// Knows the key without reading it: somebody else will.
    pub fn leave(&self, key: &str) {
        self.asked.borrow_mut().push(key.to_owned());
    }

    /// Refuses every key that was not asked for.
    pub fn finish(self) -> Result<(), Problem> {
        let asked = self.asked.borrow();
        let is_asked = |key: &str| asked.iter().any(|known| known == key);
        let Some(unknown) = self.entries.iter().find(|entry| !is_asked(&entry.key)) else {
            return Ok(());
        };
        let help = nearest(&unknown.key, &asked).map_or_else(
            || "remove it, or move it to the table that it belongs to".to_owned(),
            |near| format!("did you mean `{near}`?"),
        );
        let known = if asked.is_empty() {
            "no key here".into()
        } else {
            format!("one of: {}", asked.join(", "))
        };
        let key = self.dotted(&shown(&unknown.key));
        Err(Problem::at(self.source, unknown.key_span.clone(), &key, "unknown key", &known, &help))
    }

    /// A problem at `key`'s value, or at this table where the key is absent: for what only the
    /// reader of this file can know (two keys that contradict each other, say).
    pub fn problem(&self, key: &str, what: &str, expected: &str, help: &str) -> Problem {
        let span =
            self.entries.get(key).map_or_else(|| self.span.clone(), |value| value.span.clone());
        Problem::at(self.source, span, &self.dotted(key), what, expected, help)
    }

    /// The file that this table stands in.
    pub fn source(&self) -> &'d Source {
        self.source
    }

    fn look_up(&self, key: &str) -> Option<&'d Value> {
        self.leave(key);
        self.entries.get(key)
    }

    fn read_number(&self, key: &str, value: &Value, bounds: Bounds) -> Result<f64, Problem> {
        let number = match value.kind {
            Kind::Float(number) => number,
            Kind::Integer(integer) => integer as f64,
            _ => f64::NAN,
        };
        if bounds.contain(number) {
            return Ok(number);
        }
        Err(self.unexpected(key, value, &bounds.to_string()))
    }

    fn read_table(&self, key: &str, name: &str, value: &'d Value) -> Result<Table<'d>, Problem> {
        let Kind::Table(entries) = &value.kind else {
            return Err(self.unexpected(key, value, TABLE));
        };
        Ok(Table::new(self.source, self.dotted(name), value.span.clone(), entries))
    }

    /// That `key` isn't there: at its misspelling where there is one, else at this table.
    pub fn missing(&self, key: &str, expected: &str) -> Problem {
        if let Some(entry) = self.misspelt(key) {
            let expected = format!("`{key}`, {expected}");
            let (found, span) = (self.dotted(&shown(&entry.key)), entry.key_span.clone());
            let help = format!("did you mean `{key}`?");
            return Problem::at(self.source, span, &found, "unknown key", &expected, &help);
        }
        let key_or_table = if expected == TABLE {
            format!("a table `[{}]`", self.dotted(key))
        } else {
            format!("`{key} = ...`")
        };
        let key = self.dotted(key);
        if self.path.is_empty() {
            let help = format!("add {key_or_table}, or is this the wrong file?");
            let whole = self.span.clone();
            return Problem::at(self.source, whole, &key, "missing key", expected, &help)
                .without_place();
        }
        let help = format!("add {key_or_table} here");
        Problem::at(self.source, self.span.clone(), &key, "missing key", expected, &help)
    }

    /// The key, not asked for so far, that is likely to be `key` misspelt. It may yet be asked
    /// for, so the two must differ in one word alone (`_` parts words), and that little; or in
    /// the unit, the last word, or lack the unit. So `y_mm` is not taken for `x_mm`.
    fn misspelt(&self, key: &str) -> Option<&'d Entry> {
        let asked = self.asked.borrow();
        let words: Vec<&str> = key.split('_').collect();
        self.entries.iter().filter(|entry| !asked.contains(&entry.key)).find(|entry| {
            let found: Vec<&str> = entry.key.split('_').collect();
            if let Some((unit, rest)) = words.split_last()
                && UNITS.contains(unit)
                && rest == found
            {
                return true;
            }
            if found.len() != words.len() {
                return false;
            }
            let mut differing = (0..words.len()).filter(|i| words[*i] != found[*i]);
            let (Some(i), None) = (differing.next(), differing.next()) else { return false };
            let is_unit = UNITS.contains(&words[i]) && UNITS.contains(&found[i]);
            let letters = words[i].len().max(found[i].len());
            is_unit || edits(words[i], found[i]) <= letters / WORD_LETTERS_PER_EDIT
        })
    }

    fn unexpected(&self, key: &str, value: &Value, expected: &str) -> Problem {
        self.unexpected_with(key, value, expected, "")
    }

    fn unexpected_with(&self, key: &str, value: &Value, expected: &str, help: &str) -> Problem {
        let span = value.span.clone();
        let found = self.source.text().get(span.clone()).unwrap_or_default();
        let found = shortened(found.lines().next().unwrap_or_default());
        let what = format!("found {} {found}", value.kind.name());
        Problem::at(self.source, span, &self.dotted(key), &what, expected, help)
    }

    fn dotted(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }
}

fn one_of<T>(choices: &[(&str, T)]) -> String {
    let words: Vec<String> = choices.iter().map(|(word, _)| format!("\"{word}\"")).collect();
    format!("one of {}", words.join(", "))
}

/// A key from a file as it would stand there, on one line: in quotes unless it is a bare one.
fn shown(key: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let key = shortened(key);
    if !key.is_empty() && key.chars().all(is_bare) { key } else { format!("{key:?}") }
}

fn shortened(text: &str) -> String {
    text.chars().take(SHOWN_MAX).collect()
}

/// The known word that a person most likely meant, if any is near.
///
/// ```
/// let known = ["shot-noise".to_owned(), "read-noise".to_owned()];
/// assert_eq!(spanned_toml::nearest("shot-nosie", &known), Some(&known[0]));
/// assert_eq!(spanned_toml::nearest("beam", &known), None);
/// ```
pub fn nearest<'a>(word: &str, known: &'a [String]) -> Option<&'a String> {
    if word.len() > SHOWN_MAX {
        return None;
    }
    known
        .iter()
        .map(|candidate| (edits(word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= NEAREST_EDITS_MAX.min(candidate.len() / 2 + 1))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein's distance (1966): insertions, deletions and substitutions of characters.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Document;

    fn document(text: &str) -> Document {
        Document::parse(Source::new("rig.toml", text)).unwrap()
    }

    #[test]
    fn an_unknown_key_names_its_place_and_the_nearest_known_one() {
        let document = document("[detector]\ndistance_mm = 300\ndistence_mm = 3\n");
        let root = document.root();
        let detector = root.required_table("detector").unwrap();
        assert_eq!(detector.required_number("distance_mm", Bounds::POSITIVE), Ok(300.0));
        let problem = detector.finish().unwrap_err();
        assert_eq!(problem.line_and_column(), Some((3, 1)));
        assert_eq!(problem.key(), "detector.distence_mm");
        let text = problem.to_string();
        assert!(text.contains("did you mean `distance_mm`?"), "{text}");
        assert!(text.contains("rig.toml:3:1"), "{text}");
    }

    #[test]
    fn nan_infinity_and_wrong_kinds_are_refused_with_what_was_found() {
        for text in ["v = nan", "v = inf", "v = \"3\"", "v = -1.0", "v = [1]"] {
            let document = document(text);
            let problem = document.root().required_number("v", Bounds::POSITIVE).unwrap_err();
            assert!(problem.to_string().contains("above 0"), "{problem}");
        }
        assert_eq!(document("v = 1_000").root().required_number("v", Bounds::POSITIVE), Ok(1000.0));
    }

    #[test]
    fn a_missing_key_is_reported_at_its_table() {
        let document = document("a = 1\n[link]\nkind = \"serial\"\n");
        let link = document.root().required_table("link").unwrap();
        let problem = link.required_integer("baud", 1..=10).unwrap_err();
        assert_eq!(problem.line_and_column().unwrap().0, 2);
        assert_eq!(problem.what(), "missing key");
    }

    #[test]
    fn a_missing_key_that_is_there_misspelt_is_shown_where_it_stands() {
        for (text, key) in [
            ("[region]\ntheta_mx_deg = 80", "theta_max_deg"),
            ("[region]\ntheta_max_rad = 80", "theta_max_deg"),
            ("[region]\ndwel_ms = 80", "dwell_ms"),
            ("[region]\ntheta_max = 80", "theta_max_deg"),
        ] {
            let document = document(text);
            let region = document.root().required_table("region").unwrap();
            let problem = region.required_number(key, Bounds::POSITIVE).unwrap_err();
            assert_eq!((problem.what(), problem.line_and_column()), ("unknown key", Some((2, 1))));
            assert!(problem.to_string().contains(&format!("did you mean `{key}`?")), "{problem}");
        }
        for other in ["y_mm = 1", "x_count = 1", "phi_step_deg = 3"] {
            let document = document(&format!("[region]\n{other}"));
            let region = document.root().required_table("region").unwrap();
            for key in ["x_mm", "theta_step_deg"] {
                let problem = region.required_number(key, Bounds::POSITIVE).unwrap_err();
                assert_eq!(problem.what(), "missing key", "{problem}");
            }
        }
    }

    #[test]
    fn what_the_file_itself_lacks_has_no_line() {
        let document = document("# A plan.\na = 1\n");
        let problem = document.root().required_table("region").unwrap_err();
        let text = problem.to_string();
        assert!(text.contains("rig.toml: region: missing key"), "{text}");
        assert!(text.contains("add a table `[region]`, or is this the wrong file?"), "{text}");
    }

    #[test]
    fn a_misspelt_word_is_corrected() {
        let document = document("kind = \"rastr\"");
        let problem = document.root().required_choice("kind", &[("raster", 1), ("list", 2)]);
        assert!(problem.unwrap_err().to_string().contains("did you mean \"raster\"?"));
    }

    #[test]
    fn points_are_lists_of_lists_each_refused_where_it_stands() {
        let document = document("a = [[0, 1], [2.5, 3]]\nb = [[0, 1], [2]]\nc = [[0, \"x\"]]");
        let root = document.root();
        let points = |key| root.points(key, Bounds::FINITE, 1..=4, 2..=3);
        assert_eq!(points("a"), Ok(Some(vec![vec![0.0, 1.0], vec![2.5, 3.0]])));
        assert_eq!(points("b").unwrap_err().line_and_column(), Some((2, 14)));
        assert_eq!(points("c").unwrap_err().line_and_column(), Some((3, 10)));
        assert_eq!(points("d"), Ok(None));
    }

    #[test]
    fn intervals_are_in_order() {
        let document = document("travel_deg = [90, -90]");
        let problem = document.root().required_interval("travel_deg", Bounds::FINITE).unwrap_err();
        assert!(problem.to_string().contains("90 is not below -90"), "{problem}");
    }

    #[test]
    fn syntax_errors_have_a_place() {
        let problem = Document::parse(Source::new("plan.toml", "a = 1\nb = = 2\n")).unwrap_err();
        assert_eq!(problem.line_and_column().unwrap().0, 2);
    }
}
