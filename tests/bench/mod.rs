//! A lab bench for tests of the whole program: a folder with an example's files, and the program
//! run in it as a stranger would, by its command line alone.

#![allow(dead_code)] // each test program uses a part

pub(crate) mod device;
pub(crate) mod twins;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// A command that takes longer has lost its way.
const PATIENCE: Duration = Duration::from_mins(3);

const PLAN: &str = r#"name = "small"
rig = "rig.toml"
scene = "scene.toml"

[region]
x_mm = [-10, 10]
y_mm = [-10, 10]
theta_max_deg = 80

[schedule]
kind = "raster"
x_count = 2
y_count = 2
theta_step_deg = 20
phi_step_deg = 45
order = "travel"

[dwell]
dwell_ms = 20
gain = "1 uA"

[dark]
method = "shutter"
every = 20
dwell_ms = 50

[reference]
x_mm = 0
y_mm = 0
theta_deg = 0
phi_deg = 0
every = 20
dwell_ms = 50

[fit]
angular_degree = 2
position_degree = 1
"#;

/// The folder of an example, to spoil at will.
pub(crate) struct Bench {
    folder: TempDir,
}

/// What the program said, and how it ended.
pub(crate) struct Said {
    pub(crate) command: String,
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Bench {
    /// An empty one.
    pub(crate) fn empty() -> Self {
        Self { folder: TempDir::new().unwrap() }
    }

    /// With the files of an example.
    pub(crate) fn of(example: &str) -> Self {
        let bench = Self::empty();
        for entry in fs::read_dir(repository().join("examples").join(example)).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, bench.path(path.file_name().unwrap().to_str().unwrap())).unwrap();
        }
        bench
    }

    /// A plan with few targets, for which a test has time: the rig and scene are an example's.
    pub(crate) fn small() -> Self {
        Self::of("lambertian").having("plan.toml", PLAN)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Replaces what a file is sure to hold.
    pub(crate) fn with(self, file: &str, from: &str, to: &str) -> Self {
        let text = self.text(file);
        assert!(text.contains(from), "{file} has no {from:?}");
        fs::write(self.path(file), text.replace(from, to)).unwrap();
        self
    }

    /// Writes a file.
    pub(crate) fn having(self, file: &str, bytes: impl AsRef<[u8]>) -> Self {
        fs::write(self.path(file), bytes).unwrap();
        self
    }

    /// Makes a real rig of the simulated one, at this port.
    pub(crate) fn at_port(self, port: &str) -> Self {
        let rig = self.text("rig.toml");
        let rig = rig.split("\n[simulated]").next().unwrap();
        let serial = format!("kind = \"serial\"\nport = \"{port}\"");
        let rig = rig.replace("kind = \"simulated\"", &serial);
        self.having("rig.toml", rig).with("plan.toml", "scene = \"scene.toml\"\n", "")
    }

    /// At another port than before.
    pub(crate) fn at_port_again(self, port: &str) -> Self {
        let rig = self.text("rig.toml");
        let lines = rig.lines().map(|line| match line.strip_prefix("port = ") {
            Some(_) => format!("port = \"{port}\"\n"),
            None => format!("{line}\n"),
        });
        let rig: String = lines.collect();
        self.having("rig.toml", rig)
    }

    pub(crate) fn text(&self, file: &str) -> String {
        fs::read_to_string(self.path(file)).unwrap()
    }

    pub(crate) fn json(&self, file: &str) -> serde_json::Value {
        serde_json::from_str(&self.text(file)).unwrap()
    }

    /// Every file and folder below, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        fn collect(folder: &Path, root: &Path, names: &mut Vec<String>) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                names.push(path.strip_prefix(root).unwrap().to_str().unwrap().to_owned());
                if path.is_dir() {
                    collect(&path, root, names);
                }
            }
        }
        let mut names = Vec::new();
        collect(self.folder.path(), self.folder.path(), &mut names);
        names.sort();
        names
    }

    /// The program with these arguments, in this folder, without the user's surroundings.
    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gonio"));
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .env("XDG_RUNTIME_DIR", self.folder.path())
            .env("RUST_BACKTRACE", "1")
            .stdin(std::process::Stdio::null());
        command
    }

    /// Runs the program to its end.
    pub(crate) fn gonio(&self, arguments: &[&str]) -> Said {
        Said::of(&format!("gonio {}", arguments.join(" ")), self.command(arguments))
    }

    /// Runs a line of shell in which `gonio` is the program.
    pub(crate) fn shell(&self, line: &str) -> Said {
        let mut command = Command::new("sh");
        let function = format!("gonio() {{ '{}' \"$@\"; }}; {line}", env!("CARGO_BIN_EXE_gonio"));
        command.args(["-c", &function]).current_dir(self.folder.path());
        command.env("XDG_RUNTIME_DIR", self.folder.path()).stdin(std::process::Stdio::null());
        Said::of(line, command)
    }
}

impl Said {
    fn of(shown: &str, mut command: Command) -> Self {
        let began = Instant::now();
        let output = command.output().unwrap();
        let said = Self::from_output(shown, &output);
        assert!(began.elapsed() < PATIENCE, "took {:?}\n{said}", began.elapsed());
        said
    }

    pub(crate) fn from_output(command: &str, output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        let said = Self {
            command: command.to_owned(),
            code: output.status.code(),
            out: text(&output.stdout),
            err: text(&output.stderr),
        };
        assert!(!said.err.contains("panicked"), "a panic\n{said}");
        said
    }

    /// It ended well.
    #[track_caller]
    pub(crate) fn well(self) -> Self {
        assert_eq!(self.code, Some(0), "{self}");
        self
    }

    /// It could not start, and says so as this program does: on standard error alone, with every
    /// one of these parts.
    #[track_caller]
    pub(crate) fn refused(self, parts: &[&str]) -> Self {
        assert_eq!(self.code, Some(2), "{self}");
        assert_eq!(self.out, "", "{self}");
        self.says(parts)
    }

    #[track_caller]
    pub(crate) fn says(self, parts: &[&str]) -> Self {
        for part in parts {
            assert!(self.err.contains(part), "does not say {part:?}:\n{self}");
        }
        self
    }

    /// Standard output as one JSON document.
    #[track_caller]
    pub(crate) fn json(&self) -> serde_json::Value {
        match serde_json::from_str(&self.out) {
            Ok(document) => document,
            Err(error) => panic!("not one JSON document ({error}):\n{self}"),
        }
    }
}

impl std::fmt::Display for Said {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { command, code, out, err } = self;
        write!(f, "$ {command}\n[exit code {code:?}]\n{out}\n[standard error]\n{err}")
    }
}

/// Sends a signal by its name.
pub(crate) fn signal(child: &Child, name: &str) {
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-s", name, &pid]).status().unwrap().success());
}

pub(crate) fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}
