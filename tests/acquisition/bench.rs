//! A rig, a plan and an owner around the test device.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use firmware_protocol::Shutter;
use gonio::device::Opener;
use gonio::journal::{EffectWishes, Header, Journal, Writer};
use gonio::plan::Step;
use gonio::rig::{AxisPositions, Latched, ReadingKind, Rig};
use gonio::run::{Happening, OwnerHandle, RunEvent, State, own};
use tokio::sync::broadcast;

use crate::board::TestDevice;

pub(crate) const BAUD: u32 = 1_000_000;

pub(crate) fn rig() -> Arc<Rig> {
    Arc::new(Rig::built_in().unwrap())
}

pub(crate) fn device(faults: sim::LinkFaults) -> TestDevice {
    TestDevice::new(rig(), BAUD, faults)
}

/// Steps on a spiral: every axis moves, by little.
pub(crate) fn steps(count: u32) -> Vec<Step> {
    let rig = rig();
    (0..count)
        .map(|id| {
            let t = f64::from(id);
            let positions = AxisPositions([
                0.01 * t.sqrt() * (t * 0.7).cos(),
                0.02 * t.sqrt() * (t * 0.7).sin(),
                1e-3 * (t * 0.3).cos(),
                1e-3 * (t * 0.3).sin(),
            ]);
            let counts = Latched(std::array::from_fn(|i| rig.axes[i].counts(positions.0[i])));
            Step {
                id,
                kind: ReadingKind::Target { index: id, repeat: 0 },
                pose: None,
                positions,
                counts,
                via: None,
                settle: Duration::from_millis(50),
                gain: 0,
                dwell: Duration::from_millis(50),
                shutter: Shutter::Open,
                source_off: false,
                swept: None,
            }
        })
        .collect()
}

/// A journal in a folder of its own.
pub(crate) struct Folder {
    folder: tempfile::TempDir,
}

impl Folder {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.folder.path().join("run.sqlite")
    }

    pub(crate) fn journal(&self, steps: &[Step]) -> Writer {
        let header = Header {
            program_version: "0".into(),
            seed: 1,
            simulated: true,
            rig_name: "test".into(),
            plan_name: "test".into(),
            plan_hash: "00".into(),
            started_utc: "2026-01-01T00:00:00Z".into(),
            effects: Vec::new(),
            effect_wishes: EffectWishes::default(),
        };
        Writer::inline(Journal::create(&self.path(), &header, &[], steps).unwrap())
    }
}

pub(crate) fn owner(opener: Opener) -> OwnerHandle {
    own(rig(), opener, 1).0
}

/// Waits for something to happen.
pub(crate) async fn wait_for(
    events: &mut broadcast::Receiver<RunEvent>,
    mut is_it: impl FnMut(&Happening) -> bool,
) -> Happening {
    loop {
        let event = events.recv().await.unwrap();
        if is_it(&event.happening) {
            return event.happening;
        }
    }
}

pub(crate) async fn wait_for_state(events: &mut broadcast::Receiver<RunEvent>, state: State) {
    wait_for(events, |happening| *happening == Happening::State(state)).await;
}

pub(crate) async fn wait_for_readings(events: &mut broadcast::Receiver<RunEvent>, count: usize) {
    let mut seen = 0;
    wait_for(events, |happening| {
        seen += usize::from(matches!(happening, Happening::Reading(_)));
        seen == count
    })
    .await;
}
