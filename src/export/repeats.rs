//! Lines of a file that stand there twice: each counted, they make u too small.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Remembers lines by a hash of all their fields: of long files the last quarter of a million at least.
#[derive(Debug, Default)]
pub(super) struct Repeats {
    /// The line of each hash, from 1.
    recent: HashMap<u64, u64>,
    before: HashMap<u64, u64>,
}

impl Repeats {
    /// Takes a line in; the earlier line that it repeats in every field, if there is one.
    pub(super) fn note(&mut self, record: &csv::StringRecord, line: u64) -> Option<u64> {
        let mut hasher = DefaultHasher::new();
        record.iter().for_each(|field| field.hash(&mut hasher));
        let hash = hasher.finish();
        if let Some(first) = self.recent.get(&hash).or_else(|| self.before.get(&hash)) {
            return Some(*first);
        }
        if self.recent.len() >= REMEMBERED {
            self.before = std::mem::take(&mut self.recent);
        }
        self.recent.insert(hash, line);
        None
    }
}

/// Lines in each of the two tables: 8 MB or so.
const REMEMBERED: usize = 250_000;
