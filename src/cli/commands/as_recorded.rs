//! `simulate --recording`: the model beside recordings, at their temperatures and supplies, at the times of their samples.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::json;

use crate::cli::args::recordings;
use crate::cli::{CommandResult, Outcome};
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::observed::{Place, modelled, observations};
use crate::model::Model;
use crate::model::constraint::Given;
use crate::model::effects::Chosen;
use crate::report::pest::observations::{HEADER, Table};
use crate::simulate::memory;
use crate::storage::output;
use crate::study::open;

/// What the model is to be shown beside.
#[derive(Debug, clap::Args)]
pub struct AsRecorded {
    /// Simulate these recordings instead of a run that is made up, and write a row for each of their samples from shortly before the
    /// closure: file, sensor, time_s, unit, value (the head in m; of a flow meter, the flow before the closure).
    #[arg(long, value_name = "MCAP", num_args = 1.., conflicts_with_all = ["valve", "duration", "csv_times", "energy"])]
    recording: Vec<PathBuf>,
    /// The rows to write, as an older such table has them; its values do not matter.
    #[arg(long, value_name = "CSV", requires = "recording")]
    times: Option<PathBuf>,
}

/// What `simulate` says beside it.
pub struct Asked<'a> {
    /// A rig instead of the one that is stored in the recordings.
    pub rig: Option<&'a Path>,
    /// Effects of the model.
    pub effects: &'a [Chosen],
    /// Values; the first that concerns a parameter counts.
    pub given: &'a [Given],
    /// Where the table goes; standard output otherwise.
    pub output: Option<&'a Path>,
    /// Whether any file there may go.
    pub overwrite: bool,
}

/// Reaches unless `reaches` is set.
const REACHES: usize = 240;

impl AsRecorded {
    /// Whether there are recordings.
    pub fn asked(&self) -> bool {
        !self.recording.is_empty()
    }

    /// Simulates.
    ///
    /// # Errors
    /// Recordings that cannot be read or show no closure, values that the model does not have, a table that may not or cannot be written.
    pub fn run(&self, asked: &Asked, json: bool) -> CommandResult {
        if let Some(path) = asked.output {
            output::check_series(path, HEADER, asked.overwrite, asked.rig.unwrap_or(&self.recording[0]))?;
        }
        let loaded = recordings::load(&self.recording, asked.rig)?;
        let (rig, runs) = (&loaded[0].recording.rig, open::runs(&loaded));
        let files: Vec<String> = loaded.iter().map(|l| l.file.clone()).collect();
        let mut model = Model::new(rig, &runs[0].conditions.water, asked.effects);
        model.memory_limit_bytes = memory::limit_bytes();
        let reaches = reaches(asked.given)?;
        let window = Window { reaches: reaches.unwrap_or(REACHES), horizon_s: f64::INFINITY, stride: 1 };
        let mut problem = FitProblem::new(&model, &runs, window);
        let values = values(&problem, asked.given, &files)?;
        if reaches.is_none() {
            let shared = &values[..model.shared.len()];
            let fitting = model.fitting_reaches(shared, REACHES.max(model.least_reaches(shared)));
            problem.set_window(Window { reaches: fitting, ..window });
        }
        let table = Table { rig, runs: &runs, files: &files };
        let places: Vec<Place> = match &self.times {
            None => observations(&problem).iter().map(|o| o.place).collect(),
            Some(path) => {
                let name = path.display();
                let text = std::fs::read_to_string(path).map_err(|e| format!("cannot read the rows in {name}: {e}"))?;
                table.places(&text, &name.to_string())?
            }
        };
        let start = Instant::now();
        let heads = modelled(&problem, &values, &places)?;
        let seconds = start.elapsed().as_secs_f64();
        let rows = places.len();
        let text = table.text(places.into_iter().zip(heads));
        match asked.output {
            Some(path) => output::write(path, &text)?,
            None if json => {}
            None => crate::cli::say_text!(text),
        }
        if json {
            let own: serde_json::Map<_, _> = problem.parameters[..model.shared.len()]
                .iter()
                .zip(&values)
                .map(|(p, v)| (p.name.clone(), json!(v)))
                .collect();
            let document = json!({
                "file": asked.output,
                "recordings": files,
                "effects": model.effects.iter().map(Chosen::label).collect::<Vec<_>>(),
                "settings": own,
                "reaches": problem.window().reaches,
                "rows": rows,
                "seconds": seconds,
            });
            crate::cli::say!("{document:#}");
        }
        Ok(Outcome::Done)
    }
}

/// What `reaches` is set to.
fn reaches(given: &[Given]) -> Result<Option<usize>, String> {
    let set = given.iter().find(|g| g.name == "reaches" && g.run.is_none());
    set.map(|g| crate::cli::args::values::reaches(&g.value.to_string()).map_err(|e| format!("reaches: {e}")))
        .transpose()
}

/// A value for each of the problem's parameters: as given, or where a fit would start; what was not given is told.
fn values(problem: &FitProblem, given: &[Given], files: &[String]) -> Result<Vec<f64>, String> {
    let run = |j: usize| problem.run_of(j).map(|r| files[r].as_str());
    let own = || problem.parameters.iter().enumerate();
    let strange = |g: &&Given| g.name != "reaches" && !own().any(|(j, p)| g.concerns(&p.name, run(j)));
    if let Some(g) = given.iter().find(strange) {
        let of = g.run.as_ref().map_or(String::new(), |run| format!(" of {run}"));
        let known: BTreeSet<&str> = own().map(|(_, p)| p.name.as_str()).collect();
        let known = known.into_iter().collect::<Vec<_>>().join(", ");
        return Err(format!("the model has no parameter '{}'{of}; of {} it has {known}", g.name, files.join(", ")));
    }
    let mut missing = Vec::new();
    let values = own()
        .map(|(j, p)| match given.iter().find(|g| g.concerns(&p.name, run(j))) {
            Some(g) => g.value,
            None => {
                missing.push(format!("{}={:.6}", p.name, p.start));
                p.start
            }
        })
        .collect();
    if !missing.is_empty() {
        crate::cli::tell!("not set, so where a fit would start: {}", missing.join(" "));
    }
    Ok(values)
}
