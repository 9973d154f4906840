//! Two effects at once: where no single effect brings the error down to the noise, each two of them are tried together.
//!
//! Each effect's refit has a signature: how it changes the residuals, less what the start model can absorb. What two signatures would leave
//! together is a small linear problem, so all pairs are ranked by it. The best pairs are refitted on the coarse grid, and the best of these to all
//! samples. Far from the start model signatures say little, so where none of these is down to the noise, the other effects are also tried beside the
//! best single one. Where that does not explain the records, the start model's parameters may have led astray: the leading effect is then fitted beside
//! each of the others from the signals, and whichever is best beside it leads next, while that finds a better pair.

use std::mem::replace;

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::Form;
use crate::diagnose::candidate_fit::{FullFitter, least_fall, over_noise, square};
use crate::diagnose::evidence::EvidenceScale;
use crate::diagnose::limits::{
    CONVERGE_BELOW, DOWN_TO_THE_NOISE, EXPLAINED_OVER_NOISE, FULL_FITS, LEAST_EVIDENCE, LEAST_SHARE_OF_SECOND,
    NO_FULL_FIT_ABOVE, PAIR_STRENGTH, REFINE, REFINED_PAIRS, START_DOUBTFUL,
};
use crate::diagnose::refit::Refit;
use crate::diagnose::screening::refits;
use crate::fit::data::run_data::RunData;
use crate::fit::numeric::least_squares::{Problem, minimise};
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::problem::error::FitError;
use crate::fit::progress::Progress;
use crate::fit::search::calibrate::CoarseFit;
use crate::model::effects::Chosen;
use crate::product::dot;

/// A pair of forms, refitted on the coarse grid.
struct PairRefit {
    of: [Form; 2],
    /// Free parameters of the second effect.
    added: usize,
    effects: Vec<Chosen>,
    values: Vec<f64>,
    square: f64,
    /// Of the samples.
    residuals: Vec<f64>,
    /// See [`Baseline::mean_square`].
    mean_square: f64,
    /// It has been fitted to all samples.
    is_fitted: bool,
}

/// Two effects, fitted together to all samples.
pub(crate) struct PairFit {
    pub(crate) of: [Form; 2],
    pub(crate) fit: Fit,
    /// It was also fitted from the signals.
    is_afresh: bool,
}

impl PairFit {
    /// Keeps a fit if it is better than the one so far.
    fn take(&mut self, fit: Result<Fit, FitError>) {
        if let Ok(fit) = fit
            && square(&fit) < square(&self.fit)
        {
            self.fit = fit;
        }
    }

    /// Whether it is of the effects of these two forms.
    fn is_of(&self, forms: &[Form; 2]) -> bool {
        forms.iter().all(|form| self.of.iter().any(|own| own.effect == form.effect))
    }

    /// Goes on to its optimum. What is left may be the way that the fit came: elements that the effects now explain, or too few of them.
    fn settle(&mut self, fitter: &FullFitter) {
        if over_noise(&self.fit, fitter.runs) > DOWN_TO_THE_NOISE && !replace(&mut self.is_afresh, true) {
            self.take(fitter.fit_pair_from_scratch(&self.of));
        }
        if !self.fit.converged {
            self.take(fitter.converged(&self.fit));
        }
    }

    /// Whether it is worth a model beside the best single effect, or none, that leaves `single` times the noise after `start` times without any: instruments within their class are at
    /// work on every rig, and a second effect must take its share.
    pub(crate) fn is_worth(&self, baseline: &Baseline, runs: &[RunData], start: f64, single: f64) -> bool {
        let taken = start.powi(2) - single.powi(2);
        let least = least_fall(runs, taken).max(LEAST_SHARE_OF_SECOND * (single.powi(2) - 1.0));
        self.is_noteworthy(baseline) && single.powi(2) - over_noise(&self.fit, runs).powi(2) > least
    }

    /// Whether both effects are stronger than what every rig has of them.
    fn is_noteworthy(&self, baseline: &Baseline) -> bool {
        let (model, values, n) = (baseline.model(&self.fit.effects), self.fit.values(), self.fit.effects.len());
        (n - 2..n).all(|i| self.fit.effects[i].effect.noteworthy(&values[model.parameters_of(i)], &baseline.known))
    }

    /// The parameters of the two effects, which are the model's last.
    pub(crate) fn own_parameters(&self, baseline: &Baseline) -> Vec<FittedParameter> {
        let (model, last) = (baseline.model(&self.fit.effects), self.fit.effects.len() - 1);
        self.fit.parameters[model.parameters_of(last - 1).start..model.parameters_of(last).end].to_vec()
    }
}

/// The search for pairs, as far as it has got.
#[derive(Default)]
pub(crate) struct PairSearch {
    /// On the coarse grid.
    refitted: Vec<PairRefit>,
    /// To all samples, the best first.
    fits: Vec<PairFit>,
    /// The square of the error over noise that the best single effect left when it was started from.
    single: Option<f64>,
    /// The best are fitted to all samples.
    is_compared: bool,
}

impl PairSearch {
    /// Refits the pairs whose signatures promise most and, where none of them explains the records, those beside the best `single` effect; goes on only
    /// where that leaves less than the last time. `leading` has a form of each effect, that which leaves least alone first. Fits the pairs to all samples
    /// only where one is not far from the records on the coarse grid: else a better single effect may be found first.
    pub(crate) fn go_on(
        &mut self,
        fitter: &FullFitter,
        baseline: &Baseline,
        refits: &[Refit],
        single: Option<(&Form, &Fit)>,
        leading: &[&Refit],
    ) {
        let left = single.map_or(f64::MAX, |(_, fit)| over_noise(fit, fitter.runs).powi(2));
        if self.single.is_some_and(|known| known - left < fitter.least_fall) {
            return;
        }
        self.single = Some(left);
        self.is_compared = false;
        (fitter.progress)(&Progress::from("two effects at once"));
        if self.refitted.is_empty() {
            self.refitted = promising(baseline, refits).par_iter().filter_map(|of| refitted(baseline, *of)).collect();
            if self.is_near() {
                self.fit_best(fitter, baseline, refits);
            }
        }
        if !self.explains(fitter.runs) {
            self.refitted.extend(single.into_iter().flat_map(|(form, fit)| beside(fitter, form, fit)));
        }
        if self.is_near() {
            self.compare(fitter, baseline, refits, leading);
        }
    }

    /// Whether a pair is not far from the records on the coarse grid.
    fn is_near(&self) -> bool {
        self.refitted.iter().any(|pair| pair.mean_square < START_DOUBTFUL.powi(2))
    }

    /// Fits the best pairs to all samples, rivals of the leading effect in its place among them.
    fn compare(&mut self, fitter: &FullFitter, baseline: &Baseline, refits: &[Refit], leading: &[&Refit]) {
        self.is_compared = true;
        self.refitted.extend(in_its_place(baseline, &self.refitted, leading));
        self.fit_best(fitter, baseline, refits);
    }

    /// Whether the best pair is down to the noise.
    pub(crate) fn explains(&self, runs: &[RunData]) -> bool {
        self.fits.first().is_some_and(|best| over_noise(&best.fit, runs) < DOWN_TO_THE_NOISE)
    }

    /// The pairs that leave least, the best first, fitted to all samples. See [`PairSearch::go_on`].
    pub(crate) fn fitted(
        mut self,
        fitter: &FullFitter,
        baseline: &Baseline,
        refits: &[Refit],
        single: Option<(&Form, &Fit)>,
        leading: &[&Refit],
        start: &Fit,
    ) -> Vec<PairFit> {
        self.go_on(fitter, baseline, refits, single, leading);
        if !self.is_compared {
            self.compare(fitter, baseline, refits, leading);
        }
        let led_astray = over_noise(start, fitter.runs) > START_DOUBTFUL;
        let left = self.fits.first().map_or(f64::INFINITY, |best| over_noise(&best.fit, fitter.runs));
        if led_astray && left > EXPLAINED_OVER_NOISE {
            from_the_signals(fitter, baseline, leading, &mut self.fits);
            settle_leading(fitter, &mut self.fits);
        }
        self.fits
    }

    /// Fits the best to all samples: those for whose second effect the coarse refits give evidence enough.
    fn fit_best(&mut self, fitter: &FullFitter, baseline: &Baseline, refits: &[Refit]) {
        self.refitted.sort_by(|a, b| a.square.total_cmp(&b.square));
        one_of_each(&mut self.refitted);
        let Some(best) = self.refitted.first() else { return };
        let refitted_alone = refits.iter().map(|refit| refit.square).fold(baseline.square, f64::min);
        let scale = EvidenceScale::of(&best.residuals, baseline.features());
        let most = NO_FULL_FIT_ABOVE * best.square;
        let worth = |pair: &&mut PairRefit| {
            pair.square < most && scale.evidence(refitted_alone, pair.square, pair.added) > LEAST_EVIDENCE
        };
        let leading = self.refitted.iter_mut().filter(worth).take(FULL_FITS);
        let new: Vec<&PairRefit> =
            leading.filter_map(|pair| (!replace(&mut pair.is_fitted, true)).then_some(&*pair)).collect();
        let fits = new.into_par_iter().filter_map(|pair| fitted(fitter, &pair.of, &pair.effects, &pair.values));
        keep_better(&mut self.fits, fits.collect());
        settle_leading(fitter, &mut self.fits);
    }
}

/// A pair, fitted to all samples from where a coarse fit ended.
fn fitted(fitter: &FullFitter, of: &[Form; 2], effects: &[Chosen], values: &[f64]) -> Option<PairFit> {
    let fit = fitter.fit_pair(of, effects, values).ok()?;
    Some(PairFit { of: of.clone(), fit, is_afresh: false })
}

/// Adds `more` pairs; of two fits of the same pair the better one stays.
fn keep_better(fits: &mut Vec<PairFit>, more: Vec<PairFit>) {
    for pair in more {
        match fits.iter_mut().find(|known| known.is_of(&pair.of)) {
            Some(known) if square(&pair.fit) < square(&known.fit) => {
                *known = PairFit { is_afresh: known.is_afresh, ..pair };
            }
            Some(_) => {}
            None => fits.push(pair),
        }
    }
}

/// Sorts the pairs, the best first, after those that lead have gone on: rivals are compared at their optima.
fn settle_leading(fitter: &FullFitter, fits: &mut [PairFit]) {
    let by_square = |a: &PairFit, b: &PairFit| square(&a.fit).total_cmp(&square(&b.fit));
    fits.sort_by(by_square);
    let Some((best, rivals)) = fits.split_first_mut() else { return };
    best.settle(fitter);
    let near = CONVERGE_BELOW * square(&best.fit);
    rivals.par_iter_mut().filter(|rival| square(&rival.fit) < near).for_each(|rival| rival.settle(fitter));
    fits.sort_by(by_square);
}

/// Fits the `leading` effect, the first, with each of the others from the signals on a coarse grid. Where the best of these pairs leaves more than noise,
/// the leading effect may stand in for another: the one that is best beside it takes its place, and so on while that finds a better pair. Those that
/// leave least are fitted to all samples.
fn from_the_signals(fitter: &FullFitter, baseline: &Baseline, leading: &[&Refit], fits: &mut Vec<PairFit>) {
    let mut coarse: Vec<([Form; 2], CoarseFit)> = Vec::new();
    let mut tried: Vec<&'static str> = Vec::new();
    let mut next = leading.first();
    while let Some(one) = next {
        tried.push(one.form.effect);
        let new = |other: &&&Refit| !tried.contains(&other.form.effect) && can_be_combined(&one.form, &other.form);
        let beside = leading.par_iter().filter(new).filter_map(|other| {
            let of = [one, other].map(|refit| refit.form.clone());
            let added = of.iter().map(|form| &form.chosen);
            let effects: Vec<Chosen> = baseline.effects.iter().chain(added).cloned().collect();
            let fit = fitter.coarse_pair(&of, &effects).ok()?;
            Some((of, fit))
        });
        coarse.extend(beside.collect::<Vec<_>>());
        coarse.sort_by(|a, b| a.1.mean_square.total_cmp(&b.1.mean_square));
        let far = coarse.first().filter(|(_, best)| best.mean_square > EXPLAINED_OVER_NOISE.powi(2));
        let untried = far.and_then(|(of, _)| of.iter().find(|form| !tried.contains(&form.effect)));
        next = untried.and_then(|form| leading.iter().find(|refit| refit.form.effect == form.effect));
    }
    let most = NO_FULL_FIT_ABOVE * coarse.first().map_or(0.0, |(_, best)| best.mean_square);
    coarse.retain(|(_, fit)| fit.mean_square <= most);
    coarse.truncate(FULL_FITS);
    let fine = coarse.par_iter().filter_map(|(of, fit)| fitted(fitter, of, &fit.effects, &fit.values));
    keep_better(fits, fine.collect());
}

/// The other effects beside a single one, from its fit to all samples.
fn beside(fitter: &FullFitter, form: &Form, single: &Fit) -> Vec<PairRefit> {
    let Ok(baseline) = Baseline::new(fitter.rig, fitter.runs, single, fitter.options) else { return Vec::new() };
    let second = refits(&baseline, fitter.progress).into_iter();
    let pair = |refit: Refit| PairRefit {
        of: [form.clone(), refit.form],
        added: refit.added,
        square: refit.square,
        residuals: refit.residuals[..baseline.samples].to_vec(),
        mean_square: baseline.mean_square(&refit.residuals),
        values: refit.values,
        effects: refit.effects,
        is_fitted: false,
    };
    second.map(pair).collect()
}

/// The best of the pairs that hold the leading effect, with each of its rivals alone in its place: only the leading one met every other effect in a fit of
/// its own.
fn in_its_place(baseline: &Baseline, pairs: &[PairRefit], leading: &[&Refit]) -> Vec<PairRefit> {
    let Some((first, others)) = leading.split_first() else { return Vec::new() };
    let of_first = |pair: &PairRefit| pair.of.iter().position(|form| form.effect == first.form.effect);
    let holding = pairs.iter().filter_map(|pair| Some((of_first(pair)?, pair)));
    let Some((i, best)) = holding.min_by(|a, b| a.1.square.total_cmp(&b.1.square)) else { return Vec::new() };
    let partner = &best.of[1 - i];
    let place = best.effects.len() - 2 + i;
    let near = |rival: &&&Refit| {
        rival.square < NO_FULL_FIT_ABOVE * first.square
            && rival.form.effect != partner.effect
            && can_be_combined(&rival.form, partner)
    };
    let exchanged = |rival: &&Refit| {
        let (mut of, mut effects) = (best.of.clone(), best.effects.clone());
        (of[i], effects[place]) = (rival.form.clone(), rival.form.chosen.clone());
        let was = baseline.model(&best.effects).parameters_of(place);
        let values = [&best.values[..was.start], baseline.added(&rival.values), &best.values[was.end..]].concat();
        let added = if i == 0 { best.added } else { rival.added };
        refined(baseline, of, added, &effects, &[values])
    };
    others.par_iter().filter(near).filter_map(exchanged).collect()
}

/// Keeps the first pair of each two effects.
fn one_of_each(pairs: &mut Vec<PairRefit>) {
    let mut known: Vec<[&'static str; 2]> = Vec::new();
    pairs.retain(|pair| {
        let mut names = pair.of.each_ref().map(|form| form.effect);
        names.sort_unstable();
        let new = !known.contains(&names);
        known.push(names);
        new
    });
}

/// The pairs whose signatures together leave least, the best first.
fn promising<'a>(baseline: &Baseline, refits: &'a [Refit]) -> Vec<[&'a Refit; 2]> {
    let left = baseline.projected(&baseline.residuals);
    let signatures: Vec<Vec<f64>> = refits
        .par_iter()
        .map(|refit| {
            baseline.projected(&refit.residuals).iter().zip(&left).map(|(with, without)| with - without).collect()
        })
        .collect();
    let alone: Vec<(f64, f64)> = signatures.iter().map(|s| (dot(s, s), dot(s, &left))).collect();
    let both: Vec<(usize, usize)> = (0..refits.len()).flat_map(|i| (0..i).map(move |j| (i, j))).collect();
    let mut ranked: Vec<(f64, [&Refit; 2])> = both
        .into_par_iter()
        .filter(|&(i, j)| {
            refits[i].form.effect != refits[j].form.effect && can_be_combined(&refits[i].form, &refits[j].form)
        })
        .map(|(i, j)| {
            let across = dot(&signatures[i], &signatures[j]);
            (fall(alone[i], alone[j], across), [&refits[i], &refits[j]])
        })
        .filter(|(fall, _)| fall.is_finite())
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    // one form of each two effects: neighbouring forms differ less than effects do
    let mut kept: Vec<[&Refit; 2]> = Vec::new();
    for (_, pair) in ranked {
        let same = |known: &[&Refit; 2]| {
            known[0].form.effect == pair[0].form.effect && known[1].form.effect == pair[1].form.effect
        };
        if kept.iter().filter(|known| same(known)).count() < 2 {
            kept.push(pair);
        }
        if kept.len() == REFINED_PAIRS {
            break;
        }
    }
    kept
}

fn can_be_combined(a: &Form, b: &Form) -> bool {
    let (a, b) = (a.chosen.effect, b.chosen.effect);
    let excluded =
        |x: &dyn crate::model::effects::Effect, name: &str| x.excludes().iter().any(|(other, _)| *other == name);
    !excluded(a, b.name()) && !excluded(b, a.name())
}

/// By how much two signatures change the square, each as strong as leaves least within [`PAIR_STRENGTH`].
fn fall((aa, ar): (f64, f64), (bb, br): (f64, f64), ab: f64) -> f64 {
    let (weakest, strongest) = PAIR_STRENGTH;
    let kept = |x: f64| if x.is_finite() { x.clamp(weakest, strongest) } else { weakest };
    let (mut x, mut y) = (1.0, 1.0);
    for _ in 0..8 {
        x = kept(-(ar + y * ab) / aa);
        y = kept(-(br + x * ab) / bb);
    }
    x * x * aa + y * y * bb + 2.0 * (x * ar + y * br + x * y * ab)
}

/// Fits all parameters of a model with both forms on the coarse grid: from the start model's values, and from those of either refit.
fn refitted(baseline: &Baseline, of: [&Refit; 2]) -> Option<PairRefit> {
    let effects: Vec<Chosen> =
        baseline.effects.iter().cloned().chain(of.iter().map(|refit| refit.form.chosen.clone())).collect();
    let rests = [&baseline.values, &of[0].values, &of[1].values];
    let starts = rests.map(|rest| with_both(baseline, of, rest));
    refined(baseline, of.map(|refit| refit.form.clone()), of[1].added, &effects, &starts)
}

/// Fits all parameters of a model with two forms, its last effects, on the coarse grid from the best of some `starts`.
fn refined(
    baseline: &Baseline,
    of: [Form; 2],
    added: usize,
    effects: &[Chosen],
    starts: &[Vec<f64>],
) -> Option<PairRefit> {
    let model = baseline.model(effects);
    let problem = baseline.passing(&model);
    let starts = starts.iter().map(|values| problem.variables(values));
    let cost = |x: &Vec<f64>| problem.residuals(x).map_or(f64::INFINITY, |r| dot(&r, &r));
    let start = starts.map(|x| (cost(&x), x)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    let solution = minimise(&problem, &start, REFINE, |_, _| {}).ok()?;
    Some(PairRefit {
        of,
        added,
        effects: model.effects.clone(),
        values: problem.values(&solution.x),
        square: 2.0 * solution.cost,
        residuals: solution.residuals[..baseline.samples].to_vec(),
        mean_square: baseline.mean_square(&solution.residuals),
        is_fitted: false,
    })
}

/// Values of all variables: both effects as their refits have them, the rest from `rest`, a start model's or a refit's values.
fn with_both(baseline: &Baseline, of: [&Refit; 2], rest: &[f64]) -> Vec<f64> {
    let own = of.iter().flat_map(|refit| baseline.added(&refit.values));
    let after = baseline.shared + baseline.added(rest).len();
    rest[..baseline.shared].iter().chain(own).chain(&rest[after..]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_signatures_that_make_up_the_residual_leave_nothing() {
        // residual -(2a + b) with a, b at right angles, then oblique
        for ab in [0.0, 0.5] {
            let (aa, bb) = (1.0, 1.0);
            let (ar, br) = (-(2.0 * aa + ab), -(2.0 * ab + bb));
            let square = 4.0 * aa + bb + 4.0 * ab;
            assert!((square + fall((aa, ar), (bb, br), ab)).abs() < 1e-2, "{ab}");
        }
    }
}
