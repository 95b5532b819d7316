//! What the rig says of itself becomes notices, and the state of the run that has it.

use super::{Activity, Conductor};
use crate::daemon::notice::{Kind, Progress};
use crate::daemon::question;
use crate::daemon::workshop::Workshop;
use crate::journal::{JournalError, QueueState};
use crate::run::{OwnerStatus, State};

impl<W: Workshop> Conductor<W> {
    /// Compares what the rig says with what it said before. What came and went in between is not
    /// worth telling.
    pub(super) async fn notice_rig(&mut self) -> Result<(), JournalError> {
        let now = self.status.borrow_and_update().clone();
        let before = std::mem::replace(&mut self.seen, now.clone());
        if now.position != before.position {
            let text = now.position.to_string();
            self.book.tell(Kind::Position, self.tenant_id(), &text, None).await?;
        }
        let is_measuring = matches!(*self.activity.borrow(), Activity::Measuring(_));
        let (Some(id), true) = (self.tenant_id(), is_measuring) else { return Ok(()) };
        let Some((state, kind, text)) = told_of(&before, &now) else { return Ok(()) };
        self.book.set_state(id, state, kind, &text).await
    }

    /// How far the run is, if that changed.
    pub(super) async fn tell_progress(&mut self) -> Result<(), JournalError> {
        let progress = Progress::from(self.seen.progress);
        if std::mem::replace(&mut self.told, progress) == progress {
            return Ok(());
        }
        let mut text = format!("{} of {} readings", progress.done, progress.total);
        if !self.seen.accuracy.is_empty() {
            text.extend(["; ", &self.seen.accuracy]);
        }
        self.book.tell(Kind::Progress, self.tenant_id(), &text, Some(progress)).await
    }

    fn tenant_id(&self) -> Option<i64> {
        self.activity.borrow().tenant().map(|tenant| tenant.id)
    }
}

/// What a change of the rig's state means for the run that has it.
fn told_of(before: &OwnerStatus, now: &OwnerStatus) -> Option<(QueueState, Kind, String)> {
    let is_news = (before.state, before.asked, &before.fault) != (now.state, now.asked, &now.fault);
    let was_at_rest = matches!(before.state, State::Paused | State::Faulted);
    match now.state {
        _ if !is_news => None,
        State::Faulted => {
            let fault = now.fault.as_ref().map(ToString::to_string).unwrap_or_default();
            Some((QueueState::Paused, Kind::Fault, fault))
        }
        State::Paused => Some(match now.asked {
            Some(source) => (QueueState::Paused, Kind::Asked, question(source).to_owned()),
            None => (QueueState::Paused, Kind::Paused, String::new()),
        }),
        State::Homing | State::Moving | State::Settling | State::Dwelling if was_at_rest => {
            Some((QueueState::Running, Kind::Continued, String::new()))
        }
        _ => None,
    }
}
