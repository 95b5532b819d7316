//! The architecture as a test: which room may import which, who may read a clock, who knows SQL,
//! and how large a file may grow. A failure names the rule, the place and the remedy.
//!
//! It reads sources as text. It does not know Rust: a rule that needs the compiler is a lint.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The root package's rooms by floor, lowest first. A room imports only from lower floors.
const FLOORS: [&[&str]; 8] = [
    &["rig"],
    &["plan"],
    &["study"],
    &["journal", "device", "export"],
    &["report"],
    &["run"],
    &["daemon"],
    &["cli"],
];

/// Which of our crates each crate may depend on.
const CRATES: [(&str, &[&str]); 6] = [
    ("firmware-protocol", &[]),
    ("radiometry", &[]),
    ("photometry-files", &[]),
    ("spanned-toml", &[]),
    ("sim", &["firmware-protocol", "radiometry", "photometry-files", "spanned-toml"]),
    ("fit", &["radiometry"]),
];

/// Sources that are handed the time, read no files, log nothing and roll no dice.
const PURE: [&str; 9] = [
    "src/rig/",
    "src/plan/",
    "src/study/",
    "src/run/machine",
    "src/run/resume",
    "fit/src/",
    "radiometry/src/",
    "firmware-protocol/src/",
    "photometry-files/src/",
];

/// Where a library is known: SQL, HTTP, arguments, serial ports, terminals and linear algebra can
/// each be replaced by changing these places alone.
const KNOWN_IN: [(&str, &[&str]); 9] = [
    ("rusqlite", &["src/journal/"]),
    ("hyper", &["src/daemon/http/", "src/cli/client.rs"]),
    ("clap", &["src/cli/args/", "src/cli/mod.rs"]),
    ("tokio_serial", &["src/device/"]),
    ("serialport", &["src/device/"]),
    ("indicatif", &["src/cli/"]),
    ("faer", &["fit/src/"]),
    ("kuva", &["src/report/"]),
    ("rand_pcg", &["sim/src/"]),
];

const LINES_MAX: usize = 500;
/// An overview that is longer is read by nobody.
const ARCHITECTURE_LINES_MAX: usize = 150;

struct Source {
    path: String,
    text: String,
}

impl Source {
    /// Lines with their numbers, up to the unit tests at the file's foot, comments left out.
    fn code(&self) -> impl Iterator<Item = (usize, &str)> {
        let product = self.text.split("\n#[cfg(test)]").next().unwrap_or_default();
        product
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line))
            .filter(|(_, line)| !line.trim_start().starts_with("//"))
    }

    fn is_product(&self) -> bool {
        let in_src = self.path.starts_with("src/") || self.path.contains("/src/");
        in_src && !self.path.starts_with("benches/") && !self.path.ends_with("tests.rs")
    }
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every file of the repository that ends so, with its text.
fn collect(folder: &Path, ends: &[&str], sources: &mut Vec<Source>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') && name != "runs" {
                collect(&path, ends, sources);
            }
        } else if path.extension().is_some_and(|extension| ends.iter().any(|e| extension == *e)) {
            let relative = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
            sources.push(Source { path: relative, text: fs::read_to_string(&path).unwrap() });
        }
    }
}

fn sources() -> Vec<Source> {
    let mut sources = Vec::new();
    collect(&root(), &["rs"], &mut sources);
    assert!(sources.len() > 20, "the sources were not found");
    sources
}

fn demand(broken: &[String], rule: &str, remedy: &str) {
    assert!(broken.is_empty(), "\n{rule}\n  {}\nremedy: {remedy}\n", broken.join("\n  "));
}

/// Every product line that holds one of the words, but for the sources that `allowed` passes.
fn lines_with(words: &[&str], allowed: impl Fn(&str) -> bool) -> Vec<String> {
    let mut found = Vec::new();
    for source in sources().iter().filter(|s| s.is_product() && !allowed(&s.path)) {
        for (number, line) in source.code() {
            if let Some(word) = words.iter().find(|word| line.contains(**word)) {
                found.push(format!("{}:{number}: {word}", source.path));
            }
        }
    }
    found
}

fn room_of(path: &str) -> Option<&str> {
    path.strip_prefix("src/")?.split_once('/').map(|(room, _)| room)
}

fn floor_of(room: &str) -> Option<usize> {
    FLOORS.iter().position(|floor| floor.contains(&room))
}

#[test]
fn crates_depend_only_on_what_lies_below_them() {
    let ours: Vec<&str> = CRATES.iter().map(|(name, _)| *name).chain(["gonio"]).collect();
    let mut broken = Vec::new();
    for (name, allowed) in CRATES {
        let manifest = fs::read_to_string(root().join(name).join("Cargo.toml")).unwrap();
        let dependencies = manifest.split("[dependencies]").nth(1).unwrap_or_default();
        for line in dependencies.lines() {
            let dependency = line.split(['.', ' ', '=']).next().unwrap_or_default();
            if ours.contains(&dependency) && !allowed.contains(&dependency) {
                broken.push(format!("{name} depends on {dependency}"));
            }
        }
    }
    demand(
        &broken,
        "rule 1: the numeric and wire crates import nothing of ours, sim those, fit radiometry",
        "hand the value in as an argument, or move the code to the crate that may know both",
    );
}

#[test]
fn rooms_import_only_from_lower_floors() {
    let mut broken = Vec::new();
    for source in sources() {
        let Some(room) = room_of(&source.path) else { continue };
        let Some(floor) = floor_of(room) else {
            broken.push(format!("{}: src/{room}/ is on no floor", source.path));
            continue;
        };
        for (number, line) in source.code() {
            for other in FLOORS.iter().flat_map(|floor| floor.iter()).filter(|o| **o != room) {
                let named = line.contains(&format!("crate::{other}::"))
                    || line.contains(&format!("crate::{other};"));
                if named && floor_of(other).is_some_and(|f| f >= floor) {
                    broken.push(format!("{}:{number}: {room} imports {other}", source.path));
                }
            }
        }
    }
    broken.extend(lines_with(&["use crate::{"], |path| !path.starts_with("src/")));
    demand(
        &broken,
        "rule 2: no arrow runs up, and no two rooms of a floor know each other",
        "move the shared thing down, or hand it in from above",
    );
}

#[test]
fn the_hardware_path_does_not_know_that_a_simulator_exists() {
    let broken = lines_with(&["sim::", "use sim"], |path| {
        path.starts_with("src/cli/") || path.starts_with("sim/") || !path.starts_with("src/")
    });
    demand(&broken, "rule 3: only src/cli/ names sim", "take a byte stream (a Link) instead");
}

#[test]
fn pure_rooms_read_no_clock_and_do_no_io() {
    let impure = [
        "Instant::now",
        "SystemTime",
        "Timestamp::now",
        "std::fs",
        "std::net",
        "tokio::",
        "println!",
        "eprintln!",
        "tracing::",
        "rand_pcg",
        "std::process",
    ];
    let broken = lines_with(&impure, |path| !PURE.iter().any(|room| path.starts_with(room)));
    demand(
        &broken,
        "rule 4: rig, plan, study, fit, radiometry and the run machine are pure",
        "take the time, the bytes or the random number as an argument",
    );
    let wall = ["SystemTime::now", "Timestamp::now", "Zoned::now"];
    let broken = lines_with(&wall, |path| path.starts_with("src/cli/"));
    demand(&broken, "rule 4: wall time is read in cli alone", "hand the value on from cli");
}

#[test]
fn links_know_bytes_and_only_a_driver_knows_both() {
    let links = ["src/device/link.rs", "src/device/serial.rs", "src/device/ports.rs"];
    let broken = lines_with(&["firmware_protocol"], |path| !links.contains(&path));
    demand(&broken, "rule 5: a link does not know messages", "move it to the driver");
    let broken = lines_with(&[".flush().await"], |path| !path.starts_with("src/device/"));
    demand(
        &broken,
        "a serial port's flush blocks the executor and hides errors",
        "leave it out: writing is enough",
    );
}

#[test]
fn each_outer_library_is_known_in_one_place() {
    for (library, places) in KNOWN_IN {
        let words = [format!("{library}::"), format!("use {library}")];
        let words = words.each_ref().map(String::as_str);
        let broken = lines_with(&words, |path| places.iter().any(|place| path.starts_with(place)));
        demand(
            &broken,
            &format!("rule 6: only {} knows {library}", places.join(" and ")),
            "ask that room for what you need",
        );
    }
    let terminal = ["println!(", "print!("];
    let broken = lines_with(&terminal, |path| path.starts_with("src/cli/"));
    demand(&broken, "only the command line speaks to a terminal", "hand the text to cli");
}

#[test]
fn every_select_is_biased() {
    let mut broken = Vec::new();
    for source in sources().iter().filter(|s| s.is_product()) {
        let lines: Vec<(usize, &str)> = source.code().collect();
        for (i, (number, line)) in lines.iter().enumerate() {
            let biased = lines.get(i + 1).is_some_and(|(_, next)| next.contains("biased;"));
            if line.contains("select! {") && !biased {
                broken.push(format!("{}:{number}", source.path));
            }
        }
    }
    demand(
        &broken,
        "select! draws its order at random, which no simulated run can repeat",
        "write `biased;` first, then: stop, time-out, bytes, journal",
    );
}

#[test]
fn nothing_is_left_undone_and_nothing_from_outside_is_unwrapped() {
    let undone = ["todo!(", "unimplemented!(", "dbg!(", "FIXME", "XXX"];
    demand(&lines_with(&undone, |_| false), "nothing is left undone", "finish it, or remove it");
    let broken = lines_with(&[".unwrap()"], |_| false);
    demand(
        &broken,
        "no unwrap in product code",
        "return an error; for our own invariant, expect(\"why it holds\")",
    );
}

#[test]
fn files_open_with_what_they_are_and_stay_small() {
    let sources = sources();
    let large: Vec<String> = sources
        .iter()
        .map(|s| (s.path.as_str(), s.text.lines().count()))
        .filter(|(_, lines)| *lines > LINES_MAX)
        .map(|(path, lines)| format!("{path}: {lines} lines"))
        .collect();
    demand(&large, "a file has at most 500 lines", "split it by idea");
    let nameless: Vec<String> = sources
        .iter()
        .filter(|s| !s.text.starts_with("//!") && !s.text.starts_with("#!"))
        .map(|s| s.path.clone())
        .collect();
    demand(&nameless, "a file opens with //!", "say what it is and what it does not know");
}

#[test]
fn every_room_and_crate_says_what_it_does_not_know() {
    let rooms = FLOORS.iter().flat_map(|floor| floor.iter()).filter(|room| **room != "cli");
    let rooms = rooms.map(|room| format!("src/{room}/mod.rs"));
    let crates = CRATES.iter().map(|(name, _)| format!("{name}/src/lib.rs"));
    let overview = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let mut broken = Vec::new();
    for path in rooms.chain(crates) {
        let text = fs::read_to_string(root().join(&path)).unwrap();
        let head = text.lines().take_while(|line| line.starts_with("//!"));
        if !head.clone().any(|line| line.to_lowercase().contains("know")) {
            broken.push(path.clone());
        }
        let name = path.trim_start_matches("src/").split('/').next().unwrap();
        if !overview.contains(&format!("\n| `{name}` |")) {
            broken.push(format!("ARCHITECTURE.md: no row for {name}"));
        }
    }
    demand(&broken, "a room is what it does not know", "say it in its //! and in ARCHITECTURE.md");
    let lines = overview.lines().count();
    assert!(lines <= ARCHITECTURE_LINES_MAX, "ARCHITECTURE.md: {lines} lines, shorten it");
}

#[test]
fn documents_lead_somewhere_on_every_machine() {
    let mut documents = Vec::new();
    collect(&root(), &["md", "rs", "toml", "svg"], &mut documents);
    let mut broken = Vec::new();
    for document in documents.iter().filter(|d| d.path != "tests/tidy.rs") {
        for home in ["/home/", "/root/", "/Users/"] {
            let places = document.text.lines().enumerate().filter(|(_, line)| line.contains(home));
            broken.extend(places.map(|(i, _)| format!("{}:{}: {home}", document.path, i + 1)));
        }
        if Path::new(&document.path).extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let folder = root().join(&document.path).parent().unwrap().to_path_buf();
        for link in document.text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            if !link.contains("://") && !folder.join(file).exists() {
                broken.push(format!("{}: no {link}", document.path));
            }
        }
    }
    demand(
        &broken,
        "no path of one machine, no link to nowhere",
        "write the path from the repository's root or from the document",
    );
}

#[test]
fn rooms_have_names_of_the_field() {
    let drawers = ["utils", "util", "helpers", "helper", "common", "types", "prelude", "manager"];
    let mut broken = Vec::new();
    for source in sources() {
        let parts: Vec<&str> = source.path.split('/').collect();
        if parts.iter().any(|part| drawers.contains(&part.trim_end_matches(".rs"))) {
            broken.push(source.path.clone());
        }
    }
    demand(&broken, "no drawers", "name it after what it holds");
}

#[test]
fn the_build_needs_no_system_package() {
    let lock = fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let broken: Vec<String> =
        lock.lines().filter(|line| line.contains("libudev")).map(str::to_owned).collect();
    demand(
        &broken,
        "serialport is built without libudev",
        "set default-features = false on whatever turned it on",
    );
    let mut versions: BTreeMap<&str, usize> = BTreeMap::new();
    for line in lock.lines().filter(|line| *line == "name = \"libsqlite3-sys\"") {
        *versions.entry(line).or_default() += 1;
    }
    assert!(versions.values().all(|n| *n == 1), "one SQLite, bundled");
}
