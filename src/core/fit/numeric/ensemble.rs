//! Sampling a density known up to a factor by ensembles of walkers that learn its shape from each other.
//!
//! Coordinates are those in which the density is about standard normal, as far as that is known. Half of the moves lean
//! on it: they go towards the middle and a random step away, such that a standard normal density would take every one,
//! and the density decides by how it differs (preconditioned Crank-Nicolson: Cotter, Roberts, Stuart & White 2013,
//! Stat. Sci. 28, 424). The others lean on nothing. A walker of one half of an ensemble is moved by walkers of the
//! other half: mostly along the difference of two of them (ter Braak 2006, Stat. Comput. 16, 239), sometimes towards or
//! away from one (the snooker move of ter Braak & Vrugt 2008, Stat. Comput. 18, 435). Neither asks for a scale, a
//! covariance or a slope, and bounds are places of density zero. Halves move in turn, so that all walkers of a half
//! move at once (Foreman-Mackey et al. 2013, PASP 125, 306). Several ensembles that know nothing of each other show
//! whether they found the same density.

use rayon::prelude::*;

use crate::fit::numeric::population::normal;
use crate::fit::numeric::thresholds::{
    LEAST_NORMAL_MOVE, LONG_MOVE_SHARE, MOVE_JITTER, NORMAL_MOVE_SHARE, SNOOKER_SHARE, SNOOKER_STEP,
};
use crate::product::dot;

/// A walker where it stands, and the way it went.
#[derive(Debug, Clone)]
pub(crate) struct Walker {
    at: Vec<f64>,
    log_density: f64,
    /// Its place after each sweep.
    pub(crate) path: Vec<Vec<f64>>,
    /// Moves that it made, not those that it refused.
    pub(crate) moves: usize,
    random: fastrand::Rng,
}

/// Ensembles of walkers.
#[derive(Debug, Clone)]
pub(crate) struct Ensembles {
    /// Of each ensemble, its two halves.
    halves: Vec<[Vec<Walker>; 2]>,
}

impl Ensembles {
    /// Walkers of each ensemble at their `starts`, at least four each, where the density is not zero.
    pub(crate) fn new(starts: Vec<Vec<(Vec<f64>, f64)>>, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut walker =
            |(at, log_density)| Walker { at, log_density, path: Vec::new(), moves: 0, random: random.fork() };
        let mut halved = |ensemble: Vec<(Vec<f64>, f64)>| {
            let mut first: Vec<Walker> = ensemble.into_iter().map(&mut walker).collect();
            let second = first.split_off(first.len() / 2);
            [first, second]
        };
        Ensembles { halves: starts.into_iter().map(&mut halved).collect() }
    }

    /// Moves every walker once.
    pub(crate) fn sweep(&mut self, log_density: &(impl Fn(&[f64]) -> f64 + Sync)) {
        for moving in [0, 1] {
            let pairs = self.halves.iter_mut().map(|[first, second]| match moving {
                0 => (first, &*second),
                _ => (second, &*first),
            });
            let each: Vec<(&mut Walker, &Vec<Walker>)> =
                pairs.flat_map(|(walkers, others)| walkers.iter_mut().map(move |walker| (walker, others))).collect();
            each.into_par_iter().for_each(|(walker, others)| walker.step(others, log_density));
        }
    }

    /// All walkers.
    pub(crate) fn walkers(&self) -> impl Iterator<Item = &Walker> {
        self.halves.iter().flatten().flatten()
    }
}

impl Walker {
    fn step(&mut self, others: &[Walker], log_density: &impl Fn(&[f64]) -> f64) {
        let (to, log_factor) = self.proposal(others);
        let there = log_density(&to);
        if there.is_finite() && self.random.f64().ln() < there - self.log_density + log_factor {
            (self.at, self.log_density) = (to, there);
            self.moves += 1;
        }
        self.path.push(self.at.clone());
    }

    /// Where it may go, and the logarithm of the factor that makes the move reversible.
    fn proposal(&mut self, others: &[Walker]) -> (Vec<f64>, f64) {
        let dimensions = self.at.len() as f64;
        if self.random.f64() < NORMAL_MOVE_SHARE {
            let by = LEAST_NORMAL_MOVE.powf(self.random.f64());
            let keep = (1.0 - by * by).sqrt();
            let to: Vec<f64> = self.at.iter().map(|x| keep * x + by * normal(&mut self.random)).collect();
            let factor = 0.5 * (dot(&to, &to) - dot(&self.at, &self.at));
            return (to, factor);
        }
        let [a, b, anchor] = three(others.len(), &mut self.random).map(|i| &others[i].at);
        if self.random.f64() < SNOOKER_SHARE {
            let away: Vec<f64> = self.at.iter().zip(anchor).map(|(x, z)| x - z).collect();
            let square = dot(&away, &away);
            let share = SNOOKER_STEP * a.iter().zip(b).zip(&away).map(|((a, b), w)| (a - b) * w).sum::<f64>() / square;
            let to = self.at.iter().zip(&away).map(|(x, w)| x + share * w).collect();
            // The way from the anchor is `1 + share` times as long.
            return (to, (dimensions - 1.0) * (1.0 + share).abs().ln());
        }
        let usual = 2.38 / (2.0 * dimensions).sqrt();
        // A move by the whole difference goes from one basin to another.
        let by = if self.random.f64() < LONG_MOVE_SHARE { 1.0 } else { usual };
        let by = by * (1.0 + MOVE_JITTER * (2.0 * self.random.f64() - 1.0));
        (self.at.iter().zip(a.iter().zip(b)).map(|(x, (a, b))| x + by * (a - b)).collect(), 0.0)
    }
}

/// Three different numbers below `n`, which is at least three, or two of them where it is two.
fn three(n: usize, random: &mut fastrand::Rng) -> [usize; 3] {
    let first = random.usize(..n);
    let second = (first + 1 + random.usize(..n - 1)) % n;
    let third = loop {
        let third = random.usize(..n);
        if n < 3 || (third != first && third != second) {
            break third;
        }
    };
    [first, second, third]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::convergence::Convergence;

    /// Draws of the second halves of all ways.
    fn drawn(
        dimensions: usize,
        sweeps: usize,
        seed: u64,
        start: impl Fn(&mut fastrand::Rng) -> Vec<f64>,
        density: impl Fn(&[f64]) -> f64 + Sync,
    ) -> Vec<Vec<Vec<f64>>> {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut one = || loop {
            let at = start(&mut random);
            let there = density(&at);
            if there.is_finite() {
                return (at, there);
            }
        };
        let walkers = (2 * dimensions).max(12);
        let starts = (0..2).map(|_| (0..walkers).map(|_| one()).collect()).collect();
        let mut all = Ensembles::new(starts, seed);
        (0..sweeps).for_each(|_| all.sweep(&density));
        all.walkers().map(|w| w.path[sweeps / 2..].to_vec()).collect()
    }

    fn marginal(draws: &[Vec<Vec<f64>>], j: usize) -> (Vec<f64>, Convergence) {
        let chains: Vec<Vec<f64>> = draws.iter().map(|path| path.iter().map(|x| x[j]).collect()).collect();
        let convergence = Convergence::of(&chains, 2);
        (chains.concat(), convergence)
    }

    fn moments(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64)
    }

    fn quantile(values: &mut [f64], share: f64) -> f64 {
        values.sort_by(f64::total_cmp);
        values[(share * values.len() as f64) as usize]
    }

    /// Five variables of correlation 0.99 and of sizes from 1 to 10⁴: mean and variance are those of the density.
    #[test]
    fn a_correlated_normal_density_is_drawn_with_its_moments() {
        let size = |j: usize| 10f64.powi(j as i32);
        let density = |x: &[f64]| {
            let y: Vec<f64> = (0..5).map(|j| x[j] / size(j) - 3.0).collect();
            let (sum, square) = (y.iter().sum::<f64>(), dot(&y, &y));
            // the inverse of 0.01 I + 0.99 11ᵀ, by Sherman and Morrison
            -0.5 * (square - 0.99 * sum * sum / (0.01 + 5.0 * 0.99)) / 0.01
        };
        let start = |random: &mut fastrand::Rng| (0..5).map(|j| size(j) * (3.0 + normal(random))).collect();
        let draws = drawn(5, 4000, 1, start, density);
        for j in 0..5 {
            let (values, convergence) = marginal(&draws, j);
            let (mean, variance) = moments(&values);
            let (mean, variance) = (mean / size(j), variance / size(j).powi(2));
            let error = (1.0 / convergence.effective_draws).sqrt();
            assert!(convergence.r_hat < 1.02 && error < 0.05, "{convergence:?}");
            assert!(
                (mean - 3.0).abs() < 4.0 * error && (variance - 1.0).abs() < 6.0 * error,
                "{mean} {variance} {error}"
            );
        }
    }

    /// A normal density cut off at one standard deviation above its mean: its quantiles are those of statrs.
    #[test]
    fn a_bound_cuts_the_density_off() {
        use statrs::distribution::{ContinuousCDF, Normal};
        let exact = Normal::new(0.0, 1.0).unwrap();
        let above = 1.0 - exact.cdf(1.0);
        let density = |x: &[f64]| if x[0] < 1.0 { f64::NEG_INFINITY } else { -0.5 * dot(x, x) };
        let draws = drawn(2, 6000, 2, |random| vec![1.0 + random.f64(), normal(random)], density);
        let (mut values, convergence) = marginal(&draws, 0);
        assert!(convergence.r_hat < 1.01 && convergence.effective_draws > 2000.0, "{convergence:?}");
        assert!(values.iter().all(|v| *v >= 1.0));
        for share in [0.025, 0.5, 0.95] {
            let (found, known) = (quantile(&mut values, share), exact.inverse_cdf(1.0 - above * (1.0 - share)));
            assert!((found - known).abs() < 0.04, "{share}: {found} {known}");
        }
    }

    /// Haario, Saksman & Tamminen's (1999) banana: `y = x₂ + b x₁² - b s²`, `x₁` of variance `s²`, `y` of variance 1.
    /// So `x₂` has mean 0 and variance `1 + 2 b² s⁴`.
    #[test]
    fn a_banana_is_drawn_with_its_moments() {
        let (b, s2) = (0.5, 4.0);
        let density = |x: &[f64]| -0.5 * (x[0] * x[0] / s2 + (x[1] + b * x[0] * x[0] - b * s2).powi(2));
        let draws = drawn(2, 50_000, 3, |random| vec![normal(random), 2.0 + normal(random)], density);
        let ((first, _), (second, convergence)) = (marginal(&draws, 0), marginal(&draws, 1));
        assert!(convergence.r_hat < 1.01 && convergence.effective_draws > 1500.0, "{convergence:?}");
        let (mean, variance) = moments(&first);
        assert!(mean.abs() < 0.15 && (variance / s2 - 1.0).abs() < 0.08, "{mean} {variance}");
        let (mean, variance) = moments(&second);
        assert!(mean.abs() < 0.2 && (variance / (1.0 + 2.0 * b * b * s2 * s2) - 1.0).abs() < 0.12, "{mean} {variance}");
    }

    /// Two basins of weights 3 and 1, ten standard deviations apart: walkers that start in both weigh them.
    #[test]
    fn two_basins_are_weighed() {
        let density = |x: &[f64]| {
            let basin = |at: f64| -0.5 * ((x[0] - at).powi(2) + x[1] * x[1]);
            (0.75 * basin(0.0).exp() + 0.25 * basin(10.0).exp()).ln()
        };
        let start =
            |random: &mut fastrand::Rng| vec![10.0 * f64::from(random.u8(..2)) + normal(random), normal(random)];
        let draws = drawn(2, 20_000, 4, start, density);
        let (values, _) = marginal(&draws, 0);
        let share = values.iter().filter(|v| **v > 5.0).count() as f64 / values.len() as f64;
        assert!((share - 0.25).abs() < 0.04, "{share}");
    }

    #[test]
    fn the_same_seed_draws_the_same() {
        let of = || drawn(3, 50, 7, |r| (0..3).map(|_| normal(r)).collect(), |x| -0.5 * dot(x, x));
        assert_eq!(of(), of());
    }
}
