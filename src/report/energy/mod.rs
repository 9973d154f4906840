//! The energy book of a simulation as a file, as JSON and in a sentence.

use std::io::Write;
use std::path::Path;

use serde_json::{Value, json};

use crate::model::energy::Energy;
use crate::report::text::number::rounded;

/// Writes one row a time, in J.
///
/// # Errors
/// As `out`.
pub fn write_csv(energy: &Energy, mut out: impl Write, times_s: impl Iterator<Item = f64>) -> std::io::Result<()> {
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
    let shares: Vec<String> =
        energy.shares(duration_s).iter().map(|(name, share)| format!("{name} {:.1}%", 100.0 * share)).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;
    use crate::simulate::scenario::{Scenario, ValveForm};

    #[test]
    fn every_row_of_the_file_balances_and_the_shares_add_up() {
        let rig = Rig::from_toml(include_str!("../../../rigs/imperial-pe.toml"), "imperial-pe.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let scenario = Scenario::new(rig, &effects, ValveForm::FlowCycloid, &[("reaches".into(), 60.0)]).unwrap();
        let energy = scenario.simulate_with(3.0, true).unwrap().1.unwrap();
        let mut text = Vec::new();
        write_csv(&energy, &mut text, (0..=30).map(|i| 0.1 * f64::from(i))).unwrap();
        let text = String::from_utf8(text).unwrap();
        let mut lines = text.lines();
        let head = "time_s,kinetic_J,elastic_J,supply_J,valve_J,friction_J,viscoelastic-wall_J,unbalanced_J";
        assert_eq!(lines.next().unwrap(), head);
        let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|c| c.parse().unwrap()).collect()).collect();
        assert_eq!(rows.len(), 31);
        let initial = rows[0][1];
        for row in &rows {
            let balance = row[1] + row[2] - row[3] + row[4] + row[5] + row[6];
            assert!((balance - initial).abs() < 1e-6 * initial, "{row:?}");
        }
        assert!(rows[30][6] > 0.1 * initial, "the wall has taken a good part: {:?}", rows[30]);
        let taken: f64 = energy.takers(3.0).iter().map(|t| t.1).sum();
        assert!((taken - initial - energy.supplied_j(3.0)).abs() < 1e-6 * initial);
        let said = sentence(&energy, 3.0);
        assert!(said.contains("viscoelastic-wall") && said.contains("left in the line"), "{said}");
        assert_eq!(json(&energy, 3.0, Path::new("energy.csv"))["initial_kinetic_J"], energy.initial_kinetic_j());
    }
}
