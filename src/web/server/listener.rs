//! Serves a bounded number of connections: a page that opens more waits. A connection that sends no request gives its
//! place back, and where all are taken, the oldest that has not shown the token makes room.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::AbortHandle;

/// Most connections at a time: six for each of fifty pages.
const MOST: usize = 300;
/// How long the head of a request may take, or be waited for.
const HEAD: Duration = Duration::from_secs(20);
/// Most bytes of a connection that wait for its reader, and of a request's head.
const BUFFER: usize = 64 << 10;
/// How long nobody is let in after the system had no more to give.
const PAUSE: Duration = Duration::from_millis(200);

/// Whether a connection has shown the token. Each of its requests carries this.
#[derive(Clone, Default)]
pub(crate) struct Admitted(Arc<AtomicBool>);

impl Admitted {
    /// It has.
    pub fn admit(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Serves an application on a listener.
pub(crate) async fn serve(listener: TcpListener, app: Router) {
    let places = Arc::new(Semaphore::new(MOST));
    let mut strangers: VecDeque<(Admitted, AbortHandle)> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        strangers.retain(|(admitted, task)| !admitted.0.load(Ordering::Relaxed) && !task.is_finished());
        if places.available_permits() == 0
            && let Some((_, oldest)) = strangers.pop_front()
        {
            oldest.abort();
        }
        // the semaphore is never closed
        let Ok(place) = places.clone().acquire_owned().await else { return };
        // small events should not wait for more to send
        let _ = stream.set_nodelay(true);
        let app = TowerToHyperService::new(app.clone());
        let admitted = Admitted::default();
        let carried = admitted.clone();
        let service = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(carried.clone());
            app.call(request)
        });
        let task = tokio::spawn(async move {
            let mut http = http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(HEAD).max_buf_size(BUFFER);
            // a connection that breaks off is its peer's affair
            let _ = http.serve_connection(TokioIo::new(stream), service).await;
            drop(place);
        });
        strangers.push_back((admitted, task.abort_handle()));
    }
}
