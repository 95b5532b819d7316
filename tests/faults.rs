//! Devices of other makes that fail in the midst of a run: unplugged, locked by an alarm, garbled,
//! deaf, overloaded, stalled, saturated. Would break: axes that go on moving, a fault without its
//! name, a reading lost or taken twice, a number that no meter said.

mod bench;

use bench::Bench;
use bench::twins::{self, Devices, at_ports, each_once, noted_s};

const GRBL: [&str; 2] = ["grbl", "keithley-6485"];
const SERVOS: [&str; 2] = ["dynamixel", "keithley-6485"];

/// One spot, and steps of 40 and 60 degrees.
fn few(bench: Bench, theta: u32, phi: u32) -> Bench {
    bench
        .with("plan.toml", "x_count = 2", "x_count = 1")
        .with("plan.toml", "y_count = 2", "y_count = 1")
        .with("plan.toml", &format!("theta_step_deg = {theta}"), "theta_step_deg = 40")
        .with("plan.toml", &format!("phi_step_deg = {phi}"), "phi_step_deg = 60")
}

/// The small plan on a quick gantry with grbl and a picoammeter, simulated.
fn gantry() -> Bench {
    const LINK: &str = "[link]\nkind = \"simulated\"\nbaud = 1_000_000\n";
    let devices = "[link]\nkind = \"simulated\"\n\n[[axes_link]]\ndriver = \"grbl\"\n\
        letters = { theta = \"X\", phi = \"Y\", x = \"Z\", y = \"A\" }\n\
        zero_deg = { theta = -100, phi = -190 }\nzero_mm = { x = -55, y = -55 }\n\
        shutter = \"flood\"\n\n[photometer]\ndriver = \"keithley-6485\"\nbaud = 57600\nnplc = 0.025\n";
    few(Bench::small(), 20, 45)
        .with("plan.toml", "position_degree = 1", "position_degree = 0")
        .with("rig.toml", "readback = \"encoder\"", "readback = \"steps\"")
        .with("rig.toml", "full_scale_a = 1e-", "full_scale_a = 2e-")
        .with("rig.toml", LINK, devices)
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 400")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 2000")
        .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 400")
        .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 2000")
}

/// The example's plan on servos and a picoammeter, small.
fn arm() -> Bench {
    few(Bench::of("servo-arm"), 15, 30)
        .with("plan.toml", "angular_degree = 4", "angular_degree = 2")
        .with("plan.toml", "position_degree = 1", "position_degree = 0")
}

/// With something that goes wrong.
fn failing(bench: Bench, device: &str, nth: u32, how: &str) -> Bench {
    let rig = bench.text("rig.toml");
    let fault = format!("\n[[simulated.fault]]\ndevice = \"{device}\"\nnth = {nth}\n{how}\n");
    bench.having("rig.toml", rig + &fault)
}

/// A run at terminals that a fault ends, with these words; the same devices once more, and a
/// resume to the end. What the devices noticed.
fn ends_and_is_carried_on(bench: &Bench, drivers: &[&str], words: &[&str]) -> String {
    let devices = Devices::switched_on(bench, drivers);
    let run = twins::end(twins::start(bench, &["run", "plan.toml", "--out", "run"]));
    assert_eq!(run.code, Some(1), "{run}");
    run.says(words).says(&["gonio resume"]);
    let before = twins::committed(bench);
    assert!(!before.is_empty(), "it ended in the midst");
    // Plugs that come back take their time.
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let resumed = twins::end(twins::start(bench, &["resume", "run", "--accept-drift"]));
    resumed.well();
    each_once(bench);
    devices.notes()
}

/// Seconds from the beginning of a fault until the axes stood.
fn stopped_within_s(notes: &str, fault: &str) -> f64 {
    noted_s(notes, "the axes stand") - noted_s(notes, fault)
}

/// They wait for devices more than they work: all at once.
#[test]
fn at_terminals_a_run_that_a_fault_ends_is_carried_on() {
    std::thread::scope(|scope| {
        let cases: [fn(); 5] = [
            a_grbl_that_is_unplugged_in_mid_move_and_returns_loses_and_doubles_nothing,
            a_meter_that_stalls_ends_the_run_with_its_name_and_can_be_read_again,
            an_alarm_in_mid_move_is_named_and_the_run_is_carried_on_after_homing,
            an_overloaded_servo_is_named_and_left_by_a_resume,
            when_the_meter_is_unplugged_the_axes_of_the_other_device_are_stopped,
        ];
        for case in cases {
            scope.spawn(case);
        }
    });
}

fn a_grbl_that_is_unplugged_in_mid_move_and_returns_loses_and_doubles_nothing() {
    let fault = "kind = \"unplugged\"\nafter_ms = 20\nlasts_ms = 1000";
    let bench = at_ports(failing(gantry(), "grbl", 6, fault), &GRBL);
    let words = ["grbl", "the port hung up"];
    let notes = ends_and_is_carried_on(&bench, &GRBL, &words);
    noted_s(&notes, "no longer unplugged");
    // Nobody can stop it: it ends the one move that it was told.
    assert!(stopped_within_s(&notes, "unplugged") < 2.0, "{notes}");
}

fn an_alarm_in_mid_move_is_named_and_the_run_is_carried_on_after_homing() {
    let fault = "kind = \"alarm\"\nafter_ms = 20";
    let bench = at_ports(failing(gantry(), "grbl", 6, fault), &GRBL);
    let notes = ends_and_is_carried_on(&bench, &GRBL, &["ALARM:1", "hard limit", "in mid-move"]);
    assert!(stopped_within_s(&notes, "alarm") < 0.1, "{notes}");
}

fn when_the_meter_is_unplugged_the_axes_of_the_other_device_are_stopped() {
    // Its plug goes in the time in which the axes have set out for the next place.
    let fault = "kind = \"unplugged\"\nafter_ms = 120\nlasts_ms = 1000";
    let slow = gantry().with("rig.toml", "speed_deg_per_s = 400", "speed_deg_per_s = 90");
    let bench = at_ports(failing(slow, "keithley-6485", 6, fault), &GRBL);
    let notes = ends_and_is_carried_on(&bench, &GRBL, &["keithley-6485", "the port hung up"]);
    // 40 degrees at 90 degrees a second take 0.5 s.
    assert!(stopped_within_s(&notes, "unplugged") < 0.3, "{notes}");
}

fn an_overloaded_servo_is_named_and_left_by_a_resume() {
    let fault = "kind = \"overload\"\nservo = 2\nafter_ms = 100";
    let bench = at_ports(failing(arm(), "dynamixel", 6, fault), &SERVOS);
    let words = ["servo 2 (phi): overload (hardware error 0x20); its torque is off"];
    let notes = ends_and_is_carried_on(&bench, &SERVOS, &words);
    assert!(stopped_within_s(&notes, "overload") < 0.7, "{notes}");
}

fn a_meter_that_stalls_ends_the_run_with_its_name_and_can_be_read_again() {
    let fault = "kind = \"mute\"\nlasts_ms = 3000";
    let bench = at_ports(failing(arm(), "keithley-6485", 7, fault), &SERVOS);
    let words = ["keithley picoammeter", "no answer to READ?"];
    ends_and_is_carried_on(&bench, &SERVOS, &words);
}

/// In virtual time: how a simulated run with this fault ends.
fn ends(bench: &Bench, words: &[&str]) {
    let said = bench.gonio(&["run", "plan.toml", "--out", "run"]);
    assert_eq!(said.code, Some(1), "{said}");
    said.says(words).says(&["gonio resume"]);
}

#[test]
fn a_lost_line_and_a_line_that_stays_garbled_are_named() {
    let bench = failing(gantry(), "grbl", 6, "kind = \"deaf\"\nlasts_ms = 20");
    ends(&bench, &["a line was lost: it stands idle"]);
    let bench = failing(gantry(), "grbl", 6, "kind = \"garbled\"");
    ends(&bench, &["damaged lines and no whole one"]);
    let bench = failing(arm(), "dynamixel", 9, "kind = \"garbled\"");
    ends(&bench, &["dynamixel", "no answer from servo 1 (theta)"]);
    let bench = failing(arm(), "keithley-6485", 6, "kind = \"garbled\"");
    ends(&bench, &["keithley picoammeter at a simulated port"]);
}

#[test]
fn a_line_that_is_garbled_for_a_while_changes_no_reading() {
    for (bench, device) in [(gantry(), "grbl"), (arm(), "dynamixel")] {
        bench.gonio(&["run", "plan.toml", "--out", "whole"]).well();
        let fault = "kind = \"garbled\"\nafter_ms = 10\nlasts_ms = 150";
        let bench = failing(bench, device, 9, fault);
        bench.gonio(&["run", "plan.toml", "--out", "run"]).well().says(&["no longer garbled"]);
        each_once(&bench);
        let [run, whole] = ["run", "whole"].map(|run| radiances(&bench, run));
        assert_eq!(run, whole, "{device}");
    }
}

/// Radiance and flags of each target.
fn radiances(bench: &Bench, run: &str) -> Vec<(String, String)> {
    let text = bench.text(&format!("{run}/samples.csv"));
    let heads: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let place = |name: &str| heads.iter().position(|head| *head == name).unwrap();
    let (value, flags) = (place("radiance_w_per_m2_sr"), place("flags"));
    let rows = text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
    rows.map(|row| (row[value].to_owned(), row[flags].to_owned())).collect()
}

#[test]
fn what_saturates_the_meter_is_flagged_and_never_a_number() {
    // The signal is some 10 nA: far beyond the meter's range of 2 nA.
    let bench = arm().with("plan.toml", "gain = \"2 uA\"", "gain = \"2 nA\"");
    let said = bench.gonio(&["run", "plan.toml", "--out", "run"]);
    assert!(said.out.contains("13 saturated"), "{said}");
    // No fit makes a value with an uncertainty of them.
    assert!(said.out.contains("all 13 readings are lower limits"), "{said}");
    assert_eq!(said.code, Some(1), "{said}");
    let samples = radiances(&bench, "run");
    assert!(samples.len() > 10 && samples.iter().all(|(_, flags)| flags.contains("saturated")));
    let readings = bench.text("run/readings.csv");
    assert!(!readings.contains("e37") && !readings.to_lowercase().contains("nan"), "{readings}");
    for (radiance, _) in samples {
        let radiance: f64 = radiance.parse().unwrap();
        assert!(radiance < 50.0, "a limit, below what is there: {radiance}");
    }
}

#[test]
fn faults_that_nothing_can_have_are_refused() {
    let cases: [(Bench, &str, &[&str]); 4] = [
        (gantry(), "dynamixel", &["rig.toml", "device", "dynamixel: no such device"]),
        (arm(), "dynamixel", &["rig.toml", "kind", "alarm: nothing that", "a grbl"]),
        (Bench::small(), "grbl", &["no such device", "gonio's own controller"]),
        (gantry(), "keithley-6485", &["alarm: nothing that a Keithley 6485 suffers"]),
    ];
    for (bench, device, words) in cases {
        let bench = failing(bench, device, 1, "kind = \"alarm\"");
        bench.gonio(&["run", "plan.toml", "--out", "run"]).refused(words);
    }
}
