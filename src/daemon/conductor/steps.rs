//! The steps of a run through the daemon: prepare, measure, evaluate. Each ends with a message,
//! and what follows is decided here.

use std::sync::Arc;

use tokio::sync::oneshot;
use tokio::task::JoinError;

use super::{Activity, Conductor, No, Tenant};
use crate::daemon::hand::{self, Hand, Handled};
use crate::daemon::notice::{Kind, Progress};
use crate::daemon::workshop::{Finished, Prepared, Refusal, Workshop};
use crate::journal::{Journal, JournalError, QueueState, QueuedRun, Writer};
use crate::run::{Ended, Job, Outcome, Running, StartError, Wish};

/// How a step ended.
pub(super) enum Step {
    Evaluated(Result<Finished, Refusal>),
    Handled(&'static str),
    Measured(Result<Outcome, String>),
    Prepared(Result<Prepared, Refusal>),
}

impl<W: Workshop> Conductor<W> {
    pub(super) fn prepare(&mut self, run: QueuedRun) {
        self.is_aborted = false;
        self.is_held = false;
        let tenant = Tenant { id: run.id, name: run.name.clone() };
        self.become_busy(Activity::Preparing(tenant));
        let (workshop, book) = (Arc::clone(&self.workshop), self.book.clone());
        let (id, folder) = (run.id, run.folder.clone());
        self.run = Some(run);
        self.steps.spawn(async move {
            let bundle = match book.with(move |queue| queue.bundle(id)).await {
                Ok(bundle) => bundle.unwrap_or_default(),
                Err(error) => return Step::Prepared(Err(Refusal::new(error.to_string()))),
            };
            let prepare = move || workshop.prepare(&bundle, &folder);
            Step::Prepared(
                tokio::task::spawn_blocking(prepare).await.unwrap_or_else(|e| Err(broken(&e))),
            )
        });
    }

    pub(super) async fn advance(
        &mut self,
        step: Result<Step, JoinError>,
    ) -> Result<(), JournalError> {
        match step {
            Ok(Step::Prepared(prepared)) => self.on_prepared(prepared).await,
            Ok(Step::Measured(measured)) => self.on_measured(measured).await,
            Ok(Step::Evaluated(evaluated)) => self.on_evaluated(evaluated).await,
            Ok(Step::Handled(what)) => {
                self.book.tell(Kind::Hand, None, what, None).await?;
                self.become_free();
                Ok(())
            }
            Err(error) => self.interrupt(&broken(&error).error).await,
        }
    }

    async fn on_prepared(
        &mut self,
        prepared: Result<Prepared, Refusal>,
    ) -> Result<(), JournalError> {
        let was_queued = self.run.as_ref().is_some_and(|run| run.state == QueueState::Queued);
        match prepared {
            Err(refusal) if self.is_aborted => {
                self.end(QueueState::Aborted, Kind::Aborted, &refusal.error).await
            }
            Err(refusal) if was_queued => {
                self.end(QueueState::Failed, Kind::Failed, &refusal.error).await
            }
            Err(refusal) => self.interrupt(&refusal.error).await,
            Ok(_) if self.is_aborted => {
                self.end(QueueState::Aborted, Kind::Aborted, "before anything moved").await
            }
            // As it was: nothing has moved.
            Ok(_) if self.stopping.is_some() => {
                self.become_free();
                Ok(())
            }
            Ok(Prepared::Measured) => self.evaluate().await,
            Ok(Prepared::ToMeasure { job, journal }) => {
                self.measure(*job, *journal, was_queued).await
            }
        }
    }

    async fn measure(
        &mut self,
        job: Job,
        journal: Writer,
        was_queued: bool,
    ) -> Result<(), JournalError> {
        let Some(run) = &self.run else { return Ok(()) };
        let tenant = Tenant { id: run.id, name: run.name.clone() };
        let (kind, text) = if was_queued {
            (Kind::Started, "")
        } else {
            (Kind::Continued, "homes, measures the reference pose again, then what is missing")
        };
        // Noted before anything moves: whatever happens now, the run has begun.
        self.book.set_state(tenant.id, QueueState::Running, kind, text).await?;
        self.become_busy(Activity::Measuring(tenant));
        self.told = Progress::default();
        match self.owner.start(job, journal).await {
            Ok(running) => {
                self.steps.spawn(async move { Step::Measured(until_end(running).await) })
            }
            Err(error) => return self.on_measured(Err(error.to_string())).await,
        };
        if self.is_held {
            // The owner takes orders in turn: the run is there to be paused.
            let _ = self.ask_rig(Wish::Pause).await;
        }
        Ok(())
    }

    async fn on_measured(&mut self, measured: Result<Outcome, String>) -> Result<(), JournalError> {
        match measured {
            _ if self.is_aborted => self.evaluate().await,
            Ok(Outcome::Complete | Outcome::Reached(_)) if self.stopping.is_some() => {
                self.interrupt("the daemon was stopped before the results were written").await
            }
            Ok(Outcome::Aborted | Outcome::Stopped) if self.stopping.is_some() => {
                self.interrupt("the daemon was stopped").await
            }
            Ok(Outcome::Complete | Outcome::Reached(_) | Outcome::Stopped) => self.evaluate().await,
            Ok(Outcome::Aborted) => self.interrupt("stopped at once").await,
            Ok(Outcome::Faulted(fault)) => self.interrupt(&fault.to_string()).await,
            Err(why) => self.interrupt(&why).await,
        }
    }

    async fn evaluate(&mut self) -> Result<(), JournalError> {
        let Some(run) = &self.run else { return Ok(()) };
        let tenant = Tenant { id: run.id, name: run.name.clone() };
        self.book.tell(Kind::Evaluating, Some(run.id), "", None).await?;
        let (workshop, folder) = (Arc::clone(&self.workshop), run.folder.clone());
        self.become_busy(Activity::Evaluating(tenant));
        self.steps.spawn(async move {
            let finish = move || workshop.finish(&folder);
            Step::Evaluated(
                tokio::task::spawn_blocking(finish).await.unwrap_or_else(|e| Err(broken(&e))),
            )
        });
        Ok(())
    }

    async fn on_evaluated(
        &mut self,
        evaluated: Result<Finished, Refusal>,
    ) -> Result<(), JournalError> {
        match evaluated {
            Ok(finished) if self.is_aborted => {
                self.end(QueueState::Aborted, Kind::Aborted, &finished.summary).await
            }
            Err(refusal) if self.is_aborted => {
                let text = format!("its readings are kept; no results: {}", refusal.error);
                self.end(QueueState::Aborted, Kind::Aborted, &text).await
            }
            Ok(finished) if finished.is_complete => {
                self.end(QueueState::Complete, Kind::Complete, &finished.summary).await
            }
            Ok(finished) => self.end(QueueState::Failed, Kind::Failed, &finished.summary).await,
            Err(refusal) => self.end(QueueState::Failed, Kind::Failed, &refusal.error).await,
        }
    }

    /// The run waits for a person, and so does the queue.
    pub(super) async fn interrupt(&mut self, text: &str) -> Result<(), JournalError> {
        self.end(QueueState::Interrupted, Kind::Interrupted, text).await
    }

    async fn end(&mut self, state: QueueState, kind: Kind, text: &str) -> Result<(), JournalError> {
        if let Some(run) = &self.run {
            self.book.set_state(run.id, state, kind, text).await?;
        }
        self.become_free();
        Ok(())
    }

    fn become_free(&mut self) {
        self.run = None;
        self.is_due = true;
        self.become_busy(Activity::Idle);
    }

    /// Drives by hand, if nobody has the rig; the answer goes to whoever asked.
    pub(super) fn drive(&mut self, hand: Hand, answer: oneshot::Sender<Result<Handled, No>>) {
        if let Some(why) = self.why_not_by_hand() {
            let _ = answer.send(Err(why));
            return;
        }
        self.become_busy(Activity::ByHand);
        let (owner, workshop) = (self.owner.clone(), Arc::clone(&self.workshop));
        self.steps.spawn(async move {
            let handled = hand::drive(&owner, workshop.rig(), hand).await;
            // Whoever asked may have gone; the rig has moved all the same.
            let _ = answer.send(handled);
            Step::Handled(match hand {
                Hand::Home => "homed",
                Hand::Jog(_) => "moved",
                Hand::Read { .. } => "took a reading",
            })
        });
    }

    fn why_not_by_hand(&self) -> Option<No> {
        if self.stopping.is_some() {
            return Some(No::Stopping);
        }
        match &*self.activity.borrow() {
            Activity::Idle => None,
            Activity::ByHand => Some(No::NotNow("somebody drives it by hand already".to_owned())),
            activity => activity.tenant().map(|tenant| {
                No::NotNow(format!("run {} ({}) has the rig", tenant.id, tenant.name))
            }),
        }
    }
}

/// Waits for a run's end, and closes its journal.
async fn until_end(running: Running) -> Result<Outcome, String> {
    let Ended { outcome, journal, lost, .. } =
        running.ended().await.map_err(|error: StartError| error.to_string())?;
    let runtime = tokio::runtime::Handle::current();
    // Folding in the log waits for the disk.
    let close = move || runtime.block_on(journal.finish()).and_then(Journal::close);
    let closed = tokio::task::spawn_blocking(close).await.unwrap_or(Err(JournalError::Stopped));
    match lost.or(closed.err()) {
        None => Ok(outcome),
        Some(error) => Err(error.to_string()),
    }
}

fn broken(error: &JoinError) -> Refusal {
    Refusal::new(format!("a defect of this program: {error}"))
}
