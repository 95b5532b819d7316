//! The parsed tree: every key and value with its place in the text.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

#[derive(Debug, Clone)]
pub(crate) struct Value {
    pub(crate) span: Range<usize>,
    pub(crate) kind: Kind,
}

#[derive(Debug, Clone)]
pub(crate) enum Kind {
    Array(Vec<Value>),
    Boolean(bool),
    Datetime,
    Float(f64),
    Integer(i64),
    Table(Entries),
    Text(String),
    /// An integer that no i64 holds.
    TooLarge,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Entries(Vec<Entry>);

#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub(crate) key: String,
    pub(crate) key_span: Range<usize>,
    pub(crate) value: Value,
}

impl Entries {
    pub(crate) fn get(&self, key: &str) -> Option<&Value> {
        self.iter().find(|entry| entry.key == key).map(|entry| &entry.value)
    }

    /// In the order of the file, so that the first problem is the one reported.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Entry> {
        self.0.iter()
    }
}

impl From<&DeTable<'_>> for Entries {
    fn from(table: &DeTable<'_>) -> Self {
        let mut entries: Vec<Entry> = table
            .iter()
            .map(|(key, value)| Entry {
                key: key.get_ref().to_string(),
                key_span: key.span(),
                value: value.into(),
            })
            .collect();
        entries.sort_by_key(|entry| entry.key_span.start);
        Self(entries)
    }
}

impl From<&Spanned<DeValue<'_>>> for Value {
    fn from(value: &Spanned<DeValue<'_>>) -> Self {
        let kind = match value.get_ref() {
            DeValue::Array(items) => Kind::Array(items.iter().map(Self::from).collect()),
            DeValue::Boolean(flag) => Kind::Boolean(*flag),
            DeValue::Datetime(_) => Kind::Datetime,
            DeValue::Float(float) => float.as_str().parse().map_or(Kind::TooLarge, Kind::Float),
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .map_or(Kind::TooLarge, Kind::Integer),
            DeValue::String(text) => Kind::Text(text.to_string()),
            DeValue::Table(table) => Kind::Table(table.into()),
        };
        Self { span: value.span(), kind }
    }
}

impl Kind {
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Array(_) => "the list",
            Self::Boolean(_) => "the boolean",
            Self::Datetime => "the date",
            Self::Float(_) => "the number",
            Self::Integer(_) | Self::TooLarge => "the integer",
            Self::Table(_) => "a table",
            Self::Text(_) => "the text",
        }
    }
}
