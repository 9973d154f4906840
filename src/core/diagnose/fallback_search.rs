//! What the diagnosis tries when no effect brings the error down to the noise.
//!
//! Without the missing effect, the start model's parameters or its number of elements may have gone where no descent
//! leads back from. So the best candidates are fitted afresh, with as many elements as their own fits ask for; if that does
//! not explain the records, effects are fitted coarsely from the signals, and the best of these afresh.

use rayon::prelude::*;

use crate::diagnose::candidate_fit::{CandidateFit, FullFitter, beyond, over_noise};
use crate::diagnose::limits::{DOWN_TO_THE_NOISE, FULL_FITS, NO_FULL_FIT_ABOVE};
use crate::fit::outcome::fit::Fit;
use crate::fit::validate::conflict::{at_bounds, contradicts};

/// The effects that were fitted afresh.
pub(crate) type Done = Vec<&'static str>;

/// Fits the leading candidates afresh, unless one explains the records from a start model that stands at no bound; returns their effects.
pub(crate) fn begin_afresh(fitter: &FullFitter, start: &Fit, candidate_fits: &mut [CandidateFit]) -> Done {
    let mut done = Done::new();
    if !start.parameters.iter().any(|p| p.at_bound) {
        afresh(fitter, candidate_fits, &mut done);
    } else {
        // A start at a bound has stood in for what is missing; whoever goes on from there may have to carry that along.
        fit_afresh(fitter, &mut candidate_fits.iter_mut().collect::<Vec<_>>(), 2 * FULL_FITS, &mut done);
    }
    done
}

/// Where the start model and every sound fit leave more than solvers differ by, fits all effects from the signals: a refit may have failed, whatever its
/// forecast promised. Then fits the leading ones afresh that are not `done`.
pub(crate) fn search_on(fitter: &FullFitter, start: &Fit, candidate_fits: &mut [CandidateFit], mut done: Done) {
    let sound = candidate_fits.iter().filter_map(|r| r.fit.as_ref()).filter(|fit| is_sound(fitter, fit));
    if sound.chain([start]).any(|fit| beyond(fit, fitter.runs) < fitter.least_fall) {
        return;
    }
    from_the_signals(fitter, candidate_fits);
    afresh(fitter, candidate_fits, &mut done);
}

/// Fits the leading candidates afresh, unless one explains the records.
fn afresh(fitter: &FullFitter, candidate_fits: &mut [CandidateFit], done: &mut Done) {
    let explains = |fit: &Fit| over_noise(fit, fitter.runs) < DOWN_TO_THE_NOISE && is_sound(fitter, fit);
    if !candidate_fits.iter().filter_map(|r| r.fit.as_ref()).any(explains) {
        let mut fitted: Vec<_> = candidate_fits.iter_mut().filter(|r| r.fit.is_some()).collect();
        fit_afresh(fitter, &mut fitted, FULL_FITS, done);
    }
}

/// A fit that gets to the noise against what the instruments say, or at a bound, has not shown that no other would.
fn is_sound(fitter: &FullFitter, fit: &Fit) -> bool {
    !contradicts(fit, fitter.runs) && at_bounds(fit).is_empty()
}

/// Fits the leading candidates afresh, so many at the most, unless that is `done` already. What they leave may be the way that their fits came:
/// elements that the effect now explains, a place that is another's.
fn fit_afresh(fitter: &FullFitter, leading: &mut Vec<&mut CandidateFit>, number: usize, done: &mut Done) {
    leading.sort_by(|a, b| a.square.total_cmp(&b.square));
    let most = NO_FULL_FIT_ABOVE * leading.first().map_or(0.0, |r| r.square);
    leading.retain(|r| r.square < most && !done.contains(&r.refit.form.effect));
    leading.truncate(number);
    done.extend(leading.iter().map(|r| r.refit.form.effect));
    let afresh = |candidate_fit: &mut &mut CandidateFit| {
        let fit = fitter.fit_from_scratch(candidate_fit.refit);
        candidate_fit.take(fit);
    };
    let Some((first, others)) = leading.split_first_mut() else { return };
    afresh(first);
    // the best of them may have left the others so far behind that they need no fit
    let most = NO_FULL_FIT_ABOVE * first.square;
    others.par_iter_mut().filter(|r| r.square < most).for_each(afresh);
}

/// Fits candidates from the signals, without any earlier fit: all on a coarse grid, then those that leave least.
fn from_the_signals(fitter: &FullFitter, candidate_fits: &mut [CandidateFit]) {
    let coarse: Vec<_> =
        candidate_fits.par_iter().map(|candidate_fit| fitter.coarse_fit(candidate_fit.refit).ok()).collect();
    let mean_square = |i: usize| coarse[i].as_ref().map_or(f64::INFINITY, |c| c.mean_square);
    let mut order: Vec<usize> = (0..candidate_fits.len()).collect();
    order.sort_by(|&a, &b| mean_square(a).total_cmp(&mean_square(b)));
    order.truncate(FULL_FITS);
    let most = NO_FULL_FIT_ABOVE * order.first().map_or(0.0, |&i| mean_square(i));
    candidate_fits.par_iter_mut().enumerate().filter(|(i, _)| order.contains(i)).for_each(|(i, candidate_fit)| {
        if let Some(coarse) = coarse[i].as_ref().filter(|c| c.mean_square <= most) {
            candidate_fit.take(fitter.fit_from_values(candidate_fit.refit, &coarse.effects, &coarse.values));
        }
    });
}
