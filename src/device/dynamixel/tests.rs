//! What could break: a driver that says done before the axes are, that moves what it should not,
//! or that leaves an axis moving when something fails. Against simulated servos, by an exact
//! clock.

use std::sync::Arc;

use firmware_protocol::Shutter;
use sim::{
    Bench, DeviceFault, DynamixelBus, Emitter, FaultKind, LinkFaults, Nominal, NominalAxis,
    NominalDetector, NominalGain, Note, Quantity, Scene, ServoFault, ServoSetting, Shape,
    Simulated, SimulatedBoard, Terms, Wire, compile,
};

use super::packet::Instruction;
use super::*;
use crate::device::axes::AxesFacts;
use crate::device::driver::Refusal;

const BAUD: u32 = 1_000_000;
/// 40 units of velocity, 6 of acceleration.
const SPEED: u32 = 625;
const ACCELERATION: u32 = 1464;

const TOLERANCE: u32 = 12;

fn board() -> SimulatedBoard {
    let axis = |channel| NominalAxis {
        channel,
        home: 0.0,
        counts_per_unit: 4096.0 / std::f64::consts::TAU,
        travel_counts: (-2000, 2000),
        speed_counts_per_s: SPEED,
        acceleration_counts_per_s2: ACCELERATION,
        settle_s: 0.02,
        has_encoder: true,
        u_zero: 0.0,
        u_homing: 0.0,
        u_readback: 0.0,
    };
    let gain = NominalGain { name: "1 uA".into(), full_scale_a: 1e-6, u_relative: 0.0 };
    let nominal = Nominal {
        quantity: Quantity::Radiance,
        axes: [axis(0), axis(1), axis(2), axis(3)],
        detector: NominalDetector {
            distance_m: 0.3,
            u_distance_m: 0.0,
            pupil_radius_m: 0.006,
            u_pupil_radius_m: 0.0,
            spot_radius_m: 0.002,
            u_spot_radius_m: 0.0,
            responsivity_a_per_w: 0.2,
            u_responsivity_relative: 0.0,
            read_noise_a: 0.0,
            gains: vec![gain],
            adc_bits: 24,
            adc_rate_hz: 2000,
        },
    };
    let patch = Emitter::lambertian(Shape::rectangle(0.0, 0.0, 0.04, 0.04), 40.0);
    let scene = Scene::new(Quantity::Radiance).with(patch).unwrap();
    let compiled = compile(scene, nominal, Simulated::default(), &Terms::seeded(3)).unwrap();
    SimulatedBoard::new(Arc::new(compiled), 0)
}

fn axis(id: u8, axis: &'static str) -> ServoAxis {
    let id = ServoId::new(id).unwrap();
    ServoAxis { axis, id, speed: SPEED, acceleration: ACCELERATION, travel: (48, 4048) }
}

struct Pair {
    driver: Dynamixel,
    bench: Bench,
    now: Instant,
}

impl Pair {
    fn new(settings: Vec<ServoSetting>, wire: Wire) -> Self {
        Self::with(settings, wire, |bus| bus)
    }

    fn with(
        settings: Vec<ServoSetting>,
        wire: Wire,
        faults: impl FnOnce(DynamixelBus) -> DynamixelBus,
    ) -> Self {
        let mut board = board();
        let bus = faults(DynamixelBus::new(settings, &mut board));
        let mut bench = Bench::new(board);
        bench.plug(bus, wire);
        let servos = vec![axis(1, "theta"), axis(2, "phi")];
        let driver = Dynamixel::new("test", BAUD, servos, None, TOLERANCE);
        Self { driver, bench, now: Instant::ZERO }
    }

    fn opened(self) -> Self {
        let mut pair = self;
        pair.driver.open(pair.now);
        let event = pair.event();
        assert!(matches!(event, Some(AxesEvent::Ready(_))), "{event:?}");
        pair
    }

    /// Lets time pass until the next event, or until both have nothing more to do, or so long.
    fn event_within(&mut self, limit: Duration) -> Option<AxesEvent> {
        let end = self.now + limit;
        loop {
            if let Some(event) = self.driver.poll_event() {
                return Some(event);
            }
            while let Some(bytes) = self.driver.poll_transmit(self.now) {
                self.bench.send(self.now, 0, &bytes);
            }
            let next = [self.driver.poll_timeout(), self.bench.next()];
            let next = next.into_iter().flatten().min().filter(|next| *next <= end)?;
            self.now = self.now.max(next);
            self.bench.advance(self.now);
            while let Some(bytes) = self.bench.receive(self.now, 0) {
                self.driver.handle_bytes(self.now, &bytes);
            }
            self.driver.handle_timeout(self.now);
        }
    }

    fn event(&mut self) -> Option<AxesEvent> {
        self.event_within(Duration::from_mins(1))
    }

    fn command(&mut self, command: AxesCommand) -> Option<AxesEvent> {
        self.driver.begin(self.now, command);
        self.event()
    }

    fn move_to(&mut self, goals: [i32; 2]) -> Option<AxesEvent> {
        self.command(AxesCommand::MoveTo(goals.to_vec()))
    }

    /// Where the axes stand, asked anew.
    fn where_are_you(&mut self) -> Vec<i32> {
        match self.command(AxesCommand::Locate) {
            Some(AxesEvent::Located(located)) => located.steps,
            other => panic!("{other:?}"),
        }
    }
}

fn two() -> Vec<ServoSetting> {
    vec![ServoSetting::new(1, 0), ServoSetting::new(2, 1)]
}

fn pair() -> Pair {
    Pair::new(two(), Wire::new(BAUD)).opened()
}

fn facts(event: Option<AxesEvent>) -> AxesFacts {
    match event {
        Some(AxesEvent::Ready(facts)) => facts,
        other => panic!("{other:?}"),
    }
}

fn refusal(event: Option<AxesEvent>) -> Refusal {
    match event {
        Some(AxesEvent::Trouble(Trouble::Refused(refusal))) => refusal,
        other => panic!("{other:?}"),
    }
}

fn done(event: Option<AxesEvent>) -> Vec<i32> {
    match event {
        Some(AxesEvent::Done(located)) => located.steps,
        other => panic!("{other:?}"),
    }
}

#[test]
fn opening_reads_and_moves_nothing() {
    for firmware in [38, 48] {
        let settings = two().into_iter().map(|setting| ServoSetting { firmware, ..setting });
        let mut pair = Pair::new(settings.collect(), Wire::new(BAUD));
        let before = pair.bench.board().seen_ray(Instant::ZERO);
        pair.driver.open(pair.now);
        let facts = facts(pair.event());
        assert!(facts.identity.contains("servo 2 (phi) XM430-W210 firmware"), "{facts:?}");
        assert!(facts.is_homed && facts.fault.is_none() && !facts.has_shutter);
        assert_eq!((facts.axes[0].speed, facts.axes[0].acceleration), (SPEED, ACCELERATION));
        assert_eq!((facts.axes[1].low, facts.axes[1].high), (0, 4095));
        assert_eq!(pair.bench.board().seen_ray(pair.now), before);
        assert_eq!(pair.driver.poll_timeout(), None, "an idle driver arms no timer");
    }
}

#[test]
fn a_move_is_done_when_the_axes_stand_at_their_goals() {
    for firmware in [38, 48] {
        let settings = two().into_iter().map(|setting| ServoSetting { firmware, ..setting });
        let mut pair = Pair::new(settings.collect(), Wire::new(BAUD)).opened();
        let home = done(pair.command(AxesCommand::Home));
        let began = pair.now;
        assert_eq!(
            done(pair.move_to([home[0] + 500, home[1] - 20])),
            [home[0] + 500, home[1] - 20]
        );
        // 500 steps at 625 a second: the ramps take 0.427 s, as a trapezoid says.
        let took = (pair.now - began).as_secs_f64();
        assert!((1.227..1.34).contains(&took), "{took}");
        assert_eq!(pair.where_are_you(), [home[0] + 500, home[1] - 20]);
        assert_eq!(pair.driver.poll_timeout(), None);
        // At rest nothing strikes, however long nobody says a word.
        pair.now = pair.now + Duration::from_hours(1);
        assert_eq!(done(pair.move_to([home[0], home[1]])), home);
    }
}

#[test]
fn a_stop_brakes_on_the_way_and_the_axes_are_known() {
    let mut pair = pair();
    let home = done(pair.command(AxesCommand::Home));
    let goal = if home[0] > 2048 { home[0] - 1500 } else { home[0] + 1500 };
    pair.driver.begin(pair.now, AxesCommand::MoveTo(vec![goal, home[1]]));
    assert_eq!(pair.event_within(Duration::from_secs(1)), None);
    let told = pair.now;
    pair.driver.stop(pair.now);
    let Some(AxesEvent::Stopped(Some(located))) = pair.event() else { panic!() };
    let took = (pair.now - told).as_secs_f64();
    // From 625 steps/s at 1464 steps/s²: 0.43 s, over 133 steps.
    assert!((0.4..0.6).contains(&took), "{took}");
    let gone = located.steps[0].abs_diff(home[0]);
    assert!((500..700).contains(&gone), "{gone}");
    assert_eq!(pair.where_are_you(), located.steps);
    assert_eq!(done(pair.move_to([goal, home[1]])), [goal, home[1]]);
    // Where nothing moves it is answered too.
    pair.driver.stop(pair.now);
    assert!(matches!(pair.event(), Some(AxesEvent::Stopped(Some(_)))));
}

#[test]
fn servos_stop_by_themselves_when_the_host_falls_silent() {
    let mut pair = pair();
    let home = done(pair.command(AxesCommand::Home));
    let goal = if home[0] > 2048 { 100 } else { 4000 };
    pair.driver.begin(pair.now, AxesCommand::MoveTo(vec![goal, home[1]]));
    assert_eq!(pair.event_within(Duration::from_millis(300)), None);
    // The host hangs for two seconds; the servos do not.
    pair.now = pair.now + Duration::from_secs(2);
    pair.bench.advance(pair.now);
    let seen = pair.bench.board().seen_ray(pair.now);
    let event = pair.event();
    let Some(AxesEvent::Trouble(Trouble::Fault(fault))) = &event else { panic!("{event:?}") };
    assert_eq!(fault.cause, Cause::LeaseExpired);
    assert!(fault.name.contains("500 ms"), "{fault}");
    let after = Instant::from_micros(pair.now.micros() + 1_000_000);
    assert_eq!(pair.bench.board().seen_ray(after), seen, "they stood when the host came back");
    // A strike is left by the next move.
    assert_eq!(pair.command(AxesCommand::Clear), Some(AxesEvent::Cleared));
    assert_eq!(done(pair.move_to([goal, home[1]])), [goal, home[1]]);
}

#[test]
fn servos_that_are_heard_no_more_are_left_to_their_watchdog() {
    let mut pair = pair();
    let home = done(pair.command(AxesCommand::Home));
    let kind = FaultKind::Mute;
    let delay = Duration::from_millis(300);
    let fault = DeviceFault { device: String::new(), kind, nth: 1, delay, lasts: None };
    pair.bench.plan_fault(0, fault);
    let goal = if home[0] > 2048 { 100 } else { 4000 };
    let event = pair.move_to([goal, home[1]]);
    assert!(matches!(event, Some(AxesEvent::Trouble(Trouble::Silent(_)))), "{event:?}");
    pair.now = pair.now + Duration::from_secs(3);
    pair.bench.advance(pair.now);
    let notes = pair.bench.take_notes();
    let [Note::Began(began, ..), Note::AtRest(stood)] = notes[..] else { panic!("{notes:?}") };
    let took = stood.since(began).as_secs_f64();
    // The host asks in vain for a while; from its last word on 500 ms, and 430 ms of braking.
    assert!((0.5..1.4).contains(&took), "{took}");
}

#[test]
fn an_overload_stops_the_others_has_its_name_and_is_left_by_a_restart() {
    let overload = |bus: DynamixelBus| bus.with_fault(2, 2, ServoFault::Overload);
    let mut pair = Pair::with(two(), Wire::new(BAUD), overload).opened();
    let home = done(pair.command(AxesCommand::Home));
    done(pair.move_to([home[0] + 10, home[1] + 10]));
    let began = pair.now;
    let event = pair.move_to([home[0] + 600, home[1] + 600]);
    let Some(AxesEvent::Trouble(Trouble::Fault(fault))) = &event else { panic!("{event:?}") };
    assert_eq!(fault.name, "servo 2 (phi): overload (hardware error 0x20); its torque is off");
    assert_eq!((fault.cause, fault.loses_position), (Cause::Stalled(1), false));
    assert!(pair.now - began < Duration::from_millis(50), "{:?}", pair.now - began);
    pair.driver.stop(pair.now);
    let stopped = pair.event();
    let Some(AxesEvent::Stopped(Some(located))) = stopped else { panic!("{stopped:?}") };
    assert!(located.steps[0] - home[0] < 60, "the other one came to rest at once");
    // It does not go away by itself.
    let again = pair.move_to([home[0], home[1]]);
    assert!(matches!(again, Some(AxesEvent::Trouble(Trouble::Fault(_)))), "{again:?}");
    assert_eq!(pair.command(AxesCommand::Clear), Some(AxesEvent::Cleared));
    assert_eq!(done(pair.move_to([home[0], home[1]])), home);
}

#[test]
fn a_servo_that_restarts_by_itself_is_noticed() {
    let mut pair = pair();
    let home = done(pair.command(AxesCommand::Home));
    done(pair.move_to([home[0], home[1] + 30]));
    // Its plug was out and in again.
    let reboot = Instruction::Reboot(ServoId::new(2).unwrap()).encode().unwrap();
    pair.bench.send(pair.now, 0, &reboot);
    pair.now = pair.now + Duration::from_secs(1);
    pair.bench.advance(pair.now);
    while pair.bench.receive(pair.now, 0).is_some() {}
    let event = pair.move_to(home.clone().try_into().unwrap());
    assert_eq!(event, Some(AxesEvent::Trouble(Trouble::Restarted)));
    assert_eq!(done(pair.move_to([home[0], home[1]])), home, "and given torque again");
}

#[test]
fn what_can_t_be_driven_is_refused_at_once_and_named() {
    let refused = |settings: Vec<ServoSetting>| {
        let mut pair = Pair::new(settings, Wire::new(BAUD));
        pair.driver.open(pair.now);
        let refusal = refusal(pair.event());
        assert_eq!(pair.bench.board().seen_ray(pair.now), board().seen_ray(Instant::ZERO));
        refusal.to_string()
    };
    let velocity = ServoSetting { operating_mode: 1, ..ServoSetting::new(2, 1) };
    let words = refused(vec![ServoSetting::new(1, 0), velocity]);
    assert!(words.contains("servo 2 (phi): operating mode 1 (velocity)"), "{words}");
    assert!(words.contains("register 11"), "{words}");
    let words = refused(vec![ServoSetting::new(1, 0)]);
    assert!(words.contains("no answer from servo 2 (phi)"), "{words}");
    let mut pair = Pair::new(two(), Wire::new(BAUD));
    pair.driver.servos[0].axis.speed = 6000;
    pair.driver.servos[1].axis.travel = (-100, 4000);
    pair.driver.open(pair.now);
    let words = refusal(pair.event()).to_string();
    assert!(words.contains("its limit of speed is 350 (5471 steps/s)"), "{words}");
    pair.driver.servos[0].axis.speed = SPEED;
    pair.driver.open(pair.now);
    let words = refusal(pair.event()).to_string();
    assert!(words.contains("takes positions 0 to 4095; expected at least -100 to 4000"), "{words}");
}

#[test]
fn a_bus_on_which_nobody_answers_may_boot_and_is_not_waited_for_for_ever() {
    let mut pair = Pair::new(vec![], Wire::new(BAUD));
    pair.driver.open(pair.now);
    assert_eq!(pair.event_within(Duration::from_secs(3)), None);
    let event = pair.event_within(Duration::from_secs(2));
    let Some(AxesEvent::Trouble(Trouble::Silent(words))) = event else { panic!("{event:?}") };
    assert!(words.contains("no servo answers at 1000000 baud"), "{words}");
}

#[test]
fn turns_are_known_for_a_power_up_only() {
    let settings = two().into_iter().map(|s| ServoSetting { operating_mode: 4, ..s });
    let mut pair = Pair::new(settings.collect(), Wire::new(BAUD));
    pair.driver.servos[1].axis.travel = (-8000, 8000);
    pair.driver.open(pair.now);
    let facts = facts(pair.event());
    assert!(!facts.is_homed, "it may have been turned with the power off");
    assert_eq!(facts.axes[1].high, 1_048_575);
    let home = done(pair.command(AxesCommand::Home));
    assert!((0..4096).contains(&home[1]));
}

#[test]
fn a_servo_holds_a_shutter_and_the_axes_stay_where_they_are() {
    let mut settings = two();
    settings.push(ServoSetting::shutter(7, 1024, 2048));
    let mut pair = Pair::new(settings, Wire::new(BAUD));
    let id = ServoId::new(7).unwrap();
    let shutter = ShutterServo { id, open: 1024, closed: 2048 };
    let servos = vec![axis(1, "theta"), axis(2, "phi")];
    pair.driver = Dynamixel::new("test", BAUD, servos, Some(shutter), TOLERANCE);
    pair.driver.open(pair.now);
    let facts = facts(pair.event());
    assert!(facts.has_shutter && facts.axes.len() == 2);
    let home = done(pair.command(AxesCommand::Home));
    done(pair.move_to([home[0] + 40, home[1] + 40]));
    for to in [Shutter::Closed, Shutter::Open, Shutter::Closed] {
        let put = pair.command(AxesCommand::PutShutter(to));
        assert_eq!(put, Some(AxesEvent::ShutterIs(to)));
        assert_eq!(pair.bench.board().shutter(), to);
        assert_eq!(pair.where_are_you(), [home[0] + 40, home[1] + 40]);
    }
    assert_eq!(done(pair.move_to([home[0], home[1]])), home);
    assert_eq!(pair.bench.board().shutter(), Shutter::Closed);
}

#[test]
fn a_cut_cable_is_silence_and_the_rest_comes_to_rest() {
    let mut pair = pair();
    let home = done(pair.command(AxesCommand::Home));
    let goal = if home[0] > 2048 { home[0] - 1500 } else { home[0] + 1500 };
    pair.driver.begin(pair.now, AxesCommand::MoveTo(vec![goal, home[1]]));
    assert_eq!(pair.event_within(Duration::from_millis(600)), None);
    let cut = pair.now;
    // What the driver says is lost from here on.
    let event = loop {
        while pair.driver.poll_transmit(pair.now).is_some() {}
        let Some(next) = pair.driver.poll_timeout() else { panic!("it does not wait for ever") };
        pair.now = pair.now.max(next);
        pair.driver.handle_timeout(pair.now);
        if let Some(event) = pair.driver.poll_event() {
            break event;
        }
    };
    let AxesEvent::Trouble(Trouble::Silent(words)) = event else { panic!("{event:?}") };
    assert!(words.contains("servo 1 (theta), servo 2 (phi)"), "{words}");
    // As long as they bear with the host; it asked each of them once more.
    assert!(pair.now - cut < Duration::from_millis(600), "{:?}", pair.now - cut);
    // And by themselves the axes stand within the watchdog and the way in which they brake.
    let stood = cut + WATCHDOG + Duration::from_millis(460);
    pair.bench.advance(stood);
    let seen = pair.bench.board().seen_ray(stood);
    pair.bench.advance(stood + Duration::from_secs(3));
    assert_eq!(pair.bench.board().seen_ray(stood + Duration::from_secs(3)), seen);
}

#[test]
fn a_noisy_line_costs_time_and_nothing_else() {
    let faults = LinkFaults { drop_rate: 2e-4, corrupt_rate: 2e-4 };
    for seed in 0..4 {
        let wire = Wire::new(BAUD).with_faults(faults, seed);
        let mut pair = Pair::new(two(), wire).opened();
        let home = done(pair.command(AxesCommand::Home));
        for n in 1..=8 {
            let goals = [home[0] + 7 * n, home[1] - 11 * n];
            assert_eq!(done(pair.move_to(goals)), goals, "{seed}");
            assert_eq!(pair.where_are_you(), goals);
        }
    }
}
