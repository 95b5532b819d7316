//! Who is on a bus: one ping to all, which moves nothing and sets nothing. It knows no port, and not
//! what the servos are for.

use std::fmt;

use super::packet::{Decoder, Instruction, ServoId};
use super::table::model_name;

/// A servo that answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServoFound {
    /// Its number.
    pub id: ServoId,
    /// Its model's number.
    pub model: u16,
    /// Its firmware.
    pub firmware: u8,
    /// Whether it says that a hardware error is raised.
    pub alert: bool,
}

impl ServoFound {
    /// What the maker calls its model.
    pub fn model_name(&self) -> Option<&'static str> {
        model_name(self.model)
    }
}

impl fmt::Display for ServoFound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.id)?;
        match self.model_name() {
            Some(name) => f.write_str(name)?,
            None => write!(f, "model {}", self.model)?,
        }
        write!(f, ", firmware {}", self.firmware)?;
        if self.alert { f.write_str(", a hardware error is raised") } else { Ok(()) }
    }
}

/// Listens for their answers.
#[derive(Debug, Default)]
pub(crate) struct RollCall {
    decoder: Decoder,
    found: Vec<ServoFound>,
}

impl RollCall {
    /// The ping.
    pub(crate) fn question() -> Vec<u8> {
        Instruction::PingAll.encode().unwrap_or_default()
    }

    /// Takes what was heard.
    pub(crate) fn take(&mut self, bytes: &[u8]) {
        for status in self.decoder.take(bytes) {
            if let [low, high, firmware] = status.data[..]
                && self.found.iter().all(|known| known.id != status.id)
            {
                let (id, alert) = (status.id, status.alert);
                let model = u16::from_le_bytes([low, high]);
                self.found.push(ServoFound { id, model, firmware, alert });
            }
        }
    }

    /// Who answered, by their numbers.
    pub(crate) fn found(mut self) -> Vec<ServoFound> {
        self.found.sort_by_key(|servo| servo.id);
        self.found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_makers_ping_to_all_and_its_answers() {
        // The e-manual's example of protocol 2.0: two servos, of one model, answer one ping.
        let ping = [0xff, 0xff, 0xfd, 0x00, 0xfe, 0x03, 0x00, 0x01, 0x31, 0x42];
        assert_eq!(RollCall::question(), ping);
        let first = [0xff, 0xff, 0xfd, 0, 1, 7, 0, 0x55, 0, 0x06, 0x04, 0x26, 0x65, 0x5d];
        let second = [0xff, 0xff, 0xfd, 0, 2, 7, 0, 0x55, 0, 0x06, 0x04, 0x26, 0x6f, 0x6d];
        let mut call = RollCall::default();
        call.take(&[&[0x20][..], &second, &first, &second].concat());
        let found = call.found();
        let words: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(words[0], "servo 1: XM430-W210, firmware 38");
        assert_eq!((found.len(), found[1].id.number()), (2, 2));
    }
}
