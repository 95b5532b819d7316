//! Ctrl-C and SIGTERM for commands that are made of many pieces, most of the time deep in arithmetic
//! that hears nothing: they end at once, whatever is under way.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::failure::Failure;
use super::simulated::StopSignals;

/// A folder that something is put into is taken away so many times.
const TRIES: u32 = 10;

/// Whoever ends the process has it, and never gives it back.
static LAST_WORD: Mutex<()> = Mutex::new(());

/// Returns where the process is the caller's to end. Where a signal has come first it doesn't return: what
/// was under way has lost its folder, and what it says of that is not what happened.
pub(crate) fn take_last_word() {
    std::mem::forget(LAST_WORD.lock().unwrap_or_else(PoisonError::into_inner));
}

/// From now on either signal takes `folder` away, which was made for what is under way, says `text`, and
/// ends the process with exit code 1: it ran, but not to its end. What is to be kept must be whole on the
/// disk, elsewhere, at any moment.
pub(crate) fn ends_when_stopped(folder: &Path, text: String) -> Result<(), Failure> {
    let no_signals = |error: std::io::Error| Failure::start(format!("signals: {error}"));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(no_signals)?;
    // Before anything is begun, so that no signal finds nobody.
    let mut stop = runtime.block_on(async { StopSignals::new() }).map_err(no_signals)?;
    let folder = folder.to_owned();
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            runtime.block_on(stop.next());
            take_last_word();
            leave_nothing(&folder);
            let _ = Failure::midway(text).report();
            std::process::exit(1);
        })
        .map_err(no_signals)?;
    Ok(())
}

/// The same command shall find the place as it was.
fn leave_nothing(folder: &Path) {
    // Runs under way may put something there meanwhile.
    for _ in 0..TRIES {
        if std::fs::remove_dir_all(folder).is_ok() || !folder.exists() {
            break;
        }
    }
}
