//! The control file, and what the folder says to people.

use crate::fit::numeric::least_squares::Problem as _;
use crate::model::parameter::Scale;
use crate::report::pest::case::{Case, PriorInformation};
use crate::report::pest::form::{LONGEST, file, fixed, number};
use crate::report::pest::names::Names;

/// How much more than a step of our own differences PEST takes: what it writes and reads passes through text.
const STEP_FACTOR: f64 = 10.0;
/// Group of the parameters that are moved as logarithms.
const LOG_GROUP: &str = "log";
/// Group of the prior information.
const PRIOR_GROUP: &str = "priors";

/// The control file.
pub fn control(case: &Case) -> String {
    let groups = parameter_groups(case);
    let size = case.size();
    let prior_groups = usize::from(size.priors > 0);
    let mut lines = vec!["pcf".to_owned(), "* control data".to_owned(), "restart estimation".to_owned()];
    lines.push(format!(
        "{} {} {} {} {}",
        size.parameters,
        size.observations,
        groups.len(),
        size.priors,
        case.observation_groups.len() + prior_groups
    ));
    // One template, one instruction file, one model command; then how PEST searches, as its manual proposes.
    let searched =
        ["1 1 double point 1 0 0", "10.0 -3.0 0.3 0.03 10", "10.0 10.0 0.001", "0.1", "30 0.005 4 4 0.005 4", "1 1 1"];
    lines.extend(searched.map(str::to_owned));
    lines.push("* parameter groups".to_owned());
    lines.extend(groups.iter().map(|g| format!("{} {} {} 0.0 switch 2.0 parabolic", g.name, g.kind, number(g.step))));
    lines.push("* parameter data".to_owned());
    lines.extend(parameter_data(case, &groups));
    lines.push("* observation groups".to_owned());
    lines.extend(case.observation_groups.iter().cloned());
    lines.extend((prior_groups > 0).then(|| PRIOR_GROUP.to_owned()));
    lines.push("* observation data".to_owned());
    lines.extend(case.observations.iter().map(|n| {
        let (measured, weight) = (number(n.observation.measured), number(1.0 / n.observation.sd));
        format!("{} {measured} {weight} {}", n.name, case.observation_groups[n.group])
    }));
    lines.extend(["* model command line", case.command, "* model input/output"].map(str::to_owned));
    lines.push(format!("{} {}", file::TEMPLATE, file::VALUES));
    lines.push(format!("{} {}", file::INSTRUCTIONS, file::MODELLED));
    if size.priors > 0 {
        lines.push("* prior information".to_owned());
        let equation = |p: &PriorInformation| format!("{} {} {} {PRIOR_GROUP}", p.name, p.equation, number(p.weight));
        lines.extend(case.priors.iter().map(equation));
    }
    lines.join("\n") + "\n"
}

fn parameter_data<'a>(case: &'a Case, groups: &'a [Group]) -> impl Iterator<Item = String> + 'a {
    case.problem.parameters.iter().enumerate().map(|(j, p)| {
        let transform = match (fixed(p), p.scale) {
            (true, _) => "fixed",
            (false, Scale::Log) => "log",
            (false, Scale::Linear) => "none",
        };
        // Limits of a step by a factor are for what cannot change its sign.
        let limit = if p.scale == Scale::Log { "factor" } else { "relative" };
        // What is fixed has no range; PEST wants one all the same.
        let (lower, upper) = if fixed(p) { around(p.lower) } else { (p.lower, p.upper) };
        let group = &groups.iter().find(|g| g.parameters.contains(&j)).map_or("none", |g| &g.name);
        let [value, lower, upper] = [case.values[j], lower, upper].map(number);
        format!("{} {transform} {limit} {value} {lower} {upper} {group} 1.0 0.0 1", case.parameter_names[j])
    })
}

/// All that are moved as logarithms have one step; of the others, those of one name.
fn parameter_groups(case: &Case) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let mut names = Names::new(LONGEST);
    names.take(LOG_GROUP, "");
    for (j, p) in case.problem.parameters.iter().enumerate() {
        let stem = p.name.split('[').next().unwrap_or(&p.name);
        let (of, kind) = match p.scale {
            Scale::Log => (LOG_GROUP, "relative"),
            Scale::Linear => (stem, "absolute"),
        };
        match groups.iter_mut().find(|g| g.of == of) {
            Some(group) => group.parameters.push(j),
            None => groups.push(Group {
                of: of.to_owned(),
                name: if of == LOG_GROUP { of.to_owned() } else { names.take(of, "") },
                kind,
                step: STEP_FACTOR * case.problem.difference_step(j),
                parameters: vec![j],
            }),
        }
    }
    groups
}

/// What stands in the folder. `every`: of how many samples one is an observation.
pub fn readme(case: &Case, sources: &[String], every: usize) -> String {
    let runs = case.files.iter().zip(sources).map(|(file, source)| format!("  {file}: {source}\n"));
    let samples = if every == 1 { "every sample".to_owned() } else { format!("one of {every} samples") };
    format!(
        "A calibration of surgescope as a problem of PEST, PEST++ or pyEMU.\n\n\
         Run it in this folder, with surgescope on the PATH: pestpp-glm {control} (PEST++), pest {control} (PEST),\n\
         or in Python: pyemu.Pst(\"{control}\"). The model command alone, at the values of {values}:\n  {command}\n\n\
         Recordings:\n{runs}\n\
         {control}: control file; names are cut to what PEST takes, {template} shows whose they are.\n\
         {template}, {values}: template and values, as `surgescope simulate --values` reads them.\n\
         {measured}: the observations, {samples} from shortly before the closure, heads in m, and flows before the closure in m3/s.\n\
         {instructions}, {modelled}: how to read what the model shows, in the same rows.\n\n\
         Weights are one over the standard deviation of each sensor's noise; prior information is what the calibration takes for known.\n\
         The objective function is thus the sum of squares that `surgescope calibrate` minimises. The model's grid is fixed.\n",
        control = file::CONTROL,
        values = file::VALUES,
        template = file::TEMPLATE,
        measured = file::MEASURED,
        modelled = file::MODELLED,
        instructions = file::INSTRUCTIONS,
        command = case.command,
        runs = runs.collect::<String>(),
    )
}

/// Parameters that PEST differentiates by one rule.
struct Group {
    /// What its parameters have in common.
    of: String,
    name: String,
    /// `relative` or `absolute`.
    kind: &'static str,
    /// Step of the difference.
    step: f64,
    /// Indices of its parameters.
    parameters: Vec<usize>,
}

/// A range around a value that does not move; of one sign, as a factor's must be.
fn around(value: f64) -> (f64, f64) {
    if value == 0.0 { (-1.0, 1.0) } else { (value - 0.5 * value.abs(), value + 0.5 * value.abs()) }
}
