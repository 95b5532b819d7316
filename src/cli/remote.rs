//! The commands that a daemon carries out: submit, status, watch, pause, continue, abort, and
//! driving its rig by hand.

use std::fmt::Write as _;
use std::process::ExitCode;

use serde::Serialize;
use serde_json::json;

use super::args::{
    DaemonAddress, HandArgs, JogArgs, ReadArgs, RunIdArgs, StatusArgs, SubmitArgs, WatchArgs,
};
use super::client::{Client, WORK_WITHIN};
use super::failure::{Failure, Outcome};
use super::inputs::{Bundle, Inputs, beside};
use super::output::{say, say_json};
use super::setup::{rig_at, stage_at};
use super::text::{duration, row, table, wrapped};
use crate::daemon::http::body::{
    Asked, JogBody, Nothing, ReadBody, ReadingBody, Run, Runs, Stands, Status, Submitted,
};
use crate::journal::InputRole;
use crate::plan::Plan;
use crate::rig::Rig;

/// The seed is the daemon's own business.
const NO_SEED: u64 = 0;

/// `gonio submit`.
pub(crate) fn submit(args: &SubmitArgs) -> Outcome {
    let client = Client::of(&args.address)?;
    let bundle = bundle(&args.plan)?;
    let submitted: Submitted = client.post("/runs", as_body(&bundle)?, WORK_WITHIN)?;
    if args.json {
        say_json(&json!(submitted))?;
        return Ok(ExitCode::SUCCESS);
    }
    let simulated = if submitted.simulated { " (simulated)" } else { "" };
    let mut text = format!(
        "run {} queued: {}{simulated}, {} targets, about {} in the rig\n",
        submitted.id,
        submitted.name,
        submitted.targets,
        duration(submitted.predicted_s),
    );
    if submitted.ahead > 0 {
        let _ = writeln!(text, "  {} ahead of it", submitted.ahead);
    }
    for note in &submitted.notes {
        let _ = writeln!(text, "  note: {note}");
    }
    let _ = writeln!(text, "  folder: {}", submitted.folder);
    say(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// A plan and what it refers to, read from the disk. Where the plan names no rig, the daemon's
/// own is meant, and what stands on it.
fn bundle(path: &std::path::Path) -> Result<Bundle, Failure> {
    let mut inputs = Inputs::from_disk();
    let plan = Plan::read(inputs.document(InputRole::Plan, path)?)?;
    if let Some(name) = plan.list_file() {
        inputs.attachment(path, name).map_err(Failure::start)?;
    }
    if let Some(name) = plan.rig.as_deref() {
        let is_built_in = name == super::inputs::BUILT_IN;
        let rig_path = if is_built_in { name.into() } else { beside(path, name) };
        let rig: Rig = rig_at(&mut inputs, &rig_path)?;
        if let Some(scene) = plan.scene.as_deref().filter(|_| rig.is_simulated()) {
            // Reading it is what finds the files that it names.
            stage_at(&mut inputs, &beside(path, scene), &rig, &sim::Terms::seeded(NO_SEED))?;
        }
    }
    let name = plan.name.clone().unwrap_or_else(|| super::setup::folder_name(path));
    Ok(Bundle::pack(NO_SEED, Some(name), inputs.read()))
}

fn as_body(body: &impl Serialize) -> Result<Vec<u8>, Failure> {
    serde_json::to_vec(body).map_err(|error| Failure::start(format!("the request: {error}")))
}

/// `gonio status`.
pub(crate) fn status(args: &StatusArgs) -> Outcome {
    let client = Client::of(&args.address)?;
    let status: Status = client.get("/status")?;
    let Runs { runs } = client.get("/runs")?;
    if args.json {
        let mut document = json!(status);
        document["runs"] = json!(runs);
        say_json(&document)?;
        return Ok(ExitCode::SUCCESS);
    }
    say(&status_text(&status, &runs))?;
    Ok(ExitCode::SUCCESS)
}

fn status_text(status: &Status, runs: &[Run]) -> String {
    let simulated = if status.simulated { " (simulated)" } else { "" };
    let mut rows = vec![
        row("rig", format!("{}{simulated}", status.rig)),
        row("state", status.state.clone()),
        row("position", status.position.clone()),
    ];
    rows.extend(status.watchdogs.iter().map(|words| row("if silent", words.clone())));
    if let Some(run) = &status.current_run {
        let progress = run.progress;
        rows.push(row("run", format!("{} ({})", run.id, run.name)));
        rows.push(row("readings", format!("{} of {}", progress.done, progress.total)));
    }
    let more = [
        ("time left", status.eta_s.map(duration)),
        ("fault", status.fault.clone()),
        ("asks", status.question.clone()),
        ("queued", (status.queue_length > 0).then(|| status.queue_length.to_string())),
    ];
    rows.extend(more.into_iter().filter_map(|(name, value)| Some(row(name, value?))));
    let mut text = table(&rows);
    if !runs.is_empty() {
        text.push('\n');
        text.push_str(&runs_text(runs));
    }
    for id in &status.interrupted_runs {
        let _ = writeln!(
            text,
            "\n  run {id} waits: `gonio continue {id}` carries it on, `gonio abort {id}` ends it"
        );
    }
    text
}

/// A row for every run, and below it how it went.
fn runs_text(runs: &[Run]) -> String {
    let head = ["run", "plan", "state", "submitted"].map(str::to_owned).to_vec();
    let rows = runs.iter().map(|run| {
        let Run { id, name, state, submitted_utc, .. } = run;
        vec![id.to_string(), name.clone(), state.clone(), submitted_utc.clone()]
    });
    let rows = table(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
    let details = std::iter::once("").chain(runs.iter().map(|run| run.detail.as_str()));
    let mut text = String::new();
    for (row, detail) in rows.lines().zip(details) {
        let _ = writeln!(text, "{row}");
        if let Some(first) = detail.lines().next() {
            text.push_str(&wrapped(first, 7));
        }
    }
    text
}

/// `gonio watch`.
pub(crate) fn watch(args: &WatchArgs) -> Outcome {
    let client = Client::of(&args.address)?;
    client.follow(args.after, |sequence, notice| {
        if args.json {
            let mut document = json!(notice);
            document["sequence"] = json!(sequence);
            return say_json(&document);
        }
        let run = notice.run.map_or_else(String::new, |run| format!(" run {run}"));
        let left = notice.progress.and_then(|progress| progress.eta_s);
        let left = left.map_or_else(String::new, |eta_s| format!(", {} left", duration(eta_s)));
        let (kind, time) = (notice.kind.name(), notice.time_utc);
        let colon = if notice.text.is_empty() { "" } else { ": " };
        say(&format!("{sequence} {time}{run} {kind}{colon}{}{left}\n", notice.text))
    })?;
    Ok(ExitCode::SUCCESS)
}

/// `gonio pause`, `continue` and `abort`: `what` is the last part of the route.
pub(crate) fn ask(args: &RunIdArgs, what: &str) -> Outcome {
    let client = Client::of(&args.address)?;
    let path = format!("/runs/{}/{what}", args.id);
    let asked: Asked = client.post(&path, Vec::new(), WORK_WITHIN)?;
    if args.json {
        say_json(&json!(asked))?;
    } else {
        say(&format!("run {}: {}\n", asked.id, asked.answer))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The daemon that has the rig, if there is one: the one that was named, or the default one where
/// no rig or that very rig was named. `rig` is the rig that the command line names.
pub(crate) fn daemon_for(
    address: &DaemonAddress,
    rig: Option<&Rig>,
) -> Result<Option<Client>, Failure> {
    let client = Client::of(address)?;
    if address.daemon.is_some() {
        let status: Status = client.get("/status")?;
        return match rig.filter(|rig| rig.name != status.rig) {
            None => Ok(Some(client)),
            Some(rig) => Err(Failure::with_help(
                format!("the daemon's rig is \"{}\", not \"{}\"", status.rig, rig.name),
                "leave --rig out, or --daemon",
            )),
        };
    }
    let status: Option<Status> = client.get_if_there("/status")?;
    let is_its = |status: &Status| rig.is_none_or(|rig| rig.name == status.rig);
    Ok(status.filter(is_its).map(|_| client))
}

/// `gonio home` through a daemon.
pub(crate) fn home(client: &Client, args: &HandArgs) -> Outcome {
    let stands: Stands = client.post("/rig/home", as_body(&Nothing {})?, WORK_WITHIN)?;
    tell_stand(&stands, args.json)
}

/// `gonio jog` through a daemon.
pub(crate) fn jog(client: &Client, args: &JogArgs) -> Outcome {
    let JogArgs { hand, theta_deg, phi_deg, x_mm, y_mm } = args;
    let body = JogBody { theta_deg: *theta_deg, phi_deg: *phi_deg, x_mm: *x_mm, y_mm: *y_mm };
    tell_stand(&client.post("/rig/jog", as_body(&body)?, WORK_WITHIN)?, hand.json)
}

/// `gonio read` through a daemon.
pub(crate) fn read(client: &Client, args: &ReadArgs) -> Outcome {
    let body = ReadBody { dwell_ms: Some(args.dwell_ms), gain: args.gain.clone() };
    let within = WORK_WITHIN + std::time::Duration::from_mins(10);
    let reading: ReadingBody = client.post("/rig/read", as_body(&body)?, within)?;
    tell_reading(&reading, args.hand.json)
}

/// Where the rig stands, for a person or a program.
pub(crate) fn tell_stand(stands: &Stands, is_json: bool) -> Outcome {
    if is_json {
        say_json(&json!(stands))?;
    } else {
        let pose = stands.pose;
        say(&format!(
            "looking along theta {:.3}°, phi {:.3}° at x {:.3} mm, y {:.3} mm\n",
            pose.theta_deg, pose.phi_deg, pose.x_mm, pose.y_mm
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A reading taken by hand, for a person or a program.
pub(crate) fn tell_reading(reading: &ReadingBody, is_json: bool) -> Outcome {
    if is_json {
        say_json(&json!(reading))?;
    } else {
        let saturated = if reading.saturated > 0 { ", saturated" } else { "" };
        say(&format!(
            "{:.1} counts, {:.4e} A in range {}{saturated} (dark current included)\n",
            reading.mean_counts, reading.current_a, reading.gain
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
