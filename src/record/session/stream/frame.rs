//! Devices that send frames: each a block of samples of all channels, a stated period apart.

use crate::record::clock::device_clock::Missing;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::stamp::Stamp;
use crate::record::session::stream::state::{Codec, Stream};
use crate::record::session::stream::timing::Sign;
use crate::record::wire::frames::{Event, Taken};

/// Records what the decoder handed on.
pub(crate) fn record(stream: &mut Stream<'_>, events: Vec<Event>, live: &mut Live<'_>) -> Result<(), RecordError> {
    for event in events {
        match event {
            Event::Restarted => stream.timing.restarted = true,
            Event::Frame(taken) => {
                let restarts = stream.timing.stretches.len();
                frame(stream, &taken, live)?;
                if restarts > 0 && stream.timing.stretches.len() > restarts {
                    not_lost(stream, taken.lost_before);
                }
            }
        }
    }
    Ok(())
}

/// What the sequence says is missing before a restart is another sequence's.
fn not_lost(stream: &mut Stream<'_>, frames: u32) {
    if let Codec::Frames(decoder) = &mut stream.codec {
        decoder.not_lost(frames);
    }
}

fn frame(stream: &mut Stream<'_>, taken: &Taken, live: &mut Live<'_>) -> Result<(), RecordError> {
    let &Taken { ref frame, lost_before: lost, began_ns, anew, jump, hole_from_ns } = taken;
    let sign = if anew { Sign::Sequence } else { Sign::None };
    stream.timing.sent_something(lost == 0);
    if !stream.check_columns(usize::from(frame.channels()), live)? {
        return Ok(());
    }
    let (period_ns, rows) = (frame.period_ns(), frame.samples());
    let device_ns = (frame.first_us() * 1000) as i64;
    // A frame is sent when its last sample was taken; its first is that much older.
    let sent_ns = device_ns.saturating_add(i64::from(period_ns).saturating_mul(rows as i64));
    let end_before_ns = stream.timing.clock.map_or(0, |clock| clock.end_ns());
    let stamp = Stamp { device_ns, sent_ns, began_ns, period_ns: i64::from(period_ns), rows, lost, jump };
    let clock = stream.timing.begin(&stamp, sign, live)?;
    let missing = if lost > 0 { Missing::Surely } else { Missing::From(hole_from_ns) };
    let placed = clock.place(device_ns, period_ns, rows, missing);
    let (last_ns, now_ns) = (clock.last_ns().unwrap_or_default(), clock.end_ns());
    stream.timing.arrived(&stamp, last_ns, now_ns);
    let limit_ns = stream.timing.limit_ns(live);
    let left_ns = limit_ns.saturating_sub(placed.first_ns).max(0) as f64;
    let wanted = ((left_ns / placed.period_ns).ceil() as usize).min(rows);
    let gap = placed.gap.filter(|_| stream.timing.is_wanted(end_before_ns, live));
    stream.holes += u64::from(gap.is_some());
    let output = live.output()?;
    for tap in &stream.taps {
        if let Some(gap) = gap {
            output.gap(tap.sensor, gap)?;
        }
        stream.values.clear();
        let counts = frame.channel(tap.column).take(wanted);
        stream.values.extend(counts.map(|count| tap.scale * f64::from(count) + tap.offset));
        if wanted > 0 {
            output.samples(tap.sensor, placed.first_ns, placed.period_ns, &stream.values)?;
        }
    }
    Ok(())
}
