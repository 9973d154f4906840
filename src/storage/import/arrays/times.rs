//! Which array holds the times of which, what steps and units a file states beside its arrays: by their names and
//! places.

use crate::storage::import::arrays::contents::{Array, Contents};
use crate::storage::import::csv::heading::{heading_unit, time_unit};

/// Words in the names of times, in lower case.
const TIMES: [&str; 10] =
    ["t", "time", "times", "zeit", "temps", "tempo", "tiempo", "timestamp", "timestamps", "elapsed"];
/// Names of steps in seconds, and of rates in hertz, in lower case and without signs.
const STEPS: [&str; 12] = [
    "dt",
    "deltat",
    "tinterval",
    "timeinterval",
    "sampleinterval",
    "samplinginterval",
    "sampleperiod",
    "samplingperiod",
    "sampletime",
    "timestep",
    "xincrement",
    "wfincrement",
];
const RATES: [&str; 8] =
    ["fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "samplesperseconds", "rate", "srate"];
/// Names of units, in lower case.
const UNITS: [&str; 4] = ["unit", "units", "unit_string", "ni_unitdescription"];
/// Names that say no more than that a structure's numbers stand there.
const PLAIN: [&str; 6] = ["data", "value", "values", "signal", "signals", "y"];

/// The name without what stands around it; of `P1/data` that is `P1`.
pub(crate) fn short(name: &str) -> &str {
    let (around, own) = name.rsplit_once('/').unwrap_or(("", name));
    if !around.is_empty() && PLAIN.contains(&own.to_lowercase().as_str()) { short(around) } else { own }
}

/// What stands around a name.
pub(crate) fn parent(name: &str) -> &str {
    name.rsplit_once('/').map_or("", |(around, _)| around)
}

/// Never falls, and ends higher than it begins.
pub(crate) fn rises(values: &[f64]) -> bool {
    let finite = || values.iter().filter(|v| v.is_finite());
    let follows = finite().zip(finite().skip(1)).all(|(a, b)| b >= a);
    follows && finite().next().zip(finite().next_back()).is_some_and(|(first, last)| last > first)
}

/// One column that rises under the name of a time.
pub(crate) fn is_time(array: &Array) -> bool {
    let [column] = &array.columns[..] else { return false };
    rest_of_name(short(&array.name)).is_some() && rises(column)
}

/// The unit of time that a name ends with.
pub(crate) fn unit_in_name(name: &str) -> Option<&str> {
    let word = name.rsplit(['_', ' ', '(', '[']).next()?.trim_end_matches([')', ']']);
    (word != name && time_unit(word).is_some()).then_some(word)
}

/// What is left of the name of a time without the word for it, in lower case: `p1` of `time_P1`, `1` of `t1`, nothing
/// of `Time (s)`; none where it has no such word.
pub(crate) fn rest_of_name(name: &str) -> Option<String> {
    let bare = name.split(['(', '[']).next().unwrap_or(name);
    // `tP1` and `t1` are two words each
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in bare.chars() {
        let is_new = (before.is_lowercase() && (c.is_uppercase() || c.is_ascii_digit()))
            || (before.is_ascii_digit() && c.is_alphabetic());
        if is_new || words.is_empty() || !before.is_alphanumeric() {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| c.is_alphanumeric()) {
            word.push(c);
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    // a `T` is a temperature
    let place = words.iter().position(|word| word != "T" && TIMES.contains(&word.to_lowercase().as_str()))?;
    words.remove(place);
    words.retain(|word| time_unit(word).is_none());
    Some(words.concat().to_lowercase())
}

/// How sure it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Belongs {
    /// By place or name, or nothing else comes into question.
    Surely,
    /// By the order in the file alone, or from another group.
    Perhaps,
}

/// Which of the `times` are those of the array at a place, all places among `series`; none where there are none of its
/// length, or nothing tells which.
pub(crate) fn time_of(at: usize, times: &[usize], series: &[&Array]) -> Option<(usize, Belongs)> {
    let array = series[at];
    let fitting = || times.iter().copied().filter(|&i| series[i].samples() == array.samples());
    let common = |i: usize| {
        let (own, other) = (parent(&array.name).split('/'), parent(&series[i].name).split('/'));
        own.zip(other).take_while(|(a, b)| a == b && !a.is_empty()).count()
    };
    let nearest = fitting().map(common).max()?;
    let near: Vec<usize> = fitting().filter(|&i| common(i) == nearest).collect();
    let around = |i: usize| parent(&series[i].name);
    let is_around =
        |i: usize| around(i).is_empty() || format!("{}/", array.name).starts_with(&format!("{}/", around(i)));
    let sure = |i: usize| if is_around(i) { Belongs::Surely } else { Belongs::Perhaps };
    let same = |i: &usize| series[*i].columns == series[near[0]].columns;
    if near.iter().all(same) {
        return Some((near[0], sure(near[0])));
    }
    let plain = |name: &str| name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase();
    let rest = |i: usize| rest_of_name(short(&series[i].name)).unwrap_or_default();
    let name = plain(short(&array.name));
    let digits = name.trim_start_matches(|c: char| !c.is_ascii_digit());
    let only = |is: &dyn Fn(usize) -> bool| {
        let found: Vec<usize> = near.iter().copied().filter(|&i| is(i)).collect();
        if let [one] = found[..] { Some(one) } else { None }
    };
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let numbered = near.iter().all(|&i| is_number(&rest(i)));
    // One of them has the array's name, or its number where all are numbered, or is the only one that no other array
    // claims.
    let claimed = |i: usize| series.iter().any(|other| plain(short(&other.name)) == rest(i));
    let by_name = only(&|i| rest(i) == name)
        .or_else(|| only(&|i| numbered && is_number(digits) && rest(i) == digits))
        .or_else(|| only(&|i| !claimed(i)).filter(|_| near.iter().any(|&i| claimed(i))));
    if let Some(found) = by_name {
        return Some((found, sure(found)));
    }
    // In tables the times stand before what belongs to them.
    let before = near.iter().copied().filter(|&i| i < at).max();
    before.map(|i| (i, Belongs::Perhaps))
}

/// Seconds between samples, as a file states them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    pub(crate) seconds: f64,
    /// Where it says so.
    pub(crate) name: String,
    /// It is stated of this array alone.
    pub(crate) is_own: bool,
}

/// The step that is stated of an array, or of what stands around it.
pub(crate) fn step_of(array: &Array, contents: &Contents) -> Option<Step> {
    let mut around = array.name.as_str();
    loop {
        let here =
            contents.arrays.iter().filter(|a| a.samples() == 1 && a.columns.len() == 1 && parent(&a.name) == around);
        let stated = here
            .filter_map(|a| Some((a, seconds(short(&a.name), a.columns[0][0], own_unit(&a.name, &contents.texts))?)));
        if let Some((found, seconds)) = stated.into_iter().next() {
            return Some(Step { seconds, name: found.name.clone(), is_own: around == array.name });
        }
        if around.is_empty() {
            return None;
        }
        around = parent(around);
    }
}

/// Seconds between samples by a number and its name, such as `dt`, `dt_ms`, `fs_kHz`.
pub(crate) fn seconds(name: &str, value: f64, unit: Option<&str>) -> Option<f64> {
    let hertz = |unit: &str| match unit.to_lowercase().as_str() {
        "hz" => Some(1.0),
        "khz" => Some(1e3),
        "mhz" => Some(1e6),
        _ => None,
    };
    let plain = |name: &str| name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase();
    let (bare, written) = match name.rsplit_once(['_', ' ', '(']) {
        Some((bare, unit)) if time_unit(unit.trim_end_matches(')')).or(hertz(unit.trim_end_matches(')'))).is_some() => {
            (plain(bare), Some(unit.trim_end_matches(')')))
        }
        _ => (plain(name), None),
    };
    let unit = unit.or(written);
    let seconds = if STEPS.contains(&bare.as_str()) {
        value * unit.map_or(Some(1.0), time_unit)?
    } else if RATES.contains(&bare.as_str()) {
        1.0 / (value * unit.map_or(Some(1.0), hertz)?)
    } else {
        return None;
    };
    (seconds.is_finite() && seconds > 0.0).then_some(seconds)
}

/// What the file says that the unit of a name is: within it, or beside it under its name.
fn own_unit<'t>(name: &str, texts: &'t [(String, String)]) -> Option<&'t str> {
    let last = name.rsplit('/').next().unwrap_or(name);
    let stands = |place: &str| {
        let place = place.to_lowercase();
        let (name, last) = (name.to_lowercase(), last.to_lowercase());
        UNITS.iter().any(|unit| {
            let around = parent(&name);
            let within = if around.is_empty() { String::new() } else { format!("{around}/") };
            [format!("{name}/{unit}"), format!("{name}_{unit}"), format!("{within}{unit}/{last}")].contains(&place)
        })
    };
    texts.iter().find(|(place, text)| stands(place) && !text.trim().is_empty()).map(|(_, text)| text.trim())
}

/// The unit of an array of values; that of the structure around it where it is `alone` in it.
pub(crate) fn unit_of<'t>(array: &Array, alone: bool, texts: &'t [(String, String)]) -> Option<&'t str> {
    let around = parent(&array.name);
    let beside = || {
        let is_unit = |name: &str| {
            parent(name) == around
                && UNITS.contains(&name[around.len()..].trim_start_matches('/').to_lowercase().as_str())
        };
        texts.iter().find(|(name, text)| is_unit(name) && !text.trim().is_empty()).map(|(_, text)| text.trim())
    };
    own_unit(&array.name, texts).or_else(|| beside().filter(|_| alone))
}

/// The name that a structure or a group gives to the one array in it: `name` or `label`.
pub(crate) fn label_of<'t>(array: &Array, texts: &'t [(String, String)]) -> Option<&'t str> {
    let around = parent(&array.name);
    let is_label = |name: &str| !around.is_empty() && parent(name) == around && matches!(short(name), "name" | "label");
    texts.iter().find(|(name, text)| is_label(name) && !text.trim().is_empty()).map(|(_, text)| text.trim())
}

/// The heading of an array of times, such that a table's reader knows it for one.
pub(crate) fn heading(time: &Array, texts: &[(String, String)]) -> String {
    let name = short(&time.name);
    let unit = own_unit(&time.name, texts).or_else(|| unit_in_name(name));
    let is_plain = heading_unit(name).is_some() || rest_of_name(name).is_some_and(|rest| rest.is_empty());
    match unit {
        _ if heading_unit(name).is_some() => name.to_owned(),
        Some(unit) => format!("time ({unit})"),
        None if is_plain => name.to_owned(),
        None => "time".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_for_time_is_found_in_a_name() {
        let rests = ["time", "t1", "tP1", "P1_time", "Time (s)", "time_ms", "timeUpper", "t_2"];
        let rests = rests.map(|name| rest_of_name(name).unwrap());
        assert_eq!(rests, ["", "1", "p1", "p1", "", "", "upper", "2"]);
        for name in ["P1", "temp", "T", "T1", "start", "data"] {
            assert_eq!(rest_of_name(name), None, "{name}");
        }
    }

    #[test]
    fn steps_have_the_unit_that_is_written() {
        assert_eq!(seconds("Tinterval", 0.001, None), Some(0.001));
        assert_eq!(seconds("dt_ms", 2.0, None), Some(0.002));
        assert_eq!(seconds("Sample Rate (kHz)", 4.0, None), Some(0.000_25));
        assert_eq!(seconds("fs", 2.0, Some("kHz")), Some(0.000_5));
        assert_eq!(seconds("fs", 2.0, Some("furlong")), None);
        assert_eq!((seconds("rate", 0.0, None), seconds("length", 3.0, None)), (None, None));
    }
}
