//! The document of `inspect --json`.

use serde_json::{Value, json};

use crate::recording::Recording;
use crate::signal::doubts::doubts;
use crate::signal::{Crossings, Estimate, Features, SensorFeatures};

fn estimate(e: Estimate) -> Value {
    json!({ "value": e.value, "standard_error": e.standard_error })
}

/// What a recording shows.
pub fn document(recording: &Recording, f: &Features) -> Value {
    let crossings = f.wave_speed.crossings;
    let found = |value: fn(Crossings) -> f64| crossings.map(value);
    // a slow closure's front carries no number, but it says that it is slow
    let crossings = (crossings.is_some() || f.closure.slow).then(|| {
        json!({ "value": found(|c| c.value), "standard_error": found(|c| c.standard_error), "low": found(|c| c.low),
                "high": found(|c| c.high), "slow_closure": f.closure.slow })
    });
    json!({
        "notes": recording.run.notes.iter().map(|(k, v)| json!({ "key": k, "value": v })).collect::<Vec<_>>(),
        "temperature_degC": f.temperature_degc,
        "closure": {
            "start_s": f.closure.start_s,
            "start_standard_error_s": f.closure.start_se_s,
            "end_s": f.closure.end_s,
            "slow": f.closure.slow,
            "from_trigger": f.closure.from_trigger,
            "pressure_onset_s": f.closure.pressure_onset_s,
        },
        "flow_m3_s": f.flow_m3_s.map(estimate),
        "steady_velocity_m_s": f.steady_velocity_m_s.map(estimate),
        "period_s": f.period.map(estimate),
        "damping_per_cycle": f.damping_per_cycle,
        "wave_speed_m_s": {
            "joukowsky": f.wave_speed.joukowsky.map(estimate),
            "crossings": crossings,
            "arrival": f.wave_speed.arrival.map(estimate),
            "period": f.wave_speed.period.map(estimate),
        },
        "reference_sensor": f.sensors.get(f.reference).map(|s| &s.name),
        "doubts": doubts(&recording.rig, f),
        "sensors": f.sensors.iter().map(|s| sensor(recording, s)).collect::<Vec<_>>(),
    })
}

fn sensor(recording: &Recording, s: &SensorFeatures) -> Value {
    let extrema: Vec<Value> = s
        .extrema
        .iter()
        .map(|e| json!({ "cycle": e.cycle, "peak": e.peak, "time_s": e.time_s, "head_m": e.head_m }))
        .collect();
    json!({
        "name": s.name,
        "position_m": s.position_m,
        "samples": s.samples,
        "gaps": recording.series[s.sensor].gaps.len(),
        "interval_s": s.interval_s,
        "noise": {
            "white_sd_m": s.noise.white_sd_m,
            "total_sd_m": s.noise.total_sd_m,
            "coloured": s.noise.coloured,
            "lag1_autocorrelation": s.noise.lag1_autocorrelation,
            "effective_fraction": s.noise.effective_fraction,
            "quantum_m": s.noise.quantum_m,
            "interpolated_share": s.noise.corners.map(|corners| 1.0 - corners.share),
            "hum": s.noise.hum,
            "without_hum": { "white_sd_m": s.noise.without_hum_m[0], "total_sd_m": s.noise.without_hum_m[1] },
            "line": s.noise.lines.first(),
        },
        "steady_before_m": estimate(s.steady_before_m),
        "steady_after_m": s.steady_after_m.map(estimate),
        "front_arrival_s": s.front_arrival_s.map(estimate),
        "first_peak": s.first_peak.map(|e| json!({ "time_s": e.time_s, "head_m": e.head_m })),
        "extrema": extrema,
        "damping_per_cycle": s.damping_per_cycle,
    })
}
