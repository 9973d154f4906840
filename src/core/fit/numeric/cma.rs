//! Evolution strategy whose covariance adapts to the valleys of the cost, over the unit cube: CMA-ES.
//!
//! Hansen (2016), The CMA evolution strategy: a tutorial, arXiv:1604.00772, with the weights and rates of its table 1,
//! without negative weights. A point beyond a bound is put on it (Biedrzycki 2020, Swarm Evol. Comput. 52, 100627, on
//! repairs).

use nalgebra::{DMatrix, DVector};

use crate::fit::numeric::population::{Member, evaluated, normal, sort};
use crate::fit::numeric::thresholds::{CMA_LEAST_SPREAD, SPREAD_TOLERANCE};

/// The points of a generation are drawn from here.
struct Cloud {
    mean: DVector<f64>,
    /// Step size and shape: the covariance is `sigma² shape`.
    sigma: f64,
    shape: DMatrix<f64>,
    /// Where the mean has been going, for the step size and for the shape.
    sigma_path: DVector<f64>,
    shape_path: DVector<f64>,
}

/// Constants of a search: weights of the best points, and rates of learning.
struct Rates {
    weights: Vec<f64>,
    /// Variance-effective number of the points with weight.
    effective: f64,
    sigma_path: f64,
    shape_path: f64,
    rank_one: f64,
    rank_mu: f64,
    damping: f64,
    /// Expected length of a vector of independent normal numbers.
    usual_length: f64,
}

impl Rates {
    fn of(n: f64, points: usize) -> Rates {
        let best = points / 2;
        let raw: Vec<f64> = (0..best).map(|i| (0.5 * (points as f64 + 1.0)).ln() - (i as f64 + 1.0).ln()).collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        let effective = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        let sigma_path = (effective + 2.0) / (n + effective + 5.0);
        let rank_one = 2.0 / ((n + 1.3).powi(2) + effective);
        let rank_mu = 2.0 * (effective - 2.0 + 1.0 / effective) / ((n + 2.0).powi(2) + effective);
        Rates {
            sigma_path,
            shape_path: (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n),
            rank_one,
            rank_mu: rank_mu.clamp(0.0, 1.0 - rank_one),
            damping: 1.0 + 2.0 * (((effective - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + sigma_path,
            usual_length: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            weights,
            effective,
        }
    }
}

/// Goes on from `members`, sorted, the best first: least `cost` seen within `budget` evaluations, and where.
/// `on_generation` receives the evaluations so far and the least cost of each generation.
pub(crate) fn minimise(
    cost: &(impl Fn(&[f64]) -> f64 + Sync),
    members: &[Member],
    budget: usize,
    random: &mut fastrand::Rng,
    on_generation: &dyn Fn(usize, f64),
) -> Member {
    let mut best = members[0].clone();
    let n = best.x.len();
    let points = 4 + (3.0 * (n as f64).ln()) as usize;
    let rates = Rates::of(n as f64, points);
    let mut cloud = Cloud::around(members);
    let mut spent = 0;
    while spent + points <= budget {
        let Some(drawn) = cloud.draw(points, random) else { break };
        let mut generation = evaluated(cost, drawn);
        spent += generation.len();
        sort(&mut generation);
        let (least, worst) = (generation[0].cost, generation[points - 1].cost);
        if least < best.cost {
            best = generation[0].clone();
        }
        on_generation(spent, best.cost);
        if worst - least <= SPREAD_TOLERANCE * least || !cloud.learn(&rates, &generation) {
            break;
        }
    }
    best
}

impl Cloud {
    /// As the better half of a population lies about its best.
    fn around(members: &[Member]) -> Cloud {
        let mean = DVector::from_column_slice(&members[0].x);
        let n = mean.len();
        let half = &members[..members.len().div_ceil(2)];
        let mut shape = DMatrix::from_diagonal_element(n, n, CMA_LEAST_SPREAD * CMA_LEAST_SPREAD);
        for member in half {
            let off = DVector::from_column_slice(&member.x) - &mean;
            shape += &off * off.transpose() / half.len() as f64;
        }
        Cloud { sigma: 1.0, shape, sigma_path: DVector::zeros(n), shape_path: DVector::zeros(n), mean }
    }

    /// Points inside the cube; `None` where the shape has broken down.
    fn draw(&self, points: usize, random: &mut fastrand::Rng) -> Option<Vec<Vec<f64>>> {
        let n = self.mean.len();
        let root = self.shape.clone().cholesky()?.l();
        let mut one = || {
            let z = DVector::from_fn(n, |_, _| normal(random));
            let x = &self.mean + &root * z * self.sigma;
            x.iter().map(|v| v.clamp(0.0, 1.0)).collect()
        };
        Some((0..points).map(|_| one()).collect())
    }

    /// Moves and bends towards the best of a sorted generation; false where the shape has broken down.
    fn learn(&mut self, rates: &Rates, generation: &[Member]) -> bool {
        let steps: Vec<DVector<f64>> = rates
            .weights
            .iter()
            .zip(generation)
            .map(|(_, member)| (DVector::from_column_slice(&member.x) - &self.mean) / self.sigma)
            .collect();
        let zero = DVector::zeros(self.mean.len());
        let step = steps.iter().zip(&rates.weights).fold(zero, |sum, (step, w)| sum + step * *w);
        self.mean += &step * self.sigma;
        let eigen = self.shape.clone().symmetric_eigen();
        if eigen.eigenvalues.iter().any(|v| *v <= 0.0 || !v.is_finite()) {
            return false;
        }
        let inverse_roots = DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| v.sqrt().recip()));
        let whitened = &eigen.eigenvectors * inverse_roots * eigen.eigenvectors.transpose() * &step;
        let c = rates.sigma_path;
        self.sigma_path = &self.sigma_path * (1.0 - c) + whitened * (c * (2.0 - c) * rates.effective).sqrt();
        let length = self.sigma_path.norm() / rates.usual_length;
        // A long path would stretch the shape too far in its direction.
        let calm = if length < 1.4 + 2.0 / (self.mean.len() as f64 + 1.0) { 1.0 } else { 0.0 };
        let c = rates.shape_path;
        self.shape_path = &self.shape_path * (1.0 - c) + step * (calm * (c * (2.0 - c) * rates.effective).sqrt());
        let kept = 1.0 - rates.rank_one - rates.rank_mu + (1.0 - calm) * rates.rank_one * c * (2.0 - c);
        self.shape *= kept;
        self.shape += &self.shape_path * self.shape_path.transpose() * rates.rank_one;
        for (step, weight) in steps.iter().zip(&rates.weights) {
            self.shape += step * step.transpose() * (rates.rank_mu * weight);
        }
        self.sigma *= ((length - 1.0) * rates.sigma_path / rates.damping).exp();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn population(cost: &(impl Fn(&[f64]) -> f64 + Sync), n: usize, random: &mut fastrand::Rng) -> Vec<Member> {
        let points = (0..10 * n).map(|_| (0..n).map(|_| random.f64()).collect()).collect();
        let mut members = evaluated(cost, points);
        sort(&mut members);
        members
    }

    /// An ellipsoid a thousand times as long as wide, turned, and a bent valley (of three dimensions: from four on it
    /// has another minimum).
    #[test]
    fn long_turned_and_bent_valleys_are_followed_to_their_bottom() {
        let turned = |x: &[f64]| -> f64 {
            let z: Vec<f64> = x.iter().map(|v| v - 0.3).collect();
            let sum: f64 = z.iter().sum();
            1e6 * sum * sum + z.iter().enumerate().map(|(i, z)| 10f64.powi(i as i32) * z * z).sum::<f64>()
        };
        let bent = |x: &[f64]| -> f64 {
            let z: Vec<f64> = x.iter().map(|v| 4.0 * v - 2.0).collect();
            z.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
        };
        for seed in 1..4 {
            let mut random = fastrand::Rng::with_seed(seed);
            let first = population(&turned, 6, &mut random);
            let found = minimise(&turned, &first, 6000, &mut random, &|_, _| {});
            assert!(found.cost < 1e-12, "{:?}: {}", found.x, found.cost);
            let first = population(&bent, 3, &mut random);
            let found = minimise(&bent, &first, 8000, &mut random, &|_, _| {});
            assert!(found.cost < 1e-9, "{:?}: {}", found.x, found.cost);
        }
    }

    /// The least of a slope lies in a corner of the cube.
    #[test]
    fn an_optimum_at_bounds_is_reached() {
        let slope = |x: &[f64]| 1.0 + x[0] - 0.5 * x[1] + (x[2] - 0.5).powi(2);
        let mut random = fastrand::Rng::with_seed(7);
        let first = population(&slope, 3, &mut random);
        let found = minimise(&slope, &first, 3000, &mut random, &|_, _| {});
        assert!(found.cost - 0.5 < 1e-9, "{:?}: {}", found.x, found.cost);
    }
}
