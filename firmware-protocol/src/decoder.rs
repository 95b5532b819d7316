//! Finds frames in a stream of bytes, however it is cut into slices. After anything that is no
//! frame it starts again at the next delimiter, and counts why.

use crate::frame::{self, Frame, FrameError};

/// What fits between two delimiters: a frame with its COBS code byte.
const PACKED_MAX: usize = frame::DECODED_MAX + 1;

/// Frames refused, by cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BadFrames {
    /// Longer than a frame can be.
    pub too_long: u32,
    /// A COBS code beyond the end.
    pub cobs: u32,
    /// Shorter than header and check.
    pub too_short: u32,
    /// Stated length unlike the one found.
    pub length: u32,
    /// Wrong check.
    pub check: u32,
}

impl BadFrames {
    /// All causes together.
    pub const fn total(&self) -> u32 {
        self.too_long
            .saturating_add(self.cobs)
            .saturating_add(self.too_short)
            .saturating_add(self.length)
            .saturating_add(self.check)
    }

    fn count(&mut self, error: FrameError) {
        let cause = match error {
            FrameError::TooLong => &mut self.too_long,
            FrameError::Cobs => &mut self.cobs,
            FrameError::TooShort(_) => &mut self.too_short,
            FrameError::Length(..) => &mut self.length,
            FrameError::Check(..) => &mut self.check,
        };
        *cause = cause.saturating_add(1);
    }
}

/// The receiving end of a wire.
#[derive(Debug, Clone)]
pub struct Decoder {
    packed: [u8; PACKED_MAX],
    /// How much of `packed` is filled; beyond it: the frame is too long, and being discarded.
    filled: usize,
    bad: BadFrames,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { packed: [0; PACKED_MAX], filled: 0, bad: BadFrames::default() }
    }
}

impl Decoder {
    /// Takes bytes from the front of `bytes` up to the next frame, good or bad; `None` when
    /// they are used up. Call again until then.
    pub fn next_frame(&mut self, bytes: &mut &[u8]) -> Option<Result<Frame<'_>, FrameError>> {
        loop {
            let delimiter = bytes.iter().position(|byte| *byte == 0);
            let (piece, rest) = bytes.split_at(delimiter.unwrap_or(bytes.len()));
            self.fill(piece);
            *bytes = rest.get(1..).unwrap_or(&[]);
            delimiter?;
            let filled = core::mem::take(&mut self.filled);
            // Two delimiters in a row enclose nothing: that is how every frame begins.
            if filled > 0 {
                return Some(self.finish(filled));
            }
        }
    }

    /// What was refused so far.
    pub const fn bad(&self) -> BadFrames {
        self.bad
    }

    fn fill(&mut self, piece: &[u8]) {
        let end = self.filled.saturating_add(piece.len());
        if let Some(room) = self.packed.get_mut(self.filled..end) {
            room.copy_from_slice(piece);
        }
        self.filled = end;
    }

    fn finish(&mut self, filled: usize) -> Result<Frame<'_>, FrameError> {
        let result = match self.packed.get_mut(..filled) {
            Some(packed) => frame::decode(packed),
            None => Err(FrameError::TooLong),
        };
        if let Err(error) = result {
            self.bad.count(error);
        }
        result
    }
}
