//! The mechanics as they are: where each axis really stands, and which ray of the sample the
//! detector sees from there. Computed from the drawings, not from the host's kinematics.
//!
//! Frame: the sample's plane is z = 0, its normal +z, the origin on the turntable's axis. The arm
//! swings in the laboratory's x-z plane and holds the detector over the point where the axes
//! meet. Below it stands the turntable, on that the stage, on that the sample.

mod effects;

use core::time::Duration;

use firmware_protocol::Instant;
use glam::{DMat3, DVec3};

pub(crate) use effects::{axes, candidates};

use crate::NominalAxis;
use crate::chance::{draw, mix};
use crate::optics;
use crate::switches::Switches;

/// A ray from the sample to the detector: where it leaves, metres, and its direction, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenRay {
    /// In the sample's plane.
    pub x_m: f64,
    /// In the sample's plane.
    pub y_m: f64,
    /// From the normal.
    pub theta_rad: f64,
    /// From +x towards +y.
    pub phi_rad: f64,
}

/// Where the detector is when the joints θ, φ, x, y stand at these values (radians, metres).
///
/// With the arm at θ the detector is at Ry(θ) ẑ from the point where it looks. The turntable at φ
/// has turned the sample by -φ about z, so that in the sample's frame the detector stands at
/// Rz(φ) Ry(θ) ẑ. The stage at (x, y) has carried the sample's point (x, y) to the axis.
pub(crate) fn forward([theta, phi, x, y]: [f64; 4]) -> optics::Axis {
    let turntable = DMat3::from_rotation_z(-phi);
    let to_detector = DMat3::from_rotation_y(theta) * DVec3::Z;
    let stage = DVec3::new(-x, -y, 0.0);
    optics::Axis { spot: -stage, direction: turntable.transpose() * to_detector }
}

impl From<optics::Axis> for SeenRay {
    /// The axis as a ray.
    fn from(axis: optics::Axis) -> Self {
        let (spot, direction) = (axis.spot, axis.direction);
        Self {
            x_m: spot.x,
            y_m: spot.y,
            theta_rad: libm::atan2(libm::hypot(direction.x, direction.y), direction.z),
            phi_rad: libm::atan2(direction.y, direction.x),
        }
    }
}

/// An axis as drawn: where its mark really is, and how its scale departs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AxisTruth {
    name: &'static str,
    seed: u64,
    counts_per_unit: f64,
    /// Where the home mark stands, in counts from where the axis's value is zero.
    mark_counts: f64,
    /// Standard deviation of finding it again.
    homing_counts: f64,
    scale: Option<ScaleError>,
    settle: Option<Settle>,
    /// Where it stands at boot, counts.
    start_counts: f64,
    /// Where the limit switches stand, counts.
    switch_counts: (f64, f64),
    speed_counts_per_s: f64,
}

/// The true position departs from the reported one by an amount that belongs to the position:
/// graduation of the scale, pitch of the screw. The same wherever the axis comes from.
#[derive(Debug, Clone, PartialEq)]
struct ScaleError {
    sigma_counts: f64,
    effect: String,
}

/// After a stop the axis is behind by what its servo lags at the axis's acceleration, and comes
/// in as (1 - t/T)³: at rest exactly after the stated time T.
#[derive(Debug, Clone, PartialEq)]
struct Settle {
    time_s: f64,
    lag_counts_max: f64,
}

/// A critically damped servo whose error falls as (1 - t/T)³ begins with a time constant of T/3:
/// it lags a constant acceleration a by a (T/3)².
const LAG_PART_OF_SETTLE: f64 = 1.0 / 3.0;

impl AxisTruth {
    pub(crate) fn draw(
        name: &'static str,
        axis: &NominalAxis,
        start: Option<f64>,
        limit_margin: f64,
        seed: u64,
    ) -> Self {
        let per_unit = axis.counts_per_unit;
        let (low, high) = (f64::from(axis.travel_counts.0), f64::from(axis.travel_counts.1));
        let zero = if axis.u_zero > 0.0 { draw(seed, &effect("zero", name), 0) } else { 0.0 };
        let fraction = start.unwrap_or_else(|| {
            let uniform = crate::chance::Stream::new(seed, &effect("start", name), 0).uniform();
            0.25 + uniform / 2.0
        });
        let scale = (axis.u_readback > 0.0).then(|| ScaleError {
            sigma_counts: axis.u_readback * per_unit.abs(),
            effect: effect("scale", name),
        });
        let lag_s = axis.settle_s * LAG_PART_OF_SETTLE;
        let settle = (axis.settle_s > 0.0).then(|| Settle {
            time_s: axis.settle_s,
            lag_counts_max: f64::from(axis.acceleration_counts_per_s2) * lag_s * lag_s,
        });
        let mark_counts = zero * axis.u_zero * per_unit;
        // The travel is stated from the mark, wherever that really is.
        let beyond = limit_margin * (high - low);
        Self {
            name,
            seed,
            counts_per_unit: per_unit,
            mark_counts,
            homing_counts: axis.u_homing * per_unit.abs(),
            scale,
            settle,
            start_counts: libm::round(low + fraction * (high - low)),
            switch_counts: (mark_counts + low - beyond, mark_counts + high + beyond),
            speed_counts_per_s: f64::from(axis.speed_counts_per_s),
        }
    }

    /// How far the axis may be off when it stops, in units.
    pub(crate) fn lag_units_max(axis: &NominalAxis) -> f64 {
        let lag_s = axis.settle_s * LAG_PART_OF_SETTLE;
        f64::from(axis.acceleration_counts_per_s2) * lag_s * lag_s / axis.counts_per_unit.abs()
    }

    /// The mark as it is found at the n-th homing of this boot, counts. By its number and not by
    /// the clock: a resumed run finds it where the run before did.
    fn mark_found(&self, homing: u32) -> f64 {
        if self.homing_counts <= 0.0 {
            return self.mark_counts;
        }
        let again = draw(self.seed, &effect("homing", self.name), u64::from(homing));
        self.mark_counts + self.homing_counts * again
    }

    fn scale_error(&self, mechanical_counts: f64) -> f64 {
        let Some(scale) = &self.scale else { return 0.0 };
        #[allow(clippy::cast_possible_truncation)] // counts are far inside 64 bits
        let line = libm::round(mechanical_counts) as i64;
        scale.sigma_counts * draw(self.seed, &scale.effect, mix(line.cast_unsigned()))
    }
}

fn effect(what: &str, axis: &str) -> String {
    format!("{axis} {what}")
}

/// An axis in motion.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    truth: AxisTruth,
    /// The mechanical position at setpoint zero, counts.
    origin_counts: f64,
    setpoint_counts: f64,
    /// By how much the axis was behind its setpoint when that last moved, counts.
    behind_counts: f64,
    stopped: Instant,
    homings: u32,
    mark_counts: f64,
    /// The setpoints passed since the search began.
    searched: Option<(f64, f64)>,
    switches: Switches,
}

impl Axis {
    pub(crate) fn at_boot(truth: &AxisTruth) -> Self {
        Self {
            origin_counts: truth.start_counts,
            setpoint_counts: 0.0,
            behind_counts: 0.0,
            stopped: Instant::ZERO,
            homings: 0,
            mark_counts: truth.mark_found(0),
            searched: None,
            switches: Switches::new(truth.switch_counts, truth.speed_counts_per_s),
            truth: truth.clone(),
        }
    }

    pub(crate) fn begin_motion(&mut self, now: Instant, towards_counts: f64) {
        let [from, towards] =
            [self.setpoint_counts, towards_counts].map(|counts| self.origin_counts + counts);
        self.switches.begin_motion(now, from, towards);
    }

    /// The limit switches' view of it: they are passed by the setpoint.
    pub(crate) const fn switches(&mut self) -> &mut Switches {
        &mut self.switches
    }

    /// When to look whether it has reached a limit switch.
    pub(crate) const fn look_at(&self) -> Option<Instant> {
        self.switches.look_at()
    }

    pub(crate) fn set_setpoint(&mut self, now: Instant, counts: f64) {
        self.switches.pass(now, self.origin_counts + counts);
        let moved = counts - self.setpoint_counts;
        if moved == 0.0 {
            return;
        }
        let lag = self.truth.settle.as_ref().map_or(0.0, |settle| settle.lag_counts_max);
        self.behind_counts = -moved.clamp(-lag, lag);
        self.stopped = now;
        self.setpoint_counts = counts;
        if let Some((low, high)) = &mut self.searched {
            (*low, *high) = (low.min(counts), high.max(counts));
        }
    }

    /// From where setpoints count, counts.
    fn position(&self, now: Instant) -> f64 {
        let Some(settle) = &self.truth.settle else { return self.setpoint_counts };
        let rest = 1.0 - seconds(now.since(self.stopped)) / settle.time_s;
        if rest <= 0.0 {
            return self.setpoint_counts;
        }
        self.setpoint_counts + self.behind_counts * rest * rest * rest
    }

    /// What an encoder reads: the nearest count.
    #[allow(clippy::cast_possible_truncation)] // saturates beyond any axis
    pub(crate) fn readback(&self, now: Instant, has_encoder: bool) -> i32 {
        libm::round(if has_encoder { self.position(now) } else { self.setpoint_counts }) as i32
    }

    /// The axis's true value, radians or metres.
    pub(crate) fn value(&self, now: Instant) -> f64 {
        let mechanical = self.origin_counts + self.position(now);
        (mechanical + self.truth.scale_error(mechanical)) / self.truth.counts_per_unit
    }

    /// When the axis will be at rest.
    pub(crate) fn rests_at(&self) -> Instant {
        let Some(settle) = &self.truth.settle else { return self.stopped };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // seconds at most
        let micros = libm::ceil(settle.time_s * 1e6) as u64;
        self.stopped + Duration::from_micros(micros)
    }

    pub(crate) fn begin_search(&mut self) {
        self.searched = Some((self.setpoint_counts, self.setpoint_counts));
        self.mark_counts = self.truth.mark_found(self.homings);
    }

    pub(crate) fn home_mark(&self) -> Option<f64> {
        let mark = self.mark_counts - self.origin_counts;
        self.searched.filter(|(low, high)| (*low..=*high).contains(&mark)).map(|_| mark)
    }

    /// It stands still on its mark: that it has settled there is the caller's word.
    pub(crate) fn set_home(&mut self) {
        self.origin_counts = self.mark_counts;
        self.setpoint_counts = 0.0;
        self.behind_counts = 0.0;
        self.searched = None;
        self.homings += 1;
    }
}

fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    #[test]
    fn the_arm_leans_along_x_and_the_turntable_turns_the_azimuth() {
        let close = |axis: optics::Axis, theta: f64, phi: f64| {
            let ray = SeenRay::from(axis);
            let near = |a: f64, b: f64| libm::fabs(a - b) < 1e-14;
            assert!(near(ray.theta_rad, theta) && near(ray.phi_rad, phi), "{ray:?}");
        };
        close(forward([0.4, 0.0, 0.0, 0.0]), 0.4, 0.0);
        close(forward([0.4, 1.0, 0.0, 0.0]), 0.4, 1.0);
        close(forward([0.4, -2.5, 0.0, 0.0]), 0.4, -2.5);
        // Through the zenith: an arm at -30° with the turntable at 20° sees φ = -160°.
        let (arm, turntable) = ((-30.0_f64).to_radians(), 20.0_f64.to_radians());
        close(forward([arm, turntable, 0.0, 0.0]), 30.0_f64.to_radians(), turntable - PI);
        close(forward([FRAC_PI_2, 0.2, 0.0, 0.0]), FRAC_PI_2, 0.2);
        let ray = SeenRay::from(forward([0.3, 0.9, 0.01, -0.02]));
        assert_eq!((ray.x_m, ray.y_m), (0.01, -0.02));
    }

    fn axis() -> NominalAxis {
        NominalAxis {
            channel: 0,
            counts_per_unit: 1000.0,
            travel_counts: (-1000, 1000),
            speed_counts_per_s: 500,
            acceleration_counts_per_s2: 9000,
            settle_s: 0.03,
            has_encoder: true,
            u_zero: 0.01,
            u_homing: 0.001,
            u_readback: 0.0,
        }
    }

    fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1000)
    }

    #[test]
    fn an_axis_stands_still_after_its_settle_time_and_not_before() {
        let mut nominal = axis();
        nominal.u_zero = 0.0;
        nominal.u_homing = 0.0;
        let truth = AxisTruth::draw("theta", &nominal, Some(0.5), 0.01, 1);
        let mut axis = Axis::at_boot(&truth);
        axis.set_setpoint(at(100), 200.0);
        // 9000 counts/s² for (10 ms)²: 0.9 counts behind, and on its way.
        assert!((axis.value(at(100)) - 0.1991).abs() < 1e-12);
        assert!(axis.value(at(115)) < 0.2 && axis.value(at(115)) > 0.1998);
        assert_eq!(axis.rests_at(), at(130));
        assert_eq!(axis.value(at(130)).to_bits(), 0.2_f64.to_bits());
        assert_eq!((axis.readback(at(100), true), axis.readback(at(100), false)), (199, 200));
    }

    #[test]
    fn a_homed_axis_is_off_by_what_was_drawn() {
        let truth = AxisTruth::draw("theta", &axis(), None, 0.01, 3);
        let mut axis = Axis::at_boot(&truth);
        axis.begin_search();
        assert_eq!(axis.home_mark(), None);
        axis.set_setpoint(at(1), -truth.start_counts - 100.0);
        axis.set_setpoint(at(2), -truth.start_counts + 100.0);
        let mark = axis.home_mark().expect("it was passed");
        axis.set_setpoint(at(3), mark);
        axis.set_home();
        let off = axis.value(at(1000));
        assert!((off - truth.mark_found(0) / 1000.0).abs() < 1e-15);
        assert!(off != 0.0 && off.abs() < 0.06, "{off}");
        assert!((truth.mark_found(0) - truth.mark_found(1)).abs() < 8.0);
        assert!(truth.mark_found(0).to_bits() != truth.mark_found(1).to_bits());
    }

    #[test]
    fn zeros_and_scales_spread_as_stated() {
        let mut nominal = axis();
        nominal.u_homing = 0.0;
        nominal.u_readback = 0.002;
        let rms = |values: &dyn Fn(u64) -> f64| {
            libm::sqrt((0..4000).map(|i| values(i) * values(i)).sum::<f64>() / 4000.0)
        };
        let zero = rms(&|seed| AxisTruth::draw("phi", &nominal, None, 0.01, seed).mark_counts);
        assert!((zero / 10.0 - 1.0).abs() < 0.05, "{zero}");
        let truth = AxisTruth::draw("phi", &nominal, None, 0.01, 9);
        let scale = rms(&|line| truth.scale_error(line as f64 - 2000.0));
        assert!((scale / 2.0 - 1.0).abs() < 0.05, "{scale}");
    }
}
