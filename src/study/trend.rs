//! How an uncertainty goes on to fall with rig time: what all readings share stays, what is independent
//! from reading to reading falls as the square root of the time. It holds while more time means more
//! readings of the same kind, and misfit does not rule.

/// A relative standard uncertainty and the rig time that it took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// Rig time so far, seconds.
    pub rig_s: f64,
    /// The part that all readings share.
    pub shared: f64,
    /// The part that is independent from reading to reading.
    pub independent: f64,
}

/// When a target will be met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
    /// It is.
    Met,
    /// After so much rig time in all, seconds.
    At(f64),
    /// Never by more time: what all readings share is more than that.
    Never,
}

impl Trend {
    /// Of an estimate; `None` of what is not above zero, which has no relative uncertainty.
    pub fn of(rig_s: f64, estimate: &fit::Estimate) -> Option<Self> {
        let fit::Estimate { value, u, u_independent } = *estimate;
        let shared = libm::sqrt((u * u - u_independent * u_independent).max(0.0));
        (value > 0.0).then(|| Self {
            rig_s,
            shared: shared / value,
            independent: u_independent / value,
        })
    }

    /// So far.
    pub fn u(&self) -> f64 {
        self.after(1.0)
    }

    /// After this many times the rig time.
    pub fn after(&self, factor: f64) -> f64 {
        libm::hypot(self.shared, self.independent / libm::sqrt(factor))
    }

    /// When it will be no more than a target.
    pub fn reach(&self, target: f64) -> Reach {
        if self.u() <= target {
            Reach::Met
        } else if self.shared >= target {
            Reach::Never
        } else {
            let room = target * target - self.shared * self.shared;
            Reach::At(self.rig_s * self.independent * self.independent / room)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_independent_part_alone_falls() {
        let trend = Trend { rig_s: 100.0, shared: 0.003, independent: 0.004 };
        assert!((trend.u() - 0.005).abs() < 1e-15);
        assert!((trend.after(4.0) - libm::hypot(0.003, 0.002)).abs() < 1e-15);
        assert_eq!(trend.reach(0.005), Reach::Met);
        assert_eq!(trend.reach(0.003), Reach::Never);
        let Reach::At(seconds) = trend.reach(libm::hypot(0.003, 0.002)) else { panic!("in time") };
        assert!((seconds - 400.0).abs() < 1e-9);
    }
}
