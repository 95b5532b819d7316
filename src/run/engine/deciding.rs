//! What others decide for the machine: whether a resume may go on, what is measured next, and that it
//! is enough.

use super::{Decided, Engine, Fault, Next};
use crate::journal::{EventKind, Record};
use crate::run::events::Happening;
use crate::run::machine::Input;
use crate::run::rule::Said;

impl Engine<'_> {
    pub(super) fn judge(&mut self) {
        let judgement = self.check.take().map(|mut check| (check.judge)(&self.checked));
        let go_on = match judgement {
            None => Ok(()),
            Some(judgement) => {
                if let Some(check) = judgement.check {
                    self.record(Record::ReferenceCheck(check.clone()));
                    self.desk.tell(Happening::ReferenceCheck(check));
                }
                judgement.go_on
            }
        };
        let now = self.now();
        self.machine.handle(now, Input::Judged(go_on));
    }

    /// A decision is kept before it is followed: a resume takes it up, and never makes it again.
    /// A run that nobody decides for stands still: it is not at its end.
    pub(super) async fn decided(&mut self, decided: Result<Decided, String>) {
        let Decided { number, account, next } = match decided {
            Ok(decided) => decided,
            Err(why) => {
                let now = self.now();
                return self.machine.handle(now, Input::Fault(Fault::Undecided(why)));
            }
        };
        let (steps, enough) = match next {
            Next::Measure(steps) => (steps, None),
            Next::Enough(why) => (Vec::new(), Some(why)),
        };
        self.record(Record::Round { number, account, steps: steps.clone() });
        if self.lost.is_none()
            && let Err(error) = self.journal.flush().await
        {
            self.journal_failed(error);
        }
        if self.lost.is_some() {
            return;
        }
        if let Some(why) = enough {
            return self.enough(why);
        }
        self.course.extend(&steps);
        let now = self.now();
        self.machine.handle(now, Input::Decided(steps));
        self.tell_progress();
    }

    pub(super) fn enough(&mut self, why: String) {
        self.note(EventKind::Note, &format!("nothing more is measured: {why}"));
        let now = self.now();
        self.machine.handle(now, Input::Enough(why));
    }

    /// What the rule says is told, or ends the targets.
    pub(super) fn heed(&mut self, said: Said) {
        match said {
            Said::Nothing => {}
            Said::SoFar(text) => self.desk.tell(Happening::Accuracy(text)),
            Said::Enough(text) => self.conclude(text),
        }
    }

    /// A rule of the plan is met.
    pub(super) fn conclude(&mut self, rule: String) {
        self.note(EventKind::Note, &format!("a rule of the plan is met: {rule}"));
        self.course.conclude();
        let now = self.now();
        self.machine.conclude(now, rule);
    }
}
