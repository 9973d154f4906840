//! What is recorded, handed on while it is: to whoever watches, never waiting for one.
//!
//! The recorder sees one bounded channel. It never blocks: whoever falls [`PACKETS`] behind loses the oldest, alone.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;
use tokio::sync::broadcast::{Receiver, Sender, WeakSender, channel};

use crate::recording::Gap;
use crate::rig::Rig;
use crate::storage::layout::kind_of;
use crate::storage::schema::Kind;

/// How long samples are gathered before they are handed on together.
const GATHER: Duration = Duration::from_millis(20);
/// So many are handed on at once, at the latest.
const PACKET_SAMPLES: usize = 16_384;
/// Most packets that wait for a watcher: five seconds, and 32 MiB for the fastest devices.
const PACKETS: usize = 256;

/// A channel of the recording: a sensor (index in the rig), and what its messages are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// Index in the rig.
    pub sensor: usize,
    /// What the messages are.
    pub kind: Kind,
}

impl Channel {
    /// Its place among all channels that sensors can have: three a sensor.
    pub fn index(self) -> usize {
        self.sensor * Kind::ALL.len() + self.kind as usize
    }

    /// The channel at a place.
    pub fn at(index: usize) -> Channel {
        Channel { sensor: index / Kind::ALL.len(), kind: Kind::ALL[index % Kind::ALL.len()] }
    }
}

/// Something that was recorded. Times are on the recording's clock, counted from `zero_unix_ns` of its packet.
#[derive(Debug, Clone)]
pub enum Event {
    /// Evenly spaced samples of a channel, in the sensor's unit.
    Samples {
        /// Samples or blocks of a sensor.
        channel: Channel,
        /// Time of the first, ns.
        first_ns: i64,
        /// From one to the next, ns.
        period_ns: f64,
        /// The values.
        values: Vec<f64>,
    },
    /// A gap.
    Gap {
        /// Gaps of a sensor.
        channel: Channel,
        /// What is missing.
        gap: Gap,
    },
}

impl Event {
    /// Its channel.
    pub fn channel(&self) -> Channel {
        match self {
            Event::Samples { channel, .. } | Event::Gap { channel, .. } => *channel,
        }
    }

    /// How many samples it has; a gap counts as one.
    pub fn count(&self) -> u64 {
        match self {
            Event::Samples { values, .. } => values.len() as u64,
            Event::Gap { .. } => 1,
        }
    }
}

/// What was recorded within a moment.
#[derive(Debug)]
pub struct Packet {
    /// Recording time 0, ns since 1970 UTC.
    pub zero_unix_ns: u64,
    /// In the order in which it was recorded.
    pub events: Vec<Event>,
    /// Samples of each channel since the beginning, by [`Channel::index`], with those of this packet: what a watcher
    /// has missed shows in it.
    pub totals: Vec<u64>,
}

/// Where recorders hand on what they record. It ends when all clones are gone.
#[derive(Debug, Clone)]
pub struct Feed(Sender<Arc<Packet>>);

impl Feed {
    /// A feed that nobody watches yet.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Feed {
        Feed(channel(PACKETS).0)
    }

    /// From where it can be watched.
    pub fn place(&self) -> Place {
        Place(self.0.downgrade())
    }
}

/// From where a feed can be watched; it does not keep the feed going.
#[derive(Debug, Clone)]
pub struct Place(WeakSender<Arc<Packet>>);

impl Place {
    /// Watches from now on; `None` once the feed has ended.
    pub fn watch(&self) -> Option<Receiver<Arc<Packet>>> {
        self.0.upgrade().map(|sender| sender.subscribe())
    }
}

/// How a feed was watched.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Watched {
    /// How many watched.
    pub clients: u64,
    /// Samples that did not reach one that had asked for them, because it was too slow.
    pub dropped: u64,
}

/// One recording's end of a feed.
#[derive(Debug)]
pub(crate) struct Tap {
    feed: Feed,
    gathered: Packet,
    samples: usize,
    since: Instant,
}

impl Tap {
    /// For a recording that begins at this time.
    pub(crate) fn new(feed: &Feed, rig: &Rig, zero_unix_ns: u64) -> Tap {
        let totals = vec![0; rig.sensors.len() * Kind::ALL.len()];
        let gathered = Packet { zero_unix_ns, events: Vec::new(), totals };
        Tap { feed: feed.clone(), gathered, samples: 0, since: Instant::now() }
    }

    /// As [`Output::samples`](crate::record::session::output::Output::samples).
    pub(crate) fn samples(&mut self, sensor: usize, first_ns: i64, period_ns: f64, values: &[f64]) {
        if !values.is_empty() {
            let channel = Channel { sensor, kind: kind_of(values.len(), period_ns) };
            self.samples += values.len();
            self.take(Event::Samples { channel, first_ns, period_ns, values: values.to_vec() });
        }
    }

    /// As [`Output::gap`](crate::record::session::output::Output::gap).
    pub(crate) fn gap(&mut self, sensor: usize, gap: Gap) {
        self.take(Event::Gap { channel: Channel { sensor, kind: Kind::Gap }, gap });
    }

    fn take(&mut self, event: Event) {
        if let Some(total) = self.gathered.totals.get_mut(event.channel().index()) {
            *total += event.count();
            self.gathered.events.push(event);
        }
        self.tick();
    }

    /// To be called often: hands on what was gathered, when it is time.
    pub(crate) fn tick(&mut self) {
        if self.samples >= PACKET_SAMPLES || self.since.elapsed() >= GATHER {
            self.hand_on();
        }
    }

    fn hand_on(&mut self) {
        (self.samples, self.since) = (0, Instant::now());
        if self.gathered.events.is_empty() {
            return;
        }
        let (zero_unix_ns, totals) = (self.gathered.zero_unix_ns, self.gathered.totals.clone());
        let packet = Packet { zero_unix_ns, totals, events: std::mem::take(&mut self.gathered.events) };
        // that nobody watches is no error
        let _ = self.feed.0.send(Arc::new(packet));
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.hand_on();
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::broadcast::error::TryRecvError;

    use super::*;

    const P: Channel = Channel { sensor: 0, kind: Kind::Sample };

    fn rig() -> Rig {
        Rig::from_toml(include_str!("../../../rigs/demo-hdpe.toml"), "demo-hdpe.toml").unwrap()
    }

    #[test]
    fn what_is_recorded_arrives_once_and_in_order_and_the_totals_count_it() {
        let feed = Feed::new();
        let (place, mut watcher) = (feed.place(), feed.place().watch().unwrap());
        let mut tap = Tap::new(&feed, &rig(), 7);
        tap.samples(0, 0, 1e6, &[1.0, 2.0]);
        tap.gap(0, Gap { from_s: 0.001, to_s: 0.5, samples: None });
        tap.samples(0, 500_000_000, 10_000.0, &[3.0, 4.0, 5.0]);
        drop((tap, feed));
        let mut events = Vec::new();
        let mut last = Vec::new();
        while let Ok(packet) = watcher.try_recv() {
            assert_eq!(packet.zero_unix_ns, 7);
            events.extend(packet.events.iter().map(|event| (event.channel(), event.count())));
            last.clone_from(&packet.totals);
        }
        let (blocks, gaps) = (Channel { sensor: 0, kind: Kind::Block }, Channel { sensor: 0, kind: Kind::Gap });
        assert_eq!(events, [(P, 2), (gaps, 1), (blocks, 3)], "100 kHz goes in blocks");
        assert_eq!((last[P.index()], last[blocks.index()], last[gaps.index()]), (2, 3, 1));
        assert_eq!(watcher.try_recv().unwrap_err(), TryRecvError::Closed);
        assert!(place.watch().is_none());
    }

    #[test]
    fn a_watcher_that_sleeps_loses_the_oldest_and_holds_nobody_up() {
        let feed = Feed::new();
        let mut sleeper = feed.place().watch().unwrap();
        let mut tap = Tap::new(&feed, &rig(), 0);
        let packets = PACKETS + 3;
        for i in 0..packets {
            tap.samples(0, i as i64 * 1_000_000_000, 1e3, &vec![0.5; PACKET_SAMPLES]);
        }
        drop((tap, feed));
        assert!(matches!(sleeper.try_recv(), Err(TryRecvError::Lagged(3))));
        let kept: Vec<_> = std::iter::from_fn(|| sleeper.try_recv().ok()).collect();
        let index = Channel { sensor: 0, kind: Kind::Block }.index();
        assert_eq!(kept.len(), PACKETS);
        assert_eq!(kept[PACKETS - 1].totals[index], (packets * PACKET_SAMPLES) as u64);
    }

    #[test]
    fn every_channel_has_a_place_of_its_own() {
        for index in 0..9 {
            assert_eq!(Channel::at(index).index(), index);
        }
    }
}
