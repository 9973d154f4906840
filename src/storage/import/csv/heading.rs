//! Headings: names, the units that stand with them, and whether one is that of a time.

use crate::storage::import::kinds::{is_electric, is_unit, kind_of_name};
use crate::units::{Quantity, Unit};

/// Names of times, in lower case and without signs.
const TIMES: [&str; 31] = [
    "time",
    "times",
    "t",
    "x",
    "xvalue",
    "xaxis",
    "zeit",
    "uhrzeit",
    "messzeit",
    "zeitstempel",
    "temps",
    "heure",
    "tempo",
    "ora",
    "tiempo",
    "hora",
    "tijd",
    "tid",
    "elapsed",
    "timestamp",
    "datetime",
    "datetimeutc",
    "datumzeit",
    "second",
    "seconds",
    "sec",
    "secs",
    "millis",
    "micros",
    "clock",
    "время",
];

/// Names of counted samples, in lower case and without signs.
const COUNTERS: [&str; 22] = [
    "",
    "sample",
    "samples",
    "index",
    "n",
    "no",
    "nr",
    "i",
    "id",
    "scan",
    "scans",
    "count",
    "counter",
    "samplenumber",
    "number",
    "record",
    "recno",
    "point",
    "points",
    "row",
    "sequence",
    "seq",
];

/// A unit of what loggers record, also that of a transducer without its line.
pub(crate) fn is_known_unit(text: &str) -> bool {
    is_electric(text) || time_unit(text).is_some() || is_unit("", text)
}

/// Name and unit of a heading: `P1 (bar)`, `P1 [kPa]`, `P1 / kPa`, `P1/psi`, `Pres, kPa (logger 7)`; where the unit is
/// none that is known, brackets and ` / ` show it all the same. A unit behind an underscore, a blank or a point must be
/// known: `P1_psi`, `P1 PSI`, `P1.psi`, MATLAB's `P1_psi_`. A factor in a heading, `P1 x10 (bar)`, belongs to the unit
/// and makes an unknown one of it: which way it is meant, nobody can tell.
pub(crate) fn header_unit(heading: &str) -> Option<(String, String)> {
    let heading = heading.split_whitespace().collect::<Vec<_>>().join(" ");
    match take_factor(&heading) {
        Some((rest, factor)) => {
            let (name, unit) = plain_unit(&rest).unwrap_or((rest, String::new()));
            Some((name, format!("{factor} {unit}").trim_end().to_owned()))
        }
        None => plain_unit(&heading),
    }
}

fn plain_unit(heading: &str) -> Option<(String, String)> {
    let bracketed = in_brackets(heading).or_else(|| behind(heading, " / ")).or_else(|| within(heading));
    if bracketed.as_ref().is_some_and(|(_, unit)| is_known_unit(unit)) {
        return bracketed;
    }
    // what stands in brackets may be a remark
    let rest = bracketed.as_ref().map_or(heading, |(name, _)| name);
    known_behind(rest).or(bracketed)
}

/// `P1 (bar)`, `P1(bar)`, `P1 [bar]`; `m(H2O)` has brackets of its own.
fn in_brackets(heading: &str) -> Option<(String, String)> {
    for (open, close) in [('(', ')'), ('[', ']'), ('{', '}')] {
        let Some(inner) = heading.strip_suffix(close) else { continue };
        let mut depth = 0;
        let at = inner.char_indices().rev().find(|(_, c)| {
            depth += i32::from(*c == close) - i32::from(*c == open);
            depth < 0
        });
        let (name, unit) = (inner[..at?.0].trim(), inner[at?.0 + open.len_utf8()..].trim());
        if unit == "H2O"
            && let Some(column) = ["mm", "cm", "in", "ft", "m"].into_iter().find(|unit| name.ends_with(unit))
        {
            let name = name[..name.len() - column.len()].trim();
            return (!name.is_empty()).then(|| (name.to_owned(), format!("{column}(H2O)")));
        }
        return (!name.is_empty() && !unit.is_empty()).then(|| (name.to_owned(), unit.to_owned()));
    }
    None
}

/// `101 (bar)- Valve`: a unit that is known, in brackets within the name.
fn within(heading: &str) -> Option<(String, String)> {
    let (before, rest) = heading.split_once(['(', '['])?;
    let (unit, after) = rest.split_once([')', ']'])?;
    let name = format!("{} {}", before.trim(), after.trim_start_matches([' ', '-', ':', ','])).trim().to_owned();
    (is_known_unit(unit.trim()) && !name.is_empty()).then(|| (name, unit.trim().to_owned()))
}

fn behind(heading: &str, mark: &str) -> Option<(String, String)> {
    let (name, unit) = heading.rsplit_once(mark)?;
    let (name, unit) = (name.trim(), unit.trim());
    (!name.is_empty() && !unit.is_empty()).then(|| (name.to_owned(), unit.to_owned()))
}

/// A unit that is known, behind a comma, a slash, or as the last word.
fn known_behind(heading: &str) -> Option<(String, String)> {
    let listed = |mark: &str| behind(heading, mark).filter(|(_, unit)| is_known_unit(unit));
    if let Some(found) = listed(", ").or_else(|| listed(" in ")).or_else(|| listed(":")) {
        return Some(found);
    }
    let whole = heading.trim_end_matches('_');
    let is_mark = |c: char| matches!(c, '_' | ' ' | '.' | '-');
    // two words first: `P1 mm Hg`, `p_kPa_abs`
    let ends: Vec<usize> = whole.rmatch_indices(is_mark).map(|(at, _)| at).take(2).collect();
    let last = ends.into_iter().rev().find_map(|at| {
        let (name, unit) = (whole[..at].trim_end_matches(is_mark), &whole[at + 1..]);
        // `Channel A` is no current, nor `Sensor K` a temperature
        let is_letter = unit.chars().count() == 1 && !whole[at..].starts_with('_');
        if name.is_empty() || is_letter || !is_word_unit(name, unit) {
            return None;
        }
        Some(with_number(name, unit))
    });
    // `Q L/min` is no minute
    last.or_else(|| listed("/"))
}

/// Name and unit of which a number before the unit is a part: `Valve 0.01 bar`, `Valve 10^5 Pa`, but not
/// `Channel 7 bar`.
fn with_number(name: &str, unit: &str) -> (String, String) {
    let at = name.rfind(['_', ' ', '-', '(']).map_or(0, |at| at + 1);
    let (before, word) = (name[..at].trim_end_matches(['_', ' ', '-', '(']), &name[at..]);
    let word = word.trim_end_matches(')');
    let scales = is_number(word) && (word.contains(['.', ',', '^']) || word.starts_with("10"));
    match scales && !before.is_empty() {
        true => (before.to_owned(), format!("{word} {unit}")),
        false => (name.to_owned(), unit.to_owned()),
    }
}

/// Signs of a factor; `x` is one only where a word begins or ends with it.
const OPERATORS: [char; 6] = ['*', '/', '×', '·', '÷', '⋅'];

/// A heading without the factor in it, and the factor: `P/100`, `t*2000`, `P1 x10 (bar)`, `Valve [x10] (bar)`,
/// `0.1*P1`, `P1 x 10`, `Valve 1e-3 (bar)`.
fn take_factor(heading: &str) -> Option<(String, String)> {
    let is_edge = |c: char| c == ' ' || "()[]{}_,;".contains(c);
    let mut words: Vec<(usize, &str)> = Vec::new();
    let mut at = 0;
    for piece in heading.split_inclusive(is_edge) {
        let word = piece.trim_end_matches(is_edge);
        words.extend((!word.is_empty()).then_some((at, word)));
        at += piece.len();
    }
    let worded = |text: &str| text.contains(char::is_alphabetic);
    let (from, to) = words.iter().enumerate().find_map(|(i, &(at, word))| {
        if let Some((from, to)) = factor_in(word) {
            return Some((at + from, at + to));
        }
        // `P1 x 10`, but not `22 x 1.5`
        let is_sign = word == "x" || (word.chars().count() == 1 && word.starts_with(OPERATORS));
        let before = i.checked_sub(1).map(|i| words[i].1)?;
        let &(next, number) = words.get(i + 1)?;
        (is_sign && worded(before) && is_number(number)).then_some((at, next + number.len()))
    })?;
    let rest = format!("{} {}", heading[..from].trim_end_matches('_'), heading[to..].trim_start_matches('_'));
    let rest = ["()", "( )", "[]", "[ ]", "{}", "{ }"].iter().fold(rest, |rest, empty| rest.replace(empty, " "));
    let rest = rest.replace("( ", "(").replace("[ ", "[").split_whitespace().collect::<Vec<_>>().join(" ");
    worded(&rest).then(|| (rest, heading[from..to].to_owned()))
}

/// Where the factor stands in a word: all of `x10`, `10x`, `10^5` and `1e-3`, the end of `P/100`, the beginning of
/// `0.1*P1`. One by one changes nothing.
fn factor_in(word: &str) -> Option<(usize, usize)> {
    let scales = |number: &str| is_number(number) && number.parse() != Ok(1.0);
    let signs = |c: char| c == 'x' || OPERATORS.contains(&c);
    let whole = word.strip_prefix(signs).or(word.strip_suffix(signs)).is_some_and(scales);
    let is_power = is_number(word) && word.contains(['^', 'e', 'E']);
    if whole || is_power {
        return Some((0, word.len()));
    }
    let worded = |text: &str| text.contains(char::is_alphabetic);
    let (first, last) = (word.find(OPERATORS)?, word.rfind(OPERATORS)?);
    let behind = |at: usize| &word[at + word[at..].chars().next().map_or(1, char::len_utf8)..];
    if scales(behind(last)) && worded(&word[..last]) {
        return Some((last, word.len()));
    }
    let leads = !word[first..].starts_with(['/', '÷']) && scales(&word[..first]) && worded(behind(first));
    leads.then(|| (0, word.len() - behind(first).len()))
}

/// The factor within words: `pressures x10`, `bar*10`.
pub(crate) fn factor_of(words: &str) -> Option<String> {
    take_factor(words).map(|(_, factor)| factor)
}

/// Whether a cell is a factor with or without a name: `x0.1`, `INT*100`.
pub(crate) fn is_factor(cell: &str) -> bool {
    !cell.contains(' ') && factor_in(cell).is_some()
}

/// `10`, `0.01`, `1e-3`, `10^5`.
fn is_number(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit())
        && text.ends_with(|c: char| c.is_ascii_digit())
        && text.chars().all(|c| c.is_ascii_digit() || ".,^eE-+".contains(c))
        && !text.contains("..")
}

/// Whether what stands as a unit is a factor with or without one: it says how large numbers are, and not which way.
pub(crate) fn is_factored(unit: &str) -> bool {
    !is_known_unit(unit) && unit.split(' ').any(|word| is_number(word) || factor_in(word).is_some())
}

/// Whether a last word is a unit: as it is written in a rig file, in whatever case where it has three letters, and that
/// of a time behind a time.
fn is_word_unit(name: &str, unit: &str) -> bool {
    let exact = unit.parse::<Unit>().is_ok_and(|u| u.quantity != Quantity::Ratio);
    let spelled = unit.len() >= 3 && !unit.starts_with(|c: char| c.is_ascii_digit()) && is_unit("", unit);
    // `ch0_V` is in volts; `P_V` may as well stand at the valve
    let electric = is_electric(unit) && (unit.len() > 1 || kind_of_name(name).is_none());
    exact || spelled || electric || (is_time_name(name) && time_unit(unit).is_some())
}

/// A name without signs, in lower case, by which keys are known.
pub(crate) fn key_of(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase()
}

/// A name without its signs, in lower case, and without a number at its end: `Time_1` is `time`.
fn bare(name: &str) -> String {
    key_of(name).trim_end_matches(|c: char| c.is_ascii_digit()).to_owned()
}

/// Whether a name is that of a time: as a whole, or by its first or last word.
pub(crate) fn is_time_name(name: &str) -> bool {
    let is = |word: &str| TIMES.contains(&bare(word).as_str());
    let mut words = name.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
    let first = words.next();
    is(name) || first.is_some_and(|w| w.len() > 1 && is(w)) || words.next_back().is_some_and(|w| w.len() > 1 && is(w))
}

/// Whether a name is that of a date.
pub(crate) fn is_date_name(name: &str) -> bool {
    ["date", "datum", "fecha", "data", "datetime"].contains(&bare(name).as_str())
}

/// Whether a name is that of counted samples.
pub(crate) fn is_counter_name(name: &str) -> bool {
    let is_number = !name.is_empty() && name.bytes().all(|b| b.is_ascii_digit());
    !is_number && COUNTERS.contains(&bare(name).as_str())
}

/// Seconds of the unit that a name means by itself: `millis`, `us`, `seconds`.
pub(crate) fn unit_of_name(name: &str) -> Option<f64> {
    match bare(name).as_str() {
        "millis" => Some(1e-3),
        "micros" => Some(1e-6),
        // what is called `t` or `d` says nothing of a unit
        plain if plain.len() > 1 => time_unit(plain),
        _ => None,
    }
}

/// Seconds of the unit in a heading of a time column: `time_s`, `Time (ms)`, `T1 (s)`, `t/us`, `millis`; `None` where
/// it names none or is none.
pub(crate) fn heading_unit(heading: &str) -> Option<f64> {
    header_unit(heading).map_or_else(|| unit_of_name(heading), |(_, unit)| time_unit(&unit))
}

/// The unit of time of so many seconds.
pub fn time_symbol(seconds: f64) -> &'static str {
    ["ms", "us", "ns", "min", "h", "d"].into_iter().find(|unit| time_unit(unit) == Some(seconds)).unwrap_or("s")
}

/// Seconds of a unit of time.
pub fn time_unit(text: &str) -> Option<f64> {
    match text.trim_end_matches('.').to_lowercase().as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" | "sek" | "sekunden" | "с" | "сек" => Some(1.0),
        "ms" | "msec" | "msecs" | "millisecond" | "milliseconds" | "millisec" | "мс" => Some(1e-3),
        "us" | "µs" | "μs" | "usec" | "usecs" | "microsecond" | "microseconds" => Some(1e-6),
        "ns" | "nsec" | "nanosecond" | "nanoseconds" => Some(1e-9),
        "min" | "mins" | "minute" | "minutes" | "мин" => Some(60.0),
        "h" | "hr" | "hrs" | "hour" | "hours" => Some(3600.0),
        "d" | "day" | "days" => Some(86_400.0),
        _ => None,
    }
}

/// What to do about a first column that is the time under another name or in another unit.
pub(crate) fn hint_on_time(heading: &str) -> String {
    let lower = heading.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric() && c != 'µ').filter(|w| !w.is_empty()).collect();
    let has = |names: &[&str]| words.iter().any(|w| names.contains(w));
    if !has(&["time", "t", "times", "zeit", "temps", "tempo", "seconds", "s", "sec"]) {
        return ": times come first, whatever else the file holds".into();
    }
    let other = [
        (&["ms", "msec", "milliseconds"][..], "milliseconds", "1000"),
        (&["us", "µs", "μs", "usec", "microseconds"], "microseconds", "1000000"),
        (&["ns"], "nanoseconds", "1000000000"),
    ];
    match other.iter().find(|(names, ..)| has(names)) {
        Some((_, unit, factor)) => {
            format!(
                ": times must be in seconds, these look like {unit}; divide them by {factor} and name the column time_s"
            )
        }
        None => ": if these times are in seconds, name the column time_s".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_headings_as_programs_write_them() {
        for (heading, name, unit) in [
            ("P1 (bar)", "P1", "bar"),
            ("P1\n(psi)", "P1", "psi"),
            ("P1(bar(g))", "P1", "bar(g)"),
            ("P1 [kPa]", "P1", "kPa"),
            ("P1 / kPa", "P1", "kPa"),
            ("P1/psi", "P1", "psi"),
            ("Q in L/min", "Q", "L/min"),
            ("Q L/min", "Q", "L/min"),
            ("t in ms", "t", "ms"),
            ("P1.psi", "P1", "psi"),
            ("M00: mbar", "M00", "mbar"),
            ("P1_psi_", "P1", "psi"),
            ("P1_PSI", "P1", "PSI"),
            ("P1 PSI", "P1", "PSI"),
            ("P1 m(H2O)", "P1", "m(H2O)"),
            ("P1 (m(H2O))", "P1", "m(H2O)"),
            ("Pres, kPa (LGR S/N: 1, LBL: valve)", "Pres", "kPa"),
            ("ch0_V", "ch0", "V"),
            ("101 (VDC)", "101", "VDC"),
            ("101 (bar)- Valve", "101 Valve", "bar"),
            ("P1 (furlong)", "P1", "furlong"),
            ("Channel 10 (bar)", "Channel 10", "bar"),
            ("Valve x10 bar", "Valve", "x10 bar"),
            ("Valve (x10) (bar)", "Valve", "x10 bar"),
            ("Valve/10 bar", "Valve", "/10 bar"),
            ("Valve [x10] (bar)", "Valve", "x10 bar"),
            ("P1 x10 (bar)", "P1", "x10 bar"),
            ("P1 x 10 (bar)", "P1", "x 10 bar"),
            ("P1_x10__bar_", "P1", "x10 bar"),
            ("Valve (bar/10)", "Valve", "/10 bar"),
            ("Valve (bar x10)", "Valve", "x10 bar"),
            ("0.1*P1 (bar)", "P1", "0.1* bar"),
            ("Valve 1e-3 (bar)", "Valve", "1e-3 bar"),
            ("Valve 10^5 Pa", "Valve", "10^5 Pa"),
            ("Valve 0.01 bar", "Valve", "0.01 bar"),
            ("P/100", "P", "/100"),
            ("t*2000", "t", "*2000"),
            ("Time (x0.1 ms)", "Time", "x0.1 ms"),
            ("CH1 x1 (bar)", "CH1 x1", "bar"),
            ("Pipe 22x1.5 (bar)", "Pipe 22x1.5", "bar"),
            ("copper 22 x 1.5 (bar)", "copper 22 x 1.5", "bar"),
            ("Sensor 1/2 (bar)", "Sensor 1/2", "bar"),
            ("14/03/2026 P1 (bar)", "14/03/2026 P1", "bar"),
            ("Q (m3/h)", "Q", "m3/h"),
            ("Time (ms)", "Time", "ms"),
            ("Time_ms_", "Time", "ms"),
            ("t/us", "t", "us"),
            ("p_kPa_abs", "p", "kPa_abs"),
        ] {
            assert_eq!(header_unit(heading), Some((name.into(), unit.into())), "{heading}");
        }
        for heading in
            ["P1", "P_V", "Druck=2", "P1_m", "valve_s", "Sample", "Sensor A", "Channel A", "Sensor K", "P.1", "Wave-K2"]
        {
            assert_eq!(header_unit(heading), None, "{heading}");
        }
    }

    #[test]
    fn times_and_counters_by_their_names() {
        for (heading, unit_s) in [
            ("time_s", 1.0),
            ("T1 (s)", 1.0),
            ("millis", 1e-3),
            ("t_ms", 1e-3),
            ("Elapsed Time (us)", 1e-6),
            ("x [ms]", 1e-3),
            ("Zeit [d]", 86_400.0),
        ] {
            assert_eq!(heading_unit(heading), Some(unit_s), "{heading}");
        }
        assert!(
            [heading_unit("t"), heading_unit("P1 (bar)"), heading_unit("valve_s"), heading_unit("d")]
                .iter()
                .all(Option::is_none)
        );
        assert!(
            [
                "Time",
                "t1",
                "X_Value",
                "x-axis",
                "Elapsed Time",
                "pc_timestamp",
                "Date Time",
                "Time 1 - default sample rate"
            ]
            .into_iter()
            .all(is_time_name)
        );
        assert!(!["P1", "Valve", "Temperature", "T valve", "Date"].into_iter().any(is_time_name));
        assert!(["", "No", "Sample #", "RECORD", "#"].into_iter().all(is_counter_name) && !is_counter_name("P1"));
    }
}
