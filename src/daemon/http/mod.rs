//! The daemon's HTTP: routes, what goes in and out, and how long anybody may take. It decides
//! nothing about the rig: it asks the conductor, the queue's file and the run's journal.

pub mod body;
pub(super) mod error;
mod events;
mod guard;
mod openapi;
mod rig;
mod runs;

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::State;
use axum::handler::Handler;
use axum::http::StatusCode;
use axum::response::Json;
use axum::routing::{MethodRouter, get, post};
use serde::de::DeserializeOwned;
use tokio::sync::{Semaphore, mpsc, watch};
use tokio_util::sync::CancellationToken;

use self::error::{ApiError, ApiResult};
use super::book::Book;
use super::conductor::{Activity, No, Order};
use super::workshop::{Refusal, Workshop};
use crate::run::OwnerStatus;

/// A plan with a photometric file and a list of poses is far below.
const BUNDLE_BYTES_MAX: usize = 64 << 20;
/// What the other requests carry fits in a fraction of this.
const BODY_BYTES_MAX: usize = 64 << 10;
/// How long a client may take to send its body.
const BODY_WITHIN: Duration = Duration::from_mins(1);
/// Plans that are checked at a time; each may hold a large body and compile a scene.
const CHECKS_MAX: usize = 2;
/// Watchers at a time.
const WATCHERS_MAX: usize = 64;

/// What handlers know.
pub(super) struct Desk<W> {
    pub(super) workshop: Arc<W>,
    pub(super) book: Book,
    pub(super) orders: mpsc::Sender<Order>,
    pub(super) activity: watch::Receiver<Activity>,
    pub(super) rig: watch::Receiver<OwnerStatus>,
    /// Nothing more will happen: who watches may go.
    pub(super) closing: CancellationToken,
    pub(super) data: std::path::PathBuf,
    checks: Semaphore,
    watchers: Arc<Semaphore>,
}

impl<W> Desk<W> {
    pub(super) fn new(
        workshop: Arc<W>,
        book: Book,
        orders: mpsc::Sender<Order>,
        activity: watch::Receiver<Activity>,
        rig: watch::Receiver<OwnerStatus>,
        closing: CancellationToken,
        data: std::path::PathBuf,
    ) -> Self {
        let (checks, watchers) =
            (Semaphore::new(CHECKS_MAX), Arc::new(Semaphore::new(WATCHERS_MAX)));
        Self { workshop, book, orders, activity, rig, closing, data, checks, watchers }
    }
}

type Shared<W> = State<Arc<Desk<W>>>;

/// One route: its method, its path, and what answers.
struct Route<W> {
    #[cfg_attr(not(test), expect(dead_code, reason = "a test holds it against /openapi.json"))]
    method: &'static str,
    path: &'static str,
    answers: MethodRouter<Arc<Desk<W>>>,
}

fn get_at<W: Workshop, H: Handler<T, Arc<Desk<W>>>, T: 'static>(
    path: &'static str,
    handler: H,
) -> Route<W> {
    Route { method: "get", path, answers: get(handler) }
}

fn post_at<W: Workshop, H: Handler<T, Arc<Desk<W>>>, T: 'static>(
    path: &'static str,
    handler: H,
) -> Route<W> {
    Route { method: "post", path, answers: post(handler) }
}

/// Every route there is.
fn routes<W: Workshop>() -> Vec<Route<W>> {
    vec![
        get_at("/openapi.json", openapi::openapi::<W>),
        get_at("/status", rig::status::<W>),
        post_at("/runs", runs::submit::<W>),
        get_at("/runs", runs::list::<W>),
        get_at("/runs/{id}", runs::show::<W>),
        post_at("/runs/{id}/pause", runs::pause::<W>),
        post_at("/runs/{id}/continue", runs::carry_on::<W>),
        post_at("/runs/{id}/abort", runs::abort::<W>),
        get_at("/runs/{id}/readings", runs::readings::<W>),
        get_at("/runs/{id}/fit", runs::fit::<W>),
        post_at("/rig/home", rig::home::<W>),
        post_at("/rig/jog", rig::jog::<W>),
        post_at("/rig/read", rig::read::<W>),
        get_at("/events", events::events::<W>),
    ]
}

/// The whole API. `is_tcp` says whether a browser could reach it.
pub(super) fn router<W: Workshop>(desk: Desk<W>, is_tcp: bool) -> Router {
    let mut router = Router::new();
    for Route { path, answers, .. } in routes::<W>() {
        router = router.route(path, answers);
    }
    let guard = move |request, next| guard::guard(is_tcp, request, next);
    router
        .fallback(no_such_route)
        .method_not_allowed_fallback(no_such_method)
        .layer(axum::middleware::from_fn(guard))
        .with_state(Arc::new(desk))
}

async fn no_such_route() -> ApiError {
    let refusal = Refusal::new("no such route").with_help("GET /openapi.json lists them all");
    ApiError::new(StatusCode::NOT_FOUND, refusal)
}

async fn no_such_method() -> ApiError {
    let refusal = Refusal::new("this route does not take this method")
        .with_help("GET /openapi.json lists them all");
    ApiError::new(StatusCode::METHOD_NOT_ALLOWED, refusal)
}

/// A body of at most `limit` bytes, if it comes in time.
async fn receive(body: Body, limit: usize) -> ApiResult<axum::body::Bytes> {
    match tokio::time::timeout(BODY_WITHIN, to_bytes(body, limit)).await {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(error)) if is_too_long(&error) => Err(ApiError::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            Refusal::new("the request's body is too large")
                .expecting(format!("at most {limit} bytes")),
        )),
        Ok(Err(error)) => {
            Err(ApiError::malformed(format!("the request's body broke off: {error}"), "all of it"))
        }
        Err(_) => Err(ApiError::new(
            StatusCode::REQUEST_TIMEOUT,
            Refusal::new("the request's body took too long")
                .expecting(format!("all of it within {} s", BODY_WITHIN.as_secs())),
        )),
    }
}

fn is_too_long(error: &axum::Error) -> bool {
    std::error::Error::source(error)
        .is_some_and(<dyn std::error::Error>::is::<http_body_util::LengthLimitError>)
}

/// A small JSON body; none at all is the default.
async fn receive_json<T: DeserializeOwned + Default>(body: Body) -> ApiResult<T> {
    let bytes = receive(body, BODY_BYTES_MAX).await?;
    if bytes.is_empty() {
        return Ok(T::default());
    }
    serde_json::from_slice(&bytes).map_err(|error| {
        ApiError::malformed(format!("the request's body: {error}"), "JSON as in /openapi.json")
    })
}

impl<W> Desk<W> {
    /// Asks the conductor, which always answers.
    async fn order<T>(
        &self,
        make: impl FnOnce(tokio::sync::oneshot::Sender<Result<T, No>>) -> Order,
    ) -> ApiResult<T> {
        let (answer, answered) = tokio::sync::oneshot::channel();
        let ending = || ApiError::unavailable("the daemon is about to end");
        self.orders.send(make(answer)).await.map_err(|_| ending())?;
        Ok(answered.await.map_err(|_| ending())??)
    }
}

impl From<No> for ApiError {
    fn from(no: No) -> Self {
        match no {
            No::Disk(error) => Self::from(error),
            No::Limit(why) => Self::malformed(why, "a pose within the rig's limits"),
            No::Missing(id) => Self::missing(format!("there is no run {id}")),
            No::NotNow(why) => Self::conflict(why),
            No::Rig(why) => Self::new(StatusCode::BAD_GATEWAY, Refusal::new(why)),
            No::Stopping => Self::unavailable("the daemon is about to end"),
        }
    }
}

/// A success with its JSON.
type Answer<T> = ApiResult<Json<T>>;
