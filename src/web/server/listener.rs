//! Serves a bounded number of connections: a page that opens more waits, and so does a hostile one. A connection that sends no request gives its
//! place back.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// Most connections at a time: six for each of fifty pages.
const MOST: usize = 300;
/// How long the head of a request may take, or be waited for.
const HEAD: Duration = Duration::from_secs(20);
/// Most bytes of a connection that wait for its reader, and of a request's head.
const BUFFER: usize = 64 << 10;
/// How long nobody is let in after the system had no more to give.
const PAUSE: Duration = Duration::from_millis(200);

/// Serves an application on a listener.
pub(crate) async fn serve(listener: TcpListener, app: Router) {
    let places = Arc::new(Semaphore::new(MOST));
    // the semaphore is never closed
    while let Ok(place) = places.clone().acquire_owned().await {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        // small events should not wait for more to send
        let _ = stream.set_nodelay(true);
        let app = TowerToHyperService::new(app.clone());
        tokio::spawn(async move {
            let mut http = http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(HEAD).max_buf_size(BUFFER);
            // a connection that breaks off is its peer's affair
            let _ = http.serve_connection(TokioIo::new(stream), app).await;
            drop(place);
        });
    }
}
