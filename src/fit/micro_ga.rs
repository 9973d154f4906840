//! The micro-genetic algorithm: five members, no mutation, and a fresh start around the best whenever they have become alike.
//!
//! Krishnakumar (1989, Proc. SPIE 1196, 289), with the uniform crossover of binary strings of Carroll (1996, AIAA J. 34, 338).

use rayon::prelude::*;

const MEMBERS: usize = 5;
/// Bits a variable: a millionth of its range.
const BITS: usize = 20;
/// Share of bits in which the members differ from the best below which they are alike.
const ALIKE: f64 = 0.05;

/// A point of the unit cube as a binary string.
type Genes = Vec<bool>;

/// Least `cost` over the unit cube of `dimensions`, seen within `budget` evaluations, and where; `start` is among the first members.
/// `heard` is told evaluations and cost of each generation.
pub(super) fn minimise(
    cost: &(impl Fn(&[f64]) -> f64 + Sync),
    start: &[f64],
    budget: usize,
    seed: u64,
    heard: &dyn Fn(usize, f64),
) -> (Vec<f64>, f64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut best = encoded(start);
    let mut least = cost(&decoded(&best));
    let mut spent = 1;
    while spent < budget {
        let mut members: Vec<(Genes, f64)> = vec![(best.clone(), least)];
        let strangers = (1..MEMBERS).map(|_| best.iter().map(|_| random.bool()).collect()).collect();
        members.extend(evaluated(cost, strangers));
        spent += MEMBERS - 1;
        while spent < budget && !alike(&members) {
            let children = (1..MEMBERS).map(|_| {
                let (mother, father) = (tournament(&members, &mut random), tournament(&members, &mut random));
                let (mother, father) = (&members[mother].0, &members[father].0);
                mother.iter().zip(father).map(|(m, f)| if random.bool() { *m } else { *f }).collect()
            });
            let children = evaluated(cost, children.collect());
            spent += MEMBERS - 1;
            let elite = members.swap_remove(best_of(&members));
            members = std::iter::once(elite).chain(children).collect();
            heard(spent, members[best_of(&members)].1);
        }
        (best, least) = members.swap_remove(best_of(&members));
    }
    (decoded(&best), least)
}

fn evaluated(cost: &(impl Fn(&[f64]) -> f64 + Sync), members: Vec<Genes>) -> Vec<(Genes, f64)> {
    members
        .into_par_iter()
        .map(|genes| {
            let cost = cost(&decoded(&genes));
            (genes, cost)
        })
        .collect()
}

fn best_of(members: &[(Genes, f64)]) -> usize {
    (0..members.len()).min_by(|&a, &b| members[a].1.total_cmp(&members[b].1)).unwrap_or(0)
}

/// The better of two, drawn at random.
fn tournament(members: &[(Genes, f64)], random: &mut fastrand::Rng) -> usize {
    let (a, b) = (random.usize(..members.len()), random.usize(..members.len()));
    if members[a].1 <= members[b].1 { a } else { b }
}

fn alike(members: &[(Genes, f64)]) -> bool {
    let best = &members[best_of(members)].0;
    let differing: usize =
        members.iter().map(|(genes, _)| genes.iter().zip(best).filter(|(a, b)| a != b).count()).sum();
    (differing as f64) < ALIKE * (best.len() * (members.len() - 1)) as f64
}

fn encoded(x: &[f64]) -> Genes {
    let whole = ((1u32 << BITS) - 1) as f64;
    x.iter()
        .flat_map(|v| {
            let number = (v.clamp(0.0, 1.0) * whole).round() as u32;
            (0..BITS).map(move |bit| number >> bit & 1 == 1)
        })
        .collect()
}

fn decoded(genes: &Genes) -> Vec<f64> {
    let whole = ((1u32 << BITS) - 1) as f64;
    let number = |bits: &[bool]| bits.iter().rev().fold(0u32, |n, &bit| n << 1 | u32::from(bit));
    genes.chunks(BITS).map(|bits| f64::from(number(bits)) / whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_and_points_belong_together() {
        let x = [0.0, 1.0, 0.25, 0.7123];
        assert!(decoded(&encoded(&x)).iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn a_bowl_with_ripples_is_found_and_a_seed_repeats_it() {
        let bowl = |x: &[f64]| -> f64 {
            x.iter().map(|v| 10.0 * (v - 0.3).powi(2) + 0.1 * (1.0 - (30.0 * (v - 0.3)).cos())).sum()
        };
        let found = |seed| minimise(&bowl, &[0.9, 0.9, 0.9], 5000, seed, &|_, _| {});
        assert!(found(1).1 < 0.05, "{:?}", found(1));
        assert_eq!(found(1), found(1));
        assert!(found(1).1 <= bowl(&decoded(&encoded(&[0.9, 0.9, 0.9]))));
    }
}
