//! One device of a session: what it sends becomes samples and gaps of the sensors wired to it.
//!
//! | file | what it does |
//! | --- | --- |
//! | `state` | what is known of the device |
//! | `timing` | when its samples were measured, and when it should send |
//! | `frame`, `line`, `polled` | what its protocol hands on becomes samples and gaps |
//! | `said` | what it says to people |
//! | `count` | what came, and why nothing did |

pub(crate) mod count;
pub(crate) mod frame;
pub(crate) mod line;
pub(crate) mod polled;
pub(crate) mod said;
pub(crate) mod stamp;
pub(crate) mod state;
pub(crate) mod timing;

use std::time::Instant;

use crate::record::devices::queue::Input;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::state::Codec;

pub use crate::record::session::stream::state::{State, Stream};
pub use crate::record::session::stream::timing::ON_ITS_WAY;

/// Records what came.
///
/// # Errors
/// What makes a recording impossible before it has begun: a sensor on a column that the device lacks. Later it ends
/// this device's part.
pub fn take(stream: &mut Stream<'_>, input: Input, live: &mut Live<'_>) -> Result<(), RecordError> {
    match input {
        Input::Bytes { at_ns, bytes } => {
            stream.bytes += bytes.len() as u64;
            if stream.is_recorded() {
                decode(stream, at_ns, &bytes, live)?;
            }
        }
        Input::Polled(polled) => {
            if stream.is_recorded() {
                polled::record(stream, polled, live)?;
            }
        }
        Input::Said { at_ns, text } => stream.said.take(at_ns, text, live)?,
        Input::Vanished(why) => {
            if stream.device.port.command().is_some() {
                // what comes next is another process': nothing that it says is about what this one left unsaid
                finish(stream, live)?;
            }
            cut(stream);
            if matches!(stream.state, State::Open) {
                // one that came back and sent nothing has been away all along
                let before = stream.away.take().filter(|_| stream.timing.returned);
                let since = before.map_or_else(Instant::now, |(since, _)| since);
                stream.away = Some((since, why.clone()));
                stream.state = State::Vanished(since, why);
            }
        }
        Input::Back => {
            stream.reconnects += 1;
            stream.timing.returned = true;
            let is_command = stream.device.port.command().is_some();
            if is_command {
                stream.begin_anew();
            }
            if matches!(stream.state, State::Vanished(..)) {
                stream.state = State::Open;
                // a command that has never sent a sample does not gain time by dying
                if !(is_command && stream.is_empty()) {
                    stream.timing.last_message = Instant::now();
                }
            }
        }
        Input::Ended(why) => {
            finish(stream, live)?;
            cut(stream);
            if stream.state != State::Reached {
                stream.state = State::Ended(why);
            }
        }
    }
    Ok(())
}

/// No more will come: records what was held back until more would have come.
///
/// # Errors
/// As [`take`].
pub fn finish(stream: &mut Stream<'_>, live: &mut Live<'_>) -> Result<(), RecordError> {
    let last_message = stream.timing.last_message;
    hand_on_what_is_held(stream, live)?;
    stream.said.note(live)?;
    // It came when it came.
    stream.timing.last_message = last_message;
    Ok(())
}

fn hand_on_what_is_held(stream: &mut Stream<'_>, live: &mut Live<'_>) -> Result<(), RecordError> {
    match &mut stream.codec {
        Codec::Frames(decoder) => {
            let mut events = Vec::new();
            decoder.finish(&mut events);
            frame::record(stream, events, live)
        }
        Codec::Lines(decoder) => {
            let mut events = Vec::new();
            decoder.finish(&mut events);
            line::record(stream, events, live)
        }
        Codec::Polled(_) => Ok(()),
    }
}

/// The line was cut: what was on it is lost.
fn cut(stream: &mut Stream<'_>) {
    match &mut stream.codec {
        Codec::Frames(decoder) => decoder.cut(),
        Codec::Lines(decoder) => decoder.cut(),
        Codec::Polled(_) => stream.taps.iter_mut().for_each(|tap| tap.away = true),
    }
}

fn decode(stream: &mut Stream<'_>, at_ns: i64, bytes: &[u8], live: &mut Live<'_>) -> Result<(), RecordError> {
    match &mut stream.codec {
        Codec::Frames(decoder) => {
            let mut events = Vec::new();
            decoder.feed(at_ns, bytes, &mut events);
            frame::record(stream, events, live)?;
        }
        Codec::Lines(decoder) => {
            let mut events = Vec::new();
            let held = decoder.held();
            decoder.feed(at_ns, bytes, &mut events);
            // A line that is held back is a sign of life, and with the next one shows the device's rhythm as any other.
            if held > 0 && (decoder.held() > held || !events.is_empty()) {
                stream.timing.pause = stream.timing.pause.max(Some(stream.timing.last_message.elapsed()));
            }
            if decoder.held() > held {
                stream.timing.last_message = Instant::now();
            }
            line::record(stream, events, live)?;
        }
        Codec::Polled(_) => {}
    }
    Ok(())
}
