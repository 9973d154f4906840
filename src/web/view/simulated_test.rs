//! What may be set of a simulated test before it is recorded.

use std::error::Error;

use serde_json::{Value, json};

use crate::model::effects::parse_list;
use crate::rig::Rig;
use crate::simulate::scenario::{Scenario, ValveForm};

type AnyError = Box<dyn Error + Send + Sync>;

/// The settings of a simulated test on a rig with these effects, each with the value that it has where nothing but
/// `known` is set.
///
/// # Errors
/// Effects that do not exist or exclude each other, a rig that cannot be simulated.
pub fn settings(rig: &Rig, effects: &str, known: &[(String, f64)]) -> Result<Value, AnyError> {
    let scenario = Scenario::new(rig.clone(), &parse_list(effects)?, ValveForm::Linear, known)?;
    let model = scenario.model();
    let values = scenario.values();
    let described = model.shared.iter().chain(&model.per_run).zip(&values);
    let all: Vec<Value> = described
        .map(|(p, (name, value))| json!({ "name": name, "value": value, "unit": p.unit, "about": p.about }))
        .collect();
    Ok(json!({ "rig": rig.name, "length_m": rig.length_m(), "period_s": scenario.period_s(), "settings": all }))
}
