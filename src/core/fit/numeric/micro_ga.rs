//! The micro-genetic algorithm: five members, no mutation, and a restart around the best whenever they have become
//! alike.
//!
//! Krishnakumar (1989, Proc. SPIE 1196, 289), with the uniform crossover and tournaments of Carroll (1996, AIAA J.
//! 34, 338), strings in Gray code (Caruana & Schaffer 1988), and a window around the best that narrows as the budget is
//! spent (successive zooming, Kwon et al. 2003, Comput. Struct. 81, 1715): without it, random members of the whole box
//! hardly ever improve on a good one.

use crate::fit::numeric::thresholds::{MICRO_ALIKE_SHARE, MICRO_BITS, MICRO_LAST_WIDTH, MICRO_MEMBERS};
use rayon::prelude::*;

/// A point of the window as a binary string.
type Genes = Vec<bool>;

/// Where strings lie in the unit cube: least corner and width.
struct Window {
    corner: Vec<f64>,
    width: f64,
}

impl Window {
    fn around(centre: &[f64], width: f64) -> Self {
        Window { corner: centre.iter().map(|c| (c - 0.5 * width).clamp(0.0, 1.0 - width)).collect(), width }
    }

    fn encoded(&self, x: &[f64]) -> Genes {
        let whole = ((1u32 << MICRO_BITS) - 1) as f64;
        let number = |(v, c): (&f64, &f64)| (((v - c) / self.width).clamp(0.0, 1.0) * whole).round() as u32;
        let gray = |n: u32| n ^ (n >> 1);
        x.iter()
            .zip(&self.corner)
            .map(number)
            .flat_map(|n| (0..MICRO_BITS).map(move |bit| gray(n) >> bit & 1 == 1))
            .collect()
    }

    fn decoded(&self, genes: &Genes) -> Vec<f64> {
        let whole = ((1u32 << MICRO_BITS) - 1) as f64;
        let number = |bits: &[bool]| {
            let step = |(n, last): (u32, bool), &bit: &bool| (n << 1 | u32::from(bit ^ last), bit ^ last);
            bits.iter().rev().fold((0u32, false), step).0
        };
        genes.chunks(MICRO_BITS).zip(&self.corner).map(|(b, c)| c + self.width * f64::from(number(b)) / whole).collect()
    }

    fn evaluated(&self, cost: &(impl Fn(&[f64]) -> f64 + Sync), members: Vec<Genes>) -> Vec<Member> {
        members.into_par_iter().map(|genes| Member { cost: cost(&self.decoded(&genes)), genes }).collect()
    }
}

struct Member {
    genes: Genes,
    cost: f64,
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
    let (mut best, mut least) = (start.to_vec(), cost(start));
    let mut spent = 1;
    while spent + MICRO_MEMBERS <= budget {
        let window = Window::around(&best, MICRO_LAST_WIDTH.powf(spent as f64 / budget as f64));
        // The best itself, as near as a string of this window comes to it, and random members.
        let mut first = vec![window.encoded(&best)];
        first.extend((1..MICRO_MEMBERS).map(|_| first_bits(start.len(), &mut random)));
        let mut members = window.evaluated(cost, first);
        spent += MICRO_MEMBERS;
        loop {
            let elite = best_of(&members);
            on_generation(spent, members[elite].cost.min(least));
            if alike(&members) || spent + MICRO_MEMBERS > budget + 1 {
                break;
            }
            let children = (1..MICRO_MEMBERS).map(|_| {
                let (mother, father) = (tournament(&members, &mut random), tournament(&members, &mut random));
                let (mother, father) = (&members[mother].genes, &members[father].genes);
                mother.iter().zip(father).map(|(m, f)| if random.bool() { *m } else { *f }).collect()
            });
            let children = window.evaluated(cost, children.collect());
            spent += MICRO_MEMBERS - 1;
            let elite = members.swap_remove(elite);
            members = std::iter::once(elite).chain(children).collect();
        }
        let elite = &members[best_of(&members)];
        if elite.cost < least {
            (best, least) = (window.decoded(&elite.genes), elite.cost);
        }
    }
    (best, least)
}

fn first_bits(dimensions: usize, random: &mut fastrand::Rng) -> Genes {
    (0..dimensions * MICRO_BITS).map(|_| random.bool()).collect()
}

fn best_of(members: &[Member]) -> usize {
    (0..members.len()).min_by(|&a, &b| members[a].cost.total_cmp(&members[b].cost)).unwrap_or(0)
}

/// The better of two, drawn at random.
fn tournament(members: &[Member], random: &mut fastrand::Rng) -> usize {
    let (a, b) = (random.usize(..members.len()), random.usize(..members.len()));
    if members[a].cost <= members[b].cost { a } else { b }
}

fn alike(members: &[Member]) -> bool {
    let best = &members[best_of(members)].genes;
    let differing: usize = members.iter().map(|m| m.genes.iter().zip(best).filter(|(a, b)| a != b).count()).sum();
    (differing as f64) < MICRO_ALIKE_SHARE * (best.len() * (members.len() - 1)) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::test_problem::keeps_to_its_budget;

    #[test]
    fn strings_and_points_belong_together_and_neighbours_differ_in_one_bit() {
        let window = Window::around(&[0.1, 0.5, 0.9, 0.5], 0.4);
        let x = [0.0, 0.31, 0.95, 0.7];
        assert!(window.decoded(&window.encoded(&x)).iter().zip(&x).all(|(a, b)| (a - b).abs() < 3e-4));
        let one = Window::around(&[0.5], 1.0);
        let step = 1.0 / ((1u32 << MICRO_BITS) - 1) as f64;
        for i in 0..(1u32 << MICRO_BITS) - 1 {
            let (a, b) = (one.encoded(&[f64::from(i) * step]), one.encoded(&[f64::from(i + 1) * step]));
            assert_eq!(a.iter().zip(&b).filter(|(a, b)| a != b).count(), 1);
        }
    }

    #[test]
    fn a_bowl_with_ripples_is_found_and_a_seed_repeats_it() {
        let bowl = |x: &[f64]| -> f64 {
            x.iter().map(|v| 10.0 * (v - 0.3).powi(2) + 0.1 * (1.0 - (30.0 * (v - 0.3)).cos())).sum()
        };
        let found = |seed| minimise(&bowl, &[0.9; 5], 5000, seed, &|_, _| {});
        for seed in 1..5 {
            assert!(found(seed).1 < 0.01, "{:?}", found(seed));
        }
        assert_eq!(found(1), found(1));
    }

    #[test]
    fn a_budget_is_never_exceeded() {
        keeps_to_its_budget(|cost, start, budget| drop(minimise(&cost, start, budget, 1, &|_, _| {})));
    }
}
