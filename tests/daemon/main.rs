//! The daemon as programs see it: the real binary, a real socket, a simulated rig in real time.
//! What could break: a run lost or begun unasked after a restart, an event twice or not at all,
//! a client that keeps the daemon from ending, a plan taken that can't be run.

mod served;

use std::time::Duration;

use serde_json::{Value, json};

use served::{Place, bundle, wait_until};

/// Far below what the daemon grants clients that do not leave, on a machine that is busy.
const AT_ONCE: Duration = Duration::from_secs(4);

const DEVICES: &str = include_str!("../bench/grbl_and_picoammeter.toml");

fn sequence_of(events: &[Value]) -> Vec<i64> {
    events.iter().map(|event| event["sequence"].as_i64().unwrap()).collect()
}

fn rise_from_1(events: &[Value]) -> bool {
    sequence_of(events).into_iter().zip(1..).all(|(number, expected)| number == expected)
}

fn kinds_of(events: &[Value]) -> Vec<&str> {
    events.iter().map(|event| event["kind"].as_str().unwrap()).collect()
}

/// Whether `wanted` occur in this order, with anything between them.
fn occur_in_order(kinds: &[&str], wanted: &[&str]) -> bool {
    let mut kinds = kinds.iter();
    wanted.iter().all(|wanted| kinds.any(|kind| kind == wanted))
}

#[test]
fn a_run_is_queued_paused_continued_and_evaluated_and_events_replay() {
    let place = Place::new();
    let daemon = place.daemon();
    let (status, submitted) = daemon.post("/runs", &bundle(&place));
    assert_eq!((status, &submitted["id"]), (201, &json!(1)), "{submitted}");
    assert_eq!(submitted["simulated"], true);
    daemon.wait_for_readings(1, 3);

    let (status, asked) = daemon.post("/runs/1/pause", "");
    assert_eq!(status, 200, "{asked}");
    daemon.wait_for(1, "paused");
    let (status, asked) = daemon.post("/runs/1/pause", "{}");
    assert_eq!((status, &asked["answer"]), (200, &json!("paused already")));
    let (status, refused) = daemon.post("/rig/home", "{}");
    assert_eq!(status, 409, "{refused}");
    let (_, fit) = daemon.get("/runs/1/fit");
    assert_eq!(fit["error"], "run 1 has no fit: it is under way");

    assert_eq!(daemon.post("/runs/1/continue", "").0, 200);
    daemon.wait_for(1, "complete");
    let (status, asked) = daemon.post("/runs/1/abort", "");
    assert_eq!((status, &asked["error"]), (409, &json!("run 1 is over already: complete")));
    let (status, fit) = daemon.get("/runs/1/fit");
    assert_eq!(status, 200);
    let error = fit["exitance_w_per_m2"]["value"].as_f64().unwrap()
        / fit["truth"]["exitance_w_per_m2"]["value"].as_f64().unwrap()
        - 1.0;
    assert!(error.abs() < 0.05, "{error}");

    let events = daemon.events_after(0, "complete");
    let wanted =
        ["daemon_started", "submitted", "started", "paused", "continued", "evaluating", "complete"];
    assert!(occur_in_order(&kinds_of(&events), &wanted), "{:?}", kinds_of(&events));
    assert!(rise_from_1(&events), "{:?}", sequence_of(&events));
    let later = daemon.events_after(3, "complete");
    assert_eq!(later, events[3..]);
}

#[test]
fn readings_come_in_pages_each_once() {
    let place = Place::new();
    let daemon = place.daemon();
    daemon.post("/runs", &bundle(&place));
    daemon.wait_for(1, "complete");
    let (mut after, mut ids) = (0, Vec::new());
    loop {
        let (_, page) = daemon.get(&format!("/runs/1/readings?after={after}&limit=7"));
        let readings = page["readings"].as_array().unwrap();
        assert!(readings.len() <= 7);
        ids.extend(readings.iter().map(|reading| reading["id"].as_u64().unwrap()));
        after = page["next_after"].as_u64().unwrap();
        if page["more"] == false {
            break;
        }
    }
    ids.sort_unstable();
    assert_eq!(ids, (0..ids.len() as u64).collect::<Vec<_>>());
    assert!(ids.len() > 7);
    let (status, refused) = daemon.get("/runs/1/readings?limit=1000000");
    assert_eq!((status, &refused["expected"]), (400, &json!("1 to 2000")));
}

#[test]
fn an_abort_is_final_however_often_it_is_said_and_the_queue_goes_on() {
    let place = Place::new();
    let daemon = place.daemon();
    for _ in 0..3 {
        daemon.post("/runs", &bundle(&place));
    }
    daemon.wait_for_readings(1, 1);
    assert_eq!(daemon.get("/status").1["queue_length"], 2);
    let (status, refused) = daemon.post("/runs/2/pause", "");
    assert_eq!(status, 409, "{refused}");
    for _ in 0..2 {
        assert_eq!(daemon.post("/runs/2/abort", "").0, 200);
        assert_eq!(daemon.post("/runs/1/abort", "").0, 200);
    }
    daemon.wait_for(1, "aborted");
    assert_eq!(daemon.post("/runs/1/abort", "").1["answer"], "aborted already");
    daemon.wait_for(3, "complete");
    assert_eq!(daemon.state_of(2), "aborted");
    assert_eq!(daemon.post("/runs/9/abort", "").0, 404);
}

#[test]
fn after_a_kill_nothing_moves_before_a_person_says_so_and_nothing_is_measured_twice() {
    let place = Place::new();
    let mut daemon = place.daemon();
    daemon.post("/runs", &bundle(&place));
    daemon.post("/runs", &bundle(&place));
    let had = daemon.wait_for_readings(1, 5);
    daemon.kill();

    let daemon = place.daemon();
    assert_eq!((daemon.state_of(1), daemon.state_of(2)), ("interrupted".into(), "queued".into()));
    std::thread::sleep(Duration::from_millis(500));
    let status = daemon.get("/status").1;
    assert_eq!((&status["state"], &status["interrupted_runs"]), (&json!("idle"), &json!([1])));
    assert_eq!(status["position_trusted"], false);
    assert!(status["watchdogs"][0].as_str().unwrap().contains("lease"), "{status}");
    assert_eq!(daemon.state_of(2), "queued");

    let (_, asked) = daemon.post("/runs/1/continue", "");
    assert!(asked["answer"].as_str().unwrap().starts_with("continuing"), "{asked}");
    daemon.wait_for(1, "complete");
    daemon.wait_for(2, "complete");
    let (resumed, whole) = (daemon.ids_of(1), daemon.ids_of(2));
    let (checks, steps): (Vec<u64>, Vec<u64>) =
        resumed.into_iter().partition(|id| *id >= 0x8000_0000);
    assert!(!checks.is_empty() && had >= 5);
    // ids_of is sorted: each step once.
    assert_eq!(steps, whole);
    let samples = |run| place.samples(run);
    assert_eq!(samples("1-small").len(), samples("2-small").len());
}

#[test]
fn a_run_is_not_carried_on_in_front_of_another_scene() {
    let place = Place::new();
    let mut daemon = place.daemon();
    daemon.post("/runs", &bundle(&place));
    daemon.wait_for_readings(1, 2);
    daemon.kill();
    let scene = place.scene();
    place.write("scene.toml", &scene.replace("50", "60"));
    let mut daemon = place.daemon();
    assert_eq!(daemon.post("/runs/1/continue", "").0, 200);
    wait_until("it says why not", || {
        let (_, run) = daemon.get("/runs/1");
        run["detail"].as_str().unwrap().contains("begun with another scene")
    });
    assert_eq!(daemon.state_of(1), "interrupted");
    daemon.kill();
    place.write("scene.toml", &scene);
    let daemon = place.daemon();
    daemon.post("/runs/1/continue", "");
    daemon.wait_for(1, "complete");
}

#[test]
fn over_a_serial_line_a_killed_daemon_loses_nothing_and_measures_nothing_twice() {
    let place = Place::new();
    let _device = place.device_on_a_pseudo_terminal("wire");
    place.write_serial_rig("wire");
    let mut daemon = place.daemon_of(&["--rig", "serial.toml"]);
    // The plan alone: the daemon's own rig is meant.
    let plan = json!({"role": "plan", "name": "plan.toml", "text": place.plan()});
    let (status, submitted) = daemon.post("/runs", &json!({"files": [plan]}).to_string());
    assert_eq!((status, &submitted["simulated"]), (201, &json!(false)), "{submitted}");
    daemon.wait_for_readings(1, 5);
    daemon.post("/runs/1/pause", "");
    daemon.wait_for(1, "paused");
    daemon.post("/runs/1/continue", "");
    daemon.wait_for_readings(1, 15);
    daemon.kill();
    let daemon = place.daemon_of(&["--rig", "serial.toml"]);
    assert_eq!(daemon.state_of(1), "interrupted");
    daemon.post("/runs/1/continue", "");
    daemon.wait_for(1, "complete");
    let steps: Vec<_> = daemon.ids_of(1).into_iter().filter(|id| *id < 0x8000_0000).collect();
    assert_eq!(steps, (0..steps.len() as u64).collect::<Vec<_>>());
    // A line a target, and the header.
    assert_eq!(place.samples("1-small").len(), 41);
}

#[test]
fn a_rig_that_is_not_there_is_waited_for() {
    let place = Place::new();
    place.write_serial_rig("wire");
    let daemon = place.daemon_of(&["--rig", "serial.toml"]);
    let (status, refused) = daemon.post("/rig/home", "");
    assert_eq!(status, 502, "{refused}");
    let plan = json!({"role": "plan", "name": "plan.toml", "text": place.plan()});
    daemon.post("/runs", &json!({"files": [plan]}).to_string());
    wait_until("the run says what is wrong", || {
        let detail = daemon.get("/runs/1").1["detail"].as_str().unwrap().to_owned();
        detail.contains("wire")
    });
    let _device = place.device_on_a_pseudo_terminal("wire");
    daemon.post("/runs/1/continue", "");
    daemon.wait_for(1, "complete");
}

#[test]
fn a_client_that_says_nothing_does_not_keep_it() {
    let place = Place::new();
    let daemon = place.daemon();
    let _silent = std::os::unix::net::UnixStream::connect(place.socket()).unwrap();
    std::thread::sleep(Duration::from_millis(100));
    let began = std::time::Instant::now();
    assert!(daemon.terminate().success());
    assert!(began.elapsed() < AT_ONCE, "{:?}", began.elapsed());
}

#[test]
fn a_stop_brings_the_run_to_rest_tells_who_watches_and_ends_at_once() {
    let place = Place::new();
    let daemon = place.daemon();
    daemon.post("/runs", &bundle(&place));
    daemon.wait_for_readings(1, 2);
    let watcher = daemon.watch(0);
    let ended = daemon.terminate();
    assert!(ended.success(), "{ended}");
    let events = watcher.join().unwrap();
    let wanted = ["started", "daemon_stopping", "interrupted"];
    assert!(occur_in_order(&kinds_of(&events), &wanted), "{:?}", kinds_of(&events));
    assert!(!place.socket().exists());

    let daemon = place.daemon();
    assert_eq!(daemon.state_of(1), "interrupted");
    assert_eq!(daemon.post("/runs/1/abort", "").0, 200);
    assert_eq!(daemon.state_of(1), "aborted");
    // Idle, with somebody watching: nothing to wait for.
    let watcher = daemon.watch(0);
    std::thread::sleep(Duration::from_millis(200));
    let began = std::time::Instant::now();
    assert!(daemon.terminate().success());
    assert!(began.elapsed() < AT_ONCE, "{:?}", began.elapsed());
    assert_eq!(*kinds_of(&watcher.join().unwrap()).last().unwrap(), "daemon_stopping");
}

#[test]
fn what_cannot_be_run_is_refused_with_what_a_person_would_be_told() {
    let place = Place::new();
    let daemon = place.daemon();
    let with_plan = |text: &str| {
        json!({"files": [{"role": "plan", "name": "plan.toml", "text": text}]}).to_string()
    };
    let (status, refused) = daemon.post("/runs", "not json");
    assert_eq!(status, 400, "{refused}");
    let (status, refused) = daemon.post("/runs", "{\"files\": 7}");
    assert_eq!(status, 422, "{refused}");
    let misspelt = place.plan().replace("dwell_ms = 20", "dwel_ms = 20");
    let (status, refused) = daemon.post("/runs", &with_plan(&misspelt));
    let text = refused["error"].as_str().unwrap();
    assert!(status == 422 && text.contains("dwel_ms") && text.contains("plan.toml"), "{text}");

    let other = place.rig().replace("fast gantry", "another gantry");
    let body = json!({"files": [
        {"role": "plan", "name": "plan.toml", "text": place.plan()},
        {"role": "rig", "name": "rig.toml", "text": other},
    ]});
    let (status, refused) = daemon.post("/runs", &body.to_string());
    assert_eq!(status, 422);
    assert_eq!(refused["error"], "the plan is for another rig: \"another gantry\"");
    let body = json!({"files": [
        {"role": "plan", "name": "plan.toml", "text": place.plan()},
        {"role": "scene", "name": "scene.toml", "text": place.scene().replace("50", "60")},
    ]});
    let (status, refused) = daemon.post("/runs", &body.to_string());
    assert!(status == 422 && refused["error"].as_str().unwrap().contains("another scene"));

    assert_eq!(daemon.post("/rig/jog", &" ".repeat(70 << 10)).0, 413);
    assert_eq!(daemon.post("/rig/jog", "{\"theta_deg\": 91}").0, 400);
    assert_eq!(daemon.post("/rig/jog", "{\"theta\": 10}").0, 400);
    assert_eq!(daemon.post("/rig/jog", "").0, 400);
    assert_eq!(daemon.post("/rig/read", "{\"gain\": \"2 uA\"}").0, 400);
    assert_eq!(daemon.post("/status", "").0, 405);
    assert_eq!(daemon.get("/nothing").0, 404);
    assert_eq!(daemon.get("/runs/x").0, 400);
    assert_eq!(daemon.get("/events?after=x").0, 400);
    assert_eq!(daemon.get("/runs").1["runs"], json!([]));
}

#[test]
fn a_body_that_is_too_large_is_not_taken_in() {
    let place = Place::new();
    let daemon = place.daemon();
    let (status, refused) = daemon.post("/runs", &" ".repeat((64 << 20) + 1));
    assert_eq!(status, 413, "{refused}");
    assert_eq!(refused["expected"], "at most 67108864 bytes");
    assert_eq!(daemon.get("/status").0, 200);
}

#[test]
fn an_idle_rig_is_driven_by_hand() {
    let place = Place::new();
    let daemon = place.daemon();
    let (status, stands) = daemon.post("/rig/home", "{}");
    assert_eq!(status, 200, "{stands}");
    assert_eq!(daemon.get("/status").1["position_trusted"], true);
    let (status, stands) = daemon.post("/rig/jog", "{\"theta_deg\": 30, \"x_mm\": 4}");
    assert_eq!(status, 200, "{stands}");
    let near = |name: &str, expected: f64| {
        let value = stands["pose"][name].as_f64().unwrap();
        assert!((value - expected).abs() < 0.05, "{name}: {value}, expected {expected}");
    };
    near("theta_deg", 30.0);
    near("x_mm", 4.0);
    let (status, refused) = daemon.post("/rig/jog", "{\"x_mm\": 4000}");
    assert_eq!(status, 400);
    assert!(refused["error"].as_str().unwrap().starts_with("x: "), "{refused}");
    let (status, reading) = daemon.post("/rig/read", "{\"dwell_ms\": 20}");
    assert_eq!(status, 200, "{reading}");
    assert!(reading["mean_counts"].as_f64().unwrap() > 1000.0, "{reading}");
    assert_eq!(reading["n"], 40);
}

#[test]
fn a_rig_of_other_makes_says_which_of_its_devices_stops_by_itself() {
    let place = Place::new();
    let own = "gonio's own controller: stops by itself when its lease ends";
    assert_eq!(place.daemon().get("/status").1["watchdogs"], json!([own]));
    let devices = place
        .rig()
        .replace("readback = \"encoder\"", "readback = \"steps\"")
        .replace("full_scale_a = 1e-", "full_scale_a = 2e-")
        .replace("baud = 1_000_000\n", DEVICES);
    place.write("rig.toml", &devices);
    let daemon = place.daemon();
    let (status, answer) = daemon.get("/status");
    assert_eq!(status, 200, "{answer}");
    let watchdogs = ["grbl at a simulated port: no device watchdog"];
    assert_eq!(answer["watchdogs"], json!(watchdogs), "{answer}");
    // By hand it is driven as any other.
    let (status, stands) = daemon.post("/rig/jog", "{\"theta_deg\": 30}");
    assert_eq!(status, 200, "{stands}");
    assert_eq!(daemon.get("/status").1["position_trusted"], true);
    let (status, reading) = daemon.post("/rig/read", "{\"dwell_ms\": 20}");
    assert_eq!(status, 200, "{reading}");
}

#[test]
fn a_data_folder_and_an_address_have_one_daemon() {
    let place = Place::new();
    let _daemon = place.daemon();
    let refused = place.command("unix:other.sock").output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let text = String::from_utf8_lossy(&refused.stderr);
    assert!(text.contains("another daemon is running on this data folder"), "{text}");
    let public = place.command("0.0.0.0:0").output().unwrap();
    assert_eq!(public.status.code(), Some(2));
    let text = String::from_utf8_lossy(&public.stderr);
    assert!(text.contains("0.0.0.0:0: not a loopback address"), "{text}");
}

#[test]
fn the_commands_speak_to_it() {
    let place = Place::new();
    let daemon = place.daemon();
    let run = |arguments: &[&str]| {
        let output = place.gonio(arguments).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        (output.status.code().unwrap(), text, String::from_utf8(output.stderr).unwrap())
    };
    let (code, text, error) = run(&["submit", "plan.toml"]);
    assert!(code == 0 && text.starts_with("run 1 queued: small (simulated)"), "{text}{error}");
    daemon.wait_for_readings(1, 1);
    let (code, text, _) = run(&["pause", "1", "--json"]);
    let asked: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, &asked["id"]), (0, &json!(1)));
    daemon.wait_for(1, "paused");
    let (code, text, _) = run(&["status"]);
    assert!(code == 0 && text.contains("paused") && text.contains("fast gantry"), "{text}");
    assert_eq!(run(&["continue", "1"]).0, 0);
    daemon.wait_for(1, "complete");
    let (code, _, error) = run(&["abort", "1"]);
    assert_eq!((code, error.as_str()), (2, "error: run 1 is over already: complete\n"));

    let watching = place.gonio(&["watch", "--json"]).stdout(std::process::Stdio::piped()).spawn();
    std::thread::sleep(Duration::from_millis(300));
    assert!(daemon.terminate().success());
    let output = watching.unwrap().wait_with_output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let events: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(rise_from_1(&events), "{:?}", sequence_of(&events));
    assert_eq!(*kinds_of(&events).last().unwrap(), "daemon_stopping");

    let (code, _, error) = run(&["status"]);
    assert_eq!(code, 2);
    assert!(error.contains("no daemon listens at unix:") && error.contains("help: "), "{error}");
}

#[test]
fn over_tcp_only_this_machine_is_served() {
    let place = Place::new();
    let daemon = place.daemon_at("127.0.0.1:0");
    assert_eq!(daemon.get("/status").0, 200);
    let forged = "GET /status HTTP/1.1\r\nhost: rig.example.org\r\nconnection: close\r\n\r\n";
    assert_eq!(daemon.send(forged.as_bytes()).0, 403);
    let page = "POST /rig/home HTTP/1.1\r\nhost: localhost\r\norigin: https://example.org\r\n\
                connection: close\r\ncontent-length: 0\r\n\r\n";
    assert_eq!(daemon.send(page.as_bytes()).0, 403);
    wait_until("the rig is at rest", || daemon.get("/status").1["state"] == "idle");
}
