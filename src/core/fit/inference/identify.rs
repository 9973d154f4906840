//! Which combinations of parameters the recordings do not determine.
//!
//! The unit of each variable is its uncertainty without the recordings: its prior, its bounds, or a factor of two,
//! whichever is least. Along an eigenvector of the normal matrix in these units whose eigenvalue is below 1, the
//! recordings add less than that (Vajda et al. 1989, Chem. Eng. Sci. 44, 49; Cui et al. 2014, Inverse Problems
//! 30, 114015). Zero errors of sensors take the accuracy that they have and are left out. The space of all such
//! directions counts: variables that share one cannot be told apart.

use nalgebra::DMatrix;

use crate::fit::inference::errors::{Errors, Linearised};
use crate::fit::inference::thresholds::{UNIDENTIFIED_SHARE, UNIT_EXPONENT_WITHIN};
use crate::fit::outcome::unidentifiable::Unidentifiable;
use crate::fit::problem::elements::{Element, vanished};
use crate::fit::problem::fit_problem::FitProblem;
use crate::model::parameter::{Parameter, Scale};
use crate::product::dot;

/// The parameters and combinations of a linearised fit that the recordings do not determine.
pub(crate) fn unidentifiable(
    problem: &FitProblem,
    values: &[f64],
    fit: Linearised,
    errors: &Errors,
) -> Vec<Unidentifiable> {
    let gone = vanished(problem, values);
    let all: Vec<usize> = (0..problem.parameters.len()).filter(|j| !fit.at_bound[*j]).collect();
    let (zeros, rest): (Vec<usize>, Vec<usize>) =
        all.into_iter().partition(|&j| problem.parameters[j].name.starts_with("offset_m["));
    // Autocorrelated noise, or more of it than believed, weakens the data: by the median over the variables.
    let mut inflations: Vec<f64> = rest.iter().map(|&j| errors.inflation(j)).collect();
    inflations.sort_by(f64::total_cmp);
    let worth = 1.0 / inflations.get(inflations.len() / 2).copied().unwrap_or(1.0);
    let priors = problem.prior_rows();
    let cell = |i: usize, j: usize| {
        let (c, d) = (&fit.columns[i], &fit.columns[j]);
        let seen = dot(&c[..priors.start], &d[..priors.start]) + dot(&c[priors.end..], &d[priors.end..]);
        worth * seen * known(&problem.parameters[i]) * known(&problem.parameters[j])
    };
    let matrix = |a: &[usize], b: &[usize]| DMatrix::from_fn(a.len(), b.len(), |i, j| cell(a[i], b[j]));
    let mut seen = matrix(&rest, &rest);
    // In units of itself the prior of a zero error has the weight 1.
    let own = matrix(&zeros, &zeros) + DMatrix::identity(zeros.len(), zeros.len());
    if let Some(inverse) = own.try_inverse() {
        let across = matrix(&rest, &zeros);
        seen -= &across * inverse * across.transpose();
    }
    let groups = groups(&undetermined_space(seen));
    let unsupported =
        (0..problem.model.effects.len()).filter_map(|effect| unsupported_elements(problem, effect, &gone));
    unsupported
        .chain(groups.into_iter().map(|(members, size)| describe(problem, errors, &rest, &members, size)))
        .collect()
}

/// The elements of one effect that the record does not support.
fn unsupported_elements(problem: &FitProblem, effect: usize, gone: &[Element]) -> Option<Unidentifiable> {
    let gone: Vec<&Element> = gone.iter().filter(|e| e.effect == effect).collect();
    let chosen = &problem.model.effects[effect];
    let kept = chosen.elements?.checked_sub(gone.len()).filter(|_| !gone.is_empty())?;
    let name = |j: usize| problem.parameters[j].name.clone();
    let parameters: Vec<String> = gone.iter().flat_map(|e| [name(e.strength), name(e.time)]).collect();
    let so_many = match kept {
        0 => format!("without {}", chosen.effect.name()),
        _ => format!("with {}", chosen.with_elements(kept).label()),
    };
    let in_words = format!(
        "The record does not support {}: {} vanished in the fit, and the fit is as good {so_many}.",
        listed(&parameters),
        if gone.len() == 1 { "the element has" } else { "the elements have" },
    );
    Some(Unidentifiable { parameters, run: None, seen_combination: None, standard_error_percent: None, in_words })
}

/// Standard deviation of a variable without the recordings: at most that of a uniform distribution between its bounds.
fn known(parameter: &Parameter) -> f64 {
    let (width, most) = match parameter.scale {
        Scale::Linear => (parameter.upper - parameter.lower, f64::INFINITY),
        Scale::Log => ((parameter.upper / parameter.lower).ln(), std::f64::consts::LN_2),
    };
    parameter.prior.map_or(f64::INFINITY, |(_, sd)| sd).min(width / 12f64.sqrt()).min(most)
}

/// The projection on the eigenvectors whose eigenvalue is below 1.
fn undetermined_space(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let mut space = DMatrix::zeros(n, n);
    if n == 0 {
        return space;
    }
    let eigen = (0.5 * (&matrix + matrix.transpose())).symmetric_eigen();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value < 1.0 {
            space += vector * vector.transpose();
        }
    }
    space
}

/// Groups of variables that share undetermined directions, and the number of these directions.
fn groups(space: &DMatrix<f64>) -> Vec<(Vec<usize>, usize)> {
    let mut left: Vec<usize> = (0..space.nrows()).filter(|&j| space[(j, j)] > UNIDENTIFIED_SHARE).collect();
    let mut groups = Vec::new();
    while let Some(first) = left.first().copied() {
        let mut members = vec![first];
        left.retain(|j| *j != first);
        let mut at = 0;
        while at < members.len() {
            let i = members[at];
            let (with, without): (Vec<usize>, Vec<usize>) =
                left.iter().partition(|&&j| space[(i, j)].abs() > UNIDENTIFIED_SHARE);
            members.extend(with);
            left = without;
            at += 1;
        }
        members.sort_unstable();
        let trace: f64 = members.iter().map(|&j| space[(j, j)]).sum();
        groups.push((members, (trace.round() as usize).max(1)));
    }
    groups
}

fn describe(problem: &FitProblem, errors: &Errors, rest: &[usize], members: &[usize], size: usize) -> Unidentifiable {
    let which: Vec<usize> = members.iter().map(|&m| rest[m]).collect();
    let parameters: Vec<String> = which.iter().map(|&j| problem.parameters[j].name.clone()).collect();
    let run_of = |j: usize| problem.run_of(j).map(|r| problem.runs[r].file.clone());
    let first = run_of(which[0]);
    let run = first.filter(|_| which.iter().all(|&j| run_of(j) == run_of(which[0])) && problem.runs.len() > 1);
    let of = run.as_ref().map_or(String::new(), |r| format!(" of {r}"));
    let list = listed(&parameters);
    if size >= which.len() {
        let known_before = which.iter().all(|&j| problem.parameters[j].prior.is_some());
        let rest = if known_before {
            "it adds nothing to what was known before"
        } else {
            "values between half and twice this one, or more, fit as well"
        };
        let in_words = format!("The record does not determine {list}{of}: {rest}.");
        return Unidentifiable { parameters, run, seen_combination: None, standard_error_percent: None, in_words };
    }
    let pair = (which.len() == 2).then(|| combination(problem, errors, [which[0], which[1]])).flatten();
    let in_words = match &pair {
        Some((name, percent)) => {
            format!("The record does not separate {list}{of}: it determines only {name}, to {}%.", rounded(*percent))
        }
        None => format!("The record does not separate {list}{of}: each can change if the others compensate."),
    };
    let (seen_combination, standard_error_percent) = pair.unzip();
    Unidentifiable { parameters, run, seen_combination, standard_error_percent, in_words }
}

/// The best known product of powers of two logarithmic variables, and its standard error, percent.
fn combination(problem: &FitProblem, errors: &Errors, [i, j]: [usize; 2]) -> Option<(String, f64)> {
    let parameters = [&problem.parameters[i], &problem.parameters[j]];
    if parameters.iter().any(|p| p.scale != Scale::Log) {
        return None;
    }
    let [a, b, c] = [(i, i), (i, j), (j, j)].map(|at| errors.covariance[at]);
    let (power, variance) = best_power(a, b, c)?;
    let [first, second] = parameters.map(|p| p.name.as_str());
    Some((powers(first, second, power), 100.0 * variance.sqrt()))
}

/// The power `q` with which `x + q y` has least variance, of variances `a`, `c` and covariance `b`, rounded to ±1 where
/// it is near; with that variance.
fn best_power(a: f64, b: f64, c: f64) -> Option<(f64, f64)> {
    let q = -b / c;
    let q = if (q.abs() - 1.0).abs() < UNIT_EXPONENT_WITHIN { q.signum() } else { (100.0 * q).round() / 100.0 };
    let variance = a + 2.0 * q * b + q * q * c;
    (variance.is_finite() && variance >= 0.0).then_some((q, variance))
}

fn powers(first: &str, second: &str, q: f64) -> String {
    let sign = if q < 0.0 { "/" } else { "·" };
    if q.abs() == 1.0 { format!("{first}{sign}{second}") } else { format!("{first}{sign}{second}^{}", q.abs()) }
}

fn rounded(percent: f64) -> String {
    if percent >= 10.0 { format!("{percent:.0}") } else { format!("{percent:.1}") }
}

fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creep slower than the record: only J/τ shows. Normal matrix of ln J, ln τ, a third that is seen, and a fourth
    /// that nothing shows.
    #[test]
    fn what_goes_together_is_found_whatever_the_basis() {
        let mut matrix = DMatrix::zeros(4, 4);
        for (i, j, v) in [(0, 0, 1e4), (0, 1, -1e4), (1, 0, -1e4), (1, 1, 1e4 + 0.1), (2, 2, 1e6), (3, 3, 1e-3)] {
            matrix[(i, j)] = v;
        }
        let found = groups(&undetermined_space(matrix));
        assert_eq!(found, [(vec![0, 1], 1), (vec![3], 1)]);
    }

    #[test]
    fn all_that_is_seen_is_left_out() {
        assert!(groups(&undetermined_space(DMatrix::from_diagonal_element(3, 3, 25.0))).is_empty());
        assert!(groups(&undetermined_space(DMatrix::zeros(0, 0))).is_empty());
    }

    /// Variance 1 each, of the difference 0.0009: the ratio is known to 3%.
    #[test]
    fn the_ratio_is_named_with_its_error() {
        let (q, variance) = best_power(1.0, 1.0 - 0.000_45, 1.0).unwrap();
        assert!(q == -1.0 && (variance.sqrt() - 0.03).abs() < 1e-6, "{q} {variance}");
        assert_eq!(powers("J2_per_GPa", "tau2_s", q), "J2_per_GPa/tau2_s");
        assert_eq!(powers("a", "b", 0.5), "a·b^0.5");
        assert!(best_power(f64::INFINITY, 0.0, 1.0).is_none());
    }
}
