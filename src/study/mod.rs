//! Studies of plans and of many runs, the pure part: what a plan is going to know, how good a fit is,
//! which plans to compare, what accuracy costs in time, whether stated uncertainties hold. It is
//! handed what runs found; it does not know clocks or files.

pub mod adaptive;
pub mod arithmetic;
pub mod cost;
pub mod coverage;
mod demand;
mod forecast;
mod frontier;
mod ladder;
mod missed;
mod motion;
mod nodes;
mod parts;
mod prior;
mod rehearsal;
mod score;
mod search;
mod trend;

pub use demand::{Demand, Shortfall};
pub use forecast::{Forecast, ForecastError};
pub use frontier::{
    Coverage, Foretold, ForetoldUncertainty, FrontierPoint, FrontierRow, by_strategy, coverage,
    doubling, points,
};
pub use ladder::{LADDER, Rung};
pub use missed::Truncation;
pub use motion::Motion;
pub use nodes::{Fineness, Nodes};
pub use parts::Budget;
pub use prior::{Feature, Features, Prior};
pub use rehearsal::{Likely, Rehearsed, Stated};
pub use score::{Score, median, percent};
pub use search::{Candidate, Considered, Found, Looked, Search, SearchError};
pub use trend::{Reach, Trend};

/// A small plan with this schedule and this fit.
#[cfg(test)]
fn plan_by(schedule: &str, fit: &str) -> crate::plan::Plan {
    use spanned_toml::{Document, Source};

    let text = format!(
        "[region]\nx_mm = [-1, 1]\ny_mm = [-1, 1]\ntheta_max_deg = 80\n[schedule]\n{schedule}\n\
         [dwell]\ndwell_ms = 50\n[dark]\nmethod = \"shutter\"\n[fit]\n{fit}\n"
    );
    crate::plan::Plan::read(Document::parse(Source::new("plan.toml", &text)).unwrap()).unwrap()
}
