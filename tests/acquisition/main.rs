//! Driver, engine and owner of a rig, end to end over the real protocol in virtual time.

mod board;
mod driver;
