//! What a column of a foreign file measures, by its unit and its name, and which sensor of a rig it may be.

use crate::rig::{Rig, SensorKind, quantity_of, spelled_unit};
use crate::storage::import::source::{NAMELESS, Track};
use crate::units::{Quantity, Unit};

/// Words in names, in lower case. A name that starts with the letter alone, as `P1` and `Q_valve`, counts as well.
const WORDS: [(SensorKind, &[&str], &str); 5] = [
    (SensorKind::Pressure, &["press", "druck", "presi", "transducer"], "ph"),
    (SensorKind::Flow, &["flow", "debit", "débit", "durchfl", "caudal", "portata", "discharge"], "qf"),
    (SensorKind::Temperature, &["temp"], "t"),
    (SensorKind::Trigger, &["trig"], ""),
    // the valve alone is a place
    (SensorKind::ValvePosition, &["opening", "position", "stroke", "öffnung", "stellung"], ""),
];

/// What file and user say of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Known {
    /// It is this sensor of the rig.
    Sensor(usize),
    /// It is no sensor.
    Ignored,
    /// Nothing.
    Nothing,
}

/// Whether a heading is none: a number, as pandas and spreadsheets give.
pub fn is_nameless(heading: &str) -> bool {
    heading.starts_with(NAMELESS) || (!heading.is_empty() && heading.bytes().all(|b| b.is_ascii_digit()))
}

/// The unit of a pressure, and whether it counts from the vacuum: `bara`, `psia`, `kPa abs`, `bar(a)`, or a name that
/// says so. Of gauges it may be `bar g` or `mbar Überdruck`.
pub(crate) fn pressure_unit(name: &str, text: &str) -> Option<(Unit, bool)> {
    let plain = |text: &str| text.to_lowercase().replace(['(', ')', '[', ']', '.', '_', '-'], " ").trim().to_owned();
    let bare = plain(text);
    let named = is_absolute_name(name);
    if let Some(unit) = spelled_unit(text, Quantity::Pressure) {
        return Some((unit, named));
    }
    let without = |ends: &[&str]| ends.iter().find_map(|end| bare.strip_suffix(end));
    // milliamperes are no metres
    let of = |ends| without(ends).filter(|unit| *unit != "m").and_then(|unit| spelled_unit(unit, Quantity::Pressure));
    let absolute = of(&["absolute", "absolut", "assoluta", "abs", "ass", "a"]).map(|unit| (unit, true));
    absolute.or_else(|| Some((of(&["gauge", "relative", "relativ", "rel", "überdruck", "изб", "g"])?, named)))
}

/// Whether a unit counts from the vacuum by itself: `bar abs`, `psia`.
pub(crate) fn is_absolute_unit(text: &str) -> bool {
    text.len() > 3 && pressure_unit("", text).is_some_and(|(_, absolute)| absolute)
}

/// Whether a text behind a name is the unit of a pressure, a flow or a temperature.
pub(crate) fn is_unit(name: &str, text: &str) -> bool {
    let other = [Quantity::Flow, Quantity::Temperature];
    pressure_unit(name, text).is_some() || other.into_iter().any(|quantity| spelled_unit(text, quantity).is_some())
}

/// What a unit measures, if it is one of a test.
pub(crate) fn quantity_of_unit(text: &str) -> Option<Quantity> {
    let other = [Quantity::Flow, Quantity::Temperature];
    let pressure = pressure_unit("", text).map(|_| Quantity::Pressure);
    pressure.or_else(|| other.into_iter().find(|quantity| spelled_unit(text, *quantity).is_some()))
}

/// How words for it begin in the languages of Europe, and words for it where they stand without blanks.
const ABSOLUTE: [&str; 12] =
    ["absol", "abspr", "absdr", "absp", "assolut", "bezwzgl", "mutlak", "абс", "απολυτ", "απόλυτ", "απολύτ", "abszol"];
const ABSOLUTE_SIGNS: [&str; 3] = ["绝", "絶対", "절대"];

/// Whether a name says that its pressure counts from the vacuum: `Abs Pres`, `p_abs`, `Pabs`, `P1abs`, `AbsPress1`,
/// `absolut`. ABS is also the wall of a pipe.
pub(crate) fn is_absolute_name(name: &str) -> bool {
    if ABSOLUTE_SIGNS.iter().any(|sign| name.contains(sign)) {
        return true;
    }
    name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).any(|word| {
        let lower = word.to_lowercase();
        let bare = lower.trim_end_matches(|c: char| c.is_ascii_digit());
        let begins = ABSOLUTE.iter().any(|begin| lower.starts_with(begin));
        let ends = bare.strip_suffix("abs").is_some_and(|rest| rest.starts_with('p') && rest.len() <= 3);
        begins || ends || (bare == "abs" && word != "ABS")
    })
}

/// Words for the level that heads count from which are no gauge pressures: the sea, or another datum.
const LEVELS: [&str; 16] = [
    "sea level",
    "above datum",
    "elevation datum",
    "vertical datum",
    "hydraulic grade",
    "piezometric",
    "meeresspiegel",
    "niveau de la mer",
    "nivel del mar",
    "asl",
    "masl",
    "amsl",
    "nhn",
    "nn",
    "navd88",
    "hgl",
];

/// Whether a text says that heads count from the sea or another level: `head above sea level`, `m a.s.l.`, `HGL`.
pub(crate) fn is_above_level(text: &str) -> bool {
    let lower = text.to_lowercase().replace("a.s.l", "asl").replace("a.m.s.l", "amsl");
    let (phrases, words) = LEVELS.split_at(9);
    phrases.iter().any(|phrase| lower.contains(phrase))
        || lower.split(|c: char| !c.is_alphanumeric()).any(|word| words.contains(&word))
}

/// What the line of a column may look like whose unit is none that is known: the ranges of a transducer, a zero to take
/// off, or a factor.
pub fn line_like(unit: &str, target: &str) -> String {
    match unit {
        _ if is_electric(unit) => format!("1..5 -> 0..10 {target}"),
        _ if is_above_level(unit) => "x-ELEVATION m(H2O)".to_owned(),
        _ => format!("FACTOR*x {target}"),
    }
}

/// Whether two spellings are of one unit.
pub(crate) fn same_unit(a: &str, b: &str) -> bool {
    let quantities = [Quantity::Flow, Quantity::Temperature, Quantity::Ratio];
    let of = |text: &str| {
        let other = || quantities.iter().find_map(|q| spelled_unit(text, *q)).map(|unit| (unit, false));
        // the density of what a metre is of is not known here
        pressure_unit("", text).or_else(other).map(|(unit, is_absolute)| (unit.symbol, is_absolute))
    };
    a.eq_ignore_ascii_case(b) || (is_electric(a) && is_electric(b)) || of(a).is_some_and(|unit| of(b) == Some(unit))
}

/// What a logger measures before a transducer's line makes a pressure of it: volts or milliamperes.
pub fn is_electric(unit: &str) -> bool {
    let plain = unit.trim().replace([' ', '.'], "");
    matches!(
        plain.as_str(),
        "V" | "mV"
            | "uV"
            | "µV"
            | "mA"
            | "A"
            | "VDC"
            | "Vdc"
            | "mVDC"
            | "mAdc"
            | "V/V"
            | "mV/V"
            | "Volt"
            | "Volts"
            | "volt"
            | "volts"
            | "VOLT"
            | "VOLTS"
    )
}

/// What a track measures and its unit, where either its unit or its name says so.
pub fn kind_of(track: &Track) -> Option<(SensorKind, Option<Unit>)> {
    let kinds = [SensorKind::Pressure, SensorKind::Flow, SensorKind::Temperature];
    let unit_of = |kind, unit: &str| match kind {
        SensorKind::Pressure => pressure_unit(&track.short, unit).map(|(unit, _)| unit),
        _ => spelled_unit(unit, quantity_of(kind)),
    };
    let by_unit =
        track.unit.as_deref().and_then(|unit| kinds.into_iter().find_map(|kind| Some((kind, unit_of(kind, unit)?))));
    if let Some((kind, unit)) = by_unit {
        return Some((kind, Some(unit))).filter(|_| kind != SensorKind::Pressure || !is_elsewhere(&track.short));
    }
    let ratio = track.unit.as_deref().and_then(|unit| spelled_unit(unit, Quantity::Ratio));
    if ratio.is_some() && ["valve", "ventil"].iter().any(|word| track.short.to_lowercase().contains(word)) {
        return Some((SensorKind::ValvePosition, ratio));
    }
    kind_of_name(&track.short).map(|kind| (kind, None))
}

/// Whether a name says that its pressure is none at a place of the pipe: that of the air, or a difference of two.
fn is_elsewhere(name: &str) -> bool {
    let lower = name.to_lowercase();
    let begins = ["baro", "atm", "ambient", "luftdruck", "umgebung", "differ", "différ", "delta", "δ", "∆"];
    let is = |word: &str| {
        let bare = word.trim_end_matches(|c: char| c.is_ascii_digit());
        begins.iter().any(|begin| word.starts_with(begin)) || ["dp", "pdiff", "diff", "patm", "pbaro"].contains(&bare)
    };
    lower.split(|c: char| !c.is_alphanumeric() && c != '∆').any(is)
}

/// What a name says that its column measures.
pub fn kind_of_name(name: &str) -> Option<SensorKind> {
    if is_elsewhere(name) {
        return None;
    }
    let name = name.to_lowercase();
    let said = |words: &[&str]| words.iter().any(|w| name.contains(w));
    // a header is no head
    let is_head = name.split(|c: char| !c.is_alphabetic()).any(|word| word == "head");
    let lettered = |letters: &str| {
        let mut chars = name.chars();
        chars.next().is_some_and(|c| letters.contains(c)) && !chars.next().is_some_and(char::is_alphabetic)
    };
    // A pressure at the valve is no valve's position.
    let (valve, quantities) = WORDS.split_last()?;
    let worded = quantities.iter().find(|(_, words, _)| said(words));
    let head = quantities.first().filter(|_| is_head);
    let named = worded.or(head).or_else(|| quantities.iter().find(|(.., letters)| lettered(letters)));
    let found = named.or(Some(valve).filter(|(_, words, _)| said(words)));
    found.map(|(kind, ..)| *kind)
}

/// The same kind of signal, whatever its unit.
fn same(a: SensorKind, b: SensorKind) -> bool {
    quantity_of(a) == quantity_of(b) && (quantity_of(a) != Quantity::Ratio || a == b)
}

/// Track and sensor for each sensor that no track is named for: by a name that differs in case and signs only, else by
/// kind, in their order, where as many tracks of a kind are left as sensors.
pub(crate) fn guessed(
    tracks: &[Track],
    rig: &Rig,
    elsewhere: &[String],
    known: impl Fn(&Track) -> Known,
) -> Vec<(usize, usize)> {
    let bare = |name: &str| name.to_lowercase().replace([' ', '_', '-', '.'], "");
    let mut found: Vec<(usize, usize)> = Vec::new();
    let known: Vec<Known> = tracks.iter().map(known).collect();
    let free: Vec<usize> = (0..tracks.len()).filter(|&t| known[t] == Known::Nothing).collect();
    let is_elsewhere = |s: usize| elsewhere.contains(&rig.sensors[s].name);
    let open: Vec<usize> =
        (0..rig.sensors.len()).filter(|&s| !known.contains(&Known::Sensor(s)) && !is_elsewhere(s)).collect();
    for &sensor in &open {
        let alike = |t: &&usize| bare(&tracks[**t].short) == bare(&rig.sensors[sensor].name);
        found.extend(free.iter().find(alike).map(|&t| (t, sensor)));
    }
    for kind in WORDS.map(|(kind, ..)| kind) {
        let is_left = |t: &&usize| found.iter().all(|(other, _)| other != *t);
        let of_kind = |t: &&usize| kind_of(&tracks[**t]).is_some_and(|(k, _)| same(k, kind));
        let left: Vec<usize> = free.iter().filter(is_left).filter(of_kind).copied().collect();
        let waits = |s: &&usize| same(rig.sensors[**s].kind, kind) && found.iter().all(|(_, other)| other != *s);
        let wait: Vec<usize> = open.iter().filter(waits).copied().collect();
        match (&left[..], &wait[..]) {
            (left, wait) if left.len() == wait.len() => found.extend(left.iter().copied().zip(wait.iter().copied())),
            // The one pressure that everybody records is that at the valve.
            ([one], [_, _, ..]) if kind == SensorKind::Pressure => {
                let place = |s: &&usize| rig.sensors[**s].position_m;
                found.extend(wait.iter().max_by(|a, b| place(a).total_cmp(&place(b))).map(|&sensor| (*one, sensor)));
            }
            _ => {}
        }
    }
    // A table without headings says nothing but the order of its columns.
    let nameless = free.iter().all(|&t| is_nameless(&tracks[t].name));
    if found.is_empty() && nameless {
        let pressures: Vec<usize> =
            open.iter().copied().filter(|&s| rig.sensors[s].kind == SensorKind::Pressure).collect();
        let fitting = [open, pressures].into_iter().find(|sensors| sensors.len() == free.len());
        return fitting.map_or(found, |sensors| free.into_iter().zip(sensors).collect());
    }
    found
}
