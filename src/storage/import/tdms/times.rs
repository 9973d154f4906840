//! When the values of a channel were taken: by its own properties, by a channel of times beside it, or by a rate.

use std::collections::BTreeMap;

use crate::storage::import::arrays::times::{rest_of_name, rises, seconds, unit_in_name};
use crate::storage::import::csv::heading::time_unit;
use crate::storage::import::source::{Repair, SourceOptions};
use crate::storage::import::tdms::channel::{Channel, Timing, Values};
use crate::storage::import::tdms::property::{Properties, Property};
use crate::storage::import::tdms::segment::names as names_of;
use crate::storage::layout::to_s;

/// Times of a channel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Times {
    /// Seconds from its own start.
    pub time_s: Vec<f64>,
    /// That start, nanoseconds since 1970 UTC.
    pub start_ns: Option<i64>,
    /// The last time before each hole between its stretches, s from its start.
    pub holes_s: Vec<f64>,
}

fn timing(channel: &Channel, properties: &BTreeMap<String, Properties>) -> Option<Timing> {
    properties.get(&channel.path).map(Timing::of)
}

/// Whether a channel holds the times of others, and has none of its own.
pub(crate) fn is_times(channel: &Channel, properties: &BTreeMap<String, Properties>) -> bool {
    let has_step = timing(channel, properties).is_some_and(|timing| timing.increment_s.is_some());
    !has_step && given(channel, properties).is_some()
}

/// The times of a channel, whose properties and those of what stands around it are a `chain`; none where nothing says
/// them. What was chosen is added to `repairs`.
pub(crate) fn times_of(
    channel: &Channel,
    all: &[Channel],
    properties: &BTreeMap<String, Properties>,
    chain: &[&Properties],
    options: &SourceOptions,
    repairs: &mut Vec<Repair>,
) -> Result<Option<Times>, String> {
    let own = timing(channel, properties);
    let count = channel.values.len();
    if let Some(last) = own.filter(|timing| timing.increment_s.is_some()) {
        return evenly(channel, last, count).map(Some);
    }
    let group = |path: &str| names_of(path).into_iter().next();
    let is_beside =
        |c: &&Channel| c.path != channel.path && c.values.len() == count && group(&c.path) == group(&channel.path);
    let place = |path: &str| all.iter().position(|c| c.path == path);
    let beside = all.iter().filter(is_beside).filter_map(|c| Some((c.path.as_str(), given(c, properties)?)));
    let mut beside: Vec<(&str, Times)> = beside.collect();
    if !beside.is_empty() {
        // in tables the times stand before what belongs to them
        let before = beside.iter().rposition(|(path, _)| place(path) < place(&channel.path)).unwrap_or_default();
        if beside.iter().any(|(_, times)| *times != beside[0].1) {
            let text = format!("the times of {} are {}", channel.path, beside[before].0);
            repairs.push(Repair::guess("times-of", text));
        }
        return Ok(Some(beside.swap_remove(before).1));
    }
    let rate = || Some((1.0 / options.rate_hz?, "option `rate`".to_owned()));
    let Some((step_s, by)) = chain.iter().find_map(|p| stated_step(p)).or_else(rate) else { return Ok(None) };
    repairs.push(Repair::new("step", 1, None, format!("{} has a sample every {step_s} s, by {by}", channel.path)));
    let time_s = (0..count).map(|i| i as f64 * step_s).collect();
    Ok(Some(Times { time_s, start_ns: own.and_then(|timing| timing.start_ns), holes_s: Vec::new() }))
}

/// A step or a rate among properties, such as `Sample Rate`, in s, and where it stands.
fn stated_step(properties: &Properties) -> Option<(f64, String)> {
    properties.iter().find_map(|(key, value)| match value {
        Property::Number(number) => Some((seconds(key, *number, None)?, format!("'{key}'"))),
        _ => None,
    })
}

/// Those of a channel of even steps.
fn evenly(channel: &Channel, last: Timing, count: usize) -> Result<Times, String> {
    // properties behind the last value, or twice between two values, begin no stretch
    let mut stretches: Vec<(usize, Timing)> = channel.earlier.iter().copied().filter(|(to, _)| *to < count).collect();
    stretches.dedup_by_key(|(to, _)| *to);
    stretches.push((count, last));
    let start_ns = stretches[0].1.start_ns;
    let (mut time_s, mut holes_s) = (Vec::with_capacity(count), Vec::new());
    for (index, (to, timing)) in stretches.into_iter().enumerate() {
        let from = time_s.len();
        let step_s = timing.increment_s.filter(|_| index == 0 || (timing.start_ns.is_some() && start_ns.is_some()));
        let step_s = step_s.ok_or_else(|| {
            format!(
                "channel {}: its wf_increment changes at value {from}, and no wf_start_time gives the time of that value",
                channel.path
            )
        })?;
        let late_s = timing.start_ns.zip(start_ns).map_or(0.0, |(own, first)| to_s(own.saturating_sub(first)));
        let begins_s = late_s + timing.offset_s;
        holes_s.extend(time_s.last().copied().filter(|before| begins_s - before > 1.5 * step_s));
        time_s.extend((0..to.saturating_sub(from)).map(|i| begins_s + i as f64 * step_s));
    }
    Ok(Times { time_s, start_ns, holes_s })
}

/// The times that a channel beside gives: timestamps, or numbers under a name such as `time_s` or `Time`.
fn given(channel: &Channel, properties: &BTreeMap<String, Properties>) -> Option<Times> {
    let (time_s, start_ns) = match &channel.values {
        Values::Times(ns) => {
            let first = *ns.first()?;
            (ns.iter().map(|t| to_s(t.saturating_sub(first))).collect(), Some(first))
        }
        Values::Numbers(values) => {
            let names = names_of(&channel.path);
            let name = names.get(1)?;
            rest_of_name(name).filter(|rest| rest.is_empty() || rises(values))?;
            let said = match properties.get(&channel.path).and_then(|p| p.get("unit_string")) {
                Some(Property::Text(unit)) => time_unit(unit),
                _ => None,
            };
            let unit_s = said.or_else(|| time_unit(unit_in_name(name)?)).unwrap_or(1.0);
            (values.iter().map(|t| t * unit_s).collect(), None)
        }
        Values::Other(_) => return None,
    };
    Some(Times { time_s, start_ns, holes_s: Vec::new() })
}
