//! A rig of Dynamixel servos and a meter, simulated: the example's plan in virtual time beside
//! gonio's own controller, and over pseudo-terminals with kills in between. Would break: a reading
//! lost or taken twice, a number that the meter did not say, axes that a dead host leaves moving.

mod bench;

use bench::Bench;
use bench::twins::{self, Devices};

const DRIVERS: [&str; 2] = ["dynamixel", "keithley-6485"];

struct Samples {
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
}

fn samples(bench: &Bench, file: &str) -> Samples {
    let text = bench.text(file);
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect());
    let heads = lines.next().unwrap();
    Samples { heads, rows: lines.collect() }
}

impl Samples {
    fn column(&self, name: &str) -> Vec<f64> {
        let place = self.heads.iter().position(|head| head == name).unwrap();
        self.rows.iter().map(|row| row[place].parse().unwrap()).collect()
    }
}

/// After homing the run took what its plan says: servos are asked whether they stand, and one of them swings
/// the shutter.
fn foretold(bench: &Bench) {
    let plan = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    let time = |part: &str| plan["time_s"][part].as_f64().unwrap();
    let readings = samples(bench, "run/readings.csv");
    let first_s = readings.column("time_s").into_iter().fold(f64::INFINITY, f64::min);
    let ends_us = readings.column("end_us").into_iter().fold(0.0, f64::max);
    let (foretold_s, took_s) = (time("total") - time("homing"), ends_us / 1e6 - first_s);
    assert!((took_s / foretold_s - 1.0).abs() < 0.01, "{took_s} s, {foretold_s} s foretold");
}

/// The example's plan, small: one spot, and steps of 40 and 60 degrees.
fn small() -> Bench {
    Bench::of("servo-arm")
        .with("plan.toml", "x_count = 2", "x_count = 1")
        .with("plan.toml", "y_count = 2", "y_count = 1")
        .with("plan.toml", "theta_step_deg = 15", "theta_step_deg = 40")
        .with("plan.toml", "phi_step_deg = 30", "phi_step_deg = 60")
        .with("plan.toml", "angular_degree = 4", "angular_degree = 2")
        .with("plan.toml", "position_degree = 1", "position_degree = 0")
}

#[test]
fn the_plan_reads_the_same_through_servos_and_a_meter() {
    let servos = Bench::of("servo-arm");
    servos.gonio(&["run", "plan.toml", "--out", "run"]).well();
    // The same rig with a controller of gonio's own: its files differ in who is at the port.
    let own = Bench::of("servo-arm");
    let rig = own.text("rig.toml");
    let (before, after) = rig.split_once("[[axes_link]]").unwrap();
    let (_, simulated) = after.split_once("[simulated]").unwrap();
    let own = own.having("rig.toml", format!("{before}[simulated]{simulated}"));
    own.gonio(&["run", "plan.toml", "--out", "run"]).well();
    foretold(&servos);
    let [a, b] = [&servos, &own].map(|bench| samples(bench, "run/samples.csv"));
    assert!(a.rows.len() == b.rows.len() && a.rows.len() > 100);
    let radiance = "radiance_w_per_m2_sr";
    let noise = "u_independent_radiance_w_per_m2_sr";
    let pairs = a.column(radiance).into_iter().zip(b.column(radiance));
    let noises = a.column(noise).into_iter().zip(b.column(noise));
    for (row, ((a, b), (ua, ub))) in pairs.zip(noises).enumerate() {
        let off = (a - b).abs() / ua.hypot(ub);
        assert!(off < 6.0, "target {row}: {a} beside {b}, {off} uncertainties");
    }
    for name in ["theta_deg", "phi_deg", "x_mm", "y_mm"] {
        for (a, b) in a.column(name).into_iter().zip(b.column(name)) {
            assert!((a - b).abs() < 0.1, "{name}: {a} beside {b}");
        }
    }
}

#[test]
fn over_terminals_a_killed_run_is_resumed_and_a_meter_that_is_unplugged_ends_it() {
    let bench = twins::at_ports(small(), &DRIVERS);
    let sim = Devices::switched_on(&bench, &DRIVERS);
    let mut run = twins::start(&bench, &["run", "plan.toml", "--out", "run"]);
    twins::await_readings(&bench, &mut run, 3);
    // No last words: the servos stop by themselves.
    run.0.kill().unwrap();
    run.0.wait().unwrap();
    let before = twins::committed(&bench).len();
    let mut run = twins::start(&bench, &["resume", "run"]);
    twins::await_readings(&bench, &mut run, before + 2);
    // All plugs out.
    drop(sim);
    assert_eq!(twins::end(run).code, Some(1));
    let _sim = Devices::switched_on(&bench, &DRIVERS);
    twins::end(twins::start(&bench, &["resume", "run"])).well();
    twins::each_once(&bench);
}

/// As on a machine that is busy with other things, or behind an adapter that hands bytes on late.
#[test]
fn devices_that_answer_late_again_and_again_cost_time_and_nothing_else() {
    let bench = twins::at_ports(small(), &DRIVERS);
    let sim = Devices::switched_on(&bench, &DRIVERS);
    let mut run = twins::start(&bench, &["run", "plan.toml", "--out", "run"]);
    let mut held_up = 0;
    while run.0.try_wait().unwrap().is_none() {
        // At moves and rest, by turns; an answer was called lost after 120 ms once.
        std::thread::sleep(std::time::Duration::from_millis(150 + held_up * 37 % 300));
        sim.hold_up(std::time::Duration::from_millis(300));
        held_up += 1;
    }
    let said = twins::end(run);
    assert!(held_up > 10, "{held_up}");
    if said.code != Some(0) {
        // Where the machine holds them up for as long again, the servos stop by themselves, and say
        // so; nobody who answers is called silent.
        said.says(&["its bus watchdog has struck"]);
        twins::end(twins::start(&bench, &["resume", "run", "--accept-drift"])).well();
    }
    twins::each_once(&bench);
}

#[test]
fn what_is_wrong_with_servos_or_meter_is_found_before_anything_moves() {
    let cases: [(&str, &str, &[&str]); 7] = [
        ("theta = 1, phi = 2", "theta = 1, phi = 1", &["ids", "moves another axis already"]),
        (
            "{ theta = 1, phi = 2, x = 3, y = 4 }\nzero_deg = { theta = 180, phi",
            "{ phi = 2, x = 3, y = 4 }\nzero_deg = { phi",
            &["no device moves theta"],
        ),
        ("id = 5, open", "id = 2, open", &["servo 2 moves an axis"]),
        ("closed_steps = 2048", "closed_steps = 1030", &["closed_steps", "200 steps apart"]),
        ("nplc = 1", "nplc = 100", &["nplc", "0.01"]),
        ("nplc = 1", "npcl = 1", &["did you mean `nplc`"]),
        ("full_scale_a = 2e-7", "full_scale_a = 1e-7", &["a range of 1e-7 A", "2e-8"]),
    ];
    for (from, to, words) in cases {
        let bench = small().with("rig.toml", from, to);
        let before = bench.names();
        bench.gonio(&["run", "plan.toml", "--out", "run"]).refused(words);
        assert_eq!(bench.names(), before);
    }
}

#[test]
fn a_servo_in_another_mode_or_turn_is_refused_when_it_is_reached() {
    use std::io::Write as _;

    let bench = twins::at_ports(small(), &DRIVERS);
    let sim = Devices::switched_on(&bench, &DRIVERS);
    // As the maker's tool would: register 11 of servo 1 is set to 1, velocity.
    let write: [u8; 13] =
        [0xff, 0xff, 0xfd, 0x00, 0x01, 0x06, 0x00, 0x03, 0x0b, 0x00, 0x01, 0x47, 0x63];
    let mut port = std::fs::OpenOptions::new().write(true).open(bench.path("dynamixel")).unwrap();
    port.write_all(&write).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(100));
    drop(port);
    let before = bench.names();
    let run = ["run", "plan.toml", "--out", "run"];
    bench.gonio(&run).refused(&["servo 1 (theta): operating mode 1", "register 11"]);
    assert_eq!(bench.names(), before);

    // At another rate servos hear nothing; or what they say is garbage here.
    let rig = bench.text("rig.toml");
    let port = bench.path("dynamixel").display().to_string();
    let other = rig.replace("baud = 1_000_000", "baud = 115_200");
    for (end, words) in [
        (bench::device::mute(), ["no servo answers at 115200 baud", "--baud 57600"]),
        (bench::device::chatterer(), ["not in Dynamixel's protocol 2.0", "check the baud rate"]),
    ] {
        std::fs::write(bench.path("rig.toml"), other.replace(&port, &end)).unwrap();
        bench.gonio(&run).refused(&words);
        assert_eq!(bench.names(), before);
    }
    drop(sim);

    // Without their zeros x and y would leave the servos' turn.
    let start = "dark_current_a = 1e-12\nstart_fraction_of_travel = { x = 0.1, y = 0.9 }\n";
    let bench = small().with("rig.toml", "zero_mm = { x = 50, y = 50 }\n", "").with(
        "rig.toml",
        "dark_current_a = 1e-12\n",
        start,
    );
    bench.gonio(&run).refused(&["servo 3 (x)", "steps", "zero_mm"]);
}
