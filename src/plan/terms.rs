//! The terms of a plan: what its file states, in SI units and radians.
//!
//! Nothing here knows how the file looks, or whether a rig can do what it asks.

use std::time::Duration;

use fit::{Outline, Wish};
use spanned_toml::Document;

use super::{Adaptive, Allocation, Expect, Wanted};
use crate::rig::Pose;

/// A plan as its file states it.
#[derive(Debug, Clone)]
pub struct Plan {
    /// `name`: what to call its runs.
    pub name: Option<String>,
    /// `rig`: a rig file beside the plan, or `"simulated"` for the built-in rig.
    pub rig: Option<String>,
    /// `scene`: a scene file beside the plan, for simulated rigs.
    pub scene: Option<String>,
    /// `[region]`: where the fit shall hold.
    pub region: Region,
    /// `[sample]`: where the sample ends; `None` where the plan does not say.
    pub sample: Option<Outline>,
    /// `[schedule]`: which poses.
    pub schedule: Schedule,
    /// `schedule.order`.
    pub order: Order,
    /// `schedule.repeat`: how often the whole schedule is measured, at least once.
    pub repeat: u32,
    /// `dwell.dwell_ms`: the integration at a target.
    pub dwell: Duration,
    /// `dwell.allocation`: how the targets' dwells differ from it.
    pub allocation: Allocation,
    /// `dwell.gain`: a gain range's name, or "expected"; the rig's first if absent.
    pub gain: Option<String>,
    /// `[dark]`.
    pub dark: Dark,
    /// `[reference]`.
    pub reference: Reference,
    /// `[warm_up]`.
    pub warm_up: Option<WarmUp>,
    /// `[stop]`.
    pub stop: Stop,
    /// `[expect]`.
    pub expect: Expect,
    /// `[fit]`.
    pub fit: Wish,
    /// `[[derive]]`: what shall be derived from the fit.
    pub derive: Vec<Wanted>,
    pub(super) document: Document,
}

/// A part of the sample and of the directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// From and to, metres.
    pub x_m: (f64, f64),
    /// From and to, metres.
    pub y_m: (f64, f64),
    /// From the normal to here, radians.
    pub theta_max_rad: f64,
}

/// Which poses are the targets.
#[derive(Debug, Clone, PartialEq)]
pub enum Schedule {
    /// Sweeps that the readings so far decide upon.
    Adaptive(Adaptive),
    /// C-planes and γ: γ = θ, C = -φ modulo 360°.
    CGamma {
        /// Columns of places on the sample.
        x_count: u32,
        /// Rows.
        y_count: u32,
        /// Between planes, degrees.
        c_step_deg: f64,
        /// Within a plane, degrees.
        gamma_step_deg: f64,
    },
    /// The poses of a CSV file beside the plan.
    List {
        /// Its path.
        file: String,
    },
    /// Points that fill the region evenly, however many there are.
    LowDiscrepancy {
        /// How many.
        count: u32,
    },
    /// The nodes of a product rule for the exitance: Gauss-Legendre's in x, y and sin²θ, evenly
    /// spaced meridians.
    Quadrature {
        /// Columns of places on the sample.
        x_count: u32,
        /// Rows.
        y_count: u32,
        /// Circles of latitude.
        theta_count: u32,
        /// Meridians.
        phi_count: u32,
    },
    /// A grid in x, y, θ and φ.
    Raster {
        /// Columns of places on the sample.
        x_count: u32,
        /// Rows.
        y_count: u32,
        /// Between circles of latitude, degrees.
        theta_step_deg: f64,
        /// Between meridians, degrees.
        phi_step_deg: f64,
    },
    /// Turns of the table while the arm rises from each to the next, readings taken in flight.
    Spiral {
        /// Columns of places on the sample.
        x_count: u32,
        /// Rows.
        y_count: u32,
        /// Between turns, degrees, at most.
        theta_step_deg: f64,
        /// Whether the turns are dealt out over the places, each flown at one of them alone; otherwise
        /// all are flown at every place.
        is_interleaved: bool,
        /// Full width at half maximum of the narrowest feature that is looked for, degrees.
        narrowest_feature_deg: f64,
    },
    /// Sweeps of the arm along meridians, readings taken in flight.
    Sweep {
        /// Columns of places on the sample.
        x_count: u32,
        /// Rows.
        y_count: u32,
        /// Between meridians, degrees.
        phi_step_deg: f64,
        /// Whether the meridians are dealt out over the places, each flown at one of them alone;
        /// otherwise all are flown at every place.
        is_interleaved: bool,
        /// The arm's speed, degrees a second; as fast as the narrowest feature bears if absent.
        speed_deg_per_s: Option<f64>,
        /// Full width at half maximum of the narrowest feature that is looked for, degrees.
        narrowest_feature_deg: Option<f64>,
    },
}

/// The order of the visits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// As the schedule lists them.
    Listed,
    /// So that the axes travel little.
    Travel,
}

/// Dark readings: one at the start, one at the end, and some between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dark {
    /// Targets from one to the next.
    pub every: u32,
    /// The integration.
    pub dwell: Duration,
    /// What dark means.
    pub method: DarkMethod,
}

/// What dark means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DarkMethod {
    /// The detector's shutter is closed.
    Shutter,
    /// A person switches the source off.
    SourceOff,
}

/// A pose that is measured again and again: at the start, at the end, and between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// Where.
    pub pose: Pose,
    /// Targets from one to the next.
    pub every: u32,
    /// The integration.
    pub dwell: Duration,
}

/// Waiting until the source is stable, at the reference pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarmUp {
    /// The readings' spread, highest less lowest over their mean, that counts as stable; of raw
    /// counts, dark included.
    pub tolerance_relative: f64,
    /// Over this time.
    pub over: Duration,
    /// After this time without it, the run is given up.
    pub timeout: Duration,
}

/// When to stop before all targets are measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stop {
    /// Once the exitance's combined relative standard uncertainty is no more than this.
    pub exitance_relative: Option<f64>,
    /// So that the rig has worked no longer than this.
    pub rig_time_max: Option<Duration>,
}

impl Plan {
    /// The file that it was read from.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// The terms of a schedule that readings decide upon; `None` for those that are fixed beforehand.
    pub fn adaptive(&self) -> Option<&Adaptive> {
        match &self.schedule {
            Schedule::Adaptive(adaptive) => Some(adaptive),
            _ => None,
        }
    }

    /// The CSV of poses that the schedule refers to, as the plan names it.
    pub fn list_file(&self) -> Option<&str> {
        match &self.schedule {
            Schedule::List { file } => Some(file),
            _ => None,
        }
    }
}
