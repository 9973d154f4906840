//! Global searches over the whole box of the variables, on the coarse grid: what descent from a few starts is to be measured against.
//!
//! Offsets of sensors enter the heads linearly, so their best values for all else are known and cost no simulation (variable projection, Golub
//! & Pereyra 1973, SIAM J. Numer. Anal. 10, 413): the search has so many dimensions less.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::fit::numeric::least_squares::Problem;
use crate::fit::numeric::{evolution, micro_ga};
use crate::fit::problem::fit_problem::Calibration;
use crate::fit::problem::method::Method;
use crate::fit::search::calibrate::Progress;
use crate::fit::search::coarse_fit::{FIRST_REACHES, Fitter, State};
use crate::fit::search::stepwise::Groups;
use crate::model::{Model, ModelError};

/// Standard deviations from what is known beforehand that a search goes, where a parameter's bounds are wider.
const KNOWN_WITHIN: f64 = 4.0;
/// Retardation times that a surge can show, in periods, and the least compliance, as a share of the largest that its bounds allow.
const SEEN_TIMES: (f64, f64) = (0.01, 10.0);
const SEEN_COMPLIANCE: f64 = 1e-3;
/// How far it goes at the least from a measured velocity, of the velocity, and from the seen start of the closure, of the period.
const LEAST_SHARE: f64 = 0.05;
/// What cannot be simulated costs more than anything that can.
const IMPOSSIBLE: f64 = 1e300;

/// The box that a search goes over: a parameter's bounds, and no further than what is known beforehand allows.
struct Window {
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Window {
    fn of(problem: &Calibration) -> Self {
        let (lower, upper) = problem.bounds();
        let mut window = Window { lower: lower.to_vec(), upper: upper.to_vec() };
        let model = problem.model;
        let start = problem.start();
        for j in 0..start.len() {
            if let Some((mean, sd)) = problem.known(j) {
                window.narrow(j, mean, KNOWN_WITHIN * sd);
            }
        }
        let period_s = model.period_s(&problem.values(&start)[..model.shared.len()]);
        for (r, run) in problem.runs.iter().enumerate() {
            let [velocity, head, .., closure] = problem.run_variables(r);
            let (velocity_m_s, relative_sd) = run.start.velocity_m_s;
            window.narrow(velocity, velocity_m_s.ln(), (KNOWN_WITHIN * relative_sd).max(LEAST_SHARE));
            if run.start.valve_head_m.1.is_none() {
                let offset_sd_m = run.sensors.iter().map(|s| s.offset_sd_m).fold(0.0, f64::max);
                window.narrow(head, run.start.valve_head_m.0, KNOWN_WITHIN * offset_sd_m);
            }
            let (start_s, sd) = run.start.closure_s;
            window.narrow(closure, start_s, (KNOWN_WITHIN * sd).max(LEAST_SHARE * period_s));
        }
        keep_seen(&mut window.lower, &mut window.upper, &Groups::of(problem), period_s);
        window
    }

    /// Keeps a variable within `reach` of what it is known to be; a start that was asked for elsewhere lies on the window's edge.
    fn narrow(&mut self, j: usize, known: f64, reach: f64) {
        self.lower[j] = (known - reach).clamp(self.lower[j], self.upper[j]);
        self.upper[j] = (known + reach).clamp(self.lower[j], self.upper[j]);
    }
}

/// Keeps elements of creep where a surge of that period can show them.
pub(crate) fn keep_seen(lower: &mut [f64], upper: &mut [f64], groups: &Groups, period_s: f64) {
    for &j in &groups.times {
        let (quickest, slowest) = SEEN_TIMES;
        lower[j] = (quickest * period_s).ln().clamp(lower[j], upper[j]);
        upper[j] = (slowest * period_s).ln().clamp(lower[j], upper[j]);
    }
    for &j in &groups.compliances {
        lower[j] = (upper[j] + SEEN_COMPLIANCE.ln()).clamp(lower[j], upper[j]);
    }
}

/// Half the sum of squares over the unit cube of those variables that have any choice and are no offsets.
struct Cube<'a> {
    problem: &'a Calibration<'a>,
    /// All variables, to put the free ones among.
    still: Vec<f64>,
    free: Vec<usize>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    evaluations: AtomicUsize,
}

impl<'a> Cube<'a> {
    fn new(problem: &'a Calibration) -> Self {
        let (lower, upper) = problem.bounds();
        let sensors = |r: usize| problem.runs[r].sensors.len();
        let offsets: Vec<usize> =
            (0..problem.runs.len()).flat_map(|r| (0..sensors(r)).map(move |s| problem.offset_variable(r, s))).collect();
        let free: Vec<usize> = (0..lower.len()).filter(|j| lower[*j] < upper[*j] && !offsets.contains(j)).collect();
        let window = Window::of(problem);
        let (lower, upper) = (window.lower, window.upper);
        Cube { problem, still: problem.start(), free, lower, upper, evaluations: AtomicUsize::new(0) }
    }

    /// All variables of a point in the cube, the offsets at their start.
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
        let cost = self.with_offsets(&self.variables(point)).map_or(IMPOSSIBLE, |(_, cost)| cost);
        if cost.is_finite() { cost } else { IMPOSSIBLE }
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
                let (rows, one) = (&residuals[self.problem.rows(r, s)], self.problem.unit_offset(r, s));
                let (known, sd) = (self.problem.prior_residual(j, x[j]), self.problem.known(j).map(|(_, sd)| sd));
                // d: by how much it moves; each sample's residual falls by d over the noise, its prior's grows by d over sd.
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

impl Fitter<'_> {
    /// The best that a global search finds of a model, on the coarse grid, from nothing but the bounds.
    pub(crate) fn searched(&self, model: &Model) -> Result<State, ModelError> {
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
        let cost = |point: &[f64]| cube.cost(point);
        let minimise = match self.options.method {
            Method::MicroGa => micro_ga::minimise,
            _ => evolution::minimise,
        };
        let point = match cube.free.is_empty() {
            true => Vec::new(),
            false => minimise(&cost, &cube.start(), budget, self.options.seed, &heard).0,
        };
        let (x, cost) = cube.with_offsets(&cube.variables(&point))?;
        self.count(cube.evaluations.load(Ordering::Relaxed));
        Ok(State { values: problem.values(&x), cost })
    }
}
