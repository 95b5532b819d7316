//! Standard output: what a command answers. A reader that has read enough (`| head`) is no error;
//! a full disk is one, and is named. And standard error: what a person may want to know meanwhile.

use std::io::{self, BufWriter, ErrorKind, Write};

use super::failure::Failure;
use crate::export::cause;

/// Writes a text that has its line ends.
pub(crate) fn say(text: &str) -> Result<(), Failure> {
    write_out(|out| out.write_all(text.as_bytes()))
}

/// Writes one JSON document and ends its line.
pub(crate) fn say_json(document: &serde_json::Value) -> Result<(), Failure> {
    write_out(|out| writeln!(out, "{document}"))
}

/// Tells a person something beside the answer. Where nobody listens it is not said.
pub(crate) fn note(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Hands standard output, buffered, to a writer of something long.
pub(crate) fn write_out(
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Failure> {
    let mut out = BufWriter::new(io::stdout().lock());
    let written = write(&mut out).and_then(|()| out.flush());
    // What could not be written is dropped here, not tried once more.
    drop(out.into_parts());
    match written {
        Err(error) if cause(&error) != ErrorKind::BrokenPipe => {
            Err(Failure::midway(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}
