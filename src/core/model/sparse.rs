//! Symmetric positive definite systems of a graph: `A x = b` with one equation a node and one entry an edge, as the
//! steady flow of a network has them.
//!
//! `A = L D Lᵀ` in an order of least degree, which leaves little fill in a network of pipes (George & Liu 1989, SIAM
//! Rev. 31(1):1-19); the factors row by row along the elimination tree (Davis 2005, ACM Trans. Math. Softw.
//! 31(4):587-591, LDL).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// The order and the pattern of the factors; the numbers may change.
pub(crate) struct Symmetric {
    /// Place of each node in the order of elimination.
    place: Vec<usize>,
    /// For each place: earlier places that share an entry with it, and the entry's index.
    rows: Vec<Vec<(usize, usize)>>,
    /// Index of the entry of each edge.
    entry: Vec<usize>,
    entries: usize,
    parent: Vec<usize>,
    /// Where each column of `L` begins.
    columns: Vec<usize>,
}

/// No node.
const NONE: usize = usize::MAX;

impl Symmetric {
    /// The pattern of `nodes` with edges between them; edges between the same two add up.
    pub(crate) fn new(nodes: usize, edges: &[(usize, usize)]) -> Symmetric {
        let mut entries = BTreeMap::new();
        let mut near = vec![Vec::new(); nodes];
        let entry = edges.iter().map(|&(a, b)| {
            let next = entries.len();
            *entries.entry((a.min(b), a.max(b))).or_insert_with(|| {
                near[a].push(b);
                near[b].push(a);
                next
            })
        });
        let entry: Vec<usize> = entry.collect();
        let place = least_degree(near);
        let mut rows = vec![Vec::new(); nodes];
        for (&(a, b), &i) in &entries {
            let (a, b) = (place[a], place[b]);
            rows[a.max(b)].push((a.min(b), i));
        }
        let mut symmetric =
            Symmetric { place, rows, entry, entries: entries.len(), parent: vec![NONE; nodes], columns: Vec::new() };
        let (mut seen, mut lengths) = (vec![NONE; nodes], vec![0; nodes]);
        for k in 0..nodes {
            seen[k] = k;
            for &(mut i, _) in &symmetric.rows[k] {
                while seen[i] != k {
                    if symmetric.parent[i] == NONE {
                        symmetric.parent[i] = k;
                    }
                    lengths[i] += 1;
                    seen[i] = k;
                    i = symmetric.parent[i];
                }
            }
        }
        symmetric.columns = std::iter::once(0)
            .chain(lengths.iter().scan(0, |sum, length| {
                *sum += length;
                Some(*sum)
            }))
            .collect();
        symmetric
    }

    /// The factors of numbers: `diagonal` by node, `off` by edge.
    pub(crate) fn factors(&self, diagonal: &[f64], off: &[f64]) -> Factors<'_> {
        let n = self.place.len();
        let mut values = vec![0.0; self.entries];
        self.entry.iter().zip(off).for_each(|(&i, v)| values[i] += v);
        let filled = self.columns[n];
        let (mut index, mut lower, mut used) = (vec![0usize; filled], vec![0.0; filled], vec![0usize; n]);
        let mut d = vec![0.0; n];
        self.place.iter().zip(diagonal).for_each(|(&k, &dk)| d[k] = dk);
        let (mut y, mut seen) = (vec![0.0; n], vec![NONE; n]);
        let (mut pattern, mut path) = (Vec::<usize>::new(), Vec::<usize>::new());
        for k in 0..n {
            seen[k] = k;
            pattern.clear();
            for &(mut i, at) in &self.rows[k] {
                y[i] += values[at];
                path.clear();
                while seen[i] != k {
                    path.push(i);
                    seen[i] = k;
                    i = self.parent[i];
                }
                pattern.extend(path.iter().rev());
            }
            for &i in pattern.iter().rev() {
                let yi = std::mem::take(&mut y[i]);
                let (begin, end) = (self.columns[i], self.columns[i] + used[i]);
                for p in begin..end {
                    y[index[p]] -= lower[p] * yi;
                }
                let l = yi / d[i];
                d[k] -= l * yi;
                (index[end], lower[end]) = (k, l);
                used[i] += 1;
            }
        }
        Factors { of: self, index, lower, d }
    }
}

/// `L` and `D`.
pub(crate) struct Factors<'a> {
    of: &'a Symmetric,
    /// The row of each entry of `L`, column after column.
    index: Vec<usize>,
    lower: Vec<f64>,
    d: Vec<f64>,
}

impl Factors<'_> {
    /// Solves for `x` in place of `b`.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        let Factors { of: Symmetric { place, columns, .. }, index, lower, d } = self;
        let n = place.len();
        let mut x = vec![0.0; n];
        place.iter().zip(b.iter()).for_each(|(&k, &bk)| x[k] = bk);
        for i in 0..n {
            for p in columns[i]..columns[i + 1] {
                x[index[p]] -= lower[p] * x[i];
            }
        }
        for i in (0..n).rev() {
            x[i] /= d[i];
            for p in columns[i]..columns[i + 1] {
                x[i] -= lower[p] * x[index[p]];
            }
        }
        place.iter().zip(b).for_each(|(&k, b)| *b = x[k]);
    }
}

/// The place of each node in an order in which the one with the fewest neighbours goes next.
fn least_degree(mut near: Vec<Vec<usize>>) -> Vec<usize> {
    near.iter_mut().for_each(|own| own.sort_unstable());
    let mut place = vec![NONE; near.len()];
    let mut open: BinaryHeap<Reverse<(usize, usize)>> =
        near.iter().enumerate().map(|(node, own)| Reverse((own.len(), node))).collect();
    let mut next = 0;
    while let Some(Reverse((degree, node))) = open.pop() {
        if place[node] != NONE || degree != near[node].len() {
            continue;
        }
        place[node] = next;
        next += 1;
        let own = std::mem::take(&mut near[node]);
        for &other in &own {
            let both = merged(&near[other], &own, [node, other]);
            open.push(Reverse((both.len(), other)));
            near[other] = both;
        }
    }
    place
}

/// Two ascending lists as one, without two of their numbers.
fn merged(a: &[usize], b: &[usize], without: [usize; 2]) -> Vec<usize> {
    let mut both = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    while i < a.len() || j < b.len() {
        let (x, y) = (a.get(i).copied().unwrap_or(NONE), b.get(j).copied().unwrap_or(NONE));
        let least = x.min(y);
        (i, j) = (i + usize::from(x == least), j + usize::from(y == least));
        if least != without[0] && least != without[1] {
            both.push(least);
        }
    }
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_of_pipes_is_solved_to_rounding() {
        let (w, h) = (17, 11);
        let at = |x: usize, y: usize| y * w + x;
        let mut edges = Vec::new();
        for y in 0..h {
            for x in 0..w {
                edges.extend((x + 1 < w).then_some((at(x, y), at(x + 1, y))));
                edges.extend((y + 1 < h).then_some((at(x, y + 1), at(x, y))));
            }
        }
        edges.push(edges[5]); // two pipes side by side
        let weight: Vec<f64> = (0..edges.len()).map(|i| 0.1 + ((i * 37) % 19) as f64).collect();
        let mut diagonal = vec![0.01; w * h];
        for (&(a, b), g) in edges.iter().zip(&weight) {
            diagonal[a] += g;
            diagonal[b] += g;
        }
        let exact: Vec<f64> = (0..w * h).map(|i| ((i * 13) % 29) as f64 - 9.0).collect();
        let mut b: Vec<f64> = diagonal.iter().zip(&exact).map(|(d, x)| d * x).collect();
        for (&(i, j), g) in edges.iter().zip(&weight) {
            b[i] -= g * exact[j];
            b[j] -= g * exact[i];
        }
        let off: Vec<f64> = weight.iter().map(|g| -g).collect();
        let system = Symmetric::new(w * h, &edges);
        system.factors(&diagonal, &off).solve(&mut b);
        let worst = b.iter().zip(&exact).map(|(x, e)| (x - e).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-10, "{worst}");
        // An order as the nodes stand would fill a band of the grid's width.
        assert!(system.columns[w * h] < w * h * 11, "{}", system.columns[w * h]);
    }
}
