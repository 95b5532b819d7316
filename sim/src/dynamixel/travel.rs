//! How a servo's setpoint goes to its goal: with a speed and an acceleration at most, from
//! whatever speed it has, which a goal that changes on the way leaves it with.

use firmware_protocol::Instant;

/// A stretch of even acceleration.
#[derive(Debug, Clone, Copy)]
struct Leg {
    lasts_s: f64,
    acceleration: f64,
}

/// A way to a goal, steps and seconds.
#[derive(Debug, Clone)]
pub(super) struct Travel {
    since: Instant,
    from: f64,
    speed: f64,
    legs: Vec<Leg>,
    goal: f64,
}

impl Travel {
    /// From `from`, at `speed` (signed), to `goal`, with at most `speed_max` > 0 and exactly
    /// `acceleration` > 0.
    pub(super) fn new(
        since: Instant,
        (from, speed): (f64, f64),
        goal: f64,
        speed_max: f64,
        acceleration: f64,
    ) -> Self {
        let mut legs = Vec::new();
        let (mut at, mut pace) = (from, speed);
        let way = goal - at;
        let braking = pace * pace.abs() / (2.0 * acceleration);
        let is_away = way * pace < 0.0 || braking.abs() > way.abs() || pace.abs() > speed_max;
        if pace != 0.0 && is_away {
            legs.push(Leg {
                lasts_s: pace.abs() / acceleration,
                acceleration: -acceleration.copysign(pace),
            });
            at += braking;
            pace = 0.0;
        }
        let way = goal - at;
        let (length, pace) = (way.abs(), pace.abs());
        let peak = (acceleration * length + pace * pace / 2.0).sqrt().min(speed_max);
        let ramps = (2.0 * peak * peak - pace * pace) / (2.0 * acceleration);
        let signed = acceleration.copysign(way);
        if length > 0.0 {
            let cruising = if peak > 0.0 { ((length - ramps) / peak).max(0.0) } else { 0.0 };
            legs.push(Leg { lasts_s: (peak - pace) / acceleration, acceleration: signed });
            legs.push(Leg { lasts_s: cruising, acceleration: 0.0 });
            legs.push(Leg { lasts_s: peak / acceleration, acceleration: -signed });
        }
        Self { since, from, speed, legs, goal }
    }

    /// At rest from the start.
    pub(super) fn rest(since: Instant, at: f64) -> Self {
        Self { since, from: at, speed: 0.0, legs: Vec::new(), goal: at }
    }

    /// To rest as fast as may be.
    pub(super) fn braked(&self, now: Instant, acceleration: f64) -> Self {
        let (at, speed) = self.at(now);
        let goal = at + speed * speed.abs() / (2.0 * acceleration);
        Self::new(now, (at, speed), goal, f64::INFINITY, acceleration)
    }

    /// When it is at rest.
    pub(super) fn ends(&self) -> Instant {
        let lasts_s: f64 = self.legs.iter().map(|leg| leg.lasts_s).sum();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // hours at most
        let lasts_us = (lasts_s * 1e6).ceil() as u64;
        Instant::from_micros(self.since.micros() + lasts_us)
    }

    /// Where it goes to.
    pub(super) const fn goal(&self) -> f64 {
        self.goal
    }

    /// Where it is, and how fast.
    pub(super) fn at(&self, now: Instant) -> (f64, f64) {
        if now >= self.ends() {
            return (self.goal, 0.0);
        }
        let mut left_s = now.since(self.since).as_secs_f64();
        let (mut at, mut speed) = (self.from, self.speed);
        for leg in &self.legs {
            let step_s = left_s.min(leg.lasts_s);
            at += (speed + leg.acceleration * step_s / 2.0) * step_s;
            speed += leg.acceleration * step_s;
            left_s -= step_s;
        }
        (at, speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Instant {
        Instant::from_micros(ms * 1000)
    }

    /// Position and speed go on evenly, within what they may, and end at the goal.
    fn check(travel: &Travel, speed_max: f64, acceleration: f64) {
        let (mut at, mut speed) = travel.at(travel.since);
        for i in 1..=20_000 {
            let now = Instant::from_micros(travel.since.micros() + i * 1000);
            let (next, pace) = travel.at(now);
            assert!((next - at).abs() <= (speed_max + acceleration * 1e-3) * 1e-3 + 1e-6);
            assert!((pace - speed).abs() <= acceleration * 1e-3 * 1.001 + 1e-6, "{i}");
            (at, speed) = (next, pace);
        }
        assert!((at - travel.goal).abs() < 1e-9 && speed.abs() < 1e-9, "{at} {speed}");
    }

    #[test]
    fn it_goes_to_its_goal_from_any_speed() {
        for speed in [0.0, 300.0, -300.0, 700.0] {
            for goal in [100.0, 110.0, -2000.0, 3000.0] {
                let travel = Travel::new(ms(5), (100.0, speed), goal, 600.0, 1000.0);
                check(&travel, 700.0, 1000.0);
            }
        }
    }

    #[test]
    fn it_takes_as_long_as_a_trapezoid_and_brakes_in_the_shortest_way() {
        let travel = Travel::new(ms(0), (0.0, 0.0), 1200.0, 600.0, 1200.0);
        assert_eq!(travel.ends(), ms(2500));
        let braked = travel.braked(ms(1000), 1200.0);
        assert!((braked.goal() - (450.0 + 150.0)).abs() < 1e-9, "{}", braked.goal());
        assert_eq!(braked.ends(), ms(1500));
        check(&braked, 600.0, 1200.0);
    }
}
