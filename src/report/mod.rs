//! Pictures of what was measured, and the page that holds them. They do not know where the numbers
//! came from: they are handed numbers, words and functions of direction.

mod bars;
mod chart;
mod colour;
mod frontier;
mod hemisphere;
mod page;
mod panels;
mod plane;
mod polar;
mod raster;
mod scores;
mod sphere;
mod svg;
mod ticks;

pub use bars::Budget;
pub use chart::{Chart, INK, Series, Stroke};
pub use frontier::frontier_pictures;
pub use hemisphere::Hemisphere;
pub use page::{Report, Section, Table};
pub use panels::{Curve, FLOOR, Panel, error_against_time};
pub use plane::Plane;
pub use polar::Polar;
pub use scores::{Cells, scores_svg};
pub use sphere::Sphere;
pub use svg::Picture;
pub use ticks::significant;
