//! What pages hear while the session works.

use std::collections::VecDeque;
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::{Instant, timeout_at};

/// Events that a slow page may lag behind; it then asks for the state anew.
const KEPT: usize = 512;

/// How long the first word of a job's progress waits for others.
const BUNDLE: Duration = Duration::from_millis(100);

/// One event.
#[derive(Debug, Clone)]
pub struct Event {
    /// Its name.
    pub name: &'static str,
    /// One line of JSON; none where it is what the session shows when the event is delivered.
    pub data: Option<String>,
}

impl Event {
    fn changed() -> Event {
        Event { name: "state", data: Some(json!({}).to_string()) }
    }
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
        let _ = self.sender.send(Event::changed());
    }

    /// Listens from now on.
    pub fn listen(&self) -> Listener {
        Listener { receiver: self.sender.subscribe(), heard: VecDeque::new() }
    }

    /// How many listen.
    pub fn listeners(&self) -> usize {
        self.sender.receiver_count()
    }
}

/// One who listens.
pub struct Listener {
    receiver: broadcast::Receiver<Event>,
    heard: VecDeque<Event>,
}

impl Listener {
    /// The next event; none where nobody will send another. A fit tells hundreds of errors a second, and each would
    /// wake the page: progress comes in bundles. Whatever else happens is handed on at once, after what came before.
    pub async fn next(&mut self) -> Option<Event> {
        if self.heard.is_empty() {
            self.hear().await?;
            let until = Instant::now() + BUNDLE;
            while self.heard.back().is_some_and(|event| event.name == "progress") {
                // where nothing more comes, what has been heard is handed on all the same
                let Ok(Some(())) = timeout_at(until, self.hear()).await else { break };
            }
        }
        self.heard.pop_front()
    }

    async fn hear(&mut self) -> Option<()> {
        self.heard.push_back(match self.receiver.recv().await {
            Ok(event) => event,
            Err(RecvError::Lagged(_)) => Event::changed(),
            Err(RecvError::Closed) => return None,
        });
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn progress_waits_for_more_and_nothing_else_does() {
        let hub = Hub::default();
        let mut listener = hub.listen();
        let began = Instant::now();
        for step in 0..3 {
            hub.send("progress", &json!(step));
        }
        assert_eq!(listener.next().await.unwrap().data.unwrap(), "0");
        assert!(began.elapsed() >= BUNDLE);
        hub.model();
        let mut names = Vec::new();
        for _ in 0..3 {
            names.push(listener.next().await.unwrap().name);
        }
        assert_eq!(names, ["progress", "progress", "model"]);
        hub.send("progress", &json!(3));
        hub.model();
        let began = Instant::now();
        assert_eq!(listener.next().await.unwrap().name, "progress");
        assert!(began.elapsed() < BUNDLE, "the end of a fit waits for a bundle");
    }

    #[tokio::test]
    async fn one_that_lags_is_told_to_ask_anew_and_a_closed_hub_ends_the_stream() {
        let hub = Hub::default();
        let mut listener = hub.listen();
        for _ in 0..2 * KEPT {
            hub.model();
        }
        assert_eq!(listener.next().await.unwrap().name, "state");
        hub.send("progress", &json!(0));
        drop(hub);
        let mut last = None;
        while let Some(event) = listener.next().await {
            last = Some(event.name);
        }
        assert_eq!(last, Some("progress"));
    }
}
