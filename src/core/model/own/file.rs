//! The text of an effect file, read and checked; errors name line and column.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use crate::interned::interned;
use crate::model::own::parser::{Fault, WORDS, parse};
use crate::model::own::program::Program;
use crate::model::parameter::{Parameter, Scale};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: Spanned<String>,
    says: String,
    at: Spanned<String>,
    gives: Spanned<String>,
    law: Spanned<String>,
    #[serde(default)]
    parameter: BTreeMap<Spanned<String>, WrittenParameter>,
    #[serde(default)]
    state: BTreeMap<Spanned<String>, WrittenState>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenParameter {
    unit: String,
    #[serde(default)]
    says: Option<String>,
    start: Spanned<f64>,
    bounds: Spanned<[f64; 2]>,
    #[serde(default)]
    scale: WrittenScale,
    vanishes_at: Option<Spanned<f64>>,
}

#[derive(Deserialize, Default, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum WrittenScale {
    #[default]
    Linear,
    Log,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenState {
    start: Spanned<Start>,
    rate: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Start {
    Number(f64),
    Law(String),
}

/// What a law gives, and where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gives {
    /// A flow out of the pipe at a place, m³/s.
    FlowOut,
    /// A head loss at a place, m.
    HeadLoss,
    /// A head loss between the supply and the pipe, m.
    HeadLossAtSupply,
    /// A head loss just before the valve, m.
    HeadLossAtValve,
    /// A flow out just before the valve, m³/s.
    FlowOutAtValve,
    /// The head of the supply, m.
    SupplyHead,
    /// What a sensor reads, m.
    Reading,
    /// Friction of the wall, m of head per m of pipe.
    Friction,
}

/// Inputs of a law before its parameters and states.
pub const INPUTS: [&str; 6] = ["t", "H", "Q", "H0", "Q0", "z"];
/// The time.
pub const T: usize = 0;
/// Head.
pub const H: usize = 1;
/// Flow.
pub const Q: usize = 2;
/// Head before the closure.
pub const H0: usize = 3;
/// Flow before the closure.
pub const Q0: usize = 4;
/// Elevation.
pub const Z: usize = 5;

impl Gives {
    const ALL: [(&'static str, &'static str, Gives); 8] = [
        ("node", "flow_out_m3_s", Gives::FlowOut),
        ("node", "head_loss_m", Gives::HeadLoss),
        ("valve", "flow_out_m3_s", Gives::FlowOutAtValve),
        ("valve", "head_loss_m", Gives::HeadLossAtValve),
        ("supply", "head_m", Gives::SupplyHead),
        ("supply", "head_loss_m", Gives::HeadLossAtSupply),
        ("sensor", "reading_m", Gives::Reading),
        ("wall", "friction_m_per_m", Gives::Friction),
    ];

    /// Whether it stands at a place along the pipe.
    pub fn is_at_place(self) -> bool {
        matches!(self, Gives::FlowOut | Gives::HeadLoss)
    }

    /// The inputs that the law has there: the others are not known where it is solved.
    pub fn inputs(self) -> &'static [usize] {
        match self {
            Gives::FlowOut => &[T, H, Q, H0, Q0, Z],
            Gives::FlowOutAtValve | Gives::Reading => &[T, H, H0, Z],
            Gives::HeadLoss | Gives::Friction => &[T, H, Q, H0, Q0],
            Gives::HeadLossAtSupply | Gives::HeadLossAtValve => &[T, Q, Q0],
            Gives::SupplyHead => &[T, H, H0],
        }
    }

    /// Whether it is a head loss.
    pub fn is_loss(self) -> bool {
        matches!(self, Gives::HeadLoss | Gives::HeadLossAtSupply | Gives::HeadLossAtValve)
    }

    /// The input with which the law is solved, the same before the closure, and the other two, which are as they were
    /// at the last step.
    pub fn moving(self) -> [usize; 4] {
        if self.is_loss() { [Q, Q0, H, H0] } else { [H, H0, Q, Q0] }
    }
}

/// A state: its start and its rate.
#[derive(Debug, Clone)]
pub struct State {
    /// Its value before the closure.
    pub start: Program,
    /// Its rate, per second.
    pub rate: Program,
}

/// An effect file, compiled.
#[derive(Debug, Clone)]
pub struct Definition {
    /// Its name.
    pub name: &'static str,
    /// One sentence of physics.
    pub says: &'static str,
    /// The law as it was written.
    pub law_text: &'static str,
    /// Where it acts, and what its law gives.
    pub gives: Gives,
    /// The law.
    pub law: Program,
    /// Its parameters in the order of the file; bounds of a `position_m` that the file lacks follow from the rig.
    pub parameters: Vec<Parameter>,
    /// Its states.
    pub states: Vec<State>,
}

/// The parameter of an effect at a place.
pub const POSITION: &str = "position_m";
/// Names that every simulation has already.
const SETTINGS: [&str; 7] = [
    "wave_speed_m_s",
    "friction_factor",
    "friction_scale",
    "initial_velocity_m_s",
    "valve_head_m",
    "closing_time_s",
    "reaches",
];
/// Most parameters and states.
const MOST: usize = 20;

/// Reads a file; `file` is its name in messages, `name` the one that the effect must have.
///
/// # Errors
/// A sentence that names file, line and column.
pub fn read(text: &str, file: &str, name: &str) -> Result<Definition, String> {
    let fault = |span: Range<usize>, message: &str| placed(text, file, span.start, message);
    let written: Written = toml::from_str(text).map_err(|e| match e.span() {
        Some(span) => fault(span, e.message().trim_end()),
        None => format!("{file}: {}", e.message().trim_end()),
    })?;
    if written.name.get_ref() != name {
        let message = format!(
            "the name is that of the file: write name = \"{name}\", or call the file {}.toml",
            written.name.get_ref()
        );
        return Err(fault(written.name.span(), &message));
    }
    if let Some(c) = name.chars().find(|c| !c.is_ascii_lowercase() && !c.is_ascii_digit() && *c != '-') {
        return Err(fault(written.name.span(), &format!("a name has lower-case letters, digits and '-', not '{c}'")));
    }
    let (at, gives) = (written.at.get_ref().as_str(), written.gives.get_ref().as_str());
    let here: Vec<&str> = Gives::ALL.iter().filter(|g| g.0 == at).map(|g| g.1).collect();
    if here.is_empty() {
        return Err(fault(
            written.at.span(),
            &format!("\"{at}\" is no place: write node, supply, valve, sensor or wall"),
        ));
    }
    let Some(&(_, _, gives)) = Gives::ALL.iter().find(|g| g.0 == at && g.1 == gives) else {
        return Err(fault(
            written.gives.span(),
            &format!("at = \"{at}\" gives {}, not \"{gives}\"", here.join(" or ")),
        ));
    };
    let mut own: Vec<(&Spanned<String>, &WrittenParameter)> = written.parameter.iter().collect();
    own.sort_by_key(|(name, _)| name.span().start);
    let mut states: Vec<(&Spanned<String>, &WrittenState)> = written.state.iter().collect();
    states.sort_by_key(|(name, _)| name.span().start);
    if own.len().max(states.len()) > MOST {
        return Err(format!("{file}: more than {MOST} parameters or states"));
    }
    let mut parameters = Vec::new();
    if gives.is_at_place() && own.iter().all(|(name, _)| name.get_ref() != POSITION) {
        let about = "where it is, from the supply (in a network, from where its pipe begins)";
        parameters.push(Parameter::linear(POSITION, "m", about, f64::NAN, f64::NAN, f64::NAN));
    }
    for (name, p) in &own {
        parameters.push(parameter(name.get_ref(), p).map_err(|(span, message)| fault(span, &message))?);
    }
    let first_state = INPUTS.len() + parameters.len();
    let mut names: Vec<(&str, usize)> = gives.inputs().iter().map(|&i| (INPUTS[i], i)).collect();
    names.extend(parameters.iter().enumerate().map(|(i, p)| (p.name.as_str(), INPUTS.len() + i)));
    names.extend(states.iter().enumerate().map(|(i, (name, _))| (name.get_ref().as_str(), first_state + i)));
    for (name, _) in own.iter().map(|(n, _)| (n, ())).chain(states.iter().map(|(n, _)| (n, ()))) {
        let word = name.get_ref().as_str();
        let first = word.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_');
        if !first || !word.chars().all(|c| c.is_alphanumeric() || c == '_') {
            return Err(fault(
                name.span(),
                &format!("'{word}' is no name: it begins with a letter and has letters, digits and '_'"),
            ));
        }
        let taken = WORDS.contains(&word) || SETTINGS.contains(&word) || INPUTS.contains(&word);
        if taken || names.iter().filter(|(n, _)| *n == word).count() > 1 {
            return Err(fault(name.span(), &format!("'{word}' has a meaning already: choose another name")));
        }
    }
    let hint = |word: &str| {
        INPUTS.contains(&word).then(|| {
            let known: Vec<&str> = gives.inputs().iter().map(|&i| INPUTS[i]).collect();
            let gives = written.gives.get_ref();
            format!("'{word}' is not known to a law that gives {gives} at a {at}: known are {}", known.join(", "))
        })
    };
    let compiled = |law: &Spanned<String>, names: &[(&str, usize)]| {
        let place = |f: Fault| {
            let begin = law.span().start;
            let inside = text[law.span()].find(law.get_ref().as_str()).unwrap_or(0);
            placed(text, file, begin + inside + f.at, &f.message)
        };
        parse(law.get_ref(), names, &hint).map_err(place)
    };
    let law = compiled(&written.law, &names)?;
    let before = &names[..names.len() - states.len()];
    let states = states.iter().map(|(_, state)| {
        let start = match state.start.get_ref() {
            Start::Number(value) => number(*value),
            Start::Law(law) => compiled(&Spanned::new(state.start.span(), law.clone()), before)?,
        };
        Ok(State { start, rate: compiled(&state.rate, &names)? })
    });
    let definition = Definition {
        states: states.collect::<Result<_, String>>()?,
        name: kept(name),
        says: kept(written.says.trim()),
        law_text: kept(written.law.get_ref()),
        gives,
        law,
        parameters,
    };
    vanishes(&definition).map_err(|message| fault(written.law.span(), &message))?;
    Ok(definition)
}

fn kept(text: &str) -> &'static str {
    interned(text.to_owned())
}

fn number(value: f64) -> Program {
    let mut program = Program::default();
    let at = program.number(value);
    program.ending(at)
}

fn placed(text: &str, file: &str, at: usize, message: &str) -> String {
    let before = text.get(..at).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let from = before.rfind('\n').map_or(0, |n| n + 1);
    let column = before[from..].chars().count() + 1;
    let shown: String = text[from..].lines().next().unwrap_or_default().chars().take(200).collect();
    let pointer = " ".repeat(column.min(200) - 1);
    format!("{file}:{line}:{column}: {message}\n{line:>5} | {shown}\n      | {pointer}^")
}

fn parameter(name: &str, p: &WrittenParameter) -> Result<Parameter, (Range<usize>, String)> {
    let [lower, upper] = *p.bounds.get_ref();
    let start = *p.start.get_ref();
    if !(lower < upper && lower.is_finite() && upper.is_finite()) {
        return Err((p.bounds.span(), "bounds are two numbers, the lesser one first".to_owned()));
    }
    let scale = match p.scale {
        WrittenScale::Linear => Scale::Linear,
        WrittenScale::Log => Scale::Log,
    };
    if scale == Scale::Log && lower <= 0.0 {
        return Err((p.bounds.span(), "a log scale needs bounds above zero".to_owned()));
    }
    if !(lower..=upper).contains(&start) {
        return Err((p.start.span(), format!("the start is not within the bounds, {lower} to {upper}")));
    }
    let vanishes_at = p.vanishes_at.as_ref().map(|v| *v.get_ref());
    if let Some(v) = p.vanishes_at.as_ref().filter(|v| !v.get_ref().is_finite() || *v.get_ref() == start) {
        return Err((
            v.span(),
            "vanishes_at is a number other than the start, where the effect would not be seen".to_owned(),
        ));
    }
    let about = p.says.as_deref().unwrap_or("see the effect's file");
    Ok(Parameter { scale, vanishes_at, ..Parameter::linear(name, kept(&p.unit), kept(about), start, lower, upper) })
}

/// Heads, flows, times and elevations at which a law is tried, and of them those before the closure.
const TRIED: [[f64; 6]; 7] = [
    [0.0, 20.3, 1.1e-3, 20.3, 1.1e-3, 0.0],
    [0.013, 47.9, 0.7e-3, 20.3, 1.1e-3, 0.0],
    [0.37, 151.7, 0.0, 20.3, 1.1e-3, 0.0],
    [1.9, -4.13, -0.9e-3, 20.3, 1.1e-3, 0.0],
    [0.71, 0.0, 0.3e-3, 20.3, 1.1e-3, 1.7],
    [7.3, 88.1, -2.2e-3, 61.3, 4.3e-3, -2.9],
    [23.0, 309.0, 1e-2, 61.3, 4.3e-3, 12.1],
];

/// A law must be a number wherever it is tried, and change nothing where a parameter has the value at which it
/// vanishes.
fn vanishes(d: &Definition) -> Result<(), String> {
    let starts: Vec<f64> = d.parameters.iter().map(|p| if p.start.is_nan() { 50.0 } else { p.start }).collect();
    let mut cases = vec![(starts.clone(), None)];
    for (i, p) in d.parameters.iter().enumerate() {
        if let Some(gone) = p.vanishes_at {
            let mut values = starts.clone();
            values[i] = gone;
            cases.push((values, Some((&p.name, gone))));
        }
    }
    if cases.len() == 1 {
        return Err("no parameter says at which value the effect vanishes: give one vanishes_at".to_owned());
    }
    for (values, gone) in cases {
        for tried in TRIED {
            let mut inputs: Vec<f64> = tried.iter().chain(&values).copied().collect();
            let run = |program: &Program, inputs: &[f64]| {
                program.run(|i| crate::model::own::number::Dual(inputs[i], 0.0), &mut Vec::new()).0
            };
            for state in &d.states {
                let start = run(&state.start, &inputs);
                inputs.push(start);
            }
            let value = run(&d.law, &inputs);
            let rates: Vec<f64> = d.states.iter().map(|s| run(&s.rate, &inputs)).collect();
            let used = d.gives.inputs().iter().map(|&i| format!("{} = {}", INPUTS[i], tried[i]));
            let here = used.collect::<Vec<_>>().join(", ");
            if !value.is_finite() || rates.iter().any(|r| !r.is_finite()) {
                return Err(format!("the law or a rate is not a number at {here}: guard it with if, max or abs"));
            }
            let nothing = if matches!(d.gives, Gives::SupplyHead | Gives::Reading) { tried[H] } else { 0.0 };
            if let Some((name, gone)) = gone.filter(|_| (value - nothing).abs() > 1e-12 * (1.0 + nothing.abs())) {
                return Err(format!(
                    "the effect does not vanish at {name} = {gone}: the law gives {value} and not {nothing} at {here}"
                ));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RELIEF: &str = r#"name = "relief-valve"
says = "A relief valve that opens above a set head."
at = "node"
gives = "flow_out_m3_s"
law = "if(H > set_head_m, cda_mm2 * 1e-6 * sqrt(2 * g * (H - set_head_m)), 0)"
[parameter.set_head_m]
unit = "m"
start = 60
bounds = [20, 200]
[parameter.cda_mm2]
unit = "mm²"
start = 1
bounds = [0, 100]
vanishes_at = 0
[state.x]
start = 0
rate = "(H - x) / 0.2"
"#;

    #[test]
    fn the_contracts_example_is_read_in_its_order() {
        let d = read(RELIEF, "relief-valve.toml", "relief-valve").unwrap();
        let names: Vec<&str> = d.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, [POSITION, "set_head_m", "cda_mm2"]);
        assert_eq!((d.parameters[2].vanishes_at, d.states.len(), d.gives), (Some(0.0), 1, Gives::FlowOut));
    }

    #[test]
    fn faults_name_line_and_column_and_what_was_meant() {
        for (from, to, place, words) in [
            ("cda_mm2 * 1e-6", "cda_mm * 1e-6", "x.toml:5:27:", "did you mean 'cda_mm2'"),
            (
                "at = \"node\"\ngives = \"flow_out_m3_s\"\nlaw = \"if(H",
                "at = \"supply\"\ngives = \"head_m\"\nlaw = \"if(Q",
                "x.toml:5:11:",
                "not known",
            ),
            ("\"node\"", "\"nod\"", "x.toml:3:6:", "node, supply"),
            ("flow_out_m3_s", "head_m", "x.toml:4:9:", "flow_out_m3_s or head_loss_m"),
            ("[20, 200]", "[200, 20]", "x.toml:9:10:", "lesser"),
            ("start = 60", "start = 600", "x.toml:8:9:", "bounds"),
            ("vanishes_at = 0", "vanishes_at = 2", "x.toml:5:7:", "does not vanish"),
            ("vanishes_at = 0\n", "", "x.toml:5:7:", "vanishes_at"),
            ("(H - x) / 0.2", "(H - x) / 0", "x.toml:5:7:", "not a number"),
            ("if(H > set_head_m, ", "max(", "x.toml:5:7:", "not a number"),
            ("unit = \"m\"", "units = \"m\"", "x.toml:7:1:", "unknown field `units`"),
            ("[state.x]", "[state.H]", "x.toml:15:8:", "meaning already"),
            ("name = \"relief-valve\"", "name = \"relief\"", "x.toml:1:8:", "that of the file"),
        ] {
            let said = read(&RELIEF.replacen(from, to, 1), "x.toml", "relief-valve").unwrap_err();
            assert!(said.starts_with(place) && said.contains(words), "{from} -> {to}: {said}");
        }
    }
}
