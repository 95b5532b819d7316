//! The arguments that all measurements share.

use std::path::PathBuf;

/// Where results go, and what the document says of their day.
#[derive(Debug, Clone, clap::Args)]
pub struct Arguments {
    /// Replace this measurement's section in a Markdown document, or add it.
    #[arg(long, value_name = "FILE")]
    pub doc: Option<PathBuf>,
    /// Write the raw numbers as CSV.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The day, for the document; nothing here reads a calendar. Needed with --doc.
    #[arg(long, value_name = "YYYY-MM-DD")]
    pub date: Option<String>,
    /// What else ran on the machine, for the document.
    #[arg(long, value_name = "TEXT", default_value = "nothing else of note")]
    pub beside: String,
    /// The program under test. Default: the `gonio` that lies beside this one.
    #[arg(long, value_name = "FILE")]
    pub gonio: Option<PathBuf>,
}
