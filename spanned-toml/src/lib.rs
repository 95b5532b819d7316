//! TOML files that people write (rig, plan, scene), read strictly: every value is asked for by
//! its key, with its bounds, and every problem knows its file, line and column.
//!
//! The keys that a reader asks for are the keys that exist: [`Table::finish`] refuses all others
//! and names the nearest known one. So a reader is also the only list of its keys.
//!
//! This crate does not know what any file means, and it never changes a value.

mod bounds;
mod problem;
mod source;
mod table;
mod value;

pub use bounds::Bounds;
pub use problem::Problem;
pub use source::{Document, Source};
pub use table::{Table, nearest};
