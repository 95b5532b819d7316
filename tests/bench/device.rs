//! Devices that are not what the rig file says, each at the far end of a pseudo-terminal. They
//! end when the program lets go of the line.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;

use firmware_protocol::ReplyType;
use firmware_protocol::frame::{self, Header, Kind, WIRE_MAX};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// A device that sends text of its own, whatever it is told: a printer, a modem, a logger.
pub(crate) fn chatterer() -> String {
    serve(|_| b"T=21.4C RH=40%\r\n\x00\x07\xff".to_vec())
}

/// A device that says nothing.
pub(crate) fn mute() -> String {
    serve(|_| Vec::new())
}

/// A device whose firmware speaks protocol 2.3, which answers `Identify` as every version must.
pub(crate) fn newer() -> String {
    serve(|told| {
        let mut answers = Vec::new();
        for packed in told.split(|byte| *byte == 0).filter(|packed| !packed.is_empty()) {
            let mut packed = packed.to_vec();
            let Ok(request) = frame::decode(&mut packed) else { continue };
            let Some(session) = request.body.get(..2) else { continue };
            let boot_id = [7, 0, 0, 0];
            let identity = [2, 3, 99, 99, 99];
            let body = [session, &boot_id, &identity].concat();
            let (seq, type_byte) = (request.header.seq, ReplyType::Identity.byte());
            let header = Header { kind: Kind::Reply, major: 2, seq, type_byte };
            let mut wire = [0; WIRE_MAX];
            let length = frame::encode(header, &body, &mut wire).unwrap();
            answers.extend_from_slice(&wire[..length]);
        }
        answers
    })
}

/// Opens a pseudo-terminal and answers on it, in a thread, until the line hangs up; returns where
/// the program opens it.
fn serve(answer: impl Fn(&[u8]) -> Vec<u8> + Send + 'static) -> String {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let mut termios = tcgetattr(&master).unwrap();
    termios.make_raw();
    tcsetattr(&master, OptionalActions::Now, &termios).unwrap();
    let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
    let _detached = std::thread::spawn(move || converse(master, &answer));
    path
}

fn converse(master: OwnedFd, answer: &dyn Fn(&[u8]) -> Vec<u8>) {
    let mut line = File::from(master);
    let mut buffer = [0; 1024];
    // An error is the hang-up.
    while let Ok(n) = line.read(&mut buffer) {
        if line.write_all(&answer(&buffer[..n])).is_err() {
            return;
        }
    }
}
