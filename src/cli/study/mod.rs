//! `gonio study`: questions to which only many runs have an answer.

mod coverage;
mod document;

pub(crate) use coverage::coverage;
