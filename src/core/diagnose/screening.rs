//! All candidates on the coarse problem: every form is screened, and the most promising effects are refined.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::candidates;
use crate::diagnose::evidence::EvidenceScale;
use crate::diagnose::limits::REFINED_EFFECTS;
use crate::diagnose::refit::{Refit, refine, screen};
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::thresholds::NOISE_LIKE;

/// Screens every form.
pub(crate) fn screened(baseline: &Baseline, progress: &OnProgress<'_>) -> Vec<Refit> {
    let forms: Vec<_> = candidates(baseline.rig, &baseline.effects, baseline.runs.len());
    let done = AtomicUsize::new(0);
    let one = |form| {
        let refit = screen(baseline, form).ok();
        let n = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(&Progress::from(format!("{n} of {} candidates screened", forms.len())));
        refit
    };
    forms.par_iter().filter_map(one).collect()
}

/// Screens every form and refines those of the most promising effects.
pub(crate) fn refits(baseline: &Baseline, progress: &OnProgress<'_>) -> Vec<Refit> {
    let screened = screened(baseline, progress);
    let mut order = best_forms(&screened, |r| -r.square);
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let promising: Vec<&str> = order.iter().take(REFINED_EFFECTS).map(|(_, r)| r.form.effect).collect();
    // Near the noise the linear forecast is accurate: an effect that screening does not promise will not appear.
    let quiet = baseline.mean_square(&baseline.residuals) < NOISE_LIKE.powi(2);
    let scale = EvidenceScale::of(&baseline.residuals[..baseline.samples], baseline.features());
    let hopeful = |r: &Refit| scale.evidence(baseline.square, r.square, r.added) > 0.0;
    screened
        .par_iter()
        .map(|screened| {
            // Boiling sets in beyond a threshold that no linear forecast sees.
            let promising = promising.contains(&screened.form.effect) || screened.form.chosen.effect.lets_boil();
            if !promising || (quiet && !hopeful(screened)) {
                return screened.clone();
            }
            progress(&Progress::from(format!("{} refitted", screened.form.chosen.label())));
            refine(baseline, screened).ok().unwrap_or_else(|| screened.clone())
        })
        .collect()
}

/// The best form of each effect, with its evidence.
pub(crate) fn best_forms(refits: &[Refit], evidence: impl Fn(&Refit) -> f64) -> Vec<(f64, &Refit)> {
    let mut best: Vec<(f64, &Refit)> = Vec::new();
    for refit in refits {
        let own = evidence(refit);
        match best.iter_mut().find(|(_, b)| b.form.effect == refit.form.effect) {
            Some(known) if own > known.0 => *known = (own, refit),
            Some(_) => {}
            None => best.push((own, refit)),
        }
    }
    best
}
