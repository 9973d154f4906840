//! Effects for the terminal.

use std::fmt::Write as _;

use crate::model::effects::{CATALOGUE, Effect};
use crate::model::parameter::{Parameter, Scale};
use crate::report::text::number::significant;
use crate::report::text::table::Table;

/// One line per effect, its variants below it.
pub fn list() -> String {
    let mut table = Table::new(&["effect", "adds"]);
    for effect in CATALOGUE {
        let elements = effect.elements().map_or(String::new(), |r| format!(":{}..{}", r.start(), r.end()));
        let sensor = if effect.at_sensor() { "@SENSOR" } else { "" };
        table.row([format!("{}{elements}{sensor}", effect.name()), effect.summary().into()]);
        for variant in effect.variants() {
            table.row([variant.name().into(), variant.summary().into()]);
        }
    }
    format!(
        "{table}\n`surgescope effects NAME` explains one. The fit chooses a number of elements or a sensor that is not given.\n"
    )
}

/// Name, equation, source and trace of an effect.
pub fn explained(effect: &dyn Effect) -> String {
    let mut text = format!("{}: {}\n", effect.name(), effect.summary());
    let mut line = |label: &str, value: &str| {
        let _ = writeln!(text, "  {label:9} {value}");
    };
    line("equation", effect.equation());
    line("source", effect.source());
    line("trace", effect.trace());
    if let Some(range) = effect.elements() {
        line("elements", &format!("{} to {}, as in {}:{}", range.start(), range.end(), effect.name(), range.end()));
    }
    if effect.at_sensor() {
        line("sensor", &format!("one pressure sensor, as in {}@P2", effect.name()));
    }
    for variant in effect.variants() {
        line("variant", &format!("{}: {}", variant.name(), variant.summary()));
    }
    for (other, why) in effect.excludes() {
        line("excludes", &format!("{other}: {why}"));
    }
    text
}

/// Parameters with their start values and bounds.
pub fn table(parameters: &[Parameter]) -> String {
    let mut table = Table::new(&["parameter", "unit", "<start", "<from", "<to", "<vanishes at", "scale", "is"]);
    for p in parameters {
        table.row([
            p.name.clone(),
            p.unit.into(),
            significant(p.start, 3),
            significant(p.lower, 3),
            significant(p.upper, 3),
            p.vanishes_at.map_or(String::new(), |v| significant(v, 3)),
            if p.scale == Scale::Log { "log" } else { "linear" }.into(),
            p.about.into(),
        ]);
    }
    table.without_empty_columns().to_string()
}
