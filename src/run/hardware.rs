//! The rig at the end of its link: reached on demand, and again after the link was lost.

use std::sync::Arc;
use std::time::Duration;

use firmware_protocol::{Identity, Status};
use thiserror::Error;
use tokio::task::JoinHandle;

use crate::device::{
    Composer, ConnectError, Controller, Disagreement, Openers, SerialError, check_agreement,
};
use crate::rig::Rig;

/// How long a device may take to answer to its name.
const PATIENCE: Duration = Duration::from_secs(3);
/// Between the numbers of sessions on successive links: the driver counts upwards on each.
const SESSION_STRIDE: u32 = 0x1_0000;

/// Why the rig can't be reached, or is not the one that was expected. Nothing has moved.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ReachError {
    /// The port does not open.
    #[error(transparent)]
    Open(#[from] SerialError),
    /// Nobody answers on it, or somebody else does.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// Nothing opens a link.
    #[error("the rig has no link to open")]
    NoLink,
    /// A device answers, but not the one that the rig file describes.
    #[error("{0}; correct the rig file, or plug in its rig")]
    Disagrees(#[from] Disagreement),
}

/// A device that answers.
#[derive(Debug, Clone)]
pub(super) struct Reached {
    /// Who it is.
    pub(super) identity: Identity,
    /// How it is.
    pub(super) status: Status,
    /// The most windows that a sweep of it can have; 0: it can't sweep.
    pub(super) windows: u16,
    /// What the devices of a rig of several call themselves.
    pub(super) devices: Vec<String>,
}

/// See the module.
pub(super) struct Hardware {
    pub(super) rig: Arc<Rig>,
    pub(super) controller: Option<Controller>,
    openers: Openers,
    session: u32,
    // The task of the controller that was let go last: until it ends, the ports are its.
    leaving: Option<JoinHandle<()>>,
}

impl Hardware {
    pub(super) fn new(rig: Arc<Rig>, openers: Openers, session: u32) -> Self {
        Self { rig, controller: None, openers, session, leaving: None }
    }

    /// Opens a session: over the links that there are, because opening a port resets some boards;
    /// or else over new ones.
    pub(super) async fn reach(&mut self) -> Result<Reached, ReachError> {
        if let Some(mut controller) = self.controller.take() {
            if let Ok(identity) = controller.identify(PATIENCE).await
                && let Ok(status) = controller.status().await
                && let Ok(windows) = controller.windows(&identity).await
            {
                check_agreement(&identity, &self.rig)?;
                let devices = controller.devices().to_vec();
                self.controller = Some(controller);
                return Ok(Reached { identity, status, windows, devices });
            }
            self.leaving = Some(controller.let_go());
        }
        self.gone().await;
        self.session = self.session.wrapping_add(SESSION_STRIDE);
        let (mut controller, identity) = self.connect().await?;
        check_agreement(&identity, &self.rig)?;
        let status = controller.status().await?;
        let windows = controller.windows(&identity).await?;
        let devices = controller.devices().to_vec();
        self.controller = Some(controller);
        Ok(Reached { identity, status, windows, devices })
    }

    async fn connect(&mut self) -> Result<(Controller, Identity), ReachError> {
        let mut links = Vec::new();
        for open in &mut self.openers.0 {
            links.push(open().await?);
        }
        if let Some(composer) = Composer::of(&self.rig, self.session) {
            return Ok(Controller::compose(composer, links).await?);
        }
        let link = links.pop().ok_or(ReachError::NoLink)?;
        let baud = self.rig.link.baud();
        Ok(Controller::connect(link, self.session, baud, PATIENCE).await?)
    }

    /// Lets go of the links, after stopping what may move; returns before that is done.
    pub(super) fn let_go(&mut self) {
        if let Some(controller) = self.controller.take() {
            self.leaving = Some(controller.let_go());
        }
    }

    /// As [`Hardware::let_go`], and waits for it.
    pub(super) async fn close(&mut self) {
        self.let_go();
        self.gone().await;
    }

    /// Waits until nobody of ours has the ports any more.
    async fn gone(&mut self) {
        if let Some(task) = self.leaving.take() {
            let _ = task.await;
        }
    }
}
