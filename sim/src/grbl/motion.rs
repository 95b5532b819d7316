//! The motion of a simulated grbl: lines in the machine's space, each from rest to rest, as fast
//! as the slowest axis lets all of them go. It holds and goes on; it knows no words.
//!
//! A real board joins lines at speed where they meet at a blunt angle; this one stops at each.

use firmware_protocol::{Instant, Trapezoid};

/// A line to go.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    /// Machine position at its end, steps.
    pub(super) target: Vec<f64>,
    /// At most so many of its length a second; `None`: as fast as it can.
    pub(super) lengths_per_s: Option<f64>,
}

/// What limits an axis, steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub(super) speed: f64,
    pub(super) acceleration: f64,
}

/// A line that is gone along.
#[derive(Debug, Clone)]
pub(super) struct Leg {
    from: Vec<f64>,
    to: Vec<f64>,
    began: Instant,
    profile: Trapezoid,
    /// Line lengths a second squared.
    acceleration: f64,
    braking: Option<Braking>,
}

#[derive(Debug, Clone, Copy)]
struct Braking {
    began: Instant,
    /// Where on the line, and how fast, in its length.
    at: f64,
    speed: f64,
}

/// Over which a speed is taken, seconds.
const STEP_S: f64 = 1e-6;

impl Leg {
    /// From rest; `None` where there is no way to go.
    pub(super) fn new(
        from: &[f64],
        block: &Block,
        limits: &[Limits],
        now: Instant,
    ) -> Option<Self> {
        let ways = from.iter().zip(&block.target).zip(limits);
        let (mut speed, mut acceleration) = (f64::INFINITY, f64::INFINITY);
        for ((from, to), limits) in ways {
            let way = (to - from).abs();
            if way > 0.0 {
                speed = speed.min(limits.speed / way);
                acceleration = acceleration.min(limits.acceleration / way);
            }
        }
        let speed = block.lengths_per_s.map_or(speed, |most| speed.min(most));
        let profile = Trapezoid::new(1.0, speed, acceleration)?;
        let (from, to) = (from.to_vec(), block.target.clone());
        Some(Self { from, to, began: now, profile, acceleration, braking: None })
    }

    /// How far along the line.
    fn part(&self, now: Instant) -> f64 {
        match self.braking {
            None => self.profile.travelled(now.since(self.began).as_secs_f64()),
            Some(Braking { began, at, speed }) => {
                let t = now.since(began).as_secs_f64().min(speed / self.acceleration);
                (at + t * (speed - 0.5 * self.acceleration * t)).min(1.0)
            }
        }
    }

    /// Where it is.
    pub(super) fn position(&self, now: Instant) -> Vec<f64> {
        let part = self.part(now);
        let between =
            |(from, to): (&f64, &f64)| if part >= 1.0 { *to } else { from + part * (to - from) };
        self.from.iter().zip(&self.to).map(between).collect()
    }

    pub(super) fn target(&self) -> &[f64] {
        &self.to
    }

    /// When it comes to rest.
    pub(super) fn ends_at(&self) -> Instant {
        let (from, seconds) = match self.braking {
            None => (self.began, self.profile.duration_s()),
            Some(Braking { began, speed, .. }) => (began, speed / self.acceleration),
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        Instant::from_micros(from.micros().saturating_add(libm::ceil(seconds * 1e6) as u64))
    }

    /// Brakes as hard as it may.
    pub(super) fn brake(&mut self, now: Instant) {
        if self.braking.is_some() {
            return;
        }
        let elapsed_s = now.since(self.began).as_secs_f64();
        let at = self.profile.travelled(elapsed_s);
        let before = self.profile.travelled(elapsed_s - STEP_S);
        let speed = ((at - before) / STEP_S).max(0.0);
        self.braking = Some(Braking { began: now, at, speed });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: [Limits; 2] = [Limits { speed: 100.0, acceleration: 200.0 }; 2];

    #[test]
    fn axes_go_together_as_fast_as_the_slowest_can() {
        let block = Block { target: vec![100.0, -50.0], lengths_per_s: None };
        let leg = Leg::new(&[0.0, 0.0], &block, &LIMITS, Instant::ZERO).unwrap();
        // 100 steps at 100 a second with 200 a second squared: 1 s and half a second of ramps.
        assert_eq!(leg.ends_at(), Instant::from_micros(1_500_000));
        let halfway = leg.position(Instant::from_micros(750_000));
        assert!((halfway[0] - 50.0).abs() < 1e-9 && (halfway[1] + 25.0).abs() < 1e-9);
        assert_eq!(leg.position(leg.ends_at()), [100.0, -50.0]);
        assert!(
            Leg::new(
                &[1.0, 2.0],
                &Block { target: vec![1.0, 2.0], lengths_per_s: None },
                &LIMITS,
                Instant::ZERO
            )
            .is_none()
        );
    }

    #[test]
    fn a_hold_brakes_within_the_acceleration_and_stays_on_the_line() {
        let block = Block { target: vec![100.0, 0.0], lengths_per_s: None };
        let mut leg = Leg::new(&[0.0, 0.0], &block, &LIMITS, Instant::ZERO).unwrap();
        let now = Instant::from_micros(800_000);
        let before = leg.position(now)[0];
        leg.brake(now);
        // From 100 a second at 200 a second squared: half a second, 25 steps.
        assert!((leg.ends_at().since(now).as_secs_f64() - 0.5).abs() < 1e-3);
        let after = leg.position(leg.ends_at())[0];
        assert!((after - before - 25.0).abs() < 0.01, "{before} {after}");
    }
}
