//! Wall time of something that is done again and again: once to warm up, then as often as asked;
//! median and range, never the best alone.

use std::fmt;
use std::time::{Duration, Instant};

use crate::Unmeasured;

/// Wall seconds of several repeats.
#[derive(Debug, Clone)]
pub struct Spread(Vec<f64>);

impl Spread {
    /// Of at least one number; none of them NaN.
    pub fn of(mut seconds: Vec<f64>) -> Self {
        assert!(!seconds.is_empty(), "a spread of nothing");
        seconds.sort_by(f64::total_cmp);
        Self(seconds)
    }

    /// Half are no larger.
    pub fn median(&self) -> f64 {
        let middle = self.0.len() / 2;
        if self.0.len() % 2 == 1 {
            self.0[middle]
        } else {
            f64::midpoint(self.0[middle - 1], self.0[middle])
        }
    }

    /// This part of them is no larger.
    pub fn quantile(&self, part: f64) -> f64 {
        let last = self.0.len() - 1;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the list
        let place = (part.clamp(0.0, 1.0) * last as f64).round() as usize;
        self.0[place]
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        let (low, high) = (self.quantile(0.0), self.quantile(1.0));
        write!(f, "{:.digits$} ({low:.digits$} to {high:.digits$})", self.median())
    }
}

/// Does it once unwatched, then `times` times (at least once) with the watch in hand. What the
/// watched thing hands back is the time that it took.
pub fn repeat(
    times: usize,
    mut act: impl FnMut() -> Result<Duration, Unmeasured>,
) -> Result<Spread, Unmeasured> {
    let [spread] = repeat_together(times, || Ok([act()?]))?;
    Ok(spread)
}

/// As [`repeat`], of several things that take turns.
pub fn repeat_together<const N: usize>(
    times: usize,
    mut act: impl FnMut() -> Result<[Duration; N], Unmeasured>,
) -> Result<[Spread; N], Unmeasured> {
    act()?;
    let mut seconds: [Vec<f64>; N] = std::array::from_fn(|_| Vec::new());
    for _ in 0..times.max(1) {
        for (list, took) in seconds.iter_mut().zip(act()?) {
            list.push(took.as_secs_f64());
        }
    }
    Ok(seconds.map(Spread::of))
}

/// The time that something takes, and what it answers.
pub fn timed<T>(act: impl FnOnce() -> Result<T, Unmeasured>) -> Result<(Duration, T), Unmeasured> {
    let began = Instant::now();
    let answer = act()?;
    Ok((began.elapsed(), answer))
}

/// Nanoseconds of one call of something quick: the median of 31 batches of at least 0.1 ms each, in
/// the processor time of this thread, in which another program's turn on the core does not count.
pub fn call_ns<T>(act: impl FnMut() -> T) -> f64 {
    call_ns_in(31, act)
}

/// The same from another number of batches.
pub fn call_ns_in<T>(batches: usize, mut act: impl FnMut() -> T) -> f64 {
    let mut act = || {
        act();
    };
    1e9 * gonio::cli::stopwatch::call_s(batches, &mut act)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_states_its_median_and_its_ends() {
        assert_eq!(Spread::of(vec![3.0, 1.0, 2.0]).to_string(), "2.00 (1.00 to 3.00)");
        assert_eq!(format!("{:.1}", Spread::of(vec![4.0, 1.0])), "2.5 (1.0 to 4.0)");
    }
}
