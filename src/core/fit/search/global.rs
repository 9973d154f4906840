//! Global searches over the whole box of the variables, on the coarse grid: the yardstick for a descent from a few
//! starts.
//!
//! Offsets of sensors enter the heads linearly, so their best values for all else are known and cost no simulation
//! (variable projection, Golub & Pereyra 1973, SIAM J. Numer. Anal. 10, 413): the search needs no dimension for them.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::fit::numeric::least_squares::Problem;
use crate::fit::numeric::{evolution, micro_ga};
use crate::fit::problem::fit_problem::FitProblem;
use crate::fit::problem::groups::Groups;
use crate::fit::problem::method::Method;
use crate::fit::progress::Progress;
use crate::fit::search::calibrator::{Calibrator, Estimate};
use crate::fit::search::thresholds::COARSE_REACHES;
use crate::fit::search::thresholds::{IMPOSSIBLE_COST, MIN_WINDOW_SHARE, PRIOR_HALF_WIDTH};
use crate::model::{Model, ModelError};

/// The box of a search: the parameters' bounds, narrowed by what is known beforehand.
struct SearchBox {
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl SearchBox {
    fn of(problem: &FitProblem) -> Self {
        let (lower, upper) = problem.bounds();
        let mut window = SearchBox { lower: lower.to_vec(), upper: upper.to_vec() };
        let model = problem.model;
        let start = problem.start();
        for j in 0..start.len() {
            if let Some((mean, sd)) = problem.known(j) {
                window.narrow(j, mean, PRIOR_HALF_WIDTH * sd);
            }
        }
        let period_s = model.period_s(&problem.values(&start)[..model.shared.len()]);
        for (r, run) in problem.runs.iter().enumerate() {
            let [velocity, head, .., closure] = problem.run_variables(r);
            let (velocity_m_s, relative_sd) = run.start.velocity_m_s;
            window.narrow(velocity, velocity_m_s.ln(), (PRIOR_HALF_WIDTH * relative_sd).max(MIN_WINDOW_SHARE));
            if run.start.valve_head_m.1.is_none() {
                let offset_sd_m = run.sensors.iter().map(|s| s.offset_sd_m).fold(0.0, f64::max);
                window.narrow(head, run.start.valve_head_m.0, PRIOR_HALF_WIDTH * offset_sd_m);
            }
            let (start_s, sd) = run.start.closure_s;
            window.narrow(closure, start_s, (PRIOR_HALF_WIDTH * sd).max(MIN_WINDOW_SHARE * period_s));
        }
        Groups::of(problem).keep_visible(&mut window.lower, &mut window.upper, period_s);
        window
    }

    /// Keeps a variable within `reach` of its `known` value; a given start outside lies on the edge of the box.
    fn narrow(&mut self, j: usize, known: f64, reach: f64) {
        self.lower[j] = (known - reach).clamp(self.lower[j], self.upper[j]);
        self.upper[j] = (known + reach).clamp(self.lower[j], self.upper[j]);
    }
}

/// Half the sum of squares over the unit cube of the free variables other than offsets and places of sensors, which a
/// descent finds.
struct Cube<'a> {
    problem: &'a FitProblem<'a>,
    /// All variables, at their start.
    still: Vec<f64>,
    free: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    evaluations: AtomicUsize,
}

impl<'a> Cube<'a> {
    fn new(problem: &'a FitProblem) -> Self {
        let (lower, upper) = problem.bounds();
        let sensors = |r: usize| problem.runs[r].sensors.len();
        let offsets: Vec<usize> =
            (0..problem.runs.len()).flat_map(|r| (0..sensors(r)).map(move |s| problem.offset_variable(r, s))).collect();
        let descended = |j: &usize| offsets.contains(j) || problem.place_variables().contains(j);
        let free: Vec<usize> = (0..lower.len()).filter(|j| lower[*j] < upper[*j] && !descended(j)).collect();
        let window = SearchBox::of(problem);
        let (lower, upper) = (window.lower, window.upper);
        Cube { problem, still: problem.start(), free, lower, upper, evaluations: AtomicUsize::new(0) }
    }

    /// All variables at a point of the cube, with offsets at their start.
    fn variables(&self, point: &[f64]) -> Vec<f64> {
        let mut x = self.still.clone();
        for (&j, share) in self.free.iter().zip(point) {
            x[j] = self.lower[j] + share.clamp(0.0, 1.0) * (self.upper[j] - self.lower[j]);
        }
        x
    }

    fn start(&self) -> Vec<f64> {
        let share = |j: usize| (self.still[j] - self.lower[j]) / (self.upper[j] - self.lower[j]);
        self.free.iter().map(|&j| share(j).clamp(0.0, 1.0)).collect()
    }

    fn cost(&self, point: &[f64]) -> f64 {
        let cost = self.with_offsets(&self.variables(point)).map_or(IMPOSSIBLE_COST, |(_, cost)| cost);
        if cost.is_finite() { cost } else { IMPOSSIBLE_COST }
    }

    /// Variables with the best offsets for all else, and half the sum of squares.
    fn with_offsets(&self, x: &[f64]) -> Result<(Vec<f64>, f64), ModelError> {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let residuals = self.problem.residuals(x)?;
        let mut cost = 0.5 * residuals.iter().map(|r| r * r).sum::<f64>();
        let mut x = x.to_vec();
        for (r, run) in self.problem.runs.iter().enumerate() {
            for (s, sensor) in run.sensors.iter().enumerate() {
                let j = self.problem.offset_variable(r, s);
                let (rows, one) = (&residuals[self.problem.rows.rows(r, s)], self.problem.rows.unit_offset(r, s));
                let (known, sd) = (self.problem.prior_residual(j, x[j]), self.problem.known(j).map(|(_, sd)| sd));
                // A change d of the offset lowers each sample's residual by d over the noise, and raises its prior's by
                // d over sd.
                let slope = known.unwrap_or(0.0) / sd.unwrap_or(1.0)
                    - rows.iter().zip(&one).map(|(r, one)| r * one).sum::<f64>() / sensor.noise_m;
                let curvature = one.iter().map(|one| one * one).sum::<f64>() / sensor.noise_m.powi(2)
                    + sd.map_or(0.0, |sd| sd.powi(-2));
                let d = (x[j] - slope / curvature).clamp(self.lower[j], self.upper[j]) - x[j];
                if d.is_finite() {
                    x[j] += d;
                    cost += d * slope + 0.5 * d * d * curvature;
                }
            }
        }
        Ok((x, cost))
    }
}

/// The best fit of a model that a global search finds on the coarse grid, from nothing but the bounds.
pub(crate) fn global_search(ctx: &Calibrator, model: &Model) -> Result<Estimate, ModelError> {
    let problem = FitProblem::new(model, ctx.runs, ctx.window(COARSE_REACHES, f64::INFINITY));
    let cube = Cube::new(&problem);
    let n = problem.samples().max(1) as f64;
    let budget = (ctx.options.budget / ctx.runs.len().max(1)).max(1);
    let on_generation = |spent: usize, cost: f64| {
        (ctx.progress)(&Progress::fitting(
            format!("{spent} of {budget} trials"),
            problem.window().reaches,
            spent,
            (2.0 * cost / n).sqrt(),
        ));
    };
    let cost = |point: &[f64]| cube.cost(point);
    let minimise = match ctx.options.method {
        Method::MicroGa => micro_ga::minimise,
        _ => evolution::minimise,
    };
    let point = match cube.free.is_empty() {
        true => Vec::new(),
        false => minimise(&cost, &cube.start(), budget, ctx.options.seed, &on_generation).0,
    };
    let (x, cost) = cube.with_offsets(&cube.variables(&point))?;
    ctx.count(cube.evaluations.load(Ordering::Relaxed));
    Ok(Estimate { cost, ..Estimate::unseen(problem.values(&x)) })
}
