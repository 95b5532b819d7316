//! The wire from end to end: golden bytes, damaged bytes, and two ends in lock step.

#[path = "../board/mod.rs"]
mod board;
mod device;
mod golden;
mod link;
mod pair;
mod stream;
mod vectors;
