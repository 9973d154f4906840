//! `surgescope effects`: the catalogue, and what each effect is and does.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text};
use crate::model::effects::{CATALOGUE, Chosen, Effect, Site, parse_list};
use crate::model::parameter::{Parameter, Scale};
use crate::model::trace::Trace;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::number::significant;
use crate::report::text::plot::{MARKS, plot};
use crate::report::text::table::Table;
use crate::rig::Rig;
use crate::simulate::scenario::{Scenario, ValveForm};
use crate::storage::output;

/// List the effects that a model can have, or explain one.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Effect to explain, such as valve-law or viscoelastic-wall:2 [default: list all].
    #[arg(value_name = "NAME", value_parser = one_effect)]
    effect: Option<Chosen>,
    /// Write a chart of its influence on a record; replaces an older picture of that name, and no other file.
    #[arg(long, value_name = "SVG", requires = "effect")]
    svg: Option<PathBuf>,
}

/// The rig on which an effect shows its parameters and what it does.
const RIG: &str = include_str!("../../../rigs/demo-hdpe.toml");
/// Periods shown.
const PERIODS: f64 = 5.0;
/// Head before the valve at which the water of that rig boils when it closes, m: some effects only show there.
const LOW_HEAD_M: f64 = 1.0;
/// Differences below this part of the record's range are not seen.
const UNSEEN: f64 = 2e-3;

fn one_effect(text: &str) -> Result<Chosen, String> {
    match parse_list(text).map_err(|e| e.to_string())?.as_slice() {
        [one] => Ok(one.clone()),
        _ => Err("name one effect; without a name, all are listed".into()),
    }
}

/// Runs it.
///
/// # Errors
/// An effect that cannot be simulated on the example's rig, a chart that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    let Some(chosen) = args.effect else {
        if json {
            let list: Vec<Value> = CATALOGUE.iter().map(|e| about(*e)).collect();
            say!("{:#}", json!({ "effects": list }));
        } else {
            say_text!(list());
        }
        return Ok(Outcome::Done);
    };
    let example = Example::of(&chosen)?;
    if let Some(path) = &args.svg {
        output::check_picture(path)?;
        output::write(path, &example.chart().to_svg(900.0, 420.0))?;
    }
    if json {
        let mut document = about(chosen.effect);
        document["parameters"] = example.parameters.iter().map(described).collect();
        document["example"] = example.to_json();
        say!("{document:#}");
    } else {
        say_text!(explained(chosen.effect));
        say_text!(format_args!(
            "\nParameters, with their start values and bounds on rig '{}':\n",
            example.scenario.rig.name
        ));
        say_text!(table(&example.parameters));
        say_text!(format_args!("\n{example}"));
    }
    Ok(Outcome::Done)
}

/// One line an effect, its other forms below it.
fn list() -> String {
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

/// What an effect says of itself, as JSON.
fn about(effect: &dyn Effect) -> Value {
    json!({
        "name": effect.name(), "summary": effect.summary(), "equation": effect.equation(), "source": effect.source(),
        "trace": effect.trace(), "most_elements": effect.elements().map(|r| *r.end()), "at_sensor": effect.at_sensor(),
        "variants": effect.variants().iter().map(|v| about(*v)).collect::<Vec<_>>(),
        "excludes": effect.excludes().iter().map(|(name, why)| json!({"name": name, "why": why})).collect::<Vec<_>>(),
    })
}

/// The same as text.
fn explained(effect: &dyn Effect) -> String {
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

fn described(p: &Parameter) -> Value {
    json!({
        "name": p.name, "unit": p.unit, "about": p.about, "start": p.start, "lower": p.lower, "upper": p.upper,
        "scale": if p.scale == Scale::Log { "log" } else { "linear" }, "vanishes_at": p.vanishes_at,
    })
}

fn table(parameters: &[Parameter]) -> String {
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

/// What an effect does to the record of one sensor, with its parameters where a fit starts.
struct Example {
    label: String,
    parameters: Vec<Parameter>,
    scenario: Scenario,
    sensor: String,
    base: Trace,
    with: Trace,
    duration_s: f64,
}

impl Example {
    /// At the usual head; at a low one where the effect does not show there.
    fn of(chosen: &Chosen) -> Result<Example, Box<dyn std::error::Error + Send + Sync>> {
        let usual = Example::under(chosen, &[])?;
        if usual.largest_difference_m() > UNSEEN * usual.range_m() {
            return Ok(usual);
        }
        let low = Example::under(chosen, &[("valve_head_m".into(), LOW_HEAD_M)])?;
        Ok(if low.largest_difference_m() > UNSEEN * low.range_m() { low } else { usual })
    }

    fn under(chosen: &Chosen, settings: &[(String, f64)]) -> Result<Example, Box<dyn std::error::Error + Send + Sync>> {
        let rig = Rig::from_toml(RIG, "rigs/demo-hdpe.toml")?;
        let base = Scenario::new(rig.clone(), &[], ValveForm::Linear, settings)?;
        let scenario = Scenario::new(rig, std::slice::from_ref(chosen), ValveForm::Linear, settings)?;
        let duration_s = PERIODS * base.period_s();
        let names: Vec<String> = scenario.rig.pressure_sensors().map(|(_, s)| s.name.clone()).collect();
        let at = names.iter().position(|n| chosen.sensor.as_ref() == Some(n)).unwrap_or(0);
        let shown = |s: &Scenario| s.simulate(duration_s).map(|traces| traces.into_iter().nth(at));
        let (Some(base), Some(with)) = (shown(&base)?, shown(&scenario)?) else {
            return Err("the example rig has no pressure sensor".into());
        };
        let period_s = scenario.period_s();
        let site = Site { rig: &scenario.rig, water: &scenario.water, period_s };
        let elements = scenario.effects.first().and_then(|c| c.elements).unwrap_or(1);
        let parameters = chosen.effect.parameters(&site, elements);
        let sensor = names.into_iter().nth(at).unwrap_or_default();
        Ok(Example { label: chosen.label(), parameters, scenario, sensor, base, with, duration_s })
    }

    /// Both traces at even times: time (s), base model and model with the effect (m).
    fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        const POINTS: usize = 1000;
        (0..=POINTS).map(|i| {
            let t = self.duration_s * i as f64 / POINTS as f64;
            (t, self.base.at(t), self.with.at(t))
        })
    }

    fn largest_difference_m(&self) -> f64 {
        self.points().map(|(_, base, with)| (with - base).abs()).fold(0.0, f64::max)
    }

    fn range_m(&self) -> f64 {
        let (low, high) =
            self.points().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.1), high.max(p.1)));
        high - low
    }

    fn values(&self) -> String {
        let name = |p: &Parameter| format!("{} = {}", p.name, significant(p.start, 3));
        self.parameters.iter().map(name).collect::<Vec<_>>().join(", ")
    }

    fn chart(&self) -> LineChart {
        let series = |n: usize, label: &str, of: fn((f64, f64, f64)) -> f64| Series {
            label: label.into(),
            points: self.points().map(|p| (p.0, of(p))).collect(),
            style: Style::line(n),
        };
        LineChart {
            title: format!("{}: {}", self.label, self.values()),
            x_label: "time after the start of the closure, s".into(),
            y_label: format!("head at {}, m", self.sensor),
            series: vec![series(0, "base model", |p| p.1), series(1, &format!("with {}", self.label), |p| p.2)],
            ..LineChart::default()
        }
    }

    fn to_json(&self) -> Value {
        let (mut times, mut base, mut with) = (Vec::new(), Vec::new(), Vec::new());
        for (t, b, w) in self.points() {
            times.push(t);
            base.push(b);
            with.push(w);
        }
        json!({
            "rig": self.scenario.rig.name, "sensor": self.sensor,
            "settings": self.scenario.values().into_iter().map(|(n, v)| (n, json!(v))).collect::<serde_json::Map<_, _>>(),
            "largest_difference_m": self.largest_difference_m(),
            "time_s": times, "base_m": base, "with_effect_m": with,
        })
    }
}

impl std::fmt::Display for Example {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let run = self.scenario.run;
        writeln!(
            f,
            "Head at {} of that rig, m, at {} m/s and {} m upstream of the valve. {} base model, {} with {}:",
            self.sensor,
            significant(run.initial_velocity_m_s, 2),
            significant(run.valve_head_m, 3),
            MARKS[0],
            MARKS[1],
            self.values()
        )?;
        f.write_str(&plot([&|t| self.base.at(t), &|t| self.with.at(t)], self.duration_s, "s"))?;
        let difference = self.largest_difference_m();
        if difference > UNSEEN * self.range_m() {
            writeln!(f, "They differ by up to {} m.", significant(difference, 2))
        } else {
            writeln!(f, "They hardly differ ({} m): this rig does not show the effect.", significant(difference, 1))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_shows_what_it_does_on_the_demo_rig() {
        let all = CATALOGUE.iter().flat_map(|e| std::iter::once(*e).chain(e.variants().iter().copied()));
        for effect in all {
            let example = Example::of(&one_effect(effect.name()).unwrap()).unwrap();
            assert!(example.largest_difference_m() > UNSEEN * example.range_m(), "{} is not seen", effect.name());
            let text = example.to_string();
            assert!(text.contains(MARKS[1]) && text.contains("They differ"), "{text}");
            for parameter in &example.parameters {
                assert!(text.contains(&parameter.name), "{text}");
                assert!((parameter.lower..=parameter.upper).contains(&parameter.start), "{parameter:?}");
            }
            assert!(example.chart().to_svg(900.0, 420.0).ends_with("</svg>"));
        }
    }

    #[test]
    fn a_slip_is_explained_and_the_list_names_them_all() {
        assert!(one_effect("valve_law").unwrap_err().contains("did you mean 'valve-law'"));
        assert!(one_effect("none").is_err() && one_effect("valve-law,sensor-gain").is_err());
        let list = list();
        assert!(CATALOGUE.iter().all(|e| list.contains(e.name()) && list.contains(e.summary())), "{list}");
        assert!(list.contains("valve-law/power") && list.contains("sensor-lag@SENSOR"), "{list}");
    }
}
