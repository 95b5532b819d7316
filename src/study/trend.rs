//! How an uncertainty goes on to fall with rig time: what all readings share stays, and so does what the
//! fit's functions can't follow; what is independent from reading to reading falls as the square root of
//! the time. It holds while more time means more readings of the same kind. It does not know what other
//! poses or functions would bring.

/// A relative standard uncertainty and the rig time that it took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// Rig time so far, seconds.
    pub rig_s: f64,
    /// The part that more readings of the same kind leave as it is.
    pub lasting: f64,
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
    /// Never by more time: what lasts is more than that.
    Never,
}

impl Trend {
    /// Of an estimate without truncation; `None` of what is not above zero, which has no relative
    /// uncertainty.
    pub fn of(rig_s: f64, estimate: &fit::Estimate) -> Option<Self> {
        Self::beside(rig_s, estimate, 0.0)
    }

    /// Of a fit's exitance.
    pub fn of_exitance(rig_s: f64, fit: &fit::Fit) -> Option<Self> {
        let rows = fit.contributions();
        let lasts = |name: &str| name == fit::TRUNCATION || name == fit::EXTRAPOLATION;
        let lasting = rows.iter().filter(|row| lasts(&row.name)).map(|row| row.u);
        Self::beside(rig_s, &fit.exitance(), lasting.fold(0.0, libm::hypot))
    }

    /// With a part of the independent u that more readings do not lessen.
    fn beside(rig_s: f64, estimate: &fit::Estimate, lasting: f64) -> Option<Self> {
        let fit::Estimate { value, u, u_independent } = *estimate;
        let rest = |whole: f64, part: f64| libm::sqrt((whole * whole - part * part).max(0.0));
        let independent = rest(u_independent, lasting);
        (value > 0.0).then(|| Self {
            rig_s,
            lasting: rest(u, independent) / value,
            independent: independent / value,
        })
    }

    /// So far.
    pub fn u(&self) -> f64 {
        self.after(1.0)
    }

    /// After this many times the rig time.
    pub fn after(&self, factor: f64) -> f64 {
        libm::hypot(self.lasting, self.independent / libm::sqrt(factor))
    }

    /// When it will be no more than a target.
    pub fn reach(&self, target: f64) -> Reach {
        if self.u() <= target {
            Reach::Met
        } else if self.lasting >= target {
            Reach::Never
        } else {
            let room = target * target - self.lasting * self.lasting;
            Reach::At(self.rig_s * self.independent * self.independent / room)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_independent_part_alone_falls() {
        let trend = Trend { rig_s: 100.0, lasting: 0.003, independent: 0.004 };
        assert!((trend.u() - 0.005).abs() < 1e-15);
        assert!((trend.after(4.0) - libm::hypot(0.003, 0.002)).abs() < 1e-15);
        assert_eq!(trend.reach(0.005), Reach::Met);
        assert_eq!(trend.reach(0.003), Reach::Never);
        let Reach::At(seconds) = trend.reach(libm::hypot(0.003, 0.002)) else { panic!("in time") };
        assert!((seconds - 400.0).abs() < 1e-9);
    }

    #[test]
    fn what_the_functions_miss_lasts_as_what_is_shared_does() {
        // u² = 12² + 3² + 4², of which 12 is shared and 3 is truncation.
        let estimate = fit::Estimate { value: 1000.0, u: 13.0, u_independent: 5.0 };
        let trend = Trend::beside(60.0, &estimate, 3.0).expect("above zero");
        assert!((trend.lasting - libm::hypot(0.012, 0.003)).abs() < 1e-15);
        assert!((trend.independent - 0.004).abs() < 1e-15);
        assert!((trend.u() - 0.013).abs() < 1e-15);
    }
}
