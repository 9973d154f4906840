//! `simulate --energy`: the energy book as a file and in a sentence.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use serde_json::{Value, json};

use super::values::rounded;
use crate::model::energy::Energy;

/// Writes one row a time, in J; an older file of that name is replaced.
///
/// # Errors
/// A file that cannot be written.
pub fn write_csv(energy: &Energy, path: &Path, times_s: impl Iterator<Item = f64>) -> Result<(), String> {
    let file = File::create(path).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    rows(energy, BufWriter::new(file), times_s).map_err(|e| format!("writing {}: {e}", path.display()))
}

fn rows(energy: &Energy, mut out: impl Write, times_s: impl Iterator<Item = f64>) -> std::io::Result<()> {
    writeln!(out, "time_s,{}", energy.columns().join(","))?;
    for time_s in times_s {
        write!(out, "{}", rounded(time_s))?;
        for value in energy.at(time_s) {
            write!(out, ",{}", rounded(value))?;
        }
        writeln!(out)?;
    }
    out.flush()
}

/// What came in and who has taken it by the end, in a sentence.
pub fn sentence(energy: &Energy, duration_s: f64) -> String {
    let takers = energy.takers(duration_s);
    // What gives more than it takes (water drawn in) comes in beside the flow's own energy.
    let whole: f64 = takers.iter().map(|t| t.1.max(0.0)).sum();
    let shares: Vec<String> =
        takers.iter().map(|(name, joules)| format!("{name} {:.1}%", 100.0 * joules / whole)).collect();
    format!(
        "energy: {:.4} J of motion before the closure, {:+.4} J from the supply; after {duration_s:.3} s: {}; unaccounted for at \
         most {:.0e} of the motion",
        energy.initial_kinetic_j(),
        energy.supplied_j(duration_s),
        shares.join(", "),
        energy.largest_imbalance_j() / energy.initial_kinetic_j(),
    )
}

/// The same as JSON, J.
pub fn json(energy: &Energy, duration_s: f64, file: &Path) -> Value {
    let takers: serde_json::Map<String, Value> =
        energy.takers(duration_s).into_iter().map(|(name, joules)| (name, json!(joules))).collect();
    json!({
        "file": file,
        "initial_kinetic_J": energy.initial_kinetic_j(),
        "supplied_J": energy.supplied_j(duration_s),
        "taken_J": takers,
        "largest_imbalance_J": energy.largest_imbalance_j(),
    })
}
