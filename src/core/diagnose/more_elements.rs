//! The elements that an effect of the start model lacks, as one more candidate. Where their number is fixed, an effect that makes up for missing
//! ones would be named in their place.

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::base_name;
use crate::diagnose::candidate_fit::{FullFitter, over_noise, square};
use crate::diagnose::evidence::EvidenceScale;
use crate::diagnose::outcome::Candidate;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::with_more_elements;
use crate::model::effects::Chosen;

/// The start model with more elements.
pub(crate) struct MoreElements {
    /// Which of its effects has them.
    of: usize,
    /// The fit.
    pub fit: Fit,
}

impl MoreElements {
    /// As many as the evidence supports; none where their number is open, or where more of them leave no less than solvers differ by.
    pub fn of(fitter: &FullFitter, start: &Fit) -> Option<MoreElements> {
        let fixed = fitter.effects.iter().position(|c| c.elements.is_some())?;
        let open: Vec<Chosen> = fitter.effects.iter().map(|c| Chosen { elements: None, ..c.clone() }).collect();
        let more = with_more_elements(fitter.rig, fitter.runs, start, &open, fitter.options, &|_| {});
        let fit = more.ok().flatten()?;
        let fall = over_noise(start, fitter.runs).powi(2) - over_noise(&fit, fitter.runs).powi(2);
        (fall >= fitter.least_fall).then_some(MoreElements { of: fixed, fit })
    }

    /// Evidence for them, and the odds before it.
    pub fn evidence(&self, scale: EvidenceScale, baseline: &Baseline, start: &Fit) -> (f64, f64) {
        let added = self.fit.parameters.len().saturating_sub(start.parameters.len());
        let odds = self.fit.effects[self.of].effect.odds(&baseline.known);
        (scale.evidence(square(start), square(&self.fit), added), odds)
    }

    /// As a candidate.
    pub fn candidate(&self, baseline: &Baseline, evidence: f64, probability: f64) -> Candidate {
        let own = baseline.model(&self.fit.effects).parameters_of(self.of);
        Candidate {
            effect: base_name(self.fit.effects[self.of].effect.name()),
            label: self.fit.effects[self.of].label(),
            probability,
            evidence,
            held_out_m: None,
            over_noise: over_noise(&self.fit, &baseline.runs),
            within_class: false,
            rmse_m: self.fit.pooled().0,
            parameters: self.fit.parameters[own].to_vec(),
            indistinguishable_from: Vec::new(),
            fit: Some(self.fit.clone()),
        }
    }
}
