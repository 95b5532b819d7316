//! Many independent things at once, on as many threads as the machine has, with a bar for a terminal.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget};

/// Answers in the entries' order; `None` where a thread came to grief.
pub(super) fn in_parallel<E: Sync, T: Send>(
    entries: &[E],
    one: impl Fn(&E) -> T + Sync,
) -> Vec<Option<T>> {
    let bar = ProgressBar::with_draw_target(
        Some(entries.len() as u64),
        ProgressDrawTarget::stderr_with_hz(5),
    );
    let next = AtomicUsize::new(0);
    let slots: Vec<Mutex<Option<T>>> = entries.iter().map(|_| Mutex::new(None)).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads.min(entries.len()) {
            scope.spawn(|| {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(entry) = entries.get(place) else { break };
                    let answer = one(entry);
                    bar.inc(1);
                    if let Ok(mut slot) = slots[place].lock() {
                        *slot = Some(answer);
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    slots.into_iter().map(|slot| slot.into_inner().ok().flatten()).collect()
}
