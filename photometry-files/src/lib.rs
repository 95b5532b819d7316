//! photometry-files
