//! What is tried where no effect brings the error down to the noise.
//!
//! Without the effect the start model's parameters, or the number of its elements, may have gone where no straight way leads back
//! from. So the best get the elements that their own fits ask for; then every effect is fitted as if nothing had been before.

use rayon::prelude::*;

use crate::diagnose::candidate_fit::{Finisher, Rival};
use crate::diagnose::{HOPELESS, over_noise};

/// How many are fitted to the end.
const FITTED: usize = 3;

/// Tries on until an error is below `enough` times the noise, from the signals with the first `most` of the effects and with those
/// that err by more than the start model, which leaves `start`: they contain it, so their refits have failed.
pub(crate) fn rescue(finisher: &Finisher, rivals: &mut [Rival], start: f64, enough: f64, most: usize) {
    let done =
        |rivals: &[Rival]| rivals.iter().filter_map(|r| r.fit.as_ref()).any(|f| over_noise(f, finisher.runs) < enough);
    if done(rivals) {
        return;
    }
    more_elements(finisher, rivals);
    if done(rivals) {
        return;
    }
    let mut tried: Vec<&mut Rival> =
        rivals.iter_mut().enumerate().filter(|(i, r)| *i < most || r.square > start).map(|(_, r)| r).collect();
    from_the_signals(finisher, &mut tried);
    if !done(rivals) {
        more_elements(finisher, rivals);
    }
}

fn more_elements(finisher: &Finisher, rivals: &mut [Rival]) {
    let mut best: Vec<&mut Rival> = rivals.iter_mut().filter(|r| r.fit.is_some()).collect();
    best.sort_by(|a, b| a.square.total_cmp(&b.square));
    let hopeless = HOPELESS * best.first().map_or(0.0, |b| b.square);
    best.par_iter_mut().take(FITTED).filter(|r| r.square < hopeless).for_each(|rival| {
        let grown = finisher.with_more_elements(rival);
        rival.take(grown);
    });
}

fn from_the_signals(finisher: &Finisher, rivals: &mut [&mut Rival]) {
    let coarse: Vec<_> = rivals.par_iter().map(|rival| finisher.approached(rival.refit).ok()).collect();
    let mean_square = |i: usize| coarse[i].as_ref().map_or(f64::INFINITY, |c| c.mean_square);
    let mut order: Vec<usize> = (0..rivals.len()).collect();
    order.sort_by(|&a, &b| mean_square(a).total_cmp(&mean_square(b)));
    order.truncate(FITTED);
    let hopeless = HOPELESS * order.first().map_or(0.0, |&i| mean_square(i));
    rivals.par_iter_mut().enumerate().filter(|(i, _)| order.contains(i)).for_each(|(i, rival)| {
        if let Some(coarse) = coarse[i].as_ref().filter(|c| c.mean_square <= hopeless) {
            rival.take(finisher.refined(rival.refit, &coarse.effects, &coarse.values));
        }
    });
}
