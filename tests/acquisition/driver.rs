//! The driver against the device core over a paced wire in virtual time, and against peers that
//! are none of ours. Would break: losing a command's order, letting the lease run out while a
//! dwell is long, ticking while nothing happens, leaving axes moving.

use std::sync::Arc;
use std::time::Duration;

use firmware_protocol::{
    AxisCounts, AxisMask, Cause, CommandId, Dwell, Event, Home, Identity, MoveTo, Request, Shutter,
};
use tokio::io::duplex;

use gonio::device::{ConnectError, Controller, DeviceEvent, Link, LinkLost};
use gonio::rig::Rig;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

use crate::board::{TestDevice, counts_of};

const BAUD: u32 = 1_000_000;
const DEADLINE: Duration = Duration::from_secs(3);

fn device() -> TestDevice {
    let rig = Arc::new(Rig::built_in().unwrap());
    TestDevice::new(rig, BAUD, sim::LinkFaults::default())
}

async fn open(device: &TestDevice) -> (Controller, Identity) {
    let stream = device.stream();
    Controller::connect(Link::new("simulated", stream), device.opened(), BAUD, DEADLINE)
        .await
        .unwrap()
}

async fn result(native: &mut Controller) -> Event {
    loop {
        match native.next_event().await {
            DeviceEvent::Event(Event::Started(..)) | DeviceEvent::Reply { .. } => {}
            DeviceEvent::Event(event) => return event,
            other => panic!("{other:?}"),
        }
    }
}

fn home(id: u32) -> Request {
    Request::Home(Home { id: CommandId(id), axes: AxisMask(0b1111) })
}

fn dwell(id: u32, duration_us: u32) -> Request {
    Request::Dwell(Dwell {
        id: CommandId(id),
        reading: 5,
        gain: 0,
        shutter: Shutter::Open,
        settle_us: 0,
        duration_us,
    })
}

#[tokio::test(start_paused = true)]
async fn a_dwell_longer_than_the_lease_is_kept_alive() {
    let device = device();
    let (mut native, identity) = open(&device).await;
    assert!(identity.lease_ms <= 1000);
    native.submit(home(1));
    native.submit(dwell(2, 10_000_000));
    assert!(matches!(result(&mut native).await, Event::Done(_)));
    let Event::Sampled(sampled) = result(&mut native).await else { panic!() };
    assert!((sampled.mean - f64::from(counts_of(5))).abs() < 1e-9);
    native.acknowledge(CommandId(1));
    native.acknowledge(CommandId(2));
    assert_eq!(native.status().await.unwrap().unacknowledged, 0);
    // At rest nothing ticks: an hour passes without a frame.
    let sent = native.statistics().sent;
    tokio::time::sleep(Duration::from_hours(1)).await;
    assert_eq!(native.statistics().sent, sent);
    assert_eq!(native.status().await.unwrap().fault, None);
}

#[tokio::test(start_paused = true)]
async fn dropping_the_driver_stops_the_axes() {
    let device = device();
    let (mut native, _) = open(&device).await;
    native.submit(home(1));
    result(&mut native).await;
    let targets = AxisCounts([90_000, 90_000, 0, 0].into_iter().collect());
    native.submit(Request::MoveTo(MoveTo { id: CommandId(2), targets }));
    tokio::time::sleep(Duration::from_millis(300)).await;
    drop(native);
    // Without the driver's Stop it would be the lease that expired.
    tokio::time::sleep(Duration::from_secs(5)).await;
    let (mut native, _) = open(&device).await;
    assert_eq!(native.status().await.unwrap().fault, Some(Cause::Stopped));
}

#[tokio::test(start_paused = true)]
async fn more_requests_than_the_window_keep_their_order() {
    let device = device();
    let (mut native, identity) = open(&device).await;
    native.submit(home(1));
    let last = u32::from(identity.queue_depth);
    (2..=last).for_each(|id| native.submit(dwell(id, 1000)));
    for id in 1..=last {
        match result(&mut native).await {
            Event::Done(done) => assert_eq!(done.id.0, id),
            Event::Sampled(sampled) => assert_eq!(sampled.id.0, id),
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test(start_paused = true)]
async fn who_does_not_answer_is_named_for_what_was_heard() {
    let (silent, _far) = duplex(4096);
    let error =
        Controller::connect(Link::new("a port", silent), 1, BAUD, DEADLINE).await.unwrap_err();
    assert!(matches!(error, ConnectError::Silent { .. }), "{error}");

    let (noisy, far) = duplex(4096);
    let (mut from_host, mut to_host) = tokio::io::split(far);
    tokio::spawn(async move {
        let mut buffer = [0; 64];
        while from_host.read(&mut buffer).await.is_ok_and(|n| n > 0) {
            let _ = to_host.write(b"Grbl 1.1h ['$' for help]\r\n\0").await;
        }
    });
    let error =
        Controller::connect(Link::new("a port", noisy), 1, BAUD, DEADLINE).await.unwrap_err();
    assert!(matches!(error, ConnectError::Garbled { .. }), "{error}");

    let (gone, far) = duplex(4096);
    drop(far);
    let error =
        Controller::connect(Link::new("a port", gone), 1, BAUD, DEADLINE).await.unwrap_err();
    assert!(matches!(error, ConnectError::HungUp { .. }), "{error}");
}

#[tokio::test(start_paused = true)]
async fn a_cut_link_is_a_hang_up_and_the_device_stops_by_itself() {
    let device = device();
    let (mut native, _) = open(&device).await;
    native.submit(home(1));
    native.submit(dwell(2, 60_000_000));
    result(&mut native).await;
    device.cut();
    let gone = native.next_event().await;
    let gone = if matches!(gone, DeviceEvent::LinkLost(LinkLost::HungUp { .. })) {
        gone
    } else {
        native.next_event().await
    };
    assert!(matches!(gone, DeviceEvent::LinkLost(LinkLost::HungUp { .. })), "{gone:?}");
    tokio::time::sleep(Duration::from_secs(1)).await;
    let (mut native, _) = open(&device).await;
    let status = native.status().await.unwrap();
    assert_eq!((status.fault, status.running), (Some(Cause::LeaseExpired), None));
}
