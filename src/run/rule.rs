//! A rule by which a run may end before its last target: somebody outside looks at the readings as
//! they come, says how accurate they make it, and when it is enough.
//!
//! It does not know what the rule is. Where time is real the rule is asked on a thread of its own,
//! because a device that hears nothing from its host for the time of a large fit stops.

use std::sync::mpsc;

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};

use crate::rig::Reading;

/// What a rule says when it is shown a reading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Said {
    /// Nothing new.
    Nothing,
    /// How accurate the readings make the result so far, for people.
    SoFar(String),
    /// Why it is enough: this ends the run, and is what people are told. The rule is not asked again.
    Enough(String),
}

/// Looks at every reading as it is taken.
pub type Rule = Box<dyn FnMut(&Reading) -> Said + Send>;

/// Asks a rule.
pub struct Watch(Asked);

enum Asked {
    Inline(Rule),
    Threaded { readings: mpsc::Sender<Reading>, said: UnboundedReceiver<Said> },
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
        let (answer, said) = unbounded_channel();
        std::thread::Builder::new().name("stop rule".to_owned()).spawn(move || {
            for reading in waiting {
                let said = rule(&reading);
                let is_last = matches!(said, Said::Enough(_));
                // The run may have ended by itself.
                if (said != Said::Nothing && answer.send(said).is_err()) || is_last {
                    break;
                }
            }
        })?;
        Ok(Self(Asked::Threaded { readings, said }))
    }

    /// Shows it a reading; an answer at once, or later by [`Watch::said`].
    pub(super) fn show(&mut self, reading: &Reading) -> Said {
        let said = match &mut self.0 {
            Asked::Inline(rule) => rule(reading),
            Asked::Threaded { readings, .. } => {
                // A rule that has answered looks no more.
                let _ = readings.send(reading.clone());
                Said::Nothing
            }
            Asked::Answered => Said::Nothing,
        };
        self.close_after(said)
    }

    /// Waits for what a rule on its own thread says, which may be nothing ever.
    pub(super) async fn said(&mut self) -> Said {
        if let Asked::Threaded { said, .. } = &mut self.0 {
            match said.recv().await {
                Some(said) => return self.close_after(said),
                None => self.0 = Asked::Answered,
            }
        }
        std::future::pending().await
    }

    fn close_after(&mut self, said: Said) -> Said {
        if let Said::Enough(_) = said {
            self.0 = Asked::Answered;
        }
        said
    }
}
