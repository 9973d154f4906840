//! The joint posterior of a fit's values by sampling.

use std::sync::atomic::Ordering;

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::convergence::Convergence;
use crate::fit::numeric::randomised::{Chain, Chains};
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::posterior::{Marginal, Posterior};
use crate::fit::posterior::interval;
use crate::fit::posterior::likelihood::Likelihood;
use crate::fit::posterior::thresholds::{
    CHAINS, CONVERGED_R_HAT, FIRST_SWEEPS, KEPT_DRAWS, MOVES_PER_DRAW, R_HAT_SCATTER, SWEEPS_GROWTH,
};
use crate::fit::problem::elements::vanished;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::Window;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::options::Options;
use crate::model::stop;
use crate::rig::Rig;

/// Groups of chains that are compared.
const GROUPS: usize = 2;

/// What is done with the likelihood of a fit and the number of simulations so far; none where it has no likelihood.
pub(crate) fn with_likelihood<T>(
    rig: &Rig,
    runs: &[RunData],
    fit: &Fit,
    options: &Options,
    progress: &OnProgress<'_>,
    work: impl FnOnce(&Likelihood, &OnProgress<'_>) -> T,
) -> Result<Option<T>, FitError> {
    let values = fit.values();
    let ctx = Calibrator::new(rig, runs, options, progress, &fit.effects, Some(&values))?;
    let model = ctx.model(&fit.effects);
    let mut problem = ctx.problem(&model, ctx.whole(fit.reaches));
    // An element that has vanished stays so: the posterior is that of the model without it, which is as good.
    let gone: Vec<usize> = vanished(&problem, &values).into_iter().flat_map(|e| [e.strength, e.time]).collect();
    problem.hold(&gone, &values);
    let centre = problem.variables(&values);
    let halved = model.fitting_reaches(&values[..model.shared.len()], fit.reaches.div_ceil(2));
    let mut coarser = ctx.problem(&model, Window { reaches: halved, ..problem.window() });
    coarser.hold(&gone, &values);
    Ok(Likelihood::of(&problem, &coarser, &centre)?.map(|likelihood| work(&likelihood, progress)))
}

/// Samples the joint posterior of a fit's values until all parameters have `wanted` effective draws and R̂ says that
/// the chains have met, and sets [`Fit::posterior`] and the posterior of each parameter. Where they come that far, the
/// 95% intervals are those of the posterior; otherwise they stay what they are, and [`Posterior::converged`] says so.
/// Values and standard errors stay in any case.
///
/// # Errors
/// As [`crate::fit::search::calibrate::refine`].
pub fn sample(
    rig: &Rig,
    runs: &[RunData],
    fit: &mut Fit,
    wanted: usize,
    options: &Options,
    progress: &OnProgress<'_>,
) -> Result<(), FitError> {
    let sampled = with_likelihood(rig, runs, fit, options, progress, |likelihood, progress| {
        let scales: Vec<_> = likelihood.free.iter().map(|&j| fit.parameters[j].scale).collect();
        let draws = draw(likelihood, wanted, options.seed, progress)?;
        let simulations = likelihood.simulations.load(Ordering::Relaxed);
        Some((draws, likelihood.free.clone(), likelihood.bounds(), scales, simulations))
    })?;
    stop::check()?;
    let Some((draws, of, bounds, scales, simulations)) = sampled.flatten() else { return Ok(()) };
    let to_value = |a: usize, x: f64| match scales[a] {
        crate::model::parameter::Scale::Linear => x,
        crate::model::parameter::Scale::Log => x.exp(),
    };
    let evaluations = simulations * runs.len();
    fit.evaluations += evaluations;
    let met = draws.met(wanted);
    for (a, &j) in of.iter().enumerate() {
        let mut sorted: Vec<f64> = draws.chains[a].concat();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = interval::of(&sorted, bounds[a]);
        let end = |x: f64| if x.is_finite() { to_value(a, x) } else { x };
        let marginal = Marginal {
            median: to_value(a, sorted[sorted.len() / 2]),
            interval_95: (end(low), end(high)),
            r_hat: draws.convergence[a].r_hat,
            effective_draws: draws.convergence[a].effective_draws,
        };
        if met {
            fit.parameters[j].interval_95 = marginal.interval_95;
        }
        fit.parameters[j].posterior = Some(marginal);
    }
    let (chains, sweeps) = (draws.chains[0].len(), draws.chains[0][0].len());
    let every = (chains * sweeps).div_ceil(KEPT_DRAWS.max(wanted));
    let one = |i: usize| (0..of.len()).map(|a| to_value(a, draws.chains[a][i % chains][i / chains])).collect();
    fit.posterior = Some(Posterior {
        converged: met,
        r_hat: draws.r_hat(),
        effective_draws: draws.effective_draws(),
        wanted,
        chains,
        sweeps,
        acceptance: draws.acceptance,
        evaluations,
        draws: (0..chains * sweeps).step_by(every).map(one).collect(),
        of,
    });
    Ok(())
}

/// The draws that count.
struct Draws {
    /// Of each variable, of each chain.
    chains: Vec<Vec<Vec<f64>>>,
    convergence: Vec<Convergence>,
    acceptance: f64,
}

impl Draws {
    /// Of each chain's way, all but the first quarter.
    fn of(all: &[Chain]) -> Self {
        let counts = |c: &Chain, a: usize| c.path[c.path.len() / 4..].iter().map(|x| x[a]).collect();
        let one = |a: usize| all.iter().map(|c| counts(c, a)).collect();
        let chains: Vec<Vec<Vec<f64>>> = (0..all[0].path[0].len()).map(one).collect();
        let (moves, steps) = all.iter().fold((0, 0), |(m, s), c| (m + c.moves, s + c.path.len()));
        let convergence = chains.par_iter().map(|chains| Convergence::of(chains, GROUPS)).collect();
        Draws { chains, convergence, acceptance: moves as f64 / steps.max(1) as f64 }
    }

    fn r_hat(&self) -> f64 {
        // one that is not a number has not converged
        self.convergence.iter().map(|c| if c.r_hat.is_nan() { f64::INFINITY } else { c.r_hat }).fold(1.0, f64::max)
    }

    fn effective_draws(&self) -> f64 {
        self.convergence.iter().map(|c| c.effective_draws).fold(f64::INFINITY, f64::min)
    }

    fn met(&self, wanted: usize) -> bool {
        let by_chance = (1.0 + R_HAT_SCATTER / wanted as f64).sqrt();
        self.r_hat() <= CONVERGED_R_HAT.max(by_chance) && self.effective_draws() >= wanted as f64
    }
}

fn draw(likelihood: &Likelihood, wanted: usize, seed: u64, progress: &OnProgress<'_>) -> Option<Draws> {
    let mut all = Chains::new(likelihood, &likelihood.centre(), &likelihood.bounds(), CHAINS, seed)?;
    let most = (MOVES_PER_DRAW * wanted).div_ceil(CHAINS).max(FIRST_SWEEPS);
    let (mut sweeps, mut until, mut so_far) = (0, FIRST_SWEEPS, String::new());
    loop {
        while sweeps < until {
            all.step();
            sweeps += 1;
            let simulations = likelihood.simulations.load(Ordering::Relaxed);
            progress(&Progress::from(format!("posterior: {simulations} simulations{so_far}").as_str()));
        }
        let draws = Draws::of(&all.chains);
        if sweeps >= most || draws.met(wanted) || stop::check().is_err() {
            return Some(draws);
        }
        so_far = format!(", {:.0} of {wanted} independent draws", draws.effective_draws().min(wanted as f64));
        until = ((sweeps as f64 * SWEEPS_GROWTH) as usize).min(most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::doubt::Doubt;
    use crate::fit::posterior::doubt::find_doubts;
    use crate::fit::problem::test_record::{HDPE, record};
    use crate::fit::search::calibrate::calibrate;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;

    const RUN: RunValues =
        RunValues { initial_velocity_m_s: 0.5, valve_head_m: 20.0, closing_time_s: 0.05, friction_scale: 1.0 };

    /// A strong signal: errors are small, the residuals are straight as far as they go, and the posterior is the normal
    /// density of the fit's own errors.
    #[test]
    fn where_errors_are_normal_the_posterior_has_the_linear_intervals() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:1").unwrap();
        let runs = [record(&rig, &effects, &[380.0, 0.12, 0.05], RUN, 0.05, 3.0)];
        let options = Options::default();
        let mut fit = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        find_doubts(&rig, &runs, &mut fit, &options).unwrap();
        let linear = fit.clone();
        sample(&rig, &runs, &mut fit, 400, &options, &|_| {}).unwrap();
        let sampled = fit.posterior.as_ref().unwrap();
        assert!(sampled.converged && sampled.effective_draws >= 400.0, "{sampled:?}");
        assert!(sampled.draws.len() > 500 && sampled.draws.iter().all(|draw| draw.len() == sampled.of.len()));
        for (p, before) in fit.parameters.iter().zip(&linear.parameters) {
            if before.doubt.is_some() {
                continue;
            }
            let (own, linear, error) = (p.interval_95, before.interval_95, before.standard_error());
            // the end of an interval of n normal draws is known to √(0.975 0.025/n)/φ(1.96) standard errors: 0.13 of
            // 400
            for (own, linear) in [(own.0, linear.0), (own.1, linear.1)] {
                assert!((own - linear).abs() < 0.5 * error, "{}: {own} {linear} {error}", p.name);
            }
        }
        assert!(linear.parameters.iter().filter(|p| p.doubt.is_none()).count() >= 6, "{:?}", linear.parameters);
    }

    /// Creep of 20 s in a record of 3 s: only the ratio of compliance and time is well seen, and the fit ends at the
    /// bound of the time, 88 s. The draws go along the ratio and hold the true time.
    #[test]
    fn what_the_record_hardly_shows_is_in_doubt_and_wide() {
        let rig = Rig::from_toml(HDPE, "rig.toml").unwrap();
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let runs = [record(&rig, &effects, &[380.0, 0.12, 0.05, 0.5, 20.0], RUN, 0.05, 3.0)];
        let options = Options::default();
        let mut fit = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        find_doubts(&rig, &runs, &mut fit, &options).unwrap();
        let slow = fit.parameter("tau2_s").unwrap();
        assert!(matches!(slow.doubt, Some(Doubt::Curved | Doubt::Bound)), "{slow:?}");
        sample(&rig, &runs, &mut fit, 50, &options, &|_| {}).unwrap();
        let slow = fit.parameter("tau2_s").unwrap();
        let (low, high) = slow.interval_95;
        assert!(fit.posterior.as_ref().unwrap().converged, "{:?}", fit.posterior);
        assert!(low < 20.0 && high > 20.0 && high > 3.0 * low, "{slow:?}");
    }
}
