//! Many independent things at once, on as many threads as the machine has, with a bar for a terminal.
//! It does not know what they are.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget};

/// Answers in the entries' order; `None` where one panicked, of which standard error says more. The
/// others are not disturbed.
pub(crate) fn in_parallel<E: Sync, T: Send>(
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
                    // What it had its hands on is its own, or nobody's: nothing of it is looked at.
                    let answer = catch_unwind(AssertUnwindSafe(|| one(entry))).ok();
                    bar.inc(1);
                    if let Ok(mut slot) = slots[place].lock() {
                        *slot = answer;
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    slots.into_iter().map(|slot| slot.into_inner().ok().flatten()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_keep_their_order_and_one_that_panics_takes_no_other_along() {
        let entries: Vec<u32> = (0..100).collect();
        let done = in_parallel(&entries, |n| {
            assert!(n % 10 != 3, "meant");
            2 * n
        });
        let expected: Vec<Option<u32>> =
            entries.iter().map(|n| (n % 10 != 3).then_some(2 * n)).collect();
        assert_eq!(done, expected);
    }
}
