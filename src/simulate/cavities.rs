//! Without the physics of cavities a head below vapour pressure is a number, not water.

use crate::model::effects::{ATMOSPHERE_PA, boils};
use crate::model::trace::Trace;
use crate::number::duration;
use crate::rig::Coupling;
use crate::simulate::scenario::Scenario;
use crate::units::GRAVITY_M_S2;

/// A sentence for each pressure sensor whose `traces`, as the scenario gives them, fall below vapour pressure although
/// its water cannot boil.
pub fn unmodelled(scenario: &Scenario, traces: &[Trace]) -> Vec<String> {
    if boils(&scenario.effects) {
        return Vec::new();
    }
    let least_pa = scenario.water.vapour_pressure_pa - ATMOSPHERE_PA;
    // A piezoelectric sensor shows no head to judge by.
    let steady = scenario.rig.pressure_sensors().zip(traces).filter(|((_, s), _)| s.coupling == Coupling::Dc);
    let of = |((_, sensor), trace): ((usize, &crate::rig::Sensor), &Trace)| {
        let elevation_m = scenario.rig.sensor_elevation_m(sensor);
        let least_head_m = elevation_m + least_pa / (scenario.water.density_kg_m3 * GRAVITY_M_S2);
        let step = trace.values.iter().position(|&h| h < least_head_m)?;
        Some(format!(
            "at {} the pressure falls below vapour pressure {} after the start of the closure; this model does not let the water boil, so what \
             follows is not physical: add vapour-cavity, or take a lower velocity or a higher head",
            sensor.name,
            duration(step as f64 * trace.dt_s)
        ))
    };
    steady.filter_map(of).collect()
}
