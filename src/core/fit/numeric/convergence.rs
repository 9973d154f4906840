//! Whether chains of draws have come to one distribution, and how many independent draws they are worth.
//!
//! Vehtari, Gelman, Simpson, Carpenter & Bürkner 2021 (Bayesian Anal. 16, 667): draws become normal scores of their
//! ranks, and chains are split in halves. R̂ compares the variance between with that within. Of many short chains it is
//! taken between groups, whose chains have no memory of each other (nested R̂: Margossian et al. 2024, Bayesian
//! Anal., doi 10.1214/24-BA1453): between single ones it would ask for as many draws of each. A chain that stays apart
//! from the others of its group shows in the number of independent draws, which follows from autocorrelations,
//! summed as far as Geyer's (1992) initial monotone sequence goes. Each is that of the worst of the draws, of their
//! distances from the median or whether they lie in a tail.

use statrs::distribution::{ContinuousCDF, Normal};

/// See the module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Convergence {
    /// 1 where all chains show the same distribution; not a number where nothing moves.
    pub(crate) r_hat: f64,
    /// Independent draws that say as much.
    pub(crate) effective_draws: f64,
}

impl Convergence {
    /// Of chains of equal length, of at least four draws: those of so many `groups`, one after the other.
    pub(crate) fn of(chains: &[Vec<f64>], groups: usize) -> Self {
        let split: Vec<&[f64]> = chains.iter().flat_map(|c| [&c[..c.len() / 2], &c[c.len() - c.len() / 2..]]).collect();
        let mut sorted: Vec<f64> = split.concat();
        sorted.sort_by(f64::total_cmp);
        let ranks = scores(&split, &sorted);
        let middle = sorted[sorted.len() / 2];
        let folded: Vec<Vec<f64>> =
            split.iter().map(|chain| chain.iter().map(|v| (v - middle).abs()).collect()).collect();
        let folded: Vec<&[f64]> = folded.iter().map(Vec::as_slice).collect();
        let mut sorted_folded = folded.concat();
        sorted_folded.sort_by(f64::total_cmp);
        let tails = [0.025, 0.975].map(|share| {
            let end = sorted[((share * sorted.len() as f64) as usize).min(sorted.len() - 1)];
            split.iter().map(|chain| chain.iter().map(|v| f64::from(u8::from(*v <= end))).collect()).collect()
        });
        let effective = |chains: &Vec<Vec<f64>>| effective_draws(chains);
        let worst = tails.iter().chain([&ranks]).map(effective).fold(f64::INFINITY, f64::min);
        let folded = scores(&folded, &sorted_folded);
        let [r_hat, of_spread] = [&ranks, &folded].map(|scores| nested_r_hat(scores, groups));
        Convergence { r_hat: r_hat.max(of_spread), effective_draws: worst }
    }
}

/// Normal scores of the ranks of draws among all, which are `sorted`; draws of one value share their rank.
fn scores(chains: &[&[f64]], sorted: &[f64]) -> Vec<Vec<f64>> {
    let standard = Normal::standard();
    let n = sorted.len() as f64;
    let score = |v: &f64| {
        let (first, last) = (sorted.partition_point(|s| s < v), sorted.partition_point(|s| s <= v));
        // Blom (1958)
        standard.inverse_cdf((0.5 * (first + last) as f64 + 0.5 - 0.375) / (n + 0.25))
    };
    chains.iter().map(|chain| chain.iter().map(score).collect()).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn variance(values: &[f64]) -> f64 {
    let about = mean(values);
    values.iter().map(|v| (v - about).powi(2)).sum::<f64>() / (values.len() - 1) as f64
}

/// Variance within chains, and that of all draws that it and the chains' means show.
fn variances(chains: &[Vec<f64>]) -> (f64, f64) {
    let n = chains[0].len() as f64;
    let within = mean(&chains.iter().map(|c| variance(c)).collect::<Vec<_>>());
    let between = variance(&chains.iter().map(|c| mean(c)).collect::<Vec<_>>());
    (within, within * (n - 1.0) / n + between)
}

/// Of split chains: the first halves of a group's chains count as one, and the second.
fn nested_r_hat(split: &[Vec<f64>], groups: usize) -> f64 {
    let of_group = split.chunks(split.len().div_ceil(groups));
    let halves =
        of_group.flat_map(|own| [0, 1].map(|half| own.iter().skip(half).step_by(2).flatten().copied().collect()));
    let (within, all) = variances(&halves.collect::<Vec<Vec<f64>>>());
    (all / within).sqrt()
}

fn effective_draws(chains: &[Vec<f64>]) -> f64 {
    let (n, total) = (chains[0].len(), chains.iter().map(Vec::len).sum::<usize>() as f64);
    let (within, all) = variances(chains);
    if all <= 0.0 || !all.is_finite() {
        return 0.0;
    }
    let centred = |c: &Vec<f64>| {
        let about = mean(c);
        c.iter().map(|v| v - about).collect()
    };
    let centred: Vec<Vec<f64>> = chains.iter().map(centred).collect();
    let correlation = |lag: usize| {
        let of = |c: &Vec<f64>| c[lag..].iter().zip(c).map(|(a, b)| a * b).sum::<f64>() / n as f64;
        let covariance = mean(&centred.iter().map(of).collect::<Vec<_>>());
        1.0 - (within * (n - 1) as f64 / n as f64 - covariance) / all
    };
    let (mut sum, mut least) = (-1.0, f64::INFINITY);
    for lag in (0..n - 1).step_by(2) {
        let pair = correlation(lag) + correlation(lag + 1);
        if pair <= 0.0 {
            break;
        }
        least = pair.min(least);
        sum += 2.0 * least;
    }
    // Draws that avoid each other say more than independent ones, but not by more than this.
    (total / sum.max(1.0 / total.log10())).min(total * total.log10())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::population::normal;

    /// Chains of a first-order autoregression, four of each of two groups.
    fn chains(correlation: f64) -> Vec<Vec<f64>> {
        let mut random = fastrand::Rng::with_seed(5);
        let mut one = |_| {
            let mut last = normal(&mut random);
            let step = |_| {
                last = correlation * last + (1.0 - correlation * correlation).sqrt() * normal(&mut random);
                last
            };
            (0..2000).map(step).collect::<Vec<f64>>()
        };
        (0..8).map(&mut one).collect()
    }

    /// An autoregression of correlation φ is worth (1 - φ)/(1 + φ) of its draws.
    #[test]
    fn correlated_draws_count_as_fewer() {
        for (correlation, share) in [(0.0, 1.0f64), (0.6, 0.25), (0.9, 1.0 / 19.0)] {
            let found = Convergence::of(&chains(correlation), 2);
            // the means of four half groups of so many draws scatter by chance
            let by_chance = (1.0 + 21.7 / (16_000.0 * share)).sqrt();
            assert!((0.999..by_chance).contains(&found.r_hat), "{correlation}: {found:?}");
            let bulk = effective_draws(&chains(correlation)) / 16_000.0;
            assert!((bulk / share - 1.0).abs() < 0.15, "{correlation}: {bulk}");
            assert!(found.effective_draws <= 1.05 * bulk * 16_000.0, "{found:?}");
        }
    }

    #[test]
    fn groups_that_differ_are_noticed() {
        let with = |change: &dyn Fn(f64) -> f64| {
            let mut chains = chains(0.5);
            chains[..4].iter_mut().flatten().for_each(|v| *v = change(*v));
            Convergence::of(&chains, 2).r_hat
        };
        assert!(with(&|v| v) < 1.005 && with(&|v| v + 0.5) > 1.02, "{} {}", with(&|v| v), with(&|v| v + 0.5));
        // one that is wider, about the same mean
        assert!(with(&|v| 1.5 * v) > 1.02, "{}", with(&|v| 1.5 * v));
    }

    /// A chain that stays three standard deviations away from the seven others: all draws are worth little more than
    /// one of each chain.
    #[test]
    fn a_chain_that_stays_apart_is_worth_one_draw() {
        let mut apart = chains(0.0);
        apart[0].iter_mut().for_each(|v| *v += 3.0);
        let found = Convergence::of(&apart, 2);
        assert!(found.effective_draws < 100.0, "{found:?}");
    }

    #[test]
    fn what_does_not_move_is_worth_nothing() {
        let found = Convergence::of(&vec![vec![1.0; 100]; 4], 2);
        assert!(found.r_hat.is_nan() && found.effective_draws == 0.0, "{found:?}");
    }
}
