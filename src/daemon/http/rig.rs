//! The rig over HTTP: how it is, and driving it by hand while no run has it.

use std::time::Duration;

use axum::body::Body;
use axum::extract::State;
use axum::response::Json;

use super::body::{CurrentRun, ErrorBody, JogBody, Nothing, ReadBody, ReadingBody, Stands, Status};
use super::error::{ApiError, ApiResult};
use super::{Answer, Shared, receive_json};
use crate::daemon::conductor::{Activity, Order};
use crate::daemon::hand::{Hand, Handled, Jog};
use crate::daemon::notice::Progress;
use crate::daemon::question;
use crate::daemon::workshop::Workshop;
use crate::device::Composer;
use crate::journal::QueueState;
use crate::rig::Rig;

/// As long as a plan may dwell.
const DWELL_MS_MAX: f64 = 600_000.0;
const DWELL_MS_DEFAULT: f64 = 100.0;

/// How the rig and its runs are.
#[utoipa::path(get, path = "/status", responses(
    (status = 200, body = Status),
    (status = 500, body = ErrorBody),
))]
pub(super) async fn status<W: Workshop>(State(desk): Shared<W>) -> Answer<Status> {
    let now = desk.rig.borrow().clone();
    let activity = desk.activity.borrow().clone();
    let (runs, latest_event) =
        desk.book.with(|queue| Ok((queue.runs()?, queue.latest_event()?))).await?;
    let in_state = |state| runs.iter().filter(move |run| run.state == state);
    let is_measuring = matches!(activity, Activity::Measuring(_));
    let current_run = activity.tenant().map(|tenant| CurrentRun {
        id: tenant.id,
        name: tenant.name.clone(),
        progress: if is_measuring { now.progress.into() } else { Progress::default() },
    });
    let rig = desk.workshop.rig();
    Ok(Json(Status {
        rig: rig.name.clone(),
        simulated: rig.is_simulated(),
        state: match activity {
            Activity::ByHand => "by_hand",
            Activity::Evaluating(_) => "evaluating",
            Activity::Idle => "idle",
            Activity::Measuring(_) => now.state.name(),
            Activity::Preparing(_) => "preparing",
        }
        .to_owned(),
        position_trusted: now.position.is_trusted(),
        position: now.position.to_string(),
        watchdogs: watchdogs(rig),
        fault: now.fault.as_ref().map(ToString::to_string),
        question: now.asked.map(|source| question(source).to_owned()),
        eta_s: current_run.as_ref().and_then(|run| run.progress.eta_s),
        current_run,
        queue_length: in_state(QueueState::Queued).count() as u64,
        interrupted_runs: in_state(QueueState::Interrupted).map(|run| run.id).collect(),
        latest_event,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }))
}

fn watchdogs(rig: &Rig) -> Vec<String> {
    let own = || vec!["gonio's own controller: stops by itself when its lease ends".to_owned()];
    Composer::of(rig, 0).map_or_else(own, |composer| composer.watchdogs())
}

/// Find the home marks of all axes. Only while no run has the rig.
#[utoipa::path(post, path = "/rig/home", request_body = Nothing, responses(
    (status = 200, description = "Homed; where the axes stand.", body = Stands),
    (status = 400, body = ErrorBody),
    (status = 409, description = "A run has the rig.", body = ErrorBody),
    (status = 502, description = "The rig could not.", body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn home<W: Workshop>(State(desk): Shared<W>, body: Body) -> Answer<Stands> {
    let Nothing {} = receive_json(body).await?;
    stands(&desk.order(|answer| Order::Hand { hand: Hand::Home, answer }).await?)
}

/// Move to a pose, homing first where the position is not trusted. Only while no run has the rig.
#[utoipa::path(post, path = "/rig/jog", request_body = JogBody, responses(
    (status = 200, description = "There; where the axes stand.", body = Stands),
    (status = 400, description = "Not a pose, or outside the rig's limits.", body = ErrorBody),
    (status = 409, description = "A run has the rig.", body = ErrorBody),
    (status = 502, description = "The rig could not.", body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn jog<W: Workshop>(State(desk): Shared<W>, body: Body) -> Answer<Stands> {
    let asked: JogBody = receive_json(body).await?;
    let degrees = |value: Option<f64>| value.map(f64::to_radians);
    let millimetres = |value: Option<f64>| value.map(|mm| mm / 1e3);
    if asked == JogBody::default() {
        let expected = "at least one of theta_deg, phi_deg, x_mm, y_mm";
        return Err(ApiError::malformed("no pose to go to", expected));
    }
    let jog = Jog {
        theta_rad: degrees(asked.theta_deg),
        phi_rad: degrees(asked.phi_deg),
        x_m: millimetres(asked.x_mm),
        y_m: millimetres(asked.y_mm),
    };
    if let Some(theta_deg) = asked.theta_deg.filter(|theta| !(0.0..=90.0).contains(theta)) {
        return Err(ApiError::malformed(format!("theta_deg: {theta_deg}"), "0 to 90"));
    }
    let hand = Hand::Jog(jog);
    stands(&desk.order(|answer| Order::Hand { hand, answer }).await?)
}

/// Take one reading where the rig stands. Only while no run has the rig.
#[utoipa::path(post, path = "/rig/read", request_body = ReadBody, responses(
    (status = 200, body = ReadingBody),
    (status = 400, body = ErrorBody),
    (status = 409, description = "A run has the rig.", body = ErrorBody),
    (status = 502, description = "The rig could not.", body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn read<W: Workshop>(State(desk): Shared<W>, body: Body) -> Answer<ReadingBody> {
    let asked: ReadBody = receive_json(body).await?;
    let dwell_ms = asked.dwell_ms.unwrap_or(DWELL_MS_DEFAULT);
    if !(dwell_ms > 0.0 && dwell_ms <= DWELL_MS_MAX) {
        let expected = format!("more than 0 and at most {DWELL_MS_MAX} ms");
        return Err(ApiError::malformed(format!("dwell_ms: {dwell_ms}"), expected));
    }
    let rig = desk.workshop.rig();
    let gain = match &asked.gain {
        None => 0,
        Some(name) => rig.detector.gain_index(name).ok_or_else(|| {
            let known: Vec<_> = rig.detector.gains.iter().map(|gain| gain.name.as_str()).collect();
            ApiError::malformed(format!("gain: no range {name:?}"), known.join(", "))
        })?,
    };
    let hand = Hand::Read { dwell: Duration::from_secs_f64(dwell_ms / 1e3), gain };
    match desk.order(|answer| Order::Hand { hand, answer }).await? {
        Handled::Read(reading) => Ok(Json(ReadingBody::of(rig, &reading))),
        Handled::Stands(_) => Err(ApiError::unavailable("the rig took no reading")),
    }
}

fn stands(handled: &Handled) -> ApiResult<Json<Stands>> {
    match handled {
        Handled::Stands(positions) => Ok(Json(Stands::at(*positions))),
        Handled::Read(_) => Err(ApiError::unavailable("the rig took a reading instead")),
    }
}
