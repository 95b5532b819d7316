//! Run time from the device's wrapping ticks: microseconds since the session began, whatever
//! pauses and restarts lie between.
//!
//! The host's clock only says how many times the ticks wrapped in between; it is handed in.

use std::time::Duration;

use firmware_protocol::{Instant, Tick};

/// How often ticks wrap, microseconds.
const WRAP_US: i64 = 1 << 32;

/// See the module.
#[derive(Debug, Clone, Default)]
pub(super) struct RunClock {
    last: Option<(Tick, i64, Instant)>,
}

impl RunClock {
    /// The time of `tick`, which the host hears of at `now`, microseconds since the first call.
    pub(super) fn micros(&mut self, tick: Tick, now: Instant) -> i64 {
        let Some((last, micros, heard)) = self.last else {
            self.last = Some((tick, 0, now));
            return 0;
        };
        let ahead = i64::from(tick.micros_since(last));
        let behind = elapsed_us(heard, now) - ahead;
        // To the nearest whole number of wraps; between two events none, nearly always.
        let wraps = (behind + WRAP_US / 2).div_euclid(WRAP_US);
        let at = micros + ahead + wraps * WRAP_US;
        if at > micros {
            self.last = Some((tick, at, now));
        }
        at
    }

    /// The time when nobody has heard of a tick: it goes on by the host's clock since the last one.
    pub(super) fn now(&self, now: Instant) -> i64 {
        self.last.map_or(0, |(_, micros, heard)| micros + elapsed_us(heard, now))
    }

    /// The device's clock began anew, and reads `tick` now: time goes on by the host's clock.
    pub(super) fn restart(&mut self, tick: Tick, now: Instant) {
        self.last = Some((tick, self.now(now), now));
    }
}

fn elapsed_us(from: Instant, to: Instant) -> i64 {
    let elapsed: Duration = to.since(from);
    i64::try_from(elapsed.as_micros()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(us: u64) -> Instant {
        Instant::from_micros(us)
    }

    #[test]
    fn time_starts_at_zero_and_follows_the_device_not_the_host() {
        let mut clock = RunClock::default();
        assert_eq!(clock.micros(Tick(500), at(0)), 0);
        assert_eq!(clock.micros(Tick(1500), at(4000)), 1000);
        assert_eq!(clock.micros(Tick(1400), at(4000)), 900);
        assert_eq!(clock.micros(Tick(2500), at(5000)), 2000);
    }

    #[test]
    fn between_two_ticks_the_hosts_clock_goes_on() {
        let mut clock = RunClock::default();
        assert_eq!(clock.now(at(9000)), 0);
        clock.micros(Tick(500), at(0));
        clock.micros(Tick(1500), at(1200));
        assert_eq!(clock.now(at(3200)), 3000);
    }

    #[test]
    fn a_pause_of_many_wraps_is_counted_by_the_hosts_clock() {
        let mut clock = RunClock::default();
        clock.micros(Tick(7), at(0));
        // Ten hours, as the device counts them, and as a host a second off does.
        let ten_hours = 36_000_000_000_u64;
        let tick = Instant::from_micros(ten_hours + 7).tick();
        assert_eq!(clock.micros(tick, at(ten_hours + 1_000_000)), 36_000_000_000);
    }

    #[test]
    fn a_restart_goes_on_where_the_host_is() {
        let mut clock = RunClock::default();
        clock.micros(Tick(0), at(0));
        clock.micros(Tick(1_000_000), at(1_000_000));
        clock.restart(Tick(42), at(3_000_000));
        assert_eq!(clock.micros(Tick(142), at(3_000_100)), 3_000_100);
    }
}
