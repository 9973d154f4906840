//! The parameters, observations and priors of a problem under the names that PEST takes, and its template and
//! instructions.

use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::observed::{Observation, observations};
use crate::model::parameter::Scale;
use crate::report::pest::form::{LONGEST, LONGEST_OBSERVATION, fixed, number};
use crate::report::pest::names::Names;
use crate::report::pest::observations::Table;
use crate::rig::Rig;

/// A calibration as a problem of PEST.
pub struct Case<'a> {
    pub(crate) problem: &'a FitProblem<'a>,
    rig: &'a Rig,
    /// Value of each parameter.
    pub(crate) values: &'a [f64],
    /// What each run's recording is called in the folder.
    pub(crate) files: &'a [String],
    /// The model command.
    pub(crate) command: &'a str,
    /// PEST's names of the parameters.
    pub(crate) parameter_names: Vec<String>,
    pub(crate) observations: Vec<Named>,
    pub(crate) observation_groups: Vec<String>,
    pub(crate) priors: Vec<PriorInformation>,
}

/// An observation with PEST's names of it and of its group.
pub(crate) struct Named {
    pub(crate) observation: Observation,
    pub(crate) name: String,
    pub(crate) group: usize,
}

/// `name  1.0 * parameter = value  weight  group`.
pub(crate) struct PriorInformation {
    pub(crate) name: String,
    pub(crate) equation: String,
    pub(crate) weight: f64,
}

/// Sizes of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Parameters, fixed ones too.
    pub parameters: usize,
    /// Observations.
    pub observations: usize,
    /// Prior information.
    pub priors: usize,
}

impl<'a> Case<'a> {
    /// `problem` at `values`, whose runs' recordings are `files`, simulated by `command`.
    pub fn new(
        problem: &'a FitProblem<'a>,
        rig: &'a Rig,
        values: &'a [f64],
        files: &'a [String],
        command: &'a str,
    ) -> Self {
        let table = Table { rig, runs: problem.runs, files };
        let mut parameters = Names::new(LONGEST);
        let several = problem.runs.len() > 1;
        let suffix = |j: usize| problem.run_of(j).filter(|_| several).map_or(String::new(), |r| format!("_r{}", r + 1));
        let parameter_names: Vec<String> =
            problem.parameters.iter().enumerate().map(|(j, p)| parameters.take(&p.name, &suffix(j))).collect();
        let priors = priors(problem, &parameter_names);
        let (mut groups, mut own) = (Names::new(LONGEST), Vec::new());
        let mut observation_groups: Vec<String> = Vec::new();
        let (mut last, mut count) = (None, 0);
        for observation in observations(problem) {
            let place = observation.place;
            if last != Some((place.run, place.gauge)) {
                (last, count) = (Some((place.run, place.gauge)), 0);
                observation_groups.push(groups.take(table.gauge(&place).0, &format!("_r{}", place.run + 1)));
            }
            count += 1;
            let group = observation_groups.len() - 1;
            let name = format!("{}_{count}", observation_groups[group]);
            debug_assert!(name.len() <= LONGEST_OBSERVATION);
            own.push(Named { observation, name, group });
        }
        Case { problem, rig, values, files, command, parameter_names, observations: own, observation_groups, priors }
    }

    /// How large it is.
    pub fn size(&self) -> Size {
        Size {
            parameters: self.parameter_names.len(),
            observations: self.observations.len(),
            priors: self.priors.len(),
        }
    }

    fn table(&self) -> Table<'_> {
        Table { rig: self.rig, runs: self.problem.runs, files: self.files }
    }

    /// What was measured.
    pub fn measured(&self) -> String {
        self.table().text(self.observations.iter().map(|n| (n.observation.place, n.observation.measured)))
    }

    /// How PEST reads the model's output: the number after the last comma of each row.
    pub fn instructions(&self) -> String {
        let table = self.table();
        let mut text = "pif ~\n".to_owned();
        for (i, named) in self.observations.iter().enumerate() {
            // The first row stands below the header.
            let lines = if i == 0 { 2 } else { 1 };
            let commas = table.row(&named.observation.place, 0.0).matches(',').count();
            text += &format!("l{lines}{} !{}!\n", " ~,~".repeat(commas), named.name);
        }
        text
    }

    /// The file of values with a place for each parameter.
    pub fn template(&self) -> String {
        let mark = |j: usize| format!("~{:^23}~", self.parameter_names[j]);
        format!("ptf ~\n{}", self.with_values(mark))
    }

    /// The file of values as it stands before PEST has moved any.
    pub fn values(&self) -> String {
        self.with_values(|j| number(self.values[j]))
    }

    /// Shared parameters, then each run's below its name.
    fn with_values(&self, value: impl Fn(usize) -> String) -> String {
        let mut text =
            "# values of a surgescope model: those that all runs share, then each recording's own\n".to_owned();
        let mut run = None;
        for (j, parameter) in self.problem.parameters.iter().enumerate() {
            if self.problem.run_of(j) != run {
                run = self.problem.run_of(j);
                text += &run.map_or(String::new(), |r| format!("[{}]\n", self.files[r]));
            }
            text += &format!("{} = {}\n", parameter.name, value(j));
        }
        text
    }
}

/// What is known of parameters that are not fixed. PEST's logarithms are to the base of ten.
fn priors(problem: &FitProblem, names: &[String]) -> Vec<PriorInformation> {
    let known = problem.parameters.iter().zip(names).filter(|(p, _)| !fixed(p));
    known
        .filter_map(|(p, name)| {
            let (mean, sd) = p.prior?;
            let (equation, weight) = match p.scale {
                Scale::Linear => (format!("1.0 * {name} = {}", number(mean)), 1.0 / sd),
                Scale::Log => (format!("1.0 * log({name}) = {}", number(mean.log10())), std::f64::consts::LN_10 / sd),
            };
            Some(PriorInformation { name: format!("pi_{name}"), equation, weight })
        })
        .collect()
}
