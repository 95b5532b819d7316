//! Rigs that are put together of other makes' devices, simulated: a run, its readings beside those
//! of gonio's own controller, and what a rig file gets wrong.

mod bench;

use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use bench::Bench;
use bench::twins::{self, Devices};

const DEVICES: &str = include_str!("bench/grbl_and_picoammeter.toml");
const ONE_LINK: &str = "[link]\nkind = \"simulated\"\nbaud = 1_000_000\n";

/// The small plan on a rig of simulated devices.
fn on_devices() -> Bench {
    let link = format!("[link]\nkind = \"simulated\"\n\n{DEVICES}");
    Bench::small()
        .with("rig.toml", "readback = \"encoder\"", "readback = \"steps\"")
        // The meter's own ranges.
        .with("rig.toml", "full_scale_a = 1e-", "full_scale_a = 2e-")
        .with("rig.toml", ONE_LINK, &link)
}

struct Column(Vec<Vec<String>>, Vec<String>);

fn table(bench: &Bench, file: &str) -> Column {
    let text = bench.text(file);
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect());
    let heads = lines.next().unwrap();
    Column(lines.collect(), heads)
}

impl Column {
    fn of(&self, name: &str) -> Vec<f64> {
        let n = self.1.iter().position(|head| head == name).unwrap();
        self.0.iter().map(|row| row[n].parse().unwrap()).collect()
    }
}

#[test]
fn a_plan_reads_the_same_through_grbl_and_a_picoammeter() {
    let devices = on_devices();
    devices.gonio(&["run", "plan.toml", "--out", "run"]).well();
    let own = Bench::small();
    own.gonio(&["run", "plan.toml", "--out", "run"]).well();
    let [a, b] = [&devices, &own].map(|bench| table(bench, "run/samples.csv"));
    let radiance = "radiance_w_per_m2_sr";
    let pairs = a.of(radiance).into_iter().zip(b.of(radiance));
    let u = a
        .of("u_independent_radiance_w_per_m2_sr")
        .into_iter()
        .zip(b.of("u_independent_radiance_w_per_m2_sr"));
    let mut worst = 0.0_f64;
    for ((a, b), (ua, ub)) in pairs.zip(u) {
        worst = worst.max((a - b).abs() / (ua.hypot(ub) + 2e-3 * b.abs()));
    }
    assert!(a.0.len() == b.0.len() && a.0.len() > 20);
    assert!(worst < 5.0, "off by {worst} uncertainties");
    for column in ["theta_deg", "phi_deg", "x_mm", "y_mm"] {
        for (a, b) in a.of(column).into_iter().zip(b.of(column)) {
            assert!((a - b).abs() < 0.02, "{column}: {a} beside {b}");
        }
    }
    // The same again is the same, byte for byte.
    devices.gonio(&["run", "plan.toml", "--out", "again"]).well();
    assert_eq!(devices.text("run/samples.csv"), devices.text("again/samples.csv"));
}

/// At ports, with a simulated twin of the same file.
fn at_ports() -> Bench {
    let bench = on_devices();
    let simulated = bench.text("rig.toml");
    let real = simulated.split("\n[simulated]").next().unwrap();
    let port = |name: &str| format!("port = \"{}\"\n", bench.path(name).display());
    let real = real
        .replace("kind = \"simulated\"", "kind = \"devices\"")
        .replace("driver = \"grbl\"\n", &format!("driver = \"grbl\"\n{}", port("board")))
        .replace(
            "driver = \"keithley-6485\"\n",
            &format!("driver = \"keithley-6485\"\n{}", port("board-photometer")),
        );
    bench.having("rig.toml", real).with("plan.toml", "scene = \"scene.toml\"\n", "")
}

#[test]
fn a_run_that_is_interrupted_stops_its_devices_and_is_carried_on() {
    // Fast axes, so that homing does not take longer than the test.
    let devices = on_devices()
        .with("rig.toml", "speed_deg_per_s = 60", "speed_deg_per_s = 1000")
        .with("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 20000")
        .with("rig.toml", "speed_mm_per_s = 100", "speed_mm_per_s = 1000")
        .with("rig.toml", "acceleration_mm_per_s2 = 500", "acceleration_mm_per_s2 = 20000");
    let mut command = devices.command(&["run", "plan.toml", "--realtime", "--out", "run"]);
    let mut run = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    // Homed, and in the midst of it.
    while !devices.path("run/run.sqlite").exists() {
        assert!(began.elapsed() < Duration::from_secs(30), "it never began");
        sleep(Duration::from_millis(50));
    }
    sleep(Duration::from_secs(8));
    bench::signal(&run, "INT");
    let asked = Instant::now();
    while run.try_wait().unwrap().is_none() {
        if asked.elapsed() > Duration::from_secs(20) {
            run.kill().unwrap();
            panic!("it does not stop");
        }
        sleep(Duration::from_millis(20));
    }
    let said = bench::Said::from_output("gonio run", &run.wait_with_output().unwrap());
    assert_eq!(said.code, Some(1), "{said}");
    said.says(&["gonio resume"]);

    devices.gonio(&["resume", "run"]).well();
    let resumed = table(&devices, "run/samples.csv");
    devices.gonio(&["run", "plan.toml", "--out", "whole"]).well();
    let whole = table(&devices, "whole/samples.csv");
    assert_eq!(resumed.of("index"), whole.of("index"), "each target once");
    let radiance = "radiance_w_per_m2_sr";
    for (a, b) in resumed.of(radiance).into_iter().zip(whole.of(radiance)) {
        assert!((a / b - 1.0).abs() < 2e-3, "{a} beside {b}");
    }
    let sessions = table(&devices, "run/readings.csv").of("session");
    assert!(sessions.contains(&0.0) && sessions.contains(&1.0), "two sessions");
    // The meter's own clock beside the host's; grbl has none.
    let readings = table(&devices, "run/readings.csv");
    let meter_s = readings.of("photometer_time_s");
    assert!(meter_s.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 0.01));
}

#[test]
fn what_a_rig_file_gets_wrong_about_its_devices_is_named() {
    let cases: [(&str, &str, &[&str]); 7] = [
        ("theta = \"X\"", "theta = \"Y\"", &["rig.toml", "letters", "another axis's already"]),
        (", y = \"A\"", "", &["zero_mm.y: unknown key"]),
        ("theta = \"X\"", "theta = \"Q\"", &["no letter of an axis"]),
        ("shutter = \"flood\"", "shuter = \"flood\"", &["did you mean `shutter`"]),
        ("shutter = \"flood\"\n", "", &["plan.toml", "dark.method", "has no shutter"]),
        ("driver = \"keithley-6485\"", "driver = \"keithley\"", &["keithley-6485"]),
        ("theta = -100", "theta = -10", &["theta", "travel", "the device allows"]),
    ];
    for (from, to, words) in cases {
        let bench = on_devices().with("rig.toml", from, to);
        let before = bench.names();
        bench.gonio(&["run", "plan.toml", "--out", "run"]).refused(words);
        assert_eq!(bench.names(), before);
    }
    let twice = at_ports().with("rig.toml", "board-photometer", "board");
    twice.gonio(&["run", "plan.toml"]).refused(&["another device's port already"]);
    let unmoved =
        on_devices().with("rig.toml", ", y = \"A\"", "").with("rig.toml", ", y = -55", "");
    unmoved.gonio(&["run", "plan.toml"]).refused(&["no device moves y"]);
    let bare = Bench::small().with("rig.toml", ONE_LINK, "[link]\nkind = \"devices\"\n");
    bare.gonio(&["run", "plan.toml"]).refused(&["[[axes_link]]"]);
    let encoders = on_devices().with("rig.toml", "readback = \"steps\"", "readback = \"encoder\"");
    encoders.gonio(&["run", "plan.toml"]).refused(&["grbl", "no encoder", "steps"]);
}

/// A board with two axes: the stage's are fixed.
fn on_two_axes() -> Bench {
    let bench = on_devices().with("rig.toml", ", x = \"Z\", y = \"A\"", "").with(
        "rig.toml",
        "zero_mm = { x = -55, y = -55 }\n",
        "",
    );
    let rig = bench.text("rig.toml");
    let (before, after) = rig.split_once("[axes.x]").unwrap();
    let (_, after) = after.split_once("[detector]").unwrap();
    let fixed = "[axes.x]\nfixed_mm = 3\nu_zero_mm = 0.05\n\n\
                 [axes.y]\nfixed_mm = -2\nu_zero_mm = 0.05\n\n";
    let rig = format!("{before}{fixed}[detector]{after}");
    bench
        .having("rig.toml", rig)
        .with("plan.toml", "x_mm = [-10, 10]\ny_mm = [-10, 10]", "x_mm = [-2, 8]\ny_mm = [-7, 3]")
        .with("plan.toml", "x_count = 2\ny_count = 2", "x_count = 1\ny_count = 1")
        .with("plan.toml", "position_degree = 1", "position_degree = 0")
        .with("plan.toml", "x_mm = 0\ny_mm = 0", "x_mm = 3\ny_mm = -2")
}

#[test]
fn an_axis_that_no_device_moves_stands_where_the_rig_file_says() {
    let bench = on_two_axes();
    bench.gonio(&["run", "plan.toml", "--out", "run"]).well();
    let samples = table(&bench, "run/samples.csv");
    assert!(samples.of("x_mm").iter().all(|x| x.to_bits() == 3.0_f64.to_bits()));
    assert!(samples.of("y_mm").iter().all(|y| y.to_bits() == (-2.0_f64).to_bits()));
    // The simulator looks there too: elsewhere the patch ends.
    assert!(samples.of("radiance_w_per_m2_sr").iter().all(|l| (l / 50.2 - 1.0).abs() < 0.02));

    let run = ["run", "plan.toml", "--out", "other"];
    let elsewhere = on_two_axes().with("plan.toml", "y_count = 1", "y_count = 2");
    let before = elsewhere.names();
    let words = ["plan.toml", "y: -7.000 mm is asked for, but", "fixed at -2.000 mm"];
    elsewhere.gonio(&run).refused(&words);
    elsewhere.gonio(&["plan", "plan.toml"]).refused(&words);
    assert_eq!(elsewhere.names(), before);
    let words = ["reference", "x: 0.000 mm is asked for", "fixed at 3.000 mm"];
    let reference = on_two_axes().with("plan.toml", "x_mm = 3", "x_mm = 0");
    reference.gonio(&run).refused(&words);
    let jog = ["jog", "--rig", "rig.toml", "--scene", "scene.toml", "--x-mm", "4"];
    on_two_axes().gonio(&jog).refused(&["x: 4.000 mm is asked for", "fixed at 3.000 mm"]);
    // The others stay at their switches, beyond the travel.
    let jog = ["jog", "--rig", "rig.toml", "--scene", "scene.toml", "--theta-deg", "30"];
    for (bench, x) in [(on_two_axes(), "x 3.000 mm"), (on_devices(), "x 53.000 mm")] {
        let said = bench.gonio(&jog).well();
        assert!(said.out.contains("theta 30.000°") && said.out.contains(x), "{said}");
    }

    let cases: [(&str, &str, &[&str]); 4] = [
        ("fixed_mm = 3", "fixed_mm = 3\ntravel_mm = [-5, 5]", &["axes.x.travel_mm", "fixed_mm"]),
        ("fixed_mm = 3\nu_zero_mm = 0.05", "fixed_mm = 3", &["axes.x", "u_zero_mm"]),
        ("phi = \"Y\"", "phi = \"Y\", x = \"Z\"", &["moves x, which is fixed in [axes.x]"]),
        ("fixed_mm = 3", "fixed_deg = 3", &["axes.x"]),
    ];
    for (from, to, words) in cases {
        on_two_axes().with("rig.toml", from, to).gonio(&run).refused(words);
    }
    let own = Bench::small();
    let rig = own.text("rig.toml");
    let (before, after) = rig.split_once("[axes.y]").unwrap();
    let (_, after) = after.split_once("[detector]").unwrap();
    let fixed = "[axes.y]\nfixed_mm = 0\nu_zero_mm = 0.05\n\n[detector]";
    let own = own.having("rig.toml", format!("{before}{fixed}{after}"));
    own.gonio(&run).refused(&["axes.y: y is fixed, on a rig with one controller", "[[axes_link]]"]);
}

/// The words of a table, for a meter that nobody here knows.
const TABLE: &str = "driver = \"scpi\"\nidentity = \"OPTOMETER\"\nmeasures = \"current\"\n\
    set_up = [\"*RST\", \"CONF:CURR\"]\nzero = [\"ZERO\"]\nrange = \"CURR:RANG {}\"\n\
    read = \"MEAS?\"\nelement = 1\nbaud = 115200\n";

#[test]
fn a_plan_runs_on_a_meter_that_a_table_describes() {
    let keithley = "driver = \"keithley-6485\"\nbaud = 57600\nnplc = 0.025\n";
    let bench = on_devices().with("rig.toml", keithley, TABLE);
    bench.gonio(&["run", "plan.toml", "--out", "run"]).well();
    let samples = table(&bench, "run/samples.csv");
    assert!(samples.of("radiance_w_per_m2_sr").iter().all(|l| (l / 50.2 - 1.0).abs() < 0.02));
    // The report says who it was, as it called itself.
    let page = bench.text("run/report.html");
    for words in ["scpi meter", "SIMULATED,OPTOMETER", "grbl 1.1h", "no device watchdog"] {
        assert!(page.contains(words), "{words}");
    }

    // Another instrument, and a word that it does not know, over its own line.
    let drivers = ["grbl", "scpi"];
    let bench = twins::at_ports(on_devices().with("rig.toml", keithley, TABLE), &drivers);
    let _sim = Devices::switched_on(&bench, &drivers);
    let run = ["run", "plan.toml", "--out", "run"];
    let before = bench.names();
    let bench = bench.with("rig.toml", "\"OPTOMETER\"", "\"PHOTOMETER\"");
    bench.gonio(&run).refused(&["SIMULATED,OPTOMETER", "a name with \"PHOTOMETER\" in it"]);
    assert_eq!(bench.names(), before);
}

#[test]
fn a_picoammeter_can_t_give_more_readings_than_its_integration_lets_it() {
    let bench = on_devices().with("rig.toml", "nplc = 0.025", "nplc = 1");
    let words = ["2000 readings a second of 1 power line cycles each", "at most 60", "nplc"];
    bench.gonio(&["run", "plan.toml", "--out", "run"]).refused(&words);
}

#[test]
fn a_meter_in_another_unit_and_garbage_are_refused_when_they_are_reached() {
    let newport = "driver = \"newport-1830c\"\nranges = [4, 3, 2, 1]\n";
    let keithley = "driver = \"keithley-6485\"\nbaud = 57600\nnplc = 0.025\n";
    let drivers = ["grbl", "newport-1830c"];
    let bench = twins::at_ports(on_devices().with("rig.toml", keithley, newport), &drivers);
    let _sim = Devices::switched_on(&bench, &drivers);
    std::fs::write(bench.path("newport-1830c"), "U2\n").unwrap();
    let run = ["run", "plan.toml", "--out", "run"];
    let before = bench.names();
    bench.gonio(&run).refused(&["newport 1830-c", "unit 2 (dBm", "unit 1, W"]);
    std::fs::write(bench.path("newport-1830c"), "U1\n").unwrap();
    // What a wrong baud rate looks like, at the board's port and at the meter's.
    let rig = bench.text("rig.toml");
    for driver in drivers {
        let garbage = bench::device::chatterer();
        let port = bench.path(driver).display().to_string();
        let spoilt = rig.replace(&port, &garbage);
        std::fs::write(bench.path("rig.toml"), spoilt).unwrap();
        bench.gonio(&run).refused(&[&driver[..4], "baud"]);
    }
    assert_eq!(bench.names(), before);
}

#[test]
fn another_session_s_meter_has_other_noise() {
    let fault = "\n[[simulated.fault]]\ndevice = \"keithley-6485\"\nkind = \"mute\"\nnth = 90\n";
    let bench = on_devices();
    let rig = bench.text("rig.toml");
    let bench = bench.having("rig.toml", rig + fault);
    assert_eq!(bench.gonio(&["run", "plan.toml", "--out", "run"]).code, Some(1));
    bench.gonio(&["resume", "run", "--accept-drift"]).well();
    let readings = table(&bench, "run/readings.csv");
    let kind = readings.1.iter().position(|head| head == "kind").unwrap();
    let (means, sessions) = (readings.of("mean_counts"), readings.of("session"));
    let looks = |session: f64| -> Vec<f64> {
        let rows = readings.0.iter().zip(&means).zip(&sessions);
        let those =
            rows.filter(|((row, _), of)| row[kind] == "reference" && (**of - session).abs() < 0.5);
        those.map(|((_, mean), _)| *mean).collect()
    };
    let (first, second) = (looks(0.0), looks(1.0));
    assert!(first.len() > 1 && second.len() > 1, "{first:?} {second:?}");
    assert!(second.iter().all(|mean| !first.contains(mean)), "{first:?} {second:?}");
}

#[test]
fn what_a_plan_would_take_in_flight_is_foretold_at_rest() {
    let schedule = "kind = \"raster\"\nx_count = 2\ny_count = 2\ntheta_step_deg = 20\n\
                    phi_step_deg = 45\norder = \"travel\"\n";
    let sweep = "kind = \"sweep\"\nx_count = 1\ny_count = 1\nphi_step_deg = 45\n\
                 narrowest_feature_deg = 60\n";
    let bench = on_devices().with("plan.toml", schedule, sweep).with(
        "plan.toml",
        "position_degree = 1",
        "position_degree = 0",
    );
    let plan = bench.gonio(&["plan", "plan.toml", "--json"]).well().json();
    assert_eq!(plan["sweeps"]["at_rest"], true);
    let said = bench.gonio(&["plan", "plan.toml"]).well();
    assert!(said.out.contains("at rest, window by window"), "{said}");
    let run = bench.gonio(&["run", "plan.toml", "--out", "run", "--json"]).well().json();
    // The words for 40 readings a window at 57600 baud are foretold (0.2 s), what is said of moves is not.
    let foretold = plan["time_s"]["total"].as_f64().unwrap();
    let homing = plan["time_s"]["homing"].as_f64().unwrap();
    let took = run["rig_s"].as_f64().unwrap();
    let readings = plan["readings"].as_f64().unwrap();
    let words = plan["time_s"]["overhead"].as_f64().unwrap();
    assert!(words / readings > 0.15, "{words} s of {readings} readings");
    let beyond = (took - foretold) / readings;
    assert!(readings > 20.0 && beyond < 0.1 && took > foretold - homing, "{took}, {foretold}");
}
