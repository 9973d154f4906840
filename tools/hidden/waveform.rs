//! What a hidden forcing did: its place and its waveform in every run.

use serde_json::{Value, json};

use super::forcing::Forced;
use super::record::sensed;
use super::rig::{Case, Hidden};
use super::scheme::{Solved, solve};

/// Where a hidden forcing is, its unit and its waveform in every run, with the root mean square of what it does to the
/// sensors over the noise.
pub fn truth(case: &Case) -> Option<Value> {
    let (place, position_m, unit) = match case.hidden.first()? {
        Hidden::Pulsation(..) => ("supply".to_owned(), None, "m"),
        Hidden::Forced(forced) => match forced {
            Forced::SecondPump { at_m, .. } | Forced::ReliefValve { at_m, .. } => ("pipe".into(), Some(*at_m), "m³/s"),
            Forced::ValveReopens { .. } | Forced::OperatorsHand { .. } => ("valve".into(), None, "m³/s"),
            Forced::SwingingCheck { .. } | Forced::FreeSurface { .. } => ("supply".into(), None, "m"),
            Forced::SaturatingSensor { sensor, .. } => (format!("sensor@P{}", sensor + 1), None, "m"),
            Forced::NonlinearWall { .. } => ("wall".into(), None, "1"),
        },
        _ => return None,
    };
    let without = Case {
        hidden: Vec::new(),
        sensors_m: case.sensors_m.clone(),
        name: String::new(),
        creep: case.creep.clone(),
        start_effects: Vec::new(),
        ..*case
    };
    let of = |velocity: f64| {
        let (with, bare) = (solve(case, velocity, case.duration_s), solve(&without, velocity, case.duration_s));
        let lead = if with.heads_m[0].len() > bare.heads_m[0].len() + 2 {
            (case.lead_s / with.dt_s).ceil() as usize
        } else {
            0
        };
        let (mut sum, mut n) = (0.0, 0.0);
        for s in 0..case.sensors_m.len() {
            let shown = sensed(case, s, &with);
            for (a, b) in shown[lead..].iter().zip(&bare.heads_m[s]) {
                sum += (a - b).powi(2);
                n += 1.0;
            }
        }
        let every = (with.forcing.len() / 2000).max(1);
        let waveform = waveform(case, &with);
        let kept: Vec<(f64, f64)> =
            waveform.iter().enumerate().step_by(every).map(|(i, v)| ((i as f64 + 0.5) * with.dt_s, *v)).collect();
        json!({"strength": f64::sqrt(sum / n) / case.noise_m, "time_s": kept.iter().map(|k| k.0).collect::<Vec<_>>(),
               "value": kept.iter().map(|k| k.1).collect::<Vec<_>>()})
    };
    let mut runs = json!({"run": of(case.velocity_m_s)});
    if let Some(velocity) = case.second_velocity_m_s {
        runs["run2"] = of(velocity);
    }
    let hz = if let Hidden::Pulsation(_, hz) = case.hidden[0] { Some(hz) } else { None };
    Some(json!({"where": place, "position_m": position_m, "unit": unit, "frequency_hz": hz, "runs": runs}))
}

/// The waveform from the closure on: what the scheme kept, or what a sensor makes of its head.
fn waveform(case: &Case, solved: &Solved) -> Vec<f64> {
    let Some(Hidden::Forced(Forced::SaturatingSensor { sensor, .. })) = case.hidden.first() else {
        return solved.forcing.clone();
    };
    let shown = sensed(case, *sensor, solved);
    shown.iter().zip(&solved.heads_m[*sensor]).map(|(a, b)| a - b).collect()
}
