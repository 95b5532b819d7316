//! The composer over devices that a test speaks for: what they are told, in which order, and what
//! becomes of a command when one of them fails.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use firmware_protocol::{
    AxisCounts, AxisMask, Cause, CommandId, Dwell, Event, Home, Instant, MoveTo, Rejection, Reply,
    Request, Shutter,
};

use super::Composer;
use crate::device::axes::{Axes, AxesCommand, AxesEvent, AxesFacts, AxisFacts, Located};
use crate::device::controller::{DeviceEvent, LinkLost, Order, Said};
use crate::device::driver::{Driver, NamedFault, Promises, Trouble};
use crate::device::photometer::{
    Exposed, Photometer, PhotometerCommand, PhotometerEvent, PhotometerFacts,
};
use crate::rig::{AXES, AxesDriver, AxesLink, Readback, Rig};

/// What a device was told, and what it is to say.
#[derive(Debug, Default)]
struct Script {
    told: Vec<String>,
    axes: VecDeque<AxesEvent>,
    meter: VecDeque<PhotometerEvent>,
    /// Whether its time-out is never put off.
    is_due: bool,
}

#[derive(Debug, Clone, Default)]
struct Puppet(Arc<Mutex<Script>>);

impl Puppet {
    fn told(&self) -> Vec<String> {
        std::mem::take(&mut self.0.lock().unwrap().told)
    }

    fn note(&self, what: String) {
        self.0.lock().unwrap().told.push(what);
    }
}

impl Driver for Puppet {
    fn open(&mut self, _now: Instant) {
        self.note("open".into());
    }
    fn handle_bytes(&mut self, _now: Instant, bytes: &[u8]) {
        self.note(format!("{} bytes", bytes.len()));
    }
    fn handle_timeout(&mut self, _now: Instant) {
        if self.0.lock().unwrap().is_due {
            self.note("due".into());
        }
    }
    fn poll_transmit(&mut self, _now: Instant) -> Option<Vec<u8>> {
        None
    }
    fn poll_timeout(&self) -> Option<Instant> {
        self.0.lock().unwrap().is_due.then_some(Instant::ZERO)
    }
    fn name(&self) -> &'static str {
        "puppet"
    }
    fn promises(&self) -> Promises {
        Promises { accepted: "", done: "", watchdog: None }
    }
}

impl Axes for Puppet {
    fn begin(&mut self, _now: Instant, command: AxesCommand) {
        self.note(format!("{command:?}"));
    }
    fn stop(&mut self, _now: Instant) {
        self.note("stop".into());
    }
    fn poll_event(&mut self) -> Option<AxesEvent> {
        self.0.lock().unwrap().axes.pop_front()
    }
}

impl Photometer for Puppet {
    fn begin(&mut self, _now: Instant, command: PhotometerCommand) {
        let word = match command {
            PhotometerCommand::Zero => "zero".to_owned(),
            PhotometerCommand::Expose(exposure) => format!("expose {}", exposure.readings),
        };
        self.note(word);
    }
    fn abandon(&mut self, _now: Instant) {
        self.note("abandon".into());
    }
    fn poll_event(&mut self) -> Option<PhotometerEvent> {
        self.0.lock().unwrap().meter.pop_front()
    }
}

/// Two boards, of two axes each, and a meter.
struct Play {
    composer: Composer,
    arm: Puppet,
    table: Puppet,
    meter: Puppet,
    now: Instant,
}

impl Play {
    fn new() -> Self {
        let rig = Rig::built_in().unwrap();
        let link = |axes: &[crate::rig::AxisName], zero: f64| AxesLink {
            driver: AxesDriver::Grbl { letters: vec!['X', 'Y'], shutter: None },
            port: None,
            baud: 1,
            axes: axes.to_vec(),
            zeros: vec![zero; 2],
        };
        // A degree, and a millimetre: 1000 steps each.
        let links = [link(&AXES[..2], 1.0_f64.to_radians()), link(&AXES[2..], -1e-3)];
        let puppets = [Puppet::default(), Puppet::default(), Puppet::default()];
        let [arm, table, meter] = puppets.clone();
        let axes: Vec<Box<dyn Axes>> = vec![Box::new(arm.clone()), Box::new(table.clone())];
        let mut rig = rig;
        rig.axes.iter_mut().for_each(|axis| axis.readback = Readback::Steps);
        let composer = Composer::new(&rig, &links, axes, Box::new(meter.clone()), 7);
        Self { composer, arm, table, meter, now: Instant::ZERO }
    }

    fn ready() -> Self {
        let mut play = Self::new();
        play.order(Order::Identify);
        for board in [&play.arm, &play.table] {
            assert_eq!(board.told(), ["open"]);
            board.0.lock().unwrap().axes.push_back(AxesEvent::Ready(facts()));
        }
        let facts = PhotometerFacts { identity: "puppet".into() };
        play.meter.0.lock().unwrap().meter.push_back(PhotometerEvent::Ready(facts));
        assert_eq!(play.meter.told(), ["open"]);
        let said = play.hear();
        let [DeviceEvent::Reply { reply: Reply::Identity(identity), .. }] = &said[..] else {
            panic!("{said:?}")
        };
        assert_eq!((identity.boot_id, identity.axes.len()), (7, 4));
        assert_eq!((identity.axes[0].low, identity.axes[2].low), (-51_000, -49_000));
        play
    }

    /// With a home.
    fn homed() -> Self {
        let mut play = Self::ready();
        let home = Home { id: CommandId(1), axes: AxisMask(0b1111) };
        play.request(Request::Home(home));
        assert_eq!(play.arm.told(), ["Home"]);
        assert_eq!(play.table.told(), [""; 0]);
        play.arm_says(AxesEvent::Done(at([-500, 0])));
        assert_eq!(play.table.told(), ["Home"]);
        let said = play.table_says(AxesEvent::Done(at([0, 0])));
        let Some(DeviceEvent::Event(Event::Done(done))) = said.last() else { panic!("{said:?}") };
        // Steps less the zeros: a degree, and minus a millimetre.
        assert_eq!(done.readback.0[..], [-1500, -1000, 1000, 1000]);
        play
    }

    fn order(&mut self, order: Order) -> Vec<DeviceEvent> {
        self.composer.handle_order(self.now, order);
        self.hear()
    }

    fn request(&mut self, request: Request) -> Vec<DeviceEvent> {
        self.order(Order::Send(request))
    }

    fn hear(&mut self) -> Vec<DeviceEvent> {
        self.composer.listen(self.now);
        let said = std::iter::from_fn(|| self.composer.poll_said());
        said.filter_map(|said| match said {
            Said::Device(event) => Some(event),
            Said::Devices(devices) => {
                assert_eq!(devices, ["puppet: puppet"; 3]);
                None
            }
            other => panic!("{other:?}"),
        })
        .collect()
    }

    /// What the axes were told until now.
    fn forget(&self) {
        self.arm.told();
        self.table.told();
    }

    fn arm_says(&mut self, event: AxesEvent) -> Vec<DeviceEvent> {
        self.arm.0.lock().unwrap().axes.push_back(event);
        self.hear()
    }

    fn table_says(&mut self, event: AxesEvent) -> Vec<DeviceEvent> {
        self.table.0.lock().unwrap().axes.push_back(event);
        self.hear()
    }

    fn meter_says(&mut self, event: PhotometerEvent) -> Vec<DeviceEvent> {
        self.meter.0.lock().unwrap().meter.push_back(event);
        self.hear()
    }
}

fn facts() -> AxesFacts {
    let axis = AxisFacts {
        low: -50_000,
        high: 50_000,
        speed: 1,
        acceleration: 1,
        readback: Readback::Steps,
    };
    AxesFacts {
        identity: "puppet".into(),
        axes: vec![axis; 2],
        is_homed: false,
        is_synchronous: true,
        has_shutter: false,
        fault: None,
    }
}

fn at(steps: [i32; 2]) -> Located {
    Located { steps: steps.to_vec(), device_time_s: None }
}

fn move_to(id: u32, counts: [i32; 4]) -> Request {
    let targets = AxisCounts(counts.into_iter().collect());
    Request::MoveTo(MoveTo { id: CommandId(id), targets })
}

fn dwell(id: u32, shutter: Shutter) -> Request {
    Request::Dwell(Dwell {
        id: CommandId(id),
        reading: 42,
        gain: 1,
        shutter,
        settle_us: 1000,
        duration_us: 50_000,
    })
}

fn fault(cause: Cause, loses_position: bool) -> NamedFault {
    NamedFault { device: "puppet".into(), name: "ALARM".into(), cause, loses_position }
}

fn failures(said: &[DeviceEvent]) -> Vec<(u32, Cause)> {
    let failed = said.iter().filter_map(|event| match event {
        DeviceEvent::Event(Event::Failed(id, cause, _)) => Some((id.0, *cause)),
        _ => None,
    });
    failed.collect()
}

#[test]
fn a_move_is_done_when_all_devices_are() {
    let mut play = Play::homed();
    play.request(move_to(2, [0, 100, -200, 300]));
    assert_eq!(play.arm.told(), ["MoveTo([1000, 1100])"]);
    assert_eq!(play.table.told(), ["MoveTo([-1200, -700])"]);
    assert_eq!(play.table_says(AxesEvent::Done(at([-1200, -700]))), []);
    let said = play.arm_says(AxesEvent::Done(at([1000, 1100])));
    let [DeviceEvent::Event(Event::Done(done))] = &said[..] else { panic!("{said:?}") };
    assert_eq!(done.readback.0[..], [0, 100, -200, 300]);
}

#[test]
fn a_dwell_zeroes_once_settles_locates_exposes_and_locates() {
    let mut play = Play::homed();
    play.request(dwell(2, Shutter::Open));
    assert_eq!(play.meter.told(), ["zero"]);
    play.meter_says(PhotometerEvent::Zeroed);
    assert_eq!(
        (play.arm.told(), play.table.told()),
        (vec!["Locate".into()], vec!["Locate".into()])
    );
    play.arm_says(AxesEvent::Located(at([1000, 1000])));
    play.table_says(AxesEvent::Located(at([-1000, -1000])));
    // Settling: nothing but time ends it.
    assert_eq!(play.meter.told(), [""; 0]);
    assert_eq!(play.composer.poll_timeout(), Some(Instant::from_micros(1000)));
    play.now = Instant::from_micros(1000);
    play.composer.handle_timeout(play.now);
    assert_eq!(play.meter.told(), ["expose 100"]);
    let [began, ended] = [2000, 52_000].map(Instant::from_micros);
    play.meter_says(PhotometerEvent::Exposed(Exposed {
        range: 1,
        readings: 100,
        mean: 5e-8,
        variance: 1e-20,
        min: 4.9e-8,
        max: 1e-7,
        saturated: 1,
        began,
        ended,
        device_time_s: Some(3.0),
    }));
    play.arm_says(AxesEvent::Located(at([1001, 1000])));
    let said = play.table_says(AxesEvent::Located(at([-1000, -1000])));
    let [DeviceEvent::Clocks(id, times), DeviceEvent::Event(Event::Sampled(result))] = &said[..]
    else {
        panic!("{said:?}")
    };
    assert_eq!((*id, times.axes_s, times.photometer_s), (CommandId(2), None, Some(3.0)));
    // Half of the range's full scale, of 2^19 counts.
    assert!((result.mean - 262_144.0).abs() < 1e-6);
    assert!((result.variance / (1e-10_f64 / 1e-7 * 524_288.0).powi(2) - 1.0).abs() < 1e-12);
    assert_eq!((result.n, result.saturated, result.max), (100, 1, 524_288));
    assert_eq!((result.start.0[0], result.end.0[0]), (0, 1));
    assert_eq!(result.end_tick.micros_since(result.start_tick), 50_000);

    play.request(dwell(3, Shutter::Open));
    assert_eq!(play.meter.told(), [""; 0], "it is zeroed already");
}

#[test]
fn what_can_t_be_done_is_refused_at_once() {
    let mut play = Play::ready();
    let rejection = |said: Vec<DeviceEvent>| match &said[..] {
        [DeviceEvent::Reply { reply: Reply::Rejected(_, why), .. }] => *why,
        other => panic!("{other:?}"),
    };
    assert_eq!(rejection(play.request(move_to(1, [0; 4]))), Rejection::Unhomed(0));
    assert_eq!(rejection(play.request(dwell(1, Shutter::Closed))), Rejection::Unsupported);
    let mut play = Play::homed();
    let outside = rejection(play.request(move_to(2, [0, 49_001, 0, 0])));
    assert_eq!(outside, Rejection::OutsideLimits(1, 49_001));
    assert_eq!(rejection(play.request(move_to(1, [0; 4]))), Rejection::IdReused);
}

#[test]
fn a_stop_goes_to_whatever_moves_and_ends_all_commands_once_it_stands() {
    let mut play = Play::homed();
    play.request(move_to(2, [0; 4]));
    play.request(move_to(3, [5; 4]));
    play.table_says(AxesEvent::Done(at([-1000, -1000])));
    play.forget();
    let said = play.request(Request::Stop);
    assert!(matches!(said[..], [DeviceEvent::Reply { reply: Reply::Stopping, .. }]));
    assert_eq!((play.arm.told(), play.table.told()), (vec!["stop".to_owned()], vec![]));
    // Asked for before it stands: answered after.
    assert_eq!(play.request(Request::ClearFault), []);
    let said = play.arm_says(AxesEvent::Stopped(Some(at([900, 1000]))));
    assert_eq!(failures(&said), [(2, Cause::Stopped), (3, Cause::Stopped)]);
    assert!(matches!(said.last(), Some(DeviceEvent::Reply { reply: Reply::Cleared, .. })));
    play.request(move_to(4, [0; 4]));
    assert_eq!(play.arm.told(), ["MoveTo([1000, 1000])"]);
}

/// A reset at rest, by which a grbl forgets its lines, switches its coolant off: the shutter opens.
#[test]
fn where_the_shutter_is_after_a_stop_is_not_believed() {
    let mut play = Play::homed();
    play.composer.parts[0].facts.as_mut().unwrap().has_shutter = true;
    play.request(dwell(2, Shutter::Closed));
    assert_eq!(play.arm.told(), ["PutShutter(Closed)"]);
    play.arm_says(AxesEvent::ShutterIs(Shutter::Closed));
    assert_eq!(play.meter.told(), ["zero"]);
    play.forget();
    play.request(Request::Stop);
    play.arm_says(AxesEvent::Stopped(Some(at([0, 0]))));
    play.table_says(AxesEvent::Stopped(Some(at([0, 0]))));
    play.request(Request::ClearFault);
    play.forget();
    play.request(dwell(3, Shutter::Closed));
    assert_eq!(play.arm.told(), ["PutShutter(Closed)"], "again");
}

#[test]
fn a_fault_of_one_device_stops_the_other_and_keeps_its_name() {
    let mut play = Play::homed();
    play.request(move_to(2, [0; 4]));
    play.forget();
    let alarm = fault(Cause::LimitSwitch(0), true);
    let said = play.arm_says(AxesEvent::Trouble(Trouble::Fault(alarm.clone())));
    assert_eq!(said, [DeviceEvent::Fault(alarm.clone())]);
    assert_eq!((play.arm.told(), play.table.told()), (vec![], vec!["stop".to_owned()]));
    let said = play.table_says(AxesEvent::Stopped(Some(at([0, 0]))));
    assert_eq!(failures(&said), [(2, Cause::LimitSwitch(0))]);
    // Its own axes lost their home, the other's did not.
    let said = play.request(Request::ReadStatus);
    let [DeviceEvent::Reply { reply: Reply::Status(status), .. }] = &said[..] else { panic!() };
    assert_eq!((status.homed, status.fault), (AxisMask(0b1100), Some(Cause::LimitSwitch(0))));
    play.request(Request::ClearFault);
    assert_eq!(play.arm.told(), ["Clear"]);
    let again = AxesEvent::Trouble(Trouble::Fault(alarm));
    let said = play.arm_says(again);
    let Some(DeviceEvent::Reply { reply: Reply::Rejected(_, why), .. }) = said.last() else {
        panic!("{said:?}")
    };
    assert_eq!(*why, Rejection::Faulted(Cause::LimitSwitch(0)));
    play.request(Request::ClearFault);
    let said = play.arm_says(AxesEvent::Cleared);
    assert!(matches!(said[..], [DeviceEvent::Reply { reply: Reply::Cleared, .. }]));
}

#[test]
fn when_the_meter_dies_the_axes_are_stopped() {
    let mut play = Play::homed();
    play.request(move_to(2, [0; 4]));
    play.forget();
    let lost = LinkLost::HungUp { port: "meter".into(), detail: "gone".into() };
    play.composer.port_gone(play.now, 2, lost.clone());
    assert_eq!(play.hear(), [DeviceEvent::LinkLost(lost)]);
    assert_eq!((play.arm.told(), play.table.told()), (vec!["stop".into()], vec!["stop".into()]));
    assert!(!play.composer.is_at_rest());
    play.arm_says(AxesEvent::Stopped(None));
    assert_eq!(
        play.table_says(AxesEvent::Stopped(None)),
        [],
        "the session's commands are forgotten"
    );
    assert!(play.composer.is_at_rest());
}

#[test]
fn a_board_that_boots_ends_the_session_and_loses_its_home() {
    let mut play = Play::homed();
    play.request(move_to(2, [0; 4]));
    let said = play.arm_says(AxesEvent::Trouble(Trouble::Restarted));
    assert_eq!(said, [DeviceEvent::Restarted { old: 7, new: 8 }]);
    play.table_says(AxesEvent::Stopped(None));
    play.forget();
    // Another session asks the one who he is, and the other for a sign of life.
    play.order(Order::Identify);
    assert_eq!((play.arm.told(), play.table.told()), (vec!["open".into()], vec!["Locate".into()]));
    play.arm_says(AxesEvent::Ready(facts()));
    let said = play.table_says(AxesEvent::Located(at([0, 0])));
    assert!(matches!(said[..], [DeviceEvent::Reply { reply: Reply::Identity(_), .. }]));
}

#[tokio::test(start_paused = true)]
async fn a_driver_that_is_always_due_keeps_nobody_from_ending_it() {
    let play = Play::new();
    play.arm.0.lock().unwrap().is_due = true;
    let (orders, to_pump) = tokio::sync::mpsc::unbounded_channel();
    let (from_pump, _said) = tokio::sync::mpsc::unbounded_channel();
    let pump = tokio::spawn(super::pump::pump(play.composer, Vec::new(), to_pump, from_pump));
    drop(orders);
    // Simulated time goes on, which it does not while a task never rests.
    tokio::time::timeout(std::time::Duration::from_mins(1), pump).await.unwrap().unwrap();
}

#[tokio::test(start_paused = true)]
async fn an_answer_that_is_there_is_heard_before_a_time_out_that_is_due() {
    use tokio::io::AsyncWriteExt as _;

    let play = Play::new();
    play.arm.0.lock().unwrap().is_due = true;
    let (mut device, host) = tokio::io::duplex(64);
    device.write_all(b"late").await.unwrap();
    let links = vec![crate::device::Link::new("port", host)];
    let (orders, to_pump) = tokio::sync::mpsc::unbounded_channel();
    let (from_pump, _said) = tokio::sync::mpsc::unbounded_channel();
    let pump = tokio::spawn(super::pump::pump(play.composer, links, to_pump, from_pump));
    tokio::time::sleep(std::time::Duration::from_millis(2)).await;
    drop(orders);
    pump.await.unwrap();
    let told = play.arm.told();
    assert_eq!(told.first().map(String::as_str), Some("4 bytes"), "{told:?}");
    assert!(told.contains(&"due".to_owned()));
}
