//! A whole device but for its hardware: the link and the core behind it, as one machine. What
//! firmware's main loop pumps, and a simulator's task.

use crate::{BadFrames, Board, DeviceCore, DeviceEndpoint, Instant};

/// Bytes in, bytes out, a board underneath.
///
/// A main loop hands in what the wire brought and the time; sends what `poll_transmit` gives;
/// and sleeps until bytes come or `poll_timeout`. There is no event to poll: everything that
/// happens goes out over the wire, or to the board.
pub struct Device<B> {
    link: DeviceEndpoint,
    core: DeviceCore<B>,
    heard: Instant,
}

impl<B: Board> Device<B> {
    /// A device that has just booted: at rest, unhomed, without a session.
    pub fn new(board: B) -> Self {
        let core = DeviceCore::new(board);
        Self { link: DeviceEndpoint::new(core.identity()), core, heard: Instant::ZERO }
    }

    /// Takes what the wire brought, in slices of any size, and executes what it asks for.
    pub fn handle_bytes(&mut self, now: Instant, bytes: &[u8]) {
        // At most one frame ends in each piece, so that it makes no difference how the bytes
        // were cut: one request is executed, with all that it causes, before the next is read.
        for piece in bytes.split_inclusive(|byte| *byte == 0) {
            self.link.handle_bytes(now, piece);
            self.execute(now);
        }
    }

    /// The time is `now`: carries motion and dwells on, ends the lease, says results again.
    /// Needed at [`Self::poll_timeout`]'s moment, harmless at any time.
    pub fn handle_timeout(&mut self, now: Instant) {
        self.core.handle_timeout(now);
        self.link.handle_timeout(now);
        self.say_what_happened();
    }

    /// Writes the next frame to `out`, which should have [`crate::frame::WIRE_MAX`] bytes, and
    /// gives its length. Call after `handle_bytes` and `handle_timeout`, whenever the wire can
    /// take a frame, until it gives `None`; then ask [`Self::poll_timeout`].
    pub fn poll_transmit(&mut self, now: Instant, out: &mut [u8]) -> Option<usize> {
        // Windows come one at a time, as fast as the wire takes them.
        self.say_what_happened();
        self.link.poll_transmit(now, out)
    }

    /// When to call [`Self::handle_timeout`]; it may change with every other call. `None` while
    /// nothing moves, waits or is to be said again.
    pub fn poll_timeout(&self) -> Option<Instant> {
        [self.core.poll_timeout(), self.link.poll_timeout()].into_iter().flatten().min()
    }

    /// The core, to look at.
    pub const fn core(&self) -> &DeviceCore<B> {
        &self.core
    }

    /// The hardware underneath, to be changed from outside: by an interrupt, or by a test.
    pub const fn board_mut(&mut self) -> &mut B {
        self.core.board_mut()
    }

    /// Frames refused so far.
    pub const fn bad(&self) -> BadFrames {
        self.link.bad()
    }

    fn execute(&mut self, now: Instant) {
        if self.heard != self.link.heard() {
            self.heard = self.link.heard();
            self.core.link_heard(now);
        }
        while let Some(incoming) = self.link.poll_event() {
            let reply = self.core.handle_request(now, &incoming.request);
            self.link.answer(incoming.reply_to, reply);
        }
        self.say_what_happened();
    }

    /// Hands the core's events to the link. What finds no room stays in the core.
    fn say_what_happened(&mut self) {
        while self.link.has_room() {
            let Some(event) = self.core.poll_event() else { return };
            if self.link.say(event).is_err() {
                return;
            }
        }
    }
}
