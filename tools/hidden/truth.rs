//! The parameters that a fit of the case should find, under the names and in the units that the program gives them.

use std::error::Error;
use std::path::Path;

use serde_json::{Value, json};
use surgescope::rig::{Rig, darcy_friction_factor};

use super::rig::Case;

/// `{"shared": {name: value}, "runs": {file: {name: value}}}`; retardation times ascend. Friction has the units of what
/// the program takes for a smooth pipe, compliance for the constraint that it takes from the rig file: the case's own
/// are 0.316/Re^0.25 and 1.
///
/// # Errors
/// A rig file that was not written before.
pub fn of(case: &Case, folder: &Path) -> Result<Value, Box<dyn Error + Send + Sync>> {
    let rig = Rig::load(&folder.join("rig.toml"))?;
    let water = rig.fluid.properties(case.temperature_c);
    let mut shared = json!({"wave_speed_m_s": case.wave_speed_m_s});
    for (k, (compliance, tau_s)) in case.creep.iter().enumerate() {
        shared[format!("J{}_per_GPa", k + 1)] = json!(1e9 * compliance / rig.pipes[0].constraint_coefficient());
        shared[format!("tau{}_s", k + 1)] = json!(tau_s);
    }
    let mut runs = json!({});
    for (file, velocity) in [("run", Some(case.velocity_m_s)), ("run2", case.second_velocity_m_s)] {
        let Some(velocity) = velocity else { continue };
        let reynolds = velocity * case.diameter_m / water.kinematic_viscosity_m2_s;
        runs[file] = json!({
            "initial_velocity_m_s": velocity,
            "valve_head_m": case.valve_head_m,
            "closing_time_s": case.closing_s,
            "friction_scale": case.friction_factor(velocity) / darcy_friction_factor(reynolds, 0.0),
            "closure_start_s": case.lead_s,
        });
    }
    Ok(json!({"shared": shared, "runs": runs}))
}
