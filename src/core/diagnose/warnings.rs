//! What makes a diagnosis doubtful before it begins: a start model that cannot be this rig's, or was not fitted at all.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::with_more_elements;
use crate::fit::search::options::Options;
use crate::fit::validate::conflict::{conflicts, faded_noise};
use crate::model::effects::Chosen;
use crate::rig::Rig;

/// Share of the signal's own deviation, rms, that a fitted model cannot leave.
const NOT_FITTED: f64 = 0.5;

/// One sentence a doubt about the start model.
pub fn doubts(rig: &Rig, runs: &[RunData], start: &Fit, effects: &[Chosen], options: &Options) -> Vec<String> {
    let mut doubts = Vec::new();
    let held: Vec<&str> = start.parameters.iter().filter(|p| p.held).map(|p| p.name.as_str()).collect();
    if !held.is_empty() {
        doubts.push(format!("held: {}; an effect that is found may make up for a value that is off", held.join(", ")));
    }
    doubts.extend(too_few_elements(rig, runs, start, effects, options));
    for chosen in effects {
        if let Some(why) = chosen.effect.impossible(rig) {
            doubts.push(format!(
                "{} is in the start model, but {why}: what it takes up belongs to another effect; leave it out of --effects",
                chosen.effect.name()
            ));
        }
    }
    let at_bound: Vec<&str> = start.parameters.iter().filter(|p| p.at_bound).map(|p| p.name.as_str()).collect();
    if !at_bound.is_empty() {
        doubts.push(format!(
            "the start model has {} at a bound: check material, length and wall of the pipe, and the effects it starts with, before \
             believing what follows",
            at_bound.join(", ")
        ));
    }
    let (rmse_m, signal_m) = (start.pooled().0, signal_m(start));
    if rmse_m > NOT_FITTED * signal_m {
        doubts.push(format!(
            "the start model leaves {rmse_m:.3} m of a signal that moves by {signal_m:.3} m, rms: it follows nothing, and where it fails \
             says little; start with the effects that are known to be there"
        ));
    }
    doubts.extend(conflicts(start, runs));
    doubts.extend(faded_noise(start));
    doubts
}

/// A number of elements that was fixed, where the evidence asks for more.
fn too_few_elements(rig: &Rig, runs: &[RunData], start: &Fit, effects: &[Chosen], options: &Options) -> Option<String> {
    let open: Vec<Chosen> = effects.iter().map(|c| Chosen { elements: None, ..c.clone() }).collect();
    let fixed = effects.iter().find(|c| c.elements.is_some())?;
    let more = with_more_elements(rig, runs, start, &open, options, &|_| {}).ok()??;
    let name = more.effects.iter().find(|c| c.effect.name() == fixed.effect.name())?.label();
    Some(format!(
        "{} has too few elements: with {name} the error falls from {:.4} to {:.4} m, and what is found here may only make up for them; \
         leave their number out",
        fixed.label(),
        start.pooled().0,
        more.pooled().0
    ))
}

/// Deviation of what was measured from its mean, rms over all samples, m.
fn signal_m(fit: &Fit) -> f64 {
    let (mut square, mut n) = (0.0, 0usize);
    for sensor in fit.runs.iter().flat_map(|r| &r.sensors) {
        let mean = sensor.measured_m.iter().sum::<f64>() / sensor.measured_m.len().max(1) as f64;
        square += sensor.measured_m.iter().map(|h| (h - mean).powi(2)).sum::<f64>();
        n += sensor.measured_m.len();
    }
    (square / n.max(1) as f64).sqrt()
}
