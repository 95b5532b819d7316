//! The thread that a rig lives on: its own runtime, so that nothing that the daemon does for its
//! clients can make the device's lease expire.

use std::io;
use std::thread::JoinHandle;

use tokio::task;

use crate::run::OwnerHandle;

/// A rig's owner on a thread of its own.
#[derive(Debug)]
pub struct RigThread {
    owner: OwnerHandle,
    thread: JoinHandle<()>,
}

impl RigThread {
    /// Starts the thread. `own` is called on it, within its runtime, and starts the owner there.
    pub fn start(
        own: impl FnOnce() -> (OwnerHandle, task::JoinHandle<()>) + Send + 'static,
    ) -> io::Result<Self> {
        let (started, owner) = std::sync::mpsc::sync_channel(1);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let live = move || {
            runtime.block_on(async {
                let (handle, task) = own();
                // Whoever started us waits for it.
                let _ = started.send(handle);
                // Ends when the owner is shut down, or when its last handle goes.
                let _ = task.await;
            });
        };
        let thread = std::thread::Builder::new().name("rig".to_owned()).spawn(live)?;
        let owner = owner.recv().map_err(|_| io::Error::other("the rig's thread ended at once"))?;
        Ok(Self { owner, thread })
    }

    /// How to speak to the owner.
    pub fn owner(&self) -> OwnerHandle {
        self.owner.clone()
    }

    /// Brings the rig to rest, lets go of it, and waits for the thread's end.
    pub fn end(self) {
        let Self { owner, thread } = self;
        let Ok(runtime) = tokio::runtime::Builder::new_current_thread().build() else { return };
        runtime.block_on(owner.shut_down());
        drop(owner);
        let _ = thread.join();
    }
}
