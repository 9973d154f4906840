//! Global searches over the whole box of the variables, on the coarse grid: what descent from a few starts is to be measured against.

use std::sync::atomic::{AtomicUsize, Ordering};

use metaheuristics_nature::methods::de::{De, Strategy};
use metaheuristics_nature::{Bounded, ObjFunc, Pool, Solver};

use super::approach::{FIRST_REACHES, Fitter, State};
use super::calibrate::Progress;
use super::least_squares::Problem;
use super::method::Method;
use super::micro_ga;
use super::problem::Calibration;
use crate::model::{Model, ModelError};

/// Members of the population for each variable: Storn & Price (1997, J. Glob. Optim. 11, 341) take five to ten.
const MEMBERS_A_VARIABLE: usize = 5;
/// Relative difference between the worst member and the best at which the population has settled.
const SETTLED: f64 = 1e-6;
/// What cannot be simulated costs more than anything that can.
const IMPOSSIBLE: f64 = 1e300;

/// Half the sum of squares over the unit cube of those variables that have any choice.
struct Cube<'a> {
    problem: &'a Calibration<'a>,
    /// All variables, to put the free ones among.
    still: Vec<f64>,
    free: Vec<usize>,
    bounds: Vec<[f64; 2]>,
    evaluations: AtomicUsize,
}

impl<'a> Cube<'a> {
    fn new(problem: &'a Calibration) -> Self {
        let (lower, upper) = problem.bounds();
        let free: Vec<usize> = (0..lower.len()).filter(|&j| lower[j] < upper[j]).collect();
        let bounds = vec![[0.0, 1.0]; free.len()];
        Cube { problem, still: problem.start(), free, bounds, evaluations: AtomicUsize::new(0) }
    }

    /// All variables of a point in the cube.
    fn variables(&self, point: &[f64]) -> Vec<f64> {
        let (lower, upper) = self.problem.bounds();
        let mut x = self.still.clone();
        for (&j, share) in self.free.iter().zip(point) {
            x[j] = lower[j] + share.clamp(0.0, 1.0) * (upper[j] - lower[j]);
        }
        x
    }

    fn start(&self) -> Vec<f64> {
        let (lower, upper) = self.problem.bounds();
        self.free.iter().map(|&j| (self.still[j] - lower[j]) / (upper[j] - lower[j])).collect()
    }

    fn cost(&self, point: &[f64]) -> f64 {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let residuals = self.problem.residuals(&self.variables(point));
        let cost = residuals.map_or(IMPOSSIBLE, |r| 0.5 * r.iter().map(|r| r * r).sum::<f64>());
        if cost.is_finite() { cost } else { IMPOSSIBLE }
    }
}

impl Bounded for &Cube<'_> {
    fn bound(&self) -> &[[f64; 2]] {
        &self.bounds
    }
}

impl ObjFunc for &Cube<'_> {
    type Ys = f64;

    fn fitness(&self, point: &[f64]) -> f64 {
        self.cost(point)
    }
}

impl Fitter<'_> {
    /// The best that a global search finds of a model, on the coarse grid, from nothing but the bounds.
    pub(super) fn searched(&self, model: &Model) -> Result<State, ModelError> {
        let problem = Calibration::new(model, self.runs, self.window(FIRST_REACHES, f64::INFINITY));
        let cube = Cube::new(&problem);
        let n = problem.samples().max(1) as f64;
        let budget = (self.options.budget / self.runs.len().max(1)).max(1);
        let heard = |spent: usize, cost: f64| {
            (self.progress)(&Progress {
                stage: format!("{spent} of {budget} trials"),
                reaches: problem.window().reaches,
                iteration: spent,
                error_over_noise: (2.0 * cost / n).sqrt(),
            });
        };
        let point = match self.options.method {
            _ if cube.free.is_empty() => Vec::new(),
            Method::MicroGa => {
                micro_ga::minimise(&|p: &[f64]| cube.cost(p), &cube.start(), budget, self.options.seed, &heard).0
            }
            _ => evolved(&cube, budget, self.options.seed, &heard),
        };
        self.count(cube.evaluations.load(Ordering::Relaxed));
        let values = problem.values(&cube.variables(&point));
        // What the signals say is worth a look, too: a search that ends above it has found nothing.
        let start = problem.values(&problem.start());
        let cost = |values: &[f64]| {
            problem.residuals(&problem.variables(values)).map(|r| 0.5 * r.iter().map(|r| r * r).sum::<f64>())
        };
        match (cost(&values), cost(&start)) {
            (Ok(found), Ok(known)) if known < found => Ok(State { values: start, cost: known }),
            (found, _) => Ok(State { cost: found?, values }),
        }
    }
}

/// Differential evolution: best/1/bin, until the budget is spent or all members are alike.
fn evolved(cube: &Cube, budget: usize, seed: u64, heard: &(dyn Fn(usize, f64) + Sync)) -> Vec<f64> {
    let members = (MEMBERS_A_VARIABLE * cube.free.len()).clamp(20, budget.max(20));
    let settings = De::new().strategy(Strategy::C2F3).f(0.7).cross(0.9);
    let found = Solver::build(settings, cube)
        .seed(seed)
        .pop_num(members)
        .init_pool(Pool::UniformBy(Box::new(|_| true)))
        .task(|ctx| {
            let spent = cube.evaluations.load(Ordering::Relaxed);
            let (least, most) =
                ctx.pool_y.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), y| (a.min(*y), b.max(*y)));
            heard(spent, least);
            spent + members > budget || most - least <= SETTLED * least
        })
        .solve();
    found.as_best_xs().to_vec()
}
