//! radiometry
