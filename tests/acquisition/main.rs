//! Driver, engine and owner of a rig, end to end over the real protocol in virtual time.

mod bench;
mod board;
mod course;
mod driver;
mod engine;
mod resume;
