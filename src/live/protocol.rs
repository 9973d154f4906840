//! The messages of Foxglove's protocol that a server needs which only shows:
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.

use std::time::{SystemTime, UNIX_EPOCH};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use prost::Message as _;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::record::session::feed::{Channel, Event};
use crate::recording::CsvFormat;
use crate::rig::Rig;
use crate::storage::layout::{offset_ns, to_ns};
use crate::storage::schema::{self, Block, Kind, Sample};
use crate::storage::sink::{metadata_of, program};

/// Names of the protocol, the one that is preferred first. They differ in nothing that is used here; older clients know
/// only the second.
pub(crate) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// What a message of samples begins with.
const MESSAGE_DATA: u8 = 1;

/// What a client asks for.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(crate) enum Request {
    /// To get the messages of channels.
    Subscribe {
        /// One a channel.
        subscriptions: Vec<Subscription>,
    },
    /// To get them no longer.
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        /// As the client named them.
        subscription_ids: Vec<u32>,
    },
    /// To publish, to set parameters, to call services and the like.
    #[serde(other)]
    Other,
}

/// A channel that a client asks for.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Subscription {
    /// The client's name for it.
    pub(crate) id: u32,
    /// The channel's number.
    pub(crate) channel_id: u64,
}

/// How grave a message to a client is.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Level {
    /// The client asked for what is not to be had.
    Warning = 1,
    /// What it sent is no request.
    Error = 2,
}

/// What the server can show.
pub(crate) struct Catalogue {
    info: String,
    /// By [`Channel::index`].
    channels: Vec<Value>,
}

impl Catalogue {
    /// Of a rig: the channels that its recording has, or may come to have; `csv` is as the recording keeps it.
    pub(crate) fn of(rig: &Rig, csv: Option<&CsvFormat>) -> Catalogue {
        let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let info = json!({
            "op": "serverInfo",
            "name": format!("{}, rig {}", program(), rig.name),
            "capabilities": [],
            "metadata": { "program": program(), "rig": rig.name },
            "sessionId": started.as_nanos().to_string(),
        });
        let schema = STANDARD.encode(schema::descriptor_set());
        let channel = |index| {
            let Channel { sensor, kind } = Channel::at(index);
            let (place, sensor) = (sensor, &rig.sensors[sensor]);
            json!({
                "id": index,
                "topic": kind.topic(&sensor.name),
                "encoding": "protobuf",
                "schemaName": kind.schema_name(),
                "schemaEncoding": "protobuf",
                "schema": schema,
                "metadata": metadata_of(place, sensor, csv),
            })
        };
        Catalogue { info: info.to_string(), channels: (0..rig.sensors.len() * Kind::ALL.len()).map(channel).collect() }
    }

    /// How many channels there can be.
    pub(crate) fn len(&self) -> usize {
        self.channels.len()
    }

    /// What a client hears first.
    pub(crate) fn info(&self) -> String {
        self.info.clone()
    }

    /// That there are these channels.
    pub(crate) fn advertise(&self, indices: &[usize]) -> String {
        let channels: Vec<&Value> = indices.iter().filter_map(|&index| self.channels.get(index)).collect();
        json!({ "op": "advertise", "channels": channels }).to_string()
    }
}

/// A message that the client shows its user.
pub(crate) fn status(level: Level, message: &str) -> String {
    json!({ "op": "status", "level": level as u8, "message": message }).to_string()
}

/// The messages of an event for a subscription, as they stand in the file; times of the event count from
/// `zero_unix_ns`.
pub(crate) fn messages(event: &Event, subscription: u32, zero_unix_ns: u64) -> Vec<Vec<u8>> {
    let message = |ns: i64, data: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = vec![MESSAGE_DATA];
        bytes.extend(subscription.to_le_bytes());
        bytes.extend(zero_unix_ns.saturating_add_signed(ns).to_le_bytes());
        data(&mut bytes);
        bytes
    };
    match event {
        Event::Samples { channel, first_ns, period_ns, values } if channel.kind == Kind::Block => {
            let block = Block { period_ns: Some(*period_ns), values: values.clone(), times_s: Vec::new() };
            vec![message(*first_ns, &|bytes| block.encode_raw(bytes))]
        }
        Event::Samples { first_ns, period_ns, values, .. } => {
            let sample = |(i, &value): (usize, &f64)| {
                let sample = Sample { value: Some(value), time_s: None };
                message(first_ns.saturating_add(offset_ns(i, *period_ns)), &|bytes| sample.encode_raw(bytes))
            };
            values.iter().enumerate().map(sample).collect()
        }
        Event::Gap { gap, .. } => {
            let lost = schema::Gap { from_s: Some(gap.from_s), to_s: Some(gap.to_s), samples: gap.samples };
            vec![message(to_ns(gap.to_s).unwrap_or_default(), &|bytes| lost.encode_raw(bytes))]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_a_message_as_the_protocol_lays_it_out() {
        let channel = Channel { sensor: 0, kind: Kind::Sample };
        let event = Event::Samples { channel, first_ns: 5, period_ns: 2.5, values: vec![1.0, 2.0] };
        let [first, second] = &messages(&event, 0x0102_0304, 1000)[..] else { panic!("two samples") };
        assert_eq!(first[..13], [1, 4, 3, 2, 1, 0xED, 3, 0, 0, 0, 0, 0, 0], "opcode, subscription, 1005 ns");
        assert_eq!(Sample::decode(&first[13..]).unwrap(), Sample { value: Some(1.0), time_s: None });
        assert_eq!(second[5..13], 1008_u64.to_le_bytes(), "to the nearest nanosecond, as in the file");
    }

    #[test]
    fn what_a_client_may_not_ask_for_is_told_from_what_is_no_request() {
        let read = |text| serde_json::from_str::<Request>(text);
        assert!(matches!(
            read(r#"{"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 2}]}"#),
            Ok(Request::Subscribe { subscriptions }) if subscriptions[0].id == 7 && subscriptions[0].channel_id == 2
        ));
        assert!(matches!(
            read(r#"{"op": "unsubscribe", "subscriptionIds": [7]}"#),
            Ok(Request::Unsubscribe { subscription_ids }) if subscription_ids == [7]
        ));
        assert!(matches!(read(r#"{"op": "setParameters", "parameters": []}"#), Ok(Request::Other)));
        assert!(read("{}").is_err() && read("[").is_err() && read(r#"{"op": "subscribe"}"#).is_err());
    }
}
