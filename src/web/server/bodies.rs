//! Bodies of requests: each of a bounded size and read in a bounded time, the large ones one after the other.

use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::extract::Request;
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use tokio::sync::Semaphore;
use tokio::time::timeout;

use crate::web::server::answers::{Answer, refusal};

/// Where files come in.
const FILES: &str = "/api/import";
/// Most bytes of a file with its words, and how long they may take to come.
const FILE: (usize, Duration) = (64 << 20, Duration::from_secs(120));
/// The same of what asks for something.
const WORDS: (usize, Duration) = (256 << 10, Duration::from_secs(20));

/// A file takes several times its size while it is looked at.
static ONE_FILE: Semaphore = Semaphore::const_new(1);

/// Most bytes that a request to a path may have.
pub(crate) fn most_bytes(path: &str) -> usize {
    if path == FILES { FILE.0 } else { WORDS.0 }
}

/// Why a request is refused that is too long.
pub(crate) fn too_long(path: &str) -> Answer {
    let most = format!("a request to {path} may have {} kB", most_bytes(path) >> 10);
    refusal(StatusCode::PAYLOAD_TOO_LARGE, &most)
}

/// Reads the body before the request goes on.
pub(crate) async fn gather(request: Request, next: Next) -> Answer {
    if *request.method() != Method::POST {
        return next.run(request).await;
    }
    let path = request.uri().path().to_owned();
    let is_file = path == FILES;
    // held until the file has been taken; the semaphore is never closed
    let _turn = if is_file { ONE_FILE.acquire().await.ok() } else { None };
    let (most, time) = if is_file { FILE } else { WORDS };
    let (head, body) = request.into_parts();
    match timeout(time, to_bytes(body, most)).await {
        Ok(Ok(bytes)) => next.run(Request::from_parts(head, Body::from(bytes))).await,
        Ok(Err(_)) => too_long(&path),
        Err(_) => refusal(StatusCode::REQUEST_TIMEOUT, "the request came too slowly: send it again"),
    }
}
