//! What pages hear while the session works.

use serde_json::{Value, json};
use tokio::sync::broadcast;

/// Events that a slow page may lag behind; it then asks for the state anew.
const KEPT: usize = 512;

/// One event.
#[derive(Debug, Clone)]
pub struct Event {
    /// Its name.
    pub name: &'static str,
    /// One line of JSON; none where it is what the session shows when the event is delivered.
    pub data: Option<String>,
}

/// Hands events to all who listen. Nobody waits for a listener.
pub struct Hub {
    sender: broadcast::Sender<Event>,
}

impl Default for Hub {
    fn default() -> Self {
        Hub { sender: broadcast::channel(KEPT).0 }
    }
}

impl Hub {
    /// Tells everybody.
    pub fn send(&self, name: &'static str, data: &Value) {
        // no listener is no error
        let _ = self.sender.send(Event { name, data: Some(data.to_string()) });
    }

    /// Tells everybody that another model is in force, or that it has been fitted.
    pub fn model(&self) {
        let _ = self.sender.send(Event { name: "model", data: None });
    }

    /// Tells everybody that a recording has come further.
    pub fn live(&self) {
        let _ = self.sender.send(Event { name: "live", data: None });
    }

    /// Tells everybody to ask for the state anew.
    pub fn changed(&self) {
        self.send("state", &json!({}));
    }

    /// Listens from now on.
    pub fn listen(&self) -> broadcast::Receiver<Event> {
        self.sender.subscribe()
    }

    /// How many listen.
    pub fn listeners(&self) -> usize {
        self.sender.receiver_count()
    }
}
