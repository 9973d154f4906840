//! Who may come in: requests that name this server, and pages only of known origins.
//!
//! A browser lets the pages of every site open a WebSocket to this machine, and says whose page it is in the Origin
//! header. Programs that are no browser send none.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::extract::rejection::ExtensionRejection;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Extension, Request, State};
use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::any;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

use crate::live::protocol::{Catalogue, SUBPROTOCOLS};
use crate::live::watcher::Watcher;
use crate::own_host::{is_own_host, is_this_machine};
use crate::record::session::feed::{Place, Watched};

/// Pages that may watch beside those of this machine: Foxglove's web application, and the desktop applications, whose
/// page is a file.
pub const USUAL_ORIGINS: [&str; 2] = ["https://app.foxglove.dev", "file://"];

/// Most connections at a time.
const MOST: u32 = 16;
/// How long the head of a request may take.
const HEAD: Duration = Duration::from_secs(10);
/// How long nobody is let in after the system had no more to give.
const PAUSE: Duration = Duration::from_millis(200);
/// How long those who do not keep up are waited for at the end.
const GRACE: Duration = Duration::from_secs(2);
/// Most bytes of a request: a subscription to every channel of a large rig.
const REQUEST: usize = 256 << 10;
/// Most refused origins that it reports.
const TOLD: usize = 5;

type Tell = Box<dyn Fn(&str) + Send + Sync>;

/// See the module.
pub(crate) struct Door {
    address: SocketAddr,
    origins: Vec<String>,
    refused: Mutex<Vec<String>>,
    tell: Tell,
}

impl Door {
    pub(crate) fn new(address: SocketAddr, origins: Vec<String>, tell: Tell) -> Door {
        Door { address, origins, refused: Mutex::default(), tell }
    }

    /// Why a request is refused.
    fn refusal(&self, headers: &HeaderMap) -> Option<Response> {
        let host = headers.get(HOST).and_then(|host| host.to_str().ok());
        if !host.is_some_and(|host| is_own_host(host, self.address)) {
            let port = self.address.port();
            let how = format!("call this computer by its address, not by a name: ws://ADDRESS:{port}\n");
            return Some((StatusCode::FORBIDDEN, how).into_response());
        }
        let origin = headers.get(ORIGIN)?;
        let origin = origin.to_str().unwrap_or("of unreadable name");
        if self.lets_in(origin) {
            return None;
        }
        self.tell_once(origin);
        Some((StatusCode::FORBIDDEN, "pages of this origin may not watch the recording\n").into_response())
    }

    fn lets_in(&self, origin: &str) -> bool {
        let here = origin
            .split_once("://")
            .is_some_and(|(scheme, host)| ["http", "https"].contains(&scheme) && is_this_machine(host));
        let named = self.origins.iter().map(String::as_str).chain(USUAL_ORIGINS);
        here || named.into_iter().any(|known| known.eq_ignore_ascii_case(origin))
    }

    fn tell_once(&self, origin: &str) {
        let mut refused = self.refused.lock().unwrap_or_else(PoisonError::into_inner);
        if refused.len() < TOLD && !refused.iter().any(|known| known == origin) {
            refused.push(origin.to_owned());
            (self.tell)(origin);
        }
    }
}

/// What every request needs.
struct Hall {
    door: Door,
    catalogue: Arc<Catalogue>,
    place: Place,
    ended: watch::Receiver<bool>,
    clients: AtomicU64,
    dropped: AtomicU64,
}

/// The place that a connection takes up, as long as anything of it is there.
type Seat = Arc<OwnedSemaphorePermit>;

/// Serves on a listener until `ended` says so and everybody has gone.
pub(crate) async fn serve(
    listener: TcpListener,
    door: Door,
    catalogue: Arc<Catalogue>,
    place: Place,
    mut ended: watch::Receiver<bool>,
) -> Watched {
    let seats = Arc::new(Semaphore::new(MOST as usize));
    let (clients, dropped) = (AtomicU64::new(0), AtomicU64::new(0));
    let hall = Arc::new(Hall { door, catalogue, place, ended: ended.clone(), clients, dropped });
    let app = TowerToHyperService::new(Router::new().fallback(any(enter)).with_state(hall.clone()));
    let mut connections = JoinSet::new();
    tokio::select! {
        () = async {
            loop {
                // the semaphore is never closed
                let Ok(seat) = seats.clone().acquire_owned().await else { return };
                while connections.try_join_next().is_some() {}
                match listener.accept().await {
                    Ok((stream, _)) => drop(connections.spawn(connection(stream, app.clone(), Arc::new(seat)))),
                    Err(_) => sleep(PAUSE).await,
                }
            }
        } => {}
        _ = ended.wait_for(|ended| *ended) => {}
    }
    // who has only begun to ask gets no answer
    connections.shutdown().await;
    let _ = timeout(GRACE * 2, seats.acquire_many(MOST)).await;
    Watched { clients: hall.clients.load(Ordering::Relaxed), dropped: hall.dropped.load(Ordering::Relaxed) }
}

async fn connection(stream: TcpStream, app: TowerToHyperService<Router>, seat: Seat) {
    // messages are put together already
    let _ = stream.set_nodelay(true);
    let service = service_fn(move |mut request: hyper::Request<Incoming>| {
        request.extensions_mut().insert(seat.clone());
        app.call(request)
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEAD).keep_alive(false);
    // a connection that breaks off is its peer's affair
    let _ = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
}

async fn enter(
    State(hall): State<Arc<Hall>>,
    seat: Result<Extension<Seat>, ExtensionRejection>,
    socket: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
    request: Request,
) -> Response {
    if let Some(refusal) = hall.door.refusal(request.headers()) {
        return refusal;
    }
    // it is the server's own by now
    let host = request.headers().get(HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let how = format!(
        "a recording can be watched here: in Foxglove or Lichtblick, open a connection of the kind Foxglove WebSocket to ws://{host}\n"
    );
    let (Ok(socket), Ok(Extension(seat))) = (socket, seat) else {
        return (StatusCode::UPGRADE_REQUIRED, how).into_response();
    };
    let socket = socket.protocols(SUBPROTOCOLS).max_message_size(REQUEST).max_frame_size(REQUEST);
    if socket.selected_protocol().is_none() {
        return (StatusCode::BAD_REQUEST, format!("offer the subprotocol {}; {how}", SUBPROTOCOLS[0])).into_response();
    }
    let Some(packets) = hall.place.watch() else {
        return (StatusCode::GONE, "the recording is over\n").into_response();
    };
    socket.on_upgrade(move |socket| async move {
        hall.clients.fetch_add(1, Ordering::Relaxed);
        let mut ended = hall.ended.clone();
        let over = async move {
            let _ = ended.wait_for(|ended| *ended).await;
            sleep(GRACE).await;
        };
        let dropped = Watcher::new(socket, hall.catalogue.clone(), packets).serve(over).await;
        hall.dropped.fetch_add(dropped, Ordering::Relaxed);
        drop(seat);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn door(address: &str) -> Door {
        Door::new(address.parse().unwrap(), vec!["https://lab.example".into()], Box::new(|_| {}))
    }

    #[test]
    fn pages_of_known_origins_come_in_and_no_others() {
        let door = door("127.0.0.1:8765");
        for known in [
            "https://app.foxglove.dev",
            "file://",
            "http://localhost:8080",
            "http://127.0.0.1",
            "https://[::1]:8443",
            "https://lab.example",
        ] {
            assert!(door.lets_in(known), "{known}");
        }
        for strange in [
            "null",
            "",
            "https://evil.example",
            "https://app.foxglove.dev.evil.example",
            "https://app.foxglove.dev@evil.example",
            "http://localhost.evil.example",
            "http://127.0.0.1@evil.example",
            "http://127.0.0.1.evil.example",
            "ws://localhost",
            "file:///tmp/page.html",
            "http://lab.example",
        ] {
            assert!(!door.lets_in(strange), "{strange}");
        }
    }

    #[test]
    fn a_name_that_was_rebound_to_this_machine_is_refused_with_and_without_an_origin() {
        let door = door("127.0.0.1:8765");
        let refused = |host: &str| door.refusal(&HeaderMap::from_iter([(HOST, host.parse().unwrap())])).is_some();
        for own in ["127.0.0.1:8765", "localhost:8765", "[::1]:8765"] {
            assert!(!refused(own), "{own}");
        }
        for strange in ["evil.example:8765", "127.0.0.1:80", "localhost", "10.0.0.1:8765"] {
            assert!(refused(strange), "{strange}");
        }
        assert!(door.refusal(&HeaderMap::new()).is_some());
    }
}
