//! What the recordings could not have shown: the least size at which an effect would have been worth a model.
//!
//! The signature of an effect, projected off what the fitted parameters can absorb, grows with its size. The effect is
//! visible when the evidence for it and the error that it removes are large enough.

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::Form;
use crate::diagnose::evidence::EvidenceScale;
use crate::diagnose::limits::TEMPERATURE;
use crate::fit::numeric::least_squares::Problem;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::interned::Text;
use crate::model::parameter::{Parameter, Scale};

/// The least of an effect that these recordings would show.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Visible {
    /// The effect, as on the command line.
    pub effect: String,
    /// The parameter that measures its strength.
    pub parameter: String,
    /// Its least visible value.
    pub value: f64,
    /// Where the effect vanishes.
    pub vanishes_at: f64,
    /// Its unit.
    #[serde(deserialize_with = "crate::interned::text")]
    pub unit: Text,
}

/// The least visible size of each form that has a strength, at its usual place, if it lies within the parameter's
/// bounds. Only a fall of the squared error over noise by `least_fall` is worth a model.
pub fn visible(baseline: &Baseline, forms: &[Form], scale: EvidenceScale, least_fall: f64) -> Vec<Visible> {
    forms.par_iter().filter_map(|form| least(baseline, form, scale, least_fall)).collect()
}

fn least(baseline: &Baseline, form: &Form, scale: EvidenceScale, least_fall: f64) -> Option<Visible> {
    let effects: Vec<_> = baseline.effects.iter().cloned().chain([form.chosen.clone()]).collect();
    let model = baseline.model(&effects);
    let own = &model.shared[baseline.shared..];
    let strength = own.iter().position(|p| p.vanishes_at.is_some())?;
    let parameter = &own[strength];
    let problem = baseline.problem(&model);
    let starts: Vec<f64> = own.iter().map(|p| p.start).collect();
    let seen = |size: f64| {
        let mut values = starts.clone();
        values[strength] = sized(parameter, size);
        problem.residuals(&problem.variables(&baseline.values_with(&values))).ok().map(|all| baseline.seen(&all))
    };
    let (with, without) = (seen(1.0)?, &baseline.residuals);
    let change: Vec<f64> = with.iter().zip(without).map(|(w, r)| w - r).collect();
    let square = baseline.projected_dot(&change, &change);
    let free = own.iter().filter(|p| p.prior.is_none()).count() as f64;
    let for_evidence = 2.0 * scale.unit * (TEMPERATURE * STRONG_EVIDENCE + 0.5 * free * scale.effective.ln());
    let for_fall = least_fall * baseline.run_samples() as f64;
    let size = (for_evidence.max(for_fall) / square).sqrt();
    let value = sized(parameter, size);
    (size.is_finite() && (parameter.lower..=parameter.upper).contains(&value)).then(|| Visible {
        effect: form.chosen.label(),
        parameter: parameter.name.clone(),
        value,
        vanishes_at: parameter.vanishes_at.unwrap_or(0.0),
        unit: parameter.unit,
    })
}

/// The strength that is `size` times as far from where the effect vanishes as its usual start.
fn sized(parameter: &Parameter, size: f64) -> f64 {
    let gone = parameter.vanishes_at.unwrap_or(0.0);
    match parameter.scale {
        Scale::Log if gone > 0.0 => gone * (parameter.start / gone).powf(size),
        _ => gone + (parameter.start - gone) * size,
    }
}
