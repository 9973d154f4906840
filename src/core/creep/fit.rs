//! Kelvin-Voigt elements from creep tests: their number, their noise, their intervals, and the band of the curve.

use crate::creep::ladder::{Ladder, Step};
use crate::creep::outcome::{CreepFit, Noise, TestFit, Tried};
use crate::creep::problem::Shifted;
use crate::creep::remarks::remark;
use crate::creep::shift::{ShiftFactor, laws};
use crate::creep::spectrum::{Samples, spectrum};
use crate::creep::thresholds::{BARE_MENTION, LEAST_NOISE, LEAST_VARIANCE, MAX_ELEMENTS};
use crate::creep::{Creep, CreepError, CreepTest};
use crate::fit::numeric::quantiles::student_95;

/// Fits tests of one material together: one temperature, or times shifted to the `reference_degc` (the first test's
/// where it is none). Evidence chooses the number of elements where `elements` is none: the smallest over which the
/// best has no more than a bare mention.
///
/// # Errors
/// A reference that was not tested; more parameters than samples.
pub fn fit(tests: &[CreepTest], reference_degc: Option<f64>, elements: Option<usize>) -> Result<CreepFit, CreepError> {
    let reference_degc = reference_degc.or(tests.first().and_then(|t| t.temperature_degc));
    let others = other_temperatures(tests, reference_degc)?;
    let shift_of = |t: &CreepTest| others.iter().position(|o| Some(*o) == t.temperature_degc);
    let samples: usize = tests.iter().map(|t| t.time_s.len()).sum();
    let parameters = |n: usize| 1 + 2 * n + others.len();
    let room = (0..=MAX_ELEMENTS).rev().find(|&n| 2 * parameters(n) <= samples).unwrap_or(0);
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
    let chosen = elements.or_else(|| steps.iter().position(|s| s.bic <= best_bic + BARE_MENTION)).unwrap_or(0);
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

/// A fit with its errors, which take the residuals' spread and autocorrelation into account; other fields stay empty.
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
    let reading_noise = ladder.reading_noise(step);
    let inflation = reading_noise.inflation();
    let covariance = reading_noise.covariance(&columns, at_bound, &ladder.records(), LEAST_VARIANCE);
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

/// Gives each test its noise, from the residuals of a spectrum of retardation times at its temperature: constant or
/// proportional to the reading, whichever is likelier for all tests.
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
        // A J0 of 0 would make the first reading's share infinite.
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
