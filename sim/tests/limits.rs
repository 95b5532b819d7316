//! What could break: an axis that leaves its travel unnoticed, a limit switch that depends on
//! who looked when, a home mark that is not found from somewhere in the travel.

mod bench;

use std::sync::Arc;
use std::time::Duration;

use bench::{COUNTS_PER_M, counts, exact_rig};
use firmware_protocol::{
    AxisMask, Cause, CommandId, DeviceCore, Event, Home, Instant, MoveTo, Reply, Request,
};
use sim::{Nominal, Quantity, Scene, Simulated, SimulatedBoard, Terms, compile};

const X_CHANNEL: u8 = 3;
/// Half the travel of x in the bench's rig, and a margin of 1 % of the whole.
const X_END_M: f64 = 10_000.0 / COUNTS_PER_M;
const X_MARGIN_M: f64 = 200.0 / COUNTS_PER_M;

struct Run {
    core: DeviceCore<SimulatedBoard>,
    now: Instant,
    ids: u32,
    /// The furthest that x came, metres.
    x_m: (f64, f64),
}

impl Run {
    fn new(nominal: Nominal, simulated: Simulated, seed: u64) -> Self {
        let scene = Scene::new(Quantity::Radiance);
        // On a dark sample no error of the axes changes a reading: it takes a word to keep one.
        let force =
            if nominal.axes[2].u_homing > 0.0 { vec!["x-homing".to_owned()] } else { Vec::new() };
        let terms = Terms { force, ..Terms::seeded(seed) };
        let compiled = compile(scene, nominal, simulated, &terms).expect("a sound rig");
        let board = SimulatedBoard::new(Arc::new(compiled), 0);
        let mut run =
            Self { core: DeviceCore::new(board), now: Instant::ZERO, ids: 0, x_m: (0.0, 0.0) };
        run.ask(&Request::Identify(1));
        run
    }

    fn at_fraction(fraction: f64) -> Self {
        let simulated = Simulated { start: [Some(fraction); 4], ..Simulated::default() };
        Self::new(exact_rig(), simulated, 1)
    }

    fn ask(&mut self, request: &Request) -> Reply {
        self.core.handle_request(self.now, request)
    }

    fn home(&mut self) -> Event {
        self.ids += 1;
        let home = Home { id: CommandId(self.ids), axes: AxisMask(0b1111) };
        let reply = self.ask(&Request::Home(home));
        assert!(matches!(reply, Reply::Accepted(_)), "{reply:?}");
        self.result()
    }

    fn move_to(&mut self, x_m: f64) -> Event {
        self.ids += 1;
        let targets = counts(0.0, 0.0, x_m, 0.0);
        let reply = self.ask(&Request::MoveTo(MoveTo { id: CommandId(self.ids), targets }));
        assert!(matches!(reply, Reply::Accepted(_)), "{reply:?}");
        self.result()
    }

    /// Wakes the core when it asks for it, and shows signs of life.
    fn result(&mut self) -> Event {
        loop {
            match self.core.poll_event() {
                Some(Event::Started(..)) => continue,
                Some(result) => return result,
                None => {}
            }
            let wake = self.core.poll_timeout().expect("a command runs");
            // Well within the lease.
            self.look(wake.min(self.now + Duration::from_millis(100)));
        }
    }

    fn look(&mut self, at: Instant) {
        self.now = at;
        self.core.link_heard(at);
        let x_m = self.core.board().seen_ray(at).x_m;
        self.x_m = (self.x_m.0.min(x_m), self.x_m.1.max(x_m));
    }
}

#[test]
fn the_mark_is_found_from_anywhere_in_the_travel_and_no_axis_leaves_it_far() {
    let mut longest = Duration::ZERO;
    for i in 0..=40 {
        let fraction = f64::from(i) / 40.0;
        let mut run = Run::at_fraction(fraction);
        assert!(matches!(run.home(), Event::Done(_)), "from {fraction}");
        let took = run.now - Instant::ZERO;
        longest = longest.max(took);
        // At 6 000 counts/s x brakes within 375 counts.
        let end_m = X_END_M + X_MARGIN_M + 376.0 / COUNTS_PER_M;
        assert!(run.x_m.0 > -end_m && run.x_m.1 < end_m, "from {fraction}: {:?}", run.x_m);
        assert!(matches!(run.move_to(X_END_M), Event::Done(_)));
    }
    // The longest axis: 72 000 counts to the wrong end and back at 6 000 a second.
    assert!(longest > Duration::from_secs(20) && longest < Duration::from_secs(26), "{longest:?}");
}

#[test]
fn a_switch_turns_an_axis_at_the_microsecond_whoever_looks_when() {
    let undisturbed = {
        let mut run = Run::at_fraction(0.3);
        (run.home(), run.now)
    };
    for step_us in [777, 3_001, 40_009] {
        let mut run = Run::at_fraction(0.3);
        run.ids += 1;
        let home = Home { id: CommandId(run.ids), axes: AxisMask(0b1111) };
        run.ask(&Request::Home(home));
        let result = loop {
            match run.core.poll_event() {
                Some(Event::Started(..)) => continue,
                Some(result) => break result,
                None => {}
            }
            run.look(run.now + Duration::from_micros(step_us));
            run.ask(&Request::ReadStatus);
        };
        assert_eq!(result, undisturbed.0, "asked every {step_us} µs");
        assert!(run.now >= undisturbed.1);
    }
}

#[test]
fn beyond_a_switch_a_motion_ends_in_a_fault_and_homing_comes_back() {
    let mut nominal = exact_rig();
    nominal.axes[2].u_homing = 100.0 / COUNTS_PER_M;
    let simulated = Simulated { limit_margin: 0.0, ..Simulated::default() };
    // Half of all seeds find the mark too far up, so that the travel's end is past the switch.
    let mut faults = 0;
    for seed in 0..8 {
        let mut run = Run::new(nominal.clone(), simulated.clone(), seed);
        assert!(matches!(run.home(), Event::Done(_)));
        let found_m = run.core.board().seen_ray(run.now).x_m;
        let started = run.now;
        let result = run.move_to(X_END_M);
        if found_m <= 0.0 {
            assert!(matches!(result, Event::Done(_)), "seed {seed}: {result:?}");
            continue;
        }
        faults += 1;
        let Event::Failed(_, Cause::LimitSwitch(X_CHANNEL), tick) = result else {
            panic!("seed {seed}: {result:?}")
        };
        // Too short a way for full speed: 2 sqrt(s / a) for all of it, and from d before its end
        // on it would still take sqrt(2 d / a).
        let counts = found_m * COUNTS_PER_M;
        let whole_s = 2.0 * (10_000.0_f64 / 48_000.0).sqrt();
        let expected_s = whole_s - (2.0 * counts / 48_000.0).sqrt();
        let took_s = f64::from(tick.micros_since(started.tick())) / 1e6;
        assert!((took_s - expected_s).abs() < 3e-6, "{took_s} s, expected {expected_s} s");
        let status = run.core.status(run.now);
        assert_eq!((status.homed.0 >> X_CHANNEL & 1, status.fault.is_some()), (0, true));
        run.look(run.now + Duration::from_secs(1));
        assert_eq!(run.ask(&Request::ClearFault), Reply::Cleared);
        assert!(matches!(run.home(), Event::Done(_)), "seed {seed}");
    }
    assert!(faults > 0 && faults < 8, "{faults}");
}
