//! `gonio study`: questions to which only many runs have an answer.

mod cost;
mod coverage;
mod document;
mod kept;
mod place;

pub(crate) use cost::cost;
pub(crate) use coverage::coverage;
