//! One client. It gets what it asked for as fast as it reads; what it does not read in time it does not get, and that
//! is counted.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::SinkExt as _;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::{RecvError, TryRecvError};
use tokio::time::timeout;

use crate::live::protocol::{Catalogue, Level, Request, messages, status};
use crate::record::session::feed::Packet;

/// A client that takes nothing for so long is left: it makes room for another.
const STALLED: Duration = Duration::from_secs(20);

/// See the module.
pub(crate) struct Watcher {
    socket: WebSocket,
    catalogue: Arc<Catalogue>,
    packets: Receiver<Arc<Packet>>,
    /// Samples of each channel up to the last packet that was looked at; a channel that has some is advertised.
    totals: Vec<u64>,
    subscribed: Vec<Option<Subscribed>>,
    dropped: u64,
}

/// A channel that the client has asked for.
struct Subscribed {
    /// The client's name for it.
    id: u32,
    /// The channel's samples when it asked.
    from: u64,
    /// What it was given since.
    sent: u64,
}

/// Why nothing more is sent to a client.
#[derive(Debug, PartialEq)]
enum Left {
    /// It has all, or wants no more.
    Content,
    /// It takes nothing.
    Stalled,
}

impl Watcher {
    /// That watches from now on.
    pub(crate) fn new(socket: WebSocket, catalogue: Arc<Catalogue>, packets: Receiver<Arc<Packet>>) -> Watcher {
        let channels = catalogue.len();
        let subscribed = std::iter::repeat_with(|| None).take(channels).collect();
        Watcher { socket, catalogue, packets, totals: vec![0; channels], subscribed, dropped: 0 }
    }

    /// Serves the client until it leaves or the feed ends, and no longer than until `over`. Returns how many samples it
    /// did not get.
    pub(crate) async fn serve(mut self, over: impl Future<Output = ()>) -> u64 {
        let left = tokio::select! {
            left = self.run() => left,
            () = over => Left::Stalled,
        };
        if left == Left::Stalled {
            // all that waits for it
            loop {
                match self.packets.try_recv() {
                    Ok(packet) => self.totals.clone_from(&packet.totals),
                    Err(TryRecvError::Lagged(_)) => {}
                    Err(TryRecvError::Empty | TryRecvError::Closed) => break,
                }
            }
        }
        (0..self.subscribed.len()).for_each(|index| self.forget(index));
        self.dropped
    }

    async fn run(&mut self) -> Left {
        let info = self.catalogue.info();
        if self.say(info).await.is_err() {
            return Left::Content;
        }
        loop {
            tokio::select! {
                message = self.socket.recv() => match message {
                    Some(Ok(Message::Text(text))) => {
                        if self.hear(&text).await.is_err() {
                            return Left::Content;
                        }
                    }
                    Some(Ok(Message::Binary(_))) => {
                        if self.refuse(Level::Warning, READ_ONLY).await.is_err() {
                            return Left::Content;
                        }
                    }
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return Left::Content,
                },
                packet = self.packets.recv() => match packet {
                    Ok(packet) => match timeout(STALLED, self.show(&packet)).await {
                        Ok(Ok(())) => {}
                        Ok(Err(_)) => return Left::Content,
                        Err(_) => {
                            self.totals.clone_from(&packet.totals);
                            return Left::Stalled;
                        }
                    },
                    // the totals of the next packet tell what was missed
                    Err(RecvError::Lagged(_)) => {}
                    Err(RecvError::Closed) => {
                        self.part().await;
                        return Left::Content;
                    }
                },
            }
        }
    }

    /// Sends what of a packet the client has asked for, and advertises channels that are new.
    async fn show(&mut self, packet: &Packet) -> Result<(), axum::Error> {
        let channels = packet.totals.iter().zip(&self.totals).enumerate();
        let new: Vec<usize> =
            channels.filter(|(_, (now, before))| **now > 0 && **before == 0).map(|(index, _)| index).collect();
        if !new.is_empty() {
            self.socket.feed(self.catalogue.advertise(&new).into()).await?;
        }
        for event in &packet.events {
            let Some(Some(Subscribed { id, .. })) = self.subscribed.get(event.channel().index()) else { continue };
            for message in messages(event, *id, packet.zero_unix_ns) {
                self.socket.feed(Message::Binary(message.into())).await?;
            }
        }
        self.socket.flush().await?;
        for event in &packet.events {
            if let Some(Some(subscribed)) = self.subscribed.get_mut(event.channel().index()) {
                subscribed.sent += event.count();
            }
        }
        self.totals.clone_from(&packet.totals);
        Ok(())
    }

    async fn hear(&mut self, text: &str) -> Result<(), axum::Error> {
        match serde_json::from_str(text) {
            Ok(Request::Subscribe { subscriptions }) => {
                for wanted in subscriptions {
                    let index = usize::try_from(wanted.channel_id).unwrap_or(usize::MAX);
                    let from = self.totals.get(index).copied().unwrap_or_default();
                    match self.subscribed.get_mut(index) {
                        Some(free @ None) if from > 0 => *free = Some(Subscribed { id: wanted.id, from, sent: 0 }),
                        Some(Some(_)) => self.refuse(Level::Warning, "this channel is subscribed to already").await?,
                        _ => self.refuse(Level::Warning, "there is no such channel").await?,
                    }
                }
                Ok(())
            }
            Ok(Request::Unsubscribe { subscription_ids }) => {
                for index in 0..self.subscribed.len() {
                    if self.subscribed[index].as_ref().is_some_and(|known| subscription_ids.contains(&known.id)) {
                        self.forget(index);
                    }
                }
                Ok(())
            }
            Ok(Request::Other) => self.refuse(Level::Warning, READ_ONLY).await,
            Err(_) => self.refuse(Level::Error, "this is no request of Foxglove's WebSocket protocol").await,
        }
    }

    /// Ends a subscription, and counts what it lacks.
    fn forget(&mut self, index: usize) {
        if let Some(known) = self.subscribed[index].take() {
            self.dropped += self.totals[index].saturating_sub(known.from + known.sent);
        }
    }

    async fn refuse(&mut self, level: Level, why: &str) -> Result<(), axum::Error> {
        self.say(status(level, why)).await
    }

    /// Sends a text, unless the client takes nothing.
    async fn say(&mut self, text: String) -> Result<(), axum::Error> {
        timeout(STALLED, self.socket.send(text.into())).await.unwrap_or_else(|late| Err(axum::Error::new(late)))
    }

    /// Says that the recording is over, and waits for the client to have heard it: a socket that is closed before loses
    /// what is on its way.
    async fn part(&mut self) {
        let frame = CloseFrame { code: close_code::AWAY, reason: "the recording is over".into() };
        if self.socket.send(Message::Close(Some(frame))).await.is_ok() {
            while let Some(Ok(_)) = self.socket.recv().await {}
        }
    }
}

const READ_ONLY: &str = "surgescope only shows what it records: it takes no messages, parameters or calls";
