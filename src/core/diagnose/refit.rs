//! A candidate refitted: the start model with one form of an effect added, from the most promising of many starts.
//!
//! First a glimpse of every form: only what it adds is moved, while the start model's parameters take up what they can in a straight
//! line (variable projection: Golub & Pereyra 1973, SIAM J. Numer. Anal. 10, 413). Then those worth it are followed to the end.

use crate::diagnose::baseline::{Ground, dot};
use crate::diagnose::candidate::Form;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution, minimise};
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::effects::Chosen;
use crate::model::parameter::{Parameter, Scale};
use crate::model::{Model, ModelError};

const GLANCE: Limits = Limits { iterations: 10, cost_tolerance: 3e-3, step_tolerance: 1e-7, thorough: false };
const FULL: Limits = Limits { iterations: 25, cost_tolerance: 1e-3, step_tolerance: 1e-7, thorough: false };

/// Strengths at which an effect's signature is taken, as multiples of its usual start's.
const STRENGTHS: [f64; 5] = [1.0, 0.1, 0.3, 3.0, 10.0];
/// Places up to which an effect is tried at all strengths: with more, one has to do.
const FEW_PLACES: usize = 12;
/// How many starts are looked at by a few iterations, and how many of these are followed.
const GLANCED: usize = 4;
const FOLLOWED: usize = 2;
/// Parts of a straight line's step that are tried.
const PARTS: [f64; 4] = [1.0, 0.3, 0.1, 0.0];
/// Strengths that a linear forecast from one of them can speak for.
const FORECAST: (f64, f64) = (0.3, 2.0);

/// What a refit came to.
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
    /// Free parameters that it adds: those of which nothing was known.
    pub added: usize,
    /// Variables of the next best glimpses, to be followed too.
    others: Vec<Vec<f64>>,
}

/// The start model with `form` added, fitted in what it adds alone, from each of its most promising starts.
///
/// # Errors
/// If no start can be simulated.
pub fn glimpse(ground: &Ground, form: &Form) -> Result<Refit, ModelError> {
    let effects: Vec<Chosen> = ground.effects.iter().cloned().chain([form.chosen.clone()]).collect();
    let model = ground.model(&effects);
    let problem = ground.problem(&model);
    let added = Added::new(ground, &problem, &model);
    let mut failure = None;
    let mut glimpses: Vec<Solution> = Vec::new();
    for start in promising(ground, &model, &problem, &form.chosen).iter().take(GLANCED) {
        match minimise(&added, &problem.variables(&ground.values_with(start))[added.range()], GLANCE, |_, _| {}) {
            Ok(solution) => glimpses.push(solution),
            Err(error) => failure = Some(error),
        }
    }
    glimpses.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let Some(best) = glimpses.first() else { return Err(failure.unwrap_or_else(|| no_start(form))) };
    let mut all = Vec::new();
    for glimpse in glimpses.iter().take(FOLLOWED) {
        all.push(added.whole(&glimpse.x)?);
    }
    Ok(Refit {
        form: form.clone(),
        square: 2.0 * best.cost,
        residuals: best.residuals[..ground.residuals.len()].to_vec(),
        added: free(ground, &model),
        values: problem.values(&all.remove(0)),
        others: all,
        effects: model.effects.clone(),
    })
}

/// The problem of fitting only what an effect adds.
struct Added<'g> {
    ground: &'g Ground<'g>,
    problem: &'g FitProblem<'g>,
    /// The start model's variables, with the effect's usual ones among them.
    usual: Vec<f64>,
    /// Mean and deviation of what is known of the added variables.
    priors: Vec<Option<(f64, f64)>>,
}

impl<'g> Added<'g> {
    fn new(ground: &'g Ground, problem: &'g FitProblem, model: &Model) -> Self {
        let parameters = &model.shared[ground.shared..];
        let variables = |of: fn(&Parameter) -> f64| {
            problem.variables(&ground.values_with(&parameters.iter().map(of).collect::<Vec<_>>()))
        };
        let means = variables(|p| p.prior.map_or(p.start, |(mean, _)| mean));
        let priors = parameters
            .iter()
            .zip(&means[ground.shared..])
            .map(|(p, &mean)| p.prior.map(|(_, sd)| (mean, sd)))
            .collect();
        Added { ground, problem, usual: variables(|p| p.start), priors }
    }

    /// Where the added variables stand among all.
    fn range(&self) -> std::ops::Range<usize> {
        self.ground.shared..self.ground.shared + self.priors.len()
    }

    fn with(&self, added: &[f64]) -> Vec<f64> {
        let mut x = self.usual.clone();
        x[self.range()].copy_from_slice(added);
        x
    }

    fn seen(&self, added: &[f64]) -> Result<Vec<f64>, ModelError> {
        Ok(self.ground.seen(&self.problem.residuals(&self.with(added))?))
    }

    /// All variables, the start model's moved to where they take up most, or as far on the way there as the straight line holds.
    fn whole(&self, added: &[f64]) -> Result<Vec<f64>, ModelError> {
        let (lower, upper) = self.problem.bounds();
        let still = self.with(added);
        let moved = self.ground.moved(&still, &self.seen(added)?);
        let on_the_way = PARTS.map(|part| {
            let between = still.iter().zip(&moved).zip(lower.iter().zip(upper));
            between.map(|((s, m), (l, u))| (s + part * (m - s)).clamp(*l, *u)).collect::<Vec<f64>>()
        });
        let square = |x: &Vec<f64>| self.problem.residuals(x).map_or(f64::INFINITY, |r| dot(&r, &r));
        let best = on_the_way.into_iter().map(|x| (square(&x), x)).min_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best.map_or(still, |(_, x)| x))
    }
}

impl Problem for Added<'_> {
    type Error = ModelError;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, ModelError> {
        let mut residuals = self.ground.projected(&self.seen(x)?);
        let known = self.priors.iter().zip(x).filter_map(|(prior, v)| prior.map(|(mean, sd)| (v - mean) / sd));
        residuals.extend(known);
        Ok(residuals)
    }

    fn bounds(&self) -> (&[f64], &[f64]) {
        let (lower, upper) = self.problem.bounds();
        (&lower[self.range()], &upper[self.range()])
    }

    fn difference_step(&self, j: usize) -> f64 {
        self.problem.difference_step(self.ground.shared + j)
    }
}

/// Follows a glimpse to the end.
///
/// # Errors
/// If it cannot be simulated.
pub fn follow(ground: &Ground, glimpse: &Refit) -> Result<Refit, ModelError> {
    let model = ground.model(&glimpse.effects);
    let problem = ground.problem(&model);
    // Without cavities the start model is far from anything that has them: they are tried from the signals, too.
    let boils = glimpse.form.chosen.effect.lets_boil();
    let starts = std::iter::once(problem.variables(&glimpse.values))
        .chain(glimpse.others.iter().cloned())
        .chain(boils.then(|| problem.start()));
    let mut best: Option<Solution> = None;
    for start in starts {
        let solution = minimise(&problem, &start, FULL, |_, _| {})?;
        if best.as_ref().is_none_or(|b| solution.cost < b.cost) {
            best = Some(solution);
        }
    }
    let best = best.ok_or_else(|| no_start(&glimpse.form))?;
    Ok(Refit {
        form: glimpse.form.clone(),
        square: 2.0 * best.cost,
        residuals: ground.seen(&best.residuals),
        added: glimpse.added,
        values: problem.values(&best.x),
        others: Vec::new(),
        effects: glimpse.effects.clone(),
    })
}

fn no_start(form: &Form) -> ModelError {
    ModelError::NotFinite { time_s: 0.0, position_m: 0.0, effects: form.chosen.label() }
}

/// Parameters of which nothing is known beforehand.
fn free(ground: &Ground, model: &Model) -> usize {
    model.shared[ground.shared..].iter().filter(|p| p.prior.is_none()).count()
}

/// Values of the added parameters at which to start, the most promising first: by what their signature, projected off the fitted
/// parameters, would take away of the residual.
fn promising(ground: &Ground, model: &Model, problem: &FitProblem, chosen: &Chosen) -> Vec<Vec<f64>> {
    let left = ground.projected_dot(&ground.residuals, &ground.residuals);
    let mut scored: Vec<(f64, Vec<f64>)> = starts(&model.shared[ground.shared..], chosen)
        .into_iter()
        .filter_map(|start| {
            let all = problem.residuals(&problem.variables(&ground.values_with(&start))).ok()?;
            let change: Vec<f64> = ground.seen(&all).iter().zip(&ground.residuals).map(|(w, r)| w - r).collect();
            let size = ground.projected_dot(&change, &change);
            let along = ground.projected_dot(&change, &ground.residuals);
            let by = if size > 0.0 { (-along / size).clamp(FORECAST.0, FORECAST.1) } else { 0.0 };
            Some((left + by * (2.0 * along + by * size), start))
        })
        .filter(|(cost, _)| cost.is_finite())
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.into_iter().map(|(_, start)| start).collect()
}

/// All starts of an effect: its usual one and its others, in several strengths, of either sign where it has one.
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

/// A value so many times as far from where it vanishes, to either side where there are two.
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
