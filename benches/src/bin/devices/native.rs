//! A controller of gonio's own whose host falls silent in mid-move, in real time.

use std::path::Path;
use std::time::Duration;

use benches::{Program, Unmeasured};
use firmware_protocol::{
    AxisCounts, AxisMask, CommandId, Event, Home, MoveTo, Reply, Request, Tick,
};
use gonio::device::{Controller, DeviceEvent, Link, SerialSettings, open_serial};

use crate::ports::Simulated;
use crate::rigs::{self, RIGS};

const BAUD: u32 = 1_000_000;
const PATIENCE: Duration = Duration::from_mins(2);
/// Into a move of 90 degrees, which takes 2.1 s.
const IN_MOVE: Duration = Duration::from_millis(700);
/// Longer than its lease and its braking together.
const SILENCE: Duration = Duration::from_secs(2);
const TIMES: i32 = 4;
/// 90 degrees.
const THERE: i32 = 1024;

/// How long the axes went on after the host's last word, seconds, several times.
pub(crate) fn host_dies(program: &Program, folder: &Path) -> Result<Vec<f64>, Unmeasured> {
    rigs::write(&RIGS[0], folder, "")?;
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let words = ["sim", "--rig", &path("rig.toml"), "--scene", &path("scene.toml")];
    let link = path("tty");
    let baud = BAUD.to_string();
    let _rig =
        Simulated::switched_on(program, &[&words[..], &["--baud", &baud]].concat(), &[&link])?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(times(link))
}

async fn times(port: String) -> Result<Vec<f64>, Unmeasured> {
    let settings =
        SerialSettings { port, baud: BAUD, reset_on_open: false, boot_wait: Duration::ZERO };
    let link = Link::new("tty", open_serial(&settings).await?);
    let (mut own, _) = Controller::connect(link, 1, BAUD, Duration::from_secs(5)).await?;
    own.submit(Request::Home(Home { id: CommandId(1), axes: AxisMask(0b1111) }));
    done(&mut own, 1).await?;
    let mut times = Vec::new();
    let mut id = 1;
    for n in 0..TIMES {
        let theta = if n % 2 == 0 { THERE } else { 0 };
        id += 1;
        let targets = AxisCounts([theta, 0, 0, 0].into_iter().collect());
        own.submit(Request::MoveTo(MoveTo { id: CommandId(id), targets }));
        tokio::time::sleep(IN_MOVE).await;
        let last_word = tick(&mut own).await?;
        // Nothing of this program runs: no word goes out.
        std::thread::sleep(SILENCE);
        let failed = done(&mut own, id).await;
        let Err(Failed::Then(stopped)) = failed else {
            return Err(Unmeasured::because("the move did not fail though the host was silent"));
        };
        times.push(f64::from(stopped.micros_since(last_word)) * 1e-6);
        own.acknowledge(CommandId(id));
        own.submit(Request::ClearFault);
    }
    own.close().await;
    Ok(times)
}

/// How a command ended otherwise than well.
enum Failed {
    Then(Tick),
    Otherwise(String),
}

impl From<Failed> for Unmeasured {
    fn from(failed: Failed) -> Self {
        match failed {
            Failed::Then(_) => Self::because("a command failed"),
            Failed::Otherwise(what) => Self::because(what),
        }
    }
}

async fn done(own: &mut Controller, id: u32) -> Result<(), Failed> {
    let deadline = tokio::time::Instant::now() + PATIENCE;
    loop {
        let event = tokio::time::timeout_at(deadline, own.next_event()).await;
        match event.map_err(|_| Failed::Otherwise(format!("command {id} does not end")))? {
            DeviceEvent::Event(Event::Done(done)) if done.id.0 == id => {
                own.acknowledge(done.id);
                return Ok(());
            }
            DeviceEvent::Event(Event::Failed(failed, _, tick)) if failed.0 == id => {
                return Err(Failed::Then(tick));
            }
            DeviceEvent::LinkLost(lost) => return Err(Failed::Otherwise(lost.to_string())),
            _ => {}
        }
    }
}

/// The device's time now.
async fn tick(own: &mut Controller) -> Result<Tick, Unmeasured> {
    own.submit(Request::ReadStatus);
    loop {
        match tokio::time::timeout(PATIENCE, own.next_event()).await? {
            DeviceEvent::Reply { reply: Reply::Status(status), .. } => return Ok(status.tick),
            DeviceEvent::LinkLost(lost) => return Err(lost.into()),
            _ => {}
        }
    }
}
