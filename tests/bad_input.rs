//! What a stranger may hand to the program by mistake: each time it must say what is wrong, where,
//! what was expected and what to do, end with exit code 2, and leave everything as it was.

mod bench;

use bench::{Bench, device};

const LIST_PLAN: &str = "rig = \"simulated\"\nscene = \"scene.toml\"\n\
    [region]\nx_mm = [-10, 10]\ny_mm = [-10, 10]\ntheta_max_deg = 80\n\
    [schedule]\nkind = \"list\"\nfile = \"poses.csv\"\n\
    [dwell]\ndwell_ms = 10\n[dark]\nmethod = \"shutter\"\n\
    [fit]\nangular_degree = 0\nposition_degree = 0\n";
const SAMPLES_HEADER: &str = "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr\n";

/// The program refuses, saying every part, and touches nothing.
#[track_caller]
fn refused(bench: &Bench, arguments: &[&str], parts: &[&str]) {
    let before = bench.names();
    bench.gonio(arguments).refused(parts);
    assert_eq!(bench.names(), before, "gonio {}", arguments.join(" "));
}

/// One text of one file exchanged: refused at its line with every part.
#[track_caller]
fn spoilt(file: &str, from: &str, to: &str, parts: &[&str]) {
    let text = Bench::small().with(file, from, to).text(file);
    let line = text[..text.find(to).unwrap()].matches('\n').count() + 1;
    let place = format!("{file}:{line}:");
    spoilt_elsewhere(file, from, to, &[parts, &[&place]].concat());
}

/// One text of one file exchanged: refused with every part, by `plan` and before a run as well.
#[track_caller]
fn spoilt_elsewhere(file: &str, from: &str, to: &str, parts: &[&str]) {
    let bench = Bench::small().with(file, from, to);
    refused(&bench, &["plan", "plan.toml"], parts);
    refused(&bench, &["run", "plan.toml", "--out", "out"], parts);
}

#[test]
fn a_misspelt_key_is_shown_where_it_stands_with_the_right_one() {
    let parts = ["region.theta_mx_deg: unknown key", "did you mean `theta_max_deg`?"];
    spoilt("plan.toml", "theta_max_deg", "theta_mx_deg", &parts);
    spoilt("plan.toml", "order =", "ordre =", &["unknown key", "did you mean `order`?"]);
    spoilt("plan.toml", "x_count", "x_counts", &["unknown key", "did you mean `x_count`?"]);
    let parts = ["simulated.dark_curent_a: unknown key", "did you mean `dark_current_a`?"];
    spoilt("rig.toml", "dark_current_a", "dark_curent_a", &parts);
    let parts = ["axes.theta.u_homing_deg: missing key", "add `u_homing_deg = ...` here"];
    spoilt_elsewhere("rig.toml", "u_homing_deg = 0.005", "", &parts);
    let parts = ["emitter[0]", "scene.toml:", "radiance_w_per_m2_sr"];
    spoilt_elsewhere("scene.toml", "radiance_w_per_m2_sr", "radiance_w_per_m2", &parts);
}

#[test]
fn a_rig_that_cannot_be_is_refused_at_its_line() {
    let parts = ["axes.theta.travel_deg: 95 is not below -95", "swap the two numbers"];
    spoilt("rig.toml", "[-95, 95]", "[95, -95]", &parts);
    let parts = ["acceleration_deg_per_s2: found the integer 0", "a finite number above 0"];
    spoilt("rig.toml", "acceleration_deg_per_s2 = 120", "acceleration_deg_per_s2 = 0", &parts);
    let parts = ["found the number nan", "a finite number above 0"];
    spoilt("rig.toml", "responsivity_a_per_w = 0.2", "responsivity_a_per_w = nan", &parts);
    spoilt("rig.toml", "bits = 20", "bits = 99", &["expected an integer from 8 to 32"]);
    let parts = ["axes.phi.channel: channel 0 is another axis's already", "wired to"];
    spoilt_elsewhere("rig.toml", "channel = 1\n", "channel = 0\n", &parts);
}

#[test]
fn a_plan_outside_the_rigs_limits_names_pose_axis_and_limit() {
    let parts = ["theta: 80.000° is above the upper limit 60.000°", "shrink the region"];
    spoilt_elsewhere("rig.toml", "[-95, 95]", "[-60, 60]", &parts);
    let parts = ["pose 0: x: -100.000 mm is below the lower limit -50.000 mm", "plan.toml:"];
    spoilt_elsewhere("plan.toml", "x_mm = [-10, 10]", "x_mm = [-100, 100]", &parts);
}

#[test]
fn numbers_that_mean_nothing_are_refused_as_found() {
    for (from, to, found) in [
        ("x_mm = [-10, 10]", "x_mm = [10, 10]", "10 is not below 10"),
        ("x_mm = [-10, 10]", "x_mm = [nan, 10]", "found the number nan"),
        ("x_mm = [-10, 10]", "x_mm = 10", "found the integer 10"),
        ("theta_max_deg = 80", "theta_max_deg = 0", "found the integer 0"),
        ("theta_max_deg = 80", "theta_max_deg = 95", "at most 90"),
        ("theta_max_deg = 80", "theta_max_deg = inf", "found the number inf"),
        ("theta_max_deg = 80", "theta_max_deg = \"80\"", "found the text \"80\""),
        ("dwell_ms = 20", "dwell_ms = 1e300", "found the number 1e300"),
        ("x_count = 2", "x_count = 99999999999999999999", "found the integer 9999"),
        ("gain = \"1 uA\"", "gain = \"2 uA\"", "one of \"1 uA\", \"100 nA\""),
        ("kind = \"raster\"", "kind = \"rastr\"", "did you mean \"raster\"?"),
    ] {
        spoilt("plan.toml", from, to, &[found, "expected"]);
    }
    let parts = ["schedule has ", "at most 1000000 targets", "take larger steps"];
    spoilt_elsewhere("plan.toml", "x_count = 2", "x_count = 1000000", &parts);
}

#[test]
fn what_is_no_toml_file_is_refused_as_what_it_is() {
    let plan = |bytes: &[u8], parts: &[&str]| {
        let bench = Bench::small().having("plan.toml", bytes);
        refused(&bench, &["plan", "plan.toml"], parts);
    };
    plan(b"\x7fELF\x02\x01\x01\xff\xfe\x00", &["plan.toml: is not text", "a TOML file"]);
    plan(b"\0\0\0\0", &["plan.toml: is not text", "a TOML file"]);
    plan(b"", &["plan.toml: is empty", "was it saved?"]);
    plan(b"[region]\nx_mm = [1, 2\n", &["plan.toml:", "expected"]);
    plan(b"[region]\nx_mm = [1, 2]\nx_mm = [1, 2]\n", &["duplicate key", "plan.toml:3:1"]);
    plan(&vec![b'#'; 2 << 20], &["plan.toml: is larger than 1 MiB"]);
    let bench = Bench::small();
    refused(&bench, &["plan", "."], &["cannot be read: Is a directory", "check the path"]);
    refused(&bench, &["plan", "gone.toml"], &["gone.toml: cannot be read: No such file"]);
    refused(&bench, &["plan", "rig.toml"], &["rig.toml: region: missing", "the wrong file?"]);
    let swapped = ["plan", "plan.toml", "--rig", "scene.toml"];
    refused(&bench, &swapped, &["scene.toml:", "missing key", "the wrong file?"]);
}

#[test]
fn a_rig_or_scene_is_never_made_up() {
    let parts = ["the plan names no rig, and neither does --rig", "give --rig"];
    spoilt_elsewhere("plan.toml", "rig = \"rig.toml\"\n", "", &parts);
    let parts = ["a simulated rig needs a scene", "give --scene"];
    spoilt_elsewhere("plan.toml", "scene = \"scene.toml\"\n", "", &parts);
    let parts = ["rig: gone.toml: cannot be read: No such file", "correct the path", "--rig"];
    spoilt("plan.toml", "\"rig.toml\"", "\"gone.toml\"", &parts);
    let parts = ["scene: gone.toml: cannot be read: No such file", "--scene"];
    spoilt("plan.toml", "\"scene.toml\"", "\"gone.toml\"", &parts);
    let bench = Bench::small().at_port("/dev/nonexistent");
    let with_scene = ["run", "plan.toml", "--scene", "scene.toml", "--out", "out"];
    refused(&bench, &with_scene, &["--scene scene.toml", "is a real rig", "leave --scene out"]);
    let explain = ["explain", "scene.toml", "--rig", "rig.toml"];
    refused(&bench, &explain, &["is a real rig", "leave --rig out"]);
    refused(&bench, &["sim"], &["needs a scene to look at", "--scene"]);
}

#[test]
fn a_list_of_poses_is_refused_by_its_line() {
    for (list, parts) in [
        ("0,0,0,0\n0,0,ten,0\n", ["poses.csv:3:1", "found \"ten\"", "plain number"]),
        ("0,0,0,0\n0,0,nan,0\n", ["poses.csv:3:1", "found \"nan\"", "plain number"]),
        ("0,0,0,0\n0,0,10\n", ["poses.csv:3:1", "3 fields", "expected 4 fields"]),
        ("0,0,0,0\n0,0,99,0\n", ["poses.csv:3:1", "at most 90", "correct the pose"]),
        ("0,0,0,0\n\n0,99,9,0\n", ["poses.csv:4:1", "99.000 mm", "widen the region"]),
    ] {
        let list = format!("x_mm,y_mm,theta_deg,phi_deg\n{list}");
        let bench = Bench::small().having("plan.toml", LIST_PLAN).having("poses.csv", list);
        refused(&bench, &["plan", "plan.toml"], &parts);
    }
    let list = |bytes: &[u8], parts: &[&str]| {
        let bench = Bench::small().having("plan.toml", LIST_PLAN);
        refused(&bench.having("poses.csv", bytes), &["plan", "plan.toml"], parts);
    };
    list(b"x_mm;y_mm;theta_deg;phi_deg\n0;0;0;0\n", &["poses.csv:1:1", "by commas"]);
    list(b"x_mm,y_mm,theta_deg\n0,0,0\n", &["no column \"phi_deg\"", "poses.csv:1:1"]);
    list(b"x_mm,y_mm,theta_deg,phi_deg\n", &["poses.csv: no pose in the list"]);
    list(b"", &["no column \"x_mm\""]);
    list(b"\xff\xfe\x00", &["poses.csv: is not text", "plan.toml:9:8"]);
    list(&vec![b'0'; (64 << 20) + 1], &["poses.csv: is larger than 64 MiB", "plan.toml:9:8"]);
    let bench = Bench::small().having("plan.toml", LIST_PLAN);
    refused(&bench, &["plan", "plan.toml"], &["poses.csv: cannot be read", "plan.toml:9:8"]);
}

#[test]
fn a_photometric_file_is_refused_by_name_and_line() {
    let whole = std::fs::read(bench::repository().join("examples/luminaire/ushio_b1.ies")).unwrap();
    let file = |bytes: &[u8], parts: &[&str]| {
        let bench = Bench::of("luminaire").having("ushio_b1.ies", bytes);
        refused(&bench, &["plan", "plan.toml"], parts);
        refused(&bench, &["explain", "scene.toml"], parts);
    };
    let place = "--> scene.toml:5:8";
    file(&whole[..whole.len() / 2], &["emitter[0].file", "ushio_b1.ies: line ", "end", place]);
    file(b"", &["ushio_b1.ies: line 1", "found the file's end", "is the file complete"]);
    file(b"\x7fELF\x02\x01", &["ushio_b1.ies: line 1", "control character", place]);
    file(&vec![b'0'; (64 << 20) + 1], &["ushio_b1.ies: is larger than 64 MiB", place]);
    let text = String::from_utf8(whole).unwrap();
    let candela: String =
        text.lines().filter(|line| !line.contains("mW")).flat_map(|line| [line, "\n"]).collect();
    let parts = ["intensities in cd", "calibrated for radiance", "W/sr, mW/sr", place];
    file(candela.as_bytes(), &parts);
    let bench = Bench::of("luminaire");
    std::fs::remove_file(bench.path("ushio_b1.ies")).unwrap();
    let parts = ["ushio_b1.ies: cannot be read", place, "relative to the scene's file"];
    refused(&bench, &["plan", "plan.toml"], &parts);
}

#[test]
fn samples_from_elsewhere_are_refused_by_line_and_column() {
    let samples = |text: &str, parts: &[&str]| {
        let bench = Bench::empty().having("s.csv", text);
        refused(&bench, &["fit", "s.csv", "-o", "fit.json"], parts);
    };
    let below = |rows: &str| format!("{SAMPLES_HEADER}{rows}");
    let row_3 = ["s.csv: line 3, column radiance_w_per_m2_sr", "from -1e100 to 1e100", "help:"];
    samples(&below("0,0,0,0,1\n0,0,10,0,one\n"), &row_3);
    samples(&below("0,0,0,0,1\n0,0,10,0,nan\n"), &row_3);
    samples(&below("0,0,0,0,1\n0,0,10,0\n"), &["s.csv: line 3: 4 fields", "expected 5"]);
    samples(&below("0,0,95,0,1\n"), &["line 2, column theta_deg", "[0, 90]"]);
    samples(&below("0,0,5,0,1\n"), &["1 readings of unknown noise"]);
    samples(&below(""), &["s.csv: no rows below the header"]);
    samples("0,0,9,0,1\n", &["line 1: no column x_mm", "expected a header"]);
    samples("", &["line 1: no column x_mm"]);
    let bench = Bench::empty().having("s.csv", below("0,0,0,0,1\n0,0,9,0,1\n"));
    refused(&bench, &["fit", "gone.csv"], &["gone.csv: cannot be read", "give a run's folder"]);
    let degree = ["fit", "s.csv", "--angular-degree", "6"];
    refused(&bench, &degree, &["fewer than the 28 coefficients", "--angular-degree"]);
    let basis = ["fit", "s.csv", "--basis", "zernicke"];
    refused(&bench, &basis, &["--basis: `zernicke`", "expected one of zernike"]);
    let degree = ["fit", "s.csv", "--basis", "splines", "--angular-degree", "3"];
    refused(&bench, &degree, &["--angular-degree: splines have no degree"]);
    let spans = ["fit", "s.csv", "--theta-spans", "9", "--phi-spans", "8", "--fine-spans", "3,2,1"];
    refused(&bench, &spans, &["--fine-spans: no stretch of 9 spans", "FIRST < AFTER_LAST"]);
    let patch = [&spans[..6], &["--fine-spans", "3,5,1", "--fine-phi-spans", "2,11,1"]].concat();
    refused(&bench, &patch, &["--fine-phi-spans: no stretch of 9 spans of theta and 8 of phi"]);
    let spans = ["fit", "s.csv", "--theta-spans", "9"];
    refused(&bench, &spans, &["--phi-spans"]);
    let columns = ["fit", "s.csv", "--cosine-columns", "2"];
    refused(&bench, &columns, &["--cosine-columns: cosine columns stand beside", "add the degree"]);
    let many = ["fit", "s.csv", "--theta-spans=60", "--phi-spans=60", "--position-degree=0"];
    refused(
        &bench,
        &many,
        &["--theta-spans: no strength of the penalty", "more than 2000 splines"],
    );
    let power = ["fit", "s.csv", "--penalty-power", "-1"];
    refused(&bench, &power, &["--penalty-power: expected a number of 0 or more"]);
    let degree = ["fit", "s.csv", "--angular-degree", "100000"];
    refused(&bench, &degree, &["are more than 4096"]);
    let at = ["fit", "s.csv", "--angular-degree", "0", "-o", "fit.json", "--at", "gone.csv"];
    refused(&bench, &at, &["gone.csv: cannot be read"]);
}

#[test]
fn a_folder_that_is_no_run_is_refused_and_stays_as_it_was() {
    let bench = Bench::small().having("run.sqlite", b"not a database, though long enough");
    for command in [&["export", ".", "--format", "csv"][..], &["fit", "."], &["resume", "."]] {
        refused(&bench, command, &["run.sqlite: not a run's journal"]);
    }
    std::fs::write(bench.path("run.sqlite"), b"").unwrap();
    refused(&bench, &["resume", "."], &["run.sqlite: empty", "start it again"]);
    std::fs::remove_file(bench.path("run.sqlite")).unwrap();
    refused(&bench, &["resume", "."], &["run.sqlite: no such file", "a run's folder"]);
    refused(&bench, &["resume", "gone"], &["run.sqlite: no such file"]);
    refused(&bench, &["export", "gone", "--format", "csv"], &["no such file"]);
}

#[test]
fn a_run_never_overwrites_and_says_where_it_cannot_be_made() {
    let bench = Bench::small();
    std::fs::create_dir(bench.path("out")).unwrap();
    let bench = bench.having("out/samples.csv", "precious");
    let parts = ["exists already", "never overwritten", "--out", "gonio resume"];
    refused(&bench, &["run", "plan.toml", "--out", "out"], &parts);
    refused(&bench, &["run", "plan.toml", "--out", "plan.toml"], &parts);
    assert_eq!(bench.text("out/samples.csv"), "precious");
    let parts = ["plan.toml: the folder cannot be made", "choose another one with --out"];
    refused(&bench, &["run", "plan.toml", "--out", "plan.toml/out"], &parts);
}

/// A limit on the size of files stands for a full disk: a test cannot fill one.
#[test]
fn a_full_disk_leaves_nothing_that_looks_whole() {
    let limited = |blocks: u32| {
        let bench = Bench::small();
        let line = format!("trap '' XFSZ; ulimit -f {blocks}; gonio run plan.toml --out out");
        let said = bench.shell(&line);
        (bench, said)
    };
    let (bench, said) = limited(1);
    said.refused(&["out/rig.toml: disk full"]);
    assert!(!bench.path("out").exists());
    let (bench, said) = limited(60);
    said.refused(&["out/run.sqlite", "a full disk, a limit"]);
    assert!(!bench.path("out").exists());
    let bench = Bench::empty().having("s.csv", format!("{SAMPLES_HEADER}0,0,0,0,1\n0,0,9,0,1\n"));
    let said = bench.shell("gonio fit s.csv --angular-degree 0 > /dev/full");
    assert_eq!(said.code, Some(1), "{said}");
    said.says(&["standard output: No space left"]);
    let said = bench.shell("gonio fit s.csv --angular-degree 0 -o /dev/full");
    assert_eq!(said.code, Some(1), "{said}");
    said.says(&["/dev/full: disk full"]);
}

#[test]
fn a_port_that_is_none_is_named() {
    let bench = Bench::small();
    let probe = |port: &str, parts: &[&str]| refused(&bench, &["ports", "--probe", port], parts);
    probe("/dev/nonexistent", &["/dev/nonexistent: no such port", "`gonio ports` lists"]);
    probe("plan.toml", &["plan.toml: not a serial port"]);
    probe("/dev/null", &["/dev/null: not a serial port"]);
    let bench = Bench::small().at_port("/dev/nonexistent");
    let parts = ["/dev/nonexistent: no such port", "`gonio ports` lists"];
    refused(&bench, &["run", "plan.toml", "--out", "out"], &parts);
    refused(&bench, &["home", "--rig", "rig.toml"], &parts);
}

#[test]
fn who_answers_otherwise_on_a_port_is_told_apart() {
    let garbled = ["something answers, but not in gonio's protocol", "another baud rate"];
    let newer = ["speaks protocol 2.3, this program 1.", "update this program"];
    let silent = ["no answer from a device", "is it powered"];
    std::thread::scope(|scope| {
        for (device, parts) in [
            (device::chatterer as fn() -> String, &garbled[..]),
            (device::newer, &newer),
            (device::mute, &silent),
        ] {
            scope.spawn(move || {
                let port = device();
                let bench = Bench::small().at_port(&port);
                let named = format!("{port}: ");
                let parts: Vec<&str> = [&named[..]].into_iter().chain(parts.to_vec()).collect();
                refused(&bench, &["ports", "--probe", &port], &parts);
                let port = device();
                let bench = bench.at_port_again(&port);
                refused(&bench, &["run", "plan.toml", "--out", "out"], &parts[1..]);
            });
        }
    });
}
