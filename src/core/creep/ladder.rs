//! Fits with one element more after the other, and the evidence for each.

use std::ops::Range;

use crate::creep::problem::{CreepProblem, Shifted};
use crate::creep::reading_noise::ReadingNoise;
use crate::creep::spectrum::{Samples, merged, spectrum, with_times};
use crate::creep::thresholds::{
    FIT_LIMITS, LEAST_MEAN_SQUARE, MAX_VAIN_ELEMENTS, SCAN_DECADES, SCAN_STEP, START_LIMITS,
};
use crate::creep::{Creep, Element};
use crate::fit::numeric::least_squares::{Limits, Solution, jacobian, minimise};

/// Tests that are fitted together.
pub(crate) struct Ladder {
    pub(crate) tests: Vec<Shifted>,
    /// The same with fewer samples that show nearly as much.
    thin: Vec<Shifted>,
    /// How many shift factors there are.
    pub(crate) shifts: usize,
    /// First guess of their logarithms.
    pub(crate) log_shifts: Vec<f64>,
}

/// One step: a fit.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(crate) creep: Creep,
    pub(crate) solution: Solution,
    /// Bayesian information criterion, of which differences count.
    pub(crate) bic: f64,
}

impl Ladder {
    /// Of some tests; `order` lists the shifts from the one nearest to the reference on, as they are found.
    pub(crate) fn new(tests: Vec<Shifted>, order: &[usize]) -> Self {
        let shifts = order.len();
        let thin = tests.iter().map(|t| Shifted { samples: t.samples.thinned(), shift: t.shift }).collect();
        let mut ladder = Ladder { tests, thin, shifts, log_shifts: vec![0.0; shifts] };
        ladder.scan(order);
        ladder
    }

    /// Thinned samples of the reference, or of one shift.
    fn of(&self, shift: Option<usize>) -> Samples {
        let own = self.thin.iter().filter(|t| t.shift == shift);
        own.fold(Samples::default(), |all, t| all.with(&t.samples, 1.0))
    }

    /// Finds each shift: the one under which one spectrum describes this test and the previous ones best.
    fn scan(&mut self, order: &[usize]) {
        let mut pooled = self.of(None);
        for &m in order {
            let own = self.of(Some(m));
            let steps = (SCAN_DECADES / SCAN_STEP).round() as i32;
            let trials = (-steps..=steps).map(|i| f64::from(i) * SCAN_STEP * 10f64.ln());
            let squared = trials.map(|log| {
                let square = spectrum(&pooled.with(&own, log.exp())).1;
                // Among equally good shifts the smallest: tests that do not overlap allow many.
                (log, square * (1.0 + 1e-3 * log.abs()))
            });
            let best = squared.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |b| b.0);
            self.log_shifts[m] = best;
            pooled = pooled.with(&own, best.exp());
        }
    }

    /// All samples at the reference by some shifts.
    fn reduced(&self, log_shifts: &[f64]) -> Samples {
        let shifted = (0..self.shifts).map(Some);
        shifted.fold(self.of(None), |all, m| all.with(&self.of(m), m.map_or(1.0, |m| log_shifts[m].exp())))
    }

    pub(crate) fn samples(&self) -> usize {
        self.tests.iter().map(|t| t.samples.time_s.len()).sum()
    }

    /// Each test's readings among the residuals.
    pub(crate) fn records(&self) -> Vec<Range<usize>> {
        let mut end = 0;
        let next = |test: &Shifted| {
            let start = end;
            end += test.samples.time_s.len();
            start..end
        };
        self.tests.iter().map(next).collect()
    }

    /// Variables of a fit with `elements` elements.
    pub(crate) fn variables(&self, elements: usize) -> usize {
        1 + 2 * elements + self.shifts
    }

    /// The problem of fitting `elements` elements to all samples.
    pub(crate) fn problem(&self, elements: usize) -> CreepProblem<'_> {
        self.problem_of(&self.tests, elements)
    }

    fn problem_of<'s>(&self, tests: &'s [Shifted], elements: usize) -> CreepProblem<'s> {
        CreepProblem::new(tests, elements, self.shifts, self.reduced(&self.log_shifts).span_s())
    }

    /// Fits with 0, 1, … elements: to `least`, and on to `most` unless evidence falls.
    pub(crate) fn climb(&self, least: usize, most: usize) -> Vec<Step> {
        let mut log_shifts = self.log_shifts.clone();
        let mut steps: Vec<Step> = Vec::new();
        for n in 0..=most {
            let reduced = self.reduced(&log_shifts);
            let mut starts = vec![evenly(reduced.span_s(), n)];
            let few: Vec<f64> = merged(spectrum(&reduced).0.elements, n.max(1)).iter().map(|e| e.tau_s).collect();
            if few.len() == n {
                starts.push(few);
            }
            if let Some(before) = steps.last() {
                starts.extend(with_one_more(&before.creep.elements, reduced.span_s()));
            }
            let best = starts
                .iter()
                .map(|tau_s| with_times(&reduced, tau_s))
                .map(|(creep, _)| self.fitted(&self.thin, &creep, &log_shifts, START_LIMITS))
                .min_by(|a, b| a.solution.cost.total_cmp(&b.solution.cost));
            let Some(best) = best else { break };
            let step = self.fitted(&self.tests, &best.creep, &best.solution.x[1 + 2 * n..], FIT_LIMITS);
            log_shifts = step.solution.x[1 + 2 * n..].to_vec();
            steps.push(step);
            self.weigh(&mut steps);
            let best = steps.iter().enumerate().min_by(|a, b| a.1.bic.total_cmp(&b.1.bic)).map_or(0, |b| b.0);
            if n >= least && n >= best + MAX_VAIN_ELEMENTS {
                break;
            }
        }
        steps
    }

    /// A fit from a start, its elements in order.
    fn fitted(&self, tests: &[Shifted], start: &Creep, log_shifts: &[f64], limits: Limits) -> Step {
        let problem = self.problem_of(tests, start.elements.len());
        let Ok(mut solution) = minimise(&problem, &problem.variables(start, log_shifts), limits, |_, _| {});
        let mut creep = problem.creep(&solution.x);
        let mut order: Vec<usize> = (0..creep.elements.len()).collect();
        order.sort_by(|&a, &b| creep.elements[a].tau_s.total_cmp(&creep.elements[b].tau_s));
        creep.elements = order.iter().map(|&k| creep.elements[k]).collect();
        let (x, at_bound) = (solution.x.clone(), solution.at_bound.clone());
        for (place, &k) in order.iter().enumerate() {
            for i in 1..=2 {
                solution.x[2 * place + i] = x[2 * k + i];
                solution.at_bound[2 * place + i] = at_bound[2 * k + i];
            }
        }
        Step { creep, solution, bic: f64::NAN }
    }

    /// `n ln χ² + k ln n`, `χ²` that of generalised least squares with the noise as the richest model has it.
    fn weigh(&self, steps: &mut [Step]) {
        let Some(richest) = steps.last() else { return };
        let (n, records) = (self.samples() as f64, self.records());
        let reading_noise = self.reading_noise(richest);
        for step in steps {
            let columns = self.columns(step);
            let square = reading_noise.square(&free(&columns, step), &step.solution.residuals, &records);
            let mean_square = (square / n).max(LEAST_MEAN_SQUARE);
            let variables = self.variables(step.creep.elements.len()) as f64;
            step.bic = n * mean_square.ln() + variables * n.ln();
        }
    }

    /// Slopes of the residuals of a step.
    pub(crate) fn columns(&self, step: &Step) -> Vec<Vec<f64>> {
        let Ok(columns) =
            jacobian(&self.problem(step.creep.elements.len()), &step.solution.x, &step.solution.residuals);
        columns
    }

    /// The noise as a step leaves it.
    pub(crate) fn reading_noise(&self, step: &Step) -> ReadingNoise {
        ReadingNoise::of(&free(&self.columns(step), step), &step.solution.residuals, &self.records())
    }
}

/// Columns of the variables that are not at a bound.
fn free<'c>(columns: &'c [Vec<f64>], step: &Step) -> Vec<&'c [f64]> {
    columns.iter().zip(&step.solution.at_bound).filter(|(_, held)| !**held).map(|(c, _)| &c[..]).collect()
}

/// Retardation times in equal ratios within a span.
fn evenly((shortest_s, longest_s): (f64, f64), n: usize) -> Vec<f64> {
    let part = |k: usize| (k as f64 + 0.5) / n as f64;
    (0..n).map(|k| shortest_s * (longest_s / shortest_s).powf(part(k))).collect()
}

/// Retardation times with one more: in the middle of each gap, or at an end.
fn with_one_more(elements: &[Element], (shortest_s, longest_s): (f64, f64)) -> Vec<Vec<f64>> {
    let own: Vec<f64> = elements.iter().map(|e| e.tau_s).collect();
    let ends: Vec<f64> = std::iter::once(shortest_s).chain(own.iter().copied()).chain([longest_s]).collect();
    let middles = ends.windows(2).map(|w| (w[0] * w[1]).sqrt());
    let grown = |tau: f64| own.iter().copied().chain([tau]).collect();
    middles.map(grown).collect()
}
