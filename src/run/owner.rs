//! The owner of a rig: one task that holds it, for one thing at a time. `gonio run` has one in
//! its own process; the daemon has one for as long as it lives.
//!
//! When the last handle goes, the owner stops the axes, lets go of the link and ends.

use std::sync::Arc;

use tokio::sync::{broadcast, mpsc, oneshot, watch};
use tokio::task::JoinHandle;

use super::desk::{Desk, Order, OwnerStatus};
use super::engine::Engine;
use super::events::{Events, RunEvent};
use super::hand::{Hand, HandError, Stand, TakeOne};
use super::hardware::Hardware;
use super::job::{Ended, Job};
use super::machine::{Answer, Wish};
use crate::device::Openers;
use crate::journal::Writer;
use crate::rig::{Latched, Reading, Rig};

/// Orders that can wait.
const ORDERS: usize = 32;

/// Why a run was not begun.
#[derive(Debug)]
pub enum StartError {
    /// Another one goes on; the journal comes back unused.
    Busy(Box<Writer>),
    /// The owner has ended.
    Gone,
}

/// A run that goes on.
#[derive(Debug)]
pub struct Running(oneshot::Receiver<Result<Ended, Box<Writer>>>);

impl Running {
    /// Its end. A run that could not begin because another one goes on says so here.
    pub async fn ended(self) -> Result<Ended, StartError> {
        match self.0.await {
            Ok(Ok(ended)) => Ok(ended),
            Ok(Err(journal)) => Err(StartError::Busy(journal)),
            Err(_) => Err(StartError::Gone),
        }
    }
}

/// How others speak to an owner.
#[derive(Debug, Clone)]
pub struct OwnerHandle {
    orders: mpsc::Sender<Order>,
    events: Events,
    status: watch::Receiver<OwnerStatus>,
}

/// Starts an owner on the runtime that this is called in. `session` numbers its first session on
/// the wire, and is to be drawn anew by every process; a simulated rig's may come from its seed.
pub fn own(
    rig: Arc<Rig>,
    openers: impl Into<Openers>,
    session: u32,
) -> (OwnerHandle, JoinHandle<()>) {
    let openers = openers.into();
    let (sender, mut orders) = mpsc::channel(ORDERS);
    let mut desk = Desk::new();
    let handle = OwnerHandle {
        orders: sender,
        events: desk.events.clone(),
        status: desk.status.subscribe(),
    };
    let task = tokio::spawn(async move {
        let mut hardware = Hardware::new(rig, openers, session);
        while !desk.is_closing {
            let Some(order) = orders.recv().await else { break };
            serve(order, &mut hardware, &mut orders, &mut desk).await;
        }
        hardware.close().await;
    });
    (handle, task)
}

async fn serve(
    order: Order,
    hardware: &mut Hardware,
    orders: &mut mpsc::Receiver<Order>,
    desk: &mut Desk,
) {
    let order = match order {
        Order::Start(job, journal, reply) => {
            let ended = Engine::new(hardware, orders, desk, *job, *journal).run().await;
            let _ = reply.send(Ok(ended));
            return;
        }
        Order::ShutDown => {
            desk.is_closing = true;
            return;
        }
        other => other,
    };
    let mut hand = Hand { hardware, orders, desk };
    match order {
        Order::Home(reply) => drop(reply.send(hand.home().await)),
        Order::Jog(to, reply) => drop(reply.send(hand.jog(to).await)),
        Order::Take(one, reply) => drop(reply.send(hand.take(one).await)),
        Order::Look(reply) => drop(reply.send(hand.look().await)),
        // Nothing goes on that a wish could be about.
        other => other.refuse(),
    }
}

impl OwnerHandle {
    /// Begins a run, or refuses it where another one goes on: [`Running::ended`] tells.
    pub async fn start(&self, job: Job, journal: Writer) -> Result<Running, StartError> {
        let (reply, ended) = oneshot::channel();
        let order = Order::Start(Box::new(job), Box::new(journal), reply);
        self.orders.send(order).await.map_err(|_| StartError::Gone)?;
        Ok(Running(ended))
    }

    /// Asks something of the run that goes on; `None` where none does.
    pub async fn wish(&self, wish: Wish) -> Option<Answer> {
        self.ask(|reply| Order::Wish(wish, reply)).await.flatten()
    }

    /// Finds the home marks of all axes.
    pub async fn home(&self) -> Result<Stand, HandError> {
        self.ask(Order::Home).await.unwrap_or(Err(HandError::Gone))
    }

    /// Goes to a pose, in counts, in the order of [`crate::rig::AXES`].
    pub async fn jog(&self, to: Latched) -> Result<Stand, HandError> {
        self.ask(|reply| Order::Jog(to, reply)).await.unwrap_or(Err(HandError::Gone))
    }

    /// Takes a reading where the axes stand. No journal keeps it.
    pub async fn take(&self, one: TakeOne) -> Result<Reading, HandError> {
        self.ask(|reply| Order::Take(one, reply)).await.unwrap_or(Err(HandError::Gone))
    }

    /// Asks the device where the axes stand.
    pub async fn look(&self) -> Result<Stand, HandError> {
        self.ask(Order::Look).await.unwrap_or(Err(HandError::Gone))
    }

    /// Comes to rest, lets go of the rig, and ends. The owner's task ends after it.
    pub async fn shut_down(&self) {
        let _ = self.orders.send(Order::ShutDown).await;
    }

    /// How the rig is, as its owner last knew.
    pub fn status(&self) -> OwnerStatus {
        self.status.borrow().clone()
    }

    /// Follows the status.
    pub fn watch(&self) -> watch::Receiver<OwnerStatus> {
        self.status.clone()
    }

    /// Listens to what happens from now on.
    pub fn subscribe(&self) -> broadcast::Receiver<RunEvent> {
        self.events.subscribe()
    }

    async fn ask<T>(&self, order: impl FnOnce(oneshot::Sender<T>) -> Order) -> Option<T> {
        let (reply, answer) = oneshot::channel();
        self.orders.send(order(reply)).await.ok()?;
        answer.await.ok()
    }
}

/// So that a start that failed says why in one line.
impl std::fmt::Display for StartError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Busy(_) => "another run goes on",
            Self::Gone => "the owner of the rig has ended",
        })
    }
}

impl std::error::Error for StartError {}
