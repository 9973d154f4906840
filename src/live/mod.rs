//! What is recorded, over Foxglove's WebSocket protocol while it is: the channels, schemas and messages of the file,
//! for Foxglove, Lichtblick and scripts. Nobody can do anything here but watch.
//!
//! Foxglove's own crate is not used: it checks no Origin, and the only way to check it in front of it, a second port on
//! this machine, would be open to every page itself. Nor does it count what it drops.

mod door;
mod protocol;
mod watcher;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use tokio::sync::watch;

use crate::live::door::Door;
use crate::live::protocol::Catalogue;
use crate::record::session::feed::{Place, Watched};
use crate::recording::CsvFormat;
use crate::rig::Rig;

pub use crate::live::door::USUAL_ORIGINS;

/// A server on a thread of its own.
pub struct Server {
    address: SocketAddr,
    ending: watch::Sender<bool>,
    thread: JoinHandle<Watched>,
}

impl Server {
    /// Serves what is recorded of a rig at `place`; `csv` is how the time series was written, where it was imported.
    /// Pages of `origins` may watch beside [`USUAL_ORIGINS`] and those of this machine; `tell` hears once of each other
    /// origin that was refused.
    ///
    /// # Errors
    /// An address that is not this machine's, a port that is taken.
    pub fn start(
        address: SocketAddr,
        (rig, csv): (&Rig, Option<&CsvFormat>),
        place: Place,
        origins: Vec<String>,
        tell: impl Fn(&str) + Send + Sync + 'static,
    ) -> io::Result<Server> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (ending, ended) = watch::channel(false);
        let door = Door::new(address, origins, Box::new(tell));
        let catalogue = Arc::new(Catalogue::of(rig, csv));
        let serve = move || {
            runtime.block_on(async {
                match tokio::net::TcpListener::from_std(listener) {
                    Ok(listener) => door::serve(listener, door, catalogue, place, ended).await,
                    Err(_) => Watched::default(),
                }
            })
        };
        Ok(Server { address, ending, thread: Builder::new().name("live".into()).spawn(serve)? })
    }

    /// Its address.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// To be called when the feed has ended. Those who keep up get the rest first; others are not waited for longer
    /// than two seconds.
    pub fn finish(self) -> Watched {
        let _ = self.ending.send(true);
        self.thread.join().unwrap_or_default()
    }
}
