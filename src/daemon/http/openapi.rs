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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::super::routes;
    use super::*;
    use crate::daemon::{Checked, Finished, Prepared, Refusal};
    use crate::rig::Rig;

    struct Closed;

    impl Workshop for Closed {
        fn rig(&self) -> &Rig {
            unreachable!("nobody asks")
        }

        fn utc_now(&self) -> String {
            String::new()
        }

        fn check(&self, _: &[u8]) -> Result<Checked, Refusal> {
            Err(Refusal::default())
        }

        fn prepare(&self, _: &[u8], _: &Path) -> Result<Prepared, Refusal> {
            Err(Refusal::default())
        }

        fn finish(&self, _: &Path) -> Result<Finished, Refusal> {
            Err(Refusal::default())
        }
    }

    #[test]
    fn every_route_is_described_and_nothing_else() {
        let api = serde_json::to_value(Api::openapi()).unwrap();
        let mut described = BTreeSet::new();
        for (path, item) in api["paths"].as_object().unwrap() {
            for method in item.as_object().unwrap().keys() {
                described.insert((method.clone(), path.clone()));
            }
        }
        let served: BTreeSet<_> = routes::<Closed>()
            .iter()
            .map(|route| (route.method.to_owned(), route.path.to_owned()))
            .collect();
        assert_eq!(described, served);
    }

    #[test]
    fn every_reference_leads_somewhere() {
        let text = serde_json::to_string(&Api::openapi()).unwrap();
        let api: serde_json::Value = serde_json::from_str(&text).unwrap();
        let references = text.split("\"$ref\":\"#").skip(1);
        let mut count = 0;
        for reference in references.filter_map(|rest| rest.split('"').next()) {
            assert!(api.pointer(reference).is_some(), "{reference}");
            count += 1;
        }
        assert!(count > 20, "{count}");
    }
}
