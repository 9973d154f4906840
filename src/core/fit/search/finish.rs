//! The end of a fit: the grid is refined until halving its step changes less than the noise does, then all samples
//! enter.

use crate::fit::inference::errors::Errors;
use crate::fit::numeric::least_squares::{Limits, Problem, Solution};
use crate::fit::numeric::uncertainty::gauss_newton_step;
use crate::fit::outcome::fit::Fit;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::search::assemble::{assemble, moments_of};
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::descent::{polishing_from, slopes};
use crate::fit::search::options::Effort;
use crate::fit::search::polish::polish;
use crate::fit::search::thresholds::{FINAL, FINAL_REACHES, GRID_REFINEMENT, MAX_GRID_PULL, SCREENING};
use crate::model::{Model, ModelError};

/// The changes that a finer grid makes.
struct Pull {
    /// At the samples, in units of their noise, rms.
    error_over_noise: f64,
    /// The largest change in a variable, in standard errors.
    over_errors: f64,
}

fn is_brief(ctx: &Calibrator) -> bool {
    ctx.options.effort == Effort::Brief
}

/// The limits; those of a brief fit stop as early as a screening.
fn patient(ctx: &Calibrator, limits: Limits) -> Limits {
    if is_brief(ctx) { Limits { iterations: SCREENING.iterations, ..limits } } else { limits }
}

/// Refines the grid until its error is small against the noise and its pull on the parameters against their standard
/// errors, then fits all samples on a grid of half that step and puts the result together.
pub(crate) fn finish(ctx: &Calibrator, model: &Model, state: Estimate) -> Result<Fit, FitError> {
    let mut values = state.values;
    let mut reaches = FINAL_REACHES.max(ctx.least_reaches);
    let fine = loop {
        let fitting = |n: usize| model.fitting_reaches(&values[..model.shared.len()], n);
        let (coarse, fine) = (fitting(reaches), fitting(2 * reaches));
        let problem = ctx.passing(model, ctx.compared(coarse));
        let solution = ctx.minimise(&problem, &values, patient(ctx, GRID_REFINEMENT), &format!("{coarse} reaches"))?;
        values = problem.values(&solution.x);
        let pull = grid_pull(ctx, &problem, &solution, fine)?;
        // Where the model leaves more than noise, the grid may err by as much more.
        let left = (2.0 * solution.cost / problem.samples().max(1) as f64).sqrt();
        let settled = pull.error_over_noise <= ctx.options.grid_error_over_noise * left.max(1.0)
            && pull.over_errors <= MAX_GRID_PULL;
        if settled || 4 * reaches > ctx.options.most_reaches {
            break fine;
        }
        reaches *= 2;
    };
    descend(ctx, model, values, fine)
}

/// Fits all samples on a grid of so many reaches, and puts the result together.
pub(crate) fn descend(ctx: &Calibrator, model: &Model, values: Vec<f64>, reaches: usize) -> Result<Fit, FitError> {
    let (problem, solution) = last_descent(ctx, model, values, reaches)?;
    assemble(ctx, &problem, &solution)
}

/// The fit of all samples on a grid of so many reaches.
pub(crate) fn last_descent<'m>(
    ctx: &'m Calibrator,
    model: &'m Model<'m>,
    mut values: Vec<f64>,
    reaches: usize,
) -> Result<(FitProblem<'m>, Solution), FitError> {
    // A parameter that is held or known beforehand keeps its name.
    if model.constraints.is_empty() && model.priors.is_empty() {
        model.put_in_order(&mut values);
    }
    let whole = ctx.whole(reaches);
    let problem = if is_brief(ctx) { ctx.passing(model, whole) } else { ctx.problem(model, whole) };
    problem.validate_constraints(&model.constraints)?;
    let limits = polishing_from(ctx, &problem, &values, patient(ctx, FINAL))?;
    let solution = polish(ctx, &problem, &values, limits)?;
    Ok((problem, solution))
}

/// The end of a search on the least grid of a final fit, without any further descent.
pub(crate) fn without_descent(ctx: &Calibrator, model: &Model, state: Estimate) -> Result<Fit, FitError> {
    let fitting = |n: usize| model.fitting_reaches(&state.values[..model.shared.len()], n);
    let still = Limits { iterations: 0, ..FINAL };
    let problem = FitProblem::new(model, ctx.runs, ctx.whole(fitting(2 * FINAL_REACHES)));
    problem.validate_constraints(&model.constraints)?;
    let solution = ctx.minimise(&problem, &state.values, still, "without descent")?;
    let fit = assemble(ctx, &problem, &solution)?;
    let over = "the search ended, and a descent from there would gain nothing".to_owned();
    Ok(if fit.converged { Fit { stopped_because: over, ..fit } } else { fit })
}

/// The changes that a finer grid makes: at the samples, and by one Gauss-Newton step in the parameters.
fn grid_pull(ctx: &Calibrator, problem: &FitProblem, solution: &Solution, fine: usize) -> Result<Pull, ModelError> {
    let finer = ctx.problem(problem.model, Window { reaches: fine, ..problem.window() });
    let residuals = finer.residuals(&solution.x)?;
    let columns = slopes(ctx, problem, solution)?;
    ctx.count(1);
    let errors = Errors::among(&moments_of(problem, solution, &columns, &[]), &solution.at_bound);
    let change: Vec<f64> = residuals.iter().zip(&solution.residuals).map(|(f, c)| f - c).collect();
    let shifts = gauss_newton_step(&columns, &change, &solution.at_bound);
    let n = problem.samples().max(1);
    let over_errors = (0..shifts.len())
        .map(|j| shifts[j].abs() / errors.of_variable(j))
        .filter(|r| r.is_finite())
        .fold(0.0, f64::max);
    let error_over_noise = (change[..n].iter().map(|c| c * c).sum::<f64>() / n as f64).sqrt();
    Ok(Pull { error_over_noise, over_errors })
}

#[cfg(test)]
mod tests {
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::{calibrate, refine};
    use crate::fit::search::calibrator::Calibrator;
    use crate::fit::search::finish::descend;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// A fit begun anew where one has ended comes to the same place, and to the same errors: what the grid adds to them
    /// is no matter of the way.
    #[test]
    fn errors_belong_to_the_place_and_not_to_the_way_there() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let runs = [record(&rig, &effects, &[380.0, 0.12, 0.03, 0.35, 0.6], run, 0.05, 6.0)];
        let first = calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap();
        let again = refine(&rig, &runs, &effects, &first.values(), &Options::default(), &|_| {}).unwrap();
        assert_eq!(first.reaches, again.reaches);
        for (a, b) in first.parameters.iter().zip(&again.parameters) {
            assert!((a.value - b.value).abs() < 0.1 * a.standard_error(), "{}: {} {}", a.name, a.value, b.value);
            let ratio = a.standard_error() / b.standard_error();
            assert!((0.98..1.02).contains(&ratio), "{}: {} {}", a.name, a.standard_error(), b.standard_error());
        }
    }

    /// Elements of creep stand in the order of their times, wherever the descent began.
    #[test]
    fn elements_end_in_their_order() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let runs = [record(&rig, &effects, &[380.0, 0.12, 0.03, 0.35, 0.6], run, 0.05, 3.0)];
        let options = Options::default();
        let ctx = Calibrator::new(&rig, &runs, &options, &|_| {}, &effects, None).unwrap();
        let known = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        let mut exchanged = known.values();
        exchanged.swap(1, 3);
        exchanged.swap(2, 4);
        let fit = descend(&ctx, &ctx.model(&effects), exchanged, known.reaches).unwrap();
        let time_s = |name: &str| fit.parameter(name).unwrap().value;
        assert!(time_s("tau1_s") < time_s("tau2_s"), "{} {}", time_s("tau1_s"), time_s("tau2_s"));
    }
}
