//! A daemon in a folder of its own, and a plain HTTP client that takes nothing for granted.

use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Longer than any of it takes on a machine that is busy with other tests.
const PATIENCE: Duration = Duration::from_secs(90);

const PLAN: &str = "
name = \"small\"
rig = \"rig.toml\"
scene = \"scene.toml\"
[region]
x_mm = [-5, 5]
y_mm = [-5, 5]
theta_max_deg = 60
[schedule]
kind = \"low-discrepancy\"
count = 40
[dwell]
dwell_ms = 20
gain = \"1 uA\"
[dark]
method = \"shutter\"
every = 20
dwell_ms = 20
[reference]
x_mm = 0
y_mm = 0
theta_deg = 0
phi_deg = 0
every = 10
dwell_ms = 20
[fit]
angular_degree = 2
position_degree = 0
";

/// A folder with a quick rig, a scene, a plan, and a daemon's data.
pub(crate) struct Place {
    folder: tempfile::TempDir,
}

/// A daemon that runs; killed when it is dropped.
pub(crate) struct Served {
    child: Child,
    address: String,
}

/// What `submit` would send.
pub(crate) fn bundle(place: &Place) -> String {
    json!({"files": [
        {"role": "plan", "name": "plan.toml", "text": place.plan()},
        {"role": "rig", "name": "rig.toml", "text": place.rig()},
        {"role": "scene", "name": "scene.toml", "text": place.scene()},
    ]})
    .to_string()
}

pub(crate) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(30));
    }
}

impl Place {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/lambertian");
        let read = |name: &str| std::fs::read_to_string(example.join(name)).unwrap();
        let rig = read("rig.toml")
            .replace("simulated gantry", "fast gantry")
            .replace("speed_deg_per_s = 60", "speed_deg_per_s = 600")
            .replace("acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 12000")
            .replace("speed_mm_per_s = 100", "speed_mm_per_s = 500")
            .replace("acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 10000")
            .replace("settle_ms = 50", "settle_ms = 5");
        let place = Self { folder };
        place.write("rig.toml", &rig);
        place.write("scene.toml", &read("scene.toml"));
        place.write("plan.toml", PLAN);
        place
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    pub(crate) fn plan(&self) -> String {
        self.read("plan.toml")
    }

    pub(crate) fn rig(&self) -> String {
        self.read("rig.toml")
    }

    pub(crate) fn scene(&self) -> String {
        self.read("scene.toml")
    }

    /// serial.toml: the same rig at the end of a serial line.
    pub(crate) fn write_serial_rig(&self, port: &str) {
        let link = format!("kind = \"serial\"\nport = \"{}\"", self.path(port).display());
        let rig = self.rig().replace("kind = \"simulated\"", &link);
        let (rig, _) = rig.split_once("\n[simulated]").unwrap();
        self.write("serial.toml", rig);
    }

    pub(crate) fn socket(&self) -> PathBuf {
        self.folder.path().join("gonio.sock")
    }

    /// The samples of a run that is over.
    pub(crate) fn samples(&self, run: &str) -> Vec<String> {
        let text = self.read(&format!("data/runs/{run}/samples.csv"));
        text.lines().map(str::to_owned).collect()
    }

    pub(crate) fn gonio(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gonio"));
        command.args(arguments).current_dir(self.folder.path());
        command.env("XDG_RUNTIME_DIR", self.folder.path());
        command
    }

    pub(crate) fn command(&self, listen: &str) -> Command {
        self.command_of(&["--rig", "rig.toml", "--scene", "scene.toml"], listen)
    }

    fn command_of(&self, rig: &[&str], listen: &str) -> Command {
        let listening = ["--data", "data", "--listen", listen];
        self.gonio(&[&["daemon"], rig, &listening[..]].concat())
    }

    /// `gonio sim`, until it is dropped.
    pub(crate) fn device_on_a_pseudo_terminal(&self, link: &str) -> Device {
        let rig = ["--rig", "rig.toml", "--scene", "scene.toml"];
        let mut command = self.gonio(&[&["sim", "--pty", link], &rig[..]].concat());
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let device = Device(child);
        wait_until("the pseudo-terminal is there", || self.path(link).exists());
        device
    }

    /// On the default socket.
    pub(crate) fn daemon(&self) -> Served {
        self.daemon_at(&format!("unix:{}", self.socket().display()))
    }

    pub(crate) fn daemon_at(&self, listen: &str) -> Served {
        served(self.command(listen))
    }

    /// A daemon of another rig than the simulated one, on the default socket.
    pub(crate) fn daemon_of(&self, rig: &[&str]) -> Served {
        served(self.command_of(rig, &format!("unix:{}", self.socket().display())))
    }
}

fn served(mut command: Command) -> Served {
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    lines.read_line(&mut line).unwrap();
    let address = line.trim().rsplit_once("listening at ").map(|(_, at)| at.to_owned());
    // What else it says must not fill the pipe.
    std::thread::spawn(move || std::io::copy(&mut lines, &mut std::io::stderr()));
    Served { address: address.unwrap_or_else(|| panic!("it says: {line}")), child }
}

/// A simulated device in a process of its own.
pub(crate) struct Device(Child);

impl Drop for Device {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

trait Stream: Read + Write + Send {}
impl<S: Read + Write + Send> Stream for S {}

fn connect(address: &str) -> Box<dyn Stream> {
    if let Some(path) = address.strip_prefix("unix:") {
        let stream = UnixStream::connect(path).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        return Box::new(stream);
    }
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    Box::new(stream)
}

impl Served {
    pub(crate) fn get(&self, path: &str) -> (u16, Value) {
        let head = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
        self.send(head.as_bytes())
    }

    pub(crate) fn post(&self, path: &str, body: &str) -> (u16, Value) {
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-length: {}\r\n\r\n",
            body.len()
        );
        self.send(&[head.as_bytes(), body.as_bytes()].concat())
    }

    pub(crate) fn send(&self, request: &[u8]) -> (u16, Value) {
        let mut stream = connect(&self.address);
        // Whoever refuses a body need not read it.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8(answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").expect("an HTTP answer");
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, serde_json::from_str(body).unwrap_or_else(|_| json!({"not JSON": body})))
    }

    pub(crate) fn state_of(&self, run: i64) -> String {
        let (_, run) = self.get(&format!("/runs/{run}"));
        run["state"].as_str().unwrap_or_else(|| panic!("{run}")).to_owned()
    }

    pub(crate) fn wait_for(&self, run: i64, state: &str) {
        wait_until(&format!("run {run} is {state}"), || {
            let now = self.state_of(run);
            assert!(
                now == state || !["failed", "aborted", "complete"].contains(&&*now),
                "run {run}: {}",
                self.get(&format!("/runs/{run}")).1
            );
            now == state
        });
    }

    /// Waits until a run has at least that many readings, and says how many.
    pub(crate) fn wait_for_readings(&self, run: i64, least: usize) -> usize {
        let mut had = 0;
        wait_until(&format!("run {run} has {least} readings"), || {
            had = self.ids_of(run).len();
            had >= least
        });
        had
    }

    /// The ids of a run's readings, rising.
    pub(crate) fn ids_of(&self, run: i64) -> Vec<u64> {
        let (_, page) = self.get(&format!("/runs/{run}/readings?limit=2000"));
        let readings = page["readings"].as_array().unwrap_or_else(|| panic!("{page}"));
        let mut ids: Vec<u64> =
            readings.iter().map(|reading| reading["id"].as_u64().unwrap()).collect();
        ids.sort_unstable();
        ids
    }

    /// Events after a number, up to the first of this kind.
    pub(crate) fn events_after(&self, after: i64, last: &str) -> Vec<Value> {
        follow(&self.address, after, |event| event["kind"] == last)
    }

    /// All events until the daemon ends.
    pub(crate) fn watch(&self, after: i64) -> JoinHandle<Vec<Value>> {
        let address = self.address.clone();
        let (seen, first) = std::sync::mpsc::channel();
        let watching = std::thread::spawn(move || {
            follow(&address, after, |_| {
                let _ = seen.send(());
                false
            })
        });
        first.recv_timeout(PATIENCE).expect("an event");
        watching
    }

    /// SIGKILL.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM, and how it ended.
    pub(crate) fn terminate(mut self) -> ExitStatus {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
        let mut ended = None;
        wait_until("the daemon has ended", || {
            ended = self.child.try_wait().unwrap();
            ended.is_some()
        });
        ended.unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn follow(address: &str, after: i64, mut is_last: impl FnMut(&Value) -> bool) -> Vec<Value> {
    let mut stream = connect(address);
    let head = format!("GET /events?after={after} HTTP/1.1\r\nhost: localhost\r\n\r\n");
    stream.write_all(head.as_bytes()).unwrap();
    let (mut events, mut sequence) = (Vec::new(), 0);
    for line in BufReader::new(stream).lines() {
        let Ok(line) = line else { break };
        if let Some(id) = line.strip_prefix("id: ") {
            sequence = id.trim().parse().unwrap();
        } else if let Some(data) = line.strip_prefix("data: ") {
            let mut event: Value = serde_json::from_str(data).unwrap();
            event["sequence"] = json!(sequence);
            let is_last = is_last(&event);
            events.push(event);
            if is_last {
                break;
            }
        }
    }
    events
}
