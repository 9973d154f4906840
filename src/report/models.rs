//! A file of models as JSON and as text: which there are, how well each does, which one is in force.

use std::fmt::Write;

use serde::Serialize;

use crate::fit::model_file::{Entry, ModelFile};

#[derive(Serialize)]
struct Document<'a> {
    in_force: usize,
    models: &'a [Entry],
}

/// The JSON document.
///
/// # Errors
/// None in practice: all values can be written.
pub fn json(file: &ModelFile) -> serde_json::Result<String> {
    serde_json::to_string_pretty(&Document { in_force: file.in_force, models: &file.models })
}

/// The models, one a line, the one in force marked, then its parameters.
pub fn text(file: &ModelFile) -> String {
    let mut out = String::from("    no  from      RMSE m  x noise    evidence  model\n");
    for (i, model) in file.models.iter().enumerate() {
        let mark = if i + 1 == file.in_force { '*' } else { ' ' };
        let from = model.grown_from.map_or(String::new(), |n| n.to_string());
        let evidence = model.evidence.map_or(String::new(), |e| format!("{e:.1}"));
        let _ = writeln!(
            out,
            "{mark} {:>4}  {from:>4}  {:>10.4} {:>8.2}  {evidence:>10}  {}   {} ({})",
            i + 1,
            model.rmse_m,
            model.rmse_m / model.noise_m,
            model.name,
            model.why,
            model.when
        );
    }
    out.push_str("\nin force:\n");
    for p in &file.current().parameters {
        let run = p.run.as_ref().map_or(String::new(), |r| format!(" ({r})"));
        let error = p.standard_error.map_or(String::new(), |e| format!(" ± {e:.2e}"));
        let _ = writeln!(out, "  {}{run} = {:.6}{error}   {}", p.name, p.value, p.source);
    }
    out
}
