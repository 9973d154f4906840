//! Which column of a time series belongs to which sensor of the rig.

use std::collections::HashSet;

use crate::rig::Rig;
use crate::storage::error::CsvProblem;
use crate::storage::import::csv::heading::hint_on_time;
use crate::storage::nearest::{listed, nearest};

/// The sensor of each column after the first, as an index in the rig. The first must be `time_s`; every other column
/// must be a sensor, and every sensor must have a column or be among those `without` one.
pub(crate) fn sensors_of(header: &[String], rig: &Rig, without: &[String]) -> Result<Vec<usize>, CsvProblem> {
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
    let mut before = HashSet::new();
    for name in names {
        if !before.insert(name) || name == first {
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
                kind: sensor.kind.name(),
                rig: rig.name.clone(),
                found: listed(header),
                hint: question(nearest(&sensor.name, spare)),
            });
        }
    }
    if !rig.pressure_sensors().any(|(_, s)| names.contains(&s.name)) {
        return Err(CsvProblem::NoPressure);
    }
    let column = |name: &String| match sensors().position(|s| s == name) {
        Some(sensor) => Ok(sensor),
        None => Err(CsvProblem::UnknownColumn {
            column: name.clone(),
            rig: rig.name.clone(),
            known: sensors().collect::<Vec<_>>().join(", "),
            hint: question(nearest(name, sensors())),
        }),
    };
    names.iter().map(column).collect()
}
