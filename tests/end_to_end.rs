//! The whole road in real processes and real time: `gonio sim --pty`, a daemon on its serial port,
//! and people at the command line who submit, pause, kill and unplug. Would break: a reading lost
//! or taken twice, motion that nobody asked for, axes that a dead host leaves moving.

mod bench;

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use firmware_protocol::Status;
use gonio::device::{Controller, SerialSettings, serial_opener};
use gonio::journal::{EventKind, Order, Reader};
use serde_json::Value;

use bench::Bench;

/// Whatever takes longer has stuck.
const PATIENCE: Duration = Duration::from_secs(30);
const BAUD: u32 = 1_000_000;
const LINK: &str = "rig-port";
const TARGETS: usize = 66;

const PLAN: &str = r#"name = "small"
rig = "rig.toml"

[region]
x_mm = [-1, 1]
y_mm = [-1, 1]
theta_max_deg = 80

[schedule]
kind = "raster"
x_count = 2
y_count = 1
theta_step_deg = 20
phi_step_deg = 45

[dwell]
dwell_ms = 20

[dark]
method = "shutter"
every = 20
dwell_ms = 40

[reference]
every = 20
dwell_ms = 40

[fit]
angular_degree = 3
position_degree = 0
"#;

/// A rig at a serial port, and what is done with it.
struct Lab {
    bench: Bench,
}

/// A process that does not outlive its test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Process {
    /// Pulls the plug: no last words.
    fn kill(mut self) {
        self.0.kill().unwrap();
        assert_eq!(self.0.wait().unwrap().signal(), Some(9));
    }

    /// Asks it to end, and waits for its exit code.
    fn end(mut self) -> Option<i32> {
        let id = self.0.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
        let deadline = Instant::now() + PATIENCE;
        while self.0.try_wait().unwrap().is_none() {
            assert!(Instant::now() < deadline, "did not end");
            sleep(Duration::from_millis(10));
        }
        self.0.wait().unwrap().code()
    }
}

impl Lab {
    fn new() -> Self {
        let bench = Bench::of("led-lobe").having("plan.toml", PLAN);
        let bench = bench
            .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 1000")
            .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 20000")
            .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 1000")
            .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 20000")
            .with("rig.toml", "settle_ms = 50", "settle_ms = 5");
        let rig = bench.text("rig.toml");
        let rig = rig.split("\n[simulated]").next().unwrap();
        let port = bench.path(LINK).display().to_string();
        let serial = format!("kind = \"serial\"\nport = \"{port}\"");
        let serial = rig.replace("kind = \"simulated\"", &serial);
        Self { bench: bench.having("in-process.toml", rig).having("rig.toml", serial) }
    }

    fn port(&self) -> String {
        self.bench.path(LINK).display().to_string()
    }

    /// Plugs the rig in.
    fn sim(&self) -> Process {
        let arguments = ["sim", "--rig", "rig.toml", "--scene", "scene.toml", "--pty", LINK];
        let mut sim = self.spawn(&arguments);
        // It says where it is once it is there.
        let mut line = String::new();
        BufReader::new(sim.0.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line.trim_end(), LINK);
        sim
    }

    /// A daemon, ready to listen.
    fn daemon(&self) -> Process {
        let socket = format!("unix:{}", self.bench.path("gonio.sock").display());
        let daemon =
            self.spawn(&["daemon", "--rig", "rig.toml", "--data", "data", "--listen", &socket]);
        wait_until("the daemon", || self.bench.gonio(&["status", "--json"]).code == Some(0));
        daemon
    }

    fn spawn(&self, arguments: &[&str]) -> Process {
        let mut command = self.bench.command(arguments);
        Process(command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap())
    }

    fn status(&self) -> Value {
        self.bench.gonio(&["status", "--json"]).well().json()
    }

    #[track_caller]
    fn wait_for(&self, what: &str, is_it: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let status = self.status();
            if is_it(&status) {
                return status;
            }
            assert!(Instant::now() < deadline, "never {what}: {status:#}");
            sleep(Duration::from_millis(20));
        }
    }

    #[track_caller]
    fn wait_for_readings(&self, count: u64) {
        self.wait_for("so many readings", |status| done(status) >= count);
    }

    #[track_caller]
    fn wait_for_run(&self, state: &str) -> Value {
        self.wait_for(state, |status| status["runs"][0]["state"] == state)
    }

    fn submit(&self) {
        let submitted = self.bench.gonio(&["submit", "plan.toml", "--json"]).well().json();
        assert_eq!((&submitted["id"], &submitted["simulated"]), (&1.into(), &false.into()));
    }

    fn ask(&self, what: &str) -> String {
        let asked = self.bench.gonio(&[what, "1", "--json"]).well().json();
        asked["answer"].as_str().unwrap().to_owned()
    }

    /// What the device says of itself, asked by nobody but us: the port must be free.
    fn device(&self) -> Status {
        let settings = SerialSettings {
            port: self.port(),
            baud: BAUD,
            reset_on_open: false,
            boot_wait: Duration::ZERO,
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let link = serial_opener(settings)().await.unwrap();
            // Each connection has a session of its own.
            let session = std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap().subsec_nanos();
            let connected = Controller::connect(link, session, BAUD, Duration::from_secs(3)).await;
            connected.unwrap().0.status().await.unwrap()
        })
    }

    /// The device at rest, twice.
    #[track_caller]
    fn at_rest(&self) -> Status {
        let first = self.device();
        sleep(Duration::from_millis(200));
        let then = self.device();
        assert!(!then.moving && then.running.is_none() && then.queued == 0, "{then:?}");
        assert_eq!(first.readback, then.readback, "it moves");
        then
    }

    fn folder(&self) -> String {
        self.status()["runs"][0]["folder"].as_str().unwrap().to_owned()
    }

    /// The run's journal holds every step once, in time that goes forward.
    fn assert_whole(&self, homings: usize) -> Vec<gonio::rig::Reading> {
        let journal = Reader::open(&Path::new(&self.folder()).join("run.sqlite")).unwrap();
        let steps = journal.steps().unwrap();
        let planned: Vec<_> = steps.iter().map(|step| step.id).collect();
        let readings = journal.readings(Order::Id).unwrap();
        let ids: Vec<_> = readings.iter().map(|reading| reading.id).collect();
        let of_plan: Vec<_> = ids.iter().copied().filter(|id| *id < 0x4000_0000).collect();
        assert_eq!(of_plan, planned);
        let taken = journal.readings(Order::Taken).unwrap();
        for pair in taken.windows(2) {
            assert!(pair[0].time_s < pair[1].time_s, "{:?} {:?}", pair[0], pair[1]);
        }
        let events = journal.events().unwrap();
        let homed = events.iter().filter(|event| event.kind == EventKind::Homed);
        assert_eq!(homed.count(), homings, "{events:?}");
        readings
    }
}

fn wait_until(what: &str, is_it: impl Fn() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !is_it() {
        assert!(Instant::now() < deadline, "never: {what}");
        sleep(Duration::from_millis(20));
    }
}

fn done(status: &Value) -> u64 {
    status["current_run"]["progress"]["done"].as_u64().unwrap_or(0)
}

/// Radiance by target, of a samples.csv in which no target stands twice.
fn radiances(csv: &str) -> BTreeMap<usize, f64> {
    let mut lines = csv.lines();
    let head: Vec<_> = lines.next().unwrap().split(',').collect();
    let radiance = head.iter().position(|name| *name == "radiance_w_per_m2_sr").unwrap();
    let mut radiances = BTreeMap::new();
    for line in lines {
        let cells: Vec<_> = line.split(',').collect();
        let index = cells[0].parse().unwrap();
        let again = radiances.insert(index, cells[radiance].parse().unwrap());
        assert_eq!(again, None, "target {index} twice");
    }
    radiances
}

#[test]
fn paused_killed_and_continued_a_run_is_whole_and_equals_an_uninterrupted_one() {
    let lab = Lab::new();
    let _sim = lab.sim();
    let daemon = lab.daemon();
    lab.submit();
    lab.wait_for_readings(8);

    assert!(lab.ask("pause").starts_with("paus"));
    let paused = lab.wait_for("paused", |status| status["state"] == "paused");
    assert_eq!(lab.wait_for_run("paused")["position_trusted"], true);
    sleep(Duration::from_millis(500));
    let still = lab.status();
    assert_eq!((done(&still), &still["state"]), (done(&paused), &paused["state"]), "at rest");

    assert_eq!(lab.ask("continue"), "continuing");
    lab.wait_for_readings(done(&paused) + 15);
    daemon.kill();
    // The lease runs out, and the device comes to rest by itself.
    sleep(Duration::from_secs(1));
    let left = lab.at_rest();

    let daemon = lab.daemon();
    sleep(Duration::from_secs(1));
    let status = lab.wait_for_run("interrupted");
    assert_eq!(status["interrupted_runs"], serde_json::json!([1]));
    assert_eq!((&status["state"], &status["current_run"]), (&"idle".into(), &Value::Null));
    assert_eq!(lab.at_rest().readback, left.readback, "motion resumed by itself");

    lab.ask("continue");
    lab.wait_for_run("complete");
    let readings = lab.assert_whole(2);
    let parts = radiances(&std::fs::read_to_string(lab.folder() + "/samples.csv").unwrap());
    assert_eq!(daemon.end(), Some(0));

    let run = ["run", "plan.toml", "--rig", "in-process.toml", "--scene", "scene.toml"];
    lab.bench.gonio(&[&run[..], &["--out", "whole"]].concat()).well();
    let whole = radiances(&lab.bench.text("whole/samples.csv"));
    assert_eq!((parts.len(), whole.len()), (TARGETS, TARGETS));
    assert_eq!(readings.iter().map(|reading| reading.session).max(), Some(1));
    // 100 cos^10 on axis falls by at most 285 a radian; a mark is found again to 0.005°, drawn
    // twice, and the zero of two axes.
    let again = 285.0 * 0.005_f64.to_radians() * 2.0;
    let sessions: BTreeMap<_, _> = readings
        .iter()
        .filter_map(|reading| match reading.kind {
            gonio::rig::ReadingKind::Target { index, .. } => Some((index, reading.session)),
            _ => None,
        })
        .collect();
    for (index, value) in &parts {
        let off = (value - whole[index]).abs();
        let session = sessions[&u32::try_from(*index).unwrap()];
        let most = if session == 0 { 1e-12 * value.abs() } else { 5.0 * again };
        assert!(off <= most, "target {index}: {value} in session {session}, {}", whole[index]);
    }
}

#[test]
fn an_unplugged_rig_is_named_and_a_continue_homes_it_and_completes() {
    let lab = Lab::new();
    let sim = lab.sim();
    let daemon = lab.daemon();
    lab.submit();
    lab.wait_for_readings(10);
    sim.kill();
    let status = lab.wait_for("faulted", |status| status["state"] == "faulted");
    let fault = status["fault"].as_str().unwrap();
    assert!(fault.contains("link lost") && fault.contains("hung up"), "{fault}");
    assert_eq!(status["position_trusted"], false);
    // Nobody there yet: the run goes on waiting.
    lab.ask("continue");
    let status = lab.wait_for("still faulted", |status| {
        status["fault"].as_str().is_some_and(|fault| fault.contains("no such port"))
    });
    assert_eq!(status["state"], "faulted");

    let _sim = lab.sim();
    sleep(Duration::from_millis(300));
    assert_eq!(lab.status()["state"], "faulted", "it went on by itself");
    lab.ask("continue");
    lab.wait_for_run("complete");
    lab.assert_whole(2);
    assert_eq!(daemon.end(), Some(0));
}

#[test]
fn sigterm_stops_the_axes_and_exits_0() {
    let lab = Lab::new();
    let _sim = lab.sim();
    let daemon = lab.daemon();
    lab.submit();
    lab.wait_for_readings(10);
    assert_eq!(daemon.end(), Some(0));
    assert_eq!(lab.at_rest().fault, Some(firmware_protocol::Cause::Stopped));
    let _daemon = lab.daemon();
    lab.wait_for_run("interrupted");
    lab.ask("continue");
    lab.wait_for_run("complete");
    lab.assert_whole(2);
}
