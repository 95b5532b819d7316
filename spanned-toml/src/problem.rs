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
