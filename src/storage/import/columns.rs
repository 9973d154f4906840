//! Which column of a time series belongs to which sensor of the rig.

use crate::recording::Series;
use crate::rig::Rig;
use crate::storage::import::numbers::Numbers;
use crate::storage::layout::kind_name;
use crate::storage::{CsvProblem, nearest};

/// A column on its way into a series.
pub(crate) struct Column {
    pub(crate) sensor: usize,
    pub(crate) series: Series,
    pub(crate) numbers: Numbers,
}

/// Finds the sensor of each column after the first.
pub(crate) fn columns(header: &[String], rig: &Rig, without: &[String]) -> Result<Vec<Column>, CsvProblem> {
    let first = header.first().map(String::as_str).unwrap_or_default();
    if first != "time_s" {
        let separator = first.chars().find(|c| matches!(c, ';' | '\t')).filter(|_| header.len() == 1);
        let hint = match separator {
            Some(_) => ": separate the columns by commas, and write decimals with a point".to_string(),
            None if header.len() > 1 && first.parse::<f64>().is_ok() => ": the header line is missing".to_string(),
            None => hint_on_time(first),
        };
        return Err(CsvProblem::NoTimeColumn { found: first.into(), hint });
    }
    let names = &header[1..];
    let question = |n: Option<&str>| n.map(|n| format!("; did you mean '{n}'?")).unwrap_or(".".into());
    let sensors = || rig.sensors.iter().map(|s| s.name.as_str());
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) || name == first {
            return Err(CsvProblem::DuplicateColumn(name.clone()));
        }
    }
    for sensor in without {
        let bad = |why: String| CsvProblem::BadWithout { sensor: sensor.clone(), why };
        if !sensors().any(|s| s == sensor) {
            return Err(bad(format!("rig '{}' has no such sensor{}", rig.name, question(nearest(sensor, sensors())))));
        }
        if names.contains(sensor) {
            return Err(bad("the file has a column for it".into()));
        }
    }
    for sensor in &rig.sensors {
        if !names.contains(&sensor.name) && !without.contains(&sensor.name) {
            let spare = names.iter().map(String::as_str).filter(|n| !sensors().any(|s| s == *n));
            return Err(CsvProblem::MissingColumn {
                sensor: sensor.name.clone(),
                kind: kind_name(sensor.kind),
                rig: rig.name.clone(),
                found: header.join(", "),
                hint: question(nearest(&sensor.name, spare)),
            });
        }
    }
    if !rig.pressure_sensors().any(|(_, s)| names.contains(&s.name)) {
        return Err(CsvProblem::NoPressure);
    }
    let column = |name: &String| match sensors().position(|s| s == name) {
        Some(sensor) => Ok(Column { sensor, series: Series::default(), numbers: Numbers::default() }),
        None => Err(CsvProblem::UnknownColumn {
            column: name.clone(),
            rig: rig.name.clone(),
            known: sensors().collect::<Vec<_>>().join(", "),
            hint: question(nearest(name, sensors())),
        }),
    };
    names.iter().map(column).collect()
}

/// What to do about a first column that is the time under another name or in another unit.
pub(crate) fn hint_on_time(heading: &str) -> String {
    let lower = heading.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric() && c != 'µ').filter(|w| !w.is_empty()).collect();
    let has = |names: &[&str]| words.iter().any(|w| names.contains(w));
    if !has(&["time", "t", "times", "zeit", "temps", "tempo", "seconds", "s", "sec"]) {
        return ": it stands first, whatever else the file holds".into();
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
