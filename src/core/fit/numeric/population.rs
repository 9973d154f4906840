//! Populations of trial points, which the global searches share.

use rayon::prelude::*;

/// A point of the unit cube and its cost.
#[derive(Clone)]
pub(crate) struct Member {
    pub x: Vec<f64>,
    pub cost: f64,
}

/// Puts the best first.
pub(crate) fn sort(members: &mut [Member]) {
    members.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}

/// The points with their costs, evaluated in parallel.
pub(crate) fn evaluated(cost: &(impl Fn(&[f64]) -> f64 + Sync), points: Vec<Vec<f64>>) -> Vec<Member> {
    points.into_par_iter().map(|x| Member { cost: cost(&x), x }).collect()
}

/// A normal random number of mean 0 and variance 1 (Box & Muller 1958).
pub(crate) fn normal(random: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos()
}
