//! Who has the rig: one run after the other, or a hand. It takes the queue in order, carries an
//! interrupted run on only when a person says so, and lets nothing else begin before that.
//!
//! It runs on the real clock and waits for nothing but messages: what takes long goes on
//! elsewhere, as one step at a time. It knows no HTTP and no files.

mod notice_rig;
mod steps;
mod wishes;

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinSet;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until};
use tokio_util::sync::CancellationToken;

use super::book::Book;
use super::hand::{Hand, Handled};
use super::notice::{Kind, Progress};
use super::workshop::Workshop;
use crate::journal::{JournalError, QueueState, QueuedRun};
use crate::run::{Answer, OwnerHandle, OwnerStatus, Wish};
use steps::Step;

/// How long the rig's thread may take to answer a wish. It never waits for the device with it.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// How long a stop may finish the dwell that runs before the axes are stopped at once; after as
/// long again the rig is given up on.
const GENTLE: Duration = Duration::from_secs(10);
/// How often progress is told, at most: each notice is a write to the disk.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

/// What people ask of the conductor.
#[derive(Debug)]
pub(super) enum Order {
    /// Something of a run.
    Ask { id: i64, wish: RunWish, answer: oneshot::Sender<Result<String, No>> },
    /// To drive the rig by hand.
    Hand { hand: Hand, answer: oneshot::Sender<Result<Handled, No>> },
    /// To look at the queue again.
    Wake,
}

/// What people ask of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RunWish {
    Abort,
    Continue,
    Pause,
}

/// Why it is not done.
#[derive(Debug)]
pub(super) enum No {
    /// The queue's file says no.
    Disk(JournalError),
    /// The rig can't go there.
    Limit(String),
    /// There is no such run.
    Missing(i64),
    /// Not in this state.
    NotNow(String),
    /// The rig tried, and could not.
    Rig(String),
    /// The daemon is about to end.
    Stopping,
}

impl From<JournalError> for No {
    fn from(error: JournalError) -> Self {
        Self::Disk(error)
    }
}

/// Who has the rig, for whoever asks.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) enum Activity {
    ByHand,
    Evaluating(Tenant),
    #[default]
    Idle,
    Measuring(Tenant),
    Preparing(Tenant),
}

/// The run that has the rig.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tenant {
    pub(super) id: i64,
    pub(super) name: String,
}

impl Activity {
    pub(super) fn tenant(&self) -> Option<&Tenant> {
        match self {
            Self::Evaluating(tenant) | Self::Measuring(tenant) | Self::Preparing(tenant) => {
                Some(tenant)
            }
            Self::ByHand | Self::Idle => None,
        }
    }
}

/// How the daemon is told to end.
#[derive(Debug, Clone, Default)]
pub struct Shutdown {
    /// Finish the dwell that runs, bring the axes to rest, note everything, end.
    pub gently: CancellationToken,
    /// Bring the axes to rest now.
    pub at_once: CancellationToken,
}

/// See the module.
pub(super) struct Conductor<W: Workshop> {
    workshop: Arc<W>,
    book: Book,
    owner: OwnerHandle,
    status: watch::Receiver<OwnerStatus>,
    orders: mpsc::Receiver<Order>,
    shutdown: Shutdown,
    activity: watch::Sender<Activity>,
    // At most one at a time.
    steps: JoinSet<Step>,
    run: Option<QueuedRun>,
    seen: OwnerStatus,
    told: Progress,
    // The queue may have something to do.
    is_due: bool,
    // The interrupted run that a person wants carried on.
    continued: Option<i64>,
    // The run that has the rig is to be aborted, or held as soon as it begins.
    is_aborted: bool,
    is_held: bool,
    stopping: Option<Stopping>,
}

#[derive(Debug, Clone, Copy)]
enum Stopping {
    Gently(Instant),
    AtOnce(Instant),
}

impl Stopping {
    fn deadline(self) -> Instant {
        match self {
            Self::Gently(deadline) | Self::AtOnce(deadline) => deadline,
        }
    }
}

impl<W: Workshop> Conductor<W> {
    pub(super) fn new(
        workshop: Arc<W>,
        book: Book,
        owner: OwnerHandle,
        orders: mpsc::Receiver<Order>,
        activity: watch::Sender<Activity>,
        shutdown: Shutdown,
    ) -> Self {
        let (seen, status) = (owner.status(), owner.watch());
        Self {
            workshop,
            book,
            owner,
            status,
            orders,
            shutdown,
            activity,
            steps: JoinSet::new(),
            run: None,
            seen,
            told: Progress::default(),
            is_due: true,
            continued: None,
            is_aborted: false,
            is_held: false,
            stopping: None,
        }
    }

    /// Conducts until a shutdown; the axes are at rest and everything is noted when this returns.
    /// An error is a queue that can't be written any more.
    pub(super) async fn conduct(mut self) -> Result<(), JournalError> {
        let mut progress = interval(PROGRESS_EVERY);
        progress.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            if self.steps.is_empty() {
                if self.stopping.is_some() {
                    return Ok(());
                }
                if std::mem::take(&mut self.is_due) {
                    self.begin_next().await?;
                }
            }
            let is_measuring = matches!(*self.activity.borrow(), Activity::Measuring(_));
            let deadline = self.stopping.map(Stopping::deadline);
            let shutdown = self.shutdown.clone();
            tokio::select! {
                biased;
                () = shutdown.at_once.cancelled(), if !self.is_stopping_at_once() => {
                    self.stop(Wish::Abort).await?;
                }
                () = shutdown.gently.cancelled(), if self.stopping.is_none() => {
                    self.stop(Wish::Stop).await?;
                }
                () = sleep_until(deadline.unwrap_or_else(Instant::now)), if deadline.is_some() => {
                    if self.is_stopping_at_once() {
                        return self.give_up().await;
                    }
                    self.stop(Wish::Abort).await?;
                }
                Some(step) = self.steps.join_next() => self.advance(step).await?,
                Ok(()) = self.status.changed() => self.notice_rig().await?,
                order = self.orders.recv() => match order {
                    Some(order) => self.take_order(order).await?,
                    None => shutdown.gently.cancel(),
                },
                _ = progress.tick(), if is_measuring => self.tell_progress().await?,
            }
        }
    }

    fn is_stopping_at_once(&self) -> bool {
        matches!(self.stopping, Some(Stopping::AtOnce(_)))
    }

    /// Brings the rig to rest. What follows, follows when the step ends.
    async fn stop(&mut self, wish: Wish) -> Result<(), JournalError> {
        if self.stopping.is_none() {
            self.book.tell(Kind::DaemonStopping, None, "", None).await?;
        }
        let deadline = Instant::now() + GENTLE;
        self.stopping = Some(match wish {
            Wish::Abort => Stopping::AtOnce(deadline),
            _ => Stopping::Gently(deadline),
        });
        if matches!(*self.activity.borrow(), Activity::Measuring(_) | Activity::ByHand) {
            // A rig that is at rest by now has nothing to answer.
            let _ = self.ask_rig(wish).await;
        }
        Ok(())
    }

    /// The step does not end: its run waits for a person.
    async fn give_up(&mut self) -> Result<(), JournalError> {
        let text = match *self.activity.borrow() {
            Activity::Evaluating(_) => "the daemon was stopped before the results were written",
            _ => "the daemon was stopped, and the rig did not answer",
        };
        self.interrupt(text).await
    }

    async fn ask_rig(&self, wish: Wish) -> Result<Option<Answer>, No> {
        tokio::time::timeout(ANSWER_WITHIN, self.owner.wish(wish)).await.map_err(|_| {
            let within_s = ANSWER_WITHIN.as_secs();
            No::Rig(format!("the rig's owner did not answer within {within_s} s"))
        })
    }

    /// The oldest run that waits, unless an interrupted one waits for a person.
    async fn begin_next(&mut self) -> Result<(), JournalError> {
        let runs = self.book.with(|queue| queue.runs()).await?;
        let mut interrupted = runs.iter().filter(|run| run.state == QueueState::Interrupted);
        let continued = self.continued.take();
        let next = match continued {
            Some(id) => interrupted.find(|run| run.id == id),
            None if interrupted.next().is_some() => None,
            None => runs.iter().find(|run| run.state == QueueState::Queued),
        };
        if let Some(run) = next.cloned() {
            self.prepare(run);
        }
        Ok(())
    }

    fn become_busy(&mut self, activity: Activity) {
        self.activity.send_replace(activity);
    }
}
