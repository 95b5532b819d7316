//! How many questions a second a rig answers over a pseudo-terminal, and what limits that. `gonio
//! sim` serves the simulated device in a process of its own, paced like a wire at the baud rate;
//! here the driver asks it for its status through the serial port code that real rigs use, first
//! one question after another's answer, then with four on their way, which is the protocol's window.
//!
//! Beside each rate stand its two floors: the time that the frames take on a wire at that rate, and
//! the time in which a bare pseudo-terminal (no protocol, no pacing: a thread that hands back what
//! it reads) returns as many bytes on the same machine. What remains is the pacing's timer, which
//! wakes at whole milliseconds, and both programs.

use std::path::Path;
use std::process::{Child, ExitCode};
use std::time::{Duration, Instant};

use benches::{
    Arguments, Bytes, Counted, Program, Section, Spread, Table, Unmeasured, copy_example, report,
};
use clap::Parser;
use firmware_protocol::{Reply, Request};
use gonio::device::{Controller, DeviceEvent, Link, SerialSettings, open_serial};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

/// The last is the fastest that a simulated wire goes: hardly a wire at all.
const BAUDS: [u32; 3] = [115_200, 1_000_000, 12_000_000];
const WINDOW: usize = 4;
const PATIENCE: Duration = Duration::from_secs(5);
const BITS_A_BYTE: f64 = 10.0;

/// Round trips a second over a pseudo-terminal.
#[derive(Debug, Parser)]
struct Asked {
    /// Questions a baud rate and way.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    questions: u32,
    #[command(flatten)]
    arguments: Arguments,
}

/// The simulated rig in its own process; ends with this.
struct Rig(Child);

impl Drop for Rig {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() -> ExitCode {
    let asked = Asked::parse();
    report(&asked.arguments, || measure(&asked))
}

/// What one way of asking showed.
struct Asking {
    /// Seconds a question, from submitting it to its answer; with several on their way, the time
    /// between answers.
    each: Spread,
    per_s: f64,
    /// Bytes a question, to the device and back.
    bytes: (f64, f64),
    resent: u64,
}

fn measure(asked: &Asked) -> Result<Section, Unmeasured> {
    let program = Program::find(&asked.arguments)?;
    let folder = tempfile::tempdir()?;
    copy_example("lambertian", folder.path())?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let mut table = Table::new(&[
        "wire, on their way",
        "a second",
        "the wire allows",
        "one takes, ms",
        "95 %, ms",
        "bytes there and back",
        "sent again",
    ]);
    let mut bytes = (0.0, 0.0);
    for baud in BAUDS {
        for window in [1, WINDOW] {
            let rig = switch_on(&program, folder.path(), baud)?;
            let asking = runtime.block_on(ask(folder.path(), baud, window, asked.questions))?;
            drop(rig);
            bytes = asking.bytes;
            // One after the other: both ways add. Several on their way: the fuller way fills.
            let in_turn = if window == 1 { bytes.0 + bytes.1 } else { bytes.0.max(bytes.1) };
            let allowed_per_s = f64::from(baud) / BITS_A_BYTE / in_turn;
            // With several on their way answers come in bunches.
            let ms = |part: f64| match window {
                1 => format!("{:.2}", 1e3 * asking.each.quantile(part)),
                _ => String::new(),
            };
            table.row([
                format!("{baud} baud, {window}"),
                format!("{:.0}", asking.per_s),
                format!("{allowed_per_s:.0}"),
                ms(0.5),
                ms(0.95),
                format!("{:.0} + {:.0}", bytes.0, bytes.1),
                asking.resent.to_string(),
            ]);
        }
    }
    let bare = bare(&runtime, asked.questions, bytes)?;
    let mut section = Section::new("round_trips", "Round trips a second over a pseudo-terminal");
    section.say(&format!("{} status requests a row.", asked.questions));
    section.show(&table);
    section.say(&format!(
        "A bare pseudo-terminal returns as many bytes in {:.3} ms (median; {:.3} ms in 95 % of \
         cases), {:.0} times a second. With one question on its way the rate is the pacing's: an \
         answer reaches the host at the first whole millisecond after its last byte has passed.",
        1e3 * bare.median(),
        1e3 * bare.quantile(0.95),
        1.0 / bare.median()
    ));
    section.keep(table);
    Ok(section)
}

fn switch_on(program: &Program, folder: &Path, baud: u32) -> Result<Rig, Unmeasured> {
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let (rig, scene, link, baud) =
        (path("rig.toml"), path("scene.toml"), path("tty"), baud.to_string());
    let words = ["sim", "--rig", &rig, "--scene", &scene, "--pty", &link, "--baud", &baud];
    // One that was killed leaves its link.
    let _ = std::fs::remove_file(&link);
    let mut rig = Rig(program.command(&words).spawn()?);
    let began = Instant::now();
    while !Path::new(&link).exists() {
        if let Some(status) = rig.0.try_wait()? {
            return Err(Unmeasured::because(format!("`gonio sim` ended with {status}")));
        }
        if began.elapsed() > PATIENCE {
            return Err(Unmeasured::because("`gonio sim` made no pseudo-terminal in 5 s"));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(rig)
}

async fn ask(
    folder: &Path,
    baud: u32,
    window: usize,
    questions: u32,
) -> Result<Asking, Unmeasured> {
    let settings = SerialSettings {
        port: folder.join("tty").to_string_lossy().into_owned(),
        baud,
        reset_on_open: false,
        boot_wait: Duration::ZERO,
    };
    let (stream, passed) = Counted::new(open_serial(&settings).await?);
    let (mut native, _) = Controller::connect(Link::new("tty", stream), 1, baud, PATIENCE).await?;
    rounds(&mut native, window, questions / 10).await?;
    let before = passed.passed();
    let began = Instant::now();
    let each = rounds(&mut native, window, questions).await?;
    let per_s = f64::from(questions) / began.elapsed().as_secs_f64();
    let bytes = per_question(&passed, before, questions);
    let resent = native.statistics().resent;
    native.close().await;
    Ok(Asking { each, per_s, bytes, resent })
}

/// To the device and back.
fn per_question(passed: &Bytes, before: (u64, u64), questions: u32) -> (f64, f64) {
    let (read, written) = passed.passed();
    let each = |now: u64, then: u64| (now - then) as f64 / f64::from(questions);
    (each(written, before.1), each(read, before.0))
}

async fn rounds(
    native: &mut Controller,
    window: usize,
    questions: u32,
) -> Result<Spread, Unmeasured> {
    let mut left = questions;
    for _ in 0..window.min(questions as usize) {
        native.submit(Request::ReadStatus);
        left -= 1;
    }
    let mut each = Vec::with_capacity(questions as usize);
    let mut last = Instant::now();
    while each.len() < questions as usize {
        match tokio::time::timeout(PATIENCE, native.next_event()).await? {
            DeviceEvent::Reply { reply: Reply::Status(_), .. } => {
                each.push(last.elapsed().as_secs_f64());
                last = Instant::now();
                if left > 0 {
                    native.submit(Request::ReadStatus);
                    left -= 1;
                }
            }
            DeviceEvent::LinkLost(lost) => return Err(lost.into()),
            other => {
                return Err(Unmeasured::because(format!("expected a status, found {other:?}")));
            }
        }
    }
    Ok(Spread::of(each))
}

/// As many bytes there and back through a pseudo-terminal whose other side hands on what it reads.
fn bare(
    runtime: &tokio::runtime::Runtime,
    questions: u32,
    (there, back): (f64, f64),
) -> Result<Spread, Unmeasured> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a frame's bytes
    let (there, back) = (there.round() as usize, back.round() as usize);
    let (opened, port) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(async {
            let mut pty = sim::Pty::open(None)?;
            let _ = opened.send(pty.path().display().to_string());
            let (mut question, answer) = (vec![0; there], vec![1; back]);
            for _ in 0..questions {
                pty.read_exact(&mut question).await?;
                pty.write_all(&answer).await?;
            }
            // The last answer is lost if the line closes before it was read.
            tokio::time::sleep(Duration::from_secs(1)).await;
            std::io::Result::Ok(())
        })
    });
    let port = port.recv_timeout(PATIENCE)?;
    let settings =
        SerialSettings { port, baud: 115_200, reset_on_open: false, boot_wait: Duration::ZERO };
    runtime.block_on(async {
        let mut link = open_serial(&settings).await?;
        let (question, mut answer) = (vec![1; there], vec![0; back]);
        let mut each = Vec::new();
        for _ in 0..questions {
            let began = Instant::now();
            link.write_all(&question).await?;
            tokio::time::timeout(PATIENCE, link.read_exact(&mut answer)).await??;
            each.push(began.elapsed().as_secs_f64());
        }
        Ok(Spread::of(each))
    })
}
