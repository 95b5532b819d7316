//! Runs over HTTP: handing them in, looking at them, pausing, continuing and ending them.

use std::io::Read as _;
use std::path::PathBuf;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Json, Response};
use serde::Deserialize;
use utoipa::IntoParams;

use super::body::{Asked, BundleBody, ErrorBody, ReadingBody, Readings, Run, Runs, Submitted};
use super::error::{ApiError, ApiResult};
use super::{Answer, BUNDLE_BYTES_MAX, Desk, Shared, receive};
use crate::daemon::conductor::{Order, RunWish};
use crate::daemon::notice::Kind;
use crate::daemon::workshop::{Checked, Refusal, Workshop};
use crate::journal::{JournalError, QueueState, QueuedRun, Reader};

/// Readings in one answer.
const PAGE_DEFAULT: u32 = 500;
const PAGE_MAX: u32 = 2000;
/// fit.json grows with the square of the number of coefficients.
const FIT_BYTES_MAX: u64 = 64 << 20;

/// Hand in a plan with all files that it refers to; it is checked completely, and joins the queue.
#[utoipa::path(post, path = "/runs", request_body = BundleBody, responses(
    (status = 201, body = Submitted),
    (status = 400, description = "Not a bundle.", body = ErrorBody),
    (status = 408, body = ErrorBody),
    (status = 413, body = ErrorBody),
    (status = 422, description = "Can't be run: what is wrong, as a person would be told.",
     body = ErrorBody),
    (status = 500, body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn submit<W: Workshop>(
    State(desk): Shared<W>,
    body: Body,
) -> ApiResult<(StatusCode, Json<Submitted>)> {
    if desk.closing.is_cancelled() {
        return Err(ApiError::unavailable("the daemon is about to end"));
    }
    let ending = |_| ApiError::unavailable("the daemon is about to end");
    let _permit = desk.checks.acquire().await.map_err(ending)?;
    let bundle = receive(body, BUNDLE_BYTES_MAX).await?.to_vec();
    if let Err(error) = serde_json::from_slice::<serde::de::IgnoredAny>(&bundle) {
        let what = format!("the request's body is not JSON: {error}");
        return Err(ApiError::malformed(what, "a plan with its files, as in /openapi.json"));
    }
    let workshop = Arc::clone(&desk.workshop);
    let (bundle, checked) = tokio::task::spawn_blocking(move || {
        let checked = workshop.check(&bundle);
        (bundle, checked)
    })
    .await
    .map_err(|error| ApiError::unavailable(format!("a defect of this program: {error}")))?;
    let checked =
        checked.map_err(|refusal| ApiError::new(StatusCode::UNPROCESSABLE_ENTITY, refusal))?;
    let (run, ahead) = enqueue(&desk, bundle, &checked).await?;
    desk.book.tell(Kind::Submitted, Some(run.id), &run.name, None).await?;
    desk.orders.send(Order::Wake).await.map_err(|_| {
        ApiError::unavailable("the daemon is about to end; the run begins when it runs again")
    })?;
    let answer = Submitted {
        id: run.id,
        name: run.name,
        state: run.state.name().to_owned(),
        folder: run.folder.display().to_string(),
        ahead,
        targets: checked.targets.into(),
        readings: checked.readings.into(),
        predicted_s: checked.predicted_s,
        simulated: desk.workshop.rig().is_simulated(),
        notes: checked.notes,
    };
    Ok((StatusCode::CREATED, Json(answer)))
}

async fn enqueue<W: Workshop>(
    desk: &Desk<W>,
    bundle: Vec<u8>,
    checked: &Checked,
) -> Result<(QueuedRun, u64), JournalError> {
    let (name, utc, data) = (checked.name.clone(), desk.book.utc_now(), desk.data.clone());
    desk.book
        .with(move |queue| {
            let ahead = queue.runs()?.iter().filter(|run| !run.state.is_final()).count() as u64;
            let folder = |id| run_folder(&data, id, &name);
            let run = queue.submit(&name, &bundle, &utc, folder)?;
            Ok((run, ahead))
        })
        .await
}

/// The number makes it unique; the name is for people, of what a file name may hold.
fn run_folder(data: &std::path::Path, id: i64, name: &str) -> PathBuf {
    let is_plain = |c: &char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    let plain: String = name.chars().map(|c| if is_plain(&c) { c } else { '-' }).take(64).collect();
    data.join("runs").join(format!("{id}-{plain}"))
}

/// All runs, oldest first.
#[utoipa::path(get, path = "/runs", responses(
    (status = 200, body = Runs),
    (status = 500, body = ErrorBody),
))]
pub(super) async fn list<W: Workshop>(State(desk): Shared<W>) -> Answer<Runs> {
    let runs = desk.book.with(|queue| queue.runs()).await?;
    Ok(Json(Runs { runs: runs.into_iter().map(Run::from).collect() }))
}

/// One run.
#[utoipa::path(get, path = "/runs/{id}", params(("id" = i64, Path, description = "The run's number.")),
responses(
    (status = 200, body = Run),
    (status = 400, body = ErrorBody),
    (status = 404, body = ErrorBody),
    (status = 500, body = ErrorBody),
))]
pub(super) async fn show<W: Workshop>(
    State(desk): Shared<W>,
    Path(id): Path<String>,
) -> Answer<Run> {
    Ok(Json(Run::from(find(&desk, &id).await?)))
}

/// Bring a run to rest after the dwell that runs. Asking twice does no harm.
#[utoipa::path(post, path = "/runs/{id}/pause",
params(("id" = i64, Path, description = "The run's number.")), responses(
    (status = 200, description = "What happened.", body = Asked),
    (status = 400, body = ErrorBody),
    (status = 404, body = ErrorBody),
    (status = 409, description = "Not in its state.", body = ErrorBody),
    (status = 502, description = "The rig could not.", body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn pause<W: Workshop>(
    State(desk): Shared<W>,
    Path(id): Path<String>,
) -> Answer<Asked> {
    ask(&desk, &id, RunWish::Pause).await
}

/// Go on after a pause, a question, a fault or an interruption. Asking twice does no harm.
#[utoipa::path(post, path = "/runs/{id}/continue",
params(("id" = i64, Path, description = "The run's number.")), responses(
    (status = 200, description = "What happened.", body = Asked),
    (status = 400, body = ErrorBody),
    (status = 404, body = ErrorBody),
    (status = 409, description = "Not in its state.", body = ErrorBody),
    (status = 502, description = "The rig could not.", body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn carry_on<W: Workshop>(
    State(desk): Shared<W>,
    Path(id): Path<String>,
) -> Answer<Asked> {
    ask(&desk, &id, RunWish::Continue).await
}

/// End a run for good, at once; what was measured is kept. Asking twice does no harm.
#[utoipa::path(post, path = "/runs/{id}/abort",
params(("id" = i64, Path, description = "The run's number.")), responses(
    (status = 200, description = "What happened.", body = Asked),
    (status = 400, body = ErrorBody),
    (status = 404, body = ErrorBody),
    (status = 409, description = "Not in its state.", body = ErrorBody),
    (status = 502, description = "The rig could not.", body = ErrorBody),
    (status = 503, body = ErrorBody),
))]
pub(super) async fn abort<W: Workshop>(
    State(desk): Shared<W>,
    Path(id): Path<String>,
) -> Answer<Asked> {
    ask(&desk, &id, RunWish::Abort).await
}

async fn ask<W: Workshop>(desk: &Desk<W>, id: &str, wish: RunWish) -> Answer<Asked> {
    let id = number(id)?;
    let answer = desk.order(|answer| Order::Ask { id, wish, answer }).await?;
    Ok(Json(Asked { id, answer }))
}

/// From which reading on, and how many.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct Page {
    /// The `next_after` of the page before; 0 begins.
    #[serde(default)]
    after: u64,
    /// At most so many, 1 to 2000; 500 if left out.
    limit: Option<u32>,
}

/// A page of a run's raw readings, in the order in which they were taken.
#[utoipa::path(get, path = "/runs/{id}/readings",
params(("id" = i64, Path, description = "The run's number."), Page), responses(
    (status = 200, body = Readings),
    (status = 400, body = ErrorBody),
    (status = 404, body = ErrorBody),
    (status = 500, body = ErrorBody),
))]
pub(super) async fn readings<W: Workshop>(
    State(desk): Shared<W>,
    Path(id): Path<String>,
    page: Result<Query<Page>, QueryRejection>,
) -> Answer<Readings> {
    let Query(Page { after, limit }) =
        page.map_err(|e| ApiError::malformed(e.body_text(), "after=N and limit=N, whole numbers"))?;
    let limit = limit.unwrap_or(PAGE_DEFAULT);
    if !(1..=PAGE_MAX).contains(&limit) {
        return Err(ApiError::malformed(format!("limit: {limit}"), format!("1 to {PAGE_MAX}")));
    }
    let journal = find(&desk, &id).await?.folder.join("run.sqlite");
    let rig = desk.workshop.rig().clone();
    let work = move || -> Result<Readings, JournalError> {
        let reader = match Reader::open(&journal) {
            // Not begun yet: there are none, and there will be.
            Err(JournalError::Missing { .. } | JournalError::Empty { .. }) => {
                return Ok(Readings { readings: Vec::new(), next_after: after, more: false });
            }
            opened => opened?,
        };
        let mut page = reader.readings_after(after, limit + 1)?;
        let more = page.len() > limit as usize;
        page.truncate(limit as usize);
        let next_after = page.last().map_or(after, |(position, _)| *position);
        let readings = page.iter().map(|(_, reading)| ReadingBody::of(&rig, reading)).collect();
        Ok(Readings { readings, next_after, more })
    };
    let page = tokio::task::spawn_blocking(work).await.unwrap_or(Err(JournalError::Stopped))?;
    Ok(Json(page))
}

/// A run's fit, as in its folder's fit.json.
#[utoipa::path(get, path = "/runs/{id}/fit",
params(("id" = i64, Path, description = "The run's number.")), responses(
    (status = 200, description = "fit.json.", body = serde_json::Value),
    (status = 400, body = ErrorBody),
    (status = 404, description = "No such run, or no fit of it yet.", body = ErrorBody),
    (status = 500, body = ErrorBody),
))]
pub(super) async fn fit<W: Workshop>(
    State(desk): Shared<W>,
    Path(id): Path<String>,
) -> ApiResult<Response> {
    let run = find(&desk, &id).await?;
    let path = run.folder.join("fit.json");
    let read = move || {
        let mut bytes = Vec::new();
        let file = std::fs::File::open(path)?;
        file.take(FIT_BYTES_MAX).read_to_end(&mut bytes)?;
        Ok::<_, std::io::Error>(bytes)
    };
    let bytes = tokio::task::spawn_blocking(read)
        .await
        .map_err(|error| ApiError::unavailable(error.to_string()))?;
    match bytes {
        Ok(bytes) => Ok(([(header::CONTENT_TYPE, "application/json")], bytes).into_response()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(no_fit(&run)),
        Err(error) => Err(ApiError::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            Refusal::new(format!("fit.json of run {}: {error}", run.id)),
        )),
    }
}

fn no_fit(run: &QueuedRun) -> ApiError {
    let why = match run.state {
        QueueState::Queued => "it has not begun",
        QueueState::Running | QueueState::Paused => "it is under way",
        QueueState::Interrupted => "it is interrupted, and waits for continue",
        QueueState::Aborted | QueueState::Complete | QueueState::Failed => {
            "its readings allow none; GET /runs/{id} says why"
        }
    };
    ApiError::missing(format!("run {} has no fit: {why}", run.id))
}

async fn find<W: Workshop>(desk: &Desk<W>, id: &str) -> ApiResult<QueuedRun> {
    let id = number(id)?;
    let found = desk.book.run(id).await?;
    found.ok_or_else(|| ApiError::missing(format!("there is no run {id}")))
}

fn number(id: &str) -> ApiResult<i64> {
    id.parse().map_err(|_| ApiError::malformed(format!("run {id:?}"), "a run's number, from 1"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_holds_nothing_that_leads_elsewhere() {
        let data = std::path::Path::new("/data");
        assert_eq!(run_folder(data, 7, "luminaire"), data.join("runs/7-luminaire"));
        assert_eq!(run_folder(data, 8, "../../etc x"), data.join("runs/8-..-..-etc-x"));
    }
}
