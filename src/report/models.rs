//! A file of models as JSON and as text: which there are, how well each does, which one is in force.

use std::fmt::Write;

use serde::Serialize;

use crate::report::text::number::{error_m, grouped, significant, times, with_error};
use crate::results::model_file::{Entry, ModelFile};
use crate::shown::Shown as _;

/// What `--json` prints of a file of models.
#[derive(Serialize)]
pub struct Document<'a> {
    in_force: usize,
    models: &'a [Entry],
}

/// The JSON document.
pub fn document(file: &ModelFile) -> Document<'_> {
    Document { in_force: file.in_force, models: &file.models }
}

/// The models, one a line, the one in force marked, then its parameters.
pub fn text(file: &ModelFile) -> String {
    let mut out = String::from("    no  from   RMSE, m  × noise     ln odds  model\n");
    for (i, model) in file.models.iter().enumerate() {
        let mark = if i + 1 == file.in_force { '*' } else { ' ' };
        let from = model.grown_from.map_or(String::new(), |n| n.to_string());
        let evidence = model.evidence.map_or(String::new(), grouped);
        let _ = writeln!(
            out,
            "{mark} {:>4}  {from:>4}  {:>8} {:>8}  {evidence:>10}  {}   {} ({})",
            i + 1,
            error_m(model.rmse_m),
            times(model.rmse_m, model.noise_m),
            model.name.shown(),
            model.why.shown(),
            model.when
        );
    }
    out.push_str("\nin force:\n");
    for p in &file.current().parameters {
        let run = p.run.as_ref().map_or(String::new(), |r| format!(" ({r})"));
        let value = p.standard_error.map_or_else(|| significant(p.value, 5), |error| with_error(p.value, error));
        let _ = writeln!(out, "  {}{run} = {value}   {}", p.name, p.source);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_values_keep_their_digits() {
        let parameter = |name: &str, value: &str, error: &str| {
            format!(
                "[[model.parameter]]\nname = \"{name}\"\nvalue = {value}\n{error}lower = 1e-9\nupper = 1e9\nfixed = false\nsource = \"fitted\"\n"
            )
        };
        let toml = "in_force = 1\nrecordings = [\"a.mcap\"]\n[[model]]\nname = \"m\"\nwhen = \"2026-01-01T00:00:00Z\"\nwhy = \"calibrated\"\n\
                    effects = [\"viscoelastic-wall:1\"]\nrmse_m = 0.1\nnoise_m = 0.1\n"
            .to_owned()
            + &parameter("J1_per_GPa", "3.99e-7", "")
            + &parameter("tau1_s", "0.000531154", "standard_error = 1.4e-5\n");
        let said = text(&ModelFile::parse(&toml, std::path::Path::new("m.toml")).unwrap());
        assert!(said.contains("  J1_per_GPa = 3.9900e-7   fitted\n"), "{said}");
        assert!(said.contains("  tau1_s = 0.000531(14)   fitted\n"), "{said}");
    }
}
