//! A bench for tests: a rig as its file would state it, and a host that is no more than the
//! protocol's endpoint on a byte stream.
#![allow(dead_code, unreachable_pub)] // each test takes what it needs

use std::sync::Arc;
use std::time::Duration;

use firmware_protocol::{
    AxisCounts, AxisMask, CommandId, Device, Done, Dwell, DwellResult, Event, Home, HostEndpoint,
    HostEvent, Instant, MoveTo, Reply, Request, Shutter, Sweep, Window, frame,
};
use sim::{
    Compiled, Nominal, NominalAxis, NominalDetector, NominalGain, Quantity, Scene, Simulated,
    SimulatedBoard, Terms, compile,
};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

pub const COUNTS_PER_DEG: f64 = 400.0;
pub const COUNTS_PER_M: f64 = 200_000.0;

/// A rig without any uncertainty and without noise but shot noise. The channels are not in the
/// axes' order, and one axis counts backwards.
pub fn exact_rig() -> Nominal {
    let per_rad = COUNTS_PER_DEG * 180.0 / core::f64::consts::PI;
    let axis = |channel, counts_per_unit: f64, travel: i32| NominalAxis {
        channel,
        home: 0.0,
        counts_per_unit,
        travel_counts: (-travel, travel),
        speed_counts_per_s: 24_000,
        acceleration_counts_per_s2: 48_000,
        settle_s: 0.0,
        has_encoder: true,
        u_zero: 0.0,
        u_homing: 0.0,
        u_readback: 0.0,
    };
    Nominal {
        quantity: Quantity::Radiance,
        axes: [
            axis(2, per_rad, 38_000),
            axis(0, per_rad, 72_000),
            axis(3, COUNTS_PER_M, 10_000),
            axis(1, -COUNTS_PER_M, 10_000),
        ],
        detector: NominalDetector {
            distance_m: 0.3,
            u_distance_m: 0.0,
            pupil_radius_m: 0.006_25,
            u_pupil_radius_m: 0.0,
            spot_radius_m: 0.002_5,
            u_spot_radius_m: 0.0,
            responsivity_a_per_w: 0.2,
            u_responsivity_relative: 0.0,
            read_noise_a: 0.0,
            gains: vec![
                NominalGain { name: "1 uA".into(), full_scale_a: 1e-6, u_relative: 0.0 },
                NominalGain { name: "10 nA".into(), full_scale_a: 1e-8, u_relative: 0.0 },
            ],
            adc_bits: 24,
            adc_rate_hz: 2000,
        },
    }
}

/// Compiled without the finite beam, which has tests of its own: a reading is the radiance of one
/// ray.
pub fn compiled(scene: Scene, nominal: Nominal, seed: u64) -> Arc<Compiled> {
    let without = vec!["finite-beam".to_owned()];
    let terms = Terms { without, ..Terms::seeded(seed) };
    Arc::new(compile(scene, nominal, Simulated::default(), &terms).expect("a sound rig"))
}

pub fn device(compiled: &Arc<Compiled>) -> Device<SimulatedBoard> {
    Device::new(SimulatedBoard::new(Arc::clone(compiled), 0))
}

/// Counts in channel order for a pose in degrees and metres.
pub fn counts(theta_deg: f64, phi_deg: f64, x_m: f64, y_m: f64) -> AxisCounts {
    let by_channel = [
        phi_deg * COUNTS_PER_DEG,
        -y_m * COUNTS_PER_M,
        theta_deg * COUNTS_PER_DEG,
        x_m * COUNTS_PER_M,
    ];
    #[allow(clippy::cast_possible_truncation)]
    AxisCounts(by_channel.into_iter().map(|counts| counts.round() as i32).collect())
}

/// The endpoint, its stream and its clock.
pub struct Host<S> {
    endpoint: HostEndpoint,
    stream: S,
    boot: tokio::time::Instant,
    next_id: u32,
    spoke: Instant,
}

impl<S: AsyncRead + AsyncWrite + Unpin> Host<S> {
    pub fn new(stream: S, session: u32, baud: u32) -> Self {
        let boot = tokio::time::Instant::now();
        Self {
            endpoint: HostEndpoint::new(session, baud),
            stream,
            boot,
            next_id: 0,
            spoke: Instant::ZERO,
        }
    }

    fn now(&self) -> Instant {
        Instant::ZERO + self.boot.elapsed()
    }

    fn id(&mut self) -> CommandId {
        self.next_id += 1;
        CommandId(self.next_id)
    }

    /// The next event; signs of life go out meanwhile.
    pub async fn event(&mut self) -> HostEvent {
        loop {
            if let Some(event) = self.endpoint.poll_event() {
                return event;
            }
            let mut wire = [0; frame::WIRE_MAX];
            while let Some(len) = self.endpoint.poll_transmit(self.now(), &mut wire) {
                self.stream.write_all(&wire[..len]).await.unwrap();
                self.spoke = self.now();
            }
            let alive = self.spoke + Duration::from_millis(100);
            let deadline = self.endpoint.poll_timeout().map_or(alive, |at| at.min(alive));
            let mut buffer = [0; 256];
            tokio::select! {
                biased;
                () = tokio::time::sleep_until(self.boot + (deadline - Instant::ZERO)) => {
                    self.endpoint.handle_timeout(self.now());
                    if deadline == alive {
                        self.spoke = self.now();
                        let _ = self.endpoint.submit(self.now(), Request::KeepAlive);
                    }
                }
                read = self.stream.read(&mut buffer) => {
                    let n = read.unwrap();
                    assert!(n > 0, "the stream ended");
                    self.endpoint.handle_bytes(self.now(), &buffer[..n]);
                }
            }
        }
    }

    pub async fn identify(&mut self) -> Reply {
        self.endpoint.identify(self.now());
        self.reply().await
    }

    /// Submits once the window has room.
    async fn submit(&mut self, request: Request) {
        while self.endpoint.submit(self.now(), request.clone()).is_err() {
            let event = self.event().await;
            assert!(matches!(event, HostEvent::Reply { .. }), "{event:?}");
        }
    }

    /// The next reply that is not to a sign of life.
    async fn reply(&mut self) -> Reply {
        loop {
            match self.event().await {
                HostEvent::Reply { reply: Reply::Alive | Reply::Acknowledged(_), .. }
                | HostEvent::Event(Event::Started(..)) => {}
                HostEvent::Reply { reply, .. } => return reply,
                other => panic!("{other:?}"),
            }
        }
    }

    /// The next result, acknowledged.
    async fn result(&mut self) -> Event {
        loop {
            match self.event().await {
                HostEvent::Event(Event::Started(..)) => {}
                HostEvent::Event(event) => {
                    let id = match &event {
                        Event::Done(done) => done.id,
                        Event::Sampled(sampled) => sampled.id,
                        Event::Failed(id, ..) | Event::Started(id, _) => *id,
                        Event::Window(_) => return event,
                    };
                    self.submit(Request::Acknowledge(id)).await;
                    return event;
                }
                HostEvent::Reply { reply: Reply::Rejected(id, why), .. } => {
                    panic!("{id:?} rejected: {why:?}")
                }
                HostEvent::Reply { .. } => {}
                other => panic!("{other:?}"),
            }
        }
    }

    async fn done(&mut self) -> Done {
        match self.result().await {
            Event::Done(done) => done,
            other => panic!("{other:?}"),
        }
    }

    pub async fn home(&mut self) -> Done {
        let id = self.id();
        self.submit(Request::Home(Home { id, axes: AxisMask(0b1111) })).await;
        self.done().await
    }

    pub async fn move_to(&mut self, targets: AxisCounts) -> Done {
        let id = self.id();
        self.submit(Request::MoveTo(MoveTo { id, targets })).await;
        self.done().await
    }

    pub async fn dwell(&mut self, reading: u32, gain: u8, shutter: Shutter) -> DwellResult {
        let id = self.id();
        let dwell = Dwell { id, reading, gain, shutter, settle_us: 50_000, duration_us: 100_000 };
        self.submit(Request::Dwell(dwell)).await;
        match self.result().await {
            Event::Sampled(result) => result,
            other => panic!("{other:?}"),
        }
    }

    /// The windows of a sweep, in order: those that were lost on the way are fetched.
    pub async fn sweep(&mut self, sweep: Sweep) -> Vec<Window> {
        let id = self.id();
        let count = sweep.windows;
        self.submit(Request::Sweep(Sweep { id, ..sweep })).await;
        let mut windows = std::collections::BTreeMap::new();
        loop {
            match self.event().await {
                HostEvent::Event(Event::Window(window)) => {
                    windows.insert(window.index, window);
                }
                HostEvent::Event(Event::Done(_)) => break,
                HostEvent::Event(Event::Failed(..)) => panic!("the sweep failed"),
                HostEvent::Reply { reply: Reply::Rejected(_, why), .. } => panic!("{why:?}"),
                _ => {}
            }
        }
        let missing: Vec<u16> = (0..count).filter(|index| !windows.contains_key(index)).collect();
        for index in missing {
            self.submit(Request::FetchWindow(id, index)).await;
            match self.reply().await {
                Reply::Fetched(window) => windows.insert(index, window),
                other => panic!("{other:?}"),
            };
        }
        self.submit(Request::Acknowledge(id)).await;
        windows.into_values().collect()
    }

    /// The number of the last command that another host gave this device.
    pub fn set_last_id(&mut self, last: u32) {
        self.next_id = last;
    }
}
