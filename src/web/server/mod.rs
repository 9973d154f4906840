//! The server: it binds an address, lets in who may come in, and serves until somebody stops it.

pub mod answers;
pub mod assets;
pub mod bodies;
pub mod guard;
pub mod listener;
pub mod routes;
pub mod runs;

use std::future::Future;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;

use crate::web::server::guard::Guard;
use crate::web::server::routes::router;
use crate::web::session::Session;

/// How often the server looks for new recordings and for what another program has written to the model file.
const LOOK: Duration = Duration::from_millis(700);

/// A server that is bound to its address.
pub struct Server {
    listener: TcpListener,
    guard: Guard,
}

impl Server {
    /// Binds an address; port 0 takes a free one.
    ///
    /// # Errors
    /// An address that is not this machine's, a port that is taken.
    pub async fn bind(address: IpAddr, port: u16) -> io::Result<Server> {
        let listener = TcpListener::bind(SocketAddr::new(address, port)).await?;
        let guard = Guard::new(listener.local_addr()?)?;
        Ok(Server { listener, guard })
    }

    /// Its address.
    pub fn address(&self) -> SocketAddr {
        self.guard.address
    }

    /// What a script sends as `Authorization: Bearer TOKEN`.
    pub fn token(&self) -> &str {
        &self.guard.token
    }

    /// The address to open in a browser, on this machine where it listens on all addresses.
    pub fn url(&self) -> String {
        let mut address = self.guard.address;
        match address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => address.set_ip(Ipv4Addr::LOCALHOST.into()),
            IpAddr::V6(ip) if ip.is_unspecified() => address.set_ip(Ipv6Addr::LOCALHOST.into()),
            _ => {}
        }
        format!("http://{address}/?token={}", self.guard.token)
    }

    /// Serves a session until `stop` is done.
    pub async fn serve(self, session: Arc<Session>, stop: impl Future<Output = ()>) {
        let outside = session.clone();
        let looks = tokio::spawn(async move {
            let mut every = tokio::time::interval(LOOK);
            loop {
                every.tick().await;
                let session = outside.clone();
                // a folder on a network may keep a look waiting, but no page
                let _ = tokio::task::spawn_blocking(move || session.look()).await;
            }
        });
        let app = router(session, Arc::new(self.guard), runs::routes());
        // Pages keep their stream of events open, so nobody waits for them to close.
        tokio::select! {
            () = listener::serve(self.listener, app) => {}
            () = stop => {}
        }
        looks.abort();
    }
}
