//! Refits of a candidate: the start model with one form of an effect added, from the most promising of many starts.
//!
//! Screening moves only the added parameters, while the start model's parameters absorb what they can to first order
//! (variable projection: Golub & Pereyra 1973, SIAM J. Numer. Anal. 10, 413). Refining then moves all parameters of the
//! forms that are worth it.

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::Form;
use crate::diagnose::limits::{FEW_PLACES, FORECAST_RANGE, STRENGTHS};
use crate::fit::numeric::least_squares::{Problem, Solution, Way, minimise};
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::search::thresholds::{COARSE, LEADING, SCREENING, STEP_SHARES};
use crate::model::effects::Chosen;
use crate::model::parameter::{Parameter, Scale};
use crate::model::{Model, ModelError};
use crate::product::dot;

/// Result of screening or refining a form.
#[derive(Debug, Clone)]
pub struct Refit {
    /// The form that was added.
    pub form: Form,
    /// The effects of the model, the added one last.
    pub effects: Vec<Chosen>,
    /// Values of all variables.
    pub values: Vec<f64>,
    /// Sum of squares of all residuals, priors included.
    pub square: f64,
    /// Residuals of samples and flow meters.
    pub residuals: Vec<f64>,
    /// Free parameters that it adds, without those that have a prior.
    pub added: usize,
}

/// Screens a form: adds it to the start model and fits only what it adds, from each of its most promising starts.
///
/// # Errors
/// If no start can be simulated.
pub fn screen(baseline: &Baseline, form: &Form) -> Result<Refit, ModelError> {
    let effects: Vec<Chosen> = baseline.effects.iter().cloned().chain([form.chosen.clone()]).collect();
    let model = baseline.model(&effects);
    let problem = baseline.passing(&model);
    let added = Added::new(baseline, &problem, &model);
    let mut failure = None;
    let mut screened: Vec<Solution> = Vec::new();
    for start in promising(baseline, &model, &problem, &form.chosen)?.iter().take(LEADING) {
        match minimise(&added, &problem.variables(&baseline.values_with(start))[added.range()], SCREENING, |_, _| {}) {
            Ok(solution) => screened.push(solution),
            Err(error) => failure = Some(error),
        }
    }
    let best = screened.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let Some(best) = best else { return Err(failure.unwrap_or_else(|| no_start(form))) };
    Ok(Refit {
        form: form.clone(),
        square: 2.0 * best.cost,
        residuals: best.residuals[..baseline.residuals.len()].to_vec(),
        added: free(baseline, &model),
        values: problem.values(&added.whole(&best.x)?),
        effects: model.effects.clone(),
    })
}

/// The problem of fitting only the added parameters.
struct Added<'g> {
    baseline: &'g Baseline<'g>,
    problem: &'g FitProblem<'g>,
    /// The start model's variables, with the usual values of the added ones.
    usual: Vec<f64>,
    /// Prior mean and standard deviation of the added variables.
    priors: Vec<Option<(f64, f64)>>,
    /// The same on a coarser grid, whose differences make the Jacobian.
    coarser: Option<Box<Added<'g>>>,
}

impl<'g> Added<'g> {
    fn new(baseline: &'g Baseline, problem: &'g FitProblem, model: &Model) -> Self {
        let parameters = &model.shared[baseline.shared..];
        let variables = |of: fn(&Parameter) -> f64| {
            problem.variables(&baseline.values_with(&parameters.iter().map(of).collect::<Vec<_>>()))
        };
        let means = variables(|p| p.prior.map_or(p.start, |(mean, _)| mean));
        let priors = parameters
            .iter()
            .zip(&means[baseline.shared..])
            .map(|(p, &mean)| p.prior.map(|(_, sd)| (mean, sd)))
            .collect();
        let coarser = problem.cheaper().map(|coarser| Box::new(Added::new(baseline, coarser, model)));
        Added { baseline, problem, usual: variables(|p| p.start), priors, coarser }
    }

    /// Range of the added variables among all.
    fn range(&self) -> std::ops::Range<usize> {
        self.baseline.shared..self.baseline.shared + self.priors.len()
    }

    fn with(&self, added: &[f64]) -> Vec<f64> {
        let mut x = self.usual.clone();
        x[self.range()].copy_from_slice(added);
        x
    }

    fn seen(&self, added: &[f64]) -> Result<Vec<f64>, ModelError> {
        Ok(self.baseline.seen(&self.problem.residuals(&self.with(added))?))
    }

    /// All variables, with the start model's moved to where they absorb most, or as far towards it as lowers the
    /// square.
    fn whole(&self, added: &[f64]) -> Result<Vec<f64>, ModelError> {
        let (lower, upper) = self.problem.bounds();
        let still = self.with(added);
        let moved = self.baseline.moved(&still, &self.seen(added)?);
        let on_the_way = STEP_SHARES.iter().chain(&[0.0]).map(|part| {
            let between = still.iter().zip(&moved).zip(lower.iter().zip(upper));
            between.map(|((s, m), (l, u))| (s + part * (m - s)).clamp(*l, *u)).collect::<Vec<f64>>()
        });
        let square = |x: &Vec<f64>| self.problem.residuals(x).map_or(f64::INFINITY, |r| dot(&r, &r));
        let best = on_the_way.map(|x| (square(&x), x)).min_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best.map_or(still, |(_, x)| x))
    }
}

impl Problem for Added<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let mut residuals = self.baseline.projected(&self.seen(x)?);
        let known = self.priors.iter().zip(x).filter_map(|(prior, v)| prior.map(|(mean, sd)| (v - mean) / sd));
        residuals.extend(known);
        Ok(residuals)
    }

    fn cheaper(&self) -> Option<&Self> {
        self.coarser.as_deref()
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        let (lower, upper) = self.problem.bounds();
        (&lower[self.range()], &upper[self.range()])
    }

    fn difference_step(&self, j: usize) -> f64 {
        self.problem.difference_step(self.baseline.shared + j)
    }

    fn way(&self, j: usize) -> Way {
        self.problem.way(self.baseline.shared + j)
    }
}

/// Refines a screened form: fits all parameters.
///
/// # Errors
/// If it cannot be simulated.
pub fn refine(baseline: &Baseline, screened: &Refit) -> Result<Refit, ModelError> {
    let model = baseline.model(&screened.effects);
    let problem = baseline.passing(&model);
    // A start model without cavities is far from any model with them, so these are also tried from the signals.
    let boils = screened.form.chosen.effect.lets_boil();
    let starts = std::iter::once(problem.variables(&screened.values)).chain(boils.then(|| problem.start()));
    let mut best: Option<Solution> = None;
    for start in starts {
        let solution = minimise(&problem, &start, SCREENING, |_, _| {})?;
        if best.as_ref().is_none_or(|b| solution.cost < b.cost) {
            best = Some(solution);
        }
    }
    let best = best.ok_or_else(|| no_start(&screened.form))?;
    let best = if best.stop.converged() { best } else { minimise(&problem, &best.x, COARSE, |_, _| {})? };
    Ok(Refit {
        form: screened.form.clone(),
        square: 2.0 * best.cost,
        residuals: baseline.seen(&best.residuals),
        added: screened.added,
        values: problem.values(&best.x),
        effects: screened.effects.clone(),
    })
}

fn no_start(form: &Form) -> ModelError {
    ModelError::NotFinite {
        time_s: 0.0,
        place: 0.0.into(),
        along: "from the supply".to_owned(),
        effects: form.chosen.label(),
    }
}

/// Number of added parameters without a prior.
fn free(baseline: &Baseline, model: &Model) -> usize {
    model.shared[baseline.shared..].iter().filter(|p| p.prior.is_none()).count()
}

/// Start values of the added parameters, the most promising first: sorted by how much of the residual their signature,
/// projected off the fitted parameters, would remove.
fn promising(
    baseline: &Baseline,
    model: &Model,
    problem: &FitProblem,
    chosen: &Chosen,
) -> Result<Vec<Vec<f64>>, ModelError> {
    let left = baseline.projected_dot(&baseline.residuals, &baseline.residuals);
    // A coarser grid shows what an effect changes.
    let own = baseline.model(&baseline.effects);
    let without = baseline.passing(&own);
    let (with, without) = problem.cheaper().zip(without.cheaper()).unwrap_or((problem, &without));
    let base = baseline.seen(&without.residuals(&without.variables(&baseline.values))?);
    let mut scored: Vec<(f64, Vec<f64>)> = starts(&model.shared[baseline.shared..], chosen)
        .into_iter()
        .filter_map(|start| {
            let all = with.residuals(&with.variables(&baseline.values_with(&start))).ok()?;
            let change: Vec<f64> = baseline.seen(&all).iter().zip(&base).map(|(w, r)| w - r).collect();
            let size = baseline.projected_dot(&change, &change);
            let along = baseline.projected_dot(&change, &baseline.residuals);
            let by = if size > 0.0 { (-along / size).clamp(FORECAST_RANGE.0, FORECAST_RANGE.1) } else { 0.0 };
            Some((left + by * (2.0 * along + by * size), start))
        })
        .filter(|(cost, _)| cost.is_finite())
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(scored.into_iter().map(|(_, start)| start).collect())
}

/// All starts of an effect: its usual one and its others, in several strengths and, where possible, of either sign.
fn starts(parameters: &[Parameter], chosen: &Chosen) -> Vec<Vec<f64>> {
    let usual: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let others = chosen.effect.other_starts(chosen.elements.unwrap_or(1));
    let strengths = if others.len() > FEW_PLACES { &STRENGTHS[..1] } else { &STRENGTHS };
    let places = others.iter().map(|factors| usual.iter().zip(factors).map(|(v, f)| v * f).collect::<Vec<f64>>());
    let strength_of = parameters.iter().position(|p| p.vanishes_at.is_some());
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for place in std::iter::once(usual.clone()).chain(places) {
        let Some(j) = strength_of else {
            starts.push(place);
            continue;
        };
        for &strength in strengths {
            for value in strengthened(&parameters[j], place[j], strength) {
                let mut start = place.clone();
                start[j] = value.clamp(parameters[j].lower, parameters[j].upper);
                if !starts.contains(&start) {
                    starts.push(start);
                }
            }
        }
    }
    starts
}

/// A value `strength` times as far from where the effect vanishes, on both sides if there are two.
fn strengthened(parameter: &Parameter, value: f64, strength: f64) -> Vec<f64> {
    let gone = parameter.vanishes_at.unwrap_or(0.0);
    match parameter.scale {
        Scale::Linear => [strength, -strength].map(|by| gone + (value - gone) * by).to_vec(),
        Scale::Log if gone > 0.0 => [strength, -strength].map(|by| gone * (value / gone).powf(by)).to_vec(),
        Scale::Log => vec![value * strength],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strengths_lie_on_both_sides_of_what_vanishes_between() {
        let ratio = Parameter::log("ratio", "1", "", 1.1, 0.25, 4.0).vanishing_at(1.0);
        let both = strengthened(&ratio, 1.1, 2.0);
        assert!((both[0] - 1.21).abs() < 1e-12 && (both[1] * 1.21 - 1.0).abs() < 1e-12, "{both:?}");
        let signed = Parameter::linear("shift", "s", "", 0.01, -1.0, 1.0).vanishing_at(0.0);
        assert_eq!(strengthened(&signed, 0.01, 10.0), [0.1, -0.1]);
        let amount = Parameter::log("amount", "1", "", 0.01, 1e-6, 1.0).vanishing_at(0.0);
        assert_eq!(strengthened(&amount, 0.01, 0.1), [0.001]);
    }
}
