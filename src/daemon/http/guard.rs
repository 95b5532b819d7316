//! What a browser must not do: a page from elsewhere may not move a rig, even though it runs on
//! the machine that the daemon trusts.
//!
//! A request over TCP must name a loopback host (a name that was re-bound to 127.0.0.1 is not
//! one), and one that comes from a page must come from this daemon's own.

use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::error::ApiError;
use crate::daemon::Refusal;

/// Lets through what may pass.
pub(super) async fn guard(is_tcp: bool, request: Request, next: Next) -> Response {
    match refuse(is_tcp, request.headers()) {
        Some(why) => {
            let expected = "a request from this machine, to a loopback address, from no other page";
            let refusal = Refusal::new(why).expecting(expected);
            ApiError::new(StatusCode::FORBIDDEN, refusal).into_response()
        }
        None => next.run(request).await,
    }
}

fn refuse(is_tcp: bool, headers: &HeaderMap) -> Option<String> {
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
    let host = text(header::HOST).unwrap_or_default();
    if is_tcp && !is_loopback(host) {
        return Some(format!("host {host:?} is not this daemon's"));
    }
    let origin = text(header::ORIGIN)?;
    let is_own = origin.split_once("://").is_some_and(|(_, of)| of == host);
    (!is_own).then(|| format!("origin {origin:?} is not this daemon's page"))
}

fn is_loopback(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    name == "localhost" || bare.parse().is_ok_and(|ip: std::net::IpAddr| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(is_tcp: bool, host: &str, origin: Option<&str>) -> bool {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        refuse(is_tcp, &headers).is_some()
    }

    #[test]
    fn only_loopback_hosts_pass_over_tcp() {
        for host in ["127.0.0.1:80", "localhost", "localhost:8080", "[::1]:80", "127.0.0.1"] {
            assert!(!refused(true, host, None), "{host}");
        }
        for host in ["rig.example.org", "rig.example.org:80", "192.168.1.7:80", ""] {
            assert!(refused(true, host, None), "{host}");
            assert!(!refused(false, host, None), "{host}");
        }
    }

    #[test]
    fn pages_from_elsewhere_may_not_ask() {
        assert!(!refused(true, "localhost:80", Some("http://localhost:80")));
        for origin in ["https://example.org", "http://localhost:81", "null"] {
            assert!(refused(true, "localhost:80", Some(origin)), "{origin}");
        }
    }
}
