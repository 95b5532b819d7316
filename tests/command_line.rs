//! The command line as scripts rely on it: help with an example that works, exit codes, JSON and
//! nothing else on standard output, and readers that go away.

mod bench;

use std::process::Stdio;
use std::time::{Duration, Instant};

use bench::{Bench, Said};

const COMMANDS: [&str; 20] = [
    "run", "resume", "fit", "report", "export", "plan", "frontier", "explain", "sim", "ports",
    "home", "jog", "read", "daemon", "submit", "status", "watch", "pause", "continue", "abort",
];

/// A bench that looks like a fresh clone, with a run that is done.
fn clone_with_a_run() -> Bench {
    let bench = Bench::small();
    for example in ["luminaire", "lambertian"] {
        let folder = bench::repository().join("examples").join(example);
        std::fs::create_dir_all(bench.path("examples").join(example)).unwrap();
        for entry in std::fs::read_dir(folder).unwrap() {
            let from = entry.unwrap().path();
            let to = bench.path("examples").join(example).join(from.file_name().unwrap());
            std::fs::copy(from, to).unwrap();
        }
    }
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    bench.having("rays.csv", "x_mm,y_mm,theta_deg,phi_deg\n0,0,0,0\n1,2,30,-40\n")
}

/// The example that a command's help shows.
fn example_of(bench: &Bench, command: &str) -> Vec<String> {
    let help = bench.gonio(&[command, "--help"]).well();
    let text = help.out.split_whitespace().collect::<Vec<_>>().join(" ");
    let (before, rest) = text.split_once("Example: gonio ").unwrap_or_else(|| panic!("{help}"));
    assert!(before.len() > 10, "does not say what it does\n{help}");
    let line = rest.split(" Usage:").next().unwrap();
    line.split(' ').map(str::to_owned).collect()
}

#[test]
fn every_command_says_what_it_does_and_shows_an_example() {
    let bench = Bench::empty();
    let help = bench.gonio(&["--help"]).well();
    for command in COMMANDS {
        assert!(help.out.contains(&format!("\n  {command} ")), "{command}\n{help}");
        assert_eq!(example_of(&bench, command)[0], command);
    }
    let version = bench.gonio(&["--version"]).well();
    assert_eq!(version.out, format!("gonio {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn examples_that_need_no_rig_and_no_daemon_work_as_they_are_written() {
    let bench = clone_with_a_run();
    for command in ["run", "plan", "explain"] {
        let example = example_of(&bench, command);
        let arguments: Vec<&str> = example.iter().map(String::as_str).collect();
        let said = bench.gonio(&arguments).well();
        assert!(!said.out.is_empty(), "{said}");
    }
    for command in ["resume", "fit", "report", "export"] {
        let example = example_of(&bench, command);
        let of_a_run = example.iter().map(|argument| match argument.as_str() {
            argument if argument.starts_with("runs/") => "out",
            argument => argument,
        });
        bench.gonio(&of_a_run.collect::<Vec<_>>()).well();
    }
    let runs: Vec<String> =
        bench.names().into_iter().filter(|name| name.ends_with("/fit.json")).collect();
    assert_eq!(runs.len(), 2, "{runs:?}");
    assert!(runs[1].starts_with("runs/luminaire-20"), "{runs:?}");
}

#[test]
fn what_is_no_command_or_flag_is_refused_with_the_nearest() {
    let bench = Bench::small();
    bench.gonio(&["pln", "plan.toml"]).refused(&["unrecognized subcommand 'pln'", "'plan'"]);
    bench.gonio(&["plan", "plan.toml", "--rigg", "r"]).refused(&["'--rigg'", "'--rig'"]);
    bench.gonio(&["plan", "plan.toml", "--seed", "x"]).refused(&["--seed", "'x'"]);
    bench.gonio(&["plan"]).refused(&["<PLAN>"]);
    bench.gonio(&["export", "out", "--format", "xls"]).refused(&["xls", "csv"]);
    bench.gonio(&["sim", "--baud", "3"]).refused(&["--baud", "1200..=12000000"]);
    bench.gonio(&[]).refused(&["Usage: gonio"]);
}

#[test]
fn json_is_one_document_and_nothing_else() {
    let bench = clone_with_a_run();
    let plan = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    assert_eq!(plan["plan"], "small");
    assert_eq!(plan["simulated"], true);
    assert!(plan["time_s"]["total"].as_f64().unwrap() > 1.0);
    let run = bench.gonio(&["run", "plan.toml", "--out", "json", "--json"]).well().json();
    assert_eq!(run["targets_measured"], plan["targets"]);
    assert_eq!(run["simulated"], true);
    let (value, u) = (&run["exitance_w_per_m2"]["value"], &run["exitance_w_per_m2"]["u"]);
    let error = value.as_f64().unwrap() - run["truth"]["exitance_w_per_m2"].as_f64().unwrap();
    assert!(error.abs() < 4.0 * u.as_f64().unwrap(), "{run}");
    let explain = bench.gonio(&["explain", "scene.toml", "--json"]).well().json();
    assert!(explain["effects"].as_array().unwrap().len() > 3);
    let ports = bench.gonio(&["ports", "--json"]).well().json();
    assert!(ports["ports"].is_array());
    let fit = bench.gonio(&["fit", "out", "--json"]).well().json();
    assert_eq!(fit, bench.json("out/fit.json"));
    let fit = bench.gonio(&["fit", "out/samples.csv", "--angular-degree", "2", "--json"]);
    assert_eq!(fit.well().json()["quantity"], "radiance");
}

#[test]
fn standard_error_is_quiet_where_nothing_is_wrong() {
    let bench = Bench::small();
    let run = bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    assert_eq!(run.err, "", "no progress but on a terminal");
    for command in [&["plan", "plan.toml"][..], &["explain", "scene.toml"], &["fit", "out"]] {
        assert_eq!(bench.gonio(command).well().err, "");
    }
    let export = bench.gonio(&["export", "out", "--format", "csv"]).well();
    assert_eq!(export.err, "");
    assert_eq!(export.out, bench.text("out/samples.csv"));
    bench.gonio(&["export", "out", "--format", "csv", "-o", "s.csv"]).well();
    assert_eq!(bench.text("s.csv"), export.out);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let bench = clone_with_a_run();
    for command in [
        "gonio export out --format csv",
        "gonio fit out --json",
        "gonio fit out --at rays.csv",
        "gonio plan plan.toml --json",
        "gonio explain scene.toml",
        "gonio ports",
        "gonio run plan.toml --out again",
        "gonio --help",
    ] {
        let line = format!("{{ {command}; echo \"code $?\" >&2; }} | true");
        let said = bench.shell(&line).well();
        assert_eq!(said.err, "code 0\n", "{said}");
    }
}

#[test]
fn rays_are_evaluated_in_the_order_asked_for() {
    let bench = clone_with_a_run();
    let said = bench.gonio(&["fit", "out", "--at", "rays.csv"]).well();
    let lines: Vec<&str> = said.out.lines().collect();
    let header = "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,u_radiance_w_per_m2_sr";
    assert!(lines[0].starts_with(header), "{said}");
    assert_eq!(lines.len(), 3);
    assert!(lines[1].starts_with("0,0,0,0,") && lines[2].starts_with("1,2,30,-40,"), "{said}");
    // A Lambertian patch of 50 W/(m² sr), with a detector known to 0.7 %.
    let radiance: f64 = lines[2].split(',').nth(4).unwrap().parse().unwrap();
    assert!((radiance - 50.0).abs() < 2.0, "{said}");
}

/// `gonio sim` prints its port as soon as it serves, and goes when it is told to.
#[test]
fn a_simulated_device_is_there_until_it_is_stopped() {
    let bench = Bench::small();
    let mut command = bench.command(&["sim", "--scene", "scene.toml", "--pty", "port"]);
    let device = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while !bench.path("port").exists() && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let probe = bench.gonio(&["ports", "--probe", "port", "--json"]).well().json();
    assert_eq!(probe["axes"].as_array().unwrap().len(), 4);
    let bench = bench.at_port("port");
    let home = bench.gonio(&["read", "--rig", "rig.toml", "--dwell-ms", "20", "--json"]);
    home.well().json();
    bench::signal(&device, "TERM");
    let said = Said::from_output("gonio sim", &device.wait_with_output().unwrap()).well();
    assert_eq!(said.out, "port\n");
    assert!(!bench.path("port").exists(), "the link stayed");
}

#[test]
fn effects_are_explained_over_a_plan_and_chosen_by_name() {
    let bench = Bench::of("lambertian");
    let explain = |more: &[&str]| {
        let words = ["explain", "scene.toml", "--plan", "plan.toml", "--json"];
        bench.gonio(&[&words[..], more].concat())
    };
    let row = |document: &serde_json::Value, name: &str| {
        let rows = document["effects"].as_array().unwrap();
        rows.iter().find(|row| row["effect"] == name).cloned().unwrap_or_else(|| panic!("{name}"))
    };
    let said = explain(&[]).well().json();
    // The whole footprint stays on an even patch: no influence at all.
    let beam = row(&said, "finite-beam");
    assert_eq!((&beam["included"], &beam["bound"]["value"]), (&false.into(), &0.0.into()));
    let shot = row(&said, "shot-noise");
    assert!(shot["included"] == true && shot["cost_ns"].is_number(), "{shot}");
    assert!((said["region"]["theta_max_deg"].as_f64().unwrap() - 80.0).abs() < 1e-9, "{said}");
    let forced = explain(&["--force", "finite-beam", "--without", "shot-noise"]).well().json();
    assert_eq!(row(&forced, "finite-beam")["included"], true);
    assert_eq!(row(&forced, "shot-noise")["included"], false);
    explain(&["--without", "shot-nois"])
        .refused(&["no effect is called", "did you mean shot-noise"]);
    explain(&["--without", "saturation"]).refused(&["saturation", "part of what a reading is"]);
    bench
        .gonio(&["frontier", "plan.toml", "--out", "ladder", "--without", "saturation"])
        .refused(&["saturation", "part of what a reading is"]);
    bench.gonio(&["explain", "plan.toml"]).refused(&["plan.toml", "is a plan, not a scene"]);
}
