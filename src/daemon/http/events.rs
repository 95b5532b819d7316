//! `GET /events`: what happened since, then what happens. Each event carries the number that the
//! queue's file gave it; numbers rise by one, so that a watcher sees when it missed something.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State};
use axum::http::HeaderMap;
use axum::response::sse::{Event, KeepAlive, Sse};
use serde::Deserialize;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use utoipa::IntoParams;

use super::Shared;
use super::body::ErrorBody;
use super::error::{ApiError, ApiResult};
use crate::daemon::book::Book;
use crate::daemon::notice::Notice;
use crate::daemon::workshop::Workshop;

/// Events read from the queue's file at a time, and those on the way to a watcher.
const PAGE: u32 = 256;
const ON_THE_WAY: usize = 64;
/// A comment now and then, so that a watcher that went away is noticed.
const SIGN_OF_LIFE: Duration = Duration::from_secs(15);

/// From which event on.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct After {
    /// The number of the last event that is known; 0 replays all that are kept (the latest
    /// 10,000). The header `Last-Event-ID` does the same.
    after: Option<i64>,
}

/// What happened after an event, and what happens from now on: server-sent events. `id` is the
/// event's number, `event` its kind, `data` its JSON.
#[utoipa::path(get, path = "/events",
params(After, ("Last-Event-ID" = Option<i64>, Header, description = "As `after`.")), responses(
    (status = 200, content_type = "text/event-stream", body = Notice),
    (status = 400, body = ErrorBody),
    (status = 503, description = "Too many watchers.", body = ErrorBody),
))]
pub(super) async fn events<W: Workshop>(
    State(desk): Shared<W>,
    headers: HeaderMap,
    after: Result<Query<After>, QueryRejection>,
) -> ApiResult<Sse<impl tokio_stream::Stream<Item = Result<Event, Infallible>>>> {
    let expected = "after=N, a whole number";
    let Query(After { after }) =
        after.map_err(|error| ApiError::malformed(error.body_text(), expected))?;
    // A browser that comes back names the last one in the header, with the address unchanged.
    let last = headers.get("last-event-id").and_then(|value| value.to_str().ok()?.parse().ok());
    let after = last.or(after).unwrap_or(0);
    let permit = Arc::clone(&desk.watchers)
        .try_acquire_owned()
        .map_err(|_| ApiError::unavailable("too many watchers"))?;
    let (sender, stream) = mpsc::channel(ON_THE_WAY);
    let (book, closing) = (desk.book.clone(), desk.closing.clone());
    tokio::spawn(async move {
        feed(&book, &closing, after, &sender).await;
        drop(permit);
    });
    let alive = KeepAlive::new().interval(SIGN_OF_LIFE);
    Ok(Sse::new(ReceiverStream::new(stream)).keep_alive(alive))
}

/// Ends when the watcher has gone, or when nothing more will happen.
async fn feed(
    book: &Book,
    closing: &CancellationToken,
    mut after: i64,
    watcher: &mpsc::Sender<Result<Event, Infallible>>,
) {
    let mut latest = book.latest();
    loop {
        // Asked before reading: what is noted meanwhile wakes us again.
        let is_last = closing.is_cancelled();
        latest.mark_unchanged();
        let Ok(page) = book.with(move |queue| queue.events_after(after, PAGE)).await else {
            return;
        };
        for (sequence, body) in &page {
            let kind = serde_json::from_str::<Notice>(body).map_or("", |notice| notice.kind.name());
            let event = Event::default().id(sequence.to_string()).event(kind).data(body);
            tokio::select! {
                biased;
                sent = watcher.send(Ok(event)) => if sent.is_err() { return },
                // A watcher that takes nothing must not keep the daemon.
                () = closing.cancelled(), if watcher.capacity() == 0 => return,
            }
            after = *sequence;
        }
        if !page.is_empty() {
            continue;
        }
        if is_last {
            return;
        }
        tokio::select! {
            biased;
            () = closing.cancelled() => {}
            () = watcher.closed() => return,
            changed = latest.changed() => if changed.is_err() { return },
        }
    }
}
