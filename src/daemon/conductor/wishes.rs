//! What people ask, and what they are told. Asking twice does no harm, and the answer says what
//! happened.

use super::{Activity, Conductor, No, Order, RunWish};
use crate::daemon::notice::Kind;
use crate::daemon::workshop::Workshop;
use crate::journal::{JournalError, QueueState, QueuedRun};
use crate::run::Wish;

impl<W: Workshop> Conductor<W> {
    /// An error is the queue's file, and ends the daemon.
    pub(super) async fn take_order(&mut self, order: Order) -> Result<(), JournalError> {
        match order {
            Order::Ask { id, wish, answer } => {
                let answered = self.ask(id, wish).await;
                let broken = match &answered {
                    Err(No::Disk(error)) => Some(error.clone()),
                    _ => None,
                };
                // Whoever asked may have gone.
                let _ = answer.send(answered);
                broken.map_or(Ok(()), Err)
            }
            Order::Hand { hand, answer } => {
                self.drive(hand, answer);
                Ok(())
            }
            Order::Wake => {
                self.is_due = true;
                Ok(())
            }
        }
    }

    async fn ask(&mut self, id: i64, wish: RunWish) -> Result<String, No> {
        let run = self.book.run(id).await?.ok_or(No::Missing(id))?;
        let activity = self.activity.borrow().clone();
        if activity.tenant().is_some_and(|tenant| tenant.id == id) {
            return self.ask_tenant(&activity, wish).await;
        }
        match wish {
            RunWish::Abort => self.abort_waiting(&run).await,
            RunWish::Continue => self.continue_waiting(&run),
            RunWish::Pause => pause_waiting(&run),
        }
    }

    async fn ask_tenant(&mut self, activity: &Activity, wish: RunWish) -> Result<String, No> {
        if self.stopping.is_some() {
            return Err(No::Stopping);
        }
        match (activity, wish) {
            (Activity::Preparing(_), RunWish::Abort) => {
                self.is_aborted = true;
                Ok("aborting before anything moves".to_owned())
            }
            (Activity::Preparing(_), RunWish::Continue) => {
                let was_held = std::mem::take(&mut self.is_held);
                Ok(if was_held { "continuing" } else { "running already" }.to_owned())
            }
            (Activity::Preparing(_), RunWish::Pause) => {
                self.is_held = true;
                Ok("pausing before it begins".to_owned())
            }
            (Activity::Measuring(_), _) => {
                let wish = match wish {
                    RunWish::Abort => Wish::Abort,
                    RunWish::Continue => Wish::Continue,
                    RunWish::Pause => Wish::Pause,
                };
                self.is_aborted |= wish == Wish::Abort;
                let answer = self.ask_rig(wish).await?;
                Ok(answer.map_or("ending", crate::run::Answer::text).to_owned())
            }
            (_, RunWish::Abort) if self.is_aborted => Ok("aborted already".to_owned()),
            (_, RunWish::Abort) => {
                Err(No::NotNow("measured already; its results are being written".to_owned()))
            }
            _ => Ok("measured already; its results are being written".to_owned()),
        }
    }

    async fn abort_waiting(&mut self, run: &QueuedRun) -> Result<String, No> {
        match run.state {
            QueueState::Aborted => Ok("aborted already".to_owned()),
            QueueState::Complete | QueueState::Failed => Err(over(run)),
            QueueState::Queued => {
                let text = "before it began";
                self.book.set_state(run.id, QueueState::Aborted, Kind::Aborted, text).await?;
                Ok("aborted; it had not begun".to_owned())
            }
            QueueState::Interrupted | QueueState::Paused | QueueState::Running => {
                if self.continued == Some(run.id) {
                    self.continued = None;
                }
                let text = "what was measured is in its journal";
                self.book.set_state(run.id, QueueState::Aborted, Kind::Aborted, text).await?;
                self.is_due = true;
                Ok("aborted; what was measured is in its journal".to_owned())
            }
        }
    }

    fn continue_waiting(&mut self, run: &QueuedRun) -> Result<String, No> {
        if self.stopping.is_some() {
            return Err(No::Stopping);
        }
        match run.state {
            QueueState::Queued => Ok("waiting for its turn".to_owned()),
            state if state.is_final() => Err(over(run)),
            _ => {
                self.continued = Some(run.id);
                self.is_due = true;
                Ok(if self.steps.is_empty() {
                    "continuing: homes, measures the reference pose again, then what is missing"
                } else {
                    "continues as soon as the rig is free"
                }
                .to_owned())
            }
        }
    }
}

fn pause_waiting(run: &QueuedRun) -> Result<String, No> {
    match run.state {
        QueueState::Queued => Err(No::NotNow(format!(
            "run {} has not begun: there is nothing to pause; abort it, or let it wait",
            run.id
        ))),
        state if state.is_final() => Err(over(run)),
        _ => Ok("at rest already: interrupted".to_owned()),
    }
}

fn over(run: &QueuedRun) -> No {
    No::NotNow(format!("run {} is over already: {}", run.id, run.state.name()))
}
