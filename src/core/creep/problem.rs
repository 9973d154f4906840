//! The fit of creep tests as bounded least squares: all variables are logarithms.
//!
//! `[ln J0, ln J_1, ln τ_1, …, ln a_1, …]`: a shift factor for each temperature but the reference.

use crate::creep::spectrum::Samples;
use crate::creep::thresholds::{LARGEST_COMPLIANCE, LARGEST_LOG_SHIFT, LEAST_COMPLIANCE, LOG_DIFFERENCE, TAU_RANGE};
use crate::creep::{Creep, Element};
use crate::fit::numeric::least_squares::Problem;

/// One test with the number of its shift; none at the reference.
pub(crate) struct Shifted {
    pub(crate) samples: Samples,
    pub(crate) shift: Option<usize>,
}

/// See the module.
pub(crate) struct CreepProblem<'a> {
    tests: &'a [Shifted],
    elements: usize,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'a> CreepProblem<'a> {
    /// Of `elements` elements; `span_s` are the shortest and longest reduced times.
    pub(crate) fn new(tests: &'a [Shifted], elements: usize, shifts: usize, span_s: (f64, f64)) -> Self {
        let all = tests.iter().flat_map(|t| &t.samples.compliance_per_pa);
        let largest = all.copied().fold(0.0, f64::max);
        let (least, most) = ((LEAST_COMPLIANCE * largest).ln(), (LARGEST_COMPLIANCE * largest).ln());
        let (short, long) = ((TAU_RANGE.0 * span_s.0).ln(), (TAU_RANGE.1 * span_s.1).ln());
        let bounds = |compliance: f64, tau: f64, shift: f64| {
            let mut all = vec![compliance];
            all.extend([compliance, tau].repeat(elements));
            all.extend(vec![shift; shifts]);
            all
        };
        CreepProblem {
            tests,
            elements,
            lower: bounds(least, short, -LARGEST_LOG_SHIFT),
            upper: bounds(most, long, LARGEST_LOG_SHIFT),
        }
    }

    /// The variables of a creep and of logarithms of shifts, within the bounds.
    pub(crate) fn variables(&self, creep: &Creep, log_shifts: &[f64]) -> Vec<f64> {
        let pairs = creep.elements.iter().flat_map(|e| [e.compliance_per_pa.ln(), e.tau_s.ln()]);
        let x = std::iter::once(creep.instantaneous_per_pa.ln()).chain(pairs).chain(log_shifts.iter().copied());
        x.zip(self.lower.iter().zip(&self.upper)).map(|(v, (l, u))| v.clamp(*l, *u)).collect()
    }

    /// The creep of some variables, its elements in the variables' order.
    pub(crate) fn creep(&self, x: &[f64]) -> Creep {
        let element = |pair: &[f64]| Element { compliance_per_pa: pair[0].exp(), tau_s: pair[1].exp() };
        let elements = x[1..=2 * self.elements].chunks_exact(2).map(element).collect();
        Creep { instantaneous_per_pa: x[0].exp(), elements }
    }

    /// The logarithms of the shifts.
    pub(crate) fn log_shifts<'x>(&self, x: &'x [f64]) -> &'x [f64] {
        &x[1 + 2 * self.elements..]
    }
}

impl Problem for CreepProblem<'_> {
    type Error = std::convert::Infallible;

    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, Self::Error> {
        let (creep, shifts) = (self.creep(x), self.log_shifts(x));
        let mut out = Vec::new();
        for Shifted { samples, shift } in self.tests {
            let per_factor = shift.map_or(1.0, |m| (-shifts[m]).exp());
            let measured = samples.compliance_per_pa.iter().zip(&samples.sd_per_pa);
            out.extend(
                samples
                    .time_s
                    .iter()
                    .zip(measured)
                    .map(|(t, (j, sd))| (j - creep.compliance_per_pa(t * per_factor)) / sd),
            );
        }
        Ok(out)
    }
    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }
    fn difference_step(&self, _j: usize) -> f64 {
        LOG_DIFFERENCE
    }
}

/// How J(t) moves with each of the logarithms `ln J0, ln J_1, ln τ_1, …`, 1/Pa.
pub(crate) fn gradient(creep: &Creep, time_s: f64) -> Vec<f64> {
    let pairs = creep.elements.iter().flat_map(|e| {
        let ratio = time_s / e.tau_s;
        [-e.compliance_per_pa * (-ratio).exp_m1(), -e.compliance_per_pa * ratio * (-ratio).exp()]
    });
    std::iter::once(creep.instantaneous_per_pa).chain(pairs).collect()
}
