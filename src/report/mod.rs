//! Pictures of what was measured. They do not know where the numbers came from.

mod frontier;

pub use frontier::frontier_svg;
