//! Homing: each axis creeps until its board has seen the home mark, brakes, comes back to the
//! mark and counts from there. Axes search together. It knows axes and board, not the queue.
//!
//! An axis does not know on which side its mark is. It searches one way as far as the mark can
//! be, then the other way; a limit switch turns it round earlier, and is no fault then.

use core::time::Duration;

use heapless::Vec;

use super::axes::Axes;
use crate::{AXES_MAX, AxisMask, Board, Cause, Instant};

/// How often the board is asked whether a searching axis has passed its home mark. The mark is
/// latched where it is, so that this only sets how far an axis overruns it.
pub const SEARCH_PERIOD: Duration = Duration::from_millis(5);

pub(super) struct Homing {
    seekers: Vec<Seeker, AXES_MAX>,
    /// When to ask next; `None` while no axis searches.
    next_look: Option<Instant>,
}

struct Seeker {
    channel: u8,
    stage: Stage,
}

#[derive(Clone, Copy)]
enum Stage {
    /// Looking out for the mark, with another way to go or none.
    Searching { other_end: Option<f64> },
    /// Braking at a limit switch, to search the other way.
    Turning { other_end: f64 },
    /// The mark was passed: braking.
    Overrunning { mark: f64 },
    /// On the way back to the mark.
    Returning,
    /// Homed.
    Found,
}

impl Homing {
    /// The axes of the mask set out, and have no home until they find it.
    pub(super) fn begin(
        mask: AxisMask,
        now: Instant,
        axes: &mut Axes,
        board: &mut impl Board,
    ) -> Self {
        let mut seekers = Vec::new();
        for (channel, _) in (0_u8..).zip(axes.identities().clone()) {
            if mask.0 >> channel & 1 == 0 {
                continue;
            }
            let (end, other_end) = axes.search_ends(channel);
            axes.unhome(channel);
            board.begin_search(now, channel);
            let stage = if let Some(mark) = board.home_mark(now, channel) {
                axes.creep_to(now, channel, mark, board);
                Stage::Returning
            } else {
                axes.creep_to(now, channel, end, board);
                Stage::Searching { other_end: Some(other_end) }
            };
            let _ = seekers.push(Seeker { channel, stage });
        }
        Self { seekers, next_look: Some(now) }
    }

    /// When to [`progress`](Homing::progress) next, beside the ends of the axes' paths.
    pub(super) const fn due(&self) -> Option<Instant> {
        self.next_look
    }

    /// Goes on at a moment that is due. `true` when all axes are homed.
    pub(super) fn progress(
        &mut self,
        now: Instant,
        axes: &mut Axes,
        board: &mut impl Board,
    ) -> Result<bool, Cause> {
        for seeker in &mut self.seekers {
            seeker.progress(now, axes, board)?;
        }
        let searches = |seeker: &Seeker| matches!(seeker.stage, Stage::Searching { .. });
        self.next_look =
            if self.seekers.iter().any(searches) { Some(now + SEARCH_PERIOD) } else { None };
        Ok(self.seekers.iter().all(|seeker| matches!(seeker.stage, Stage::Found)))
    }

    /// A limit switch opened. `true` if that only ended an axis's search to this side.
    pub(super) fn turn(&mut self, channel: u8, now: Instant, axes: &mut Axes) -> bool {
        let Some(seeker) = self.seekers.iter_mut().find(|seeker| seeker.channel == channel) else {
            return false;
        };
        match seeker.stage {
            Stage::Searching { other_end: Some(other_end) } => {
                axes.brake(now, channel);
                seeker.stage = Stage::Turning { other_end };
                true
            }
            // Braking already, and about to go the other way.
            Stage::Turning { .. } | Stage::Overrunning { .. } => true,
            Stage::Searching { other_end: None } | Stage::Returning | Stage::Found => false,
        }
    }
}

impl Seeker {
    fn progress(
        &mut self,
        now: Instant,
        axes: &mut Axes,
        board: &mut impl Board,
    ) -> Result<(), Cause> {
        while let Some(stage) = self.next_stage(now, axes, board)? {
            self.stage = stage;
        }
        Ok(())
    }

    /// The stage that follows now, if this one has ended. The stages have an order, so that a
    /// seeker passes each at most once a search.
    fn next_stage(
        &self,
        now: Instant,
        axes: &mut Axes,
        board: &mut impl Board,
    ) -> Result<Option<Stage>, Cause> {
        let channel = self.channel;
        Ok(match self.stage {
            Stage::Searching { other_end } => {
                if let Some(mark) = board.home_mark(now, channel) {
                    axes.brake(now, channel);
                    Some(Stage::Overrunning { mark })
                } else if axes.rests(channel) {
                    let end = other_end.ok_or(Cause::HomingMissed(channel))?;
                    axes.creep_to(now, channel, end, board);
                    Some(Stage::Searching { other_end: None })
                } else {
                    None
                }
            }
            Stage::Turning { other_end } if axes.rests(channel) => {
                axes.creep_to(now, channel, other_end, board);
                Some(Stage::Searching { other_end: None })
            }
            Stage::Overrunning { mark } if axes.rests(channel) => {
                axes.creep_to(now, channel, mark, board);
                Some(Stage::Returning)
            }
            Stage::Returning if axes.rests(channel) => {
                board.set_home(now, channel);
                axes.set_home(channel);
                Some(Stage::Found)
            }
            Stage::Turning { .. } | Stage::Overrunning { .. } | Stage::Returning | Stage::Found => {
                None
            }
        })
    }
}
