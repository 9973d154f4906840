//! Who may come in: the right Host, the token, and for what changes something the page's own Origin.
//!
//! A page of another site can make a browser send requests here, and by a rebound name even read the answers. The Host
//! header tells such a name on every method, a GET of which carries no Origin. The token comes once in the address,
//! then as a cookie that scripts of the page cannot read and other sites do not send; programs send it as a bearer.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{
    AUTHORIZATION, CACHE_CONTROL, CONTENT_LENGTH, CONTENT_SECURITY_POLICY, CONTENT_TYPE, COOKIE, HOST, LOCATION,
    ORIGIN, REFERRER_POLICY, SET_COOKIE, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, Method, Response, StatusCode, header::HeaderName};
use axum::middleware::Next;

use crate::own_host::is_own_host;
use crate::web::server::answers::refusal;
use crate::web::server::bodies::{most_bytes, too_long};
use crate::web::server::listener::Admitted;

/// Bytes of a token.
const TOKEN: usize = 24;
/// What the page may load and run: its own files. Charts set sizes by script, which needs no exception.
const POLICY: &str =
    "default-src 'self'; img-src 'self' data: blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// See the module.
pub struct Guard {
    /// Where the server listens.
    pub address: SocketAddr,
    /// Who knows it may come in.
    pub token: String,
}

impl Guard {
    /// With a new token.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn new(address: SocketAddr) -> io::Result<Guard> {
        let mut bytes = [0; TOKEN];
        getrandom::fill(&mut bytes).map_err(|e| io::Error::other(e.to_string()))?;
        Ok(Guard { address, token: bytes.iter().map(|b| format!("{b:02x}")).collect() })
    }

    fn is_own_host(&self, host: &str) -> bool {
        is_own_host(host, self.address)
    }

    fn is_own_origin(&self, origin: &str) -> bool {
        origin.strip_prefix("http://").is_some_and(|host| self.is_own_host(host))
    }

    /// Cookies of one host are shared by its ports, so each server has a name of its own.
    fn cookie_name(&self) -> String {
        format!("surgescope_{}", self.address.port())
    }

    fn is_token(&self, text: &str) -> bool {
        // takes as long for a wrong token as for the right one
        let same = text.bytes().zip(self.token.bytes()).fold(0, |differs, (a, b)| differs | (a ^ b));
        text.len() == self.token.len() && same == 0
    }

    /// What a program sends.
    fn bearer(headers: &HeaderMap) -> Option<&str> {
        let (scheme, token) = headers.get(AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
        scheme.eq_ignore_ascii_case("bearer").then_some(token.trim())
    }

    fn may_enter(&self, headers: &HeaderMap) -> bool {
        let text = |name: &HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        let name = self.cookie_name();
        let cookie = text(&COOKIE).into_iter().flat_map(|all| all.split(';')).find_map(|one| {
            let (key, value) = one.trim().split_once('=')?;
            (key == name).then_some(value)
        });
        Guard::bearer(headers).or(cookie).is_some_and(|token| self.is_token(token))
    }

    /// Why a request is refused.
    fn refused(&self, request: &Request) -> Option<Response<Body>> {
        let headers = request.headers();
        let text = |name: &HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        if !text(&HOST).is_some_and(|host| self.is_own_host(host)) {
            let own = format!("this address is not the workbench's own: open http://{}/", self.address);
            return Some(refusal(StatusCode::FORBIDDEN, &own));
        }
        if text(&ORIGIN).is_some_and(|origin| !self.is_own_origin(origin)) {
            return Some(refusal(StatusCode::FORBIDDEN, "another site's page may not use the workbench"));
        }
        if !self.may_enter(headers) {
            let how = "the token is missing or wrong: open the address that `surgescope open` printed, or send Authorization: Bearer TOKEN";
            return Some(refusal(StatusCode::UNAUTHORIZED, how));
        }
        if *request.method() != Method::POST {
            return None;
        }
        // said at once, not when so much has been read
        let path = request.uri().path();
        if text(&CONTENT_LENGTH).and_then(|n| n.parse::<usize>().ok()).is_some_and(|n| n > most_bytes(path)) {
            return Some(too_long(path));
        }
        if Guard::bearer(headers).is_none() && headers.get(ORIGIN).is_none() {
            return Some(refusal(StatusCode::FORBIDDEN, "a POST of a page must say its Origin"));
        }
        let is_json = text(&CONTENT_TYPE)
            .and_then(|kind| kind.split(';').next())
            .is_some_and(|kind| kind.trim().eq_ignore_ascii_case("application/json"));
        (!is_json).then(|| refusal(StatusCode::UNSUPPORTED_MEDIA_TYPE, "send JSON (Content-Type: application/json)"))
    }

    /// The way in by the address that was printed: the token becomes a cookie and leaves the address.
    fn entrance(&self, request: &Request) -> Option<Response<Body>> {
        let host = request.headers().get(HOST)?.to_str().ok()?;
        let token = request.uri().query()?.split('&').find_map(|part| part.strip_prefix("token="))?;
        let enters = request.method() == Method::GET && request.uri().path() == "/";
        if !(enters && self.is_own_host(host) && self.is_token(token)) {
            return None;
        }
        let cookie = format!("{}={}; HttpOnly; SameSite=Strict; Path=/", self.cookie_name(), self.token);
        let mut response = Response::new(Body::empty());
        *response.status_mut() = StatusCode::SEE_OTHER;
        response.headers_mut().insert(LOCATION, HeaderValue::from_static("/"));
        response.headers_mut().insert(SET_COOKIE, HeaderValue::from_str(&cookie).ok()?);
        Some(response)
    }
}

/// Stands before every route.
pub(crate) async fn admit(State(guard): State<Arc<Guard>>, request: Request, next: Next) -> Response<Body> {
    let mut response = match guard.entrance(&request).or_else(|| guard.refused(&request)) {
        Some(answer) => answer,
        None => {
            if let Some(connection) = request.extensions().get::<Admitted>() {
                connection.admit();
            }
            next.run(request).await
        }
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.entry(CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}
