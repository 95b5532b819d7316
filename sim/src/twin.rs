//! Devices of other makes, simulated: what each must be able to do to stand on a [`Bench`].
//!
//! A twin speaks one make's language over one line, and moves or reads the one board that all
//! twins of a bench share: so that a light meter sees the scene from where the axes stand that
//! another twin moves. It reads no clock and knows no stream.
//!
//! [`Bench`]: crate::Bench

use firmware_protocol::Instant;

use crate::{FaultKind, SimulatedBoard};

/// A simulated device that speaks another make's language. Calls come with a time that never goes
/// back; before each of them all twins of the bench have been asked to [`follow`](Twin::follow).
pub trait Twin: Send {
    /// Takes the axes that this twin moves to where they are now. Called before anything reads
    /// the board.
    fn follow(&mut self, board: &mut SimulatedBoard, now: Instant) {
        let _ = (board, now);
    }

    /// Bytes have arrived, in order, however cut.
    fn handle_bytes(&mut self, board: &mut SimulatedBoard, now: Instant, bytes: &[u8]);

    /// The moment that [`poll_timeout`](Twin::poll_timeout) named has come.
    fn handle_timeout(&mut self, board: &mut SimulatedBoard, now: Instant);

    /// When it wants to be woken; `None` while nothing is due. May change with every other call.
    fn poll_timeout(&self, board: &SimulatedBoard) -> Option<Instant>;

    /// How many moves it has set out on since it was switched on, or readings it was asked for.
    fn deeds(&self) -> u32 {
        0
    }

    /// Something goes wrong in it, now. What it can't suffer it takes no notice of.
    fn fail(&mut self, board: &mut SimulatedBoard, now: Instant, fault: FaultKind) {
        let _ = (board, now, fault);
    }

    /// What it puts on the wire now; empty when it has nothing to say. Asked after every other
    /// call.
    fn poll_transmit(&mut self) -> Vec<u8>;
}
