//! Devices that are polled: each answer is a sample, at the middle of request and answer.

use crate::record::clock::align::Stretch;
use crate::record::clock::device_clock::seconds;
use crate::record::devices::queue::Polled;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::state::{Codec, State, Stream};
use crate::recording::Gap;
use crate::rig::Protocol;

/// A sensor whose port was gone has lost nothing where its next sample comes within so many times the interval of its
/// polls.
const IN_TIME: f64 = 1.5;

/// Records what became of a poll.
pub(crate) fn record(stream: &mut Stream<'_>, polled: Polled, live: &mut Live<'_>) -> Result<(), RecordError> {
    if polled.values.iter().any(|(_, value)| value.is_some()) {
        stream.timing.sent_something(true);
        stream.timing.returned = false;
        live.begin(polled.at_ns)?;
    } else if !live.has_begun() {
        // Nothing is recorded yet, so nothing is lost.
        stream.before = polled.counts;
        // A refusal says more of why nothing comes than the silence after it.
        let before = if let Codec::Polled(Some(before)) = &stream.codec { before.refused } else { None };
        stream.codec = Codec::Polled(Some(Polled { refused: polled.refused.or(before), ..polled }));
        return Ok(());
    }
    let is_open = stream.state != State::Reached;
    let interval_s = match stream.device.protocol {
        Protocol::ModbusRtu { poll_interval_s, .. } => poll_interval_s,
        Protocol::Frames | Protocol::Lines { .. } => 0.0,
    };
    for &(index, number) in &polled.values {
        let limit_ns = stream.timing.limit_ns(live);
        let Some(tap) = stream.taps.get_mut(index) else { continue };
        let Some(number) = number else {
            tap.missed = true;
            stream.holes += u64::from(is_open);
            continue;
        };
        let time_ns = live.recording_ns(polled.at_ns);
        stream.timing.come_ns = Some(time_ns);
        if time_ns >= limit_ns {
            break;
        }
        let output = live.output()?;
        let late = |last_ns: i64| seconds(time_ns - last_ns) > IN_TIME * interval_s;
        let fell_out = std::mem::take(&mut tap.away) && !tap.missed && tap.last_ns.is_some_and(late);
        stream.holes += u64::from(fell_out);
        if let Some(last_ns) = tap.last_ns.filter(|_| tap.missed || fell_out) {
            let gap = Gap { from_s: seconds(last_ns), to_s: seconds(time_ns), samples: None };
            output.gap(tap.sensor, gap)?;
        }
        output.samples(tap.sensor, time_ns, 0.0, &[tap.scale * number + tap.offset])?;
        (tap.last_ns, tap.missed) = (Some(time_ns), false);
        match stream.timing.stretches.last_mut() {
            Some(stretch) => stretch.last_ns = time_ns,
            None => stream.timing.stretches.push(Stretch::of_host(time_ns, time_ns, live.zero_ns())),
        }
    }
    stream.codec = Codec::Polled(Some(polled));
    Ok(())
}
