//! Whoever decides on the way what a run measures next: asked whenever nothing is left to measure,
//! and shown every reading before.
//!
//! It does not know how it is decided. Where time is real the question goes to a thread of its own,
//! because a device that hears nothing from its host for the time of a large fit stops.

use std::sync::mpsc;

use tokio::sync::oneshot;

use crate::plan::Step;
use crate::rig::Reading;

/// What was decided.
#[derive(Debug, Clone, PartialEq)]
pub struct Decided {
    /// Which decision of the run it is, from 0.
    pub number: u32,
    /// What it rests on, for the journal.
    pub account: String,
    /// What follows.
    pub next: Next,
}

/// What follows a decision.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// These steps, whose ids follow those of the steps that there are; the last ones are what a
    /// run closes with.
    Measure(Vec<Step>),
    /// Nothing: the run ends, and this is what people are told.
    Enough(String),
}

/// Decides, by the readings of the run's sequence that were taken since it was asked last; or says
/// why it can't.
pub type Decide = Box<dyn FnMut(Vec<Reading>) -> Result<Decided, String> + Send>;

/// Asks a decision.
pub struct Decider {
    form: Form,
    shown: Vec<Reading>,
}

enum Form {
    Inline(Decide),
    Threaded { questions: mpsc::Sender<Question>, answer: Option<oneshot::Receiver<Answer>> },
}

type Answer = Result<Decided, String>;
type Question = (Vec<Reading>, oneshot::Sender<Answer>);

impl Decider {
    /// Asks on the spot, whatever time that takes: for virtual time, which waits.
    pub fn inline(decide: Decide) -> Self {
        Self { form: Form::Inline(decide), shown: Vec::new() }
    }

    /// Asks on another thread; the rig stands still meanwhile, and its link lives.
    pub fn threaded(mut decide: Decide) -> std::io::Result<Self> {
        let (questions, waiting) = mpsc::channel::<Question>();
        std::thread::Builder::new().name("decisions".to_owned()).spawn(move || {
            for (readings, answer) in waiting {
                // The run may have ended meanwhile.
                let _ = answer.send(decide(readings));
            }
        })?;
        Ok(Self { form: Form::Threaded { questions, answer: None }, shown: Vec::new() })
    }

    /// Shows it a reading.
    pub(super) fn show(&mut self, reading: &Reading) {
        self.shown.push(reading.clone());
    }

    /// Asks; the answer comes at once, or later as [`Decider::answer`].
    pub(super) fn ask(&mut self) -> Option<Result<Decided, String>> {
        let readings = std::mem::take(&mut self.shown);
        match &mut self.form {
            Form::Inline(decide) => Some(decide(readings)),
            Form::Threaded { questions, answer } => {
                let (reply, receiver) = oneshot::channel();
                *answer = Some(receiver);
                // A thread that is gone answers nothing, which is an answer too.
                let _ = questions.send((readings, reply));
                None
            }
        }
    }

    /// Waits for the answer of another thread; for ever where nothing was asked. A thread that is
    /// gone is an error too.
    pub(super) async fn answer(&mut self) -> Result<Decided, String> {
        let Form::Threaded { answer: waiting, .. } = &mut self.form else {
            return std::future::pending().await;
        };
        let Some(answer) = waiting else { return std::future::pending().await };
        let decided = answer.await;
        *waiting = None;
        decided.unwrap_or_else(|_| Err("the thread of decisions has ended".to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_thread_that_panics_has_answered_with_an_error() {
        let mut decider = Decider::threaded(Box::new(|_| panic!("no more ideas"))).unwrap();
        for _ in 0..2 {
            assert!(decider.ask().is_none());
            assert_eq!(decider.answer().await, Err("the thread of decisions has ended".to_owned()));
        }
    }
}
