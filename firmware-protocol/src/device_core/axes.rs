//! All axes of a device: their limits, whether they are homed, and the path that each is on.
//! It plans motion and hands setpoints to the board; it knows no command.

use heapless::Vec;

use super::path::{Path, whole_micros};
use crate::{
    AXES_MAX, AxisCounts, AxisIdentity, AxisMask, Board, Instant, Rejection, SweepMotion, Trapezoid,
};

/// An axis searches its home mark at this fraction of its speed, so that it overruns the mark
/// by 1/16 of the way in which it stops from full speed.
const HOMING_SPEED: f64 = 0.25;

/// How far a search goes beyond where the mark must be, as a fraction of the travel: an axis may
/// stand a little outside its limits at boot.
const SEARCH_SLACK: f64 = 0.02;

pub(super) struct Axes {
    identities: Vec<AxisIdentity, AXES_MAX>,
    paths: Vec<Path, AXES_MAX>,
    homed: AxisMask,
}

impl Axes {
    /// All at rest, unhomed, at setpoint zero. Axes beyond [`AXES_MAX`] are left out.
    pub(super) fn new(identities: &[AxisIdentity]) -> Self {
        let identities: Vec<_, AXES_MAX> = identities.iter().take(AXES_MAX).copied().collect();
        let paths = identities.iter().map(|_| Path::Rest(0.0)).collect();
        Self { identities, paths, homed: AxisMask(0) }
    }

    pub(super) fn identities(&self) -> &Vec<AxisIdentity, AXES_MAX> {
        &self.identities
    }

    pub(super) const fn homed(&self) -> AxisMask {
        self.homed
    }

    pub(super) const fn is_homed(&self, channel: u8) -> bool {
        self.homed.0 >> channel & 1 == 1
    }

    pub(super) fn unhome(&mut self, channel: u8) {
        self.homed.0 &= !1_u8.unbounded_shl(u32::from(channel));
    }

    /// The axis stands on its mark: zero is here.
    pub(super) fn set_home(&mut self, channel: u8) {
        if let Some(path) = self.paths.get_mut(usize::from(channel)) {
            *path = Path::Rest(0.0);
            self.homed.0 |= 1 << channel;
        }
    }

    pub(super) fn is_at_rest(&self) -> bool {
        self.next_end().is_none()
    }

    pub(super) fn rests(&self, channel: u8) -> bool {
        self.paths.get(usize::from(channel)).is_none_or(|path| path.end().is_none())
    }

    /// When the next axis comes to rest; `None` when all are.
    pub(super) fn next_end(&self) -> Option<Instant> {
        self.paths.iter().filter_map(Path::end).min()
    }

    /// Hands the setpoints of moving axes to the board. Those whose path ends are at rest then.
    pub(super) fn follow(&mut self, now: Instant, board: &mut impl Board) {
        for (channel, path) in (0..).zip(&mut self.paths) {
            let Some(end) = path.end() else { continue };
            board.set_setpoint(now, channel, path.position(now));
            if end <= now {
                *path = Path::Rest(path.destination());
            }
        }
    }

    pub(super) fn readback(&self, now: Instant, board: &mut impl Board) -> AxisCounts {
        AxisCounts(
            (0..).zip(&self.identities).map(|(channel, _)| board.readback(now, channel)).collect(),
        )
    }

    /// Whether targets can be gone to: one an axis, all homed, within limits.
    pub(super) fn check(&self, targets: &AxisCounts) -> Result<(), Rejection> {
        if targets.0.len() != self.identities.len() {
            return Err(Rejection::Senseless);
        }
        for ((channel, axis), &target) in (0..).zip(&self.identities).zip(&targets.0) {
            if !self.is_homed(channel) {
                return Err(Rejection::Unhomed(channel));
            }
            if target < axis.low || target > axis.high {
                return Err(Rejection::OutsideLimits(channel, target));
            }
        }
        Ok(())
    }

    /// Sets out for the targets, one an axis: all start now, and arrive together when the slowest
    /// can.
    pub(super) fn go_to(
        &mut self,
        now: Instant,
        targets: impl IntoIterator<Item = f64>,
        board: &mut impl Board,
    ) {
        let mut profiles: Vec<(Trapezoid, f64, f64), AXES_MAX> = Vec::new();
        let mut duration_us = 0;
        for ((axis, path), to) in self.identities.iter().zip(&self.paths).zip(targets) {
            let from = path.destination();
            let Some(profile) = Trapezoid::new((to - from).abs(), speed(axis), acceleration(axis))
            else {
                continue;
            };
            duration_us = duration_us.max(whole_micros(profile.duration_s()));
            let _ = profiles.push((profile, from, to));
        }
        for ((channel, path), (profile, from, to)) in (0..).zip(&mut self.paths).zip(profiles) {
            *path = Path::leg(from, to, profile, now, duration_us);
            announce(path, now, channel, board);
        }
    }

    /// Sets out on a sweep, from where its motion begins.
    pub(super) fn sweep(&mut self, now: Instant, motion: &SweepMotion, board: &mut impl Board) {
        let ramp_s = motion.ramp_us() as f64 / 1e6;
        for ((channel, path), cruise) in (0..).zip(&mut self.paths).zip(motion.axes()) {
            let speed = cruise.counts_per_s.abs();
            let (distance, acceleration) = ((cruise.to - cruise.from).abs(), speed / ramp_s);
            let Some(profile) = Trapezoid::new(distance, speed, acceleration) else { continue };
            *path = Path::leg(cruise.from, cruise.to, profile, now, motion.duration_us());
            announce(path, now, channel, board);
        }
    }

    /// Sets out for one place at homing speed. Limits do not hold before an axis is homed.
    pub(super) fn creep_to(&mut self, now: Instant, channel: u8, to: f64, board: &mut impl Board) {
        let index = usize::from(channel);
        let (Some(axis), Some(path)) = (self.identities.get(index), self.paths.get_mut(index))
        else {
            return;
        };
        let from = path.destination();
        let creeping = HOMING_SPEED * speed(axis);
        if let Some(profile) = Trapezoid::new((to - from).abs(), creeping, acceleration(axis)) {
            *path = Path::leg(from, to, profile, now, whole_micros(profile.duration_s()));
            announce(path, now, channel, board);
        }
    }

    /// Where the two searches for the home mark end, the more promising first. From anywhere in
    /// its travel an unhomed axis finds the mark on one of them.
    pub(super) fn search_ends(&self, channel: u8) -> (f64, f64) {
        let index = usize::from(channel);
        let (Some(axis), Some(path)) = (self.identities.get(index), self.paths.get(index)) else {
            return (0.0, 0.0);
        };
        let here = path.destination();
        let (low, high) = (f64::from(axis.low), f64::from(axis.high));
        let slack = 1.0 + SEARCH_SLACK * (high - low).abs();
        let (down, up) = (high.max(0.0) + slack, (-low).max(0.0) + slack);
        if self.is_homed(channel) {
            if here > 0.0 { (-slack, here + up) } else { (slack, here - down) }
        } else if down <= up {
            (here - down, here + up)
        } else {
            (here + up, here - down)
        }
    }

    /// Brakes one axis as hard as it may.
    pub(super) fn brake(&mut self, now: Instant, channel: u8) {
        let index = usize::from(channel);
        if let (Some(axis), Some(path)) = (self.identities.get(index), self.paths.get_mut(index)) {
            *path = path.braked(now, acceleration(axis));
        }
    }

    /// Brakes every axis as hard as it may.
    pub(super) fn brake_all(&mut self, now: Instant) {
        for (axis, path) in self.identities.iter().zip(&mut self.paths) {
            *path = path.braked(now, acceleration(axis));
        }
    }
}

/// Tells the board of a path that goes anywhere.
fn announce(path: &Path, now: Instant, channel: u8, board: &mut impl Board) {
    if path.end().is_some() {
        board.begin_motion(now, channel, path.destination());
    }
}

/// A board that claims no speed is taken to creep, rather than to stand for ever.
fn speed(axis: &AxisIdentity) -> f64 {
    f64::from(axis.speed.max(1))
}

fn acceleration(axis: &AxisIdentity) -> f64 {
    f64::from(axis.acceleration.max(1))
}
