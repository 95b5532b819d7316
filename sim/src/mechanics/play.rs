//! Backlash: a load that its drive moves only where their play is used up.

/// The play operator (Krasnosel'skii, Pokrovskii 1989, section 2): the load stays while it is
/// within half the play of the drive, and is dragged along beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Play {
    half_counts: f64,
    /// By how much the load is ahead of the drive, counts.
    ahead_counts: f64,
}

impl Play {
    /// The drive in the middle of the play.
    pub(super) const fn new(width_counts: f64) -> Self {
        Self { half_counts: width_counts / 2.0, ahead_counts: 0.0 }
    }

    /// The drive has moved.
    pub(super) const fn drive(&mut self, by_counts: f64) {
        let ahead = self.ahead_counts - by_counts;
        self.ahead_counts = ahead.clamp(-self.half_counts, self.half_counts);
    }

    pub(super) const fn ahead_counts(&self) -> f64 {
        self.ahead_counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_load_stays_until_the_play_is_used_up() {
        let mut play = Play::new(4.0);
        let mut drive = 0.0;
        let mut load_after = |by: f64| {
            drive += by;
            play.drive(by);
            drive + play.ahead_counts()
        };
        let loads = [1.0, 1.0, 5.0, -3.0, -1.0, -4.0, 2.0].map(&mut load_after);
        assert_eq!(
            loads.map(f64::to_bits),
            [0.0, 0.0, 5.0, 5.0, 5.0, 1.0, 1.0_f64].map(f64::to_bits)
        );
    }

    #[test]
    fn far_moves_leave_it_half_the_play_behind_on_either_side() {
        let mut play = Play::new(4.0);
        play.drive(1000.0);
        assert_eq!(play.ahead_counts().to_bits(), (-2.0_f64).to_bits());
        play.drive(-1000.0);
        assert_eq!(play.ahead_counts().to_bits(), 2.0_f64.to_bits());
    }
}
