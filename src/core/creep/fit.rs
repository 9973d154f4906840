//! Kelvin-Voigt elements from creep tests: their number, their noise, their intervals, and the band of the curve.

use nalgebra::DMatrix;

use crate::creep::ladder::{Ladder, Step};
use crate::creep::problem::{Shifted, gradient};
use crate::creep::remarks::remark;
use crate::creep::shift::{Arrhenius, ShiftFactor, Wlf, laws};
use crate::creep::spectrum::{Samples, spectrum};
use crate::creep::{Creep, CreepError, CreepTest};
use crate::fit::numeric::uncertainty::student_95;

/// Most elements that are tried where their number is left open.
pub(crate) const MOST: usize = 6;
/// Noise below which no strain is measured, relative.
const LEAST_NOISE: f64 = 1e-6;
/// Least variance of the residuals, in units of the noise's: readings without noise are still read to so many digits.
const LEAST_VARIANCE: f64 = 0.25;
/// Fall of the Bayesian information criterion that is not worth more than a bare mention (Kass & Raftery 1995).
const BARE: f64 = 2.0;
/// Relative standard error from which a value is open.
pub const OPEN: f64 = 2.0;

/// How the noise of a test goes with its reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// The same at all times.
    Constant,
    /// A share of the reading.
    Proportional,
}

impl Noise {
    /// In one word.
    pub fn name(self) -> &'static str {
        match self {
            Noise::Constant => "constant",
            Noise::Proportional => "proportional",
        }
    }
}

/// A number of elements that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tried {
    /// Elements.
    pub elements: usize,
    /// Root mean square of what they leave, in units of the noise that a spectrum of retardation times leaves.
    pub rms_over_noise: f64,
    /// Bayesian information criterion above that of the best.
    pub bic_above_best: f64,
}

/// One test under the fit; vectors of one length.
#[derive(Debug, Clone, PartialEq)]
pub struct TestFit {
    /// The test.
    pub test: CreepTest,
    /// J of the fit at the test's temperature, 1/Pa.
    pub fitted_per_pa: Vec<f64>,
    /// Root mean square of measured - fitted, 1/Pa.
    pub rms_per_pa: f64,
    /// What the measurement jumps from sample to sample, whatever the model, 1/Pa.
    pub noise_per_pa: f64,
    /// Its shift factor: 1 at the reference.
    pub factor: f64,
}

/// The result.
#[derive(Debug, Clone, PartialEq)]
pub struct CreepFit {
    /// At the reference temperature.
    pub creep: Creep,
    /// Standard errors of `ln J0, ln J_1, ln τ_1, …`: relative ones of the values; NaN at a bound.
    pub relative_errors: Vec<f64>,
    /// Which of these ended at a bound.
    pub at_bound: Vec<bool>,
    /// Covariance of the same, and of the logarithms of the shift factors after them.
    covariance: DMatrix<f64>,
    /// How many standard errors make half a 95% interval.
    pub half_width: f64,
    /// By how much the residuals' colour has widened variances.
    pub inflation: f64,
    /// How noise goes with the reading.
    pub noise: Noise,
    /// Numbers of elements tried.
    pub tried: Vec<Tried>,
    /// Each test.
    pub tests: Vec<TestFit>,
    /// Temperature of the elements, °C, where temperatures are known.
    pub reference_degc: Option<f64>,
    /// The shift factor of each other temperature.
    pub shifts: Vec<ShiftFactor>,
    /// Arrhenius' law of them.
    pub arrhenius: Option<Arrhenius>,
    /// Williams, Landel and Ferry's, from three temperatures on.
    pub wlf: Option<Wlf>,
    /// What a reader has to know, in sentences.
    pub remarks: Vec<String>,
}

impl CreepFit {
    /// J(t) at the reference and the bounds of its 95% interval, 1/Pa.
    pub fn band_per_pa(&self, time_s: f64) -> (f64, f64, f64) {
        let slope = gradient(&self.creep, time_s);
        let cell = |i: usize, j: usize| slope[i] * self.covariance[(i, j)] * slope[j];
        let variance: f64 =
            (0..slope.len()).flat_map(|i| (0..slope.len()).map(move |j| (i, j))).map(|(i, j)| cell(i, j)).sum();
        let (mid, half) = (self.creep.compliance_per_pa(time_s), self.half_width * variance.max(0.0).sqrt());
        (mid, mid - half, mid + half)
    }

    /// The 95% interval of a value by the standard error of its logarithm.
    pub fn interval(&self, value: f64, relative_error: f64) -> (f64, f64) {
        let by = (self.half_width * relative_error).exp();
        (value / by, value * by)
    }

    /// Root mean square of what the fit leaves, over all tests, 1/Pa.
    pub fn rms_per_pa(&self) -> f64 {
        self.pooled(|t| t.rms_per_pa)
    }

    /// The tests' noise, each weighed by its samples, 1/Pa.
    pub fn noise_per_pa(&self) -> f64 {
        self.pooled(|t| t.noise_per_pa)
    }

    /// Covariance of the logarithms of the shift factors.
    fn shift_covariance(&self) -> DMatrix<f64> {
        let (first, n) = (self.relative_errors.len(), self.shifts.len());
        self.covariance.view((first, first), (n, n)).clone_owned()
    }

    fn pooled(&self, of: impl Fn(&TestFit) -> f64) -> f64 {
        let samples = |t: &TestFit| t.test.time_s.len() as f64;
        let total: f64 = self.tests.iter().map(samples).sum();
        (self.tests.iter().map(|t| samples(t) * of(t).powi(2)).sum::<f64>() / total).sqrt()
    }

    /// Time of the first reading, reduced to the reference, s: J0 holds all that the wall does within it. 0 where one was taken at once.
    pub fn first_reading_s(&self) -> f64 {
        self.tests.iter().filter_map(|t| t.test.time_s.first().map(|s| s / t.factor)).fold(f64::INFINITY, f64::min)
    }

    /// Shortest time after 0 and longest, reduced to the reference, s.
    pub fn span_s(&self) -> (f64, f64) {
        let reduced = self.tests.iter().flat_map(|t| t.test.time_s.iter().map(|s| s / t.factor));
        reduced.filter(|t| *t > 0.0).fold((f64::INFINITY, 0.0), |(a, b), t| (t.min(a), t.max(b)))
    }
}

/// Fits tests of one material together: one temperature, or times shifted to the `reference_degc` (the first test's where it is none).
/// The number of elements is chosen by evidence where `elements` is none: the smallest that the best has no more than a bare mention over.
///
/// # Errors
/// A reference that was not tested; more parameters than samples.
pub fn fit(tests: &[CreepTest], reference_degc: Option<f64>, elements: Option<usize>) -> Result<CreepFit, CreepError> {
    let reference_degc = reference_degc.or(tests.first().and_then(|t| t.temperature_degc));
    let others = other_temperatures(tests, reference_degc)?;
    let shift_of = |t: &CreepTest| others.iter().position(|o| Some(*o) == t.temperature_degc);
    let samples: usize = tests.iter().map(|t| t.time_s.len()).sum();
    let parameters = |n: usize| 1 + 2 * n + others.len();
    let room = (0..=MOST).rev().find(|&n| 2 * parameters(n) <= samples).unwrap_or(0);
    let most = elements.unwrap_or(room);
    if parameters(most) >= samples {
        return Err(CreepError::TooManyElements { elements: most, parameters: parameters(most), samples });
    }
    let mut order: Vec<usize> = (0..others.len()).collect();
    let away = |m: &usize| (others[*m] - reference_degc.unwrap_or(others[*m])).abs();
    order.sort_by(|a, b| away(a).total_cmp(&away(b)));
    let (weighted, noise) = weighted(tests, &shift_of);
    let ladder = Ladder::new(weighted, &order);
    let steps = ladder.climb(elements.unwrap_or(0), most);
    let best_bic = steps.iter().map(|s| s.bic).fold(f64::INFINITY, f64::min);
    let rms = |s: &Step| (2.0 * s.solution.cost / samples as f64).sqrt();
    let tried: Vec<Tried> = steps
        .iter()
        .enumerate()
        .map(|(n, s)| Tried { elements: n, rms_over_noise: rms(s), bic_above_best: s.bic - best_bic })
        .collect();
    let chosen = elements.or_else(|| steps.iter().position(|s| s.bic <= best_bic + BARE)).unwrap_or(0);
    let Some(step) = steps.get(chosen) else {
        return Err(CreepError::TooManyElements { elements: chosen, parameters: parameters(chosen), samples });
    };
    let mut fit = CreepFit { noise, tried, reference_degc, ..judged(&ladder, step, tests, &others, &shift_of) };
    if let Some(at) = reference_degc {
        let covariance = fit.shift_covariance();
        (fit.arrhenius, fit.wlf) = laws(at, &fit.shifts, &covariance, &mut fit.remarks);
    }
    let most_taken = elements.is_none() && chosen == most;
    remark(&mut fit, &ladder, step, (room, most_taken), elements.is_some());
    Ok(fit)
}

/// A fit with its errors, which respect the residuals' spread and colour; what is not known from it is left at nothing.
fn judged(
    ladder: &Ladder,
    step: &Step,
    tests: &[CreepTest],
    others: &[f64],
    shift_of: &dyn Fn(&CreepTest) -> Option<usize>,
) -> CreepFit {
    let elements = step.creep.elements.len();
    let first_shift = 1 + 2 * elements;
    let problem = ladder.problem(elements);
    let columns = ladder.columns(step);
    let freedom = (ladder.samples() - ladder.variables(elements)) as f64;
    let at_bound = &step.solution.at_bound;
    let alike = ladder.alike(step);
    let inflation = alike.inflation();
    let covariance = alike.covariance(&columns, at_bound, &ladder.records(), LEAST_VARIANCE);
    let error = |j: usize| if at_bound[j] { f64::NAN } else { covariance[(j, j)].max(0.0).sqrt() };
    let log_shifts = problem.log_shifts(&step.solution.x);
    let shifts = others.iter().zip(log_shifts).enumerate().map(|(m, (&temperature_degc, log))| ShiftFactor {
        temperature_degc,
        factor: log.exp(),
        relative_error: error(first_shift + m),
    });
    let factor = |t: &CreepTest| shift_of(t).map_or(1.0, |m| log_shifts[m].exp());
    CreepFit {
        creep: step.creep.clone(),
        relative_errors: (0..first_shift).map(error).collect(),
        at_bound: step.solution.at_bound[..first_shift].to_vec(),
        half_width: student_95(freedom / inflation),
        inflation,
        tests: tests.iter().map(|t| test_fit(t, &step.creep, factor(t))).collect(),
        shifts: shifts.collect(),
        covariance,
        noise: Noise::Constant,
        tried: Vec::new(),
        reference_degc: None,
        arrhenius: None,
        wlf: None,
        remarks: Vec::new(),
    }
}

/// The temperatures beside the reference, in the order of the tests.
fn other_temperatures(tests: &[CreepTest], reference: Option<f64>) -> Result<Vec<f64>, CreepError> {
    let mut all: Vec<f64> = Vec::new();
    for degc in tests.iter().filter_map(|t| t.temperature_degc) {
        if !all.contains(&degc) {
            all.push(degc);
        }
    }
    if let Some(reference) = reference.filter(|r| !all.contains(r)) {
        let tested = if all.is_empty() { "which are not given".to_owned() } else { list(&all) };
        return Err(CreepError::Reference { reference, tested });
    }
    all.retain(|degc| Some(*degc) != reference);
    Ok(all)
}

fn list(degc: &[f64]) -> String {
    degc.iter().map(|t| format!("{t}")).collect::<Vec<_>>().join(", ")
}

/// Gives each test its noise, by what a spectrum of retardation times of its own temperature leaves of it: constant or proportional to the
/// reading, whichever makes all tests likelier.
fn weighted(tests: &[CreepTest], shift_of: &dyn Fn(&CreepTest) -> Option<usize>) -> (Vec<Shifted>, Noise) {
    let unweighted = |t: &CreepTest| Samples {
        time_s: t.time_s.clone(),
        compliance_per_pa: t.compliance_per_pa.clone(),
        sd_per_pa: vec![t.compliance_per_pa.iter().sum::<f64>() / t.time_s.len() as f64; t.time_s.len()],
    };
    // Twice the logarithm of the likelihood, constants left out, and for each test its two scales.
    let (mut constant, mut proportional, mut scales) = (0.0, 0.0, Vec::new());
    for test in tests {
        let alike = tests.iter().filter(|t| shift_of(t) == shift_of(test));
        let all = alike.fold(Samples::default(), |all, t| all.with(&unweighted(t).thinned(), 1.0));
        let rich = spectrum(&all).0;
        // A J0 of nothing would make the first reading's share infinite.
        let fitted = test.time_s.iter().zip(&test.compliance_per_pa);
        let fitted: Vec<f64> = fitted.map(|(t, j)| rich.compliance_per_pa(*t).max(0.01 * j)).collect();
        let count = fitted.len() as f64;
        let lost = count / (count - 1.0 - rich.elements.len() as f64).max(1.0);
        let mean = fitted.iter().sum::<f64>() / count;
        let square = |reading: &dyn Fn(f64) -> f64| {
            let left = test.compliance_per_pa.iter().zip(&fitted).map(|(j, f)| ((j - f) / reading(*f)).powi(2));
            (left.sum::<f64>() / count * lost).max(LEAST_NOISE.powi(2))
        };
        let (a, b) = (square(&|_| mean), square(&|f| f));
        constant -= count * a.ln();
        proportional -= count * b.ln() + 2.0 * fitted.iter().map(|f| (f / mean).ln()).sum::<f64>();
        scales.push((a.sqrt() * mean, b.sqrt(), fitted));
    }
    let noise = if proportional > constant { Noise::Proportional } else { Noise::Constant };
    let shifted = tests.iter().zip(scales).map(|(test, (constant, proportional, fitted))| {
        let sd_per_pa = match noise {
            Noise::Constant => vec![constant; fitted.len()],
            Noise::Proportional => fitted.iter().map(|f| proportional * f).collect(),
        };
        Shifted { samples: Samples { sd_per_pa, ..unweighted(test) }, shift: shift_of(test) }
    });
    (shifted.collect(), noise)
}

fn test_fit(test: &CreepTest, creep: &Creep, factor: f64) -> TestFit {
    let fitted_per_pa: Vec<f64> = test.time_s.iter().map(|t| creep.compliance_per_pa(t / factor)).collect();
    let left: Vec<f64> = test.compliance_per_pa.iter().zip(&fitted_per_pa).map(|(j, f)| j - f).collect();
    let n = left.len().max(2) as f64;
    let rms_per_pa = (left.iter().map(|r| r * r).sum::<f64>() / n).sqrt();
    let jumps: f64 = left.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    let noise_per_pa = (0.5 * jumps / (n - 1.0)).sqrt();
    TestFit { test: test.clone(), fitted_per_pa, rms_per_pa, noise_per_pa, factor }
}
