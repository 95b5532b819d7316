//! One axis as it is: where its mark stands, how its scale departs, and where it really is while
//! it moves, settles, rings, plays and slips.
//!
//! Counts here: the drive stands where the setpoint says, but for lost steps; the load follows it
//! through the play, and swings about it after a stop. An encoder sits on the load and counts from
//! the home mark as it was found. The true position is the load's, with the errors of the scale.

use core::time::Duration;

use firmware_protocol::Instant;

use super::flaws::{AxisFlaws, ENCODER_ERROR, LATCH_JITTER, MISSED_STEPS};
use super::play::Play;
use super::ringing::Rings;
use super::scale::{Lines, Periodic};
use super::settling::Settling;
use crate::NominalAxis;
use crate::chance::{Stream, draw};
use crate::switches::Switches;

/// An axis as drawn: where its mark really is, and how its scale departs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AxisTruth {
    name: &'static str,
    seed: u64,
    counts_per_unit: f64,
    /// The value at count 0 as stated.
    home: f64,
    /// Where the home mark stands, in counts from where the axis's value is zero.
    mark_counts: f64,
    /// Standard deviation of finding it again.
    homing_counts: f64,
    lines: Option<Lines>,
    periodic: Option<Periodic>,
    settling: Option<Settling>,
    rings: Option<Rings>,
    play: Option<Play>,
    misses: Option<Misses>,
    /// By how much the moments of latches in flight scatter, seconds.
    latch_jitter_s: f64,
    /// Where it stands at boot, counts.
    start_counts: f64,
    /// Where the limit switches stand, counts.
    switch_counts: (f64, f64),
    speed_counts_per_s: f64,
    acceleration_counts_per_s2: f64,
}

/// A stepper that is asked for more torque than it has falls back by whole electrical cycles,
/// here once a move at most, and stands that much short of where it was sent.
#[derive(Debug, Clone, PartialEq)]
struct Misses {
    probability: f64,
    counts: f64,
    effect: String,
}

impl AxisTruth {
    pub(crate) fn draw(
        name: &'static str,
        axis: &NominalAxis,
        flaws: &AxisFlaws,
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
        let lines = (axis.u_readback > 0.0).then(|| Lines {
            sigma_counts: axis.u_readback * per_unit.abs(),
            effect: effect("scale", name),
            seed,
        });
        let periodic = flaws
            .encoder_error
            .as_ref()
            .map(|error| Periodic::new(error, per_unit, &format!("{name}-{ENCODER_ERROR}"), seed));
        let settling = Settling::new(axis, flaws.settle_s.unwrap_or(axis.settle_s));
        let mark_counts = zero * axis.u_zero * per_unit;
        // The travel is stated from the mark, wherever that really is.
        let beyond = limit_margin * (high - low);
        Self {
            name,
            seed,
            counts_per_unit: per_unit,
            home: axis.home,
            mark_counts,
            homing_counts: axis.u_homing * per_unit.abs(),
            lines,
            periodic,
            settling,
            rings: flaws.ringing.as_ref().map(|ringing| Rings::new(ringing, per_unit)),
            play: (flaws.backlash > 0.0).then(|| Play::new(flaws.backlash * per_unit.abs())),
            misses: flaws.missed_steps.map(|missed| Misses {
                probability: missed.probability_per_move,
                counts: missed.counts,
                effect: format!("{name}-{MISSED_STEPS}"),
            }),
            latch_jitter_s: flaws.jitter_s(),
            // One that can't move can't seek its mark: it was put there.
            start_counts: if low < high {
                libm::round(low + fraction * (high - low))
            } else {
                mark_counts
            },
            switch_counts: (mark_counts + low - beyond, mark_counts + high + beyond),
            speed_counts_per_s: f64::from(axis.speed_counts_per_s),
            acceleration_counts_per_s2: f64::from(axis.acceleration_counts_per_s2.max(1)),
        }
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
        let lines = self.lines.as_ref().map_or(0.0, |lines| lines.error_counts(mechanical_counts));
        lines + self.periodic_error(mechanical_counts)
    }

    fn periodic_error(&self, mechanical_counts: f64) -> f64 {
        self.periodic.as_ref().map_or(0.0, |sine| sine.error_counts(mechanical_counts))
    }

    /// How late an encoder is latched, by where the setpoint is and which way it goes: the end of one
    /// window and the beginning of the next are one latch, and a sweep that is flown again after an
    /// interruption has the same ones.
    #[allow(clippy::cast_possible_truncation)] // saturates beyond any axis
    fn late_s(&self, cruise: &Cruise, now: Instant) -> f64 {
        if self.latch_jitter_s <= 0.0 {
            return 0.0;
        }
        let effect = format!("{}-{LATCH_JITTER}", self.name);
        let meant = libm::round(cruise.setpoint(now, 0.0)) as i64;
        let key = meant.wrapping_mul(2) + i64::from(cruise.counts_per_s < 0.0);
        self.latch_jitter_s * draw(self.seed, &effect, key.cast_unsigned())
    }

    /// What the n-th move since boot loses, counts: by its number, so that it does not depend on
    /// where the axis goes or when.
    fn missed(&self, number: u64) -> f64 {
        let Some(misses) = &self.misses else { return 0.0 };
        let uniform = Stream::new(self.seed, &misses.effect, number).uniform();
        if uniform < misses.probability { misses.counts } else { 0.0 }
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
    /// By how much the axis was ahead of its setpoint when that last moved, counts.
    settles_counts: f64,
    /// By how much it rang then, counts.
    rings_counts: f64,
    play: Option<Play>,
    /// By how much the drive is ahead of origin and setpoint: by what the play was when it found
    /// its mark, less what steps were lost since.
    drive_ahead_counts: f64,
    moves: u64,
    /// When the setpoint last moved unevenly.
    stopped: Instant,
    cruise: Option<Cruise>,
    homings: u32,
    mark_counts: f64,
    search: Option<Search>,
    switches: Switches,
}

/// A setpoint that moves at constant speed.
#[derive(Debug, Clone, Copy)]
struct Cruise {
    since: Instant,
    from_counts: f64,
    counts_per_s: f64,
}

/// A setpoint is on a cruise's line within what floats make of it, counts.
const ON_LINE_COUNTS: f64 = 1e-6;

impl Cruise {
    fn setpoint(&self, now: Instant, later_s: f64) -> f64 {
        self.from_counts + self.counts_per_s * (seconds(now.since(self.since)) + later_s)
    }
}

/// A search for the home mark.
#[derive(Debug, Clone, Copy)]
struct Search {
    /// Where the load has been since it began, counts from the origin.
    low: f64,
    high: f64,
    /// The setpoint at which it passed the mark, and by how much the load was ahead there.
    found: Option<(f64, f64)>,
}

impl Axis {
    pub(crate) fn at_boot(truth: &AxisTruth) -> Self {
        Self {
            origin_counts: truth.start_counts,
            setpoint_counts: 0.0,
            settles_counts: 0.0,
            rings_counts: 0.0,
            play: truth.play,
            drive_ahead_counts: 0.0,
            moves: 0,
            stopped: Instant::ZERO,
            cruise: None,
            homings: 0,
            mark_counts: truth.mark_found(0),
            search: None,
            switches: Switches::new(truth.switch_counts, truth.speed_counts_per_s),
            truth: truth.clone(),
        }
    }

    pub(crate) const fn setpoint_counts(&self) -> f64 {
        self.setpoint_counts
    }

    pub(crate) fn begin_motion(&mut self, now: Instant, towards_counts: f64) {
        let [from, towards] =
            [self.setpoint_counts, towards_counts].map(|counts| self.origin_counts + counts);
        self.switches.begin_motion(now, from, towards);
        self.moves += 1;
        let lost = self.truth.missed(self.moves);
        if lost > 0.0 {
            self.slip((towards - from).clamp(-lost, lost));
        }
    }

    /// The drive falls back by this against its move.
    fn slip(&mut self, counts: f64) {
        self.drive_ahead_counts -= counts;
        if let Some(play) = &mut self.play {
            play.drive(-counts);
        }
    }

    /// By how much the load is ahead of origin and setpoint, at rest.
    fn ahead_counts(&self) -> f64 {
        self.drive_ahead_counts + self.play.map_or(0.0, |play| play.ahead_counts())
    }

    /// The limit switches' view of it: they are passed by the setpoint.
    pub(crate) const fn switches(&mut self) -> &mut Switches {
        &mut self.switches
    }

    /// When to look whether it has reached a limit switch.
    pub(crate) const fn look_at(&self) -> Option<Instant> {
        self.switches.look_at()
    }

    /// The setpoint has come to a constant speed from rest, by even acceleration over `ramp_s`:
    /// the load is still behind by what its servo lags at that, and swings, and comes in as after
    /// a stop. It lags no constant speed.
    pub(crate) fn begin_cruise(&mut self, now: Instant, counts_per_s: f64, ramp_s: f64) {
        let part = counts_per_s / ramp_s / self.truth.acceleration_counts_per_s2;
        self.settles_counts = self.truth.settling.map_or(0.0, |settling| settling.lagging(part));
        self.rings_counts = -self.truth.rings.map_or(0.0, |rings| rings.excited(part));
        self.stopped = now;
        self.cruise = Some(Cruise { since: now, from_counts: self.setpoint_counts, counts_per_s });
    }

    pub(crate) fn set_setpoint(&mut self, now: Instant, counts: f64) {
        self.switches.pass(now, self.origin_counts + counts);
        let moved = counts - self.setpoint_counts;
        if moved == 0.0 {
            return;
        }
        let is_on_line =
            |cruise: &Cruise| (cruise.setpoint(now, 0.0) - counts).abs() <= ON_LINE_COUNTS;
        self.cruise = self.cruise.filter(is_on_line);
        if self.cruise.is_some() {
            self.setpoint_counts = counts;
            if let Some(play) = &mut self.play {
                play.drive(moved);
            }
            return;
        }
        self.settles_counts = self.truth.settling.map_or(0.0, |settling| settling.after(moved));
        self.rings_counts = self.truth.rings.map_or(0.0, |rings| rings.after(moved));
        self.stopped = now;
        self.setpoint_counts = counts;
        if let Some(play) = &mut self.play {
            play.drive(moved);
        }
        self.look_for_mark();
    }

    fn look_for_mark(&mut self) {
        let (ahead, setpoint) = (self.ahead_counts(), self.setpoint_counts);
        let mark = self.mark_counts - self.origin_counts;
        let Some(search) = &mut self.search else { return };
        search.low = search.low.min(setpoint + ahead);
        search.high = search.high.max(setpoint + ahead);
        if search.found.is_none() && (search.low..=search.high).contains(&mark) {
            search.found = Some((mark - ahead, ahead));
        }
    }

    /// Of the load, counts from the origin, so much later than now.
    fn position(&self, now: Instant, later_s: f64) -> f64 {
        let line = self.cruise.map(|cruise| cruise.setpoint(now, later_s));
        let mut position = line.unwrap_or(self.setpoint_counts) + self.ahead_counts();
        let since_s = seconds(now.since(self.stopped)) + later_s;
        if let Some(settling) = &self.truth.settling {
            position += self.settles_counts * settling.left(since_s);
        }
        if let Some(rings) = &self.truth.rings {
            position += self.rings_counts * rings.left(since_s);
        }
        position
    }

    /// What an encoder reads: the nearest count. At rest the line that it stands on is read
    /// exactly, and the value departs from it; in flight the value goes evenly, and what is
    /// latched departs.
    #[allow(clippy::cast_possible_truncation)] // saturates beyond any axis
    pub(crate) fn readback(&self, now: Instant, has_encoder: bool) -> i32 {
        if !has_encoder {
            return libm::round(self.setpoint_counts) as i32;
        }
        // Where nothing moves it does not matter when.
        let late_s = self.cruise.map_or(0.0, |cruise| self.truth.late_s(&cruise, now));
        let position = self.position(now, late_s);
        let lines = self.cruise.and(self.truth.lines.as_ref());
        let error = lines.map_or(0.0, |lines| lines.error_counts(self.origin_counts + position));
        libm::round(position - error) as i32
    }

    /// The axis's true value, radians or metres.
    pub(crate) fn value(&self, now: Instant) -> f64 {
        self.value_later(now, 0.0)
    }

    /// The same so many seconds later, if the setpoint goes on as it does.
    pub(crate) fn value_later(&self, now: Instant, later_s: f64) -> f64 {
        let mechanical = self.origin_counts + self.position(now, later_s);
        let error = match self.cruise {
            None => self.truth.scale_error(mechanical),
            Some(_) => self.truth.periodic_error(mechanical),
        };
        self.truth.home + (mechanical + error) / self.truth.counts_per_unit
    }

    /// Whether it moves at constant speed.
    pub(crate) const fn cruises(&self) -> bool {
        self.cruise.is_some()
    }

    /// When the axis will be at rest.
    pub(crate) fn rests_at(&self) -> Instant {
        let settles_s = self.truth.settling.map_or(0.0, |settling| settling.lasts_s());
        let rings_s = self.truth.rings.map_or(0.0, |rings| rings.lasts_s());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // seconds at most
        let micros = libm::ceil(settles_s.max(rings_s) * 1e6) as u64;
        self.stopped + Duration::from_micros(micros)
    }

    pub(crate) fn begin_search(&mut self) {
        self.mark_counts = self.truth.mark_found(self.homings);
        let here = self.setpoint_counts + self.ahead_counts();
        self.search = Some(Search { low: here, high: here, found: None });
        self.look_for_mark();
    }

    /// Its counts are from its mark from now on, without a search; it stays where it is.
    pub(crate) fn know_home(&mut self) {
        self.mark_counts = self.truth.mark_found(self.homings);
        self.setpoint_counts += self.origin_counts - self.mark_counts;
        self.origin_counts = self.mark_counts;
        self.homings += 1;
    }

    pub(crate) fn home_mark(&self) -> Option<f64> {
        self.search?.found.map(|(setpoint, _)| setpoint)
    }

    /// It stands still on its mark, the drive where it was when the load passed that: that it has
    /// settled there is the caller's word.
    pub(crate) fn set_home(&mut self) {
        let found = self.search.take().and_then(|search| search.found);
        self.drive_ahead_counts = match (&self.play, found) {
            // The drive stands ahead of the mark by what the load was behind it.
            (Some(_), Some((_, load_ahead))) => self.drive_ahead_counts - load_ahead,
            _ => 0.0,
        };
        self.origin_counts = self.mark_counts;
        self.setpoint_counts = 0.0;
        self.settles_counts = 0.0;
        self.rings_counts = 0.0;
        self.cruise = None;
        self.homings += 1;
    }
}

fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}

#[cfg(test)]
mod tests;
