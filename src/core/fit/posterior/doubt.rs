//! Where the intervals of a fit rest on a straight line that its residuals do not follow.
//!
//! One rule: a parameter's interval is in doubt where a bound lies within 1.96 standard errors of the value, or where
//! the residuals, at the place that shows what the linearised ones show at its end, are not what the line promises: the
//! parameter has moved, or minus twice the logarithm of the likelihood has risen, by more or less than
//! [`PROFILE_DIFFERS`] allows. That is the comparison of a profile with its linear interval, with one correction in
//! place of a descent: four simulations a parameter.

use rayon::prelude::*;

use crate::fit::data::run_data::RunData;
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::outcome::doubt::Doubt;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::PROFILE_DIFFERS;
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::fit::posterior::likelihood::Likelihood;
use crate::fit::posterior::sample::with_likelihood;
use crate::fit::problem::error::FitError;
use crate::fit::search::options::Options;
use crate::rig::Rig;

/// What the intervals themselves show of [`find_doubts`], without a simulation: that a bound lies within one, or that
/// it is open.
pub fn find_bounds(fit: &mut Fit) {
    if !fit.converged {
        return;
    }
    for p in &mut fit.parameters {
        let passes = p.interval_95.0 < p.lower || p.interval_95.1 > p.upper;
        p.doubt = match p.uncertainty {
            Uncertainty::AtBound => Some(Doubt::Bound),
            Uncertainty::Open => Some(Doubt::Open),
            Uncertainty::Known(_) if passes => Some(Doubt::Bound),
            _ => None,
        };
    }
}

/// Says of each parameter of a fit why its interval is in doubt, if it is: sets
/// [`FittedParameter::doubt`](crate::fit::outcome::fit::FittedParameter::doubt). A fit that ended at no
/// optimum gets none.
///
/// # Errors
/// As [`crate::fit::search::calibrate::refine`].
pub fn find_doubts(rig: &Rig, runs: &[RunData], fit: &mut Fit, options: &Options) -> Result<(), FitError> {
    if !fit.converged {
        return Ok(());
    }
    let found = with_likelihood(rig, runs, fit, options, &|_| {}, |likelihood, _| {
        let known: Vec<Uncertainty> = likelihood.free.iter().map(|&j| fit.parameters[j].uncertainty).collect();
        let of = |a: usize| (likelihood.free[a], of_variable(likelihood, a, known[a]));
        (0..known.len()).into_par_iter().map(of).collect::<Vec<_>>()
    })?;
    for (j, doubt) in found.unwrap_or_default() {
        fit.parameters[j].doubt = doubt;
    }
    Ok(())
}

fn of_variable(likelihood: &Likelihood, a: usize, known: Uncertainty) -> Option<Doubt> {
    match known {
        Uncertainty::AtBound => return Some(Doubt::Bound),
        Uncertainty::Open => return Some(Doubt::Open),
        _ => {}
    }
    let (centre, (lower, upper)) = (likelihood.centre()[a], likelihood.bounds()[a]);
    let sides = [-Z_95, Z_95].map(|by| {
        let Some(displacement) = likelihood.along(a, by) else { return Some(Doubt::Open) };
        if !(lower..=upper).contains(&(centre + displacement[a])) {
            return Some(Doubt::Bound);
        }
        let Some((there, rise)) = likelihood.corrected(&displacement) else { return Some(Doubt::Curved) };
        let reached = (there[a] - centre) / displacement[a];
        // How far the interval goes, over how far the line says: the likelihood's own end is where the root of the rise
        // is 1.96.
        let ratio = reached * Z_95 / rise.max(0.0).sqrt();
        let straight = (1.0 / (1.0 + PROFILE_DIFFERS)..=1.0 + PROFILE_DIFFERS).contains(&ratio);
        (!straight).then_some(Doubt::Curved)
    });
    let says = |doubt: Doubt| sides.contains(&Some(doubt)).then_some(doubt);
    says(Doubt::Bound).or_else(|| says(Doubt::Open)).or_else(|| says(Doubt::Curved))
}
