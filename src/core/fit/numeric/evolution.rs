//! Differential evolution over the unit cube, with parameters that adapt to what succeeds and a population that
//! shrinks, L-SHADE; and from half of the budget on, CMA-ES in the valley that was found (see
//! [`crate::fit::numeric::cma`]).
//!
//! Storn & Price (1997, J. Glob. Optim. 11, 341); mutation `current-to-pbest/1` with an archive after Zhang & Sanderson
//! (2009, IEEE Trans. Evol. Comput. 13, 945); memory of successful `F` and `CR`, and linear shrinking, after Tanabe &
//! Fukunaga (2014, IEEE CEC, 1658). The two in one search: Mohamed, Hadi, Fattouh & Jambi (2017, IEEE CEC, 145).

use crate::fit::numeric::cma;
use crate::fit::numeric::population::{Member, evaluated, normal, sort};
use crate::fit::numeric::thresholds::{
    ARCHIVE_SIZE, BEST_SHARE, LEAST_MEMBERS, MEMBERS_PER_VARIABLE, MEMORY_SIZE, SPREAD_TOLERANCE,
};

/// A child and the settings that made it.
struct Trial {
    x: Vec<f64>,
    f: f64,
    cr: f64,
}

/// Means of `F` and `CR` that made better children lately; a `CR` of none has died out.
struct Memory {
    f: [f64; MEMORY_SIZE],
    cr: [Option<f64>; MEMORY_SIZE],
    next: usize,
}

/// Least `cost` over the unit cube of `start.len()` dimensions, seen within `budget` evaluations, and where; `start` is
/// among the first members. `on_generation` receives the evaluations so far and the least cost of each generation.
pub(crate) fn minimise(
    cost: &(impl Fn(&[f64]) -> f64 + Sync),
    start: &[f64],
    budget: usize,
    seed: u64,
    on_generation: &dyn Fn(usize, f64),
) -> (Vec<f64>, f64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let dimensions = start.len();
    let most = (MEMBERS_PER_VARIABLE * dimensions).clamp(LEAST_MEMBERS, (budget / 4).max(LEAST_MEMBERS));
    let mut first = latin_hypercube(most, dimensions, &mut random);
    first[0] = start.to_vec();
    first.truncate(budget.max(1));
    let mut members = evaluated(cost, first);
    let mut spent = members.len();
    let mut archive: Vec<Vec<f64>> = Vec::new();
    let mut memory = Memory { f: [0.5; MEMORY_SIZE], cr: [Some(0.5); MEMORY_SIZE], next: 0 };
    sort(&mut members);
    while members.len() >= LEAST_MEMBERS && spent < budget / 2 {
        let (least, worst) = (members[0].cost, members[members.len() - 1].cost);
        on_generation(spent, least);
        if worst - least <= SPREAD_TOLERANCE * least {
            break;
        }
        let trials: Vec<Trial> = (0..members.len().min(budget - spent))
            .map(|i| trial(i, &members, &archive, &memory, &mut random))
            .collect();
        let children = evaluated(cost, trials.iter().map(|t| t.x.clone()).collect());
        spent += children.len();
        let mut successes = Vec::new();
        for (i, (trial, child)) in trials.into_iter().zip(children).enumerate() {
            let fall = members[i].cost - child.cost;
            if fall > 0.0 {
                successes.push((fall, trial.f, trial.cr));
                archive.push(std::mem::replace(&mut members[i], child).x);
            } else if fall == 0.0 {
                members[i] = child;
            }
        }
        memory.learn(&successes);
        sort(&mut members);
        let left = 1.0 - spent as f64 / budget as f64;
        let wanted = LEAST_MEMBERS + ((most - LEAST_MEMBERS) as f64 * left).round() as usize;
        members.truncate(wanted.max(LEAST_MEMBERS));
        while archive.len() > (ARCHIVE_SIZE * members.len() as f64) as usize {
            archive.swap_remove(random.usize(..archive.len()));
        }
    }
    let best = cma::minimise(cost, &members, budget.saturating_sub(spent), &mut random, &|more, least| {
        on_generation(spent + more, least)
    });
    (best.x, best.cost)
}

/// As many points as strata of each variable, one in each.
fn latin_hypercube(n: usize, dimensions: usize, random: &mut fastrand::Rng) -> Vec<Vec<f64>> {
    let mut points = vec![vec![0.0; dimensions]; n];
    for j in 0..dimensions {
        let mut strata: Vec<usize> = (0..n).collect();
        random.shuffle(&mut strata);
        for (point, stratum) in points.iter_mut().zip(strata) {
            point[j] = (stratum as f64 + random.f64()) / n as f64;
        }
    }
    points
}

/// A child of member `i`; members are sorted, the best first.
fn trial(i: usize, members: &[Member], archive: &[Vec<f64>], memory: &Memory, random: &mut fastrand::Rng) -> Trial {
    let (f, cr) = memory.draw(random);
    let n = members.len();
    let best = &members[random.usize(..((BEST_SHARE * n as f64) as usize).clamp(2, n))].x;
    let other_than = |taken: &[usize], most: usize, random: &mut fastrand::Rng| {
        loop {
            let one = random.usize(..most);
            if !taken.contains(&one) {
                return one;
            }
        }
    };
    let a = other_than(&[i], n, random);
    let b = other_than(&[i, a], n + archive.len(), random);
    let (x, a) = (&members[i].x, &members[a].x);
    let b = if b < n { &members[b].x } else { &archive[b - n] };
    let always = random.usize(..x.len());
    let child = (0..x.len()).map(|j| {
        if j != always && random.f64() >= cr {
            return x[j];
        }
        let v = x[j] + f * (best[j] - x[j]) + f * (a[j] - b[j]);
        // Beyond a bound: half way there.
        if v < 0.0 {
            0.5 * x[j]
        } else if v > 1.0 {
            0.5 * (1.0 + x[j])
        } else {
            v
        }
    });
    Trial { x: child.collect(), f, cr }
}

impl Memory {
    fn draw(&self, random: &mut fastrand::Rng) -> (f64, f64) {
        let place = random.usize(..MEMORY_SIZE);
        let cr = self.cr[place].map_or(0.0, |mean| (mean + 0.1 * normal(random)).clamp(0.0, 1.0));
        loop {
            let f = self.f[place] + 0.1 * (std::f64::consts::PI * (random.f64() - 0.5)).tan();
            if f > 0.0 {
                return (f.min(1.0), cr);
            }
        }
    }

    /// Learns from the settings that made children better than their parents: fall of the cost, `F`, `CR`.
    fn learn(&mut self, successes: &[(f64, f64, f64)]) {
        // The fall from a parent that could not be simulated is only known to be large.
        let weight = |fall: f64| fall.min(1e100);
        // Lehmer means, each weighed by the fall.
        let lehmer = |of: fn(&(f64, f64, f64)) -> f64| {
            let sum = |power: i32| successes.iter().map(|s| weight(s.0) * of(s).powi(power)).sum::<f64>();
            sum(2) / sum(1)
        };
        if successes.is_empty() {
            return;
        }
        self.f[self.next] = lehmer(|s| s.1);
        let gone = self.cr[self.next].is_none() || successes.iter().all(|s| s.2 == 0.0);
        self.cr[self.next] = if gone { None } else { Some(lehmer(|s| s.2)) };
        self.next = (self.next + 1) % MEMORY_SIZE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::test_problem::keeps_to_its_budget;

    /// Rastrigin's function in five dimensions, least 0 at 0.4 each, about 10⁵ other minima; and a narrow bent valley.
    #[test]
    fn ripples_and_a_bent_valley_are_solved_and_a_seed_repeats_it() {
        let rastrigin = |x: &[f64]| -> f64 {
            let z = x.iter().map(|v| 10.24 * (v - 0.4));
            z.map(|z| z * z + 10.0 * (1.0 - (std::f64::consts::TAU * z).cos())).sum()
        };
        let rosenbrock = |x: &[f64]| -> f64 {
            let z: Vec<f64> = x.iter().map(|v| 4.0 * v - 2.0).collect();
            z.windows(2).map(|w| 100.0 * (w[1] - w[0] * w[0]).powi(2) + (1.0 - w[0]).powi(2)).sum()
        };
        for seed in 1..4 {
            let (x, cost) = minimise(&rastrigin, &[0.9; 5], 20_000, seed, &|_, _| {});
            assert!(cost < 1e-6, "{x:?}: {cost}");
            let (x, cost) = minimise(&rosenbrock, &[0.1; 5], 20_000, seed, &|_, _| {});
            assert!(cost < 1e-4, "{x:?}: {cost}");
        }
        let found = |seed| minimise(&rastrigin, &[0.9; 5], 1000, seed, &|_, _| {});
        assert_eq!(found(1), found(1));
        assert_ne!(found(1), found(2));
    }

    #[test]
    fn a_budget_is_never_exceeded() {
        keeps_to_its_budget(|cost, start, budget| drop(minimise(&cost, start, budget, 1, &|_, _| {})));
    }
}
