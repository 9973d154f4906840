//! Answers that every route may give.

use axum::body::Body;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{HeaderValue, Response, StatusCode};
use axum::response::IntoResponse;
use serde_json::{Value, json};

use crate::web::view::words::in_json;

/// What a request is answered with.
pub(crate) type Answer = Response<Body>;

/// JSON, whose sentences name options as the page does.
pub(crate) fn of_json(value: &Value) -> Answer {
    ([(CONTENT_TYPE, "application/json")], in_json(value.to_string())).into_response()
}

/// A refusal with its reason.
pub(crate) fn refusal(status: StatusCode, why: &str) -> Answer {
    let mut answer = of_json(&json!({ "error": why }));
    *answer.status_mut() = status;
    answer
}

/// A file to keep.
pub(crate) fn download(name: &str, kind: &'static str, content: impl IntoResponse) -> Answer {
    let mut answer = ([(CONTENT_TYPE, kind)], content).into_response();
    if let Ok(named) = HeaderValue::from_str(&format!("attachment; filename=\"{name}\"")) {
        answer.headers_mut().insert(CONTENT_DISPOSITION, named);
    }
    answer
}
