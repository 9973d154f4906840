//! An effect as JSON.

use serde_json::{Value, json};

use crate::model::effects::Effect;
use crate::model::parameter::{Parameter, Scale};
use crate::report::effects::example::Example;

/// Name, equation, source and trace of an effect.
pub fn about(effect: &dyn Effect) -> Value {
    json!({
        "name": effect.name(), "summary": effect.summary(), "equation": effect.equation(), "source": effect.source(),
        "trace": effect.trace(), "most_elements": effect.elements().map(|r| *r.end()), "at_sensor": effect.at_sensor(),
        "variants": effect.variants().iter().map(|v| about(*v)).collect::<Vec<_>>(),
        "excludes": effect.excludes().iter().map(|(name, why)| json!({"name": name, "why": why})).collect::<Vec<_>>(),
    })
}

/// A parameter with its bounds.
pub fn described(p: &Parameter) -> Value {
    json!({
        "name": p.name, "unit": p.unit, "about": p.about, "start": p.start, "lower": p.lower, "upper": p.upper,
        "scale": if p.scale == Scale::Log { "log" } else { "linear" }, "vanishes_at": p.vanishes_at,
    })
}

/// The example.
pub fn example(of: &Example) -> Value {
    let (mut times, mut base, mut with) = (Vec::new(), Vec::new(), Vec::new());
    for (t, b, w) in of.points() {
        times.push(t);
        base.push(b);
        with.push(w);
    }
    json!({
        "rig": of.scenario.rig.name, "sensor": of.sensor,
        "settings": of.scenario.values().into_iter().map(|(n, v)| (n, json!(v))).collect::<serde_json::Map<_, _>>(),
        "largest_difference_m": of.largest_difference_m(),
        "time_s": times, "base_m": base, "with_effect_m": with,
    })
}
