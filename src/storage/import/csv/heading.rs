//! Headings: names with units, and whether one is that of a time.

/// Name and unit of a heading such as `P1 (bar)`, `P1 [kPa]` or `P1 / kPa`.
pub(crate) fn header_unit(heading: &str) -> Option<(String, String)> {
    for (open, close) in [(" (", ")"), ("(", ")"), ("[", "]"), (" / ", "")] {
        if let Some((name, unit)) = heading.strip_suffix(close).and_then(|rest| rest.rsplit_once(open))
            && !name.trim().is_empty()
            && !unit.trim().is_empty()
        {
            // m(H2O) has brackets of its own
            let unit = if unit == "H2O" && heading.ends_with("m(H2O)") { "m(H2O)" } else { unit };
            let name = name.trim().strip_suffix(" m").filter(|_| unit == "m(H2O)").unwrap_or(name.trim());
            return Some((name.to_string(), unit.trim().to_string()));
        }
    }
    None
}

/// Seconds of the unit in a heading of a time column: `time_s`, `Time (ms)`, `t [us]`; `None` where it names none or is none.
pub(crate) fn heading_unit(heading: &str) -> Option<f64> {
    let (name, unit) = match header_unit(heading) {
        Some(split) => split,
        None => heading.rsplit_once(['_', ' ']).map(|(name, unit)| (name.to_string(), unit.to_string()))?,
    };
    let name = name.to_lowercase();
    let is_time = ["time", "t", "times", "zeit", "temps", "tempo", "tiempo", "x", "elapsed time", "relative time"];
    is_time.contains(&name.as_str()).then(|| time_unit(&unit)).flatten()
}

/// The unit of time of so many seconds.
pub fn time_symbol(seconds: f64) -> &'static str {
    ["ms", "us", "ns", "min", "h", "d"].into_iter().find(|unit| time_unit(unit) == Some(seconds)).unwrap_or("s")
}

/// Seconds of a unit of time.
pub fn time_unit(text: &str) -> Option<f64> {
    match text.trim_end_matches('.').to_lowercase().as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" => Some(1.0),
        "ms" | "msec" | "milliseconds" => Some(1e-3),
        "us" | "µs" | "μs" | "usec" | "microseconds" => Some(1e-6),
        "ns" | "nanoseconds" => Some(1e-9),
        "min" | "minutes" => Some(60.0),
        "h" | "hours" => Some(3600.0),
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
