//! The rig at the end of its link: reached on demand, and again after the link was lost.

use std::sync::Arc;
use std::time::Duration;

use firmware_protocol::{Identity, Status};
use thiserror::Error;

use crate::device::{ConnectError, Disagreement, Native, Opener, SerialError, check_agreement};
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
}

/// See the module.
pub(super) struct Hardware {
    pub(super) rig: Arc<Rig>,
    pub(super) native: Option<Native>,
    opener: Opener,
    session: u32,
}

impl Hardware {
    pub(super) fn new(rig: Arc<Rig>, opener: Opener, session: u32) -> Self {
        Self { rig, native: None, opener, session }
    }

    /// Opens a session: over the link that there is, because opening a port resets some boards;
    /// or else over a new one.
    pub(super) async fn reach(&mut self) -> Result<Reached, ReachError> {
        if let Some(mut native) = self.native.take()
            && let Ok(identity) = native.identify(PATIENCE).await
            && let Ok(status) = native.status().await
            && let Ok(windows) = native.windows(&identity).await
        {
            check_agreement(&identity, &self.rig)?;
            self.native = Some(native);
            return Ok(Reached { identity, status, windows });
        }
        let link = (self.opener)().await?;
        self.session = self.session.wrapping_add(SESSION_STRIDE);
        let baud = self.rig.link.baud();
        let (mut native, identity) = Native::connect(link, self.session, baud, PATIENCE).await?;
        check_agreement(&identity, &self.rig)?;
        let status = native.status().await?;
        let windows = native.windows(&identity).await?;
        self.native = Some(native);
        Ok(Reached { identity, status, windows })
    }

    /// Lets go of the link, after stopping what may move.
    pub(super) async fn close(&mut self) {
        if let Some(native) = self.native.take() {
            native.close().await;
        }
    }
}
