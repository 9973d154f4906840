//! The results of the joint fit: for each parameter, run and quantity.

use crate::fit::numeric::least_squares::Solution;
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::parameter::Parameter;
use crate::temperature::apart::{Banded, Quantity};
use crate::temperature::joint::problem::JointProblem;
use crate::temperature::law::is_log;
use crate::temperature::start::{step_of, to_value};
use crate::temperature::thresholds::LINE_POINTS;

/// A fitted parameter of the laws.
#[derive(Debug, Clone, PartialEq)]
pub struct LawParameter {
    /// Name with its unit.
    pub name: String,
    /// Unit as displayed.
    pub unit: &'static str,
    /// What it is, in plain words.
    pub about: &'static str,
    /// Value, at the reference temperature where it depends on it.
    pub value: f64,
    /// Standard error; widened by what the laws leave where they do not describe the runs.
    pub standard_error: f64,
    /// 95% interval; of the logarithm for what is moved as one.
    pub interval: (f64, f64),
    /// It ended at one of its bounds.
    pub at_bound: bool,
}

/// Error of one run, over the samples of all its pressure sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct RunError {
    /// File name.
    pub file: String,
    /// Fitted by itself, m.
    pub apart_m: f64,
    /// Under the laws, m.
    pub together_m: f64,
    /// Noise, m.
    pub noise_m: f64,
    /// Temperature that suits the laws best, as far as its standard deviation lets it move, °C.
    pub temperature_degc: f64,
}

pub(crate) fn parameter(p: &Parameter, solution: &Solution, errors: &[f64], j: usize) -> LawParameter {
    let (x, half) = (solution.x[j], Z_95 * errors[j]);
    let value = to_value(p, x);
    LawParameter {
        name: p.name.clone(),
        unit: p.unit,
        about: p.about,
        value,
        standard_error: errors[j] * if is_log(p) { value } else { 1.0 },
        interval: (to_value(p, x - half), to_value(p, x + half)),
        at_bound: solution.at_bound[j],
    }
}

pub(crate) fn run_errors(joint: &JointProblem, apart: &[f64], together: &Solution) -> Vec<RunError> {
    let of = |(r, c): (usize, &FitProblem)| {
        let [place, _] = joint.places(r);
        let noise = c.rows.sample_noise();
        let rms = |of: &dyn Fn(usize) -> f64| {
            let square: f64 = noise.iter().enumerate().map(|(i, n)| (n * of(i)).powi(2)).sum();
            (square / noise.len().max(1) as f64).sqrt()
        };
        RunError {
            file: joint.members[r].data.file.clone(),
            apart_m: rms(&|i| apart[place.start + i]),
            together_m: rms(&|i| together.residuals[place.start + i]),
            temperature_degc: joint.members[r].temperature_degc + together.x[joint.thermometer(r)],
            noise_m: rms(&|_| 1.0),
        }
    };
    joint.problems.iter().enumerate().map(of).collect()
}

/// Adds the laws' values of each quantity, with the intervals from their parameters' errors.
pub(crate) fn lines(
    joint: &JointProblem,
    x: &[f64],
    errors: &[f64],
    correlation: &[Vec<f64>],
    quantities: &mut [Quantity],
) {
    let law = joint.law;
    let count = law.parameters.len();
    let by_law = |x: &[f64], degc: f64, run: Option<usize>| -> Vec<f64> {
        let water = run.map_or_else(
            || joint.problems[0].model.rig.fluid.properties(degc),
            |r| joint.members[r].data.conditions.water,
        );
        let (shared, moduli) = law.shared(&joint.law_values(x), degc, &water, run);
        // Each modulus stands behind its wave speed.
        let pipes = moduli.len();
        shared[..pipes].iter().zip(&moduli).flat_map(|(a, e)| [*a, *e]).chain(shared[pipes..].iter().copied()).collect()
    };
    let degrees: Vec<f64> = joint.members.iter().map(|m| m.temperature_degc).collect();
    let places: Vec<(f64, Option<usize>)> = if law.is_a_law() {
        let low = degrees.iter().copied().fold(f64::INFINITY, f64::min);
        let high = degrees.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (0..LINE_POINTS).map(|i| (low + (high - low) * i as f64 / (LINE_POINTS - 1) as f64, None)).collect()
    } else {
        degrees.iter().enumerate().map(|(r, &t)| (t, Some(r))).collect()
    };
    for (degc, run) in places {
        let mid = by_law(x, degc, run);
        let columns: Vec<Vec<f64>> = (0..count)
            .map(|j| {
                let (mut moved, step) = (x.to_vec(), step_of(&law.parameters[j]));
                moved[j] += step;
                by_law(&moved, degc, run).iter().zip(&mid).map(|(a, b)| (a - b) / step).collect()
            })
            .collect();
        for (q, quantity) in quantities.iter_mut().enumerate() {
            let mut variance = 0.0;
            for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
                let both = columns[i][q] * columns[j][q] * errors[i] * errors[j] * correlation[i][j];
                variance += if both.is_finite() { both } else { 0.0 };
            }
            // A law that does not hold has a line and no band.
            let known = errors[..count].iter().any(|e| e.is_finite());
            let (value, half) = (mid[q], if known { Z_95 * variance.max(0.0).sqrt() } else { f64::NAN });
            let interval = if value > 0.0 {
                (value * (-half / value).exp(), value * (half / value).exp())
            } else {
                (value - half, value + half)
            };
            quantity.law.push(Banded { temperature_degc: degc, value, interval });
        }
    }
}
