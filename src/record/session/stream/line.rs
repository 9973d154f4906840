//! Devices that send lines: each a row of values with its own time.

use crate::record::clock::device_clock::seconds;
use crate::record::clock::time_unit::Runs;
use crate::record::error::RecordError;
use crate::record::session::session_log::Live;
use crate::record::session::stream::stamp::Stamp;
use crate::record::session::stream::state::Stream;
use crate::record::session::stream::timing::Sign;
use crate::record::wire::lines::{Event, Line};
use crate::recording::Gap;
use crate::rig::Protocol;

/// Records what the decoder handed on.
pub(crate) fn record(stream: &mut Stream<'_>, events: Vec<Event>, live: &mut Live<'_>) -> Result<(), RecordError> {
    for event in events {
        match event {
            Event::Restarted => stream.timing.restarted = true,
            Event::Line(taken) => line(stream, &taken, live)?,
            Event::Hole { from_us, to_us } => hole(stream, from_us, to_us, live)?,
        }
    }
    Ok(())
}

fn line(stream: &mut Stream<'_>, line: &Line, live: &mut Live<'_>) -> Result<(), RecordError> {
    stream.timing.sent_something(!line.hole_before);
    if !stream.check_columns(line.values.len(), live)? {
        return Ok(());
    }
    let device_ns = (line.time_us * 1000) as i64;
    let sign = if line.hole_before { Sign::Hole } else { Sign::None };
    let (sent_ns, began_ns) = (device_ns, line.began_ns);
    let stamp = Stamp { device_ns, sent_ns, began_ns, period_ns: 0, rows: 1, lost: 0, jump: None };
    let clock = stream.timing.begin(&stamp, sign, live)?;
    let Some(placed) = clock.place_row(device_ns, line.hole_before) else { return Ok(()) };
    if stream.timing.arrived(&stamp, placed.first_ns, placed.first_ns) {
        check_unit(stream, false, live)?;
    }
    if placed.first_ns >= stream.timing.limit_ns(live) {
        return Ok(());
    }
    let wanted = stream.timing.is_wanted(placed.first_ns, live);
    stream.holes += u64::from(placed.gap.is_some() && wanted);
    let output = live.output()?;
    let now_ns = placed.first_ns;
    for tap in &mut stream.taps {
        let value = line.values.get(tap.column).copied().flatten().map(|value| tap.scale * value + tap.offset);
        let Some(value) = value.filter(|value| value.is_finite()) else {
            tap.missed = true;
            stream.holes += u64::from(wanted);
            continue;
        };
        let missed = std::mem::take(&mut tap.missed);
        if let Some(last_ns) = tap.last_ns.filter(|_| missed || placed.gap.is_some()) {
            output.gap(tap.sensor, Gap { from_s: seconds(last_ns), to_s: seconds(now_ns), samples: None })?;
        }
        output.samples(tap.sensor, now_ns, 0.0, &[value])?;
        tap.last_ns = Some(now_ns);
    }
    Ok(())
}

/// Calls out times that are likely in another unit; `is_over` where no more will come.
pub(crate) fn check_unit(stream: &Stream<'_>, is_over: bool, live: &mut Live<'_>) -> Result<(), RecordError> {
    let Protocol::Lines { time_unit } = stream.device.protocol else { return Ok(()) };
    if live.has_begun()
        && let Some(likely) = stream.timing.pace.as_ref().and_then(|pace| pace.likely(time_unit, is_over))
    {
        let monitor = &mut live.output()?.monitor;
        stream.sensors().for_each(|sensor| monitor.likely_unit(sensor, (time_unit, likely)));
    }
    Ok(())
}

/// What to say of times that do not run as they arrive, but for those in a unit that [`check_unit`] names.
pub(crate) fn clock_is_off(stream: &Stream<'_>, runs: Runs) -> Option<(f64, f64)> {
    let Runs::Off { times, within } = runs else { return None };
    let is_named = match stream.device.protocol {
        Protocol::Lines { time_unit } => stream.timing.pace.as_ref()?.likely(time_unit, true).is_some(),
        Protocol::Frames | Protocol::ModbusRtu { .. } => false,
    };
    (!is_named).then_some((times, within))
}

/// Lines that were taken have a hole between them.
fn hole(stream: &mut Stream<'_>, from_us: u64, to_us: u64, live: &mut Live<'_>) -> Result<(), RecordError> {
    let Some(clock) = stream.timing.clock else { return Ok(()) };
    let [from_ns, to_ns] = [from_us, to_us].map(|time_us| clock.at_ns((time_us * 1000) as i64));
    stream.holes += u64::from(stream.timing.is_wanted(from_ns, live));
    let gap = Gap { from_s: seconds(from_ns), to_s: seconds(to_ns), samples: None };
    stream.taps.iter().try_for_each(|tap| live.output()?.gap(tap.sensor, gap))
}
