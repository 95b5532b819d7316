//! Simulated devices of other makes at pseudo-terminals, as a process of their own, and runs on them.

use std::io::{BufRead as _, BufReader, Read as _};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use gonio::journal::{Order, Reader};

use super::{Bench, Said};

/// Whatever takes longer has stuck.
const PATIENCE: Duration = Duration::from_mins(2);
/// Names of readings that no plan has: the references that a resume begins with.
const OF_RESUMES: u32 = 1 << 31;

/// A rig file's devices, at ports in the bench's folder; the simulated ones' file is kept as
/// `simulated.toml`. Each driver's port has the driver's name.
pub(crate) fn at_ports(bench: Bench, drivers: &[&str]) -> Bench {
    let simulated = bench.text("rig.toml");
    let real = simulated.split("\n[simulated]").next().unwrap();
    let mut real = real.replace("kind = \"simulated\"", "kind = \"devices\"");
    for driver in drivers {
        let line = format!("driver = \"{driver}\"\n");
        assert!(real.contains(&line), "no {driver}");
        let port = bench.path(driver);
        real = real.replace(&line, &format!("{line}port = \"{}\"\n", port.display()));
    }
    let bench = bench.having("simulated.toml", &simulated).having("rig.toml", real);
    bench.with("plan.toml", "scene = \"scene.toml\"\n", "")
}

/// A process that does not outlive its test.
pub(crate) struct Process(pub(crate) Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Devices that are switched on.
pub(crate) struct Devices {
    process: Process,
    _said: BufReader<ChildStdout>,
}

impl Devices {
    /// Those of `simulated.toml`, at links with their drivers' names.
    pub(crate) fn switched_on(bench: &Bench, drivers: &[&str]) -> Self {
        let links = drivers.join(",");
        let words = ["sim", "--rig", "simulated.toml", "--scene", "scene.toml", "--pty", &links];
        let mut command = bench.command(&words);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut process = Process(child);
        let mut said = BufReader::new(process.0.stdout.take().unwrap());
        for driver in drivers {
            let mut line = String::new();
            said.read_line(&mut line).unwrap();
            assert_eq!(line.trim(), *driver);
        }
        Self { process, _said: said }
    }

    /// Holds them up for so long, and lets them go again.
    pub(crate) fn hold_up(&self, duration: Duration) {
        let signal = |name: &str| {
            let id = self.process.0.id().to_string();
            assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
        };
        signal("-STOP");
        sleep(duration);
        signal("-CONT");
    }

    /// Switches them off; what they noticed meanwhile.
    pub(crate) fn notes(mut self) -> String {
        self.process.0.kill().unwrap();
        let mut notes = String::new();
        self.process.0.stderr.take().unwrap().read_to_string(&mut notes).unwrap();
        notes
    }
}

/// The seconds at which the devices noticed this.
pub(crate) fn noted_s(notes: &str, what: &str) -> f64 {
    let line = notes.lines().find(|line| line.contains(what));
    let line = line.unwrap_or_else(|| panic!("nobody noted {what:?} in:\n{notes}"));
    line.split(' ').next().unwrap().parse().unwrap()
}

/// A command of the program that goes on in the background.
pub(crate) fn start(bench: &Bench, words: &[&str]) -> Process {
    let mut command = bench.command(words);
    Process(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
}

/// Its end, in time.
pub(crate) fn end(mut process: Process) -> Said {
    let began = Instant::now();
    while process.0.try_wait().unwrap().is_none() {
        assert!(began.elapsed() < PATIENCE, "it does not end");
        sleep(Duration::from_millis(20));
    }
    let mut texts = [String::new(), String::new()];
    process.0.stdout.take().unwrap().read_to_string(&mut texts[0]).unwrap();
    process.0.stderr.take().unwrap().read_to_string(&mut texts[1]).unwrap();
    let [out, err] = texts;
    let code = process.0.wait().unwrap().code();
    assert!(!err.contains("panicked"), "{err}");
    Said { command: "gonio".to_owned(), code, out, err }
}

/// The names of the plan's readings that are committed, in their order; none while there is no
/// journal yet.
pub(crate) fn committed(bench: &Bench) -> Vec<u32> {
    let reader = Reader::open(&bench.path("run/run.sqlite"));
    let readings = reader.and_then(|reader| reader.readings(Order::Id)).unwrap_or_default();
    readings.into_iter().map(|reading| reading.id).filter(|id| *id < OF_RESUMES).collect()
}

/// The plan's readings are all there, each once.
#[track_caller]
pub(crate) fn each_once(bench: &Bench) {
    let ids = committed(bench);
    let steps = Reader::open(&bench.path("run/run.sqlite")).unwrap().steps().unwrap();
    let planned = u32::try_from(steps.len()).unwrap();
    assert!(planned > 10 && ids == (0..planned).collect::<Vec<_>>(), "{planned}: {ids:?}");
}

/// Waits until so many are committed.
pub(crate) fn await_readings(bench: &Bench, run: &mut Process, readings: usize) {
    let began = Instant::now();
    while committed(bench).len() < readings {
        assert!(began.elapsed() < PATIENCE, "no {readings} readings");
        if let Some(status) = run.0.try_wait().unwrap() {
            let mut said = String::new();
            run.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
            panic!("it ended before, {status}: {said}");
        }
        sleep(Duration::from_millis(50));
    }
}
