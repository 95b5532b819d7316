//! Where a study puts what it finds, made before it begins. It does not know what is put there.

use std::path::{Path, PathBuf};

use super::kept::stopped;
use crate::cli::failure::Failure;
use crate::cli::folder::refuse_existing;
use crate::cli::halt::ends_when_stopped;
use crate::cli::session::utc_stamp;

/// A study's folder, and the one below it for the journals of its runs.
pub(super) struct Place {
    pub(super) folder: PathBuf,
    pub(super) runs: PathBuf,
}

impl Place {
    /// Makes the cache, if there is to be one, and the folder: `out`, or else the study's name with the time.
    /// From here on the study ends when it is stopped, and takes its folder along.
    pub(super) fn make(
        name: &str,
        out: Option<&Path>,
        cache: Option<&Path>,
    ) -> Result<Self, Failure> {
        let stamped = || PathBuf::from(format!("{name}-{}", utc_stamp()));
        let folder = out.map_or_else(stamped, Path::to_owned);
        refuse_existing(&folder)?;
        let make = |what: &str, made: &Path| {
            std::fs::create_dir_all(made).map_err(|error| {
                Failure::with_help(
                    format!("{what} {}: the folder cannot be made: {error}", made.display()),
                    format!("choose another one with {what}"),
                )
            })
        };
        // First what may have been there before: where it can't be made there is no other folder yet.
        cache.map_or(Ok(()), |cache| make("--cache", cache))?;
        let runs = folder.join("runs");
        make("--out", &runs)?;
        ends_when_stopped(&folder, stopped(cache))?;
        Ok(Self { folder, runs })
    }

    /// All runs are made.
    pub(super) fn clear(&self) {
        // Ours, and empty but for runs that were refused.
        let _ = std::fs::remove_dir_all(&self.runs);
    }
}
