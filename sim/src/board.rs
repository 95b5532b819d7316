//! The board under the simulated device: axes that follow their setpoints, and a detector that
//! sees the scene from where the axes really stand.

use core::time::Duration;
use std::collections::BTreeMap;
use std::sync::Arc;

use firmware_protocol::{AxisIdentity, Board, BoardFault, Illumination, Instant, Shutter};

use crate::chance::mix;
use crate::mechanics::{Axis, SeenRay, passing};
use crate::optics;
use crate::stage::Stages;
use crate::time::Interval;
use crate::{Compiled, Nominal};

/// A simulated rig's hardware. It answers after the fact, so that a device core is woken when
/// something ends and not for every ADC reading.
#[derive(Debug)]
pub struct SimulatedBoard {
    compiled: Arc<Compiled>,
    boot_id: u32,
    /// In channel order.
    identities: Vec<AxisIdentity>,
    /// In the order θ, φ, x, y.
    axes: [Axis; 4],
    /// The axis of each channel.
    axis_of_channel: [usize; 4],
    stages: Stages,
    /// The time of one ADC reading.
    reading_s: f64,
    dwell: Dwelling,
    /// How a shutter that no command of a dwell names stands.
    shutter: Shutter,
    /// How often a reading was named at each place.
    visits: BTreeMap<u64, u32>,
}

/// What the detector sees while it dwells.
#[derive(Debug)]
struct Dwelling {
    illumination: Illumination,
    /// Photocurrent at rest, once the axes rest.
    current_a: Option<f64>,
    /// In a sweep's window: the photocurrents of the ADC readings that are still to come.
    passing_a: std::vec::IntoIter<f64>,
}

impl Dwelling {
    fn new(illumination: Illumination) -> Self {
        Self { illumination, current_a: None, passing_a: Vec::new().into_iter() }
    }
}

impl SimulatedBoard {
    /// A rig that has just been switched on, for the `boot`-th time.
    #[allow(clippy::cast_possible_truncation)] // a number among 2^32
    pub fn new(compiled: Arc<Compiled>, boot: u32) -> Self {
        let nominal = &compiled.nominal;
        let mut axis_of_channel = [0; 4];
        for (axis, nominal) in nominal.axes.iter().enumerate() {
            axis_of_channel[usize::from(nominal.channel)] = axis;
        }
        let identities = axis_of_channel.iter().map(|axis| &nominal.axes[*axis]);
        let identities = identities.map(|axis| AxisIdentity {
            low: axis.travel_counts.0,
            high: axis.travel_counts.1,
            speed: axis.speed_counts_per_s,
            acceleration: axis.acceleration_counts_per_s2,
        });
        Self {
            boot_id: mix(mix(compiled.seed) ^ u64::from(boot)) as u32,
            identities: identities.collect(),
            axes: core::array::from_fn(|axis| Axis::at_boot(&compiled.drawn.axes[axis])),
            axis_of_channel,
            stages: compiled.stages(),
            reading_s: 1.0 / f64::from(nominal.detector.adc_rate_hz),
            dwell: Dwelling::new(Illumination { reading: 0, gain: 0, shutter: Shutter::Closed }),
            shutter: Shutter::Open,
            visits: BTreeMap::new(),
            compiled,
        }
    }

    /// Puts a shutter that is moved apart from the readings: by an output of another device.
    pub fn put_shutter(&mut self, shutter: Shutter) {
        self.shutter = shutter;
        self.dwell.current_a = None;
    }

    /// How that shutter stands.
    pub const fn shutter(&self) -> Shutter {
        self.shutter
    }

    /// A name for a reading that its meter has none for: by where the axes were sent, the range,
    /// the shutter, and how often such a reading was named before in this boot. Noise is keyed by
    /// names, and so depends on what was measured, and not on when.
    #[allow(clippy::cast_possible_truncation)] // a number among 2^32
    pub fn name_reading(&mut self, gain: u8) -> u32 {
        let closed = u64::from(self.shutter == Shutter::Closed);
        let boot = u64::from(self.boot_id) << 32;
        let place = self.axes.iter().fold(boot | u64::from(gain) << 1 | closed, |key, axis| {
            mix(key ^ u64::from(axis.readback(Instant::ZERO, false).cast_unsigned()))
        });
        let visits = self.visits.entry(place).or_default();
        *visits = visits.wrapping_add(1);
        mix(place ^ u64::from(*visits)) as u32
    }

    /// Where the drives were sent, whole counts in the order θ, φ, x, y.
    #[allow(clippy::cast_possible_truncation)] // saturating
    pub(crate) fn setpoints(&self) -> [i64; 4] {
        self.axes.each_ref().map(|axis| libm::round(axis.setpoint_counts()) as i64)
    }

    /// The rig file's description of the rig.
    pub fn nominal(&self) -> &Nominal {
        &self.compiled.nominal
    }

    /// The ray that the detector really sees.
    pub fn seen_ray(&self, now: Instant) -> SeenRay {
        self.detector_axis(now).into()
    }

    fn detector_axis(&self, now: Instant) -> optics::Axis {
        self.compiled.drawn.kinematics.seen(core::array::from_fn(|axis| self.axes[axis].value(now)))
    }

    /// Puts an absolute encoder on an axis: its counts are from the home mark, wherever it stands
    /// at boot. Where the mark stands is as uncertain as where a search finds it.
    pub fn know_home(&mut self, channel: u8) {
        if let Some(axis) = self.axis(channel) {
            axis.know_home();
        }
    }

    fn axis(&mut self, channel: u8) -> Option<&mut Axis> {
        let axis = *self.axis_of_channel.get(usize::from(channel))?;
        self.axes.get_mut(axis)
    }

    /// The light's current over an ADC reading, amperes. At rest it is worked out once a dwell.
    fn photocurrent_a(&mut self, now: Instant) -> f64 {
        if let Some(current_a) = self.dwell.passing_a.next().or(self.dwell.current_a) {
            return current_a;
        }
        let rests_at = self.axes.iter().map(Axis::rests_at).max();
        let begin = earlier(now, self.reading_s);
        let current_a = match self.dwell.illumination.shutter {
            Shutter::Closed => 0.0,
            Shutter::Open if rests_at.is_none_or(|at| at <= begin) => self.light_a(now),
            Shutter::Open => {
                let moments = self.compiled.drawn.moments.iter();
                let at = |before_end: f64| earlier(now, before_end * self.reading_s);
                moments.map(|moment| moment.weight * self.light_a(at(moment.before_end))).sum()
            }
        };
        if rests_at.is_none_or(|at| at <= begin) {
            self.dwell.current_a = Some(current_a);
        }
        current_a
    }

    /// Over each ADC reading of the window that begins now, amperes: the axes go on as they do.
    fn passing_a(&self, now: Instant, until: Instant) -> Vec<f64> {
        if !self.axes.iter().any(Axis::cruises) {
            return Vec::new();
        }
        let window_s = until.since(now).as_secs_f64();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an hour at most
        let readings = libm::round(window_s / self.reading_s) as usize;
        let drawn = &self.compiled.drawn;
        let light_a = |part: f64| {
            let later_s = part * window_s;
            let joints = core::array::from_fn(|i| self.axes[i].value_later(now, later_s));
            let axis = drawn.kinematics.seen(joints);
            self.compiled.optics.radiance(&axis) * drawn.current_per_radiance
        };
        passing::readings(light_a, readings, drawn.averages())
    }

    /// What a detector that is looked at now shows, amperes: the light's part of its current.
    pub(crate) fn light_now_a(&self, now: Instant) -> f64 {
        if self.shutter == Shutter::Closed { 0.0 } else { self.light_a(now) }
    }

    /// At a moment, amperes.
    fn light_a(&self, now: Instant) -> f64 {
        let radiance = self.compiled.optics.radiance(&self.detector_axis(now));
        radiance * self.compiled.drawn.current_per_radiance
    }
}

/// A moment so many seconds earlier, to the microsecond.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a part of an ADC reading
fn earlier(now: Instant, by_s: f64) -> Instant {
    Instant::from_micros(now.micros().saturating_sub(libm::round(by_s * 1e6) as u64))
}

impl Board for SimulatedBoard {
    fn axes(&self) -> &[AxisIdentity] {
        &self.identities
    }

    fn gains(&self) -> u8 {
        u8::try_from(self.compiled.nominal.detector.gains.len()).unwrap_or(u8::MAX)
    }

    fn adc(&self) -> (u8, u32) {
        let detector = &self.compiled.nominal.detector;
        (detector.adc_bits, detector.adc_rate_hz)
    }

    fn boot_id(&self) -> u32 {
        self.boot_id
    }

    fn answers_late(&self) -> bool {
        true
    }

    fn wake_at(&self) -> Option<Instant> {
        self.axes.iter().filter_map(Axis::look_at).min()
    }

    fn begin_motion(&mut self, now: Instant, channel: u8, towards: f64) {
        if let Some(axis) = self.axis(channel) {
            axis.begin_motion(now, towards);
        }
    }

    fn begin_cruise(&mut self, now: Instant, channel: u8, counts_per_s: f64, ramp: Duration) {
        self.dwell.current_a = None;
        if let Some(axis) = self.axis(channel) {
            axis.begin_cruise(now, counts_per_s, ramp.as_secs_f64());
        }
    }

    fn set_setpoint(&mut self, now: Instant, channel: u8, counts: f64) {
        self.dwell.current_a = None;
        if let Some(axis) = self.axis(channel) {
            axis.set_setpoint(now, counts);
        }
    }

    fn readback(&mut self, now: Instant, channel: u8) -> i32 {
        let Some(&axis) = self.axis_of_channel.get(usize::from(channel)) else { return 0 };
        self.axes[axis].readback(now, self.compiled.nominal.axes[axis].has_encoder)
    }

    fn begin_search(&mut self, _now: Instant, channel: u8) {
        if let Some(axis) = self.axis(channel) {
            axis.begin_search();
        }
    }

    fn home_mark(&mut self, _now: Instant, channel: u8) -> Option<f64> {
        self.axis(channel)?.home_mark()
    }

    fn set_home(&mut self, _now: Instant, channel: u8) {
        self.dwell.current_a = None;
        if let Some(axis) = self.axis(channel) {
            axis.set_home();
        }
    }

    fn prepare_dwell(&mut self, now: Instant, illumination: Illumination) {
        self.stages.prepare(now, illumination);
    }

    fn begin_dwell(&mut self, now: Instant, illumination: Illumination) {
        self.dwell = Dwelling::new(illumination);
        self.stages.begin(now, illumination);
    }

    fn begin_window(&mut self, now: Instant, until: Instant, illumination: Illumination) {
        self.begin_dwell(now, illumination);
        self.dwell.passing_a = self.passing_a(now, until).into_iter();
    }

    fn convert(&mut self, now: Instant) -> Result<i32, BoardFault> {
        let light_a = self.photocurrent_a(now);
        let current_a = self.stages.pass(Interval::ending(now, self.reading_s), light_a);
        let gain = self.dwell.illumination.gain;
        self.compiled.drawn.amplifier.convert(gain, current_a).ok_or(BoardFault::Detector)
    }

    fn fault(&mut self, _now: Instant) -> Option<BoardFault> {
        let opened = self.axes.iter_mut().position(|axis| axis.switches().take_opened())?;
        Some(BoardFault::LimitSwitch(self.compiled.nominal.axes[opened].channel))
    }
}
