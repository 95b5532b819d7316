//! `GET /openapi.json`: every route, its parameters, bodies and answers, as they are in the code.

use axum::extract::State;
use axum::response::Json;
use utoipa::OpenApi;

use super::{Shared, events, rig, runs};
use crate::daemon::workshop::Workshop;

#[derive(OpenApi)]
#[openapi(
    info(
        title = "gonio daemon",
        description = "The owner of a measurement rig: a queue of runs, hand drive, events. \
                       Angles are degrees, lengths millimetres, times seconds; every error is \
                       {error, expected?, help?}."
    ),
    paths(
        openapi_json,
        rig::status,
        runs::submit,
        runs::list,
        runs::show,
        runs::pause,
        runs::carry_on,
        runs::abort,
        runs::readings,
        runs::fit,
        rig::home,
        rig::jog,
        rig::read,
        events::events
    )
)]
struct Api;

/// This description.
#[utoipa::path(get, path = "/openapi.json", responses(
    (status = 200, description = "OpenAPI 3.1.", body = serde_json::Value),
))]
#[allow(dead_code)] // carries the description of the handler below
fn openapi_json() {}

pub(super) async fn openapi<W: Workshop>(State(_): Shared<W>) -> Json<utoipa::openapi::OpenApi> {
    Json(Api::openapi())
}
