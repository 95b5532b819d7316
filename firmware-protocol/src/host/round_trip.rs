//! How long to wait for an answer: the smoothed round trip of RFC 6298 (Jacobson 1988), plus the
//! time that the bytes take on the wire.

use core::time::Duration;

/// The shortest patience, wire time not included.
const RTO_MIN: Duration = Duration::from_millis(25);
/// Before anything was measured: a board that has just booted is slow.
const RTO_FIRST: Duration = Duration::from_millis(100);
/// The longest patience.
const RTO_MAX: Duration = Duration::from_secs(2);
/// Doubling further would only overflow: the longest patience is reached before.
const DOUBLINGS_MAX: u32 = 16;
/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// The estimate of the round trip.
#[derive(Debug, Clone)]
pub(super) struct RoundTrip {
    baud: u32,
    smoothed: Option<(Duration, Duration)>,
    /// Time-outs since the last sample: each doubles the patience.
    doublings: u32,
}

impl RoundTrip {
    pub(super) fn new(baud: u32) -> Self {
        Self { baud: baud.max(1), smoothed: None, doublings: 0 }
    }

    /// SRTT.
    pub(super) fn smoothed(&self) -> Option<Duration> {
        self.smoothed.map(|(srtt, _)| srtt)
    }

    /// A round trip of a request that was sent once (Karn and Partridge 1987: a request that was
    /// sent again has no round trip that could be told).
    pub(super) fn sample(&mut self, round_trip: Duration) {
        self.doublings = 0;
        self.smoothed = Some(match self.smoothed {
            None => (round_trip, round_trip / 2),
            Some((srtt, var)) => {
                ((srtt * 7 + round_trip) / 8, (var * 3 + srtt.abs_diff(round_trip)) / 4)
            }
        });
    }

    /// Nobody answered in time.
    pub(super) fn timed_out(&mut self) {
        self.doublings = self.doublings.saturating_add(1);
    }

    /// A new session starts without doublings.
    pub(super) fn forget_time_outs(&mut self) {
        self.doublings = 0;
    }

    /// For a request in the window: [`Self::patience_after`] the time-outs since a sample.
    pub(super) fn patience(&self, bytes: usize) -> Duration {
        self.patience_after(self.doublings, bytes)
    }

    /// max(25 ms, SRTT + 4 RTTVAR) and the time of `bytes` on the wire, doubled at every
    /// time-out.
    pub(super) fn patience_after(&self, time_outs: u32, bytes: usize) -> Duration {
        let quiet = self.smoothed.map_or(RTO_FIRST, |(srtt, var)| RTO_MIN.max(srtt + var * 4));
        ((quiet + self.wire_time(bytes)) * (1 << time_outs.min(DOUBLINGS_MAX))).min(RTO_MAX)
    }

    fn wire_time(&self, bytes: usize) -> Duration {
        Duration::from_micros(bytes as u64 * BITS_PER_BYTE * 1_000_000 / u64::from(self.baud))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn the_estimate_follows_rfc_6298() {
        let mut trip = RoundTrip::new(1_000_000);
        trip.sample(MS * 80);
        assert_eq!(trip.smoothed, Some((MS * 80, MS * 40)));
        trip.sample(MS * 160);
        // SRTT = 7/8·80 + 1/8·160, RTTVAR = 3/4·40 + 1/4·|80 - 160|.
        assert_eq!(trip.smoothed, Some((MS * 90, MS * 50)));
        assert_eq!(trip.patience(0), MS * 290);
    }

    #[test]
    fn patience_is_at_least_25_ms_and_the_wire_time() {
        let mut trip = RoundTrip::new(115_200);
        trip.sample(Duration::from_micros(10));
        // 1152 bytes of ten bits at 115200 baud take 100 ms.
        assert_eq!(trip.patience(1152), MS * 125);
    }

    #[test]
    fn a_time_out_doubles_until_the_next_sample() {
        let mut trip = RoundTrip::new(1_000_000);
        trip.sample(MS);
        trip.timed_out();
        trip.timed_out();
        assert_eq!(trip.patience(0), MS * 100);
        trip.sample(MS);
        assert_eq!(trip.patience(0), MS * 25);
    }
}
