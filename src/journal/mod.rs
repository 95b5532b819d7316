//! The run file: raw readings, durable before they count.
//!
//! One SQLite file a run holds all that is needed to rebuild everything else: the header, every
//! input file byte for byte, the fixed sequence of steps, the raw readings, the sessions in which
//! they were taken, and what happened on the way. A reading counts only once
//! [`Journal::append`] has returned, or once a [`Writer`] has reported it as committed.
//!
//! - [`Journal`] appends; one process at a time, held to that by a lock.
//! - [`Reader`] reads, also while another process appends.
//! - [`Writer`] stands between an engine and the journal: inline in virtual time, on an owner
//!   thread in real time.
//!
//! This is the only room that knows SQL. It does not know what a reading means: radiance is
//! derived elsewhere and can be derived again. It reads no clock; wall time is handed in as text.

mod append;
mod error;
mod lock;
#[cfg(test)]
mod old_tests;
mod queue;
mod read;
mod record;
mod schema;
mod steps;
#[cfg(test)]
mod tests;
mod writer;

pub use append::{Appended, Journal};
pub use error::JournalError;
pub use queue::{Queue, QueueState, QueuedRun};
pub use read::{Order, Reader};
pub use record::{
    EffectWishes, Event, EventKind, Header, Input, InputRole, Record, ReferenceCheck, Round,
    Session, Verdict,
};
pub use writer::{Progress, Writer};
