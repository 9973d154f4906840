//! Compares the given rig with the recorded one.

use crate::rig::Rig;
use crate::rig::check::{Finding, Level};

pub(crate) fn compare_rigs(given: &Rig, recorded: &Rig) -> Finding {
    let subject = "rig of the recording";
    if given.source == recorded.source {
        return Finding::new(Level::Fine, subject, "identical to the rig file given", &[]);
    }
    let units = |rig: &Rig| rig.sensors.iter().map(|s| (s.name.clone(), s.unit.symbol)).collect::<Vec<_>>();
    let recorded_units = units(recorded);
    for (name, unit) in units(given) {
        if let Some((_, other)) = recorded_units.iter().find(|(n, u)| *n == name && *u != unit) {
            let message = format!("'{name}' is in {unit} in the rig given, its samples were recorded in {other}");
            return Finding::new(Level::Contradiction, subject, message, &[]);
        }
    }
    let differing: Vec<&str> = [
        ("fluid", given.fluid != recorded.fluid),
        ("pipe", format!("{:?}", given.pipes) != format!("{:?}", recorded.pipes)),
        ("upstream", given.upstream != recorded.upstream),
        ("downstream", given.valve != recorded.valve),
        ("sensor", format!("{:?}", given.sensors) != format!("{:?}", recorded.sensors)),
        ("device", given.devices != recorded.devices),
    ]
    .into_iter()
    .filter_map(|(table, differs)| differs.then_some(table))
    .collect();
    if differing.is_empty() {
        return Finding::new(Level::Fine, subject, "equivalent to the rig file given, but worded differently", &[]);
    }
    let message =
        format!("differs from the rig file given in: {}; the rig file given is used here", differing.join(", "));
    Finding::new(Level::Warning, subject, message, &[])
}
