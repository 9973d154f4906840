//! Merges several recordings of one closure, each on its own clock: by the edges of a trigger that all of them
//! recorded, by absolute time, or by the pressure front itself.
//!
//! Each part holds one file's samples on the sensors of the same rig. The first part's clock is kept.

pub(crate) mod clock;
pub(crate) mod front;
pub(crate) mod merge;
pub(crate) mod trigger;

use crate::align::clock::{SURE, short};
use crate::align::merge::{on_clock, repeated};
use crate::recording::Series;
use crate::rig::SensorKind;

pub use crate::align::clock::{Clock, Method, Part};
pub use crate::align::merge::merge;

/// Why files cannot be aligned.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AlignError {
    /// The requested method does not work.
    #[error("{file} cannot be aligned with {first} by {method}: {why}")]
    Method {
        /// The file.
        file: String,
        /// The file whose clock stays.
        first: String,
        /// The method.
        method: Method,
        /// Why, and what to do.
        why: String,
    },
    /// No method works.
    #[error("{file} cannot be aligned with {first}: {why}")]
    None {
        /// The file.
        file: String,
        /// The file whose clock stays.
        first: String,
        /// Why each of them fails.
        why: String,
    },
}

/// Start times with a coarser resolution than this are less reliable than a front, s.
const FINE_TIME_S: f64 = 2e-3;

/// Aligns every part with the first. Without a method it takes the most reliable one that every file allows: trigger,
/// absolute time to the millisecond, front, any absolute time.
///
/// # Errors
/// If a file lacks what the method needs; the error says what.
pub fn align(parts: &[Part], wanted: Option<Method>) -> Result<Vec<Clock>, AlignError> {
    let Some((first, others)) = parts.split_first() else { return Ok(Vec::new()) };
    if wanted.is_none()
        && let Some(clocks) = continued(parts)
    {
        return Ok(clocks);
    }
    let chosen = match wanted {
        Some(method) => method,
        None if others.is_empty() => Method::Time,
        None => choose(first, others)?,
    };
    let mut clocks = vec![Clock::own(&first.file, chosen)];
    for other in others {
        let mut clock = by(chosen, first, other).map_err(|why| AlignError::Method {
            file: other.file.clone(),
            first: first.file.clone(),
            method: chosen,
            why,
        })?;
        contradict(&mut clock, first, other);
        if chosen == Method::Time {
            check_overlap(&mut clock, first, other, wanted.is_some())?;
        }
        clocks.push(clock);
    }
    Ok(clocks)
}

/// The first sensor that several files hold; a trigger may be in all of them.
fn in_common(parts: &[Part]) -> Option<&str> {
    let sensors = &parts.first()?.recording.rig.sensors;
    let holds = |part: &Part, i: usize| part.recording.series.get(i).is_some_and(|s| !s.time_s.is_empty());
    let mut measured = (0..sensors.len()).filter(|&i| sensors[i].kind != SensorKind::Trigger);
    let shared = measured.find(|&i| parts.iter().filter(|part| holds(part, i)).count() > 1)?;
    Some(&sensors[shared].name)
}

/// Clocks of files that hold one record, each a part of its time: they go on where others end, by their starts or,
/// where not all give one, by their times. None where they have no sensor in common.
fn continued(parts: &[Part]) -> Option<Vec<Clock>> {
    in_common(parts)?;
    let by_start = parts.iter().all(|part| part.recording.run.start_unix_ns > 0);
    let clock = |part: &Part| match by_time(&parts[0], part) {
        Ok(clock) if by_start => Clock { remarks: Vec::new(), ..clock },
        _ => Clock::own(&part.file, Method::Time),
    };
    Some(parts.iter().map(clock).collect())
}

/// Refuses files that hold one sensor at the same times: one of them would have to be left out.
///
/// # Errors
/// Names two such files and what to do.
pub fn refuse_overlaps(parts: &[Part], clocks: &[Clock]) -> Result<(), AlignError> {
    let Some(sensor) = in_common(parts) else { return Ok(()) };
    let mut spans: Vec<(f64, f64, usize)> = Vec::new();
    for (i, (part, clock)) in parts.iter().zip(clocks).enumerate() {
        spans.extend(span(part).map(|(from_s, to_s)| (clock.time_s(from_s), clock.time_s(to_s), i)));
    }
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    // what a logger writes at the end of a file and again at the beginning of the next is no contradiction
    let is_seam = |first: usize, then: usize| {
        let series = |part: usize, i: usize| on_clock(&parts[part].recording.series[i], &clocks[part]);
        let sensors = parts[first].recording.rig.sensors.len();
        (0..sensors).all(|i| repeated(&series(first, i), &series(then, i)).is_some())
    };
    let Some(w) = spans.windows(2).find(|w| w[1].0 <= w[0].1 && !is_seam(w[0].2, w[1].2)) else { return Ok(()) };
    let why = format!(
        "both hold '{sensor}', and at the same times: if these are two runs, import each alone; if one goes on after the other, give the start of each \
         with option `start FILE=TIME`; if the column of one is another sensor, say which with option `map`"
    );
    let [first, file] = [w[0].2, w[1].2].map(|i| parts[i].file.clone());
    Err(AlignError::Method { file, first, method: clocks[w[1].2].method, why })
}

fn choose(first: &Part, others: &[Part]) -> Result<Method, AlignError> {
    let mut refused = (first.file.clone(), String::new());
    let mut works = |method: Method, fine: fn(&Clock) -> bool| {
        others.iter().all(|other| match by(method, first, other) {
            Ok(clock) => fine(&clock),
            Err(why) => {
                let separator = if refused.1.is_empty() { "" } else { "; " };
                refused = (other.file.clone(), format!("{}{separator}by {method}: {why}", refused.1));
                false
            }
        })
    };
    if works(Method::Trigger, |_| true) {
        return Ok(Method::Trigger);
    }
    if works(Method::Time, |clock| clock.uncertainty_s < FINE_TIME_S) {
        return Ok(Method::Time);
    }
    if works(Method::Front, |_| true) {
        return Ok(Method::Front);
    }
    if others.iter().all(|other| by(Method::Time, first, other).is_ok()) {
        return Ok(Method::Time);
    }
    Err(AlignError::None { file: refused.0, first: first.file.clone(), why: refused.1 })
}

fn by(method: Method, first: &Part, other: &Part) -> Result<Clock, String> {
    match method {
        Method::Trigger => by_trigger(first, other),
        Method::Time => by_time(first, other),
        Method::Front => crate::align::front::by_front(first, other),
    }
}

/// Adds what the other methods give, and a warning where they differ by more than their errors.
fn contradict(clock: &mut Clock, first: &Part, other: &Part) {
    for method in Method::ALL.into_iter().filter(|m| *m != clock.method) {
        let Ok(check) = by(method, first, other) else { continue };
        // compare at the best known event of the recording: clocks that drift differ elsewhere
        let at = |wanted| [&check, &*clock].into_iter().find(|c| c.method == wanted).map(|c| c.at_s);
        let at_s = at(Method::Front).or_else(|| at(Method::Trigger)).unwrap_or(0.0);
        let difference = check.time_s(at_s) - clock.time_s(at_s);
        let error = check.error_s(at_s).hypot(clock.error_s(at_s));
        let contradicts = difference.abs() > SURE * error;
        let verdict = if contradicts { "which contradicts it" } else { "which agrees" };
        if contradicts {
            clock.warnings.push(format!(
                "by {method} it would be {} later than by {}; option `align {method}` uses that instead",
                short(difference),
                clock.method
            ));
        }
        clock.remarks.push(format!(
            "by {method} it would be {} later ± {}, {verdict}",
            short(difference),
            short(check.error_s(at_s))
        ));
    }
}

/// Files of one closure overlap in time. Absolute times without any overlap are refused if the front contradicts them,
/// unless the user asked for them.
fn check_overlap(clock: &mut Clock, first: &Part, other: &Part, asked_for: bool) -> Result<(), AlignError> {
    let (Some((from_s, to_s)), Some((own_from_s, own_to_s))) = (span(first), span(other)) else { return Ok(()) };
    let apart_s = (clock.time_s(own_from_s) - to_s).max(from_s - clock.time_s(own_to_s));
    if apart_s <= 0.0 {
        return Ok(());
    }
    let apart = format!("by their times the two recordings do not overlap but lie {} apart", short(apart_s));
    let remedy = "does one of them lack its time zone (option `zone +01:00`, or in its times)";
    if !asked_for && crate::align::front::by_front(first, other).is_ok() {
        let why = format!(
            "{apart}, and both show the front: {remedy}? option `align front` uses the front instead, option `align time` uses these times anyway"
        );
        let (file, first) = (other.file.clone(), first.file.clone());
        return Err(AlignError::Method { file, first, method: Method::Time, why });
    }
    clock.warnings.push(format!("{apart}: {remedy}?"));
    Ok(())
}

/// Times of the first and the last sample, s on the part's own clock.
fn span(part: &Part) -> Option<(f64, f64)> {
    let ends = |series: &Series| Some((*series.time_s.first()?, *series.time_s.last()?));
    let all = part.recording.series.iter().filter_map(ends);
    all.reduce(|(from, to), (own_from, own_to)| (from.min(own_from), to.max(own_to)))
}

/// Every trigger of the part that has samples.
fn triggers(part: &Part) -> impl Iterator<Item = (&str, &Series)> {
    let sensors = part.recording.rig.sensors.iter().zip(&part.recording.series);
    sensors
        .filter(|(s, series)| s.kind == SensorKind::Trigger && !series.time_s.is_empty())
        .map(|(s, series)| (s.name.as_str(), series))
}

fn by_trigger(first: &Part, other: &Part) -> Result<Clock, String> {
    let edges = |part: &Part| {
        let mut known = triggers(part).peekable();
        if known.peek().is_none() {
            let hint = "the rig needs a sensor of kind = \"trigger\", and every file a column of it (option `map NAME=SENSOR`)";
            return Err(format!("{} has no trigger: {hint}", part.file));
        }
        known
            .map(|(_, series)| crate::align::trigger::edges(series))
            .find(|edges| !edges.is_empty())
            .ok_or_else(|| format!("the trigger of {} has no edge", part.file))
    };
    let (a, b) = (edges(first)?, edges(other)?);
    let expected = by_time(first, other).ok().map(|c| c.offset_s);
    let found = crate::align::trigger::matched(&a, &b, expected).map_err(|no| match no {
        crate::align::trigger::NoMatch::NoEdge => "no edge of one matches an edge of the other".to_string(),
        crate::align::trigger::NoMatch::Ambiguous => format!(
            "{} edges against {} match in several ways; give both files their absolute start, or use option `align front`",
            a.len(),
            b.len()
        ),
    })?;
    let line = crate::align::trigger::line(&a, &b, &found.pairs);
    let mut remarks = Vec::new();
    let unmatched = a.len().max(b.len()) - found.pairs.len();
    if unmatched > 0 {
        remarks.push(format!("{unmatched} edges of the file that has more match none of the other"));
    }
    if found.inverted {
        remarks.push("one of the triggers is active low, the other high".into());
    }
    Ok(Clock {
        offset_s: line.offset_s,
        uncertainty_s: line.error_s,
        at_s: line.middle_s,
        drift_ppm: (line.drift != 0.0).then_some(line.drift * 1e6),
        drift_error_ppm: line.drift_error.map(|e| e * 1e6),
        events: found.pairs.len(),
        residual_s: line.residual_s,
        remarks,
        ..Clock::own(&other.file, Method::Trigger)
    })
}

fn by_time(first: &Part, other: &Part) -> Result<Clock, String> {
    let start = |part: &Part| match part.recording.run.start_unix_ns {
        0 => Err(format!(
            "{} does not say when its time 0 was: give date-times, a comment '# start: 2026-03-14T09:26:53.5Z', or option `start`",
            part.file
        )),
        ns => Ok((ns, part.start_digit_s.unwrap_or_else(|| last_digit_s(ns)))),
    };
    let ((a, digit_a), (b, digit_b)) = (start(first)?, start(other)?);
    // within the resolution, every value is equally likely
    let written = short(digit_a.max(digit_b));
    let remark = format!("the starts are given to {written}; any difference between the clocks adds to that");
    Ok(Clock {
        offset_s: (i128::from(b) - i128::from(a)) as f64 * 1e-9,
        uncertainty_s: digit_a.hypot(digit_b) / 12f64.sqrt(),
        events: 1,
        remarks: vec![remark],
        ..Clock::own(&other.file, Method::Time)
    })
}

/// Value of the last digit of a time that is not 0, at most a second, s.
fn last_digit_s(ns: u64) -> f64 {
    (0..10).map(|k| 10u64.pow(9 - k)).find(|unit| ns.is_multiple_of(*unit)).unwrap_or(1) as f64 * 1e-9
}
