//! A candidate refitted: the start model with one form of an effect added, from the most promising of many starts.

use super::candidate::Form;
use super::ground::Ground;
use crate::fit::least_squares::{Limits, minimise};
use crate::fit::problem::Calibration;
use crate::model::effects::Chosen;
use crate::model::parameter::Scale;
use crate::model::{Model, ModelError};

const GLANCE: Limits = Limits { iterations: 6, cost_tolerance: 1e-2, step_tolerance: 1e-7 };
const FULL: Limits = Limits { iterations: 25, cost_tolerance: 1e-3, step_tolerance: 1e-7 };

/// Strengths at which an effect's signature is taken, as multiples of its usual start's.
const STRENGTHS: [f64; 5] = [1.0, 0.1, 0.3, 3.0, 10.0];
/// How many starts are looked at by a few iterations, and how many of these are followed.
const GLANCED: usize = 4;
const FOLLOWED: usize = 2;

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
    /// Simulations it took.
    pub evaluations: usize,
}

/// Refits the start model with `form` added.
///
/// # Errors
/// If no start can be simulated.
pub fn refit(ground: &Ground, form: &Form) -> Result<Refit, ModelError> {
    let effects: Vec<Chosen> = ground.effects.iter().cloned().chain([form.chosen.clone()]).collect();
    let model = ground.model(&effects);
    let (model, effects) = (&model, effects.clone());
    let problem = ground.problem(model);
    let mut evaluations = 0;
    let mut starts = promising(ground, model, &problem, &form.chosen, &mut evaluations);
    starts.truncate(GLANCED);
    let mut failure = None;
    let mut glimpses = Vec::new();
    for start in &starts {
        match minimise(&problem, &problem.variables(&ground.values_with(start)), GLANCE, |_, _| {}) {
            Ok(solution) => glimpses.push(solution),
            Err(error) => failure = Some(error),
        }
    }
    evaluations += glimpses.iter().map(|g| g.evaluations).sum::<usize>();
    glimpses.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    glimpses.truncate(FOLLOWED);
    let mut best = None;
    for glimpse in glimpses {
        let solution = minimise(&problem, &glimpse.x, FULL, |_, _| {})?;
        evaluations += solution.evaluations;
        if best.as_ref().is_none_or(|b: &crate::fit::least_squares::Solution| solution.cost < b.cost) {
            best = Some(solution);
        }
    }
    let Some(best) = best else {
        return Err(failure.unwrap_or(ModelError::NotFinite {
            time_s: 0.0,
            position_m: 0.0,
            effects: form.chosen.label(),
        }));
    };
    Ok(Refit {
        form: form.clone(),
        effects,
        square: 2.0 * best.cost,
        residuals: ground.seen(&best.residuals),
        added: model.shared[ground.shared..].iter().filter(|p| p.prior.is_none()).count(),
        values: problem.values(&best.x),
        evaluations,
    })
}

/// Values of the added parameters at which to start, the most promising first: by what their signature, projected off the fitted
/// parameters, would take away of the residual.
fn promising(
    ground: &Ground,
    model: &Model,
    problem: &Calibration,
    chosen: &Chosen,
    evaluations: &mut usize,
) -> Vec<Vec<f64>> {
    let parameters = &model.shared[ground.shared..];
    let usual: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let others = chosen.effect.other_starts(chosen.elements.unwrap_or(1));
    let places = std::iter::once(usual.clone())
        .chain(others.iter().map(|factors| usual.iter().zip(factors).map(|(v, f)| v * f).collect()));
    let strengths: &[f64] = if others.len() > 12 { &STRENGTHS[..1] } else { &STRENGTHS };
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for place in places {
        for &strength in strengths {
            for sign in [1.0, -1.0] {
                let mut start = place.clone();
                let Some(j) = parameters.iter().position(|p| p.vanishes_at.is_some()) else {
                    starts.push(start);
                    continue;
                };
                let p = &parameters[j];
                let gone = p.vanishes_at.unwrap_or(0.0);
                start[j] = match p.scale {
                    // Some vanish at one on a log scale: a ratio, and its inverse.
                    Scale::Log if gone > 0.0 => gone * (start[j] / gone).powf(strength * sign),
                    Scale::Log if sign > 0.0 => start[j] * strength,
                    Scale::Linear => gone + (start[j] - gone) * strength * sign,
                    Scale::Log => continue,
                }
                .clamp(p.lower, p.upper);
                if !starts.contains(&start) {
                    starts.push(start);
                }
            }
        }
    }
    let left = ground.projected_dot(&ground.residuals, &ground.residuals);
    let mut scored: Vec<(f64, Vec<f64>)> = starts
        .into_iter()
        .filter_map(|start| {
            *evaluations += 1;
            let with = ground.residuals_with(problem, &start).ok()?;
            let change: Vec<f64> = with.iter().zip(&ground.residuals).map(|(w, r)| w - r).collect();
            let size = ground.projected_dot(&change, &change);
            let along = ground.projected_dot(&change, &ground.residuals);
            // The strength is free: within what a linear forecast can say.
            let by = if size > 0.0 { (-along / size).clamp(0.3, 2.0) } else { 0.0 };
            Some((left + by * (2.0 * along + by * size), start))
        })
        .filter(|(cost, _)| cost.is_finite())
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.into_iter().map(|(_, start)| start).collect()
}
