//! A small board for tests of the device core: axes that are where their setpoint is, a home
//! mark and limit switches somewhere on them, a converter with made-up readings.

#![allow(dead_code)] // each test file uses a part of it

use std::time::Duration;

use firmware_protocol::{
    AxisCounts, AxisIdentity, AxisMask, Board, BoardFault, CommandId, DeviceCore, Dwell, Event,
    Home, Illumination, Instant, LEASE, MoveTo, Reply, Request, Shutter,
};

/// Four axes like a gantry's: two angles, two lengths; travels around, beside and from zero.
pub(crate) const AXES: [AxisIdentity; 4] = [
    AxisIdentity { low: -38_000, high: 38_000, speed: 24_000, acceleration: 48_000 },
    AxisIdentity { low: -72_000, high: 72_000, speed: 36_000, acceleration: 30_000 },
    AxisIdentity { low: 0, high: 50_000, speed: 10_000, acceleration: 40_000 },
    AxisIdentity { low: -40_000, high: 1_000, speed: 9_001, acceleration: 7_003 },
];

/// What the board was told.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Call {
    Setpoint(Instant, u8, f64),
    SetHome(Instant, u8),
    Prepare(Instant, Illumination),
    BeginDwell(Instant, Illumination),
    Convert(Instant),
    Cruise(Instant, u8, f64),
    BeginWindow(Instant, Instant, Illumination),
}

#[derive(Debug, Clone)]
pub(crate) struct TestBoard {
    pub(crate) axes: Vec<AxisIdentity>,
    pub(crate) answers_late: bool,
    pub(crate) adc: (u8, u32),
    /// Where each axis stands, counted from its true home mark.
    pub(crate) places: Vec<f64>,
    /// The place at which each axis's setpoint is zero.
    origins: Vec<f64>,
    /// The stretch seen since a search began.
    searches: Vec<Option<(f64, f64)>>,
    /// Whether the axis has a mark at all.
    pub(crate) has_mark: Vec<bool>,
    /// Places of limit switches, if there are any.
    pub(crate) switches: Vec<Option<(f64, f64)>>,
    /// Faults to come, in order of time.
    pub(crate) faults: Vec<(Instant, BoardFault)>,
    noticed: Vec<BoardFault>,
    /// The converter does not answer from then on.
    pub(crate) detector_dies_at: Option<Instant>,
    illumination: Option<Illumination>,
    pub(crate) calls: Vec<Call>,
}

impl TestBoard {
    /// Stands at these places, counted from the home marks.
    pub(crate) fn at(places: [f64; 4]) -> Self {
        Self {
            axes: AXES.to_vec(),
            answers_late: false,
            adc: (20, 2000),
            places: places.to_vec(),
            origins: places.to_vec(),
            searches: vec![None; 4],
            has_mark: vec![true; 4],
            switches: vec![None; 4],
            faults: Vec::new(),
            noticed: Vec::new(),
            detector_dies_at: None,
            illumination: None,
            calls: Vec::new(),
        }
    }

    /// The reading of the interval that ends then: spread over the range, different each time.
    pub(crate) fn reading(&self, now: Instant) -> i32 {
        let name = self.illumination.map_or(0, |illumination| illumination.reading);
        let mixed = (now.micros() ^ u64::from(name) << 40).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let half = 1_i64 << (self.adc.0 - 1);
        let spread = i64::try_from(mixed >> 33).unwrap() % (2 * half + 9) - half - 4;
        i32::try_from(spread.clamp(-half, half - 1)).unwrap()
    }
}

impl Board for TestBoard {
    fn axes(&self) -> &[AxisIdentity] {
        &self.axes
    }

    fn gains(&self) -> u8 {
        3
    }

    fn adc(&self) -> (u8, u32) {
        self.adc
    }

    fn boot_id(&self) -> u32 {
        77
    }

    fn answers_late(&self) -> bool {
        self.answers_late
    }

    fn wake_at(&self) -> Option<Instant> {
        self.faults.first().map(|(at, _)| *at)
    }

    fn set_setpoint(&mut self, now: Instant, channel: u8, counts: f64) {
        self.calls.push(Call::Setpoint(now, channel, counts));
        let index = usize::from(channel);
        let (from, to) = (self.places[index], self.origins[index] + counts);
        self.places[index] = to;
        if let Some((low, high)) = &mut self.searches[index] {
            (*low, *high) = (low.min(to), high.max(to));
        }
        if let Some((low, high)) = self.switches[index] {
            let opens = (from > low && to <= low) || (from < high && to >= high);
            if opens {
                self.noticed.push(BoardFault::LimitSwitch(channel));
            }
        }
    }

    #[allow(clippy::cast_possible_truncation)] // an encoder rounds
    fn readback(&mut self, _: Instant, channel: u8) -> i32 {
        let index = usize::from(channel);
        (self.places[index] - self.origins[index]).round() as i32
    }

    fn begin_search(&mut self, _: Instant, channel: u8) {
        let place = self.places[usize::from(channel)];
        self.searches[usize::from(channel)] = Some((place, place));
    }

    fn home_mark(&mut self, _: Instant, channel: u8) -> Option<f64> {
        let index = usize::from(channel);
        let (low, high) = self.searches[index]?;
        let is_passed = self.has_mark[index] && low <= 0.0 && 0.0 <= high;
        is_passed.then(|| -self.origins[index])
    }

    fn set_home(&mut self, now: Instant, channel: u8) {
        self.calls.push(Call::SetHome(now, channel));
        let index = usize::from(channel);
        self.origins[index] = self.places[index];
        self.searches[index] = None;
    }

    fn prepare_dwell(&mut self, now: Instant, illumination: Illumination) {
        self.calls.push(Call::Prepare(now, illumination));
    }

    fn begin_dwell(&mut self, now: Instant, illumination: Illumination) {
        self.calls.push(Call::BeginDwell(now, illumination));
        self.illumination = Some(illumination);
    }

    fn begin_cruise(&mut self, now: Instant, channel: u8, counts_per_s: f64, _: Duration) {
        self.calls.push(Call::Cruise(now, channel, counts_per_s));
    }

    fn begin_window(&mut self, now: Instant, until: Instant, illumination: Illumination) {
        self.calls.push(Call::BeginWindow(now, until, illumination));
        self.illumination = Some(illumination);
    }

    fn convert(&mut self, now: Instant) -> Result<i32, BoardFault> {
        self.calls.push(Call::Convert(now));
        if self.detector_dies_at.is_some_and(|at| at <= now) {
            return Err(BoardFault::Detector);
        }
        Ok(self.reading(now))
    }

    fn fault(&mut self, now: Instant) -> Option<BoardFault> {
        if self.faults.first().is_some_and(|(at, _)| *at <= now) {
            return Some(self.faults.remove(0).1);
        }
        self.noticed.pop()
    }
}

/// A core with a clock, called whenever it asks for it, by a host that is never silent unless
/// told.
pub(crate) struct Bench {
    pub(crate) core: DeviceCore<TestBoard>,
    pub(crate) now: Instant,
    next_id: u32,
}

impl Bench {
    pub(crate) fn new(board: TestBoard) -> Self {
        Self { core: DeviceCore::new(board), now: Instant::ZERO, next_id: 1 }
    }

    /// A device that was homed where it stands, at its marks, its log empty.
    pub(crate) fn homed() -> Self {
        let mut bench = Self::new(TestBoard::at([0.0; 4]));
        let id = bench.accept(home(0b1111));
        let events = bench.run();
        assert!(matches!(events.last(), Some(Event::Done(done)) if done.id == id), "{events:?}");
        bench.acknowledge(id);
        bench.core.board_mut().calls.clear();
        bench
    }

    pub(crate) fn ask(&mut self, request: &Request) -> Reply {
        self.core.handle_request(self.now, request)
    }

    /// Asks with the next command number.
    pub(crate) fn command(&mut self, request: impl FnOnce(CommandId) -> Request) -> Reply {
        let id = CommandId(self.next_id);
        self.next_id += 1;
        self.ask(&request(id))
    }

    pub(crate) fn accept(&mut self, request: impl FnOnce(CommandId) -> Request) -> CommandId {
        match self.command(request) {
            Reply::Accepted(id) => id,
            other => panic!("not accepted: {other:?}"),
        }
    }

    pub(crate) fn acknowledge(&mut self, id: CommandId) {
        assert_eq!(self.ask(&Request::Acknowledge(id)), Reply::Acknowledged(id));
    }

    pub(crate) fn events(&mut self) -> Vec<Event> {
        std::iter::from_fn(|| self.core.poll_event()).collect()
    }

    /// Goes on for so long, at every moment that the core asks for.
    pub(crate) fn pass_us(&mut self, us: u64) {
        let end = Instant::from_micros(self.now.micros() + us);
        while let Some(at) = self.core.poll_timeout().filter(|at| *at <= end) {
            self.now = at;
            self.core.handle_timeout(at);
        }
        self.now = end;
        self.core.handle_timeout(end);
    }

    /// Keeps the lease alive until nothing is left to do.
    pub(crate) fn run(&mut self) -> Vec<Event> {
        while let Some(at) = self.core.poll_timeout() {
            self.now = at.min(self.now + LEASE / 4);
            self.core.link_heard(self.now);
        }
        self.events()
    }

    pub(crate) fn targets_in_travel(fractions: [f64; 4]) -> [i32; 4] {
        std::array::from_fn(|i| {
            let (low, high) = (f64::from(AXES[i].low), f64::from(AXES[i].high));
            #[allow(clippy::cast_possible_truncation)] // within the travel
            let target = (low + fractions[i] * (high - low)).round() as i32;
            target
        })
    }
}

pub(crate) fn home(axes: u8) -> impl FnOnce(CommandId) -> Request {
    move |id| Request::Home(Home { id, axes: AxisMask(axes) })
}

pub(crate) fn move_to(targets: [i32; 4]) -> impl FnOnce(CommandId) -> Request {
    move |id| {
        let targets = AxisCounts(targets.into_iter().collect());
        Request::MoveTo(MoveTo { id, targets })
    }
}

pub(crate) fn dwell(settle_us: u32, duration_us: u32) -> impl FnOnce(CommandId) -> Request {
    move |id| {
        let (reading, gain, shutter) = (id.0 + 1000, 1, Shutter::Open);
        Request::Dwell(Dwell { id, reading, gain, shutter, settle_us, duration_us })
    }
}
