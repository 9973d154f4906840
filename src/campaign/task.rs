//! A task: one fit, diagnosis or simulation. Its name is a hash of all that decides its result, so that equal tasks
//! have equal names anywhere.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::campaign::checksum::hexadecimal;
use crate::rig::own_effects::stem;

/// A line of `tasks.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Its name: the first 64 bits of the SHA-256 of kind, effects, options, seed and the checksums of the inputs, as
    /// 16 hexadecimal digits.
    pub task: String,
    /// What people call the recordings or the rig.
    pub case: String,
    /// Recordings that are used together; none of a simulation.
    pub recordings: Vec<Input>,
    /// The rig, where it is not the one that the recordings hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<Input>,
    /// Effects of the model; none are the base model alone.
    pub effects: Vec<String>,
    /// What is done.
    #[serde(flatten)]
    pub work: Work,
}

/// A file that goes into a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// As the plan names it: relative to the plan's folder.
    pub name: String,
    /// Where it is; relative to the campaign's folder where it was copied.
    pub path: PathBuf,
    /// SHA-256 of its content.
    pub sha256: String,
    /// The effects of one's own in the folder `effects` beside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<Input>,
}

impl Input {
    /// What it decides of a result: its checksum, or that of all checksums where there are effects beside it.
    pub fn identity(&self) -> String {
        let beside = self.effects.iter().map(|effect| format!("{} {}\n", stem(&effect.path), effect.sha256));
        match self.effects.is_empty() {
            true => self.sha256.clone(),
            false => hexadecimal(std::iter::once(self.sha256.clone()).chain(beside).collect::<String>().as_bytes()),
        }
    }
}

/// What is done, with everything that its result depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Work {
    /// A fit.
    Calibrate {
        /// How it searches.
        method: String,
        /// Seed of its random draws; none where it draws nothing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
        /// Most simulations of a search over the whole range.
        budget: usize,
        /// `time` or `frequency`.
        misfit: String,
        /// What all fits have.
        #[serde(flatten)]
        fit: FitOptions,
    },
    /// What a fitted model lacks.
    Diagnose {
        /// Seed of its random draws; none where it draws nothing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
        /// What all fits have.
        #[serde(flatten)]
        fit: FitOptions,
    },
    /// A diagnosis whose answer is known.
    Reliability {
        /// The effect that is hidden in the recordings, `nothing`, or `unknown` for one that is not in the catalogue.
        truth: String,
        /// Seed of its random draws; none where it draws nothing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        seed: Option<u64>,
        /// What all fits have.
        #[serde(flatten)]
        fit: FitOptions,
    },
    /// A closure on a rig.
    Simulate {
        /// Values of settings; what is not among them is the rig's or a default.
        set: BTreeMap<String, f64>,
    },
    /// Which parameter moves what.
    Sensitivity {
        /// `morris` or `sobol`.
        method: String,
        /// Seed of its random draws.
        seed: u64,
        /// Values around which the model is studied.
        set: BTreeMap<String, f64>,
        /// Ranges of parameters.
        range: BTreeMap<String, [f64; 2]>,
        /// Parameters that vary; none are all.
        only: Vec<String>,
        /// All others vary by this factor to either side.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        within: Option<f64>,
        /// The sensor that is read; none is the one nearest to the valve.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sensor: Option<String>,
        /// Trajectories of Morris, or rows of Sobol.
        size: usize,
    },
}

/// Options of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitOptions {
    /// Random starts of least squares beside those from the signals.
    pub random_starts: usize,
    /// Finest grid.
    pub most_reaches: usize,
    /// Parameters that are held at a value or between two.
    pub hold: BTreeMap<String, [f64; 2]>,
    /// Sensors that are left out.
    pub ignore: Vec<String>,
}

impl Work {
    /// As the plan file names it.
    pub fn kind(&self) -> &'static str {
        match self {
            Work::Calibrate { .. } => "calibrate",
            Work::Diagnose { .. } => "diagnose",
            Work::Reliability { .. } => "reliability",
            Work::Simulate { .. } => "simulate",
            Work::Sensitivity { .. } => "sensitivity",
        }
    }

    /// How it searches or draws.
    pub fn method(&self) -> Option<&str> {
        match self {
            Work::Calibrate { method, .. } | Work::Sensitivity { method, .. } => Some(method),
            _ => None,
        }
    }

    /// Seed of its random draws.
    pub fn seed(&self) -> Option<u64> {
        match self {
            Work::Calibrate { seed, .. } | Work::Diagnose { seed, .. } | Work::Reliability { seed, .. } => *seed,
            Work::Sensitivity { seed, .. } => Some(*seed),
            Work::Simulate { .. } => None,
        }
    }
}

impl Task {
    /// A task with its name.
    ///
    /// # Errors
    /// None in practice: all values can be written.
    pub fn new(
        case: String,
        recordings: Vec<Input>,
        rig: Option<Input>,
        effects: Vec<String>,
        work: Work,
    ) -> serde_json::Result<Task> {
        let checksums: Vec<String> = recordings.iter().map(Input::identity).collect();
        let content = serde_json::to_vec(&(&effects, &work, checksums, rig.as_ref().map(Input::identity)))?;
        let task = hexadecimal(&content)[..16].to_owned();
        Ok(Task { task, case, recordings, rig, effects, work })
    }

    /// All its files.
    pub fn inputs(&self) -> impl Iterator<Item = &Input> {
        self.recordings.iter().chain(&self.rig)
    }

    /// The effects as a list on the command line.
    pub fn list_of_effects(&self) -> String {
        if self.effects.is_empty() { "none".to_owned() } else { self.effects.join(",") }
    }

    /// In a line, for people.
    pub fn in_words(&self) -> String {
        let mut words = format!("{} {}, {}", self.work.kind(), self.case, self.list_of_effects());
        if let Some(method) = self.work.method() {
            words += &format!(", {method}");
        }
        if let Some(seed) = self.work.seed() {
            words += &format!(", seed {seed}");
        }
        if let Work::Simulate { set } = &self.work {
            set.iter().for_each(|(name, value)| words += &format!(", {name}={value}"));
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task(name: &str, sha256: &str, seed: u64) -> Task {
        let input = Input { name: name.into(), path: name.into(), sha256: sha256.into(), effects: Vec::new() };
        let fit = FitOptions { random_starts: 1, most_reaches: 64, hold: BTreeMap::new(), ignore: Vec::new() };
        let work = Work::Diagnose { seed: Some(seed), fit };
        Task::new("a".into(), vec![input], None, vec!["leak".into()], work).unwrap()
    }

    #[test]
    fn the_name_is_of_the_content_and_not_of_the_place() {
        assert_eq!(task("a.mcap", "12", 1).task, task("elsewhere/b.mcap", "12", 1).task);
        let names = [task("a", "12", 1), task("a", "13", 1), task("a", "12", 2)].map(|t| t.task);
        assert!(names[0] != names[1] && names[0] != names[2] && names.iter().all(|n| n.len() == 16), "{names:?}");
    }

    #[test]
    fn a_line_is_read_as_it_was_written() {
        let task = task("a", "12", u64::MAX);
        let line = serde_json::to_string(&task).unwrap();
        assert_eq!(serde_json::from_str::<Task>(&line).unwrap(), task, "{line}");
    }
}
