//! Ctrl-C and SIGTERM for commands that are made of many pieces, most of the time deep in arithmetic
//! that hears nothing: they end at once, whatever is under way.

use super::failure::Failure;
use super::simulated::StopSignals;

/// From now on either signal cleans up, says `text`, and ends the process with exit code 1: it ran,
/// but not to its end. What is under way is lost; what is to be kept must be whole on the disk at any
/// moment.
pub(crate) fn ends_when_stopped(
    clean: impl FnOnce() + Send + 'static,
    text: String,
) -> Result<(), Failure> {
    let no_signals = |error: std::io::Error| Failure::start(format!("signals: {error}"));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(no_signals)?;
    // Before anything is begun, so that no signal finds nobody.
    let mut stop = runtime.block_on(async { StopSignals::new() }).map_err(no_signals)?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            runtime.block_on(stop.next());
            clean();
            let _ = Failure::midway(text).report();
            std::process::exit(1);
        })
        .map_err(no_signals)?;
    Ok(())
}
