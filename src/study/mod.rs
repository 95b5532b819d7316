//! Studies of plans and of many runs, the pure part: what a plan is going to know, how good a fit is,
//! which plans to compare, what accuracy costs in time, whether stated uncertainties hold. It is
//! handed what runs found; it does not know clocks or files.

pub mod adaptive;
pub mod cost;
pub mod coverage;
mod demand;
mod forecast;
mod frontier;
mod ladder;
mod nodes;
mod parts;
mod prior;
mod score;
mod search;
mod strategy;
mod trend;

pub use demand::{Demand, Shortfall};
pub use forecast::{Forecast, ForecastError};
pub use frontier::{
    Coverage, Foretold, ForetoldUncertainty, FrontierPoint, FrontierRow, by_strategy, coverage,
    doubling, points,
};
pub use ladder::{LADDER, Rung};
pub use nodes::{Fineness, Nodes};
pub use parts::Budget;
pub use prior::{Feature, Prior};
pub use score::Score;
pub use search::{Candidate, Considered, Found, Search, SearchError};
pub use strategy::Strategy;
pub use trend::{Reach, Trend};
