//! The windows of sweeps: each said once, kept until its sweep's result is acknowledged, and
//! fetched again by its index where it was lost on the way. It knows no frame.

use heapless::Vec;

use super::WINDOWS_MAX;
use crate::{CommandId, Window};

#[derive(Default)]
pub(super) struct Windows {
    /// In the order in which they were taken.
    kept: Vec<Window, WINDOWS_MAX>,
    /// How many of them were said.
    said: usize,
}

impl Windows {
    /// Whether all windows of a sweep find a place.
    pub(super) fn has_room(&self, windows: u16) -> bool {
        self.kept.len() + usize::from(windows) <= WINDOWS_MAX
    }

    pub(super) fn keep(&mut self, window: Window) {
        let kept = self.kept.push(window);
        debug_assert!(kept.is_ok(), "a sweep starts only where all its windows have a place");
    }

    /// The next to say, in order.
    pub(super) fn poll(&mut self) -> Option<Window> {
        let window = self.kept.get(self.said)?.clone();
        self.said += 1;
        Some(window)
    }

    /// Says none of those that wait: their sweep has failed, and its host shall hear of that
    /// first.
    pub(super) fn hush(&mut self) {
        self.said = self.kept.len();
    }

    pub(super) fn get(&self, id: CommandId, index: u16) -> Option<&Window> {
        self.kept.iter().find(|window| (window.id, window.index) == (id, index))
    }

    /// Forgets the windows of a sweep.
    pub(super) fn release(&mut self, id: CommandId) {
        let said = self.kept.iter().take(self.said);
        self.said = said.filter(|window| window.id != id).count();
        self.kept.retain(|window| window.id != id);
    }

    pub(super) fn clear(&mut self) {
        self.kept.clear();
        self.said = 0;
    }
}
