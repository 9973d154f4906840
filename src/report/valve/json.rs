//! How a valve closed, as JSON.

use serde_json::json;

use crate::fit::problem::valve_curve::TwoStage;
use crate::valve::curve::ValveClosure;
use crate::valve::shift::{LawError, Shift};

/// The closure of one run.
pub fn document(closure: &ValveClosure) -> serde_json::Value {
    let error = |e: LawError| json!({ "first_rise_rms_m": e.first_rise_m, "record_rms_m": e.record_m });
    let shift = |s: &Shift| {
        json!({
            "what": s.what, "largest_change_of_opening": s.largest, "rms_change_of_opening": s.rms,
            "effective_closing_time_s": s.effective_closing_s, "two_stage": two_stage(s.two_stage),
            "time_s": s.curve.time_s, "opening": s.curve.opening,
        })
    };
    json!({
        "file": closure.file,
        "sensor": closure.sensor,
        "fitted_closing_time_s": closure.fitted_closing_s,
        "effective_closing_time_s": closure.effective_closing_s,
        "two_stage": two_stage(closure.two_stage),
        "errors": { "fitted": error(closure.errors.fitted), "two_stage": error(closure.errors.two_stage),
                    "curve": error(closure.errors.curve) },
        "shifts": closure.shifts.iter().map(shift).collect::<Vec<_>>(),
        "time_s": closure.curve.time_s,
        "velocity_m_s": closure.curve.velocity_m_s,
        "opening": closure.curve.opening,
    })
}

fn two_stage(law: TwoStage) -> serde_json::Value {
    json!({ "inflection_s": law.inflection_s, "inflection_opening": law.inflection_opening,
            "closing_time_s": law.closing_s, "rms_of_opening": law.rms, "straight": law.straight() })
}
