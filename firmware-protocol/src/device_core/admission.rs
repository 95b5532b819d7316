//! Which commands a device takes. Nothing is checked again later: what was accepted runs, or
//! fails together with the device.

use super::dwelling::Dwelling;
use super::queue::Command;
use super::{DeviceCore, RESULTS_MAX};
use crate::{Board, Home, Rejection, Reply, Sweep, SweepMotion};

impl<B: Board> DeviceCore<B> {
    /// Queues a command, and starts it if it is its turn, or says why not.
    pub(super) fn offer(&mut self, command: Command) -> Reply {
        let id = command.id();
        if let Err(rejection) = self.admit(&command) {
            return Reply::Rejected(id, rejection);
        }
        self.queue.push(command);
        self.start_next();
        Reply::Accepted(id)
    }

    fn admit(&self, command: &Command) -> Result<(), Rejection> {
        if self.queue.last_id().is_some_and(|last| command.id() <= last) {
            return Err(Rejection::IdReused);
        }
        if let Some(cause) = self.fault {
            return Err(Rejection::Faulted(cause));
        }
        match command {
            Command::Home(home) => self.admit_home(home)?,
            Command::MoveTo(move_to) => self.axes.check(&move_to.targets)?,
            Command::Dwell(dwell) => {
                let (_, rate_hz) = self.board.adc();
                if dwell.gain >= self.board.gains() || Dwelling::readings(dwell, rate_hz).is_none()
                {
                    return Err(Rejection::Senseless);
                }
            }
            Command::Sweep(sweep) => self.admit_sweep(sweep)?,
        }
        self.find_room()
    }

    fn admit_home(&self, home: &Home) -> Result<(), Rejection> {
        let all = (1_u8 << self.axes.identities().len()) - 1;
        if home.axes.0 == 0 || home.axes.0 & !all != 0 {
            return Err(Rejection::Senseless);
        }
        Ok(())
    }

    fn admit_sweep(&self, sweep: &Sweep) -> Result<(), Rejection> {
        if sweep.gain >= self.board.gains() {
            return Err(Rejection::Senseless);
        }
        self.axes.check(&sweep.from)?;
        let most = Self::capabilities().windows;
        if sweep.windows > most {
            return Err(Rejection::TooManyWindows(most));
        }
        self.motion_of(sweep).map(|_| ())
    }

    /// How this device's axes go on a sweep.
    pub(super) fn motion_of(&self, sweep: &Sweep) -> Result<SweepMotion, Rejection> {
        SweepMotion::new(self.axes.identities(), self.board.adc().1, sweep)
    }

    /// A command needs a place in the queue, and one for its result.
    fn find_room(&self) -> Result<(), Rejection> {
        let running = usize::from(self.running.is_some());
        let promised = self.results.len() + self.queue.len() + running;
        if self.queue.is_full() || promised >= RESULTS_MAX {
            return Err(Rejection::QueueFull);
        }
        Ok(())
    }
}
