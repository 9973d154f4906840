//! A sensitivity study as plain text.

use std::fmt::Write as _;

use crate::report::text::number::significant;
use crate::report::text::table::Table;
use crate::sensitivity::anova::OneWay;
use crate::sensitivity::factor::Factor;
use crate::sensitivity::levels;
use crate::sensitivity::map::Map;
use crate::sensitivity::morris::Effects;
use crate::sensitivity::sobol::{Index, Indices};
use crate::sensitivity::study::{Column, Study, Table as Of};

/// Everything that was asked for.
pub fn text(study: &Study) -> String {
    let model = if study.effects.is_empty() { "base model".to_owned() } else { study.effects.join(", ") };
    let mut out = format!(
        "Rig {}, {model}, sensor {}, 4L/a = {} s, {} reaches, seed {}.\n",
        study.rig,
        study.sensor,
        significant(study.period_s, 4),
        study.reaches,
        study.seed
    );
    if let Some(anova) = &study.anova {
        let _ = write!(out, "\n{}", of_anova(anova));
    }
    if let Some(morris) = &study.morris {
        let cell = |e: &Effects| {
            let half = significant(1.96 * e.mu_star_error, 1);
            format!("{}±{half} {}", significant(e.mu_star, 2), significant(e.sigma, 2))
        };
        out += "\nMorris: mean absolute effect of a step over the whole range ± half its 95% interval, and standard deviation of the effect\n\n";
        out += &columns(&morris.factors, &morris.outputs, cell);
        out += &after(morris);
    }
    if let Some(sobol) = &study.sobol {
        let cell = |i: &Indices| format!("{} {}", with_half(i.first), with_half(i.total));
        out += "\nSobol: share of the variance, first-order and total, each ± half its 95% interval\n\n";
        out += &columns(&sobol.factors, &sobol.outputs, cell);
        out += &after(sobol);
    }
    for map in &study.maps {
        let _ = write!(out, "\n{}", of_map(map));
    }
    out
}

/// What repeats mean in an analysis of variance of a simulation.
pub fn repeats(study: &levels::Study) -> String {
    let widths: Vec<String> = study
        .drawn
        .iter()
        .map(|f| format!("{} {}-{}", f.name, significant(f.lower, 3), significant(f.upper, 3)))
        .collect();
    format!(
        "{} levels × {} runs of each parameter. A simulation repeats exactly, so the other parameters are drawn anew for each run of a level \
         (seed {}), evenly from {}: F grows with the inverse square of the width of these draws.",
        study.plan.levels,
        study.plan.repeats,
        study.plan.seed,
        widths.join(", ")
    )
}

/// `F` with stars: ** where p < 0.01, * where p < 0.05.
pub fn f_value(found: &Option<OneWay>) -> String {
    let Some(found) = found else { return "–".into() };
    let stars = match found.p {
        p if p < 0.01 => "**",
        p if p < 0.05 => "*",
        _ => "",
    };
    let f = if found.f.is_infinite() { "inf".to_owned() } else { significant(found.f, 3) };
    format!("{f}{stars}")
}

fn of_anova(study: &levels::Study) -> String {
    let mut headings: Vec<String> = vec!["parameter".into()];
    headings.extend(study.outputs.iter().map(|o| format!("<{}", o.name)));
    let mut table = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
    for analysis in &study.analyses {
        let mut row = vec![analysis.parameter.clone()];
        row.extend(analysis.outputs.iter().map(f_value));
        table.row(row);
    }
    let mut p = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
    for analysis in &study.analyses {
        let mut row = vec![analysis.parameter.clone()];
        row.extend(analysis.outputs.iter().map(|o| o.map_or("–".into(), |o| significant(o.p, 2))));
        p.row(row);
    }
    format!(
        "One-way analysis of variance: F (** where p < 0.01, * where p < 0.05)\n\n{table}\np\n\n{p}{}\n{}",
        repeats(study),
        failures(study.failed, study.runs, None)
    )
}

fn columns<T>(factors: &[Factor], outputs: &[Column<T>], cell: impl Fn(&T) -> String) -> String {
    let mut headings: Vec<String> = vec!["parameter".into(), "range".into()];
    headings.extend(outputs.iter().map(|o| format!("<{}", o.output.name)));
    let mut table = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
    for (i, factor) in factors.iter().enumerate() {
        let mut row = vec![factor.name.clone(), range(factor)];
        row.extend(outputs.iter().map(|o| cell(&o.parameters[i])));
        table.row(row);
    }
    table.to_string()
}

/// `0.02-0.2`, the range over which a parameter varied.
pub fn range(factor: &Factor) -> String {
    format!("{}-{}", significant(factor.lower, 2), significant(factor.upper, 2))
}

/// A share of the variance, to hundredths: an estimate has no more digits.
pub fn share(value: f64) -> String {
    if value.is_finite() { format!("{:.2}", value + 0.0).replace("-0.00", "0.00") } else { "–".into() }
}

/// A share and half of its interval, which is nearly even on both sides; the page and the JSON have both ends.
fn with_half(index: Index) -> String {
    format!("{}±{}", share(index.value), share(0.5 * (index.high - index.low)))
}

fn after<T>(table: &Of<T>) -> String {
    let mut out = failures(table.failed, table.runs, table.why.as_deref());
    out += &undefined(table);
    out
}

/// How many simulations failed.
pub fn failures(failed: usize, runs: usize, why: Option<&str>) -> String {
    match (failed, why) {
        (0, _) => format!("{runs} simulations.\n"),
        (_, Some(why)) => format!("{runs} simulations, of which {failed} failed, the first because: {why}.\n"),
        (_, None) => format!("{runs} simulations, of which {failed} failed.\n"),
    }
}

/// Which outputs not every simulation had.
pub fn undefined<T>(table: &Of<T>) -> String {
    let few = table.outputs.iter().filter(|o| o.defined < 1.0);
    let list: Vec<String> = few.map(|o| format!("{} {:.1} %", o.output.name, 100.0 * o.defined)).collect();
    if list.is_empty() {
        return String::new();
    }
    format!(
        "Not every closure has every output (one that creeps to its end has no second peak): {}.\n",
        list.join(", ")
    )
}

fn of_map(map: &Map) -> String {
    let mut table = Table::new(&["over the map", "raising", "<least", "<greatest"]);
    for layer in &map.layers {
        let finite = || layer.values.iter().flatten().copied().filter(|v| v.is_finite());
        table.row([
            layer.output.name.into(),
            layer.raised.clone().unwrap_or_default(),
            significant(finite().fold(f64::NAN, f64::min), 3),
            significant(finite().fold(f64::NAN, f64::max), 3),
        ]);
    }
    format!(
        "Map of {} and {}, {} × {} cells\n\n{}{}",
        map.x.name,
        map.y.name,
        map.x.values.len(),
        map.y.values.len(),
        table.without_empty_columns(),
        failures(map.failed, map.runs, None)
    )
}
