//! From samples to a few retardation times: a non-negative spectrum on a fine grid of τ, whose spikes are merged.

use nalgebra::{DMatrix, DVector};

use crate::creep::nnls::nnls;
use crate::creep::thresholds::NEIGHBOUR_RATIO;
use crate::creep::thresholds::{GRID_PER_DECADE, THINNED_PER_DECADE};
use crate::creep::{Creep, Element};

/// Samples for a fit, of one temperature or reduced to one; all vectors of one length.
#[derive(Debug, Clone, Default)]
pub(crate) struct Samples {
    /// Times, s.
    pub(crate) time_s: Vec<f64>,
    /// Compliances, 1/Pa.
    pub(crate) compliance_per_pa: Vec<f64>,
    /// Standard deviation of each, 1/Pa.
    pub(crate) sd_per_pa: Vec<f64>,
}

impl Samples {
    /// Means over short stretches of log time, with their standard deviations: many samples a second late in a test
    /// show little more than a few.
    pub(crate) fn thinned(&self) -> Samples {
        let mut thin = Samples::default();
        let bin = |t: f64| if t > 0.0 { (t.log10() * THINNED_PER_DECADE).floor() } else { f64::NEG_INFINITY };
        let mut first = 0;
        for last in 1..=self.time_s.len() {
            if last < self.time_s.len() && bin(self.time_s[last]) == bin(self.time_s[first]) {
                continue;
            }
            let n = (last - first) as f64;
            let mean = |v: &[f64]| v[first..last].iter().sum::<f64>() / n;
            thin.time_s.push(mean(&self.time_s));
            thin.compliance_per_pa.push(mean(&self.compliance_per_pa));
            thin.sd_per_pa.push(mean(&self.sd_per_pa) / n.sqrt());
            first = last;
        }
        thin
    }

    /// With other samples, whose times are divided by `factor`.
    pub(crate) fn with(&self, other: &Samples, factor: f64) -> Samples {
        let mut all = self.clone();
        all.time_s.extend(other.time_s.iter().map(|t| t / factor));
        all.compliance_per_pa.extend(&other.compliance_per_pa);
        all.sd_per_pa.extend(&other.sd_per_pa);
        all
    }

    /// Shortest time after 0 and longest, s.
    pub(crate) fn span_s(&self) -> (f64, f64) {
        let after = self.time_s.iter().copied().filter(|t| *t > 0.0);
        let shortest = after.fold(f64::INFINITY, f64::min);
        (shortest, self.time_s.iter().copied().fold(shortest, f64::max))
    }
}

/// The best creep with these retardation times and no negative compliance, and the sum of its squared weighted
/// residuals.
pub(crate) fn with_times(samples: &Samples, tau_s: &[f64]) -> (Creep, f64) {
    let rows = samples.time_s.len();
    let matrix = DMatrix::from_fn(rows, tau_s.len() + 1, |i, j| {
        let basis = if j == 0 { 1.0 } else { -(-samples.time_s[i] / tau_s[j - 1]).exp_m1() };
        basis / samples.sd_per_pa[i]
    });
    let weighted = samples.compliance_per_pa.iter().zip(&samples.sd_per_pa).map(|(j, sd)| j / sd);
    let right = DVector::from_iterator(rows, weighted);
    let x = nnls(&matrix, &right);
    let square = (&right - &matrix * &x).norm_squared();
    let elements = tau_s.iter().enumerate().map(|(k, &tau_s)| Element { compliance_per_pa: x[k + 1], tau_s });
    (Creep { instantaneous_per_pa: x[0], elements: elements.collect() }, square)
}

/// The spectrum of some samples on a grid over their times and somewhat beyond, and the sum of squares that it leaves.
pub(crate) fn spectrum(samples: &Samples) -> (Creep, f64) {
    let (shortest_s, longest_s) = samples.span_s();
    let (from, to) = ((0.5 * shortest_s).ln(), (5.0 * longest_s).ln());
    let steps = ((to - from) / 10f64.ln() * GRID_PER_DECADE).ceil().clamp(1.0, 200.0) as usize;
    let grid: Vec<f64> = (0..=steps).map(|i| (from + (to - from) * i as f64 / steps as f64).exp()).collect();
    let (mut creep, square) = with_times(samples, &grid);
    creep.elements.retain(|e| e.compliance_per_pa > 0.0);
    (creep, square)
}

/// Merges neighbouring elements, each pair at the mean of its log τ weighted by compliance, until `most` are left and
/// none are neighbours.
pub(crate) fn merged(mut elements: Vec<Element>, most: usize) -> Vec<Element> {
    elements.sort_by(|a, b| a.tau_s.total_cmp(&b.tau_s));
    while elements.len() > 1 {
        let ratio = |k: &usize| elements[k + 1].tau_s / elements[*k].tau_s;
        let Some(k) = (0..elements.len() - 1).min_by(|a, b| ratio(a).total_cmp(&ratio(b))) else { break };
        if elements.len() <= most && ratio(&k) > NEIGHBOUR_RATIO {
            break;
        }
        let (a, b) = (elements[k], elements[k + 1]);
        let sum = a.compliance_per_pa + b.compliance_per_pa;
        let log_tau = (a.compliance_per_pa * a.tau_s.ln() + b.compliance_per_pa * b.tau_s.ln()) / sum;
        elements[k] = Element { compliance_per_pa: sum, tau_s: log_tau.exp() };
        elements.remove(k + 1);
    }
    elements
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(creep: &Creep) -> Samples {
        let time_s: Vec<f64> = (0..=160).map(|i| 10f64.powf(-1.0 + f64::from(i) / 32.0)).collect();
        let compliance_per_pa: Vec<f64> = time_s.iter().map(|&t| creep.compliance_per_pa(t)).collect();
        let sd_per_pa = vec![1e-13; time_s.len()];
        Samples { time_s, compliance_per_pa, sd_per_pa }
    }

    #[test]
    fn spikes_drawn_together_stand_near_the_elements() {
        let elements = [(0.2e-9, 2.0), (0.3e-9, 60.0), (0.5e-9, 1500.0)]
            .map(|(compliance_per_pa, tau_s)| Element { compliance_per_pa, tau_s });
        let creep = Creep { instantaneous_per_pa: 0.8e-9, elements: elements.to_vec() };
        let (found, _) = spectrum(&exact(&creep));
        let few = merged(found.elements, 3);
        assert_eq!(few.len(), 3, "{few:?}");
        for (few, own) in few.iter().zip(&elements) {
            assert!((few.tau_s / own.tau_s).ln().abs() < 0.2, "{few:?} for {own:?}");
            assert!((few.compliance_per_pa / own.compliance_per_pa - 1.0).abs() < 0.15, "{few:?} for {own:?}");
        }
    }

    #[test]
    fn thinned_samples_keep_their_weight() {
        let n = 10_000;
        let samples = Samples {
            time_s: (0..n).map(f64::from).collect(),
            compliance_per_pa: vec![2.0; n as usize],
            sd_per_pa: vec![1.0; n as usize],
        };
        let thin = samples.thinned();
        let weight = |s: &Samples| s.sd_per_pa.iter().map(|sd| sd.powi(-2)).sum::<f64>();
        assert!(thin.time_s.len() < 120 && thin.time_s.windows(2).all(|w| w[0] < w[1]));
        assert!((weight(&thin) / weight(&samples) - 1.0).abs() < 1e-9);
    }
}
