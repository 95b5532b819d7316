//! A board for tests: axes that follow exactly, a converter that says what reading it was for.
//! It answers late, as the simulated one does, and knows nothing of scenes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use firmware_protocol::{AxisIdentity, Board, BoardFault, Device, Illumination, Instant, Shutter};
use tokio::io::DuplexStream;

use gonio::device::{Link, Opener, opener};
use gonio::rig::Rig;

/// A board with the rig's axes, gains and converter.
#[derive(Debug)]
pub(crate) struct TestBoard {
    axes: Vec<AxisIdentity>,
    gains: u8,
    adc: (u8, u32),
    boot_id: u32,
    setpoints: Vec<f64>,
    reading: Illumination,
}

impl TestBoard {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small numbers
    pub(crate) fn new(rig: &Rig, boot_id: u32) -> Self {
        let mut axes: Vec<_> = rig.axes.iter().collect();
        axes.sort_by_key(|axis| axis.channel);
        let axes: Vec<_> = axes
            .into_iter()
            .map(|axis| AxisIdentity {
                low: axis.count_limits().0,
                high: axis.count_limits().1,
                speed: (axis.speed * axis.counts_per_unit).round() as u32,
                acceleration: (axis.acceleration * axis.counts_per_unit).round() as u32,
            })
            .collect();
        Self {
            // Nobody knows where the axes stand at boot.
            setpoints: axes.iter().map(|_| 0.0).collect(),
            axes,
            gains: rig.detector.gains.len() as u8,
            adc: (rig.detector.adc.bits, rig.detector.adc.rate_hz),
            boot_id,
            reading: Illumination { reading: 0, gain: 0, shutter: Shutter::Closed },
        }
    }
}

/// What the board reads in every conversion of this reading, counts.
pub(crate) fn counts_of(reading: u32) -> i32 {
    i32::try_from(1000 + reading % 1000).unwrap()
}

impl Board for TestBoard {
    fn axes(&self) -> &[AxisIdentity] {
        &self.axes
    }
    fn gains(&self) -> u8 {
        self.gains
    }
    fn adc(&self) -> (u8, u32) {
        self.adc
    }
    fn boot_id(&self) -> u32 {
        self.boot_id
    }
    fn answers_late(&self) -> bool {
        true
    }
    fn set_setpoint(&mut self, _: Instant, channel: u8, counts: f64) {
        self.setpoints[usize::from(channel)] = counts;
    }
    #[allow(clippy::cast_possible_truncation)] // inside the travel
    fn readback(&mut self, _: Instant, channel: u8) -> i32 {
        self.setpoints[usize::from(channel)].round() as i32
    }
    fn begin_search(&mut self, _: Instant, _: u8) {}
    fn home_mark(&mut self, _: Instant, _: u8) -> Option<f64> {
        Some(0.0)
    }
    fn set_home(&mut self, _: Instant, channel: u8) {
        self.setpoints[usize::from(channel)] = 0.0;
    }
    fn begin_dwell(&mut self, _: Instant, illumination: Illumination) {
        self.reading = illumination;
    }
    fn convert(&mut self, _: Instant) -> Result<i32, BoardFault> {
        match self.reading.shutter {
            Shutter::Open => Ok(counts_of(self.reading.reading)),
            Shutter::Closed => Ok(0),
        }
    }
    fn fault(&mut self, _: Instant) -> Option<BoardFault> {
        None
    }
}

/// A device in this process that can be reached again and again, unplugged, and switched off and
/// on.
#[derive(Clone)]
pub(crate) struct TestDevice {
    rig: Arc<Rig>,
    device: Arc<tokio::sync::Mutex<Device<TestBoard>>>,
    boot: tokio::time::Instant,
    baud: u32,
    cut: Arc<tokio::sync::Notify>,
    opened: Arc<AtomicU32>,
    boots: Arc<AtomicU32>,
    faults: sim::LinkFaults,
}

impl TestDevice {
    pub(crate) fn new(rig: Arc<Rig>, baud: u32, faults: sim::LinkFaults) -> Self {
        let device = Device::new(TestBoard::new(&rig, 0));
        Self {
            rig,
            device: Arc::new(tokio::sync::Mutex::new(device)),
            boot: tokio::time::Instant::now(),
            baud,
            cut: Arc::default(),
            opened: Arc::default(),
            boots: Arc::default(),
            faults,
        }
    }

    /// Breaks the link that is open.
    pub(crate) fn cut(&self) {
        self.cut.notify_waiters();
    }

    /// Switches off and on: another boot, nothing homed. The link must be down.
    pub(crate) async fn restart(&self) {
        let mut device = self.device.lock().await;
        let boot_id = self.boots.fetch_add(1, Ordering::Relaxed) + 1;
        *device = Device::new(TestBoard::new(&self.rig, boot_id));
    }

    /// How often the link was opened.
    pub(crate) fn opened(&self) -> u32 {
        self.opened.load(Ordering::Relaxed)
    }

    pub(crate) fn stream(&self) -> DuplexStream {
        let (host, far) = tokio::io::duplex(4096);
        let Self { device, boot, baud, cut, faults, .. } = self.clone();
        let opened = self.opened.fetch_add(1, Ordering::Relaxed);
        tokio::spawn(async move {
            let mut device = device.lock().await;
            let wire = sim::Wire::new(baud).with_faults(faults, u64::from(opened) + 1);
            tokio::select! {
                biased;
                () = cut.notified() => {}
                served = sim::serve(far, &mut device, boot, wire) => served.unwrap(),
            }
        });
        host
    }

    pub(crate) fn opener(&self) -> Opener {
        let device = self.clone();
        opener(move || {
            let stream = device.stream();
            async move { Ok(Link::new("simulated", stream)) }
        })
    }
}
