//! What is wrong in a file, where, what was expected, and what to do about it.

use core::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};

use crate::Source;

/// One thing wrong in one file. `Display` shows the place in its line, as compilers do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem(Box<Details>);

#[derive(Debug, Clone, PartialEq, Eq)]
struct Details {
    source: Source,
    span: Option<Range<usize>>,
    key: String,
    what: String,
    expected: String,
    help: String,
}

impl Problem {
    /// A problem with a place in the file. `key` is the dotted path, empty if there is none.
    pub fn at(
        source: &Source,
        span: Range<usize>,
        key: &str,
        what: &str,
        expected: &str,
        help: &str,
    ) -> Self {
        let end = source.text().len();
        let span = span.start.min(end)..span.end.min(end);
        Self(Box::new(Details {
            source: source.clone(),
            span: Some(span),
            key: key.into(),
            what: what.into(),
            expected: expected.into(),
            help: help.into(),
        }))
    }

    /// A problem with a file as a whole.
    pub fn of_file(source: &Source, what: &str, expected: &str, help: &str) -> Self {
        Self::at(source, 0..0, "", what, expected, help).without_place()
    }

    /// The same problem, with the file as a whole.
    pub(crate) fn without_place(mut self) -> Self {
        self.0.span = None;
        self
    }

    /// The file's name.
    pub fn file(&self) -> &str {
        self.0.source.name()
    }

    /// Line and column, both from 1, where there is a place.
    pub fn line_and_column(&self) -> Option<(usize, usize)> {
        self.0.span.as_ref().map(|span| self.0.source.line_and_column(span.start))
    }

    /// The dotted key, empty if there is none.
    pub fn key(&self) -> &str {
        &self.0.key
    }

    /// What is wrong, in one phrase.
    pub fn what(&self) -> &str {
        &self.0.what
    }

    fn title(&self) -> String {
        if self.0.key.is_empty() {
            self.0.what.clone()
        } else {
            format!("{}: {}", self.0.key, self.0.what)
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let title = self.title();
        let expected = format!("expected {}", self.0.expected);
        match &self.0.span {
            None => {
                write!(
                    f,
                    "error: {}: {title}\n  expected: {}",
                    self.0.source.name(),
                    self.0.expected
                )?;
                if self.0.help.is_empty() { Ok(()) } else { write!(f, "\n  help: {}", self.0.help) }
            }
            Some(span) => {
                let snippet = Snippet::source(self.0.source.text())
                    .path(self.0.source.name())
                    .annotation(AnnotationKind::Primary.span(span.clone()).label(&expected));
                let mut group = Level::ERROR.primary_title(&title).element(snippet);
                if !self.0.help.is_empty() {
                    group = group.element(Level::HELP.message(&self.0.help));
                }
                f.write_str(&Renderer::plain().render(&[group]))
            }
        }
    }
}

impl std::error::Error for Problem {}

#[cfg(test)]
mod tests {
    use crate::{Bounds, Document, Source};

    /// What a reader makes of the text: asks for a few keys, refuses the rest.
    fn complaint(text: &str) -> Option<String> {
        let read = || {
            let document = Document::parse(Source::new("file.toml", text))?;
            let root = document.root();
            root.number("a", Bounds::between(0.0, 1.0))?;
            root.text("b")?;
            root.numbers("c", Bounds::between(0.0, 1.0), 1..=2)?;
            if let Some(table) = root.table("t")? {
                table.required_text("x")?;
                table.finish()?;
            }
            for table in root.tables("l")? {
                table.required_number("x", Bounds::between(0.0, 1.0))?;
                table.finish()?;
            }
            root.finish()
        };
        read().err().map(|problem| {
            let place = problem.line_and_column().map_or(String::new(), |at| format!("{at:?}"));
            format!("{place} {problem}")
        })
    }

    #[test]
    fn whatever_is_wrong_can_be_shown() {
        let long = "x".repeat(20_000);
        let texts = [
            String::new(),
            "\n".into(),
            "\u{feff}".into(),
            "\u{feff}a = 2\n".into(),
            "\u{feff}[t".into(),
            "a = 2".into(),
            "a = 2\r\nb = 1\r\n".into(),
            "\r\n\r\na = \"\u{1f4a1}\" # \u{1f4a1}\r\n".into(),
            "a\r= 2".into(),
            "a = 1\n\r".into(),
            "b = \"\"\"\n\n\"\"\"\n".into(),
            "c = [\n  0.5,\n  2,\n]\n".into(),
            "c = [\n\n0,\n1,\n2\n]".into(),
            "\"a.b\" = 1".into(),
            "'\"' = 1".into(),
            "\"\" = 1".into(),
            "\"\\n\" = 1\n".into(),
            "\"\\u0000\\u001b[31m\" = 1\n".into(),
            "a.b.c = 1".into(),
            "t.\"x y\" = 1".into(),
            "[t]\n[t]".into(),
            "[t]".into(),
            "[t]\n".into(),
            "[[l]]\n[[l]]\nx = 0\n".into(),
            "l = [{x = 0}, {}]".into(),
            "t = {".into(),
            "a = \"\\uD800\"".into(),
            "a = 99999999999999999999999999".into(),
            "a = 1e999999999999".into(),
            "a = 0x".into(),
            "a = nan".into(),
            "a = 2020-13-45".into(),
            format!("a = {}", "9".repeat(20_000)),
            format!("b = 1 # {long}"),
            format!("{long} = 1"),
            format!("a = \"{long}\""),
            format!("a = \"{}\"\n", "\u{1f4a1}".repeat(5_000)),
            format!("a = {}1{}", "[".repeat(100_000), "]".repeat(100_000)),
            format!("a = {}", "{a=".repeat(100_000)),
            format!("a{} = 1", ".a".repeat(100_000)),
            format!("[a{}]", ".a".repeat(100_000)),
            "\u{202e}\u{301} = 1".into(),
            "\t\ta = 2".into(),
            "a = 2 \u{0}".into(),
            "a = 1\u{2028}b = 2".into(),
        ];
        for text in texts {
            let Some(shown) = complaint(&text) else { continue };
            assert!(!shown.contains('\u{1b}') && !shown.contains('\0'), "{shown}");
            let title = shown.lines().next().unwrap_or_default();
            assert!(title.chars().count() < 120, "{title}");
        }
    }

    #[test]
    fn keys_are_named_as_they_stand_in_the_file() {
        for (text, title) in [
            ("\"a.b\" = 1", "(1, 1) error: \"a.b\": unknown key"),
            ("t = { x = '1', \"\" = 1 }", "(1, 16) error: t.\"\": unknown key"),
            ("\"\\n\" = 1", "(1, 1) error: \"\\n\": unknown key"),
            ("\u{feff}a = 2\r\n", "(1, 5) error: a: found the integer 2"),
        ] {
            let shown = complaint(text).unwrap();
            assert_eq!(shown.lines().next(), Some(title), "{shown}");
        }
    }

    #[test]
    fn of_a_file_that_is_nearly_empty_nothing_is_wrong_but_what_is_missing() {
        for text in ["", "\n", "\r\n", "\u{feff}", "# nothing"] {
            assert_eq!(complaint(text), None);
            let document = Document::parse(Source::new("file.toml", text)).unwrap();
            let problem = document.root().required_table("t").unwrap_err();
            assert!(problem.to_string().contains("t: missing key"), "{problem}");
        }
    }
}
