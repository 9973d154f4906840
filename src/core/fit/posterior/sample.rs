//! The joint posterior of a fit's values by sampling.

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::convergence::Convergence;
use crate::fit::numeric::ensemble::{Ensembles, Walker};
use crate::fit::numeric::least_squares::Problem;
use crate::fit::numeric::population::normal;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::posterior::{Marginal, Posterior};
use crate::fit::posterior::interval;
use crate::fit::posterior::likelihood::Likelihood;
use crate::fit::posterior::thresholds::{
    CONVERGED_R_HAT, FIRST_SWEEPS, KEPT_DRAWS, LEAST_START_SPREAD, LEAST_WALKERS, LINES_PER_VARIABLE, MOVES_PER_DRAW,
    OPEN_START_SHARE, R_HAT_SCATTER, START_NEARER, START_SPREAD, SWEEPS_GROWTH, WALKERS_PER_VARIABLE,
};
use crate::fit::problem::elements::vanished;
use crate::fit::problem::error::FitError;
use crate::fit::problem::fit_problem::Window;
use crate::fit::progress::{OnProgress, Progress};
use crate::fit::search::calibrator::Calibrator;
use crate::fit::search::options::Options;
use crate::model::stop;
use crate::rig::Rig;

/// Ensembles that know nothing of each other.
const ENSEMBLES: usize = 2;

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
    let coarser = ctx.problem(&model, Window { reaches: halved, ..problem.window() }).residuals(&centre)?;
    Ok(Likelihood::of(&problem, &centre, &coarser)?.map(|likelihood| work(&likelihood, progress)))
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
        let simulations = AtomicUsize::new(0);
        let draws = draw(likelihood, wanted, options.seed, progress, &simulations);
        (draws, likelihood.free.clone(), likelihood.bounds(), scales, simulations.into_inner())
    })?;
    stop::check()?;
    let Some((draws, of, bounds, scales, simulations)) = sampled else { return Ok(()) };
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
    let every = (chains * sweeps).div_ceil(KEPT_DRAWS);
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
    /// The second half of each walker's way.
    fn of(all: &Ensembles, variables: &(impl Fn(&[f64]) -> Vec<f64> + Sync)) -> Self {
        let walkers: Vec<_> = all.walkers().collect();
        let counts = |w: &&Walker| w.path[w.path.len() / 2..].iter().map(|at| variables(at)).collect::<Vec<_>>();
        let ways: Vec<Vec<Vec<f64>>> = walkers.par_iter().map(counts).collect();
        let one = |a: usize| ways.iter().map(|way| way.iter().map(|x| x[a]).collect()).collect();
        let chains: Vec<Vec<Vec<f64>>> = (0..ways[0][0].len()).map(one).collect();
        let (moves, steps) = all.walkers().fold((0, 0), |(m, s), w| (m + w.moves, s + w.path.len()));
        let convergence = chains.par_iter().map(|chains| Convergence::of(chains, ENSEMBLES)).collect();
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

fn draw(
    likelihood: &Likelihood,
    wanted: usize,
    seed: u64,
    progress: &OnProgress<'_>,
    simulations: &AtomicUsize,
) -> Draws {
    let (centre, bounds, spread) = (likelihood.centre(), likelihood.bounds(), likelihood.spread(OPEN_START_SHARE));
    let variables = |at: &[f64]| -> Vec<f64> {
        let step = &spread * DVector::from_column_slice(at);
        centre.iter().zip(step.iter()).map(|(x, by)| x + by).collect()
    };
    let log = |at: &[f64]| {
        let x = variables(at);
        if x.iter().zip(&bounds).any(|(x, (lower, upper))| !(lower..=upper).contains(&x)) {
            return f64::NEG_INFINITY;
        }
        simulations.fetch_add(1, Ordering::Relaxed);
        likelihood.log(&x)
    };
    let walkers = (WALKERS_PER_VARIABLE * centre.len()).max(LEAST_WALKERS);
    let room = Room { centre: &centre, bounds: &bounds, spread: &spread };
    // Wider than the posterior; where nothing fits so far away, nearer, and at the fit in the end.
    let start = |number: usize| {
        let mut random = fastrand::Rng::with_seed(seed.wrapping_mul(1_000_003).wrapping_add(number as u64));
        let mut reach = START_SPREAD;
        while reach > LEAST_START_SPREAD {
            let at = room.draw(reach, &mut random);
            let there = log(&at);
            if there.is_finite() {
                return (at, there);
            }
            reach *= START_NEARER;
        }
        (vec![0.0; centre.len()], likelihood.at_centre)
    };
    let starts: Vec<(Vec<f64>, f64)> = (0..ENSEMBLES * walkers).into_par_iter().map(start).collect();
    let mut all = Ensembles::new(starts.chunks(walkers).map(<[_]>::to_vec).collect(), seed);
    let most = (MOVES_PER_DRAW * wanted).div_ceil(ENSEMBLES * walkers).max(FIRST_SWEEPS);
    let (mut sweeps, mut until) = (0, FIRST_SWEEPS);
    loop {
        while sweeps < until {
            all.sweep(&log);
            sweeps += 1;
            progress(&Progress::from(
                format!("posterior: {} simulations", simulations.load(Ordering::Relaxed)).as_str(),
            ));
        }
        let draws = Draws::of(&all, &variables);
        if sweeps >= most || draws.met(wanted) {
            return draws;
        }
        until = ((sweeps as f64 * SWEEPS_GROWTH) as usize).min(most);
    }
}

/// The linearised likelihood within the bounds.
struct Room<'a> {
    centre: &'a [f64],
    bounds: &'a [(f64, f64)],
    spread: &'a DMatrix<f64>,
}

impl Room<'_> {
    /// A draw of a normal density of standard deviation `reach` about the fit, cut off at the bounds: by steps along
    /// random lines (hit and run: Bélisle, Romeijn & Smith 1993, Math. Oper. Res. 18, 255). Nothing is simulated for
    /// it.
    fn draw(&self, reach: f64, random: &mut fastrand::Rng) -> Vec<f64> {
        let n = self.centre.len();
        let (mut at, mut x) = (DVector::zeros(n), DVector::from_column_slice(self.centre));
        for _ in 0..LINES_PER_VARIABLE * n {
            let line = DVector::from_fn(n, |_, _| normal(random)).normalize();
            let along = self.spread * &line;
            let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
            for (a, (lower, upper)) in self.bounds.iter().enumerate().filter(|(a, _)| along[*a] != 0.0) {
                let (one, other) = ((lower - x[a]) / along[a], (upper - x[a]) / along[a]);
                (from, to) = (from.max(one.min(other)), to.min(one.max(other)));
            }
            let by = cut_off_normal(-at.dot(&line), reach, (from.min(0.0), to.max(0.0)), random);
            (at, x) = (at + &line * by, x + along * by);
        }
        at.as_slice().to_vec()
    }
}

/// A draw of a normal density between two ends.
fn cut_off_normal(mean: f64, sd: f64, (from, to): (f64, f64), random: &mut fastrand::Rng) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    let standard = Normal::standard();
    let [low, high] = [from, to].map(|end| standard.cdf((end - mean) / sd));
    let drawn = mean + sd * standard.inverse_cdf(low + (high - low) * random.f64());
    drawn.clamp(from, to)
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
