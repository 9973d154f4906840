//! What the diagnosis tries when no effect brings the error down to the noise.
//!
//! Without the missing effect, the start model's parameters or its number of elements may have gone where no descent
//! leads back from. So the best candidates get the elements that their own fits ask for; then effects are fitted from
//! the signals, without any earlier fit.

use rayon::prelude::*;

use crate::diagnose::candidate_fit::{CandidateFit, FullFitter, over_noise};
use crate::diagnose::limits::{FALLBACK_FITS, NO_FULL_FIT_ABOVE};

/// Searches until a candidate's error is below `enough` times the noise. Fits from the signals the first `most`
/// candidates and all candidates that leave more than `start`, the start model's square: they contain the start model,
/// so their refits have failed.
pub(crate) fn fallback_search(
    fitter: &FullFitter,
    candidate_fits: &mut [CandidateFit],
    start: f64,
    enough: f64,
    most: usize,
) {
    let done = |candidate_fits: &[CandidateFit]| {
        candidate_fits.iter().filter_map(|r| r.fit.as_ref()).any(|f| over_noise(f, fitter.runs) < enough)
    };
    if done(candidate_fits) {
        return;
    }
    more_elements(fitter, candidate_fits);
    if done(candidate_fits) {
        return;
    }
    let mut tried: Vec<&mut CandidateFit> =
        candidate_fits.iter_mut().enumerate().filter(|(i, r)| *i < most || r.square > start).map(|(_, r)| r).collect();
    from_the_signals(fitter, &mut tried);
    if !done(candidate_fits) {
        more_elements(fitter, candidate_fits);
    }
}

/// Gives the best candidates the elements that their own fits ask for.
fn more_elements(fitter: &FullFitter, candidate_fits: &mut [CandidateFit]) {
    let mut best: Vec<&mut CandidateFit> = candidate_fits.iter_mut().filter(|r| r.fit.is_some()).collect();
    best.sort_by(|a, b| a.square.total_cmp(&b.square));
    let most = NO_FULL_FIT_ABOVE * best.first().map_or(0.0, |b| b.square);
    best.par_iter_mut().take(FALLBACK_FITS).filter(|r| r.square < most).for_each(|candidate_fit| {
        let grown = fitter.with_more_elements(candidate_fit);
        candidate_fit.take(grown);
    });
}

/// Fits candidates from the signals, without any earlier fit: all on a coarse grid, then those that leave least.
fn from_the_signals(fitter: &FullFitter, candidate_fits: &mut [&mut CandidateFit]) {
    let coarse: Vec<_> =
        candidate_fits.par_iter().map(|candidate_fit| fitter.coarse_fit(candidate_fit.refit).ok()).collect();
    let mean_square = |i: usize| coarse[i].as_ref().map_or(f64::INFINITY, |c| c.mean_square);
    let mut order: Vec<usize> = (0..candidate_fits.len()).collect();
    order.sort_by(|&a, &b| mean_square(a).total_cmp(&mean_square(b)));
    order.truncate(FALLBACK_FITS);
    let most = NO_FULL_FIT_ABOVE * order.first().map_or(0.0, |&i| mean_square(i));
    candidate_fits.par_iter_mut().enumerate().filter(|(i, _)| order.contains(i)).for_each(|(i, candidate_fit)| {
        if let Some(coarse) = coarse[i].as_ref().filter(|c| c.mean_square <= most) {
            candidate_fit.take(fitter.fit_from_values(candidate_fit.refit, &coarse.effects, &coarse.values));
        }
    });
}
