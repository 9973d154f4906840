//! Reasons to doubt a diagnosis before it begins: a start model that cannot be this rig's, or that was not fitted at
//! all.

use crate::diagnose::limits::NOT_FITTED;
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::validate::conflict::{conflicts, faded_noise, moved_sensors};
use crate::model::effects::Chosen;
use crate::number::error_m;
use crate::rig::Rig;

/// One sentence for each reason to doubt the start model.
pub fn warnings(rig: &Rig, runs: &[RunData], start: &Fit, effects: &[Chosen]) -> Vec<String> {
    let mut warnings = Vec::new();
    let held: Vec<&str> = start.parameters.iter().filter(|p| p.held).map(|p| p.name.as_str()).collect();
    if !held.is_empty() {
        warnings.push(format!(
            "held: {}; an effect may be found only because it makes up for a wrong value",
            held.join(", ")
        ));
    }
    for chosen in effects {
        if let Some(why) = chosen.effect.impossible(rig) {
            warnings.push(format!(
                "{} is in the start model, but {why}: whatever it absorbs belongs to another effect; leave it out of option `effects`",
                chosen.effect.name()
            ));
        }
    }
    let at_bound: Vec<&str> = start.parameters.iter().filter(|p| p.at_bound).map(|p| p.name.as_str()).collect();
    if !at_bound.is_empty() {
        warnings.push(format!(
            "the start model has {} at a bound: check material, length and wall of the pipe, and its effects, before \
             believing what follows",
            at_bound.join(", ")
        ));
    }
    let (rmse_m, signal_m) = (start.pooled().0, signal_m(start));
    if rmse_m > NOT_FITTED * signal_m {
        warnings.push(format!(
            "the start model leaves {} m of a signal that moves by {} m, rms: it does not follow the signal, so its residual \
             says little; start with the effects that are known to be present",
            error_m(rmse_m),
            error_m(signal_m)
        ));
    }
    warnings.extend(conflicts(start, runs));
    warnings.extend(moved_sensors(start).into_iter().filter(|_| start.converged));
    warnings.extend(faded_noise(start));
    warnings
}

/// Deviation of the measured heads from their mean, rms over all samples, m.
fn signal_m(fit: &Fit) -> f64 {
    let (mut square, mut n) = (0.0, 0usize);
    for sensor in fit.runs.iter().flat_map(|r| &r.sensors) {
        let mean = sensor.measured_m.iter().sum::<f64>() / sensor.measured_m.len().max(1) as f64;
        square += sensor.measured_m.iter().map(|h| (h - mean).powi(2)).sum::<f64>();
        n += sensor.measured_m.len();
    }
    (square / n.max(1) as f64).sqrt()
}
