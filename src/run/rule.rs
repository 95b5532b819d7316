//! A rule by which a run may end before its last target: somebody outside looks at the readings as
//! they come, and says when it is enough.
//!
//! It does not know what the rule is. Where time is real the rule is asked on a thread of its own,
//! because a device that hears nothing from its host for the time of a large fit stops.

use std::sync::mpsc;

use tokio::sync::oneshot;

use crate::rig::Reading;

/// Looks at every reading as it is taken. What it says ends the run, and is what people are told.
pub type Rule = Box<dyn FnMut(&Reading) -> Option<String> + Send>;

/// Asks a rule.
pub struct Watch(Asked);

enum Asked {
    Inline(Rule),
    Threaded { readings: mpsc::Sender<Reading>, verdict: oneshot::Receiver<String> },
    Answered,
}

impl Watch {
    /// Asks between two readings, whatever time that takes: for virtual time, which waits.
    pub fn inline(rule: Rule) -> Self {
        Self(Asked::Inline(rule))
    }

    /// Asks on another thread; the run goes on meanwhile.
    pub fn threaded(mut rule: Rule) -> std::io::Result<Self> {
        let (readings, waiting) = mpsc::channel::<Reading>();
        let (answer, verdict) = oneshot::channel();
        std::thread::Builder::new().name("stop rule".to_owned()).spawn(move || {
            let answered = waiting.into_iter().find_map(|reading| rule(&reading));
            if let Some(text) = answered {
                // The run may have ended by itself.
                let _ = answer.send(text);
            }
        })?;
        Ok(Self(Asked::Threaded { readings, verdict }))
    }

    /// Shows it a reading; an answer at once, or later as [`Watch::verdict`].
    pub(super) fn show(&mut self, reading: &Reading) -> Option<String> {
        match &mut self.0 {
            Asked::Inline(rule) => {
                let answer = rule(reading)?;
                self.0 = Asked::Answered;
                Some(answer)
            }
            Asked::Threaded { readings, .. } => {
                // A rule that has answered looks no more.
                let _ = readings.send(reading.clone());
                None
            }
            Asked::Answered => None,
        }
    }

    /// Waits for the answer of a rule on its own thread, which may never come.
    pub(super) async fn verdict(&mut self) -> String {
        if let Asked::Threaded { verdict, .. } = &mut self.0 {
            let answer = verdict.await;
            self.0 = Asked::Answered;
            if let Ok(text) = answer {
                return text;
            }
        }
        std::future::pending().await
    }
}
