//! How the API says no: a status, and a JSON body that says what, what was expected, and what to
//! do about it.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};

use super::body::ErrorBody;
use crate::daemon::Refusal;
use crate::journal::JournalError;

/// An answer that is not a success.
#[derive(Debug)]
pub(crate) struct ApiError {
    status: StatusCode,
    refusal: Refusal,
}

/// What handlers answer.
pub(super) type ApiResult<T> = Result<T, ApiError>;

impl ApiError {
    pub(crate) fn new(status: StatusCode, refusal: Refusal) -> Self {
        Self { status, refusal }
    }

    /// The request makes no sense.
    pub(super) fn malformed(what: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, Refusal::new(what).expecting(expected))
    }

    /// There is no such thing.
    pub(crate) fn missing(what: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, Refusal::new(what))
    }

    /// Not in this state.
    pub(crate) fn conflict(why: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, Refusal::new(why))
    }

    /// The daemon is about to end, or too busy.
    pub(crate) fn unavailable(why: impl Into<String>) -> Self {
        Self::new(StatusCode::SERVICE_UNAVAILABLE, Refusal::new(why))
    }
}

impl From<JournalError> for ApiError {
    fn from(error: JournalError) -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::new(error.to_string()))
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let Refusal { error, expected, help } = self.refusal;
        (self.status, Json(ErrorBody { error, expected, help })).into_response()
    }
}
