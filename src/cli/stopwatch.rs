//! Time of something quick, by doing it again and again. It does not know what.

/// Seconds of one call: the median of so many batches of at least 0.1 ms each, in the processor time of
/// this thread, in which another program's turn on the core does not count.
pub fn call_s(batches: usize, act: &mut dyn FnMut()) -> f64 {
    const BATCH_S: f64 = 1e-4;
    let mut batch = |calls: u32| {
        let began = processor_s();
        for _ in 0..calls {
            act();
        }
        processor_s() - began
    };
    let mut calls = 1;
    while batch(calls) < BATCH_S && calls < 1 << 24 {
        calls *= 2;
    }
    let mut seconds: Vec<f64> = (0..batches.max(1)).map(|_| batch(calls)).collect();
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2] / f64::from(calls)
}

/// What this thread has had of a processor.
fn processor_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twice_the_work_takes_about_twice_the_time() {
        let time = |n: u32| {
            call_s(31, &mut || {
                std::hint::black_box(
                    (0..std::hint::black_box(n)).map(|i| f64::from(i).sqrt()).sum::<f64>(),
                );
            })
        };
        let (one, two) = (time(10_000), time(20_000));
        assert!((1.5..2.7).contains(&(two / one)), "{one} s, {two} s");
    }
}
